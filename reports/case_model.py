"""A model as the script of a case page draws it: rings in the plane, triangles in space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.model import Model
from hapticeval.geometry.surface import Surface
from hapticeval.reports.canvas import MM
from hapticeval.reports.case_data import Packer, Track, position_resolution
from hapticeval.reports.plane import Box, filled_part
from hapticeval.types import Array, IntArray

if TYPE_CHECKING:
    from shapely import Geometry

HULL_POINTS = 500
"""Points of a round solid that is drawn as the hull of them."""

LARGEST_VERTEX = 2047
"""The largest number of a vertex: a solid is seen to a thousandth of its size."""

TORUS_QUADS = 36
"""Quadrilaterals of a torus round its axis."""

EYE_AXES = np.array([[0.866, 0.5, 0.0], [-0.25, 0.433, 0.866], [0.433, -0.75, 0.5]])
"""From where a solid is seen first: rows are what lies to the right, up, and towards the eye, 30 degrees above."""

VIEW_RATIO = 3.0
"""An open model, or one far larger than the paths, is drawn this many times as far as they go."""


def pack_model(model: Model | None, tracks: Sequence[Track], packer: Packer) -> dict[str, Any] | None:
    """Pack the outline of a model in the plane as `rings`, or its `vertices` (m) and `triangles`; None for no model."""
    if model is None:
        return None
    if model.dimension == 3:
        vertices, triangles = triangles_of(model.boundary)
        return {
            "closed": True,
            "vertices": packer.add(vertices, scale=float(np.max(np.abs(vertices))) / LARGEST_VERTEX),
            "triangles": packer.add(triangles.astype(np.float64), scale=1.0),
            "sharp": isinstance(model.boundary, Mesh),
            "turn": EYE_AXES.tolist(),
        }
    import shapely

    # Holes are rings of their own; the script fills by the even-odd rule.
    parts = shapely.get_parts(_outline(model, tracks))
    rings = [ring for part in parts if part.geom_type == "Polygon" for ring in (part.exterior, *part.interiors)]
    scale = position_resolution(tracks)
    return {
        "closed": model.boundary.closed,
        "rings": [packer.add(shapely.get_coordinates(ring) / MM, scale=scale) for ring in rings],
    }


def triangles_of(boundary: Boundary) -> tuple[Array, IntArray]:
    """Return vertices (v, 3), m, and triangles (t, 3) of a solid, anticlockwise seen from outside."""
    if isinstance(boundary, Mesh):
        return boundary.vertices, boundary.triangles
    if isinstance(boundary, Surface) and boundary.kind == "torus":
        return torus(*boundary.reals)
    points = boundary.points(HULL_POINTS)
    return points, outward(points, convex_faces(points))


def outward(points: Array, rows: IntArray) -> IntArray:
    """Return the triangles of a convex solid, each turned so that it is anticlockwise seen from outside.

    `points` (v, 3) are the vertices, m, and `rows` (t, 3) the numbers of each triangle's corners, which are changed.
    """
    a, b, c = points[rows.T]
    # The normal of the corners' order points to the centre: the order has to be reversed.
    inwards = np.sum(np.cross(b - a, c - a) * (a - points.mean(axis=0)), axis=1) < 0.0
    rows[inwards] = rows[inwards][:, ::-1]
    return rows


def convex_faces(points: Array) -> IntArray:
    """Return the triangles (t, 3), numbers of points, of the convex hull of points (n, 3), m."""
    from scipy.spatial import ConvexHull

    return np.asarray(ConvexHull(points).simplices, dtype=np.int64)


def torus(major: float, minor: float) -> tuple[Array, IntArray]:
    """Return vertices (v, 3), m, and triangles (t, 3) of a torus about the z axis.

    It has `TORUS_QUADS` quadrilaterals round its axis and half as many round its tube, of two triangles each.
    """
    n, m = TORUS_QUADS, TORUS_QUADS // 2
    turn, tube = np.meshgrid(np.arange(n) * 2.0 * np.pi / n, np.arange(m) * 2.0 * np.pi / m, indexing="ij")
    # Distance from the axis: ((R + r cos v) cos u, (R + r cos v) sin u, r sin v).
    out = major + minor * np.cos(tube)
    vertices = np.stack([out * np.cos(turn), out * np.sin(turn), minor * np.sin(tube)], axis=-1).reshape(-1, 3)
    i, k = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    # Vertex numbers of each quadrilateral's corners, in order; both directions close on themselves.
    corner = [((i + a) % n * m + (k + b) % m).ravel() for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    rows = np.concatenate(
        [np.column_stack([corner[0], corner[1], corner[2]]), np.column_stack([corner[0], corner[2], corner[3]])]
    )
    return vertices, rows.astype(np.int64)


def _outline(model: Model, tracks: Sequence[Track]) -> Geometry:
    """Return what the model fills round the paths, mm: a closed outline as fine as the penetration depth asks for."""
    view = _view_around_paths(model, tracks)
    filled = filled_part(model, view)
    # Open, or far larger than the paths: only what the view holds of it.
    if not model.boundary.closed or view[2] - view[0] < MM * model.size:
        return filled
    import shapely

    depths = [np.linalg.norm(track.apart, axis=1).max(initial=0.0) for track in tracks if track.apart is not None]
    # mm: a thirtieth of the deepest penetration, but no finer than 1/200000 and no coarser than 1/2000 of the size.
    within = float(np.clip(MM * max(depths, default=0.0) / 30.0, MM * model.size / 2e5, MM * model.size / 2000.0))
    ring = shapely.make_valid(shapely.Polygon(MM * model.boundary.points(max(6000, 8 * len(model.boundary.corners)))))
    return shapely.simplify(ring, within)


def _view_around_paths(model: Model, tracks: Sequence[Track]) -> Box:
    """Return the box (mm) that is drawn of a model: round the paths, or the whole if it is not far larger."""
    points = MM * np.vstack([np.vstack([track.hip, track.ihip]) for track in tracks])
    low, high = points.min(axis=0), points.max(axis=0)
    # mm; at least 1.5 where nothing moves.
    half = 0.5 * VIEW_RATIO * max(float(np.ptp(points, axis=0).max()), 1.0)
    middle = 0.5 * (low + high)
    low, high = middle - half, middle + half
    if model.boundary.closed:
        bounds = MM * np.array(model.boundary.bounds)
        # A model that is not far larger is shown whole.
        if np.all(np.abs(bounds - np.tile(middle, 2)) < 3.0 * half):
            low, high = np.minimum(low, bounds[:2]), np.maximum(high, bounds[2:])
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])
