"""A curve, polygon or line for the compiled loops of the projections: nearest point, first crossing, and the slide.

The slide of the constraint projection (4.3) goes downhill in distance along a curve, until the error would increase.
The distance of the hand p from the curve y(u) falls while g(u) = (p - y)·y' points onwards. A march towards the first
zero of g must not step over one: a low barrier skipped would be a pop-through that the method does not have. Each
step therefore ends at the first zero of g's upper quadratic bound

    g(u) + g'(u) d + M d^2 / 2,      M = third_0 + third_1 |p - y|  >=  |g''|

which is exact on straight pieces, approaches the zero from the safe side, and converges like Newton's method.
Where the local minimum has vanished (a fold) there is no zero to stop at, and the march goes on to the next: that is
the pop-through of Figure 4.7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from hapticeval.compiled import compiled, for_kernels
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.curve_kernels import STRAIGHT, joint_turn, project
from hapticeval.geometry.kernels import (
    ARC,
    CASSINIAN,
    ELLIPSE,
    KIND,
    LINE,
    U0,
    U1,
    A,
    B,
    C,
    D,
    evaluate,
    evaluate_many,
    piece_of,
)
from hapticeval.geometry.model import Model
from hapticeval.geometry.polygon import Polygon
from hapticeval.geometry.polygon_kernels import first_crossing_kernel, nearest_kernel, side_kernel
from hapticeval.renderers.family import VERTICES
from hapticeval.types import Array, IntArray

MARGIN = 1.1
"""A sampled maximum is raised by this much."""


def third_bounds(pieces: Array) -> Array:
    """(n, 2): for each piece, third_0 and third_1 with |g''| <= third_0 + third_1 |p - y| for every point p.

    g = (p - y)·y' gives g'' = (p - y)·y''' - 3 y'·y'', so they bound 3 |y'·y''| and |y'''|. Both are zero on
    straight pieces; with arc length as parameter y'·y'' = 0, and |y'''| is the square of an arc's curvature.
    """
    out = np.zeros((pieces.shape[0], 2))
    arcs = pieces[:, KIND] == ARC
    out[arcs, 1] = pieces[arcs, C] ** -2.0
    for i in np.flatnonzero(pieces[:, KIND] == ELLIPSE):
        a, b = pieces[i, A], pieces[i, B]
        out[i] = 1.5 * abs(a * a - b * b), max(a, b)
    for i in np.flatnonzero(pieces[:, KIND] == CASSINIAN):
        out[i] = _cassinian(pieces[i, A], pieces[i, B], pieces[i, D])
    return out


def _cassinian(scale: float, lobes: float, above: float) -> tuple[float, float]:
    """Sampled over one lobe, densely around the valley, where all derivatives peak as a_n / a_d falls to 1.

    With z = r exp(iu) and w = r'/r + i, the derivatives are z' = z w, z'' = z (w^2 + w') and
    z''' = z (w^3 + 3 w w' + w'').
    """
    ratio, sharpest = 1.0 + above, math.sqrt(above)
    near = np.geomspace(1e-3 * min(sharpest, 1.0), math.pi / 2.0, 4000)
    angle = np.concatenate([np.linspace(0.0, math.pi, 4001), math.pi / 2.0 - near, math.pi / 2.0 + near])
    sin, cos = np.sin(angle), np.cos(angle)
    root = np.sqrt(above + cos * cos)
    lift = np.where(cos > 0.0, cos + root, above / (root + np.abs(cos)))
    r = scale * (lift / (1.0 + math.sqrt(ratio))) ** (1.0 / lobes)
    w = -sin / root + 1j
    w1 = -lobes * ratio * cos / root**3
    w2 = lobes**2 * ratio * (sin / root**3 - 3.0 * sin * cos**2 / root**5)
    third = np.max(r * np.abs(w**3 + 3.0 * w * w1 + w2))
    mixed = np.max(3.0 * r * r * np.abs((np.conj(w) * (w * w + w1)).real))
    return MARGIN * float(mixed), MARGIN * float(third)


RESTS, LEAVES = 0, 1
LONGEST_MARCH = 100_000
"""Steps on curved pieces after which a march stops where it is; marches at a fold take some hundreds."""


@compiled
def at(pieces: Array, k: int, u: float) -> tuple[float, float, float, float, float, float]:
    """`evaluate` on piece k; straight pieces, by far the most, without the cost of a view of the row."""
    if pieces[k, KIND] == LINE:
        along = u - pieces[k, U0]
        dx, dy = pieces[k, C], pieces[k, D]
        return pieces[k, A] + along * dx, pieces[k, B] + along * dy, dx, dy, 0.0, 0.0
    return evaluate(pieces[k], u)


@compiled
def slide(
    pieces: Array,
    joints: Array,
    third: Array,
    closed: bool,
    releases: bool,
    piece: int,
    u: float,
    x: float,
    y: float,
) -> tuple[int, int, float]:
    """From (piece, u) downhill to the local minimum of the distance to (x, y): (RESTS or LEAVES, piece, u).

    With `releases` (unilateral contact) it LEAVES where the HIP is above the tangent half-plane: of the piece it is
    on, or, at a convex joint, of the piece it would go to. At a concave joint it rests on the corner, or goes on
    where the next piece leads further downhill. A rest at a joint has u exactly at the end of its piece. From a
    point of exactly largest distance both ways lead downhill: it goes anticlockwise.
    """
    count = pieces.shape[0]
    onwards = 0.0
    steps = 0
    while True:
        px, py, dx, dy, ddx, ddy = at(pieces, piece, u)
        ex, ey = x - px, y - py
        if releases and ex * dy - ey * dx > 0.0:
            k = _other_wall(pieces, joints, closed, piece, u, x, y) if onwards == 0.0 else -1
            if k < 0:
                return LEAVES, piece, u
            u = pieces[k, U0] if u == pieces[piece, U1] else pieces[k, U1]
            piece = k
            continue
        g = ex * dx + ey * dy
        slope = dx * dx + dy * dy - ex * ddx - ey * ddy
        if onwards == 0.0:
            onwards = 1.0 if g > 0.0 or (g == 0.0 and slope < 0.0) else -1.0
        if g * onwards < 0.0 or (g == 0.0 and slope >= 0.0):
            return RESTS, piece, u
        # a step of zero length means that g has vanished to rounding
        bend = third[piece, 0]
        if third[piece, 1] > 0.0:
            bend += third[piece, 1] * math.hypot(ex, ey)
        step = _first_zero(abs(g), slope, bend)
        following = u + onwards * step
        end = pieces[piece, U1] if onwards > 0.0 else pieces[piece, U0]
        if (end - following) * onwards > 0.0:
            steps += 1
            tiny = 2e-16 * (pieces[piece, U1] - pieces[piece, U0])
            if following == u or bend == 0.0 or step <= tiny or steps > LONGEST_MARCH:
                return RESTS, piece, following
            u = following
            continue
        if not closed:
            return RESTS, piece, following
        k = (piece + 1) % count if onwards > 0.0 else (piece - 1) % count
        start = pieces[k, U0] if onwards > 0.0 else pieces[k, U1]
        turn = joints[k] if onwards > 0.0 else joints[piece]
        px, py, dx, dy, _, _ = at(pieces, k, start)
        ex, ey = x - px, y - py
        if releases and turn > -STRAIGHT and ex * dy - ey * dx > 0.0:
            return LEAVES, piece, end
        if (ex * dx + ey * dy) * onwards <= 0.0:
            return RESTS, piece, end
        piece, u = k, start


@compiled
def _first_zero(g: float, slope: float, bend: float) -> float:
    """The smallest d > 0 with -g + slope d + bend d^2 / 2 = 0, for g > 0; infinite if there is none."""
    if bend == 0.0:
        return g / slope if slope > 0.0 else math.inf
    root = math.sqrt(slope * slope + 2.0 * bend * g)
    return 2.0 * g / (slope + root) if slope > 0.0 else (root - slope) / bend


@compiled
def _other_wall(pieces: Array, joints: Array, closed: bool, piece: int, u: float, x: float, y: float) -> int:
    """The piece that still holds the tool in a concave corner when it is free of `piece`, or -1."""
    if not closed:
        return -1
    count = pieces.shape[0]
    if u == pieces[piece, U1]:
        k = (piece + 1) % count
        turn, there = joints[k], pieces[k, U0]
    elif u == pieces[piece, U0]:
        k = (piece - 1) % count
        turn, there = joints[piece], pieces[k, U1]
    else:
        return -1
    if turn > -STRAIGHT:
        return -1
    px, py, dx, dy, _, _ = at(pieces, k, there)
    return k if (x - px) * dy - (y - py) * dx < 0.0 else -1


@compiled
def frame(
    pieces: Array, joints: Array, closed: bool, piece: int, u: float, x: float, y: float
) -> tuple[float, float, float, float]:
    """The surface point at (piece, u), and the outward unit normal that holds the HIP (x, y) there.

    At a corner every direction between the two faces' normals is one: there it is the direction between HIP and
    IHIP, which is continuous with the faces' normals, or their mean where the two points coincide.
    """
    px, py, dx, dy, _, _ = at(pieces, piece, u)
    first, last = pieces[piece, U0], pieces[piece, U1]
    nx, ny = dy, -dx
    if pieces[piece, KIND] != LINE:
        speed = math.hypot(dx, dy)
        nx, ny = nx / speed, ny / speed
    if closed and u in (first, last):
        count = pieces.shape[0]
        k = (piece + 1) % count if u == last else (piece - 1) % count
        turn = joints[k] if u == last else joints[piece]
        if abs(turn) > STRAIGHT:
            _, _, dx, dy, _, _ = evaluate(pieces[k], pieces[k, U0] if u == pieces[piece, U1] else pieces[k, U1])
            speed = math.hypot(dx, dy)
            mx, my = nx + dy / speed, ny - dx / speed
            ex, ey = x - px, y - py
            far = math.hypot(ex, ey)
            if far > 1e-12 * (abs(px) + abs(py)):
                side = far if ex * mx + ey * my > 0.0 else -far
                return px, py, ex / side, ey / side
            size = math.hypot(mx, my)
            nx, ny = mx / size, my / size
    return px, py, nx, ny


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
    pieces = for_kernels(polygon.pieces)
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


@dataclass(frozen=True)
class Outline:
    """A boundary for the compiled loops, the same as a curve, and its `resolution` and `standoff` (m)."""

    boundary: Boundary
    surface: Curve
    resolution: float
    standoff: float


def outline_of(model: Model, representation: str, vertices: int = VERTICES) -> Outline:
    """The representation of a model, made once: its polygon of so many vertices, or its exact curve.

    A model of straight edges is its own polygon; the unbounded line has no other representation than itself.
    """
    curve = model.curve
    kept = _KEPT.setdefault(model, {})
    key = f"{representation} {vertices}" if representation == "polygon" else representation
    if key not in kept:
        if curve.closed and straight(curve):
            kept[key] = Outline(boundary_of(model.polygon()), curve, 0.0, 0.0)
        elif curve.closed and representation == "polygon":
            polygon = model.polygon(vertices)
            kept[key] = Outline(boundary_of(polygon), polygon, polygon.resolution, polygon.standoff_from(curve))
        else:
            kept[key] = Outline(boundary_of(curve), curve, 0.0, 0.0)
    return kept[key]


_KEPT: WeakKeyDictionary[Model, dict[str, Outline]] = WeakKeyDictionary()
