"""Two legs of a solid, ways past the edge of the lower one to the upper, and renderers that leap there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from outsiders import case

from hapticeval import Response, resolve
from hapticeval.scene import Scene
from hapticeval.suite.case import Case

PLANE = {
    "kind": "polygon",
    "vertices": [[-0.05, -0.05], [0.05, -0.05], [0.05, -0.01], [-0.01, -0.01], [-0.01, 0.05], [-0.05, 0.05]],
}
"""The lower leg ends at x = 5 cm, and above it, from y = -1 cm on, the other one begins at x = -1 cm."""
LEGS: list[Mapping[str, Any]] = [PLANE, {"kind": "l-block", "thickness": 0.04}]


def flying(legs: Mapping[str, Any], aslant: float = 0.0) -> Case:
    """In through the end of one leg, deep to the other, and up past the edge, `aslant` m from upright."""
    points = [[0.06, -0.03], [-0.02, -0.03], [-0.02 + aslant, 0.01]]
    level = [] if legs is PLANE else [0.0]
    path = {"kind": "points", "points": [[*point, *level] for point in points], "duration": 2.0}
    return case("past-the-edge", legs, ("continuous-contact",), trajectory=path)


def grazing() -> Case:
    """By the edge of the upper leg, and down on the lower one, whose normal is the same."""
    path = {"kind": "points", "points": [[-0.0129, 0.0558, 0.0178], [0.0185, -0.0128, 0.0227]], "duration": 0.25}
    return case("grazing", LEGS[1], ("broken-contact",), trajectory=path)


class Leaps:
    """A god-object's answers, but from where the hand is `early` (m) below the edge on: at the other leg already."""

    supports = frozenset({"plane", "space"})
    early, aside = 2e-3, 0.0

    def __init__(self, scene: Scene) -> None:
        self.proxy: Any = resolve("constraint")(scene)
        self.stiffness = scene.stiffness

    def reset(self, hip: np.ndarray) -> None:
        self.proxy.reset(hip)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = self.proxy.step(hip, velocity, dt)
        if hip[0] < -0.01 and -0.01 - self.early < hip[1] < 0.0:
            ihip = np.array([-0.01, max(hip[1], -0.01) + self.aside, *hip[2:]])
            force = self.stiffness * (ihip - hip)
        return Response(ihip, force)


class LandsElsewhere(Leaps):
    """One that leaps when the edge is past, and lands 5 mm higher than its flight leads."""

    early, aside = 0.0, 5e-3


class UndeclaredBall:
    """The virtual proxy, a ball of 0.5 mm, that does not declare its radius."""

    supports = frozenset({"space"})

    def __init__(self, scene: Scene) -> None:
        ball = resolve("virtual-proxy")(scene)
        self.reset, self.step = ball.reset, ball.step
