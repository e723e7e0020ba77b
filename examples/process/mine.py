"""A penalty renderer for the plane that hapticeval asks in JSON lines: hapticeval run -r 'cmd:python3 mine.py'."""

import json
import math
import sys


def step(hip: list, scene: dict) -> tuple:
    """Return IHIP, force and contact: a hand inside is pushed to the nearest point of the edges."""
    best, nearest, turn = math.inf, hip, 0.0
    for first, last in scene["cells"]:
        (ax, ay), (bx, by) = scene["vertices"][first], scene["vertices"][last]
        ux, uy, px, py = bx - ax, by - ay, hip[0] - ax, hip[1] - ay
        share = min(max((px * ux + py * uy) / (ux * ux + uy * uy), 0.0), 1.0)
        foot = [ax + share * ux, ay + share * uy]
        if math.dist(foot, hip) < best:
            best, nearest = math.dist(foot, hip), foot
        qx, qy = bx - hip[0], by - hip[1]
        turn += math.atan2(px * qy - py * qx, -px * qx - py * qy)  # seen from the hand, from one end to the other
    if abs(turn) < 3.0:
        return hip, [0.0, 0.0], False
    return nearest, [scene["stiffness"] * (s - h) for s, h in zip(nearest, hip, strict=True)], True


scene: dict = {}
for line in sys.stdin:
    message = json.loads(line)
    call, answer = message["call"], {"id": message["id"]}
    if call == "hello":
        answer.update(version=1, name="penalty", supports=["plane"], spring=True)
    elif call == "scene":
        scene = message
    elif None in message.get("hip", []):  # null: there is no number
        answer["refuse"] = "a hand without a position"
    elif call == "step":
        answer["ihip"], answer["force"], answer["contact"] = step(message["hip"], scene)
    elif call == "bye":
        break
    print(json.dumps(answer), flush=True)
