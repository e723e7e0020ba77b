"""What every boundary of a model answers, in the plane and in space alike, and how a smooth one in space answers it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from inspect import getattr_static
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.laws import Closest

START_ROUNDING = 1e-6
"""Share of a march's grain from which on a point counts as inside: its start may be so by its rounding."""

SEARCH_BATCH = 32
"""Points of a segment that are looked at together on the search for its first crossing."""

RING_DIRECTIONS = 8
"""Directions in which the surroundings of a point in space are looked at."""

MOST_SLIDE_STEPS = 100
"""Most steps of one slide in space."""

STEP_PER_BEND_RADIUS = 0.25
"""Share of the smallest radius of curvature by which a slide in space steps at the most, so as to stay on its sheet."""


class ClosestPoint(NamedTuple):
    """The closest boundary points of n points: point = foot + distance normal.

    - `foot` (n, N), m: the globally nearest boundary point;
    - `normal` (n, N): the outward unit normal there; on a corner or an edge that of one of the faces that meet there,
      all of which are in `normal_cone`;
    - `distance` (n,), m: signed, negative inside;
    - `shape` (n, N, N), 1/m: the shape operator W, symmetric, with W normal = 0, and positive where the model is
      convex.

    A foot that moves with velocity ṗ turns the normal by W ṗ.

    Off the surface P_T ẏ = (I + distance W) ṗ, the projection of section 7.2 of the thesis differentiated. In the plane
    W = κ t tᵀ.
    """

    foot: Array
    normal: Array
    distance: Array
    shape: Array


@dataclass(frozen=True, eq=False)
class Corner:
    """A join of a plane boundary at which the tangent turns: where it is and the two frames that meet there.

    `u` and `s` (m) are the parameter and the arc length; `position`, the unit tangents and the outward unit normals
    before and after are (2,); `turn` (rad, between -pi and pi) is positive where the corner is convex.
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


@runtime_checkable
class Boundary(Protocol):
    """The surface of a rigid model: a plane curve, a polygon, a surface in space.

    Points are rows (n, N), m, with N = `dimension`. Every method that takes points raises `InputError`, naming the
    row, for one that is not finite or of another dimension.
    """

    @property
    def name(self) -> str:
        """What messages call it."""

    @property
    def dimension(self) -> int:
        """N: 2 in the plane, 3 in space."""

    @property
    def closed(self) -> bool:
        """Whether it encloses a bounded model."""

    @property
    def bounds(self) -> tuple[float, ...]:
        """The smallest coordinates (m) and then the largest; of an unbounded boundary those of a window on it."""

    @property
    def girth(self) -> float:
        """The length (m) once round: of a curve its own, in space that of a circle of the largest extent."""

    @property
    def corners(self) -> tuple[Corner, ...]:
        """The corners of a plane boundary in order; empty in space."""

    def closest_point(self, points: ArrayLike) -> ClosestPoint:
        """Return the closest boundary points of points (n, N), m, with normals, signed distances (m) and curvature."""

    def signed_distance(self, points: ArrayLike) -> Array:
        """Return the distances (n,), m, of points (n, N), m, from the boundary: negative inside the model."""

    def first_crossing(self, start: Array, end: Array, *, grain: float) -> Array | None:
        """Return the boundary point (N,), m, at which a segment between two points (N,), m, first goes inside, or None.

        A boundary may miss what the segment has inside over less than `grain` (m). A start on the surface, or inside by
        its rounding, is no crossing where the next point of the segment is outside.
        """

    def normal_cone(self, points: Array, reach: Array) -> Callable[[Array], Array]:
        """Return a function that measures by how much directions leave the true normals around points (n, N), m.

        True normals are those of the boundary within `reach` (n,), m, along it: one on a face, and on an edge or a
        corner the fan between those of the faces.

        The function takes directions (n, N) and returns angles (n,), rad, 0 inside the cone.
        """

    def points(self, n: int) -> Array:
        """Return n boundary points (n, N), spread over all of it, the same at each call."""

    def walk(self, start: Array, lengths: Array) -> ClosestPoint:
        """Return the boundary points (k, N), m, at `lengths` (k,), m, along it from the one nearest to `start` (N,), m.

        Negative lengths go the other way; `distance` is zero. In space the way is straight, and ends are projected.
        """

    def around(self, point: Array, reach: float) -> Array:
        """Return boundary points (k, N), m, about `reach` metres along from `point` (N,), m.

        In the plane they lie to either side of it, in space all round.
        """

    def descend(self, start: Array, goal: Array, *, step: float) -> Array:
        """Slide from `start` (N,), m, downhill in distance to `goal` (N,), m: a local minimum (N,) on the boundary.

        `step` (m) is how exactly that is placed.
        """


def is_boundary(value: object) -> bool:
    """Whether a value offers all of `Boundary`; as `isinstance`, which would ask for its corners to find them there."""
    return all(getattr_static(value, name, None) is not None for name in _MEMBERS)


_MEMBERS = [name for name in vars(Boundary) if not name.startswith("_")]


def march_to_crossing(boundary: Boundary, start: Array, end: Array, grain: float) -> Array | None:
    """Return where a segment first goes inside, (N,), m, or None: found by closest points alone.

    `start` and `end` (N,), m, as in `Boundary.first_crossing`. Steps of `grain` (m) where the surface is near; clear
    stretches are passed in steps as long as the distance from the surface.
    """
    length = distance_between(start, end)
    # a segment of no length has no direction
    if length == 0.0:
        return None
    covered = 0.0
    while covered < length:
        lengths = np.minimum(covered + grain * np.arange(SEARCH_BATCH + 1), length)
        points = start + lengths[:, np.newaxis] * ((end - start) / length)
        frame = boundary.closest_point(points)
        inside = np.flatnonzero(frame.distance[1:] < -START_ROUNDING * grain)
        if inside.size:
            return np.asarray(frame.foot[inside[0]])
        # nothing of the surface lies within a point's distance: skip that far ahead
        covered = float(lengths[-1]) + max(float(frame.distance[-1]), 0.0)
    return None


def distance_between(a: Array, b: Array) -> float:
    """Return the distance (m) of two points (N,), m."""
    return float(np.linalg.norm(a - b))


class SurfaceInSpace:
    """What a closed boundary in space has of itself: all of `Boundary` but `name`, `bounds` and `closest_point`.

    Normal cones, slides and walks are those of a smooth surface. One with edges has its own `normal_cone`.
    """

    name: str
    dimension = 3
    closed = True
    corners: tuple[Corner, ...] = ()

    @property
    def bounds(self) -> tuple[float, ...]:
        """(xmin, ymin, zmin, xmax, ymax, zmax), m."""
        raise NotImplementedError

    def closest_point(self, points: ArrayLike) -> ClosestPoint:
        """Answer `Boundary.closest_point` for points (n, 3), m: what each surface has of its own."""
        raise NotImplementedError

    @property
    def girth(self) -> float:
        """See `Boundary.girth`."""
        low, high = np.reshape(self.bounds, (2, 3))
        return math.pi * float(np.max(high - low))

    def signed_distance(self, points: ArrayLike) -> Array:
        """Return the signed distances (n,), m, of points (n, 3), m: see `Boundary.signed_distance`."""
        return self.closest_point(points).distance

    def first_crossing(self, start: Array, end: Array, *, grain: float) -> Array | None:
        """Return where the segment from `start` to `end` (3,), m, first goes inside: see `Boundary.first_crossing`."""
        return march_to_crossing(self, start, end, grain)

    def normal_cone(self, points: Array, reach: Array) -> Callable[[Array], Array]:
        """Answer `Boundary.normal_cone` for points (n, 3), m: circular cones round the normals, of a smooth surface.

        Each is as wide (rad) as the surface turns within `reach` (n,), m: along a path of length s the normal turns by
        at most the largest |W| on the way times s.
        """
        frame = self.closest_point(points)
        # the last two right singular vectors of the normal, as a row, span the tangent plane
        tangents = np.linalg.svd(frame.normal[:, np.newaxis, :])[2][:, 1:, :]
        # the curvature is sampled at the foot and at RING_DIRECTIONS points one reach away
        steps = [np.zeros_like(frame.foot)]
        for angle in np.linspace(0.0, 2.0 * np.pi, RING_DIRECTIONS, endpoint=False):
            steps.append(reach[:, np.newaxis] * (np.cos(angle) * tangents[:, 0] + np.sin(angle) * tangents[:, 1]))
        shapes = [self.closest_point(frame.foot + step).shape for step in steps]
        # half the opening: reach times the largest |principal curvature| seen
        half_angle = reach * np.max([np.abs(np.linalg.eigvalsh(shape)).max(axis=1) for shape in shapes], axis=0)

        def angle_outside(directions: Array) -> Array:
            """Return the angles (n,), rad, by which directions (n, 3) leave the cones."""
            across = np.linalg.norm(np.cross(frame.normal, directions), axis=1)
            # atan2 and not acos: exact for small angles too
            angle = np.arctan2(across, np.sum(frame.normal * directions, axis=1))
            return np.asarray(np.maximum(0.0, angle - half_angle))

        return angle_outside

    def points(self, n: int) -> Array:
        """See `Boundary.points`: those of a sphere round the bounds, projected."""
        low, high = np.reshape(self.bounds, (2, 3))
        return self.closest_point(0.5 * (low + high) + 0.5 * (high - low) * spread_over_sphere(n)).foot

    def walk(self, start: Array, lengths: Array) -> ClosestPoint:
        """Return the points (k, 3), m, at `lengths` (k,), m, along the surface from the one nearest to `start` (3,), m.

        The way is straight, along the coordinate axis that lies flattest to the surface: see `Boundary.walk`.
        """
        begin = self.closest_point(start[np.newaxis])
        along = np.zeros(3)
        # the axis whose normal component is smallest, less its part along the normal
        along[int(np.argmin(np.abs(begin.normal[0])))] = 1.0
        along -= (along @ begin.normal[0]) * begin.normal[0]
        ends = self.closest_point(begin.foot + lengths[:, np.newaxis] * along / np.linalg.norm(along))
        return ends._replace(distance=np.zeros_like(ends.distance))

    def around(self, point: Array, reach: float) -> Array:
        """Return points (k, 3), m, all round and `reach` (m) from the foot of a `point` (3,), m: see `Boundary.around`.

        There are RING_DIRECTIONS of them.
        """
        frame = self.closest_point(point[np.newaxis])
        across = np.linalg.svd(frame.normal)[2][1:]
        angle = np.linspace(0.0, 2.0 * np.pi, RING_DIRECTIONS, endpoint=False)
        return self.closest_point(frame.foot + reach * np.column_stack([np.cos(angle), np.sin(angle)]) @ across).foot

    def descend(self, start: Array, goal: Array, *, step: float) -> Array:
        """Answer `Boundary.descend` for `start` and `goal` (3,), m: by the part of the error along the surface.

        A step is halved where it leads uphill.
        """
        share = 1.0
        frame = self.closest_point(start[np.newaxis])
        distance = distance_between(goal, frame.foot[0])
        for _ in range(MOST_SLIDE_STEPS):
            foot, normal = frame.foot[0], frame.normal[0]
            error = goal - foot
            # the tangential part of the way to the goal: zero at a local minimum of the distance
            error = error - (error @ normal) * normal
            error_length = float(np.linalg.norm(error))
            largest_curvature = float(np.abs(np.linalg.eigvalsh(frame.shape[0])).max())
            # no farther than a share of the bend radius 1 / |W|, so as to stay on this sheet
            length = share * min(
                error_length, STEP_PER_BEND_RADIUS / largest_curvature if largest_curvature > 0.0 else math.inf
            )
            if length <= 1e-3 * step:
                break
            next_frame = self.closest_point((foot + length / error_length * error)[np.newaxis])
            next_distance = distance_between(goal, next_frame.foot[0])
            # overshot: shorten this and all later steps
            if next_distance >= distance:
                share *= 0.5
                continue
            frame, distance = next_frame, next_distance
        return np.asarray(frame.foot[0])


def spread_over_sphere(n: int) -> Array:
    """Return n points (n, 3) spread evenly over the unit sphere: golden angles, between equal shares of area."""
    height = 1.0 - 2.0 * (np.arange(n) + 0.5) / n
    axis_distance = np.sqrt(1.0 - height * height)
    azimuth = np.arange(n) * (math.pi * (3.0 - math.sqrt(5.0)))
    return np.column_stack([axis_distance * np.cos(azimuth), axis_distance * np.sin(azimuth), height])


def closest_of(boundary: Boundary) -> Closest | None:
    """Return the closest point of a boundary as compiled code; None for one that has none, such as one in Python.

    A boundary offers it as `compiled_closest`, with a function made by `hapticeval.compiled`.
    """
    return getattr(boundary, "compiled_closest", None)


def closest_in_python(boundary: Boundary) -> Callable[[object, Array, Array], float]:
    """Return what a boundary answers from Python in the form of `CLOSEST`; the data is not used. No arc length."""

    def closest(_data: object, point: Array, frame: Array) -> float:
        """Answer `CLOSEST` for a point (N,), m, into the rows of `frame` (k, N)."""
        closest_point = boundary.closest_point(point[np.newaxis])
        rows = np.vstack(
            [closest_point.foot, closest_point.normal, *closest_point.shape, np.full_like(closest_point.foot, np.nan)]
        )
        frame[:] = rows[: frame.shape[0]]
        return float(closest_point.distance[0])

    return closest
