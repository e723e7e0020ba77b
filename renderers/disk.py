"""The projection through a transformation to the disk (5.17): what the mapping and conformal renderers share.

The hand is mapped to the disk, moved radially onto the circle, and that point is mapped back to the surface. Only the
boundary is mapped back, so that the IHIP lies on the exact curve: the standoff is zero. The side of the hand is the
exact curve's too.

Outside, the hand is free; in a bilateral scene it goes to the nearest surface point there, for a map covers the inside
alone. Without memory. Lines of projection are curved: regulate with (5.21), `transversal`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from hapticeval.compiled import borrowing, inner
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import piece_index
from hapticeval.geometry.polygon_kernels import nearest_kernel, side_kernel
from hapticeval.records import as_record
from hapticeval.renderers.maps import conformal_kernels
from hapticeval.renderers.maps import flow_map as flow
from hapticeval.renderers.maps.conformal import ConformalMap, conformal_map
from hapticeval.renderers.maps.flow import FlowSettings
from hapticeval.renderers.maps.front import track_front
from hapticeval.renderers.nearest import nearest
from hapticeval.renderers.outline import Outline, Representation, frame, nearest_on, outline_in, outline_of
from hapticeval.renderers.projective import Projection, once
from hapticeval.renderers.regulation_kernel import GAINS, PAST, regulate, release
from hapticeval.scene import Scene
from hapticeval.types import Array


class DiskData(NamedTuple):
    """What a law through the disk works on: a `LawData`, and the tables of the map, a `Chart` or `DiskTables`."""

    params: Array
    pieces: Array
    joins: Array
    lookup: Array
    vertices: Array
    tree: Array
    state: Array
    map: Any


class DiskProjection(Projection):
    """Projects by the kernel `law` through a `map` to the disk, whose tables it is given.

    `resolution` (m) is the length of surface over which the map itself is blurred.
    """

    def __init__(
        self, law: Callable[..., int], disk_map: ConformalMap | flow.FlowMap, curve: Curve, *, bilateral: bool,
        resolution: float,
    ) -> None:  # fmt: skip
        shape = Representation(outline_of(curve), curve, resolution, 0.0)
        super().__init__(
            law, curve, bilateral=bilateral, smooth_only=True, arrange=lambda data: DiskData(*data, disk_map.tables),
            **shape.tables,
        )  # fmt: skip
        self.map = disk_map


@borrowing
def through_flow(
    data: DiskData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick through the flow's map, of signature `LAW` but for its data: (5.17), then the scheme's force.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    Returns 0.
    """
    outline = outline_in(data)
    inside, u = _is_inside(outline, hip[0], hip[1]), 0.0
    if inside:
        u = flow.project_to_parameter(data.map, hip[0], hip[1])
        if math.isnan(u):  # in the sliver between the curve and the chords of the grid
            _, nearest_u, _, _ = nearest_on(outline, hip[0], hip[1])
            u = flow.surface_parameter(data.map, flow.angle_of(data.map, nearest_u))
    return _answer(data, outline, inside, u, hip, velocity, dt, ihip, force)


@borrowing
def through_conformal_map(
    data: DiskData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick through the conformal map, of signature `LAW` but for its data: (5.17), then the scheme's force.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    Returns 0.
    """
    outline = outline_in(data)
    inside, u = _is_inside(outline, hip[0], hip[1]), 0.0
    if inside:
        u = conformal_kernels.project_to_parameter(data.map, hip[0], hip[1])
    return _answer(data, outline, inside, u, hip, velocity, dt, ihip, force)


@inner
def _answer(
    data: DiskData, outline: Outline, inside: bool, u: float, hip: Array, velocity: Array, dt: float, ihip: Array,
    force: Array,
) -> int:  # fmt: skip
    """Write IHIP and force of a HIP: at the parameter u where it is `inside`. Returns 0."""
    params, state = data.params, data.state
    if not inside and as_record(params, GAINS).bilateral == 0.0:
        return release(state, hip, ihip, force)
    piece, normal = 0, as_record(state, PAST).normal
    if inside:
        piece = piece_index(outline.pieces, u)
    else:
        piece, u, _, _ = nearest_on(outline, hip[0], hip[1])
    ihip[0], ihip[1], normal[0], normal[1] = frame(outline.pieces, outline.joins, piece, u, hip[0], hip[1])
    return regulate(params, state, hip, velocity, 0.0, 0.0, dt, ihip, force)


@borrowing
def _is_inside(outline: Outline, x: float, y: float) -> bool:
    """Whether a point is inside the curve. Where squares of distances overflow, it is outside."""
    edge, along, distance2 = nearest_kernel(outline.vertices, outline.tree, x, y)
    distance = math.sqrt(distance2)
    if not math.isfinite(distance):
        return False
    # the curve lies within `stray` of its chords: beyond that the polygon of the chords tells the side
    if distance > outline.stray:
        return side_kernel(outline.vertices, edge, along, x, y) < 0.0
    if outline.stray == 0.0:
        return False
    _, _, _, side = nearest_on(outline, x, y)
    return side < 0.0


FLOW_CELLS = 200
"""Cells of the flow grid along the model's longer side."""

LINE_GAP = 1e-6
"""Least distance of transversal lines as a share of their mean: enough to keep their order, and no more."""


FRONT_NODES = 800
"""Nodes of a tracked front."""


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
    disk_map = flow.flow_map(scene.model, FlowSettings(cells=int(cells), lines=lines, levels=levels, gap=gap))
    curve = scene.model.curve
    return DiskProjection(through_flow, disk_map, curve, bilateral=scene.bilateral, resolution=disk_map.spacing)


def by_tracked_front(scene: Scene, representation: str, *, nodes: float = FRONT_NODES) -> Projection:
    """Return the projection of `by_flow_map` with the flow by points on its front: what errors of that count from.

    Raises as `by_flow_map` does.
    """
    if not scene.model.curve.closed:
        return nearest(scene, representation)
    curve = scene.model.curve
    disk_map = flow.FlowMap(curve, flow.build_chart(scene.model, track_front(scene.model, int(nodes))))
    return DiskProjection(through_flow, disk_map, curve, bilateral=scene.bilateral, resolution=disk_map.spacing)


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
    return DiskProjection(through_conformal_map, disk_map, curve, bilateral=scene.bilateral, resolution=disk_map.blur)
