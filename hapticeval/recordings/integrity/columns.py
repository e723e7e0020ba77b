"""What is wrong with one column: no number, stuck, saturated, spiking, jumping, or still while the hand moves.

A value that does not change is no fault by itself, as nothing may have happened. So each column is held against the
travel of the hand. A live sensor changes its reading every so many metres; one that keeps a value over a travel in
which it otherwise changes many times is frozen. What keeps its value by nature is left alone: zero force in free
motion, the reading that a coarse converter has there, a limit that is reached again and again, and a proxy, which may
rest in a notch while the hand moves inside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.integrity.issue import Fault, Severity, plural
from hapticeval.recordings.provenance import declared_floor
from hapticeval.recordings.quantization import quantum
from hapticeval.recordings.recording import Column, Recording, columns_of, runs_of
from hapticeval.recordings.stretches import GAP_STEPS
from hapticeval.types import Array, BoolArray, IntArray

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
    for begin, stop in unbroken(sound, time):
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


def unbroken(sound: BoolArray, time: Array) -> list[tuple[int, int]]:
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


SAME = 1e-12
"""Share of a column's largest value by which a frozen reading may change: turning its frame changes it by so much."""

TIMES = 30.0
"""A live sensor changes its reading so many times, in the mean, over the travel for which a frozen one keeps it."""

RECURS = 0.1
"""A reading that comes back and stays for this share of the travel is a level of the sensor, or a limit."""

MOVES = 50
"""Steps in which the hand must move before a column that never changes is reported."""

EVEN = 0.2
"""How far, as a share of it, a constant speed may be from that of its place: a wrong one is further off by far."""

LEVELS = 1.5
"""Steps of a coarse converter within which a constant reading is its zero."""

STEADY = 2.5
"""Quanta in a step that no encoder at rest makes: between two such steps the row cannot be the same."""

AROUND = 3
"""Steps on either side of a repeated row that are looked at."""

FEWEST, SHARE = 10, 0.005
"""So many repeated rows, and this share of all, are a logger's habit and no chance."""

MEASURES: Mapping[str, str] = {"N": "force", "N m": "torque", "m/s": "speed", "rad/s": "speed"}
"""Units of what must change while the hand moves: positions may stand still in one direction."""

REFERENCES = ("hip", "measured_hip", "joint_position", "raw", "ihip")
"""Whose travel a column is held against: the first that was recorded."""

OWN = {"velocity": "hip", "measured_velocity": "hip", "joint_velocity": "joint_position", "wall_force": "ihip"}
"""... but for these, which follow one channel: a speed its own component of it."""


def frozen(recording: Recording, known: Sequence[Fault] = ()) -> list[Fault]:
    """Stretches over which a force, torque or speed keeps its value though the hand moves, and constant columns.

    `known` are findings whose rows need no second one. Answers of a simulation are exact, and left alone.
    """
    if recording.meta.get("source") in SIMULATED or len(recording) <= STUCK_ROWS:
        return []
    faults = []
    columns = columns_of(recording)
    for name, (channel, unit, values) in columns.items():
        travel, other = _travel(recording, columns, name, channel)
        if travel is None or not other:
            continue
        if _constant(values[recording.measured]):
            faults += _dead(recording, name, channel, unit, values, travel, other)
        elif unit in MEASURES:
            taken = [each for each in known if each.channel == name and each.first is not None]
            place = columns[other].values if MEASURES[unit] == "speed" and other in columns else None
            faults += _frozen_stretches(recording, name, channel, values, travel, other, taken, place)
    return faults


def _travel(recording: Recording, columns: Mapping[str, Column], name: str, channel: str) -> tuple[Array | None, str]:
    """How far the reference of a column moved in each step (n - 1,), 0 beside rows without a measurement."""
    reference = OWN.get(channel) or next((each for each in REFERENCES if each in recording.channels), "")
    if reference not in recording.channels:
        return None, ""
    values = recording.channels[reference]
    if channel == reference:  # against the other components
        rest = [each for each in _parts(columns, channel) if each != name]
        values = np.column_stack([columns[each].values for each in rest]) if rest else np.zeros((len(recording), 0))
        reference = ", ".join(rest)
    elif channel.endswith("velocity") and values.shape == recording.channels[channel].shape:
        place = _parts(columns, channel).index(name)
        values, reference = values[:, [place]], _parts(columns, reference)[place]
    moved = np.linalg.norm(np.diff(values.reshape(len(recording), -1), axis=0), axis=1)
    both = recording.measured[1:] & recording.measured[:-1]
    return np.where(both & np.isfinite(moved), moved, 0.0), reference


def _parts(columns: Mapping[str, Column], channel: str) -> list[str]:
    return [name for name, each in columns.items() if each.channel == channel]


def _constant(values: Array) -> bool:
    kept = values[np.isfinite(values)]
    return kept.size > 0 and float(np.ptp(kept)) <= SAME * float(np.max(np.abs(kept)))


def _dead(
    recording: Recording, name: str, channel: str, unit: str, values: Array, travel: Array, other: str
) -> list[Fault]:
    """The finding on a column that never changes, where its reference does."""
    if np.count_nonzero(travel) < MOVES or recording.signals[channel].frame not in ("world", "joint"):
        return []
    value = float(values[recording.measured][0])
    suspected = unit in MEASURES and value != 0.0
    what = f"it is {value:.6g} {unit} throughout, while {other} moves {np.sum(travel):.3g} {_unit(recording, other)}"
    if unit in MEASURES and value == 0.0 and not recording.channels[channel].any() and "velocity" not in channel:
        what += ": no contact, or a sensor that is not connected"
    return [
        Fault(
            "constant",
            Severity.SUSPICIOUS if suspected else Severity.NOTE,
            what,
            "see the sensor and its cable, and which column of the file belongs here",
            name,
            measures={"value": value, "travel": float(np.sum(travel))},
        )
    ]


def _unit(recording: Recording, reference: str) -> str:
    first = reference.split(", ")[0]
    return recording.signals[first if first in recording.signals else first.rpartition(".")[0]].unit


def _frozen_stretches(
    recording: Recording,
    name: str,
    channel: str,
    values: Array,
    travel: Array,
    other: str,
    known: Sequence[Fault],
    place: Array | None,
) -> list[Fault]:
    """The findings on the stretches over which a column that changes elsewhere keeps its value.

    A speed that was made of a `place` (n,) keeps its value where that goes on evenly, and is left alone.
    """
    measured = recording.measured
    size = float(np.max(np.abs(values[measured])))
    both = measured[1:] & measured[:-1]
    same = both & (np.abs(np.diff(values)) <= SAME * size)
    path = np.concatenate([[0.0], np.cumsum(travel)])
    runs = [(first, end + 1) for first, end in runs_of(same)]  # rows
    moved = np.array([path[end - 1] - path[first] for first, end in runs])
    lengths = np.array([end - first for first, end in runs])
    found = []
    for index in np.flatnonzero(lengths >= STUCK_ROWS):
        first, end = runs[index]
        value, steps = float(values[first]), travel[first : end - 1]
        if np.count_nonzero(steps) < STUCK_ROWS or _rests(recording, channel, values, slice(first, end), value):
            continue
        if place is not None:
            even = (place[end - 1] - place[first]) / (recording.time[end - 1] - recording.time[first])
            if abs(even - value) <= EVEN * abs(value):
                continue
        alike = np.array([abs(values[a] - value) <= SAME * size for a, _ in runs])
        alike[index] = False
        if np.any(moved[alike] >= RECURS * moved[index]):
            continue
        # how far the hand goes, elsewhere, between two changes of the reading
        changes = int(np.count_nonzero(both & ~same))
        elsewhere = float(path[-1] - moved[lengths >= STUCK_ROWS].sum())
        if changes < STUCK_ROWS or moved[index] * changes < TIMES * elsewhere:
            continue
        if any(each.first < end and first < each.end for each in known if each.first is not None and each.end):
            continue
        found.append(
            Fault(
                "stuck",
                Severity.SUSPICIOUS,
                f"it keeps {value:.6g} over {end - first} rows, while {other} moves {moved[index]:.3g} "
                f"{_unit(recording, other)}; elsewhere it changes every {elsewhere / changes:.2g}",
                "leave those rows out; see the sensor and its cable",
                name,
                first,
                end,
                (float(recording.time[first]), float(recording.time[end - 1])),
                {"travel": float(moved[index])},
            )
        )
    return found


def _rests(recording: Recording, channel: str, values: Array, rows: slice, value: float) -> bool:
    """Whether a constant reading is that of free motion: zero, or as good as zero to the sensor."""
    if value == 0.0:
        # of a component alone: a surface across the axes has none of its force in one of them
        return True
    floor = declared_floor(recording) or 0.0
    if abs(value) <= max(floor, LEVELS * (quantum(values[recording.measured]) or 0.0)):
        return bool(np.max(np.abs(recording.channels[channel][rows])) <= max(floor, abs(value)) * LEVELS)
    return False


def repeated_rows(recording: Recording) -> list[Fault]:
    """Rows that hold the row before over again, in every column that ever changes, in the middle of a motion.

    At rest, and in motion slower than a quantum per row, that may be so. Between two steps of `STEADY` quanta in the
    same direction it cannot: the logger wrote an old sample.
    """
    if recording.meta.get("source") in SIMULATED:
        return []
    measured = recording.measured
    both = measured[1:] & measured[:-1]
    columns = [each.values for each in columns_of(recording).values()]
    found = [values for values in columns if np.any(np.diff(values[measured]))]
    if not found or len(recording) < 4 * AROUND:
        return []
    steps = np.column_stack([np.where(both, np.diff(values), 0.0) for values in found])
    again: BoolArray = both & ~steps.any(axis=1)
    rows = np.flatnonzero(again)
    rows = rows[(rows >= AROUND) & (rows < again.size - AROUND)]
    if rows.size < FEWEST:
        return []
    impossible = np.zeros(rows.size, dtype=bool)
    for place in range(steps.shape[1]):
        sizes = np.abs(steps[steps[:, place] != 0.0, place])
        step = quantum(found[place][measured]) or float(np.quantile(sizes, 0.01))
        impossible |= _passed(steps[:, place], rows, STEADY * step)
    count = int(impossible.sum())
    if count < FEWEST or count < SHARE * len(recording):
        return []
    first = int(rows[np.argmax(impossible)]) + 1
    return [
        Fault(
            "repeated rows",
            Severity.SUSPICIOUS,
            f"{int(again.sum())} of {len(recording)} rows repeat the row before in all {len(found)} columns, {count} "
            f"of them in the middle of a motion, first row {first} ({recording.time[first]:.6g} s)",
            "the logger wrote old samples: see its rate and that of the device, and record again",
            "time",
            measures={"rows": int(again.sum()), "moving": count},
        )
    ]


def _passed(steps: Array, rows: IntArray, least: float) -> BoolArray:
    """Whether a column moves on, before and after each of `rows`, in the same direction and by more than `least`."""
    offsets = np.arange(1, AROUND + 1)
    before, after = steps[rows[:, None] - offsets], steps[rows[:, None] + offsets]
    sides = []
    for side in (before, after):
        large = np.abs(side) > least
        some = large.any(axis=1) & np.all(large | (side == 0.0), axis=1)
        signs = np.sign(side)
        sides.append((some, signs.max(axis=1), signs.min(axis=1)))
    (one, up, down), (other, up2, down2) = sides
    rising, falling = (down >= 0.0) & (down2 >= 0.0), (up <= 0.0) & (up2 <= 0.0)
    return np.asarray(one & other & (rising | falling))
