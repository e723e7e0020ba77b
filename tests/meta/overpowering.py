"""Renderers whose force is of another size than it should be, or that make energy of it.

Each takes its IHIP and its force from an honest renderer, and has one fault in the size of the force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from honest import Changed

from hapticeval.discovery import resolve
from hapticeval.renderer import Renderer, Response
from hapticeval.scene import Scene


@dataclass
class Tick:
    """What a fault may look at: time since the reset, s, its tick, how often it was reset, and the honest answer."""

    number: int
    time: float
    resets: int
    stiffness: float
    hip: np.ndarray
    velocity: np.ndarray
    ihip: np.ndarray
    force: np.ndarray


Fault = Callable[[Tick], np.ndarray]


class Overpowering(Changed):
    """An honest renderer's answer, with the force that `fault` makes of it; it declares what the honest one does."""

    def __init__(self, scene: Scene, inner: Renderer, fault: Fault) -> None:
        super().__init__(scene, inner)
        self.fault = fault
        self.resets = 0

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.resets += 1
        self.number, self.time = 0, 0.0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        tick = Tick(self.number, self.time, self.resets, self.scene.stiffness, hip, velocity, ihip, force)
        self.number, self.time = self.number + 1, self.time + dt
        return Response(ihip, self.fault(tick))


def third(tick: Tick) -> np.ndarray:
    """A third of the stiffness."""
    return tick.force / 3.0


def half(tick: Tick) -> np.ndarray:
    """Half of the stiffness."""
    return tick.force / 2.0


def stiffer(tick: Tick) -> np.ndarray:
    """Five per cent stiffer."""
    return 1.05 * tick.force


def one_newton(tick: Tick) -> np.ndarray:
    """1 N at any depth."""
    size = float(np.linalg.norm(tick.force))
    return tick.force / size if size > 0.0 else tick.force


def spikes(tick: Tick) -> np.ndarray:
    """Ten times the force at every 50th tick."""
    return 10.0 * tick.force if tick.number % 50 == 49 else tick.force


def kicks(tick: Tick) -> np.ndarray:
    """A tenth more on the way out."""
    return 1.1 * tick.force if float(tick.velocity @ tick.force) > 0.0 else tick.force


def drifts(tick: Tick) -> np.ndarray:
    """The force grows by five per cent a second."""
    return (1.0 + 0.05 * tick.time) * tick.force


def wears(tick: Tick) -> np.ndarray:
    """Three per cent softer after every reset."""
    return 0.97 ** (tick.resets - 1) * tick.force


def swirls(tick: Tick) -> np.ndarray:
    """A fifth of the force across it beside: it has a curl, and drives the hand round one way."""
    return tick.force + 0.2 * np.array([-tick.force[1], tick.force[0]])


OVERPOWERING: dict[str, tuple[frozenset[str], Fault]] = {
    "third": (frozenset({"force-magnitude"}), third),
    "half": (frozenset({"force-magnitude"}), half),
    "stiffer": (frozenset({"force-magnitude"}), stiffer),
    "one-newton": (frozenset({"force-magnitude"}), one_newton),
    "spikes": (frozenset({"force-magnitude"}), spikes),
    "kicks": (frozenset({"force-magnitude", "passivity"}), kicks),
    "drifts": (frozenset({"force-magnitude", "passivity"}), drifts),
    "wears": (frozenset({"reset-clears"}), wears),
    "swirls": (frozenset({"passivity"}), swirls),
}
"""Overpowering renderer: the checks of force and energy that it must fail, and no other of these, and its fault."""


def factory(name: str, base: str = "minimum-distance") -> Callable[[Scene], Overpowering]:
    """A renderer factory for one of `OVERPOWERING`, built on the honest renderer `base`."""
    return lambda scene: Overpowering(scene, resolve(base)(scene), OVERPOWERING[name][1])
