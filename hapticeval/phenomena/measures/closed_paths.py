"""Where a path comes back to what it was, and the work of the force on the hand along it.

Laps over the same points, and contacts between two stays in free space: over either nothing more is stored in the end.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from hapticeval.phenomena.decisions import PLACE_ROUNDING
from hapticeval.phenomena.observed import Observed
from hapticeval.recordings.recording import runs_of
from hapticeval.types import Array, BoolArray


class LapRun(NamedTuple):
    """Laps that follow each other on the same points: the `first` row, the `period` in rows, and how many: `number`."""

    first: int
    period: int
    number: int

    @property
    def later(self) -> list[tuple[int, int]]:
        """First and last row of each lap after the first."""
        ends = [self.first + lap * self.period for lap in range(1, self.number + 1)]
        return list(itertools.pairwise(ends))


def laps(hip: Array, size: float) -> list[LapRun]:
    """Return where a hand goes round two or more times on the same points `hip` (n, N), m.

    Points are the same within `PLACE_ROUNDING` of `size`, m; a hand that stays at one, or creeps by less than that,
    makes no lap.
    """
    count, near = hip.shape[0], PLACE_ROUNDING * size
    if count < 3:
        return []
    # Rows of one cell of a fine grid: candidates for the same point, each with the next row of its cell.
    cells = np.unique(np.rint(hip / near), axis=0, return_inverse=True)[1].reshape(-1)
    order = np.argsort(cells, kind="stable")
    same = cells[order[1:]] == cells[order[:-1]]
    rows = order[:-1][same]
    period = order[1:][same] - rows
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):  # most are told from laps by a few of their points
        at = rows + np.maximum(share * period, 1.0).astype(int)
        fits = at + period < count
        fits[fits] = np.linalg.norm(hip[(at + period)[fits]] - hip[at[fits]], axis=1) <= near
        rows, period = rows[fits], period[fits]
    periods = dict(zip(rows.tolist(), period.tolist(), strict=True))
    lap_runs, end = [], 0
    # The earliest first; rows within laps that are known begin none of their own. Two rows are not a lap.
    for row in sorted(periods):
        if row >= end and periods[row] > 2 and (number := _count_laps(hip, row, periods[row], near)) >= 2:
            lap_runs.append(LapRun(row, periods[row], number))
            end = row + number * periods[row]
    return lap_runs


def later_laps(hip: Array, size: float) -> list[tuple[int, int]]:
    """Return first and last row of each lap after the first that `laps` finds in `hip` (n, N), m; `size` in m."""
    return [rows for lap_run in laps(hip, size) for rows in lap_run.later]


def _count_laps(hip: Array, first: int, period: int, near: float) -> int:
    """Return how many laps of `period` rows follow each other from row `first` on, each with the row that ends it.

    The points are `hip` (n, N), m; those within `near` (m) of each other are the same.
    """
    lap = hip[first : first + period + 1]
    if np.linalg.norm(lap - lap[0], axis=1).max() <= 2.0 * near:  # all may be within that of one point
        return 0
    number = 1
    while True:
        begin = first + number * period
        next_lap = hip[begin : begin + period + 1]
        if len(next_lap) <= period or np.linalg.norm(next_lap - lap, axis=1).max() > near:
            return number
        lap, number = next_lap, number + 1


def contact_spans(free: BoolArray) -> list[tuple[int, int]]:
    """Return first and last row of each span from the last row in free space to the next one there, or to the end.

    `free` (n,) is where nothing touches. The first row of a span bounds the work, J: there nothing is stored.
    """
    # The last free row before each contact: what happens from there on is all of the contact's.
    return [(first - 1, min(end, free.size - 1)) for first, end in runs_of(~free) if first > 0]


class SampledWork:
    """Running sums of the work in a recording at `factor` times the base rate: (n,), J, at each row of the base run.

    - `smooth`: the work by the trapezoid, and `error` what bounds that it is off by.
    - `held`: the work of a force that is held from row to row.
    - `crossed`: the work without its sign.
    - `path` (m): the length of the hand's path, and `effort` that times the force.
    - `free`: where nothing touches.
    """

    def __init__(self, run: Observed, factor: int) -> None:
        force, moved = run.force, np.diff(run.hip, axis=0)
        length = np.linalg.norm(moved, axis=1)
        mean = np.sum(0.5 * (force[1:] + force[:-1]) * moved, axis=1)
        # By this a trapezoid of two ticks differs: the whole of a jump of the force, and of second order elsewhere.
        bend = np.zeros_like(moved)
        bend[1:] = np.diff(force, n=2, axis=0)
        self.free = ~run.contact[::factor]
        self.smooth, self.held, self.error, self.crossed, self.path, self.effort = (
            running_sums(steps)[::factor]
            for steps in (
                mean,
                np.sum(force[:-1] * moved, axis=1),
                0.5 * np.abs(np.sum(bend * moved, axis=1)),
                np.abs(mean),
                length,
                np.linalg.norm(force[:-1], axis=1) * length,
            )
        )


def running_sums(steps: Array) -> Array:
    """Return the running sums of `steps` (n,), as J, from 0 at the first row: (n + 1,)."""
    return np.concatenate([[0.0], np.cumsum(steps)])
