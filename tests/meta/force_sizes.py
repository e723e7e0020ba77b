"""A spring to the nearest point whose force is off in size, and honest ones whose stiffness varies and is declared.

`FAULTS` are of what a tick answers, see `broken.Tick`. None of the renderers round them declares a spring.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from broken import Fault, Tick, scaled, spoiled
from honest import Spring

from hapticeval.renderer import Declaration, Response
from hapticeval.scene import Scene


def kicking(change: Callable[[Tick, np.ndarray], np.ndarray]) -> Fault:
    """In the first three ticks of each contact the force (N,), N, is changed; the tick tells the normal's way."""

    def fault(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
        since = tick.memory["since"] = tick.memory.get("since", 0) + 1 if tick.inside else 0
        return tick.ihip, change(tick, tick.force) if 1 <= since <= 3 else tick.force

    return fault


def pushed(newtons: float) -> Callable[[Tick, np.ndarray], np.ndarray]:
    return lambda tick, force: force + newtons * force / (np.linalg.norm(force) or 1.0)


def dead(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """No force up to a depth of half a millimetre, and the spring's less that one's behind."""
    size, band = float(np.linalg.norm(tick.force)), 0.5e-3 * tick.scene.stiffness
    return tick.ihip, tick.force * (max(size - band, 0.0) / size if size > 0.0 else 1.0)


def slow(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """The force goes through a low-pass of 10 Hz that begins with the contact."""
    before = tick.memory.get("force", np.zeros_like(tick.force))
    after = before + (1.0 - np.exp(-2.0 * np.pi * 10.0 * tick.dt)) * (tick.force - before)
    tick.memory["force"] = after if tick.inside else np.zeros_like(tick.force)
    return tick.ihip, tick.memory["force"]


FAULTS: dict[str, Fault] = {
    "kick": kicking(pushed(3.0)),
    "triple-kick": kicking(lambda tick, force: 3.0 * force),
    "hard-kick": kicking(pushed(30.0)),
    "tenth": scaled(lambda tick: 0.1),
    "half": scaled(lambda tick: 0.5),
    "tenfold": scaled(lambda tick: 10.0),
    "dead-band": dead,
    "slow": slow,
    "outage": scaled(lambda tick: 0.0 if 1000 <= tick.number < 1057 else 1.0),
    "by-place": scaled(lambda tick: 1.0 + 0.2 * np.sin(2.0 * np.pi * (tick.ihip[0] / 0.02 - 0.25))),
}
"""Fault: what it does to the force. All but the last are off by a factor of two or more somewhere."""


def faulty(name: str) -> Callable[[Scene], Any]:
    """Return the factory of a spring that declares nothing, with one of the faults."""
    return spoiled(FAULTS[name], Spring)


class Declaring(Spring):
    """A spring whose stiffness goes with the depth's root, and which declares the range of that."""

    REFERENCE = 1e-3

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.declares = Declaration(stiffness_range=((self.REFERENCE / scene.model.size) ** 0.5, 32.0))

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        depth = float(np.linalg.norm(ihip - hip))
        return Response(ihip, force * ((self.REFERENCE / depth) ** 0.5 if depth > 0.0 else 1.0))


class Coarse(Spring):
    """A spring with a dead band of 0.09 N, as a motor's driver has one, and which declares it or does not."""

    BAND = 0.09

    def __init__(self, scene: Scene, *, declared: bool = True) -> None:
        super().__init__(scene)
        if declared:
            self.declares = Declaration(force_resolution=self.BAND)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force * (np.linalg.norm(force) > self.BAND))


class Quantized(Spring):
    """A spring behind a converter of 4 mN a component, which declares it or does not."""

    QUANTUM = 4e-3

    def __init__(self, scene: Scene, *, declared: bool = True) -> None:
        super().__init__(scene)
        if declared:
            self.declares = Declaration(force_resolution=self.QUANTUM)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, np.rint(force / self.QUANTUM) * self.QUANTUM)


class Damped(Spring):
    """A spring with a damper of 2 N s/m across the surface, which the scene does not call for."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        normal = self.boundary.closest_point(ihip[np.newaxis]).normal[0]
        return Response(ihip, force - 2.0 * (velocity @ normal) * normal * bool(force.any()))


def along_curves(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """The force pushes the hand on along its way, by 0.7 K times the step, wherever that bends by 1e-4 of it or more.

    It vanishes with the tick, as the hold of a force does and a lag, and there is none.
    """
    before, last = tick.memory.get("way", (tick.hip, tick.hip))
    tick.memory["way"] = last, tick.hip
    step = tick.hip - last
    bends = np.linalg.norm(step - (last - before)) > 1e-4 * np.linalg.norm(step)
    return tick.ihip, tick.force + 0.7 * tick.scene.stiffness * step * (bends and tick.inside)


class EverySecond(Spring):
    """Answers anew in every second tick, and gives that answer twice: half a tick late on the average."""

    def reset(self, hip: np.ndarray) -> None:
        self.ticks = 0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        if self.ticks % 2 == 0:
            self.answer = super().step(hip, velocity, dt)
        self.ticks += 1
        return self.answer
