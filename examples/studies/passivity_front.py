"""What a passivity controller takes out of maps, and what it costs: mJ a lap against degrees by which the force turns.

Run it as `python -m hapticeval.examples.studies.passivity_front -o pictures`. The hand goes round circles of several
radii in the case thesis/cassinian-loops, the way round that gives it energy. The lap after its store is spent counts.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from hapticeval.cli import run_program
from hapticeval.commands.arguments import Folder
from hapticeval.commands.draw import DRAW_CODES
from hapticeval.commands.terminal import columns, paragraphs, say, wrote_lines
from hapticeval.discovery import resolve
from hapticeval.phenomena.checks.shading import angles
from hapticeval.recordings.recording import Recording
from hapticeval.reports.canvas import CURVES, MARKERS, THEME, figure, save_figure
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.stimulus.paths import LAP_POINTS, Loop
from hapticeval.stimulus.stimulus import Path as HandPath
from hapticeval.suite.reading import case_named
from hapticeval.types import Array

CASE = "thesis/cassinian-loops"

RADII = (1e-3, 2e-3, 3e-3, 4e-3)
"""Radii of the circles, m: up to that of the case."""

INNER = ("mapping", "conformal")
"""Renderers whose force has a curl."""


class FrontPoint(NamedTuple):
    """Of a circle of `radius` (m): energy of a lap, J, without and with controller, and the force's turn, degrees.

    `turned` is the mean over the lap of the angle between the two forces, `most_turned` the largest.
    """

    radius: float
    without: float
    with_controller: float
    turned: float
    most_turned: float


def energy_by_tick(recording: Recording) -> Array:
    """Return the energy that the hand is given in each tick but the first, F . dx, J: (n - 1,)."""
    return np.asarray(np.sum(recording.force[1:] * np.diff(recording.hip, axis=0), axis=1))


def follow(name: str, loop: Loop, laps: int) -> Recording:
    """Return a renderer's answers along the first laps of a loop in the case's scene."""
    scene = case_named(CASE).build_scene()
    path = loop.path(scene.model.boundary, Path())
    until = path.time <= loop.approach + (laps + 0.5 / LAP_POINTS) * loop.lap
    renderer = make_renderer(resolve(name), scene)
    return play(renderer, HandPath(path.time[until], path.points[until]), scene.sampling_time)


def mirrored(loop: Loop) -> Loop:
    """Return the loop on the other side of the case's axis of symmetry, where anticlockwise is the other way round."""
    (start_x, start_y), (centre_x, centre_y) = loop.start, loop.centre
    return replace(loop, start=[start_x, -start_y], centre=[centre_x, -centre_y])


def measure(inner: str, radius: float) -> FrontPoint:
    """Return what the controller takes out of a renderer round a circle of `radius` (m), and the turn of its force."""
    case = case_named(CASE)
    assert isinstance(case.trajectory, Loop)
    dt = case.build_scene().sampling_time
    lap, approach = round(case.trajectory.lap / dt), round(case.trajectory.approach / dt)
    few = replace(case.trajectory, radius=radius, laps=2)
    energy = energy_by_tick(follow(inner, few, 4))
    # Two laps anticlockwise and two clockwise: the way round that gives is tried to the end.
    ways = [float(energy[approach + start * lap : approach + (start + 1) * lap].sum()) for start in (1, 3)]
    store = -float(energy[:approach].sum())
    # The controller gives what the way in has put into its store first.
    laps = 2 + math.ceil(max(store / max(ways), 1.0))
    long = replace(few if ways[0] > ways[1] else mirrored(few), laps=laps)
    free, controlled = follow(inner, long, laps), follow(f"{inner}+pc", long, laps)
    rows = slice(approach + (laps - 1) * lap, approach + laps * lap)
    force, other = free.force[1:][rows], controlled.force[1:][rows]
    turn = np.degrees(angles(force, other))
    return FrontPoint(
        radius,
        float(energy_by_tick(free)[rows].sum()),
        float(energy_by_tick(controlled)[rows].sum()),
        float(turn.mean()),
        float(turn.max()),
    )


def write_front(directory: Path, fronts: Mapping[str, list[FrontPoint]]) -> list[Path]:
    """Draw the fronts into `directory`, mJ taken out of a lap against mean degrees; return the paths written."""
    with figure(4.6, 3.4, layout="constrained") as fig:
        axes = fig.subplots()
        for role, marker, (name, points) in zip(CURVES, MARKERS, fronts.items(), strict=False):
            out = [1e3 * (point.without - point.with_controller) for point in points]
            axes.plot([point.turned for point in points], out, marker=marker, color=THEME[role], label=f"{name}+pc")
        axes.set(xlabel="turn of the force, mean over a lap (degrees)", ylabel="taken out of a lap (mJ)", yscale="log")
        axes.legend()
        document = {name: [point._asdict() for point in points] for name, points in fronts.items()}
        return save_figure(fig, directory, "passivity-front", document=document)


def passivity_front(directory: Folder = Path()) -> None:
    """Draw what a passivity controller takes out of two maps against what it costs."""
    fronts = {inner: [measure(inner, radius) for radius in RADII] for inner in INNER}
    rows = [
        (
            f"{inner}+pc, {1e3 * point.radius:g} mm",
            f"{1e3 * point.without:.3g} mJ a lap without, {1e3 * point.with_controller:.3g} mJ with it; "
            f"the force turns by {point.turned:.2g} degrees, {point.most_turned:.2g} at most",
        )
        for inner, points in fronts.items()
        for point in points
    ]
    say(paragraphs(columns(rows), wrote_lines(write_front(directory, fronts))))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the study as a program and return its exit code."""
    return run_program(passivity_front, DRAW_CODES, arguments)


if __name__ == "__main__":
    sys.exit(main())
