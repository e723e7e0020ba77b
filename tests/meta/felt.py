"""Renderers that show effects by code of their own: right ones as real ones differ, and ones with a fault each.

`HONEST` no check of the effect may blame, and `BROKEN` says what stops the others, in the cases of the suites `CASES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import latecomers
import numpy as np
from honest import Late, Single
from msgspec import structs
from outsiders import Outsider

from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.stimulus.paths import Loop
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

RELIEFS = ("height-map-line", "height-map-circle", "height-map-sphere", "bump-map-line")


def _asked(suite: str, names: tuple[str, ...], checks: tuple[str, ...]) -> dict[str, Case]:
    """Return cases of a suite with these checks of theirs; loops as far as they show a fault."""
    cases = {}
    for name in names:
        case = load_suite(suite).case(name)
        if isinstance(case.trajectory, Loop):
            case = structs.replace(case, trajectory=structs.replace(case.trajectory, laps=1, lap=1.0, radius=0.0005))
        cases[name] = structs.replace(case, checks=tuple(check for check in case.checks if check in checks))
    return cases


CASES = _asked("effects-texture", RELIEFS, ("texture-relief",))


class Carved:
    """A relief by its formulas, round a spring to the nearest point of a line, a circle or a sphere.

    The sine is `high` times as high as the scene's and `long` times as long.
    """

    supports = frozenset({"height-map", "bump-map"})

    def __init__(self, scene: Scene, *, high: float = 1.0, long: float = 1.0) -> None:
        self.scene, self.boundary = scene, scene.model.boundary
        self.relief: Any = scene.effects[0] if scene.effects else None
        if self.relief is not None:
            self.high = high * self.relief.amplitude
            self.wave = long * self.relief.wavelength
            if scene.model.name == "circle":
                girth = np.pi * scene.model.size
                self.wave = girth / round(girth / self.wave)

    def reset(self, hip: np.ndarray) -> None:
        pass

    def phase(self, foot: np.ndarray, normal: np.ndarray) -> tuple[float, np.ndarray]:
        """Return how far along the waves a foot is, m, and the way along which they run there."""
        if foot.size == 3:
            unit = np.array(self.relief.direction) / np.linalg.norm(self.relief.direction)
            return float(foot @ unit), unit - (unit @ normal) * normal
        along = np.array([-normal[1], normal[0]])
        if self.scene.model.name == "line":
            return -float(foot[0]), along
        return float(np.arctan2(foot[1], foot[0]) % (2.0 * np.pi)) * 0.5 * self.scene.model.size, along

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        frame = self.boundary.closest_point(np.asarray(hip, dtype=float)[np.newaxis])
        foot, normal, depth = frame.foot[0], frame.normal[0], -float(frame.distance[0])
        stiffness, height, slope = self.scene.stiffness, 0.0, np.zeros_like(foot)
        if self.relief is not None:
            at, along = self.phase(foot, normal)
            turn = 2.0 * np.pi / self.wave
            height = self.high * np.sin(turn * at)
            slope = self.high * turn * np.cos(turn * at) * along
            if self.relief.kind == "bump-map":
                tilted = (normal - slope) / np.linalg.norm(normal - slope)
                return Response(foot, stiffness * depth * tilted) if depth > 0.0 else Response(hip, 0.0 * normal)
            # Round surfaces shrink towards their middle.
            slope = slope / (1.0 - depth * (2.0 / self.scene.model.size if self.scene.model.name != "line" else 0.0))
        if depth + height <= 0.0:
            return Response(hip, 0.0 * normal)
        return Response(foot + height * normal, stiffness * (depth + height) * (normal - slope))


def _late(scene: Scene, make: Any, ticks: int) -> Any:
    return type("LateFelt", (Late,), {"ticks": ticks})(scene, make(scene))


def _between_ticks(scene: Scene, make: Any, **ticks: float) -> Any:
    return latecomers.Latecomer(scene, make(scene), **ticks)


def changed(make: Any) -> dict[str, Any]:
    """Return right renderers as real ones differ: late in whole ticks and between, one channel, in single precision."""
    return {
        "": make,
        "-late": partial(_late, make=make, ticks=3),
        "-late-between": partial(_between_ticks, make=make, ihip=1.5, force=1.5),
        "-force-late": partial(_between_ticks, make=make, force=1.0),
        "-ihip-late": partial(_between_ticks, make=make, ihip=1.0),
        "-single": lambda scene: Single(scene, make(scene)),
    }


OFF = "the relief that is felt is another"
BROKEN: Mapping[str, Outsider] = {
    "flat": Outsider(partial(Carved, high=0.0), {"texture-relief": "no relief is felt"}, RELIEFS),
    "too-high": Outsider(partial(Carved, high=1.3), {"texture-relief": OFF}, RELIEFS),
    "too-long": Outsider(partial(Carved, long=1.7), {"texture-relief": OFF}, RELIEFS),
    "inverted": Outsider(partial(Carved, high=-1.0), {"texture-relief": OFF}, RELIEFS),
}
"""What each fault fails, and why."""

HONEST: Mapping[str, Outsider] = {
    f"carved{name}": Outsider(make, cases=RELIEFS) for name, make in changed(Carved).items()
}
"""A relief by formulas of its own."""
