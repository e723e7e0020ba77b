"""Force shading: the change of an answer on a polygon and on a triangle mesh, and the normals at a point of a mesh."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import borrowing
from hapticeval.geometry.mesh_kernels import CORNER_COLUMN, NORMAL_COLUMN
from hapticeval.laws import FOOT, ChangeData, Closest
from hapticeval.records import as_record, record_type
from hapticeval.types import Array

# ruff: noqa: ARG001 - every change of an answer has these arguments

SHADED_FACET = record_type("start", "length", "own_x", "own_y", "first_x", "first_y", "last_x", "last_y")
"""A facet in the plane: the arc length (m) at which it starts, its length (m), its own unit normal, and those of both
corners."""

ARC_LENGTH_ROW = 4
"""Last row of a frame of `hapticeval.laws.CLOSEST` in the plane: the arc length."""

OWN_NORMAL, SHADED_NORMAL, SHADING_ROWS = 2, 3, 4
"""Rows of a frame of N = 3 beside those of a closest point: the normal that is turned, and what it is turned to."""

SMOOTH, TRIANGLE_COLUMNS = 9, 12
"""A triangle's row has the normals of its three corners, and from here on whether its three edges are smooth."""

CORNER_SHARE_ON_EDGE = 1e-10
"""Share of a corner below which a point is on the edge across from it."""


@borrowing
def write_normals(faces: Array, vertices: Array, table: Array, k: int, ihip: Array, hip: Array, frame: Array) -> None:
    """Write the normal that a force is turned from and the one that it is turned to, at a point of triangle k.

    They are the rows `OWN_NORMAL` and `SHADED_NORMAL` of `frame` (SHADING_ROWS, 3), whose row FOOT is the point; `ihip`
    and `hip` (3,), m, are the answer's. `faces` (t, c) and `vertices` (m, 3), m, are a mesh's tables, and `table` (t,
    TRIANGLE_COLUMNS) that of `shading.mesh_corners`.

    On a smooth edge the tool rests on both faces, and the own normal is the direction from the hand to it, as in a
    notch in the plane.
    """
    touched_edge, length_squared, normal = -1, 0.0, faces[k, NORMAL_COLUMN : NORMAL_COLUMN + 3]
    foot, own, shaded, corners = (
        frame[FOOT],
        frame[OWN_NORMAL],
        frame[SHADED_NORMAL],
        faces[k, CORNER_COLUMN : CORNER_COLUMN + 3],
    )
    double_area = 0.0  # twice the triangle's area, m^2: n.((b - a) x (c - a))
    for axis in range(3):
        own[axis], shaded[axis] = normal[axis], 0.0
        y, z = (axis + 1) % 3, (axis + 2) % 3
        a, b, c = int(corners[0]), int(corners[1]), int(corners[2])
        double_area += normal[axis] * (
            (vertices[b, y] - vertices[a, y]) * (vertices[c, z] - vertices[a, z])
            - (vertices[b, z] - vertices[a, z]) * (vertices[c, y] - vertices[a, y])
        )
    for i in range(3):
        next_corner, last_corner = int(corners[(i + 1) % 3]), int(corners[(i + 2) % 3])
        # barycentric share of corner i: the area of the triangle of the foot and the two other corners
        area_share = 0.0
        for axis in range(3):
            y, z = (axis + 1) % 3, (axis + 2) % 3
            area_share += normal[axis] * (
                (vertices[next_corner, y] - foot[y]) * (vertices[last_corner, z] - foot[z])
                - (vertices[next_corner, z] - foot[z]) * (vertices[last_corner, y] - foot[y])
            )
        area_share = max(area_share / double_area, 0.0)
        for axis in range(3):
            shaded[axis] += area_share * table[k, 3 * i + axis]  # (4.15)
        # on the edge across from corner i, which starts at corner i + 1
        if area_share <= CORNER_SHARE_ON_EDGE and table[k, SMOOTH + (i + 1) % 3] == 1.0:
            touched_edge = i
    # a mean of unit normals is shorter than one: without this the force would shrink
    for i in range(3):
        length_squared += shaded[i] ** 2
    length = math.sqrt(length_squared)
    for i in range(3):
        shaded[i] /= length
    if touched_edge >= 0:
        length = math.sqrt((ihip[0] - hip[0]) ** 2 + (ihip[1] - hip[1]) ** 2 + (ihip[2] - hip[2]) ** 2)
        if length > 0.0:
            for i in range(3):
                own[i] = (ihip[i] - hip[i]) / length


def shade(
    data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array
) -> int:  # fmt: skip
    """Turn `force` (2,), N, as the own normal o is turned on to the shaded one s, in the plane of both.

    That is F - F.(o + s) / (1 + o.s) (o + s) + 2 (F.o) s.

    The signature is that of `Effect.change`: `hip` and `ihip` (2,), m. `data.params` (1,) is the rounding of the arc
    length, m; `data.samples` (n, 8) are those of `shading.facets`. Returns 0: it is defined everywhere.
    """
    if force[0] == 0.0 and force[1] == 0.0:
        return 0
    tolerance, frame, table = data.params[0], data.state, data.samples
    closest.function(closest.data, ihip, frame)
    arc_length = frame[ARC_LENGTH_ROW, 0]
    facet = as_record(table, SHADED_FACET, max(np.searchsorted(table[:, 0], arc_length, side="right") - 1, 0))
    from_start = arc_length - facet.start
    share = from_start / facet.length
    # (4.15) between the facet's corners, renormalised
    x = (1.0 - share) * facet.first_x + share * facet.last_x
    y = (1.0 - share) * facet.first_y + share * facet.last_y
    size = math.hypot(x, y)
    x, y = x / size, y / size
    own_x, own_y = facet.own_x, facet.own_y
    begins = from_start <= tolerance
    if begins or facet.length - from_start <= tolerance:
        # In a notch the tool rests on both facets, and a spring's force is anywhere between their normals.
        corner_x, corner_y = (facet.first_x, facet.first_y) if begins else (facet.last_x, facet.last_y)
        if corner_x == own_x and corner_y == own_y:
            return 0
        error_x, error_y = ihip[0] - hip[0], ihip[1] - hip[1]
        size = math.hypot(error_x, error_y)
        if size > 0.0:
            own_x, own_y = error_x / size, error_y / size
    force_on_own = force[0] * own_x + force[1] * own_y
    # the rotation that turns the own normal on to the shaded one
    sum_x, sum_y = own_x + x, own_y + y
    share = (force[0] * sum_x + force[1] * sum_y) / (1.0 + own_x * x + own_y * y)
    force[0] += 2.0 * force_on_own * x - share * sum_x
    force[1] += 2.0 * force_on_own * y - share * sum_y
    return 0


def shade_mesh(
    data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array
) -> int:  # fmt: skip
    """Turn `force` (3,), N, on a mesh by as much as its shaded normal is turned: see `shading.Shading`.

    The signature is that of `Effect.change`: `hip` and `ihip` (3,), m. Returns 0: it is defined everywhere.
    """
    if force[0] == 0.0 and force[1] == 0.0 and force[2] == 0.0:
        return 0
    frame, mesh = data.state, closest.data
    own, shaded = frame[OWN_NORMAL], frame[SHADED_NORMAL]
    closest.function(mesh, ihip, frame)
    # the code of the closest point keeps the triangle that it found in its state
    write_normals(mesh.pieces, mesh.vertices, data.samples, int(mesh.state[0]), ihip, hip, frame)
    force_on_own, force_on_sum, cosine = 0.0, 0.0, 0.0
    for i in range(3):
        force_on_own += force[i] * own[i]
        force_on_sum += force[i] * (own[i] + shaded[i])
        cosine += own[i] * shaded[i]
    force_on_sum /= 1.0 + cosine
    # the rotation that turns own on to shaded in their plane: F - F.(o + s) / (1 + o.s) (o + s) + 2 (F.o) s
    for i in range(3):
        force[i] += 2.0 * force_on_own * shaded[i] - force_on_sum * (own[i] + shaded[i])
    return 0
