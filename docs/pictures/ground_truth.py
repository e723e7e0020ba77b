"""Draw the pictures of docs/ground-truth.md into `pictures`: runs of `ideal` itself, with their closed forms dashed."""

from pathlib import Path

import numpy as np

import hapticeval
from hapticeval.reports.canvas import INK, MM, QUIET, THEME, figure
from hapticeval.suite.reading import load_suite

PICTURES = Path("pictures")
PICTURES.mkdir(exist_ok=True)
MASS, DT, WEIGHT = 0.1, 1e-3, 1.0
"""The tool (kg), the sampling time (s), and the force (N) that presses it down where one does."""
GRAVITY = WEIGHT / MASS
TOOL, FORCE, OTHER, MARK = THEME["hip"], THEME["ihip"], THEME["one"], THEME["mark"]


def run(model, position, velocity, times, forces, duration, **scene):
    """Let the ideal contact carry a tool under a push that runs straight between `times`."""
    tool = hapticeval.resolve("ideal")(hapticeval.Scene(model=model, mass=MASS, **scene))
    return tool.simulate(hapticeval.Experiment(duration, position, velocity, times, forces), DT)


def event_of(recording, kind):
    """Return the first event of a kind."""
    return next(event for event in recording.meta["events"] if event["kind"] == kind)


def save(made, name):
    """Write a figure, the same bytes each time."""
    made.savefig(PICTURES / f"{name}.svg", format="svg", metadata={"Date": None})


def bare_axes_in_space(made, place):
    """Return axes in space without a frame, in one scale."""
    axes = made.add_subplot(place, projection="3d")
    axes.set_axis_off()
    axes.set_proj_type("ortho")
    return axes


def draw_faces(axes, quads):
    """Draw flat faces (n, 4, 3), m, as panes."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    axes.add_collection3d(Poly3DCollection(MM * np.array(quads), facecolor=(0.93, 0.94, 0.95, 0.6), edgecolor=QUIET))


# A slide over the edge of a cube: 0.2 m/s towards it, 0.08 m/s along it.
top, ahead, aside = 0.05, 0.2, 0.08
recording = run(
    hapticeval.make_model("cube"), [-0.03, -0.035, top], [ahead, aside, 0.0], [0.0], [[0.0, 0.0, -WEIGHT]], 0.53
)
leave = event_of(recording, "leave")
flown = np.linspace(0.0, recording.time[-1] - leave["time"], 100)
parabola = leave["position"] + np.column_stack([ahead * flown, aside * flown, -0.5 * GRAVITY * flown**2])
slides = recording.time <= leave["time"]
with figure(8.0, 3.4, layout="constrained") as made:
    space, height, force = bare_axes_in_space(made, 121), made.add_subplot(222), made.add_subplot(224)
    h = top
    draw_faces(
        space,
        [
            [[-h, -h, h], [h, -h, h], [h, h, h], [-h, h, h]],
            [[h, -h, h], [h, h, h], [h, h, -h], [h, -h, -h]],
            [[-h, -h, h], [h, -h, h], [h, -h, -h], [-h, -h, -h]],
        ],
    )
    space.plot(*(MM * recording.hip[slides].T), color=TOOL, linewidth=1.8, zorder=10)
    space.plot(*(MM * recording.hip[~slides].T), color=FORCE, linewidth=1.8, zorder=10)
    space.plot(*(MM * parabola.T), color=INK, linewidth=0.9, linestyle="--", zorder=11)
    space.scatter(*(MM * np.array(leave["position"])), color=MARK, s=28, zorder=12, depthshade=False)
    space.set(xlim=(-50, 90), ylim=(-70, 70), zlim=(-80, 60))
    space.set_box_aspect((1, 1, 1), zoom=1.2)
    space.view_init(elev=22.0, azim=-62.0)
    height.plot(recording.time, MM * recording.hip[:, 2], color=FORCE, label="run")
    height.plot(leave["time"] + flown, MM * parabola[:, 2], "--", color=INK, linewidth=0.9, label="parabola")
    height.set(ylabel="height (mm)")
    height.legend(fontsize=8, frameon=False, loc="lower left")
    force.plot(recording.time[:-1], recording.force[:-1, 2], color=TOOL)
    force.annotate("leaves the edge ", (leave["time"], 0.3), fontsize=8, color=QUIET, ha="right")
    force.set(xlabel="time (s)", ylabel="N (N)", ylim=(-0.15, 1.2))
    for graph in (height, force):
        graph.axvline(leave["time"], color=MARK, linewidth=1.0)
    save(made, "ground-truth-edge")

# The top of a sphere of 0.1 m, left from rest a thousandth of a radian off.
radius, tilt = 0.1, 1e-3
start = radius * np.array([np.sin(tilt), 0.0, np.cos(tilt)])
recording = run(hapticeval.make_model("sphere", size=2.0 * radius), start, [0, 0, 0], [0.0], [[0, 0, -WEIGHT]], 0.98)
leave = event_of(recording, "leave")
angle = np.arccos(leave["position"][2] / radius)
print(f"sphere: leaves at cos = {np.cos(angle):.12f}, {np.degrees(angle):.3f} degrees, {leave['time']:.4f} s")
with figure(8.0, 3.4, layout="constrained") as made:
    side, graph = made.subplots(1, 2)
    turn = np.linspace(0.0, 2.0 * np.pi, 300)
    side.fill(MM * radius * np.cos(turn), MM * radius * np.sin(turn), facecolor=THEME["model"], edgecolor=QUIET)
    slides = recording.time <= leave["time"]
    side.plot(*(MM * recording.hip[slides][:, [0, 2]].T), color=TOOL, linewidth=2.0, label="slides")
    side.plot(*(MM * recording.hip[~slides][:, [0, 2]].T), color=FORCE, linewidth=2.0, label="flies")
    side.plot([0, MM * leave["position"][0]], [0, MM * leave["position"][2]], "--", color=INK, linewidth=0.9)
    side.plot([0, 0], [0, MM * radius], "--", color=INK, linewidth=0.9)
    side.plot(MM * leave["position"][0], MM * leave["position"][2], "o", color=MARK, markersize=5)
    side.annotate(f"{np.degrees(angle):.1f}°", (10, 38), fontsize=9)
    side.set(aspect="equal", xlim=(-105, 150), ylim=(-62, 105))
    side.set_axis_off()
    side.legend(fontsize=8, frameon=False, loc="upper right")
    middle = 0.5 * (recording.hip[:-1] + recording.hip[1:])
    down = np.arctan2(middle[:, 0], middle[:, 2])
    shown = recording.time[1:] < leave["time"] + 0.05
    graph.plot(
        np.cos(down[shown]),
        np.linalg.norm(recording.force[:-1], axis=1)[shown],
        color=TOOL,
        label="contact force of the run",
    )
    law = np.linspace(0.6, 1.0, 60)
    graph.plot(law, WEIGHT * (3.0 * law - 2.0 * np.cos(tilt)), "--", color=INK, linewidth=0.9, label="F (3 cos - 2)")
    graph.axvline(2.0 / 3.0, color=MARK, linewidth=1.0)
    graph.annotate(
        "cos = 2/3", (2.0 / 3.0, 0.75), fontsize=9, color=QUIET, ha="right", xytext=(-4, 0), textcoords="offset points"
    )
    graph.set(xlabel="cosine of the angle from the top", ylabel="N (N)", xlim=(1.0, 0.6), ylim=(-0.25, 1.05))
    graph.axhline(0.0, color=QUIET, linewidth=0.6)
    graph.legend(fontsize=8, frameon=False, loc="lower left")
    save(made, "ground-truth-sphere")

# Thrown into an inner corner, held there by three walls, and let go by one after the other.
model = next(case for case in load_suite("solids").cases if case.name == "inner-corner").build_scene().model
times, pushes = [0.0, 0.4, 0.5, 0.6], [[-1.0, -0.7, -0.4], [-1.0, -0.7, -0.4], [-1.0, -0.7, 0.4], [-1.0, 0.9, 0.4]]
recording = run(model, [0.03, 0.008, 0.02], [-0.5, -0.4, -0.6], times, pushes, 0.605)
rest = event_of(recording, "rest")
print("inner corner:", [(event["kind"], round(event["time"], 4)) for event in recording.meta["events"]])
with figure(8.0, 3.4, layout="constrained") as made:
    space, graph = bare_axes_in_space(made, 121), made.add_subplot(122)
    w = 0.035
    draw_faces(
        space,
        [
            [[0, 0, 0], [w, 0, 0], [w, w, 0], [0, w, 0]],
            [[0, 0, 0], [w, 0, 0], [w, 0, w], [0, 0, w]],
            [[0, 0, 0], [0, w, 0], [0, w, w], [0, 0, w]],
        ],
    )
    into, out = recording.time <= rest["time"], recording.time >= 0.45
    space.plot(*(MM * recording.hip[into].T), color=TOOL, linewidth=1.8, zorder=10)
    space.plot(*(MM * recording.hip[out].T), color=FORCE, linewidth=1.8, zorder=10)
    space.scatter(0.0, 0.0, 0.0, color=MARK, s=28, zorder=12, depthshade=False)
    for axis, name in enumerate("xyz"):
        space.text(*(MM * 1.1 * w * np.eye(3)[axis]), name, fontsize=9, color=QUIET)
    space.set(xlim=(0, MM * w), ylim=(0, MM * w), zlim=(0, MM * w))
    space.set_box_aspect((1, 1, 1), zoom=0.88)
    space.view_init(elev=24.0, azim=62.0)
    held = recording.time[:-1] > rest["time"] + DT
    for axis, (name, colour) in enumerate(zip("xyz", (TOOL, OTHER, FORCE), strict=True)):
        graph.plot(
            recording.time[:-1][held], recording.force[:-1, axis][held], color=colour, label=f"N of the wall {name} = 0"
        )
        drawn = -np.interp(recording.time, times, np.array(pushes)[:, axis])
        graph.plot(recording.time, drawn, "--", color=INK, linewidth=0.8, label="parts of -F" if name == "z" else None)
    for event in recording.meta["events"]:
        graph.axvline(event["time"], color=MARK, linewidth=1.0 if event["kind"] == "rest" else 0.5)
    graph.annotate(" rests", (rest["time"], 1.08), fontsize=8, color=QUIET)
    graph.set(xlabel="time (s)", ylabel="N (N)", ylim=(-0.95, 1.2))
    graph.legend(fontsize=8, frameon=False, loc="lower left")
    save(made, "ground-truth-corner")

# Dropped from 20 mm, a half of the speed at each bounce.
drop, share = 0.02, 0.5
recording = run(
    hapticeval.make_model("cube"), [0.01, 0.0, top + drop], [0, 0, 0], [0.0], [[0, 0, -WEIGHT]], 0.26, restitution=share
)
fall = np.sqrt(2.0 * drop / GRAVITY)
limit = fall * (1.0 + share) / (1.0 - share)
impacts = [event for event in recording.meta["events"] if event["kind"] == "impact"]
print(f"bounces: {len(impacts)}, the last at {impacts[-1]['time']:.6f} s, limit {limit:.6f} s")
with figure(8.0, 3.0, layout="constrained") as made:
    graph, sizes = made.subplots(1, 2)
    graph.plot(recording.time, MM * (recording.hip[:, 2] - top), color=TOOL)
    graph.plot([event["time"] for event in impacts], np.zeros(len(impacts)), "o", color=MARK, markersize=3)
    graph.axvline(limit, color=INK, linestyle="--", linewidth=0.9)
    graph.annotate("limit time ", (limit, 17.0), fontsize=8, color=QUIET, ha="right")
    graph.set(xlabel="time (s)", ylabel="height over the face (mm)", ylim=(-1.0, 21.0))
    number = np.arange(len(impacts))
    impulses = np.array([event["impulse"][2] for event in impacts])
    sizes.semilogy(number + 1, impulses, "o", color=TOOL, markersize=4, label="impulse of the run")
    first = (1.0 + share) * MASS * GRAVITY * fall
    sizes.semilogy(number + 1, first * share**number, "--", color=INK, linewidth=0.9, label="a half of the one before")
    sizes.set(xlabel="impact", xticks=np.arange(1, len(impacts) + 1, 4), ylabel="impulse (N s)")
    sizes.legend(fontsize=8, frameon=False)
    save(made, "ground-truth-bounces")
