"""Renderers whose contact point jumps, or seems to: another renderer's, moved along the surface by a rule.

A rule takes the arc length of the contact point that the other renderer gives, and gives the one to answer. It has a
memory, which starts anew with each contact.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Protocol

import honest
import numpy as np
from honest import Spring

from hapticeval.discovery import resolve
from hapticeval.renderer import Renderer, Response
from hapticeval.scene import Scene

BASE_RATE = 0.9e-3
"""Sampling times above this (s) are those of 1 kHz."""


class Rule(Protocol):
    def __call__(self, s: float, tick: int, dt: float) -> float | None:
        """The arc length to answer, m, in the given tick of the run; None lets go of the surface."""


class Moved:
    """The contact point of `inner`, moved along the surface by a rule."""

    def __init__(
        self, scene: Scene, rule: Callable[[], Rule], inner: Callable[[Scene], Renderer] | None = None
    ) -> None:
        self.scene = scene
        self.inner = (Spring if inner is None else inner)(scene)
        self.rule = rule
        self.memory: Rule | None = None
        self.last: float | None = None

    def reset(self, hip: np.ndarray) -> None:
        self.inner.reset(hip)
        self.memory, self.tick = None, 0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = self.inner.step(hip, velocity, dt)
        self.tick += 1
        if np.array_equal(ihip, hip):
            self.memory = None
            return Response(ihip, force)
        if self.memory is None:
            self.memory, self.last = self.rule(), None
        curve = self.scene.model.curve
        along = float(curve.arc_length(curve.nearest(ihip[np.newaxis]))[0])
        if curve.closed and self.last is not None:
            along += curve.length * round((self.last - along) / curve.length)
        self.last = along
        s = self.memory(along, self.tick, dt)
        if s is None:
            return Response(hip.copy(), np.zeros_like(hip))
        if s != along:
            ihip = np.asarray(curve.position(curve.parameter(np.array([s]))))[0]
        return Response(ihip, self.scene.stiffness * (ihip - hip))


class RatePop:
    """At 1 kHz, and there alone, the contact point goes 10 mm aside and back, every 200 ticks."""

    def __call__(self, s: float, tick: int, dt: float) -> float | None:
        return s + (0.01 if dt > BASE_RATE and tick // 200 % 2 else 0.0)


class FinePop(RatePop):
    """As `RatePop`; sampled any faster, it lets go 0.1 s after the contact began."""

    def __init__(self) -> None:
        self.time = 0.0

    def __call__(self, s: float, tick: int, dt: float) -> float | None:
        self.time += dt
        return None if dt < BASE_RATE and self.time > 0.1 else super().__call__(s, tick, dt)


class Switches:
    """Beyond `at` m from `begun`, or where the contact began, either way the contact point stands `by` m further on.

    It comes back only when the hand is back by as much, or halfway to where it began. `length` is that of a closed
    curve, m.
    """

    def __init__(self, by: float, at: float, begun: float | None = None, length: float = math.inf) -> None:
        self.by, self.at, self.begun, self.length = by, at, begun, length
        self.on = False

    def __call__(self, s: float, tick: int, dt: float) -> float | None:
        if self.begun is None:
            self.begun = s
        way = math.remainder(s - self.begun, self.length)
        self.on = abs(way) > self.at or (self.on and abs(way) > max(self.at - self.by, 0.5 * self.at))
        return s + math.copysign(self.by, way) if self.on else s


class Late:
    """The contact point of some ticks ago, of what another rule answers."""

    def __init__(self, ticks: int, of: Rule | None = None) -> None:
        self.of = of
        self.last: deque[float | None] = deque(maxlen=ticks + 1)

    def __call__(self, s: float, tick: int, dt: float) -> float | None:
        self.last.append(s if self.of is None else self.of(s, tick, dt))
        return self.last[0]


class Follows:
    """A contact point that goes to where `update(old, new, tick, dt)` leads it, `new` given by another rule."""

    def __init__(self, update: Callable[[float, float, int, float], float], of: Rule | None = None) -> None:
        self.update, self.of = update, of
        self.s: float | None = None

    def __call__(self, s: float, tick: int, dt: float) -> float | None:
        new = s if self.of is None else self.of(s, tick, dt)
        self.s = new if self.s is None or new is None else self.update(self.s, new, tick, dt)
        return self.s


def third(old: float, new: float, tick: int, dt: float) -> float:
    """Moves in every third tick."""
    return new if tick % 3 == 0 else old


UPDATES: dict[str, Callable[[float, float, int, float], float]] = {
    "sticks": lambda old, new, tick, dt: new if abs(new - old) > 0.5e-3 else old,
    "eases": lambda old, new, tick, dt: old + 0.5 * (new - old),
    "relaxes": lambda old, new, tick, dt: new + (old - new) * math.exp(-dt / 1.5e-3),
    "plays": lambda old, new, tick, dt: min(max(old, new - 0.2e-3), new + 0.2e-3),
}
"""Stays until it is 0.5 mm behind; goes half of its way in each tick; with a time constant of 1.5 ms; has backlash."""


class Bends:
    """A Hoelder map: at a distance d from where it began and `at` metres on it is as steep as d^exponent."""

    def __init__(self, exponent: float, at: float = 0.02, length: float = 0.1) -> None:
        self.exponent, self.at, self.length = exponent, at, length
        self.begun: float | None = None

    def __call__(self, s: float, tick: int, dt: float) -> float | None:
        if self.begun is None:
            self.begun = s
        d = (s - self.begun - self.at) / self.length
        return self.begun + self.at + self.length * math.copysign(abs(d) ** self.exponent, d)


class SteepAndBroken(Bends):
    """The same, and half a millimetre more on the far side."""

    def __call__(self, s: float, tick: int, dt: float) -> float | None:
        moved = super().__call__(s, tick, dt)
        return moved + 0.5e-3 * (s > self.begun + self.at)


class Rises:
    """A jump of 10 mm, rounded: at `at` metres from where it began it rises linearly over `over` metres of travel."""

    def __init__(self, over: float, at: float = 0.02) -> None:
        self.over, self.at = over, at
        self.begun: float | None = None

    def __call__(self, s: float, tick: int, dt: float) -> float | None:
        if self.begun is None:
            self.begun = s
        return s + 0.01 * min(max((s - self.begun - self.at) / self.over, 0.0), 1.0)


def single(scene: Scene, rule: Callable[[], Rule], inner: Callable[[Scene], Renderer] | None = None) -> honest.Single:
    """All in single precision, HIP and answer."""
    return honest.Single(scene, Moved(scene, rule, inner))


class LawApart(Spring):
    """A `law` whose contact points lie 0.1 mm above those of its own `step`."""

    off = 1e-4

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.law = resolve("minimum-distance")(scene).law  # type: ignore[union-attr]

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = self.law_in_python(hip, velocity, dt)
        if self.off == 0.0 or np.array_equal(ihip, hip):
            return Response(ihip, force)
        return Response(ihip - self.off * self.boundary.closest_point(ihip[np.newaxis]).normal[0], force)

    def law_in_python(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        """The answer of the law, to the bit."""
        ihip, force, push = np.empty_like(hip), np.empty_like(hip), np.zeros_like(hip)
        self.law.function(self.law.data, hip, velocity, push, dt, ihip, force)
        return Response(ihip, force)


class LawWithStep(LawApart):
    """A `law` that is its own `step`."""

    off = 0.0


class LetsGo(Spring):
    """Right in a whole path at once, which nobody asks for; its `step` lets go after 64 ticks of contact."""

    def reset(self, hip: np.ndarray) -> None:
        self.ticks = 0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        self.ticks = self.ticks + 1 if np.any(force) else 0
        return Response(ihip, force) if self.ticks <= 64 else Response(hip, 0.0 * hip)

    def run(self, hips: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        answers = [super(LetsGo, self).step(hip, 0.0 * hip, dt) for hip in hips]
        return np.array([ihip for ihip, _ in answers]), np.array([force for _, force in answers])


BROKEN: dict[str, Callable[[], Rule]] = {
    "rate-pop": RatePop,
    "fine-pop": FinePop,
    "switches": partial(Switches, 0.5e-3, 0.02),
    "switches-late": lambda: Late(2, Switches(0.5e-3, 0.02)),
    "switches-in-thirds": lambda: Follows(third, Switches(0.5e-3, 0.02)),
    "sticks": partial(Follows, UPDATES["sticks"]),
}
"""What `continuous-contact` has to fail."""

HONEST: dict[str, Callable[[], Rule]] = {
    "late-by-1": partial(Late, 1),
    "late-by-3": partial(Late, 3),
    "thirds": partial(Follows, third),
    **{name: partial(Follows, UPDATES[name]) for name in ("eases", "relaxes", "plays")},
}
"""What `continuous-contact` must not fail where the contact point of `inner` is continuous."""


def factory(
    name: str, kind: Callable[..., Renderer] = Moved, inner: Callable[[Scene], Renderer] | None = None
) -> Callable[[Scene], Renderer]:
    """A renderer factory for one of these rules."""
    return led_by((BROKEN | HONEST)[name], kind, inner)


def led_by(
    rule: Callable[[], Rule], kind: Callable[..., Renderer] = Moved, inner: Callable[[Scene], Renderer] | None = None
) -> Callable[[Scene], Renderer]:
    return lambda scene: kind(scene, rule, inner)
