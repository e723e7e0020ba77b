"""A projection field: where a projection jumps, lines of constant projection, amplification, and its numbers.

The projection is any function from HIPs to IHIPs. It jumps at lines across which neighbouring HIPs have IHIPs that stay
apart, and at single points; both are found on a lattice.

Two numbers stand beside these: the share of the inside near a jump, and how far the error vector at shallow depth is
from normal, the last of the properties that section 5.1 asks of a projection.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.types import Array, BoolArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Project: TypeAlias = Callable[[Array], Array]
"""HIPs (n, 2) to IHIPs (n, 2), m; out of contact the IHIP is the HIP."""

LATTICE_OFFSET = (
    0.3819660,
    0.2763932,
)  # where in its cell the lattice starts: neither nodes nor lines lie on axes of symmetry
SHORTEST_JUMP = 5e-4  # the shortest jump that counts, as a share of the model's size: 0.1 mm of 200 mm
TORN_STRETCH = 1.2  # neighbours whose IHIPs are further apart than this many lattice steps are looked at closer
JUMP_HALVINGS = 10
PERSISTENCE = (
    0.15  # as in `continuous-contact`: a jump's logarithm falls by less than this a halving, a continuous map's more
)


@dataclass(frozen=True, eq=False)
class Lattice:
    """The IHIPs of hand positions on a lattice over the inside of a surface.

    - `x` (nx,) and `y` (ny,), m: where its nodes are, a step `h` (m) apart;
    - `inside` (ny, nx): where the HIP is inside the surface, `contact` (ny, nx) where it is in contact too;
    - `ihip` (ny, nx, 2), m, and its arc length `s` (ny, nx), m, on `surface`: NaN out of contact.
    """

    surface: Curve
    x: Array
    y: Array
    h: float
    inside: BoolArray
    contact: BoolArray
    ihip: Array
    s: Array

    @property
    def nodes(self) -> Array:
        """The lattice's nodes (ny, nx, 2), m."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1)

    @property
    def size(self) -> float:
        """The surface's largest extent (m)."""
        return extent(self.surface)


def extent(surface: Curve) -> float:
    """Return the largest extent (m) of a surface along x or y."""
    xmin, ymin, xmax, ymax = surface.bounds
    return max(xmax - xmin, ymax - ymin)


def sample_projection(project: Project, surface: Curve, *, cells: int) -> Lattice:
    """Project the inside of a closed surface on a lattice of `cells` steps along its longer side.

    Raises `InputError` for an unbounded surface and for one in which no node is in contact.
    """
    if not surface.closed:
        raise InputError("a projection field needs a closed model", todo="choose another model than the line")
    xmin, ymin, xmax, ymax = surface.bounds
    h = extent(surface) / cells
    # The first node lies outside the box by another share of a cell along x than along y.
    x = np.arange(xmin - (1.0 - LATTICE_OFFSET[0]) * h, xmax + h, h)
    y = np.arange(ymin - (1.0 - LATTICE_OFFSET[1]) * h, ymax + h, h)
    nodes = np.stack(np.meshgrid(x, y), axis=-1)
    inside = surface.contains(nodes.reshape(-1, 2)).reshape(nodes.shape[:2])
    ihip = np.full_like(nodes, np.nan)
    ihip[inside] = project(nodes[inside])
    # Out of contact the IHIP is the HIP.
    in_contact = inside & np.any(ihip != nodes, axis=-1)
    if not in_contact.any():
        raise InputError("no hand inside the model is in contact", why="there is no projection to draw")
    ihip[~in_contact] = np.nan
    s = np.full(inside.shape, np.nan)
    s[in_contact] = arc_lengths(surface, ihip[in_contact])
    return Lattice(surface, x, y, h, inside, in_contact, ihip, s)


def arc_lengths(surface: Curve, ihips: Array) -> Array:
    """Return the arc lengths (n,), m, of IHIPs (n, 2) on a surface."""
    return surface.arc_length(surface.nearest(ihips))


def arc_offset(s: Array, other: Array | float, length: float) -> Array:
    """Return how far along a closed surface one place is from another, by the shorter way round, with its sign.

    From `other`, (n,) or one for all, to `s` (n,), m: (n,), m, in [-length/2, length/2).
    """
    # Shifted by half the length, so that the shorter way round is taken, with its sign.
    arc: Array = np.mod(s - other + 0.5 * length, length) - 0.5 * length
    return arc


@dataclass(frozen=True, eq=False)
class SingularSet:
    """The set where a projection is not continuous.

    - `segments` (m, 2, 2), m: the lines, one piece per lattice cell;
    - `points` (k, 2), m: single points round which the IHIP goes once round the surface;
    - `jumps` (n,), m: the jump at each place where a lattice line meets the set;
    - `across` and `up` (ny, nx): marks at the lattice edges to the right of and above each node that meet it.
    """

    segments: Array
    points: Array
    jumps: Array
    across: BoolArray
    up: BoolArray


def singular_set(project: Project, lattice: Lattice) -> SingularSet:
    """Find where a projection jumps: lines by bisecting lattice edges, points by going round lattice cells.

    Jumps shorter than a lattice step may be missed where the projection is not steep beside them.
    """
    places, jumps = zip(*(_jumps_on_edges(project, lattice, axis) for axis in (1, 0)), strict=True)
    across, up = (~np.isnan(place[..., 0]) for place in places)
    points = _singular_points(project, lattice, across, up)
    return SingularSet(_line_pieces(*places), points, np.concatenate(jumps), across, up)


def _jumps_on_edges(project: Project, lattice: Lattice, axis: int) -> tuple[Array, Array]:
    """Return where each edge along an axis meets the set, (ny, nx, 2), m, NaN elsewhere; and the jumps there."""
    place = np.full((*lattice.contact.shape, 2), np.nan)
    first, second = edge_ends(axis)
    both = lattice.contact[first] & lattice.contact[second]
    # m between the IHIPs of neighbours; a continuous projection moves them about as far as the HIPs.
    leap = np.linalg.norm(lattice.ihip[second] - lattice.ihip[first], axis=-1)
    suspect = both & (leap > max(SHORTEST_JUMP * lattice.size, TORN_STRETCH * lattice.h))
    nodes = lattice.nodes
    a, b = nodes[first][suspect], nodes[second][suspect]
    crossings, jump = jumps_between(project, a, b, lattice.ihip[first][suspect], lattice.ihip[second][suspect])
    # A leap that bisection has shrunk was steepness, not a jump.
    real = jump > SHORTEST_JUMP * lattice.size
    rows, columns = np.nonzero(suspect)
    place[rows[real], columns[real]] = crossings[real]
    return place, jump[real]


def edge_ends(axis: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the slices of node arrays (ny, nx) that select the first and the second node of edges along an axis."""
    every, first, second = slice(None), slice(None, -1), slice(1, None)
    return ((every, first), (every, second)) if axis == 1 else ((first, every), (second, every))


def cell_sides(across: Array, up: Array) -> Array:
    """Return what the four sides of each lattice cell have: lower, upper, left and right, (ny - 1, nx - 1, 4, ...).

    `across` and `up` (ny, nx, ...) hold it for the edges to the right of and above each node: marks, or crossings
    (x, y) in m.
    """
    return np.stack([across[:-1, :-1], across[1:, :-1], up[:-1, :-1], up[:-1, 1:]], axis=2)


def _cell_corners(s: Array) -> list[Array]:
    """Return what the four corners of each cell have, anticlockwise."""
    return [s[:-1, :-1], s[:-1, 1:], s[1:, 1:], s[1:, :-1]]


def jumps_between(project: Project, a: Array, b: Array, at_a: Array, at_b: Array) -> tuple[Array, Array]:
    """Find where the projection jumps between HIPs a and b (n, 2), m, whose IHIPs are `at_a` and `at_b` (n, 2), m.

    Twenty halvings keep the half with the larger IHIP step.

    Returns where they end, (n, 2), and the jump that stays there, (n,), m: zero where it shrinks as the step does.
    """
    if a.shape[0] == 0:
        return a, np.zeros(0)
    free = np.zeros(a.shape[0], dtype=bool)
    sizes = []
    for halving in range(2 * JUMP_HALVINGS):
        middle = 0.5 * (a + b)
        at_middle = project(middle)
        # In free space on the way: letting go of the hand is not a jump along the surface.
        free |= np.all(at_middle == middle, axis=1)
        left = np.linalg.norm(at_middle - at_a, axis=1)
        right = np.linalg.norm(at_b - at_middle, axis=1)
        # The half with the larger step goes on: a jump is in it to the end.
        in_left = left >= right
        a, at_a = np.where(in_left[:, None], a, middle), np.where(in_left[:, None], at_a, at_middle)
        b, at_b = np.where(in_left[:, None], middle, b), np.where(in_left[:, None], at_middle, at_b)
        if halving + 1 in (JUMP_HALVINGS, 2 * JUMP_HALVINGS):
            # Kept after half and after all halvings; 1e-300 so that a logarithm can be taken.
            sizes.append(np.maximum(np.maximum(left, right), 1e-300))
    # Octaves that the step has fallen by in a halving: 1 where the map is smooth, 0 at a jump.
    slope = np.log2(sizes[0] / sizes[1]) / JUMP_HALVINGS
    return 0.5 * (a + b), np.where((slope < PERSISTENCE) & ~free, sizes[1], 0.0)


def _line_pieces(across: Array, up: Array) -> Array:
    """Return the pieces of line in each cell: between its two crossings, or from each of more to their middle."""
    sides = cell_sides(across, up)
    met = ~np.isnan(sides[..., 0])
    count = met.sum(axis=2)
    two = count == 2
    pairs = sides[two][met[two]].reshape(-1, 2, 2)
    stars = []
    # Three or four crossings, as where lines meet: a star about their mean.
    for cell, which in zip(sides[count > 2], met[count > 2], strict=True):
        ends = cell[which]
        stars += [np.stack([end, ends.mean(axis=0)]) for end in ends]
    return np.concatenate([pairs, np.reshape(stars, (-1, 2, 2))])


def _singular_points(project: Project, lattice: Lattice, across: BoolArray, up: BoolArray) -> Array:
    """Find single points where a projection jumps, (k, 2), m: in cells round which the IHIP goes round the surface."""
    s, length = lattice.s, lattice.surface.length
    corners = _cell_corners(s)
    # Cells with all corners in contact, and no line on any side: there turns can be counted.
    complete = ~np.isnan(sum(corners)) & ~(across[:-1, :-1] | across[1:, :-1] | up[:-1, :-1] | up[:-1, 1:])
    turns = np.where(complete, _turns_round_cell(corners, length), 0)
    points = [
        _narrow_to_point(project, lattice, np.array([lattice.x[i], lattice.y[j]]))
        for j, i in zip(*np.nonzero(turns), strict=True)
    ]
    return np.reshape(points, (-1, 2))


def _turns_round_cell(corners: list[Array], length: float) -> Array:
    """Count how often the arc lengths at a cell's corners go round the surface on the way round the cell."""
    # The steps from corner to corner add up to a whole number of lengths.
    steps = [arc_offset(corners[(k + 1) % 4], corners[k], length) for k in range(4)]
    return np.rint(np.nan_to_num(sum(steps)) / length)


def _narrow_to_point(project: Project, lattice: Lattice, low: Array) -> Array:
    """Quarter a cell with lower left corner `low` (2,) again and again, keeping the quarter with the point in it."""
    size = lattice.h
    for _ in range(30):
        # 3 x 3 nodes of the four quarters, row by row from the lower left.
        shares = np.array([[i, j] for j in range(3) for i in range(3)]) / 2.0
        s = arc_lengths(lattice.surface, project(low + size * shares)).reshape(3, 3)
        corners = _cell_corners(s)
        rows, columns = np.nonzero(_turns_round_cell(corners, lattice.surface.length))
        # No quarter has a whole turn any more: rounding ends the search.
        if rows.size == 0:
            break
        low = low + 0.5 * size * np.array([columns[0], rows[0]])
        size *= 0.5
    middle: Array = low + 0.5 * size
    return middle


def singular_geometry(singular: SingularSet) -> BaseGeometry:
    """Return a singular set as one geometry, its lines joined end to end."""
    import shapely

    drawn = [shapely.LineString(segment) for segment in singular.segments]
    lines = shapely.line_merge(shapely.MultiLineString(drawn))
    return shapely.GeometryCollection([*shapely.get_parts(lines), *map(shapely.Point, singular.points)])


LATTICE_CELLS = 300
CONSTANT_LINES = 96
AMPLIFICATION_STEP = 1e-5  # HIP step for amplification, as a share of the model's size
REST_AMPLIFICATION = 1e-6  # amplification below which the IHIP rests while the hand moves
FAR_SHARE = 0.25  # IHIPs further from the one that is asked for than this share of the surface are on its other side
SLANT_DEPTHS = (0.0025, 0.025)  # as shares of the model's extent: 0.5 mm and 5 mm in a model of 200 mm
SLANT_PLACES = 400
FROM_CORNERS = 3.0  # depths that a place keeps away from every corner, where there is no one normal


@dataclass(frozen=True, eq=False)
class Field:
    """A projection on the inside of a surface: nodes, the singular set, lines, and amplification.

    `lines` are arrays (n, 2), m; `amplification` (ny, nx) is the largest |dIHIP| / |dHIP| over directions, NaN out of
    contact and beside the singular set. `start` (2,), m, is where the tool was, for a renderer with memory.
    """

    lattice: Lattice
    singular: SingularSet
    lines: list[Array]
    amplification: Array
    start: Array | None

    @property
    def surface(self) -> Curve:
        """The surface that HIPs are projected to."""
        return self.lattice.surface

    @property
    def rests(self) -> BoolArray:
        """Where the IHIP stays at a corner while the hand moves, (ny, nx)."""
        with np.errstate(invalid="ignore"):
            resting: BoolArray = self.amplification < REST_AMPLIFICATION
        return resting

    @cached_property
    def body(self) -> BaseGeometry:
        """The inside as an area, m^2."""
        import shapely

        count = max(4000, 8 * len(self.surface.corners))
        return shapely.make_valid(shapely.Polygon(self.surface.outline(count)))

    @cached_property
    def discontinuity(self) -> BaseGeometry:
        """The singular set as lines and points, m."""
        return singular_geometry(self.singular)

    def share_near(self, distance: float) -> float:
        """Return the share of the inside, by area, that lies within `distance` (m) of the singular set."""
        # Round ends have 32 segments a quarter turn: a disc's area is exact to 0.04 per cent.
        near = self.discontinuity.buffer(distance, quad_segs=32)
        return float(self.body.intersection(near).area / self.body.area)

    def summary(self, *, within: float) -> dict[str, Any]:
        """Return the field's numbers as JSON values; `within` (m) is the distance of the share near a jump."""
        lattice = self.lattice
        rates = self.amplification[np.isfinite(self.amplification)]
        worst = np.unravel_index(np.nanargmax(self.amplification), self.amplification.shape)
        return {
            "cells": round(lattice.size / lattice.h),
            "start": None if self.start is None else self.start.tolist(),
            "contact_share": float(lattice.contact.sum() / lattice.inside.sum()),
            "singular": {
                "length_m": float(self.discontinuity.length),
                "points": self.singular.points.tolist(),
                "largest_jump_m": float(self.singular.jumps.max(initial=0.0)),
                "within_m": within,
                "share_within": self.share_near(within),
            },
            "amplification": {
                "median": float(np.median(rates)),
                "p95": float(np.quantile(rates, 0.95)),
                "max": float(rates.max()),
                "max_at": [float(lattice.x[worst[1]]), float(lattice.y[worst[0]])],
                "rest_share": float(np.mean(rates < REST_AMPLIFICATION)),
            },
        }


def field_of(project: Project, surface: Curve, *, cells: int = LATTICE_CELLS, start: Array | None = None) -> Field:
    """Sample a projection on a lattice of `cells` steps, and find lines, jumps and amplification.

    Raises `InputError` as `sample_projection` does.
    """
    lattice = sample_projection(project, surface, cells=cells)
    singular = singular_set(project, lattice)
    return Field(
        lattice,
        singular,
        lines_of_constant_projection(lattice, singular, count=CONSTANT_LINES),
        _amplification(project, lattice, singular),
        start,
    )


def _amplification(project: Project, lattice: Lattice, singular: SingularSet) -> Array:
    """Return |dIHIP| / |dHIP| (ny, nx), from a step along x and one along y.

    The IHIP moves along the surface only, so that the two add up.
    """
    import shapely

    step = AMPLIFICATION_STEP * lattice.size
    hips, ihips = lattice.nodes[lattice.contact], lattice.ihip[lattice.contact]
    # A step of 2 um in a model of 200 mm, along x and along y.
    moves = [hips + step * axis for axis in np.eye(2)]
    moved = [project(hips) for hips in moves]
    # IHIPs move along one curve: with rates a and b along x and y the largest over all directions is sqrt(a² + b²).
    rates = np.hypot(*(np.linalg.norm(moved_ihips - ihips, axis=1) / step for moved_ihips in moved))
    # A step that meets the singular set, or leaves the contact, measures nothing.
    unclear = shapely.dwithin(singular_geometry(singular), shapely.points(hips), 3.0 * step)
    for at, before in zip(moved, moves, strict=True):
        unclear |= np.all(at == before, axis=1)
    rates[unclear] = np.nan
    amplification = np.full(lattice.contact.shape, np.nan)
    amplification[lattice.contact] = rates
    return amplification


def lines_of_constant_projection(lattice: Lattice, singular: SingularSet, *, count: int) -> list[Array]:
    """Return the lines (n, 2), m, of HIPs that share an IHIP, for `count` IHIPs in equal steps of arc length.

    A line never crosses the singular set. One that ends within a lattice step of its IHIP is drawn up to it.
    """
    length = lattice.surface.length
    levels = (np.arange(count) + 0.5) * length / count
    ends = lattice.surface.position(lattice.surface.parameter(levels))
    lines: list[Array] = []
    for level, end in zip(levels, ends, strict=True):
        for line in _join_pieces(_level_segments(lattice, singular, arc_offset(lattice.s, float(level), length))):
            lines.append(_extend_to(line, end, 1.5 * lattice.h))
    return lines


def _level_segments(lattice: Lattice, singular: SingularSet, offsets: Array) -> Array:
    """Return the lines on which `offsets` (ny, nx), m, are zero, one piece (m, 2, 2) per cell, none across a jump."""
    farthest = FAR_SHARE * lattice.surface.length
    nodes = lattice.nodes
    crossings = []
    for axis, jumps in ((1, singular.across), (0, singular.up)):
        first, second = edge_ends(axis)
        a, b = offsets[first], offsets[second]
        with np.errstate(invalid="ignore"):
            # A change of sign is a crossing, unless it is the one at half the length, on the other side.
            met = ((a < 0.0) != (b < 0.0)) & (np.abs(a) < farthest) & (np.abs(b) < farthest) & ~jumps[first]
        place = np.full(nodes.shape, np.nan)
        # Linear between the nodes: the crossing divides the edge as a to -b.
        share = (a[met] / (a[met] - b[met]))[:, None]
        # A view: what is written into it is in `place`.
        view = place[first]
        view[met] = nodes[first][met] + share * (nodes[second][met] - nodes[first][met])
        crossings.append(place)
    sides = cell_sides(*crossings)
    met = ~np.isnan(sides[..., 0])
    count: BoolArray = met.sum(axis=2) == 2
    pieces: Array = sides[count][met[count]].reshape(-1, 2, 2)
    return pieces


def _join_pieces(pieces: Array) -> list[Array]:
    """Join the pieces end to end."""
    import shapely

    if len(pieces) == 0:
        return []
    joined = shapely.line_merge(shapely.MultiLineString(list(pieces)))
    return [shapely.get_coordinates(part) for part in shapely.get_parts(joined)]


def _extend_to(line: Array, end: Array, near: float) -> Array:
    # Only the end that is nearer to the IHIP is drawn up to it.
    gaps = np.linalg.norm(line[[0, -1]] - end, axis=1)
    if gaps.min() > near:
        return line
    return np.vstack([end, line]) if gaps[0] <= gaps[1] else np.vstack([line, end])


@dataclass(frozen=True)
class ShallowAngle:
    """Angle (degrees) between error vector and surface normal at `depth` (m): median and 95 per cent of the places."""

    depth: float
    median: float
    p95: float


def shallow_angles(project: Project, surface: Curve) -> tuple[ShallowAngle, ...]:
    """Measure how far from normal a projection of HIPs (n, 2) is under a closed `surface`, at each of `SLANT_DEPTHS`.

    Places are evenly spaced along the surface, away from its corners; HIPs that come out in free space do not count.
    """
    angles = []
    for share in SLANT_DEPTHS:
        depth = share * extent(surface)
        u = surface.parameter(np.linspace(0.0, surface.length, SLANT_PLACES, endpoint=False))
        position = surface.position(u)
        clear = np.ones(SLANT_PLACES, dtype=bool)
        for corner in surface.corners:
            # Near a corner the depth is that of two faces, with two normals.
            clear &= np.linalg.norm(position - corner.position, axis=1) > FROM_CORNERS * depth
        hips = position[clear] - depth * surface.normal(u[clear])
        ihips = project(hips)
        error = ihips - hips
        length = np.linalg.norm(error, axis=1)
        pressed = length > 0.0
        if not pressed.any():
            continue
        normal = surface.normal(surface.nearest(ihips[pressed]))
        # cos = (e . n) / |e|, with e from the HIP to the IHIP and n the outward normal at the IHIP.
        cosine = np.sum(error[pressed] * normal, axis=1) / length[pressed]
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        angles.append(ShallowAngle(depth, float(np.median(angle)), float(np.percentile(angle, 95))))
    return tuple(angles)
