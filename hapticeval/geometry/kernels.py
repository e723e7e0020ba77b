"""Plane curves as rows of numbers, so that compiled loops can walk any of them.

A curve is an array `pieces` of shape (n, 9), a row a piece. A row begins with a `PIECE`: the kind, and the range of the
parameter u, which runs from u0 to u1 on the piece, and from one piece into the next. What follows depends on the kind:

| kind      | record            | what it holds                                              | u is           |
|-----------|-------------------|------------------------------------------------------------|----------------|
| LINE      | `LINE_PIECE`      | start (m), unit tangent                                    | arc length (m) |
| ARC       | `ARC_PIECE`       | centre (m), radius (m), angle of the start (rad), sense    | arc length (m) |
| CASSINIAN | `CASSINIAN_PIECE` | scale (m), lobes n_l, ratio a_n / a_d, `above`: that less 1 | s of (4.1)    |
| ELLIPSE   | `ELLIPSE_PIECE`   | semi-axes a and b (m)                                      | angle (rad)    |
| UNBOUNDED | `LINE_PIECE`      | a point (m), unit tangent; u runs over all reals           | arc length (m) |

The sense of an arc is +1 anticlockwise, -1 clockwise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.records import as_record, as_records, record_type
from hapticeval.types import Array

LINE, ARC, CASSINIAN, ELLIPSE, UNBOUNDED = 0.0, 1.0, 2.0, 3.0, 4.0
PIECE = record_type("kind", "u0", "u1")
LINE_PIECE = record_type("x", "y", "dx", "dy", base=PIECE)
ARC_PIECE = record_type("x", "y", "radius", "angle", "sense", base=PIECE)
CASSINIAN_PIECE = record_type("scale", "lobes", "ratio", "above", base=PIECE)
ELLIPSE_PIECE = record_type("a", "b", base=PIECE)
"""What a row of pieces begins with, of any kind and of each, see the table above."""
PIECE_COLUMNS = 9

SMOOTH_KINDS = {CASSINIAN: (CASSINIAN_PIECE, ("scale",)), ELLIPSE: (ELLIPSE_PIECE, ("a", "b"))}
"""The kinds that close on themselves and are alone in their curve: the record of each, and which of it are lengths, m.

A further one has a branch in `evaluate` and in `curvature_rate` too, and its bounds in `renderers/outline.py`.
"""

RESTS, LEAVES = 0, 1
"""How a walk along the surface ends: at a local minimum of the distance, or where the way to the hand is free."""

Values: TypeAlias = tuple[float, float, float, float, float, float]
"""Position (m) and its first two derivatives by the parameter: x, y, x', y', x'', y''."""


@compiled
def cassinian_root(lobes: float, above: float, u: float) -> tuple[float, float, float, float]:
    """Return what (4.1) is made of, to rounding: sin and cos of n_l u, their root, and cos + root.

    The root is sqrt(a_n / a_d - sin^2), and `above` is a_n / a_d - 1. As a_n / a_d falls to 1 the valleys become
    narrow, and these are small differences.

    So n_l u is taken with the part that its product loses (Dekker 1971), and root^2 = above + cos^2.
    """
    turn = lobes * u
    # Dekker's split: 2^27 + 1 leaves in `high` the upper 26 bits of u
    high = 134217729.0 * u
    high -= high - u
    # turn + product_error is n_l u exactly
    product_error = (lobes * high - turn) + lobes * (u - high)
    sin_n, cos_n = math.sin(turn), math.cos(turn)
    # the angle-sum formulas for an angle as small as product_error
    sin_n, cos_n = sin_n + product_error * cos_n, cos_n - product_error * sin_n
    root = math.sqrt(above + cos_n * cos_n)
    # cos + root = above / (root - cos): no cancellation where cos < 0
    return sin_n, cos_n, root, cos_n + root if cos_n > 0.0 else above / (root - cos_n)


@compiled
def evaluate_line(piece: Array, along: float) -> Values:
    """Return what `evaluate` gives on a straight piece (9,), m, `along` (m) from its start."""
    line = as_record(piece, LINE_PIECE)
    return line.x + along * line.dx, line.y + along * line.dy, line.dx, line.dy, 0.0, 0.0


@compiled
def evaluate(piece: Array, u: float) -> Values:
    """Return position and its first two derivatives by u on one piece (9,): (x, y, x', y', x'', y'').

    Positions are in m, derivatives in m per unit of u: arc length (m) on lines and arcs, an angle (rad) on the others.
    """
    start = as_record(piece, PIECE)
    kind = start.kind
    if kind == LINE:
        return evaluate_line(piece, u - start.u0)
    # its range begins at -infinity: u itself is the arc length from its point
    if kind == UNBOUNDED:
        return evaluate_line(piece, u)
    if kind == ARC:
        arc = as_record(piece, ARC_PIECE)
        radius, sense = arc.radius, arc.sense
        angle = arc.angle + sense * (u - arc.u0) / radius
        cos, sin = math.cos(angle), math.sin(angle)
        return (
            arc.x + radius * cos,
            arc.y + radius * sin,
            -sense * sin,
            sense * cos,
            -cos / radius,
            -sin / radius,
        )
    if kind == CASSINIAN:
        oval = as_record(piece, CASSINIAN_PIECE)
        lobes, ratio = oval.lobes, oval.ratio
        sin_n, cos_n, root, lift = cassinian_root(lobes, oval.above, u)
        # radius(u) of (4.1) and its logarithmic derivatives: r'/r = g, g' = -n_l (a_n/a_d) cos / root^3
        radius = oval.scale * (lift / (1.0 + math.sqrt(ratio))) ** (1.0 / lobes)
        g = -sin_n / root
        g1 = -lobes * ratio * cos_n / (root * root * root)
        cos, sin = math.cos(u), math.sin(u)
        # y = r e^(iu): y'' = r (g^2 + g' - 1 + 2 i g) e^(iu)
        second = g * g - 1.0 + g1
        return (
            radius * cos,
            radius * sin,
            radius * (g * cos - sin),
            radius * (g * sin + cos),
            radius * (second * cos - 2.0 * g * sin),
            radius * (second * sin + 2.0 * g * cos),
        )
    # what is left is an ellipse: (a cos u, b sin u)
    ellipse = as_record(piece, ELLIPSE_PIECE)
    a, b, cos, sin = ellipse.a, ellipse.b, math.cos(u), math.sin(u)
    return a * cos, b * sin, -a * sin, b * cos, -a * cos, -b * sin


@compiled
def curvature_rate(piece: Array, u: float) -> float:
    """Return how fast the signed curvature changes along one piece (9,), dκ/ds, 1/m^2: zero on lines and arcs."""
    kind = as_record(piece, PIECE).kind
    if kind == ELLIPSE:
        ellipse, cos, sin = as_record(piece, ELLIPSE_PIECE), math.cos(u), math.sin(u)
        long, short = ellipse.a, ellipse.b
        # κ = a b / speed^3, so dκ/ds = -3 a b speed' / speed^5, and speed speed' = (a^2 - b^2) sin cos
        speed_squared = (long * sin) ** 2 + (short * cos) ** 2
        speed_to_sixth = speed_squared * speed_squared * speed_squared
        return float(-3.0 * long * short * (long * long - short * short) * sin * cos / speed_to_sixth)
    if kind == CASSINIAN:
        oval = as_record(piece, CASSINIAN_PIECE)
        lobes, ratio = oval.lobes, oval.ratio
        sin_n, cos_n, root, lift = cassinian_root(lobes, oval.above, u)
        root_squared = root * root
        radius = oval.scale * (lift / (1.0 + math.sqrt(ratio))) ** (1.0 / lobes)
        # with g, g', g'' as in `evaluate` and h^2 = 1 + g^2: κ = (h^2 - g') / (radius h^3), ds/du = radius h
        g = -sin_n / root
        g1 = -lobes * ratio * cos_n / (root_squared * root)
        g2 = lobes * lobes * ratio * sin_n * (root_squared - 3.0 * cos_n * cos_n) / (root_squared * root_squared * root)
        h_squared = 1.0 + g * g
        return float(
            (2.0 * g * g1 - g2 - (h_squared - g1) * g * (1.0 + 3.0 * g1 / h_squared))
            / (radius * radius * h_squared * h_squared)
        )
    return 0.0


@compiled
def piece_index(pieces: Array, u: float) -> int:
    """Return the index of the piece of `pieces` (n, 9) that holds u, the later one at a join.

    u must lie in the curve's range: in m of arc length on lines and arcs.
    """
    low, high = 0, pieces.shape[0] - 1
    # bisection over the starts, which rise
    while low < high:
        middle = (low + high + 1) // 2
        if as_record(pieces, PIECE, middle).u0 <= u:
            low = middle
        else:
            high = middle - 1
    return low


@compiled
def evaluate_many(pieces: Array, us: Array) -> Array:
    """Return `evaluate` at each of `us` (n,): rows (n, 6) of position (m) and first two derivatives by u."""
    out = np.empty((us.shape[0], 6))
    for i in range(us.shape[0]):
        x, y, dx, dy, ddx, ddy = evaluate(pieces[piece_index(pieces, us[i])], us[i])
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4], out[i, 5] = x, y, dx, dy, ddx, ddy
    return out


@compiled
def check_finite(points: Array) -> None:
    """Raise `ValueError` for points (n, N), m, of which a coordinate is not finite: who calls words it, by row."""
    for i in range(points.shape[0]):
        for k in range(points.shape[1]):
            if not math.isfinite(points[i, k]):
                raise ValueError("not finite")


def line_pieces(vertices: Array) -> Array:
    """Return LINE pieces (n, PIECE_COLUMNS) through the vertices (n, 2), m, and back to the first."""
    edges = np.roll(vertices, -1, axis=0) - vertices
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    # u is the arc length from the first vertex
    ends = np.cumsum(lengths)
    pieces = np.zeros((vertices.shape[0], PIECE_COLUMNS))
    lines = as_records(pieces, LINE_PIECE)
    lines.kind = LINE
    lines.u0[1:] = ends[:-1]
    lines.u1 = ends
    lines.x, lines.y = vertices.T
    lines.dx, lines.dy = (edges / lengths[:, np.newaxis]).T
    return pieces


def line_piece(start: Sequence[float], end: Sequence[float]) -> Array:
    """Return one LINE piece from a point (m) to another, with u from 0."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = float(np.hypot(dx, dy))
    return np.array([LINE, 0.0, length, start[0], start[1], dx / length, dy / length, 0.0, 0.0])


def arc_piece(centre: Sequence[float], radius: float, start: float, sweep: float) -> Array:
    """Return one ARC piece from angle `start` through `sweep` (rad, negative is clockwise), with u from 0."""
    # u runs over the arc length
    length = abs(sweep) * radius
    return np.array([ARC, 0.0, length, centre[0], centre[1], radius, start, np.sign(sweep), 0.0])


def concatenate_segments(rows: Sequence[Array]) -> Array:
    """Return pieces (n, PIECE_COLUMNS), m, put one after the other: u runs on from each into the next."""
    pieces = np.array(rows)
    ranges = as_records(pieces, PIECE)
    ends = np.cumsum(ranges.u1)
    ranges.u1 = ends
    ranges.u0[1:] = ends[:-1]
    return pieces
