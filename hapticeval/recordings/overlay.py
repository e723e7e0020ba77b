"""Two recordings beside each other, over time or over the way along a surface, and how far they are apart.

The rows of the first are what both are compared at; the second is interpolated linearly between its own rows. Nothing
is compared where either has a gap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hapticeval.diagnosis.fits import delayed, fit_delay, power
from hapticeval.diagnosis.ranking import EXPLAINED
from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array, BoolArray, IntArray

COMPARED = ("hip", "ihip", "force")
"""Channels that are laid over each other."""

BRIDGED_STEPS = 2.5
"""Median steps from row to row beyond which nothing is interpolated: one row may be missing; *chosen*."""

BRIDGED_WAY = 1e-3
"""Way (m) up to which that is done however short the median step is; *chosen*."""

LONGEST_DELAY = 0.5
"""Delay (s), either way, up to which one is looked for, and never more than a quarter of the rows; *chosen*."""

SAME = 1e-6
"""Share of a channel's size below which a difference is rounding, and is not explained."""


@dataclass(frozen=True, eq=False)
class Gap:
    """How far two runs are apart in one channel, root mean square and largest, m or N.

    The largest is at `place` of the overlay's `along` (s or m), where the first hand is at `hip` (N,), m, None where
    it was not recorded. The second run is `delay` (s) later and `gain` times as large where that explains the
    difference, which leaves `left` (m or N, root mean square); None where neither does.
    """

    rms: float
    largest: float
    place: float
    hip: Array | None
    delay: float | None = None
    gain: float | None = None
    left: float = 0.0


@dataclass(frozen=True, eq=False)
class Overlay:
    """Two runs at the same places: `along` (n,), s or, with `on_surface`, m of way; their channels (n, N) there.

    `touches` (n,) is their contact, None where it cannot be told of both. Rows that either lacks are NaN in `runs`.
    """

    along: Array
    on_surface: bool
    runs: tuple[Mapping[str, Array], Mapping[str, Array]]
    touches: tuple[BoolArray, BoolArray] | None
    rows: BoolArray
    gaps: Mapping[str, Gap]


@dataclass(frozen=True, eq=False)
class _Track:
    """Rows of a recording, increasing `along` (k,), s or m; steps up to `longest` are bridged."""

    recording: Recording
    along: Array
    rows: IntArray
    longest: float

    def covers(self, places: Array) -> BoolArray:
        """Say at which places (n,), s or m, there is a row, or one closely before and after: (n,)."""
        after = np.clip(np.searchsorted(self.along, places), 0, len(self.along) - 1)
        before = np.clip(after - 1, 0, None)
        within = (places > self.along[before]) & (places < self.along[after])
        near = self.along[after] - self.along[before] <= self.longest
        return np.asarray((self.along[after] == places) | (within & near))

    def at(self, name: str, places: Array) -> Array:
        """Return a channel (n, N) at places (n,), interpolated."""
        values = self.recording.channels[name][self.rows]
        return np.stack([np.interp(places, self.along, column) for column in values.T], axis=1)

    def touches_at(self, places: Array) -> BoolArray:
        """Return the contact (n,) of the row before each of `places` (n,), s or m."""
        before = np.clip(np.searchsorted(self.along, places, side="right") - 1, 0, None)
        return np.asarray(self.recording.contact[self.rows][before])


def overlay(first: Recording, second: Recording, *, curve: Curve | None = None) -> Overlay:
    """Lay two recordings over each other: over time, each from its own zero, or over the way along a `curve`.

    On a curve it is the first pass of each: from where it first touches, the rows in contact that come further than
    any before. Raises `InputError` for recordings of two dimensions, without a channel in common, without contact on
    the curve, and where times or ways have nothing in common.
    """
    names = [name for name in COMPARED if name in first.channels and name in second.channels]
    if not names:
        raise InputError(
            "the two recordings have no channel in common",
            why=f"{', '.join(COMPARED)} can be compared: each must be in both",
            todo="map columns of both to the same channel: hapticeval inspect FILE proposes a mapping",
        )
    if first.dimension != second.dimension:
        raise InputError(
            f"the first recording is in {first.dimension}D, the second in {second.dimension}D",
            why="positions and forces of different dimensions have no difference",
            todo="compare two runs of one robot, or map the same axes of both",
        )
    if curve is None:
        tracks = tuple(
            _Track(one, one.time[one.measured], np.flatnonzero(one.measured), BRIDGED_STEPS * one.dt)
            for one in (first, second)
        )
    else:
        tracks = _tracks_on_surface(first, second, curve)
    along = tracks[0].along
    rows = tracks[1].covers(along)
    if not rows.any():
        unit, scale = ("s", 1.0) if curve is None else ("mm", 1e3)
        spans = [f"{scale * track.along[0]:.4g} to {scale * track.along[-1]:.4g} {unit}" for track in tracks]
        raise InputError(
            f"the two recordings have no {'time' if curve is None else 'place on the surface'} in common",
            why=f"the first goes from {spans[0]}, the second from {spans[1]}",
            todo="compare them over the way along the surface: --over way" if curve is None else "compare over time",
        )
    values = tuple({name: np.where(rows[:, None], track.at(name, along), np.nan) for name in names} for track in tracks)
    known = all({"contact", "force", "ihip"} & one.channels.keys() for one in (first, second))
    touches = (tracks[0].touches_at(along), tracks[1].touches_at(along)) if known else None
    runs = values[0], values[1]
    gaps = {name: _gap(name, along, rows, runs, timed=curve is None) for name in names}
    return Overlay(along, curve is not None, runs, touches, rows, gaps)


def _tracks_on_surface(first: Recording, second: Recording, curve: Curve) -> tuple[_Track, ...]:
    """Return the first pass of both over the way (m), that of the second in the direction and turn nearest to it."""
    # The tool is on the surface; where either run has none, the hand's foot stands for it.
    name = "ihip" if all("ihip" in recording.channels for recording in (first, second)) else "hip"
    arc_lengths = [
        _arc_length(recording, name, curve, which) for recording, which in ((first, "first"), (second, "second"))
    ]
    first_length = arc_lengths[0][0]
    forwards = np.max(first_length) - first_length[0] >= first_length[0] - np.min(first_length)
    passed = _first_pass(first, *arc_lengths[0], sign=1.0 if forwards else -1.0)
    candidates = []
    for sign in (1.0, -1.0):
        track = _first_pass(second, *arc_lengths[1], sign=sign)
        # Whole turns may lie between two runs on a closed curve.
        away = (np.mean(passed.along) - np.mean(track.along)) / curve.length if curve.closed else 0.0
        for turns in {np.floor(away), np.ceil(away)}:
            shift = turns * curve.length if turns else 0.0
            candidates.append(replace(track, along=track.along + shift))
    return passed, max(candidates, key=lambda track: np.count_nonzero(track.covers(passed.along)))


def _arc_length(recording: Recording, name: str, curve: Curve, which: str) -> tuple[Array, IntArray]:
    """Return the way (k,), m, of the rows (k,) in contact; on a closed curve it goes on beyond a turn."""
    recording.require(name)
    rows = np.flatnonzero(recording.contact)
    if rows.size < 2:
        raise InputError(
            f"the {which} recording touches the surface in {rows.size} rows",
            why="a way along the surface is that of the rows in contact",
            todo="compare over time",
        )
    arc_length = curve.arc_length(curve.nearest(recording.channels[name][rows]))
    return (np.unwrap(arc_length, period=curve.length) if curve.closed else arc_length), rows


def _first_pass(recording: Recording, arc_length: Array, rows: IntArray, *, sign: float) -> _Track:
    """Return the rows that come further than any before, in the direction of `sign`, by increasing way (m)."""
    furthest = np.maximum.accumulate(sign * arc_length)
    further = np.r_[True, furthest[1:] > furthest[:-1]]
    order = slice(None, None, int(sign))
    along, rows = arc_length[further][order], rows[further][order]
    step = float(np.median(np.diff(along))) if along.size > 1 else 0.0
    return _Track(recording, along, rows, max(BRIDGED_WAY, BRIDGED_STEPS * step))


def _gap(name: str, along: Array, rows: BoolArray, runs: Sequence[Mapping[str, Array]], *, timed: bool) -> Gap:
    """Return how far the second run is from the first in a channel, and the delay and gain that explain it."""
    first, second = (run[name][rows] for run in runs)
    distance = np.linalg.norm(second - first, axis=1)
    at = int(np.argmax(distance))
    hip = runs[0]["hip"][rows][at] if "hip" in runs[0] else None
    gap = Gap(float(np.sqrt(np.mean(distance**2))), float(distance[at]), float(along[rows][at]), hip)
    if power(second - first) <= SAME**2 * power(first):
        return gap
    step = float(np.median(np.diff(along))) if along.size > 1 else 0.0
    places = along[rows]
    # A delay is counted in even steps.
    even = timed and step > 0.0 and bool(np.allclose(np.diff(places), step, rtol=0.05))
    max_ticks = min(int(LONGEST_DELAY / step), len(places) // 4) if even else 0
    # The simplest first: a delay, a gain of the force, both.
    for late, stronger in ((True, False), (False, True), (True, True)):
        if (late and max_ticks < 1) or (stronger and name != "force"):
            continue
        ticks = fit_delay(second, first, max_ticks=max_ticks, early=True, free_gain=stronger).ticks if late else 0.0
        # What a shift brings in at the ends was never recorded.
        inner = slice(int(np.ceil(abs(ticks))), len(places) - int(np.ceil(abs(ticks))))
        source, signal = delayed(first, ticks)[inner], second[inner]
        gain = float(np.sum(source * signal)) / max(power(source), 1e-300) if stronger else 1.0
        left, before = power(signal - gain * source), power(signal - first[inner])
        if left <= (1.0 - EXPLAINED) * before:
            rms = float(np.sqrt(left / max(len(signal), 1)))
            return replace(gap, delay=ticks * step if late else None, gain=gain if stronger else None, left=rms)
    return gap
