"""Renderers with one fault each, round a right one: a force of the wrong size or direction, or a contact let go.

A fault takes a `Tick` and returns the answer, IHIP and force, in place of the right one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from honest import Changed

from hapticeval.discovery import resolve
from hapticeval.renderer import Renderer, Response
from hapticeval.scene import Scene

Make = Callable[[Scene], Any]


@dataclass
class Tick:
    """What a fault sees: the tick and time (s) since the reset, how often it was reset, the hand, the right answer."""

    scene: Scene
    resets: int
    hip: np.ndarray
    number: int = 0
    time: float = 0.0
    dt: float = 0.0
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(2))
    ihip: np.ndarray = field(default_factory=lambda: np.zeros(2))
    force: np.ndarray = field(default_factory=lambda: np.zeros(2))
    memory: dict[str, Any] = field(default_factory=dict)

    @property
    def inside(self) -> bool:
        return bool(np.any(self.ihip != self.hip))


Fault = Callable[[Tick], tuple[np.ndarray, np.ndarray]]


class Spoiled(Changed):
    """A right renderer whose answers `fault` spoils; it declares what the right one does."""

    def __init__(self, scene: Scene, inner: Renderer, fault: Fault) -> None:
        super().__init__(scene, inner)
        self.fault, self.resets = fault, 0

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.resets += 1
        self.tick = Tick(self.scene, self.resets, hip)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        tick = self.tick
        tick.hip, tick.velocity, tick.dt = hip, velocity, dt
        tick.ihip, tick.force = super().step(hip, velocity, dt)
        answer = Response(*self.fault(tick))
        tick.number, tick.time = tick.number + 1, tick.time + dt
        return answer


def free(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    return tick.hip, np.zeros_like(tick.hip)


def free_where(there: Callable[[Tick], bool]) -> Fault:
    return lambda tick: free(tick) if there(tick) else (tick.ihip, tick.force)


def right(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    return tick.ihip, tick.force


def late_force(fault: Fault, ticks: float) -> Fault:
    """What `fault` makes of an answer, with the force so many ticks late, or between two."""

    def late(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
        ihip, force = fault(tick)
        past = tick.memory.setdefault("past", [])
        past.append(force)
        whole, share = divmod(ticks, 1.0)
        one, two = (past[max(0, len(past) - 1 - int(whole) - more)] for more in (0, 1))
        return ihip, (1.0 - share) * one + share * two

    return late


def trails(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """In free space the proxy goes a twentieth of the way to the hand at each tick; there is no force there."""
    proxy = tick.memory.setdefault("proxy", tick.hip)
    tick.memory["proxy"] = tick.ihip if tick.inside else proxy + 0.05 * (tick.hip - proxy)
    return tick.memory["proxy"], tick.force if tick.inside else np.zeros_like(tick.hip)


LETTING_GO: dict[str, tuple[str, Fault]] = {
    "drops": ("let go", free_where(lambda tick: tick.time > 0.2985)),
    "flickers": ("let go", free_where(lambda tick: tick.number % 100 == 99)),
    "lets-deep-go": ("let go", free_where(lambda tick: bool(np.linalg.norm(tick.hip - tick.ihip) > 2e-3))),
    "never-meets": ("not met", free),
    "trails": ("trails", trails),
}
"""Fault: the kind that `contact-kept` must give it, in `evidence["kind"]`, and what it does."""


def falls_through(tick: Tick) -> bool:
    """Loses the surface at one place, as a proxy does at the edge of two triangles, until the hand enters anew."""
    fallen = tick.memory.get("fallen", False)
    tick.memory["fallen"] = tick.inside and (fallen or 0.03 < tick.hip[1] < 0.031)
    return bool(tick.memory["fallen"])


def strays(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """The IHIP lies 1 mm under the surface, and jumps 10 mm along it halfway; the force is along the normal there."""
    if not np.any(tick.force):
        return tick.ihip, tick.force
    angle = 0.1 * (tick.hip[1] > 0.03)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    at = tick.scene.model.boundary.closest_point((turn @ tick.ihip)[np.newaxis])
    return at.foot[0] - 0.001 * at.normal[0], np.linalg.norm(tick.force) * at.normal[0]


def scaled(factor: Callable[[Tick], float]) -> Fault:
    return lambda tick: (tick.ihip, factor(tick) * tick.force)


SIZE = frozenset({"force-magnitude"})
BOTH = SIZE | {"passivity"}
OVERPOWERING: dict[str, tuple[frozenset[str], Fault]] = {
    "third": (SIZE, scaled(lambda tick: 1.0 / 3.0)),
    "half": (SIZE, scaled(lambda tick: 0.5)),
    "stiffer": (SIZE, scaled(lambda tick: 1.05)),
    "one-newton": (SIZE, scaled(lambda tick: 1.0 / float(np.linalg.norm(tick.force) or 1.0))),
    "spikes": (SIZE, scaled(lambda tick: 10.0 if tick.number % 50 == 49 else 1.0)),
    "kicks": (BOTH, scaled(lambda tick: 1.1 if float(tick.velocity @ tick.force) > 0.0 else 1.0)),
    "drifts": (BOTH, scaled(lambda tick: 1.0 + 0.05 * tick.time)),
    "wears": (frozenset({"reset-clears"}), scaled(lambda tick: 0.97 ** (tick.resets - 1))),
    "swirls": (
        frozenset({"passivity"}),
        lambda tick: (tick.ihip, tick.force + 0.2 * np.array([-tick.force[1], tick.force[0]])),
    ),
}
"""Fault: the checks of force and energy that it must fail, and no other of these, and what it does.

`kicks` gives a tenth more on the way out, `swirls` a fifth of the force across it, which drives the hand round one way.
"""


def stale(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """In one tick of fifty the answer is that of the tick before."""
    before = tick.memory.get("answer", (tick.ihip, tick.force))
    tick.memory["answer"] = tick.ihip, tick.force
    return before if tick.number % 50 == 49 else (tick.ihip, tick.force)


def mirrored(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """The force follows the normal mirrored in the line under 45 degrees: x and y are exchanged."""
    return tick.ihip, tick.force[::-1].copy()


def left_handed(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """On the left of the model the force is a hundredth larger than on the right, seen along the x axis."""
    return tick.ihip, tick.force * (1.01 if tick.hip[1] > 0.0 else 1.0)


def first_edge(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """Up to a quarter of the outline from where it is listed first the force is a hundredth larger."""
    curve = tick.scene.model.curve
    along = curve.arc_length(curve.nearest(tick.ihip[np.newaxis]))[0] / curve.length
    return tick.ihip, tick.force * (1.01 if min(along, 1.0 - along) < 0.25 else 1.0)


class Shared:
    """What a renderer keeps in its class by mistake: all objects of it have it in common."""

    steps = 0


def shares(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """The force is a hundredth larger once another object has answered since this one's last answer."""
    own = tick.memory.get("steps", Shared.steps)
    Shared.steps += 1
    tick.memory["steps"] = Shared.steps
    return tick.ihip, tick.force * (1.0 if own == Shared.steps - 1 else 1.01)


RELATIONS: dict[str, tuple[str, Fault]] = {
    "left-handed": ("mirror-image", left_handed),
    "first-edge": ("vertex-order", first_edge),
    "ticks": ("time-subdivision", scaled(lambda tick: 1.0 if tick.dt == tick.scene.sampling_time else 1.01)),
    "stale": ("time-subdivision", stale),
    "shares": ("two-at-once", shares),
}
"""Fault: the relation that it breaks, and what it does. None of them breaks another."""

FAULTS: dict[str, Fault] = {
    "mirrored": mirrored,
    **{name: fault for name, (_, fault) in RELATIONS.items()},
    **{name: fault for name, (_, fault) in (LETTING_GO | OVERPOWERING).items()},
    "falls-through": free_where(falls_through),
    "strays": strays,
}


def spoiled(fault: str | Fault, make: Make | str = "minimum-distance") -> Make:
    """Return the factory of a right renderer, or of one by its name, with a fault or one of `FAULTS` by its name."""
    made = resolve(make) if isinstance(make, str) else make
    what = FAULTS[fault] if isinstance(fault, str) else fault

    return lambda scene: Spoiled(scene, made(scene), what)
