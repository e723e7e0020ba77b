"""The projection through a transformation to the disk (5.17): what the mapping and conformal renderers share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import piece_index
from hapticeval.geometry.polygon_kernels import nearest_kernel, side_kernel
from hapticeval.renderers.maps.conformal import conformal_map
from hapticeval.renderers.maps.flow import FlowSettings
from hapticeval.renderers.maps.flow_map import flow_map
from hapticeval.renderers.nearest import nearest
from hapticeval.renderers.outline import Outline, frame, nearest_on, outline_of
from hapticeval.renderers.projective import Projected, Projection, once
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray

DISTANCE_ROUNDING = 1e-14
"""Of a distance, in parts of the coordinates that it is made of."""


class DiskMap(Protocol):
    """A one-to-one transformation of the inside of a closed curve to the unit disk, and back on the boundary.

    Every point that is strictly inside the exact curve has an answer, finite, also where a table or grid ends short
    of the boundary. The three methods agree to the last bit: `parameter(x, y)` is `surface(to_angle([[x, y]]))[0]`.
    """

    def to_angle(self, points: Array) -> Array:
        """Return the angles (n,), rad, on the disk's circle that points (n, 2), m, inside the curve are mapped to."""

    def surface(self, angles: Array) -> Array:
        """Return the curve's parameters u (n,), inside its `u_range`, at boundary angles (n,), rad, of any turn."""

    def parameter(self, x: float, y: float) -> float:
        """The scalar path for one tick, in compiled code: the u at the boundary angle of one point inside, m."""


class DiskProjection:
    """Maps the hand to the disk, moves it radially onto the circle, and maps that point back to the surface (5.17).

    Only the boundary is mapped back, so that the IHIP lies on the exact curve: `standoff` is zero. The side of the hand
    is the exact curve's too.

    Outside, the hand is free; with `bilateral` it goes to the nearest surface point there, for the map covers the
    inside alone. Without memory. `resolution` (m) is the length of surface over which the map itself is blurred.

    Lines of projection are curved: regulate with (5.21), `transversal`.
    """

    smooth_only = True
    potential: Sequence[float] = ()
    support_range: Sequence[float] = ()

    def __init__(self, disk: DiskMap, curve: Curve, *, bilateral: bool, resolution: float = 0.0) -> None:
        self.surface = curve
        self.resolution = resolution
        self.standoff = 0.0
        self.map = disk
        self._boundary = outline_of(curve)
        self._bilateral = bilateral

    def project(self, hip: Array) -> Projected:
        """Project a HIP (2,), m, in one tick (5.17)."""
        x, y = hip.tolist()
        inside, _ = _side_and_clearance(self._boundary, x, y)
        u = self.map.parameter(x, y) if inside else math.nan
        px, py, nx, ny = _ihip_and_normal(self._boundary, self._bilateral, inside, u, x, y)
        return Projected(np.array((px, py)), np.array((nx, ny)), inside or self._bilateral)

    def trace(self, hips: Array) -> Projected:
        """Project HIPs (n, 2), m, a tick a row."""
        inside = _are_inside(self._boundary, hips)
        # (5.17): to the disk, radially out to its circle, and back to the boundary
        parameters = np.full(inside.size, np.nan)
        parameters[inside] = self.map.surface(self.map.to_angle(np.ascontiguousarray(hips[inside])))
        answers = _ihips_and_normals(self._boundary, self._bilateral, inside, parameters, hips)
        return Projected(answers[:, :2], answers[:, 2:], np.ones_like(inside) if self._bilateral else inside)


@compiled
def _side_and_clearance(outline: Outline, x: float, y: float) -> tuple[bool, float]:
    """Whether a point is inside the curve, and a distance to which every point is on the same side as it.

    Where squares of distances overflow, a point is outside, and nothing is known of others: the distance is negative.
    """
    edge, along, distance2 = nearest_kernel(outline.vertices, outline.tree, x, y)
    distance = math.sqrt(distance2)
    if not math.isfinite(distance):
        return False, -1.0
    # the curve lies within `stray` of its chords: beyond that the polygon of the chords tells the side
    if distance > outline.stray:
        return side_kernel(outline.vertices, edge, along, x, y) < 0.0, distance - outline.stray
    if outline.stray == 0.0:
        return False, 0.0
    _, _, distance, side = nearest_on(outline, x, y)
    return side < 0.0, distance


@compiled
def _are_inside(outline: Outline, points: Array) -> BoolArray:
    """Whether each point is inside: one close to the point before it, for its distance, need not be looked up.

    Distances are known to the rounding of coordinates.
    """
    out = np.empty(points.shape[0], np.bool_)
    inside, clear, x0, y0 = False, -1.0, 0.0, 0.0
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        if not math.hypot(x - x0, y - y0) < clear:  # it may have crossed the curve since (x0, y0)
            inside, clear = _side_and_clearance(outline, x, y)
            clear = 0.999999 * clear - DISTANCE_ROUNDING * (abs(x) + abs(y) + clear)
            x0, y0 = x, y
        out[i] = inside
    return out


@compiled
def _ihip_and_normal(
    outline: Outline, bilateral: bool, inside: bool, u: float, x: float, y: float
) -> tuple[float, float, float, float]:
    """IHIP and normal of a HIP: at the parameter u where it is `inside`."""
    if inside:
        return frame(outline.pieces, outline.joins, piece_index(outline.pieces, u), u, x, y)
    if not bilateral:  # free space
        return x, y, 0.0, 0.0
    piece, u, _, _ = nearest_on(outline, x, y)
    return frame(outline.pieces, outline.joins, piece, u, x, y)


@compiled
def _ihips_and_normals(outline: Outline, bilateral: bool, inside: BoolArray, parameters: Array, hips: Array) -> Array:
    """IHIP and normal (n, 4) a row of `hips` (n, 2)."""
    out = np.empty((hips.shape[0], 4))
    for i in range(hips.shape[0]):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = _ihip_and_normal(
            outline, bilateral, inside[i], parameters[i], hips[i, 0], hips[i, 1]
        )
    return out


FLOW_CELLS = 200
"""Cells of the flow grid along the model's longer side."""

LINE_GAP = 1e-6
"""Least distance of transversal lines as a share of their mean: enough to keep their order, and no more."""


def by_flow_map(
    scene: Scene,
    representation: str,
    *,
    cells: float = FLOW_CELLS,
    lines: float | None = None,
    levels: float | None = None,
    gap: float = LINE_GAP,
) -> Projection:
    """Return the projection through the flow map of a model's inside; the nearest point outside, where bilateral.

    The IHIP lies on the exact curve, linear in the curve's parameter between the starts of the transversal lines, whose
    distance is the `resolution`.

    On the unbounded line the lines are vertical and lead to the nearest point: that is used there. Raises
    `FlowSplitError`, `FlowCollapseError` and `FoldedGridError` for a model that the flow does not map.
    """
    if not scene.model.curve.closed:
        return nearest(scene, representation)
    lines, levels = (None if count is None else int(count) for count in (lines, levels))
    disk_map = flow_map(scene.model, FlowSettings(cells=int(cells), lines=lines, levels=levels, gap=gap))
    return DiskProjection(disk_map, scene.model.curve, bilateral=scene.bilateral, resolution=disk_map.spacing)


def by_conformal_map(scene: Scene, representation: str, *, nodes: float | None = None) -> Projection:
    """Return the projection through the conformal map of a model's inside (5.17), (8.2.1).

    It has `nodes` boundary nodes, or as many as it needs. On the unbounded line the map's limit is the vertical
    projection, which is the nearest point: that is used there. Raises `CrowdingError` and `InputError` as
    `conformal_map` does.
    """
    if not scene.model.curve.closed:
        return nearest(scene, representation)
    curve, count = scene.model.curve, None if nodes is None else int(nodes)
    disk_map = once(scene.model, ("conformal", count), lambda: conformal_map(curve, nodes=count))
    return DiskProjection(disk_map, curve, bilateral=scene.bilateral, resolution=disk_map.blur)
