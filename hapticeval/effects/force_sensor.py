"""A force sensor at the handle: it measures the hand's force, which inner loops and renderers then use (8.6)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hapticeval.effects.effect import Effect, Part, Stage, number
from hapticeval.effects.velocity_filter import low_pass_share
from hapticeval.quantity import format_quantity
from hapticeval.types import Array


@dataclass(frozen=True)
class ForceSensor(Effect):
    """Filter the hand's force with a first-order low-pass, add noise to each sample, and round.

    `step` (N, 0 = none) is its quantum, `noise` (N) the standard deviation of each sample, `cutoff` (Hz, inf = none)
    that of the low-pass; `seed` of the noise.
    """

    step: float = number("N", at=True, default=0.0)
    noise: float = number("N", at=True, default=0.0)
    cutoff: float = number("Hz", finite=False, default=math.inf)
    seed: int = number("", at=True, default=0)

    kind: ClassVar[str] = "force-sensor"
    stage: ClassVar[Stage] = Stage.FEEL
    channels: ClassVar[tuple[str, ...]] = ("measured_force",)

    def part(self, ticks: int, size: int, dt: float) -> Part:
        """Assemble the sensor: `params` are step and blend, `samples` the noise, `state` (1, N) the filtered force."""
        noise = self.noise * np.random.default_rng(self.seed).standard_normal((ticks, size))
        return Part(measure_force, np.array([self.step, low_pass_share(self.cutoff, dt)]), noise, np.zeros((1, size)))

    def describe(self, *, turning: bool) -> str:  # noqa: ARG002 - as every effect
        """Describe what of it is not ideal."""
        imperfections = [
            f"{word} {format_quantity(size, 'N')}"
            for word, size in (("quantum", self.step), ("noise", self.noise))
            if size
        ]
        if math.isfinite(self.cutoff):
            imperfections.append(f"low-passed at {format_quantity(self.cutoff, 'Hz')}")
        return "force sensor" + (f" ({', '.join(imperfections)})" if imperfections else ", ideal")


def measure_force(
    params: Array, samples: Array, state: Array, tick: int, dt: float, force: Array, unused: Array  # noqa: ARG001
) -> float:  # fmt: skip
    """Replace the hand's `force` (N,), N, by what a sensor gives of it: low-passed, with noise, and rounded.

    `params` (2,) are the quantum (N) and the low-pass's share of a new value; `samples` (ticks, N) the noise, N;
    `state` (1, N) the filtered force, N.
    """
    for i in range(force.shape[0]):
        # the filter starts at the first force, as if it had always been that
        state[0, i] = force[i] if tick == 0 else state[0, i] + params[1] * (force[i] - state[0, i])
        force[i] = state[0, i] + samples[tick, i]
        if params[0] > 0.0:
            force[i] = params[0] * float(np.rint(force[i] / params[0]))
    return 0.0
