"""What separates a real device from an ideal one (thesis 2.6): each off unless a scene asks for it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hapticeval.errors import InputError

ENCODER_COUNTS = 262_144
"""Counts a turn of the robot's encoders, four for each of 65,536 lines (thesis A.1)."""

ENCODER_STEP = 2.0 * math.pi / ENCODER_COUNTS
"""2.4e-5 rad a count."""


@dataclass(frozen=True, kw_only=True)
class ForceSensor:
    """A sensor at the handle: `step` (N, 0 = none) is its quantum, `noise` (N) the standard deviation of each sample,
    `cutoff` (Hz, inf = none) of its first-order low-pass; `seed` of the noise.

    Raises `InputError` for a number that is negative, or not finite where it must be.
    """

    step: float = 0.0
    noise: float = 0.0
    cutoff: float = math.inf
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value in (("step", self.step), ("noise", self.noise)):
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"the force sensor's {name} = {value!r} N", why="it must be finite and not negative")
        if not self.cutoff > 0.0:
            raise InputError(
                f"the force sensor's cutoff = {self.cutoff!r} Hz",
                why="it must be positive",
                todo="leave it out for none",
            )


@dataclass(frozen=True, kw_only=True)
class Imperfections:
    """The real-world effects of section 2.6 that a scene calls for; None or 0 is off, and free.

    `encoder_step` (rad a count; m for the point mass) quantises joint positions; `torque_limit` (N m; N for the
    point mass) saturates each motor; `delay` (s) passes between sampling and output; `friction` (N m; N) is the
    Coulomb friction of each joint, which no controller knows of; `velocity_cutoff` (Hz) makes velocity the filtered
    difference of the sampled positions, where it is exact otherwise; `force_sensor` measures the hand's force, which
    inner loops and renderers then use (8.6).

    Raises `InputError` for a value that is negative or not finite.
    """

    encoder_step: float | None = None
    torque_limit: float | None = None
    delay: float = 0.0
    friction: float | None = None
    velocity_cutoff: float | None = None
    force_sensor: ForceSensor | None = None

    def __post_init__(self) -> None:
        for name in ("encoder_step", "torque_limit", "delay", "friction", "velocity_cutoff"):
            value = getattr(self, name)
            if value is None or (name == "delay" and value == 0.0):
                continue
            if not math.isfinite(value) or value <= 0.0:
                raise InputError(
                    f"{name} = {value!r}", why="it must be finite and positive", todo="leave it out for none"
                )
