"""The homothetic projection: the hand goes out on the ray from a centre, to where that meets the surface.

For any model that is star-shaped about the centre: see `kernel_centre`. With `gradient` the force is that of the
potential K H^2 (1 - lambda)^2 / 2, lambda = |HIP - c| / |IHIP - c|, see `potential`: continuous but at the centre,
normal, without memory, and conservative. Where the hand moves by d the IHIP moves by at most |y_0 - c| / (h lambda) d.
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
        middle = middle_of(model, boundary, centre)
        own = numbers(middle)
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
        shown = representation_of(model, representation, int(vertices))
        curve, lengths = shown.surface, (shown.resolution, shown.standoff)
    middle = middle_of(model, curve, centre)
    own = numbers(middle)
    return CompiledProjection(
        in_plane, curve, bilateral=scene.bilateral, own=own, potential=own, support_range=middle.support_range,
        segments=curve.pieces, lookup=rays(curve, own[CENTRE:]), resolution=lengths[0], standoff=lengths[1],
    )  # fmt: skip


def _quadric(boundary: Surface, centre: Centre) -> Array:
    """Return (1, 5): one over the squares of an ellipsoid's axes; 1 less the sum of c^2 / axis^2, and one over that."""
    axes = np.array([*boundary.reals, *boundary.reals, *boundary.reals][:3])
    rest = 1.0 - float(np.sum((centre.point / axes) ** 2))
    return np.array([[*axes**-2.0, rest, 1.0 / rest]])


def numbers(centre: Centre, reach: float = 0.0) -> list[float]:
    """Return the numbers of the potential about a centre, with a `reach` (m)."""
    return [centre.support, reach, *centre.point.tolist()]


def middle_of(model: Model, boundary: Boundary, centre: ArrayLike | None) -> Centre:
    """Return the centre of a model's boundary, or of that of a representation which is kept with it: made once."""
    if centre is not None:
        return centre_of(boundary, model.name, centre)
    return once(model, ("centre", id(boundary)), lambda: centre_of(boundary, model.name))


def rays(curve: Curve, centre: ArrayLike) -> Array:
    """Return the table in which the piece on a ray is looked for, (m, 2): turn from the first ray, and parameter.

    The turn is that of `_turn`. The last row is a whole turn, and the curve's end.
    """
    us = []
    for row in curve.pieces:
        share = (row[U1] - row[U0]) / (curve.pieces[-1, U1] - curve.pieces[0, U0])
        count = 1 if row[KIND] == LINE else max(8, math.ceil(CUTS * share))
        us.append(np.linspace(row[U0], row[U1], count, endpoint=False))
    found = np.concatenate(us)
    if len(curve.samples):
        found = np.unique(np.concatenate([found, curve.samples[:-1, 0]]))
    ways = curve.position(found) - np.asarray(centre)
    turns = [_turn(*ways[0], *way) for way in ways]
    return np.vstack([np.column_stack([turns, found]), [4.0, curve.pieces[-1, U1]]])


@borrowing
def _turn(x0: float, y0: float, x: float, y: float) -> float:
    """Return how far (x, y) is turned from (x0, y0), from 0 to 4 for a whole turn: it grows with the angle."""
    along, up = x0 * x + y0 * y, x0 * y - y0 * x
    size = abs(along) + abs(up)
    if size == 0.0:
        return 0.0
    if up >= 0.0:
        return up / size if along >= 0.0 else 2.0 - up / size
    return 2.0 - up / size if along < 0.0 else 4.0 + up / size


@borrowing
def on_ray(pieces: Array, table: Array, cx: float, cy: float, ex: float, ey: float) -> tuple[int, float]:
    """Return the (piece, u) at which the ray from (cx, cy) along (ex, ey) meets the curve; of no way its first."""
    first = evaluate(pieces[0], pieces[0, U0])
    turn = _turn(first[0] - cx, first[1] - cy, ex, ey)
    low, high = 0, table.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle, 0] <= turn:
            low = middle
        else:
            high = middle
    u0, u1 = table[low, 1], table[high, 1]
    piece = piece_index(pieces, u0)
    if pieces[piece, KIND] == LINE:
        tx, ty = pieces[piece, C], pieces[piece, D]
        away = ex * ty - ey * tx
        if away == 0.0:
            return piece, u0
        along = (ey * (pieces[piece, A] - cx) - ex * (pieces[piece, B] - cy)) / away
        return piece, min(max(pieces[piece, U0] + along, u0), u1)
    u = u0 + (u1 - u0) * (turn - table[low, 0]) / (table[high, 0] - table[low, 0])
    begin, end = u0, u1
    for _ in range(STEPS):
        x, y, dx, dy, _, _ = evaluate(pieces[piece], u)
        off, slope = ex * (y - cy) - ey * (x - cx), ex * dy - ey * dx
        if off < 0.0:
            begin = u
        else:
            end = u
        following = u - off / slope if slope > 0.0 else 0.5 * (begin + end)
        if not begin <= following <= end:
            following = 0.5 * (begin + end)
        if abs(following - u) <= 2e-16 * (abs(u1) + abs(u0)):
            return piece, following
        u = following
    return piece, u


@borrowing
def in_plane(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick on a curve or a polygon, of signature `LAW`."""
    params, state = data.params, data.state
    cx, cy = params[POTENTIAL + CENTRE], params[POTENTIAL + CENTRE + 1]
    ex, ey = hip[0] - cx, hip[1] - cy
    piece, u = on_ray(data.segments, data.lookup, cx, cy, ex, ey)
    x, y, dx, dy, _, _ = evaluate(data.segments[piece], u)
    wx, wy = x - cx, y - cy
    out = 1.0 - (ex * wx + ey * wy) / (wx * wx + wy * wy)
    if params[BILATERAL] == 0.0 and not out > 0.0:
        return release(state, hip, ihip, force)
    speed = math.hypot(dx, dy)
    ihip[0], ihip[1], state[ERROR + 2], state[ERROR + 3] = x, y, dy / speed, -dx / speed
    h = (wx * dy - wy * dx) / speed
    return regulate(params, state, hip, velocity, _known(params, out, h), dt, ihip, force)


@inner
def _known(params: Array, out: float, h: float) -> float:
    """Return H^2 (1 - lambda) / h for `gradient`: `potential.stretch` where all level curves are smaller copies."""
    support = params[POTENTIAL + SUPPORT]
    return support * support * out / h if params[SCHEME] == GRADIENT else 0.0


@borrowing
def in_space(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick on a sphere or an ellipsoid, whose `_quadric` is `lookup`, of signature `LAW`."""
    row, params, state = data.lookup, data.params, data.state
    c = POTENTIAL + CENTRE
    # the ray c + s e is on the surface where the sum of (c + s e)^2 / axis^2 is 1; lambda is one over that s
    square, along, rest = 0.0, 0.0, row[0, 3]
    for i in range(3):
        e = row[0, i] * (hip[i] - params[c + i])
        square, along = square + e * (hip[i] - params[c + i]), along + e * params[c + i]
    whole = math.sqrt(along * along + square * rest) + along
    share = whole * row[0, 4]
    if params[BILATERAL] == 0.0 and not share < 1.0:
        return release(state, hip, ihip, force)
    reach = rest / whole if share > 0.0 else 0.0
    for i in range(3):
        ihip[i] = params[c + i] + reach * (hip[i] - params[c + i])
    if not share > 0.0:
        share = 0.0
        ihip[0] = math.sqrt(rest / row[0, 0] + params[c] * params[c])
    size, h = 0.0, 0.0
    for i in range(3):
        across = row[0, i] * ihip[i]
        state[ERROR + 3 + i] = across
        size += across * across
        h += across * (ihip[i] - params[c + i])
    size = 1.0 / math.sqrt(size)
    for i in range(3):
        state[ERROR + 3 + i] *= size
    return regulate(params, state, hip, velocity, _known(params, 1.0 - share, h * size), dt, ihip, force)


LENGTH = POTENTIAL + CENTRE + 3
"""In `params`, on a mesh: how far (m) from the centre no point of it lies."""


@borrowing
def on_mesh(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick on a triangle mesh, of signature `LAW`: one ray cast."""
    params, state = data.params, data.state
    c = POTENTIAL + CENTRE
    centre = (params[c], params[c + 1], params[c + 2])
    way = (hip[0] - centre[0], hip[1] - centre[1], hip[2] - centre[2])
    far = math.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    ray = (params[LENGTH], 0.0, 0.0)
    if far > 0.0:
        scale = params[LENGTH] / far
        ray = (scale * way[0], scale * way[1], scale * way[2])
    k, share = first_triangle_hit(data.segments, data.vertices, data.tree, centre, ray, 0.0, 1.0)
    out = 1.0 - far / (share * params[LENGTH])
    if params[BILATERAL] == 0.0 and not out > 0.0:
        return release(state, hip, ihip, force)
    h = 0.0
    for i in range(3):
        ihip[i], state[ERROR + 3 + i] = centre[i] + share * ray[i], data.segments[k, NORMAL + i]
        h += state[ERROR + 3 + i] * share * ray[i]
    return regulate(params, state, hip, velocity, _known(params, out, h), dt, ihip, force)
