"""A model as a polygon: the representation that most renderers hold, with queries that grow as log n."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import line_pieces
from hapticeval.geometry.validate import checked_vertices
from hapticeval.types import Array


class Polygon(Curve):
    """A simple polygon: `vertices` (n, 2), m, anticlockwise; edge k runs from vertex k to the next.

    It is the curve of its edges. Raises `InputError` for vertices that are no such outline (see `checked_vertices`).
    """

    def __init__(self, vertices: ArrayLike) -> None:
        super().__init__("polygon", line_pieces(checked_vertices(vertices)), True)

    @property
    def vertices(self) -> Array:
        """The corners (n, 2), m; they cannot be written to."""
        return self.pieces[:, 3:5]

    @cached_property
    def edges(self) -> Array:
        """From each vertex to the next, (n, 2), m."""
        return np.asarray(np.roll(self.vertices, -1, axis=0) - self.vertices)

    @cached_property
    def resolution(self) -> float:
        """The longest edge (m)."""
        return float(np.max(np.hypot(self.edges[:, 0], self.edges[:, 1])))

    def standoff_from(self, curve: Curve) -> float:
        """Return the largest distance (m) between this outline and a closed curve's.

        Measured both ways, from a fine sampling whose peaks are then climbed to rounding.
        """
        start, end = curve.u_range
        feet = np.clip(curve.nearest(self.vertices), start, end)
        # between two stops the distance is smooth: corners, and feet of vertices, are kinks
        stops = np.unique(np.concatenate([[start, end], [corner.u for corner in curve.corners], feet]))
        shares = np.arange(self.vertices.shape[0] + 1.0)
        return max(
            # both ways: neither outline may have a part that the other is far from
            _largest_between(lambda u: np.abs(self.signed_distance(curve.position(u))), stops),
            _largest_between(lambda share: np.abs(curve.signed_distance(self._along(share))), shares),
        )

    def _along(self, share: Array) -> Array:
        """Return the points (n, 2), m, at shares (n,): edge number plus the share of that edge."""
        edge = np.minimum(share.astype(np.int64), self.vertices.shape[0] - 1)
        return np.asarray(self.vertices[edge] + (share - edge)[:, np.newaxis] * self.edges[edge])


def _largest_between(evaluate: Callable[[Array], Array], stops: Array) -> float:
    """Return the largest value of a function smooth between `stops` (n,): eight samples each, then golden sections."""
    cuts = 8
    step = np.diff(stops)[:, np.newaxis]
    positions = np.append((stops[:-1, np.newaxis] + step * np.arange(cuts) / cuts).ravel(), stops[-1])
    values = evaluate(positions)
    inner = values[1:-1]
    # each sample no lower than its neighbours brackets a maximum
    peaks = 1 + np.flatnonzero((inner >= values[:-2]) & (inner >= values[2:]))
    low, high = positions[peaks - 1], positions[peaks + 1]
    ratio = (np.sqrt(5.0) - 1.0) / 2.0
    largest = float(values.max())
    # 0.618^40 is 4e-9 of the bracket: the error of a maximum goes with its square
    for _ in range(40):
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        value_left, value_right = evaluate(left), evaluate(right)
        largest = max(largest, float(np.max([value_left, value_right], initial=0.0)))
        rising = value_right > value_left
        low, high = np.where(rising, left, low), np.where(rising, high, right)
    return largest
