"""What is wrong with one column by itself: no number, stuck, saturated, spiking; and the quantum of its encoder."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from hapticeval.recordings.finding import Fault, Severity, plural
from hapticeval.recordings.rows import runs_of
from hapticeval.recordings.stretches import GAP_STEPS
from hapticeval.types import Array, BoolArray

STUCK_ROWS = 10
"""So many equal values in a row may be a frozen sensor, where the value jumps when it wakes."""

CLIPPED_ROWS = 5
"""So many equal values at the extreme of a column, reached at speed, are clipped."""

SPIKE = 20.0
"""A spike stands out of the noise by so many standard deviations of the second difference."""

ABOVE = 4.0
"""... and of what all rows but a hundredth bend by so many times: signals have quiet and busy stretches."""

FEW = 8
"""At least so many rows are not counted then: a spike bends three."""

QUANTA = 6.0
"""... and is so many quanta, or so many usual steps from row to row, high: an encoder at rest dithers by one."""

BESIDE = 8
"""Steps on either side of a jump, all of which it exceeds by `SPIKE` times."""

AGREE = 0.25
"""The rows beside a spike are on one line up to this share of it: otherwise the signal itself has moved."""

PLACES = np.array([-2.0, -1.0, 1.0, 2.0])
TREND = PLACES / np.dot(PLACES, PLACES)
"""Two rows on either side of a spike, and the weights that give their slope."""

FINEST = 1e-7
"""A quantum below this share of the range cannot be told from the rounding of the file."""

WHOLE = 0.02
"""How far from whole numbers the values may lie, in quanta."""


def quantum(values: Array) -> float | None:
    """The step of the lattice that all values lie on: an encoder's, or a logger's; None where they lie on none."""
    distinct = np.unique(values[np.isfinite(values)])
    if distinct.size < 4:
        return None
    span = float(distinct[-1] - distinct[0])
    steps = np.diff(distinct)
    steps = steps[steps > FINEST * span]
    if steps.size == 0:
        return None
    step = _common(steps, FINEST * span)
    for _ in range(3):  # the mean over many steps is finer than the smallest alone
        counts = np.round((distinct - distinct[0]) / step)
        if counts[-1] > 1.0 / FINEST:
            return None
        step = float(np.dot(counts, distinct - distinct[0]) / np.dot(counts, counts))
    off = np.abs((distinct - distinct[0]) / step - counts)
    return step if off.max() < WHOLE and counts[-1] > distinct.size / 50 else None


def _common(steps: Array, floor: float) -> float:
    """The largest length that all steps are multiples of, by Euclid's rule; about `floor` where there is none.

    From the smallest up: a remainder has the rounding of its divisor as many times as that was taken off.
    """
    steps = np.sort(steps)
    common = float(steps[0])
    for other in steps[: 50 * STUCK_ROWS]:
        a, b = max(common, float(other)), min(common, float(other))
        while b > floor:
            a, b = b, abs(a - b * round(a / b))
        common = a
    return common


def runs(values: Array, shortest: int) -> list[tuple[int, int]]:
    """The rows [first, end) over which a column keeps one value, of as many rows at least."""
    edges = np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1], [True]]))
    long = np.flatnonzero(np.diff(edges) >= shortest)
    return [(int(edges[k]), int(edges[k + 1])) for k in long]


def examine_numbers(name: str, columns: Mapping[str, Array], time: Array) -> list[Fault]:
    """The rows of a channel that lack a number: one finding a stretch of rows, whichever of its `columns` (n,) do."""
    empty = {column: ~np.isfinite(values) for column, values in columns.items()}
    faults = []
    for first, end in runs_of(np.logical_or.reduce(list(empty.values()))):
        lacking = [column for column, where in empty.items() if where[first:end].any()]
        parts = "" if len(lacking) == 1 else f" ({', '.join(column.rpartition('.')[2] for column in lacking)})"
        faults.append(
            _at(lacking[0] if len(lacking) == 1 else name, "no number", Severity.FAULT, first, end, time,
                f"{plural(end - first, 'row')} without a number{parts}", "left out; see why the sensor gave none")
        )  # fmt: skip
    return faults


def examine_column(
    name: str,
    values: Array,
    time: Array,
    valid: BoolArray,
    *,
    held: bool = False,
    rests: bool = False,
    place: bool = False,
) -> list[Fault]:
    """What is wrong with the numbers of a column (n,): `name` as in `hip.x`, `time` (s), judged where `valid`.

    `held` is for forces and torques, which are zero for long and then jump, and are hit in one tick; `rests` for a
    proxy, which rests on a wall at an extreme of its place and is clipped by nothing; `place` for where a hand or a
    joint is, which goes from row to row without a jump.
    """
    faults: list[Fault] = []
    sound = valid & np.isfinite(values)
    if np.ptp(values[sound]) == 0.0 if sound.any() else True:
        return faults
    step = quantum(values[sound]) or 0.0
    severity = Severity.NOTE if held else Severity.SUSPICIOUS
    extremes = (float(values[sound].min()), float(values[sound].max()))
    for begin, stop in stretches(sound, time):
        kept = values[begin:stop]
        stuck = _stuck(kept, step)
        for row in _jumps(kept, step) if place else ():
            if row not in {end for _, end in stuck}:
                faults.append(
                    _at(name, "jump", Severity.SUSPICIOUS, begin + row, begin + row + 1, time,
                        f"it jumps by {kept[row] - kept[row - 1]:.4g} between two rows, and goes on from there",
                        "see whether a counter overflowed, or two logs were joined; replays begin anew there")
                )  # fmt: skip
        for first, end in stuck:
            if not (held and kept[first] == 0.0):
                faults.append(
                    _at(name, "stuck", Severity.SUSPICIOUS, begin + first, begin + end, time,
                        "the value is frozen, then jumps", "leave those rows out; see the sensor and its cable")
                )  # fmt: skip
        for first, end in () if rests else _clipped(kept, step, extremes):
            if held and kept[first] == 0.0:  # out of contact
                continue
            faults.append(
                _at(name, "saturated", severity, begin + first, begin + end, time, f"clipped at {kept[first]:.6g}",
                    "there the limit of sensor or motor was recorded, not the signal")
            )  # fmt: skip
        for first, end in _spikes(kept, step, held):
            faults.append(
                _at(name, "spike", Severity.SUSPICIOUS, begin + first, begin + end, time,
                    "one row stands out", "leave it out; see the cable and the logger")
            )  # fmt: skip
    return faults


def stretches(sound: BoolArray, time: Array) -> list[tuple[int, int]]:
    """The rows [first, end) that follow each other, sound and without a gap of the clock."""
    rows = np.flatnonzero(sound)
    if rows.size < 2:
        return []
    steps = np.diff(time[rows])
    breaks = np.flatnonzero((np.diff(rows) > 1) | (steps > GAP_STEPS * np.median(steps))) + 1
    edges = [0, *breaks.tolist(), rows.size]
    return [(int(rows[a]), int(rows[b - 1]) + 1) for a, b in pairwise(edges)]


def _stuck(values: Array, step: float) -> list[tuple[int, int]]:
    """Runs of one value that end in a jump: by then the signal had moved on, at rest it would not have."""
    found = []
    lengths = np.diff(np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1], [True]])))
    usual = float(np.median(lengths)) if lengths.size else 1.0
    for first, end in runs(values, max(STUCK_ROWS, int(5 * usual) + 1)):
        if end >= values.size - 3:
            continue
        jump = abs(values[end] - values[first])
        before = np.abs(np.diff(values[max(0, first - 8) : first + 1]))
        after = np.abs(np.diff(values[end : end + 9]))
        around = max(float(before.max(initial=0.0)), float(after.max(initial=0.0)))
        if jump > max(4.0 * around, 4.0 * step):
            found.append((first, end))
    return found


def _jumps(values: Array, step: float) -> list[int]:
    """The rows before which a place jumps: a single step that is far larger than all beside it on either side.

    A hand has mass: its steps grow and shrink by its acceleration, from row to row, and never stand alone.
    """
    steps = np.abs(np.diff(values))
    if steps.size < 2 * BESIDE + 1 or not np.any(steps > 0.0):
        return []
    floor = max(QUANTA * step, QUANTA * float(np.median(steps[steps > 0.0])))
    found = []
    for row in np.flatnonzero(steps > floor):
        beside = np.concatenate([steps[max(0, row - BESIDE) : row], steps[row + 1 : row + 1 + BESIDE]])
        if BESIDE <= row < steps.size - BESIDE and steps[row] > SPIKE * float(beside.max()):
            found.append(int(row) + 1)
    return found


def _clipped(values: Array, step: float, extremes: tuple[float, float]) -> list[tuple[int, int]]:
    """Runs at an extreme that the signal reaches and leaves at speed, as no smooth signal turns."""
    found = []
    for extreme in extremes:
        for first, end in runs(values, CLIPPED_ROWS):
            if values[first] != extreme or first < 4 or end > values.size - 4:
                continue
            rise = np.diff(values[first - 3 : first + 1])
            fall = np.diff(values[end - 1 : end + 3])
            floor = 3.0 * step
            upward = np.sign(values[first] - values[first - 1])
            steady = np.all(upward * rise[:2] > floor) and np.all(-upward * fall[1:] > floor)
            # a smooth peak of this width is entered by steps of curvature alone: each a small share of the one before
            if steady and upward * rise[1] > 0.3 * upward * rise[0] and -upward * fall[1] > 0.3 * -upward * fall[2]:
                found.append((first, end))
    return sorted(found)


def _spikes(values: Array, step: float, held: bool) -> list[tuple[int, int]]:
    """Single rows off the line through their neighbours, whose neighbours agree."""
    if values.size < 8:
        return []
    bend = values[1:-1] - 0.5 * (values[2:] + values[:-2])
    size = np.abs(bend)
    rare = min(size.size - 1, max(FEW, size.size // 100))
    moved = np.abs(np.diff(values))
    floor = max(
        SPIKE * 1.4826 * float(np.median(size)),
        ABOVE * float(np.partition(size, -(rare + 1))[-(rare + 1)]),
        QUANTA * step,
        QUANTA * float(np.median(moved[moved > 0.0])) if np.any(moved > 0.0) else 0.0,
    )
    found = []
    for row in np.flatnonzero(np.abs(bend) > floor) + 1:
        if row < 2 or row > values.size - 3:
            continue
        beside = values[[row - 2, row - 1, row + 1, row + 2]]
        if held and np.any(beside == 0.0):
            continue  # a collision: the tool was or is free
        middle, slope = float(beside.mean()), float(np.dot(beside, TREND))
        off = abs(values[row] - middle)
        if np.max(np.abs(beside - middle - slope * PLACES)) < AGREE * off and off > floor:
            found.append((int(row), int(row) + 1))
    return found


def _at(
    channel: str, kind: str, severity: Severity, first: int, end: int, time: Array, message: str, todo: str
) -> Fault:
    return Fault(kind, severity, message, todo, channel, first, end, (float(time[first]), float(time[end - 1])))
