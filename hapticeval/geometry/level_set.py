"""A model as its signed distance on a grid: what chapter 5's mapping and voxel renderers hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.errors import InputError
from hapticeval.geometry.validate import checked_points
from hapticeval.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from hapticeval.geometry.curve import Curve
    from hapticeval.geometry.polygon import Polygon

MARGIN = 3
"""Cells between the model's bounds and the edge of the grid."""


@dataclass(frozen=True, eq=False)
class LevelSet:
    """Signed distance `values` (ny, nx), m, at the nodes `x` (nx,) and `y` (ny,), bilinear between them.

    Raises `InputError` for arrays that do not fit together, nodes that are not equally spaced, or numbers
    that are not finite.
    """

    x: Array
    y: Array
    values: Array

    def __post_init__(self) -> None:
        for name in ("x", "y", "values"):
            array = np.array(getattr(self, name), dtype=np.float64, order="C")
            if not np.isfinite(array).all():
                raise InputError(f"level set: {name} holds a number that is not finite")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if self.x.ndim != 1 or self.y.ndim != 1 or self.values.shape != (self.y.size, self.x.size):
            raise InputError(
                f"level set: values of shape {self.values.shape} on {self.x.shape} by {self.y.shape} nodes",
                why="values are (ny, nx)",
            )
        for name, nodes in (("x", self.x), ("y", self.y)):
            steps = np.diff(nodes)
            if nodes.size < 2 or not np.all(steps > 0.0) or np.ptp(steps) > 1e-6 * steps.max():
                raise InputError(f"level set: the nodes in {name} do not increase by equal steps")

    @property
    def cell(self) -> float:
        """The larger side of a cell (m)."""
        return max(self._steps)

    def inside_grid(self, points: ArrayLike) -> BoolArray:
        """Whether each of points (n, 2) lies on the grid, where `value` and `gradient` answer."""
        px, py = checked_points(points).T
        return np.asarray((px >= self.x[0]) & (px <= self.x[-1]) & (py >= self.y[0]) & (py <= self.y[-1]))

    def value(self, points: ArrayLike) -> Array:
        """Interpolated signed distances (n,), m, at points (n, 2).

        Raises `InputError`, naming the row, for a point off the grid.
        """
        i, j, a, b = self._located(points)
        low = (1.0 - a) * self.values[j, i] + a * self.values[j, i + 1]
        high = (1.0 - a) * self.values[j + 1, i] + a * self.values[j + 1, i + 1]
        return np.asarray((1.0 - b) * low + b * high)

    def gradient(self, points: ArrayLike) -> Array:
        """Gradients (n, 2) of the interpolant at points (n, 2): near unit length, outward at the surface.

        Raises `InputError`, naming the row, for a point off the grid.
        """
        i, j, a, b = self._located(points)
        v = self.values
        dx, dy = self._steps
        along_x = (1.0 - b) * (v[j, i + 1] - v[j, i]) + b * (v[j + 1, i + 1] - v[j + 1, i])
        along_y = (1.0 - a) * (v[j + 1, i] - v[j, i]) + a * (v[j + 1, i + 1] - v[j, i + 1])
        return np.column_stack([along_x / dx, along_y / dy])

    def without_islands(self) -> LevelSet:
        """Return the same with an inside of one piece, the largest, and no holes: self if it is so already.

        A tip or slit that is narrower than the diagonal of a cell may have nodes in it that no sides of cells join to
        the rest, by how the model lies on the grid. The sign of such nodes is changed, their distance kept. Nodes that
        are joined across a cell only count as apart: a contour through the middle of such a cell may touch itself.
        """
        from scipy import ndimage

        inside = self.values <= 0.0
        parts, count = ndimage.label(inside)
        if count == 0:
            return self
        largest = 1 + int(np.argmax(np.bincount(parts.ravel())[1:]))
        whole = ndimage.binary_fill_holes(parts == largest)
        if np.array_equal(whole, inside):
            return self
        distance = np.maximum(np.abs(self.values), 1e-9 * self.cell)
        return LevelSet(self.x, self.y, np.where(whole == inside, self.values, np.where(whole, -distance, distance)))

    def contour(self) -> Polygon:
        """The zero set as a polygon.

        Raises `InputError` if it is not one closed curve: the grid is too coarse for a thin part, or does not
        cover the model.
        """
        import contourpy

        from hapticeval.geometry.polygon import Polygon

        lines = contourpy.contour_generator(self.x, self.y, self.values).lines(0.0)
        if len(lines) != 1:
            raise InputError(
                f"the zero set of the level set has {len(lines)} components",
                why="a model is bounded by one curve",
                todo=f"refine the grid: its cells are {self.cell:g} m",
            )
        outline = np.asarray(lines[0], dtype=np.float64)
        if not np.array_equal(outline[0], outline[-1]):
            raise InputError(
                "the zero set of the level set runs off the grid",
                why="a polygon encloses a bounded area",
                todo="use a bounded model, or a grid that covers all of it",
            )
        # a node that lies on the curve gives the same crossing for each of its cell sides
        close = np.hypot(*(outline[1:] - outline[:-1]).T) <= 1e-9 * self.cell
        outline = outline[:-1][~close]
        x, y = (outline - outline[0]).T
        if np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0.0:
            outline = outline[::-1]
        return Polygon(outline)

    @property
    def _steps(self) -> tuple[float, float]:
        return (
            float((self.x[-1] - self.x[0]) / (self.x.size - 1)),
            float((self.y[-1] - self.y[0]) / (self.y.size - 1)),
        )

    def _located(self, points: ArrayLike) -> tuple[IntArray, IntArray, Array, Array]:
        """Cell indices and shares within the cell, in x and y."""
        array = checked_points(points)
        off = np.flatnonzero(~self.inside_grid(array))
        if off.size:
            px, py = array[off[0]]
            raise InputError(
                f"row {off[0]}: the point ({px:g}, {py:g}) m lies off the grid",
                why=f"it covers {self.x[0]:g} to {self.x[-1]:g} and {self.y[0]:g} to {self.y[-1]:g} m",
                todo="ask inside_grid first",
            )
        dx, dy = self._steps
        across, up = (array[:, 0] - self.x[0]) / dx, (array[:, 1] - self.y[0]) / dy
        i = np.minimum(across.astype(np.int64), self.x.size - 2)
        j = np.minimum(up.astype(np.int64), self.y.size - 2)
        return i, j, across - i, up - j


def sampled(curve: Curve, shape: tuple[int, int]) -> LevelSet:
    """The exact signed distance of a curve at `shape` = (nx, ny) nodes over its bounds and a margin of three
    cells.

    Raises `InputError` for a grid too small to have an inside of at least one cell.
    """
    least = 2 * MARGIN + 2
    if len(shape) != 2 or min(shape) < least:
        raise InputError(f"a level set of {shape} nodes", why=f"it needs at least {least} each way")
    xmin, ymin, xmax, ymax = curve.bounds
    x, y = _nodes(xmin, xmax, shape[0]), _nodes(ymin, ymax, shape[1])
    points = np.column_stack([array.ravel() for array in np.meshgrid(x, y)])
    return LevelSet(x, y, curve.signed_distance(points).reshape(y.size, x.size))


def _nodes(low: float, high: float, count: int) -> Array:
    step = (high - low) / (count - 1 - 2 * MARGIN)
    return np.asarray(low + step * (np.arange(count) - MARGIN))
