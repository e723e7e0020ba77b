"""Which samples of a recording a page draws: some thousand, chosen so that extremes stay and lines follow the path."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from heapq import heapify, heappop, heappush
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import continuing_steps
from hapticeval.types import Array, IntArray

THINNED_SAMPLES = 1000
"""At most about so many samples of a run are kept beside those that are kept for certain."""

CHANNEL_TOLERANCE = 1.0 / 500.0
"""Share of each channel's range that straight lines between the samples may be off: less than can be seen."""

DEPARTURE_LIMIT = 0.02
"""Share of a path's extent by which lines between its samples may leave it; else `drawn_rows` takes its ends only."""

INTERVALS = 12
"""The largest and smallest of force, depth and step in so many intervals are kept exactly."""

MOST_MARKED_EVENTS = 200
"""At most so many gaps, so many jumps and so many changes of contact are kept for certain; the longest jumps."""

JUMP_RATIO = 4.0
"""An IHIP step this many times as long as the HIP's, and as the shorter of the steps beside it, is kept: a jump."""


class DrawnRows(NamedTuple):
    """The `rows` to show; those of them that no line leads to, `cuts`; and between which times, s, few are shown."""

    rows: IntArray
    cuts: IntArray
    left_out: tuple[float, float] | None


def drawn_rows(runs: Sequence[Recording], ticks: Collection[int], *, extra_signals: Sequence[Array] = ()) -> DrawnRows:
    """Return the rows to draw of runs along one hand path: `thinned_rows` where lines between them follow the path.

    So many samples cannot follow some paths, as a hundred laps. Of these are drawn:

    - the beginning and the end, as far as lines follow them ten times as closely as `DEPARTURE_LIMIT`
    - between them `ticks`, with the rows beside them

    `extra_signals`, each (n,) for the n rows of the runs, such as a speed in m/s, have to be followed too.
    """
    rows = thinned_rows(runs, ticks, extra_signals=extra_signals)
    if _largest_departure(runs, rows) <= DEPARTURE_LIMIT:
        return DrawnRows(rows, np.zeros(0, dtype=np.int64), None)
    # Lines cannot follow the whole path: start from `length` rows at either end, one after the other.
    n, length = len(runs[0]), THINNED_SAMPLES // 2

    def rows_of_end(first: int, last: int) -> IntArray | None:
        part = slice(first, last)
        inside = [tick - first for tick in ticks if first <= tick < last]
        parts = [run.part(part) for run in runs]
        end_rows = thinned_rows(parts, inside, THINNED_SAMPLES // 2, [signal[part] for signal in extra_signals])
        return end_rows + first if _largest_departure(parts, end_rows) <= 0.1 * DEPARTURE_LIMIT else None

    ends = np.arange(length), np.arange(n - length, n)
    # Reach twice as far from both ends as long as half the samples still follow the path there.
    while 4 * length < n:
        first_rows, last_rows = rows_of_end(0, 2 * length), rows_of_end(n - 2 * length, n)
        if first_rows is None or last_rows is None:
            break
        ends, length = (first_rows, last_rows), 2 * length
    # In the part that is left out, each verdict has its row and the two beside it.
    rows_between = [k for tick in ticks for k in (tick - 1, tick, tick + 1) if length <= k < n - length]
    verdict_rows = np.unique(np.array(rows_between, dtype=np.int64))
    # No line leads to the first of neighbouring rows, nor to the first row of the end.
    cuts = np.append(verdict_rows[np.diff(verdict_rows, prepend=-1) > 1], n - length)
    time = runs[0].time
    return DrawnRows(
        np.concatenate([ends[0], verdict_rows, ends[1]]), cuts, (float(time[length - 1]), float(time[n - length]))
    )


def _largest_departure(runs: Sequence[Recording], rows: IntArray) -> float:
    """Return how far lines between the rows leave the paths of HIP and IHIP, as a share of the paths' extent."""
    time = runs[0].time
    columns = [*runs[0].hip.T, *(column for run in runs if "ihip" in run.channels for column in run.ihip.T)]
    # m: the largest distance of any coordinate from its interpolation between the chosen rows.
    off = max(float(np.max(np.abs(np.interp(time, time[rows], column[rows]) - column))) for column in columns)
    return off / max(*(float(np.ptp(column)) for column in columns), 1e-300)


def thinned_rows(
    runs: Sequence[Recording], ticks: Collection[int], count: int = THINNED_SAMPLES, extra_signals: Sequence[Array] = ()
) -> IntArray:
    """Return few rows of runs along one hand path: straight lines between them miss the others by `CHANNEL_TOLERANCE`.

    - For certain: ends, `ticks` and those beside them, gaps, contacts, jumps and extremes, with the row before each.
    - Then up to `count` more, always the row that is farthest from the lines.

    Lines follow HIP and IHIP (m), force (N) and the `extra_signals`, each (n,) for the n rows of the runs, in units of
    their own, such as m/s.
    """
    n = len(runs[0])
    if n <= count:
        return np.arange(n)
    # All runs share their rows: what one of them needs, all of them get.
    chosen = np.unique(np.concatenate([_certain_rows(run, ticks) for run in runs]))
    for signal in (signal for run in runs for signal in _signals_with_extremes(run)):
        chosen = np.union1d(chosen, _extremes(signal))
    # Every column is scaled by its tolerance, so that one threshold of 1 holds for all.
    values = np.column_stack(
        [*(_channels_in_tolerances(run) for run in runs), *(_in_tolerances(signal) for signal in extra_signals)]
    )
    return _refined_rows(runs[0].time, values, chosen, count)


def _channels_in_tolerances(run: Recording) -> Array:
    """Return the channels that are drawn (n, k), each in units of the error that straight lines may have."""
    parts = [3.0 * _in_tolerances(run.hip)]  # a picture can be enlarged
    if "ihip" in run.channels:
        parts += [_in_tolerances(run.ihip - run.hip), _in_tolerances(step_lengths(run, run.ihip))[:, None]]
    if "force" in run.channels:
        parts.append(_in_tolerances(run.force))
    return np.hstack(parts)


def _in_tolerances(values: Array) -> Array:
    return values / max(CHANNEL_TOLERANCE * float(np.ptp(values, axis=0).max()), 1e-300)


def _refined_rows(time: Array, values: Array, chosen: IntArray, count: int) -> IntArray:
    """Add up to `count` rows, always the one that is farthest from the line between those chosen on its sides.

    `values` (n, k) are lines of `time` (n,) where they are off by less than 1.
    """
    rows = chosen.tolist()

    def farthest(first: int, last: int) -> tuple[float, int, int, int] | None:
        # Between neighbours there is nothing to add.
        if last - first < 2:
            return None
        # The straight line in time from first to last, and how far each row between is from it.
        share = ((time[first + 1 : last] - time[first]) / (time[last] - time[first]))[:, None]
        line = values[first] + share * (values[last] - values[first])
        departures = np.abs(values[first + 1 : last] - line).max(axis=1)
        farthest_index = int(np.argmax(departures))
        return (
            (-float(departures[farthest_index]), first, first + 1 + farthest_index, last)
            if departures[farthest_index] > 1.0
            else None
        )

    candidates = [candidate for pair in pairwise(rows) if (candidate := farthest(*pair)) is not None]
    # A heap with the farthest row on top: adding the worst row first is the greedy form of Douglas and Peucker.
    heapify(candidates)
    for _ in range(count):
        if not candidates:
            break
        _, first, middle, last = heappop(candidates)
        rows.append(middle)
        # The new row splits its interval into two, each with a farthest row of its own.
        for pair in ((first, middle), (middle, last)):
            candidate = farthest(*pair)
            if candidate is not None:
                heappush(candidates, candidate)
    return np.array(sorted(rows), dtype=np.int64)


def _signals_with_extremes(recording: Recording) -> list[Array]:
    """Return the signals whose extremes are kept: the size of the force (N), the depth and the IHIP's steps (m)."""
    signals = []
    if "force" in recording.channels:
        signals.append(np.linalg.norm(recording.force, axis=1))
    if "ihip" in recording.channels:
        signals += [np.linalg.norm(recording.ihip - recording.hip, axis=1), step_lengths(recording, recording.ihip)]
    return signals


def step_lengths(recording: Recording, points: Array) -> Array:
    """Return how far points move in the tick before each row, m; 0 where no row lies right before.

    `points` (n, N) are places of the recording's n samples, m; the result is (n,).
    """
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return (
        np.append(0.0, np.where(continuing_steps(recording), lengths, 0.0))
        if len(points) > 1
        else np.zeros(len(points))
    )


def jump_rows(recording: Recording) -> IntArray:
    """Return the rows at which the IHIP has just jumped, the longest `MOST_MARKED_EVENTS` of them.

    A jump is a step `JUMP_RATIO` times as long as the HIP's and as the shorter of the steps before and after it, and at
    least half as long as the longer one.
    """
    if "ihip" not in recording.channels or len(recording) < 3:
        return np.zeros(0, dtype=np.int64)
    # m a tick.
    step, hip = step_lengths(recording, recording.ihip), step_lengths(recording, recording.hip)
    longer_neighbour = np.maximum(np.append(0.0, step[:-1]), np.append(step[1:], 0.0))
    # a jump of two ticks has a neighbour as long as itself: that of either side which is shorter decides
    shorter_neighbour = np.minimum(np.append(0.0, step[:-1]), np.append(step[1:], 0.0))
    # m: steps as short as rounding errors are not jumps.
    floor = 1e-6 * float(np.max(np.abs(recording.hip), initial=0.0))
    jumping = np.flatnonzero(
        (step > JUMP_RATIO * np.maximum(hip, shorter_neighbour)) & (step > floor) & (step >= 0.5 * longer_neighbour)
    )
    # The longest ones, back in the order of time.
    return np.sort(jumping[np.argsort(-step[jumping], kind="stable")[:MOST_MARKED_EVENTS]]).astype(np.int64)


def _certain_rows(recording: Recording, ticks: Collection[int]) -> IntArray:
    """Return the rows that are kept for certain: ends, verdicts' places, gaps, jumps, contacts, and the rows before."""
    n = len(recording)
    # A verdict's tick and the one after it; the ones before are added below.
    row_groups = [np.array([0, n - 1, *(tick + 1 for tick in ticks)]), np.array([*ticks], dtype=np.int64)]
    if n > 1:
        row_groups.append(np.flatnonzero(~continuing_steps(recording))[:MOST_MARKED_EVENTS] + 1)
    row_groups.append(jump_rows(recording))
    if {"ihip", "force"} & recording.channels.keys():
        row_groups.append(np.flatnonzero(np.diff(recording.contact))[:MOST_MARKED_EVENTS] + 1)
    rows = np.concatenate(row_groups).astype(np.int64)
    # What happens from one row to the next needs both.
    with_previous = np.union1d(rows, rows - 1)
    return with_previous[(with_previous >= 0) & (with_previous < n)]


def _extremes(signal: Array) -> IntArray:
    """Return the rows of the largest and the smallest value in each of `INTERVALS` of equal length."""
    edges = np.linspace(0, signal.size, INTERVALS + 1).astype(np.int64)
    parts = [(begin, signal[begin:end]) for begin, end in pairwise(edges) if end > begin]
    return np.unique([begin + int(pick(part)) for begin, part in parts for pick in (np.argmax, np.argmin)])
