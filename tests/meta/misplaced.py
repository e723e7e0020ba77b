"""Renderers whose contact point is not where the hand has it: it hops, is off the surface, stays behind, or creeps.

All are a spring to a contact point that a rule, or the renderer itself, moves to a wrong place.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from honest import Changed, Spring
from jumping import Follows, Late, led_by

from hapticeval.renderer import Response
from hapticeval.scene import Scene


class Hop:
    """From a time after the contact began on, s, the contact point is so much farther along the surface, m."""

    def __init__(self, at: float, by: float) -> None:
        self.at, self.by, self.time = at, by, 0.0

    def __call__(self, s: float, tick: int, dt: float) -> float | None:
        self.time += dt
        return s + (self.by if self.time > self.at else 0.0)


SLOW = 0.02
"""Speed of the hand, m/s, under which it is slow."""


class Slowly(Changed):
    """A spring whose contact point is `misplaced` once the hand has been slow for 50 ticks."""

    settled = 50

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.before, self.slow, self.off = hip, 0, 0.0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        inside = not np.array_equal(ihip, hip)
        self.slow = self.slow + 1 if inside and np.linalg.norm(hip - self.before) < SLOW * dt else 0
        self.before = hip
        if not inside:
            self.off = 0.0
            return Response(ihip, force)
        ihip = self.misplaced(ihip, dt)
        return Response(ihip, self.scene.stiffness * (ihip - hip))

    def misplaced(self, ihip: np.ndarray, dt: float) -> np.ndarray:
        """Return the wrong contact point."""
        raise NotImplementedError


class HopsWhileSlow(Slowly):
    """Every 100 ticks the contact point hops 1.5 mm along the surface, and back."""

    def misplaced(self, ihip: np.ndarray, dt: float) -> np.ndarray:
        curve = self.scene.model.curve
        hops = self.slow > self.settled and self.slow // 100 % 2
        s = curve.arc_length(curve.nearest(ihip[np.newaxis])) + 1.5e-3 * hops
        return np.asarray(curve.position(curve.parameter(s)))[0]


class SinksWhileSlow(Slowly):
    """The contact point sinks to 2.9 mm under the surface at 5 mm/s, and comes back once the hand is fast."""

    def misplaced(self, ihip: np.ndarray, dt: float) -> np.ndarray:
        rate = 5e-3 if self.slow > self.settled else -0.5
        self.off = min(max(self.off + rate * dt, 0.0), 2.9e-3)
        at = self.scene.model.boundary.closest_point(ihip[np.newaxis])
        return np.asarray(at.foot[0] - self.off * at.normal[0])


def behind(seconds: float) -> Callable[[float, float, int, float], float]:
    """Return an update that takes the contact point after the hand with so long a time constant."""
    return lambda old, new, tick, dt: new + (old - new) * np.exp(-dt / seconds)


def creeping(speed: float) -> Callable[[float, float, int, float], float]:
    """Return an update that moves the contact point along the surface at so many m/s, whatever the hand does."""
    return lambda old, new, tick, dt: old + speed * dt


def slowly(kind: type[Slowly]) -> Callable[[Scene], Slowly]:
    """Return the factory of a spring that is wrong while the hand is slow."""
    return lambda scene: kind(scene, Spring(scene))


single_hop = led_by(partial(Hop, 2.0, 0.115e-3))


ASTRAY: dict[str, Callable[[Scene], Any]] = {
    "behind": led_by(lambda: Late(100)),
    "slides-after": led_by(partial(Follows, behind(0.1))),
    "creeps": led_by(partial(Follows, creeping(1.0))),
}
"""Contact points 100 ms behind the hand along the surface, in one way or another, or gone at 1 m/s."""
