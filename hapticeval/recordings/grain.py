"""How finely the numbers of a column are told: an encoder's lattice, the digits of a text, single precision."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.recordings.signal_faults import quantum
from hapticeval.types import Array

SAMPLE = 400
"""So many numbers are looked at, evenly spread over the column."""

FEWEST = 50
"""Of so few different numbers nothing is said: they may be round by themselves."""

DIGITS = range(3, 15)
"""Significant digits that a text may keep; a double has 15 to 17."""


def grain(values: Array) -> float:
    """The step between neighbouring numbers that a column (n,) can tell, at its largest; 0 for double precision."""
    return max(quantum(values) or 0.0, _written(values))


def _written(values: Array) -> float:
    """The unit in the last place of the largest number, where all were rounded alike; otherwise 0."""
    kept = values[np.isfinite(values) & (values != 0.0)]
    if kept.size == 0:
        return 0.0
    largest = float(np.max(np.abs(kept)))
    sample = np.unique(kept[np.linspace(0, kept.size - 1, SAMPLE).astype(int)])
    if sample.size < FEWEST:
        return 0.0
    single = np.array_equal(sample.astype(np.float32), sample)
    step = float(np.spacing(np.float32(largest))) if single else 0.0
    for digits in DIGITS:
        rounded = np.array([float(f"{number:.{digits - 1}e}") for number in sample])
        if np.all(np.abs(rounded - sample) <= 2.0 * np.spacing(np.abs(sample))):  # a change of unit rounds again
            return max(step, float(10.0 ** (math.floor(math.log10(largest)) - digits + 1)))
    return step
