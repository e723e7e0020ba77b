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
    return max(quantum(values) or 0.0, single(values), _decimal(values))


def single(values: Array) -> float:
    """The spacing of single precision at the largest number, where every number is one; otherwise 0."""
    sample, largest = _sample(values)
    with np.errstate(over="ignore"):
        alike = sample.size > 0 and np.array_equal(sample.astype(np.float32), sample)
    return float(np.spacing(np.float32(largest))) if alike else 0.0


def _decimal(values: Array) -> float:
    """The unit in the last place of the largest number, where all have so few digits; otherwise 0."""
    sample, largest = _sample(values)
    for digits in DIGITS if sample.size else ():
        rounded = np.array([float(f"{number:.{digits - 1}e}") for number in sample])
        if np.all(np.abs(rounded - sample) <= 2.0 * np.spacing(np.abs(sample))):  # a change of unit rounds again
            return float(10.0 ** (math.floor(math.log10(largest)) - digits + 1))
    return 0.0


def _sample(values: Array) -> tuple[Array, float]:
    """Different numbers of a column that are not zero, none where there are too few, and the largest of all."""
    kept = values[np.isfinite(values) & (values != 0.0)]
    if kept.size == 0:
        return kept, 0.0
    sample = np.unique(kept[np.linspace(0, kept.size - 1, SAMPLE).astype(int)])
    return sample if sample.size >= FEWEST else sample[:0], float(np.max(np.abs(kept)))
