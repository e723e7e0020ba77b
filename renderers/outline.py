"""A curve, polygon or line for the compiled loops of the projections: nearest point, first crossing, and the slide.

The slide of the constraint projection (4.3) goes downhill in distance along a curve, until the error would increase.
The distance of the hand p from the curve y(u) falls while g(u) = (p - y)·y' points onwards.

A march towards the first zero of g must not step over one: a low barrier skipped would be a pop-through that the method
does not have. Each step therefore ends at the first zero of g's upper quadratic bound

    g(u) + g'(u) d + M d^2 / 2,      M = third_0 + third_1 |p - y|  >=  |g''|

which is exact on straight pieces, approaches the zero from the safe side, and converges like Newton's method.
Where the local minimum has vanished (a fold) there is no zero to stop at, and the march goes on to the next: that is
the pop-through of Figure 4.7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hapticeval.compiled import borrowing, compiled, for_kernels, inner
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.curve_kernels import SMOOTH_TURN, project, turn_at_join
from hapticeval.geometry.kernels import (
    ARC,
    ARC_PIECE,
    CASSINIAN,
    CASSINIAN_PIECE,
    ELLIPSE,
    ELLIPSE_PIECE,
    LEAVES,
    LINE,
    LINE_PIECE,
    PIECE,
    RESTS,
    SMOOTH_KINDS,
    UNBOUNDED,
    evaluate,
    evaluate_many,
    piece_index,
)
from hapticeval.geometry.model import VERTICES, Model
from hapticeval.geometry.polygon_kernels import first_entry_kernel, nearest_kernel, side_kernel
from hapticeval.geometry.representations import Polygon
from hapticeval.laws import EMPTY_TABLE
from hapticeval.records import as_record, as_records, record_type, room_for
from hapticeval.renderers.projective import once
from hapticeval.renderers.regulation_kernel import GAINS
from hapticeval.types import Array

SAMPLED_RAISE = 1.1
"""A sampled maximum is raised by this much."""


def third_bounds(pieces: Array) -> Array:
    """Return bounds with which a march along a curve cannot step over a zero of g, two for each of its `pieces` (n, k).

    (n, 2): third_0 and third_1 with |g''| <= third_0 + third_1 |p - y| for every point p, m. g = (p - y)·y' gives
    g'' = (p - y)·y''' - 3 y'·y'', so they bound 3 |y'·y''| and |y'''|. Both are zero on straight pieces; with arc
    length as parameter y'·y'' = 0, and |y'''| is the square of an arc's curvature.
    """
    out = np.zeros((pieces.shape[0], 2))
    kinds = as_records(pieces, PIECE).kind
    arcs = kinds == ARC
    out[arcs, 1] = as_records(pieces[arcs], ARC_PIECE).radius ** -2.0
    for i in np.flatnonzero(np.isin(kinds, list(SMOOTH_KINDS))):
        out[i] = SMOOTH_THIRD_BOUNDS[kinds[i]](pieces[i])
    return out


def _ellipse_bounds(piece: Array) -> tuple[float, float]:
    """Return the `third_bounds` of an ELLIPSE piece (9,), m, in closed form."""
    # (a cos u, b sin u): y'·y'' = (a^2 - b^2) sin u cos u, and y''' is as long as y' at most
    ellipse = as_record(piece, ELLIPSE_PIECE)
    return 1.5 * abs(ellipse.a * ellipse.a - ellipse.b * ellipse.b), max(ellipse.a, ellipse.b)


def _cassinian_bounds(piece: Array) -> tuple[float, float]:
    """Return the `third_bounds` of a CASSINIAN piece (9,), m.

    Sampled over one lobe, densely around the valley, where all derivatives peak as a_n / a_d falls to 1; over less than
    a lobe, evenly: such a piece is cut where they change, see `cut_at_valleys`.

    With z = r exp(iu) and w = r'/r + i, the derivatives are z' = z w, z'' = z (w^2 + w') and
    z''' = z (w^3 + 3 w w' + w'').
    """
    oval = as_record(piece, CASSINIAN_PIECE)
    scale, lobes, above = oval.scale, oval.lobes, oval.above
    ratio, sharpest = 1.0 + above, math.sqrt(above)
    offsets = np.geomspace(1e-3 * min(sharpest, 1.0), math.pi / 2.0, 4000)
    angle = np.concatenate([np.linspace(0.0, math.pi, 4001), math.pi / 2.0 - offsets, math.pi / 2.0 + offsets])
    if lobes * (oval.u1 - oval.u0) < math.pi:
        angle = np.linspace(lobes * oval.u0, lobes * oval.u1, 1001)
    sin, cos = np.sin(angle), np.cos(angle)
    root = np.sqrt(above + cos * cos)
    power = np.where(cos > 0.0, cos + root, above / (root + np.abs(cos)))
    r = scale * (power / (1.0 + math.sqrt(ratio))) ** (1.0 / lobes)
    w = -sin / root + 1j
    w1 = -lobes * ratio * cos / root**3
    w2 = lobes**2 * ratio * (sin / root**3 - 3.0 * sin * cos**2 / root**5)
    third_derivative = np.max(r * np.abs(w**3 + 3.0 * w * w1 + w2))
    mixed_product = np.max(3.0 * r * r * np.abs((np.conj(w) * (w * w + w1)).real))
    return SAMPLED_RAISE * float(mixed_product), SAMPLED_RAISE * float(third_derivative)


VALLEY_RING = 4.0
"""By how much a piece of a valley's side is wider than the one inside of it; the bounds of a march are its own."""


def cut_at_valleys(pieces: Array) -> Array:
    """Return `pieces` (n, 9) with the sides of narrow valleys cut into pieces, each with derivatives of one size.

    Rows are `PIECE` records, lengths in m.

    The third derivative of a Cassinian is largest where cos(n_l u) = 0, by (a_n / a_d - 1)^(-3/2) as that falls to 1,
    and falls off within sqrt(a_n / a_d - 1) of n_l u. With one bound for the whole curve a march creeps everywhere.
    """
    cut = []
    for row in pieces:
        piece = as_record(row, PIECE)
        edges = _valley_edges(row) if piece.kind == CASSINIAN else np.empty(0)
        ends = np.array([piece.u0, *edges, piece.u1])
        parts = np.repeat(row[None], len(ends) - 1, axis=0)
        ranges = as_records(parts, PIECE)  # the same memory
        ranges.u0, ranges.u1 = ends[:-1], ends[1:]
        cut.append(parts)
    return np.concatenate(cut)


def _valley_edges(piece: Array) -> Array:
    """Return where `cut_at_valleys` cuts a CASSINIAN piece (9,): rising u; none where its valleys are wide."""
    oval = as_record(piece, CASSINIAN_PIECE)
    rings = math.sqrt(oval.above) * VALLEY_RING ** np.arange(32.0)
    rings = rings[rings < math.pi / 2.0 / VALLEY_RING]
    # n_l u at the sides of the valleys, each half a turn from the next
    sides = math.pi * (np.arange(2.0 * oval.lobes) + 0.5)
    edges = np.sort((sides[:, None] + np.concatenate([-rings, rings])).ravel()) / oval.lobes
    return np.asarray(edges[(edges > oval.u0) & (edges < oval.u1)])


SMOOTH_THIRD_BOUNDS = {CASSINIAN: _cassinian_bounds, ELLIPSE: _ellipse_bounds}
"""What gives the `third_bounds` of a smooth piece, by its kind: of each of `SMOOTH_KINDS`."""

JOIN = record_type("turn", "bend", "bend_per_metre", "first_chord")
"""A row of `Outline.joins`: the turn (rad) at the start of a piece, its two `third_bounds`, and its first chord."""

LONGEST_MARCH = 100_000
"""Steps on curved pieces after which a march stops where it is; marches at a fold take some hundreds."""


@inner
def evaluate_at(pieces: Array, k: int, u: float) -> tuple[float, float, float, float, float, float]:
    """Return point (m), first and second derivative of piece k of `pieces` (n, k) at u, as `evaluate` does.

    Straight pieces, by far the most, come without the cost of a view of the row.
    """
    start = as_record(pieces, PIECE, k)
    if start.kind == LINE:
        line, along = as_record(pieces, LINE_PIECE, k), u - start.u0
        return line.x + along * line.dx, line.y + along * line.dy, line.dx, line.dy, 0.0, 0.0
    return evaluate(pieces[k], u)


@borrowing
def slide(
    pieces: Array, joins: Array, releases: bool, piece: int, u: float, x: float, y: float
) -> tuple[int, int, float]:
    """Slide the tool from (piece, u) downhill to the local minimum of the distance to a hand at (x, y), m (4.3).

    `pieces` (n, k) and `joins` (n, 4) are those of an `Outline`. Returns RESTS or LEAVES, and the (piece, u) where.

    With `releases` (unilateral contact) it LEAVES where the HIP is above the tangent half-plane: of the piece it is on,
    or, at a convex join, of the piece it would go to.

    At a concave join it rests on the corner, or goes on where the next piece leads further downhill. A rest at a join
    has u exactly at the end of its piece.

    From a point of exactly largest distance both ways lead downhill: it goes anticlockwise.
    """
    count = pieces.shape[0]
    onwards = 0.0  # the direction of the march in u: 0 before it is known, then 1 or -1, never turned round
    steps = 0
    while True:
        this_piece = as_record(pieces, PIECE, piece)
        px, py, dx, dy, ddx, ddy = evaluate_at(pieces, piece, u)
        ex, ey = x - px, y - py
        if releases and ex * dy - ey * dx > 0.0:  # along the outward normal (dy, -dx): the hand is outside
            # at a concave corner the next face may still hold it
            k = _other_wall(pieces, joins, piece, u, x, y) if onwards == 0.0 else -1
            if k < 0:
                return LEAVES, piece, u
            wall = as_record(pieces, PIECE, k)
            u = wall.u0 if u == this_piece.u1 else wall.u1
            piece = k
            continue
        g = ex * dx + ey * dy
        slope = dx * dx + dy * dy - ex * ddx - ey * ddy  # -g'
        if onwards == 0.0:
            onwards = 1.0 if g > 0.0 or (g == 0.0 and slope < 0.0) else -1.0
        if g * onwards < 0.0 or (g == 0.0 and slope >= 0.0):
            return RESTS, piece, u
        # a step of zero length means that g has vanished to rounding
        # M of the module, and the step to the first zero of the bound
        join = as_record(joins, JOIN, piece)
        third_bound = join.bend
        if join.bend_per_metre > 0.0:
            third_bound += join.bend_per_metre * math.hypot(ex, ey)
        step = _first_zero(abs(g), slope, third_bound)
        next_u = u + onwards * step
        end = this_piece.u1 if onwards > 0.0 else this_piece.u0
        if (end - next_u) * onwards > 0.0:
            steps += 1
            tiny = 2e-16 * (this_piece.u1 - this_piece.u0)
            if next_u == u or third_bound == 0.0 or step <= tiny or steps > LONGEST_MARCH:
                return RESTS, piece, next_u
            u = next_u
            continue
        if this_piece.kind == UNBOUNDED:
            return RESTS, piece, next_u
        # the march reaches the join with the next piece
        k = (piece + 1) % count if onwards > 0.0 else (piece - 1) % count
        next_piece = as_record(pieces, PIECE, k)
        start = next_piece.u0 if onwards > 0.0 else next_piece.u1
        turn = as_record(joins, JOIN, k if onwards > 0.0 else piece).turn
        px, py, dx, dy, _, _ = evaluate_at(pieces, k, start)
        ex, ey = x - px, y - py
        if releases and turn > -SMOOTH_TURN and ex * dy - ey * dx > 0.0:
            return LEAVES, piece, end
        if (ex * dx + ey * dy) * onwards <= 0.0:  # the next piece leads uphill
            return RESTS, piece, end
        piece, u = k, start


@borrowing
def _first_zero(g: float, slope: float, third_bound: float) -> float:
    """Return how far to march in u: the smallest d > 0 with -g + slope d + M d^2 / 2 = 0, for g > 0, or infinity.

    M is `third_bound`; see the module.
    """
    if third_bound == 0.0:
        return g / slope if slope > 0.0 else math.inf
    # the positive root, in the form that does not cancel
    root = math.sqrt(slope * slope + 2.0 * third_bound * g)
    return 2.0 * g / (slope + root) if slope > 0.0 else (root - slope) / third_bound


@borrowing
def _other_wall(pieces: Array, joins: Array, piece: int, u: float, x: float, y: float) -> int:
    """The piece that still holds the tool in a concave corner when it is free of `piece`, or -1."""
    count, this_piece = pieces.shape[0], as_record(pieces, PIECE, piece)
    if this_piece.kind == UNBOUNDED:
        return -1
    if u == this_piece.u1:
        k = (piece + 1) % count
        turn, join_u = as_record(joins, JOIN, k).turn, as_record(pieces, PIECE, k).u0
    elif u == this_piece.u0:
        k = (piece - 1) % count
        turn, join_u = as_record(joins, JOIN, piece).turn, as_record(pieces, PIECE, k).u1
    else:
        return -1
    if turn > -SMOOTH_TURN:
        return -1
    px, py, dx, dy, _, _ = evaluate_at(pieces, k, join_u)
    return k if (x - px) * dy - (y - py) * dx < 0.0 else -1


@inner
def frame(pieces: Array, joins: Array, piece: int, u: float, x: float, y: float) -> tuple[float, float, float, float]:
    """Return the surface point (m) at (piece, u), and the outward unit normal that holds the HIP (x, y), m, there.

    `pieces` (n, k) and `joins` (n, 4) are those of an `Outline`.

    At a corner every direction between the two faces' normals is one: there it is the direction between HIP and
    IHIP, which is continuous with the faces' normals, or their mean where the two points coincide.
    """
    px, py, dx, dy, _, _ = evaluate_at(pieces, piece, u)
    this_piece = as_record(pieces, PIECE, piece)
    nx, ny = dy, -dx  # unit length already on a line, whose parameter is the arc length
    if this_piece.kind != LINE:
        speed = math.hypot(dx, dy)
        nx, ny = nx / speed, ny / speed
    if this_piece.kind != UNBOUNDED and u in (this_piece.u0, this_piece.u1):
        count, is_last = pieces.shape[0], u == this_piece.u1
        k = (piece + 1) % count if is_last else (piece - 1) % count
        turn = as_record(joins, JOIN, k if is_last else piece).turn
        if abs(turn) > SMOOTH_TURN:
            neighbour = as_record(pieces, PIECE, k)
            _, _, dx, dy, _, _ = evaluate(pieces[k], neighbour.u0 if is_last else neighbour.u1)
            speed = math.hypot(dx, dy)
            mx, my = nx + dy / speed, ny - dx / speed  # the sum of both faces' normals
            ex, ey = x - px, y - py
            distance = math.hypot(ex, ey)
            # the hand inside: the error points inwards, and its opposite is the normal
            if distance > 1e-12 * (abs(px) + abs(py)):
                signed_distance = distance if ex * mx + ey * my > 0.0 else -distance
                return px, py, ex / signed_distance, ey / signed_distance
            size = math.hypot(mx, my)
            nx, ny = mx / size, my / size
    return px, py, nx, ny


CHORDS = 4096
"""Chords of a whole curve in its collision outline: of the 200 mm Cassinian they stray by 0.1 micrometre."""


class Outline(NamedTuple):
    """What is rendered, and the outline of chords in which collisions with it are looked for.

    - `pieces` as in `geometry.kernels`.
    - `joins` (n, 4): a `JOIN` for each piece, the one where it starts.
    - `samples`: the curve's table for its nearest point.
    - `vertices` (m, 2), m, and `tree`: the outline of chords, into which each piece is cut by equal steps of u.
    - `stray` (m): no chord strays from the curve by more. Zero for straight pieces.

    The unbounded line has no chords.
    """

    pieces: Array
    joins: Array
    samples: Array
    vertices: Array
    tree: Array
    stray: float


OUTLINE_GAINS = record_type("stray", base=GAINS)
"""The `params` of a law on an outline: with the `stray` (m) of that."""


@inner
def outline_in(data: Any) -> Outline:
    """Return the boundary that a law works on: `data` has the tables of a `LawData`."""
    stray = as_record(data.params, OUTLINE_GAINS).stray
    return Outline(data.pieces, data.joins, data.lookup, data.vertices, data.tree, stray)


@inner
def is_closed(outline: Outline) -> bool:
    """Return whether an outline is closed; else it is the unbounded line."""
    return bool(as_record(outline.pieces, PIECE).kind != UNBOUNDED)


def outline_of(curve: Curve) -> Outline:
    """Return the boundary of a curve, cut into chords, or of a polygon, whose edges they are."""
    pieces = for_kernels(cut_at_valleys(curve.pieces))
    count = len(pieces)
    joins = np.zeros((count, room_for(JOIN)))
    at_joins, ranges = as_records(joins, JOIN), as_records(pieces, PIECE)  # the same memory
    if not curve.closed:
        return Outline(pieces, joins, for_kernels(curve.samples), np.empty((0, 2)), np.empty((0, 6)), 0.0)
    at_joins.turn, at_joins.first_chord = _turns(pieces), np.arange(count)
    if isinstance(curve, Polygon):
        return Outline(pieces, joins, EMPTY_TABLE, for_kernels(curve.vertices), for_kernels(curve.tree), 0.0)
    start, end = curve.u_range
    cuts = np.ones(count, dtype=np.int64)
    curved = ranges.kind != LINE
    share = (ranges.u1[curved] - ranges.u0[curved]) / (end - start)
    cuts[curved] = np.maximum(16, np.ceil(CHORDS * share))
    at_joins.bend, at_joins.bend_per_metre = third_bounds(pieces).T
    at_joins.first_chord = np.cumsum(cuts) - cuts
    us = np.concatenate([np.linspace(p.u0, p.u1, n, endpoint=False) for p, n in zip(ranges, cuts, strict=True)])
    vertices = evaluate_many(pieces, us)[:, :2]
    # a chord strays from its arc by about the sagitta, at the middle of the parameter; twice that is on the safe side
    middles = evaluate_many(pieces, 0.5 * (us + np.append(us[1:], end)))[:, :2]
    sagitta = np.hypot(*(middles - 0.5 * (vertices + np.roll(vertices, -1, axis=0))).T)
    polygon = Polygon(vertices)
    stray = 2.0 * float(sagitta.max()) if curved.any() else 0.0
    samples = for_kernels(curve.samples)
    return Outline(pieces, joins, samples, for_kernels(polygon.vertices), for_kernels(polygon.tree), stray)


@compiled
def _turns(pieces: Array) -> Array:
    out = np.empty(pieces.shape[0])
    for k in range(pieces.shape[0]):
        out[k] = turn_at_join(pieces, k)
    return out


@borrowing
def nearest_on(outline: Outline, x: float, y: float) -> tuple[int, float, float, float]:
    """Return the nearest surface point of (x, y), m, as (piece, u), the distance to it, m, and the side.

    The side is -1.0 inside and 1.0 outside or on the surface.
    """
    if outline.stray > 0.0 or not is_closed(outline):
        u, distance, side = project(outline.pieces, outline.samples, x, y)
        return piece_index(outline.pieces, u), u, distance, side
    edge, along, distance2 = nearest_kernel(outline.vertices, outline.tree, x, y)
    piece = as_record(outline.pieces, PIECE, edge)
    side = side_kernel(outline.vertices, edge, along, x, y) if distance2 > 0.0 else 1.0
    return edge, piece.u0 + along * (piece.u1 - piece.u0), math.sqrt(distance2), side


@borrowing
def is_clear_of(outline: Outline, x: float, y: float) -> bool:
    """Whether a point is outside by more than the chords stray: what can be told at the cost of a polygon."""
    if not is_closed(outline):
        return False
    edge, along, distance2 = nearest_kernel(outline.vertices, outline.tree, x, y)
    return distance2 > outline.stray * outline.stray and side_kernel(outline.vertices, edge, along, x, y) > 0.0


@borrowing
def first_entry(outline: Outline, x0: float, y0: float, x1: float, y1: float, leaving: bool) -> tuple[bool, int, float]:
    """Whether a tool that moves straight from (x0, y0), outside or on the surface, runs into it: and (piece, u) where.

    `leaving`: it starts on the surface. A crossing of the chords counts wherever both ends lie, so that nothing is
    too thin to be hit. A curve lies up to `stray` beside its chords: there the exact side of the end decides.
    """
    if not is_closed(outline):
        _, u, _, side = nearest_on(outline, x1, y1)
        if side > 0.0:
            return False, 0, 0.0
        px, py, dx, dy, _, _ = evaluate(outline.pieces[0], u)
        # how far the ends are above the line, times its speed: where the way crosses it, if it began outside
        before, after = (x0 - px) * dy - (y0 - py) * dx, (x1 - px) * dy - (y1 - py) * dx
        if before > 0.0:
            u -= ((x1 - x0) * dx + (y1 - y0) * dy) * after / (after - before)
        return True, 0, u
    edge, t, fraction = first_entry_kernel(outline.vertices, outline.tree, x0, y0, x1, y1)
    if edge >= 0 and (outline.stray == 0.0 or fraction < 1.0):
        piece, u = _piece_at(outline, edge, t)
        return True, piece, u
    if (outline.stray == 0.0 and not leaving) or is_clear_of(outline, x1, y1):
        return False, 0, 0.0
    piece, u, distance, side = nearest_on(outline, x1, y1)
    if side > 0.0 or distance == 0.0:
        return False, 0, 0.0
    if distance > outline.stray:
        # deep inside without a crossing: it started between curve and chord
        near, v, _, _ = nearest_on(outline, x0, y0)
        _, near, v = slide(outline.pieces, outline.joins, False, near, v, x1, y1)
        px, py, dx, dy, _, _ = evaluate(outline.pieces[near], v)
        if (x1 - px) * dy - (y1 - py) * dx < 0.0:
            return True, near, v
    return True, piece, u


@borrowing
def _piece_at(outline: Outline, chord: int, t: float) -> tuple[int, float]:
    """The (piece, u) at fraction t of a chord."""
    low, high = 0, outline.pieces.shape[0] - 1
    while low < high:  # the last piece whose first chord is not after this one
        middle = (low + high + 1) // 2
        if as_record(outline.joins, JOIN, middle).first_chord <= chord:
            low = middle
        else:
            high = middle - 1
    first, after = as_record(outline.joins, JOIN, low).first_chord, float(outline.vertices.shape[0])
    if low + 1 < outline.pieces.shape[0]:
        after = as_record(outline.joins, JOIN, low + 1).first_chord
    share = (chord - first + t) / (after - first)
    piece = as_record(outline.pieces, PIECE, low)
    return low, piece.u0 + share * (piece.u1 - piece.u0)


@dataclass(frozen=True)
class Representation:
    """A curve as the compiled loops take it, the curve itself, and its `resolution` and `standoff` (m)."""

    outline: Outline
    surface: Curve
    resolution: float
    standoff: float

    @property
    def tables(self) -> dict[str, Any]:
        """What a compiled projection on it is made of, see `outline_in`."""
        outline = self.outline
        return {
            "pieces": outline.pieces, "joins": outline.joins, "lookup": outline.samples, "vertices": outline.vertices,
            "tree": outline.tree, "own": (outline.stray,), "resolution": self.resolution, "standoff": self.standoff,
        }  # fmt: skip


def representation_of(model: Model, representation: str, vertices: int = VERTICES) -> Representation:
    """Return the representation of a model, made once: its polygon of so many vertices, or its exact curve.

    A model of straight edges is its own polygon; the unbounded line has no other representation than itself.
    """

    def make() -> Representation:
        curve = model.curve
        if curve.closed and curve.straight:
            return Representation(outline_of(model.polygon()), curve, 0.0, 0.0)
        if not as_polygon:
            return Representation(outline_of(curve), curve, 0.0, 0.0)
        polygon = model.polygon(vertices)
        return Representation(outline_of(polygon), polygon, polygon.resolution, polygon.standoff_from(curve))

    as_polygon = representation == "polygon" and model.curve.closed
    return once(model, ("outline", vertices if as_polygon else 0), make)
