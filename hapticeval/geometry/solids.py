"""Solids as triangle meshes, as vertices (v, 3), m, and triangles (t, 3) anticlockwise seen from outside."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from hapticeval.types import Array, IntArray

Triangles: TypeAlias = tuple[Array, IntArray]


def prism(outline: Array, length: float) -> Triangles:
    """Return a simple anticlockwise outline (n, 2), m, extruded along z, with its middle at z = 0.

    The caps are triangulated without further vertices, so that the cross-section is the outline everywhere.
    """
    import shapely

    n = len(outline)
    vertex_of = {tuple(point): k for k, point in enumerate(outline.tolist())}
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    corners = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3]
    cap = np.array([[vertex_of[tuple(point)] for point in triangle] for triangle in corners.tolist()])
    a, b, c = outline[cap.T]
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    cap[clockwise] = cap[clockwise][:, ::-1]
    lower = np.arange(n)
    next_number = np.roll(lower, -1)
    sides = np.concatenate(
        [np.column_stack([lower, next_number, next_number + n]), np.column_stack([lower, next_number + n, lower + n])]
    )
    low, high = (np.column_stack([outline, np.full(n, z)]) for z in (-0.5 * length, 0.5 * length))
    return np.concatenate([low, high]), np.concatenate([cap[:, ::-1], cap + n, sides])


def box(sides: tuple[float, float, float]) -> Triangles:
    """Return a box of given sides (m) along x, y and z about the origin: 12 triangles."""
    x, y, z = sides
    return prism(0.5 * np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), z)


def wedge(angle: float, size: float, length: float) -> Triangles:
    """Return a prism along z over an isosceles triangle: `angle` (rad) at its edge, which lies at x = size / 2.

    Its back is the plane x = -size / 2.
    """
    half = size * math.tan(0.5 * angle)
    return prism(np.array([[0.5 * size, 0.0], [-0.5 * size, half], [-0.5 * size, -half]]), length)


def l_block(size: float, thickness: float, length: float) -> Triangles:
    """Return a prism along z over an L: two legs as long as `size`, with the concave edge between them."""
    low, inner, high = -0.5 * size, thickness - 0.5 * size, 0.5 * size
    outline = [[low, low], [high, low], [high, inner], [inner, inner], [inner, high], [low, high]]
    return prism(np.array(outline), length)


def icosphere(subdivisions: int, radius: float) -> Triangles:
    """Return 20 * 4^subdivisions triangles about the origin with all vertices on a sphere of `radius` (m)."""
    from scipy.spatial import ConvexHull

    golden = 0.5 * (1.0 + math.sqrt(5.0))
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]) * [1.0, golden]
    # the twelve corners are those of three golden rectangles, square to each other
    rectangle = np.column_stack([signs, np.zeros(4)])
    points = np.concatenate([np.roll(rectangle, turn, axis=1) for turn in range(3)])
    rows = ConvexHull(points).simplices.astype(np.int64)
    # the hull's triangles have no sense: turn those that run clockwise from outside
    a, b, c = points[rows.T]
    inward = np.sum(np.cross(b - a, c - a) * a, axis=1) < 0.0
    rows[inward] = rows[inward][:, ::-1]
    points = points / np.linalg.norm(points, axis=1)[:, np.newaxis]
    for _ in range(subdivisions):
        # each edge once, by the number of both its ends: neighbours share the new corner in its middle
        ends = np.sort(np.concatenate([rows[:, [0, 1]], rows[:, [1, 2]], rows[:, [2, 0]]]), axis=1)
        edges, middle = np.unique(ends[:, 0] * len(points) + ends[:, 1], return_inverse=True)
        # the numbers of the three middles of each triangle
        first, second, third = len(points) + middle.reshape(3, -1)
        new = points[edges // len(points)] + points[edges % len(points)]
        a, b, c = rows.T
        # a triangle becomes the three at its corners and the one between its middles
        faces = ((a, first, third), (first, b, second), (third, second, c), (first, second, third))
        rows = np.concatenate([np.column_stack(face) for face in faces])
        points = np.concatenate([points, new / np.linalg.norm(new, axis=1)[:, np.newaxis]])
    return radius * points, rows


def cylinder(radius: float, length: float, sides: int) -> Triangles:
    """Return a prism along z over a regular polygon with its corners on a circle of `radius` (m)."""
    angles = np.arange(sides) * (2.0 * math.pi / sides)
    return prism(radius * np.column_stack([np.cos(angles), np.sin(angles)]), length)
