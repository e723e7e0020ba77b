"""A look-up table of a projection without memory (thesis 6.2): IHIP and normal at the nodes of a uniform grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hapticeval.errors import InputError
from hapticeval.renderers.lut_kernels import TOUCHES, look_up, look_up_3d, look_up_many
from hapticeval.types import Array, BoolArray, ByteArray

CELL = 0.5e-3
"""Side of a cell (m) in the thesis's experiments (6.2)."""

IN_MEMORY = 2 << 30
"""The most bytes that a table may take."""


@dataclass(frozen=True)
class Grid:
    """Where the nodes are: from `origin` (m) on, every `cell` (m), with so many `cells` along x, y, (z)."""

    origin: tuple[float, ...]
    cell: float
    cells: tuple[int, ...]

    @property
    def dimension(self) -> int:
        """N, 2 or 3."""
        return len(self.cells)

    @property
    def node_bytes(self) -> int:
        """What the nodes take, end nodes counted: 16 N bytes each, an IHIP and a normal of N doubles (6.2)."""
        return 16 * self.dimension * math.prod(count + 1 for count in self.cells)

    @property
    def cell_bytes(self) -> int:
        """What the cells take: one byte each, for what (6.2) leaves out."""
        return math.prod(self.cells)


def grid_over(lower: Sequence[float], upper: Sequence[float], cell: float = CELL) -> Grid:
    """The grid that covers a box (m) and a margin of one cell.

    Raises `InputError` for a cell that is not positive and finite, or larger than the box.
    """
    extents = [high - low for low, high in zip(lower, upper, strict=True)]
    if not (math.isfinite(cell) and 0.0 < cell <= max(extents)):
        raise InputError(
            f"a look-up table with cells of {cell!r} m",
            why=f"the side of a cell must be positive and at most the model's size, {max(extents):.6g} m",
            todo=f"choose a cell such as the thesis's {CELL:g} m",
        )
    counts = tuple(math.ceil(round(extent / cell, 9)) + 2 for extent in extents)
    return Grid(tuple(float(low) - cell for low in lower), float(cell), counts)


@dataclass(frozen=True, eq=False)
class Table:
    """IHIPs and normals at the nodes of `grid`, and a byte a cell, as `lut_kernels` describes them.

    `nodes` are (..., ny, nx, 2N) and `cells` (..., ny - 1, nx - 1). With `everywhere` every HIP is in contact
    (bilateral). `standoff` (m) is the largest distance off the surface that was measured of an interpolated IHIP.
    Raises `InputError` for arrays that do not fit the grid.
    """

    grid: Grid
    nodes: Array
    cells: ByteArray
    everywhere: bool = False
    standoff: float = 0.0

    def __post_init__(self) -> None:
        cells = self.grid.cells[::-1]
        nodes = (*(count + 1 for count in cells), 2 * self.grid.dimension)
        if self.grid.dimension not in (2, 3) or self.nodes.shape != nodes or self.cells.shape != cells:
            raise InputError(
                f"a look-up table with nodes of shape {self.nodes.shape} and cells of shape {self.cells.shape}",
                why=f"a grid of {self.grid.cells} cells has {nodes} and {cells}",
            )

    @property
    def nbytes(self) -> int:
        """The memory that nodes and cells take, as measured on the arrays."""
        return self.nodes.nbytes + self.cells.nbytes

    def look(self, x: float, y: float, *, ask: bool) -> tuple[int, float, float, float, float]:
        """One HIP in the plane: (status, IHIP x, y, normal x, y), see `lut_kernels.look_up`."""
        nodes, cells, frame = self._arrays
        return look_up(nodes, cells, frame, self.everywhere, ask, x, y)

    def look_many(self, hips: Array, *, ask: bool) -> tuple[Array, Array, ByteArray]:
        """`look` for each row of hips (n, 2): IHIPs, normals, status."""
        nodes, cells, frame = self._arrays
        return look_up_many(nodes, cells, frame, self.everywhere, ask, hips)

    def answers(self, hips: Array) -> tuple[Array, Array, BoolArray]:
        """IHIPs (n, N), normals (n, N) and contact (n,) for hips (n, N), m, from the table alone.

        A HIP off the grid is in free space. In a marked cell the nearest node answers: a point of the surface.
        """
        hips = np.ascontiguousarray(hips, dtype=np.float64)
        if hips.ndim != 2 or hips.shape[1] != self.grid.dimension:
            raise InputError(
                f"HIPs of shape {hips.shape} for a table of {self.grid.dimension} dimensions",
                why=f"they must be rows of {self.grid.dimension} numbers",
            )
        if self.grid.dimension == 2:
            ihips, normals, status = self.look_many(hips, ask=False)
        else:
            nodes, cells, frame = self._arrays
            ihips, normals, status = look_up_3d(nodes, cells, frame, self.everywhere, hips)
        return ihips, normals, status == TOUCHES

    @cached_property
    def _arrays(self) -> tuple[Array, ByteArray, Array]:
        """Nodes, cells and frame, all read-only and plain: the loops are then compiled for one type."""
        frame = np.array([*self.grid.origin, 1.0 / self.grid.cell])
        nodes, cells = self.nodes.view(np.ndarray), self.cells.view(np.ndarray)
        for array in (nodes, cells, frame):
            array.flags.writeable = False
        return nodes, cells, frame


def empty(grid: Grid, *, everywhere: bool = False) -> Table:
    """A table that is free space throughout, to be filled.

    Raises `InputError` for a grid that needs more than 2 GiB.
    """
    if grid.node_bytes + grid.cell_bytes > IN_MEMORY:
        raise InputError(
            f"a look-up table of {grid.node_bytes + grid.cell_bytes:.3g} bytes",
            why=f"cells of {grid.cell:g} m make {grid.cell_bytes:.3g} of them; at most 2 GiB are held in memory",
            todo="choose a larger cell",
        )
    shape = grid.cells[::-1]
    nodes = np.zeros((*(count + 1 for count in shape), 2 * grid.dimension))
    return Table(grid, nodes, np.zeros(shape, np.uint8), everywhere)
