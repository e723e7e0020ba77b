"""The parallelogram robot for compiled loops (2.26) to (2.39): its only equations, which the classes call too.

`parameters` are ℓ₁, ℓ₄ (m), b₁, b₂, b₃ (N m s/rad), d₁, d₂, d₃ (kg m²), then 1 if the base's inertia makes the
velocity terms that energy asks for (else 0), and 1 if it goes with cos² x₃ (else sin²).
"""

# ruff: noqa: ARG001 - every device has these arguments

from __future__ import annotations

import math

from hapticeval.compiled import compiled
from hapticeval.types import Array

L1, L4, B1, B2, B3, D1, D2, D3, COUPLED, COSINE = range(10)

BASE_LIMIT = SHOULDER_LIMIT = 2.4
"""rad: |x₁| and |x₂| of (2.30)."""
ELBOW_LOW, ELBOW_HIGH = -1.0, 2.3
"""rad: the bounds of x₃."""
STOP = 1.0
"""rad: |x₂ - x₃| at the mechanical stop that keeps the parallelogram from collapsing."""
DIAGONAL = math.sqrt(0.5)
"""Euclidean distance in joint space to a plane x₂ - x₃ = constant, a unit of x₂ - x₃ away."""


@compiled
def kinematics2(
    parameters: Array, joints: Array, rates: Array, position: Array, velocity: Array, jacobian: Array, drift: Array
) -> None:
    """(2.36), (2.37)."""
    l1, l4 = parameters[L1], parameters[L4]
    sin1, cos1 = l1 * math.sin(joints[0]), l1 * math.cos(joints[0])
    sin2, cos2 = l4 * math.sin(joints[1]), l4 * math.cos(joints[1])
    first, second = rates[0], rates[1]
    position[0] = cos2 - sin1 - l4
    position[1] = sin2 + cos1 - l1
    jacobian[0, 0], jacobian[0, 1] = -cos1, -sin2
    jacobian[1, 0], jacobian[1, 1] = -sin1, cos2
    velocity[0] = -cos1 * first - sin2 * second
    velocity[1] = -sin1 * first + cos2 * second
    drift[0] = sin1 * first * first - cos2 * second * second
    drift[1] = -cos1 * first * first - sin2 * second * second


@compiled
def dynamics2(parameters: Array, joints: Array, rates: Array, inertia: Array, bias: Array) -> None:
    """(2.35): both inertias are constant, so that no velocity terms are missing from it."""
    inertia[0, 0], inertia[0, 1] = parameters[D2], 0.0
    inertia[1, 0], inertia[1, 1] = 0.0, parameters[D3]
    bias[0] = parameters[B2] * rates[0]
    bias[1] = parameters[B3] * rates[1]


@compiled
def linkage_margin(shoulder: float, elbow: float) -> float:
    """The smallest signed distance (rad) to the limits of the two linkage joints (2.38)."""
    return min(
        SHOULDER_LIMIT - abs(shoulder),
        elbow - ELBOW_LOW,
        ELBOW_HIGH - elbow,
        (STOP - abs(shoulder - elbow)) * DIAGONAL,
    )


@compiled
def margin2(parameters: Array, joints: Array) -> float:
    """See `Parallelogram2.margin`; minus infinity for joints that are not finite."""
    if not (math.isfinite(joints[0]) and math.isfinite(joints[1])):
        return -math.inf
    return linkage_margin(joints[0], joints[1])


@compiled
def kinematics3(
    parameters: Array, joints: Array, rates: Array, position: Array, velocity: Array, jacobian: Array, drift: Array
) -> None:
    """(2.28), (2.29), by the distance r = ℓ₄ cos x₃ - ℓ₁ sin x₂ from the base's axis."""
    l1, l4 = parameters[L1], parameters[L4]
    sin1, cos1 = math.sin(joints[0]), math.cos(joints[0])
    sin2, cos2 = l1 * math.sin(joints[1]), l1 * math.cos(joints[1])
    sin3, cos3 = l4 * math.sin(joints[2]), l4 * math.cos(joints[2])
    first, second, third = rates[0], rates[1], rates[2]
    reach = cos3 - sin2
    reach_rate = -sin3 * third - cos2 * second
    reach_drift = -cos3 * third * third + sin2 * second * second
    position[0] = cos1 * reach - l4
    position[1] = sin1 * reach
    position[2] = sin3 + cos2 - l1
    jacobian[0, 0], jacobian[0, 1], jacobian[0, 2] = -sin1 * reach, -cos1 * cos2, -cos1 * sin3
    jacobian[1, 0], jacobian[1, 1], jacobian[1, 2] = cos1 * reach, -sin1 * cos2, -sin1 * sin3
    jacobian[2, 0], jacobian[2, 1], jacobian[2, 2] = 0.0, -sin2, cos3
    velocity[0] = cos1 * reach_rate - sin1 * reach * first
    velocity[1] = sin1 * reach_rate + cos1 * reach * first
    velocity[2] = -sin2 * second + cos3 * third
    inward = reach_drift - reach * first * first
    across = 2.0 * reach_rate * first
    drift[0] = cos1 * inward - sin1 * across
    drift[1] = sin1 * inward + cos1 * across
    drift[2] = -cos2 * second * second - sin3 * third * third


@compiled
def dynamics3(parameters: Array, joints: Array, rates: Array, inertia: Array, bias: Array) -> None:
    """(2.26) with d₀ of (2.27), and where `parameters` say so the velocity terms that (2.26) lacks."""
    d2, d3 = parameters[D2], parameters[D3]
    sin2, sin3, cos3 = math.sin(joints[1]), math.sin(joints[2]), math.cos(joints[2])
    slope2 = 2.0 * d2 * sin2 * math.cos(joints[1])
    slope3 = 2.0 * d3 * sin3 * cos3
    base = parameters[D1] + d2 * sin2 * sin2
    if parameters[COSINE] != 0.0:
        base += d3 * cos3 * cos3
        slope3 = -slope3
    else:
        base += d3 * sin3 * sin3
    for i in range(3):
        for j in range(3):
            inertia[i, j] = 0.0
    inertia[0, 0], inertia[1, 1], inertia[2, 2] = base, d2, d3
    first, second, third = rates[0], rates[1], rates[2]
    bias[0] = parameters[B1] * first
    bias[1] = parameters[B2] * second
    bias[2] = parameters[B3] * third
    if parameters[COUPLED] != 0.0:
        bias[0] += (slope2 * second + slope3 * third) * first
        bias[1] -= 0.5 * slope2 * first * first
        bias[2] -= 0.5 * slope3 * first * first


@compiled
def margin3(parameters: Array, joints: Array) -> float:
    """See `Parallelogram3.margin`; minus infinity for joints that are not finite."""
    if not (math.isfinite(joints[0]) and math.isfinite(joints[1]) and math.isfinite(joints[2])):
        return -math.inf
    l1, l4 = parameters[L1], parameters[L4]
    reach = l4 * math.cos(joints[2]) - l1 * math.sin(joints[1])
    nearest: float = min(
        BASE_LIMIT - abs(joints[0]),
        linkage_margin(joints[1], joints[2]),
        reach / math.sqrt(l1 * l1 + l4 * l4),
    )
    return nearest
