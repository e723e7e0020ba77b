"""How a body moves: motions that are rigid, smooth and known at every instant, not at the ticks alone.

A suite writes one as `motion` in a scene. A contact that is led is the same in the frame of the body: what a renderer
answers there is, taken back into that frame, what it owes to the body at rest.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Literal, TypeAlias

import numpy as np
from msgspec import Meta, Struct

from hapticeval.errors import InputError, at
from hapticeval.geometry.pose import Pose, check_pose, turn_about, turn_in_plane
from hapticeval.stimulus.stimulus import Path
from hapticeval.types import Array, BoolArray

Vector = Annotated[tuple[float, ...], Meta(min_length=2, max_length=3)]
"""Coordinates in m, or a direction."""

INSTANT = 1e-9
"""Seconds within which a jump has happened: rounding of a clock."""

UNJUDGED_TICKS = 3
"""Answers after a jump that no check reads: as late as a proxy may be (`phenomena.decisions.LAG_TICKS`)."""


class BodyMotion(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind"):
    """Base of what a scene's `motion` may be, by its `kind`.

    `frame`: whether the case's path is given in the frame of the body, or in the world's.
    """

    frame: Literal["body", "world"] = "body"

    def pose(self, time: float | Array) -> Pose:
        """Return the body's pose at `time` (s), or its poses at times (n,), from 0 on; see `Pose`."""
        raise NotImplementedError

    @property
    def dimension(self) -> int:
        """2 or 3."""
        raise NotImplementedError

    def largest_step(self, size: float, dt: float) -> float:
        """Return how far a point of a body of `size` (m) moves in `dt` (s) at the most, m; jumps do not count."""
        raise NotImplementedError

    @property
    def jumps(self) -> tuple[float, ...]:
        """Times (s) at which the body is somewhere else at once: a jump is not a contact."""
        return ()

    @property
    def even(self) -> bool:
        """Whether the body's frame is one of inertia, as it slides evenly and does not turn."""
        return False

    def check(self, *, dimension: int, size: float, dt: float) -> None:
        """Raise `InputError` for a motion that is not for a model of `size` (m) every `dt` (s).

        It has another dimension, numbers that are not finite, or goes farther in a tick than the model is large.
        """
        numbers = [value for name in self.__struct_fields__ for value in _numbers(getattr(self, name))]
        if not all(map(math.isfinite, numbers)):
            raise InputError(f"a motion of kind '{self.kind}' is not finite: {self}")
        if self.dimension != dimension:
            raise InputError(
                f"a motion of kind '{self.kind}' is in {self.dimension}D, and the model is in {dimension}D",
                todo="give its vectors as many numbers as a point of the model has; only in space it has an axis",
            )
        step = self.largest_step(size, dt)
        if step > size:
            raise InputError(
                f"a motion of kind '{self.kind}' carries the body by {1e3 * step:.3g} mm in a tick of {1e3 * dt:.3g} "
                "ms",
                why=f"the model is {1e3 * size:.3g} mm large: between two ticks it would be anywhere",
                todo="move it slower, or declare a jump",
            )

    @property
    def kind(self) -> str:
        """Its name in a suite."""
        return str(self.__struct_config__.tag)


class Slide(BodyMotion, frozen=True, kw_only=True, tag="slide"):
    """Along a straight line at a constant `velocity` (m/s, a vector)."""

    velocity: Vector

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.velocity)

    @property
    def even(self) -> bool:
        """Always: see `BodyMotion.even`."""
        return True

    def pose(self, time: float | Array) -> Pose:
        """Return the pose at `time` (s), one or (n,): t = v time, m."""
        time = np.asarray(time, dtype=np.float64)
        return Pose(_unturned(time, self.dimension), time[..., np.newaxis] * np.array(self.velocity))

    def largest_step(self, size: float, dt: float) -> float:  # noqa: ARG002 - as every motion
        """Return the way of a tick, m."""
        return math.hypot(*self.velocity) * dt


class Spin(BodyMotion, frozen=True, kw_only=True, tag="spin"):
    """Round a `centre` (m; the origin without one) at a constant `rate` (turns a second), in space about an `axis`.

    In the plane it turns anticlockwise, in space anticlockwise seen from the axis' tip; a negative rate turns back.
    """

    rate: float
    centre: Vector | None = None
    axis: Vector | None = None

    def __post_init__(self) -> None:
        if self.axis is not None and not math.hypot(*self.axis) > 0.0:
            raise ValueError("the axis of a spin has no direction")
        if self.centre is not None and len(self.centre) != self.dimension:
            raise ValueError(f"a spin in {self.dimension}D has a centre of {len(self.centre)} numbers")

    @property
    def dimension(self) -> int:
        """2, and 3 with an axis."""
        return 2 if self.axis is None else len(self.axis)

    def pose(self, time: float | Array) -> Pose:
        """Return the pose at `time` (s), one or (n,): x -> c + R (x - c), m."""
        angle = 2.0 * np.pi * self.rate * np.asarray(time, dtype=np.float64)
        if self.axis is None:
            rotation = turn_in_plane(angle)
        else:
            rotation = turn_about(np.array(self.axis) / math.hypot(*self.axis), angle)
        centre = np.zeros(self.dimension) if self.centre is None else np.array(self.centre)
        return Pose(rotation, centre - rotation @ centre)

    def largest_step(self, size: float, dt: float) -> float:
        """Return the arc of a tick, m, at the model's size and the centre's distance from the axis."""
        reach = size + math.hypot(*(self.centre or ()))
        return 2.0 * math.pi * abs(self.rate) * dt * reach


class Swing(BodyMotion, frozen=True, kw_only=True, tag="swing"):
    """To and fro by `amplitude` (m, a vector), `hertz` times a second, without a turn: a sin(w t) + b (1 - cos(w t)).

    With `across` (m, a vector) b it goes round: on a circle where both are as long, and square to each other.
    """

    amplitude: Vector
    hertz: Annotated[float, Meta(gt=0)]
    across: Vector | None = None

    def __post_init__(self) -> None:
        if self.across is not None and len(self.across) != len(self.amplitude):
            raise ValueError("a swing's amplitude and across have as many numbers")

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.amplitude)

    def pose(self, time: float | Array) -> Pose:
        """Return the pose at `time` (s), one or (n,): moved and not turned."""
        time = np.asarray(time, dtype=np.float64)
        phase = (2.0 * np.pi * self.hertz * time)[..., np.newaxis]
        across = np.array(self.across or (0.0,) * self.dimension)
        displacement = np.sin(phase) * np.array(self.amplitude) + (1.0 - np.cos(phase)) * across
        return Pose(_unturned(time, self.dimension), displacement)

    def largest_step(self, size: float, dt: float) -> float:  # noqa: ARG002 - as every motion
        """Return a bound of the way of a tick, m: by the sum of both squares, which is that of an ellipse's axes."""
        reach = math.hypot(*self.amplitude, *(self.across or ()))
        return 2.0 * math.pi * self.hertz * reach * dt


class Poses(BodyMotion, frozen=True, kw_only=True, tag="points", dict=True):
    """Through a table of `poses`, from rest to rest between each two, as a hand moves: see `stimulus.moves`.

    A row is a time (s), the rotation matrix row by row, and the translation (m): 7 numbers in the plane, 13 in space.
    It turns by the shorter way, about one axis. At each time of `jump_at` (s), which are times of rows, the body is in
    that row's pose at once, and has rested in the one before.

    Raises `InputError`, naming the row, for a pose that is none, and for times that do not increase.
    """

    poses: Annotated[tuple[tuple[float, ...], ...], Meta(min_length=2)]
    jump_at: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        lengths = {len(row) for row in self.poses}
        if len(lengths) != 1 or not lengths <= {7, 13}:
            raise ValueError(
                f"rows of {' and '.join(map(str, sorted(lengths)))} numbers are not poses: they have 7, or 13 in space"
            )
        times = [row[0] for row in self.poses]
        if not all(map(math.isfinite, times)) or any(late <= early for early, late in pairwise(times)):
            raise ValueError("the times of poses increase, and are finite")
        if unknown := [time for time in self.jump_at if time not in times[1:]]:
            raise ValueError(f"a jump at {unknown[0]!r} s is at no row's time after the first")

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return 2 if len(self.poses[0]) == 7 else 3

    @property
    def jumps(self) -> tuple[float, ...]:
        """Times (s) of the declared jumps."""
        return self.jump_at

    @cached_property
    def table(self) -> tuple[Array, Pose, Array, Array]:
        """Times (k,), s; the poses there; and from each to the next the axis (k - 1, 3) and angle (k - 1,), rad."""
        from scipy.spatial.transform import Rotation

        size, count = self.dimension, len(self.poses)
        rows = np.array(self.poses, dtype=np.float64)
        for number, row in enumerate(rows):
            with at(f"pose {number}"):
                check_pose(row[1 : 1 + size**2].reshape(size, size), row[1 + size**2 :], size)
        rotation = rows[:, 1 : 1 + size**2].reshape(count, size, size)
        # R_k to R_k+1 in the body's axes; a turn of the plane is one about z
        between = np.tile(np.eye(3), (count - 1, 1, 1))
        between[:, :size, :size] = np.swapaxes(rotation[:-1], 1, 2) @ rotation[1:]
        turns = Rotation.from_matrix(between).as_rotvec()
        angle = np.linalg.norm(turns, axis=1)
        axis = np.where(angle[:, np.newaxis] > 0.0, turns, [0.0, 0.0, 1.0])
        axis /= np.linalg.norm(axis, axis=1)[:, np.newaxis]
        return rows[:, 0], Pose(rotation, rows[:, 1 + size**2 :]), axis, angle

    def pose(self, time: float | Array) -> Pose:
        """Return the pose at `time` (s), one or (n,): before the first row the first, after the last row the last."""
        # a scene is imported by whoever draws none: what moves and paths load is loaded where it is used
        from hapticeval.stimulus.moves import share_covered

        times, poses, axis, angle = self.table
        time = np.asarray(time, dtype=np.float64)
        row = np.clip(np.searchsorted(times, time + INSTANT, side="right") - 1, 0, times.size - 2)
        share = np.clip((time - times[row]) / (times[row + 1] - times[row]), 0.0, 1.0)
        share = np.where(time + INSTANT >= times[row + 1], 1.0, share)
        jumped = np.isin(times[1:], self.jump_at)[row]
        share = np.where(jumped & (share < 1.0), 0.0, np.atleast_1d(share_covered(share)).reshape(share.shape))
        size = self.dimension
        turn = np.empty((*time.shape, size, size))
        for index in np.ndindex(time.shape):
            turn[index] = turn_about(axis[row[index]], share[index] * angle[row[index]])[:size, :size]
        ways = poses.translation[row + 1] - poses.translation[row]
        return Pose(poses.rotation[row] @ turn, poses.translation[row] + share[..., np.newaxis] * ways)

    def largest_step(self, size: float, dt: float) -> float:
        """Return the fastest tick's way, m, at the model's size, of all rows but for jumps."""
        from hapticeval.stimulus.moves import PEAK_SPEED_FACTOR

        times, poses, _, angle = self.table
        ways = np.linalg.norm(np.diff(poses.translation, axis=0), axis=1) + angle * size
        speeds = PEAK_SPEED_FACTOR * ways / np.diff(times)
        return float((speeds[~np.isin(times[1:], self.jump_at)] * dt).max(initial=0.0))


AnyMotion: TypeAlias = Slide | Spin | Swing | Poses


def _unturned(time: Array, dimension: int) -> Array:
    """Return the rotations (..., N, N) of a body that does not turn, at times (...,), s."""
    return np.broadcast_to(np.eye(dimension), (*time.shape, dimension, dimension))


def _numbers(value: object) -> list[float]:
    """Return the numbers in an entry of a motion, at any depth."""
    if isinstance(value, tuple):
        return [number for entry in value for number in _numbers(entry)]
    return [value] if isinstance(value, int | float) else []


def path_in_body(path: Path, motion: BodyMotion, spacing: float) -> Path:
    """Return a hand's path that is given in the world as it is in the frame of the body, a point every `spacing` (s).

    Straight in between: four points a tick, so that refined runs see its true shape.
    """
    time, points = path.sampled(spacing)
    return Path(time, motion.pose(time).to_body(points))


def unjudged_rows(motion: BodyMotion, time: Array) -> BoolArray:
    """Return which rows at times (n,), s, no check reads, (n,): those of a jump, and two after it."""
    unjudged = np.zeros(time.size, dtype=bool)
    for jump in motion.jumps:
        first = int(np.searchsorted(time, jump - INSTANT))
        unjudged[first : first + UNJUDGED_TICKS] = True
    return unjudged
