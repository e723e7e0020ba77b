"""Two projections along level curves, for models that are star-shaped about a centre: homothetic, and Combescure's.

Both, with `gradient`, have the force of a `potential`: continuous, normal, without memory, and conservative.

Homothetic: the hand goes out on the ray from the centre, to where that meets the surface: all level curves are smaller
copies. The potential is K H^2 (1 - lambda)^2 / 2, with lambda = |HIP - c| / |IHIP - c|, continuous but at the centre.
Where the hand moves by d the IHIP moves by at most |y_0 - c| / (h lambda) d.

Combescure's: level curves that keep the surface's normals, parallel curves first, then smaller copies. Down to half of
min(1 / kappa_max, h_min) it is minimum distance, with the same force; deeper, where minimum distance would pop through
the medial axis, the level curves shrink to the centre of the kernel.

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

from hapticeval.bracket import step_within
from hapticeval.compiled import borrowing, inner
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import (
    ARC,
    ARC_PIECE,
    ELLIPSE,
    ELLIPSE_PIECE,
    LINE,
    LINE_PIECE,
    PIECE,
    SMOOTH_KINDS,
    evaluate,
    piece_index,
)
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import NORMAL_COLUMN, first_triangle_hit
from hapticeval.geometry.model import VERTICES, Model
from hapticeval.geometry.surface import Surface, closest_on_surface
from hapticeval.geometry.triples import dot, plus
from hapticeval.laws import LawData
from hapticeval.records import as_record, as_records, record_type
from hapticeval.renderers.outline import frame, is_clear_of, nearest_on, outline_in, representation_of
from hapticeval.renderers.potential import (
    LAST,
    PARALLEL,
    POTENTIAL,
    Centre,
    centre_of,
    level_at,
    level_values,
    potential_record,
    stretch,
)
from hapticeval.renderers.projective import Projection, once
from hapticeval.renderers.regulation import GRADIENT
from hapticeval.renderers.regulation_kernel import FIRST_OWN, GAINS, PAST, regulate, release
from hapticeval.scene import Scene
from hapticeval.types import Array

HOMOTHETIC = FIRST_OWN
"""Where in `params` of the homothetic projection the potential's numbers begin."""

TABLE_RAYS = 1024
"""Rays of the table that a closed smooth curve, or the arcs of one, are cut by."""

RAY_STEPS = 50
"""Most steps to the point of a curve on a ray, between two rays of the table."""


def homothetic(
    scene: Scene, representation: str, *, vertices: float = VERTICES, centre: ArrayLike | None = None
) -> Projection:
    """Return the projection on a representation of the scene's model, or in space on a mesh or an ellipsoid.

    `centre` (N,), m, is that of the kernel unless it is given. Raises as `centre_of` does.
    """
    model = scene.model
    if isinstance(model.boundary, Mesh) or (model.dimension == 3 and representation == "curve"):
        boundary = model.boundary if isinstance(model.boundary, Mesh) else model.surface
        middle = kernel_centre_of(model, boundary, centre)
        potential = potential_numbers(middle)
        if isinstance(boundary, Mesh):
            faces, corners, tree = boundary.tables
            low, high = np.reshape(boundary.bounds, (2, 3))
            reach = 1.1 * float(np.linalg.norm(np.maximum(high - middle.point, middle.point - low)))
            return Projection(
                homothetic_on_mesh, boundary, bilateral=scene.bilateral, own=[*potential_record(potential), reach],
                potential=potential, support_range=middle.support_range, pieces=faces, vertices=corners, tree=tree,
            )  # fmt: skip
        return Projection(
            homothetic_in_space, boundary, bilateral=scene.bilateral, own=potential_record(potential),
            potential=potential, support_range=middle.support_range, lookup=_quadric(boundary, middle),
        )  # fmt: skip
    curve, lengths = model.curve, (0.0, 0.0)
    if curve.closed:
        shape = representation_of(model, representation, int(vertices))
        curve, lengths = shape.surface, (shape.resolution, shape.standoff)
    middle = kernel_centre_of(model, curve, centre)
    potential = potential_numbers(middle)
    return Projection(
        homothetic_in_plane, curve, bilateral=scene.bilateral, own=potential_record(potential), potential=potential,
        support_range=middle.support_range, pieces=curve.pieces,
        lookup=ray_table(curve, middle.point), resolution=lengths[0], standoff=lengths[1],
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
    start, end = curve.u_range
    for piece in as_records(curve.pieces, PIECE):
        share = (piece.u1 - piece.u0) / (end - start)
        count = 1 if piece.kind == LINE else max(8, math.ceil(TABLE_RAYS * share))
        parts.append(np.linspace(piece.u0, piece.u1, count, endpoint=False))
    parameters = np.concatenate(parts)
    if len(curve.samples):
        parameters = np.unique(np.concatenate([parameters, curve.samples[:-1, 0]]))
    directions = curve.position(parameters) - np.asarray(centre)
    turns = [_turn(*directions[0], *direction) for direction in directions]
    # 4 is a whole turn
    return np.vstack([np.column_stack([turns, parameters]), [4.0, end]])


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
    first = evaluate(pieces[0], as_record(pieces, PIECE).u0)
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
    line = as_record(pieces, LINE_PIECE, piece)
    if line.kind == LINE:
        # the edge a + s t meets the ray where (a - c) x e + s (t x e) = 0
        away = ex * line.dy - ey * line.dx
        if away == 0.0:
            return piece, u0
        along = (ey * (line.x - cx) - ex * (line.y - cy)) / away
        return piece, min(max(line.u0 + along, u0), u1)
    u = u0 + (u1 - u0) * (turn - table[low, 0]) / (table[high, 0] - table[low, 0])
    begin, end = u0, u1
    for _ in range(RAY_STEPS):
        # e x (y - c) grows with u, and is zero on the ray: Newton's method, kept in the bracket
        x, y, dx, dy, _, _ = evaluate(pieces[piece], u)
        miss, slope = ex * (y - cy) - ey * (x - cx), ex * dy - ey * dx
        if miss < 0.0:
            begin = u
        else:
            end = u
        next_u = step_within(begin, end, u - miss / slope if slope > 0.0 else math.inf)
        if abs(next_u - u) <= 2e-16 * (abs(u1) + abs(u0)):
            return piece, next_u
        u = next_u
    return piece, u


@borrowing
def homothetic_in_plane(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the homothetic projection on a curve or a polygon, of signature `LAW`: out along the ray.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    params, state, centre = data.params, data.state, as_record(data.params, POTENTIAL, HOMOTHETIC).centre
    cx, cy = centre[0], centre[1]
    ex, ey = hip[0] - cx, hip[1] - cy
    piece, u = on_ray(data.pieces, data.lookup, cx, cy, ex, ey)
    x, y, dx, dy, _, _ = evaluate(data.pieces[piece], u)
    wx, wy = x - cx, y - cy
    # 1 - lambda, by the projection of one on the other: they are parallel but for rounding
    shortfall = 1.0 - (ex * wx + ey * wy) / (wx * wx + wy * wy)
    if as_record(params, GAINS).bilateral == 0.0 and not shortfall > 0.0:
        return release(state, hip, ihip, force)
    speed = math.hypot(dx, dy)
    normal = as_record(state, PAST).normal
    ihip[0], ihip[1], normal[0], normal[1] = x, y, dy / speed, -dx / speed
    h = (wx * dy - wy * dx) / speed
    return regulate(params, state, hip, velocity, 0.0, _gradient_length(params, shortfall, h), dt, ihip, force)


@inner
def _gradient_length(params: Array, shortfall: float, h: float) -> float:
    """Return H^2 (1 - lambda) / h for `gradient`: `potential.stretch` where all level curves are smaller copies."""
    support = as_record(params, POTENTIAL, HOMOTHETIC).support
    return support * support * shortfall / h if as_record(params, GAINS).scheme == GRADIENT else 0.0


@borrowing
def homothetic_in_space(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the homothetic projection on an ellipsoid, whose `_quadric` is `lookup`, of signature `LAW`.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    row, params, state, normal = data.lookup, data.params, data.state, as_record(data.state, PAST).normal
    centre = as_record(params, POTENTIAL, HOMOTHETIC).centre
    # The ray c + s e is on the surface where the sum of (c + s e)^2 / axis^2 is 1. With lambda = 1 / s, and sums over
    # the axes, P lambda^2 - 2 (e.c / axis^2) lambda - e.e / axis^2 = 0, where P = 1 - c.c / axis^2 > 0.
    hand_squared, hand_dot_centre, centre_power = 0.0, 0.0, row[0, 3]
    for i in range(3):
        e = row[0, i] * (hip[i] - centre[i])
        hand_squared, hand_dot_centre = (
            hand_squared + e * (hip[i] - centre[i]),
            hand_dot_centre + e * centre[i],
        )
    root_sum = math.sqrt(hand_dot_centre * hand_dot_centre + hand_squared * centre_power) + hand_dot_centre
    ratio = root_sum * row[0, 4]
    if as_record(params, GAINS).bilateral == 0.0 and not ratio < 1.0:
        return release(state, hip, ihip, force)
    # s = 1 / lambda, times e from the centre
    reach = centre_power / root_sum if ratio > 0.0 else 0.0
    for i in range(3):
        ihip[i] = centre[i] + reach * (hip[i] - centre[i])
    if not ratio > 0.0:  # the hand is at the centre: any ray will do, say that along x
        ratio = 0.0
        ihip[0] = math.sqrt(centre_power / row[0, 0] + centre[0] * centre[0])
    # the normal is along y / axis^2; h = n.(y - c)
    size, h = 0.0, 0.0
    for i in range(3):
        gradient = row[0, i] * ihip[i]
        normal[i] = gradient
        size += gradient * gradient
        h += gradient * (ihip[i] - centre[i])
    size = 1.0 / math.sqrt(size)
    for i in range(3):
        normal[i] *= size
    return regulate(params, state, hip, velocity, 0.0, _gradient_length(params, 1.0 - ratio, h * size), dt, ihip, force)


MESH_POTENTIAL = record_type("length", base=POTENTIAL)
"""The numbers on a mesh: with how far (m) from the centre no point of it lies."""


@borrowing
def homothetic_on_mesh(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the homothetic projection on a triangle mesh, of signature `LAW`: one ray cast.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    params, state, normal = data.params, data.state, as_record(data.state, PAST).normal
    potential = as_record(params, MESH_POTENTIAL, HOMOTHETIC)
    centre, length = (potential.centre[0], potential.centre[1], potential.centre[2]), potential.length
    from_centre = (hip[0] - centre[0], hip[1] - centre[1], hip[2] - centre[2])
    hand_distance = math.sqrt(
        from_centre[0] * from_centre[0] + from_centre[1] * from_centre[1] + from_centre[2] * from_centre[2]
    )
    ray = (length, 0.0, 0.0)  # of a hand at the centre: any direction will do
    if hand_distance > 0.0:
        scale = length / hand_distance
        ray = (scale * from_centre[0], scale * from_centre[1], scale * from_centre[2])
    triangle, ray_share = first_triangle_hit(data.pieces, data.vertices, data.tree, centre, ray, 0.0, 1.0)
    shortfall = 1.0 - hand_distance / (ray_share * length)
    if as_record(params, GAINS).bilateral == 0.0 and not shortfall > 0.0:
        return release(state, hip, ihip, force)
    h = 0.0
    for i in range(3):
        ihip[i], normal[i] = centre[i] + ray_share * ray[i], data.pieces[triangle, NORMAL_COLUMN + i]
        h += normal[i] * ray_share * ray[i]
    return regulate(params, state, hip, velocity, 0.0, _gradient_length(params, shortfall, h), dt, ihip, force)


COMBESCURE = FIRST_OWN + 1
"""Where in `params` of the Combescure projection they begin: behind the `stray` of the outline."""

MOST_CURVE_STEPS, MOST_NEAREST_POINTS = 12, 60
"""Most steps along the curve, and most nearest points that are asked for after that."""

TANGENT_SETTLED, TANGENT_ROUNDING = 1e-14, 4e-16
"""Shares of H and of the coordinates by which the tangent's point may miss the hand along the tangent."""

CLOSE = 4e-15
"""Share of H below which a change of the level is rounding."""

SUPPORT_ROUNDING = 1e-12
"""Share of H below which a difference of support distances is rounding."""

SAFE = 1.0 - 1e-6
"""Share of the smallest radius of curvature, which is sampled, that is believed."""


def combescure(scene: Scene, representation: str, *, centre: ArrayLike | None = None) -> Projection:
    """Return the projection on the scene's exact curve, or on a sphere or an ellipsoid.

    Where that has a convex corner, is round or a mesh it is `homothetic`, and the recording says so. `centre` (N,), m,
    is that of the kernel unless it is given. Raises as `centre_of` does.
    """
    model = scene.model
    boundary = model.boundary
    middle = kernel_centre_of(model, boundary, centre)
    is_round = middle.largest - middle.smallest <= SUPPORT_ROUNDING * middle.support
    if is_round or isinstance(boundary, Mesh) or any(corner.convex for corner in boundary.corners):
        projection = homothetic(scene, representation, centre=centre)
        projection.rendered_as = "homothetic"
        return projection
    # m of the potential: neither curvature nor support distance may let level curves cross
    shape = model.surface if model.dimension == 3 else model.curve
    curvature = once(model, "largest curvature", lambda: largest_curvature(shape))
    reach = min(SAFE / curvature, middle.smallest) if curvature > 0.0 else middle.smallest
    potential = potential_numbers(middle, reach)
    if model.dimension == 3:
        row = model.surface.row[np.newaxis]
        return Projection(
            combescure_in_space, boundary, bilateral=scene.bilateral, own=[0.0, *potential_record(potential)],
            potential=potential, support_range=middle.support_range, pieces=row,
        )  # fmt: skip
    tables = representation_of(model, "curve").tables
    return Projection(
        combescure_in_plane, model.curve, bilateral=scene.bilateral, potential=potential,
        support_range=middle.support_range, **{**tables, "own": [*tables["own"], *potential_record(potential)]},
    )  # fmt: skip


def largest_curvature(boundary: Curve | Surface) -> float:
    """Return the largest curvature (1/m) of a curve, or the largest principal one of a sphere or an ellipsoid."""
    if isinstance(boundary, Surface):  # at the end of the longest axis, across the shortest
        axes = boundary.reals
        return max(axes) / min(axes) ** 2
    largest = 0.0
    for row in boundary.pieces:
        kind = as_record(row, PIECE).kind
        if kind == ARC:
            arc = as_record(row, ARC_PIECE)
            largest = max(largest, arc.sense / arc.radius)
        elif kind == ELLIPSE:
            ellipse = as_record(row, ELLIPSE_PIECE)
            largest = max(ellipse.a, ellipse.b) / min(ellipse.a, ellipse.b) ** 2
        elif kind in SMOOTH_KINDS:
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
    pieces, potential = data.pieces, as_record(data.params, POTENTIAL, COMBESCURE)
    support, cx, cy = potential.support, potential.centre[0], potential.centre[1]
    first_u, last_u = as_record(pieces, PIECE).u0, as_record(pieces, PIECE, pieces.shape[0] - 1).u1
    ex, ey = x - cx, y - cy
    settled = TANGENT_SETTLED * support + TANGENT_ROUNDING * (abs(x) + abs(y) + abs(cx) + abs(cy))
    t = -1.0
    for _ in range(MOST_CURVE_STEPS):
        px, py, dx, dy, ddx, ddy = evaluate(pieces[piece], u)
        speed = math.hypot(dx, dy)
        tx, ty, wx, wy = dx / speed, dy / speed, px - cx, py - cy
        h, along = wx * ty - wy * tx, wx * tx + wy * ty  # with n = (T_y, -T_x): n.(y_0 - c) and T.(y_0 - c)
        t = level_at(potential, ex * ty - ey * tx, h)
        if not 0.0 <= t < support:
            break
        a, b, da, db = level_values(potential, t)
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
    boundary, potential = outline_in(data), as_record(data.params, POTENTIAL, COMBESCURE)
    support, reach, cx, cy = potential.support, potential.reach, potential.centre[0], potential.centre[1]
    low, high = PARALLEL * reach, support
    px, py, nx, ny, t = x, y, 0.0, 0.0, LAST * reach
    for _ in range(MOST_NEAREST_POINTS):
        a, b, _, _ = level_values(potential, t)
        # the hand enlarged by 1 / A about the centre: at its level it lies b deep under its nearest point
        qx, qy = cx + (x - cx) / a, cy + (y - cy) / a
        piece, u, distance, side = nearest_on(boundary, qx, qy)
        px, py, nx, ny = frame(boundary.pieces, boundary.joins, piece, u, qx, qy)
        if -side * distance > b:
            low = t
        else:
            high = t
        # the level by the tangent there, if that is between the bounds
        h = nx * (px - cx) + ny * (py - cy)
        next_t = level_at(potential, nx * (x - cx) + ny * (y - cy), h) if h > 0.0 else low
        if abs(next_t - t) <= CLOSE * support:
            break
        t = next_t if low < next_t < high else 0.5 * (low + high)
    return px, py, nx, ny, t


@borrowing
def combescure_in_plane(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the Combescure projection on a curve, of signature `LAW`: the hand's level curve, and its normal.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    boundary, params, state = outline_in(data), data.params, data.state
    potential, normal = as_record(params, POTENTIAL, COMBESCURE), as_record(state, PAST).normal
    x, y, bilateral = hip[0], hip[1], as_record(params, GAINS).bilateral != 0.0
    if not bilateral and is_clear_of(boundary, x, y):
        return release(state, hip, ihip, force)
    piece, u, distance, side = nearest_on(boundary, x, y)
    if not (bilateral or side < 0.0):
        return release(state, hip, ihip, force)
    t = -side * distance
    # among the parallel curves the nearest point is the IHIP; deeper, Newton's method from there, then the search
    has_foot = t <= PARALLEL * potential.reach
    if not has_foot:
        has_foot, piece, u, t = _follow(data, x, y, piece, u)
    if has_foot:
        ihip[0], ihip[1], normal[0], normal[1] = frame(boundary.pieces, boundary.joins, piece, u, x, y)
    else:
        ihip[0], ihip[1], normal[0], normal[1], t = _search(data, x, y)
    cx, cy = potential.centre[0], potential.centre[1]
    h = normal[0] * (ihip[0] - cx) + normal[1] * (ihip[1] - cy)
    return regulate(params, state, hip, velocity, 0.0, stretch(potential, t, h), dt, ihip, force)


@borrowing
def combescure_in_space(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the Combescure projection on an ellipsoid, whose row `pieces` holds, of signature `LAW`.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    row, params, state = data.pieces[0], data.params, data.state
    potential, past = as_record(params, POTENTIAL, COMBESCURE), as_record(state, PAST)
    support, reach, hand = potential.support, potential.reach, (hip[0], hip[1], hip[2])
    centre = (potential.centre[0], potential.centre[1], potential.centre[2])
    from_centre = plus(hand, -1.0, centre)
    foot, normal, distance = closest_on_surface(row, hand)
    if as_record(params, GAINS).bilateral == 0.0 and not distance < 0.0:
        return release(state, hip, ihip, force)
    t, low, high = -distance, PARALLEL * reach, support
    if t > low:
        # by the tangent plane at the nearest point, and then by those that it leads to
        t = level_at(potential, dot(normal, from_centre), dot(normal, plus(foot, -1.0, centre)))
        if not low < t < high:
            t = LAST * reach
        for _ in range(MOST_NEAREST_POINTS):  # as `_search` in the plane
            a, b, _, _ = level_values(potential, t)
            foot, normal, distance = closest_on_surface(row, plus(centre, 1.0 / a, from_centre))
            if -distance > b:
                low = t
            else:
                high = t
            h = dot(normal, plus(foot, -1.0, centre))
            next_t = level_at(potential, dot(normal, from_centre), h) if h > 0.0 else low
            if abs(next_t - t) <= CLOSE * support:
                break
            t = next_t if low < next_t < high else 0.5 * (low + high)
    for i in range(3):
        ihip[i], past.normal[i] = foot[i], normal[i]
    h = dot(normal, plus(foot, -1.0, centre))
    return regulate(params, state, hip, velocity, 0.0, stretch(potential, t, h), dt, ihip, force)
