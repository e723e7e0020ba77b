"""A plane curve under the ideal contact: where the tool starts, and how it goes from event to event between samples.

Each mode is carried to its next event or to the end of the stretch.

The state is an array (10,), see the names of its places. Kept in one number, U + DU would lose the digits of hops in a
corner, which become as short as its rounding, and of which each sets the speed of the next.

Impacts, corners and coming to rest change the state at an instant, and every change of velocity adds its impulse to
`sums`.

Sequences of ever smaller hops (bounces with 0 < c_r < 1, slides up and down the faces of a notch) never end in number
but do in time.

A hop that stays within HOP_SHARE of the size of where it began is taken as contact: the tool slides or rests.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hapticeval.bracket import MOST_GUESSES, guess_between, narrow_bracket
from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import PIECE, UNBOUNDED, piece_index
from hapticeval.records import as_record, record_type, room_for
from hapticeval.rigid_contact.contact import ON_BOUNDARY
from hapticeval.rigid_contact.force import (
    ALIGNED_SHARE,
    CORNER,
    FLIGHT,
    IMPACT,
    LEAVE,
    LOAD,
    MOST_CORNER_HITS,
    MOST_SAMPLE_STEPS,
    PLACE_REACH,
    REST,
    SLIDE,
    STOP,
    Stretches,
    longest_flight_step,
)
from hapticeval.rigid_contact.plane_search import (
    BoundaryCells,
    Slide,
    contact_force,
    first_entry,
    fly_for,
    longest_slide_step,
    operator_force,
    prepare_boundary,
    slide_for,
    surface_frame,
)
from hapticeval.scene import Scene
from hapticeval.types import Array, IntArray

RIGID_TOOL = record_type("mode", "piece", "u", "du", "w", "x", "y", "vx", "vy", "join")
"""The tool's state.

- `mode`: FLIGHT, SLIDE or REST;
- `piece` of the boundary, `u` on it where the tool touched down or came from a join, `du` how much u has grown;
- `w` = ds/dt (m/s), position (`x`, `y`), m, and velocity (`vx`, `vy`), m/s;
- `join`: in REST the join whose corner holds the tool.
"""

STEP_ROUNDING = 1e-15
"""Share of its coordinates below which the way of a step is rounding: the force on a tool that the hand holds in place
changes its sign by rounding too, and no turn is looked for there."""

WATCHED_TURN, WATCHED_END, WATCHED_LIFT = range(3)


class Run(NamedTuple):
    """What the steps of one run read and write.

    - `state`: of the tool, the record `RIGID_TOOL`;
    - `load`: of the stretch, see `force`;
    - `sums` (4,), N s: the contact's and the operator's impulse since the sample;
    - `log` (k, 6): time, kind, place and impulse of the events, and `tally` (1,) how many there were, kept or not;
    - `free` (4,): a box known to hold no boundary, see `first_entry`.
    """

    state: Any
    load: Any
    sums: Array
    log: Array
    tally: IntArray
    free: Array
    terrain: BoundaryCells


@compiled
def log_event(run: Run, kind: int, tau: float, jx: float, jy: float) -> None:
    """Log an event at the tool's place with impulse (jx, jy); beyond the log's length it is only counted."""
    k, log = run.tally[0], run.log
    if k < log.shape[0]:
        log[k, 0], log[k, 1] = run.load.began + tau, kind
        log[k, 2], log[k, 3], log[k, 4], log[k, 5] = run.state.x, run.state.y, jx, jy
    # counted even where the log is full: the caller then takes a longer one
    run.tally[0] = k + 1


@compiled
def apply_impulse(run: Run, vx: float, vy: float) -> tuple[float, float]:
    """Give the tool a velocity at once; the impulse that this took (N s) is the contact's."""
    state, mass = run.state, run.load.mass
    jx, jy = mass * (vx - state.vx), mass * (vy - state.vy)
    run.sums[0] += jx
    run.sums[1] += jy
    state.vx, state.vy = vx, vy
    return jx, jy


@compiled
def place_on_piece(run: Run, piece: int, u: float, w: float) -> None:
    """Set the tool sliding at u on a piece; its velocity is left to `apply_impulse`."""
    state = run.state
    x, y, _, _, _, _ = surface_frame(run.terrain.pieces[piece], u)
    state.mode, state.piece, state.u, state.du, state.w = SLIDE, piece, u, 0.0, w
    state.x, state.y = x, y


@compiled
def collide(run: Run, piece: int, u: float, tau: float) -> None:
    """Let the tool, with the velocity that it has, meet the boundary at u of a piece: thesis (3.5).

    It slides on if it does not bounce and is pressed on; otherwise it flies. `tau` (s) is the time within the stretch.
    """
    state, load, terrain = run.state, run.load, run.terrain
    row, piece_range = terrain.pieces[piece], as_record(terrain.pieces, PIECE, piece)
    count = terrain.pieces.shape[0]
    # within a hop of a concave join it is the corner that is hit
    for end in range(2):
        join, join_u = (piece + end) % count, piece_range.u0 if end == 0 else piece_range.u1
        if terrain.joins[join] < 0.0 and load.bilateral == 0.0 and abs(u - join_u) <= PLACE_REACH:
            hit_corner(run, join, tau, IMPACT)
            return
    u = min(max(u, piece_range.u0), piece_range.u1)
    _, _, tx, ty, _, _ = surface_frame(row, u)
    mass = load.mass
    # velocity along the face, and along its outward normal (negative: into the model)
    tangent_speed = state.vx * tx + state.vy * ty
    normal_speed = state.vx * ty - state.vy * tx
    place_on_piece(run, piece, u, tangent_speed)
    # held from both sides: the normal velocity is lost, whatever its sign
    if load.bilateral != 0.0:
        jx, jy = apply_impulse(run, tangent_speed * tx, tangent_speed * ty)
        if abs(normal_speed) > ALIGNED_SHARE * abs(tangent_speed):
            log_event(run, IMPACT, tau, jx, jy)
        return
    contact, _ = contact_force(row, u, tangent_speed, tau, load)
    # it moves off, or is let go: no impact
    if normal_speed > ALIGNED_SHARE * abs(tangent_speed) or (
        normal_speed >= -ALIGNED_SHARE * abs(tangent_speed) and contact < 0.0
    ):
        state.mode = FLIGHT
        return
    # (3.5) along the normal: c_r times the speed into the face
    bounce = -load.restitution * normal_speed
    # a hop of height m v^2 / (2 N) below the shortest that is one counts as contact
    if normal_speed >= -ALIGNED_SHARE * abs(tangent_speed) or (
        contact > 0.0 and mass * bounce * bounce < 2.0 * contact * load.hop
    ):
        bounce = 0.0
    jx, jy = apply_impulse(run, tangent_speed * tx + bounce * ty, tangent_speed * ty - bounce * tx)
    if bounce > 0.0 or contact < 0.0:
        state.mode = FLIGHT
    if normal_speed < -ALIGNED_SHARE * abs(tangent_speed):
        log_event(run, IMPACT, tau, jx, jy)


@compiled
def _faces_at_join(run: Run, join: int) -> tuple[int, float, float, tuple[float, float, float, float, float, float]]:
    """Return the piece before a join, its last u, the first u of the join's own, and the place with both tangents."""
    pieces = run.terrain.pieces
    before = (join - 1) % pieces.shape[0]
    pre_end, post_start = as_record(pieces, PIECE, before).u1, as_record(pieces, PIECE, join).u0
    # unit tangents where the piece before ends, and where the join's own begins
    _, _, ax, ay, _, _ = surface_frame(pieces[before], pre_end)
    x, y, bx, by, _, _ = surface_frame(pieces[join], post_start)
    return before, pre_end, post_start, (x, y, ax, ay, bx, by)


@compiled
def hit_corner(run: Run, join: int, tau: float, kind: int) -> None:
    """Let the tool hit a concave corner, or any corner of a boundary that holds it from both sides.

    It hits the face that it runs against with that face's normal, thesis (3.5), again and again if the notch is so
    sharp that this throws it against the other face.

    A tool that is held loses its velocity across the next face.
    """
    state, load = run.state, run.load
    before, pre_end, post_start, (x, y, ax, ay, bx, by) = _faces_at_join(run, join)
    mass, rebound = load.mass, load.restitution
    vx, vy = state.vx, state.vy
    # normal velocities below this are rounding
    rounding = ALIGNED_SHARE * math.sqrt(vx * vx + vy * vy)
    state.x, state.y = x, y
    # held: only the velocity along the next face goes on, and none if it points back
    if load.bilateral != 0.0:
        forward = state.w > 0.0
        tx, ty = (bx, by) if forward else (ax, ay)
        w = vx * tx + vy * ty
        if (w > 0.0) != forward:
            w = 0.0
        vx, vy = w * tx, w * ty
    else:
        # squared speed that counts as rest: 1e-9 of the first speed
        rest_squared = 1e6 * rounding * rounding
        for _ in range(MOST_CORNER_HITS):
            # normal velocities off both faces: negative runs into one
            from_pre, from_post = vx * ay - vy * ax, vx * by - vy * bx
            if min(from_pre, from_post) >= -rounding or vx * vx + vy * vy <= rest_squared:
                break
            # the face that it runs against more
            tx, ty, across = (ax, ay, from_pre) if from_pre < from_post else (bx, by, from_post)
            # (3.5) on that face
            vx, vy = vx - (1.0 + rebound) * across * ty, vy + (1.0 + rebound) * across * tx
            fx, fy = operator_force(load, tau, x, y, vx, vy)
            contact, bounce = -(fx * ty - fy * tx), -rebound * across
            # a bounce that the force ends within a hop that is contact is left out
            if contact > 0.0 and mass * bounce * bounce < 2.0 * contact * load.hop:
                vx, vy = vx - bounce * ty, vy + bounce * tx
        else:
            # still hitting after MOST_CORNER_HITS: each hit took speed, none is left
            if rebound < 1.0:
                vx, vy = 0.0, 0.0
        if vx * vx + vy * vy <= rest_squared:
            vx, vy = 0.0, 0.0
    jx, jy = apply_impulse(run, vx, vy)
    if jx != 0.0 or jy != 0.0:
        log_event(run, kind, tau, jx, jy)
    # speeds away from the corner, along the face after and along the face before
    forth, back = vx * bx + vy * by, -(vx * ax + vy * ay)
    on_post = forth > 0.0 and abs(vx * by - vy * bx) <= rounding
    on_pre = back > 0.0 and abs(vx * ay - vy * ax) <= rounding
    if on_post or on_pre:
        fx, fy = operator_force(load, tau, x, y, vx, vy)
        # accelerations back into the corner on either face
        pull_post, pull_pre = -(fx * bx + fy * by) / mass, (fx * ax + fy * ay) / mass
        share = max(ax * bx + ay * by, 0.0)
        speed, pull, other_pull = (forth, pull_post, pull_pre) if on_post else (back, pull_pre, pull_post)
        # speed along the other face after the next pass: `share` is the cosine of the corner's turn
        next_speed = speed * share
        if (
            pull > 0.0
            and other_pull > 0.0
            and max(speed * speed / pull, next_speed * next_speed / other_pull) < 2.0 * load.hop
        ):
            # The corner takes the same share of the speed at every pass: the passes' times are a geometric series.
            wait = 2.0 * (speed / pull + next_speed / other_pull) / (1.0 - share * share) if rebound == 0.0 else 0.0
            settle_in_corner(run, join, tau, wait, 0)
            return
        # it slides off along the face that its velocity lies in
        piece = join if on_post else before
        w = forth if on_post else -back
        place_on_piece(run, piece, post_start if on_post else pre_end, w)
        if load.bilateral == 0.0 and contact_force(run.terrain.pieces[piece], state.u, w, tau, load)[0] < 0.0:
            state.mode = FLIGHT
        return
    if vx == 0.0 and vy == 0.0:
        settle_in_corner(run, join, tau, 0.0, 0)
        return
    state.mode = FLIGHT


@compiled
def settle_in_corner(run: Run, join: int, tau: float, wait: float, exits: int) -> None:
    """Stop the tool at a corner: it rests there, goes along a face, or lets go of both.

    It rests while the force points into the corner's zone (thesis 3.2.1). Else it goes along the face on which the
    force drives it away, or off both.

    - `wait` (s) is what an unending sequence of hops still takes: the event is logged at its end.
    - `exits` is 1 or -1 when the force is just leaving the zone towards the face after or before, where its sign is
      rounding; else 0.
    """
    state, load = run.state, run.load
    before, pre_end, post_start, (x, y, ax, ay, bx, by) = _faces_at_join(run, join)
    was_rest = state.mode == REST
    apply_impulse(run, 0.0, 0.0)
    state.x, state.y, state.w = x, y, 0.0
    fx, fy = operator_force(load, tau, x, y, 0.0, 0.0)
    # the force along the face after, and along the face before, away from the corner
    forth, back = fx * bx + fy * by, -(fx * ax + fy * ay)
    # the force off either face: positive leaves it
    lifts_post, lifts_pre = fx * by - fy * bx, fx * ay - fy * ax
    bilateral = load.bilateral != 0.0
    goes_forth, goes_back = forth > 0.0 or exits == 1, back > 0.0 or exits == -1
    # pressed against both faces
    if not goes_forth and not goes_back:
        state.mode, state.join = REST, join
        if not was_rest:
            log_event(run, STOP, tau + wait, 0.0, 0.0)
    elif goes_forth and (lifts_post <= 0.0 or (bilateral and forth >= back)):
        place_on_piece(run, join, post_start, 0.0)
    elif goes_back and (lifts_pre <= 0.0 or bilateral):
        place_on_piece(run, before, pre_end, 0.0)
    else:
        state.mode = FLIGHT
        log_event(run, LEAVE, tau, 0.0, 0.0)


@compiled
def _watched_value(watched: int, piece: Array, slide: Slide, tau: float, h: float, end: float, load: Any) -> float:
    """Return the number whose change of sign is the event: speed, way to the piece's end, or contact force."""
    du, w, _, _ = slide_for(piece, slide, tau, h, load)
    if watched == WATCHED_TURN:
        return w
    if watched == WATCHED_END:
        return du - end
    return contact_force(piece, slide[0] + du, w, tau + h, load)[0]


@compiled
def _locate_event(watched: int, piece: Array, slide: Slide, tau: float, h: float, end: float, load: Any) -> float:
    """Return the time (s) within the step of h at which the watched number has just changed sign, to rounding.

    It is 0 if it had before.
    """
    low, high = 0.0, h
    a = _watched_value(watched, piece, slide, tau, low, end, load)
    b = _watched_value(watched, piece, slide, tau, high, end, load)
    if a * b >= 0.0:
        return 0.0
    positive, side_kept = a > 0.0, 0
    for i in range(MOST_GUESSES):
        middle = guess_between(low, high, a, b, i)
        if not low < middle < high:
            break
        f = _watched_value(watched, piece, slide, tau, middle, end, load)
        if f == 0.0:
            return middle
        low, high, a, b, side_kept = narrow_bracket(low, high, a, b, side_kept, middle, f, positive)
    return high


@compiled
def _leave_boundary(run: Run, tau: float) -> None:
    """Let the tool fly from where it is, and log that it left."""
    run.state.mode = FLIGHT
    log_event(run, LEAVE, tau, 0.0, 0.0)


@compiled
def _advance_slide(run: Run, tau: float, time_left: float) -> float:
    """Carry a sliding tool by one step of at most `time_left` seconds, and return how long it took."""
    state, load, sums, terrain = run.state, run.load, run.sums, run.terrain
    index, began, w = int(state.piece), state.u, state.w
    slide = (began, state.du, w)
    piece = terrain.pieces[index]
    bilateral = load.bilateral != 0.0
    contact, along = contact_force(piece, began + state.du, w, tau, load)
    # a contact force below zero would pull: the tool leaves
    if not bilateral and contact < 0.0:
        _leave_boundary(run, tau)
        return 0.0
    h = longest_slide_step(terrain.paces[index], w, along, load, time_left)
    du, end_w, jx, jy = slide_for(piece, slide, tau, h, load)
    # a step shorter than rounding has no turn worth looking for
    is_resolved = 0.5 * (abs(w) + abs(end_w)) * h > STEP_ROUNDING * (abs(state.x) + abs(state.y))
    if is_resolved and w == 0.0 and abs(along) > 1e-9 * abs(contact_force(piece, began + du, end_w, tau + h, load)[1]):
        # Out and back within the step: shorten it until it only goes out.
        for _ in range(60):
            if end_w * along >= 0.0:
                break
            h *= 0.5
            du, end_w, jx, jy = slide_for(piece, slide, tau, h, load)
    turned = is_resolved and w * end_w < 0.0
    # the tool stops: the step ends there, at rest
    if turned:
        h = _locate_event(WATCHED_TURN, piece, slide, tau, h, 0.0, load)
        du, end_w, jx, jy = slide_for(piece, slide, tau, h, load)
        end_w = 0.0
    direction = w + end_w
    crossed_end = 0
    # the piece's ends, as du
    piece_range = as_record(piece, PIECE)
    first, last = piece_range.u0 - began, piece_range.u1 - began
    # past an end of the piece, in the direction of the motion
    if piece_range.kind != UNBOUNDED and ((du >= last and direction > 0.0) or (du <= first and direction < 0.0)):
        crossed_end = 1 if direction > 0.0 else -1
        end = last if crossed_end == 1 else first
        # What has begun at the end, and got beyond it by less than rounding, stays there for the step.
        if du != end and (state.du != end or began + du != began + end):
            h = _locate_event(WATCHED_END, piece, slide, tau, h, end, load)
            du, end_w, jx, jy = slide_for(piece, slide, tau, h, load)
        du = end
    # the contact force changed its sign within the step: it leaves there
    if not bilateral and contact_force(piece, began + du, end_w, tau + h, load)[0] < 0.0:
        h = _locate_event(WATCHED_LIFT, piece, slide, tau, h, 0.0, load)
        du, end_w, jx, jy = slide_for(piece, slide, tau, h, load)
        crossed_end = 0
        state.mode = FLIGHT
    x, y, tx, ty, _, _ = surface_frame(piece, began + du)
    mass = load.mass
    sums[0] += jx
    sums[1] += jy
    # the operator's impulse is the change of momentum less the contact's
    sums[2] += mass * (end_w * tx - state.vx) - jx
    sums[3] += mass * (end_w * ty - state.vy) - jy
    state.du, state.w, state.x, state.y, state.vx, state.vy = du, end_w, x, y, end_w * tx, end_w * ty
    if state.mode == FLIGHT:
        _leave_boundary(run, tau + h)
    elif crossed_end != 0:
        _pass_join(run, crossed_end, tau + h)
    return h


@compiled
def _pass_join(run: Run, direction: int, tau: float) -> None:
    """Slide the tool over a join: on if it is smooth, off if it is convex, against the next face if concave."""
    state, terrain = run.state, run.terrain
    count = terrain.pieces.shape[0]
    index = int(state.piece)
    join = (index + 1) % count if direction > 0 else index
    # smooth: on to the next piece, from its start or from its end
    if terrain.joins[join] == 0.0:
        next_piece = join if direction > 0 else (join - 1) % count
        state.piece, state.du = next_piece, 0.0
        next_range = as_record(terrain.pieces, PIECE, next_piece)
        state.u = next_range.u0 if direction > 0 else next_range.u1
    # convex: the boundary turns away
    elif terrain.joins[join] > 0.0 and run.load.bilateral == 0.0:
        _leave_boundary(run, tau)
    else:
        hit_corner(run, join, tau, CORNER)


@compiled
def _advance_flight(run: Run, tau: float, time_left: float) -> float:
    """Carry a flying tool by one step of at most `time_left` seconds, and return how long it took."""
    state, load = run.state, run.load
    h = longest_flight_step(load, time_left)
    x, y, vx, vy = state.x, state.y, state.vx, state.vy
    entry_time, piece, u = first_entry(run.terrain, (x, y, vx, vy, tau), h, load, run.free)
    hit = entry_time <= h
    h = min(entry_time, h)
    state.x, state.y, state.vx, state.vy = fly_for(x, y, vx, vy, tau, h, load)
    # in flight all of the change of momentum is the operator's
    run.sums[2] += load.mass * (state.vx - vx)
    run.sums[3] += load.mass * (state.vy - vy)
    if hit:
        collide(run, piece, u, tau + h)
    return h


@compiled
def _advance_rest(run: Run, tau: float, time_left: float) -> float:
    """Let the tool rest in a corner until the force, linear in time, leaves its zone, and return how long that took."""
    load, sums, join = run.load, run.sums, int(run.state.join)
    _, _, _, (x, y, ax, ay, bx, by) = _faces_at_join(run, join)
    fx, fy = operator_force(load, tau, x, y, 0.0, 0.0)
    gx, gy = load.g1[0], load.g1[1]
    h, exits = time_left, 0
    for side in (1, -1):
        # the direction in which the tool would leave along either face
        tx, ty = (bx, by) if side == 1 else (-ax, -ay)
        # the force along it is force + rate t: when does that become positive?
        force, rate = fx * tx + fy * ty, gx * tx + gy * ty
        if force > 0.0:
            h, exits = 0.0, side
        elif force + rate * h > 0.0:
            h, exits = -force / rate, side
    # the integral of a force linear in time; the contact takes all of it
    jx, jy = h * (fx + 0.5 * h * gx), h * (fy + 0.5 * h * gy)
    sums[0] -= jx
    sums[1] -= jy
    sums[2] += jx
    sums[3] += jy
    if exits != 0:
        settle_in_corner(run, join, tau + h, 0.0, exits)
    return h


@compiled
def _begin_on_boundary(run: Run) -> None:
    """Start on the boundary at U with the given velocity: slide, bounce, fly off, or settle in a corner."""
    state, terrain = run.state, run.terrain
    index, u = int(state.piece), state.u
    count = terrain.pieces.shape[0]
    piece = as_record(terrain.pieces, PIECE, index)
    join = index if u == piece.u0 else (index + 1) % count
    if u in (piece.u0, piece.u1) and terrain.joins[join] > 0.0 and run.load.bilateral == 0.0:
        # On a tip the tool is on the face that it runs along; otherwise the flight decides which one it meets.
        state.mode = FLIGHT
        for side in (1, -1):
            index = join if side == 1 else (join - 1) % count
            face = as_record(terrain.pieces, PIECE, index)
            u = face.u0 if side == 1 else face.u1
            _, _, tx, ty, _, _ = surface_frame(terrain.pieces[index], u)
            along = state.vx * tx + state.vy * ty
            if along * side > 0.0 and abs(state.vx * ty - state.vy * tx) <= ALIGNED_SHARE * abs(along):
                collide(run, index, u, 0.0)
        return
    collide(run, index, u, 0.0)


@compiled
def carry_tool(
    start: Array, terrain: BoundaryCells, stretches: Stretches, gains: Array, rows: int, limit: int
) -> tuple[Array, Array, int, Array]:
    """Carry the tool from `start` (10,), SLIDE where it begins on the boundary at U, through all stretches.

    `start` and `gains` are changed: the numbers of a `RIGID_TOOL`, and of a `LOAD` with its constants filled in.
    Returned are

    - rows (rows, 8): position (m) and velocity (m/s) at each sample, contact and operator's impulse (N s) until the
      next;
    - the events (k, 6), see `Run`;
    - the number of events, of which those above `limit` are not kept and end the run;
    - where and when the run was given up, (3,), or nothing, see `Ground.carry`.
    """
    # inside out: no box is known to be free yet
    free = np.array([math.inf, -math.inf, math.inf, -math.inf])
    state, load, out, last = as_record(start, RIGID_TOOL), as_record(gains, LOAD), np.zeros((rows, 8)), -1
    run = Run(state, load, np.zeros(4), np.zeros((limit, 6)), np.zeros(1, np.int64), free, terrain)
    for i in range(stretches.began.shape[0]):
        load.g0[0], load.g0[1], load.g1[0], load.g1[1] = stretches.forces[i]
        load.began = stretches.began[i]
        # a new sample: the impulses so far are those of the one before
        if stretches.samples[i] != last:
            if last >= 0:
                out[last, 4:8] = run.sums
                run.sums[:] = 0.0
            last = stretches.samples[i]
            out[last, 0], out[last, 1], out[last, 2], out[last, 3] = state.x, state.y, state.vx, state.vy
        if i == 0 and state.mode == SLIDE:
            _begin_on_boundary(run)
        tau, length, steps = 0.0, stretches.lasts[i], 0
        while tau < length and run.tally[0] <= limit:
            time_left = length - tau
            if state.mode == FLIGHT:
                h = _advance_flight(run, tau, time_left)
            elif state.mode == SLIDE:
                h = _advance_slide(run, tau, time_left)
            else:
                h = _advance_rest(run, tau, time_left)
            steps += 1
            if steps > MOST_SAMPLE_STEPS:
                return out, run.log, int(run.tally[0]), np.array([load.began + tau, state.x, state.y])
            # to the end of the stretch, by rounding too
            if h >= time_left:
                break
            tau += h
    out[last, 4:8] = run.sums
    return out, run.log, int(run.tally[0]), np.empty(0)


class PlaneGround:
    """A plane curve as the `Ground` of an ideal contact, unilateral or bilateral: thesis (3.1) to (3.8)."""

    def __init__(self, scene: Scene) -> None:
        self.curve = scene.model.curve
        self._terrain = prepare_boundary(self.curve)

    def in_flight(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.in_flight` for a point (2,), m, and a velocity (2,), m/s."""
        state = np.zeros(room_for(RIGID_TOOL))
        tool = as_record(state, RIGID_TOOL)
        tool.mode, tool.x, tool.y, tool.vx, tool.vy = FLIGHT, *point, *velocity
        return state

    def on_boundary(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.on_boundary` for a point (2,), m, and a velocity (2,), m/s."""
        curve, pieces = self.curve, self._terrain.pieces
        u = float(curve.nearest(point[np.newaxis])[0])
        index = piece_index(pieces, u)
        state = self.in_flight(curve.position(u), velocity)
        piece = as_record(pieces, PIECE, index)
        for join_u in (piece.u0, piece.u1):
            # beside a join it starts at the join, so that corners are seen
            if abs(u - join_u) <= ON_BOUNDARY:
                u = float(join_u)
        tool = as_record(state, RIGID_TOOL)
        tool.mode, tool.piece, tool.u = SLIDE, index, u
        return state

    def carry(
        self, start: Array, stretches: Stretches, gains: Array, rows: int, limit: int
    ) -> tuple[Array, Array, int, Array]:
        """Answer `Ground.carry`: samples (rows, 8) and events (k, 6), in m, m/s, s and N s."""
        return carry_tool(start, self._terrain, stretches, gains, rows, limit)
