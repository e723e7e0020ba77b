"""Compiled loops over one plane curve: nearest point, side and arc length.

Pieces are as in `kernels`. A smooth closed piece (CASSINIAN, ELLIPSE) brings a table `samples` (m, 8) that is
fine enough for every local minimum of the distance to show between two rows, each a `SAMPLE`.

Curves of LINE, ARC and UNBOUNDED pieces are answered in closed form and bring an empty table.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.bracket import step_within
from hapticeval.compiled import borrowing, compiled
from hapticeval.geometry.kernels import (
    ARC,
    ARC_PIECE,
    LINE_PIECE,
    PIECE,
    UNBOUNDED,
    Values,
    check_finite,
    evaluate,
    evaluate_line,
    piece_index,
)
from hapticeval.geometry.polygon_kernels import nearest_kernel, side_kernel
from hapticeval.laws import FOOT, NORMAL, SHAPE, Closest, LawData, law_data
from hapticeval.records import as_record, record_type
from hapticeval.types import Array

SMOOTH_TURN = 1e-9
"""A join that turns less than this (rad) is smooth."""

TIE_ROUNDING = 1e-15
"""Share of the coordinates, and of an arc's radius, by which rounding may change which of two feet is nearer."""

SAMPLE = record_type("u", "s", "x", "y", "dx", "dy", "ddx", "ddy")
"""A row of the table: parameter, arc length (m), position (m), and its first two derivatives by u."""

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)

BLOCK_ROWS = 8
"""Rows of the table that are skipped together where all are too far."""


@compiled
def speed_integral(piece: Array, start: float, end: float) -> float:
    """Return the arc length (m) of one smooth piece (9,) between two parameters, by a 16-point Gauss-Legendre rule."""
    half = 0.5 * (end - start)
    middle = 0.5 * (start + end)
    total = 0.0
    for i in range(NODES.shape[0]):
        _, _, dx, dy, _, _ = evaluate(piece, middle + half * NODES[i])
        total += WEIGHTS[i] * math.hypot(dx, dy)
    return total * half


@compiled
def speed_integrals(piece: Array, starts: Array, ends: Array) -> Array:
    """Return the arc lengths (n,), m, of one smooth piece (9,) between parameters (n,): see `speed_integral`."""
    lengths = np.empty(starts.shape[0])
    for i in range(starts.shape[0]):
        lengths[i] = speed_integral(piece, starts[i], ends[i])
    return lengths


@compiled
def _distance_slope(piece: Array, u: float, x: float, y: float) -> tuple[float, float, float]:
    """Return two derivatives by u of half the squared distance from (x, y), and the squared distance (m^2)."""
    cx, cy, dx, dy, ddx, ddy = evaluate(piece, u)
    # with r = c - p: (r.r / 2)' = r.c' and (r.r / 2)'' = c'.c' + r.c''
    rx, ry = cx - x, cy - y
    return rx * dx + ry * dy, dx * dx + dy * dy + rx * ddx + ry * ddy, rx * rx + ry * ry


@compiled
def _minimise_distance(piece: Array, low: float, high: float, u: float, x: float, y: float) -> tuple[float, float]:
    """Return the u of the minimum of the distance between `low` and `high`, and the squared distance (m^2) there.

    The slope is negative or zero at `low` and positive at `high`; the search begins at `u`. Newton's method, kept
    between the two.

    It ends with a step whose square, times the error that a step of one leaves, is below rounding; that error is
    estimated from the last two second derivatives.
    """
    last_u, last_second_derivative = u, 0.0
    for _ in range(100):
        slope, second_derivative, distance_squared = _distance_slope(piece, u, x, y)
        if slope > 0.0:
            high = u
        else:
            low = u
        # where the second derivative is negative Newton would climb: halve the bracket
        next_u = step_within(low, high, u - slope / second_derivative if second_derivative > 0.0 else low - 1.0)
        step, rounding = abs(next_u - u), 2e-16 * (1.0 + abs(u))
        last_step = abs(u - last_u)
        # of a step h the Newton error is about h^2 times the relative change of the second derivative per unit of u
        error_left = abs(second_derivative - last_second_derivative) * step * step
        if step <= rounding or (
            last_second_derivative > 0.0
            and second_derivative > 0.0
            and step < last_step
            and error_left <= second_derivative * last_step * rounding
        ):
            # the last step still takes this off the square
            if second_derivative > 0.0:
                distance_squared = max(distance_squared - slope * slope / second_derivative, 0.0)
            return next_u, distance_squared
        last_u, last_second_derivative, u = u, second_derivative, next_u
    return u, _distance_slope(piece, u, x, y)[2]


@compiled
def _slope_extremum(piece: Array, low: float, high: float, x: float, y: float) -> float:
    """Return where the slope of the distance has its extremum between `low` and `high`, by bisection."""
    _, start, _ = _distance_slope(piece, low, x, y)
    for _ in range(60):
        middle = 0.5 * (low + high)
        _, second_derivative, _ = _distance_slope(piece, middle, x, y)
        # the slope's derivative has not changed its sign yet
        if (second_derivative > 0.0) == (start > 0.0):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@compiled
def _row_distance_squared(samples: Array, i: int, x: float, y: float) -> float:
    """Return the squared distance (m^2) of (x, y) from row i of the table."""
    sample = as_record(samples, SAMPLE, i)
    dx, dy = sample.x - x, sample.y - y
    return float(dx * dx + dy * dy)


@compiled
def _out_of_reach(first: float, last: float, arc: float, best: float) -> bool:
    """Whether an arc between two points at these squared distances is too short to come nearer than `best`."""
    reach = best + arc
    # squares settle most of what is too far; roots are slow
    # a point of the arc lies within `arc` of both ends along it
    return first > reach * reach or 0.5 * (math.sqrt(first) + math.sqrt(last) - arc) > best


@compiled
def _cubic_root(first: float, last: float, first_rate: float, last_rate: float) -> float:
    """Return about where in [0, 1] a cubic vanishes, given its values (<= 0, > 0) and derivatives at 0 and 1."""
    rise = last - first
    # coefficients of t^2 and t^3 of Hermite's cubic
    second, third = 3.0 * rise - 2.0 * first_rate - last_rate, first_rate + last_rate - 2.0 * rise
    # the root of the chord, and two steps of Newton
    t: float = -first / rise
    for _ in range(2):
        rate = first_rate + t * (2.0 * second + t * 3.0 * third)
        if rate > 0.0:
            t -= (first + t * (first_rate + t * (second + t * third))) / rate
            t = min(max(t, 0.0), 1.0)
    return t


@compiled
def _interval_minimum(piece: Array, samples: Array, i: int, x: float, y: float) -> tuple[float, float]:
    """Return the minimum of the distance between rows i and i + 1 of the table, as (u, squared distance).

    The latter is infinite without one.

    It shows as a change of sign of the slope, or as a pair of roots around an extremum of the slope.
    """
    a, b = as_record(samples, SAMPLE, i), as_record(samples, SAMPLE, i + 1)
    ax, ay, bx, by = a.x - x, a.y - y, b.x - x, b.y - y
    # half the squared distance's slopes and second derivatives at both rows, from the table
    slope_a, slope_b = ax * a.dx + ay * a.dy, bx * b.dx + by * b.dy
    second_a = a.dx * a.dx + a.dy * a.dy + ax * a.ddx + ay * a.ddy
    second_b = b.dx * b.dx + b.dy * b.dy + bx * b.ddx + by * b.ddy
    low, high = a.u, b.u
    # the slope changes its sign: one minimum, looked for from the root of its cubic
    if slope_a <= 0.0 < slope_b:
        guess = _cubic_root(slope_a, slope_b, second_a * (high - low), second_b * (high - low))
        return _minimise_distance(piece, low, high, low + guess * (high - low), x, y)
    # uphill at both ends, but the slope dips between: a minimum if it dips below zero
    if slope_a > 0.0 and slope_b > 0.0 and second_a < 0.0 < second_b:
        low = _slope_extremum(piece, low, high, x, y)
        if _distance_slope(piece, low, x, y)[0] > 0.0:
            return low, np.inf
    # downhill at both ends, but the slope rises between: the same from the other side
    elif slope_a < 0.0 and slope_b < 0.0 and second_b < 0.0 < second_a:
        high = _slope_extremum(piece, low, high, x, y)
        if _distance_slope(piece, high, x, y)[0] <= 0.0:
            return low, np.inf
    else:
        return low, np.inf
    return _minimise_distance(piece, low, high, 0.5 * (low + high), x, y)


@compiled
def nearest_on_smooth(piece: Array, samples: Array, x: float, y: float) -> float:
    """Return the u of the nearest point of a smooth closed piece (9,) to (x, y), m.

    `samples` (m, 8) is its table. A block of intervals, and then an interval, is looked into only if its arc is long
    enough to reach below the best distance known.
    """
    count = samples.shape[0] - 1
    best, nearest = np.inf, 0
    # one row of each block for a first bound; `best` is a squared distance up to here
    for i in range(0, count, BLOCK_ROWS):
        candidate_squared = _row_distance_squared(samples, i, x, y)
        if candidate_squared < best:
            best, nearest = candidate_squared, i
    best, best_u = math.sqrt(best), float(as_record(samples, SAMPLE, nearest).u)
    first_u, tie = as_record(samples, SAMPLE, 0).u, TIE_ROUNDING * (abs(x) + abs(y) + best)
    block_end_squared = _row_distance_squared(samples, 0, x, y)
    for start in range(0, count, BLOCK_ROWS):
        end = min(start + BLOCK_ROWS, count)
        block_start_squared, block_end_squared = block_end_squared, _row_distance_squared(samples, end, x, y)
        arc = as_record(samples, SAMPLE, end).s - as_record(samples, SAMPLE, start).s
        if _out_of_reach(block_start_squared, block_end_squared, arc, best):
            continue
        distance_squared = block_start_squared
        for i in range(start, end):
            previous_squared, distance_squared = distance_squared, _row_distance_squared(samples, i + 1, x, y)
            sample, next_sample = as_record(samples, SAMPLE, i), as_record(samples, SAMPLE, i + 1)
            # the row itself may be the nearest point
            if distance_squared < best * best:
                best, best_u = math.sqrt(distance_squared), next_sample.u
            if _out_of_reach(previous_squared, distance_squared, next_sample.s - sample.s, best):
                continue
            u, candidate_squared = _interval_minimum(piece, samples, i, x, y)
            # the minimum within an interval wins a tie against a row at its end, which is as near to rounding;
            # the last row is the first, once round
            end_is_best = best_u == sample.u or best_u == next_sample.u or (i + 1 == count and best_u == first_u)
            limit = best + tie if end_is_best else best
            if candidate_squared < limit * limit:
                best, best_u = math.sqrt(candidate_squared), u
    return best_u


@compiled
def _nearest_on_piece(piece: Array, x: float, y: float) -> tuple[float, float]:
    """Return the nearest point of one LINE, ARC or UNBOUNDED piece in closed form: (u, distance (m))."""
    limits = as_record(piece, PIECE)
    kind, first, last = limits.kind, limits.u0, limits.u1
    if kind == ARC:
        arc = as_record(piece, ARC_PIECE)
        cx, cy, radius = arc.x, arc.y, arc.radius
        angle = math.atan2(y - cy, x - cx)
        # how far round from the start, in the arc's own sense, the point lies
        swept = (arc.sense * (angle - arc.angle)) % (2.0 * math.pi)
        u = first + swept * radius
        if u <= last:
            return u, abs(math.hypot(x - cx, y - cy) - radius)
        ax, ay, _, _, _, _ = evaluate(piece, first)
        bx, by, _, _, _, _ = evaluate(piece, last)
        # beside the arc: the nearer of its ends
        start, end = math.hypot(ax - x, ay - y), math.hypot(bx - x, by - y)
        if start <= end:
            return first, start
        return last, end
    # a line: the foot, or the end that it lies beyond
    line = as_record(piece, LINE_PIECE)
    ex, ey, dx, dy = x - line.x, y - line.y, line.dx, line.dy
    along = ex * dx + ey * dy
    if kind == UNBOUNDED:
        return along, abs(ey * dx - ex * dy)
    if along <= 0.0:
        return first, math.hypot(ex, ey)
    length = last - first
    if along >= length:
        return last, math.hypot(ex - length * dx, ey - length * dy)
    return first + along, abs(ey * dx - ex * dy)


@compiled
def turn_at_join(pieces: Array, k: int) -> float:
    """Return the turn (rad) where piece k of `pieces` (n, 9), m, starts, from the end of the piece before.

    A positive one is convex.
    """
    # the first piece follows the last
    before = k - 1 if k > 0 else pieces.shape[0] - 1
    _, _, ax, ay, _, _ = evaluate(pieces[before], as_record(pieces, PIECE, before).u1)
    _, _, bx, by, _, _ = evaluate(pieces[k], as_record(pieces, PIECE, k).u0)
    # the angle between both tangents, which need not be of unit length
    return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


@compiled
def nearest_with_values(pieces: Array, samples: Array, x: float, y: float) -> tuple[int, float, float, float, Values]:
    """Return the nearest point of a curve to (x, y), m: (piece, u, distance (m), side, what `evaluate` gives there).

    `pieces` (n, 9) and `samples` (m, 8), see the module. The side is -1.0 inside, 1.0 outside or on the curve.
    """
    if samples.shape[0] > 0:
        return _nearest_on_smooth_with_values(pieces[0], samples, x, y)
    return _nearest_on_pieces_with_values(pieces, x, y)


@compiled
def _nearest_on_smooth_with_values(
    piece: Array, samples: Array, x: float, y: float
) -> tuple[int, float, float, float, Values]:
    """Answer `nearest_with_values` for one smooth closed piece (9,), m, and its table (m, 8): left of it is inside."""
    u = nearest_on_smooth(piece, samples, x, y)
    values = evaluate(piece, u)
    ex, ey = x - values[0], y - values[1]
    return 0, u, math.hypot(ex, ey), -1.0 if ex * values[3] - ey * values[2] < 0.0 else 1.0, values


@compiled
def _nearest_on_pieces_with_values(pieces: Array, x: float, y: float) -> tuple[int, float, float, float, Values]:
    """Answer `nearest_with_values` for LINE, ARC and UNBOUNDED pieces (n, 9), m.

    Where the nearest point is a corner, the corner alone decides: only points outside are nearest to a convex one, only
    points inside to a concave one.
    """
    count = pieces.shape[0]
    u, distance, k, best_is_within = 0.0, np.inf, 0, False
    for i in range(count):
        piece_u, piece_distance = _nearest_on_piece(pieces[i], x, y)
        piece = as_record(pieces, PIECE, i)
        # Beside a join the foot is nearer than the join by less than rounding: it is the one within its piece.
        is_within, size = piece.u0 < piece_u < piece.u1, abs(x) + abs(y) + piece_distance
        if piece.kind == ARC:
            arc = as_record(pieces, ARC_PIECE, i)
            size += abs(arc.x) + abs(arc.y) + arc.radius
        # a foot within its piece wins a tie against one at a join
        tie = TIE_ROUNDING * size
        if piece_distance < distance + (
            tie if is_within and not best_is_within else -tie if best_is_within and not is_within else 0.0
        ):
            u, distance, k, best_is_within = piece_u, piece_distance, i, is_within
    turn = 0.0
    # a foot on a join belongs to the later piece
    nearest = as_record(pieces, PIECE, k)
    if nearest.kind != UNBOUNDED and (u == nearest.u0 or u == nearest.u1):
        if u == nearest.u1:
            k = (k + 1) % count
            u = as_record(pieces, PIECE, k).u0
        turn = turn_at_join(pieces, k)
    values = evaluate(pieces[k], u)
    side = -1.0 if (x - values[0]) * values[3] - (y - values[1]) * values[2] < 0.0 else 1.0
    if abs(turn) > SMOOTH_TURN:
        side = 1.0 if turn > 0.0 else -1.0
    return k, u, distance, side, values


@compiled
def project(pieces: Array, samples: Array, x: float, y: float) -> tuple[float, float, float]:
    """Return the nearest point of a curve to (x, y), m, as (u, distance (m), side): see `nearest_with_values`.

    `pieces` (n, 9) and `samples` (m, 8).
    """
    _, u, distance, side, _ = nearest_with_values(pieces, samples, x, y)
    return u, distance, side


@compiled
def locate_on_outline(pieces: Array, vertices: Array, tree: Array, x: float, y: float) -> tuple[float, float, float]:
    """Return the nearest point of a straight-edged curve to (x, y), m, as (u, distance (m), side), by its tree.

    `pieces` (n, 9), `vertices` (n, 2), m, and `tree` (k, 6).
    """
    edge, along, distance_squared = nearest_kernel(vertices, tree, x, y)
    distance = math.sqrt(distance_squared)
    side = -1.0 if distance > 0.0 and side_kernel(vertices, edge, along, x, y) < 0.0 else 1.0
    # `along` is a share of the edge, u its arc length
    piece = as_record(pieces, PIECE, edge)
    return piece.u0 + along * (piece.u1 - piece.u0), distance, side


@compiled
def locate_on_edges(pieces: Array, vertices: Array, tree: Array, points: Array) -> Array:
    """Return where points (n, 2), m, lie by a curve of straight edges: rows (n, 3) of u, distance (m) and side.

    `pieces` (k, 9), `vertices` (k, 2), m, and `tree` (m, 6). Raises as `check_finite` does.
    """
    check_finite(points)
    located = np.empty((points.shape[0], 3))
    for i in range(points.shape[0]):
        located[i, 0], located[i, 1], located[i, 2] = locate_on_outline(
            pieces, vertices, tree, points[i, 0], points[i, 1]
        )
    return located


@compiled
def locate_on_smooth(pieces: Array, samples: Array, points: Array) -> Array:
    """Answer `locate_on_edges` for one smooth piece, of `pieces` (1, 9) and `samples` (m, 8)."""
    check_finite(points)
    located = np.empty((points.shape[0], 3))
    for i in range(points.shape[0]):
        _, u, distance, side, _ = _nearest_on_smooth_with_values(pieces[0], samples, points[i, 0], points[i, 1])
        located[i, 0], located[i, 1], located[i, 2] = u, distance, side
    return located


@compiled
def locate_on_pieces(pieces: Array, points: Array) -> Array:
    """Answer `locate_on_edges` for points (n, 2), m, by a curve of `pieces` (k, 9), lines and arcs."""
    check_finite(points)
    located = np.empty((points.shape[0], 3))
    for i in range(points.shape[0]):
        _, u, distance, side, _ = _nearest_on_pieces_with_values(pieces, points[i, 0], points[i, 1])
        located[i, 0], located[i, 1], located[i, 2] = u, distance, side
    return located


@borrowing
def closest_on_edges(
    pieces: Array, located: Array, foot: Array, normal: Array, distance: Array, shape: Array
) -> None:  # fmt: skip
    """Write the closest points, on `pieces` (k, 9), that are `located` (n, 3): u (m), distance (m) and side.

    Into the arrays of a `ClosestPoint`: to make these here would take as long to compile as all else.
    """
    for i in range(located.shape[0]):
        u = _wrapped(pieces, located[i, 0])
        k = piece_index(pieces, u)
        along = u - as_record(pieces, PIECE, k).u0
        distance[i] = located[i, 1] * located[i, 2]
        _write_shape(evaluate_line(pieces[k], along), i, foot, normal, shape)


@borrowing
def closest_on_pieces(
    pieces: Array, located: Array, foot: Array, normal: Array, distance: Array, shape: Array
) -> None:  # fmt: skip
    """Answer `closest_on_edges` for `pieces` (k, 9) of any kind, located (n, 3) by u (m, rad), distance (m), side.

    This compiles all kinds.
    """
    for i in range(located.shape[0]):
        u = _wrapped(pieces, located[i, 0])
        distance[i] = located[i, 1] * located[i, 2]
        _write_shape(evaluate(pieces[piece_index(pieces, u)], u), i, foot, normal, shape)


@compiled
def _wrapped(pieces: Array, u: float) -> float:
    """Return u on `pieces` (k, 9); on a closed curve it wraps, and rounding may wrap it onto the end: the start."""
    first = as_record(pieces, PIECE)
    start, end = first.u0, as_record(pieces, PIECE, pieces.shape[0] - 1).u1
    if first.kind == UNBOUNDED or start <= u < end:
        return u
    u = start + (u - start) % (end - start)
    return u if u < end else start


@borrowing
def _write_shape(values: Values, i: int, foot: Array, normal: Array, shape: Array) -> None:
    """Write foot, normal and shape operator of the closest point number i, where the curve has these `values`."""
    x, y, dx, dy, ddx, ddy = values
    speed = math.hypot(dx, dy)
    tx, ty = dx / speed, dy / speed
    # κ = (x' y'' - y' x'') / |c'|^3, and W = κ t t^T
    curvature = (dx * ddy - dy * ddx) / math.pow(speed, 3.0)
    foot[i, 0], foot[i, 1], normal[i, 0], normal[i, 1] = x, y, ty, -tx
    shape[i, 0, 0], shape[i, 0, 1] = curvature * tx * tx, curvature * tx * ty
    shape[i, 1, 0], shape[i, 1, 1] = curvature * ty * tx, curvature * ty * ty


def closest_of_curve(pieces: Array, samples: Array, vertices: Array, tree: Array) -> Closest:
    """Return the compiled closest point of a plane curve, given what a point is looked up in.

    `pieces` (n, 9), `samples` (m, 8), `vertices` (v, 2), m, and `tree` (k, 6): tables that do not apply are empty.
    """
    closest = closest_on_curve if tree.shape[0] == 0 else closest_on_outline
    return Closest(closest, law_data(pieces=pieces, lookup=samples, vertices=vertices, tree=tree))


@compiled
def closest_on_curve(data: LawData, point: Array, frame: Array) -> float:
    """Answer `CLOSEST` for a point (2,), m, on a curve, into rows of `frame` (k, 2)."""
    u, distance, side = project(data.pieces, data.lookup, point[0], point[1])
    _write_frame(data, u, frame)
    return distance * side


@compiled
def closest_on_outline(data: LawData, point: Array, frame: Array) -> float:
    """Answer `CLOSEST` for a point (2,), m, on a curve of straight edges by its tree, into rows of `frame` (k, 2)."""
    u, distance, side = locate_on_outline(data.pieces, data.vertices, data.tree, point[0], point[1])
    _write_frame(data, u, frame)
    return distance * side


@compiled
def _write_frame(data: LawData, u: float, frame: Array) -> None:
    """Write the rows of `frame` (k, 2), see `CLOSEST`, at the parameter u of a curve."""
    pieces, first = data.pieces, as_record(data.pieces, PIECE)
    # the end of a closed curve is its start
    if first.kind != UNBOUNDED and not u < as_record(pieces, PIECE, pieces.shape[0] - 1).u1:
        u = first.u0
    k = piece_index(pieces, u)
    x, y, dx, dy, ddx, ddy = evaluate(pieces[k], u)
    speed = math.hypot(dx, dy)
    tx, ty = dx / speed, dy / speed
    # outward normal: the tangent turned clockwise, as curves run anticlockwise
    frame[FOOT, 0], frame[FOOT, 1], frame[NORMAL, 0], frame[NORMAL, 1] = x, y, ty, -tx
    if frame.shape[0] > SHAPE:
        # W = kappa t t^T
        curvature = (dx * ddy - dy * ddx) / math.pow(speed, 3.0)
        frame[SHAPE, 0], frame[SHAPE, 1] = curvature * tx * tx, curvature * tx * ty
        frame[SHAPE + 1, 0], frame[SHAPE + 1, 1] = curvature * ty * tx, curvature * ty * ty
    if frame.shape[0] > SHAPE + 2:
        # arc length: u itself on lines and arcs, else from the row of the table before u
        along = u if first.kind == UNBOUNDED else u - first.u0
        if data.lookup.shape[0] > 0:
            i = max(int(np.searchsorted(data.lookup[:, 0], u, side="right")) - 1, 0)
            sample = as_record(data.lookup, SAMPLE, i)
            along = sample.s + speed_integral(pieces[0], sample.u, u)
        frame[SHAPE + 2, 0], frame[SHAPE + 2, 1] = along, 0.0
