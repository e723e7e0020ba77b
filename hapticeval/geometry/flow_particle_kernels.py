"""Compiled loops over the particles of the flow (5.16): they go with the front, come back onto it, and keep apart.

`values`, `h` and the origin (`x0`, `y0`) are the grid of `flow_kernels`.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.flow_kernels import derivatives, velocity
from hapticeval.types import Array


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
