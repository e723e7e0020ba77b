"""Velocity from differences: what a controller has where nothing measures velocity (thesis 2.6)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hapticeval.effects.effect import Effect, Part, Stage, number
from hapticeval.types import Array


def low_pass_share(cutoff: float, dt: float) -> float:
    """Return the share of the new value that a low-pass of `cutoff` (Hz) takes in a tick of `dt` s; 1 for inf."""
    return -math.expm1(-2.0 * math.pi * cutoff * dt)


@dataclass(frozen=True)
class VelocityFilter(Effect):
    """Take joint rates from differences of the sampled positions, through a first-order low-pass of `cutoff` (Hz).

    v⁺ = v + (1 - e^{-2π f dt}) (Δq/dt - v), from the true velocity on, as if the device had moved so before.
    """

    cutoff: float = number("Hz")

    kind: ClassVar[str] = "velocity-filter"
    stage: ClassVar[Stage] = Stage.SENSE
    channels: ClassVar[tuple[str, ...]] = ("measured_velocity",)
    words: ClassVar[str] = "velocity from differences, low-passed at {cutoff}"

    def part(self, ticks: int, size: int, dt: float) -> Part:  # noqa: ARG002 - as every effect
        """Assemble the filter: `params` is its blend, `state` (2, N) the last positions and rates."""
        return Part(filtered_difference, np.array([low_pass_share(self.cutoff, dt)]), state=np.zeros((2, size)))

    def active(self, damping: float) -> str | None:
        """Return why it gives energy away where a damper acts on the filtered velocity; None without damping."""
        return "a damper on a filtered velocity is late, and so gives energy away" if damping > 0.0 else None


def filtered_difference(
    params: Array, samples: Array, state: Array, tick: int, dt: float, joints: Array, rates: Array  # noqa: ARG001
) -> float:  # fmt: skip
    """Replace joint `rates` (N,), rad/s or m/s, by the low-passed difference of joint positions (N,), rad or m.

    `params` (1,) is the low-pass's share of a new value; `state` (2, N) the positions and rates of the last sample.
    """
    for i in range(joints.shape[0]):
        if tick > 0:  # there is no difference at the first sample: it keeps the true rate
            rates[i] = state[1, i] + params[0] * ((joints[i] - state[0, i]) / dt - state[1, i])
        state[0, i], state[1, i] = joints[i], rates[i]
    return 0.0
