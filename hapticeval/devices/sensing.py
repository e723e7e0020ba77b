"""What the sensors make of the truth (thesis 2.6), as numbers for compiled loops: encoders, velocity, force.

An encoder gives the nearest multiple of its step. Velocity is taken from the sampled positions as a first-order filter
of their differences, v⁺ = v + (1 - e^{-2π f dt}) (Δq/dt - v), which starts from the true velocity, as if the device had
moved so before. A force sensor filters the hand's force likewise, adds noise to each sample and rounds.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.devices.imperfections import ForceSensor, Imperfections
from hapticeval.types import Array

STEADY = 1e-9
"""A share of a tick below which a delay is a whole number of ticks: what rounding leaves of one."""


def blend(cutoff: float, dt: float) -> float:
    """The share of the new value that a first-order low-pass of `cutoff` (Hz) takes in a tick of `dt` s; 1 for inf."""
    return -math.expm1(-2.0 * math.pi * cutoff * dt)


def sensing(imperfections: Imperfections, dt: float) -> Array | None:
    """Encoder step (0: exact) and blend of the velocity filter (0: exact), (2,); None where both are exact."""
    step, cutoff = imperfections.encoder_step, imperfections.velocity_cutoff
    if step is None and cutoff is None:
        return None
    return np.array([step or 0.0, 0.0 if cutoff is None else blend(cutoff, dt)])


def actuation(imperfections: Imperfections, dt: float) -> Array | None:
    """Torque limit (inf: none), and the delay in whole ticks and seconds beyond, (3,); None where all is ideal."""
    limit, delay = imperfections.torque_limit, imperfections.delay
    if limit is None and delay == 0.0:
        return None
    ticks = delay / dt
    whole = math.floor(ticks + STEADY)
    rest = ticks - whole
    return np.array([math.inf if limit is None else limit, whole, rest * dt if rest > STEADY else 0.0])


def feeling(sensor: ForceSensor | None, shape: tuple[int, int], dt: float) -> tuple[Array | None, Array | None]:
    """A force sensor's noise at `shape` = (ticks, N) samples, N, and its step and blend, (2,); None where it is not."""
    if sensor is None:
        return None, None
    noise = sensor.noise * np.random.default_rng(sensor.seed).standard_normal(shape)
    return noise, np.array([sensor.step, blend(sensor.cutoff, dt)])
