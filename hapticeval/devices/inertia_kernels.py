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
    """Return what `device.apparent_mass` does, kg, for a parallelogram; zero where it does not reach.

    Its inertia is diagonal.
    """
    size = point.shape[0]
    rows = np.zeros((5, size))
    joints, rates, position, velocity, drift = rows[0], rows[1], rows[2], rows[3], rows[4]
    jacobian, inertia = np.zeros((size, size)), np.zeros((size, size))
    sine = inverse(parameters, point, joints)
    if not -1.0 <= sine <= 1.0:
        return 0.0
    if size == 2:
        kinematics2(parameters, joints, rates, position, velocity, jacobian, drift)
        dynamics2(parameters, joints, rates, inertia, drift)
    else:
        kinematics3(parameters, joints, rates, position, velocity, jacobian, drift)
        dynamics3(parameters, joints, rates, inertia, drift)
    mobility = 0.0
    for k in range(size):
        along = 0.0
        for i in range(size):
            along += jacobian[i, k] * normal[i]
        mobility += along * along / inertia[k, k]
    return 1.0 / mobility
