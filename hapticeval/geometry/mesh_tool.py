"""Compiled rigid tool that follows a hand on a triangle mesh: where it flies, lands, slides, rests and lets go."""

from __future__ import annotations

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.mesh_kernels import closest_feature, closest_on_mesh, first_entry
from hapticeval.geometry.mesh_walk import RESTS, walk_downhill
from hapticeval.geometry.surface_kernels import Triple
from hapticeval.types import Array, IntArray

MOST_FLIGHTS = 64
"""Ways within one tick, each from where the slide before has ended; each brings the tool nearer to the hand."""

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
    for _flight in range(MOST_FLIGHTS):
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
