"""Sensors that stand still while the hand moves: judged by what the other channels do, from the first row on.

A value that does not change is no fault by itself: nothing may have happened. So each column is held against the travel
of the hand. A live sensor changes its reading every so many metres; one that keeps a value over a travel in which it
otherwise changes many times is frozen. What keeps its value by nature is left alone: zero force in free motion, the
reading that a coarse converter has there, a limit that is reached again and again, and a proxy, which may rest in a
notch while the hand moves inside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hapticeval.recordings.finding import Fault, Severity
from hapticeval.recordings.impact import declared_floor
from hapticeval.recordings.metadata import SIMULATED
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.relations import columns_of
from hapticeval.recordings.rows import runs_of
from hapticeval.recordings.signal_faults import STUCK_ROWS, quantum
from hapticeval.types import Array, BoolArray

SAME = 1e-12
"""Share of a column's largest value by which a frozen reading may change: turning its frame changes it by so much."""

TIMES = 30.0
"""A live sensor changes its reading so many times, in the mean, over the travel for which a frozen one keeps it."""

RECURS = 0.1
"""A reading that comes back and stays for this share of the travel is a level of the sensor, or a limit."""

MOVES = 50
"""Steps in which the hand must move before a column that never changes is reported."""

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
    for name, values in columns.items():
        channel = name if name in recording.signals else name.rpartition(".")[0]
        travel, other = _travel(recording, columns, name, channel)
        if travel is None or not other:
            continue
        unit = recording.signals[channel].unit
        if _constant(values[recording.measured]):
            faults += _dead(recording, name, channel, unit, values, travel, other)
        elif unit in MEASURES:
            taken = [each for each in known if each.channel == name and each.first is not None]
            faults += _stretches(recording, name, channel, values, travel, other, taken)
    return faults


def _travel(recording: Recording, columns: Mapping[str, Array], name: str, channel: str) -> tuple[Array | None, str]:
    """How far the reference of a column moved in each step (n - 1,), 0 beside rows without a measurement."""
    reference = OWN.get(channel) or next((each for each in REFERENCES if each in recording.channels), "")
    if reference not in recording.channels:
        return None, ""
    values = recording.channels[reference]
    if channel == reference:  # against the other components
        rest = [each for each in columns if each.rpartition(".")[0] == channel and each != name]
        values = np.column_stack([columns[each] for each in rest]) if rest else np.zeros((len(recording), 0))
        reference = ", ".join(rest)
    elif channel.endswith("velocity") and values.shape == recording.channels[channel].shape:
        place = list(_parts(columns, channel)).index(name)
        values, reference = values[:, [place]], list(_parts(columns, reference))[place]
    moved = np.linalg.norm(np.diff(values.reshape(len(recording), -1), axis=0), axis=1)
    both = recording.measured[1:] & recording.measured[:-1]
    return np.where(both & np.isfinite(moved), moved, 0.0), reference


def _parts(columns: Mapping[str, Array], channel: str) -> list[str]:
    return [each for each in columns if each == channel or each.rpartition(".")[0] == channel]


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
    channel = first if first in recording.signals else first.rpartition(".")[0]
    return recording.signals[channel].unit


def _stretches(
    recording: Recording, name: str, channel: str, values: Array, travel: Array, other: str, known: Sequence[Fault]
) -> list[Fault]:
    """The findings on the stretches over which a column that changes elsewhere keeps its value."""
    measured = recording.measured
    size = float(np.max(np.abs(values[measured])))
    both = measured[1:] & measured[:-1]
    same = both & (np.abs(np.diff(values)) <= SAME * size)
    path = np.concatenate([[0.0], np.cumsum(travel)])
    runs = [(first, end + 1) for first, end in runs_of(same)]  # rows
    moved = np.array([path[end - 1] - path[first] for first, end in runs])
    lengths = np.array([end - first for first, end in runs])
    found = []
    for place in np.flatnonzero(lengths >= STUCK_ROWS):
        first, end = runs[place]
        value, steps = float(values[first]), travel[first : end - 1]
        if np.count_nonzero(steps) < STUCK_ROWS or _rests(recording, channel, values, slice(first, end), value):
            continue
        alike = np.array([abs(values[a] - value) <= SAME * size for a, _ in runs])
        alike[place] = False
        if np.any(moved[alike] >= RECURS * moved[place]):
            continue
        # how far the hand goes, elsewhere, between two changes of the reading
        changes = int(np.count_nonzero(both & ~same))
        elsewhere = float(path[-1] - moved[lengths >= STUCK_ROWS].sum())
        if changes < STUCK_ROWS or moved[place] * changes < TIMES * elsewhere:
            continue
        if any(each.first < end and first < each.end for each in known if each.first is not None and each.end):
            continue
        found.append(
            Fault(
                "stuck",
                Severity.SUSPICIOUS,
                f"it keeps {value:.6g} over {end - first} rows, while {other} moves {moved[place]:.3g} "
                f"{_unit(recording, other)}; elsewhere it changes every {elsewhere / changes:.2g}",
                "leave those rows out; see the sensor and its cable",
                name,
                first,
                end,
                (float(recording.time[first]), float(recording.time[end - 1])),
                {"travel": float(moved[place])},
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
    found = [values for values in columns_of(recording).values() if np.any(np.diff(values[measured]))]
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


def _passed(steps: Array, rows: Array, least: float) -> BoolArray:
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
