"""The minimum distance projection (4.2) on curves and polygons, and on surfaces in space: the hand goes to the
closest surface point, without memory; in contact while it is inside, or, in a bilateral scene, anywhere.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import LawData, compiled
from hapticeval.geometry.kernels import evaluate
from hapticeval.geometry.surface import Surface
from hapticeval.geometry.surface_kernels import bend, dot, place, times
from hapticeval.renderers.law import BILATERAL, ERROR, SCHEME, regulate, release
from hapticeval.renderers.outline import Representation, clear_of, frame, nearest_on, outline_in
from hapticeval.renderers.projective import CompiledProjection
from hapticeval.renderers.regulation import PP_PD_C
from hapticeval.types import Array


def nearest_in_plane(shown: Representation, *, bilateral: bool) -> CompiledProjection:
    """Return the projection to the globally nearest point of a curve or a polygon."""
    return CompiledProjection(in_plane, shown.surface, bilateral=bilateral, **shown.tables)


def nearest_in_space(surface: Surface, *, bilateral: bool) -> CompiledProjection:
    """Return the projection to the globally nearest point of a surface in space."""
    return CompiledProjection(in_space, surface, bilateral=bilateral, segments=surface.row[np.newaxis])


@compiled
def in_plane(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick on a curve or a polygon, of signature `LAW`."""
    b, params, state = outline_in(data), data.params, data.state
    x, y = hip[0], hip[1]
    bilateral = params[BILATERAL] != 0.0
    if not bilateral and b.stray > 0.0 and clear_of(b, x, y):
        return release(state, hip, ihip, force)
    piece, u, _, side = nearest_on(b, x, y)
    if not (bilateral or side < 0.0):
        return release(state, hip, ihip, force)
    ihip[0], ihip[1], state[ERROR + 2], state[ERROR + 3] = frame(b.pieces, b.joints, piece, u, x, y)
    fall = 0.0
    if params[SCHEME] == PP_PD_C:
        # κ (t·ẏ)^2: how fast the curve bends away from under the hand
        _, _, dx, dy, ddx, ddy = evaluate(b.pieces[piece], u)
        speed = math.hypot(dx, dy)
        along = (dx * velocity[0] + dy * velocity[1]) / speed
        fall = (dx * ddy - dy * ddx) / (speed * speed * speed) * (along * along)
    return regulate(params, state, hip, velocity, fall, dt, ihip, force)


@compiled
def in_space(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick on a surface in space, whose row `segments` holds, of signature `LAW`."""
    surface, params, state = data.segments[0], data.params, data.state
    foot, normal, distance = place(surface, (hip[0], hip[1], hip[2]))
    if params[BILATERAL] == 0.0 and not distance < 0.0:
        return release(state, hip, ihip, force)
    for i in range(3):
        ihip[i], state[ERROR + 3 + i] = foot[i], normal[i]
    fall = 0.0
    if params[SCHEME] == PP_PD_C:
        v = (velocity[0], velocity[1], velocity[2])
        fall = dot(v, times(bend(surface, foot, normal), v))
    return regulate(params, state, hip, velocity, fall, dt, ihip, force)
