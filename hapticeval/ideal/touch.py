"""What happens at an instant: impacts, corners, and coming to rest, as changes of the tool's state.

The state is an array: MODE (FLIGHT, SLIDE or REST), PIECE and U on the boundary, W = ds/dt, position, velocity, and
in REST the joint whose corner holds the tool. Every change of velocity adds its impulse to `sums`.

Sequences of ever smaller hops (bounces with 0 < c_r < 1, slides up and down the faces of a notch) never end in
number but do in time. A hop that stays within CLOSE of where it began is taken as contact: the tool slides or rests.
"""

from __future__ import annotations

import math

from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import U0, U1
from hapticeval.ideal.motion import BEGAN, BILATERAL, MASS, RESTITUTION, hold, push, surface
from hapticeval.ideal.terrain import Terrain
from hapticeval.types import Array, IntArray

MODE, PIECE, U, W, X, Y, VX, VY, JOINT = range(9)
STATES = 9
FLIGHT, SLIDE, REST = 0.0, 1.0, 2.0
IMPACT, LEAVE, CORNER, STOP = range(4)
KINDS = ("impact", "leave", "corner", "rest")

CLOSE = 1e-12
"""Longest hop (m) that is taken as contact: well above the rounding of positions, and the impulse that it leaves
out, below m sqrt(8 a CLOSE), is 1e-6 of that of a metre's fall."""

ALIGNED = 1e-12
"""Share of the speed below which a velocity across a face is rounding."""


@compiled
def note(log: Array, tally: IntArray, kind: int, time: float, state: Array, jx: float, jy: float) -> None:
    """Log an event at the tool's place with impulse (jx, jy); beyond the log's length it is only counted."""
    k = tally[0]
    if k < log.shape[0]:
        log[k, 0], log[k, 1] = time, kind
        log[k, 2], log[k, 3], log[k, 4], log[k, 5] = state[X], state[Y], jx, jy
    tally[0] = k + 1


@compiled
def strike(state: Array, vx: float, vy: float, mass: float, sums: Array) -> tuple[float, float]:
    """Give the tool a velocity at once; the impulse that this took (N s) is the contact's."""
    jx, jy = mass * (vx - state[VX]), mass * (vy - state[VY])
    sums[0] += jx
    sums[1] += jy
    state[VX], state[VY] = vx, vy
    return jx, jy


@compiled
def place(state: Array, terrain: Terrain, piece: int, u: float, w: float) -> None:
    """Set the tool sliding at u on a piece; its velocity is left to `strike`."""
    x, y, _, _, _, _ = surface(terrain.pieces[piece], u)
    state[MODE], state[PIECE], state[U], state[W] = SLIDE, piece, u, w
    state[X], state[Y] = x, y


@compiled
def land(
    state: Array,
    terrain: Terrain,
    piece: int,
    u: float,
    tau: float,
    load: Array,
    sums: Array,
    log: Array,
    tally: IntArray,
) -> None:
    """The tool, with the velocity that it has, meets the boundary at u: thesis (3.5).

    It slides on if it does not bounce and is pressed on; otherwise it flies.
    """
    row = terrain.pieces[piece]
    count = terrain.pieces.shape[0]
    for end in range(2):
        joint = (piece + end) % count
        if terrain.joints[joint] < 0.0 and load[BILATERAL] == 0.0 and abs(u - row[U0 + end]) <= CLOSE:
            corner(state, terrain, joint, tau, load, sums, log, tally, IMPACT)
            return
    u = min(max(u, row[U0]), row[U1])
    _, _, tx, ty, _, _ = surface(row, u)
    mass = load[MASS]
    w = state[VX] * tx + state[VY] * ty
    into = state[VX] * ty - state[VY] * tx
    place(state, terrain, piece, u, w)
    if load[BILATERAL] != 0.0:
        jx, jy = strike(state, w * tx, w * ty, mass, sums)
        if abs(into) > ALIGNED * abs(w):
            note(log, tally, IMPACT, load[BEGAN] + tau, state, jx, jy)
        return
    answer, _ = hold(row, u, w, tau, load)
    if into > ALIGNED * abs(w) or (into >= -ALIGNED * abs(w) and answer < 0.0):
        state[MODE] = FLIGHT
        return
    bounce = -load[RESTITUTION] * into
    if into >= -ALIGNED * abs(w) or (answer > 0.0 and mass * bounce * bounce < 2.0 * answer * CLOSE):
        bounce = 0.0
    jx, jy = strike(state, w * tx + bounce * ty, w * ty - bounce * tx, mass, sums)
    if bounce > 0.0 or answer < 0.0:
        state[MODE] = FLIGHT
    if into < -ALIGNED * abs(w):
        note(log, tally, IMPACT, load[BEGAN] + tau, state, jx, jy)


@compiled
def corner(
    state: Array,
    terrain: Terrain,
    joint: int,
    tau: float,
    load: Array,
    sums: Array,
    log: Array,
    tally: IntArray,
    kind: int,
) -> None:
    """The tool reaches a concave corner, or any corner of a boundary that holds it from both sides.

    It hits the face that it runs against with that face's normal, thesis (3.5), again and again if the notch is so
    sharp that this throws it against the other face. A tool that is held loses its velocity across the next face.
    """
    count = terrain.pieces.shape[0]
    before = (joint - 1) % count
    pre, post = terrain.pieces[before], terrain.pieces[joint]
    _, _, ax, ay, _, _ = surface(pre, pre[U1])
    x, y, bx, by, _, _ = surface(post, post[U0])
    mass, rebound = load[MASS], load[RESTITUTION]
    vx, vy = state[VX], state[VY]
    tiny = ALIGNED * math.sqrt(vx * vx + vy * vy)
    state[X], state[Y] = x, y
    if load[BILATERAL] != 0.0:
        forward = state[W] > 0.0
        tx, ty = (bx, by) if forward else (ax, ay)
        w = vx * tx + vy * ty
        if (w > 0.0) != forward:
            w = 0.0
        vx, vy = w * tx, w * ty
    else:
        for _ in range(200):
            from_pre, from_post = vx * ay - vy * ax, vx * by - vy * bx
            if min(from_pre, from_post) >= -tiny:
                break
            tx, ty, across = (ax, ay, from_pre) if from_pre < from_post else (bx, by, from_post)
            vx, vy = vx - (1.0 + rebound) * across * ty, vy + (1.0 + rebound) * across * tx
            fx, fy = push(load, tau, x, y, vx, vy)
            answer, bounce = -(fx * ty - fy * tx), -rebound * across
            if answer > 0.0 and mass * bounce * bounce < 2.0 * answer * CLOSE:
                vx, vy = vx - bounce * ty, vy + bounce * tx
        if vx * vx + vy * vy <= 1e6 * tiny * tiny:
            vx, vy = 0.0, 0.0
    jx, jy = strike(state, vx, vy, mass, sums)
    if jx != 0.0 or jy != 0.0:
        note(log, tally, kind, load[BEGAN] + tau, state, jx, jy)
    forth, back = vx * bx + vy * by, -(vx * ax + vy * ay)
    on_post = forth > 0.0 and abs(vx * by - vy * bx) <= tiny
    on_pre = back > 0.0 and abs(vx * ay - vy * ax) <= tiny
    if on_post or on_pre:
        fx, fy = push(load, tau, x, y, vx, vy)
        pull_post, pull_pre = -(fx * bx + fy * by) / mass, (fx * ax + fy * ay) / mass
        share = max(ax * bx + ay * by, 0.0)
        first, pull, other = (forth, pull_post, pull_pre) if on_post else (back, pull_pre, pull_post)
        then = first * share
        if pull > 0.0 and other > 0.0 and max(first * first / pull, then * then / other) < 2.0 * CLOSE:
            # The corner takes the same share of the speed at every pass: the passes' times are a geometric series.
            wait = 2.0 * (first / pull + then / other) / (1.0 - share * share) if rebound == 0.0 else 0.0
            settle(state, terrain, joint, tau, wait, 0, load, sums, log, tally)
            return
        piece = joint if on_post else before
        w = forth if on_post else -back
        place(state, terrain, piece, post[U0] if on_post else pre[U1], w)
        if load[BILATERAL] == 0.0 and hold(terrain.pieces[piece], state[U], w, tau, load)[0] < 0.0:
            state[MODE] = FLIGHT
        return
    if vx == 0.0 and vy == 0.0:
        settle(state, terrain, joint, tau, 0.0, 0, load, sums, log, tally)
        return
    state[MODE] = FLIGHT


@compiled
def settle(
    state: Array,
    terrain: Terrain,
    joint: int,
    tau: float,
    wait: float,
    exits: int,
    load: Array,
    sums: Array,
    log: Array,
    tally: IntArray,
) -> None:
    """The tool stops at a corner: it rests while the force points into the corner's zone (thesis 3.2.1), else goes
    along the face on which the force drives it away, or off both.

    `wait` (s) is what an unending sequence of hops still takes: the event is logged at its end. `exits` is 1 or -1
    when the force is just leaving the zone towards the face after or before, where its sign is rounding; else 0.
    """
    before = (joint - 1) % terrain.pieces.shape[0]
    pre, post = terrain.pieces[before], terrain.pieces[joint]
    _, _, ax, ay, _, _ = surface(pre, pre[U1])
    x, y, bx, by, _, _ = surface(post, post[U0])
    was_rest = state[MODE] == REST
    strike(state, 0.0, 0.0, load[MASS], sums)
    state[X], state[Y], state[W] = x, y, 0.0
    fx, fy = push(load, tau, x, y, 0.0, 0.0)
    forth, back = fx * bx + fy * by, -(fx * ax + fy * ay)
    lifts_post, lifts_pre = fx * by - fy * bx, fx * ay - fy * ax
    held = load[BILATERAL] != 0.0
    goes_forth, goes_back = forth > 0.0 or exits == 1, back > 0.0 or exits == -1
    if not goes_forth and not goes_back:
        state[MODE], state[JOINT] = REST, joint
        if not was_rest:
            note(log, tally, STOP, load[BEGAN] + tau + wait, state, 0.0, 0.0)
    elif goes_forth and (lifts_post <= 0.0 or (held and forth >= back)):
        place(state, terrain, joint, post[U0], 0.0)
    elif goes_back and (lifts_pre <= 0.0 or held):
        place(state, terrain, before, pre[U1], 0.0)
    else:
        state[MODE] = FLIGHT
        note(log, tally, LEAVE, load[BEGAN] + tau, state, 0.0, 0.0)
