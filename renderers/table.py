"""A look-up table of a projection without memory (thesis 6.2): IHIP and normal at the nodes of a uniform grid.

A table is `nodes` (..., y, x, 2N), IHIP and outward unit normal interleaved; `cells` (..., y, x), one byte a cell; and
`frame` (N + 1,): the first node (m), and one over the cell's side (1/m). A byte of `cells` says how the cell between
its nodes is read:

    FREE         outside: no contact anywhere in it
    HELD         contact everywhere in it
    EDGE         the surface may pass: contact where the HIP is behind the plane of IHIP and normal
    + MARKED     the projection breaks in it: never interpolated
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hapticeval.compiled import compiled, for_kernels
from hapticeval.errors import InputError, RefusalError
from hapticeval.types import Array, BoolArray, ByteArray

FREE, HELD, EDGE, MARKED = 0, 1, 2, 4

BLOCK = 512
"""HIPs that are looked up together."""

OUT, TOUCHES, ASK = 0, 1, 2
"""Status of an answer: in free space, in contact, to be asked of the exact projection."""


@compiled
def look_up(
    nodes: Array, cells: ByteArray, frame: Array, everywhere: bool, x: float, y: float
) -> tuple[int, float, float, float, float]:
    """Read the table at one HIP (x, y), m: (status, IHIP x, y, m, normal x, y).

    `nodes` (y, x, 4), `cells` (y, x) and `frame` (3,) are the module's. Answers that do not touch hold the HIP and a
    zero normal. A marked cell, and in a table that answers `everywhere` what is off the grid, is to be asked of the
    projection.
    """
    rows, columns = cells.shape
    a, b = (x - frame[0]) * frame[2], (y - frame[1]) * frame[2]  # in cells from the first node
    if not (0.0 <= a <= columns and 0.0 <= b <= rows):
        return ASK if everywhere and a == a and b == b else OUT, x, y, 0.0, 0.0
    i, j = min(np.uint64(np.int64(a)), np.uint64(columns - 1)), min(np.uint64(np.int64(b)), np.uint64(rows - 1))
    kind = cells[j, i]
    if kind == FREE or kind >= MARKED:
        return OUT if kind == FREE else ASK, x, y, 0.0, 0.0
    px, py, nx, ny = _bilinear(nodes, i, j, a - np.int64(i), b - np.int64(j))
    # a cell that the surface may pass: contact behind the plane of IHIP and normal only
    if kind == EDGE and not (x - px) * nx + (y - py) * ny < 0.0:
        return OUT, x, y, 0.0, 0.0
    return TOUCHES, px, py, nx, ny


@compiled
def look_up_many(
    nodes: Array, cells: ByteArray, frame: Array, everywhere: bool, hips: Array
) -> tuple[Array, Array, ByteArray]:
    """Read the table at HIPs (n, 2), m, as `look_up` does: IHIPs (n, 2), m, unit normals (n, 2), status (n,).

    `nodes` (y, x, 4), `cells` (y, x) and `frame` (3,) are the module's. A block at a time: first the cells of its HIPs,
    without a branch that chance decides; then all that is interpolated, in a row.
    """
    count, (rows, columns) = hips.shape[0], cells.shape
    ihips, normals = np.empty_like(hips), np.empty_like(hips)
    status = np.empty(count, np.uint8)
    x0, y0, per_metre = frame[0], frame[1], frame[2]
    last_column, last_row = np.uint64(columns - 1), np.uint64(rows - 1)
    hit_rows, across, up = np.empty(BLOCK, np.uint64), np.empty(BLOCK, np.uint64), np.empty(BLOCK, np.uint64)
    right, above, kinds = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK, np.uint8)
    for start in range(0, count, BLOCK):
        hit_count = np.uint64(0)
        for k in range(start, min(start + BLOCK, count)):
            x, y = hips[k, 0], hips[k, 1]
            a, b = (x - x0) * per_metre, (y - y0) * per_metre
            ihips[k, 0], ihips[k, 1], normals[k, 0], normals[k, 1] = x, y, 0.0, 0.0
            if 0.0 <= a <= columns and 0.0 <= b <= rows:
                i, j = min(np.uint64(np.int64(a)), last_column), min(np.uint64(np.int64(b)), last_row)
                kind = cells[j, i]
                hit_rows[hit_count], across[hit_count], up[hit_count], kinds[hit_count] = np.uint64(k), i, j, kind
                right[hit_count], above[hit_count] = a - np.int64(i), b - np.int64(j)
                # without a branch: a HIP that is not interpolated is written too, and overwritten by the next
                hit_count += np.uint64((kind != FREE) & (kind < MARKED))
                status[k] = (kind >> 1) & ASK
            else:
                status[k] = ASK if everywhere and a == a and b == b else OUT
        for hit in range(hit_count):
            row = hit_rows[hit]
            px, py, nx, ny = _bilinear(nodes, across[hit], up[hit], right[hit], above[hit])
            if kinds[hit] == HELD or (hips[row, 0] - px) * nx + (hips[row, 1] - py) * ny < 0.0:
                ihips[row, 0], ihips[row, 1], normals[row, 0], normals[row, 1] = px, py, nx, ny
                status[row] = TOUCHES
    return ihips, normals, status


@compiled
def look_up_in_space(
    nodes: Array, cells: ByteArray, frame: Array, everywhere: bool, hips: Array
) -> tuple[Array, Array, ByteArray]:
    """Read the table at HIPs (n, 3), m: IHIPs (n, 3), m, outward unit normals (n, 3) and status (n,).

    `nodes` (z, y, x, 6), `cells` (z, y, x) and `frame` (4,) are the module's; see `look_up`.
    """
    count, cell_counts, answer = hips.shape[0], cells.shape[::-1], np.empty(6)
    ihips, normals, status = hips.copy(), np.zeros_like(hips), np.zeros(count, np.uint8)
    cell, share = np.empty(3, np.int64), np.empty(3)
    for row in range(count):
        on_grid = True
        for axis in range(3):
            at = (hips[row, axis] - frame[axis]) * frame[3]
            on_grid = on_grid and 0.0 <= at <= cell_counts[axis]
            if on_grid:
                cell[axis] = min(np.int64(at), cell_counts[axis] - 1)
                share[axis] = at - cell[axis]
        if not on_grid:
            finite = not np.isnan(hips[row]).any()
            status[row] = ASK if everywhere and finite else OUT
            continue
        i, j, k = cell
        kind = cells[k, j, i]
        if kind == FREE or kind >= MARKED:
            status[row] = OUT if kind == FREE else ASK
            continue
        # IHIP (m) and normal at the HIP's shares of the cell
        answer[:] = 0.0
        for corner in range(8):  # trilinear: the bits of the number are the sides along x, y and z
            x, y, z = corner & 1, (corner >> 1) & 1, corner >> 2
            weight = share[0] if x else 1.0 - share[0]
            weight *= share[1] if y else 1.0 - share[1]
            weight *= share[2] if z else 1.0 - share[2]
            for axis in range(6):
                answer[axis] += weight * nodes[k + z, j + y, i + x, axis]
        normal_squared, behind = 0.0, 0.0
        for axis in range(3):
            normal_squared += answer[3 + axis] * answer[3 + axis]
            behind += (hips[row, axis] - answer[axis]) * answer[3 + axis]
        if kind == EDGE and not behind < 0.0:
            continue
        status[row] = TOUCHES
        for axis in range(3):
            ihips[row, axis], normals[row, axis] = answer[axis], answer[3 + axis] / math.sqrt(normal_squared)
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


CELL = {2: 0.5e-3, 3: 2e-3}
"""Side of a cell (m): in the plane that of the thesis's experiments (6.2), which in space makes 3 GB of 0.2 m cubed."""

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
    def nbytes(self) -> int:
        """What nodes and cells take: known before a table is made."""
        return self.node_bytes + self.cell_bytes

    @property
    def cell_bytes(self) -> int:
        """What the cells take: one byte each, for what (6.2) leaves out."""
        return math.prod(self.cells)


def grid_over(lower: Sequence[float], upper: Sequence[float], cell: float) -> Grid:
    """The grid that covers a box (m) and a margin of one cell.

    Raises `InputError` for a cell that is not positive and finite, and `RefusalError` for one larger than the box.
    """
    extents = [high - low for low, high in zip(lower, upper, strict=True)]
    if not (math.isfinite(cell) and cell > 0.0):
        raise InputError(
            f"a look-up table with cells of {cell!r} m",
            why="the side of a cell must be positive",
            todo=f"choose a cell such as {CELL[len(extents)]:g} m",
        )
    if cell > max(extents):
        raise RefusalError(
            f"a look-up table with cells of {cell:g} m",
            why=f"they are larger than the model, {max(extents):.6g} m",
            todo="choose a smaller cell",
        )
    # cells that cover the box to a rounding of nine digits, and one more on either side
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

    def look(self, x: float, y: float) -> tuple[int, float, float, float, float]:
        """One HIP in the plane: (status, IHIP x, y, normal x, y), see `look_up`."""
        return look_up(*self._arrays, self.everywhere, x, y)

    def look_many(self, hips: Array) -> tuple[Array, Array, ByteArray]:
        """Read the table at HIPs (n, N), m, in plane or space: IHIPs (n, N), m, unit normals (n, N), status (n,)."""
        look_up = look_up_many if self.grid.dimension == 2 else look_up_in_space
        return look_up(*self._arrays, self.everywhere, for_kernels(hips))

    def answers(self, hips: Array) -> tuple[Array, Array, BoolArray]:
        """IHIPs (n, N), normals (n, N) and contact (n,) for hips (n, N), m, from the table alone, in plane and space.

        A HIP off the grid is in free space, or, `everywhere`, taken as that of the nearest cell. In a marked cell the
        nearest node answers: a point of the surface.
        """
        hips = np.ascontiguousarray(hips, dtype=np.float64)
        n = self.grid.dimension
        if hips.ndim != 2 or hips.shape[1] != n:
            raise InputError(
                f"HIPs of shape {hips.shape} for a table of {n} dimensions",
                why=f"they must be rows of {n} numbers",
            )
        cell_counts = np.array(self.grid.cells)
        grid_coordinates = (hips - self.grid.origin) / self.grid.cell
        on_grid = np.all((grid_coordinates >= 0.0) & (grid_coordinates <= cell_counts), axis=1)
        clipped = np.clip(np.nan_to_num(grid_coordinates), 0.0, cell_counts)
        cell = np.minimum(clipped.astype(np.int64), cell_counts - 1)
        share, kinds = clipped - cell, self.cells[tuple(cell.T[::-1])]
        kinds = np.where(on_grid, kinds, HELD + MARKED if self.everywhere else FREE)
        # in a marked cell the nearest node alone
        share = np.where((kinds >= MARKED)[:, np.newaxis], share > 0.5, share)
        answer = np.zeros((len(hips), 2 * n))
        for corner in itertools.product((0, 1), repeat=n):
            weight = np.prod(np.where(corner, share, 1.0 - share), axis=1)
            answer += weight[:, np.newaxis] * self.nodes[tuple((cell + corner).T[::-1])]
        ihips, normals = answer[:, :n], answer[:, n:]
        with np.errstate(invalid="ignore"):
            normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        behind = np.sum((hips - ihips) * normals, axis=1) < 0.0
        contact = (kinds != FREE) & (behind | (kinds & EDGE == 0)) & ~np.isnan(hips).any(axis=1)
        return np.where(contact[:, None], ihips, hips), np.where(contact[:, None], normals, 0.0), contact

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

    Raises `RefusalError` for a grid that needs more than 2 GiB.
    """
    if grid.nbytes > IN_MEMORY:
        # the bytes grow as cell^-N
        fits = grid.cell * (grid.nbytes / IN_MEMORY) ** (1.0 / grid.dimension)
        raise RefusalError(
            f"a look-up table of {grid.nbytes:.3g} bytes",
            why=f"cells of {grid.cell:g} m make {grid.cell_bytes:.3g} of them; at most 2 GiB are held in memory",
            todo=f"choose a larger cell: {1.05 * fits:.2g} m fits",
        )
    shape = grid.cells[::-1]
    nodes = np.zeros((*(count + 1 for count in shape), 2 * grid.dimension))
    return Table(grid, nodes, np.zeros(shape, np.uint8), everywhere)
