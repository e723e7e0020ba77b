"""A model as its signed distance on a grid: what chapter 5's mapping and voxel renderers hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.polygon import Polygon
from hapticeval.types import Array

MARGIN_CELLS = 3
"""Cells between the model's bounds and the edge of the grid."""


@dataclass(frozen=True, eq=False)
class LevelSet:
    """Signed distance `values` (ny, nx), m, at the equally spaced nodes `x` (nx,) and `y` (ny,), bilinear between."""

    x: Array
    y: Array
    values: Array

    @property
    def cell(self) -> float:
        """The larger side of a cell (m)."""
        return max(float((nodes[-1] - nodes[0]) / (nodes.size - 1)) for nodes in (self.x, self.y))

    def without_islands(self) -> LevelSet:
        """Return the same with an inside of one piece, the largest, and no holes: self if it is so already.

        A tip or slit that is narrower than the diagonal of a cell may have nodes in it that no sides of cells join to
        the rest, by how the model lies on the grid.

        The sign of such nodes is changed, their distance kept. Nodes that are joined across a cell only count as apart:
        a contour through the middle of such a cell may touch itself.
        """
        from scipy import ndimage

        inside = self.values <= 0.0
        parts, count = ndimage.label(inside)
        if count == 0:
            return self
        # label 0 is the outside
        largest = 1 + int(np.argmax(np.bincount(parts.ravel())[1:]))
        solid = ndimage.binary_fill_holes(parts == largest)
        if np.array_equal(solid, inside):
            return self
        # a node whose sign changes must not stay at zero
        distance = np.maximum(np.abs(self.values), 1e-9 * self.cell)
        return LevelSet(self.x, self.y, np.where(solid == inside, self.values, np.where(solid, -distance, distance)))

    def contour(self) -> Polygon:
        """Return the zero set as a polygon.

        Raises `InputError` if it is not one closed curve: the grid is too coarse for a thin part, or does not
        cover the model.
        """
        import contourpy

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
        repeated = np.hypot(*(outline[1:] - outline[:-1]).T) <= 1e-9 * self.cell
        outline = outline[:-1][~repeated]
        # the shoelace formula about a corner: negative for a clockwise outline
        x, y = (outline - outline[0]).T
        if np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0.0:
            outline = outline[::-1]
        return Polygon(outline)


def sample_level_set(boundary: Boundary, shape: tuple[int, int]) -> LevelSet:
    """Return the exact signed distance of a plane boundary at `shape` = (nx, ny) nodes over its bounds and a margin.

    Raises `InputError` for a grid too small to have an inside of at least one cell.
    """
    # margins on both sides and one cell
    fewest = 2 * MARGIN_CELLS + 2
    if len(shape) != 2 or min(shape) < fewest:
        raise InputError(f"a level set of {shape} nodes", why=f"it needs at least {fewest} each way")
    xmin, ymin, xmax, ymax = boundary.bounds
    x, y = _grid_nodes(xmin, xmax, shape[0]), _grid_nodes(ymin, ymax, shape[1])
    points = np.column_stack([array.ravel() for array in np.meshgrid(x, y)])
    return LevelSet(x, y, boundary.signed_distance(points).reshape(y.size, x.size))


def _grid_nodes(low: float, high: float, count: int) -> Array:
    """Return `count` equal steps (count,), m, from MARGIN_CELLS before `low` to as many beyond `high`."""
    step = (high - low) / (count - 1 - 2 * MARGIN_CELLS)
    return np.asarray(low + step * (np.arange(count) - MARGIN_CELLS))
