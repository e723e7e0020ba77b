"""What is wrong with one column: no number, stuck, clipped, spiking, jumping, gone, or still while the hand moves.

A value that does not change is not a fault by itself, as nothing may have happened. So each column is held against the
travel of the hand: a live sensor changes its reading every so many metres, and one that keeps a value over a travel in
which it otherwise changes many times is stuck. What keeps its value by nature is left alone:

- zero force in free motion, and the reading that a coarse converter has there;
- a limit that is reached again and again;
- a proxy, which may rest in a notch while the hand moves inside.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from hapticeval.quantity import plural
from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.integrity.issue import Issue, Severity, make_issue
from hapticeval.recordings.provenance import declared_floor
from hapticeval.recordings.quantization import coarsest, noise_deviation, numeric_step
from hapticeval.recordings.recording import Column, Recording, columns_of, runs_of
from hapticeval.recordings.stretches import stretches
from hapticeval.types import Array, BoolArray

STUCK_ROWS = 10
"""Equal values in a row that may be a stuck sensor, where the value jumps when it wakes."""

WAKING_TIMES = 4.0
"""The jump on waking is larger than so many of the steps beside it, and than so many quanta."""

LASTING_TIMES = 5
"""A stuck value lasts for more than so many times the rows for which the column's values usually do."""

ROWS_AWAKE = 3
"""More rows than so many follow the waking: a value that differs at the column's very end is not a sensor that woke."""

CLIPPED_ROWS = 5
"""Equal values in a row, at the extreme of a column and reached at speed, that are clipped."""

CLIPPED_QUANTA = 3.0
"""A signal at speed changes by more than so many quanta in a row."""

CLIPPED_SHARE = 0.3
"""A clipped signal keeps more than this share of its speed up to the extreme: a smooth peak is entered slowly."""

RAMP_STEPS = 3
"""Steps into and out of a clipped run that show at what speed the signal comes and goes; one row more is beyond."""

NEIGHBOURING_STEPS = 8
"""Steps on either side of a jump, or of a stuck value, that it is compared with."""

SPIKE_DEVIATIONS = 20.0
"""A spike stands out of the noise by so many standard deviations of the second difference.

A jump is larger than so many of the steps beside it."""

BEND_TIMES = 4.0
"""A spike is also so many times what all rows but a hundredth bend by: signals have quiet and busy stretches."""

RARE_ROWS = 8
"""Rows, at the least, of which that hundredth is: a spike bends three."""

SPIKE_QUANTA = 6.0
"""A spike is so many quanta high, for an encoder at rest dithers by one; a jump also so many usual steps."""

NEIGHBOUR_AGREEMENT = 0.25
"""Share of a spike or a jump up to which the rows beside it are on one line: otherwise the signal itself has moved."""

FEWEST_SPIKE_ROWS = 8
"""Rows below which nothing is usual in a stretch, and so no row of it a spike."""

NEIGHBOUR_OFFSETS = np.array([-2.0, -1.0, 1.0, 2.0])
SLOPE_WEIGHTS = NEIGHBOUR_OFFSETS / np.dot(NEIGHBOUR_OFFSETS, NEIGHBOUR_OFFSETS)
"""Two rows on either side of a spike, and the weights that give their slope."""

FORCE_UNITS = ("N", "N m")
"""Units of what jumps by nature: forces and torques are zero for long, and are hit in one tick."""

Span = tuple[int, int]


def issues_of_numbers(recording: Recording) -> Iterator[Issue]:
    """Yield the stretches of rows in which a channel lacks a number, in whichever of its columns."""
    channels: dict[str, dict[str, BoolArray]] = {}
    for name, column in columns_of(recording).items():
        # Together by channel: a vector lacks a number where any of its components does.
        channels.setdefault(column.channel, {})[name] = ~np.isfinite(column.values)
    for channel, columns in channels.items():
        for first, end in runs_of(np.logical_or.reduce(list(columns.values()))):
            lacking = [name for name, where in columns.items() if where[first:end].any()]
            parts = "" if len(lacking) == 1 else f" ({', '.join(name.rpartition('.')[2] for name in lacking)})"
            message = f"{plural(end - first, 'row')} without a number{parts}"
            yield make_issue(
                recording, "no number", message, lacking[0] if len(lacking) == 1 else channel, (first, end)
            )


COMPUTED = ("ihip", "contact")
"""Channels that no sensor measures: what they do is the renderer's, and checks judge it."""


def issues_of_values(recording: Recording) -> Iterator[Issue]:
    """Yield the jumps, dropouts, stuck, clipped and spiking rows of each column, over its rows that follow each other.

    What a renderer computes has only spikes, as notes: a proxy rests on a face, leaps off an edge, or pops. A motor at
    its limit is a note, too.
    """
    for name, (channel, unit, values) in columns_of(recording).items():
        sound = recording.measured & np.isfinite(values)
        if not sound.any() or np.ptp(values[sound]) == 0.0:
            continue
        column = _Values(channel, unit, numeric_step(values[sound]) or 0.0, (values[sound].min(), values[sound].max()))
        for stretch in stretches(recording, sound):
            part = values[stretch.rows]
            for kind, spans in _spans(recording, column, part, stretch.first).items():
                for first, end in spans:
                    message = MESSAGE_OF[kind].format(by=part[first] - part[first - 1], at=part[first])
                    note = column.computed or (column.is_force and kind == "saturated")
                    span = (stretch.first + first, stretch.first + end)
                    yield make_issue(recording, kind, message, name, span, severity=Severity.NOTE if note else None)


@dataclass(frozen=True)
class _Values:
    """What is known of a column: channel, unit, quantum in that unit (0 where it is on no lattice), and range."""

    channel: str
    unit: str
    step: float
    extremes: tuple[float, float]

    @property
    def is_force(self) -> bool:
        """Whether it is zero for long, and switches on in a row."""
        return self.unit in FORCE_UNITS

    @property
    def computed(self) -> bool:
        """Whether no sensor measured it."""
        return self.channel in COMPUTED


def _spans(recording: Recording, column: _Values, values: Array, begin: int) -> Mapping[str, Sequence[Span]]:
    """Return the rows of each kind of issue in the `values` (n,) of a stretch, which begins at row `begin`."""
    spikes = [(row, row + 1) for row in _spikes(values, column.step, column.is_force)]
    if column.computed:
        return {"spike": spikes}
    # Only a place has no jumps by nature: forces switch on.
    jumps = list(_jumps(values, column.step)) if column.unit in ("m", "rad") else []
    dropouts = list(_dropouts(values, jumps))
    stuck = [span for span in _stuck(recording, column, values, begin) if span not in dropouts]
    # A stuck sensor jumps where it wakes, and a dropout at both ends: one issue is enough.
    explained = {end for _, end in stuck} | {row for span in dropouts for row in span}
    return {
        "jump": [(row, row + 1) for row in jumps if row not in explained],
        "dropout": [(first, end) for first, end in dropouts if end > first + 1],  # one row is a spike, or none
        "stuck": _pressing(column, values, stuck),
        "saturated": _pressing(column, values, _clipped(values, column.step, column.extremes)),
        "spike": spikes,
    }


def _pressing(column: _Values, values: Array, spans: Sequence[Span]) -> Sequence[Span]:
    """Return the spans but for those of a force at zero, which is free motion."""
    return [span for span in spans if not (column.is_force and values[span[0]] == 0.0)]


def _stuck(recording: Recording, column: _Values, values: Array, begin: int) -> Sequence[Span]:
    """Return the spans over which a value is frozen, then jumps; of a force only those in which the depth changes."""
    spans = list(_runs_that_wake(values, column.step))
    if column.channel != "force":
        return spans
    changing = _changing_depth(recording, [(begin + first, begin + end) for first, end in spans])
    return [(first - begin, end - begin) for first, end in changing]


MESSAGE_OF = {
    "dropout": "it jumps to {at:.4g}, by {by:.4g}, and back",
    "jump": "it jumps by {by:.4g} between two rows, and goes on from there",
    "stuck": "the value is frozen, then jumps",
    "saturated": "clipped at {at:.6g}",
    "spike": "one row stands out",
}


def _constant_runs(values: Array, shortest: int) -> list[Span]:
    """Return the rows [first, end) over which a column keeps one value, of as many rows at least."""
    return [(first, end + 1) for first, end in runs_of(np.diff(values) == 0.0) if end + 1 - first >= shortest]


def _usual_step(steps: Array) -> float:
    """Return the median of the steps that are none of rest, 0 where all are."""
    some = steps[steps > 0.0]
    return float(np.median(some)) if some.size else 0.0


def _runs_that_wake(values: Array, step: float) -> Iterator[Span]:
    """Yield runs of one value that end in a jump: by then the signal had moved on, at rest it would not have."""
    steps = np.abs(np.diff(values))
    # Rows for which each value lasts: a slow or coarse signal keeps its values longer, and that is not stuck.
    lengths = np.diff(np.concatenate([[0], np.flatnonzero(steps) + 1, [values.size]]))
    for first, end in _constant_runs(values, max(STUCK_ROWS, int(LASTING_TIMES * float(np.median(lengths))) + 1)):
        # The largest step beside the run: a jump on waking stands out against it.
        neighbours = [steps[max(0, first - NEIGHBOURING_STEPS) : first], steps[end : end + NEIGHBOURING_STEPS]]
        around = np.concatenate(neighbours).max(initial=0.0)
        waking_jump = abs(values[end] - values[first]) if end < values.size - ROWS_AWAKE else 0.0
        if waking_jump > WAKING_TIMES * max(around, step):
            yield first, end


def _jumps(values: Array, step: float) -> Iterator[int]:
    """Yield the rows before which a place jumps: by one step far larger than all beside it on either side.

    A hand has mass: its steps grow and shrink by its acceleration, from row to row, and never stand alone. What takes a
    jump back may stand beside it, and its like that are taken back as well.
    """
    changes = np.diff(values)
    steps = np.abs(changes)
    for row in np.flatnonzero(steps > SPIKE_QUANTA * max(step, _usual_step(steps))).tolist():
        neighbours = np.concatenate(
            [changes[max(0, row - NEIGHBOURING_STEPS) : row], changes[row + 1 : row + 1 + NEIGHBOURING_STEPS]]
        )
        back, again = (np.abs(neighbours + sign * changes[row]) < NEIGHBOUR_AGREEMENT * steps[row] for sign in (1, -1))
        others = np.abs(neighbours[~back & ~(again & (back.sum() >= again.sum()))])
        if NEIGHBOURING_STEPS <= row < steps.size - NEIGHBOURING_STEPS and steps[row] > SPIKE_DEVIATIONS * float(
            others.max(initial=0.0)
        ):
            yield row + 1


def _dropouts(values: Array, jumps: Sequence[int]) -> Iterator[Span]:
    """Yield the rows between a jump and the step that takes it back: few, or of one value, as of a mark out of sight.

    Many rows that go on moving are another place, such as that of a counter that overflowed.
    """
    changes, ended = np.diff(values), 0
    for first, next_jump in zip_longest(jumps, jumps[1:]):
        # Where one ends, none begins: what follows is the signal.
        if first <= ended:
            continue
        # Few rows, whatever they hold, or rows of one value up to the next jump.
        ends: Sequence[int] = range(first + 1, min(first + 1 + STUCK_ROWS, values.size))
        if next_jump is not None and np.ptp(values[first:next_jump]) == 0.0:
            ends = [next_jump]
        away = changes[first - 1]
        for end in ends:
            if abs(changes[end - 1] + away) < NEIGHBOUR_AGREEMENT * abs(away):
                ended = end
                yield first, end
                break


def _clipped(values: Array, step: float, extremes: tuple[float, float]) -> list[Span]:
    """Return runs at an extreme that the signal reaches and leaves at speed, as no smooth signal turns."""
    spans = []
    for first, end in _constant_runs(values, CLIPPED_ROWS):
        if values[first] not in extremes or first <= RAMP_STEPS or end >= values.size - RAMP_STEPS:
            continue
        # 1 at an upper extreme, -1 at a lower one: rise and fall are then positive towards and away from it.
        upward = np.sign(values[first] - values[first - 1])
        rise = upward * np.diff(values[first - RAMP_STEPS : first + 1])
        fall = -upward * np.diff(values[end - 1 : end + RAMP_STEPS])
        # the step on to the extreme, and the one off it, are cut short by it: they are left out
        steady = np.all(rise[:-1] > CLIPPED_QUANTA * step) and np.all(fall[1:] > CLIPPED_QUANTA * step)
        # a smooth peak of this width is entered by steps of curvature alone: each a small share of the one before
        if steady and rise[1] > CLIPPED_SHARE * rise[0] and fall[1] > CLIPPED_SHARE * fall[2]:
            spans.append((first, end))
    return spans


def _spikes(values: Array, step: float, is_force: bool) -> Iterator[int]:
    """Yield single rows off the line through their neighbours, whose neighbours agree."""
    if values.size < FEWEST_SPIKE_ROWS:
        return
    # How far each row is off the middle of its neighbours: half the second difference.
    size = np.abs(values[1:-1] - 0.5 * (values[2:] + values[:-2]))
    rare = min(size.size - 1, max(RARE_ROWS, size.size // 100))
    floor = max(
        # 1.4826 times the median deviation is the standard deviation of normal noise.
        SPIKE_DEVIATIONS * 1.4826 * float(np.median(size)),
        # What all rows but the rarest bend by.
        BEND_TIMES * float(np.partition(size, -(rare + 1))[-(rare + 1)]),
        SPIKE_QUANTA * step,
    )
    for row in (np.flatnonzero(size > floor) + 1).tolist():
        if row < 2 or row > values.size - 3:  # two rows on either side are asked
            continue
        neighbours = values[[row - 2, row - 1, row + 1, row + 2]]
        if is_force and np.any(neighbours == 0.0):
            continue  # a collision: the tool was or is free
        # Least-squares line through the two rows on either side, without the row itself.
        middle, slope = float(neighbours.mean()), float(np.dot(neighbours, SLOPE_WEIGHTS))
        off = abs(values[row] - middle)
        if np.max(np.abs(neighbours - middle - slope * NEIGHBOUR_OFFSETS)) < NEIGHBOUR_AGREEMENT * off:
            yield row


STUCK_ROUNDING = 1e-12
"""Share of a column's largest value by which a stuck reading may change, as when its frame is turned."""

STUCK_TIMES = 30.0
"""A live sensor changes its reading so many times, in the mean, over the travel of a stuck one."""

RECURRING_SHARE = 0.1
"""Share of the travel for which a reading stays that comes back: it is a level of the sensor, or a limit."""

BAND_SHARE = 0.8
"""Share of the rows within a quantum of a reading that a stuck one keeps: of a smooth signal on a lattice it is at most
0.71, where the signal turns, sqrt(1) to sqrt(2)."""

STILL_SECONDS, STILL_SHARE = 0.2, 0.2
"""A hand at one place to the bit for so long, while its force changes by that share of its largest, is stuck."""

LEAST_MOVES = 50
"""Steps in which the hand must move before a column that never changes is reported."""

EVEN_SPEED = 0.2
"""Share of a constant speed by which it may be off that of its place: a wrong one is further off."""

ZERO_LEVELS = 1.5
"""Steps of a coarse converter within which a constant reading is its zero."""

MOVING_UNITS: Mapping[str, str] = {"N": "force", "N m": "torque", "m/s": "speed", "rad/s": "speed"}
"""Units of what must change while the hand moves: positions may stand still in one direction."""

REFERENCES = ("hip", "measured_hip", "joint_position", "raw", "ihip")
"""Whose travel a column is held against: the first that was recorded."""

REFERENCE_OF = {"velocity": "hip", "measured_velocity": "hip", "joint_velocity": "joint_position", "wall_force": "ihip"}
"""... but for these, which follow one channel: a speed its own component of it."""


def issues_of_rest(recording: Recording, known: Sequence[Issue]) -> Iterator[Issue]:
    """Yield stretches over which a force, torque or speed keeps its value though the hand moves, and constant columns.

    `known` are issues whose rows need no second one. Answers of a simulation are exact, and left alone.
    """
    if recording.meta.get("source") in SIMULATED or len(recording) <= STUCK_ROWS:
        return
    columns = columns_of(recording)
    for name, column in columns.items():
        travel, other = _travel(recording, columns, name)
        numbers = column.values[recording.measured]
        numbers = numbers[np.isfinite(numbers)]
        # A column without a sound row is reported by its rows without a number.
        if not other or not numbers.size:
            continue
        if float(np.ptp(numbers)) <= STUCK_ROUNDING * float(np.max(np.abs(numbers))):
            yield from _constant_column(recording, name, column, travel, other)
        elif column.unit in MOVING_UNITS:
            reported = [(issue.first, issue.end) for issue in known if issue.channel == name]
            place = columns[other].values if MOVING_UNITS[column.unit] == "speed" and other in columns else None
            for run in _stuck_runs(recording, column, travel, place):
                first, end = run.span
                message = (
                    f"it keeps {column.values[first]:.6g} over {end - first} rows, while {other} moves {run.moved:.3g} "
                    f"{_unit(recording, other)}; elsewhere it changes every {run.every:.2g}"
                )
                if not any(a is not None and b is not None and a < end and first < b for a, b in reported):
                    yield make_issue(recording, "stuck", message, name, (first, end))


def _changing_depth(recording: Recording, spans: Sequence[Span]) -> list[Span]:
    """Return the spans of rows [first, end) over which the way from the HIP to the IHIP changes; all where one lacks.

    It is one, as a spring's force is then, where a hand is led along a flat face at one depth, however far.
    """
    if not {"hip", "ihip"} <= set(recording.channels):
        return list(spans)
    stretch = recording.ihip - recording.hip
    # m: rounding, and whatever steps both are given in.
    open_length = STUCK_ROUNDING * float(np.nanmax(np.abs(recording.hip), initial=0.0))
    open_length += coarsest(recording.hip) + coarsest(recording.ihip)
    # Negated <=, so that a span without a number is one of them.
    return [(first, end) for first, end in spans if not np.ptp(stretch[first:end], axis=0).max() <= open_length]


def _travel(recording: Recording, columns: Mapping[str, Column], name: str) -> tuple[Array, str]:
    """Return how far the reference of a column moved in each step (n - 1,), 0 beside rows without a measurement.

    And the reference's name, empty where there is none. A column of the reference itself is held against its others.
    """
    channel = columns[name].channel
    reference = REFERENCE_OF.get(channel) or next(
        (candidate for candidate in REFERENCES if candidate in recording.channels), ""
    )
    if reference not in recording.channels:
        return np.zeros(0), ""
    values = recording.channels[reference]
    parts = [part for part, column in columns.items() if column.channel == channel]
    if channel == reference:
        parts.remove(name)
        if not parts:
            return np.zeros(0), ""
        values = np.column_stack([columns[part].values for part in parts])
        reference = ", ".join(parts)
    elif channel.endswith("velocity") and values.shape == recording.channels[channel].shape:
        # A speed follows its own component: the other directions may well move while it is zero.
        values = values[:, [parts.index(name)]]
        reference = [part for part, column in columns.items() if column.channel == reference][parts.index(name)]
    moved = np.linalg.norm(np.diff(values.reshape(len(recording), -1), axis=0), axis=1)
    both = recording.measured[1:] & recording.measured[:-1]
    return np.where(both & np.isfinite(moved), moved, 0.0), reference


def _unit(recording: Recording, reference: str) -> str:
    first = reference.split(", ")[0]
    return recording.signals[first if first in recording.signals else first.rpartition(".")[0]].unit


def _constant_column(recording: Recording, name: str, column: Column, travel: Array, other: str) -> Iterator[Issue]:
    """Yield the issue on a column that never changes, where its reference does."""
    channel, unit, values = column
    if np.count_nonzero(travel) < LEAST_MOVES or recording.signals[channel].frame not in ("world", "joint"):
        return
    # `distance` is in the unit of the reference, m or rad.
    value, distance = float(values[recording.measured][0]), float(np.sum(travel))
    what = f"it is {value:.6g} {unit} throughout, while {other} moves {distance:.3g} {_unit(recording, other)}"
    if unit in MOVING_UNITS and value == 0.0 and not recording.channels[channel].any() and "velocity" not in channel:
        what += ": no contact, or a sensor that is not connected"
    note = None if unit in MOVING_UNITS and value != 0.0 else Severity.NOTE
    yield make_issue(recording, "constant", what, name, severity=note)


class StuckRun(NamedTuple):
    """Rows [first, end) over which a column keeps its value while its reference has `moved`, m or rad; elsewhere it
    changes each time that has moved by `every`."""

    span: Span
    moved: float
    every: float


def _stuck_runs(recording: Recording, column: Column, travel: Array, place: Array | None) -> Iterator[StuckRun]:
    """Yield the runs over which a column that changes elsewhere keeps its value.

    A speed that was made of a `place` (n,) keeps its value where that goes on evenly, and is left alone.
    """
    values, measured = column.values, recording.measured
    rounding, step = STUCK_ROUNDING * float(np.max(np.abs(values[measured]))), numeric_step(values[measured]) or 0.0
    both = measured[1:] & measured[:-1]
    same = both & (np.abs(np.diff(values)) <= rounding)
    # Travel up to each row, m or rad: that over a run is a difference of two of them.
    path = np.concatenate([[0.0], np.cumsum(travel)])
    runs = [(first, end + 1) for first, end in runs_of(same)]
    moved = np.array([path[end - 1] - path[first] for first, end in runs])
    candidates = [index for index, (first, end) in enumerate(runs) if end - first >= STUCK_ROWS]
    changes = int(np.count_nonzero(both & ~same))
    # How far the hand goes between all changes of the reading.
    elsewhere = float(path[-1] - moved[candidates].sum())
    for index in candidates:
        first, end = runs[index]
        # Stuck: the hand moved, the reading changes elsewhere, and by now it should have changed `STUCK_TIMES` times.
        resting = np.count_nonzero(travel[first : end - 1]) < STUCK_ROWS
        if resting or changes < STUCK_ROWS or moved[index] * changes < STUCK_TIMES * elsewhere:
            continue
        # A value that comes back, and stays there for long again, is a level of the sensor or a limit of the motor.
        alike = np.array([abs(values[other] - values[first]) <= rounding for other, _ in runs])
        alike[index] = False
        recurs = bool(np.any(moved[alike] >= RECURRING_SHARE * moved[index])) or _turns(values, step, first, end)
        if not (recurs or _rightly_constant(recording, column, slice(first, end), place)):
            yield StuckRun((first, end), float(moved[index]), elsewhere / changes)


def _turns(values: Array, step: float, first: int, end: int) -> bool:
    """Return whether a reading on a lattice is one level of a signal that turns there, and no stuck one."""
    near = np.abs(values - values[first]) < ZERO_LEVELS * step
    before, after = np.flatnonzero(~near[:first]), np.flatnonzero(~near[end:])
    band = (end + after[0] if after.size else values.size) - (before[-1] + 1 if before.size else 0)
    return bool(end - first < BAND_SHARE * band)


def still_hand(recording: Recording) -> Iterator[Issue]:
    """Yield the stretches over which the hand is at one place to the bit while the force on it changes."""
    if recording.meta.get("source") in SIMULATED or not {"hip", "force"} <= recording.channels.keys():
        return
    force, measured = recording.force, recording.measured
    still = measured[1:] & measured[:-1] & ~np.any(np.diff(recording.hip, axis=0), axis=1)
    for first, end in runs_of(still):
        rows = slice(first, end + 1)
        if recording.time[end] - recording.time[first] < STILL_SECONDS:
            continue
        changed, noise = np.ptp(force[rows], axis=0), noise_deviation(force[rows], order=1)
        axis = int(np.argmax(changed))
        if changed[axis] > STILL_SHARE * np.abs(force[measured]).max() and changed[axis] > SPIKE_DEVIATIONS * noise:
            low, high = force[rows, axis].min(), force[rows, axis].max()
            where = f"the hand is at one place over {end + 1 - first} rows"
            message = f"{where}, while the force goes from {low:.3g} to {high:.3g} N"
            yield make_issue(recording, "stuck", message, "hip", (first, end + 1))


def _rightly_constant(recording: Recording, column: Column, rows: slice, place: Array | None) -> bool:
    """Return whether a value may stay: in free motion, at one depth, or over a place that goes on evenly."""
    value = float(column.values[rows.start])
    if _is_free_reading(recording, column, rows, value):
        return True
    if place is not None:
        duration = recording.time[rows.stop - 1] - recording.time[rows.start]
        mean_speed = (place[rows.stop - 1] - place[rows.start]) / duration
        return bool(abs(mean_speed - value) <= EVEN_SPEED * abs(value))
    return column.channel == "force" and not _changing_depth(recording, [(rows.start, rows.stop)])


def _is_free_reading(recording: Recording, column: Column, rows: slice, value: float) -> bool:
    """Return whether a constant reading is that of free motion: zero, or as good as zero to the sensor.

    Zero counts for a component alone: a surface across the axes has none of its force in one of them.
    """
    floor = declared_floor(recording) or 0.0
    if value == 0.0:
        return True
    # Small enough for the sensor's own zero: then it rests only where all components do.
    if abs(value) > max(floor, ZERO_LEVELS * (numeric_step(column.values[recording.measured]) or 0.0)):
        return False
    return bool(np.max(np.abs(recording.channels[column.channel][rows])) <= max(floor, abs(value)) * ZERO_LEVELS)


MOVING_QUANTA = 2.5  # quanta in a step that no encoder at rest makes: between two such steps the row cannot be the same
STEPS_AROUND = 3  # steps on either side of a repeated row that are looked at
DIGIT_SHARE = 0.25  # of the smallest steps: a quantum below that is none of a sensor's
FEWEST_REPEATED = 10  # so many repeated rows in motion are a logger's habit; a device may be late once


def repeated_rows(recording: Recording) -> Iterator[Issue]:
    """Yield an issue on rows that hold the row before over again, in all columns, in the middle of a motion.

    At rest, and in motion slower than a quantum per row, that may be so. Between two steps of `MOVING_QUANTA` quanta in
    the same direction it cannot: the logger wrote an old sample.
    """
    measured = recording.measured
    both = measured[1:] & measured[:-1]
    columns = [column for column in columns_of(recording).values() if np.any(np.diff(column.values[measured]))]
    if recording.meta.get("source") in SIMULATED or not columns or len(recording) < 4 * STEPS_AROUND:
        return
    steps = np.column_stack([np.where(both, np.diff(column.values), 0.0) for column in columns])
    again = both & ~steps.any(axis=1)
    rows = np.flatnonzero(again)
    rows = rows[(rows >= STEPS_AROUND) & (rows < again.size - STEPS_AROUND)]
    if rows.size < FEWEST_REPEATED:
        return
    # Indices (k, 6) of the steps beside each repeated row, itself left out.
    around = rows[:, np.newaxis] + np.delete(np.arange(-STEPS_AROUND, STEPS_AROUND + 1), STEPS_AROUND)
    impossible = np.zeros(rows.size, dtype=bool)
    for column, column_steps in zip(columns, steps.T, strict=True):
        # Without a lattice the channel's smallest steps stand for a quantum of what it was made of, such as encoders.
        lengths = np.linalg.norm(steps[:, [other.channel == column.channel for other in columns]], axis=1)
        smallest = float(np.quantile(lengths[lengths > 0.0], 0.01))
        # One that is far finer is that of the digits in which the numbers were written.
        lattice = numeric_step(column.values[measured]) or 0.0
        step = lattice if lattice > DIGIT_SHARE * smallest else smallest
        neighbours = column_steps[around]
        large = np.abs(neighbours) > MOVING_QUANTA * step
        # The motion goes on in one direction, with steps too large for rest, before and after the repeated row.
        one_direction = np.all(neighbours >= 0.0, axis=1) | np.all(neighbours <= 0.0, axis=1)
        either = large[:, :STEPS_AROUND].any(axis=1) & large[:, STEPS_AROUND:].any(axis=1)
        impossible |= one_direction & either & np.all(large | (neighbours == 0.0), axis=1)
    count = int(impossible.sum())
    if count < FEWEST_REPEATED:
        return
    first = int(rows[np.argmax(impossible)]) + 1
    message = (
        f"{int(again.sum())} of {len(recording)} rows repeat the row before in all {len(columns)} columns, {count} "
        f"of them in the middle of a motion, first row {first} ({recording.time[first]:.6g} s)"
    )
    yield make_issue(recording, "repeated rows", message, "time", rows=int(again.sum()))
