"""Inner loops for compiled loops (2.8), (2.11), (6.7) with (6.14), (8.6)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hapticeval.compiled import compiled
from hapticeval.devices.linear_kernels import solve
from hapticeval.types import Array

STATIC, COMPENSATED, LINEARISED = range(3)


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
