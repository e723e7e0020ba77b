"""Force shading: the force follows normals interpolated between the vertices of a polygon or a mesh (thesis 4.3.1)."""

# ruff: noqa: ARG002 - every effect, and every change of an answer, has these arguments

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hapticeval.effects.effect import Calling, Effect, Part, Stage, number
from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import as_curve
from hapticeval.geometry.mesh import Mesh
from hapticeval.types import Array

AT_VERTEX = 1e-12
"""Share of the outline by which a point may be off a vertex and still be on it: rounding of the arc length."""


CREASE_ROUNDING = 1e-9
"""Share of the crease angle by which an edge that turns as much may seem to turn more."""


@dataclass(frozen=True)
class Shading(Effect):
    """Turn the force by as much as the interpolated normal is turned from the facet's own.

    - At a vertex the unit normal is halfway between those of the facets that meet there, in space their mean by the
      angles that they have there.
    - On a facet it is unit(sum of a_i n_i), (4.15) renormalised, with a_i the shares of its corners at the IHIP.
    - An edge that turns by more than `crease` (degrees) is meant to be sharp: facets keep their own normals there.

    The magnitude is the base's, whatever damps it: of a spring F = K d n, and a part across the spring, as a damper's
    along the surface, stays across it. It is not passive: n is the gradient of no potential.
    """

    crease: float = number("degrees", default=60.0)

    kind: ClassVar[str] = "shading"
    stage: ClassVar[Stage] = Stage.ANSWER
    words: ClassVar[str] = "force shading of edges up to {crease}"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.crease > 180.0:
            raise InputError(
                f"{self.named('crease')} = {self.crease!r} degrees",
                why="no edge turns by more than 180 degrees",
                todo="leave it out for 60, or give 180 to shade all edges",
            )

    def change(self, scene: Calling) -> Part:
        """Assemble the shading: `samples` are the facets, `params` the rounding of the arc length in the plane.

        Raises `RefusalError` for a boundary that has no facets.
        """
        from hapticeval.effects import shading_kernels as kernels
        from hapticeval.records import as_records

        if isinstance(scene.model.boundary, Mesh):
            corners = mesh_corners(scene.model.boundary, self.crease)
            return Part(kernels.shade_mesh, np.empty(0), corners, np.zeros((kernels.SHADING_ROWS, 3)))
        facet_table = facets(scene.model.boundary, self.crease)
        if facet_table is None:
            raise RefusalError(
                f"shading on model '{scene.model.name}', which has no facets",
                why="normals are interpolated between the vertices of a polygon or a mesh",
                todo="give the model as one; a renderer that shades facets of its own declares that in supports",
            )
        last_facet = as_records(facet_table, kernels.SHADED_FACET)[-1]
        ends = last_facet.start + last_facet.length
        frame = np.zeros((kernels.ARC_LENGTH_ROW + 1, 2))
        return Part(kernels.shade, np.array([AT_VERTEX * ends]), samples=facet_table, state=frame)

    def active(self, damping: float) -> str | None:
        """Return why it gives energy away, which it does on some loops with any renderer."""
        return "shaded normals are the gradient of no potential: round a loop whose depth changes they give energy away"


def facets(boundary: Boundary, crease: float) -> Array | None:
    """Return the edges of a polygon with the normals that are interpolated over each, (n, 8), in order.

    A row is a `shading_kernels.SHADED_FACET`: lengths are in m, normals have no unit. None for a boundary that is not
    made of straight edges. An edge of more than `crease` degrees stays sharp.
    """
    curve = as_curve(boundary)
    if curve is None or not (curve.closed and curve.straight):
        return None
    start = curve.pieces[:, 3:5]
    edge = np.roll(start, -1, axis=0) - start
    length = np.hypot(edge[:, 0], edge[:, 1])
    face = np.column_stack([edge[:, 1], -edge[:, 0]]) / length[:, np.newaxis]  # outward, of an anticlockwise polygon
    before = np.roll(face, 1, axis=0)
    across = before[:, 0] * face[:, 1] - before[:, 1] * face[:, 0]
    turn = np.degrees(np.arctan2(np.abs(across), np.sum(before * face, axis=1)))
    smooth = (turn <= crease * (1.0 + CREASE_ROUNDING))[:, np.newaxis]
    # each facet's first corner is the last of the facet before
    halfway = _unit(before + face)
    first, after = np.where(smooth, halfway, face), np.where(smooth, halfway, before)
    along = np.asarray(curve.pieces[:, 1] - curve.pieces[0, 1])
    return np.column_stack([along, length, face, first, np.roll(after, -1, axis=0)])


def mesh_corners(mesh: Mesh, crease: float) -> Array:
    """Return the shaded unit normals at the corners of each triangle of a mesh, and whether its edges are smooth.

    (n, 12) for n triangles, columns as in `shading_kernels`; no unit. Corners at one vertex share a normal where smooth
    edges, of up to `crease` degrees, join their triangles: the mean of these triangles' normals by their angles there,
    which no cutting of a face into triangles changes.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    triangles, normals, neighbours = mesh.triangles, mesh.normals, mesh.neighbours
    count = len(triangles)
    cosine = np.sum(normals[:, np.newaxis] * normals[neighbours], axis=2)
    smooth = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))) <= crease * (1.0 + CREASE_ROUNDING)
    triangle, edge = np.nonzero(smooth)
    neighbour = neighbours[triangle, edge]
    # corners (3 triangle + corner) that share a normal: of two triangles at a smooth edge, at either end of it
    corner_pairs = []
    for corner in (edge, (edge + 1) % 3):
        same_corner = np.argmax(triangles[neighbour] == triangles[triangle, corner][:, np.newaxis], axis=1)
        corner_pairs.append(np.column_stack([3 * triangle + corner, 3 * neighbour + same_corner]))
    rows, columns = np.concatenate(corner_pairs).T
    graph = coo_array((np.ones(rows.size), (rows, columns)), shape=(3 * count, 3 * count))
    group_count, group = connected_components(graph, directed=False)
    # a group of corners is a normal: the sum of its triangles' normals by their angles (rad) there
    sides = mesh.vertices[np.roll(triangles, -1, axis=1)] - mesh.vertices[triangles]
    sides_back = -np.roll(sides, 1, axis=1)
    angle = np.arctan2(np.linalg.norm(np.cross(sides, sides_back), axis=2), np.sum(sides * sides_back, axis=2))
    sums = np.zeros((group_count, 3))
    np.add.at(sums, group, (angle[..., np.newaxis] * normals[:, np.newaxis]).reshape(-1, 3))
    return np.column_stack([_unit(sums)[group].reshape(count, 9), smooth.astype(np.float64)])


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, np.newaxis])
