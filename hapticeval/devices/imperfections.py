"""What separates a real device from an ideal one (thesis 2.6): each off unless a scene asks for it.

As numbers for compiled loops: an encoder gives the nearest multiple of its step. Velocity is taken from the sampled
positions as a first-order filter of their differences, v⁺ = v + (1 - e^{-2π f dt}) (Δq/dt - v), which starts from the
true velocity, as if the device had moved so before. A force sensor filters the hand's force likewise, adds noise to
each sample and rounds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hapticeval.errors import InputError
from hapticeval.types import Array

ENCODER_COUNTS = 262_144
"""Counts per turn of the robot's encoders, four for each of 65,536 lines (thesis A.1)."""

ENCODER_STEP = 2.0 * math.pi / ENCODER_COUNTS
"""2.4e-5 rad per count."""

STEADY = 1e-9
"""A share of a tick below which a delay is a whole number of ticks: what rounding leaves of one."""


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


def blend(cutoff: float, dt: float) -> float:
    """Return the share of the new value that a low-pass of `cutoff` (Hz) takes in a tick of `dt` s; 1 for inf."""
    return -math.expm1(-2.0 * math.pi * cutoff * dt)


def sensing(imperfections: Imperfections, dt: float) -> Array | None:
    """Return encoder step (0: exact) and blend of the velocity filter (0: exact), (2,); None where both are exact."""
    step, cutoff = imperfections.encoder_step, imperfections.velocity_cutoff
    if step is None and cutoff is None:
        return None
    return np.array([step or 0.0, 0.0 if cutoff is None else blend(cutoff, dt)])


def actuation(imperfections: Imperfections, dt: float) -> Array | None:
    """Return torque limit (inf: none), delay in whole ticks and seconds beyond, (3,); None where both are ideal."""
    limit, delay = imperfections.torque_limit, imperfections.delay
    if limit is None and delay == 0.0:
        return None
    ticks = delay / dt
    whole = math.floor(ticks + STEADY)
    rest = ticks - whole
    return np.array([math.inf if limit is None else limit, whole, rest * dt if rest > STEADY else 0.0])


def feeling(sensor: ForceSensor | None, shape: tuple[int, int], dt: float) -> tuple[Array | None, Array | None]:
    """Return a force sensor's noise at `shape` = (ticks, N), N, and its step and blend, (2,); None without one."""
    if sensor is None:
        return None, None
    noise = sensor.noise * np.random.default_rng(sensor.seed).standard_normal(shape)
    return noise, np.array([sensor.step, blend(sensor.cutoff, dt)])
