"""Inner loops for compiled code: which joint torques the renderer's force becomes, (2.8), (2.11), (6.7), (8.6)."""

from __future__ import annotations

from typing import NamedTuple

from hapticeval.compiled import borrowing
from hapticeval.devices.motion_kernels import BIAS, DRIFT, INERTIA, JACOBIAN, NET, SCRATCH, Plant, Scratch, solve
from hapticeval.types import Array

STATIC, COMPENSATED, LINEARISED = range(3)


class Inner(NamedTuple):
    """An inner loop: `InnerLoop.code`, and the virtual tool's `mass`, kg."""

    loop: int
    mass: float


@borrowing
def torque(
    inner: Inner,
    plant: Plant,
    joints: Array,
    rates: Array,
    force: Array,
    push: Array | None,
    scratch: Scratch,
    out: Array,
) -> None:
    """Write joint torques (N,) for the Cartesian force of the renderer, at the state that the controller believes in.

    The device's Jacobian and J̇ q̇ there stand in `scratch`; `push` is the hand's force as measured, or None.
    """
    jacobian, drift = scratch.squares[JACOBIAN], scratch.rows[DRIFT]
    size = joints.shape[0]
    for i in range(size):
        total = 0.0
        for k in range(size):
            total += jacobian[k, i] * force[k]
        out[i] = total
    if inner.loop == STATIC:
        return
    inertia, left = scratch.squares[INERTIA], scratch.squares[SCRATCH]
    bias, goal = scratch.rows[BIAS], scratch.rows[NET]
    plant.dynamics(plant.parameters, joints, rates, inertia, bias)
    for i in range(size):
        for k in range(size):
            left[i, k] = jacobian[i, k]
    if inner.loop == COMPENSATED:
        for i in range(size):
            goal[i] = -drift[i]
    else:
        for i in range(size):
            out[i] = 0.0
            goal[i] = force[i] / inner.mass - drift[i]
        if push is not None:
            for i in range(size):
                goal[i] = (force[i] + push[i]) / inner.mass - drift[i]
                for k in range(size):
                    out[i] -= jacobian[k, i] * push[k]
    solve(left, goal)
    for i in range(size):
        total = out[i] + bias[i]
        for k in range(size):
            total += inertia[i, k] * goal[k]
        out[i] = total
