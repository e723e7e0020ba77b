"""A look-up table of a projection without memory (thesis 6.2): IHIP and normal at the nodes of a uniform grid.

Compiled look-ups in tables of IHIPs and normals: bilinear in the plane, trilinear in space.

A table is `nodes` (..., y, x, 2N), IHIP and outward unit normal interleaved; `cells` (..., y, x), one byte a cell; and
`frame` (N + 1,): the first node (m), and one over the cell's side (1/m). A byte of `cells` says how the cell between
its nodes is read:

    FREE         outside: no contact anywhere in it
    HELD         contact everywhere in it
    EDGE         the surface may pass: contact where the HIP is behind the plane of IHIP and normal
    + MARKED     the projection breaks in it: never interpolated
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.errors import InputError
from hapticeval.types import Array, BoolArray, ByteArray

FREE, HELD, EDGE, MARKED = 0, 1, 2, 4

BLOCK = 512
"""HIPs that are looked up together."""

OUT, TOUCHES, ASK = 0, 1, 2
"""Status of an answer: in free space, in contact, to be asked of the exact projection."""


@compiled
def look_up(
    nodes: Array, cells: ByteArray, frame: Array, everywhere: bool, ask: bool, x: float, y: float
) -> tuple[int, float, float, float, float]:
    """One HIP (m): (status, IHIP x, y, normal x, y). Free answers hold the HIP and a zero normal.

    A marked cell answers ASK with `ask`, else with the node that is nearest to the HIP: a surface point and its own
    normal, whatever the neighbours say. Off the grid is free, or, in a table that answers `everywhere`, treated as
    marked.
    """
    rows, columns = cells.shape
    a, b = (x - frame[0]) * frame[2], (y - frame[1]) * frame[2]
    if 0.0 <= a <= columns and 0.0 <= b <= rows:
        i, j = min(np.uint64(np.int64(a)), np.uint64(columns - 1)), min(np.uint64(np.int64(b)), np.uint64(rows - 1))
        kind = cells[j, i]
    elif everywhere and a == a and b == b:
        a, b = min(max(a, 0.0), float(columns)), min(max(b, 0.0), float(rows))
        i, j = min(np.uint64(np.int64(a)), np.uint64(columns - 1)), min(np.uint64(np.int64(b)), np.uint64(rows - 1))
        kind = np.uint8(HELD + MARKED)
    else:
        return OUT, x, y, 0.0, 0.0
    if kind == FREE:
        return OUT, x, y, 0.0, 0.0
    a, b = a - np.int64(i), b - np.int64(j)
    if kind < MARKED:
        px, py, nx, ny = _bilinear(nodes, i, j, a, b)
    elif ask:
        return ASK, x, y, 0.0, 0.0
    else:
        i, j = i + np.uint64(a > 0.5), j + np.uint64(b > 0.5)
        px, py, nx, ny = nodes[j, i, 0], nodes[j, i, 1], nodes[j, i, 2], nodes[j, i, 3]
    if kind & EDGE and not (x - px) * nx + (y - py) * ny < 0.0:
        return OUT, x, y, 0.0, 0.0
    return TOUCHES, px, py, nx, ny


@compiled
def look_up_many(
    nodes: Array, cells: ByteArray, frame: Array, everywhere: bool, ask: bool, hips: Array
) -> tuple[Array, Array, ByteArray]:
    """`look_up` for each row of hips (n, 2): IHIPs (n, 2), normals (n, 2), status (n,).

    A block at a time: first the cells of its HIPs, without a branch that chance decides; then all that is interpolated,
    in a row; what is left to the nearest node, last.
    """
    count, (rows, columns) = hips.shape[0], cells.shape
    ihips, normals = np.empty_like(hips), np.empty_like(hips)
    status = np.empty(count, np.uint8)
    x0, y0, per = frame[0], frame[1], frame[2]
    last_column, last_row = np.uint64(columns - 1), np.uint64(rows - 1)
    which, across, up = np.empty(BLOCK, np.uint64), np.empty(BLOCK, np.uint64), np.empty(BLOCK, np.uint64)
    right, above, kinds = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK, np.uint8)
    for start in range(0, count, BLOCK):
        held = np.uint64(0)
        for k in range(start, min(start + BLOCK, count)):
            x, y = hips[k, 0], hips[k, 1]
            a, b = (x - x0) * per, (y - y0) * per
            ihips[k, 0], ihips[k, 1], normals[k, 0], normals[k, 1] = x, y, 0.0, 0.0
            if 0.0 <= a <= columns and 0.0 <= b <= rows:
                i, j = min(np.uint64(np.int64(a)), last_column), min(np.uint64(np.int64(b)), last_row)
                kind = cells[j, i]
                which[held], across[held], up[held], kinds[held] = np.uint64(k), i, j, kind
                right[held], above[held] = a - np.int64(i), b - np.int64(j)
                held += np.uint64((kind != FREE) & (kind < MARKED))
                status[k] = (kind >> 1) & ASK
            else:
                status[k] = ASK if everywhere else OUT
        for q in range(held):
            m = which[q]
            px, py, nx, ny = _bilinear(nodes, across[q], up[q], right[q], above[q])
            if kinds[q] == HELD or (hips[m, 0] - px) * nx + (hips[m, 1] - py) * ny < 0.0:
                ihips[m, 0], ihips[m, 1], normals[m, 0], normals[m, 1] = px, py, nx, ny
                status[m] = TOUCHES
    if not ask or everywhere:
        for left in np.flatnonzero(status == ASK):
            status[left], ihips[left, 0], ihips[left, 1], normals[left, 0], normals[left, 1] = look_up(
                nodes, cells, frame, everywhere, ask, hips[left, 0], hips[left, 1]
            )
    return ihips, normals, status


@compiled
def _bilinear(nodes: Array, i: np.uint64, j: np.uint64, a: float, b: float) -> tuple[float, float, float, float]:
    """IHIP and unit normal at the shares (a, b) of cell (i, j): unsigned, so that no index counts from the end."""
    right, above = i + np.uint64(1), j + np.uint64(1)
    w00, w10, w01, w11 = (1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b
    px = w00 * nodes[j, i, 0] + w10 * nodes[j, right, 0] + w01 * nodes[above, i, 0] + w11 * nodes[above, right, 0]
    py = w00 * nodes[j, i, 1] + w10 * nodes[j, right, 1] + w01 * nodes[above, i, 1] + w11 * nodes[above, right, 1]
    nx = w00 * nodes[j, i, 2] + w10 * nodes[j, right, 2] + w01 * nodes[above, i, 2] + w11 * nodes[above, right, 2]
    ny = w00 * nodes[j, i, 3] + w10 * nodes[j, right, 3] + w01 * nodes[above, i, 3] + w11 * nodes[above, right, 3]
    size = 1.0 / math.sqrt(nx * nx + ny * ny)
    return px, py, nx * size, ny * size


@compiled
def look_up_3d(
    nodes: Array, cells: ByteArray, frame: Array, everywhere: bool, hips: Array
) -> tuple[Array, Array, ByteArray]:
    """The same in space, for each row of hips (n, 3); marked cells answer with their nearest node."""
    layers, rows, columns = cells.shape
    ihips, normals = hips.copy(), np.zeros_like(hips)
    status = np.zeros(hips.shape[0], np.uint8)
    mean = np.empty(6)
    for m in range(hips.shape[0]):
        a = (hips[m, 0] - frame[0]) * frame[3]
        b = (hips[m, 1] - frame[1]) * frame[3]
        c = (hips[m, 2] - frame[2]) * frame[3]
        on = 0.0 <= a <= columns and 0.0 <= b <= rows and 0.0 <= c <= layers
        if not on:
            if not everywhere or a != a or b != b or c != c:
                continue
            a, b, c = min(max(a, 0.0), columns), min(max(b, 0.0), rows), min(max(c, 0.0), layers)
        i, j, k = min(int(a), columns - 1), min(int(b), rows - 1), min(int(c), layers - 1)
        kind = cells[k, j, i] if on else np.uint8(HELD + MARKED)
        if kind == FREE:
            continue
        a, b, c = a - i, b - j, c - k
        if kind < MARKED:
            mean[:] = 0.0
            for corner in range(8):
                p, q, r = corner & 1, (corner >> 1) & 1, corner >> 2
                weight = (a if p else 1.0 - a) * (b if q else 1.0 - b) * (c if r else 1.0 - c)
                for column in range(6):
                    mean[column] += weight * nodes[k + r, j + q, i + p, column]
            mean[3:] /= math.sqrt(mean[3] ** 2 + mean[4] ** 2 + mean[5] ** 2)
        else:
            mean[:] = nodes[k + int(c > 0.5), j + int(b > 0.5), i + int(a > 0.5)]
        side = 0.0
        for axis in range(3):
            side += (hips[m, axis] - mean[axis]) * mean[3 + axis]
        if kind & EDGE and side >= 0.0:
            continue
        status[m] = TOUCHES
        ihips[m], normals[m] = mean[:3], mean[3:]
    return ihips, normals, status


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
    """IHIPs and normals at the nodes of `grid`, and a byte a cell, as the module describes them.

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
        """One HIP in the plane: (status, IHIP x, y, normal x, y), see `look_up`."""
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
