"""The simulated robot as hardware: the plant of closed loops behind encoders and motors."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.device import Device
from hapticeval.devices.imperfections import Imperfections
from hapticeval.errors import HapticevalError
from hapticeval.hardware.device import Reading
from hapticeval.hardware.wiring import Wiring
from hapticeval.stimulus.stimulus import Hand
from hapticeval.types import Array


class Twin:
    """A `HardwareDevice` that is a simulation: each `read` moves the robot on by one cycle of `dt` seconds.

    It starts at rest at `position` (N,), m, held by `hand`; encoders count as `wiring` says; of the `imperfections`
    torque limit, delay and friction are the robot's own. Without a network and a clock, so that runs can be repeated.
    """

    def __init__(
        self, wiring: Wiring, imperfections: Imperfections, *, position: Array, hand: Hand | None, dt: float
    ) -> None:
        self.wiring = wiring
        self.dt = dt
        self._plant = _Plant(wiring.device, imperfections, position, hand, dt)
        self._count = 0

    def read(self) -> Reading:
        """The encoders after one more cycle; the first time where it started."""
        if self._count:
            self._plant.advance((self._count - 1) * self.dt)
        self._count += 1
        raw = self.wiring.raw(self._plant.joints)
        return Reading(round((self._count - 1) * self.dt * 1e9), self._count, raw)

    def write(self, command: Array) -> None:
        """What the motors give from now on, once the delay has passed."""
        self._plant.command(self.wiring.torques(command))

    def close(self) -> None:
        """Nothing is held."""


class _Plant:
    """Joints, rates and the torques on their way, moved by the integrator of closed loops."""

    def __init__(
        self, device: Device, imperfections: Imperfections, position: Array, hand: Hand | None, dt: float
    ) -> None:
        from hapticeval.compiled import DYNAMICS, KINEMATICS, first_class
        from hapticeval.devices import dynamics_kernels as motion
        from hapticeval.devices.imperfections import actuation
        from hapticeval.devices.integration import control, default_method
        from hapticeval.devices.integration_kernels import advance

        count = device.dimension
        method = default_method()
        self._advance = advance
        self._kernels = (
            first_class(device.kernels.kinematics, KINEMATICS),
            first_class(device.kernels.dynamics, DYNAMICS),
            device.parameters,
        )
        self.device, self.hand, self.dt = device, hand, dt
        self.joints = np.array(device.joints(position), dtype=np.float64)
        self.rates = np.zeros(count)
        friction = imperfections.friction
        self._friction = None if friction is None else np.full(count, friction)
        self._grip = None if hand is None else np.array([hand.stiffness, hand.damping])
        motors = actuation(imperfections, dt)
        self._limit, ticks, self._rest = (np.inf, 0.0, 0.0) if motors is None else (float(each) for each in motors)
        self._line = [np.zeros(count) for _ in range(int(ticks) + 2)]
        self._settings = (method.table, control(method), np.array([dt]))
        self._scratch = (
            np.zeros((motion.ROWS, count)),
            np.empty((motion.SQUARES, count, count)),
            np.empty((method.b.size, count)),
        )
        self._move(self.joints.copy(), self.rates.copy(), 0.0, 0.0, dt, np.zeros(count))  # compiles, before time counts

    def command(self, torques: Array) -> None:
        """Put torques (N,), N m, behind those that the delay still holds back."""
        self._line[0] = np.clip(torques, -self._limit, self._limit)

    def advance(self, start: float) -> None:
        """One cycle from `start`, s."""
        self._move(self.joints, self.rates, start, 0.0, self._rest, self._line[-1])
        self._move(self.joints, self.rates, start, self._rest, self.dt, self._line[-2])
        if self.device.margin(self.joints) <= 0.0:
            raise HapticevalError(
                f"the simulated robot hit a joint limit: joints {np.round(self.joints, 4).tolist()} rad",
                todo="keep the hand's path inside the workspace: see hapticeval device",
            )
        self._line = [self._line[0].copy(), *self._line[:-1]]

    def _move(self, joints: Array, rates: Array, start: float, begin: float, finish: float, torque: Array) -> None:
        """From `begin` to `finish` seconds into the cycle that starts at `start`."""
        if finish <= begin:
            return
        path = None if self.hand is None else self.hand.desired(np.array([start, start + self.dt]))
        taken = self._advance(
            *self._kernels, joints, rates, begin, finish, self.dt, torque, None, path, self._grip, self._friction,
            *self._settings, *self._scratch,
        )  # fmt: skip
        if taken == 0 or not np.isfinite(joints).all():
            raise HapticevalError("the simulated robot ran away", why="its motors feed energy into it without end")
