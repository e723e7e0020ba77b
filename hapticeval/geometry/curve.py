"""A plane curve that bounds a model: frame, curvature, arc length, nearest point, side, and its cone of normals."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import for_kernels
from hapticeval.errors import InputError
from hapticeval.geometry import arc_length, curve_kernels, polygon_kernels
from hapticeval.geometry.boundary import SEARCH_BATCH, Boundary, ClosestPoint, Corner, march_to_crossing
from hapticeval.geometry.kernels import (
    ARC,
    ARC_PIECE,
    CASSINIAN,
    CASSINIAN_PIECE,
    ELLIPSE,
    ELLIPSE_PIECE,
    LINE,
    LINE_PIECE,
    PIECE,
    PIECE_COLUMNS,
    SMOOTH_KINDS,
    UNBOUNDED,
    concatenate_segments,
    evaluate_many,
    line_pieces,
)
from hapticeval.geometry.motion import Motion
from hapticeval.geometry.validate import answer_by_kernel
from hapticeval.laws import Closest
from hapticeval.records import as_record, as_records
from hapticeval.types import Array, BoolArray

HALF_WINDOW = 0.1
"""Half the side (m) of the square in which an unbounded curve is drawn and sampled."""

LONG_SEARCH_BATCH = 1024
"""Points of a slide that are looked at together where it is longer than `SEARCH_BATCH`: such slides go far."""


@dataclass(frozen=True, eq=False)
class Curve:
    """The exact plane boundary of a model, anticlockwise, as rows of `pieces` that compiled loops walk (see `kernels`).

    It is a `Boundary`, with a parameter u beside. Methods of u take one parameter or an array of them; on closed curves
    u wraps.

    - A closed curve is either one smooth piece, of `SMOOTH_KINDS`, or LINE and ARC pieces with arc length as parameter.
    - An open one is a single UNBOUNDED piece whose inside is the half-plane to its left.

    Raises `InputError` for pieces of another shape.
    """

    name: str
    pieces: Array
    closed: bool

    def __post_init__(self) -> None:
        pieces = np.array(self.pieces, dtype=np.float64, order="C")
        if pieces.ndim != 2 or pieces.shape[0] == 0 or pieces.shape[1] != PIECE_COLUMNS:
            raise InputError(f"curve '{self.name}' has pieces of shape {pieces.shape}, not (n, {PIECE_COLUMNS})")
        kinds = as_records(pieces, PIECE).kind
        # smooth kinds close on themselves and cannot be joined to others
        alone = pieces.shape[0] == 1
        bounded = bool(np.all(np.isin(kinds, (LINE, ARC)))) or (alone and kinds[0] in SMOOTH_KINDS)
        if not (bounded if self.closed else alone and kinds[0] == UNBOUNDED):
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

    @cached_property
    def u_range(self) -> tuple[float, float]:
        """The parameter's start and end; infinite for an unbounded line."""
        pieces = as_records(self.pieces, PIECE)
        return float(pieces[0].u0), float(pieces[-1].u1)

    @cached_property
    def length(self) -> float:
        """Arc length (m) once around; infinite for an unbounded line."""
        if self._smooth:
            return float(self._panels[-1, 1])
        start, end = self.u_range
        return end - start

    @property
    def girth(self) -> float:
        """See `Boundary.girth`: the `length`."""
        return self.length

    def position(self, u: ArrayLike) -> Array:
        """Return points (..., 2), m, at the parameters u (...,): one number or an array of any shape."""
        return self._evaluate(u)[..., 0:2]

    def tangent(self, u: ArrayLike) -> Array:
        """Return unit tangents (..., 2), anticlockwise, at u (...,), m or rad; at a corner the one after it."""
        derivative = self._evaluate(u)[..., 2:4]
        return np.asarray(derivative / np.hypot(derivative[..., 0], derivative[..., 1])[..., np.newaxis])

    def normal(self, u: ArrayLike) -> Array:
        """Return outward unit normals (..., 2) at u (...,), m or rad; at a corner the one after it."""
        tangent = self.tangent(u)
        # the tangent turned clockwise: the inside is on the left
        return np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)

    def curvature(self, u: ArrayLike) -> Array:
        """Return the signed curvature (...,), 1/m, at u (...,), positive where convex; corners carry none."""
        rows = self._evaluate(u)
        dx, dy, ddx, ddy = rows[..., 2], rows[..., 3], rows[..., 4], rows[..., 5]
        # (x' y'' - y' x'') / |c'|^3, for any parameter
        return np.asarray((dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3)

    def arc_length(self, u: ArrayLike) -> Array:
        """Return the arc length (...,), m, from the start of the curve to u (...,); it grows beyond one turn."""
        start, end = self.u_range
        u = np.asarray(u, dtype=np.float64)
        if not self.closed:
            return u
        # u is the arc length on lines and arcs
        if not self._smooth:
            return np.asarray(u - start)
        # whole turns, and the rest by the panels' quadrature
        turns = np.floor((u - start) / (end - start))
        within_turn = np.clip(u - turns * (end - start), start, end)
        lengths = arc_length.arc_lengths(self._rows[0], self._panels, np.ravel(within_turn)).reshape(u.shape)
        return np.asarray(turns * self.length + lengths)

    def parameter(self, s: ArrayLike) -> Array:
        """Return the parameter (...,) at arc length s (...,), m, which wraps on a closed curve: see `arc_length`."""
        s = np.asarray(s, dtype=np.float64)
        if not self.closed:
            return s
        within_turn = np.mod(s, self.length)
        if not self._smooth:
            return np.asarray(self.u_range[0] + within_turn)
        return arc_length.parameters_at(self._rows[0], self._panels, np.ravel(within_turn)).reshape(s.shape)

    @cached_property
    def corners(self) -> tuple[Corner, ...]:
        """The joins that turn by more than 1e-9 rad, in order of u."""
        if not self.closed or self._smooth:
            return ()
        pieces = as_records(self.pieces, PIECE)
        points, after = _evaluate_along(self.pieces, np.zeros(pieces.size))
        before = np.roll(_evaluate_along(self.pieces, pieces.u1 - pieces.u0)[1], 1, axis=0)
        # the angle from the tangent of the piece before to that of the one after
        turns = [
            math.atan2(ax * by - ay * bx, ax * bx + ay * by)
            for (ax, ay), (bx, by) in zip(before.tolist(), after.tolist(), strict=True)
        ]
        return tuple(
            # (ty, -tx) of the tangents before and after; these are unit vectors on lines and arcs
            Corner(
                u, u - self.u_range[0], points[k], before[k], after[k],
                before[k, ::-1] * (1.0, -1.0), after[k, ::-1] * (1.0, -1.0), turn,
            )
            for k, (u, turn) in enumerate(zip(pieces.u0.tolist(), turns, strict=True))
            if abs(turn) > curve_kernels.SMOOTH_TURN
        )  # fmt: skip

    def nearest(self, points: ArrayLike) -> Array:
        """Return the parameters (n,) of the globally nearest curve points, to rounding, for points (n, 2), m."""
        return self._project(points)[:, 0]

    def signed_distance(self, points: ArrayLike) -> Array:
        """Return the signed distances (n,), m, of points (n, 2), m, negative inside: see `Boundary.signed_distance`."""
        located = self._project(points)
        return located[:, 1] * located[:, 2]

    def closest_point(self, points: ArrayLike) -> ClosestPoint:
        """Return the closest points of points (n, 2), m: see `Boundary.closest_point`."""
        write_closest = curve_kernels.closest_on_edges if self.straight else curve_kernels.closest_on_pieces
        located = self._project(points)
        n = len(located)
        closest = ClosestPoint(np.empty((n, 2)), np.empty((n, 2)), np.empty(n), np.empty((n, 2, 2)))
        write_closest(self._rows, located, *closest)
        return closest

    def contains(self, points: ArrayLike) -> BoolArray:
        """Return whether each of points (n, 2), m, lies inside (n,); points on the curve do not."""
        rows = self._project(points)
        return np.asarray((rows[:, 2] < 0.0) & (rows[:, 1] > 0.0))

    def first_crossing(self, start: Array, end: Array, *, grain: float) -> Array | None:
        """Return where the segment from `start` to `end` (2,), m, first goes inside: see `Boundary.first_crossing`."""
        return march_to_crossing(self, start, end, grain)

    def normal_cone(self, points: Array, reach: Array) -> Callable[[Array], Array]:
        """Answer `Boundary.normal_cone` for points (n, 2) and `reach` (n,), m: an interval of angles (rad) at each."""
        return self._normals.angle_outside(points, reach)

    def points(self, n: int) -> Array:
        """Return n points (n, 2), m, of the curve: see `outline`."""
        return self.outline(n)

    def walk(self, start: Array, lengths: Array) -> ClosestPoint:
        """Return the points (k, 2), m, at `lengths` (k,), m, along the curve from that nearest to `start` (2,), m."""
        us = np.atleast_1d(self.parameter(self.arc_length(self.nearest(start[np.newaxis])) + lengths))
        tangent, curvature = self.tangent(us), self.curvature(us)
        # W = κ t t^T
        shape = curvature[:, np.newaxis, np.newaxis] * tangent[:, :, np.newaxis] * tangent[:, np.newaxis, :]
        return ClosestPoint(self.position(us), self.normal(us), np.zeros(us.size), shape)

    def around(self, point: Array, reach: float) -> Array:
        """Return the boundary points (2, 2), m, at `reach` (m) along the curve to either side of `point` (2,), m."""
        return self.walk(point, reach * np.array([-1.0, 1.0])).foot

    def descend(self, start: Array, goal: Array, *, step: float) -> Array:
        """Answer `Boundary.descend` for `start` and `goal` (2,), m: in steps, in the direction that leads downhill."""
        s = float(self.arc_length(self.nearest(start[np.newaxis]))[0])
        # one step to either side shows which way is downhill
        points = self.position(self.parameter(s + step * np.array([-1.0, 0.0, 1.0])))
        behind_distance, start_distance, ahead_distance = np.linalg.norm(points - goal, axis=1)
        if start_distance <= min(behind_distance, ahead_distance):
            return np.asarray(points[1])
        signed_step = step if ahead_distance <= behind_distance else -step
        first_step, count = 0, SEARCH_BATCH
        while first_step * step < self.length:
            points = self.position(self.parameter(s + signed_step * np.arange(first_step, first_step + count + 1)))
            # the last point before the distance grows is the minimum
            uphill = np.flatnonzero(np.diff(np.linalg.norm(points - goal, axis=1)) >= 0.0)
            if uphill.size:
                return np.asarray(points[uphill[0]])
            first_step, count = first_step + count, LONG_SEARCH_BATCH
        return np.asarray(points[-1])

    @cached_property
    def bounds(self) -> tuple[float, ...]:
        """(xmin, ymin, xmax, ymax), m; for an unbounded line a window of 0.2 m around its point."""
        if not self.closed:
            ((x, y),) = self._starts
            return float(x - HALF_WINDOW), float(y - HALF_WINDOW), float(x + HALF_WINDOW), float(y + HALF_WINDOW)
        # the corners of straight edges, or where x' or y' is zero on each piece
        points = self._starts if self.straight else np.vstack([*map(self._extremes, self._rows)])
        return (*points.min(axis=0).tolist(), *points.max(axis=0).tolist())

    def moved(self, motion: Motion) -> Curve | None:
        """Return the curve moved; None for a smooth piece, bound to origin and axes, that would be turned or shifted.

        A smooth piece is its own mirror image in the x axis. The pieces of others follow each other the other way round
        in a mirror, from the same place on, so that the curve still runs anticlockwise.
        """
        rows = self.pieces[:: -1 if motion.mirrors else 1]
        # corners are moved, not pieces: neighbours still meet to the last bit
        if self.straight:
            corners = motion(self._starts)
            return Curve(
                self.name,
                line_pieces(np.roll(corners[::-1], 1, axis=0) if motion.mirrors else corners),
                self.closed,
            )
        if self._smooth:
            if not motion.keeps_axes:
                return None
            row = np.array(rows)
            record, lengths = SMOOTH_KINDS[as_record(row, PIECE).kind]
            piece = as_record(row, record)
            for name in lengths:
                setattr(piece, name, getattr(piece, name) * motion.scale)
            return Curve(self.name, row, self.closed)
        return Curve(self.name, concatenate_segments([_moved_piece(row, motion) for row in rows]), self.closed)

    def reordered(self) -> Curve | None:
        """Return the same curve, begun half way round its pieces; None for a curve of one piece."""
        if len(self.pieces) < 2:
            return None
        half = len(self.pieces) // 2
        if self.straight:
            return Curve(self.name, line_pieces(np.roll(self._starts, half, axis=0)), self.closed)
        rows = np.roll(self.pieces, half, axis=0)
        return Curve(self.name, concatenate_segments([_piece_from_zero(row) for row in rows]), self.closed)

    def outline(self, n: int) -> Array:
        """Return points (n, 2) to draw, about equally spaced, corners kept; a closed curve ends where it starts."""
        if not self.closed:
            return self.position(np.linspace(-HALF_WINDOW, HALF_WINDOW, n))
        s = np.linspace(0.0, self.length, n)
        for corner in self.corners:
            # the nearest sample is moved onto the corner
            s[round(corner.s / self.length * (n - 1))] = corner.s
        points = self.position(self.parameter(s))
        points[-1] = points[0]
        return points

    @cached_property
    def straight(self) -> bool:
        """Whether it is made of straight edges alone."""
        return bool(np.all(as_records(self.pieces, PIECE).kind == LINE))

    @cached_property
    def tree(self) -> Array:
        """The search tree over straight edges, as `polygon_kernels` lays it out: an imported outline has thousands."""
        return polygon_kernels.build_tree(self._starts) if self.straight else np.empty((0, 6))

    @cached_property
    def samples(self) -> Array:
        """The table that `curve_kernels.project` needs: empty unless the curve is one smooth piece."""
        if not self._smooth:
            return np.empty((0, 8))
        return arc_length.sample_panels(self._rows[0], self._panels, curve_kernels.BLOCK_ROWS)

    @cached_property
    def _rows(self) -> Array:
        """The pieces as compiled code takes them: contiguous and writable."""
        return for_kernels(self.pieces)

    @cached_property
    def _starts(self) -> Array:
        """Where straight pieces start, (n, 2), m: the vertices of a curve of straight edges."""
        lines = as_records(self.pieces, LINE_PIECE)
        return np.column_stack([lines.x, lines.y])

    @cached_property
    def _lookup(self) -> tuple[Callable[..., Array], Sequence[Array]]:
        """The kernel that locates points by a curve of this kind, and what it looks them up in."""
        if self.straight:
            return curve_kernels.locate_on_edges, (self._rows, self._starts, self.tree)
        if self._smooth:
            return curve_kernels.locate_on_smooth, (self._rows, self.samples)
        return curve_kernels.locate_on_pieces, (self._rows,)

    @cached_property
    def compiled_closest(self) -> Closest:
        """The closest point as compiled code, for what is composed into a step: see `closest_of`."""
        return curve_kernels.closest_of_curve(self._rows, self.samples, self._starts, self.tree)

    @cached_property
    def _normals(self) -> NormalCone:
        return NormalCone(self)

    @cached_property
    def _smooth(self) -> bool:
        """Whether the curve is one smooth closed piece, with a parameter of its own."""
        return as_record(self.pieces, PIECE).kind in SMOOTH_KINDS

    @cached_property
    def _panels(self) -> Array:
        """(u, s) between which the Gauss-Legendre rule gives arc length to rounding."""
        piece = self._rows[0]
        # eight to start with for each lobe, sixteen for an ellipse: `cut_into_panels` divides further
        is_cassinian = as_record(piece, PIECE).kind == CASSINIAN
        count = 8 * int(as_record(piece, CASSINIAN_PIECE).lobes) if is_cassinian else 16
        return arc_length.cut_into_panels(piece, count)

    def _evaluate(self, u: ArrayLike) -> Array:
        """Return rows (..., 6) of position and first two derivatives by u, see `kernels.evaluate`; u wraps.

        An unbounded line's does not.
        """
        u = np.asarray(u, dtype=np.float64)
        if self.closed:
            start, end = self.u_range
            in_first_turn = (u >= start) & (u < end)
            if not in_first_turn.all():
                wrapped = start + np.mod(u - start, end - start)
                # rounding may wrap u onto the end itself: that is the start
                u = np.where(in_first_turn, u, np.where(wrapped < end, wrapped, start))
        if self.straight:
            return _evaluate_lines(self.pieces, np.ravel(u)).reshape((*u.shape, 6))
        return evaluate_many(self._rows, for_kernels(np.ravel(u))).reshape((*u.shape, 6))

    def _project(self, points: ArrayLike) -> Array:
        """Return rows (n, 3) of u, distance (m) and side for points (n, 2), m."""
        locate, tables = self._lookup
        return answer_by_kernel(locate, tables, points, 2)

    def _extremes(self, piece: Array) -> Array:
        """Points among which a piece's largest and smallest x and y are."""
        kind, first, last = as_record(piece, PIECE)
        # two opposite corners of the box
        if kind == ELLIPSE:
            ellipse = as_record(piece, ELLIPSE_PIECE)
            return np.array([[ellipse.a, ellipse.b], [-ellipse.a, -ellipse.b]])
        if kind in SMOOTH_KINDS:
            return self._turning_points()
        us = [first, last]
        if kind == ARC:
            arc = as_record(piece, ARC_PIECE)
            # where x' or y' of an arc is zero: the multiples of 90 degrees that it sweeps
            swept = arc.sense * (np.arange(4) * (math.pi / 2.0) - arc.angle) % (2.0 * math.pi)
            us += [first + a * arc.radius for a in swept if a * arc.radius <= last - first]
        return evaluate_many(piece[np.newaxis], np.array(us))[:, :2]

    def _turning_points(self) -> Array:
        """Where x' or y' of a smooth curve vanishes, by Newton from the extreme samples."""
        samples, points = self.samples, []
        for axis in (0, 1):
            for row in (np.argmin(samples[:, 2 + axis]), np.argmax(samples[:, 2 + axis])):
                u = float(samples[row, 0])
                # Newton on x' = 0 or y' = 0, from a sample beside the root: digits double each time
                for _ in range(4):
                    values = self._evaluate(u)
                    u -= values[2 + axis] / values[4 + axis] if values[4 + axis] != 0.0 else 0.0
                points.append(self.position(u))
        # the samples too: no extreme is lost where Newton left its place
        return np.array([*points, *samples[:, 2:4]])


def _evaluate_lines(pieces: Array, us: Array) -> Array:
    """Return what `evaluate_many` gives of LINE pieces (k, 9), m, at `us` (n,), m, without compiled code: (n, 6)."""
    # as in `LINE_PIECE`, and without its record: many ask for one point, and attributes cost four times the rest
    first_us = pieces[:, 1]
    _, u0, _, x, y, dx, dy, *_ = pieces[np.maximum(np.searchsorted(first_us, us, "right") - 1, 0)].T
    along = us - u0
    values = np.zeros((us.size, 6))
    values[:, 0], values[:, 1], values[:, 2], values[:, 3] = x + along * dx, y + along * dy, dx, dy
    return values


def _evaluate_along(pieces: Array, along: Array) -> tuple[Array, Array]:
    """Return points (n, 2), m, and unit tangents (n, 2) on LINE and ARC pieces (n, 9), `along` (n,), m, from starts."""
    lines = as_records(pieces, LINE_PIECE)
    points = np.column_stack([lines.x + along * lines.dx, lines.y + along * lines.dy])
    tangents = np.column_stack([lines.dx, lines.dy])
    for k in np.flatnonzero(lines.kind == ARC):
        arc = as_record(pieces[k], ARC_PIECE)
        angle = arc.angle + arc.sense * along[k] / arc.radius
        cos, sin = math.cos(angle), math.sin(angle)
        points[k] = arc.x + arc.radius * cos, arc.y + arc.radius * sin
        tangents[k] = -arc.sense * sin, arc.sense * cos
    return points, tangents


def _piece_from_zero(row: Array) -> Array:
    """Return a piece of lines or arcs with u from 0."""
    piece = np.array(row)
    limits = as_record(piece, PIECE)
    if limits.kind != UNBOUNDED:
        limits.u0, limits.u1 = 0.0, limits.u1 - limits.u0
    return piece


def _moved_piece(row: Array, motion: Motion) -> Array:
    """Return a LINE, ARC or UNBOUNDED piece moved, with u from 0; in a mirror it runs from where it ended."""
    piece = _piece_from_zero(row)
    limits, mirrored = as_record(piece, PIECE), motion.mirrors
    if limits.kind == ARC:
        arc, turn = as_record(piece, ARC_PIECE), math.atan2(motion.matrix[1, 0], motion.matrix[0, 0])
        # the angle of the start: turned; in a mirror that of the mirrored end
        arc.angle = turn - (arc.angle + arc.sense * arc.u1 / arc.radius) if mirrored else turn + arc.angle
        arc.x, arc.y = motion(np.array([arc.x, arc.y]))
        arc.radius *= motion.scale
    else:
        line = as_record(piece, LINE_PIECE)
        start, tangent = np.array([line.x, line.y]), np.array([line.dx, line.dy])
        # in a mirror the piece is run from where it ended
        if mirrored and line.kind == LINE:
            start = start + line.u1 * tangent
        line.x, line.y = motion(start)
        line.dx, line.dy = (-1.0 if mirrored else 1.0) * (motion.matrix @ tangent)
    if limits.kind != UNBOUNDED:
        limits.u1 *= motion.scale
    return piece


def as_curve(boundary: Boundary | None) -> Curve | None:
    """Return the boundary where it is a plane curve with a parameter, None where it is anything else."""
    return boundary if isinstance(boundary, Curve) else None


NORMAL_SAMPLES = 16384
JOIN_OFFSET = 1e-9
"""Before each join, in parts of the curve, where the normal of the face that ends there is sampled."""

SPLINE_TOLERANCE = 1e-10
"""How closely (rad) a spline of the normals has to keep to them half way between its knots, to be used for them."""


class NormalCone:
    """The true outward normals within a reach, in metres of arc, on either side of a surface point.

    On a smooth stretch that is a narrow interval around n_c (3.4); across a corner it holds every direction between the
    normals of the two faces, which are the equivalent normals n_e of section 3.2.1.

    The normals at the point and at both ends of the stretch are exact, on a curve of one piece to `SPLINE_TOLERANCE` at
    the ends.

    So are those where the turning changes its sense: at joins of the curve and at inflections. Two inflections between
    the same two of `NORMAL_SAMPLES` points are missed.
    """

    def __init__(self, curve: Curve) -> None:
        self.curve = curve
        # an unbounded line has one normal
        if not curve.closed:
            return
        low, high = curve.u_range
        tiny, joins = JOIN_OFFSET * (high - low), as_records(curve.pieces, PIECE).u0
        # samples just before and at each join: both normals of a corner
        inner = np.concatenate([np.linspace(low, high, NORMAL_SAMPLES), joins, joins - tiny])
        u = np.unique(np.clip(inner, low, high - tiny))
        u = np.union1d(u, _inflections(curve, u, tiny))
        s = curve.arc_length(u)
        wrapped = _angles_of(curve.normal(u))
        # unwrapped: each angle continues the one before
        angle = np.concatenate([[wrapped[0]], wrapped[0] + np.cumsum(wrap_angle(np.diff(wrapped)))])
        turn = 2.0 * np.pi
        # three turns in a row: no stretch of half a turn to either side meets a seam
        self._s = np.concatenate([s - curve.length, s, s + curve.length])
        self._angle = np.concatenate([angle - turn, angle, angle + turn])
        self._spline = None
        if len(curve.pieces) == 1:
            from scipy.interpolate import CubicHermiteSpline

            spline = CubicHermiteSpline(self._s, self._angle, np.tile(curve.curvature(u), 3))
            middle = 0.5 * (u[:-1] + u[1:])
            # the spline is used if it keeps to the exact normals half way between its knots
            spline_error = wrap_angle(_angles_of(curve.normal(middle)) - spline(curve.arc_length(middle)))
            self._spline = spline if float(np.abs(spline_error).max()) <= SPLINE_TOLERANCE else None

    def interval(self, points: Array, reach: Array) -> tuple[Array, Array]:
        """Return the lowest and highest angle (n,), rad, unwrapped, of the normals near points (n, 2), m.

        Near is within `reach` (n,), m, along the curve. At a corner these are the angles of both faces' normals,
        however small the reach.
        """
        if not self.curve.closed:
            angle = np.full(points.shape[0], _angles_of(self.curve.normal(0.0)[np.newaxis])[0])
            return angle, angle
        # half a turn to either side is all of the curve
        reach = np.minimum(reach, 0.5 * self.curve.length)
        u = self.curve.nearest(points)
        s = self.curve.arc_length(u)
        ends = [s, s - reach, s + reach]
        # at the point and at both ends of the stretch, exactly
        angles = [self._angle_at(s, u), *(self._angle_at(end) for end in ends[1:])]
        low, high = np.min(angles, axis=0), np.max(angles, axis=0)
        # rounding may put a foot beside its corner: look across it
        seam = 2.0 * JOIN_OFFSET * self.curve.length if self.curve.corners else 0.0
        first = np.searchsorted(self._s, np.minimum(ends[1], s - seam), side="left")
        last = np.searchsorted(self._s, np.maximum(ends[2], s + seam), side="right")
        has_samples = last > first
        # reduceat: the extreme of the samples of each stretch that has any
        windows = np.column_stack([first, last])[has_samples].ravel()
        if windows.size:
            low[has_samples] = np.minimum(low[has_samples], np.minimum.reduceat(self._angle, windows)[::2])
            high[has_samples] = np.maximum(high[has_samples], np.maximum.reduceat(self._angle, windows)[::2])
        return low, high

    def _angle_at(self, s: Array, u: Array | None = None) -> Array:
        """Return the normals' angle (n,), rad, unwrapped, at arc lengths (n,) and the parameters u there, if known."""
        if u is None and self._spline is not None:
            return np.asarray(self._spline(s))
        # the exact angle, brought to the turn that the samples tell
        near = np.interp(s, self._s, self._angle)
        normals = self.curve.normal(self.curve.parameter(s) if u is None else u)
        return np.asarray(near + wrap_angle(_angles_of(normals) - near))

    def angle_outside(self, points: Array, reach: Array) -> Callable[[Array], Array]:
        """Answer `Boundary.normal_cone` for points (n, 2), m, and `reach` (n,), m: the function gives angles in rad."""
        low, high = self.interval(points, reach)
        middle = 0.5 * (low + high)

        def angle_outside_of(directions: Array) -> Array:
            """Return the angles (n,), rad, by which directions (n, 2) leave the intervals."""
            # the turn of each angle that is closest to the interval
            angle = middle + wrap_angle(_angles_of(directions) - middle)
            return np.maximum(0.0, np.maximum(low - angle, angle - high))

        return angle_outside_of


def _inflections(curve: Curve, u: Array, tiny: float) -> list[float]:
    """Return the parameters at which the curvature changes its sign between neighbours of u (n,).

    Each lies at least `tiny` from both.
    """
    sign = np.sign(curve.curvature(u))
    # the angle's extremes lie where the curvature changes its sign
    changes = np.flatnonzero(sign[:-1] * sign[1:] < 0.0)
    if not changes.size:
        return []
    from scipy.optimize import brentq

    roots = [(brentq(lambda at: float(curve.curvature(at)), u[k], u[k + 1], xtol=tiny), k) for k in changes]
    return [root for root, k in roots if u[k] + tiny < root < u[k + 1] - tiny]


def wrap_angle(angle: Array) -> Array:
    """Return each angle (n,) brought into [-pi, pi), rad."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def _angles_of(vectors: Array) -> Array:
    """Return the angle (n,), rad, of each of vectors (n, 2)."""
    return np.asarray(np.arctan2(vectors[:, 1], vectors[:, 0]))
