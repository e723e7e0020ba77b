"""The ideal point-mass robot of section 2.5.5: a mass, pushed by the renderer and by the operator."""

# ruff: noqa: ARG001, ARG002 - every device has these arguments

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hapticeval.devices.device import CompiledDevice, Limit
from hapticeval.types import Array


@dataclass(frozen=True)
class PointMass:
    """m y'' = F_r + F_o (2.23), (3.1) in `dimension` N = 2 or 3; `mass` in kg. Its joints are its position (2.24)."""

    mass: float
    dimension: int = 2

    name = "point-mass"
    turning = False

    @property
    def parameters(self) -> Array:
        """The mass."""
        return np.array([self.mass])

    @property
    def kernels(self) -> CompiledDevice:
        """For compiled loops."""
        from hapticeval.compiled import compiled_once

        return CompiledDevice(*map(compiled_once, (kinematics, dynamics, margin)))

    def position(self, joints: Array) -> Array:
        """The joints themselves, (N,), m."""
        return np.array(joints, dtype=np.float64)

    def joints(self, position: Array) -> Array:
        """The position itself, (N,), m."""
        return np.array(position, dtype=np.float64)

    def jacobian(self, joints: Array) -> Array:
        """The identity (2.25), (N, N)."""
        return np.eye(self.dimension)

    def inertia(self, joints: Array) -> Array:
        """m I, (N, N), kg."""
        return self.mass * np.eye(self.dimension)

    def bias(self, joints: Array, rates: Array) -> Array:
        """Zero (2.23), (N,), N."""
        return np.zeros(self.dimension)

    def limits(self, joints: Array) -> tuple[Limit, ...]:
        """None: its functional workspace is all of space."""
        return ()

    def margin(self, joints: Array) -> float:
        """Infinite: it has no limits."""
        return math.inf

    def advance(
        self, position: Array, velocity: Array, force: Array, push: Array, next_push: Array, dt: float
    ) -> tuple[Array, Array]:
        """Position (N,), m, and velocity (N,), m/s, after `dt` seconds.

        `force` (N,) is held (zero-order hold, thesis 2.6) and the operator's force runs straight from `push` to
        `next_push`, so that the motion is a cubic and this is its exact integral.
        """
        gain = dt / self.mass
        new_position = position + dt * velocity + (dt * gain / 6.0) * (3.0 * force + 2.0 * push + next_push)
        return new_position, velocity + gain * (force + 0.5 * (push + next_push))


def kinematics(
    parameters: Array, joints: Array, rates: Array, position: Array, velocity: Array, jacobian: Array, drift: Array
) -> None:
    """Position is the joints, J the identity, J̇ rates zero."""
    for i in range(joints.shape[0]):
        position[i], velocity[i], drift[i] = joints[i], rates[i], 0.0
        for j in range(joints.shape[0]):
            jacobian[i, j] = 1.0 if i == j else 0.0


def dynamics(parameters: Array, joints: Array, rates: Array, inertia: Array, bias: Array) -> None:
    """M = m I, no bias."""
    for i in range(joints.shape[0]):
        bias[i] = 0.0
        for j in range(joints.shape[0]):
            inertia[i, j] = parameters[0] if i == j else 0.0


def margin(parameters: Array, joints: Array) -> float:
    """Infinite."""
    return math.inf
