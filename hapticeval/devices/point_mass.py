"""The ideal point-mass robot of section 2.5.5: a mass, pushed by the renderer and by the operator."""

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
        from hapticeval.devices import point_mass_kernels as kernels

        return CompiledDevice(kernels.kinematics, kernels.dynamics, kernels.margin)

    def position(self, joints: Array) -> Array:
        """The joints themselves, (N,), m."""
        return np.array(joints, dtype=np.float64)

    def joints(self, position: Array) -> Array:
        """The position itself, (N,), m."""
        return np.array(position, dtype=np.float64)

    def jacobian(self, joints: Array) -> Array:  # noqa: ARG002 - the protocol's
        """The identity (2.25), (N, N)."""
        return np.eye(self.dimension)

    def inertia(self, joints: Array) -> Array:  # noqa: ARG002 - the protocol's
        """m I, (N, N), kg."""
        return self.mass * np.eye(self.dimension)

    def bias(self, joints: Array, rates: Array) -> Array:  # noqa: ARG002 - the protocol's
        """Zero (2.23), (N,), N."""
        return np.zeros(self.dimension)

    def limits(self, joints: Array) -> tuple[Limit, ...]:  # noqa: ARG002 - the protocol's
        """None: its functional workspace is all of space."""
        return ()

    def margin(self, joints: Array) -> float:  # noqa: ARG002 - the protocol's
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
