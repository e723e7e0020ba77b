"""How finely the numbers of a recording are resolved.

A number is known to the largest of these:

    the spacing of single precision, where every number of the channel is one: that is what computed it
    the step of the lattice that the channel lies on, where it lies on one: an encoder's, a converter's
    the unit in the last place, where every number has so few digits: a text's
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.types import Array

FINEST_SHARE = 1e-7
"""A quantum below this share of the range cannot be distinguished from the rounding of the file."""

LATTICE_TOLERANCE = 0.02
"""How far from whole numbers the values may lie, in quanta."""

DIVISOR_STEPS = 500
"""Steps that a common divisor is taken of."""

SAMPLE_SIZE = 400
"""So many numbers are looked at, evenly spread over the column."""

FEWEST_DISTINCT = 50
"""Of so few different numbers nothing is said: they may be round by themselves."""

DECIMAL_DIGITS = range(3, 15)
"""Significant digits that a text may keep; a double has 15 to 17."""


def numeric_step(values: Array) -> float | None:
    """The quantum of a column (n,): the step of the lattice that all its values lie on, as an encoder's do.

    It is in the column's unit (m, N, rad, ...); None where the values lie on no lattice.
    """
    # The lattice shows in the differences of values, whatever order they came in.
    distinct = np.unique(values[np.isfinite(values)])
    if distinct.size < 4:
        return None
    span = float(distinct[-1] - distinct[0])
    steps = np.diff(distinct)
    # Smaller ones are one number in two roundings.
    steps = steps[steps > FINEST_SHARE * span]
    if steps.size == 0:
        return None
    step = common_divisor(steps, FINEST_SHARE * span)
    for _ in range(3):  # the mean over many steps is finer than the smallest alone
        counts = np.round((distinct - distinct[0]) / step)
        # A lattice finer than a 1e7th of the range is the spacing of the numbers themselves.
        if counts[-1] > 1.0 / FINEST_SHARE:
            return None
        step = float(np.dot(counts, distinct - distinct[0]) / np.dot(counts, counts))
    # In quanta: on a lattice all lie near whole numbers, and not many different values at one of them.
    off = np.abs((distinct - distinct[0]) / step - counts)
    return step if off.max() < LATTICE_TOLERANCE and counts[-1] > distinct.size / 50 else None


def common_divisor(steps: Array, floor: float) -> float:
    """Return the largest length that all steps are multiples of, by Euclid's rule; about `floor` where there is none.

    The `steps` are (n,), in m or N as the `floor` is. From the smallest up: a remainder has the rounding of its divisor
    as many times as that was taken off.
    """
    steps = np.sort(steps)
    common = float(steps[0])
    for other in steps[:DIVISOR_STEPS]:
        a, b = max(common, float(other)), min(common, float(other))
        while b > floor:
            # Euclid with the nearest multiple: the remainder is at most half the divisor.
            a, b = b, abs(a - b * round(a / b))
        common = a
    return common


def quantization_step(values: Array) -> float:
    """The step between neighbouring numbers that a column (n,) can hold, at its largest, in its unit (m, N, rad, ...).

    It is 0 for double precision: then nothing but arithmetic limits the numbers.
    """
    return max(numeric_step(values) or 0.0, single_precision_step(values), decimal_step(values))


def coarsest(values: Array) -> float:
    """Return the coarsest quantum among the columns of `values` (n, N), in their unit (m, N, rad, ...)."""
    return max(map(quantization_step, values.T), default=0.0)


def noise_deviation(values: Array, *, order: int) -> float:
    """Return the standard deviation of the white noise of the noisiest column of `values` (n, N), in their unit.

    It shows in the differences of this `order`, the higher the less of the signal; 0 where there are too few rows.
    """
    if len(values) <= order:
        return 0.0
    differences = np.abs(np.diff(values, n=order, axis=0))
    # The median of |z| / 0.6745 is the deviation of normal noise z; a difference sums squared binomials of variances.
    return float(np.max(np.median(differences, axis=0))) / 0.6745 / math.sqrt(math.comb(2 * order, order))


def rounded_as(values: Array, source: Array) -> Array:
    """Return values (n, k) rounded to what the columns of `source` (n, m) resolve, in whose unit they are.

    Sums of quantized columns lie on no lattice, and would be taken for finer than what was measured.
    """
    if all(single_precision_step(column) > 0.0 for column in source.T):
        return values.astype(np.float32).astype(np.float64)
    step = coarsest(source)
    return values if step == 0.0 else np.rint(values / step) * step


def are_singles(values: Array) -> bool:
    """Return whether all of `values` (n,) or (n, N), in m, N or another unit, are finite single precision numbers."""
    with np.errstate(over="ignore"):  # what is too large for one is none
        return np.array_equal(values.astype(np.float32), values)


def single_precision_step(values: Array) -> float:
    """The spacing of single precision at the largest number of a column (n,), in its unit (m, N, rad, ...).

    It is 0 where not every number is one of single precision.
    """
    sample, largest = _sample(values)
    return float(np.spacing(np.float32(largest))) if sample.size > 0 and are_singles(sample) else 0.0


def decimal_step(values: Array) -> float:
    """Return the last place's unit of the largest of `values` (n,), m, N, ..., where all have so few digits; or 0."""
    sample, largest = _sample(values)
    # a change of unit rounds again
    numbers = list(zip(sample.tolist(), (2.0 * np.spacing(np.abs(sample))).tolist(), strict=True))
    for digits in DECIMAL_DIGITS if numbers else ():
        # in most columns the first number has more digits
        if all(abs(float(f"{number:.{digits - 1}e}") - number) <= rounding for number, rounding in numbers):
            return float(10.0 ** (math.floor(math.log10(largest)) - digits + 1))
    return 0.0


def _sample(values: Array) -> tuple[Array, float]:
    """Different numbers of a column that are not zero, none where there are too few, and the largest of all."""
    nonzero = values[np.isfinite(values) & (values != 0.0)]
    if nonzero.size == 0:
        return nonzero, 0.0
    # Evenly spread over the run, so that a rest at the begin does not decide.
    sample = np.unique(nonzero[np.linspace(0, nonzero.size - 1, SAMPLE_SIZE).astype(int)])
    return sample if sample.size >= FEWEST_DISTINCT else sample[:0], float(np.max(np.abs(nonzero)))
