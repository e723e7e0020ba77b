"""A model as a polygon: the representation that most renderers hold, with queries that grow as log n."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import for_kernels
from hapticeval.geometry import polygon_kernels
from hapticeval.geometry.validate import checked_points, checked_vertices
from hapticeval.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from hapticeval.geometry.curve import Curve


@dataclass(frozen=True, eq=False)
class Polygon:
    """A simple polygon: `vertices` (n, 2), m, anticlockwise; edge k runs from vertex k to the next.

    Raises `InputError` for vertices that are no such outline (see `checked_vertices`).
    """

    vertices: Array

    def __post_init__(self) -> None:
        vertices = checked_vertices(self.vertices)
        vertices.flags.writeable = False
        object.__setattr__(self, "vertices", vertices)

    @cached_property
    def edges(self) -> Array:
        """From each vertex to the next, (n, 2), m."""
        return np.asarray(np.roll(self.vertices, -1, axis=0) - self.vertices)

    @cached_property
    def resolution(self) -> float:
        """The longest edge (m)."""
        return float(np.max(np.hypot(self.edges[:, 0], self.edges[:, 1])))

    @cached_property
    def tree(self) -> Array:
        """The tree that the compiled queries walk, as `polygon_kernels` lays it out."""
        return polygon_kernels.build_tree(self._rows)

    def nearest(self, points: ArrayLike) -> tuple[IntArray, Array, Array]:
        """For points (n, 2) the nearest edges (n,), the shares t (n,) along them, and the nearest points (n,
        2).

        A vertex is given as t = 0 of the edge that it starts. Raises `InputError` for points that are not
        finite.
        """
        edges, along, _, feet = self._nearest(points)
        return edges, along, feet

    def signed_distance(self, points: ArrayLike) -> Array:
        """Distances (n,), m, of points (n, 2) from the outline, negative inside."""
        return self._nearest(points)[2]

    def contains(self, points: ArrayLike) -> BoolArray:
        """Whether each of points (n, 2) lies inside; points on the outline do not."""
        return np.asarray(self.signed_distance(points) < 0.0)

    def as_curve(self) -> Curve:
        """The outline as a curve of LINE pieces, a piece an edge."""
        from hapticeval.geometry.curve import Curve
        from hapticeval.geometry.pieces import closed_polyline

        return Curve("polygon", closed_polyline(self.vertices), True)

    def standoff_from(self, curve: Curve) -> float:
        """The largest distance (m) between this outline and a closed curve's: how far apart the two surfaces
        are.

        Measured both ways, from a fine sampling whose peaks are then climbed to rounding.
        """
        corners = [corner.u for corner in curve.corners]
        start, end = curve.u_range
        feet = curve.nearest(self.vertices)
        stops = np.unique(np.concatenate([[start, end], corners, np.clip(feet, start, end)]))
        from_curve = _largest(lambda u: np.abs(self.signed_distance(curve.position(u))), stops)
        shares = np.arange(self.vertices.shape[0] + 1.0)
        from_outline = _largest(lambda share: np.abs(curve.signed_distance(self._along(share))), shares)
        return max(from_curve, from_outline)

    @cached_property
    def _rows(self) -> Array:
        return for_kernels(self.vertices)

    def _along(self, share: Array) -> Array:
        edge = np.minimum(share.astype(np.int64), self.vertices.shape[0] - 1)
        return np.asarray(self.vertices[edge] + (share - edge)[:, np.newaxis] * self.edges[edge])

    def _nearest(self, points: ArrayLike) -> tuple[IntArray, Array, Array, Array]:
        return polygon_kernels.nearest_many(self._rows, self.tree, checked_points(points))


def _largest(value: Callable[[Array], Array], stops: Array) -> float:
    """The largest value of a function smooth between `stops`: eight samples each, then golden sections."""
    cuts = 8
    step = np.diff(stops)[:, np.newaxis]
    at = np.append((stops[:-1, np.newaxis] + step * np.arange(cuts) / cuts).ravel(), stops[-1])
    values = value(at)
    inner = values[1:-1]
    peaks = 1 + np.flatnonzero((inner >= values[:-2]) & (inner >= values[2:]))
    low, high = at[peaks - 1], at[peaks + 1]
    ratio = (np.sqrt(5.0) - 1.0) / 2.0
    largest = float(values.max())
    for _ in range(40):
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        value_left, value_right = value(left), value(right)
        largest = max(largest, float(np.max([value_left, value_right], initial=0.0)))
        rising = value_right > value_left
        low, high = np.where(rising, left, low), np.where(rising, high, right)
    return largest
