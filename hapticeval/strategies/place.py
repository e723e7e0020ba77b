"""Places on a model's surface, the depths of medial axis and centre of curvature under them, edges and vertices."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.boundary import Boundary, Corner
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.model import Model
from hapticeval.types import Array, BoolArray

PLACE_COUNT = 100
"""How many places of a surface are known; parts of a path start at these, and between them."""


class Place(NamedTuple):
    """A point of the surface: `foot` (N,), m, its outward unit `normal` (N,), and two depths (m) under it.

    At `medial` another point of the surface is as near: the medial axis. At `focal` is the centre of the surface's
    largest curvature. Each is infinite where there is none.
    """

    foot: Array
    normal: Array
    medial: float
    focal: float


def places(model: Model) -> list[Place]:
    """Return `PLACE_COUNT` places of the model's surface, in order along a plane one."""
    boundary: Any = model.boundary
    return _places_of(boundary, model.size)


@lru_cache(maxsize=16)
def _places_of(boundary: Boundary, size: float) -> list[Place]:
    """Return the places of a boundary, found once; `size` is its model's, m."""
    frame = boundary.closest_point(boundary.points(PLACE_COUNT))
    foot, normal = frame.foot, frame.normal
    # The largest principal curvature, 1/m, positive where convex.
    largest_curvature = np.linalg.eigvalsh(frame.shape).max(axis=1)

    def is_nearest(depth: Array) -> BoolArray:
        """Whether each place is the nearest point of the surface from `depth` (n,), m, under it; (n,)."""
        distance = boundary.signed_distance(foot - depth[:, np.newaxis] * normal)
        # At depth d the distance is -d while no other point of the surface is nearer, and more than that beyond.
        nearest: BoolArray = distance < -depth + 1e-6 * size
        return nearest

    low, high = np.zeros(PLACE_COUNT), np.full(PLACE_COUNT, np.inf)
    # Bracket the depth at which the place is the nearest no more, from 1e-4 to 1 of the size.
    for depth in size * np.geomspace(1e-4, 1.0, 32):
        still_nearest = is_nearest(np.full(PLACE_COUNT, depth))
        low = np.where(still_nearest & np.isinf(high), depth, low)
        high = np.where(~still_nearest & np.isinf(high), depth, high)
    bracketed = np.isfinite(high)
    # Bisect: a bracket is a third of its depth wide, so that 1e-4 of it is left.
    for _ in range(12):
        middle = np.where(bracketed, 0.5 * (low + np.where(bracketed, high, 0.0)), low)
        still_nearest = is_nearest(middle)
        low, high = np.where(bracketed & still_nearest, middle, low), np.where(bracketed & ~still_nearest, middle, high)
    # r = 1 / kappa; a flat or concave place has no centre under it.
    focal = np.where(largest_curvature * size > 1e-6, 1.0 / np.maximum(largest_curvature, 1e-300), np.inf)
    return [
        Place(*row) for row in zip(foot, normal, np.where(bracketed, low, np.inf).tolist(), focal.tolist(), strict=True)
    ]


class Edge(NamedTuple):
    """A corner of a plane model, or an edge of a solid.

    In a solid `corner` is the cut across the edge at its middle, and `along` (N,), m, leads from one end of the edge to
    the other; in the plane it is zero.
    """

    corner: Corner
    along: Array

    def distance_from(self, position: Array) -> float:
        """Return the distance (m) of a `position` (N,), m, from the edge."""
        offset, squared_length = position - self.corner.position, float(self.along @ self.along)
        # The nearest point, as a share of the edge from its middle.
        share = float(np.clip(offset @ self.along / squared_length, -0.5, 0.5)) if squared_length > 0.0 else 0.0
        return float(np.linalg.norm(offset - share * self.along))


class Vertex(NamedTuple):
    """A vertex of a solid: its `position` (3,), m, and the outward unit `normals` (k, 3) of the faces that meet."""

    position: Array
    normals: Array


def edges(model: Model) -> list[Edge]:
    """Return the corners of a plane model in order, or the edges of a solid; a smooth surface has none."""
    boundary: Any = model.boundary
    if not isinstance(boundary, Mesh):
        return [Edge(corner, np.zeros(2)) for corner in boundary.corners]
    return _edges_of(boundary)


@lru_cache(maxsize=16)
def _edges_of(mesh: Mesh) -> list[Edge]:
    """Return the edges between faces that do not lie in one plane, once."""
    face, side = np.nonzero(mesh.facets[:, np.newaxis] != mesh.facets[mesh.neighbours])
    neighbour = mesh.neighbours[face, side]
    # Each edge once, by the lower of its two triangles.
    once = face < neighbour
    face, side, neighbour = face[once], side[once], neighbour[once]
    starts, ends = mesh.vertices[mesh.triangles[face, side]], mesh.vertices[mesh.triangles[face, (side + 1) % 3]]
    along = ends - starts
    units = along / np.linalg.norm(along, axis=1)[:, np.newaxis]
    before, after = mesh.normals[face], mesh.normals[neighbour]
    # The triangle lies to the left of its edge, so that e x n leads out of it, over the edge, and down the neighbour.
    over, down = np.cross(units, before), np.cross(units, after)
    turns = np.arctan2(np.sum(np.cross(before, after) * units, axis=1), np.sum(before * after, axis=1))
    return [
        Edge(Corner(0.0, 0.0, 0.5 * (starts[k] + ends[k]), over[k], down[k], before[k], after[k], float(turns[k])), row)
        for k, row in enumerate(along)
    ]


def vertices(model: Model) -> list[Vertex]:
    """Return the vertices of a solid at which three faces or more meet; other models have none."""
    boundary: Any = model.boundary
    return _vertices_of(boundary) if isinstance(boundary, Mesh) else []


@lru_cache(maxsize=16)
def _vertices_of(mesh: Mesh) -> list[Vertex]:
    """Return the vertices at which three faces or more meet, once."""
    # A vertex and a flat face that meets there, each pair once, in order of the vertices.
    pairs = np.column_stack([mesh.triangles.ravel(), np.repeat(mesh.facets, 3)])
    pairs, first = np.unique(pairs, axis=0, return_index=True)
    normals = mesh.normals[first // 3]
    starts = np.flatnonzero(np.diff(pairs[:, 0], prepend=-1))
    return [
        Vertex(mesh.vertices[pairs[start, 0]], normals[start:end])
        for start, end in zip(starts, [*starts[1:], len(pairs)], strict=True)
        if end - start >= 3
    ]


def check_model(model: object) -> None:
    """Raise `InputError` for what is not a model."""
    if not isinstance(model, Model):
        raise InputError(f"{model!r} is not a model", todo='make one: hapticeval.make_model("star")')
