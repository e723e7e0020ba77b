"""Set stabilisation about a line and a circle, written by hand, and the same with one fault each.

The faults are in the law, not in the recording: what the checks of Problem 7.1 see is what such a law does in the loop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hapticeval.discovery import resolve
from hapticeval.renderer import Declaration, RendererFactory, Response
from hapticeval.scene import Scene

Fault = Callable[["Tick"], None]


@dataclass
class Tick:
    """What a fault may change: the force's parts, N, at the state that it sees."""

    time: float
    scene: Scene
    n: float
    n_rate: float
    kappa: float
    w: float
    spring: float
    damper: float
    turning: float
    across: float = 0.0
    along: float = 0.0
    starts_on: bool = False

    @property
    def foot_rate(self) -> float:
        return self.w / (1.0 + self.n * self.kappa)


class Stabilised:
    """(7.11), (7.14), (7.17) and (7.18) for a tool that the loop moves as a point mass, which it may claim to be."""

    supports = frozenset({"bilateral", "viscosity", "plane"})

    def __init__(self, scene: Scene, fault: Fault | None = None, *, claims: bool = True) -> None:
        self.scene = scene
        self.fault = fault
        self.declares = Declaration(closed_form="set-stabilisation" if claims else None)

    def reset(self, hip: np.ndarray) -> None:
        self.time, self.starts_on = 0.0, None

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        scene = self.scene
        if scene.model.name == "line":
            normal, n, kappa = np.array([0.0, 1.0]), float(hip[1]), 0.0
        else:
            radius = scene.model.size / 2.0
            distance = float(np.hypot(*hip))
            normal, n, kappa = hip / distance, distance - radius, 1.0 / radius
        tangent = np.array([-normal[1], normal[0]])
        n_rate, w = float(normal @ velocity), float(tangent @ velocity)
        if self.starts_on is None:
            self.starts_on = abs(n) < 1e-12 and abs(n_rate) < 1e-12
        spring, damper = -scene.stiffness * n, -scene.damping * n_rate
        tick = Tick(self.time, scene, n, n_rate, kappa, w, spring, damper, 0.0, starts_on=self.starts_on)
        tick.turning = 2.0 * scene.mass * kappa * n_rate * tick.foot_rate - scene.viscosity * w
        if self.fault is not None:
            self.fault(tick)
        self.time += dt
        press = tick.spring + tick.damper + tick.across - scene.mass * kappa * w * tick.foot_rate
        return Response(hip - n * normal, press * normal + (tick.turning + tick.along) * tangent)


def swings(tick: Tick) -> None:
    """Nothing damps the motion across."""
    tick.damper = 0.0


def nudges(tick: Tick) -> None:
    """A tool that was on the surface is pushed off it for 40 ms, and then let back."""
    if tick.starts_on and 0.02 < tick.time < 0.06:
        tick.across = 0.5 * np.sin(np.pi * (tick.time - 0.02) / 0.04) ** 2


def couples(tick: Tick) -> None:
    """The Coriolis term is left out, so that coming home changes the speed along the surface."""
    tick.turning = 0.0


def rubs(tick: Tick) -> None:
    """At the surface, and at rest across it, a friction brakes that the scene does not have."""
    if abs(tick.n) < 1e-3 and abs(tick.n_rate) < 1e-2:
        tick.along = -0.05 * tick.w


def hurries(tick: Tick) -> None:
    """The way to the surface is that of a spring a third stiffer, as well damped."""
    tick.spring *= 1.3
    tick.damper *= np.sqrt(1.3)


LAWBREAKERS: dict[str, tuple[str, Fault]] = {
    "swings": ("constraint-stability", swings),
    "nudges": ("output-invariance", nudges),
    "couples": ("decoupling", couples),
    "rubs": ("tangential-dynamics", rubs),
    "hurries": ("closed-form", hurries),
}
"""Lawbreaker: the one check that it must fail, and its fault."""


def factory(name: str) -> Callable[[Scene], Stabilised]:
    """A renderer factory for one lawbreaker, or for the law without a fault.

    One with a fault that another check has to find does not claim to be that law, whose closed form it would miss too.
    """
    check, fault = LAWBREAKERS.get(name, ("closed-form", None))
    return lambda scene: Stabilised(scene, fault, claims=check == "closed-form")


def other_gains(**factors: float) -> RendererFactory:
    """Return the factory of our set stabilisation, made with gains that are so many times the scene's."""
    ours = resolve("set-stabilisation")

    def make(scene: Scene) -> Any:
        return ours(replace(scene, **{gain: factor * getattr(scene, gain) for gain, factor in factors.items()}))

    make.supports = ours.supports  # type: ignore[attr-defined]
    return make
