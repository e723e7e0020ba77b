"""A smooth surface under the ideal contact: the tool slides, leaves where the force reaches zero, flies, and hits.

The surface is f = 0, with f negative inside: a row `reals` of `geometry.surface`. With the normal n = grad f / |grad f|
and the shape operator S = P H P / |grad f|, P = I - n n^T, H the second derivatives of f, a sliding tool moves by

    m y'' = F_o + N n,      N = -F_o.n - m y'.S y'       thesis (3.1), (3.3), (3.8)

and so in all three coordinates, along f = constant: no chart is needed, and none has an edge.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hapticeval.bracket import MOST_GUESSES, guess_between
from hapticeval.compiled import compiled
from hapticeval.geometry.surface import ELLIPSOID, SPHERE, SURFACE, TORUS, Surface, closest_on_surface
from hapticeval.geometry.triples import Triple, dot, plus, put_triple, triple_at, triple_of
from hapticeval.records import as_record
from hapticeval.rigid_contact.force import (
    ALIGNED_SHARE,
    FLIGHT,
    IMPACT,
    LEAVE,
    LOAD,
    MOST_SAMPLE_STEPS,
    SLIDE,
    STAGES,
    Stretches,
    gained_in_step,
    longest_flight_step,
)
from hapticeval.rigid_contact.space import (
    SPACE_TOOL,
    Tool,
    begin_stretch,
    close_sample,
    fly_in_space,
    force_in_space,
    log_in_space,
    move_tool,
    state_in_flight,
    strike_tool,
    where_given_up,
)
from hapticeval.types import Array

SLIDE_ANGLE = 0.02
"""Longest step of the sliding motion (rad), of the surface's sharpest turn and of the spring's oscillation.

The method's error goes with its seventh power: 1e-12 of the speed is left after ten turns.
"""

FLIGHT_ANGLE = 0.2
"""Longest way of a step in flight near the surface, in its sharpest radii: its height bends the other way once at
most."""


@compiled
def surface_terms(reals: Array, p: Triple, v: Triple) -> tuple[float, Triple, float]:
    """Return f (m^2 or 1), its gradient, and the second derivative v.H v along v, at p (m) on or beside the surface.

    `reals` (k,) has the surface's kind and lengths (m). For a torus 2 f = (rho - major)^2 + z^2 - minor^2, with rho the
    distance from the axis; for an ellipsoid 2 f = sum (x_i / e_i)^2 - 1.
    """
    surface = as_record(reals, SURFACE)
    if surface.kind == TORUS:
        major, minor = surface.lengths[0], surface.lengths[1]
        rho = math.hypot(p[0], p[1])
        off_core = rho - major
        share = off_core / rho
        # velocity away from the axis; what is left of it in the plane goes round the axis
        outwards = (p[0] * v[0] + p[1] * v[1]) / rho
        round_squared = v[0] * v[0] + v[1] * v[1] - outwards * outwards
        value = 0.5 * (off_core * off_core + p[2] * p[2] - minor * minor)
        bend = outwards * outwards + share * round_squared + v[2] * v[2]
        return value, (share * p[0], share * p[1], p[2]), bend
    value, bend, gradient = -0.5, 0.0, (0.0, 0.0, 0.0)
    for i in range(3):
        axis = surface.lengths[0] if surface.kind == SPHERE else surface.lengths[i]
        scale = 1.0 / (axis * axis)
        value += 0.5 * scale * p[i] * p[i]
        bend += scale * v[i] * v[i]
        unit = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
        gradient = plus(gradient, scale * p[i], unit)
    return value, gradient, bend


@compiled
def contact_in_space(reals: Array, p: Triple, v: Triple, tau: float, load: Any) -> tuple[float, Triple, Triple]:
    """Return the contact force N (N), the outward unit normal, and the operator's force (N), for sliding at v (m/s).

    `reals` (k,) is of `surface_terms`.
    """
    _, gradient, bend = surface_terms(reals, p, v)
    steepness = math.sqrt(dot(gradient, gradient))
    normal = (gradient[0] / steepness, gradient[1] / steepness, gradient[2] / steepness)
    force = force_in_space(load, tau, p, v)
    # N = -F.n - m v.S v
    return -dot(force, normal) - load.mass * bend / steepness, normal, force


@compiled
def onto_surface(reals: Array, p: Triple, v: Triple) -> tuple[Triple, Triple]:
    """Return a place (m) beside the surface put onto it, and the velocity (m/s) without its part across.

    `reals` (k,) is of `surface_terms`.
    """
    gradient = (0.0, 0.0, 0.0)
    # Newton's method along the gradient: from 1e-13 m off, the first step gets to rounding
    for _ in range(2):
        value, gradient, _ = surface_terms(reals, p, v)
        p = plus(p, -value / dot(gradient, gradient), gradient)
    return p, plus(v, -dot(v, gradient) / dot(gradient, gradient), gradient)


@compiled
def slide_in_space(
    reals: Array, p: Triple, v: Triple, tau: float, h: float, load: Any
) -> tuple[Triple, Triple, Triple]:
    """Return place (m), velocity (m/s) and contact impulse (N s) after h seconds of sliding: one step of `STAGES`.

    From p (m) on the surface of `reals` (k,) and v (m/s) along it, `tau` (s) into the stretch of a `LOAD`.
    """
    rates, totals = np.empty((7, 9)), np.empty(9)  # dp/dt, dv/dt and the contact force, by axis
    for k in range(7):
        place, velocity = p, v
        for i in range(k):
            share = h * STAGES[k, i] / STAGES[k, 6]
            place = plus(place, share, triple_at(rates[i], 0))
            velocity = plus(velocity, share, triple_at(rates[i], 3))
        contact, normal, force = contact_in_space(reals, place, velocity, tau + STAGES[k, 7] * h / STAGES[k, 8], load)
        for axis in range(3):
            rates[k, axis] = velocity[axis]
            rates[k, 6 + axis] = contact * normal[axis]
            # m y'' = F_o + N n
            rates[k, 3 + axis] = (force[axis] + contact * normal[axis]) / load.mass
    for c in range(9):
        totals[c] = gained_in_step(rates, c, h)
    # what the method leaves across the surface goes
    place, velocity = onto_surface(reals, plus(p, 1.0, triple_at(totals, 0)), plus(v, 1.0, triple_at(totals, 3)))
    return place, velocity, triple_at(totals, 6)


@compiled
def _leave_surface(tool: Tool, tau: float) -> None:
    """Let the tool fly from where it is, and log that it left."""
    tool.state.mode = FLIGHT
    log_in_space(tool, LEAVE, tau, (0.0, 0.0, 0.0))


@compiled
def _locate_lift(reals: Array, p: Triple, v: Triple, tau: float, h: float, load: Any) -> float:
    """Return the time (s) within a sliding step of h at which the contact force has just become negative."""
    low, high = 0.0, h
    a = contact_in_space(reals, p, v, tau, load)[0]
    place, velocity, _ = slide_in_space(reals, p, v, tau, h, load)
    b = contact_in_space(reals, place, velocity, tau + h, load)[0]
    for i in range(MOST_GUESSES):
        middle = guess_between(low, high, a, b, i)
        if not low < middle < high:
            break
        place, velocity, _ = slide_in_space(reals, p, v, tau, middle, load)
        contact = contact_in_space(reals, place, velocity, tau + middle, load)[0]
        if contact >= 0.0:
            low, a = middle, contact
        else:
            high, b = middle, contact
    return high


@compiled
def advance_slide(tool: Tool, reals: Array, sharpest: float, tau: float, time_left: float) -> float:
    """Carry a sliding tool by one step of at most `time_left` seconds, and return how long it took.

    `reals` (k,) is of `surface_terms`, `sharpest` (1/m) the surface's largest curvature.
    """
    state, load = tool.state, tool.load
    p, v = triple_of(state.position), triple_of(state.velocity)
    bilateral = load.bilateral != 0.0
    contact, normal, force = contact_in_space(reals, p, v, tau, load)
    # a contact force below zero would pull: the tool leaves
    if not bilateral and contact < 0.0:
        _leave_surface(tool, tau)
        return 0.0
    h, omega = time_left, math.sqrt(load.spring / load.mass)
    if h * omega > SLIDE_ANGLE:
        h = SLIDE_ANGLE / omega
    # the speed that the force along the surface may have given the tool by the end
    along = plus(force, -dot(force, normal), normal)
    turning = sharpest * (math.sqrt(dot(v, v)) + math.sqrt(dot(along, along)) / load.mass * h)
    if h * turning > SLIDE_ANGLE:
        h = SLIDE_ANGLE / turning
    place, velocity, impulse = slide_in_space(reals, p, v, tau, h, load)
    lifted = not bilateral and contact_in_space(reals, place, velocity, tau + h, load)[0] < 0.0
    if lifted:
        h = _locate_lift(reals, p, v, tau, h, load)
        place, velocity, impulse = slide_in_space(reals, p, v, tau, h, load)
    move_tool(tool, place, velocity, impulse)
    if lifted:
        _leave_surface(tool, tau + h)
    return h


@compiled
def collide_with_surface(tool: Tool, reals: Array, tau: float) -> None:
    """Let the tool, with the velocity that it has, meet the surface where it is: thesis (3.5).

    It slides on if it does not bounce and is pressed on; otherwise it flies.

    `reals` (k,) is of `surface_terms`, `tau` (s) the time within the stretch.
    """
    state, load = tool.state, tool.load
    v = triple_of(state.velocity)
    p, along = onto_surface(reals, triple_of(state.position), v)
    put_triple(state.position, 0, p)
    contact, normal, _ = contact_in_space(reals, p, along, tau, load)
    # velocity along the outward normal: negative into the model
    normal_speed = dot(v, normal)
    rounding = ALIGNED_SHARE * math.sqrt(dot(along, along))
    state.mode = SLIDE
    # held from both sides: the normal velocity is lost, whatever its sign
    if load.bilateral != 0.0:
        impulse = strike_tool(tool, along)
        if abs(normal_speed) > rounding:
            log_in_space(tool, IMPACT, tau, impulse)
        return
    # it moves off, or is let go: no impact
    if normal_speed > rounding or (normal_speed >= -rounding and contact < 0.0):
        state.mode = FLIGHT
        return
    # (3.5) along the normal: c_r times the speed into the surface
    bounce = -load.restitution * normal_speed
    # a hop of height m v^2 / (2 N) below the shortest that is one counts as contact
    if normal_speed >= -rounding or (contact > 0.0 and load.mass * bounce * bounce < 2.0 * contact * load.hop):
        bounce = 0.0
    impulse = strike_tool(tool, plus(along, bounce, normal))
    if bounce > 0.0 or contact < 0.0:
        state.mode = FLIGHT
    if normal_speed < -rounding:
        log_in_space(tool, IMPACT, tau, impulse)


@compiled
def _height(reals: Array, p: Triple, v: Triple, tau: float, t: float, load: Any) -> tuple[float, float, float]:
    """Return the height (m) over the surface after t seconds of flight from p (m) at v (m/s), and its first two rates.

    They are in m/s and m/s^2. The second is that of a tool as near to the surface as one that may hit it.
    """
    place, velocity = fly_in_space(p, v, tau, t, load)
    foot, normal, height = closest_on_surface(reals, place)
    rate = dot(normal, velocity)
    # what a contact would have to push, so that the tool stays at its height
    contact, _, _ = contact_in_space(reals, foot, plus(velocity, -rate, normal), tau + t, load)
    return height, rate, -contact / load.mass


@compiled
def _locate_change(
    column: int, reals: Array, flight: tuple[Triple, Triple, float], low: float, high: float, load: Any
) -> float:
    """Return the time (s) between `low` and `high` of a flight at which its height changes sign, or a rate of it.

    `column` says which, see `_height`. A height that has the same sign at both is on the surface to rounding, at `low`;
    a rate changes nowhere then, and `high` is returned. A flight is where it begins, m, its velocity there, m/s, and
    the time since the beginning of the stretch, s.
    """
    p, v, tau = flight
    a, b = _height(reals, p, v, tau, low, load)[column], _height(reals, p, v, tau, high, load)[column]
    if a * b >= 0.0:
        return low if column == 0 else high
    positive = a > 0.0
    for i in range(MOST_GUESSES):
        middle = guess_between(low, high, a, b, i)
        if not low < middle < high:
            break
        value = _height(reals, p, v, tau, middle, load)[column]
        if (value > 0.0) == positive:
            low, a = middle, value
        else:
            high, b = middle, value
    return high


@compiled
def first_hit(reals: Array, flight: tuple[Triple, Triple, float], h: float, load: Any) -> float:
    """Return the time (s) at which a short flight of h seconds first meets the surface; infinite where it does not.

    `reals` (k,) is of `surface_terms`.
    """
    p, v, tau = flight
    # Where the surface bends the other way from some place on, so does the height: within a step once at most.
    bend = _locate_change(2, reals, flight, 0.0, h, load)
    # Before the bend and behind it the height has at most one extremum each: between two cuts it rises or falls.
    early = _locate_change(1, reals, flight, 0.0, bend, load)
    late = _locate_change(1, reals, flight, bend, h, load) if bend < h else h
    cuts = (early, bend, late, h)
    low = 0.0
    for part in range(4):
        high = cuts[part]
        if high > low:
            if _height(reals, p, v, tau, high, load)[0] < -load.skin:
                return _locate_change(0, reals, flight, low, high, load)
            low = high
    return math.inf


@compiled
def advance_flight(tool: Tool, reals: Array, sharpest: float, tau: float, time_left: float) -> float:
    """Carry a flying tool by one step of at most `time_left` seconds, and return how long it took, in s.

    `reals` (k,) is of `surface_terms`, `sharpest` (1/m) the surface's largest curvature.
    """
    load = tool.load
    p, v = triple_of(tool.state.position), triple_of(tool.state.velocity)
    h, hit = longest_flight_step(load, time_left), math.inf
    height = closest_on_surface(reals, p)[2]
    # it ends where numbers overflow, too: halved by each turn at least, h becomes zero
    while h > 0.0:
        place, velocity = fly_in_space(p, v, tau, h, load)
        change = plus(velocity, -1.0, v)
        # no longer than at the faster end's speed, and what that may have been exceeded by
        length_bound = h * (math.sqrt(max(dot(v, v), dot(velocity, velocity))) + math.sqrt(dot(change, change)))
        # clear of the surface: it would have to come down from both ends
        if height + closest_on_surface(reals, place)[2] > length_bound:
            break
        if length_bound * sharpest <= FLIGHT_ANGLE:
            hit = first_hit(reals, (p, v, tau), h, load)
            break
        h *= max(0.5 * FLIGHT_ANGLE / (length_bound * sharpest), 0.1)
    if hit <= h:
        h = hit
        place, velocity = fly_in_space(p, v, tau, h, load)
    # in flight all of the change of momentum is the operator's
    move_tool(tool, place, velocity, (0.0, 0.0, 0.0))
    if hit <= h:
        collide_with_surface(tool, reals, tau + h)
    return h


@compiled
def carry_on_surface(
    start: Array, reals: Array, sharpest: float, stretches: Stretches, gains: Array, rows: int, limit: int
) -> tuple[Array, Array, int, Array]:
    """Carry the tool from `start`, SLIDE where it begins on the surface, through all stretches.

    `reals` (4,) is the surface, `sharpest` (1/m) its largest curvature. See `Ground.carry` for the rest.
    """
    state, out = as_record(start, SPACE_TOOL), np.zeros((rows, 12))
    tool = Tool(state, as_record(gains, LOAD), np.zeros(6), np.zeros((limit, 8)), np.zeros(1, np.int64))
    for i in range(stretches.began.shape[0]):
        begin_stretch(tool, stretches, i, out)
        if i == 0 and state.mode == SLIDE:
            collide_with_surface(tool, reals, 0.0)
        tau, length, steps = 0.0, stretches.lasts[i], 0
        while tau < length and tool.tally[0] <= limit:
            time_left = length - tau
            if state.mode == FLIGHT:
                h = advance_flight(tool, reals, sharpest, tau, time_left)
            else:
                h = advance_slide(tool, reals, sharpest, tau, time_left)
            steps += 1
            if steps > MOST_SAMPLE_STEPS:
                return out, tool.log, int(tool.tally[0]), where_given_up(tool, tau)
            # to the end of the stretch, by rounding too
            if h >= time_left:
                break
            tau += h
    close_sample(tool, stretches, stretches.began.shape[0] - 1, out)
    return out, tool.log, int(tool.tally[0]), np.empty(0)


class SurfaceGround:
    """A smooth closed surface as the `Ground` of an ideal contact, unilateral or bilateral."""

    def __init__(self, surface: Surface) -> None:
        self.surface = surface
        self._sharpest = _largest_curvature(surface.row)

    def in_flight(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.in_flight` for a point (3,), m, and a velocity (3,), m/s."""
        return state_in_flight(point, velocity)

    def on_boundary(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.on_boundary` for a point (3,), m, and a velocity (3,), m/s."""
        state = self.in_flight(self.surface.closest_point(point[np.newaxis]).foot[0], velocity)
        as_record(state, SPACE_TOOL).mode = SLIDE
        return state

    def carry(
        self, start: Array, stretches: Stretches, gains: Array, rows: int, limit: int
    ) -> tuple[Array, Array, int, Array]:
        """Answer `Ground.carry`: samples (rows, 12) and events (k, 8), in m, m/s, s and N s."""
        return carry_on_surface(start, self.surface.row, self._sharpest, stretches, gains, rows, limit)


def _largest_curvature(row: Array) -> float:
    """Return the largest |principal curvature| (1/m) of the surface in a row (4,) of `geometry.surface`."""
    surface = as_record(row, SURFACE)
    axes = surface.lengths
    # round the tube, or round the hole
    if surface.kind == TORUS:
        return float(max(1.0 / axes[1], 1.0 / (axes[0] - axes[1])))
    # at the tip of the longest semi-axis, across the shortest
    if surface.kind == ELLIPSOID:
        return float(axes.max() / axes.min() ** 2)
    return float(1.0 / axes[0])
