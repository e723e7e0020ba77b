"""Inner loops for compiled code: which joint torques the renderer's force becomes, (2.8), (2.11), (6.7), (8.6)."""

from __future__ import annotations

from typing import NamedTuple

from hapticeval.compiled import borrowing
from hapticeval.devices.motion_kernels import BIAS, DRIFT, INERTIA, JACOBIAN, NET, SCRATCH, Plant, Scratch, solve
from hapticeval.types import Array

STATIC, COMPENSATED, LINEARISED = range(3)


class Inner(NamedTuple):
    """An inner loop: `InnerLoop.code`, the virtual tool's `mass`, kg, and the `parameters` (k,) of the device that it
    believes in: they need not be the device's own."""

    loop: int
    mass: float
    parameters: Array


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
    """Write the joint torques that an inner loop makes of the renderer's force, at the state that it believes in.

    `joints` (N,), rad or m, and `rates` (N,) are that state; `force` (N,), N, is the renderer's, and `push` (N,), N,
    the hand's as measured, or None; `out` (N,), N m or N, is written. The device's Jacobian and J̇ q̇ there stand in
    `scratch`.
    """
    jacobian, drift = scratch.squares[JACOBIAN], scratch.rows[DRIFT]
    size = joints.shape[0]
    for i in range(size):  # (2.8): τ = Jᵀ F
        total = 0.0
        for k in range(size):
            total += jacobian[k, i] * force[k]
        out[i] = total
    if inner.loop == STATIC:
        return
    inertia, matrix = scratch.squares[INERTIA], scratch.squares[SCRATCH]
    bias, acceleration = scratch.rows[BIAS], scratch.rows[NET]
    plant.dynamics(inner.parameters, joints, rates, inertia, bias)
    for i in range(size):
        for k in range(size):
            matrix[i, k] = jacobian[i, k]
    if inner.loop == COMPENSATED:  # (2.11): add bias - M J⁻¹ J̇ q̇ to Jᵀ F
        for i in range(size):
            acceleration[i] = -drift[i]
    else:  # (6.7), (6.14): τ = M J⁻¹ (v - J̇ q̇) + bias with v = F / m
        for i in range(size):
            out[i] = 0.0
            acceleration[i] = force[i] / inner.mass - drift[i]
        if push is not None:  # (8.6): the hand pushes the tool too, and is taken off the device
            for i in range(size):
                acceleration[i] = (force[i] + push[i]) / inner.mass - drift[i]
                for k in range(size):
                    out[i] -= jacobian[k, i] * push[k]
    solve(matrix, acceleration)  # J⁻¹ of it: joint accelerations
    for i in range(size):
        total = out[i] + bias[i]
        for k in range(size):
            total += inertia[i, k] * acceleration[k]
        out[i] = total
