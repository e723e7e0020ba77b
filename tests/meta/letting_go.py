"""Renderers that let go of the hand: what `contact-kept` is measured with.

Each wraps a right renderer, made by a factory, and spoils its answers. `LETTING_GO` names the fault's kind.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from honest import Changed

from hapticeval.renderer import Response
from hapticeval.scene import Scene

Make = Callable[[Scene], Any]


class Wrapped(Changed):
    """A renderer that answers as `inner` does, step by step."""

    def reset(self, hip):
        super().reset(hip)
        self.time = 0.0

    def step(self, hip, velocity, dt):
        self.time += dt
        return self.spoil(hip, super().step(hip, velocity, dt))

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


LETTING_GO: dict[str, tuple[str, type[Wrapped]]] = {
    "drops": ("let go", Drops),
    "flickers": ("let go", Flickers),
    "lets-deep-go": ("let go", LetsDeepGo),
    "never-meets": ("not met", Never),
    "trails": ("trails", Trails),
}
"""Fault: the kind that `contact-kept` must give it, in `evidence["kind"]`, and its wrapper round a right renderer."""


def wrapping(wrapper: type[Wrapped], make: Make) -> Make:
    """The factory of a wrapped renderer."""
    return lambda scene: wrapper(scene, make(scene))
