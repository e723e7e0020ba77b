"""A closed triangle mesh in space: what CAD files hold, with flat faces, edges and corners."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import compiled, for_kernels
from hapticeval.geometry import mesh_build as build
from hapticeval.geometry import mesh_kernels as kernels
from hapticeval.geometry.boundary import ClosestPoint, SurfaceInSpace
from hapticeval.geometry.mesh_input import (
    check_closed,
    check_crossings,
    checked_positions,
    checked_triangles,
    refuse_triangle,
)
from hapticeval.geometry.mesh_kernels import closest_on_mesh
from hapticeval.geometry.mesh_tool import follow_hand, walk_downhill
from hapticeval.geometry.motion import Motion
from hapticeval.geometry.polygon_kernels import COORDINATE_ROUNDING, TOUCH_SHARE
from hapticeval.geometry.triples import Triple
from hapticeval.geometry.validate import answer_by_kernel
from hapticeval.laws import FOOT, NORMAL, SHAPE, Closest, LawData, law_data
from hapticeval.types import Array, IntArray

SPREADING_STEPS = (0.7548776662466927, 0.5698402909980532)
"""Shares of one step of the evenest sequence of points in a square (Roberts: powers of 1 / the plastic number)."""


class Mesh(SurfaceInSpace):
    """A closed, connected, outward surface of triangles; it is a `Boundary`.

    `vertices` (v, 3), m, and `triangles` (t, 3), rows of vertices, anticlockwise seen from outside. Vertices that no
    triangle has are left out. `tables` are what compiled code works on, see `mesh_kernels`.

    Raises `InputError`, naming the triangle and how to mend it, for a mesh that is open, inside out, in parts, not a
    manifold, degenerate, or that crosses itself; and for sizes outside the float range.
    """

    def __init__(self, name: str, vertices: ArrayLike, triangles: ArrayLike) -> None:
        self.name = name
        positions = checked_positions(vertices)
        rows = checked_triangles(triangles, positions.shape[0])
        # each check needs what the one before has made sure of
        across = check_closed(positions, rows)
        order = build.leaf_order(positions, rows)
        faces, table, problem, triangle = build.build_tables(positions, rows, across, order)
        if problem:
            refuse_triangle(problem, triangle, positions[rows[triangle]])
        tree = build.build_tree(faces, table)
        check_crossings(faces, table, tree, order)
        self.tables = faces, table, tree

    @property
    def vertices(self) -> Array:
        """The positions (v, 3), m."""
        return self.tables[1][:, :3]

    @property
    def triangles(self) -> IntArray:
        """The triangles (t, 3), rows of `vertices`, anticlockwise seen from outside."""
        return self.tables[0][:, :3].astype(np.int64)

    @property
    def neighbours(self) -> IntArray:
        """The triangles (t, 3) across the edges of each: first corner to second, second to third, and back."""
        return self.tables[0][:, kernels.ACROSS_COLUMN : kernels.ACROSS_COLUMN + 3].astype(np.int64)

    @property
    def normals(self) -> Array:
        """The outward unit normals (t, 3) of the triangles."""
        return self.tables[0][:, kernels.NORMAL_COLUMN :]

    @cached_property
    def bounds(self) -> tuple[float, ...]:
        """(xmin, ymin, zmin, xmax, ymax, zmax), m."""
        return (*self.vertices.min(axis=0).tolist(), *self.vertices.max(axis=0).tolist())

    @cached_property
    def touch(self) -> float:
        """Depth (m) that is rounding, so that a point counts as on the mesh: by the mesh's size and place."""
        low, high = np.reshape(self.bounds, (2, 3))
        return float(TOUCH_SHARE * np.max(high - low) + COORDINATE_ROUNDING * np.max(np.abs(self.bounds)))

    def moved(self, motion: Motion) -> Mesh:
        """Return the mesh moved, its vertices rounded anew."""
        # a mirror turns corners clockwise: their order is turned back
        return Mesh(self.name, motion(self.vertices), self.triangles[:, :: -1 if motion.mirrors else 1])

    def reordered(self) -> Mesh:
        """Return the same mesh with its vertices and triangles in the opposite order, each from another corner."""
        last = len(self.vertices) - 1
        return Mesh(self.name, self.vertices[::-1], np.roll(last - self.triangles[::-1], 1, axis=1))

    def cut(self) -> Mesh:
        """Return the same surface with each triangle cut into 36 unequal ones, in its own plane but for rounding."""
        return Mesh(self.name, *build.cut_triangles(*build.cut_triangles(self.vertices, self.triangles)))

    @property
    def compiled_closest(self) -> Closest:
        """The closest point as compiled code, for what is composed into a step: see `closest_of`."""
        return closest_of_mesh(*self.tables)

    def closest_point(self, points: ArrayLike) -> ClosestPoint:
        """Return the closest points of points (n, 3), m: one compiled call, see `Boundary.closest_point`.

        On an edge the normal is that which points to the point.
        """
        return answer_by_kernel(kernels.closest_points, self.tables, points, 3)

    def signed_distance(self, points: ArrayLike) -> Array:
        """Return the signed distances (n,), m, of points (n, 3), m: see `Boundary.signed_distance`."""
        return answer_by_kernel(kernels.signed_distances, self.tables, points, 3)

    def first_crossing(self, start: Array, end: Array, *, grain: float) -> Array | None:  # noqa: ARG002 - the protocol's
        """Return where the segment from `start` to `end` (3,), m, first goes inside, exactly: nothing is too thin.

        See `Boundary.first_crossing`.
        """
        inside, _, foot, _ = kernels.first_entry(*self.tables, _triple(start), _triple(end), self.touch, 0)
        return np.array(foot) if inside else None

    def normal_cone(self, points: Array, reach: Array) -> Callable[[Array], Array]:
        """Answer `Boundary.normal_cone` for points (n, 3), m: cones that the normals of all triangles in reach span."""
        starts, normals = kernels.normals_in_reach(*self.tables, for_kernels(points), for_kernels(reach))

        def angle_outside(directions: Array) -> Array:
            """Return the angles (n,), rad, by which directions (n, 3) leave the cones."""
            return kernels.angles_outside_cones(starts, normals, for_kernels(directions))

        return angle_outside

    def least_heights(self, points: Array) -> Array:
        """Return the least height (n,), m, of the triangle that is closest to each of the points (n, 3), m."""
        closest = [kernels.closest_feature(*self.tables, _triple(point), 0)[0] for point in points]
        corners = self.vertices[self.triangles[closest]]
        sides = np.roll(corners, -1, axis=1) - corners
        # twice the area over the longest side
        double_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        return np.asarray(double_area / np.linalg.norm(sides, axis=2).max(axis=1))

    def descend(self, start: Array, goal: Array, *, step: float) -> Array:  # noqa: ARG002 - the protocol's
        """Answer `Boundary.descend` for `start` and `goal` (3,), m: exact, over faces and along edges."""
        k, feature, foot = kernels.closest_feature(*self.tables, _triple(start), 0)
        _, _, _, foot = walk_downhill(*self.tables[:2], False, k, feature, foot, _triple(goal))
        return np.array(foot, dtype=np.float64)

    def rigid_tool(self, hips: Array) -> tuple[IntArray, IntArray, Array]:
        """Return where a rigid tool is that follows the hand along `hips` (n, 3), m: see `mesh_tool.follow_hand`."""
        return follow_hand(*self.tables, self.touch, for_kernels(hips))

    @cached_property
    def facets(self) -> IntArray:
        """The flat face of the solid (t,) that each triangle belongs to, counted from 0."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        faces, neighbours = np.repeat(np.arange(len(self.triangles)), 3), self.neighbours.ravel()
        # |n - p|^2 is the squared angle between the normals, for small ones
        flat = np.sum((self.normals[faces] - self.normals[neighbours]) ** 2, axis=1) <= kernels.ONE_PLANE
        # triangles joined over flat edges are one face of the solid
        joined = coo_array((flat[flat], (faces[flat], neighbours[flat])), shape=(len(self.triangles),) * 2)
        return np.asarray(connected_components(joined, directed=False)[1], dtype=np.int64)

    @cached_property
    def concave(self) -> bool:
        """Whether the solid has a concave edge: one at which the neighbouring face rises above a face's plane."""
        face, edge = np.divmod(np.arange(3 * len(self.triangles)), 3)
        neighbour = self.neighbours[face, edge]
        start, end = self.vertices[self.triangles[face, edge]], self.vertices[self.triangles[face, (edge + 1) % 3]]
        # (n x p) . edge < 0 where the neighbour turns up from the face
        turn = np.sum(np.cross(self.normals[face], self.normals[neighbour]) * (end - start), axis=1)
        return bool(np.any((turn < 0.0) & (self.facets[face] != self.facets[neighbour])))

    def points(self, n: int) -> Array:
        """Return n points (n, 3), m, of the mesh, as many to equal areas: see `Boundary.points`."""
        a, b, c = self.vertices[self.triangles.T]
        areas = np.cumsum(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
        # a triangle for each equal share of the area
        rows = np.minimum(np.searchsorted(areas, (np.arange(n) + 0.5) / n * areas[-1]), areas.size - 1)
        u, v = ((0.5 + step * np.arange(n)) % 1.0 for step in SPREADING_STEPS)
        # the half of the square beyond the diagonal is folded back into the triangle
        u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
        a, b, c = a[rows], b[rows], c[rows]
        return np.asarray(a + u[:, np.newaxis] * (b - a) + v[:, np.newaxis] * (c - a))

    def edges(self, angle: float, eye: Array) -> Array:
        """Return the edges (e, 2, 3), m, at which the faces turn by more than `angle` (rad) and one faces the eye.

        `eye` (3,) is the direction from which the mesh is seen from afar.
        """
        triangles, normals, neighbours = self.triangles, self.normals, self.neighbours
        first, last, neighbour = (
            np.concatenate(table.T) for table in (triangles, np.roll(triangles, -1, 1), neighbours)
        )
        face = np.tile(np.arange(len(triangles)), 3)
        # each edge once, by the lower of its two triangles
        sharp = (face < neighbour) & (np.sum(normals[face] * normals[neighbour], axis=1) < math.cos(angle))
        visible = sharp & (np.maximum(normals[face] @ eye, normals[neighbour] @ eye) > 0.0)
        return np.stack([self.vertices[first[visible]], self.vertices[last[visible]]], axis=1)


def _triple(point: Array) -> Triple:
    """Return a point (3,) as the kernels take one."""
    return float(point[0]), float(point[1]), float(point[2])


def closest_of_mesh(faces: Array, vertices: Array, tree: Array) -> Closest:
    """Return the compiled closest point of a triangle mesh, given its tables of `mesh_kernels`, which are shared.

    `faces` (t, 9), `vertices` (v, 6), m, and `tree` (k, 11). Its state is the triangle of the last answer.
    """
    return Closest(closest_on_triangles, law_data(pieces=faces, vertices=vertices, tree=tree, state=1))


@compiled
def closest_on_triangles(data: LawData, point: Array, frame: Array) -> float:
    """Answer `CLOSEST` for a point (3,), m, on a triangle mesh, into `frame` (k, 3).

    A mesh bends in no face, and has no arc length.
    """
    p = (point[0], point[1], point[2])
    k, foot, normal, distance = closest_on_mesh(data.pieces, data.vertices, data.tree, p, int(data.state[0]))
    # the next point is looked for from here: it saves time and changes no answer
    data.state[0] = k
    for i in range(3):
        frame[FOOT, i], frame[NORMAL, i] = foot[i], normal[i]
        for row in range(SHAPE, min(frame.shape[0], SHAPE + 3)):
            frame[row, i] = 0.0
        if frame.shape[0] > SHAPE + 3:
            frame[SHAPE + 3, i] = np.nan
    return distance
