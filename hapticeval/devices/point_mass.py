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
    """A mass (kg) that moves freely in `dimension` N = 2 or 3: m y'' = F_r + F_o (2.23), (3.1).

    Its joints are its position (2.24).
    """

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
        from hapticeval.compiled import compiled_on_demand

        return CompiledDevice(*map(compiled_on_demand, (kinematics, dynamics, margin)))

    def position(self, joints: Array) -> Array:
        """Return where the hand is at `joints` (N,), m: there (2.24)."""
        return np.array(joints, dtype=np.float64)

    def joints(self, position: Array) -> Array:
        """Return the joints (N,), m, with which the hand is at `position` (N,), m: the position itself."""
        return np.array(position, dtype=np.float64)

    def jacobian(self, joints: Array) -> Array:
        """Return how the hand moves with the `joints` (N,), m: the identity (2.25), (N, N)."""
        return np.eye(self.dimension)

    def inertia(self, joints: Array) -> Array:
        """Return the inertia at `joints` (N,), m: the mass times the identity, (N, N), kg."""
        return self.mass * np.eye(self.dimension)

    def bias(self, joints: Array, rates: Array) -> Array:
        """Return the force that keeps `rates` (N,), m/s, at `joints` (N,), m: none (2.23), (N,), N."""
        return np.zeros(self.dimension)

    def limits(self, joints: Array) -> tuple[Limit, ...]:
        """Return no limits, whatever the `joints` (N,), m: its functional workspace is all of space."""
        return ()

    def margin(self, joints: Array) -> float:
        """Return infinity, whatever the `joints` (N,), m: it has no limits."""
        return math.inf

    def advance(
        self, position: Array, velocity: Array, force: Array, push: Array, next_push: Array, dt: float
    ) -> tuple[Array, Array]:
        """Return `position` (N,), m, and `velocity` (N,), m/s, after `dt` seconds under forces (N,), N.

        `force` (N,) is held (zero-order hold, thesis 2.6) and the operator's force runs straight from `push` to
        `next_push`, so that the motion is a cubic and this is its exact integral.
        """
        # the acceleration is linear in time: f / m over the tick, from (force + push) to (force + next_push)
        time_per_mass = dt / self.mass
        new_position = position + dt * velocity + (dt * time_per_mass / 6.0) * (3.0 * force + 2.0 * push + next_push)
        return new_position, velocity + time_per_mass * (force + 0.5 * (push + next_push))


def kinematics(
    parameters: Array, joints: Array, rates: Array, position: Array, velocity: Array, jacobian: Array, drift: Array
) -> None:
    """Write the hand's state of `joints` (N,), m, and `rates` (N,), m/s: its own, with J = I and J̇ q̇ = 0."""
    for i in range(joints.shape[0]):
        position[i], velocity[i], drift[i] = joints[i], rates[i], 0.0
        for j in range(joints.shape[0]):
            jacobian[i, j] = 1.0 if i == j else 0.0


def dynamics(parameters: Array, joints: Array, rates: Array, inertia: Array, bias: Array) -> None:
    """Write the inertia (N, N), kg, m I with the mass of `parameters` (1,), and the bias (N,), N, which is zero."""
    for i in range(joints.shape[0]):
        bias[i] = 0.0
        for j in range(joints.shape[0]):
            inertia[i, j] = parameters[0] if i == j else 0.0


def margin(parameters: Array, joints: Array) -> float:
    """Return infinity, whatever the `joints` (N,), m: there are no limits."""
    return math.inf
