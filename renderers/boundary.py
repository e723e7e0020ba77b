"""A closed curve, a polygon or a line as one bundle of arrays, for the compiled loops of the projections."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hapticeval.compiled import compiled, for_kernels
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.curve_kernels import joint_turn, project
from hapticeval.geometry.kernels import KIND, LINE, U0, U1, evaluate, evaluate_many, piece_of
from hapticeval.geometry.polygon import Polygon
from hapticeval.geometry.polygon_kernels import first_crossing_kernel, nearest_kernel, side_kernel
from hapticeval.renderers.slide import slide
from hapticeval.renderers.third import third_bounds
from hapticeval.types import Array, IntArray

CHORDS = 4096
"""Chords of a whole curve in its collision outline: of the 200 mm Cassinian they stray by 0.1 micrometre."""


class Boundary(NamedTuple):
    """What is rendered, and the outline of chords in which collisions with it are looked for.

    `pieces` as in `geometry.kernels`; `joints` (n,) the turn (rad) where each piece starts; `third` (n, 2) as in
    `third_bounds`; `samples` the curve's table for its nearest point. The outline has `vertices` (m, 2) and `tree`;
    piece k is cut into the chords from `chords[k]` up to `chords[k + 1]`, by equal steps of u; no chord strays from
    the curve by more than `stray` (m), which is zero for straight pieces. `closed` is false for the line.
    """

    pieces: Array
    joints: Array
    third: Array
    samples: Array
    vertices: Array
    tree: Array
    chords: IntArray
    stray: float
    closed: bool


def boundary_of(surface: Curve | Polygon) -> Boundary:
    """The bundle of a curve or a polygon."""
    made = _of_polygon(surface) if isinstance(surface, Polygon) else _of_curve(surface)
    arrays: dict[str, Any] = {
        k: for_kernels(part) for k, part in made._asdict().items() if isinstance(part, np.ndarray)
    }
    return made._replace(**arrays)


def straight(curve: Curve) -> bool:
    """Whether a curve is made of straight edges alone, and so is its own polygon."""
    return bool(np.all(curve.pieces[:, KIND] == LINE))


def _of_polygon(polygon: Polygon) -> Boundary:
    pieces = for_kernels(polygon.as_curve().pieces)
    count = pieces.shape[0]
    return Boundary(
        pieces,
        _turns(pieces),
        np.zeros((count, 2)),
        np.empty((0, 8)),
        polygon.vertices,
        polygon.tree,
        np.arange(count + 1),
        0.0,
        True,
    )


def _of_curve(curve: Curve) -> Boundary:
    pieces = for_kernels(curve.pieces)
    if not curve.closed:
        nothing = np.empty((0, 2))
        third = np.zeros((1, 2))
        tree, chords = np.empty((0, 6)), np.zeros(2, dtype=np.int64)
        return Boundary(pieces, np.zeros(1), third, curve.samples, nothing, tree, chords, 0.0, False)
    start, end = curve.u_range
    cuts = np.ones(pieces.shape[0], dtype=np.int64)
    curved = pieces[:, KIND] != LINE
    share = (pieces[curved, U1] - pieces[curved, U0]) / (end - start)
    cuts[curved] = np.maximum(16, np.ceil(CHORDS * share))
    chords = np.concatenate([[0], np.cumsum(cuts)])
    us = np.concatenate([np.linspace(p[U0], p[U1], n, endpoint=False) for p, n in zip(pieces, cuts, strict=True)])
    ends = np.append(us[1:], end)
    vertices = evaluate_many(pieces, us)[:, :2]
    middles = evaluate_many(pieces, 0.5 * (us + ends))[:, :2]
    sagitta = np.hypot(*(middles - 0.5 * (vertices + np.roll(vertices, -1, axis=0))).T)
    outline = Polygon(vertices)
    return Boundary(
        pieces,
        _turns(pieces),
        third_bounds(pieces),
        curve.samples,
        outline.vertices,
        outline.tree,
        chords,
        2.0 * float(sagitta.max()) if curved.any() else 0.0,
        True,
    )


@compiled
def _turns(pieces: Array) -> Array:
    out = np.empty(pieces.shape[0])
    for k in range(pieces.shape[0]):
        out[k] = joint_turn(pieces, k)
    return out


@compiled
def nearest_on(b: Boundary, x: float, y: float) -> tuple[int, float, float, float]:
    """The nearest surface point: (piece, u, distance, side), side -1.0 inside and 1.0 outside or on it."""
    if b.stray > 0.0 or not b.closed:
        u, distance, side = project(b.pieces, b.samples, x, y)
        if b.samples.shape[0] > 0 or not b.closed:
            return 0, u, distance, side
        return piece_of(b.pieces, u), u, distance, side
    edge, along, distance2 = nearest_kernel(b.vertices, b.tree, x, y)
    row = b.pieces[edge]
    side = side_kernel(b.vertices, edge, along, x, y) if distance2 > 0.0 else 1.0
    return edge, row[U0] + along * (row[U1] - row[U0]), math.sqrt(distance2), side


@compiled
def clear_of(b: Boundary, x: float, y: float) -> bool:
    """Whether a point is outside by more than the chords stray: what can be told at the cost of a polygon."""
    if not b.closed:
        return False
    edge, along, distance2 = nearest_kernel(b.vertices, b.tree, x, y)
    return distance2 > b.stray * b.stray and side_kernel(b.vertices, edge, along, x, y) > 0.0


@compiled
def entered(b: Boundary, x0: float, y0: float, x1: float, y1: float, leaving: bool) -> tuple[bool, int, float]:
    """Whether a tool that moves straight from (x0, y0), outside or on the surface, runs into it: and (piece, u) where.

    `leaving`: it starts on the surface. A crossing of the chords counts wherever both ends lie, so that nothing is
    too thin to be hit. A curve lies up to `stray` beside its chords: there the exact side of the end decides.
    """
    if not b.closed:
        _, u, _, side = nearest_on(b, x1, y1)
        if side > 0.0:
            return False, 0, 0.0
        px, py, dx, dy, _, _ = evaluate(b.pieces[0], u)
        before, after = (x0 - px) * dy - (y0 - py) * dx, (x1 - px) * dy - (y1 - py) * dx
        if before > 0.0:
            u -= ((x1 - x0) * dx + (y1 - y0) * dy) * after / (after - before)
        return True, 0, u
    edge, t, fraction = first_crossing_kernel(b.vertices, b.tree, x0, y0, x1, y1)
    if edge >= 0 and (b.stray == 0.0 or fraction < 1.0):
        piece, u = _piece_at(b, edge, t)
        return True, piece, u
    if (b.stray == 0.0 and not leaving) or clear_of(b, x1, y1):
        return False, 0, 0.0
    piece, u, distance, side = nearest_on(b, x1, y1)
    if side > 0.0 or distance == 0.0:
        return False, 0, 0.0
    if distance > b.stray:
        # deep inside without a crossing: it started between curve and chord
        near, v, _, _ = nearest_on(b, x0, y0)
        _, near, v = slide(b.pieces, b.joints, b.third, b.closed, False, near, v, x1, y1)
        px, py, dx, dy, _, _ = evaluate(b.pieces[near], v)
        if (x1 - px) * dy - (y1 - py) * dx < 0.0:
            return True, near, v
    return True, piece, u


@compiled
def _piece_at(b: Boundary, chord: int, t: float) -> tuple[int, float]:
    """The (piece, u) at fraction t of a chord."""
    low, high = 0, b.pieces.shape[0] - 1
    while low < high:
        middle = (low + high + 1) // 2
        if b.chords[middle] <= chord:
            low = middle
        else:
            high = middle - 1
    first, after = b.chords[low], b.chords[low + 1]
    share = (chord - first + t) / (after - first)
    return low, b.pieces[low, U0] + share * (b.pieces[low, U1] - b.pieces[low, U0])
