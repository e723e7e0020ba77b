"""Where a projection jumps, found on a lattice: lines across which neighbouring HIPs have IHIPs that stay apart, and
single points. The projection is any function from HIPs to IHIPs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.types import Array, BoolArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Project: TypeAlias = Callable[[Array], Array]
"""HIPs (n, 2) to IHIPs (n, 2), m; out of contact the IHIP is the HIP."""

OFFSET = (0.3819660, 0.2763932)  # where in its cell the lattice starts: neither nodes nor lines lie on axes of symmetry
SHORT = 5e-4  # the shortest jump that counts, as a share of the model's size: 0.1 mm of 200 mm
STRETCH = 1.2  # neighbours whose IHIPs are further apart than this many lattice steps are looked at closer
HALVINGS = 10
STAYS = (
    0.15  # as in `continuous-contact`: a jump's logarithm falls by less than this a halving, a continuous map's more
)


@dataclass(frozen=True, eq=False)
class Lattice:
    """Nodes at x (nx,), y (ny,), m, a step `h` (m) apart; `held` (ny, nx) where the HIP is inside and in contact.

    `ihip` (ny, nx, 2), m, and its arc length `s` (ny, nx), m, on `surface` are NaN elsewhere; `inside` (ny, nx) is
    where the HIP is inside the surface, in contact or not.
    """

    surface: Curve
    x: Array
    y: Array
    h: float
    inside: BoolArray
    held: BoolArray
    ihip: Array
    s: Array

    @property
    def nodes(self) -> Array:
        """(ny, nx, 2), m."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1)

    @property
    def size(self) -> float:
        """The surface's largest extent (m)."""
        return extent(self.surface)


def extent(surface: Curve) -> float:
    """Return the largest extent (m) of a surface along x or y."""
    xmin, ymin, xmax, ymax = surface.bounds
    return max(xmax - xmin, ymax - ymin)


def sampled(project: Project, surface: Curve, *, cells: int) -> Lattice:
    """Project the inside of a closed surface on a lattice of `cells` steps along its longer side.

    Raises `InputError` for an unbounded surface and for one in which no node is in contact.
    """
    if not surface.closed:
        raise InputError("a projection field needs a closed model", todo="choose another model than the line")
    xmin, ymin, xmax, ymax = surface.bounds
    h = extent(surface) / cells
    x = np.arange(xmin - (1.0 - OFFSET[0]) * h, xmax + h, h)
    y = np.arange(ymin - (1.0 - OFFSET[1]) * h, ymax + h, h)
    nodes = np.stack(np.meshgrid(x, y), axis=-1)
    inside = surface.contains(nodes.reshape(-1, 2)).reshape(nodes.shape[:2])
    ihip = np.full_like(nodes, np.nan)
    ihip[inside] = project(nodes[inside])
    held = inside & np.any(ihip != nodes, axis=-1)
    if not held.any():
        raise InputError("no hand inside the model is in contact", why="there is no projection to draw")
    ihip[~held] = np.nan
    s = np.full(inside.shape, np.nan)
    s[held] = arc_lengths(surface, ihip[held])
    return Lattice(surface, x, y, h, inside, held, ihip, s)


def arc_lengths(surface: Curve, ihips: Array) -> Array:
    """Return the arc lengths (n,), m, of IHIPs (n, 2) on a surface."""
    return surface.arc_length(surface.nearest(ihips))


def apart(s: Array, other: Array | float, length: float) -> Array:
    """Return the signed arc length from `other` to s along a closed surface, in [-length/2, length/2)."""
    way: Array = np.mod(s - other + 0.5 * length, length) - 0.5 * length
    return way


@dataclass(frozen=True, eq=False)
class Singular:
    """The set where a projection is not continuous.

    `segments` (m, 2, 2), m, are the lines, one piece per lattice cell; `points` (k, 2), m, single points round which
    the IHIP goes once round the surface; `jumps` (n,), m, the jump at each place where a lattice line meets the set.
    `across` and `up` (ny, nx) mark the lattice edges to the right of and above each node that meet it.
    """

    segments: Array
    points: Array
    jumps: Array
    across: BoolArray
    up: BoolArray


def singular_set(project: Project, lattice: Lattice) -> Singular:
    """Find the lines by bisecting lattice edges, and the points by going round lattice cells.

    Jumps shorter than a lattice step may be missed where the projection is not steep beside them.
    """
    places, jumps = zip(*(_on_edges(project, lattice, axis) for axis in (1, 0)), strict=True)
    across, up = (~np.isnan(place[..., 0]) for place in places)
    points = _points(project, lattice, across, up)
    return Singular(_segments(*places), points, np.concatenate(jumps), across, up)


def _on_edges(project: Project, lattice: Lattice, axis: int) -> tuple[Array, Array]:
    """Return where each edge along an axis meets the set, (ny, nx, 2), m, NaN elsewhere; and the jumps there."""
    place = np.full((*lattice.held.shape, 2), np.nan)
    first, second = edge_ends(axis)
    both = lattice.held[first] & lattice.held[second]
    leap = np.linalg.norm(lattice.ihip[second] - lattice.ihip[first], axis=-1)
    suspect = both & (leap > max(SHORT * lattice.size, STRETCH * lattice.h))
    nodes = lattice.nodes
    a, b = nodes[first][suspect], nodes[second][suspect]
    found, jump = jumps_between(project, a, b, lattice.ihip[first][suspect], lattice.ihip[second][suspect])
    real = jump > SHORT * lattice.size
    rows, columns = np.nonzero(suspect)
    place[rows[real], columns[real]] = found[real]
    return place, jump[real]


def edge_ends(axis: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the slices of node arrays (ny, nx) that select the first and the second node of edges along an axis."""
    every, first, second = slice(None), slice(None, -1), slice(1, None)
    return ((every, first), (every, second)) if axis == 1 else ((first, every), (second, every))


def cell_sides(across: Array, up: Array) -> Array:
    """Return what the four sides of each cell have, (ny - 1, nx - 1, 4, ...), from arrays of the edges at each node."""
    return np.stack([across[:-1, :-1], across[1:, :-1], up[:-1, :-1], up[:-1, 1:]], axis=2)


def _cell_corners(s: Array) -> list[Array]:
    """Return what the four corners of each cell have, anticlockwise."""
    return [s[:-1, :-1], s[:-1, 1:], s[1:, 1:], s[1:, :-1]]


def jumps_between(project: Project, a: Array, b: Array, at_a: Array, at_b: Array) -> tuple[Array, Array]:
    """Halve segments from a to b (n, 2) twenty times, each time keeping the half with the larger IHIP step.

    Returns where they end, (n, 2), and the jump that stays there, (n,), m: zero where it shrinks as the step does.
    """
    if a.shape[0] == 0:
        return a, np.zeros(0)
    free = np.zeros(a.shape[0], dtype=bool)
    sizes = []
    for halving in range(2 * HALVINGS):
        middle = 0.5 * (a + b)
        at_middle = project(middle)
        free |= np.all(at_middle == middle, axis=1)
        left = np.linalg.norm(at_middle - at_a, axis=1)
        right = np.linalg.norm(at_b - at_middle, axis=1)
        in_left = left >= right
        a, at_a = np.where(in_left[:, None], a, middle), np.where(in_left[:, None], at_a, at_middle)
        b, at_b = np.where(in_left[:, None], middle, b), np.where(in_left[:, None], at_middle, at_b)
        if halving + 1 in (HALVINGS, 2 * HALVINGS):
            sizes.append(np.maximum(np.maximum(left, right), 1e-300))
    slope = np.log2(sizes[0] / sizes[1]) / HALVINGS
    return 0.5 * (a + b), np.where((slope < STAYS) & ~free, sizes[1], 0.0)


def _segments(across: Array, up: Array) -> Array:
    """Return the pieces of line in each cell: between its two crossings, or from each of more to their middle."""
    sides = cell_sides(across, up)
    met = ~np.isnan(sides[..., 0])
    count = met.sum(axis=2)
    two = count == 2
    pairs = sides[two][met[two]].reshape(-1, 2, 2)
    stars = []
    for cell, which in zip(sides[count > 2], met[count > 2], strict=True):
        ends = cell[which]
        stars += [np.stack([end, ends.mean(axis=0)]) for end in ends]
    return np.concatenate([pairs, np.reshape(stars, (-1, 2, 2))])


def _points(project: Project, lattice: Lattice, across: BoolArray, up: BoolArray) -> Array:
    """Find cells without a line around which the IHIP goes once round the surface; narrow each down to a point."""
    s, length = lattice.s, lattice.surface.length
    corners = _cell_corners(s)
    whole = ~np.isnan(sum(corners)) & ~(across[:-1, :-1] | across[1:, :-1] | up[:-1, :-1] | up[:-1, 1:])
    turns = np.where(whole, _turns(corners, length), 0)
    found = [
        _narrowed(project, lattice, np.array([lattice.x[i], lattice.y[j]]))
        for j, i in zip(*np.nonzero(turns), strict=True)
    ]
    return np.reshape(found, (-1, 2))


def _turns(corners: list[Array], length: float) -> Array:
    """Count how often the arc lengths at a cell's corners go round the surface on the way round the cell."""
    ways = [apart(corners[(k + 1) % 4], corners[k], length) for k in range(4)]
    return np.rint(np.nan_to_num(sum(ways)) / length)


def _narrowed(project: Project, lattice: Lattice, low: Array) -> Array:
    """Quarter a cell with lower left corner `low` (2,) again and again, keeping the quarter with the point in it."""
    size = lattice.h
    for _ in range(30):
        shares = np.array([[i, j] for j in range(3) for i in range(3)]) / 2.0
        s = arc_lengths(lattice.surface, project(low + size * shares)).reshape(3, 3)
        corners = _cell_corners(s)
        rows, columns = np.nonzero(_turns(corners, lattice.surface.length))
        if rows.size == 0:
            break
        low = low + 0.5 * size * np.array([columns[0], rows[0]])
        size *= 0.5
    middle: Array = low + 0.5 * size
    return middle


def singular_geometry(singular: Singular) -> BaseGeometry:
    """Return a singular set as one geometry, its lines joined end to end."""
    import shapely

    drawn = [shapely.LineString(segment) for segment in singular.segments]
    lines = shapely.line_merge(shapely.MultiLineString(drawn))
    return shapely.GeometryCollection([*shapely.get_parts(lines), *map(shapely.Point, singular.points)])
