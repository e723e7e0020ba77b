"""The homothetic projection: the hand goes out on the ray from a centre, to where that meets the surface.

For any model that is star-shaped about the centre: see `kernel_centre`. With `gradient` the force is that of the
potential K H^2 (1 - lambda)^2 / 2, lambda = |HIP - c| / |IHIP - c|, see `potential`: continuous but at the centre,
normal, without memory, and conservative.

Where the hand moves by d the IHIP moves by at most |y_0 - c| / (h lambda) d.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import LawData, borrowing, inner
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import KIND, LINE, U0, U1, A, B, C, D, evaluate, piece_index
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import NORMAL, first_triangle_hit
from hapticeval.geometry.model import Model
from hapticeval.geometry.surface import Surface
from hapticeval.renderers.family import VERTICES
from hapticeval.renderers.kernel_centre import Centre, centre_of
from hapticeval.renderers.law import BILATERAL, ERROR, OWN, SCHEME, once, regulate, release
from hapticeval.renderers.outline import representation_of
from hapticeval.renderers.potential import CENTRE, SUPPORT
from hapticeval.renderers.projective import CompiledProjection
from hapticeval.renderers.regulation import GRADIENT
from hapticeval.scene import Scene
from hapticeval.types import Array

POTENTIAL = OWN
"""Where in `params` the potential's numbers begin."""

CUTS = 1024
"""Rays of the table that a closed smooth curve, or the arcs of one, are cut by."""

STEPS = 50
"""Most steps to the point of a curve on a ray, between two rays of the table."""


def homothetic(
    scene: Scene, representation: str, *, vertices: float = VERTICES, centre: ArrayLike | None = None
) -> CompiledProjection:
    """Return the projection on a representation of the scene's model, or in space on a mesh or an ellipsoid.

    `centre` (N,), m, is that of the kernel unless it is given. Raises as `centre_of` does.
    """
    model = scene.model
    if isinstance(model.boundary, Mesh) or (model.dimension == 3 and representation == "curve"):
        boundary = model.boundary if isinstance(model.boundary, Mesh) else model.surface
        middle = kernel_centre_of(model, boundary, centre)
        own = potential_numbers(middle)
        if isinstance(boundary, Mesh):
            faces, corners, tree = boundary.tables
            low, high = np.reshape(boundary.bounds, (2, 3))
            reach = 1.1 * float(np.linalg.norm(np.maximum(high - middle.point, middle.point - low)))
            return CompiledProjection(
                on_mesh, boundary, bilateral=scene.bilateral, own=[*own, reach], potential=own,
                support_range=middle.support_range, segments=faces, vertices=corners, tree=tree,
            )  # fmt: skip
        return CompiledProjection(
            in_space, boundary, bilateral=scene.bilateral, own=own, potential=own,
            support_range=middle.support_range, lookup=_quadric(boundary, middle),
        )  # fmt: skip
    curve, lengths = model.curve, (0.0, 0.0)
    if curve.closed:
        shape = representation_of(model, representation, int(vertices))
        curve, lengths = shape.surface, (shape.resolution, shape.standoff)
    middle = kernel_centre_of(model, curve, centre)
    own = potential_numbers(middle)
    return CompiledProjection(
        in_plane, curve, bilateral=scene.bilateral, own=own, potential=own, support_range=middle.support_range,
        segments=curve.pieces, lookup=ray_table(curve, own[CENTRE:]), resolution=lengths[0], standoff=lengths[1],
    )  # fmt: skip


def _quadric(boundary: Surface, centre: Centre) -> Array:
    """Return (1, 5): one over the squares of an ellipsoid's axes; 1 less the sum of c^2 / axis^2, and one over that."""
    axes = np.array([*boundary.reals, *boundary.reals, *boundary.reals][:3])
    centre_power = 1.0 - float(np.sum((centre.point / axes) ** 2))
    return np.array([[*axes**-2.0, centre_power, 1.0 / centre_power]])


def potential_numbers(centre: Centre, reach: float = 0.0) -> list[float]:
    """Return the numbers of the potential about a centre, with a `reach` (m)."""
    return [centre.support, reach, *centre.point.tolist()]


def kernel_centre_of(model: Model, boundary: Boundary, centre: ArrayLike | None) -> Centre:
    """Return the kernel's centre of a model's boundary, or of a representation's, made once; or the given one.

    `centre` (N,), m, is that. Raises as `centre_of` does.
    """
    if centre is not None:
        return centre_of(boundary, model.name, centre)
    return once(model, ("centre", id(boundary)), lambda: centre_of(boundary, model.name))


def ray_table(curve: Curve, centre: ArrayLike) -> Array:
    """Return the table in which the piece on a ray from `centre` (2,), m, is looked for, (m, 2).

    Columns: the turn from the first ray, as `_turn` measures it, and the curve's parameter. The last row is a whole
    turn, and the curve's end.
    """
    parts = []
    for row in curve.pieces:
        share = (row[U1] - row[U0]) / (curve.pieces[-1, U1] - curve.pieces[0, U0])
        count = 1 if row[KIND] == LINE else max(8, math.ceil(CUTS * share))
        parts.append(np.linspace(row[U0], row[U1], count, endpoint=False))
    parameters = np.concatenate(parts)
    if len(curve.samples):
        parameters = np.unique(np.concatenate([parameters, curve.samples[:-1, 0]]))
    directions = curve.position(parameters) - np.asarray(centre)
    turns = [_turn(*directions[0], *direction) for direction in directions]
    # 4 is a whole turn
    return np.vstack([np.column_stack([turns, parameters]), [4.0, curve.pieces[-1, U1]]])


@borrowing
def _turn(x0: float, y0: float, x: float, y: float) -> float:
    """Return how far (x, y) is turned from (x0, y0), from 0 to 4 for a whole turn: it grows with the angle."""
    # the point |x| + |y| = 1 in that direction, and how far round the diamond: no inverse tangent is needed
    along, up = x0 * x + y0 * y, x0 * y - y0 * x
    size = abs(along) + abs(up)
    if size == 0.0:
        return 0.0
    if up >= 0.0:
        return up / size if along >= 0.0 else 2.0 - up / size
    return 2.0 - up / size if along < 0.0 else 4.0 + up / size


@borrowing
def on_ray(pieces: Array, table: Array, cx: float, cy: float, ex: float, ey: float) -> tuple[int, float]:
    """Return the (piece, u) at which the ray from (cx, cy) along (ex, ey), m, meets the curve.

    `pieces` (n, k) are the curve's, and `table` (m, 2) is its `ray_table`. A ray without direction meets its first
    point.
    """
    first = evaluate(pieces[0], pieces[0, U0])
    turn = _turn(first[0] - cx, first[1] - cy, ex, ey)
    low, high = 0, table.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle, 0] <= turn:
            low = middle
        else:
            high = middle
    # between two rays of the table there is one piece
    u0, u1 = table[low, 1], table[high, 1]
    piece = piece_index(pieces, u0)
    if pieces[piece, KIND] == LINE:
        # the edge a + s t meets the ray where (a - c) x e + s (t x e) = 0
        tx, ty = pieces[piece, C], pieces[piece, D]
        away = ex * ty - ey * tx
        if away == 0.0:
            return piece, u0
        along = (ey * (pieces[piece, A] - cx) - ex * (pieces[piece, B] - cy)) / away
        return piece, min(max(pieces[piece, U0] + along, u0), u1)
    u = u0 + (u1 - u0) * (turn - table[low, 0]) / (table[high, 0] - table[low, 0])
    begin, end = u0, u1
    for _ in range(STEPS):
        # e x (y - c) grows with u, and is zero on the ray: Newton's method, kept in the bracket
        x, y, dx, dy, _, _ = evaluate(pieces[piece], u)
        miss, slope = ex * (y - cy) - ey * (x - cx), ex * dy - ey * dx
        if miss < 0.0:
            begin = u
        else:
            end = u
        next_u = u - miss / slope if slope > 0.0 else 0.5 * (begin + end)
        if not begin <= next_u <= end:
            next_u = 0.5 * (begin + end)
        if abs(next_u - u) <= 2e-16 * (abs(u1) + abs(u0)):
            return piece, next_u
        u = next_u
    return piece, u


@borrowing
def in_plane(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the homothetic projection on a curve or a polygon, of signature `LAW`: out along the ray.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    params, state = data.params, data.state
    cx, cy = params[POTENTIAL + CENTRE], params[POTENTIAL + CENTRE + 1]
    ex, ey = hip[0] - cx, hip[1] - cy
    piece, u = on_ray(data.segments, data.lookup, cx, cy, ex, ey)
    x, y, dx, dy, _, _ = evaluate(data.segments[piece], u)
    wx, wy = x - cx, y - cy
    # 1 - lambda, by the projection of one on the other: they are parallel but for rounding
    shortfall = 1.0 - (ex * wx + ey * wy) / (wx * wx + wy * wy)
    if params[BILATERAL] == 0.0 and not shortfall > 0.0:
        return release(state, hip, ihip, force)
    speed = math.hypot(dx, dy)
    ihip[0], ihip[1], state[ERROR + 2], state[ERROR + 3] = x, y, dy / speed, -dx / speed
    h = (wx * dy - wy * dx) / speed
    return regulate(params, state, hip, velocity, _gradient_length(params, shortfall, h), dt, ihip, force)


@inner
def _gradient_length(params: Array, shortfall: float, h: float) -> float:
    """Return H^2 (1 - lambda) / h for `gradient`: `potential.stretch` where all level curves are smaller copies."""
    support = params[POTENTIAL + SUPPORT]
    return support * support * shortfall / h if params[SCHEME] == GRADIENT else 0.0


@borrowing
def in_space(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the homothetic projection on an ellipsoid, whose `_quadric` is `lookup`, of signature `LAW`.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    row, params, state = data.lookup, data.params, data.state
    c = POTENTIAL + CENTRE
    # The ray c + s e is on the surface where the sum of (c + s e)^2 / axis^2 is 1. With lambda = 1 / s, and sums over
    # the axes, P lambda^2 - 2 (e.c / axis^2) lambda - e.e / axis^2 = 0, where P = 1 - c.c / axis^2 > 0.
    hand_squared, hand_dot_centre, centre_power = 0.0, 0.0, row[0, 3]
    for i in range(3):
        e = row[0, i] * (hip[i] - params[c + i])
        hand_squared, hand_dot_centre = (
            hand_squared + e * (hip[i] - params[c + i]),
            hand_dot_centre + e * params[c + i],
        )
    root_sum = math.sqrt(hand_dot_centre * hand_dot_centre + hand_squared * centre_power) + hand_dot_centre
    ratio = root_sum * row[0, 4]
    if params[BILATERAL] == 0.0 and not ratio < 1.0:
        return release(state, hip, ihip, force)
    # s = 1 / lambda, times e from the centre
    reach = centre_power / root_sum if ratio > 0.0 else 0.0
    for i in range(3):
        ihip[i] = params[c + i] + reach * (hip[i] - params[c + i])
    if not ratio > 0.0:  # the hand is at the centre: any ray will do, say that along x
        ratio = 0.0
        ihip[0] = math.sqrt(centre_power / row[0, 0] + params[c] * params[c])
    # the normal is along y / axis^2; h = n.(y - c)
    size, h = 0.0, 0.0
    for i in range(3):
        gradient = row[0, i] * ihip[i]
        state[ERROR + 3 + i] = gradient
        size += gradient * gradient
        h += gradient * (ihip[i] - params[c + i])
    size = 1.0 / math.sqrt(size)
    for i in range(3):
        state[ERROR + 3 + i] *= size
    return regulate(params, state, hip, velocity, _gradient_length(params, 1.0 - ratio, h * size), dt, ihip, force)


LENGTH = POTENTIAL + CENTRE + 3
"""In `params`, on a mesh: how far (m) from the centre no point of it lies."""


@borrowing
def on_mesh(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the homothetic projection on a triangle mesh, of signature `LAW`: one ray cast.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    params, state = data.params, data.state
    c = POTENTIAL + CENTRE
    centre = (params[c], params[c + 1], params[c + 2])
    from_centre = (hip[0] - centre[0], hip[1] - centre[1], hip[2] - centre[2])
    hand_distance = math.sqrt(
        from_centre[0] * from_centre[0] + from_centre[1] * from_centre[1] + from_centre[2] * from_centre[2]
    )
    ray = (params[LENGTH], 0.0, 0.0)  # of a hand at the centre: any direction will do
    if hand_distance > 0.0:
        scale = params[LENGTH] / hand_distance
        ray = (scale * from_centre[0], scale * from_centre[1], scale * from_centre[2])
    triangle, ray_share = first_triangle_hit(data.segments, data.vertices, data.tree, centre, ray, 0.0, 1.0)
    shortfall = 1.0 - hand_distance / (ray_share * params[LENGTH])
    if params[BILATERAL] == 0.0 and not shortfall > 0.0:
        return release(state, hip, ihip, force)
    h = 0.0
    for i in range(3):
        ihip[i], state[ERROR + 3 + i] = centre[i] + ray_share * ray[i], data.segments[triangle, NORMAL + i]
        h += state[ERROR + 3 + i] * ray_share * ray[i]
    return regulate(params, state, hip, velocity, _gradient_length(params, shortfall, h), dt, ihip, force)
