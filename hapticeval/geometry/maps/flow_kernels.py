"""Compiled loops of the curve shortening flow: the level set step (5.4), and its contour.

`values` (ny, nx) are gamma at square cells of side `h`, negative inside; node (j, i) is at origin + h (i, j). The front
is the zero level, moves towards gamma < 0, and leaves positive values behind.

Compiled loops over the particles of the flow (5.16): they go with the front, come back onto it, and keep apart.

`values`, `h` and the origin (`x0`, `y0`) are the grid of `flow_kernels`.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.types import Array, IntArray

CURVATURE, UNIT, CAP, ARC = 0, 1, 2, 3
"""Velocity functions: kappa; 1; max(kappa, K_cap) (5.13); arctan(kappa / kappa_avg - 1) / pi + 1/2 (5.14)."""

BEHIND = 4.0
"""Cells behind the front beyond which a node is left alone: levels move independently of each other."""


KINK = 0.8


@compiled
def velocity(kind: int, scale: float, kappa: float) -> float:
    """v_f at a curvature: `scale` is K_cap (1/m) for CAP and abs(kappa_avg) (1/m) for ARC."""
    if kind == CURVATURE:
        return kappa
    if kind == UNIT:
        return 1.0
    if kind == CAP:
        return max(kappa, scale)
    return math.atan(kappa / scale - 1.0) / math.pi + 0.5


@compiled
def largest_step(kind: int, scale: float, h: float) -> float:
    """The bound on the time step, (5.12) corrected: diffusive h^2 / (4 max dv/dkappa), hyperbolic h / (2 max v)."""
    if kind == UNIT:
        return 0.5 * h
    if kind == CURVATURE:
        return 0.25 * h * h
    if kind == CAP:
        return min(0.25 * h * h, 0.5 * h / scale)
    return min(0.25 * h * h * math.pi * scale, 0.5 * h)


@compiled
def derivatives(values: Array, h: float, j: int, i: int) -> tuple[float, float, float]:
    """Central differences at a node: gradient (gx, gy), and curvature (5.8) in 1/m, at most 1/h in size."""
    west, east = values[j, i - 1], values[j, i + 1]
    south, north = values[j - 1, i], values[j + 1, i]
    here = values[j, i]
    gx, gy = (east - west) / (2.0 * h), (north - south) / (2.0 * h)
    g2 = gx * gx + gy * gy
    if g2 < 1e-16:
        return gx, gy, 0.0
    gxx = (east - 2.0 * here + west) / (h * h)
    gyy = (north - 2.0 * here + south) / (h * h)
    gxy = (values[j + 1, i + 1] - values[j + 1, i - 1] - values[j - 1, i + 1] + values[j - 1, i - 1]) / (4.0 * h * h)
    kappa = (gx * gx * gyy - 2.0 * gx * gy * gxy + gy * gy * gxx) / (g2 * math.sqrt(g2))
    return gx, gy, min(max(kappa, -1.0 / h), 1.0 / h)


@compiled
def upwind_slope(values: Array, h: float, j: int, i: int) -> float:
    """Godunov's size of the gradient for a front that moves towards smaller values: right at kinks."""
    here = values[j, i]
    total = 0.0
    for before, after in ((values[j, i - 1], values[j, i + 1]), (values[j - 1, i], values[j + 1, i])):
        back, ahead = min(here - before, 0.0), max(after - here, 0.0)
        total += back * back + ahead * ahead
    return math.sqrt(total) / h


@compiled
def spans(values: Array, h: float) -> IntArray:
    """The columns from first to behind the last, of each row, that a step has to look at: (ny, 2), without the edge."""
    ny, nx = values.shape
    out = np.zeros((ny, 2), np.int64)
    near = (BEHIND + 2.0) * h
    for j in range(1, ny - 1):
        low, high = 1, nx - 1
        while low < high and values[j, low] > near:
            low += 1
        while high > low and values[j, high - 1] > near:
            high -= 1
        out[j, 0], out[j, 1] = low, high
    return out


@compiled
def advance(
    values: Array, out: Array, active: IntArray, h: float, kind: int, scale: float, upwind: bool, dt: float
) -> None:
    """One explicit step of (5.4) from `values` into `out`, in the columns of each row that `active` (ny, 2) gives.

    The two agree elsewhere and stay so. With `upwind` the parts of constant speed (UNIT, and CAP where it is at K_cap)
    take Godunov's slope; what depends on the curvature takes central differences, but for nodes on a kink (the medial
    axis of the model), which they would leave behind.
    """
    ny, nx = values.shape
    behind = BEHIND * h
    for j in range(1, ny - 1):
        low, high = active[j, 0], active[j, 1]
        if low >= high:
            continue
        if kind == ARC and upwind:
            reach = slice(low - 1, high + 1)
            _arc_row(values[j - 1, reach], values[j, reach], values[j + 1, reach], out[j, low:high], h, scale, dt)
            continue
        for i in range(low, high):
            here = values[j, i]
            if here > behind:
                out[j, i] = here
                continue
            gx, gy, kappa = derivatives(values, h, j, i)
            slope = math.sqrt(gx * gx + gy * gy)
            if upwind:
                steep = upwind_slope(values, h, j, i)
                if kind == UNIT or (kind == CAP and kappa <= scale) or slope < KINK * steep:
                    slope = steep
            out[j, i] = here + dt * velocity(kind, scale, kappa) * slope
    for i in range(nx):
        out[0, i] = 2.0 * out[1, i] - out[2, i]
        out[ny - 1, i] = 2.0 * out[ny - 2, i] - out[ny - 3, i]
    for j in range(ny):
        out[j, 0] = 2.0 * out[j, 1] - out[j, 2]
        out[j, nx - 1] = 2.0 * out[j, nx - 2] - out[j, nx - 3]


@compiled
def _arc_row(south: Array, here: Array, north: Array, out: Array, h: float, scale: float, dt: float) -> None:
    """The step of `advance` for ARC on a row, without branches, so that it becomes vector code."""
    behind = BEHIND * h
    half, inverse = 0.5 / h, 1.0 / (h * h)
    for i in range(out.shape[0]):
        c, w, e, s, n = here[i + 1], here[i], here[i + 2], south[i + 1], north[i + 1]
        gx, gy = (e - w) * half, (n - s) * half
        g2 = gx * gx + gy * gy
        slope = math.sqrt(g2)
        gxx, gyy = (e - 2.0 * c + w) * inverse, (n - 2.0 * c + s) * inverse
        gxy = (north[i + 2] - north[i] - south[i + 2] + south[i]) * (0.25 * inverse)
        kappa = (gx * gx * gyy - 2.0 * gx * gy * gxy + gy * gy * gxx) / (g2 * slope + 1e-300)
        kappa = 0.0 if g2 < 1e-16 else min(max(kappa, -2.0 * half), 2.0 * half)
        backx, aheadx, backy, aheady = min(c - w, 0.0), max(e - c, 0.0), min(c - s, 0.0), max(n - c, 0.0)
        steep = math.sqrt((backx * backx + aheadx * aheadx + backy * backy + aheady * aheady) * inverse)
        slope = steep if slope < KINK * steep else slope
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
        out[i] = c if c > behind else moved


@compiled
def advance_many(
    values: Array, spare: Array, h: float, kind: int, scale: float, upwind: bool, dt: float, steps: int
) -> None:
    """`advance` by an even number of `steps`, in place; `spare` is of the same shape and starts as a copy."""
    active = spans(values, h)
    for _ in range(0, steps, 2):
        advance(values, spare, active, h, kind, scale, upwind, dt)
        advance(spare, values, active, h, kind, scale, upwind, dt)


@compiled
def front(values: Array, h: float) -> tuple[float, float]:
    """Length (m) of the zero contour, and the area (m^2) where values < 0, cell by cell with straight segments."""
    ny, nx = values.shape
    length, area = 0.0, 0.0
    px, py = np.empty(4), np.empty(4)
    corner_x, corner_y = (0.0, 1.0, 1.0, 0.0), (0.0, 0.0, 1.0, 1.0)
    v = np.empty(4)
    for j in range(ny - 1):
        for i in range(nx - 1):
            v[0], v[1], v[2], v[3] = values[j, i], values[j, i + 1], values[j + 1, i + 1], values[j + 1, i]
            below = 0
            for k in range(4):
                below += v[k] < 0.0
            if below == 4:
                area += h * h
            if below in (0, 4):
                continue
            count = 0
            covered = 0.0  # twice the area below, by the shoelace rule round the part of the cell that is below
            first_x, first_y, last_x, last_y, started = 0.0, 0.0, 0.0, 0.0, False
            for k in range(4):
                after = (k + 1) % 4
                for part in range(2):
                    if part == 0:
                        if v[k] >= 0.0:
                            continue
                        x, y = corner_x[k], corner_y[k]
                    else:
                        if (v[k] < 0.0) == (v[after] < 0.0):
                            continue
                        t = v[k] / (v[k] - v[after])
                        x = corner_x[k] + t * (corner_x[after] - corner_x[k])
                        y = corner_y[k] + t * (corner_y[after] - corner_y[k])
                        px[count], py[count] = x, y
                        count += 1
                    if started:
                        covered += last_x * y - x * last_y
                    else:
                        first_x, first_y, started = x, y, True
                    last_x, last_y = x, y
            covered += last_x * first_y - first_x * last_y
            area += 0.5 * covered * h * h
            for k in range(0, count, 2):
                length += h * math.hypot(px[k + 1] - px[k], py[k + 1] - py[k])
    return length, area


@compiled
def components(values: Array, labels: IntArray) -> int:
    """How many parts, joined along sides or corners of cells, nodes below zero form; `labels` gets their numbers."""
    ny, nx = values.shape
    labels[:] = 0
    stack = np.empty(ny * nx, np.int64)
    found = 0
    for start in range(ny * nx):
        if labels[start // nx, start % nx] != 0 or values[start // nx, start % nx] >= 0.0:
            continue
        found += 1
        labels[start // nx, start % nx] = found
        stack[0] = start
        top = 1
        while top > 0:
            top -= 1
            j, i = stack[top] // nx, stack[top] % nx
            for dj in range(-1, 2):
                for di in range(-1, 2):
                    y, x = j + dj, i + di
                    if 0 <= y < ny and 0 <= x < nx and labels[y, x] == 0 and values[y, x] < 0.0:
                        labels[y, x] = found
                        stack[top] = y * nx + x
                        top += 1
    return found


@compiled
def sample(values: Array, h: float, x0: float, y0: float, x: float, y: float) -> tuple[float, float, float, float]:
    """Value, gradient and curvature at a point: bilinear between those of the nodes."""
    ny, nx = values.shape
    across, up = (x - x0) / h, (y - y0) / h
    i = min(max(int(across), 1), nx - 3)
    j = min(max(int(up), 1), ny - 3)
    a, b = across - i, up - j
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
    """One Newton step of each point (n, 2) onto the zero level, of at most a cell."""
    for k in range(points.shape[0]):
        value, gx, gy, _ = sample(values, h, x0, y0, points[k, 0], points[k, 1])
        g2 = gx * gx + gy * gy
        if g2 > 1e-4:
            step = min(max(value / g2, -h), h)
            points[k, 0] -= step * gx
            points[k, 1] -= step * gy


@compiled
def carry(values: Array, h: float, x0: float, y0: float, kind: int, scale: float, dt: float, points: Array) -> float:
    """One step of (5.16), its sign by (5.6) corrected: each point moves by v_f against the gradient.

    Returns the largest speed.
    """
    fastest = 0.0
    for k in range(points.shape[0]):
        _, gx, gy, kappa = sample(values, h, x0, y0, points[k, 0], points[k, 1])
        slope = math.hypot(gx, gy)
        if slope > 1e-8:
            speed = velocity(kind, scale, kappa)
            fastest = max(fastest, abs(speed))
            step = dt * speed / slope
            points[k, 0] -= step * gx
            points[k, 1] -= step * gy
    return fastest


@compiled
def keep_apart(points: Array, least: float) -> int:
    """Slide the points (n, 2) along their closed polyline until each is `least` (m) past the one before.

    The points keep their order, and move as little as that takes in the sense of least squares: pools of equal shift
    (isotonic regression), starting after the widest gap. Returns how
    many gaps were too small.
    """
    n = points.shape[0]
    gaps = np.empty(n)
    tangents = np.empty((n, 2))
    for k in range(n):
        before, after = (k - 1) % n, (k + 1) % n
        # a wide chord about the point: neighbours may have crossed
        for reach in range(1, n // 8):
            before, after = (k - reach) % n, (k + reach) % n
            dx, dy = points[after, 0] - points[before, 0], points[after, 1] - points[before, 1]
            if math.hypot(dx, dy) > 8.0 * least:
                break
        size = math.hypot(dx, dy)
        tangents[k, 0], tangents[k, 1] = dx / size, dy / size
    small, widest = 0, 0
    for k in range(n):
        after = (k + 1) % n
        tx, ty = tangents[k, 0] + tangents[after, 0], tangents[k, 1] + tangents[after, 1]
        size = max(math.hypot(tx, ty), 1e-300)
        dx, dy = points[after, 0] - points[k, 0], points[after, 1] - points[k, 1]
        along = (dx * tx + dy * ty) / size
        gaps[k] = along if along < 2.0 * least else math.hypot(dx, dy)
        small += gaps[k] < least
        if gaps[k] > gaps[widest]:
            widest = k
    if small == 0:
        return 0
    first = (widest + 1) % n
    mean, weight, size_of = np.empty(n), np.empty(n), np.empty(n, np.int64)
    at, pools = 0.0, 0
    places = np.empty(n)
    for m in range(n):
        places[m] = at
        at += gaps[(first + m) % n] - least
    for m in range(n):
        mean[pools], weight[pools], size_of[pools] = places[m], 1.0, 1
        pools += 1
        while pools > 1 and mean[pools - 2] > mean[pools - 1]:
            total = weight[pools - 2] + weight[pools - 1]
            mean[pools - 2] = (mean[pools - 2] * weight[pools - 2] + mean[pools - 1] * weight[pools - 1]) / total
            weight[pools - 2] = total
            size_of[pools - 2] += size_of[pools - 1]
            pools -= 1
    m = 0
    for pool in range(pools):
        for _ in range(size_of[pool]):
            k = (first + m) % n
            shift = mean[pool] - places[m]
            points[k, 0] += shift * tangents[k, 0]
            points[k, 1] += shift * tangents[k, 1]
            m += 1
    return small
