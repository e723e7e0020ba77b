"""Passes: the stretches of runs over which the abscissa goes one way, cut at every lap."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.abscissa import Abscissa
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import stretches
from hapticeval.types import Array, BoolArray, IntArray


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
