"""Renderers whose force is of another size than it should be, or that make energy of it, and honest ones beside them.

Each takes its IHIP and its force from an honest renderer, and has one fault in the size of the force. The honest ones
are late, coarse in number, off the surface by what they declare, or without an IHIP, and have no fault.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hapticeval.discovery import resolve
from hapticeval.renderer import Declaration, Renderer, Response, Spring
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


class Overpowering:
    """An honest renderer's answer, with the force that `fault` makes of it; it declares what the honest one does."""

    def __init__(self, inner: Renderer, scene: Scene, fault: Fault) -> None:
        self.inner, self.scene, self.fault = inner, scene, fault
        self.declares = getattr(inner, "declares", None)
        self.resets = 0

    def reset(self, hip: np.ndarray) -> None:
        self.inner.reset(hip)
        self.resets += 1
        self.number, self.time = 0, 0.0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = self.inner.step(hip, velocity, dt)
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
    return lambda scene: Overpowering(resolve(base)(scene), scene, OVERPOWERING[name][1])


class Wrapped:
    """An honest renderer's answers, passed on; the ground of what is honest and yet no exact answer."""

    def __init__(self, inner: Renderer, scene: Scene) -> None:
        self.inner, self.stiffness = inner, scene.stiffness

    def reset(self, hip: np.ndarray) -> None:
        self.inner.reset(hip)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        return Response(*self.inner.step(hip, velocity, dt))


class Single(Wrapped):
    """Computes in single precision."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip = np.asarray(self.inner.step(hip, velocity, dt).ihip, dtype=np.float32)
        if np.all(ihip == hip.astype(np.float32)):
            return Response(hip, 0.0 * hip)
        return Response(ihip, np.float32(self.stiffness) * (ihip - hip.astype(np.float32)))


class Lists(Wrapped):
    """Answers with lists."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = self.inner.step(hip, velocity, dt)
        return Response(ihip.tolist(), force.tolist())  # type: ignore[arg-type]


class Silent(Wrapped):
    """Gives a force only."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        return Response(hip, self.inner.step(hip, velocity, dt).force)


class Late(Wrapped):
    """Answers as the honest renderer did some ticks ago, in both or with the IHIP alone."""

    ticks, whole = 1, True

    def reset(self, hip: np.ndarray) -> None:
        self.inner.reset(hip)
        self.kept: list[Response] = []

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.kept.append(Response(*self.inner.step(hip, velocity, dt)))
        old = self.kept[-1 - min(self.ticks, len(self.kept) - 1)]
        if self.whole:
            return old
        touching = np.any(self.kept[-1].ihip != hip)
        return Response(old.ihip if touching else hip, self.stiffness * (old.ihip - hip) if touching else 0.0 * hip)


class Aloof(Wrapped):
    """Keeps its tool 0.1 mm off the surface, and declares that."""

    standoff = 1e-4

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = self.inner.step(hip, velocity, dt)
        size = float(np.linalg.norm(force))
        if size == 0.0:
            return Response(ihip, force)
        tool = ihip + self.standoff * force / size
        return Response(tool, self.stiffness * (tool - hip))


def _late(count: int, *, whole: bool) -> type[Late]:
    return type("Late", (Late,), {"ticks": count, "whole": whole})


HONEST: dict[str, type[Wrapped]] = {
    "single": Single,
    "lists": Lists,
    "silent": Silent,
    "aloof": Aloof,
    **{f"late-{count}": _late(count, whole=True) for count in (1, 2, 3)},
    **{f"late-tool-{count}": _late(count, whole=False) for count in (1, 3)},
}
"""What is honest, by name."""


def honest(name: str, base: str = "minimum-distance", *, declares: bool = False) -> Callable[[Scene], Wrapped]:
    """A renderer factory for one of `HONEST`; it may declare the spring that it is."""

    def make(scene: Scene) -> Wrapped:
        made = HONEST[name](resolve(base)(scene), scene)
        if declares:
            made.declares = Declaration(spring=Spring.ERROR)  # type: ignore[attr-defined]
        return made

    return make
