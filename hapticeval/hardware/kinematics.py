"""What joints and their rates are at the hand: as closed loops compute it, to the last bit."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.device import Device
from hapticeval.effects.velocity_filter import blend
from hapticeval.errors import DomainError
from hapticeval.types import Array

CUTOFF = 100.0
"""Hz of the low-pass of joint velocities: a count a tick of the robot's encoders is 24 mrad/s before it, 11 after."""


class Rates:
    """Joint velocities from joint positions: their difference through a first-order low-pass (2.6), from rest on."""

    def __init__(self, dimension: int, cutoff: float = CUTOFF) -> None:
        self.cutoff = cutoff
        self._before: Array | None = None
        self._rates = np.zeros(dimension)

    def after(self, elapsed: float, joints: Array) -> Array:
        """Velocities (N,), rad/s, at `joints` (N,), `elapsed` seconds after the ones before; zero the first time."""
        if self._before is not None:
            share = blend(self.cutoff, elapsed)
            self._rates = self._rates + share * ((joints - self._before) / elapsed - self._rates)
        self._before = joints
        return self._rates


class Kinematics:
    """A device's compiled kinematics, callable from Python a pose at a time."""

    def __init__(self, device: Device) -> None:
        from hapticeval.compiled import KINEMATICS, MARGIN, first_class

        self.device = device
        self._run = first_class(device.kernels.kinematics, KINEMATICS)
        self._margin = first_class(device.kernels.margin, MARGIN)
        self._parameters = device.parameters
        size = device.dimension
        self._jacobian, self._drift = np.empty((size, size)), np.empty(size)

    def hand(self, joints: Array, rates: Array) -> tuple[Array, Array]:
        """HIP (N,), m, and its velocity (N,), m/s, by (2.28) and (2.29)."""
        hip, velocity = np.empty_like(joints), np.empty_like(joints)
        self._run(self._parameters, joints, rates, hip, velocity, self._jacobian, self._drift)
        return hip, velocity

    def force(self, joints: Array, torques: Array) -> Array:
        """Force at the hand (N,), N, that joint torques (N,), N m, put there at rest: τ = Jᵀ F (2.8)."""
        self.hand(joints, np.zeros_like(joints))
        return np.asarray(np.linalg.solve(self._jacobian.T, torques), dtype=np.float64)

    def inside(self, joints: Array) -> bool:
        """Whether joints (N,) lie in the functional configuration space."""
        return bool(self._margin(self._parameters, joints) > 0.0)

    def check(self, joints: Array) -> None:
        """Raise `DomainError` for joints outside of the functional configuration space, naming the limit."""
        if self.inside(joints):
            return
        told = getattr(self.device, "check", None)
        if told is not None:
            told(joints)
        raise DomainError(
            f"the {self.device.name} is outside of its functional configuration space: joints {joints.tolist()}"
        )
