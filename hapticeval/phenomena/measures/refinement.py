"""What is left of a quantity when the loop is sampled ever faster: the law's own share, without the sampling's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.decisions import EXTRAPOLATED_HALVINGS, LENGTH_ROUNDING, SETTLING_RATIO
from hapticeval.phenomena.observed import Observed
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array


@dataclass(frozen=True, eq=False)
class Extrapolated:
    """A quantity at the base run's samples: `values` (n, ...), in the limit of fast sampling where `settled`.

    Where the base run ended early, n is what the finer ones have of it too. `change` bounds the limit's own error: see
    `richardson_two_level`. Where halving did not settle it, `values` are the base run's.
    """

    values: Array
    change: float
    settled: bool


def richardson_two_level(runs: Runs, scene: Scene, measure: Callable[[Observed], Array]) -> Extrapolated:
    """Extrapolate what `measure` returns, (n,) or (n, N), to a tick of zero length: 2 q(T/4) - q(T/2).

    A held force lags by half a tick, an effect of first order in T (s), which this removes. With d = q(T/2) - q(T) and
    d' = q(T/4) - q(T/2), what it leaves is

    - less than d' of an effect of any single higher order;
    - a third of |2 d' - d| where a first and a second order cancel in d': Richardson's next correction.

    `change` is the larger of |d'| and half of |2 d' - d|, in the unit of q.
    """
    base = measure(runs.observed(scene))
    if runs.refine is None:
        return Extrapolated(base, float("inf"), False)
    half, quarter = (
        _at_base(measure(Observed(runs.refine(factor), scene)), base.shape[0], factor) for factor in (2, 4)
    )
    common = min(half.shape[0], quarter.shape[0])
    # A finer run that is shorter shows less, unless the base run itself has ended early.
    if common < base.shape[0] and ("ended" not in runs.base.meta or common < 2):
        return Extrapolated(base, float("inf"), False)
    base, half, quarter = base[:common], half[:common], quarter[:common]
    # d and d'; their ratio is 1/2 for a first-order effect and 1/4 for a second-order one.
    before, after = half - base, quarter - half
    first, last, bent = (_largest(step) for step in (before, after, 2.0 * after - before))
    rounding = LENGTH_ROUNDING * _largest(base)
    if last <= SETTLING_RATIO * first or last <= rounding:
        return Extrapolated(2.0 * quarter - half, max(last, 0.5 * bent), True)
    return Extrapolated(base, last, False)


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def _at_base(values: Array, count: int, factor: int) -> Array:
    """Of a finer run, the samples that the base run has."""
    return values[::factor][:count]


def extrapolated(runs: Runs, measure: Callable[[Recording], Array]) -> tuple[Array, float] | None:
    """Extrapolate what `measure` returns, (n, N), to a tick of zero length, and return the last correction too.

    Richardson's scheme, for errors in whole powers of the tick. The correction is the error of the last but one value,
    and bounds that of the one given. None without siblings, or where one of them has ended early.
    """
    if runs.refine is None:
        return None
    base = measure(runs.base)
    # The first column of Richardson's table: T, T/2, T/4, ...
    finer = [2**halving for halving in range(1, EXTRAPOLATED_HALVINGS + 1)]
    row = [base] + [_at_base(measure(runs.refine(factor)), base.shape[0], factor) for factor in finer]
    if any(values.shape != base.shape for values in row):
        return None
    correction = float("inf")
    for order in range(1, EXTRAPOLATED_HALVINGS + 1):
        # q + (q - q_coarse) / (2^p - 1) removes the order p; the column gets one shorter each time.
        better = [fine + (fine - coarse) / (2.0**order - 1.0) for coarse, fine in pairwise(row)]
        correction = float(np.max(np.abs(better[-1] - row[-1]), initial=0.0))
        row = better
    return row[0], correction
