"""Right renderers whose answers come late by a number of ticks, which may lie between two: one number for all of a run.

Each channel may be late by itself. Between ticks a late value is on the straight way between the two around it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from honest import Changed, Spring

from hapticeval.renderer import Renderer, Response
from hapticeval.scene import Scene


class Latecomer(Changed):
    """Answers the IHIP of `ihip` ticks ago, and the force of `force` ticks ago."""

    def __init__(self, scene: Scene, inner: Renderer, *, ihip: float = 0.0, force: float = 0.0) -> None:
        super().__init__(scene, inner)
        self.late = {"hip": ihip, "ihip": ihip, "force": force}

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.before: dict[str, list[np.ndarray]] = {"hip": [], "ihip": [], "force": []}

    def seen(self, channel: str, value: np.ndarray) -> np.ndarray:
        """Remember a channel's value, and return the one that is as late as the channel is."""
        values, late = self.before[channel], self.late[channel]
        values.append(np.array(value))
        del values[: -math.ceil(late) - 1]
        whole = math.floor(late)
        newer, older = (values[max(-1 - ticks, -len(values))] for ticks in (whole, whole + 1))
        share = late - whole
        return newer if share == 0.0 else (1.0 - share) * newer + share * older

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(self.seen("ihip", ihip), self.seen("force", force))


class LateTool(Latecomer):
    """Looks for its tool from where the hand was `ihip` ticks ago, and pulls to it from where the hand is now."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        old = self.seen("hip", hip)
        ihip = Changed.step(self, old, velocity, dt).ihip
        free = np.array_equal(ihip, old)
        return Response(ihip, np.zeros_like(hip) if free else self.scene.stiffness * (ihip - hip))


def late(kind: type[Latecomer] = Latecomer, **ticks: float) -> Callable[[Scene], Any]:
    """Return the factory of a `Spring` that is so late."""
    return lambda scene: kind(scene, Spring(scene), **ticks)
