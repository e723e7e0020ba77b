"""How the tool moves between events in the plane, and where it meets the boundary.

It slides on the boundary, or flies freely. What the operator does to it, and how it flies along an axis, stands in
`force`.

The boundary is cut into cells, short enough to be graphs over their chords; the crossing is found on each cell that the
path comes near to.

No step is checked by its ends alone. A path that enters and leaves a thin part within one step crosses the first face
all the same, and a path that dips in and out of a cell is caught at its lowest point.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from hapticeval.bracket import MOST_GUESSES, guess_between, narrow_bracket
from hapticeval.compiled import compiled, for_kernels
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.curve_kernels import SMOOTH_TURN, turn_at_join
from hapticeval.geometry.kernels import ARC, LINE, LINE_PIECE, PIECE, UNBOUNDED, evaluate, evaluate_many
from hapticeval.records import as_record, as_records, record_type, room_for
from hapticeval.rigid_contact.force import (
    LONGEST_STEP,
    OFF_CUBIC_SHARE,
    SEAM_REACH,
    STAGES,
    fly_along_axis,
    gained_in_step,
    oscillation_of,
)
from hapticeval.types import Array

Slide: TypeAlias = tuple[float, float, float]
"""A slide under way: u where it began, how much u has grown since, and w = ds/dt (m/s)."""


@compiled
def surface_frame(piece: Array, u: float) -> tuple[float, float, float, float, float, float]:
    """Return point (x, y), m, unit tangent (tx, ty), |dc/du| and curvature (1/m) at u of a piece (9,).

    The outward normal is (ty, -tx).
    """
    x, y, dx, dy, ddx, ddy = evaluate(piece, u)
    speed = math.sqrt(dx * dx + dy * dy)
    return x, y, dx / speed, dy / speed, speed, (dx * ddy - dy * ddx) / (speed * speed * speed)


@compiled
def operator_force(load: Any, tau: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
    """Return the operator's force (N) on a tool at (x, y), m, with velocity (vx, vy), m/s.

    `tau` (s) is the time since the beginning of the stretch that `load` describes.
    """
    return (
        load.g0[0] + load.g1[0] * tau - load.spring * x - load.damper * vx,
        load.g0[1] + load.g1[1] * tau - load.spring * y - load.damper * vy,
    )


@compiled
def contact_force(piece: Array, u: float, w: float, tau: float, load: Any) -> tuple[float, float]:
    """Return the contact force N (N) along the outward normal and the tangential operator's force (N).

    For sliding at w = ds/dt (m/s) at u of a piece (9,), `tau` (s) into a `load`. N = -F.nu - m kappa w^2: thesis
    (3.3) and (3.8) with the inward centripetal force.
    """
    # the normal is (ty, -tx), so that F.nu = fx ty - fy tx
    x, y, tx, ty, _, curvature = surface_frame(piece, u)
    fx, fy = operator_force(load, tau, x, y, w * tx, w * ty)
    return -(fx * ty - fy * tx) - load.mass * curvature * w * w, fx * tx + fy * ty


@compiled
def slide_for(piece: Array, slide: Slide, tau: float, h: float, load: Any) -> tuple[float, float, float, float]:
    """Return (du, w) after h seconds of sliding by thesis (3.1), and the contact impulse (N s) meanwhile.

    On a piece (9,) from `slide`, `tau` (s) into the stretch of `load`: one step of Butcher's method.
    """
    u, grown, w = slide
    rates, totals = np.empty((7, 4)), np.empty(4)  # du/dt, dw/dt and the contact force
    for k in range(7):
        du, dw = 0.0, 0.0
        for i in range(k):
            du += STAGES[k, i] * rates[i, 0]
            dw += STAGES[k, i] * rates[i, 1]
        # ds/dt at this stage
        pace = w + h * dw / STAGES[k, 6]
        x, y, tx, ty, speed, curvature = surface_frame(piece, u + (grown + h * du / STAGES[k, 6]))
        fx, fy = operator_force(load, tau + STAGES[k, 7] * h / STAGES[k, 8], x, y, pace * tx, pace * ty)
        # the contact force, as in `contact_force`
        contact = -(fx * ty - fy * tx) - load.mass * curvature * pace * pace
        # du/dt = w / |c'(u)|, dw/dt = F_o.t / m
        rates[k, 0], rates[k, 1] = pace / speed, (fx * tx + fy * ty) / load.mass
        # the impulse grows by N nu
        rates[k, 2], rates[k, 3] = contact * ty, -contact * tx
    for c in range(4):
        totals[c] = gained_in_step(rates, c, h)
    return grown + totals[0], w + totals[1], totals[2], totals[3]


@compiled
def longest_slide_step(pace: float, w: float, along: float, load: Any, longest: float) -> float:
    """Return how long (s) a sliding step may be: `pace` (1/m) is the boundary's, `along` the tangential force (N).

    w is in m/s; `load`. LONGEST_STEP says in what units, `longest` (s) is what is left.
    """
    h = longest
    omega = math.sqrt(load.spring / load.mass)
    if h * omega > LONGEST_STEP:
        h = LONGEST_STEP / omega
    # radians per second, at the speed that the force may have given the tool by the end
    turning = pace * (abs(w) + abs(along) / load.mass * h)
    if h * turning > LONGEST_STEP:
        h = LONGEST_STEP / turning
    return h


@compiled
def fly_for(
    x: float, y: float, vx: float, vy: float, tau: float, h: float, load: Any
) -> tuple[float, float, float, float]:
    """Return position (m) and velocity (m/s) after h seconds of free flight, in closed form.

    The flight begins `tau` (s) into the stretch of `load`.
    """
    even, odd = oscillation_of(load, h)
    x, vx = fly_along_axis(x, vx, load.g0[0] + load.g1[0] * tau, load.g1[0], h, load, even, odd)
    y, vy = fly_along_axis(y, vy, load.g0[1] + load.g1[1] * tau, load.g1[1], h, load, even, odd)
    return x, y, vx, vy


Flight: TypeAlias = tuple[float, float, float, float, float]
"""Where a flight begins: x, y, vx, vy, and the time since the beginning of the stretch."""

CELL_TURN = 0.2
"""Most that the boundary turns within a cell (rad): few enough that it is a graph over the cell's chord."""

TIP_REACH = 1e-15
"""How far (m) a cell reaches beyond an end at a convex corner, in place of `SEAM_REACH`. There nothing is to be hit,
but rounding must not let a tool that is dropped straight onto the tip fall between the two faces."""

CHORD_CELL = record_type(
    "piece", "ua", "ub", "ox", "oy", "ex", "ey", "span", "slope_a", "slope_b", "reach_a", "reach_b",
    "xmin", "xmax", "ymin", "ymax",
)  # fmt: skip
"""A cell.

- `piece` it lies on, and its range of u from `ua` to `ub`;
- start of the chord (`ox`, `oy`), m, its unit direction (`ex`, `ey`) and its length `span` (m);
- `slope_a` and `slope_b` of the boundary over the chord at both ends;
- how far (m) it reaches beyond its ends, `reach_a` and `reach_b`;
- a box (m) that holds it: `xmin`, `xmax`, `ymin`, `ymax`.
"""


class BoundaryCells(NamedTuple):
    """A plane boundary cut into cells, each a graph over its chord.

    - `pieces` (n, 9) as in `kernels`;
    - `joins` (n,), rad: how the boundary turns where piece i begins, positive where convex;
    - `paces` (n,), 1/m: how fast each piece changes with arc length;
    - `cells` (m, 16): a `CHORD_CELL` a row.
    """

    pieces: Array
    joins: Array
    paces: Array
    cells: Array


def prepare_boundary(curve: Curve) -> BoundaryCells:
    """Return a plane curve as the tool's loops take it, cut into cells: made once a scene."""
    pieces = for_kernels(curve.pieces)
    count = pieces.shape[0]
    joins = np.array([turn_at_join(pieces, i) if curve.closed else 0.0 for i in range(count)])
    # a join that turns by rounding alone is smooth
    joins[np.abs(joins) <= SMOOTH_TURN] = 0.0
    paces = np.zeros(count)
    rows = []
    for i in range(count):
        cuts, paces[i] = _cuts_and_pace(pieces[i])
        rows.append(_cell_rows(pieces, i, cuts, joins[i] > 0.0, joins[(i + 1) % count] > 0.0))
    return BoundaryCells(pieces, joins, paces, np.vstack(rows))


def _cuts_and_pace(piece: Array) -> tuple[Array, float]:
    """Return the parameters at which a piece is cut into cells, and how fast it changes (1/m).

    The latter is the largest of |kappa| and |d kappa / ds|^(1/2).
    """
    kind, start, end = as_record(piece, PIECE)
    if kind in (LINE, UNBOUNDED):
        return np.array([start, end]), 0.0
    us = np.linspace(start, end, 4097)
    rows = evaluate_many(piece[np.newaxis], us)
    speed = np.hypot(rows[:, 2], rows[:, 3])
    # (x' y'' - y' x'') / |c'|^2: radians per unit of u
    turning = (rows[:, 2] * rows[:, 5] - rows[:, 3] * rows[:, 4]) / speed**2
    # as many as keep the turn of each below CELL_TURN
    cells = math.ceil((end - start) * np.abs(turning).max() / CELL_TURN)
    curvature = turning / speed
    # d kappa / ds is zero on an arc
    change = 0.0 if kind == ARC else float(np.abs(np.gradient(curvature, us) / speed).max())
    return np.linspace(start, end, max(cells, 2) + 1), max(float(np.abs(curvature).max()), math.sqrt(change))


def _cell_rows(pieces: Array, i: int, cuts: Array, convex_start: bool, convex_end: bool) -> Array:
    """Return the rows (m, 16) of cells on piece i between consecutive `cuts` (m + 1,)."""
    table = np.zeros((cuts.size - 1, room_for(CHORD_CELL)))
    # the same numbers, by their names; what the piece is if it is straight
    cells, line = as_records(table, CHORD_CELL), as_record(pieces, LINE_PIECE, i)
    cells.piece = i
    cells.ua, cells.ub = cuts[:-1], cuts[1:]
    cells.reach_a = cells.reach_b = SEAM_REACH
    # one cell without ends, which every flight is measured over
    if line.kind == UNBOUNDED:
        cells.ox, cells.oy, cells.ex, cells.ey = line.x, line.y, line.dx, line.dy
        cells.ua, cells.span = 0.0, math.inf
        cells.reach_a = math.inf
        cells.xmin = cells.ymin = -math.inf
        cells.xmax = cells.ymax = math.inf
        return table
    rows = evaluate_many(pieces[i : i + 1], cuts)
    chords = np.diff(rows[:, :2], axis=0)
    cells.span = np.hypot(chords[:, 0], chords[:, 1])
    ex, ey = (chords / cells.span[:, np.newaxis]).T
    cells.ox, cells.oy = rows[:-1, :2].T
    cells.ex, cells.ey = ex, ey
    if line.kind == LINE:
        cells.ex, cells.ey = line.dx, line.dy
    else:
        for slope, ends in (("slope_a", rows[:-1]), ("slope_b", rows[1:])):
            # slope of the boundary over the chord where the cell begins and where it ends
            cells[slope] = (ends[:, 2] * ey - ends[:, 3] * ex) / (ends[:, 2] * ex + ends[:, 3] * ey)
    # A graph whose slope stays within CELL_TURN of its chord's lies within half of that times its span.
    margin = (0.0 if line.kind == LINE else CELL_TURN) * cells.span + SEAM_REACH
    for low, high, axis in (("xmin", "xmax", 0), ("ymin", "ymax", 1)):
        cells[low] = np.minimum(rows[:-1, axis], rows[1:, axis]) - margin
        cells[high] = np.maximum(rows[:-1, axis], rows[1:, axis]) + margin
    if convex_start:
        cells.reach_a[0] = TIP_REACH
    if convex_end:
        cells.reach_b[-1] = TIP_REACH
    return table


@compiled
def height_over_cell(cell: Any, pieces: Array, x: float, y: float) -> tuple[float, float, float, float, float]:
    """Return the height (m) of a point (x, y), m, over a `CHORD_CELL`, along the chord's outward normal.

    With it come the boundary's slope below the point and the slope's change along the chord (1/m), its u there, and how
    far (m) beyond the cell's ends the point is, negative before the start; there the boundary goes on straight.
    `pieces` (n, 9) are the boundary's.
    """
    dx, dy = x - cell.ox, y - cell.oy
    # coordinates along the chord and along its outward normal
    xi = dx * cell.ex + dy * cell.ey
    eta = dx * cell.ey - dy * cell.ex
    span = cell.span
    piece = pieces[int(cell.piece)]
    kind = as_record(piece, PIECE).kind
    overhang = min(xi, 0.0) + max(xi - span, 0.0)
    # the chord is the boundary
    if kind in (LINE, UNBOUNDED):
        return eta, 0.0, 0.0, cell.ua + xi, overhang
    # before the cell's start and past its end
    if xi <= 0.0:
        return eta - cell.slope_a * xi, cell.slope_a, 0.0, cell.ua, overhang
    if xi >= span:
        return eta - cell.slope_b * (xi - span), cell.slope_b, 0.0, cell.ub, overhang
    u = cell.ua + (cell.ub - cell.ua) * xi / span
    # Newton for the u above which the point lies; it ends when it no longer comes closer
    shift = math.inf
    bottom, slope, slope_change = 0.0, 0.0, 0.0
    for _ in range(20):
        px, py, tx, ty, bx, by = evaluate(piece, u)
        px -= cell.ox
        py -= cell.oy
        # how fast the point of the boundary moves along the chord with u
        progress = tx * cell.ex + ty * cell.ey
        slope = (tx * cell.ey - ty * cell.ex) / progress
        # the second derivatives along the chord and across it, of a graph over the chord
        slope_change = (bx * cell.ey - by * cell.ex - slope * (bx * cell.ex + by * cell.ey)) / (progress * progress)
        miss = xi - (px * cell.ex + py * cell.ey)
        # first order in what is left to the point: the error goes with its square
        bottom = px * cell.ey - py * cell.ex + slope * miss
        if abs(miss) >= shift or miss == 0.0:
            break
        shift = abs(miss)
        u = min(max(u + miss / progress, cell.ua), cell.ub)
    return eta - bottom, slope, slope_change, u, overhang


@compiled
def _height_in_flight(
    cell: Any, pieces: Array, flight: Flight, h: float, load: Any
) -> tuple[float, float, float, float, float]:
    """Return the height (m) over the cell h seconds into the flight, how fast it grows and by how much that does.

    With them come u, and how far (m) beyond the cell's ends the tool is.
    """
    x, y, vx, vy = fly_for(flight[0], flight[1], flight[2], flight[3], flight[4], h, load)
    f, slope, slope_change, u, overhang = height_over_cell(cell, pieces, x, y)
    along = vx * cell.ex + vy * cell.ey
    # d/dt (eta - bottom(xi)): the velocity across the chord, less the slope times that along it
    climb = vx * cell.ey - vy * cell.ex - slope * along
    fx, fy = operator_force(load, flight[4] + h, x, y, vx, vy)
    force_across = fx * cell.ey - fy * cell.ex - slope * (fx * cell.ex + fy * cell.ey)
    return f, climb, force_across / load.mass - slope_change * along * along, u, overhang


@compiled
def _crossing_time(
    cell: Any,
    pieces: Array,
    flight: Flight,
    low: float,
    high: float,
    level: float,
    load: Any,
) -> float:
    """Return the time (s) at which the height falls through -level, to rounding.

    It does so between `low` and `high`.
    """
    # regula falsi on height + level, which is positive at `low`
    above = _height_in_flight(cell, pieces, flight, low, load)[0] + level
    below = _height_in_flight(cell, pieces, flight, high, load)[0] + level
    side_kept = 0
    for i in range(MOST_GUESSES):
        middle = guess_between(low, high, above, below, i)
        if not low < middle < high:
            break
        f = _height_in_flight(cell, pieces, flight, middle, load)[0] + level
        if f == 0.0:
            return middle
        low, high, above, below, side_kept = narrow_bracket(low, high, above, below, side_kept, middle, f, True)
    return high


@compiled
def _time_of_change(rate: int, cell: Any, pieces: Array, flight: Flight, low: float, high: float, load: Any) -> float:
    """Return the time (s) between `low` and `high` at which the height's first or second `rate` changes sign.

    It is `high` where it has the same sign at both.
    """
    first = _height_in_flight(cell, pieces, flight, low, load)[rate]
    if first * _height_in_flight(cell, pieces, flight, high, load)[rate] >= 0.0:
        return high
    for _ in range(60):
        middle = 0.5 * (low + high)
        if _height_in_flight(cell, pieces, flight, middle, load)[rate] * first > 0.0:
            low = middle
        else:
            high = middle
    return high


@compiled
def _entry_through_cell(cell: Any, pieces: Array, flight: Flight, h: float, load: Any) -> tuple[float, float, float]:
    """Return the first time (s) within h at which the flight enters through the cell, else infinity; and where.

    That is u, and how far (m) beyond the cell's ends it is.
    """
    # Over a boundary that bends the other way from some place on the height is bent there: within a step once at most.
    bend = _time_of_change(2, cell, pieces, flight, 0.0, h, load)
    # Before the bend and behind it the height has at most one extremum each: between two cuts it rises or falls.
    early = _time_of_change(1, cell, pieces, flight, 0.0, bend, load)
    late = _time_of_change(1, cell, pieces, flight, bend, h, load) if bend < h else h
    cuts = (early, bend, late, h)
    start, f = 0.0, _height_in_flight(cell, pieces, flight, 0.0, load)[0]
    for part in range(4):
        end = cuts[part]
        if end <= start:
            continue
        f_end = _height_in_flight(cell, pieces, flight, end, load)[0]
        # it goes below the skin on this part of the step
        if f >= -load.skin and f_end < -load.skin:
            entry_time = _crossing_time(cell, pieces, flight, start, end, load.skin, load)
            # A flight that began within the skin was on this face: its first crossing of the surface is rounding.
            if f > load.skin:
                entry_time = _crossing_time(cell, pieces, flight, start, entry_time, 0.0, load)
            _, _, _, u, overhang = _height_in_flight(cell, pieces, flight, entry_time, load)
            # through this cell, and not past its ends
            if -cell.reach_a <= overhang <= cell.reach_b:
                return entry_time, u, abs(overhang)
        start, f = end, f_end
    return math.inf, 0.0, math.inf


@compiled
def first_entry(terrain: BoundaryCells, flight: Flight, h: float, load: Any, free: Array) -> tuple[float, int, float]:
    """Return when a flight of h seconds first enters the model, through which piece and at what u.

    `flight` is (x, y, vx, vy, tau); the time is infinite if it stays outside. `load` is a `LOAD`.

    `free` (4,) is a box (xmin, xmax, ymin, ymax), m, known to hold no boundary: it spares the search, and is renewed
    here.
    """
    x0, y0, vx0, vy0, tau = flight
    x1, y1, vx1, vy1 = fly_for(x0, y0, vx0, vy0, tau, h, load)
    # the path's control polygon: p0, p0 + v0 h / 3, p1 - v1 h / 3, p1
    xa, xb = x0 + vx0 * h / 3.0, x1 - vx1 * h / 3.0
    ya, yb = y0 + vy0 * h / 3.0, y1 - vy1 * h / 3.0
    xmin, xmax = min(x0, x1, xa, xb), max(x0, x1, xa, xb)
    ymin, ymax = min(y0, y1, ya, yb), max(y0, y1, ya, yb)
    margin = OFF_CUBIC_SHARE * (xmax - xmin + ymax - ymin) + load.skin
    xmin, xmax, ymin, ymax = xmin - margin, xmax + margin, ymin - margin, ymax + margin
    # the whole flight is inside the free box
    if xmin > free[0] and xmax < free[1] and ymin > free[2] and ymax < free[3]:
        return math.inf, 0, 0.0
    # `room` is the gap to the nearest cell that the flight's box does not touch
    room, first_time, first_piece, u, least_overhang = math.inf, math.inf, 0, 0.0, math.inf
    speed = max(math.sqrt(vx0 * vx0 + vy0 * vy0), math.sqrt(vx1 * vx1 + vy1 * vy1))
    for i in range(terrain.cells.shape[0]):
        cell = as_record(terrain.cells, CHORD_CELL, i)
        # the boxes are apart by at least this
        gap = max(cell.xmin - xmax, xmin - cell.xmax, cell.ymin - ymax, ymin - cell.ymax)
        if gap > 0.0:
            room = min(room, gap)
            continue
        room = 0.0
        entry_time, entry_u, overhang = _entry_through_cell(cell, terrain.pieces, flight, h, load)
        if entry_time == math.inf:
            continue
        # At a seam both cells are entered: the tool is on the one that does not end before it.
        at_seam = abs(entry_time - first_time) * speed <= SEAM_REACH
        if overhang < least_overhang if at_seam else entry_time < first_time:
            first_time, first_piece, u, least_overhang = entry_time, int(cell.piece), entry_u, overhang
    # a cell was touched: no box is known to be free
    if room == 0.0:
        room = -math.inf
    free[0], free[1], free[2], free[3] = xmin - room, xmax + room, ymin - room, ymax + room
    return first_time, first_piece, u
