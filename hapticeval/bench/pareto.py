"""Which settings are worth having: the Pareto front, the cheapest that is good enough, and orders of convergence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

ALIKE = 0.05
"""Share by which two times of one bench may differ by luck."""


def front(times: Sequence[float], errors: Sequence[float]) -> list[int]:
    """The indices of settings that none beats in both time and error, from the quickest to the most accurate.

    Of settings that are equal in both the first counts. Settings with a number that is not finite never do.
    """
    order = sorted(range(len(times)), key=lambda index: (times[index], errors[index], index))
    best, kept = np.inf, []
    for index in order:
        if np.isfinite(times[index]) and errors[index] < best:
            best = errors[index]
            kept.append(index)
    return kept


def cheapest(
    times: Sequence[float],
    errors: Sequence[float],
    *,
    within: float,
    budget: float = np.inf,
) -> int | None:
    """The setting with the least time, at most `budget`, of those whose error is at most `within`; None if none is.

    Times within `ALIKE` of the least are not told apart: of those the most accurate, then the first counts.
    """
    good = [index for index, error in enumerate(errors) if error <= within and times[index] <= budget]
    least = min((times[index] for index in good), default=np.inf)
    alike = [index for index in good if times[index] <= least * (1.0 + ALIKE)]
    return min(alike, key=lambda index: (errors[index], index), default=None)


def order(values: Sequence[float], errors: Sequence[float]) -> float | None:
    """The observed order of convergence: the slope of log error against the log of refinement, positive if it falls.

    `values` of a knob go from coarse to fine, in whatever direction. None for fewer than three different values with
    a positive error.
    """
    kept = [(value, error) for value, error in zip(values, errors, strict=True) if error > 0.0 and value > 0.0]
    if len({value for value, _ in kept}) < 3:
        return None
    refinement = np.abs(np.log([value / kept[0][0] for value, _ in kept]))
    slope = np.polyfit(refinement, np.log([error for _, error in kept]), 1)[0]
    return float(-slope)
