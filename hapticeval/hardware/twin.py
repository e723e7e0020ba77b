"""The simulated robot as hardware: the plant of closed loops behind encoders and motors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hapticeval.devices.device import Device
from hapticeval.devices.integration import default_method
from hapticeval.effects.effect import Effect, Stage
from hapticeval.errors import HapticevalError
from hapticeval.hardware.device import Reading
from hapticeval.hardware.wiring import Wiring
from hapticeval.stimulus.stimulus import Hand
from hapticeval.types import Array


class Twin:
    """A `HardwareDevice` that is a simulation: each `read` moves the robot on by one cycle of `dt` seconds.

    It starts at rest at `position` (N,), m, held by `hand`; encoders count as `wiring` says; of the `effects`
    those of motors and joints are the robot's own. Without a network and a clock, so that runs can be repeated.
    """

    def __init__(
        self, wiring: Wiring, effects: Sequence[Effect], *, position: Array, hand: Hand | None, dt: float
    ) -> None:
        self.wiring = wiring
        self.dt = dt
        self._plant = _Plant(wiring.device, effects, position, hand, dt)
        self._count = 0

    def read(self) -> Reading:
        """The encoders after one more cycle; the first time where it started."""
        if self._count:
            self._plant.advance(self._count - 1)
        self._count += 1
        raw = self.wiring.raw(self._plant.joints)
        return Reading(round((self._count - 1) * self.dt * 1e9), self._count, raw)

    def write(self, command: Array) -> None:
        """What the motors give from now on, once the delay has passed."""
        self._plant.command(self.wiring.torques(command))

    def close(self) -> None:
        """Nothing is held."""


class _Plant:
    """Joints, rates and the torques of the motors, moved by the kernels of closed loops."""

    def __init__(
        self, device: Device, effects: Sequence[Effect], position: Array, hand: Hand | None, dt: float
    ) -> None:
        from hapticeval.compiled import specialised
        from hapticeval.devices.motion_kernels import Grip, Load, advance, motion_of
        from hapticeval.simulation.kernels import hook_of, take_part

        size = device.dimension
        parts = [(each.stage, each.part(0, size, dt)) for each in effects]
        friction = [part.params for stage, part in parts if stage is Stage.JOINTS]
        self.device, self.hand, self.dt = device, hand, dt
        self.joints = np.array(device.joints(position), dtype=np.float64)
        self.rates = np.zeros(size)
        self._grip = None if hand is None else Grip(np.empty((2, size)), np.array([hand.stiffness, hand.damping]))
        load = Load(dt, None, self._grip, np.sum(friction, axis=0) if friction else None)
        self._motion, self._advance = motion_of(device, load, default_method()), advance
        self._motors, self._take_part = hook_of(part for stage, part in parts if stage is Stage.COMMAND), take_part
        self._command, self._held, self._before = np.zeros(size), np.zeros(size), np.zeros(size)
        # Compile before time counts.
        specialised(take_part, self._motors, 0, dt, self._held, self._before)
        self._move(self.joints.copy(), self.rates.copy(), 0.0, 0.0, dt, np.zeros(size))

    def command(self, torques: Array) -> None:
        """Give the motors torques (N,), N m."""
        self._command[:] = torques

    def advance(self, cycle: int) -> None:
        """Move by one cycle, counted from 0."""
        start, dt = cycle * self.dt, self.dt
        self._held[:] = self._command
        switch = self._take_part(self._motors, cycle, dt, self._held, self._before)
        self._move(self.joints, self.rates, start, 0.0, switch, self._before)
        self._move(self.joints, self.rates, start, switch, dt, self._held)
        if self.device.margin(self.joints) <= 0.0:
            raise HapticevalError(
                f"the simulated robot hit a joint limit: joints {np.round(self.joints, 4).tolist()} rad",
                todo="keep the hand's path inside the workspace: see hapticeval device",
            )

    def _move(self, joints: Array, rates: Array, start: float, begin: float, finish: float, torque: Array) -> None:
        """From `begin` to `finish` seconds into the cycle that starts at `start`."""
        if finish <= begin:
            return
        if self.hand is not None and self._grip is not None:
            self._grip.path[:] = self.hand.desired(np.array([start, start + self.dt]))
        taken = self._advance(self._motion, 0, begin, finish, joints, rates, torque)
        if taken == 0 or not np.isfinite(joints).all():
            raise HapticevalError("the simulated robot ran away", why="its motors feed energy into it without end")
