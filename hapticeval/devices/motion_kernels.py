"""The motion of a device for compiled loops: how it accelerates, and how it gets from one sample to the next.

Between samples a device follows M q̈ + bias = u + Jᵀ F_o - Coulomb friction. The motors' torque u is held; `Load` is the
rest. Any method of `integration` integrates that.

Friction makes the acceleration jump where a joint stops. Each stop and each breaking loose that shows at the end of a
step is located to the step's last bits, and the step ends there: between such events the motion is smooth, and the
method keeps its order.

A joint that stops and goes on within one step, of a tick at the most, is not noticed. That a joint at rest breaks loose
is decided joint by joint, which is exact where M is diagonal, as it is for all devices here.

What a scene does not call for is None in `Load`, and its kernels test their argument for that: numba leaves the rest of
them out.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import typeof, types

from hapticeval.compiled import FirstClass, borrowing, first_class, inner
from hapticeval.devices.integration import Method, control
from hapticeval.laws import DYNAMICS, KINEMATICS, MARGIN, VECTOR
from hapticeval.records import as_record, record_type
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.devices.device import Device

(
    POSITION, VELOCITY, DRIFT, BIAS, NET, END, END_RATE, MODE, STAGE, STAGE_RATE, HOLD, EVENTS, SCRATCH_ROWS,
) = range(13)  # fmt: skip
JACOBIAN, INERTIA, SCRATCH, SQUARES = range(4)
"""Rows (SCRATCH_ROWS, N) and squares (SQUARES, N, N) of `Scratch`. MODE: the way that a joint moves, 0 at rest."""

CONTROL = record_type("tolerance", "exponent", "substeps")
"""Settings of a method, `integration.control`: the error that a step may have (0: take equal steps), the exponent with
which steps follow it, and how many equal steps a tick has."""

FLOOR = 1e-3
"""The least joint (rad, m) and rate (rad/s, m/s) that an error is measured against."""

MOST_DEVICE_STEPS = 100_000
"""Steps in a part of a tick after which a device counts as stuck: its equations are too stiff, or run away."""

MOST_JOINT_EVENTS = 64
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
    pushes: without a type of its own for that, no loop is compiled twice.

    `friction` (N,) is the Coulomb friction that opposes each joint that moves, and holds one at rest as long as it can.
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
    """Memory for what kernels compute on the way: (SCRATCH_ROWS, N), (SQUARES, N, N) and (stages, N)."""

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
    """Return a device under its load, to be integrated by `method` with the settings `knobs` (3,) of `control`.

    Lengths are in m, angles in rad, as the device has its joints.
    """
    size = device.dimension
    steps = Steps(method.table, control(method) if knobs is None else knobs, np.array([load.dt]))
    return Motion(plant_of(device), load, steps, scratch_of(size, method.b.size))


def scratch_of(size: int, stages: int = 1) -> Scratch:
    """Return scratch memory for N = `size` joints."""
    return Scratch(np.zeros((SCRATCH_ROWS, size)), np.empty((SQUARES, size, size)), np.empty((stages, size)))


@borrowing
def solve(matrix: Array, vector: Array) -> None:
    """Solve a linear system in place: `vector` (N,) becomes matrix⁻¹ vector, and `matrix` (N, N) is overwritten.

    Elimination with row exchange; units are the caller's, such as kg m² and N m for rad/s².
    """
    size = vector.shape[0]
    for column in range(size - 1):
        pivot = column  # the largest of the column, so that no factor is above 1
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
    for i in range(size - 1, -1, -1):  # back substitution
        total = vector[i]
        for k in range(i + 1, size):
            total -= matrix[i, k] * vector[k]
        vector[i] = total / matrix[i, i]


@inner
def accelerate(
    motion: Motion, tick: int, time: float, joints: Array, rates: Array, torque: Array, acceleration: Array
) -> None:
    """Write the joint accelerations q̈ (N,), rad/s² or m/s², to `acceleration`, at `time` s into the tick.

    `joints` (N,), rad or m, `rates` (N,) and the motors' `torque` (N,), N m or N, are the state. With friction also
    what holds each joint is written: rows[HOLD].
    """
    plant, load, scratch = motion.plant, motion.load, motion.scratch
    inertia, bias = scratch.squares[INERTIA], scratch.rows[BIAS]
    plant.dynamics(plant.parameters, joints, rates, inertia, bias)
    for i in range(joints.shape[0]):
        acceleration[i] = torque[i] - bias[i]  # M q̈ = u - bias + Jᵀ F_o - friction: first the right-hand side
    add_hand_force(load.push, load.grip, motion, tick, time, joints, rates, acceleration)
    solve_with_friction(load.friction, scratch, acceleration)


@inner
def add_hand_force(
    push: Array,
    grip: Grip | None,
    motion: Motion,
    tick: int,
    time: float,
    joints: Array,
    rates: Array,
    out: Array,
) -> None:
    """Add what the operator's force does to the joints, Jᵀ F_o, to the torques `out` (N,), N m, at `time` s.

    `joints` (N,), rad or m, and `rates` (N,) are the state; `push` (ticks + 1, N), N, and `grip` are those of `Load`.
    """
    plant, rows = motion.plant, motion.scratch.rows
    jacobian, position, velocity = motion.scratch.squares[JACOBIAN], rows[POSITION], rows[VELOCITY]
    plant.kinematics(plant.parameters, joints, rates, position, velocity, jacobian, rows[DRIFT])
    dt = motion.load.dt
    share = time / dt
    for k in range(joints.shape[0]):
        # the prescribed force, straight from sample to sample
        force = push[tick, k] + share * (push[tick + 1, k] - push[tick, k])
        if grip is not None:
            # k (x_d - y) + b (ẋ_d - ẏ), towards a point that runs straight from sample to sample
            path, gains = grip.path, grip.gains
            path_step = path[tick + 1, k] - path[tick, k]
            force += gains[0] * (path[tick, k] + share * path_step - position[k]) + gains[1] * (
                path_step / dt - velocity[k]
            )
        for i in range(joints.shape[0]):
            out[i] += jacobian[k, i] * force


@inner
def solve_with_friction(friction: Array | None, scratch: Scratch, out: Array) -> None:
    """Turn the torques `out` (N,), N m, into accelerations, rad/s², with friction: joints that it holds do not move.

    `friction` (N,), N m, is that of `Load`. rows[HOLD] (N,) becomes the torque that holds each joint.
    """
    inertia = scratch.squares[INERTIA]
    if friction is None:
        solve(inertia, out)
        return
    matrix = scratch.squares[SCRATCH]
    mode, hold, net = scratch.rows[MODE], scratch.rows[HOLD], scratch.rows[NET]
    size = out.shape[0]
    for i in range(size):
        out[i] -= mode[i] * friction[i]  # Coulomb: against the motion, whatever its speed
        net[i] = out[i]
        for k in range(size):
            matrix[i, k] = inertia[i, k]
        if mode[i] == 0.0:  # its row of the system says that it has no acceleration
            out[i] = 0.0
            for k in range(size):
                matrix[i, k] = 1.0 if k == i else 0.0
    solve(matrix, out)
    # what is left of each joint's torque, which friction has to take: net - M q̈
    for i in range(size):
        hold[i] = net[i]
        for k in range(size):
            hold[i] -= inertia[i, k] * out[k]


@inner
def take_step(motion: Motion, tick: int, time: float, h: float, joints: Array, rates: Array, torque: Array) -> float:
    """Take one Runge-Kutta-Nyström step of `h` s to rows[END], rows[END_RATE]; return its estimated relative error.

    It starts at `joints` (N,), rad or m, and `rates` (N,), `time` s into the tick, with the motors' `torque` (N,), N m.
    The formulas stand in `integration`. Infinite where the step's end is not finite.
    """
    table, rows, stages = motion.steps.table, motion.scratch.rows, motion.scratch.stages
    size, count = joints.shape[0], table.shape[1]
    stage, stage_rate, end, end_rate = rows[STAGE], rows[STAGE_RATE], rows[END], rows[END_RATE]
    # rows of `Method.table` after A and Ā
    b, bbar, c, e, ebar = 2 * count, 2 * count + 1, 2 * count + 2, 2 * count + 3, 2 * count + 4
    for s in range(count):
        for i in range(size):
            rate_sum, position_sum = 0.0, 0.0
            for r in range(s):
                rate_sum += table[s, r] * stages[r, i]
                position_sum += table[count + s, r] * stages[r, i]
            # q + c_i h q̇ + h² Σ ā_ij a_j and q̇ + h Σ a_ij a_j, where a_i is asked for
            stage[i] = joints[i] + h * (table[c, s] * rates[i] + h * position_sum)
            stage_rate[i] = rates[i] + h * rate_sum
        accelerate(motion, tick, time + table[c, s] * h, stage, stage_rate, torque, stages[s])
    largest_joint, largest_rate, position_error, rate_error = FLOOR, FLOOR, 0.0, 0.0
    for i in range(size):
        rate_sum, position_sum, rate_error_sum, position_error_sum = 0.0, 0.0, 0.0, 0.0
        for r in range(count):
            rate_sum += table[b, r] * stages[r, i]
            position_sum += table[bbar, r] * stages[r, i]
            rate_error_sum += table[e, r] * stages[r, i]
            position_error_sum += table[ebar, r] * stages[r, i]
        # q⁺ = q + h q̇ + h² Σ b̄_i a_i and q̇⁺ = q̇ + h Σ b_i a_i
        end[i] = joints[i] + h * (rates[i] + h * position_sum)
        end_rate[i] = rates[i] + h * rate_sum
        largest_joint, largest_rate = max(largest_joint, abs(end[i])), max(largest_rate, abs(end_rate[i]))
        position_error, rate_error = (
            max(position_error, abs(h * h * position_error_sum)),
            max(rate_error, abs(h * rate_error_sum)),
        )
        if not math.isfinite(end_rate[i] + end[i]):
            return math.inf
    return max(position_error / largest_joint, rate_error / largest_rate)


@inner
def break_loose(friction: Array, rows: Array) -> bool:
    """Let joints at rest break loose whose torque rows[HOLD] friction (N,), N m, cannot take; return whether one does.

    Its mode is then the direction in which it goes. `rows` (SCRATCH_ROWS, N) are those of `Scratch`.
    """
    mode, hold = rows[MODE], rows[HOLD]
    broke_loose = False
    for i in range(mode.shape[0]):
        if mode[i] == 0.0 and abs(hold[i]) > friction[i]:
            mode[i] = math.copysign(1.0, hold[i])
            broke_loose = True
    return broke_loose


@inner
def joint_event(friction: Array, motion: Motion, tick: int, time: float, torque: Array) -> bool:
    """Return whether a joint stopped or broke loose in the step to rows[END], which ends at `time` s.

    That is, whether it moves against its mode there, or rests and cannot be held by `friction` (N,), N m, against the
    motors' `torque` (N,), N m.
    """
    rows = motion.scratch.rows
    mode, hold, end, end_rate = rows[MODE], rows[HOLD], rows[END], rows[END_RATE]
    some_at_rest = False
    for i in range(mode.shape[0]):
        if mode[i] * end_rate[i] < 0.0:
            return True
        some_at_rest = some_at_rest or mode[i] == 0.0
    if some_at_rest:  # what would hold them
        accelerate(motion, tick, time, end, end_rate, torque, rows[STAGE])
        for i in range(mode.shape[0]):
            if mode[i] == 0.0 and abs(hold[i]) > friction[i]:
                return True
    return False


@inner
def set_modes(
    friction: Array | None, motion: Motion, tick: int, time: float, joints: Array, rates: Array, torque: Array
) -> None:
    """Write the direction in which each joint moves at the start of a tick's part, `time` s into the tick: rows[MODE].

    `friction` and `torque` (N,), N m, `joints` (N,), rad or m, and `rates` (N,) as of `accelerate`.
    """
    if friction is None:
        return
    rows = motion.scratch.rows
    mode, events = rows[MODE], rows[EVENTS]
    for i in range(joints.shape[0]):
        mode[i] = 0.0 if rates[i] == 0.0 else math.copysign(1.0, rates[i])
        events[i] = 0.0
    # a joint at rest that the motors or the hand overcome goes at once
    accelerate(motion, tick, time, joints, rates, torque, rows[STAGE])
    break_loose(friction, rows)


@inner
def end_at_event(
    friction: Array | None,
    motion: Motion,
    tick: int,
    time: float,
    h: float,
    joints: Array,
    rates: Array,
    torque: Array,
) -> float:
    """End a step of `h` s at the first joint that stops or breaks loose in it; return the step's length (s) then.

    `friction` and `torque` (N,), N m, `joints` (N,), rad or m, and `rates` (N,) as of `accelerate`; the step is in
    rows[END] and rows[END_RATE], and taken again where it is shortened.
    """
    if friction is None:
        return h
    dt, rows = motion.load.dt, motion.scratch.rows
    mode, end, end_rate, events = rows[MODE], rows[END], rows[END_RATE], rows[EVENTS]
    if events[0] < MOST_JOINT_EVENTS and joint_event(friction, motion, tick, time + h, torque):
        low, high = 0.0, h
        events[0] += 1.0
        # bisection on the length: no event in a step of `low` seconds, one in a step of `high`
        while high - low > 1e-15 * dt + 1e-13 * high:
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            take_step(motion, tick, time, middle, joints, rates, torque)
            if joint_event(friction, motion, tick, time + middle, torque):
                high = middle
            else:
                low = middle
        h = high
        take_step(motion, tick, time, h, joints, rates, torque)
    some_at_rest = False
    for i in range(joints.shape[0]):
        if mode[i] * end_rate[i] < 0.0:  # it stops: what is left of its rate is rounding
            end_rate[i], mode[i] = 0.0, 0.0
        some_at_rest = some_at_rest or mode[i] == 0.0
    if some_at_rest:
        accelerate(motion, tick, time + h, end, end_rate, torque, rows[STAGE])
        break_loose(friction, rows)
    return h


@borrowing
def advance(motion: Motion, tick: int, begin: float, finish: float, joints: Array, rates: Array, torque: Array) -> int:
    """Move a device from `begin` to `finish` s into the tick under a held torque; return the steps taken, 0 if stuck.

    `joints` (N,), rad or m, and `rates` (N,) are changed in place; `torque` (N,), N m or N, is the motors'.
    """
    control, pace, rows = as_record(motion.steps.control, CONTROL), motion.steps.pace, motion.scratch.rows
    end, end_rate = rows[END], rows[END_RATE]
    time, step_count = begin, 0
    adaptive = control.tolerance > 0.0
    # part of a tick takes its share of the tick's steps
    equal_steps = max(1, math.ceil(control.substeps * (finish - begin) / motion.load.dt - 1e-9))
    set_modes(motion.load.friction, motion, tick, time, joints, rates, torque)
    while time < finish:
        time_left = finish - time
        h = (finish - begin) / equal_steps
        if adaptive:
            h = pace[0]
        # no sliver is left for a last step, and two equal steps are better than a long and a short one
        if h >= 0.999999 * time_left:
            h = time_left
        elif adaptive and 2.0 * h > time_left:
            h = 0.5 * time_left
        error = take_step(motion, tick, time, h, joints, rates, torque)
        step_count += 1
        if step_count > MOST_DEVICE_STEPS or not math.isfinite(h + time):
            return 0
        if adaptive:
            # the usual control: 0.9 error^(-1 / (order + 1)), by a factor of 5 at the most
            error /= control.tolerance
            factor = 0.2
            if error < 1e-5:
                factor = 5.0
            elif error < 1e4:
                factor = min(5.0, max(0.2, 0.9 * error**control.exponent))
            if error > 1.0:  # again, with a shorter step
                pace[0] = h * min(factor, 0.9)
                continue
            # a step that was cut at the tick's end does not shorten the next one's
            if factor * h > pace[0] or h == pace[0]:
                pace[0] = factor * h
        h = end_at_event(motion.load.friction, motion, tick, time, h, joints, rates, torque)
        time = finish if h >= time_left else time + h
        for i in range(joints.shape[0]):
            joints[i], rates[i] = end[i], end_rate[i]
    return step_count


@inner
def push_at(push: Array, tick: int, i: int, time: float, dt: float) -> float:
    """Return the operator's prescribed force along axis `i`, N, at `time` s into the tick of `dt` s.

    `push` (n, N), N, has a row a sample, and runs straight in between.
    """
    if time <= 0.0:
        return float(push[tick, i])
    if time >= dt:
        return float(push[tick + 1, i])
    return float(push[tick, i] + time * ((push[tick + 1, i] - push[tick, i]) / dt))


@borrowing
def advance_point_mass(
    motion: Motion, tick: int, begin: float, finish: float, joints: Array, rates: Array, torque: Array
) -> int:
    """`advance` for a point mass that no hand holds, by its exact integral: `PointMass.advance`, to the last bit.

    `joints` (N,), m, and `rates` (N,), m/s, become those at `finish` s into the tick; `torque` (N,), N.
    """
    load, duration = motion.load, finish - begin
    gain = duration / motion.plant.parameters[0]
    for i in range(joints.shape[0]):
        # the push runs straight, so that the velocity is quadratic in time and the position cubic
        first, last = push_at(load.push, tick, i, begin, load.dt), push_at(load.push, tick, i, finish, load.dt)
        joints[i] = joints[i] + duration * rates[i] + (duration * gain / 6.0) * (3.0 * torque[i] + 2.0 * first + last)
        rates[i] = rates[i] + gain * (torque[i] + 0.5 * (first + last))
    return 1


def advance_of(motion: Motion, *, exact: bool = False) -> FirstClass:
    """Return `advance`, or `advance_point_mass` if `exact`, for the types of a motion as a value.

    A loop that calls it is compiled without its code, and once for both.
    """
    times = types.int64, types.float64, types.float64
    signature = types.int64(typeof(motion), *times, VECTOR, VECTOR, VECTOR)  # type: ignore[no-untyped-call]
    return first_class(advance_point_mass if exact else advance, signature)
