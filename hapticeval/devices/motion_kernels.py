"""The motion of a device for compiled loops: how it accelerates, and how it gets from one sample to the next.

Between samples a device follows M q̈ + bias = u + Jᵀ F_o - Coulomb friction. The motors' torque u is held; `Load` is the
rest. Any method of `integration` integrates that.

Friction makes the acceleration jump where a joint stops. Each stop and each breaking loose that shows at the end of a
step is located to the step's last bits, and the step ends there: between such events the motion is smooth, and the
method keeps its order. A joint that stops and goes on within one step, of a tick at the most, is not seen to. That a
joint at rest breaks loose is decided joint by joint, which is exact where M is diagonal, as it is for all devices here.

What a scene does not call for is None in `Load`, and its kernels test their argument for that: numba leaves the rest of
them out.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import typeof, types

from hapticeval.compiled import (
    DYNAMICS,
    KINEMATICS,
    MARGIN,
    VECTOR,
    FirstClass,
    borrowing,
    compiled,
    first_class,
    inner,
)
from hapticeval.devices.integration import Method, control
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.devices.device import Device

(
    POSITION, VELOCITY, DRIFT, BIAS, NET, END, END_RATE, MODE, STAGE, STAGE_RATE, HOLD, EVENTS, ROWS,
) = range(13)  # fmt: skip
JACOBIAN, INERTIA, SCRATCH, SQUARES = range(4)
"""Rows (ROWS, N) and squares (SQUARES, N, N) of `Scratch`. MODE: the way that a joint moves, 0 at rest."""

TOLERANCE, EXPONENT, SUBSTEPS = range(3)
"""Settings of a method, `control` (3,): the error that a step may have (0: take equal steps), the exponent with which
steps follow it, and how many equal steps a tick has."""

FLOOR = 1e-3
"""The least joint (rad, m) and rate (rad/s, m/s) that an error is measured against."""

MOST_STEPS = 100_000
MOST_EVENTS = 64
"""A joint that stops and breaks loose more often than that in a tick is held at the ends of whole steps only."""


class Plant(NamedTuple):
    """A device: its kernels as first-class functions, and the `parameters` that they are given."""

    kinematics: FirstClass
    dynamics: FirstClass
    margin: FirstClass
    parameters: Array


class Grip(NamedTuple):
    """A hand that draws towards a point running straight through `path` (ticks + 1, N), m; `gains` are k and b (2,)."""

    path: Array
    gains: Array


class Load(NamedTuple):
    """What acts on a device beside its motors, over ticks of `dt` seconds; what is None does not.

    `push` (ticks + 1, N), N, is the operator's prescribed force at the samples, straight in between, zero where nobody
    pushes: without a type of its own for that, no loop is compiled twice. `friction` (N,) is the Coulomb friction that
    opposes each joint that moves, and holds one at rest as long as it can.
    """

    dt: float
    push: Array
    grip: Grip | None
    friction: Array | None


class Steps(NamedTuple):
    """An integration method: `Method.table`, `integration.control`, and the step (1,), s, that it advises next."""

    table: Array
    control: Array
    pace: Array


class Scratch(NamedTuple):
    """Memory for what kernels compute on the way: (ROWS, N), (SQUARES, N, N) and (stages, N)."""

    rows: Array
    squares: Array
    stages: Array


class Motion(NamedTuple):
    """A device under its load, ready to be moved."""

    plant: Plant
    load: Load
    steps: Steps
    scratch: Scratch


def plant_of(device: Device) -> Plant:
    """Return a device as kernels take it."""
    code = device.kernels
    return Plant(
        first_class(code.kinematics, KINEMATICS),
        first_class(code.dynamics, DYNAMICS),
        first_class(code.margin, MARGIN),
        device.parameters,
    )


def motion_of(device: Device, load: Load, method: Method, knobs: Array | None = None) -> Motion:
    """Return a device under its load, to be integrated by `method` with the settings `knobs` of `control`."""
    size = device.dimension
    steps = Steps(method.table, control(method) if knobs is None else knobs, np.array([load.dt]))
    return Motion(plant_of(device), load, steps, scratch_of(size, method.b.size))


def scratch_of(size: int, stages: int = 1) -> Scratch:
    """Return scratch memory for N = `size` joints."""
    return Scratch(np.zeros((ROWS, size)), np.empty((SQUARES, size, size)), np.empty((stages, size)))


@borrowing
def solve(matrix: Array, vector: Array) -> None:
    """Replace `vector` (N,) by matrix⁻¹ vector; `matrix` (N, N) is overwritten. Elimination with row exchange."""
    size = vector.shape[0]
    for column in range(size - 1):
        pivot = column
        for i in range(column + 1, size):
            if abs(matrix[i, column]) > abs(matrix[pivot, column]):
                pivot = i
        if pivot != column:
            for k in range(column, size):
                matrix[column, k], matrix[pivot, k] = matrix[pivot, k], matrix[column, k]
            vector[column], vector[pivot] = vector[pivot], vector[column]
        for i in range(column + 1, size):
            if matrix[i, column] != 0.0:
                factor = matrix[i, column] / matrix[column, column]
                for k in range(column + 1, size):
                    matrix[i, k] -= factor * matrix[column, k]
                vector[i] -= factor * vector[column]
    for i in range(size - 1, -1, -1):
        total = vector[i]
        for k in range(i + 1, size):
            total -= matrix[i, k] * vector[k]
        vector[i] = total / matrix[i, i]


@inner
def accelerate(motion: Motion, tick: int, time: float, joints: Array, rates: Array, torque: Array, out: Array) -> None:
    """Write q̈ (N,) at `time` seconds into the tick; with friction, also what holds each joint: rows[HOLD]."""
    plant, load, scratch = motion.plant, motion.load, motion.scratch
    inertia, bias = scratch.squares[INERTIA], scratch.rows[BIAS]
    plant.dynamics(plant.parameters, joints, rates, inertia, bias)
    for i in range(joints.shape[0]):
        out[i] = torque[i] - bias[i]
    add_hand(load.push, load.grip, motion, tick, time, joints, rates, out)
    solve_held(load.friction, scratch, out)


@inner
def add_hand(
    push: Array,
    grip: Grip | None,
    motion: Motion,
    tick: int,
    time: float,
    joints: Array,
    rates: Array,
    out: Array,
) -> None:
    """Add Jᵀ F_o, N m, to `out` (N,): the operator's force at `time` seconds into the tick."""
    plant, rows = motion.plant, motion.scratch.rows
    jacobian, position, velocity = motion.scratch.squares[JACOBIAN], rows[POSITION], rows[VELOCITY]
    plant.kinematics(plant.parameters, joints, rates, position, velocity, jacobian, rows[DRIFT])
    dt = motion.load.dt
    share = time / dt
    for k in range(joints.shape[0]):
        force = push[tick, k] + share * (push[tick + 1, k] - push[tick, k])
        if grip is not None:
            path, gains = grip.path, grip.gains
            way = path[tick + 1, k] - path[tick, k]
            force += gains[0] * (path[tick, k] + share * way - position[k]) + gains[1] * (way / dt - velocity[k])
        for i in range(joints.shape[0]):
            out[i] += jacobian[k, i] * force


@inner
def solve_held(friction: Array | None, scratch: Scratch, out: Array) -> None:
    """Replace the torques `out` (N,) by M⁻¹ of them, less friction, where the joints that are held do not move."""
    inertia = scratch.squares[INERTIA]
    if friction is None:
        solve(inertia, out)
        return
    held = scratch.squares[SCRATCH]
    mode, hold, net = scratch.rows[MODE], scratch.rows[HOLD], scratch.rows[NET]
    size = out.shape[0]
    for i in range(size):
        out[i] -= mode[i] * friction[i]
        net[i] = out[i]
        for k in range(size):
            held[i, k] = inertia[i, k]
        if mode[i] == 0.0:
            out[i] = 0.0
            for k in range(size):
                held[i, k] = 1.0 if k == i else 0.0
    solve(held, out)
    for i in range(size):
        hold[i] = net[i]
        for k in range(size):
            hold[i] -= inertia[i, k] * out[k]


@inner
def step(motion: Motion, tick: int, time: float, h: float, joints: Array, rates: Array, torque: Array) -> float:
    """Take one step of `h` seconds to rows[END], rows[END_RATE]; return its estimated relative error."""
    table, rows, stages = motion.steps.table, motion.scratch.rows, motion.scratch.stages
    size, count = joints.shape[0], table.shape[1]
    stage, stage_rate, end, end_rate = rows[STAGE], rows[STAGE_RATE], rows[END], rows[END_RATE]
    b, bbar, c, e, ebar = 2 * count, 2 * count + 1, 2 * count + 2, 2 * count + 3, 2 * count + 4
    for s in range(count):
        for i in range(size):
            first, second = 0.0, 0.0
            for r in range(s):
                first += table[s, r] * stages[r, i]
                second += table[count + s, r] * stages[r, i]
            stage[i] = joints[i] + h * (table[c, s] * rates[i] + h * second)
            stage_rate[i] = rates[i] + h * first
        accelerate(motion, tick, time + table[c, s] * h, stage, stage_rate, torque, stages[s])
    largest, fastest, astray, off = FLOOR, FLOOR, 0.0, 0.0
    for i in range(size):
        first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
        for r in range(count):
            first += table[b, r] * stages[r, i]
            second += table[bbar, r] * stages[r, i]
            third += table[e, r] * stages[r, i]
            fourth += table[ebar, r] * stages[r, i]
        end[i] = joints[i] + h * (rates[i] + h * second)
        end_rate[i] = rates[i] + h * first
        largest, fastest = max(largest, abs(end[i])), max(fastest, abs(end_rate[i]))
        astray, off = max(astray, abs(h * h * fourth)), max(off, abs(h * third))
        if not math.isfinite(end_rate[i] + end[i]):
            return math.inf
    return max(astray / largest, off / fastest)


@inner
def settle(friction: Array, rows: Array) -> bool:
    """Whether a joint at rest breaks loose, given rows[HOLD]; its mode is then the way that it goes."""
    loose = False
    for i in range(rows.shape[1]):
        if rows[MODE, i] == 0.0 and abs(rows[HOLD, i]) > friction[i]:
            rows[MODE, i] = math.copysign(1.0, rows[HOLD, i])
            loose = True
    return loose


@inner
def turned(friction: Array, motion: Motion, tick: int, time: float, torque: Array) -> bool:
    """Whether at rows[END] a joint moves against its mode, or one at rest cannot be held."""
    rows = motion.scratch.rows
    resting = False
    for i in range(rows.shape[1]):
        if rows[MODE, i] * rows[END_RATE, i] < 0.0:
            return True
        resting = resting or rows[MODE, i] == 0.0
    if resting:
        accelerate(motion, tick, time, rows[END], rows[END_RATE], torque, rows[STAGE])
        for i in range(rows.shape[1]):
            if rows[MODE, i] == 0.0 and abs(rows[HOLD, i]) > friction[i]:
                return True
    return False


@inner
def set_modes(
    friction: Array | None, motion: Motion, tick: int, time: float, joints: Array, rates: Array, torque: Array
) -> None:
    """Write which way each joint moves at the start of a tick's part."""
    if friction is None:
        return
    rows = motion.scratch.rows
    for i in range(joints.shape[0]):
        rows[MODE, i] = 0.0 if rates[i] == 0.0 else math.copysign(1.0, rates[i])
        rows[EVENTS, i] = 0.0
    accelerate(motion, tick, time, joints, rates, torque, rows[STAGE])
    settle(friction, rows)


@inner
def stop(
    friction: Array | None,
    motion: Motion,
    tick: int,
    time: float,
    h: float,
    joints: Array,
    rates: Array,
    torque: Array,
) -> float:
    """End a step of `h` seconds at the first joint that stops or breaks loose in it; return the step's length then."""
    if friction is None:
        return h
    dt, rows = motion.load.dt, motion.scratch.rows
    if rows[EVENTS, 0] < MOST_EVENTS and turned(friction, motion, tick, time + h, torque):
        low, high = 0.0, h
        rows[EVENTS, 0] += 1.0
        while high - low > 1e-15 * dt + 1e-13 * high:
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            step(motion, tick, time, middle, joints, rates, torque)
            if turned(friction, motion, tick, time + middle, torque):
                high = middle
            else:
                low = middle
        h = high
        step(motion, tick, time, h, joints, rates, torque)
    stopped = False
    for i in range(joints.shape[0]):
        if rows[MODE, i] * rows[END_RATE, i] < 0.0:
            rows[END_RATE, i], rows[MODE, i] = 0.0, 0.0
        stopped = stopped or rows[MODE, i] == 0.0
    if stopped:
        accelerate(motion, tick, time + h, rows[END], rows[END_RATE], torque, rows[STAGE])
        settle(friction, rows)
    return h


@borrowing
def advance(motion: Motion, tick: int, begin: float, finish: float, joints: Array, rates: Array, torque: Array) -> int:
    """Move `joints` and `rates` (N,) from `begin` to `finish` seconds into the tick; return the steps, 0 if stuck."""
    control, pace, rows = motion.steps.control, motion.steps.pace, motion.scratch.rows
    time, taken = begin, 0
    adaptive = control[TOLERANCE] > 0.0
    equal = max(1, math.ceil(control[SUBSTEPS] * (finish - begin) / motion.load.dt - 1e-9))
    set_modes(motion.load.friction, motion, tick, time, joints, rates, torque)
    while time < finish:
        left = finish - time
        h = (finish - begin) / equal
        if adaptive:
            h = pace[0]
        if h >= 0.999999 * left:
            h = left
        elif adaptive and 2.0 * h > left:
            h = 0.5 * left
        error = step(motion, tick, time, h, joints, rates, torque)
        taken += 1
        if taken > MOST_STEPS or not math.isfinite(h + time):
            return 0
        if adaptive:
            error /= control[TOLERANCE]
            factor = 0.2
            if error < 1e-5:
                factor = 5.0
            elif error < 1e4:
                factor = min(5.0, max(0.2, 0.9 * error ** control[EXPONENT]))
            if error > 1.0:
                pace[0] = h * min(factor, 0.9)
                continue
            if factor * h > pace[0] or h == pace[0]:
                pace[0] = factor * h
        h = stop(motion.load.friction, motion, tick, time, h, joints, rates, torque)
        time = finish if h >= left else time + h
        for i in range(joints.shape[0]):
            joints[i], rates[i] = rows[END, i], rows[END_RATE, i]
    return taken


@inner
def pushed(push: Array, tick: int, i: int, time: float, dt: float) -> float:
    """Return the operator's prescribed force along axis `i`, N, at `time` seconds into the tick of `dt`."""
    if time <= 0.0:
        return float(push[tick, i])
    if time >= dt:
        return float(push[tick + 1, i])
    return float(push[tick, i] + time * ((push[tick + 1, i] - push[tick, i]) / dt))


@borrowing
def fall(motion: Motion, tick: int, begin: float, finish: float, joints: Array, rates: Array, torque: Array) -> int:
    """`advance` for a point mass that no hand holds, by its exact integral: `PointMass.advance`, to the last bit."""
    load, time = motion.load, finish - begin
    gain = time / motion.plant.parameters[0]
    for i in range(joints.shape[0]):
        first, last = pushed(load.push, tick, i, begin, load.dt), pushed(load.push, tick, i, finish, load.dt)
        joints[i] = joints[i] + time * rates[i] + (time * gain / 6.0) * (3.0 * torque[i] + 2.0 * first + last)
        rates[i] = rates[i] + gain * (torque[i] + 0.5 * (first + last))
    return 1


def advance_of(motion: Motion, *, exact: bool = False) -> FirstClass:
    """Return `advance`, or `fall` if `exact`, for the types of a motion as a value.

    A loop that calls it is compiled without its code, and once for both.
    """
    times = types.int64, types.float64, types.float64
    signature = types.int64(typeof(motion), *times, VECTOR, VECTOR, VECTOR)  # type: ignore[no-untyped-call]
    return first_class(fall if exact else advance, signature)


@compiled
def advance_many(motion: Motion, states: Array, afresh: bool, torque: Array) -> int:
    """`advance` by a tick for each row of `torque` (n, N): joints and rates into states[1:] (n, 2 N); return all steps.

    `afresh`: each tick starts from the state that is there already. Otherwise it starts where the last one ended.
    """
    ticks, size = torque.shape
    taken = 0
    joints, rates = np.empty(size), np.empty(size)
    start = states.copy()
    for tick in range(ticks):
        if afresh or tick == 0:
            for i in range(size):
                joints[i], rates[i] = start[tick, i], start[tick, size + i]
        taken += advance(motion, tick, 0.0, motion.load.dt, joints, rates, torque[tick])
        for i in range(size):
            states[tick + 1, i], states[tick + 1, size + i] = joints[i], rates[i]
    return taken
