"""Draw the pictures of docs/moving-bodies.md into `pictures`, with a wrong renderer that tests the checks."""

import sys
from dataclasses import replace
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "tests" / "meta"))

import numpy as np
from led_astray import OfLastTick

from hapticeval.discovery import resolve
from hapticeval.recordings.world import in_world, poses_of
from hapticeval.reports.canvas import figure
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.suite.reading import load_suite

PICTURES = Path("pictures")
PICTURES.mkdir(exist_ok=True)
SUITE = load_suite("moving")
INK, TOOL, WRONG = "#1c1f23", "#d55e00", "#0072b2"


def made_wrongly(scene):
    """Make a god-object that is placed a tick late."""
    return OfLastTick(resolve("constraint@curve")(replace(scene, motion=None)))


made_wrongly.supports = {"moving", "plane"}


def played(name, factory):
    """Return scene and recording of a case of the suite."""
    case = SUITE.case(name)
    scene = case.build_scene()
    renderer = make_renderer(factory, scene)
    return scene, play(renderer, case.build_stimulus(scene, renderer), scene.sampling_time, scene=scene)


def draw_tool(axes, recording):
    """Draw the hand's path, and the tool where it is apart from the hand, in mm."""
    hip, ihip = 1e3 * recording.hip, 1e3 * recording.ihip
    axes.plot(*hip.T, color=INK, linewidth=0.8)
    axes.plot(*np.where(recording.apart[:, np.newaxis], ihip, np.nan).T, color=TOOL, linewidth=2.2)
    axes.set_aspect("equal")
    axes.set_axis_off()


with figure(7.4, 3.6, layout="constrained") as drawn:
    scene, recording = played("star-sweeps", resolve("constraint@curve"))
    outline, world = scene.model.curve.outline(400), in_world(recording)
    left, right = drawn.subplots(1, 2)
    for time, shade in ((0.7, 0.25), (0.75, 0.5), (0.8, 1.0)):
        pose = scene.motion.pose(time)
        left.plot(*(1e3 * (outline @ pose.rotation.T + pose.translation)).T, color=INK, alpha=shade, linewidth=1.0)
    left.set_title("in the world: at 0.70, 0.75 and 0.80 s", fontsize=9)
    right.plot(*(1e3 * outline).T, color=INK, linewidth=1.0)
    right.set_title("in the frame of the body", fontsize=9)
    draw_tool(left, world)
    draw_tool(right, recording)
    drawn.savefig(PICTURES / "moving-frames.svg")

with figure(7.4, 2.6, layout="constrained") as drawn:
    axes = drawn.subplots()
    for words, factory, colour in (
        ("its pose", resolve("constraint@curve"), TOOL),
        ("the last pose", made_wrongly, WRONG),
    ):
        scene, recording = played("circle-slides", factory)
        speeds = np.linalg.norm(np.diff(poses_of(recording.channels).translation, axis=0), axis=1) / recording.dt
        off = 1e3 * np.abs(scene.model.boundary.signed_distance(recording.ihip))
        axes.plot(recording.time, off, color=colour, label=f"by {words}")
        print(f"{words}: {off.max():.3g} mm off the surface, the body at {speeds.max():.3g} m/s")
    axes.set(xlabel="time (s)", ylabel="IHIP off the surface (mm)")
    axes.legend(frameon=False)
    drawn.savefig(PICTURES / "moving-last-pose.svg")
