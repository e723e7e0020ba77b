"""The coarser representations of a model that renderers hold, each with its error.

A polygon has queries that grow as log n; a level set is what chapter 5's mapping and voxel renderers hold; facets,
straight edges or flat triangles, are for a renderer that takes nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry import solids
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import LINE_PIECE, line_pieces
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.solids import Triangles
from hapticeval.geometry.surface import Surface
from hapticeval.geometry.validate import checked_vertices
from hapticeval.records import as_records
from hapticeval.types import Array, IntArray


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

    def descend(self, start: Array, goal: Array, *, step: float) -> Array:  # noqa: ARG002 - the protocol's
        """Answer `Boundary.descend` for `start` and `goal` (2,), m: exact, from edge to edge."""
        vertices, count = self.vertices, len(self.vertices)
        lines = as_records(self.pieces, LINE_PIECE)
        directions = np.column_stack([lines.dx, lines.dy])
        u = float(self.nearest(start[np.newaxis])[0])
        k = min(int(np.searchsorted(lines.u1, u, side="right")), count - 1)
        # at a vertex the edge that leads downhill more steeply
        if u <= lines.u0[k] and (goal - vertices[k]) @ (directions[k - 1] + directions[k]) < 0.0:
            k = (k - 1) % count
        for _ in range(count):
            along = float((goal - vertices[k]) @ directions[k])
            if 0.0 < along < lines.u1[k] - lines.u0[k]:
                return np.asarray(vertices[k] + along * directions[k])
            # the nearest point of the edge is an end: on over the neighbour, as long as that leads downhill
            ahead = along > 0.0
            neighbour = (k + 1 if ahead else k - 1) % count
            end = vertices[neighbour if ahead else k]
            if (goal - end) @ directions[neighbour] * (1.0 if ahead else -1.0) <= 0.0:
                break
            k = neighbour
        return np.array(end)

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
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    value_left, value_right = evaluate(left), evaluate(right)
    # 0.618^36 is 3e-8 of the bracket: the error of a maximum goes with its square
    for _ in range(36):
        # of the two inner points that next to the maximum stays an inner one
        rising = value_right > value_left
        low, high = np.where(rising, left, low), np.where(rising, high, right)
        inner_point, inner_value = np.where(rising, right, left), np.where(rising, value_right, value_left)
        point = np.where(rising, low + ratio * (high - low), high - ratio * (high - low))
        value = evaluate(point)
        left, right = np.where(rising, inner_point, point), np.where(rising, point, inner_point)
        value_left, value_right = np.where(rising, inner_value, value), np.where(rising, value, inner_value)
    largest = np.max([value_left, value_right], initial=float(values.max()))
    return float(largest)


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


MOST_CELLS = {2: 100_000, 3: 20 * 4**8}
"""Edges, and triangles, that are made at the most: the errors of a model of 0.2 m are then 5e-11 m and 5e-7 m."""

CHORD_ERROR_SHARE = {2: 1e-4, 3: 1e-3}
"""How far edges, and triangles, may lie from a smooth model where no other error is asked for, as a share of its size.

A circle has some 160 edges then, and a sphere 5,120 triangles: few enough for a renderer without a search tree.
"""

HALF_PLANE_EXTENT = 100.0
"""A half-plane is cut off this far (m) from its origin, to either side and below: no hand gets there."""

LATTICE_STEPS, TRIANGLE_BATCH = 9, 4096
"""Steps of the lattice of points on a triangle at which it is measured, and triangles that are measured together."""


class Facets(NamedTuple):
    """A model as a polygon or a mesh, and how far that lies off it.

    `boundary` is the `Polygon` or the `Mesh`; `chord_error` (m) the largest distance between the two surfaces, measured
    from both; 0 for a model that is one of the two itself.
    """

    boundary: Polygon | Mesh
    chord_error: float

    @property
    def vertices(self) -> Array:
        """Return the positions (v, N), m."""
        return self.boundary.vertices

    @property
    def cells(self) -> IntArray:
        """Return rows of `vertices`: edges (c, 2) with the inside on their left, or triangles (c, 3).

        The corners of a triangle run anticlockwise seen from outside.
        """
        if isinstance(self.boundary, Mesh):
            return self.boundary.triangles
        starts = np.arange(len(self.boundary.vertices))
        return np.column_stack([starts, np.roll(starts, -1)])


def facets_of(
    boundary: Boundary, max_error: float, *, name: str, polygon_of: Callable[[int], Polygon], vertices: int
) -> Facets:
    """Return a model's boundary as edges or triangles that lie off it by `max_error` (m) at the most.

    `name` is the model's; `polygon_of` gives its polygon with so many vertices, and `vertices` are those to begin with.

    Raises `InputError` for a `max_error` that is not positive, or takes more than `MOST_CELLS` cells, and
    `RefusalError` for a boundary of a kind of its own.
    """
    if not max_error > 0.0:
        raise InputError(f"max_error = {max_error!r}", why="it must be positive", todo="give it in metres")
    if isinstance(boundary, Mesh):
        return Facets(boundary, 0.0)
    if isinstance(boundary, Curve):
        if not boundary.closed:
            return Facets(_half_plane(boundary), 0.0)
        if boundary.straight:
            return Facets(polygon_of(vertices), 0.0)
        return _refine_until(partial(_polygon_facets, polygon_of, vertices, boundary), max_error, name)
    if isinstance(boundary, Surface):
        return _refine_until(partial(_mesh_facets, boundary), max_error, name)
    raise RefusalError(
        f"model '{name}' is a {type(boundary).__name__}",
        why="edges and triangles are made of plane curves, meshes, spheres, ellipsoids and tori",
        todo="use scene.model.boundary as it is, or give the model as a mesh",
    )


def _refine_until(facets_at: Callable[[float], Facets], max_error: float, name: str) -> Facets:
    """Return the first facets that are fine enough, each finer than the last by what its error asks for.

    The error of facets with their corners on a smooth surface goes with the square of their size.
    """
    finer = 1.0
    while True:
        facets = facets_at(finer)
        if facets.chord_error <= max_error:
            return facets
        count = len(facets.cells)
        if count >= MOST_CELLS[facets.boundary.dimension]:
            raise InputError(
                f"model '{name}' with a chord error of at most {max_error:g} m",
                why=f"{count} {'edges' if facets.boundary.dimension == 2 else 'triangles'} are the most that are "
                f"made, and their error is {facets.chord_error:.3g} m",
                todo="allow a larger max_error",
            )
        # 2 % to spare: the square law is that of a fine mesh
        finer *= 1.02 * math.sqrt(facets.chord_error / max_error)


def _polygon_facets(polygon_of: Callable[[int], Polygon], vertices: int, curve: Curve, finer: float) -> Facets:
    """Return the polygon of a curve with so many vertices, or `finer`."""
    polygon = polygon_of(math.ceil(min(vertices * finer, MOST_CELLS[2])))
    return Facets(polygon, polygon.standoff_from(curve))


def _half_plane(curve: Curve) -> Polygon:
    """Return a square on the left of an unbounded line: one edge lies along it."""
    start, end = curve.position(np.array([-HALF_PLANE_EXTENT, HALF_PLANE_EXTENT]))
    # the inside is opposite to the outward normal
    inward = -2.0 * HALF_PLANE_EXTENT * curve.normal(0.0)
    return Polygon([start, end, end + inward, start + inward])


def _mesh_facets(surface: Surface, finer: float) -> Facets:
    """Return the mesh of `triangulate_surface`."""
    mesh = Mesh(surface.name, *triangulate_surface(surface, finer))
    return Facets(mesh, _largest_distance(mesh, surface))


def triangulate_surface(surface: Surface, finer: float) -> Triangles:
    """Return triangles with their corners on a surface: 80 on a sphere, 240 or so on a torus, and `finer`^2 times that.

    A sphere's are `solids.icosphere`, which are stretched to ellipsoids; they are finer by powers of two only.
    """
    if surface.kind == "torus":
        major, minor = surface.reals
        return _triangulate_torus(major, minor, finer)
    # each subdivision halves the edges
    points, rows = solids.icosphere(min(math.ceil(math.log2(finer)) + 1, 8), 1.0)
    return points * np.array(surface.reals), rows


def _triangulate_torus(major: float, minor: float, finer: float) -> Triangles:
    """Return a torus as a grid of `8 * finer` steps round the tube, and about the axis as many as err by as much.

    A chord of a circle of radius R over an angle a lies R a^2 / 8 off it.
    """
    # a step about the axis at its outermost errs like one round the tube: R a^2 = r b^2
    ratio = math.sqrt((major + minor) / minor)
    # no more than MOST_CELLS triangles: two a cell of the grid
    finer = min(finer, math.sqrt(MOST_CELLS[3] / (2.0 * 64.0 * ratio)))
    steps_around, steps_about = math.ceil(8.0 * finer), math.ceil(8.0 * finer * ratio)
    u, v = np.meshgrid(np.arange(steps_about), np.arange(steps_around), indexing="ij")
    azimuth, angle = 2.0 * math.pi / steps_about * u, 2.0 * math.pi / steps_around * v
    axis_distance = major + minor * np.cos(angle)
    x, y, z = axis_distance * np.cos(azimuth), axis_distance * np.sin(azimuth), minor * np.sin(angle)
    points = np.stack([x, y, z], axis=-1)
    number = steps_around * u + v
    next_about, next_around, both = (np.roll(number, shift, (0, 1)) for shift in ((-1, 0), (0, -1), (-1, -1)))
    # each cell of the grid in two triangles, anticlockwise seen from outside
    rows = np.concatenate(
        [np.stack([number, next_about, both], axis=-1), np.stack([number, both, next_around], axis=-1)]
    )
    return points.reshape(-1, 3), rows.reshape(-1, 3)


def _largest_distance(mesh: Mesh, surface: Surface) -> float:
    """Return the largest distance (m) between a mesh and the smooth surface that its vertices lie on.

    Each point of the surface is the foot of one of the mesh, so that the distance from the mesh is all of it. It is
    measured at a lattice of points on every triangle.

    Between corners on a surface of one curvature k it is k (R^2 - r^2) / 2, r from the middle of the circle of radius R
    round them.

    A lattice of n steps leaves no point farther than R / n from the next: what is measured falls short by 1 / n^2 at
    the most. Twice that is added, for curvature that changes.
    """
    u, v = (
        np.array([(i, j) for i in range(LATTICE_STEPS + 1) for j in range(LATTICE_STEPS + 1 - i)]).T[:, :, np.newaxis]
        / LATTICE_STEPS
    )
    corners = mesh.vertices[mesh.triangles]
    largest = 0.0
    for begin in range(0, len(corners), TRIANGLE_BATCH):
        a, b, c = (corner[:, np.newaxis] for corner in corners[begin : begin + TRIANGLE_BATCH].transpose(1, 0, 2))
        points = (a + u * (b - a) + v * (c - a)).reshape(-1, 3)
        largest = max(largest, float(np.abs(surface.signed_distance(points)).max()))
    return largest * (1.0 + 2.0 / LATTICE_STEPS**2)
