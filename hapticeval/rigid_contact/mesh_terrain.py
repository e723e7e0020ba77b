"""A triangle mesh prepared for the tool: its flat faces, how they meet, and what is free around a place on it.

A place is a triangle and the feature of it that the tool is on: its inside, an edge or a corner (see `mesh_kernels`).
Triangles of one flat face share one plane, bit for bit, and the edges between them are none: so it makes no difference
how a face is cut into triangles, slivers and fans included.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hapticeval.compiled import compiled, inner
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import (
    EDGE,
    FACE,
    NORMAL_COLUMN,
    VERTEX,
    corner_of,
    neighbour_of,
    normal_of,
    position_of,
    pseudonormal_of,
    same_corner,
    vertex_of,
)
from hapticeval.geometry.triples import Triple, cross, dot, minus, plus, put_triple, scaled, triple_at
from hapticeval.rigid_contact.force import ALIGNED_SHARE
from hapticeval.types import Array, IntArray


class MeshTerrain(NamedTuple):
    """A mesh as the tool's loops take it.

    - `faces` (t, 9), `vertices` (v, 6) and `tree` (2 m, 11) as in `mesh_kernels`, with the normal of its flat face in
      the row of each triangle;
    - `facets` (t,): the number of the flat face that a triangle belongs to;
    - `anchors` (t, 3), m: a point of that face, the same for all of its triangles;
    - `turns` (t, 3): how the mesh turns at each edge, the sine of the angle, positive where convex, 0 inside of a face;
    - `tip_reach` (m): rounding of coordinates, by which a triangle reaches beyond its edges that are not concave, so
      that no tool that is dropped straight onto one falls between two triangles.
    """

    faces: Array
    vertices: Array
    tree: Array
    facets: IntArray
    anchors: Array
    turns: Array
    tip_reach: float


TIP_ROUNDING = 1e-14
"""Share of the coordinates that is their rounding, and that of a few products of them."""


def prepare_mesh(mesh: Mesh) -> MeshTerrain:
    """Return a mesh as the tool's loops take it: made once a scene."""
    faces, vertices, tree = mesh.tables
    flat_faces, facets, anchors, turns = merge_flat_faces(faces, vertices, mesh.touch)
    tip_reach = TIP_ROUNDING * float(np.abs(mesh.bounds).max())
    return MeshTerrain(flat_faces, vertices, tree, facets, anchors, turns, tip_reach)


@compiled
def merge_flat_faces(faces: Array, vertices: Array, touch: float) -> tuple[Array, IntArray, Array, Array]:
    """Return `faces` with the normals of flat faces, and `facets`, `anchors` and `turns`, see `MeshTerrain`.

    `faces` (t, 9) and `vertices` (v, 6) are the mesh. A flat face grows from its largest triangle over neighbours that
    lie within `touch` (m) of that triangle's plane, which a sliver's own normal could not tell.
    """
    n = faces.shape[0]
    areas, flat = np.empty(n), faces.copy()
    for k in range(n):
        a = corner_of(faces, vertices, k, 0)
        aside = cross(minus(corner_of(faces, vertices, k, 1), a), minus(corner_of(faces, vertices, k, 2), a))
        # four squares of the area: only their order matters
        areas[k] = dot(aside, aside)
    facets, anchors, turns = np.full(n, -1), np.empty((n, 3)), np.zeros((n, 3))
    queue, count = np.empty(n, np.int64), 0
    # largest first; of equal ones the first in the table
    for seed in np.argsort(-areas, kind="mergesort"):
        if facets[seed] >= 0:
            continue
        normal, anchor = normal_of(faces, seed), corner_of(faces, vertices, seed, 0)
        queue[0], facets[seed] = seed, count
        # breadth first over the neighbours: queue[:done] has been looked at, queue[done:end] waits
        done, end = 0, 1
        while done < end:
            k = queue[done]
            done += 1
            put_triple(flat[k], NORMAL_COLUMN, normal)
            put_triple(anchors[k], 0, anchor)
            for i in range(3):
                j = neighbour_of(faces, k, i)
                # taken already, or turned by a right angle or more
                if facets[j] >= 0 or dot(normal_of(faces, j), normal) <= 0.0:
                    continue
                # the farthest corner from the seed's plane, |n.(q - anchor)|
                off = 0.0
                for corner in range(3):
                    q = minus(corner_of(faces, vertices, j, corner), anchor)
                    off = max(off, abs(dot(normal, q)))
                if off <= touch:
                    queue[end], facets[j] = j, count
                    end += 1
        count += 1
    for k in range(n):
        for i in range(3):
            j = neighbour_of(faces, k, i)
            if facets[j] != facets[k]:
                # (n x p) . e is the sine, positive where the neighbour turns down
                turns[k, i] = dot(cross(normal_of(flat, k), normal_of(flat, j)), edge_direction(faces, vertices, k, i))
    return flat, facets, anchors, turns


@inner
def edge_direction(faces: Array, vertices: Array, k: int, i: int) -> Triple:
    """Return the unit direction of edge i of triangle k, a row of `faces` (t, k), between `vertices` (v, 3), m."""
    a, b = corner_of(faces, vertices, k, i), corner_of(faces, vertices, k, (i + 1) % 3)
    ab = minus(b, a)
    return scaled(1.0 / math.sqrt(dot(ab, ab)), ab)


@inner
def height_over_face(terrain: MeshTerrain, k: int, p: Triple) -> float:
    """Return the height (m) of p over the flat face that triangle k belongs to."""
    return dot(normal_of(terrain.faces, k), minus(p, triple_at(terrain.anchors[k], 0)))


@inner
def next_in_fan(terrain: MeshTerrain, k: int, i: int) -> tuple[int, int]:
    """Return the triangle across edge i of triangle k, and the corner of it that is corner i of k."""
    j = neighbour_of(terrain.faces, k, i)
    return j, same_corner(terrain.faces, k, i, j)


@compiled
def feature_at(terrain: MeshTerrain, k: int, p: Triple, reach: float, convex_reach: float) -> tuple[int, Triple]:
    """Return the feature of triangle k that p (m) is on, and the point of that feature.

    p is on an edge to `reach` (m), or if that is convex to `convex_reach`; on a corner to the larger one that its edges
    have. Edges inside of a flat face are no features, nor are corners inside of one.
    """
    faces, vertices, normal = terrain.faces, terrain.vertices, normal_of(terrain.faces, k)
    for i in range(3):
        apex = corner_of(faces, vertices, k, i)
        off, (lowest, highest) = minus(p, apex), turns_at_corner(terrain, k, i)
        corner_reach = reach if lowest < 0.0 else convex_reach
        # both are zero at a corner inside of a flat face
        if lowest < highest and dot(off, off) <= corner_reach * corner_reach:
            return VERTEX + i, apex
    for i in range(3):
        turn = terrain.turns[k, i]
        a, e = corner_of(faces, vertices, k, i), edge_direction(faces, vertices, k, i)
        off = minus(p, a)
        # n x e points into the triangle
        if turn != 0.0 and dot(cross(normal, e), off) <= (convex_reach if turn > 0.0 else reach):
            return EDGE + i, plus(a, dot(off, e), e)
    return FACE, plus(p, -height_over_face(terrain, k, p), normal)


@inner
def turns_at_corner(terrain: MeshTerrain, k: int, i: int) -> tuple[float, float]:
    """Return the least and the largest turn of the edges at corner i of triangle k, and of zero: both 0 in a face."""
    lowest, highest = 0.0, 0.0
    # once round the corner, over all triangles that meet there
    j, corner = k, i
    while True:
        lowest, highest = min(lowest, terrain.turns[j, corner]), max(highest, terrain.turns[j, corner])
        j, corner = next_in_fan(terrain, j, corner)
        if j == k:
            return lowest, highest


@compiled
def nearest_around(terrain: MeshTerrain, k: int, feature: int, d: Triple) -> tuple[float, int, int, Triple]:
    """Return how far a vector d at a place points outside of the solid, negative inside, and its closest boundary.

    The solid around a place is a cone: a half-space at a face, a wedge at an edge, the cone of the fan at a corner. The
    closest boundary of d is a triangle, its feature, and the vector in the boundary that is closest to d, in its unit.

    To rounding, an edge comes before its faces and the corner before its edges.
    """
    if feature >= VERTEX:
        return _nearest_in_fan(terrain, k, feature - VERTEX, d)
    n = normal_of(terrain.faces, k)
    height = dot(n, d)
    if feature == FACE:
        return height, k, FACE, plus(d, -height, n)
    i = feature - EDGE
    j = neighbour_of(terrain.faces, k, i)
    e, p = edge_direction(terrain.faces, terrain.vertices, k, i), normal_of(terrain.faces, j)
    # d = (d.e) e + what lies in the wedge's section; its heights over the two faces
    on_edge, height_across = scaled(dot(d, e), e), dot(p, d)
    # directions from the edge into either face: where d has a part along one, its foot may lie there
    best_height, best, foot = math.inf, k, on_edge
    if dot(cross(n, e), d) > 0.0:
        best_height, foot = height, plus(d, -height, n)
    if dot(cross(e, p), d) > 0.0 and abs(height_across) < abs(best_height):
        best_height, best, foot = height_across, j, plus(d, -height_across, p)
    # neither face has a foot, or to rounding it is that on the edge
    aside, apart = minus(d, on_edge), minus(foot, on_edge)
    if math.sqrt(dot(apart, apart)) <= ALIGNED_SHARE * math.sqrt(dot(d, d)):
        # the side by the mean of both normals
        return math.copysign(math.sqrt(dot(aside, aside)), dot(plus(n, 1.0, p), aside)), k, feature, on_edge
    return best_height, best, FACE, foot


@compiled
def _nearest_in_fan(terrain: MeshTerrain, k: int, i: int, d: Triple) -> tuple[float, int, int, Triple]:
    """Answer `nearest_around` for corner i of triangle k."""
    faces, vertices = terrain.faces, terrain.vertices
    row, rounding = vertex_of(faces, k, i), ALIGNED_SHARE * math.sqrt(dot(d, d))
    apex = position_of(vertices, row)
    best_height, best, best_feature, foot = math.inf, -1, FACE, (0.0, 0.0, 0.0)
    best_edge_square, best_edge, edge_corner, on_edge, edge_side = math.inf, -1, 0, (0.0, 0.0, 0.0), 1.0
    j, corner = k, i
    while True:
        n, after, corner_after = normal_of(faces, j), *next_in_fan(terrain, j, corner)
        p = minus(corner_of(faces, vertices, j, (corner + 1) % 3), apex)
        q = minus(corner_of(faces, vertices, j, (corner + 2) % 3), apex)
        height = dot(n, d)
        # d projects into this triangle: p and q bound it at the apex
        if abs(height) < abs(best_height) and dot(cross(n, p), d) >= 0.0 and dot(cross(q, n), d) >= 0.0:
            best_height, best, foot = height, j, plus(d, -height, n)
        along = dot(p, d)
        # the edge p, unless it lies inside of a flat face
        if along > 0.0 and terrain.turns[j, corner] != 0.0:
            # (d.p / p.p) p, the foot of d on that edge
            part = scaled(along / dot(p, p), p)
            aside = minus(d, part)
            if dot(aside, aside) < best_edge_square:
                best_edge_square, best_edge, edge_corner, on_edge = dot(aside, aside), j, corner, part
                edge_side = dot(plus(n, 1.0, normal_of(faces, after)), aside)
        j, corner = after, corner_after
        if j == k:
            break
    # the edge, where no face has a foot, none as close, or to rounding the same one
    if best_edge >= 0:
        apart = minus(foot, on_edge)
        if best < 0 or best_edge_square < best_height * best_height or dot(apart, apart) <= rounding * rounding:
            best_height = math.copysign(math.sqrt(best_edge_square), edge_side)
            best, best_feature, foot = best_edge, EDGE + edge_corner, on_edge
    # neither face nor edge has a foot, or to rounding it is the corner
    if best < 0 or dot(foot, foot) <= rounding * rounding:
        mean = pseudonormal_of(vertices, row)
        return math.copysign(math.sqrt(dot(d, d)), dot(mean, d)), k, VERTEX + i, (0.0, 0.0, 0.0)
    return best_height, best, best_feature, foot


@compiled
def most_opposed_normal(terrain: MeshTerrain, k: int, feature: int, v: Triple) -> Triple:
    """Return the normal that v runs against most, of the faces that meet at a feature of triangle k."""
    best = normal_of(terrain.faces, k)
    if feature == FACE:
        return best
    best_speed = dot(best, v)
    i = (feature - EDGE) if feature < VERTEX else (feature - VERTEX)
    j, corner = next_in_fan(terrain, k, i)
    # over an edge there is one other face, around a corner all of the fan
    while j != k:
        n = normal_of(terrain.faces, j)
        if dot(n, v) < best_speed:
            best_speed, best = dot(n, v), n
        if feature < VERTEX:
            break
        j, corner = next_in_fan(terrain, j, corner)
    return best


@compiled
def pulls_into(terrain: MeshTerrain, k: int, feature: int, force: Triple) -> tuple[float, float]:
    """Return the weakest and the strongest force (N) that pulls a tool back which leaves a place along the boundary.

    The weakest is negative where a force (N) drives the tool along some edge or face away from an edge or corner.
    """
    faces, vertices = terrain.faces, terrain.vertices
    if feature < VERTEX:
        i = feature - EDGE
        e, j = edge_direction(faces, vertices, k, i), neighbour_of(faces, k, i)
        # square to the edge, up either face
        pull, other = -dot(cross(normal_of(faces, k), e), force), -dot(cross(e, normal_of(faces, j)), force)
        return min(pull, other), max(pull, other)
    weakest, strongest, j, corner = math.inf, -math.inf, k, feature - VERTEX
    while True:
        # -e.F: what pulls back from moving out along that edge
        pull = -dot(edge_direction(faces, vertices, j, corner), force)
        weakest, strongest = min(weakest, pull), max(strongest, pull)
        j, corner = next_in_fan(terrain, j, corner)
        if j == k:
            return weakest, strongest
