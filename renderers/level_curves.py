"""The projection along level curves that keep the surface's normals: parallel curves first, then smaller copies.

See `potential`. Down to half of min(1 / kappa_max, h_min) it is minimum distance, with the same force; deeper, where
minimum distance would pop through the medial axis, the level curves shrink to the centre of the kernel.

At a convex corner parallel curves cross themselves at once: on a model that has one it is `homothetic`; and so it is on
a circle and a sphere, whose parallel curves are smaller copies.

The level t of a hand x is where x, enlarged by 1 / A(t) about the centre, lies b(t) deep: the depth falls with t and b
does not, so that there is one.

Newton's method along the curve finds it in a few evaluations from the nearest point; where it does not settle (it
starts beyond the medial axis, or in the fan of a concave corner) the nearest points of the enlarged x are asked for,
with the level kept between a lower and an upper bound.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import LawData, borrowing
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import ARC, CASSINIAN, ELLIPSE, KIND, U0, U1, A, B, C, E, evaluate, piece_index
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.surface import Surface, closest_on_surface, dot, plus
from hapticeval.renderers.law import BILATERAL, ERROR, OWN, once, regulate, release
from hapticeval.renderers.outline import frame, is_clear_of, nearest_on, outline_in, representation_of
from hapticeval.renderers.potential import CENTRE, LAST, PARALLEL, REACH, SUPPORT, level_at, level_values, stretch
from hapticeval.renderers.projective import CompiledProjection
from hapticeval.renderers.rays import homothetic, kernel_centre_of, potential_numbers
from hapticeval.scene import Scene
from hapticeval.types import Array

POTENTIAL = OWN + 1
"""Where in `params` the potential's numbers begin: behind the `stray` of the outline."""

NEWTON, ROUNDS = 12, 60
"""Most steps along the curve, and most nearest points that are asked for after that."""

SETTLED, ROUNDING = 1e-14, 4e-16
"""Shares of H and of the coordinates by which the tangent's point may miss the hand along the tangent."""

CLOSE = 4e-15
"""Share of H below which a change of the level is rounding."""

EVEN = 1e-12
"""Share of H below which a difference of support distances is rounding."""

SAFE = 1.0 - 1e-6
"""Share of the smallest radius of curvature, which is sampled, that is believed."""


def combescure(scene: Scene, representation: str, *, centre: ArrayLike | None = None) -> CompiledProjection:
    """Return the projection on the scene's exact curve, or on a sphere or an ellipsoid.

    `centre` (N,), m, is that of the kernel unless it is given. Raises as `kernel_centre.centre_of` does.
    """
    model = scene.model
    boundary = model.boundary
    middle = kernel_centre_of(model, boundary, centre)
    is_round = middle.largest - middle.smallest <= EVEN * middle.support
    if is_round or isinstance(boundary, Mesh) or any(corner.convex for corner in boundary.corners):
        return homothetic(scene, representation, centre=centre)
    # m of the potential: neither curvature nor support distance may let level curves cross
    shape = model.surface if model.dimension == 3 else model.curve
    curvature = once(model, "largest curvature", lambda: largest_curvature(shape))
    own = potential_numbers(middle, min(SAFE / curvature, middle.smallest) if curvature > 0.0 else middle.smallest)
    if model.dimension == 3:
        row = model.surface.row[np.newaxis]
        return CompiledProjection(
            in_space, boundary, bilateral=scene.bilateral, own=[0.0, *own], potential=own,
            support_range=middle.support_range, segments=row,
        )  # fmt: skip
    tables = representation_of(model, "curve").tables
    return CompiledProjection(
        in_plane, model.curve, bilateral=scene.bilateral, potential=own, support_range=middle.support_range,
        **{**tables, "own": [*tables["own"], *own]},
    )  # fmt: skip


def largest_curvature(boundary: Curve | Surface) -> float:
    """Return the largest curvature (1/m) of a curve, or the largest principal one of a sphere or an ellipsoid."""
    if isinstance(boundary, Surface):  # at the end of the longest axis, across the shortest
        axes = boundary.reals
        return max(axes) / min(axes) ** 2
    largest = 0.0
    for row in boundary.pieces:
        if row[KIND] == ARC:
            largest = max(largest, row[E] / row[C])
        elif row[KIND] == ELLIPSE:
            largest = max(row[A : B + 1]) / min(row[A : B + 1]) ** 2
        elif row[KIND] == CASSINIAN:
            # sampled, and four times more finely between the neighbours of the largest
            us = boundary.samples[:, 0]
            for _ in range(4):
                top = int(np.argmax(boundary.curvature(us)))
                us = np.linspace(us[max(top - 1, 0)], us[min(top + 1, us.size - 1)], 65)
            largest = float(np.max(boundary.curvature(us)))
    return float(largest)


@borrowing
def _follow(data: LawData, x: float, y: float, piece: int, u: float) -> tuple[bool, int, float, float]:
    """Return whether Newton's method finds (piece, u) and the level t of a hand at (x, y), from a surface point on.

    At each point t is such that the hand is on the tangent of the level curve there; what it misses the hand by along
    that, R = T.(x - y_t), changes along the surface by -A (1 - b kappa) + kappa R A' T.(y_0 - c) / v.
    """
    pieces, params = data.segments, data.params
    support = params[POTENTIAL + SUPPORT]
    cx, cy = params[POTENTIAL + CENTRE], params[POTENTIAL + CENTRE + 1]
    first_u, last_u = pieces[0, U0], pieces[pieces.shape[0] - 1, U1]
    ex, ey = x - cx, y - cy
    settled = SETTLED * support + ROUNDING * (abs(x) + abs(y) + abs(cx) + abs(cy))
    t = -1.0
    for _ in range(NEWTON):
        px, py, dx, dy, ddx, ddy = evaluate(pieces[piece], u)
        speed = math.hypot(dx, dy)
        tx, ty, wx, wy = dx / speed, dy / speed, px - cx, py - cy
        h, along = wx * ty - wy * tx, wx * tx + wy * ty  # with n = (T_y, -T_x): n.(y_0 - c) and T.(y_0 - c)
        t = level_at(params, POTENTIAL, ex * ty - ey * tx, h)
        if not 0.0 <= t < support:
            break
        a, b, da, db = level_values(params, POTENTIAL, t)
        # R, and its rate along the surface with its sign turned
        miss = ex * tx + ey * ty - a * along
        if abs(miss) <= settled:
            return True, piece, u, t
        curvature = (dx * ddy - dy * ddx) / (speed * speed * speed)
        rate = a * (1.0 - b * curvature) - curvature * miss * da * along / (a * db - da * (h - b))
        if not rate > 0.0:  # beyond the medial axis: another foot is the right one
            break
        u += miss / (rate * speed)
        # round a closed curve, and against rounding at its ends
        u -= math.floor((u - first_u) / (last_u - first_u)) * (last_u - first_u)
        u = min(max(u, first_u), last_u)
        piece = piece_index(pieces, u)
    return False, piece, u, t


@borrowing
def _search(data: LawData, x: float, y: float) -> tuple[float, float, float, float, float]:
    """Return IHIP, normal and level t of a hand at (x, y) below the parallel curves, by nearest points alone."""
    boundary, params = outline_in(data), data.params
    support, reach = params[POTENTIAL + SUPPORT], params[POTENTIAL + REACH]
    cx, cy = params[POTENTIAL + CENTRE], params[POTENTIAL + CENTRE + 1]
    low, high = PARALLEL * reach, support
    px, py, nx, ny, t = x, y, 0.0, 0.0, LAST * reach
    for _ in range(ROUNDS):
        a, b, _, _ = level_values(params, POTENTIAL, t)
        # the hand enlarged by 1 / A about the centre: at its level it lies b deep under its nearest point
        qx, qy = cx + (x - cx) / a, cy + (y - cy) / a
        piece, u, distance, side = nearest_on(boundary, qx, qy)
        px, py, nx, ny = frame(boundary.pieces, boundary.joints, piece, u, qx, qy)
        if -side * distance > b:
            low = t
        else:
            high = t
        # the level by the tangent there, if that is between the bounds
        h = nx * (px - cx) + ny * (py - cy)
        next_t = level_at(params, POTENTIAL, nx * (x - cx) + ny * (y - cy), h) if h > 0.0 else low
        if abs(next_t - t) <= CLOSE * support:
            break
        t = next_t if low < next_t < high else 0.5 * (low + high)
    return px, py, nx, ny, t


@borrowing
def in_plane(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the Combescure projection on a curve, of signature `LAW`: the hand's level curve, and its normal.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    boundary, params, state = outline_in(data), data.params, data.state
    x, y, bilateral = hip[0], hip[1], params[BILATERAL] != 0.0
    if not bilateral and is_clear_of(boundary, x, y):
        return release(state, hip, ihip, force)
    piece, u, distance, side = nearest_on(boundary, x, y)
    if not (bilateral or side < 0.0):
        return release(state, hip, ihip, force)
    t = -side * distance
    # among the parallel curves the nearest point is the IHIP; deeper, Newton's method from there, then the search
    has_foot = t <= PARALLEL * params[POTENTIAL + REACH]
    if not has_foot:
        has_foot, piece, u, t = _follow(data, x, y, piece, u)
    if has_foot:
        ihip[0], ihip[1], state[ERROR + 2], state[ERROR + 3] = frame(boundary.pieces, boundary.joints, piece, u, x, y)
    else:
        ihip[0], ihip[1], state[ERROR + 2], state[ERROR + 3], t = _search(data, x, y)
    cx, cy = params[POTENTIAL + CENTRE], params[POTENTIAL + CENTRE + 1]
    h = state[ERROR + 2] * (ihip[0] - cx) + state[ERROR + 3] * (ihip[1] - cy)
    return regulate(params, state, hip, velocity, stretch(params, POTENTIAL, t, h), dt, ihip, force)


@borrowing
def in_space(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the Combescure projection on an ellipsoid, whose row `segments` holds, of signature `LAW`.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    row, params, state = data.segments[0], data.params, data.state
    support, reach = params[POTENTIAL + SUPPORT], params[POTENTIAL + REACH]
    c = POTENTIAL + CENTRE
    centre, hand = (params[c], params[c + 1], params[c + 2]), (hip[0], hip[1], hip[2])
    from_centre = plus(hand, -1.0, centre)
    foot, normal, distance = closest_on_surface(row, hand)
    if params[BILATERAL] == 0.0 and not distance < 0.0:
        return release(state, hip, ihip, force)
    t, low, high = -distance, PARALLEL * reach, support
    if t > low:
        # by the tangent plane at the nearest point, and then by those that it leads to
        t = level_at(params, POTENTIAL, dot(normal, from_centre), dot(normal, plus(foot, -1.0, centre)))
        if not low < t < high:
            t = LAST * reach
        for _ in range(ROUNDS):  # as `_search` in the plane
            a, b, _, _ = level_values(params, POTENTIAL, t)
            foot, normal, distance = closest_on_surface(row, plus(centre, 1.0 / a, from_centre))
            if -distance > b:
                low = t
            else:
                high = t
            h = dot(normal, plus(foot, -1.0, centre))
            next_t = level_at(params, POTENTIAL, dot(normal, from_centre), h) if h > 0.0 else low
            if abs(next_t - t) <= CLOSE * support:
                break
            t = next_t if low < next_t < high else 0.5 * (low + high)
    for i in range(3):
        ihip[i], state[ERROR + 3 + i] = foot[i], normal[i]
    h = dot(normal, plus(foot, -1.0, centre))
    return regulate(params, state, hip, velocity, stretch(params, POTENTIAL, t, h), dt, ihip, force)
