"""Compiled loops of the curve shortening flow: the level set step (5.4), its contour, and the particles on it (5.16).

`values` (ny, nx) are gamma at square cells of side `h`, negative inside; node (j, i) is at the origin (`x0`, `y0`) + h
(i, j).

The front is the zero level, moves towards gamma < 0, and leaves positive values behind. The particles go with the
front, come back onto it, and keep apart.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.types import Array, IntArray

CURVATURE_VELOCITY, UNIT_VELOCITY, CAPPED_VELOCITY, ARCTAN_VELOCITY = 0, 1, 2, 3
"""Velocity functions: kappa; 1; max(kappa, K_cap) (5.13); arctan(kappa / kappa_avg - 1) / pi + 1/2 (5.14)."""

CELLS_BEHIND = 4.0
"""Cells behind the front beyond which a node is left alone: levels move independently of each other."""


KINK_RATIO = 0.8


@compiled
def velocity(kind: int, scale: float, kappa: float) -> float:
    """Return the speed v_f of a front of curvature `kappa` (1/m) by one of the velocity functions.

    `scale` is K_cap (1/m) for CAPPED_VELOCITY and abs(kappa_avg) (1/m) for ARCTAN_VELOCITY.
    """
    if kind == CURVATURE_VELOCITY:
        return kappa
    if kind == UNIT_VELOCITY:
        return 1.0
    # (5.13)
    if kind == CAPPED_VELOCITY:
        return max(kappa, scale)
    # (5.14)
    return math.atan(kappa / scale - 1.0) / math.pi + 0.5


@compiled
def largest_step(kind: int, scale: float, h: float) -> float:
    """Return the bound on the time step, (5.12) corrected: the smaller of a diffusive and a hyperbolic one.

    These are h^2 / (4 max dv/dkappa) and h / (2 max v), with h (m) the side of a cell.
    """
    if kind == UNIT_VELOCITY:
        # a front at speed 1: h / (2 v) on a square grid
        return 0.5 * h
    if kind == CURVATURE_VELOCITY:
        return 0.25 * h * h
    if kind == CAPPED_VELOCITY:
        return min(0.25 * h * h, 0.5 * h / scale)
    # d v / d kappa of (5.14) is 1 / (pi kappa_avg) at the most, and v is below 1
    return min(0.25 * h * h * math.pi * scale, 0.5 * h)


@compiled
def derivatives(values: Array, h: float, j: int, i: int) -> tuple[float, float, float]:
    """Return central differences of `values` (ny, nx), m, at node (j, i): gradient (gx, gy), and curvature (5.8), 1/m.

    The curvature is held to 1/h in size.
    """
    west, east = values[j, i - 1], values[j, i + 1]
    south, north = values[j - 1, i], values[j + 1, i]
    centre = values[j, i]
    # (5.9)
    gx, gy = (east - west) / (2.0 * h), (north - south) / (2.0 * h)
    gradient_squared = gx * gx + gy * gy
    # the top of a ridge: no direction, and no curvature
    if gradient_squared < 1e-16:
        return gx, gy, 0.0
    # (5.10), and the mixed derivative that (5.8) needs beside
    gxx = (east - 2.0 * centre + west) / (h * h)
    gyy = (north - 2.0 * centre + south) / (h * h)
    gxy = (values[j + 1, i + 1] - values[j + 1, i - 1] - values[j - 1, i + 1] + values[j - 1, i - 1]) / (4.0 * h * h)
    kappa = (gx * gx * gyy - 2.0 * gx * gy * gxy + gy * gy * gxx) / (gradient_squared * math.sqrt(gradient_squared))
    # a grid of steps h knows no radius below h
    return gx, gy, min(max(kappa, -1.0 / h), 1.0 / h)


@compiled
def upwind_slope(values: Array, h: float, j: int, i: int) -> float:
    """Return Godunov's size of the gradient of `values` (ny, nx), m, at node (j, i), spaced h (m).

    It is right at kinks for a front that moves towards smaller values.
    """
    centre = values[j, i]
    total = 0.0
    for before, after in ((values[j, i - 1], values[j, i + 1]), (values[j - 1, i], values[j + 1, i])):
        # only neighbours with larger values count: that is where the front comes from
        back, ahead = min(centre - before, 0.0), max(after - centre, 0.0)
        total += back * back + ahead * ahead
    return math.sqrt(total) / h


@compiled
def active_columns(values: Array, h: float) -> IntArray:
    """Return the columns from first to behind the last, of each row, that a step has to look at: (ny, 2).

    `values` (ny, nx), m, on cells of side h (m); the edge of the grid is left out.
    """
    ny, nx = values.shape
    out = np.zeros((ny, 2), np.int64)
    # two cells more than are moved, for the differences there
    limit = (CELLS_BEHIND + 2.0) * h
    for j in range(1, ny - 1):
        low, high = 1, nx - 1
        while low < high and values[j, low] > limit:
            low += 1
        while high > low and values[j, high - 1] > limit:
            high -= 1
        out[j, 0], out[j, 1] = low, high
    return out


@compiled
def advance_step(values: Array, out: Array, active: IntArray, h: float, kind: int, scale: float, dt: float) -> None:
    """Carry `values` (ny, nx), m, by one explicit step of (5.4) into `out`, in the columns that `active` (ny, 2) gives.

    The two agree elsewhere and stay so. The parts of constant speed (UNIT_VELOCITY, and CAPPED_VELOCITY where it is at
    K_cap) take Godunov's slope.

    What depends on the curvature takes central differences, but for nodes on a kink (the medial axis of the model),
    which they would leave behind.
    """
    ny, nx = values.shape
    for j in range(1, ny - 1):
        low, high = active[j, 0], active[j, 1]
        if kind == ARCTAN_VELOCITY:
            if low < high:
                reach = slice(low - 1, high + 1)
                _arc_row(values[j - 1, reach], values[j, reach], values[j + 1, reach], out[j, low:high], h, scale, dt)
            continue
        for i in range(low, high):
            gamma = values[j, i]
            out[j, i] = gamma
            if gamma <= CELLS_BEHIND * h:
                gx, gy, kappa = derivatives(values, h, j, i)
                slope, steep = math.sqrt(gx * gx + gy * gy), upwind_slope(values, h, j, i)
                # constant speed, or central differences that see less than the upwind slope: a kink
                if kind == UNIT_VELOCITY or (kind == CAPPED_VELOCITY and kappa <= scale) or slope < KINK_RATIO * steep:
                    slope = steep
                # (5.11): forward Euler
                out[j, i] = gamma + dt * velocity(kind, scale, kappa) * slope
    # the edge of the grid is extrapolated linearly, rows and then columns
    for i in range(nx):
        out[0, i] = 2.0 * out[1, i] - out[2, i]
        out[ny - 1, i] = 2.0 * out[ny - 2, i] - out[ny - 3, i]
    for j in range(ny):
        out[j, 0] = 2.0 * out[j, 1] - out[j, 2]
        out[j, nx - 1] = 2.0 * out[j, nx - 2] - out[j, nx - 3]


@compiled
def _arc_row(south: Array, middle: Array, north: Array, out: Array, h: float, scale: float, dt: float) -> None:
    """Carry one row by an `advance_step` for ARCTAN_VELOCITY, without branches, so that it becomes vector code."""
    behind = CELLS_BEHIND * h
    half, inverse = 0.5 / h, 1.0 / (h * h)
    for i in range(out.shape[0]):
        c, w, e, s, n = middle[i + 1], middle[i], middle[i + 2], south[i + 1], north[i + 1]
        gx, gy = (e - w) * half, (n - s) * half
        gradient_squared = gx * gx + gy * gy
        slope = math.sqrt(gradient_squared)
        gxx, gyy = (e - 2.0 * c + w) * inverse, (n - 2.0 * c + s) * inverse
        gxy = (north[i + 2] - north[i] - south[i + 2] + south[i]) * (0.25 * inverse)
        kappa = (gx * gx * gyy - 2.0 * gx * gy * gxy + gy * gy * gxx) / (gradient_squared * slope + 1e-300)
        # as in `derivatives`
        kappa = 0.0 if gradient_squared < 1e-16 else min(max(kappa, -2.0 * half), 2.0 * half)
        backx, aheadx, backy, aheady = min(c - w, 0.0), max(e - c, 0.0), min(c - s, 0.0), max(n - c, 0.0)
        # as in `upwind_slope`
        steep = math.sqrt((backx * backx + aheadx * aheadx + backy * backy + aheady * aheady) * inverse)
        slope = steep if slope < KINK_RATIO * steep else slope
        # (5.14), its arctangent by a polynomial: atan x = pi / 2 - atan(1 / x) beyond 1
        x = kappa / scale - 1.0
        size = abs(x)
        t = 1.0 / size if size > 1.0 else size
        q = t * t
        # arctangent on [0, 1] to 2e-8 (Abramowitz and Stegun 4.4.49)
        series = -0.0161657367 + 0.0028662257 * q
        series = 0.1065626393 + q * (-0.0752896400 + q * (0.0429096138 + q * series))
        turn = t * (1.0 + q * (-0.3333314528 + q * (0.1999355085 + q * (-0.1420889944 + q * series))))
        turn = 0.5 * math.pi - turn if size > 1.0 else turn
        turn = -turn if x < 0.0 else turn
        moved = c + dt * (turn / math.pi + 0.5) * slope
        # nodes far behind the front are left alone
        out[i] = c if c > behind else moved


@compiled
def advance_steps(values: Array, spare: Array, h: float, kind: int, scale: float, dt: float, steps: int) -> None:
    """Carry `values` (ny, nx), m, by an even number of `steps` of dt each, in place: see `advance_step`.

    `spare` is of the same shape and starts as a copy.
    """
    active = active_columns(values, h)
    for _ in range(0, steps, 2):
        advance_step(values, spare, active, h, kind, scale, dt)
        advance_step(spare, values, active, h, kind, scale, dt)


@compiled
def measure_front(values: Array, h: float) -> tuple[float, float]:
    """Return the length (m) of the zero contour of `values` (ny, nx), m, and the area (m^2) where they are below 0.

    Cell by cell of side h (m), with straight segments.
    """
    ny, nx = values.shape
    length, area = 0.0, 0.0
    corner_x, corner_y = (0.0, 1.0, 1.0, 0.0), (0.0, 0.0, 1.0, 1.0)
    v, px, py, cut_x, cut_y = np.empty(4), np.empty(8), np.empty(8), np.empty(4), np.empty(4)
    for j in range(ny - 1):
        for i in range(nx - 1):
            v[0], v[1], v[2], v[3] = values[j, i], values[j, i + 1], values[j + 1, i + 1], values[j + 1, i]
            # the corners and the cuts round the part of the cell that is below
            count, cuts = 0, 0
            for k in range(4):
                after = (k + 1) % 4
                if v[k] < 0.0:
                    px[count], py[count] = corner_x[k], corner_y[k]
                    count += 1
                if (v[k] < 0.0) != (v[after] < 0.0):
                    t = v[k] / (v[k] - v[after])
                    px[count] = cut_x[cuts] = corner_x[k] + t * (corner_x[after] - corner_x[k])
                    py[count] = cut_y[cuts] = corner_y[k] + t * (corner_y[after] - corner_y[k])
                    count, cuts = count + 1, cuts + 1
            if cuts == 0:
                area += h * h if count else 0.0
                continue
            # the shoelace formula on the part of the cell that is below
            covered = 0.0
            for k in range(count):
                after = k + 1 if k + 1 < count else 0
                covered += px[k] * py[after] - px[after] * py[k]
            area += 0.5 * covered * h * h
            # cuts come in pairs: the contour enters and leaves
            for k in range(0, cuts, 2):
                length += h * math.hypot(cut_x[k + 1] - cut_x[k], cut_y[k + 1] - cut_y[k])
    return length, area


@compiled
def sample_at_point(
    values: Array, h: float, x0: float, y0: float, x: float, y: float
) -> tuple[float, float, float, float]:
    """Return value (m), gradient and curvature (1/m) at a point (x, y), m: bilinear between those of the nodes.

    `values` (ny, nx), m, on cells of side h (m) from (x0, y0).
    """
    ny, nx = values.shape
    column, row = (x - x0) / h, (y - y0) / h
    # away from the edge, where central differences reach over it
    i = min(max(int(column), 1), nx - 3)
    j = min(max(int(row), 1), ny - 3)
    a, b = column - i, row - j
    value, gx, gy, kappa = 0.0, 0.0, 0.0, 0.0
    for dj in range(2):
        for di in range(2):
            weight = (a if di else 1.0 - a) * (b if dj else 1.0 - b)
            nx_, ny_, k = derivatives(values, h, j + dj, i + di)
            value += weight * values[j + dj, i + di]
            gx += weight * nx_
            gy += weight * ny_
            kappa += weight * k
    return value, gx, gy, kappa


@compiled
def pull_back(values: Array, h: float, x0: float, y0: float, points: Array) -> None:
    """Move each of points (n, 2), m, by one Newton step onto the zero level of `values` (ny, nx), m, at most a cell."""
    for k in range(points.shape[0]):
        value, gx, gy, _ = sample_at_point(values, h, x0, y0, points[k, 0], points[k, 1])
        gradient_squared = gx * gx + gy * gy
        if gradient_squared > 1e-4:
            # x - gamma grad / |grad|^2
            step = min(max(value / gradient_squared, -h), h)
            points[k, 0] -= step * gx
            points[k, 1] -= step * gy


@compiled
def carry_points(
    values: Array, h: float, x0: float, y0: float, kind: int, scale: float, dt: float, points: Array
) -> float:
    """Carry points (n, 2), m, with the front by one step of (5.16), its sign by (5.6) corrected.

    Each moves by v_f against the gradient of `values` (ny, nx), m. Returns the largest speed.
    """
    fastest = 0.0
    for k in range(points.shape[0]):
        _, gx, gy, kappa = sample_at_point(values, h, x0, y0, points[k, 0], points[k, 1])
        slope = math.hypot(gx, gy)
        # on a ridge there is no direction to go
        if slope > 1e-8:
            speed = velocity(kind, scale, kappa)
            fastest = max(fastest, abs(speed))
            step = dt * speed / slope
            points[k, 0] -= step * gx
            points[k, 1] -= step * gy
    return fastest


@compiled
def keep_apart(points: Array, least_gap: float) -> int:
    """Slide points (n, 2), m, along their closed polyline until each is `least_gap` (m) past the one before.

    The points keep their order, and move as little as that takes in the sense of least squares: pools of equal shift
    (isotonic regression), starting after the widest gap. Returns how many gaps were too small.
    """
    n = points.shape[0]
    gaps, tangents = np.empty(n), np.empty((n, 2))
    for k in range(n):
        # a wide chord about the point: neighbours may have crossed
        for reach in range(1, n // 8):
            before, after = (k - reach) % n, (k + reach) % n
            dx, dy = points[after, 0] - points[before, 0], points[after, 1] - points[before, 1]
            if math.hypot(dx, dy) > 8.0 * least_gap:
                break
        size = math.hypot(dx, dy)
        tangents[k, 0], tangents[k, 1] = dx / size, dy / size
    for k in range(n):
        after = (k + 1) % n
        tx, ty = tangents[k, 0] + tangents[after, 0], tangents[k, 1] + tangents[after, 1]
        size = max(math.hypot(tx, ty), 1e-300)
        dx, dy = points[after, 0] - points[k, 0], points[after, 1] - points[k, 1]
        # along the mean tangent: negative where two points have passed each other
        along = (dx * tx + dy * ty) / size
        gaps[k] = along if along < 2.0 * least_gap else math.hypot(dx, dy)
    too_small, first = int(np.sum(gaps < least_gap)), int(np.argmax(gaps)) + 1
    if too_small == 0:
        return 0
    # pool adjacent violators: shifts must not fall from one point to the next
    mean, weight, pools = np.empty(n), np.empty(n), 0
    places, place = np.empty(n), 0.0
    for m in range(n):
        places[m] = place
        place += gaps[(first + m) % n] - least_gap
        mean[pools], weight[pools] = places[m], 1.0
        pools += 1
        # a shift that falls: both pools take their mean
        while pools > 1 and mean[pools - 2] > mean[pools - 1]:
            total = weight[pools - 2] + weight[pools - 1]
            mean[pools - 2] = (mean[pools - 2] * weight[pools - 2] + mean[pools - 1] * weight[pools - 1]) / total
            weight[pools - 2] = total
            pools -= 1
    m = 0
    for pool in range(pools):
        for _ in range(int(weight[pool])):
            k = (first + m) % n
            points[k, 0] += (mean[pool] - places[m]) * tangents[k, 0]
            points[k, 1] += (mean[pool] - places[m]) * tangents[k, 1]
            m += 1
    return too_small
