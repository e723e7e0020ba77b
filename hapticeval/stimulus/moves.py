"""A hand's path as a list of moves: how a hand goes from rest to rest, how fast, and how it trembles.

A move is straight and covers the share 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7 of its way, s the share of its time: the
polynomial of least degree whose velocity, acceleration and jerk vanish at both ends.

Over a way L (m) in T (s) the largest speed is 35/16 L/T, and the largest acceleration 7.514 L/T^2, at s = 1/2 +-
1/sqrt(20).

`SHORTEST_MOVE` follows from what a hand does: 99.9 % of the power of its acceleration lies below `HAND_BAND`, 10 Hz.

- Of one move at most 0.05 % lies above f where f T >= 3.82.
- Moves follow each other without an overlap, so that their energies add, but not above the band, where what is left
  comes from the steps of the fourth derivative at their ends: two that meet add up where both go the same way.
- The worst is a train of equal moves. Its power lies in lines at the multiples of 1/T, 0.105 % of it from the fourth
  and 0.033 % from the fifth on: with 4/T at 10 Hz or below it keeps to the band.
"""

from __future__ import annotations

import math
from pathlib import Path as FilePath
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from hapticeval.errors import InputError
from hapticeval.geometry.boundary import Boundary
from hapticeval.stimulus.paths import Point, Positive, Trajectory, as_array
from hapticeval.stimulus.stimulus import Path, check_duration
from hapticeval.types import Array

HAND_BAND = 10.0
"""Frequency (Hz) below which 99.9 % of the power of a hand's acceleration lies."""

SHORTEST_MOVE = 4.0 / HAND_BAND
"""Shortest duration (s) of a move that keeps to that."""

LARGEST_SPEED, LARGEST_ACCELERATION = 1.0, 10.0
"""What a hand reaches at the most: m/s, m/s^2."""

PEAK_SPEED_FACTOR, PEAK_ACCELERATION_FACTOR = 35.0 / 16.0, 84.0 * math.sqrt(5.0) / 25.0
"""The largest speed of a move in L/T, and its largest acceleration in L/T^2."""

POINT_SPACING = 2.5e-4
"""Seconds between the points of a path that is made of moves: four a tick at 1 kHz, so that refined runs see it."""

TREMOR_RAMP = 0.25
"""Seconds in which tremor sets in at the start of a path, and dies away at its end."""


class Move(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A straight way `to` a point (m) in `seconds`, from rest to rest, or `even`: at constant speed.

    To the point where the hand is already it is a rest.
    """

    to: Point
    seconds: Positive
    even: bool = False


class Tremor(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a hand adds to its moves without meaning to: a sine of `hertz` along `amplitude` (m, a vector)."""

    amplitude: Point
    hertz: Annotated[float, Meta(ge=8, le=12)]


class Moves(Trajectory, frozen=True, kw_only=True, tag="moves"):
    """From `start` (m) through `moves`, one after the other, with a `tremor` or without."""

    start: Point
    moves: Annotated[tuple[Move, ...], Meta(min_length=1)]
    tremor: Tremor | None = None

    def path(self, surface: Boundary | None = None, folder: FilePath = FilePath()) -> Path:  # noqa: ARG002
        """Return the path; see `Trajectory.path`. A path of even moves has a point a move."""
        corners = as_array([self.start, *(move.to for move in self.moves)], "the points of the moves")
        if self.tremor is not None and len(self.tremor.amplitude) != corners.shape[1]:
            raise InputError(
                f"a tremor in {len(self.tremor.amplitude)}D on moves in {corners.shape[1]}D",
                todo="give its amplitude as many numbers as a point has",
            )
        check_duration(self.seconds, POINT_SPACING)
        times, points = [np.zeros(1)], [corners[:1]]
        begin = 0.0
        for move, before, after in zip(self.moves, corners[:-1], corners[1:], strict=True):
            # a straight stretch at constant speed, or a rest, needs its end alone
            plain = (move.even or np.array_equal(before, after)) and self.tremor is None
            # the tolerance keeps a whole number of spacings from being one more by rounding
            count = 1 if plain else max(math.ceil(move.seconds / POINT_SPACING - 1e-6), 1)
            share = np.arange(1, count + 1) / count
            times.append(begin + share * move.seconds)
            points.append(before + (share if move.even else share_covered(share))[:, np.newaxis] * (after - before))
            # to the last bit: the next move begins there
            points[-1][-1] = after
            begin = float(times[-1][-1])
        time, place = np.concatenate(times), np.vstack(points)
        return Path(time, place if self.tremor is None else place + tremor_offsets(self.tremor, time))

    @property
    def seconds(self) -> float:
        """How long it takes, s."""
        return sum(move.seconds for move in self.moves)

    @property
    def length(self) -> float:
        """The length (m) of the way, without tremor."""
        corners = as_array([self.start, *(move.to for move in self.moves)], "the points of the moves")
        return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())


def share_covered(share: Array) -> Array:
    """Return the share of a move's way that is covered at a `share` of its time: (n,)."""
    near = np.minimum(share, 1.0 - share)  # of the same value as at the other end, and not as rounded
    near_share = near**4 * (35.0 - near * (84.0 - near * (70.0 - 20.0 * near)))
    return np.where(share < 0.5, near_share, 1.0 - near_share)


def tremor_offsets(tremor: Tremor, time: Array) -> Array:
    """Return how far tremor leads the hand off its moves at each of `time` (n,), s: (n, N), m. None at the ends."""
    settles = min(TREMOR_RAMP, 0.5 * float(time[-1]))
    # 0 at both ends, 1 from TREMOR_RAMP on: a squared sine between
    edge = np.clip(np.minimum(time, time[-1] - time) / settles, 0.0, 1.0)
    swing = np.sin(0.5 * np.pi * edge) ** 2 * np.sin(2.0 * np.pi * tremor.hertz * time)
    return np.asarray(swing[:, np.newaxis] * np.array(tremor.amplitude))


def shortest_duration(length: float, tremor: Tremor | None = None) -> float:
    """Return the seconds that a hand needs for a move of `length` (m): by its band, its speed and its acceleration.

    With a `tremor`, whose speed and acceleration take their share: 1.3 times those of the sine, as it sets in.
    """
    speed, acceleration = LARGEST_SPEED, LARGEST_ACCELERATION
    if tremor is not None:
        turn = 2.0 * math.pi * tremor.hertz
        # the largest speed (m/s) of the tremor: amplitude times angular frequency; its acceleration is once more that
        size = 1.3 * math.hypot(*tremor.amplitude) * turn
        speed, acceleration = speed - size, acceleration - size * turn
        if min(speed, acceleration) <= 0.0:
            raise InputError(f"a tremor of {tremor.amplitude} m at {tremor.hertz:g} Hz", why="no hand trembles so much")
    return max(
        SHORTEST_MOVE, PEAK_SPEED_FACTOR * length / speed, math.sqrt(PEAK_ACCELERATION_FACTOR * length / acceleration)
    )
