"""How thin a plate a renderer holds: the thinnest that still pushes the hand back, by speed and push.

Run it as `python -m hapticeval.examples.studies.plates -r constraint -o pictures`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path as FilePath
from typing import Annotated, Any, NamedTuple

import numpy as np

from hapticeval.cli import run_program
from hapticeval.commands.arguments import Folder, renderers_option
from hapticeval.commands.draw import DRAW_CODES
from hapticeval.commands.terminal import Terminal, columns, paragraphs, say, wrote_lines
from hapticeval.discovery import resolve
from hapticeval.errors import InputError
from hapticeval.files import file_stem
from hapticeval.geometry.catalogue import make_model
from hapticeval.renderer import RendererFactory
from hapticeval.reports.canvas import CURVES, MARKERS, THEME, figure, save_figure
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.reading import case_named
from hapticeval.types import Array

CASE = "solids/plate"
"""The case whose path is followed: its direction, and the plate's sides."""

THINNEST_PLATE, THICKEST_PLATE = 1e-4, 1e-2
"""Thicknesses of the plate between which the border is looked for, m."""

HAND_SPEEDS, HAND_PUSHES = (0.1, 0.3, 1.0, 3.0), (1.0, 3.0, 10.0, 30.0)
"""Speeds of the hand, m/s, and forces, N, with which a spring of the scene's stiffness pushes in the end."""

CITED = (1.0, 10.0)
"""Speed, m/s, and push, N, of the one number that stands for a renderer."""

RUN_UP, PHASES, SETTLING = 0.02, 4, 0.2
"""Height from which the hand comes, m; starts within a tick's travel; seconds for which it pushes in the end."""

RATIO = 1.02
"""How near, as a ratio, what holds and what does not are at the end of a bisection."""

HELD_SHARE = 0.5
"""Share of the push that a plate in front of which the tool stays gives back; chosen: behind it nothing pushes back."""


class Border(NamedTuple):
    """Of a `speed` (m/s) and a `push` (N) the `thinnest` plate that is held (m): None where none is."""

    speed: float
    push: float
    thinnest: float | None


def plate_scene(thickness: float) -> Scene:
    """Return the scene of a plate of that thickness (m): that of `solids/plate` but for it."""
    return Scene(model=make_model("box", z=thickness))


@cache
def direction_of_case() -> Array:
    """Return the unit direction (3,) in which the hand of `solids/plate` goes."""
    case = case_named(CASE)
    stimulus = case.build_stimulus(case.build_scene(), None)
    assert isinstance(stimulus, Path)
    direction = stimulus.points[-1] - stimulus.points[0]
    return np.asarray(direction / np.linalg.norm(direction))


def approach(scene: Scene, thickness: float, speed: float, push: float, phase: float) -> Path:
    """Return the hand's path along the direction of `solids/plate`, to where a spring gives the push; it rests there.

    It begins `RUN_UP` and a `phase` (0 to 1) of a tick's travel above the plate's face.
    """
    direction, dt = direction_of_case(), scene.sampling_time
    height = RUN_UP + phase * speed * dt
    # K times the depth under the face is the push.
    length = (height + push / scene.stiffness) / -direction[2]
    ticks = math.ceil(length / (speed * dt)) + math.ceil(SETTLING / dt)
    travelled = np.minimum(speed * dt * np.arange(ticks + 1), length)
    start: Array = np.array([0.0, 0.0, 0.5 * thickness + height])
    return Path(dt * np.arange(ticks + 1, dtype=np.float64), start + travelled[:, np.newaxis] * direction)


def holds(factory: RendererFactory, thickness: float, speed: float, push: float) -> bool:
    """Return whether a plate of `thickness` (m) pushes the hand back in the end, for each phase of a tick.

    The hand comes at `speed` (m/s), and goes as deep under the plate's face as a spring needs for `push` (N).
    """
    scene = plate_scene(thickness)
    renderer = make_renderer(factory, scene)
    return all(
        play(renderer, approach(scene, thickness, speed, push, phase / PHASES), scene.sampling_time).force[-1, 2]
        > HELD_SHARE * push
        for phase in range(PHASES)
    )


def narrow_border(is_held: Callable[[float], bool], holding: float, failing: float) -> float:
    """Return the number nearest to `failing` for which a plate is held, to `RATIO`, by bisection from one `holding` it.

    Both are positive, in any one unit: a thickness, or a push.
    """
    while max(holding, failing) / min(holding, failing) > RATIO:
        middle = math.sqrt(holding * failing)
        holding, failing = (middle, failing) if is_held(middle) else (holding, middle)
    return holding


def find_thinnest(factory: RendererFactory, speed: float, push: float) -> float | None:
    """Return the smallest thickness, m, that is held at a `speed` (m/s) and `push` (N), to `RATIO`; None if none is.

    By bisection: of a renderer that holds a plate and loses a thicker one it is one of several.
    """
    low, high = THINNEST_PLATE, THICKEST_PLATE
    if not holds(factory, high, speed, push):
        return None
    if holds(factory, low, speed, push):
        return low
    return narrow_border(lambda thickness: holds(factory, thickness, speed, push), high, low)


def study_plates(factory: RendererFactory, show: Callable[[int, int, str], object]) -> list[Border]:
    """Return the border for each speed and push. Raises as renderers, their factories and `play` do."""
    borders: list[Border] = []
    for push in HAND_PUSHES:
        for speed in HAND_SPEEDS:
            show(len(borders), len(HAND_PUSHES) * len(HAND_SPEEDS), f"{speed:g} m/s, {push:g} N")
            borders.append(Border(speed, push, find_thinnest(factory, speed, push)))
    return borders


def describe_border(thinnest: float | None) -> str:
    """Return in words from which thickness (m) on a plate is held."""
    if thinnest is None:
        return f"no plate up to {1e3 * THICKEST_PLATE:g} mm is held"
    if thinnest == THINNEST_PLATE:
        return f"a plate of {1e3 * THINNEST_PLATE:g} mm is held, the thinnest tried"
    return f"plates of {1e3 * thinnest:.3g} mm and more are held"


def plates(
    renderers: Annotated[list[str] | None, renderers_option("an error")] = None,
    directory: Folder = FilePath(),
) -> None:
    """Find the thinnest plate that a renderer holds, over the hand's speed and its push.

    By bisection between 0.1 and 10 mm, along the direction of the case solids/plate. The hand stops where a spring of
    1000 N/m pushes as much, and a plate is held where half of that comes back in the end.

    \b
    Examples:
      python -m hapticeval.examples.studies.plates -r constraint
      python -m hapticeval.examples.studies.plates -r virtual-proxy -r coupled -o pictures
    """
    if not renderers:
        raise InputError("no renderer is named", why="a map is of a renderer", todo="name one: -r constraint")
    maps = {}
    with Terminal() as terminal:
        for name in renderers:
            maps[name] = study_plates(resolve(name), terminal.working)
    speed, push = CITED
    rows = [
        (name, f"at {speed:g} m/s and {push:g} N {describe_border(border.thinnest)}")
        for name, borders in maps.items()
        for border in borders
        if (border.speed, border.push) == CITED
    ]
    document = {
        "thinnest": THINNEST_PLATE,
        "thickest": THICKEST_PLATE,
        "renderers": {name: [border._asdict() for border in borders] for name, borders in maps.items()},
    }
    say(paragraphs(columns(rows), wrote_lines(write_plates(directory, document))))


def write_plates(directory: FilePath, document: Mapping[str, Any]) -> list[FilePath]:
    """Draw the document of the study into `directory` as SVG and PNG, with the numbers as JSON.

    Where no thickness is held the mark is a cross over the thickest plate. Return the paths written. Raises
    `HapticevalError` where a file cannot be written.
    """
    panels = document["renderers"]
    thickest = 1e3 * document["thickest"]
    across = min(len(panels), 3)
    down = -(-len(panels) // across)
    with figure(3.4 * across + 0.4, 3.2 * down, layout="constrained") as fig:
        grid = fig.subplots(down, across, squeeze=False, sharex=True, sharey=True)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        for axes, (name, borders) in zip(grid.flat, panels.items(), strict=False):
            pushes = dict.fromkeys(border["push"] for border in borders)
            for role, marker, push in zip(CURVES, MARKERS, pushes, strict=False):
                of_push = [border for border in borders if border["push"] == push]
                with_thickness = [border for border in of_push if border["thinnest"] is not None]
                lost_speeds = [border["speed"] for border in of_push if border["thinnest"] is None]
                thicknesses = [1e3 * border["thinnest"] for border in with_thickness]
                look: dict[str, Any] = {"color": THEME[role]}
                speeds = [border["speed"] for border in with_thickness]
                axes.plot(speeds, thicknesses, marker=marker, label=f"{push:g} N", **look)
                axes.plot(lost_speeds, [1.3 * thickest] * len(lost_speeds), "x", **look)
            axes.set(xscale="log", yscale="log", title=name.rpartition(":")[2])
            axes.set_ylim(1e3 * document["thinnest"] / 1.2, 1.5 * thickest)
            axes.axhline(thickest, color=THEME["quiet"], linewidth=0.8, linestyle=":")
        for axes in grid[-1]:
            axes.set_xlabel("speed of the hand (m/s)")
        for axes in grid[:, 0]:
            axes.set_ylabel("thinnest plate held (mm)\ncross: none up to the dotted line")
        grid[0, -1].legend(title="push", loc="lower right")
        return save_figure(fig, directory, file_stem("plates-" + "-".join(panels)), document=document)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code."""
    return run_program(plates, DRAW_CODES, arguments)


if __name__ == "__main__":
    sys.exit(main())
