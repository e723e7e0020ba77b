"""Any projection without memory as a look-up table (thesis 6.2), the representation `@lut`: looking up, and filling.

A table is `nodes` (..., y, x, 2N), IHIP and outward unit normal interleaved; `cells` (..., y, x), one byte a cell; and
`frame` (2N + 1,): the first node (m), one over the cell's side (1/m), and the cells along x, y, (z). A byte of `cells`
says how the cell between its nodes is read:

    FREE         outside: no contact anywhere in it
    HELD         contact everywhere in it
    BORDER       the surface may pass: contact where the HIP is behind the plane of IHIP and normal
    + MARKED     the projection breaks in it: never interpolated

Filling a table also finds the cells that must not be interpolated.

A cell is marked where one of four rules says so.

1. The projection jumps across it. Where minimum distance is smooth it stretches distances by 1 / (1 - kappa d) at the
   most, at depth d under curvature kappa; a transformation stretches by its own factor. A side of a cell whose ends
   have IHIPs more than `STRETCH` sides apart is bisected `BISECTIONS` times, always on into the half with the larger
   difference. A map that is Hoelder continuous of order p brings that down by 2^-p at each bisection, a jump not at
   all: below order `ORDER` it is a jump, and every cell with that side is marked.
2. The interpolated IHIP leaves the surface. Of nodes that lie on one arc of length l, which turns by t, no mean lies
   further off than about l t / 4. Where that exceeds `OFF` sides of a cell the distance is measured at 5^N points, and
   the cell marked if it does exceed it.
3. The projection is too steep to be interpolated: a side is stretched by more than `STRETCH`, and the interpolated
   IHIP in the middle of the cell is more than `AMISS` sides off the projection's own.
4. Two of its normals are more than a right angle apart: then a mean of them may vanish, else none is shorter than
   2^(-N/2). In a cell that the surface may pass, where IHIP and normal also decide the contact, `TURN` is enough.

What the rules cannot see: a discontinuity that enters a cell and leaves it by one and the same side without parting two
nodes, or ends inside of it.

The nodes are then on one sheet of the projection, and what is interpolated is that sheet: a point of the surface, where
the jump is displaced by less than a cell.

Jumps under `STRETCH` sides are interpolated too, as long as they stay within the other rules.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from hapticeval.compiled import borrowing, compiled, for_kernels
from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import as_curve
from hapticeval.geometry.polygon_kernels import signed_distances
from hapticeval.laws import law_value
from hapticeval.records import as_record
from hapticeval.renderers.outline import outline_of
from hapticeval.renderers.potential import POTENTIAL, potential_record, stretch_at
from hapticeval.renderers.projective import Projection, once
from hapticeval.renderers.regulation import GRADIENT
from hapticeval.renderers.regulation_kernel import FIRST_OWN, GAINS, PAST, regulate, release
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, ByteArray

FREE, HELD, BORDER, MARKED = 0, 1, 2, 4

OUT, TOUCHES, ASK = 0, 1, 2
"""Status of an answer: in free space, in contact, to be asked of the exact projection."""


class TableArrays(NamedTuple):
    """A table as the loops take it: nodes (k, 2N) and cells (c,) in rows, x first, `frame` (2N + 1,) of the module.

    `everywhere` is that of a `Table`.
    """

    nodes: Array
    cells: ByteArray
    frame: Array
    everywhere: bool


@borrowing
def look_up(table: TableArrays, hip: Array, ihip: Array, normal: Array) -> int:
    """Read the table at one HIP (N,), m: write IHIP (N,), m, and outward unit normal (N,), and return the status.

    An answer that does not touch leaves nothing of use in both. A marked cell, and in a table that answers `everywhere`
    what is off the grid, is to be asked of the projection.
    """
    size, frame = hip.shape[0], table.frame
    first_node, cell, node_stride, cell_stride = np.int64(0), np.int64(0), np.int64(1), np.int64(1)
    a, b, c = 0.0, 0.0, 0.0  # shares of the cell along x, y and z
    row_nodes, layer_nodes = np.int64(0), np.int64(0)
    for axis in range(size):
        count = np.int64(frame[size + 1 + axis])
        at = (hip[axis] - frame[axis]) * frame[size]  # in cells from the first node
        if not 0.0 <= at <= count:
            finite = True
            for i in range(size):
                finite = finite and hip[i] == hip[i]
            return ASK if table.everywhere and finite else OUT
        index = min(np.int64(at), count - 1)
        if axis == 0:
            a, row_nodes = at - index, count + 1
        elif axis == 1:
            b, layer_nodes = at - index, row_nodes * (count + 1)
        else:
            c = at - index
        cell += cell_stride * index
        first_node += node_stride * index
        cell_stride *= count
        node_stride *= count + 1
    kind = table.cells[cell]
    if kind == FREE or kind >= MARKED:
        return OUT if kind == FREE else ASK
    for i in range(size):
        ihip[i] = normal[i] = 0.0
    for corner in range(1 << size):  # bilinear or trilinear: the bits of the number are the sides along x, y and z
        weight, node = (a if corner & 1 else 1.0 - a) * (b if corner & 2 else 1.0 - b), first_node
        if size == 3:
            weight *= c if corner & 4 else 1.0 - c
        node += (corner & 1) + row_nodes * ((corner >> 1) & 1) + layer_nodes * ((corner >> 2) & 1)
        for i in range(size):
            ihip[i] += weight * table.nodes[node, i]
            normal[i] += weight * table.nodes[node, size + i]
    normal_squared, height = 0.0, 0.0
    for i in range(size):
        normal_squared += normal[i] * normal[i]
        height += (hip[i] - ihip[i]) * normal[i]
    # a cell that the surface may pass: contact behind the plane of IHIP and normal only
    if kind == BORDER and not height < 0.0:
        return OUT
    unit = 1.0 / math.sqrt(normal_squared)
    for i in range(size):
        normal[i] *= unit
    return TOUCHES


@compiled
def look_up_rows(table: TableArrays, hips: Array) -> tuple[Array, Array, ByteArray]:
    """Read the table at HIPs (n, N), m: IHIPs (n, N), m, unit normals (n, N) and status (n,), as `look_up`.

    Where a HIP does not touch, the IHIP is the HIP and the normal zero.
    """
    ihips, normals, status = np.empty_like(hips), np.empty_like(hips), np.empty(hips.shape[0], np.uint8)
    for row in range(hips.shape[0]):
        status[row] = look_up(table, hips[row], ihips[row], normals[row])
        if status[row] != TOUCHES:
            for i in range(hips.shape[1]):
                ihips[row, i], normals[row, i] = hips[row, i], 0.0
    return ihips, normals, status


class LutData(NamedTuple):
    """What a law on a table works on: its gains and state, the table, and the law of the projection that is tabulated.

    That law is asked without gains: of its answer only the IHIP and the normal count.
    """

    params: Array
    state: Array
    table: TableArrays
    exact_law: Callable[..., int]
    exact: Any


@borrowing
def follow_table(data: LutData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array) -> int:
    """One tick on a table, of signature `LAW` but for its data: IHIP (6.2), then the scheme's force.

    `hip` (N,), m, and `velocity` (N,), m/s, are the hand's; `ihip` (N,), m, and `force` (N,), N, are written.
    Returns 0.
    """
    params, state, normal = data.params, data.state, as_record(data.state, PAST).normal
    status = look_up(data.table, hip, ihip, normal)
    if status == ASK:
        exact_past = as_record(data.exact.state, PAST)
        data.exact_law(data.exact, hip, velocity, push, dt, ihip, force)
        status = TOUCHES if exact_past.in_contact != 0.0 else OUT
        for i in range(hip.shape[0]):
            normal[i] = exact_past.normal[i]
    if status != TOUCHES:
        return release(state, hip, ihip, force)
    stretch = 0.0
    if as_record(params, GAINS).scheme == GRADIENT:
        stretch = stretch_at(as_record(params, POTENTIAL, FIRST_OWN), hip, ihip, normal)
    return regulate(params, state, hip, velocity, 0.0, stretch, dt, ihip, force)


CELL_SIDES = {2: 0.5e-3, 3: 2e-3}
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
            todo=f"choose a cell such as {CELL_SIDES[len(extents)]:g} m",
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

    def look_up(self, hips: Array) -> tuple[Array, Array, ByteArray]:
        """Read the table at HIPs (n, N), m, in plane or space: IHIPs (n, N), m, unit normals (n, N), status (n,)."""
        return look_up_rows(self.arrays, for_kernels(hips))

    @cached_property
    def arrays(self) -> TableArrays:
        """The table as the loops take it: of the memory that it has."""
        frame = np.array([*self.grid.origin, 1.0 / self.grid.cell, *self.grid.cells])
        nodes = self.nodes.view(np.ndarray).reshape(-1, 2 * self.grid.dimension)
        return TableArrays(nodes, self.cells.view(np.ndarray).reshape(-1), frame, self.everywhere)


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


STRETCH = 2.0
BISECTIONS = 10
ORDER = 0.2
OFF = 0.05
AMISS = 0.1
TURN = 0.5
"""The numbers of the rules above: lengths in sides of a cell, `TURN` the length of a difference of unit normals."""

PROBES = 5
PROBED_RAISE = 4.0 / 3.0
"""A probed maximum is raised by this much: where nodes lie on both faces of a corner the distance rises to a ridge in
the cell as on a roof, and the next probe may be a quarter of the way down."""

SLAB = 200_000
"""Nodes that are filled at a time."""

SAMPLED_BLOCK = 8
"""Nodes along the side of a block whose distance from the surface is asked for once, if it is far enough."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """What is tabulated, for any number of dimensions: both functions take points (n, N), m, on either side.

    `project` gives IHIPs (n, N) and outward unit normals (n, N); `distance` the signed distance (n,), m, from the
    surface, or from one that strays from it by no more than `stray` (m).
    """

    project: Callable[[Array], tuple[Array, Array]]
    distance: Callable[[Array], Array]
    stray: float = 0.0


def source_of(projection: Projection) -> Source:
    """Return what a table is filled from, of a projection without memory.

    It must be bilateral: cells at the surface have nodes outside.
    """

    def project(points: Array) -> tuple[Array, Array]:
        """Return the IHIPs (n, N), m, and normals (n, N) of points (n, N), m."""
        ihips, normals, _ = projection.trace(np.ascontiguousarray(points))
        return ihips, normals

    curve = as_curve(projection.surface)
    if curve is None:
        return Source(project=project, distance=projection.surface.signed_distance)
    outline = outline_of(curve)

    # the polygon of the chords is as good as the curve, to `stray`, and far cheaper
    def distance(points: Array) -> Array:
        """Return the signed distances (n,), m, of points (n, 2), m."""
        return signed_distances(outline.vertices, outline.tree, points)

    return Source(project=project, distance=distance, stray=outline.stray)


def grid_of(surface: Boundary, cell: float | None = None) -> Grid:
    """Return the grid of a table of a boundary: `grid_of(...).nbytes` is the memory that it takes.

    `cell` (m) is `CELL_SIDES` in the plane and in space where none is given. Raises as `grid_over` does.
    """
    bounds, dimension = surface.bounds, surface.dimension
    return grid_over(bounds[:dimension], bounds[dimension:], CELL_SIDES[dimension] if cell is None else cell)


def tabulate(projection: Projection, *, cell: float | None = None, everywhere: bool = False) -> Table:
    """The table of a bilateral projection over its surface and a margin of one cell.

    With `everywhere` it answers in contact throughout, else where the HIP is inside. Raises `InputError` as
    `grid_of` and `empty` do.
    """
    table = empty(grid_of(projection.surface, cell), everywhere=everywhere)
    return replace(table, standoff=fill(table, source_of(projection)))


def fill(table: Table, source: Source) -> float:
    """Fill a table, in slabs. Returns the largest distance (m) off the surface of what is interpolated in it."""
    high = table.grid.cells[::-1]
    across = int(np.prod([count + 1 for count in high[1:]]))
    thickness = max(1, SLAB // across)
    standoff = 0.0
    for start in range(0, high[0], thickness):
        low = (start, *(0 for _ in high[1:]))
        standoff = max(standoff, _fill_box(table, source, low, (min(start + thickness, high[0]), *high[1:])))
    return standoff


def _fill_box(table: Table, source: Source, low: tuple[int, ...], high: tuple[int, ...]) -> float:
    """One box of cells, `low` and `high` in the order of the arrays' axes."""
    dimension, side = table.grid.dimension, table.grid.cell
    counts = tuple(b - a + 1 for a, b in zip(low, high, strict=True))
    # nodes (..., y, x, N), m, by the indices of the whole grid
    axes = [side * np.arange(a, b + 1) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij")[::-1], axis=-1) + np.array(table.grid.origin)
    kinds = np.full(tuple(count - 1 for count in counts), HELD, np.uint8)
    needed = np.ones(counts, bool)
    if not table.everywhere:
        # no point of a cell is further than half its diagonal from a node
        reach = 0.5 * side * dimension**0.5 + source.stray
        distance = _distances(points, source, reach)
        near = _cells_with_a_corner(np.abs(distance) <= reach)
        kinds = np.where(
            near, np.uint8(BORDER), np.where(_cells_with_a_corner(distance < 0.0), np.uint8(HELD), np.uint8(0))
        )
        needed = _nodes_around(kinds != 0)
    answers = np.zeros((*counts, 2 * dimension))
    answers[needed] = np.concatenate(source.project(points[needed]), axis=1)
    marked, steep = _jumping_cells(points, answers[..., :dimension], needed, source, side)
    marked |= _misplaced(points, answers[..., :dimension], (kinds != 0) & steep & ~marked, source, AMISS * side)
    standoff, off = _cells_off_surface(answers, kinds, (kinds != 0) & ~marked, source, OFF * side)
    table.nodes[tuple(slice(a, b + 1) for a, b in zip(low, high, strict=True))][needed] = answers[needed]
    kinds = kinds + np.uint8(MARKED) * ((kinds != 0) & (marked | off))
    table.cells[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = kinds
    return standoff


def _distances(points: Array, source: Source, reach: float) -> Array:
    """The signed distance of each node (..., N), or, where both are beyond `reach`, a smaller one of the same sign."""
    shape, dimension = points.shape[:-1], points.shape[-1]
    # one distance a block: within it the surface is nearer by the way from its middle at the most
    middles = points[(slice(SAMPLED_BLOCK // 2, None, SAMPLED_BLOCK),) * dimension]
    if middles.size == 0:
        return source.distance(points.reshape(-1, dimension)).reshape(shape)
    block_distances = source.distance(middles.reshape(-1, dimension)).reshape(middles.shape[:-1])
    blocks = [
        np.minimum(np.arange(count) // SAMPLED_BLOCK, block_count - 1)
        for count, block_count in zip(shape, block_distances.shape, strict=True)
    ]
    middle, block_distance = middles[np.ix_(*blocks)], block_distances[np.ix_(*blocks)]
    lower_bound = np.abs(block_distance) - np.linalg.norm(points - middle, axis=-1) - 2.0 * source.stray
    distance: Array = np.copysign(lower_bound, block_distance)
    unsure = lower_bound <= reach
    distance[unsure] = source.distance(points[unsure])
    return distance


def _jumping_cells(
    points: Array, ihips: Array, needed: BoolArray, source: Source, side: float
) -> tuple[BoolArray, BoolArray]:
    """Rule 1: the cells of a box with a side across which the projection jumps, and with one that is stretched."""
    marked = np.zeros(tuple(count - 1 for count in needed.shape), bool)
    steep = np.zeros_like(marked)
    for axis in range(needed.ndim):
        low_ends, high_ends = _side_ends(needed.ndim, axis)
        span = np.linalg.norm(ihips[high_ends] - ihips[low_ends], axis=-1)
        suspect = needed[low_ends] & needed[high_ends] & (span > STRETCH * side)
        steep |= _cells_at_sides(suspect, axis)
        # rule 1: bisect the side into the half with the larger difference of IHIPs
        left, right = points[low_ends][suspect], points[high_ends][suspect]
        at_left, at_right = ihips[low_ends][suspect], ihips[high_ends][suspect]
        for _ in range(BISECTIONS):
            middle = 0.5 * (left + right)
            at_middle = source.project(middle)[0] if middle.size else middle
            left_half = np.linalg.norm(at_middle - at_left, axis=1) >= np.linalg.norm(at_right - at_middle, axis=1)
            chosen = left_half[:, np.newaxis]
            left, at_left = np.where(chosen, left, middle), np.where(chosen, at_left, at_middle)
            right, at_right = np.where(chosen, middle, right), np.where(chosen, at_middle, at_right)
        jumps = np.zeros(span.shape, bool)
        # a map of order ORDER would have brought the difference down to this
        jumps[suspect] = np.linalg.norm(at_right - at_left, axis=1) > 2.0 ** (-ORDER * BISECTIONS) * span[suspect]
        marked |= _cells_at_sides(jumps, axis)
    return marked, steep


def _cells_at_sides(sides: BoolArray, axis: int) -> BoolArray:
    """The cells with one of their sides along an axis where it is true: those on either hand along every other axis."""
    for other in range(sides.ndim):
        if other != axis:
            one, two = _side_ends(sides.ndim, other)
            sides = sides[one] | sides[two]
    return sides


def _misplaced(points: Array, ihips: Array, candidates: BoolArray, source: Source, limit: float) -> BoolArray:
    """Rule 3: the candidates whose interpolated IHIP in the middle is off by more than the limit."""
    amiss = np.zeros(candidates.shape, bool)
    if candidates.any():
        middles, means = (_corner_values(values)[:, candidates].mean(axis=0) for values in (points, ihips))
        amiss[candidates] = np.linalg.norm(source.project(middles)[0] - means, axis=1) > limit
    return amiss


def _cells_off_surface(
    answers: Array, kinds: ByteArray, candidates: BoolArray, source: Source, limit: float
) -> tuple[float, BoolArray]:
    """Rules 2 and 4: the largest measured distance off the surface that is within the limit, and the cells beyond."""
    off = np.zeros(candidates.shape, bool)
    corners = _corner_values(answers)[:, candidates]
    dimension = answers.shape[-1] // 2
    # the largest distance of two corners' IHIPs, m, and of their unit normals: l and t of rule 2
    length, turn = np.zeros(corners.shape[1]), np.zeros(corners.shape[1])
    for one, two in itertools.combinations(corners, 2):
        length = np.maximum(length, np.linalg.norm(one[:, :dimension] - two[:, :dimension], axis=1))
        turn = np.maximum(turn, np.linalg.norm(one[:, dimension:] - two[:, dimension:], axis=1))
    estimate = 0.25 * length * turn  # l t / 4
    order = np.argsort(-estimate)
    shares = np.linspace(0.0, 1.0, PROBES)
    probes = np.array(list(itertools.product(shares, repeat=dimension)))
    weights = np.array(
        [
            np.prod([share if bit else 1.0 - share for share, bit in zip(probe, bits, strict=True)])
            for probe in probes
            for bits in itertools.product((0, 1), repeat=dimension)
        ]
    ).reshape(len(probes), -1)
    # rule 4: TURN in a cell that the surface may pass, a right angle in others
    standoff, too_far = 0.0, turn > np.where(kinds[candidates] == BORDER, TURN, 2.0**0.5)
    for start in range(0, estimate.size, 1000):
        chosen = order[start : start + 1000]
        # from the largest estimate on, until none can exceed what was measured
        if estimate[chosen[0]] <= min(standoff, limit):
            break
        means = np.einsum("pc,ckd->kpd", weights, corners[:, chosen, :dimension])
        distance = np.abs(source.distance(means.reshape(-1, dimension))).reshape(chosen.size, -1).max(axis=1)
        too_far[chosen] |= distance > limit
        standoff = max(standoff, float(np.max(distance, where=~too_far[chosen], initial=0.0)))
    off[candidates] = too_far
    return PROBED_RAISE * standoff + source.stray * bool(standoff), off


def _side_ends(dimension: int, axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Slices of all nodes but the last, and of all but the first, along an axis."""
    before = tuple(slice(None, -1) if k == axis else slice(None) for k in range(dimension))
    after = tuple(slice(1, None) if k == axis else slice(None) for k in range(dimension))
    return before, after


def _corner_values(nodes: Array) -> Array:
    """The values (2^N, ..., m) at the corners of each cell, of values (..., m) at the nodes."""
    return np.stack([nodes[part] for part in _corner_slices(nodes.shape[:-1])])


def _cells_with_a_corner(nodes: BoolArray) -> BoolArray:
    """The cells with a corner where it is true."""
    cells = np.zeros(tuple(count - 1 for count in nodes.shape), bool)
    for part in _corner_slices(nodes.shape):
        cells |= nodes[part]
    return cells


def _nodes_around(cells: BoolArray) -> BoolArray:
    """The nodes at a corner of a cell where it is true."""
    nodes = np.zeros(tuple(count + 1 for count in cells.shape), bool)
    for part in _corner_slices(nodes.shape):
        nodes[part] |= cells
    return nodes


def _corner_slices(shape: tuple[int, ...]) -> list[tuple[slice, ...]]:
    """The slices of nodes of this shape that are one and the same corner of every cell, corner by corner."""
    return [
        tuple(slice(bit, count - 1 + bit) for bit, count in zip(bits, shape, strict=True))
        for bits in itertools.product((0, 1), repeat=len(shape))
    ]


class LutProjection(Projection):
    """Interpolates in a table; where the table does not interpolate, the `exact` projection answers.

    `surface` is the curve, or surface in space, that was tabulated, `resolution` (m) what is blurred: the side of a
    cell. `standoff` (m) is the table's, or the exact projection's where that is larger. Without memory.

    An IHIP that is off by e turns the position error (4.5) by e / d at depth d, so that a spring along it, `pp`, is off
    the normal when shallow. The `transversal` scheme (5.21) pushes along the interpolated normal, which is not.
    """

    def __init__(self, table: Table, exact: Projection, *, bilateral: bool) -> None:
        resolution = max(table.grid.cell, exact.resolution)
        # without gains, and of the same kind of contact
        exact_data = exact.data(exact.gains)
        exact_law = law_value(exact.law, exact_data)
        super().__init__(
            follow_table, exact.surface, bilateral=bilateral, resolution=resolution,
            standoff=max(table.standoff, exact.standoff), potential=exact.potential,
            support_range=_blurred_supports(exact.support_range, STRETCH * resolution),
            own=potential_record(exact.potential) if exact.potential else (),
            arrange=lambda data: LutData(data.params, data.state, table.arrays, exact_law, exact_data),
        )  # fmt: skip
        self.table, self.rendered_as = table, exact.rendered_as


def _blurred_supports(supports: Sequence[float], reach: float) -> tuple[float, ...]:
    """Return between what support distances lie those of interpolated IHIPs and normals, for nodes `reach` (m) apart.

    A mean of normals is at least 2^(-1/2) long (rule 4), and is divided by that.
    """
    if not supports:
        return ()
    smallest, largest = supports
    return max(smallest - reach, 0.5 * smallest), 2.0**0.5 * (largest + reach)


def tabulated(
    project: Callable[..., Projection], scene: Scene, representation: str, *, cell: float | None = None, **settings: Any
) -> Projection:
    """The projection `project(scene, representation, **settings)` through a table with cells of side `cell` (m).

    Without one it is `CELL_SIDES`. The table is made once for a model, and shared. The unbounded line has no finite
    table, and is answered exactly.
    Raises `InputError` for a cell that is not positive, or so small that the table would not fit in memory.
    """
    if not scene.model.boundary.closed:
        return project(scene, representation, **settings)

    # bilateral, so that cells at the surface have nodes outside too; in a unilateral scene the table tells the contact
    def make() -> Table:
        both_sides = project(replace(scene, bilateral=True), representation, **settings)
        return tabulate(both_sides, cell=cell, everywhere=scene.bilateral)

    exact = project(scene, representation, **settings)
    key = (project, representation, cell, scene.bilateral, *sorted(settings.items()))
    table = once(scene.model, key, make)
    return LutProjection(table, exact, bilateral=scene.bilateral)
