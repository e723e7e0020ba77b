"""The minimum distance projection (4.2) on curves and polygons, and on surfaces in space: the hand goes to the
closest surface point, without memory; in contact while it is inside, or, in a bilateral scene, anywhere.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import LawData, as_record, borrowing, record_type
from hapticeval.geometry.kernels import evaluate
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import closest_on_mesh
from hapticeval.geometry.surface import apply_matrix, closest_on_surface, dot, shape_operator
from hapticeval.renderers.contour import nearest_on_level_set
from hapticeval.renderers.family import GRID, VERTICES
from hapticeval.renderers.law import GAINS, PAST, regulate, release
from hapticeval.renderers.outline import frame, is_clear_of, nearest_on, outline_in, representation_of
from hapticeval.renderers.projective import CompiledProjection, Projection
from hapticeval.renderers.regulation import PP_PD_C
from hapticeval.scene import Scene
from hapticeval.types import Array

SEARCH = record_type("triangle", base=PAST)
"""The `state` on a mesh: with the closest triangle of the last tick, at which the search for the next begins."""


def nearest(scene: Scene, representation: str, *, vertices: float = VERTICES, grid: float = GRID) -> Projection:
    """Return the projection on a representation of the scene's model; in space on the exact surface.

    A mesh is its own polygon.
    """
    model = scene.model
    if isinstance(model.boundary, Mesh) and representation in ("curve", "polygon"):
        mesh, (faces, corners, tree) = model.boundary, model.boundary.tables
        return CompiledProjection(
            on_mesh, mesh, bilateral=scene.bilateral, state=SEARCH, segments=faces, vertices=corners, tree=tree
        )
    if model.dimension == 3 and representation == "curve":
        row = model.surface.row[np.newaxis]
        return CompiledProjection(in_space, model.surface, bilateral=scene.bilateral, exact=True, segments=row)
    if representation == "level-set" and model.curve.closed:
        return nearest_on_level_set(model, (int(grid), int(grid)), bilateral=scene.bilateral)
    shape = representation_of(model, representation, int(vertices))
    exact = representation == "curve"
    return CompiledProjection(in_plane, shape.surface, bilateral=scene.bilateral, exact=exact, **shape.tables)


@borrowing
def in_plane(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of minimum distance on a curve or a polygon, of signature `LAW`: (4.2), then the scheme's force.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    b, params, state, gains = outline_in(data), data.params, data.state, as_record(data.params, GAINS)
    x, y, normal = hip[0], hip[1], as_record(state, PAST).normal
    bilateral = gains.bilateral != 0.0
    if not bilateral and b.stray > 0.0 and is_clear_of(b, x, y):  # without the exact search: it costs more
        return release(state, hip, ihip, force)
    piece, u, _, side = nearest_on(b, x, y)
    if not (bilateral or side < 0.0):
        return release(state, hip, ihip, force)
    ihip[0], ihip[1], normal[0], normal[1] = frame(b.pieces, b.joints, piece, u, x, y)
    centripetal = 0.0
    if gains.scheme == PP_PD_C:
        # κ (t·ẏ)^2: how fast the curve bends away from under the hand
        _, _, dx, dy, ddx, ddy = evaluate(b.pieces[piece], u)
        speed = math.hypot(dx, dy)
        tangential_velocity = (dx * velocity[0] + dy * velocity[1]) / speed
        centripetal = (dx * ddy - dy * ddx) / (speed * speed * speed) * (tangential_velocity * tangential_velocity)
    return regulate(params, state, hip, velocity, centripetal, dt, ihip, force)


@borrowing
def in_space(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of minimum distance on a sphere or an ellipsoid, whose row `segments` holds, of signature `LAW`: (4.2).

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    surface, params, state, gains = data.segments[0], data.params, data.state, as_record(data.params, GAINS)
    foot, normal, distance = closest_on_surface(surface, (hip[0], hip[1], hip[2]))
    if gains.bilateral == 0.0 and not distance < 0.0:
        return release(state, hip, ihip, force)
    past = as_record(state, PAST)
    for i in range(3):
        ihip[i], past.normal[i] = foot[i], normal[i]
    centripetal = 0.0
    if gains.scheme == PP_PD_C:
        # v.W v with the shape operator W: κ v_t^2 along the motion, m/s^2
        v = (velocity[0], velocity[1], velocity[2])
        centripetal = dot(v, apply_matrix(shape_operator(surface, foot, normal), v))
    return regulate(params, state, hip, velocity, centripetal, dt, ihip, force)


@borrowing
def on_mesh(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of minimum distance on a triangle mesh, of signature `LAW`: (4.2). Flat faces have no curvature.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    params, state, search = data.params, data.state, as_record(data.state, SEARCH)
    p, last = (hip[0], hip[1], hip[2]), int(search.triangle)
    k, foot, normal, distance = closest_on_mesh(data.segments, data.vertices, data.tree, p, last)
    search.triangle = k  # the hand is near it at the next tick: the search begins there
    if as_record(params, GAINS).bilateral == 0.0 and not distance < 0.0:
        return release(state, hip, ihip, force)
    for i in range(3):
        ihip[i], search.normal[i] = foot[i], normal[i]
    return regulate(params, state, hip, velocity, 0.0, dt, ihip, force)
