"""How thin a plate a renderer holds: the thinnest that still pushes the hand back, by speed and push."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from hapticeval.geometry.catalogue import make_model
from hapticeval.renderer import RendererFactory
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
