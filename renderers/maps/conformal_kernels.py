"""Compiled loops of the conformal map: nodes, the integral equation's matrix, the map of points, and the way back."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import PIECE
from hapticeval.records import as_record
from hapticeval.types import Array

Complex: TypeAlias = NDArray[np.complex128]

GRADING_ORDER = 8
"""Order of the substitution: of 4, 6, 8 and 10 it left stars and squares of 40 to 120 nodes a piece the least error."""

NODE_OFFSET = 1e-150
"""Added to the offset from a node: too small to change one, but enough for a point on a node to be mapped as it is."""


class DiskTables(NamedTuple):
    """What the loops walk: the nodes with their images, and the table of boundary angles.

    - `nodes` (n, 6): rows x, y, x', y', cos Θ, sin Θ, in units of `scale` (m) about (`cx`, `cy`);
    - `angles` and `slopes` (m + 1,): the boundary angle Θ (rad), never falling, and its derivative by table step; a
      table has `fine` steps from one node to the next, and its last entry lies one turn after the first;
    - `pieces` and `per_piece`: the curve's, and that of `Nodes`.
    """

    nodes: Array
    angles: Array
    slopes: Array
    pieces: Array
    per_piece: int
    fine: int
    cx: float
    cy: float
    scale: float


@compiled
def grading_substitution(s: float) -> tuple[float, float, float]:
    """Return Kress's substitution w of [0, 1] onto itself at s: w, 1 - w without cancellation, and w'."""
    r, q = 1.0 - s, 0.5 - 1.0 / GRADING_ORDER
    # w = a^p / (a^p + b^p): a and b are cubics that vanish at the one end and the other
    first = s * (2.0 / GRADING_ORDER + q * (6.0 - 12.0 * s + 8.0 * s * s))
    last = r * (2.0 / GRADING_ORDER + q * (6.0 - 12.0 * r + 8.0 * r * r))
    rise = 2.0 / GRADING_ORDER + 6.0 * q * (1.0 - 2.0 * s) ** 2
    total = first**GRADING_ORDER + last**GRADING_ORDER
    # the derivative vanishes at both ends as the power p - 1
    slope = GRADING_ORDER * rise * (first * last) ** (GRADING_ORDER - 1) / (total * total)
    return first**GRADING_ORDER / total, last**GRADING_ORDER / total, slope


@compiled
def parameter_at(pieces: Array, n: int, per_piece: int, t: float) -> float:
    """Return the curve's u at the parameter t of its nodes, inside the curve's range.

    `pieces` (k, 9); u is in m of arc length on a curve of lines and arcs.
    """
    start, end = as_record(pieces, PIECE).u0, as_record(pieces, PIECE, pieces.shape[0] - 1).u1
    # a smooth curve: equal steps of u
    if per_piece == 0:
        share = t / n
        u = start + (end - start) * (share - np.floor(share))
        return float(u if u < end else start)
    # the first node of a piece lies half a step after its start
    place = (t + 0.5) / per_piece
    place -= pieces.shape[0] * np.floor(place / pieces.shape[0])
    k = min(int(place), pieces.shape[0] - 1)
    after, before, _ = grading_substitution(place - k)
    piece = as_record(pieces, PIECE, k)
    low, high = piece.u0, piece.u1
    # from the nearer end, so that no digits are lost
    u = low + (high - low) * after if after < 0.5 else high - (high - low) * before
    return float(u if u < end else start)


@compiled
def parameters_at(pieces: Array, n: int, per_piece: int, places: Array) -> Array:
    """Return `parameter_at` (m,) for each of the places (m,), in m of arc length on lines and arcs."""
    out = np.empty(places.shape[0])
    for i in range(out.shape[0]):
        out[i] = parameter_at(pieces, n, per_piece, places[i])
    return out


@compiled
def double_layer_matrix(anchors: Complex, offsets: Complex, steps: Complex) -> Array:
    """Return the adjoint double layer on the nodes: (n, n), each column of which sums to one.

    `anchors`, `offsets` and `steps` (n,), complex, m, are those of `Nodes`. Row i, column j holds the turn at node i,
    in shares of a full one, of the direction from node j.

    Seen from a boundary point the whole boundary turns by a half. Adding the half that the jump of the layer gives, the
    diagonal follows from the others, which makes the rule exact at corners too.
    """
    n = anchors.shape[0]
    out = np.empty((n, n))
    for j in range(n):
        out[j, j] = 1.0
    for i in range(n):
        tx, ty = steps[i].real / (2.0 * math.pi), steps[i].imag / (2.0 * math.pi)
        for j in range(n):
            if i == j:
                continue
            # anchors and offsets apart: close to a corner the anchors cancel exactly
            dx = (anchors[i].real - anchors[j].real) + (offsets[i].real - offsets[j].real)
            dy = (anchors[i].imag - anchors[j].imag) + (offsets[i].imag - offsets[j].imag)
            # Im(z_i' / (z_i - z_j)) / 2π
            turn = (dx * ty - dy * tx) / (dx * dx + dy * dy)
            out[i, j] = turn
            out[j, j] -= turn
    return out


@compiled
def map_to_disk(disk: DiskTables, px: float, py: float) -> tuple[float, float]:
    """Return the image in the unit disk of a point (m) inside the curve: barycentric Cauchy's formula.

    The quotient of two integrals by one rule is exact for a constant, and interpolates at the nodes: it holds its
    accuracy up to the boundary, where each integral alone loses all of it.
    """
    nodes = disk.nodes
    px, py = (px - disk.cx) / disk.scale, (py - disk.cy) / disk.scale
    ax, ay, bx, by = 0.0, 0.0, 0.0, 0.0
    for j in range(nodes.shape[0]):
        dx, dy = nodes[j, 0] - px + NODE_OFFSET, nodes[j, 1] - py
        tx, ty, fx, fy = nodes[j, 2], nodes[j, 3], nodes[j, 4], nodes[j, 5]
        # weight z_j' / (z_j - z): numerator sums it times f_j, denominator alone
        inverse_squared = 1.0 / (dx * dx + dy * dy)
        wx, wy = (tx * dx + ty * dy) * inverse_squared, (ty * dx - tx * dy) * inverse_squared
        ax += wx * fx - wy * fy
        ay += wx * fy + wy * fx
        bx += wx
        by += wy
    # complex quotient a / b
    size = bx * bx + by * by
    return (ax * bx + ay * by) / size, (ay * bx - ax * by) / size


@compiled
def map_to_angle(disk: DiskTables, px: float, py: float) -> float:
    """Return the argument, rad, of the image of a point (m): see `map_to_disk`."""
    x, y = map_to_disk(disk, px, py)
    return math.atan2(y, x)


@compiled
def map_to_angles(disk: DiskTables, points: Array) -> Array:
    """Return `map_to_angle` (n,), rad, of each of the points (n, 2), m."""
    out = np.empty(points.shape[0])
    for i in range(out.shape[0]):
        out[i] = map_to_angle(disk, points[i, 0], points[i, 1])
    return out


@compiled
def boundary_parameter(disk: DiskTables, angle: float) -> float:
    """Return the curve's u at a boundary angle (rad): the table's monotone cubic, solved by safeguarded Newton."""
    angles, slopes = disk.angles, disk.slopes
    last = angles.shape[0] - 1
    # the angle is brought into the one turn of the table
    turns = math.floor((angle - angles[0]) / (2.0 * math.pi))
    angle = min(max(angle - turns * 2.0 * math.pi, angles[0]), angles[last])
    k = min(np.searchsorted(angles, angle, "right") - 1, last - 1)
    rise, goal = angles[k + 1] - angles[k], angle - angles[k]
    share = 0.5
    if rise > 0.0:
        share = goal / rise
        start, end = slopes[k], slopes[k + 1]
        # Hermite's cubic from the rise and both slopes
        c, d = 3.0 * rise - 2.0 * start - end, start + end - 2.0 * rise
        low, high = 0.0, 1.0
        for _ in range(60):
            # Newton, halved where it leaves the bracket
            excess = share * (start + share * (c + share * d)) - goal
            if excess > 0.0:
                high = share
            else:
                low = share
            slope = start + share * (2.0 * c + 3.0 * share * d)
            next_share = share - excess / slope if slope > 0.0 else -1.0
            if not (low <= next_share <= high):
                next_share = 0.5 * (low + high)
            if abs(next_share - share) <= 1e-15:
                share = next_share
                break
            share = next_share
    return parameter_at(disk.pieces, disk.nodes.shape[0], disk.per_piece, (k + share) / disk.fine)


@compiled
def boundary_parameters(disk: DiskTables, angles: Array) -> Array:
    """Return `boundary_parameter` (n,) for each of the angles (n,), rad."""
    out = np.empty(angles.shape[0])
    for i in range(out.shape[0]):
        out[i] = boundary_parameter(disk, angles[i])
    return out


@compiled
def project_to_parameter(disk: DiskTables, x: float, y: float) -> float:
    """Return the u that a point (x, y), m, inside is projected to: that at the argument of its image."""
    return boundary_parameter(disk, map_to_angle(disk, x, y))
