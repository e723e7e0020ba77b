"""The dynamics of a device for compiled loops: which torques its motors give, and how it accelerates.

Inner loops make torques of the renderer's force by (2.8), (2.11), (6.7) with (6.14), (8.6). Between samples the device
follows M q̈ + bias = u + Jᵀ F_o - Coulomb friction. Within a tick of `dt` seconds the motors' torque u is held, and the
rest changes thus:

- the operator's prescribed force runs straight from push[0] to push[1], rows (2, N), N; None is none;
- the hand (k, b) draws towards a point that runs straight from path[0] to path[1], rows (2, N), m; None is none;
- Coulomb friction (N,) opposes each joint that moves, and holds one at rest as long as it can; None is none.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hapticeval.compiled import compiled
from hapticeval.types import Array

STATIC, COMPENSATED, LINEARISED = range(3)

POSITION, VELOCITY, DRIFT, BIAS, NET, START, START_RATE, END, END_RATE, MODE, STAGE, STAGE_RATE, HOLD, ROWS = range(14)
JACOBIAN, INERTIA, SCRATCH, SQUARES = range(4)
"""Rows (ROWS, N) and squares (SQUARES, N, N) for scratch. MODE: the way that a joint moves, 0 at rest."""


@compiled
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


@compiled
def torque(
    loop: int,
    mass: float,
    dynamics: Callable[..., Any],
    parameters: Array,
    joints: Array,
    rates: Array,
    jacobian: Array,
    drift: Array,
    force: Array,
    push: Array | None,
    squares: Array,
    rows: Array,
    out: Array,
) -> None:
    """Joint torques (N,) for the Cartesian force of the renderer, at the state that the controller believes in.

    `jacobian` and `drift` = J̇ q̇ are those of the device there; `push` is the hand's force as measured, or None;
    `squares` (2, N, N) and `rows` (2, N) are for scratch.
    """
    size = joints.shape[0]
    for i in range(size):
        total = 0.0
        for k in range(size):
            total += jacobian[k, i] * force[k]
        out[i] = total
    if loop == STATIC:
        return
    inertia, scratch = squares[0], squares[1]
    bias, goal = rows[0], rows[1]
    dynamics(parameters, joints, rates, inertia, bias)
    for i in range(size):
        for k in range(size):
            scratch[i, k] = jacobian[i, k]
    if loop == COMPENSATED:
        for i in range(size):
            goal[i] = -drift[i]
    else:
        for i in range(size):
            out[i] = 0.0
            goal[i] = force[i] / mass - drift[i]
        if push is not None:
            for i in range(size):
                goal[i] = (force[i] + push[i]) / mass - drift[i]
                for k in range(size):
                    out[i] -= jacobian[k, i] * push[k]
    solve(scratch, goal)
    for i in range(size):
        total = out[i] + bias[i]
        for k in range(size):
            total += inertia[i, k] * goal[k]
        out[i] = total


@compiled
def accelerate(
    kinematics: Callable[..., Any],
    dynamics: Callable[..., Any],
    parameters: Array,
    joints: Array,
    rates: Array,
    time: float,
    dt: float,
    torque: Array,
    push: Array | None,
    path: Array | None,
    grip: Array | None,
    friction: Array | None,
    rows: Array,
    squares: Array,
    out: Array,
) -> None:
    """q̈ (N,) at `time` seconds into the tick; with friction, also what it takes to hold each joint: rows[HOLD]."""
    size = joints.shape[0]
    inertia, bias = squares[INERTIA], rows[BIAS]
    dynamics(parameters, joints, rates, inertia, bias)
    for i in range(size):
        out[i] = torque[i] - bias[i]
    if push is not None or path is not None:
        jacobian, position, velocity = squares[JACOBIAN], rows[POSITION], rows[VELOCITY]
        kinematics(parameters, joints, rates, position, velocity, jacobian, rows[DRIFT])
        share = time / dt
        for k in range(size):
            force = 0.0
            if push is not None:
                force += push[0, k] + share * (push[1, k] - push[0, k])
            if path is not None and grip is not None:
                way = path[1, k] - path[0, k]
                force += grip[0] * (path[0, k] + share * way - position[k]) + grip[1] * (way / dt - velocity[k])
            for i in range(size):
                out[i] += jacobian[k, i] * force
    if friction is None:
        solve(inertia, out)
        return
    scratch = squares[SCRATCH]
    mode, hold, net = rows[MODE], rows[HOLD], rows[NET]
    for i in range(size):
        out[i] -= mode[i] * friction[i]
        net[i] = out[i]
        for k in range(size):
            scratch[i, k] = inertia[i, k]
        if mode[i] == 0.0:
            out[i] = 0.0
            for k in range(size):
                scratch[i, k] = 1.0 if k == i else 0.0
    solve(scratch, out)
    for i in range(size):
        hold[i] = net[i]
        for k in range(size):
            hold[i] -= inertia[i, k] * out[k]
