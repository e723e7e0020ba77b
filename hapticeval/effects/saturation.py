"""Saturation: a motor gives no more than its peak torque (thesis 2.6, A.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hapticeval.effects.effect import Effect, Part, Stage, number
from hapticeval.types import Array


@dataclass(frozen=True)
class Saturation(Effect):
    """Limit the torque of each motor to ± `limit` (N m; N for the point mass)."""

    limit: float = number("force")

    kind: ClassVar[str] = "saturation"
    stage: ClassVar[Stage] = Stage.COMMAND
    linear: ClassVar[bool] = False
    words: ClassVar[str] = "motors saturate at {limit}"

    def part(self, ticks: int, size: int, dt: float) -> Part:  # noqa: ARG002 - as every effect
        """Assemble the limit: `params`."""
        return Part(clip_torque, np.array([self.limit]))


def clip_torque(
    params: Array, samples: Array, state: Array, tick: int, dt: float, torque: Array, before: Array  # noqa: ARG001
) -> float:  # fmt: skip
    """Clip each motor's `torque` (N,), N m (N for the point mass), to ± the limit, `params` (1,)."""
    for i in range(torque.shape[0]):
        torque[i] = min(max(torque[i], -params[0]), params[0])
    return 0.0
