"""The motion of a device from one sample to the next, by any method of `integration`, for compiled loops.

Friction makes the acceleration of `dynamics_kernels` jump where a joint stops. Each stop and each breaking loose that
shows at the end of a step is located to the step's last bits, and the step ends there: between such events the motion
is smooth, and the method keeps its order. A joint that stops and goes on within one step, of a tick at the most, is
not seen to. That a joint at rest breaks loose is decided joint by joint, which is exact where M is diagonal, as it is
for all devices here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.devices.dynamics_kernels import END, END_RATE, HOLD, MODE, STAGE, STAGE_RATE, accelerate
from hapticeval.types import Array

TOLERANCE, EXPONENT, SUBSTEPS = range(3)
"""Settings of a method, `control` (3,): the error that a step may have (0: take equal steps), the exponent with which
steps follow it, and how many equal steps a tick has."""

FLOOR = 1e-3
"""The least joint (rad, m) and rate (rad/s, m/s) that an error is measured against."""

MOST_STEPS = 100_000
MOST_EVENTS = 64
"""A joint that stops and breaks loose more often than that in a tick is held at the ends of whole steps only."""


@compiled
def step(
    kinematics: Callable[..., Any],
    dynamics: Callable[..., Any],
    parameters: Array,
    joints: Array,
    rates: Array,
    time: float,
    h: float,
    dt: float,
    torque: Array,
    push: Array | None,
    path: Array | None,
    grip: Array | None,
    friction: Array | None,
    table: Array,
    rows: Array,
    squares: Array,
    stages: Array,
) -> float:
    """One step of `h` seconds from (joints, rates) to rows[END], rows[END_RATE]; its estimated relative error."""
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
        accelerate(
            kinematics, dynamics, parameters, stage, stage_rate, time + table[c, s] * h, dt, torque, push, path, grip,
            friction, rows, squares, stages[s],
        )  # fmt: skip
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


@compiled
def settle(friction: Array, rows: Array) -> bool:
    """Whether a joint at rest breaks loose, given rows[HOLD]; its mode is then the way that it goes."""
    loose = False
    for i in range(rows.shape[1]):
        if rows[MODE, i] == 0.0 and abs(rows[HOLD, i]) > friction[i]:
            rows[MODE, i] = math.copysign(1.0, rows[HOLD, i])
            loose = True
    return loose


@compiled
def turned(
    kinematics: Callable[..., Any],
    dynamics: Callable[..., Any],
    parameters: Array,
    time: float,
    dt: float,
    torque: Array,
    push: Array | None,
    path: Array | None,
    grip: Array | None,
    friction: Array,
    rows: Array,
    squares: Array,
) -> bool:
    """Whether at rows[END] a joint moves against its mode, or one at rest cannot be held."""
    resting = False
    for i in range(rows.shape[1]):
        if rows[MODE, i] * rows[END_RATE, i] < 0.0:
            return True
        resting = resting or rows[MODE, i] == 0.0
    if resting:
        accelerate(
            kinematics, dynamics, parameters, rows[END], rows[END_RATE], time, dt, torque, push, path, grip, friction,
            rows, squares, rows[STAGE],
        )  # fmt: skip
        for i in range(rows.shape[1]):
            if rows[MODE, i] == 0.0 and abs(rows[HOLD, i]) > friction[i]:
                return True
    return False


@compiled
def advance(
    kinematics: Callable[..., Any],
    dynamics: Callable[..., Any],
    parameters: Array,
    joints: Array,
    rates: Array,
    begin: float,
    finish: float,
    dt: float,
    torque: Array,
    push: Array | None,
    path: Array | None,
    grip: Array | None,
    friction: Array | None,
    table: Array,
    control: Array,
    pace: Array,
    rows: Array,
    squares: Array,
    stages: Array,
) -> int:
    """Move `joints` and `rates` (N,) from `begin` to `finish` seconds into the tick; the number of steps, 0 if stuck.

    `pace` (1,) is the step (s) that the last accepted one advises, kept from tick to tick. `rows` (ROWS, N), `squares`
    (SQUARES, N, N) and `stages` (s, N) are for scratch.
    """
    size = joints.shape[0]
    time, taken, events = begin, 0, 0
    adaptive = control[TOLERANCE] > 0.0
    equal = max(1, math.ceil(control[SUBSTEPS] * (finish - begin) / dt - 1e-9))
    if friction is not None:
        for i in range(size):
            rows[MODE, i] = 0.0 if rates[i] == 0.0 else math.copysign(1.0, rates[i])
        accelerate(
            kinematics, dynamics, parameters, joints, rates, time, dt, torque, push, path, grip, friction, rows,
            squares, rows[STAGE],
        )  # fmt: skip
        settle(friction, rows)
    while time < finish:
        left = finish - time
        h = (finish - begin) / equal
        if adaptive:
            h = pace[0]
        if h >= 0.999999 * left:
            h = left
        elif adaptive and 2.0 * h > left:
            h = 0.5 * left
        error = step(
            kinematics, dynamics, parameters, joints, rates, time, h, dt, torque, push, path, grip, friction, table,
            rows, squares, stages,
        )  # fmt: skip
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
        if friction is not None:
            if events < MOST_EVENTS and turned(
                kinematics, dynamics, parameters, time + h, dt, torque, push, path, grip, friction, rows, squares
            ):
                low, high = 0.0, h
                events += 1
                while high - low > 1e-15 * dt + 1e-13 * high:
                    middle = 0.5 * (low + high)
                    if middle in (low, high):
                        break
                    step(
                        kinematics, dynamics, parameters, joints, rates, time, middle, dt, torque, push, path, grip,
                        friction, table, rows, squares, stages,
                    )  # fmt: skip
                    if turned(
                        kinematics, dynamics, parameters, time + middle, dt, torque, push, path, grip, friction, rows,
                        squares,
                    ):  # fmt: skip
                        high = middle
                    else:
                        low = middle
                h = high
                step(
                    kinematics, dynamics, parameters, joints, rates, time, h, dt, torque, push, path, grip, friction,
                    table, rows, squares, stages,
                )  # fmt: skip
            stopped = False
            for i in range(size):
                if rows[MODE, i] * rows[END_RATE, i] < 0.0:
                    rows[END_RATE, i], rows[MODE, i] = 0.0, 0.0
                stopped = stopped or rows[MODE, i] == 0.0
            if stopped:
                accelerate(
                    kinematics, dynamics, parameters, rows[END], rows[END_RATE], time + h, dt, torque, push, path, grip,
                    friction, rows, squares, rows[STAGE],
                )  # fmt: skip
                settle(friction, rows)
        time = finish if h >= left else time + h
        for i in range(size):
            joints[i], rates[i] = rows[END, i], rows[END_RATE, i]
    return taken


@compiled
def fall_free(mass: float, joints: Array, rates: Array, force: Array, begin: Array, finish: Array, time: float) -> None:
    """The point mass under a held force and a push that runs straight: `PointMass.advance`, to the last bit."""
    gain = time / mass
    for i in range(joints.shape[0]):
        joints[i] = joints[i] + time * rates[i] + (time * gain / 6.0) * (3.0 * force[i] + 2.0 * begin[i] + finish[i])
        rates[i] = rates[i] + gain * (force[i] + 0.5 * (begin[i] + finish[i]))


@compiled
def advance_many(
    kinematics: Callable[..., Any],
    dynamics: Callable[..., Any],
    parameters: Array,
    states: Array,
    afresh: bool,
    dt: float,
    torque: Array,
    push: Array | None,
    path: Array | None,
    grip: Array | None,
    friction: Array | None,
    table: Array,
    control: Array,
    pace: Array,
    rows: Array,
    squares: Array,
    stages: Array,
) -> int:
    """`advance` by a tick for each row of `torque` (n, N): joints and rates into states[1:] (n, 2 N); all its steps.

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
        taken += advance(
            kinematics, dynamics, parameters, joints, rates, 0.0, dt, dt, torque[tick],
            None if push is None else push[tick:], None if path is None else path[tick:], grip, friction, table,
            control, pace, rows, squares, stages,
        )  # fmt: skip
        for i in range(size):
            states[tick + 1, i], states[tick + 1, size + i] = joints[i], rates[i]
    return taken
