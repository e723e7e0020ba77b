"""Runs that no clock can align, over a common abscissa (6.1.2): what each felt where, a pass at a time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.recordings.abscissa import Abscissa
from hapticeval.recordings.passes import Heading, Way, headings, rejoined, seam, ways
from hapticeval.recordings.permutation import LEVEL, needed
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.resolution import Resolution, resolution
from hapticeval.recordings.stretches import LAG, joined
from hapticeval.types import Array, BoolArray, IntArray

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
            found["leaning"] = _wrapped(direction - around)
        found["direction"] = _unwrapped(direction, mask)
    if "ihip" in recording.channels:
        found["depth"] = np.linalg.norm(at(recording.ihip) - hip, axis=1)
    return {name: np.where(mask, values, 0.0) for name, values in found.items()}, bent


def _unwrapped(direction: Array, mask: BoolArray) -> Array:
    """Without leaps of a turn from one place with an answer to the next; starts in [-pi, pi)."""
    out = np.zeros_like(direction)
    out[mask] = np.unwrap(direction[mask])
    return out


def _wrapped(angle: Array) -> Array:
    return np.asarray((angle + math.pi) % (2.0 * math.pi) - math.pi)
