"""A model as straight edges or flat triangles: what a renderer that takes nothing else is given, with its error."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry import solids
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.polygon import Polygon
from hapticeval.geometry.solids import Triangles
from hapticeval.geometry.surface import Surface
from hapticeval.types import Array, IntArray

if TYPE_CHECKING:
    from hapticeval.geometry.model import Model

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


def facets_of(model: Model, max_error: float) -> Facets:
    """Return the model as edges or triangles that lie off it by `max_error` (m) at the most.

    Raises `InputError` for a `max_error` that is not positive, or takes more than `MOST_CELLS` cells, and
    `RefusalError` for a boundary of a kind of its own.
    """
    if not max_error > 0.0:
        raise InputError(f"max_error = {max_error!r}", why="it must be positive", todo="give it in metres")
    boundary = model.boundary
    if isinstance(boundary, Mesh):
        return Facets(boundary, 0.0)
    if isinstance(boundary, Curve):
        if not boundary.closed:
            return Facets(_half_plane(boundary), 0.0)
        if boundary.straight:
            return Facets(model.polygon(), 0.0)
        return _refine_until(_polygon_maker(model, boundary), max_error, model.name)
    if isinstance(boundary, Surface):
        return _refine_until(_mesh_maker(boundary), max_error, model.name)
    raise RefusalError(
        f"model '{model.name}' is a {type(boundary).__name__}",
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


def _polygon_maker(model: Model, curve: Curve) -> Callable[[float], Facets]:
    """Return what makes polygons with 40 corners and finer, see `Model.polygon`."""

    def polygon_facets(finer: float) -> Facets:
        polygon = model.polygon(math.ceil(min(40.0 * finer, MOST_CELLS[2])))
        return Facets(polygon, polygon.standoff_from(curve))

    return polygon_facets


def _half_plane(curve: Curve) -> Polygon:
    """Return a square on the left of an unbounded line: one edge lies along it."""
    start, end = curve.position(np.array([-HALF_PLANE_EXTENT, HALF_PLANE_EXTENT]))
    # the inside is opposite to the outward normal
    inward = -2.0 * HALF_PLANE_EXTENT * curve.normal(0.0)
    return Polygon([start, end, end + inward, start + inward])


def _mesh_maker(surface: Surface) -> Callable[[float], Facets]:
    """Return what makes meshes, see `triangulate_surface`."""

    def mesh_facets(finer: float) -> Facets:
        mesh = Mesh(surface.name, *triangulate_surface(surface, finer))
        return Facets(mesh, _largest_distance(mesh, surface))

    return mesh_facets


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
