"""Runs that no clock can align, over a common abscissa (6.1.2): what each felt where, a pass at a time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.recordings.channels import CHANNELS
from hapticeval.recordings.compare.permutation import LEVEL, needed
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import LAG_TICKS, Stretch, continuing_steps, stretches
from hapticeval.types import Array, BoolArray, IntArray

# rad; a HIP that turns further about the centre in one step passes too near to it to be followed.
QUARTER_TURN = 0.5 * math.pi
LARGEST_BEND = 0.99  # share of the radius of curvature beyond which the foot is no function of the HIP to be followed
ROUNDED_STEP = 1e-9  # m below which a step of the foot is rounding
FULL_TURN = 2.0 * math.pi
HAND_STEP = 1.0 / 3600.0  # of a turn: a wider part that no run visits is none of the hand's steps


@dataclass(frozen=True)
class Abscissa:
    """The common axis over which runs are compared: where along its way each sample of a run is.

    `by` is "angle" (rad, of the HIP about `centre` (2,), m), "arc" (m, of the HIP's foot on `curve`) or a phase
    channel as CHANNEL:COLUMN, in that channel's unit. Raises `InputError` for another name, and for "arc" without a
    curve.
    """

    by: str
    centre: tuple[float, float] = (0.0, 0.0)
    curve: Curve | None = None

    def __post_init__(self) -> None:
        if self.by == "arc" and self.curve is None:
            raise InputError(
                "runs cannot be aligned by arc length",
                why="neither the recordings nor you say which model was touched",
                todo="give it with --model, or align --by angle",
            )
        if self.by not in ("angle", "arc"):
            channel, _, column = self.by.partition(":")
            if not channel or not column.isdigit():
                raise InputError(
                    f"runs cannot be aligned by '{self.by}'",
                    why="it is neither angle, nor arc, nor a channel with its column",
                    todo="write --by angle, --by arc, or a phase such as --by joint_position:0",
                )

    @property
    def unit(self) -> str:
        """The abscissa's unit."""
        units = {"angle": "rad", "arc": "m"} | {name: signal.unit for name, signal in CHANNELS.items()}
        return units.get(self.by.partition(":")[0], "")

    @property
    def period(self) -> float | None:
        """Length of one turn, in that unit; None where the abscissa is open."""
        if self.by == "angle":
            return 2.0 * math.pi
        if self.by == "arc" and self.curve is not None and self.curve.closed:
            return self.curve.length
        return None

    def along(self, recording: Recording, stretch: Stretch, label: str) -> tuple[Array, BoolArray]:
        """Return the abscissa over a stretch, (n,), which goes on beyond a full turn, and where it leaps, (n - 1,).

        The foot of a HIP that crosses the medial axis leaps: it is then farther along than the HIP moved and was not
        in between. Raises `InputError`, naming the time, where the HIP passes the centre too closely to have an angle.
        """
        hip = recording.hip[stretch.rows]
        leaps = np.zeros(len(stretch) - 1, dtype=bool)
        if self.by == "angle":
            offset = hip[:, :2] - np.asarray(self.centre)
            raw = np.arctan2(offset[:, 1], offset[:, 0])
            # Each step is the shorter way round, in [-pi, pi).
            step = _wrapped(np.diff(raw), FULL_TURN)
            # The sense of a step beyond a quarter turn is a guess, and at the centre itself there is no angle.
            steep, on_it = np.abs(step) > QUARTER_TURN, ~offset.any(axis=1)
            if steep.any() or on_it.any():
                row = stretch.first + int(np.argmax(steep if steep.any() else on_it))
                raise InputError(
                    f"{label}: the HIP passes the centre at t = {recording.time[row]:.6g} s (row {row})",
                    why="its angle about the centre cannot be followed there",
                    todo="choose another centre, or align --by arc",
                )
        elif self.by == "arc":
            assert self.curve is not None
            u = self.curve.nearest(hip)
            raw = np.asarray(self.curve.arc_length(u))
            step = np.diff(raw) if self.period is None else _wrapped(np.diff(raw), self.period)
            # From depth d under a convex surface the foot moves by the HIP's step / (1 - kappa d).
            depth = np.maximum(-self.curve.signed_distance(hip), 0.0)
            bent = np.minimum(depth * np.maximum(np.asarray(self.curve.curvature(u)), 0.0), LARGEST_BEND)
            moved = np.linalg.norm(np.diff(hip, axis=0), axis=1)
            # A foot more than LAG_TICKS times as far along as the HIP's step allows has leapt over the medial axis.
            leaps = np.asarray(
                np.abs(step) > LAG_TICKS * moved / (1.0 - np.maximum(bent[1:], bent[:-1])) + ROUNDED_STEP
            )
        else:
            channel, _, column = self.by.partition(":")
            values = np.asarray(recording.channels.get(channel, np.empty((0, 0))))
            values = values[:, np.newaxis] if values.ndim == 1 else values
            if int(column) >= values.shape[1]:
                raise InputError(
                    f"{label} has no column {column} of '{channel}'",
                    why="it is needed as the phase",
                    todo=f"its channels are: {', '.join(recording.channels)}",
                )
            return np.array(values[stretch.rows][:, int(column)]), leaps
        # The sum of wrapped steps goes on beyond a period, where the raw abscissa would start anew.
        return np.concatenate([[raw[0]], raw[0] + np.cumsum(step)]), leaps


def _wrapped(value: Array, period: float) -> Array:
    """Bring values into [-period / 2, period / 2)."""
    return np.asarray((value + 0.5 * period) % period - 0.5 * period)


class Segment(NamedTuple):
    """A piece of a run along the abscissa.

    `rows` (n,) of the run in their order, `along` (n,) their abscissa, and `apart` (n - 1,): between which of them
    nothing is known.
    """

    rows: IntArray
    along: Array
    apart: BoolArray

    @property
    def direction(self) -> int:
        """1 where the abscissa of a monotone segment rises, -1 where it falls."""
        return 1 if self.along[-1] > self.along[0] else -1


def _gapless_segments(recording: Recording, abscissa: Abscissa, label: str) -> list[Segment]:
    """Return the gapless stretches of a run with their abscissa. Raises `InputError` as `Abscissa.along` does."""
    segments = [
        Segment(np.arange(stretch.first, stretch.end), *abscissa.along(recording, stretch, label))
        for stretch in stretches(recording)
    ]
    if not segments:
        raise InputError(f"{label} has no two samples that follow each other", why="nothing can be aligned")
    return segments


def _join_over_gaps(segments: Sequence[Segment], *, slack: float, period: float | None) -> Iterator[Segment]:
    """Put the stretches of a run (one at least) together again: a gap in the clock ends neither a lap nor a way.

    Over a gap of a closed abscissa the hand took the shorter way. One that starts anew from farther back, and goes the
    same way again, is another pass and stays apart. Where two stretches meet the abscissa leaps.
    """
    joined_segment: Segment | None = None
    direction, farthest = 0, 0.0
    for rows, along, apart in segments:
        if joined_segment is not None and period is not None:
            # Lay this stretch onto the turn that brings its begin nearest to where the last one ended.
            along = along + period * round((joined_segment.along[-1] - along[0]) / period)
        turns = _turning_indices(along, slack)
        headings = [1 if along[last] > along[first] else -1 for first, last in pairwise(turns)]
        # It begins behind the farthest point so far and goes the same way, or nowhere: that is another pass.
        if (
            joined_segment is not None
            and direction * (along[0] - farthest) < -slack
            and (not headings or headings[0] == direction)
        ):
            yield joined_segment
            joined_segment, direction = None, 0
        if joined_segment is None:
            joined_segment = Segment(rows, along, apart)
        else:
            # One entry of `apart` more than steps: between the two stretches nothing is known.
            both = (joined_segment.rows, rows), (joined_segment.along, along), (joined_segment.apart, [True], apart)
            joined_segment = Segment(*(np.concatenate(parts) for parts in both))
        if headings:
            direction, farthest = headings[-1], float(along[turns[-1]])
    if joined_segment is not None:
        yield joined_segment


def _turning_indices(along: Array, slack: float) -> list[int]:
    """Return the indices at which the way begins, of every extreme that it leaves by more than `slack`, and its end."""
    turns: list[int] = []
    # `low` and `high` index the extremes since the last turn; `direction` is 0 until the first move beyond `slack`.
    low = high = direction = 0
    for index, value in enumerate(along.tolist()):
        if value >= along[high]:
            high = index
        if value <= along[low]:
            low = index
        if direction <= 0 and value - along[low] > slack:
            turns.append(low)
            direction, high = 1, index
        elif direction >= 0 and along[high] - value > slack:
            turns.append(high)
            direction, low = -1, index
    # A way that never moves by more than `slack` has neither a turn nor an end.
    return [*turns, high if direction > 0 else low] if direction else []


def _monotone_parts(segment: Segment, turns: Sequence[int]) -> Iterator[Segment]:
    """Yield the parts of a way between turns: the abscissa goes strictly one way, and steps back are left out."""
    # Leaps before each row, counted: two rows with different counts have a leap between them.
    leapt = np.concatenate([[0], np.cumsum(segment.apart)])
    for first, last in pairwise(turns):
        # Made rising whichever way the part goes, so that a row advances where it exceeds all rows before it.
        inside = segment.along[first : last + 1] * (1 if segment.along[last] > segment.along[first] else -1)
        advancing = first + np.flatnonzero(np.append(True, inside[1:] > np.maximum.accumulate(inside)[:-1]))
        yield Segment(segment.rows[advancing], segment.along[advancing], np.diff(leapt[advancing]) > 0)


def _with_unit(value: float, unit: str) -> str:
    if unit == "rad":
        return f"{math.degrees(value):.4g} degrees"
    return f"{1e3 * value:.4g} mm" if unit == "m" else f"{value:.4g} {unit}"


def _cut_of_period(segments: Sequence[Segment], period: float) -> float:
    """Return where to cut a closed abscissa: in the middle of the widest stretch that no run visits, or at 0.

    A sector round the origin of the angles then stays in one piece. `HAND_STEP` of a turn that is not visited is a step
    of the hand.
    """
    # Each segment as its begin in [0, period) and its length; a sweep in this order finds what no span covers.
    spans = sorted((float(segment.along.min()) % period, float(np.ptp(segment.along))) for segment in segments)
    # A span that goes over the end of the period covers the begin of the next.
    reached = max(spans[0][0], max(begin + length for begin, length in spans) - period)
    widest, cut = HAND_STEP * period, None
    for begin, length in [*spans, (spans[0][0] + period, 0.0)]:
        if begin - reached > widest:
            widest, cut = begin - reached, 0.5 * (begin + reached)
        reached = max(reached, begin + length)
    # In [-period, 0), so that the grid from there on reaches over the origin.
    return 0.0 if cut is None else cut % period - period


def _grid_range(segments: Sequence[Segment], period: float | None) -> tuple[float, float]:
    """Return the lowest and the highest abscissa of the common grid."""
    ends = [(float(segment.along.min()), float(segment.along.max())) for segment in segments]
    if period is not None:
        cut = _cut_of_period(segments, period)
        if cut == 0.0:
            return 0.0, period
        # Shift each segment by whole periods, until it begins in [cut, cut + period).
        shifts = [math.floor((low - cut) / period) * period for low, _ in ends]
        ends = [(low - shift, high - shift) for (low, high), shift in zip(ends, shifts, strict=True)]
    return min(low for low, _ in ends), max(high for _, high in ends)


GRID_POINTS = 721
"""Places of the grid over all that the runs cover: half a degree of a full turn."""

PASS_COLUMNS: Mapping[str, tuple[str, str]] = {
    "direction": ("rad", "direction of the force in the plane, unwrapped along the way"),
    "magnitude": ("N", "size of the force"),
    "depth": ("m", "distance of the IHIP from the HIP"),
}
"""What a pass holds, as far as its recording has it, with unit and meaning."""


@dataclass(frozen=True)
class Run:
    """A recording to align: `renderer` groups repeats, `label` names it in messages."""

    label: str
    renderer: str
    recording: Recording


@dataclass(frozen=True)
class Pass:
    """One passage over the abscissa in one direction: of run number `run`, from `start` to `end` (s).

    `lap` numbers those of a run in that direction. `columns` (m,) are on the grid, and 0 where `mask` (m,) is not set:
    outside of what the pass covers, where the tool is free, in gaps, and across jumps of IHIP or force.
    """

    run: int
    direction: int
    lap: int
    start: float
    end: float
    columns: Mapping[str, Array]
    mask: BoolArray

    @property
    def coverage(self) -> float:
        """Share of the grid with an answer."""
        return float(np.mean(self.mask))


@dataclass(frozen=True)
class Aligned:
    """Runs over a common abscissa: `grid` (m,) in `unit`."""

    by: str
    unit: str
    grid: Array
    runs: tuple[Run, ...]
    passes: tuple[Pass, ...]

    def passes_of(self, renderer: str, direction: int) -> tuple[Pass, ...]:
        """Return the passes of a renderer in one direction."""
        return tuple(
            pass_ for pass_ in self.passes if self.runs[pass_.run].renderer == renderer and pass_.direction == direction
        )


def align(runs: Sequence[Run], abscissa: Abscissa, *, split: bool = False) -> Aligned:
    """Resample runs over a common grid of the abscissa, linearly between neighbouring samples in contact.

    Nothing is interpolated over a gap in time, from contact to free space, or across a jump: an IHIP or a force that
    moves by more than three HIP steps allow (the force as of a spring of the run's own apparent stiffness). Raises
    `InputError` for no runs, runs that never touch, and, unless `split`, for one that turns back, naming the place.
    """
    if not runs:
        raise InputError("there are no runs to align", todo="name recordings")
    segments_of_runs = [_gapless_segments(run.recording, abscissa, run.label) for run in runs]
    low, high = _grid_range([segment for segments in segments_of_runs for segment in segments], abscissa.period)
    if not high > low:
        raise InputError("the runs do not move along the abscissa", todo="align them by something else")
    grid = np.linspace(low, high, GRID_POINTS)
    # Going back by less than one step of the grid is the hand's tremor, and no turn.
    slack = grid[1] - grid[0]
    passes: list[Pass] = []
    for number, (run, segments) in enumerate(zip(runs, segments_of_runs, strict=True)):
        smooth = _smooth_contact_steps(run.recording)
        laps = {1: 0, -1: 0}
        for segment in _join_over_gaps(segments, slack=slack, period=abscissa.period):
            turns = _turning_indices(segment.along, slack)
            if len(turns) > 2 and not split:
                turned_at, next_turned_at = (float(segment.along[turn]) for turn in turns[1:3])
                raise InputError(
                    f"{run.label} turns back by {_with_unit(abs(next_turned_at - turned_at), abscissa.unit)} at "
                    f"{_with_unit(turned_at, abscissa.unit)}, t = {run.recording.time[segment.rows[turns[1]]]:.6g} s",
                    why="a place that is passed twice has two answers, and a curve over it can hold only one",
                    todo=_advice(runs),
                )
            for heading in _monotone_parts(segment, turns):
                new_passes = list(
                    _passes_of(number, laps[heading.direction], run.recording, heading, smooth, grid, abscissa.period)
                )
                passes += new_passes
                # Passes of one direction are numbered through the whole run, over all of its headings.
                laps[heading.direction] = max([laps[heading.direction], *(one.lap + 1 for one in new_passes)])
    if not passes:
        raise InputError("none of the runs touches the surface", why="there is no force to compare")
    grid.flags.writeable = False
    return Aligned(abscissa.by, abscissa.unit, grid, tuple(runs), tuple(passes))


def _advice(runs: Sequence[Run]) -> str:
    """Describe what may be done about a run that turns back, and what that costs."""
    pairs = math.comb(len({run.renderer for run in runs}), 2)
    enough = needed(1, 1, tests=2 * max(pairs, 1), level=LEVEL)
    cost = "" if enough is None else f", so that it takes {enough[0]} and {enough[1]} runs to detect a difference"
    return (
        "give --split: every way between two turns is then a pass of its own, and forth and back are two tests"
        f"{cost}; or record, or cut out, one way only"
    )


def _smooth_contact_steps(recording: Recording) -> BoolArray:
    """Return between which samples (n - 1,) the run is one smooth contact."""
    force, hip = recording.force, recording.hip
    contact = np.any(force != 0.0, axis=1) & recording.measured
    moved = np.linalg.norm(np.diff(hip, axis=0), axis=1)
    both_touch = contact[1:] & contact[:-1]
    smooth: BoolArray = both_touch & continuing_steps(recording)
    if "ihip" in recording.channels:
        step = float(np.max(moved, where=both_touch, initial=0.0))
        ihip_change = np.linalg.norm(np.diff(recording.ihip, axis=0), axis=1)
        # A tool may catch up `LAG_TICKS` of the longest HIP steps in one tick, and a surface jump by its standoff.
        smooth &= ihip_change <= LAG_TICKS * step + recording.standoff
        depth = np.linalg.norm(recording.ihip - hip, axis=1)
        pressed = contact & (depth > 0.0)
        if pressed.any():
            # N/m: the apparent stiffness |F| / |IHIP - HIP|, whatever the renderer's gain and damping are.
            stiffness = float(np.median(np.linalg.norm(force[pressed], axis=1) / depth[pressed]))
            force_change = np.linalg.norm(np.diff(force, axis=0), axis=1)
            # A spring between HIP and IHIP changes with the steps of both.
            smooth &= force_change <= stiffness * ((LAG_TICKS + 1) * step + recording.standoff)
    return smooth


def _passes_of(
    number: int,
    before: int,
    recording: Recording,
    heading: Segment,
    smooth: BoolArray,
    grid: Array,
    period: float | None,
) -> Iterator[Pass]:
    """Yield the passes of a heading: one per lap, numbered on from those `before`."""
    # Rising in either direction, as searchsorted needs it.
    rows, along = heading.rows[:: heading.direction], heading.along[:: heading.direction]
    low, high = 0, 0
    if period is not None:
        # The laps that this heading touches: whole periods from the begin of the grid to either of its ends.
        low, high = (math.floor((end - float(grid[0])) / period) for end in (along[0], along[-1]))
    # Breaks before each row, counted: rows with equal counts are joined by smooth contact.
    broken = np.concatenate([[0], np.cumsum(~smooth)])
    apart = heading.apart[:: heading.direction] | (np.diff(broken[rows]) != 0)
    touched = np.any(recording.force[rows] != 0.0, axis=1)
    for lap in range(low, high + 1):
        places = grid + (0.0 if period is None else lap * period)
        after = np.searchsorted(along, places, side="left")
        right, at = np.clip(after, 1, along.size - 1), np.clip(after, 0, along.size - 1)
        inside = (after > 0) & (after < along.size)
        # An answer needs both neighbours in one contact, or a touching sample at the very place.
        mask = (inside & ~apart[right - 1]) | ((along[at] == places) & touched[at])
        if not mask.any():
            continue
        # Linear between neighbours: value = before + share (after - before).
        share = np.clip((places - along[right - 1]) / (along[right] - along[right - 1]), 0.0, 1.0)
        columns = _columns_at(recording, rows[right - 1], rows[right], share, mask)
        times = recording.time[np.concatenate([rows[right[mask] - 1], rows[right[mask]]])]
        start, end = float(times.min()), float(times.max())
        yield Pass(number, heading.direction, before + lap - low, start, end, columns, mask)


def _columns_at(
    recording: Recording, before: IntArray, after: IntArray, share: Array, mask: BoolArray
) -> dict[str, Array]:
    """Return the columns (m,) at the places that lie a `share` (m,) of the way from the rows `before` to `after`."""

    def at(values: Array) -> Array:
        """Interpolate a channel (n,) or (n, N), in m or N, at the places: (m,) or (m, N)."""
        part = share if values.ndim == 1 else share[:, np.newaxis]
        return np.asarray(values[before] + part * (values[after] - values[before]))

    pushed = at(recording.force)
    columns = {"magnitude": at(np.linalg.norm(recording.force, axis=1))}
    if pushed.shape[1] == 2:
        direction = np.arctan2(pushed[:, 1], pushed[:, 0])
        direction[mask] = np.unwrap(direction[mask])  # from one place with an answer to the next
        columns["direction"] = direction
    if "ihip" in recording.channels:
        columns["depth"] = np.linalg.norm(at(recording.ihip) - at(recording.hip), axis=1)
    return {name: np.where(mask, values, 0.0) for name, values in columns.items()}
