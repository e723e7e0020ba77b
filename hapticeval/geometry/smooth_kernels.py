"""The nearest point of a smooth closed piece: a search over a table of it, and Newton's method where it may be.

The table is that of `curve_kernels.sample_table`, with rows (u, s, x, y, x', y', x'', y'').
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import evaluate
from hapticeval.types import Array

BLOCK = 8
"""Rows of the table that are told to be too far at once."""


@compiled
def _slope(piece: Array, u: float, x: float, y: float) -> tuple[float, float, float]:
    """Half the squared distance's first and second derivative by u, and the squared distance."""
    cx, cy, dx, dy, ddx, ddy = evaluate(piece, u)
    rx, ry = cx - x, cy - y
    return rx * dx + ry * dy, dx * dx + dy * dy + rx * ddx + ry * ddy, rx * rx + ry * ry


@compiled
def _descend(piece: Array, low: float, high: float, u: float, x: float, y: float) -> tuple[float, float]:
    """The minimum of the distance between `low` (slope <= 0) and `high` (slope > 0), looked for from `u` on.

    Gives its u and the squared distance there.

    Newton's method, kept between the two. It ends with a step whose square, times the error that a step of one leaves
    as the last two bends tell it, is below rounding.
    """
    last_u, last_bend = u, 0.0
    for _ in range(100):
        slope, bend, square = _slope(piece, u, x, y)
        if slope > 0.0:
            high = u
        else:
            low = u
        following = u - slope / bend if bend > 0.0 else low - 1.0
        if not (low <= following <= high):
            following = 0.5 * (low + high)
        step, rounding = abs(following - u), 2e-16 * (1.0 + abs(u))
        far = abs(u - last_u)
        left = abs(bend - last_bend) * step * step
        if step <= rounding or (last_bend > 0.0 and bend > 0.0 and step < far and left <= bend * far * rounding):
            # the last step still takes this off the square
            return following, max(square - slope * slope / bend, 0.0) if bend > 0.0 else square
        last_u, last_bend, u = u, bend, following
    return u, _slope(piece, u, x, y)[2]


@compiled
def _turning(piece: Array, low: float, high: float, x: float, y: float) -> float:
    """Where the slope of the distance has its extremum between `low` and `high`, by bisection."""
    _, start, _ = _slope(piece, low, x, y)
    for _ in range(60):
        middle = 0.5 * (low + high)
        _, bend, _ = _slope(piece, middle, x, y)
        if (bend > 0.0) == (start > 0.0):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@compiled
def _square(samples: Array, i: int, x: float, y: float) -> float:
    """The squared distance of a row of the table."""
    dx, dy = samples[i, 2] - x, samples[i, 3] - y
    return float(dx * dx + dy * dy)


@compiled
def _out_of_reach(first: float, last: float, arc: float, best: float) -> bool:
    """Whether an arc between two points at these squared distances is too short to come nearer than `best`."""
    reach = best + arc
    # squares tell most of what is too far; roots are slow
    return first > reach * reach or 0.5 * (math.sqrt(first) + math.sqrt(last) - arc) > best


@compiled
def _zero_of_cubic(first: float, last: float, first_rate: float, last_rate: float) -> float:
    """About where between 0 and 1 a cubic with these values (<= 0, > 0) and derivatives at 0 and 1 vanishes."""
    rise = last - first
    second, third = 3.0 * rise - 2.0 * first_rate - last_rate, first_rate + last_rate - 2.0 * rise
    t: float = -first / rise
    for _ in range(2):
        rate = first_rate + t * (2.0 * second + t * 3.0 * third)
        if rate > 0.0:
            t -= (first + t * (first_rate + t * (second + t * third))) / rate
            t = min(max(t, 0.0), 1.0)
    return t


@compiled
def _lowest(piece: Array, a: Array, b: Array, x: float, y: float) -> tuple[float, float]:
    """The minimum of the distance between two rows of the table, as (u, squared distance); that is inf without one.

    It shows as a change of sign of the slope, or as a pair of roots around an extremum of the slope.
    """
    ax, ay, bx, by = a[2] - x, a[3] - y, b[2] - x, b[3] - y
    slope_a, slope_b = ax * a[4] + ay * a[5], bx * b[4] + by * b[5]
    bend_a = a[4] ** 2 + a[5] ** 2 + ax * a[6] + ay * a[7]
    bend_b = b[4] ** 2 + b[5] ** 2 + bx * b[6] + by * b[7]
    low, high = a[0], b[0]
    if slope_a <= 0.0 < slope_b:
        guess = _zero_of_cubic(slope_a, slope_b, bend_a * (high - low), bend_b * (high - low))
        return _descend(piece, low, high, low + guess * (high - low), x, y)
    if slope_a > 0.0 and slope_b > 0.0 and bend_a < 0.0 < bend_b:
        low = _turning(piece, low, high, x, y)
        if _slope(piece, low, x, y)[0] > 0.0:
            return low, np.inf
    elif slope_a < 0.0 and slope_b < 0.0 and bend_b < 0.0 < bend_a:
        high = _turning(piece, low, high, x, y)
        if _slope(piece, high, x, y)[0] <= 0.0:
            return low, np.inf
    else:
        return low, np.inf
    return _descend(piece, low, high, 0.5 * (low + high), x, y)


@compiled
def nearest_smooth(piece: Array, samples: Array, x: float, y: float) -> float:
    """The u of the nearest point of a smooth closed piece.

    A block of intervals, and then an interval, is looked into only if its arc is long enough to reach below the best
    distance known.
    """
    count = samples.shape[0] - 1
    best, nearest = np.inf, 0
    for i in range(0, count, BLOCK):
        square = _square(samples, i, x, y)
        if square < best:
            best, nearest = square, i
    best, best_u = math.sqrt(best), float(samples[nearest, 0])
    last = _square(samples, 0, x, y)
    for start in range(0, count, BLOCK):
        end = min(start + BLOCK, count)
        first, last = last, _square(samples, end, x, y)
        if _out_of_reach(first, last, samples[end, 1] - samples[start, 1], best):
            continue
        here = first
        for i in range(start, end):
            before, here = here, _square(samples, i + 1, x, y)
            if here < best * best:
                best, best_u = math.sqrt(here), samples[i + 1, 0]
            if _out_of_reach(before, here, samples[i + 1, 1] - samples[i, 1], best):
                continue
            u, square = _lowest(piece, samples[i], samples[i + 1], x, y)
            if square < best * best:
                best, best_u = math.sqrt(square), u
    return best_u
