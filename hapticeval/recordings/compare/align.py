"""Runs that no clock can align, over a common abscissa (6.1.2): what each felt where, a pass at a time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.recordings.compare.permutation import LEVEL, needed
from hapticeval.recordings.quantization import Resolution, resolution
from hapticeval.recordings.recording import CHANNELS, Recording
from hapticeval.recordings.stretches import LAG, Stretch, joined, stretches
from hapticeval.types import Array, BoolArray, IntArray

QUARTER = 0.5 * math.pi
"""A HIP that turns further about the centre in one step passes too near to it for its angle to be followed."""

MOST_BENT = 0.99
"""Share of the radius of curvature beyond which the foot is no function of the HIP that anyone could follow."""
TINY = 1e-9
"""Metres below which a step of the foot is rounding."""


@dataclass(frozen=True)
class Abscissa:
    """Says where along its way each sample of a run is.

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
        known = CHANNELS.get(self.by.partition(":")[0])
        return {"angle": "rad", "arc": "m"}.get(self.by) or (known.unit if known is not None else "")

    @property
    def period(self) -> float | None:
        """Once round, in that unit; None where the way is open."""
        if self.by == "angle":
            return 2.0 * math.pi
        if self.by == "arc" and self.curve is not None and self.curve.closed:
            return self.curve.length
        return None

    def along(self, recording: Recording, stretch: Stretch, label: str) -> tuple[Array, BoolArray]:
        """Over a stretch: the abscissa, going on beyond a full turn, (n,), and where it leaps, (n - 1,).

        The foot of a HIP that crosses the medial axis leaps: it is then farther along than the HIP moved and was not
        in between. Raises `InputError`, naming the time, where the HIP passes the centre too closely to have an angle.
        """
        hip = recording.hip[stretch.rows]
        leaps = np.zeros(len(stretch) - 1, dtype=bool)
        if self.by == "angle":
            offset = hip[:, :2] - np.asarray(self.centre)
            raw = np.arctan2(offset[:, 1], offset[:, 0])
            turn = _wrapped(np.diff(raw), 2.0 * math.pi)
            steep = np.abs(turn) > QUARTER
            if steep.any() or not offset.any(axis=1).all():
                row = stretch.first + int(np.argmax(steep if steep.any() else ~offset.any(axis=1)))
                raise InputError(
                    f"{label}: the HIP passes the centre at t = {recording.time[row]:.6g} s (row {row})",
                    why="its angle about the centre cannot be followed there",
                    todo="choose another centre, or align --by arc",
                )
            return np.concatenate([[raw[0]], raw[0] + np.cumsum(turn)]), leaps
        if self.by == "arc":
            assert self.curve is not None
            raw = np.asarray(self.curve.arc_length(self.curve.nearest(hip)))
            step = np.diff(raw) if self.period is None else _wrapped(np.diff(raw), self.period)
            return np.concatenate([[raw[0]], raw[0] + np.cumsum(step)]), self._leaps(hip, step)
        channel, _, column = self.by.partition(":")
        values = recording.channels.get(channel)
        if values is not None and values.ndim == 1:
            values = values[:, np.newaxis]
        if values is None or int(column) >= values.shape[1]:
            raise InputError(
                f"{label} has no column {column} of '{channel}'",
                why="it is needed as the phase",
                todo=f"its channels are: {', '.join(recording.channels)}",
            )
        return np.array(values[stretch.rows][:, int(column)]), leaps

    def _leaps(self, hip: Array, step: Array) -> BoolArray:
        """Steps of the foot that three of the HIP's own, stretched by the curvature at the foot, do not account for.

        From depth d under a convex surface the foot moves by the HIP's step / (1 - kappa d).
        """
        assert self.curve is not None
        moved = np.linalg.norm(np.diff(hip, axis=0), axis=1)
        u = self.curve.nearest(hip)
        depth = np.maximum(-self.curve.signed_distance(hip), 0.0)
        bent = np.minimum(depth * np.maximum(np.asarray(self.curve.curvature(u)), 0.0), MOST_BENT)
        return np.asarray(np.abs(step) > LAG * moved / (1.0 - np.maximum(bent[1:], bent[:-1])) + TINY)


def _wrapped(value: Array, period: float) -> Array:
    """Brought into [-period / 2, period / 2)."""
    return np.asarray((value + 0.5 * period) % period - 0.5 * period)


@dataclass(frozen=True)
class Way:
    """A run, or a gapless stretch of it: its rows (n,), their abscissa (n,), and where that leaps, (n - 1,)."""

    rows: IntArray
    along: Array
    leaps: BoolArray


@dataclass(frozen=True)
class Heading:
    """Rows of a way over which the abscissa goes one way: strictly onwards, small steps back left out.

    `direction` is 1 or -1; `along` (m,) are the abscissae of `rows` (m,), in the order of the run; `apart` (m - 1,)
    says between which of them nothing may be interpolated.
    """

    direction: int
    rows: IntArray
    along: Array
    apart: BoolArray


def ways(recording: Recording, abscissa: Abscissa, label: str) -> tuple[Way, ...]:
    """The gapless stretches of a run with their abscissa. Raises `InputError` as `Abscissa.along` does."""
    found = []
    for stretch in stretches(recording):
        along, leaps = abscissa.along(recording, stretch, label)
        found.append(Way(np.arange(stretch.first, stretch.end), along, leaps))
    if not found:
        raise InputError(f"{label} has no two samples that follow each other", why="nothing can be aligned")
    return tuple(found)


def rejoined(found: Sequence[Way], *, slack: float, period: float | None) -> Iterator[Way]:
    """The stretches of a run (one at least), put together again: a gap in the clock ends neither a lap nor a way.

    Over a gap of a closed abscissa the hand took the shorter way. One that starts anew from farther back, and goes the
    same way again, is another pass and stays apart. Where two stretches meet the abscissa leaps.
    """
    parts: list[Way] = []
    direction, farthest = 0, 0.0
    for way in found:
        along = way.along
        if parts and period is not None:
            along = along + period * round((parts[-1].along[-1] - along[0]) / period)
        turns = _turns(along, slack)
        goes = [1 if along[last] > along[first] else -1 for first, last in pairwise(turns)]
        if parts and direction * (along[0] - farthest) < -slack and (not goes or goes[0] == direction):
            yield _together(parts)
            parts, direction = [], 0
        parts.append(Way(way.rows, along, way.leaps))
        if goes:
            direction, farthest = goes[-1], float(along[turns[-1]])
    yield _together(parts)


def _together(parts: Sequence[Way]) -> Way:
    between = [np.append(each.leaps, True) for each in parts]
    return Way(
        np.concatenate([each.rows for each in parts]),
        np.concatenate([each.along for each in parts]),
        np.concatenate(between)[:-1],
    )


def headings(
    way: Way, recording: Recording, *, slack: float, split: bool, label: str, unit: str, todo: str
) -> Iterator[Heading]:
    """The monotone parts of a way. A step back of up to `slack` is a trembling hand, a longer one turns.

    Raises `InputError`, naming the place and what is `todo`, at a turn unless `split` asks for parts.
    """
    turns = _turns(way.along, slack)
    if len(turns) > 2 and not split:
        at = turns[1]
        back = abs(way.along[turns[2]] - way.along[at])
        amount, place = _worded(back, unit), _worded(float(way.along[at]), unit)
        raise InputError(
            f"{label} turns back by {amount} at {place}, t = {recording.time[way.rows[at]]:.6g} s",
            why="a place that is passed twice has two answers, and a curve over it can hold only one",
            todo=todo,
        )
    for first, last in pairwise(turns):
        direction = 1 if way.along[last] > way.along[first] else -1
        yield _onwards(way, first, last, direction)


def _turns(along: Array, slack: float) -> list[int]:
    """Indices at which the way begins, of every extreme that it comes back from by more than `slack`, and its end."""
    turns: list[int] = []
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
    return [*turns, high if direction > 0 else low] if direction else []


def _onwards(way: Way, first: int, last: int, direction: int) -> Heading:
    inside = direction * way.along[first : last + 1]
    best = np.maximum.accumulate(inside)
    ahead = np.concatenate([[True], inside[1:] > best[:-1]])
    kept = first + np.flatnonzero(ahead)
    leapt = np.concatenate([[0], np.cumsum(way.leaps)])
    return Heading(direction, way.rows[kept], way.along[kept], np.diff(leapt[kept]) > 0)


def _worded(value: float, unit: str) -> str:
    if unit == "rad":
        return f"{math.degrees(value):.4g} degrees"
    return f"{1e3 * value:.4g} mm" if unit == "m" else f"{value:.4g} {unit}"


def seam(found: Sequence[Way], period: float) -> float:
    """Where to cut a closed abscissa: in the middle of the widest stretch that no run visits, or at 0.

    A sector round the origin of the angles then stays in one piece.
    """
    bins = 3600
    seen = np.zeros(bins, dtype=bool)
    for way in found:
        low, high = float(way.along.min()), float(way.along.max())
        if high - low >= period:
            return 0.0
        first, last = math.floor(low / period * bins), math.floor(high / period * bins)
        seen[np.arange(first, last + 1) % bins] = True
    if seen.all():
        return 0.0
    start = int(np.argmax(seen)) if seen.any() else 0
    rolled = np.roll(seen, -start)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], rolled, [True]]).astype(np.int8)))
    begins, ends = edges[::2], edges[1::2]
    widest = int(np.argmax(ends - begins))
    middle = (start + 0.5 * float(begins[widest] + ends[widest])) / bins * period
    return float(middle % period) - period


POINTS = 721
"""Places of the grid over all that the runs cover: half a degree of a full turn."""

COLUMNS: Mapping[str, tuple[str, str]] = {
    "magnitude": ("N", "size of the force"),
    "direction": ("rad", "direction of the force in the plane, unwrapped along the way"),
    "leaning": ("rad", "angle of the force from the model's outward normal, anticlockwise"),
    "depth": ("m", "distance of the IHIP from the HIP"),
}
"""What a pass holds, as far as its recording has it, with unit and meaning."""


@dataclass(frozen=True)
class Run:
    """A recording to align: `renderer` groups repeats, `label` names it in what is said of it."""

    label: str
    renderer: str
    recording: Recording


@dataclass(frozen=True)
class Pass:
    """One way over the abscissa in one direction: of run number `run`, from `start` to `end` (s). `lap` numbers those
    of a run in that direction.

    `columns` (m,) are on the grid; `grains` (m,) are what the numbers of the recording resolve in each of them, see
    `resolution`. Both are 0 where `mask` (m,) is not set: outside of what the pass covers, where the tool is free, in
    gaps, and across jumps of IHIP or force. `coverage` is the share of the grid that is left.
    """

    run: int
    direction: int
    lap: int
    start: float
    end: float
    columns: Mapping[str, Array]
    grains: Mapping[str, Array]
    mask: BoolArray

    @property
    def coverage(self) -> float:
        """Share of the grid with an answer."""
        return float(np.mean(self.mask))


@dataclass(frozen=True)
class Aligned:
    """Runs over a common abscissa: `grid` (m,) in `unit`, `period` once round it (None: open)."""

    by: str
    unit: str
    period: float | None
    grid: Array
    runs: tuple[Run, ...]
    passes: tuple[Pass, ...]

    def of(self, renderer: str, direction: int) -> tuple[Pass, ...]:
        """The passes of a renderer in one direction."""
        return tuple(
            each for each in self.passes if self.runs[each.run].renderer == renderer and each.direction == direction
        )


def align(runs: Sequence[Run], abscissa: Abscissa, *, split: bool = False, points: int = POINTS) -> Aligned:
    """Resample runs over a common grid of the abscissa, linearly between neighbouring samples in contact.

    Nothing is interpolated over a gap in time, from contact to free space, or across a jump: an IHIP or a force that
    moves by more than three HIP steps allow (the force as of a spring of the run's own apparent stiffness). Raises
    `InputError` for no runs, runs that never touch, and, unless `split`, for one that turns back, naming the place.
    """
    if not runs:
        raise InputError("there are no runs to align", todo="name recordings")
    found = [ways(run.recording, abscissa, run.label) for run in runs]
    every = [way for each in found for way in each]
    cut = 0.0 if abscissa.period is None else seam(every, abscissa.period)
    low, high = _range(every, abscissa.period, cut)
    if not high > low:
        raise InputError("the runs do not move along the abscissa", todo="align them by something else")
    grid = np.linspace(low, high, points)
    slack = grid[1] - grid[0]
    passes: list[Pass] = []
    for number, (run, each) in enumerate(zip(runs, found, strict=True)):
        force, smooth = _smooth(run.recording)
        fine = resolution(run.recording)
        laps = {1: 0, -1: 0}
        for way in rejoined(each, slack=slack, period=abscissa.period):
            parts = headings(
                way, run.recording, slack=slack, split=split, label=run.label, unit=abscissa.unit, todo=_advice(runs)
            )
            for part in parts:
                made = [*_laps(number, laps[part.direction], run.recording, part, force, smooth, grid, abscissa, fine)]
                passes += made
                laps[part.direction] = max([laps[part.direction], *(one.lap + 1 for one in made)])
    if not any(each.mask.any() for each in passes):
        raise InputError("none of the runs touches the surface", why="there is no force to compare")
    kept = tuple(each for each in passes if each.mask.any())
    grid.flags.writeable = False
    return Aligned(abscissa.by, abscissa.unit, abscissa.period, grid, tuple(runs), kept)


def _advice(runs: Sequence[Run]) -> str:
    """What may be done about a run that turns back, and what that costs."""
    pairs = math.comb(len({run.renderer for run in runs}), 2)
    enough = needed(1, 1, tests=2 * max(pairs, 1), level=LEVEL)
    cost = "" if enough is None else f", so that it takes {enough[0]} and {enough[1]} runs to tell a difference"
    return (
        "give --split: every way between two turns is then a pass of its own, and forth and back are two tests"
        f"{cost}; or record, or cut out, one way only"
    )


def _range(every: Sequence[Way], period: float | None, cut: float) -> tuple[float, float]:
    lows = [float(way.along.min()) for way in every]
    highs = [float(way.along.max()) for way in every]
    if period is None:
        return min(lows), max(highs)
    if any(high - low >= period for low, high in zip(lows, highs, strict=True)) or cut == 0.0:
        return cut, cut + period
    shifts = [math.floor((low - cut) / period) * period for low in lows]
    return (
        min(low - shift for low, shift in zip(lows, shifts, strict=True)),
        max(high - shift for high, shift in zip(highs, shifts, strict=True)),
    )


def _smooth(recording: Recording) -> tuple[Array, BoolArray]:
    """The force (n, N), and between which samples (n - 1,) the run is one smooth contact."""
    force, hip = recording.force, recording.hip
    contact = np.any(force != 0.0, axis=1)
    if recording.valid is not None:
        contact &= recording.valid
    moved = np.linalg.norm(np.diff(hip, axis=0), axis=1)
    both = contact[1:] & contact[:-1]
    smooth = both & joined(recording)
    step = float(np.max(moved, where=both, initial=0.0))
    if "ihip" in recording.channels:
        jumped = np.linalg.norm(np.diff(recording.ihip, axis=0), axis=1)
        smooth &= jumped <= LAG * step + recording.standoff
        depth = np.linalg.norm(recording.ihip - hip, axis=1)
        pressed = contact & (depth > 0.0)
        if pressed.any():
            stiffness = float(np.median(np.linalg.norm(force[pressed], axis=1) / depth[pressed]))
            turned = np.linalg.norm(np.diff(force, axis=0), axis=1)
            # A spring between HIP and IHIP changes with the steps of both.
            smooth &= turned <= stiffness * ((LAG + 1) * step + recording.standoff)
    return force, smooth


def _laps(
    number: int,
    before: int,
    recording: Recording,
    part: Heading,
    force: Array,
    smooth: BoolArray,
    grid: Array,
    abscissa: Abscissa,
    fine: Resolution,
) -> Iterator[Pass]:
    """The passes of a heading: one a lap, numbered on from those `before`."""
    period, cut = abscissa.period, float(grid[0])
    order = slice(None) if part.direction > 0 else slice(None, None, -1)
    along, rows = part.along[order], part.rows[order]
    apart = part.apart[order]
    low, high = (0, 0) if period is None else (math.floor((each - cut) / period) for each in (along[0], along[-1]))
    broken = np.concatenate([[0], np.cumsum(~smooth)])
    between = np.diff(broken[rows]) != 0
    apart = apart | between
    for lap in range(low, high + 1):
        places = grid + (0.0 if period is None else lap * period)
        after = np.searchsorted(along, places, side="left")
        inside = (after > 0) & (after < along.size)
        right = np.clip(after, 1, along.size - 1)
        exact = (along[np.clip(after, 0, along.size - 1)] == places) & np.any(
            force[rows[np.clip(after, 0, along.size - 1)]] != 0.0, axis=1
        )
        mask = (inside & ~apart[right - 1]) | exact
        if not mask.any():
            continue
        share = np.clip((places - along[right - 1]) / (along[right] - along[right - 1]), 0.0, 1.0)
        used = np.unique(np.concatenate([rows[right[mask] - 1], rows[right[mask]]]))
        columns, bent = _columns(recording, force, rows[right - 1], rows[right], share, mask, abscissa.curve)
        # outside there is no force, whose direction nothing tells: no repeat may answer for it
        grains = {name: np.where(mask, fine.of(name, columns["magnitude"], bent), 0.0) for name in columns}
        times = recording.time[used]
        yield Pass(
            number, part.direction, before + lap - low, float(times.min()), float(times.max()), columns, grains, mask
        )


def _columns(
    recording: Recording,
    force: Array,
    before: IntArray,
    after: IntArray,
    share: Array,
    mask: BoolArray,
    curve: Curve | None,
) -> tuple[dict[str, Array], Array | float]:
    """The columns, and the curvature (m,), 1/m, of the model at their places; 0 where none is known."""

    def at(values: Array) -> Array:
        return np.asarray(values[before] + share[:, np.newaxis] * (values[after] - values[before]))

    pushed, hip = at(force), at(recording.hip)
    size = np.linalg.norm(force, axis=1)
    bent: Array | float = 0.0
    found = {"magnitude": size[before] + share * (size[after] - size[before])}
    if force.shape[1] == 2:
        direction = np.arctan2(pushed[:, 1], pushed[:, 0])
        if curve is not None:
            foot = curve.nearest(at(recording.ihip) if "ihip" in recording.channels else hip)
            normal, bent = np.asarray(curve.normal(foot)), np.asarray(curve.curvature(foot))
            around = np.unwrap(np.arctan2(normal[:, 1], normal[:, 0]))
            found["leaning"] = _wrapped(direction - around, 2.0 * math.pi)
        found["direction"] = _unwrapped(direction, mask)
    if "ihip" in recording.channels:
        found["depth"] = np.linalg.norm(at(recording.ihip) - hip, axis=1)
    return {name: np.where(mask, values, 0.0) for name, values in found.items()}, bent


def _unwrapped(direction: Array, mask: BoolArray) -> Array:
    """Without leaps of a turn from one place with an answer to the next; starts in [-pi, pi)."""
    out = np.zeros_like(direction)
    out[mask] = np.unwrap(direction[mask])
    return out
