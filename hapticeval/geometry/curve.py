"""A plane curve that bounds a model: position, frame, curvature, arc length, nearest point and side."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import for_kernels
from hapticeval.errors import InputError
from hapticeval.geometry import curve_kernels, polygon_kernels
from hapticeval.geometry.frame import Frame
from hapticeval.geometry.kernels import (
    ARC,
    CASSINIAN,
    COLUMNS,
    ELLIPSE,
    KIND,
    LINE,
    U0,
    U1,
    UNBOUNDED,
    A,
    B,
    C,
    D,
    E,
    evaluate,
    evaluate_many,
)
from hapticeval.geometry.smooth_kernels import BLOCK
from hapticeval.geometry.validate import checked_points
from hapticeval.types import Array, BoolArray

WINDOW = 0.1
"""Half the side (m) of the square in which an unbounded curve is drawn and sampled."""


@dataclass(frozen=True, eq=False)
class Corner:
    """A joint at which the tangent turns: where it is and the two frames that meet there.

    `u` and `s` (m) are the parameter and the arc length; `position`, the unit tangents and the outward unit
    normals before and after are (2,); `turn` (rad, between -pi and pi) is positive where the corner is
    convex.
    """

    u: float
    s: float
    position: Array
    tangent_pre: Array
    tangent_post: Array
    normal_pre: Array
    normal_post: Array
    turn: float

    @property
    def convex(self) -> bool:
        """Whether the corner points outwards."""
        return self.turn > 0.0


@dataclass(frozen=True, eq=False)
class Curve:
    """The exact boundary of a model, anticlockwise, as rows of pieces that compiled loops can walk (see
    `kernels`).

    Every method takes one parameter or an array of them; on closed curves u wraps. A closed curve is either
    one smooth piece (CASSINIAN, ELLIPSE) or LINE and ARC pieces with arc length as parameter; an open one is
    a single UNBOUNDED piece whose inside is the half-plane to its left.

    Raises `InputError` for pieces of another shape.
    """

    name: str
    pieces: Array
    closed: bool

    def __post_init__(self) -> None:
        pieces = np.array(self.pieces, dtype=np.float64, order="C")
        if pieces.ndim != 2 or pieces.shape[0] == 0 or pieces.shape[1] != COLUMNS:
            raise InputError(f"curve '{self.name}' has pieces of shape {pieces.shape}, not (n, {COLUMNS})")
        kinds = pieces[:, KIND]
        bounded = bool(np.all(np.isin(kinds, (LINE, ARC)))) or (
            pieces.shape[0] == 1 and kinds[0] in (CASSINIAN, ELLIPSE)
        )
        unbounded = pieces.shape[0] == 1 and kinds[0] == UNBOUNDED
        if not (bounded if self.closed else unbounded):
            raise InputError(
                f"curve '{self.name}' is {'closed' if self.closed else 'open'} with kinds {set(kinds)}",
                why="a closed curve is one smooth piece or lines and arcs; an open one is one unbounded line",
            )
        pieces.flags.writeable = False
        object.__setattr__(self, "pieces", pieces)

    @property
    def dimension(self) -> int:
        """Of the plane: 2."""
        return 2

    @property
    def u_range(self) -> tuple[float, float]:
        """The parameter's start and end; infinite for an unbounded line."""
        return float(self.pieces[0, U0]), float(self.pieces[-1, U1])

    @cached_property
    def length(self) -> float:
        """Arc length (m) once around; infinite for an unbounded line."""
        if self._smooth:
            return float(self._panels[-1, 1])
        start, end = self.u_range
        return end - start

    def position(self, u: ArrayLike) -> Array:
        """Points (..., 2), m."""
        return self._evaluated(u)[..., 0:2]

    def tangent(self, u: ArrayLike) -> Array:
        """Unit tangents (..., 2), anticlockwise; at a corner the one after it."""
        derivative = self._evaluated(u)[..., 2:4]
        return np.asarray(derivative / np.hypot(derivative[..., 0], derivative[..., 1])[..., np.newaxis])

    def normal(self, u: ArrayLike) -> Array:
        """Outward unit normals (..., 2); at a corner the one after it."""
        tangent = self.tangent(u)
        return np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)

    def curvature(self, u: ArrayLike) -> Array:
        """Signed curvature (...), 1/m, positive where the model is convex; corners carry none."""
        rows = self._evaluated(u)
        dx, dy, ddx, ddy = rows[..., 2], rows[..., 3], rows[..., 4], rows[..., 5]
        return np.asarray((dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3)

    def arc_length(self, u: ArrayLike) -> Array:
        """Arc length (...), m, from the start of the curve to u; beyond one turn it goes on growing."""
        start, end = self.u_range
        u = np.asarray(u, dtype=np.float64)
        if not self.closed:
            return u
        if not self._smooth:
            return np.asarray(u - start)
        turns = np.floor((u - start) / (end - start))
        rest = np.clip(u - turns * (end - start), start, end)
        lengths = curve_kernels.arc_lengths(self._rows[0], self._panels, np.ravel(rest)).reshape(u.shape)
        return np.asarray(turns * self.length + lengths)

    def parameter(self, s: ArrayLike) -> Array:
        """The parameter (...) at arc length s (m), which wraps on a closed curve: inverse of `arc_length`."""
        s = np.asarray(s, dtype=np.float64)
        if not self.closed:
            return s
        rest = np.mod(s, self.length)
        if not self._smooth:
            return np.asarray(self.pieces[0, U0] + rest)
        return curve_kernels.parameters_at(self._rows[0], self._panels, np.ravel(rest)).reshape(s.shape)

    @cached_property
    def corners(self) -> tuple[Corner, ...]:
        """The joints that turn by more than 1e-9 rad, in order of u."""
        if not self.closed or self._smooth:
            return ()
        found = []
        for k in range(self.pieces.shape[0]):
            turn = curve_kernels.joint_turn(self._rows, k)
            if abs(turn) > curve_kernels.STRAIGHT:
                found.append(self._corner(k, turn))
        return tuple(found)

    def nearest(self, points: ArrayLike) -> Array:
        """The parameters (n,) of the globally nearest curve points, to rounding, for points (n, 2).

        Raises `InputError`, naming the row, for a point that is not finite.
        """
        return self._projected(points)[:, 0]

    def signed_distance(self, points: ArrayLike) -> Array:
        """Distances (n,), m, of points (n, 2) from the curve, negative inside."""
        rows = self._projected(points)
        return np.asarray(rows[:, 1] * rows[:, 2])

    def frame(self, points: ArrayLike) -> Frame:
        """Feet, normals, signed distances and shape operators for points (n, 2): see `Frame`."""
        rows = self._projected(points)
        at = self._evaluated(rows[:, 0])
        dx, dy, ddx, ddy = at[:, 2], at[:, 3], at[:, 4], at[:, 5]
        speed = np.hypot(dx, dy)
        tangent = at[:, 2:4] / speed[:, np.newaxis]
        normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
        curvature = (dx * ddy - dy * ddx) / speed**3
        shape = curvature[:, np.newaxis, np.newaxis] * tangent[:, :, np.newaxis] * tangent[:, np.newaxis, :]
        return Frame(at[:, 0:2], normal, rows[:, 1] * rows[:, 2], shape)

    def contains(self, points: ArrayLike) -> BoolArray:
        """Whether each of points (n, 2) lies inside; points on the curve do not."""
        rows = self._projected(points)
        return np.asarray((rows[:, 2] < 0.0) & (rows[:, 1] > 0.0))

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """(xmin, ymin, xmax, ymax), m; for an unbounded line a window of 0.2 m around its point."""
        if not self.closed:
            x, y = self.pieces[0, A], self.pieces[0, B]
            return float(x - WINDOW), float(y - WINDOW), float(x + WINDOW), float(y + WINDOW)
        points = self._polyline[0] if self._straight else np.vstack([*map(self._extremes, self._rows)])
        (xmin, ymin), (xmax, ymax) = points.min(axis=0), points.max(axis=0)
        return float(xmin), float(ymin), float(xmax), float(ymax)

    def outline(self, n: int) -> Array:
        """Points (n, 2) to draw, about equally spaced, corners kept; a closed curve ends where it starts."""
        if not self.closed:
            return self.position(np.linspace(-WINDOW, WINDOW, n))
        s = np.linspace(0.0, self.length, n)
        for corner in self.corners:
            s[round(corner.s / self.length * (n - 1))] = corner.s
        points = self.position(self.parameter(s))
        points[-1] = points[0]
        return points

    @cached_property
    def _rows(self) -> Array:
        return for_kernels(self.pieces)

    @property
    def _smooth(self) -> bool:
        return bool(self.pieces[0, KIND] in (CASSINIAN, ELLIPSE))

    @cached_property
    def _straight(self) -> bool:
        return bool(np.all(self.pieces[:, KIND] == LINE))

    @cached_property
    def _polyline(self) -> tuple[Array, Array]:
        """Vertices and search tree of a curve of straight pieces: an imported outline may have thousands."""
        vertices = for_kernels(self.pieces[:, A : B + 1])
        return vertices, polygon_kernels.build_tree(vertices)

    @cached_property
    def _panels(self) -> Array:
        """(u, s) between which the Gauss-Legendre rule gives arc length to rounding."""
        piece = self._rows[0]
        count = 8 * int(piece[B]) if piece[KIND] == CASSINIAN else 16
        return curve_kernels.arc_panels(piece, count)

    @cached_property
    def samples(self) -> Array:
        """The table that `curve_kernels.project` needs: empty unless the curve is one smooth piece."""
        if not self._smooth:
            return np.empty((0, 8))
        return curve_kernels.sample_table(self._rows[0], self._panels, BLOCK)

    def _evaluated(self, u: ArrayLike) -> Array:
        u = np.asarray(u, dtype=np.float64)
        if self.closed:
            start, end = self.u_range
            wrapped = start + np.mod(u - start, end - start)
            u = np.where((u >= start) & (u < end), u, np.where(wrapped < end, wrapped, start))
        return evaluate_many(self._rows, for_kernels(np.ravel(u))).reshape((*u.shape, 6))

    def _projected(self, points: ArrayLike) -> Array:
        array = checked_points(points)
        if not self._straight:
            return curve_kernels.project_many(self._rows, self.samples, array)
        vertices, tree = self._polyline
        edges, along, distances, _ = polygon_kernels.nearest_many(vertices, tree, array)
        starts, ends = self.pieces[edges, U0], self.pieces[edges, U1]
        u = starts + along * (ends - starts)
        return np.column_stack([u, np.abs(distances), np.where(distances < 0.0, -1.0, 1.0)])

    def _corner(self, k: int, turn: float) -> Corner:
        before, after = self._rows[k - 1], self._rows[k]
        pre = np.array(evaluate(before, before[U1])[2:4])
        x, y, dx, dy, _, _ = evaluate(after, after[U0])
        post = np.array([dx, dy])
        start, _ = self.u_range
        return Corner(
            u=float(after[U0]),
            s=float(after[U0] - start),
            position=np.array([x, y]),
            tangent_pre=pre,
            tangent_post=post,
            normal_pre=np.array([pre[1], -pre[0]]),
            normal_post=np.array([post[1], -post[0]]),
            turn=float(turn),
        )

    def _extremes(self, piece: Array) -> Array:
        """Points among which a piece's largest and smallest x and y are."""
        if piece[KIND] == ELLIPSE:
            return np.array([[piece[A], piece[B]], [-piece[A], -piece[B]]])
        if piece[KIND] == CASSINIAN:
            return self._turning_points()
        us = [piece[U0], piece[U1]]
        if piece[KIND] == ARC:
            swept = piece[E] * (np.arange(4) * (math.pi / 2.0) - piece[D]) % (2.0 * math.pi)
            us += [piece[U0] + a * piece[C] for a in swept if a * piece[C] <= piece[U1] - piece[U0]]
        return np.array([evaluate(piece, u)[:2] for u in us])

    def _turning_points(self) -> Array:
        """Where x' or y' of a smooth curve vanishes, by Newton from the extreme samples."""
        samples, points = self.samples, []
        for axis in (0, 1):
            for row in (np.argmin(samples[:, 2 + axis]), np.argmax(samples[:, 2 + axis])):
                u = float(samples[row, 0])
                for _ in range(4):
                    value = evaluate(self._rows[0], u)
                    u -= value[2 + axis] / value[4 + axis] if value[4 + axis] != 0.0 else 0.0
                points.append(evaluate(self._rows[0], u)[:2])
        return np.array([*points, *samples[:, 2:4]])
