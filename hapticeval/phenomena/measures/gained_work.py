"""The work that the hand gets over a path that closes: its limit as the tick goes to 0, and what is not known of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hapticeval.phenomena.decisions import RIGID_WORK_SHARE, SETTLING_RATIO, TELLING_SHARE
from hapticeval.phenomena.measures.closed_paths import SampledWork
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import worst_row
from hapticeval.types import Array, IntArray

LAP = "in each lap after the first"


@dataclass(frozen=True)
class Span:
    """Rows [first, last] of the base recording between which the work is balanced, with words for what they are.

    Nothing is stored in free space, and after a lap, which it may be (`closes_lap`), as much as before it.
    """

    first: int
    last: int
    what: str
    closes_lap: bool = False

    @classmethod
    def of_lap(cls, first: int, last: int) -> Span:
        """Return the span of a lap after the first."""
        return cls(first, last, LAP, closes_lap=True)

    @property
    def ends(self) -> IntArray:
        """Rows up to which the work may be balanced, (k,): a lap has one end only, where it closes."""
        return np.arange(self.last if self.closes_lap else self.first + 1, self.last + 1)


@dataclass(frozen=True)
class Gain:
    """The work, J, that the hand has got over a `span` up to row `last`: as the motors hold the force, and its shares.

    - `hold`: what holding the force for a tick adds; `lag`: what else vanishes as the tick does.
    - `law`: the limit of fast sampling, which the force gives as a function of the hand's path.
    - `correction`: the last one of the extrapolation to it; `open` bounds all that is not known of it.
    - `stored`: what it may be without being created: see `stored_before`.
    - `crossed`: all that crossed in either direction; `effort`: the force times the path.
    """

    span: Span
    last: int
    hold: float
    lag: float
    law: float
    correction: float
    open: float
    stored: float
    crossed: float
    effort: float

    @property
    def telling(self) -> bool:
        """Whether the runs are fine enough to say if the hand has got anything.

        - They are where refinement ends on no gain, even with its last correction added. What is open may be more: an
          impulse makes the bound of a trapezoid's error larger than the error.
        - They are where little is open of what crossed, or of the effort: along a surface a rigid contact's force does
          no work, and little crosses.
        """
        settled = self.law + self.correction <= self.stored
        return settled or self.open <= max(TELLING_SHARE * self.crossed, RIGID_WORK_SHARE * self.effort)

    @property
    def excess(self) -> float:
        """How far the gain is beyond what is open and what was stored, J."""
        return self.law - self.granted

    @property
    def granted(self) -> float:
        """The largest gain that shows nothing, J."""
        return self.open + self.stored


def stored_before(base: Observed, span: Span) -> float:
    """Return by how much more may be stored at the start of a span than at its end, J, so that the hand may get it.

    - From free space a force F below the floor of contact is that of a spring that holds F^2 / (2 K), of the softest K.
    - Points of two laps are one within a gap. Over the straight step d that closes the lap, S(start) - S(end) is at
      most the largest |F| times |d|, and of a force that goes straight from one end to the other it is that at an end.
    """
    force_first, force_last = (float(np.linalg.norm(base.force[row])) for row in (span.first, span.last))
    if span.closes_lap:
        return float(np.linalg.norm(base.hip[span.last] - base.hip[span.first])) * max(force_first, force_last)
    softest, _ = base.stiffness_range or (1.0, 1.0)
    return force_first**2 / (2.0 * softest * base.scene.stiffness)


def gain_over(sampled: Sequence[SampledWork], span: Span, rounding: Array, stored: float) -> Gain:
    """Return the gain over a lap, or over another span up to the row of it where it is farthest beyond what is open.

    `sampled` are the base run, and three of which each has twice the rate of the one before. `rounding` (n,), J, is
    what the running sums may be off by, and `stored`, J, is `stored_before`.
    """
    rows = span.ends

    def over(sums: Array) -> Array:
        """Return what running sums (n,), as J, gain from the first row of the span to `rows`: (k,)."""
        return np.asarray(sums[rows] - sums[span.first])

    base_rate, *_, finest = sampled
    coarse, half, quarter = (over(sums.smooth) for sums in sampled[1:])
    # Richardson's differences: a held force is of first order, so that fine / coarse tends to 1/2.
    coarse_change, fine_change = half - coarse, quarter - half
    coarse_size, fine_size = np.abs(coarse_change), np.abs(fine_change)
    error = over(finest.error) + over(rounding)
    settled = fine_size <= np.maximum(SETTLING_RATIO * coarse_size, error)
    # W(0) = 2 W(T/4) - W(T/2)
    law = np.where(settled, quarter + fine_change, quarter)
    # Where it does not settle, a gain that grows is off by its changes. One that shrinks may end at nothing, which only
    # finer runs show: no number bounds its correction.
    unsettled_correction = np.where(fine_change < 0.0, np.inf, np.maximum(coarse_size, fine_size))
    # Where it settles: the last change, or half of what the limit moved by since the rates before, if that is more.
    limit_change = np.abs(fine_change - coarse_change + fine_change)
    correction = np.where(settled, np.maximum(fine_size, 0.5 * limit_change), unsettled_correction)
    doubt = error + correction
    # The row with the largest gain beyond what is open; at the end of the span where none is.
    row = worst_row(law - doubt)
    if law[row] <= doubt[row] + stored:
        row = rows.size - 1
    return Gain(
        span,
        last=int(rows[row]),
        # What a held force gives more than the trapezoid through the same rows.
        hold=float(over(base_rate.held - base_rate.smooth)[row]),
        lag=float(over(base_rate.smooth)[row] - law[row]),
        law=float(law[row]),
        correction=float(correction[row]),
        open=float(doubt[row]),
        stored=stored,
        crossed=float(over(finest.crossed)[row]),
        effort=float(over(finest.effort)[row]),
    )
