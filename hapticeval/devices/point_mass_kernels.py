"""The point mass for compiled loops (2.23) to (2.25)."""

# ruff: noqa: ARG001 - every device has these arguments

from __future__ import annotations

import math

from hapticeval.compiled import compiled
from hapticeval.types import Array


@compiled
def kinematics(
    parameters: Array, joints: Array, rates: Array, position: Array, velocity: Array, jacobian: Array, drift: Array
) -> None:
    """Position is the joints, J the identity, J̇ rates zero."""
    for i in range(joints.shape[0]):
        position[i], velocity[i], drift[i] = joints[i], rates[i], 0.0
        for j in range(joints.shape[0]):
            jacobian[i, j] = 1.0 if i == j else 0.0


@compiled
def dynamics(parameters: Array, joints: Array, rates: Array, inertia: Array, bias: Array) -> None:
    """M = m I, no bias."""
    for i in range(joints.shape[0]):
        bias[i] = 0.0
        for j in range(joints.shape[0]):
            inertia[i, j] = parameters[0] if i == j else 0.0


@compiled
def margin(parameters: Array, joints: Array) -> float:
    """Infinite."""
    return math.inf
