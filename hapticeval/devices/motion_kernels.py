"""What moves a device between samples: M q̈ + bias = u + Jᵀ F_o - Coulomb friction, for compiled loops.

Within a tick of `dt` seconds the motors' torque u is held, and so are the ways in which the rest changes:

- the operator's prescribed force runs straight from push[0] to push[1], rows (2, N), N; None is none;
- the hand (k, b) draws towards a point that runs straight from path[0] to path[1], rows (2, N), m; None is none;
- Coulomb friction (N,) opposes each joint that moves, and holds one at rest as long as it can; None is none.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hapticeval.compiled import compiled
from hapticeval.devices.linear_kernels import solve
from hapticeval.types import Array

POSITION, VELOCITY, DRIFT, BIAS, NET, START, START_RATE, END, END_RATE, MODE, STAGE, STAGE_RATE, HOLD, ROWS = range(14)
JACOBIAN, INERTIA, SCRATCH, SQUARES = range(4)
"""Rows (ROWS, N) and squares (SQUARES, N, N) for scratch. MODE: the way that a joint moves, 0 at rest."""


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
