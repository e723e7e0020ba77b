"""Compiled rigid tool that follows a hand on a triangle mesh: where it flies, lands, slides, rests and lets go.

It slides by a walk of a point on the mesh, downhill in distance to a goal.

A place on the mesh is a triangle, the feature of it that the point lies on (see `mesh_kernels`), and the point. What it
may do there depends on the free directions:

- on a face a half-space;
- at a convex edge the two half-spaces together, at a concave edge what they have in common;
- at a vertex what the fan of its triangles leaves free.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled, inner
from hapticeval.geometry.kernels import LEAVES, RESTS
from hapticeval.geometry.mesh_kernels import (
    EDGE,
    FACE,
    VERTEX,
    closest_feature,
    closest_on_mesh,
    corner_of,
    first_entry,
    neighbour_of,
    normal_of,
    position_of,
    pseudonormal_of,
    same_corner,
    vertex_of,
)
from hapticeval.geometry.triples import Triple, cross, dot, minus, plus, scaled
from hapticeval.types import Array, IntArray

MOST_STALLS = 16
"""Features in a row that lead no closer, after which a walk rests: rounding may lead it round in a circle."""

DIRECTION_ROUNDING = 1e-14
"""Share of a vector below which a part of it is rounding."""

TOOL_PLACE_ROUNDING = 4e-16
"""Share of its coordinates by which a place is off: two roundings of a double."""


@compiled
def walk_downhill(
    faces: Array, vertices: Array, free: bool, k: int, feature: int, point: Triple, goal: Triple
) -> tuple[int, int, int, Triple]:
    """Walk from a place to where no way along the mesh leads closer to `goal`, or, if `free`, where the goal is open.

    `faces` (t, 9) and `vertices` (v, 6) are the mesh, `point` and `goal` are in m. Returns how the walk ends, and the
    place.

    With one, two and three faces that hold it the point rests on a plane, on a line and in a corner. Where the faces
    are those of a convex room that is the closest point of the room to the goal.

    Without `free` the point never leaves the mesh, whichever side the goal is on.
    """
    last_squared, stalls = math.inf, 0
    while stalls < MOST_STALLS:
        d = minus(goal, point)
        now_squared = dot(d, d)
        # each feature should lead closer: by rounding it may not
        stalls = 0 if now_squared < last_squared else stalls + 1
        last_squared = min(now_squared, last_squared)
        # first what the point may do where it is: let go, rest, or which feature to go on along
        if feature >= VERTEX:
            opens, k, feature = _choose_at_vertex(faces, vertices, free, k, feature - VERTEX, d)
            if opens:
                return LEAVES, k, feature, point
            if feature >= VERTEX:
                return RESTS, k, feature, point
        elif feature >= EDGE:
            opens, k, feature = _choose_at_edge(faces, vertices, free, k, feature - EDGE, d)
            if opens:
                return LEAVES, k, feature, point
        # the goal is outside of the face that holds it
        elif free and dot(normal_of(faces, k), d) >= 0.0:
            return LEAVES, k, feature, point
        # then go: over the face, or along the edge
        if feature == FACE:
            feature, point = _cross_face(faces, vertices, k, point, goal)
            if feature == FACE:
                d = minus(goal, point)
                if free and dot(normal_of(faces, k), d) >= 0.0:
                    return LEAVES, k, feature, point
                return RESTS, k, feature, point
        else:
            i = feature - EDGE
            a, b = corner_of(faces, vertices, k, i), corner_of(faces, vertices, k, (i + 1) % 3)
            ab = minus(b, a)
            # where along the edge the goal's foot lies: rest there, or go on from the end
            share = dot(minus(goal, a), ab) / dot(ab, ab)
            if 0.0 < share < 1.0:
                return RESTS, k, feature, plus(a, share, ab)
            feature, point = (VERTEX + i, a) if share <= 0.0 else (VERTEX + (i + 1) % 3, b)
    return RESTS, k, feature, point


@inner
def _cross_face(faces: Array, vertices: Array, k: int, point: Triple, goal: Triple) -> tuple[int, Triple]:
    """Go straight over triangle k towards the goal's foot on its plane: to it, or to the edge or vertex on the way."""
    n = normal_of(faces, k)
    corners = (
        corner_of(faces, vertices, k, 0),
        corner_of(faces, vertices, k, 1),
        corner_of(faces, vertices, k, 2),
    )
    foot = plus(goal, -dot(n, minus(goal, corners[0])), n)
    # once more, for digits that a goal far away has cost
    foot = plus(foot, -dot(n, minus(foot, corners[0])), n)
    # the first edge that the way from point to foot leaves the triangle over
    share, left = 1.0, -1
    for i in range(3):
        # n x edge points into the triangle
        inward = cross(n, minus(corners[(i + 1) % 3], corners[i]))
        height_at_foot = dot(inward, minus(foot, corners[i]))
        if height_at_foot < 0.0:
            # a point that is outside by rounding is on the edge
            height_at_point = max(dot(inward, minus(point, corners[i])), 0.0)
            if height_at_point / (height_at_point - height_at_foot) < share:
                share, left = height_at_point / (height_at_point - height_at_foot), i
    if left < 0:
        return FACE, foot
    a, b = corners[left], corners[(left + 1) % 3]
    ab = minus(b, a)
    along = dot(minus(plus(point, share, minus(foot, point)), a), ab) / dot(ab, ab)
    if along <= 0.0:
        return VERTEX + left, a
    if along >= 1.0:
        return VERTEX + (left + 1) % 3, b
    return EDGE + left, plus(a, along, ab)


@inner
def _choose_at_edge(faces: Array, vertices: Array, free: bool, k: int, i: int, d: Triple) -> tuple[bool, int, int]:
    """From edge i of triangle k: whether the way along d opens, and the face, or the edge itself, to go on along.

    Where both faces lead down it is its own.
    """
    j = neighbour_of(faces, k, i)
    n, p = normal_of(faces, k), normal_of(faces, j)
    a, b = corner_of(faces, vertices, k, i), corner_of(faces, vertices, k, (i + 1) % 3)
    e = minus(b, a)
    e = scaled(1.0 / math.sqrt(dot(e, e)), e)
    # directions in each face, square to the edge and away from it
    inward_here, inward_beyond = cross(n, e), cross(e, p)
    # the neighbour lies below this face's plane
    convex = dot(inward_beyond, n) <= DIRECTION_ROUNDING
    rise_here, rise_beyond = dot(n, d), dot(p, d)
    # outside of both planes, or at a convex edge of either: the goal is open
    if free and ((rise_here >= 0.0 and rise_beyond >= 0.0) or (convex and (rise_here >= 0.0 or rise_beyond >= 0.0))):
        return True, k, EDGE + i
    # d is a difference of places, each off by its rounding: what of it leads along the edge goes neither way
    places = math.sqrt(dot(a, a)) + math.sqrt(dot(b, b))
    rounding = DIRECTION_ROUNDING * math.sqrt(dot(d, d)) + TOOL_PLACE_ROUNDING * places
    gain_here, gain_beyond = dot(inward_here, d), dot(inward_beyond, d)
    # at a concave edge a face that the goal is outside of holds nothing
    if free and rise_here >= 0.0:
        gain_here = 0.0
    if free and rise_beyond >= 0.0:
        gain_beyond = 0.0
    # no face leads down: along the edge itself
    if max(gain_here, gain_beyond) <= rounding:
        return False, k, EDGE + i
    return (False, k, FACE) if gain_here > rounding else (False, j, FACE)


@inner
def _choose_at_vertex(faces: Array, vertices: Array, free: bool, k: int, i: int, d: Triple) -> tuple[bool, int, int]:
    """From corner i of triangle k: whether the way along d opens, and the face or edge that leads down most steeply.

    Or the vertex itself, where none does. Whether d points out of the solid is the sign of the pseudonormal of what is
    closest to it in the fan, as for any point beside the mesh.
    """
    vertex = vertex_of(faces, k, i)
    apex, size_squared = position_of(vertices, vertex), dot(d, d)
    mean = pseudonormal_of(vertices, vertex)
    # nearest of all to d so far: the vertex, with its pseudonormal
    least_squared, side = size_squared, dot(mean, d)
    steepest, best, steepest_feature = DIRECTION_ROUNDING * DIRECTION_ROUNDING * size_squared, k, VERTEX + i
    j, h = k, i
    while True:
        n = normal_of(faces, j)
        p = minus(corner_of(faces, vertices, j, (h + 1) % 3), apex)
        q = minus(corner_of(faces, vertices, j, (h + 2) % 3), apex)
        height, after = dot(n, d), neighbour_of(faces, j, h)
        # d projects into this triangle: p and q bound it at the apex
        if dot(cross(n, p), d) >= 0.0 and dot(cross(q, n), d) >= 0.0:
            if height * height < least_squared:
                least_squared, side = height * height, height
            # the squared way along the face
            gain = size_squared - height * height
            if gain > steepest and not (free and height >= 0.0):
                steepest, best, steepest_feature = gain, j, FACE
        along = dot(p, d)
        # the edge p: its part of d, and the side by the mean of both faces' normals
        if along > 0.0:
            aside = plus(d, -along / dot(p, p), p)
            off_squared = dot(aside, aside)
            if off_squared < least_squared:
                least_squared, side = off_squared, dot(plus(n, 1.0, normal_of(faces, after)), aside)
            if along * along / dot(p, p) > steepest:
                steepest, best, steepest_feature = along * along / dot(p, p), j, EDGE + h
        j = after
        h = same_corner(faces, k, i, j)
        if j == k:
            break
    return free and side >= 0.0, best, steepest_feature


MOST_TOOL_FLIGHTS = 64
"""Flights within one tick, each from where the slide before has ended; each brings the tool nearer to the hand."""

IN_FREE_SPACE = -1
"""In place of a feature: the tool is where the hand is."""


@compiled
def fly_to_hand(
    faces: Array, vertices: Array, tree: Array, touch: float, start: Triple, hip: Triple, k: int
) -> tuple[bool, int, int, Triple]:
    """Go straight to the hand: whether the tool runs into something on the way, and where it then comes to rest.

    `faces` (t, 9), `vertices` (v, 6) and `tree` (2 m, 11) are the mesh, `touch`, `start` and `hip` are in m; returned
    are a triangle, the feature of it, and the tool's place (m).
    """
    for _flight in range(MOST_TOOL_FLIGHTS):
        meets, k, foot, _ = first_entry(faces, vertices, tree, start, hip, touch, k)
        if not meets:
            return False, k, 0, hip
        k, feature, foot = closest_feature(faces, vertices, tree, foot, k)
        status, k, feature, start = walk_downhill(faces, vertices, True, k, feature, foot, hip)
        # if it does not rest, the way to the hand is free again: fly on from there
        if status == RESTS:
            return True, k, feature, start
    # flights without end, by rounding: the closest point is where the tool would come to rest
    k, feature, foot = closest_feature(faces, vertices, tree, hip, k)
    _, _, _, distance = closest_on_mesh(faces, vertices, tree, hip, k)
    return distance < 0.0, k, feature, foot


@compiled
def follow_hand(
    faces: Array, vertices: Array, tree: Array, touch: float, hips: Array
) -> tuple[IntArray, IntArray, Array]:
    """Return a rigid tool's triangle (n,), the feature of it (n,) and its place (n, 3), m, at each of `hips` (n, 3), m.

    `faces` (t, 9), `vertices` (v, 6) and `tree` (2 m, 11) are the mesh. Where the tool is with the hand the feature is
    `IN_FREE_SPACE`. A tool whose hand begins inside begins at the closest point.
    """
    n = hips.shape[0]
    triangles, features, places = np.empty(n, np.int64), np.empty(n, np.int64), np.empty((n, 3))
    hip = (hips[0, 0], hips[0, 1], hips[0, 2])
    k, feature, tool = closest_feature(faces, vertices, tree, hip, 0)
    _, _, _, distance = closest_on_mesh(faces, vertices, tree, hip, k)
    # the first tick decides: outside the tool is with the hand
    touches = distance < 0.0
    if not touches:
        tool = hip
    for row in range(n):
        hip = (hips[row, 0], hips[row, 1], hips[row, 2])
        rests = False
        # it slides after the hand as long as the hand pushes it onto the mesh
        if touches:
            status, k, feature, tool = walk_downhill(faces, vertices, True, k, feature, tool, hip)
            rests = status == RESTS
        # it let go, or was free: straight to the hand
        if not rests:
            touches, k, feature, tool = fly_to_hand(faces, vertices, tree, touch, tool, hip, k)
        triangles[row], features[row] = k, feature if touches else IN_FREE_SPACE
        for i in range(3):
            places[row, i] = tool[i]
    return triangles, features, places
