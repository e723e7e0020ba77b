"""The mass that a hand feels at a place, as compiled code: for what strikes a device in the middle of a loop."""

from __future__ import annotations

import numpy as np

from hapticeval.compiled import compiled, compiled_once
from hapticeval.devices import parallelogram
from hapticeval.types import Array

inverse, kinematics2, kinematics3, dynamics2, dynamics3 = map(
    compiled_once,
    (
        parallelogram.inverse,
        parallelogram.kinematics2,
        parallelogram.kinematics3,
        parallelogram.dynamics2,
        parallelogram.dynamics3,
    ),
)


@compiled
def linkage_mass(parameters: Array, point: Array, normal: Array) -> float:
    """Return the mass (kg) that a blow along a unit `normal` (N,) meets at `point` (N,), m, on a parallelogram.

    That is what `device.apparent_mass` returns; zero where the device does not reach. `parameters` (k,) are its own.
    """
    dimension = point.shape[0]
    rows = np.zeros((5, dimension))
    joints, rates, position, velocity, drift = rows[0], rows[1], rows[2], rows[3], rows[4]
    jacobian, inertia = np.zeros((dimension, dimension)), np.zeros((dimension, dimension))
    sine = inverse(parameters, point, joints)  # of the linkage's fold: beyond ±1 the links do not reach there
    if not -1.0 <= sine <= 1.0:
        return 0.0
    if dimension == 2:
        kinematics2(parameters, joints, rates, position, velocity, jacobian, drift)
        dynamics2(parameters, joints, rates, inertia, drift)
    else:
        kinematics3(parameters, joints, rates, position, velocity, jacobian, drift)
        dynamics3(parameters, joints, rates, inertia, drift)
    mobility = 0.0  # n' J M⁻¹ J' n, 1/kg; M is diagonal
    for k in range(dimension):
        joint_normal = 0.0
        for i in range(dimension):
            joint_normal += jacobian[i, k] * normal[i]
        mobility += joint_normal * joint_normal / inertia[k, k]
    return 1.0 / mobility
