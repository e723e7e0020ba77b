"""A robot written from the description of the datagrams alone, without the package, that misbehaves as it is told.

    python foreign_robot.py '{"how": "repeats", "raw": [0.0, 0.0], "hertz": 200, "cycles": 300}'

It prints its port, waits for a loop's greeting, sends a reading a cycle, misbehaves from cycle `AT` on, and prints what
it was commanded, as JSON: [[count, first joint, second joint], ...], when the loop has said good-bye or is unheard.
"""

import json
import socket
import struct
import sys
import time

AT = 60
UNHEARD_SECONDS = 5.0
READING, COMMAND = struct.Struct("<4sQq3d"), struct.Struct("<4sQ3d")
GOOD_BYE = 2**64 - 1


def reading(count, clock, raw, mark=b"HCRD"):
    return READING.pack(mark, count, clock, raw[0], raw[1], 0.0)


def datagrams(how, count, clock, raw):
    """What is sent in a cycle, oldest first: each is a packet, and whether another program sends it."""
    right = [(reading(count, clock, raw), False)]
    if count < AT:
        return right
    odd = count % 10 == 0
    if how == "silent":
        return []
    if how == "jumps":
        return [(reading(count, clock, [raw[0] + 8000.0, raw[1]]), False)]
    if how == "leaves":
        return [(reading(count, clock, [raw[0] + 150_000.0, raw[1]]), False)]
    if how == "nonsense":
        return [(reading(count, clock, [float("nan"), raw[1]]), False)]
    extra = {
        "repeats": (reading(count, clock, raw), False),
        "is late": (reading(count - 5, clock, raw), False),
        "strangers": (reading(count + 1, clock, [9e9, 9e9]), True),
        "lengths": (reading(count, clock, raw)[:-8], False),
        "versions": (reading(count, clock, raw, b"HCR2"), False),
        "far counts": (reading(2**64 - 192, clock, raw), False),
    }.get(how)
    # Before and after the right one: the loop may read both at once or each by itself.
    return [extra, *right, extra] if odd and extra else right


def main():
    order = json.loads(sys.argv[1])
    own, other = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    own.bind(("127.0.0.1", 0))
    print(own.getsockname()[1], flush=True)
    packet, loop = own.recvfrom(64)
    assert COMMAND.unpack(packet)[:2] == (b"HCWR", 0)
    own.setblocking(False)
    commands, heard = [], time.monotonic()
    start, count = time.monotonic(), 0
    while time.monotonic() - heard < UNHEARD_SECONDS:
        count += 1
        for packet, foreign in datagrams(order["how"], count, round(count * 1e9 / order["hertz"]), order["raw"]):
            (other if foreign else own).sendto(packet, loop)
        time.sleep(max(0.0, start + count / order["hertz"] - time.monotonic()))
        try:
            while True:
                mark, answered, *torques, _ = COMMAND.unpack(own.recv(64))
                assert mark == b"HCWR"
                heard = time.monotonic()
                commands.append([answered, *torques])
        except BlockingIOError:
            pass
        if commands and commands[-1][0] == GOOD_BYE:
            break
    print(json.dumps(commands))


if __name__ == "__main__":
    main()
