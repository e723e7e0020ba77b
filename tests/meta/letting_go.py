"""Renderers that let go of the hand, and honest ones that look like it: what `contact-kept` is measured with.

Each wraps a right renderer, made by a factory, and spoils or delays its answers. `LETTING_GO` names those that the
check must stop, with the fault's kind; `HONEST` those that it must not blame.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hapticeval.renderer import Response
from hapticeval.scene import Scene

Make = Callable[[Scene], Any]


class Wrapped:
    """A renderer that answers as `inner` does, step by step."""

    def __init__(self, inner: Any, scene: Scene) -> None:
        self.inner, self.scene = inner, scene
        self.resolution, self.standoff = getattr(inner, "resolution", 0.0), getattr(inner, "standoff", 0.0)
        self.surface = getattr(inner, "surface", None)
        self.time = 0.0

    def reset(self, hip):
        self.inner.reset(hip)
        self.time = 0.0

    def step(self, hip, velocity, dt):
        self.time += dt
        return self.spoil(hip, self.inner.step(hip, velocity, dt))

    def spoil(self, hip, given):
        return given


def free(hip):
    return Response(hip, np.zeros_like(hip))


class Drops(Wrapped):
    """After 0.3 s there is no contact any more."""

    def spoil(self, hip, given):
        return given if self.time < 0.3 else free(hip)


class Flickers(Wrapped):
    """Every hundredth tick is without contact."""

    count = 0

    def spoil(self, hip, given):
        self.count += 1
        return free(hip) if self.count % 100 == 0 else given


class LetsDeepGo(Wrapped):
    """A hand farther than 2 mm from the tool is let go, as by a proxy that looks for its contact near the hand only."""

    def spoil(self, hip, given):
        return free(hip) if np.linalg.norm(hip - given.ihip) > 2e-3 else given


class Never(Wrapped):
    """There is no surface."""

    def spoil(self, hip, given):
        return free(hip)


class Trails(Wrapped):
    """In free space the proxy goes a twentieth of the way to the hand at each tick; there is no force there."""

    def reset(self, hip):
        super().reset(hip)
        self.proxy = hip

    def spoil(self, hip, given):
        if np.any(given.ihip != hip):
            self.proxy = given.ihip
            return given
        self.proxy = self.proxy + 0.05 * (hip - self.proxy)
        return Response(self.proxy, np.zeros_like(hip))


class Late(Wrapped):
    """IHIP and force come `ticks` late."""

    ticks = 3

    def reset(self, hip):
        super().reset(hip)
        self.kept = []

    def spoil(self, hip, given):
        self.kept.append(given)
        return self.kept[-1 - min(self.ticks, len(self.kept) - 1)]


class LateByOne(Late):
    ticks = 1


class Single(Wrapped):
    """Computes and answers in single precision."""

    def step(self, hip, velocity, dt):
        answer = self.inner.step(hip.astype(np.float32).astype(np.float64), velocity, dt)
        return Response(*(np.asarray(part, dtype=np.float32) for part in answer))


class Lists(Wrapped):
    """Answers in lists."""

    def spoil(self, hip, given):
        return [float(x) for x in given.ihip], [float(x) for x in given.force]


class ForceOnly(Wrapped):
    """Gives no contact point."""

    def spoil(self, hip, given):
        return Response(hip, given.force)


class StandsOff:
    """The nearest point of a surface 0.1 mm under the model's, and says so: memory only of having been inside."""

    standoff = 1e-4

    def __init__(self, scene: Scene) -> None:
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        frame = self.boundary.frame(hip[np.newaxis])
        if frame.distance[0] >= -self.standoff:
            return free(hip)
        ihip = frame.foot[0] - self.standoff * frame.normal[0]
        return Response(ihip, self.stiffness * (ihip - hip))


LETTING_GO: dict[str, tuple[str, type[Wrapped]]] = {
    "drops": ("let go", Drops),
    "flickers": ("let go", Flickers),
    "lets-deep-go": ("let go", LetsDeepGo),
    "never-meets": ("not met", Never),
    "trails": ("trails", Trails),
}
"""Fault: the kind that `contact-kept` must give it, in `evidence["kind"]`, and its wrapper round a right renderer."""

HONEST: dict[str, Callable[[Make], Make]] = {
    "late-by-1": lambda make: lambda scene: LateByOne(make(scene), scene),
    "late-by-3": lambda make: lambda scene: Late(make(scene), scene),
    "single": lambda make: lambda scene: Single(make(scene), scene),
    "lists": lambda make: lambda scene: Lists(make(scene), scene),
    "force-only": lambda make: lambda scene: ForceOnly(make(scene), scene),
    "stands-off": lambda make: StandsOff,
}
"""What `contact-kept` must not fail: each makes of a right renderer's factory another."""


def wrapping(wrapper: type[Wrapped], make: Make) -> Make:
    """The factory of a wrapped renderer."""
    return lambda scene: wrapper(make(scene), scene)
