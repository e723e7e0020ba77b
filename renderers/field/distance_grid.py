"""The signed distance of a model, sampled on a grid of cubes and interpolated between its nodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.boundary import Boundary
from hapticeval.types import Array

MARGIN = 3
"""Cells between the model's bounds and the edge of the grid."""
BATCH = 65_536
"""Nodes whose distance is asked for at once."""


class DistanceGrid:
    """phi(p) and its gradient, exact for the multilinear interpolant of the nodes: `cell` (m) is a.

    Between nodes phi is off by O(a^2) where the distance is smooth, and by O(a) at its medial axis, which is smeared
    over a cell. Beyond the grid is free space. Raises `InputError` for fewer than eight nodes along the longest side,
    and `RefusalError` for an unbounded model.
    """

    def __init__(self, boundary: Boundary, nodes: int) -> None:
        if nodes < 8:
            raise InputError(f"a grid of {nodes} nodes", why="it needs an inside and a margin", todo="give 8 or more")
        if not boundary.closed:
            raise RefusalError(
                f"model '{boundary.name}' is unbounded", why="a grid covers a bounded area", todo="use implicit@exact"
            )
        low, high = np.reshape(boundary.bounds, (2, boundary.dimension))
        self.cell = float((high - low).max()) / (nodes - 1 - 2 * MARGIN)
        counts = np.ceil((high - low) / self.cell).astype(np.int64) + 1 + 2 * MARGIN
        # the middle of the grid is the model's, so that a mirrored model has a mirrored grid
        self.origin = 0.5 * (low + high) - 0.5 * self.cell * (counts - 1)
        axes = [start + self.cell * np.arange(count) for start, count in zip(self.origin, counts, strict=True)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, boundary.dimension)
        parts = [boundary.signed_distance(points[start : start + BATCH]) for start in range(0, len(points), BATCH)]
        self.values, self._last = np.concatenate(parts).reshape(counts), counts - 1

    def __call__(self, point: Array) -> tuple[float, Array]:
        """Return phi (m) and grad phi (N,) at a point (N,), m."""
        place = (np.asarray(point, dtype=np.float64) - self.origin) / self.cell
        inside = np.minimum(np.maximum(place, 0.0), self._last)
        first = np.minimum(inside.astype(np.int64), self._last - 1)
        around = self.values[tuple(slice(start, start + 2) for start in first.tolist())]
        value, slopes = _between(around.tolist(), (inside - first).tolist())
        # off the grid the nearest value, and as far beyond it as the point is
        off = place - inside
        off_distance = math.sqrt(off @ off)
        if off_distance > 0.0:
            return value + self.cell * off_distance, off / off_distance
        return value, np.array(slopes) / self.cell


def _between(nodes: Any, shares: Sequence[float]) -> tuple[float, list[float]]:
    """Return the multilinear interpolant of the nodes (2, ..., 2) of a cell, and its slopes along the axes a cell."""
    if not shares:
        return nodes, []
    share, others = shares[0], shares[1:]
    (low, low_slopes), (high, high_slopes) = _between(nodes[0], others), _between(nodes[1], others)
    slopes = [one + share * (two - one) for one, two in zip(low_slopes, high_slopes, strict=True)]
    return low + share * (high - low), [high - low, *slopes]
