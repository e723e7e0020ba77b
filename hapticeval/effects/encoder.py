"""Encoders: a controller sees joint positions in whole counts (thesis 2.6, A.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hapticeval.effects.effect import Effect, Part, Stage, number
from hapticeval.errors import InputError
from hapticeval.quantity import format_quantity
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.devices.device import Device


@dataclass(frozen=True)
class Encoder(Effect):
    """Round each joint position to the nearest multiple of `step` (rad, or m for the point mass).

    `counts` per turn may be given instead, for joints that turn. Raises `InputError` where both are given, or neither.
    """

    step: float | None = number("position", default=None)
    counts: float | None = number("", default=None, compare=False)

    kind: ClassVar[str] = "encoder"
    stage: ClassVar[Stage] = Stage.SENSE
    channels: ClassVar[tuple[str, ...]] = ("measured_hip", "measured_velocity")
    linear: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.step is None) == (self.counts is None):
            how = "neither" if self.step is None else "both"
            raise InputError(f"{how} encoder_counts and encoder_step are given", todo="give one of them")
        if self.counts is not None:
            object.__setattr__(self, "step", 2.0 * math.pi / self.counts)

    def check(self, device: Device) -> None:
        """Refuse counts per turn for a device that does not turn."""
        if self.counts is not None and not device.turning:
            raise InputError(
                f"encoder_counts = {self.counts!r} for a point mass",
                why="counts are of a turn, and its joints are its position in metres",
                todo="give encoder_step (m), or a device with joints that turn",
            )

    def part(self, ticks: int, size: int, dt: float) -> Part:  # noqa: ARG002 - as every effect
        """Assemble the rounding: `params` is the step."""
        return Part(round_to_counts, np.array([self.step]))

    def describe(self, *, turning: bool) -> str:
        """Describe the step, and the counts per turn it is."""
        assert self.step is not None
        counts = f" ({2.0 * math.pi / self.step:,.0f} counts a turn)" if turning else ""
        return f"encoders of {format_quantity(self.step, 'rad' if turning else 'm')} a count{counts}"


def round_to_counts(
    params: Array, samples: Array, state: Array, tick: int, dt: float, joints: Array, rates: Array  # noqa: ARG001
) -> float:  # fmt: skip
    """Round `joints` (N,), rad or m, to whole counts of the encoder: multiples of its step, `params` (1,)."""
    for i in range(joints.shape[0]):
        joints[i] = params[0] * float(np.rint(joints[i] / params[0]))
    return 0.0
