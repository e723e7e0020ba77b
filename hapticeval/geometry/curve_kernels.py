"""Compiled loops over one plane curve: nearest point, side, arc length and its inverse.

Pieces are as in `kernels`. A smooth closed piece (CASSINIAN, ELLIPSE) brings a table `samples` (m, 8) that is
fine enough for every local minimum of the distance to show between two rows:

    u, s, x, y, x', y', x'', y''

Curves of LINE, ARC and UNBOUNDED pieces are answered in closed form and bring an empty table.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import ARC, U0, U1, UNBOUNDED, A, B, C, D, E, evaluate
from hapticeval.geometry.smooth_kernels import nearest_smooth
from hapticeval.types import Array

STRAIGHT = 1e-9
"""A joint that turns less than this (rad) is smooth."""

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
MAX_PANELS = 100_000


@compiled
def speed_integral(piece: Array, start: float, end: float) -> float:
    """Arc length of one smooth piece between two parameters, by one 16-point Gauss-Legendre rule."""
    half = 0.5 * (end - start)
    middle = 0.5 * (start + end)
    total = 0.0
    for i in range(NODES.shape[0]):
        _, _, dx, dy, _, _ = evaluate(piece, middle + half * NODES[i])
        total += WEIGHTS[i] * math.hypot(dx, dy)
    return total * half


@compiled
def arc_panels(piece: Array, count: int) -> Array:
    """Cut a smooth piece until the 16-point rule is exact to rounding: rows (u, s), from `count` panels."""
    whole = 0.0
    step = (piece[U1] - piece[U0]) / count
    for i in range(count):
        whole += speed_integral(piece, piece[U0] + i * step, piece[U0] + (i + 1) * step)
    out = np.empty((MAX_PANELS + 1, 2))
    out[0, 0], out[0, 1] = piece[U0], 0.0
    rows = 1
    ends = np.empty(64)
    carry = 0.0  # Kahan: a thousand panels must not cost three digits
    for i in range(count):
        depth = 1
        ends[0] = piece[U1] if i == count - 1 else piece[U0] + (i + 1) * step
        while depth > 0:
            start, end = out[rows - 1, 0], ends[depth - 1]
            middle = 0.5 * (start + end)
            whole_panel = speed_integral(piece, start, end)
            halves = speed_integral(piece, start, middle) + speed_integral(piece, middle, end)
            _, _, ax, ay, _, _ = evaluate(piece, start)
            _, _, bx, by, _, _ = evaluate(piece, end)
            # the nodes are rounded to 5e-16 rad, which the change of speed makes an error of the length
            rounding = 4e-16 * whole + 4e-16 * halves + 1e-15 * abs(math.hypot(bx, by) - math.hypot(ax, ay))
            fine = abs(whole_panel - halves) <= rounding
            if fine or depth > 48 or rows > MAX_PANELS - 64:
                value = halves - carry
                total = out[rows - 1, 1] + value
                carry = (total - out[rows - 1, 1]) - value
                out[rows, 0], out[rows, 1] = end, total
                rows += 1
                depth -= 1
            else:
                ends[depth] = middle
                depth += 1
    return out[:rows].copy()


@compiled
def arc_lengths(piece: Array, panels: Array, us: Array) -> Array:
    """Arc length from the start of a smooth piece to each u in its range."""
    out = np.empty(us.shape[0])
    for i in range(us.shape[0]):
        k = min(max(np.searchsorted(panels[:, 0], us[i], "right") - 1, 0), panels.shape[0] - 2)
        out[i] = panels[k, 1] + speed_integral(piece, panels[k, 0], us[i])
    return out


@compiled
def parameters_at(piece: Array, panels: Array, lengths: Array) -> Array:
    """The u at each arc length of a smooth piece: safeguarded Newton inside the panel that holds it."""
    out = np.empty(lengths.shape[0])
    for i in range(lengths.shape[0]):
        s = lengths[i]
        k = min(max(np.searchsorted(panels[:, 1], s, "right") - 1, 0), panels.shape[0] - 2)
        low, high = panels[k, 0], panels[k + 1, 0]
        u = low + (high - low) * (s - panels[k, 1]) / (panels[k + 1, 1] - panels[k, 1])
        for _ in range(60):
            miss = panels[k, 1] + speed_integral(piece, panels[k, 0], u) - s
            if miss > 0.0:
                high = u
            else:
                low = u
            _, _, dx, dy, _, _ = evaluate(piece, u)
            step = miss / math.hypot(dx, dy)
            following = u - step
            if not (low <= following <= high):
                following = 0.5 * (low + high)
            if abs(following - u) <= 2e-16 * (1.0 + abs(u)):
                u = following
                break
            u = following
        out[i] = u
    return out


@compiled
def _nearest_on_piece(piece: Array, x: float, y: float) -> tuple[float, float]:
    """Nearest point of one LINE, ARC or UNBOUNDED piece in closed form: (u, distance)."""
    if piece[0] == ARC:
        angle = math.atan2(y - piece[B], x - piece[A])
        swept = (piece[E] * (angle - piece[D])) % (2.0 * math.pi)
        u = piece[U0] + swept * piece[C]
        if u <= piece[U1]:
            return u, abs(math.hypot(x - piece[A], y - piece[B]) - piece[C])
        ax, ay, _, _, _, _ = evaluate(piece, piece[U0])
        bx, by, _, _, _, _ = evaluate(piece, piece[U1])
        start, end = math.hypot(ax - x, ay - y), math.hypot(bx - x, by - y)
        if start <= end:
            return piece[U0], start
        return piece[U1], end
    along = (x - piece[A]) * piece[C] + (y - piece[B]) * piece[D]
    if piece[0] == UNBOUNDED:
        return along, abs((y - piece[B]) * piece[C] - (x - piece[A]) * piece[D])
    if along <= 0.0:
        return piece[U0], math.hypot(x - piece[A], y - piece[B])
    length = piece[U1] - piece[U0]
    if along >= length:
        return piece[U1], math.hypot(x - piece[A] - length * piece[C], y - piece[B] - length * piece[D])
    return piece[U0] + along, abs((y - piece[B]) * piece[C] - (x - piece[A]) * piece[D])


@compiled
def joint_turn(pieces: Array, k: int) -> float:
    """The turn (rad) where piece k starts, from the end of the piece before it: positive is convex."""
    before = pieces[k - 1] if k > 0 else pieces[pieces.shape[0] - 1]
    _, _, ax, ay, _, _ = evaluate(before, before[U1])
    _, _, bx, by, _, _ = evaluate(pieces[k], pieces[k, U0])
    return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


@compiled
def foot(
    pieces: Array, samples: Array, x: float, y: float
) -> tuple[int, float, float, float, tuple[float, float, float, float, float, float]]:
    """The nearest point of a curve: (piece, u, distance, side, what `evaluate` gives there).

    The side is -1.0 inside, 1.0 outside or on the curve. Where the nearest point is a corner, it is told by the corner
    alone: only points outside are nearest to a convex one, only points inside to a concave one.
    """
    count = pieces.shape[0]
    if samples.shape[0] > 0:
        u = nearest_smooth(pieces[0], samples, x, y)
        there = evaluate(pieces[0], u)
        ex, ey = x - there[0], y - there[1]
        return 0, u, math.hypot(ex, ey), -1.0 if ex * there[3] - ey * there[2] < 0.0 else 1.0, there
    u, distance, k = 0.0, np.inf, 0
    for i in range(count):
        at, far = _nearest_on_piece(pieces[i], x, y)
        if far < distance:
            u, distance, k = at, far, i
    turn = 0.0
    if pieces[0, 0] != UNBOUNDED and (u == pieces[k, U0] or u == pieces[k, U1]):
        if u == pieces[k, U1]:
            k = (k + 1) % count
            u = pieces[k, U0]
        turn = joint_turn(pieces, k)
    there = evaluate(pieces[k], u)
    side = -1.0 if (x - there[0]) * there[3] - (y - there[1]) * there[2] < 0.0 else 1.0
    if abs(turn) > STRAIGHT:
        side = 1.0 if turn > 0.0 else -1.0
    return k, u, distance, side, there


@compiled
def project(pieces: Array, samples: Array, x: float, y: float) -> tuple[float, float, float]:
    """The nearest point of a curve: (u, distance, side), as `foot` gives them."""
    _, u, distance, side, _ = foot(pieces, samples, x, y)
    return u, distance, side


@compiled
def project_many(pieces: Array, samples: Array, points: Array) -> Array:
    """`project` for each row of points (n, 2): rows (u, distance, side)."""
    out = np.empty((points.shape[0], 3))
    for i in range(points.shape[0]):
        u, distance, side = project(pieces, samples, points[i, 0], points[i, 1])
        out[i, 0], out[i, 1], out[i, 2] = u, distance, side
    return out


@compiled
def sample_table(piece: Array, panels: Array, cuts: int) -> Array:
    """The table that `project` needs of a smooth piece: each panel cut into `cuts` equal steps of u."""
    count = (panels.shape[0] - 1) * cuts
    out = np.empty((count + 1, 8))
    for i in range(count + 1):
        k = min(i // cuts, panels.shape[0] - 2)
        u = panels[k, 0] + (panels[k + 1, 0] - panels[k, 0]) * (i - k * cuts) / cuts
        x, y, dx, dy, ddx, ddy = evaluate(piece, u)
        out[i, 0], out[i, 1] = u, panels[k, 1] + speed_integral(piece, panels[k, 0], u)
        out[i, 2], out[i, 3], out[i, 4], out[i, 5], out[i, 6], out[i, 7] = x, y, dx, dy, ddx, ddy
    return out
