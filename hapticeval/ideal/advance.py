"""The loop over samples: each mode is carried to its next event or to the end of the stretch, whichever is first."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import KIND, U0, U1, UNBOUNDED
from hapticeval.ideal.collision import first_entry
from hapticeval.ideal.motion import (
    BEGAN,
    BILATERAL,
    G0X,
    G0Y,
    G1X,
    G1Y,
    MASS,
    SPRING,
    flown,
    hold,
    push,
    slid,
    slide_step,
    surface,
)
from hapticeval.ideal.terrain import Terrain
from hapticeval.ideal.touch import (
    ALIGNED,
    CORNER,
    FLIGHT,
    JOINT,
    LEAVE,
    MODE,
    PIECE,
    SLIDE,
    VX,
    VY,
    U,
    W,
    X,
    Y,
    corner,
    land,
    note,
    settle,
)
from hapticeval.types import Array, IntArray

TURN, END, LIFT = range(3)

FLIGHT_STEP = 2e-3
"""Longest step of a flight (s): within it the height over a cell has one extremum at the most."""


@compiled
def _watched(what: int, piece: Array, u: float, w: float, tau: float, h: float, end: float, load: Array) -> float:
    """The number whose change of sign is the event: the speed, the way to the piece's end, or the contact force."""
    u1, w1, _, _ = slid(piece, u, w, tau, h, load)
    if what == TURN:
        return w1
    if what == END:
        return u1 - end
    return hold(piece, u1, w1, tau + h, load)[0]


@compiled
def _locate(what: int, piece: Array, u: float, w: float, tau: float, h: float, end: float, load: Array) -> float:
    """Time within the step of h at which the watched number has just changed sign, to rounding; 0 if it had before."""
    low, high = 0.0, h
    a = _watched(what, piece, u, w, tau, low, end, load)
    b = _watched(what, piece, u, w, tau, high, end, load)
    if a * b >= 0.0:
        return 0.0
    positive, kept = a > 0.0, 0
    for i in range(120):
        middle = low + 0.5 * (high - low)
        if i % 4 != 3:
            middle = high - b * (high - low) / (b - a)
        if not low < middle < high:
            middle = low + 0.5 * (high - low)
            if not low < middle < high:
                break
        f = _watched(what, piece, u, w, tau, middle, end, load)
        if f == 0.0:
            high = middle
            break
        if (f > 0.0) == positive:
            low, a = middle, f
            b *= 0.5 if kept == 1 else 1.0
            kept = 1
        else:
            high, b = middle, f
            a *= 0.5 if kept == 2 else 1.0
            kept = 2
    return high


@compiled
def _leave(state: Array, tau: float, load: Array, log: Array, tally: IntArray) -> None:
    state[MODE] = FLIGHT
    note(log, tally, LEAVE, load[BEGAN] + tau, state, 0.0, 0.0)


@compiled
def _slide(
    state: Array, terrain: Terrain, tau: float, rest: float, load: Array, sums: Array, log: Array, tally: IntArray
) -> float:
    """One step of sliding, of at most `rest` seconds: how long it took."""
    index, u, w = int(state[PIECE]), state[U], state[W]
    piece = terrain.pieces[index]
    held = load[BILATERAL] != 0.0
    answer, along = hold(piece, u, w, tau, load)
    if not held and answer < 0.0:
        _leave(state, tau, load, log, tally)
        return 0.0
    h = slide_step(terrain.paces[index], w, along, load, rest)
    u1, w1, jx, jy = slid(piece, u, w, tau, h, load)
    if w == 0.0 and abs(along) > 1e-9 * abs(hold(piece, u1, w1, tau + h, load)[1]):
        # Out and back within the step: shorten it until it only goes out.
        for _ in range(60):
            if w1 * along >= 0.0:
                break
            h *= 0.5
            u1, w1, jx, jy = slid(piece, u, w, tau, h, load)
    turned = w * w1 < 0.0
    if turned:
        h = _locate(TURN, piece, u, w, tau, h, 0.0, load)
        u1, w1, jx, jy = slid(piece, u, w, tau, h, load)
        w1 = 0.0
    way = w + w1
    crossed = 0
    if piece[KIND] != UNBOUNDED and ((u1 >= piece[U1] and way > 0.0) or (u1 <= piece[U0] and way < 0.0)):
        crossed = 1 if way > 0.0 else -1
        end = piece[U1] if crossed == 1 else piece[U0]
        if u1 != end:
            h = _locate(END, piece, u, w, tau, h, end, load)
            u1, w1, jx, jy = slid(piece, u, w, tau, h, load)
        u1 = end
    if not held and hold(piece, u1, w1, tau + h, load)[0] < 0.0:
        h = _locate(LIFT, piece, u, w, tau, h, 0.0, load)
        u1, w1, jx, jy = slid(piece, u, w, tau, h, load)
        crossed = 0
        state[MODE] = FLIGHT
    x, y, tx, ty, _, _ = surface(piece, u1)
    mass = load[MASS]
    sums[0] += jx
    sums[1] += jy
    sums[2] += mass * (w1 * tx - state[VX]) - jx
    sums[3] += mass * (w1 * ty - state[VY]) - jy
    state[U], state[W], state[X], state[Y], state[VX], state[VY] = u1, w1, x, y, w1 * tx, w1 * ty
    if state[MODE] == FLIGHT:
        _leave(state, tau + h, load, log, tally)
    elif crossed != 0:
        _pass_joint(state, terrain, crossed, tau + h, load, sums, log, tally)
    return h


@compiled
def _pass_joint(
    state: Array, terrain: Terrain, way: int, tau: float, load: Array, sums: Array, log: Array, tally: IntArray
) -> None:
    """The tool slides over a joint: on if it is smooth, off if it is convex, against the next face if concave."""
    count = terrain.pieces.shape[0]
    index = int(state[PIECE])
    joint = (index + 1) % count if way > 0 else index
    if terrain.joints[joint] == 0.0:
        following = joint if way > 0 else (joint - 1) % count
        state[PIECE] = following
        state[U] = terrain.pieces[following, U0] if way > 0 else terrain.pieces[following, U1]
    elif terrain.joints[joint] > 0.0 and load[BILATERAL] == 0.0:
        _leave(state, tau, load, log, tally)
    else:
        corner(state, terrain, joint, tau, load, sums, log, tally, CORNER)


@compiled
def _fly(
    state: Array,
    terrain: Terrain,
    tau: float,
    rest: float,
    load: Array,
    sums: Array,
    log: Array,
    tally: IntArray,
    free: Array,
) -> float:
    """One step of free flight, of at most `rest` seconds: how long it took."""
    h = min(rest, FLIGHT_STEP)
    if load[SPRING] > 0.0:
        h = min(h, 0.2 * math.sqrt(load[MASS] / load[SPRING]))
    x, y, vx, vy = state[X], state[Y], state[VX], state[VY]
    at, piece, u = first_entry(terrain.cells, terrain.pieces, (x, y, vx, vy, tau), h, load, free)
    hit = at <= h
    h = min(at, h)
    state[X], state[Y], state[VX], state[VY] = flown(x, y, vx, vy, tau, h, load)
    sums[2] += load[MASS] * (state[VX] - vx)
    sums[3] += load[MASS] * (state[VY] - vy)
    if hit:
        land(state, terrain, piece, u, tau + h, load, sums, log, tally)
    return h


@compiled
def _rest(
    state: Array, terrain: Terrain, tau: float, rest: float, load: Array, sums: Array, log: Array, tally: IntArray
) -> float:
    """Rest in a corner until the force, linear in time, leaves its zone: how long that took."""
    count = terrain.pieces.shape[0]
    joint = int(state[JOINT])
    before = (joint - 1) % count
    pre, post = terrain.pieces[before], terrain.pieces[joint]
    _, _, ax, ay, _, _ = surface(pre, pre[U1])
    x, y, bx, by, _, _ = surface(post, post[U0])
    fx, fy = push(load, tau, x, y, 0.0, 0.0)
    gx, gy = load[G1X], load[G1Y]
    h, exits = rest, 0
    for way in (1, -1):
        tx, ty = (bx, by) if way == 1 else (-ax, -ay)
        now, grows = fx * tx + fy * ty, gx * tx + gy * ty
        if now > 0.0:
            h, exits = 0.0, way
        elif now + grows * h > 0.0:
            h, exits = -now / grows, way
    jx, jy = h * (fx + 0.5 * h * gx), h * (fy + 0.5 * h * gy)
    sums[0] -= jx
    sums[1] -= jy
    sums[2] += jx
    sums[3] += jy
    if exits != 0:
        settle(state, terrain, joint, tau + h, 0.0, exits, load, sums, log, tally)
    return h


@compiled
def _begin(state: Array, terrain: Terrain, load: Array, sums: Array, log: Array, tally: IntArray) -> None:
    """Start on the boundary at U with the given velocity: slide, bounce, fly off, or settle in a corner."""
    index, u = int(state[PIECE]), state[U]
    count = terrain.pieces.shape[0]
    piece = terrain.pieces[index]
    joint = index if u == piece[U0] else (index + 1) % count
    if u in (piece[U0], piece[U1]) and terrain.joints[joint] > 0.0 and load[BILATERAL] == 0.0:
        # On a tip the tool is on the face that it runs along; otherwise the flight decides which one it meets.
        state[MODE] = FLIGHT
        for way in (1, -1):
            index = joint if way == 1 else (joint - 1) % count
            u = terrain.pieces[index, U0] if way == 1 else terrain.pieces[index, U1]
            _, _, tx, ty, _, _ = surface(terrain.pieces[index], u)
            along = state[VX] * tx + state[VY] * ty
            if along * way > 0.0 and abs(state[VX] * ty - state[VY] * tx) <= ALIGNED * abs(along):
                land(state, terrain, index, u, 0.0, load, sums, log, tally)
        return
    land(state, terrain, index, u, 0.0, load, sums, log, tally)


@compiled
def follow(
    start: Array,
    terrain: Terrain,
    began: Array,
    lasts: Array,
    forces: Array,
    samples: IntArray,
    gains: Array,
    rows: int,
    limit: int,
) -> tuple[Array, Array, int]:
    """Carry the tool through stretches of time in which the operator's force is linear.

    `start` is the state (see `touch`), SLIDE where it begins on the boundary at U; `began`, `lasts` (s,) seconds;
    `forces` (s, 4) is g0 and g1 of a stretch; `samples` (s,) the sample interval that it belongs to; `gains` a `load`
    with its constants filled in. Gives (rows, 8): position and velocity at each sample, contact and operator's
    impulse until the next; the events (k, 6): time, kind, place, impulse; and the number of events, of which those
    above `limit` are not kept and end the run.
    """
    state, load, sums = start.copy(), gains.copy(), np.zeros(4)
    out, log, tally = np.zeros((rows, 8)), np.zeros((limit, 6)), np.zeros(1, np.int64)
    free = np.array([math.inf, -math.inf, math.inf, -math.inf])
    last = -1
    for i in range(began.shape[0]):
        load[G0X], load[G0Y], load[G1X], load[G1Y] = forces[i]
        load[BEGAN] = began[i]
        if samples[i] != last:
            if last >= 0:
                out[last, 4:8] = sums
                sums[:] = 0.0
            last = samples[i]
            out[last, 0:4] = state[X : VY + 1]
        if i == 0 and state[MODE] == SLIDE:
            _begin(state, terrain, load, sums, log, tally)
        tau, length = 0.0, lasts[i]
        while tau < length and tally[0] <= limit:
            rest = length - tau
            if state[MODE] == FLIGHT:
                h = _fly(state, terrain, tau, rest, load, sums, log, tally, free)
            elif state[MODE] == SLIDE:
                h = _slide(state, terrain, tau, rest, load, sums, log, tally)
            else:
                h = _rest(state, terrain, tau, rest, load, sums, log, tally)
            if h >= rest:
                break
            tau += h
    out[last, 4:8] = sums
    return out, log, int(tally[0])
