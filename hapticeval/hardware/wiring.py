"""What a robot's raw numbers mean: encoder counts to joint angles, motor commands to torques, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hapticeval.devices.device import Device
from hapticeval.devices.imperfections import ENCODER_COUNTS
from hapticeval.errors import InputError
from hapticeval.types import Array


@dataclass(frozen=True, kw_only=True)
class Wiring:
    """How the parallelogram (or any other `device`) is wired.

    `counts_per_turn` of the encoders, None where the raw positions are radians already; `offsets` (N,) is the raw
    reading at joint angle zero, 0 where none is given; `directions` (N,) of +1 or -1 turn a raw step into a positive
    joint angle and a positive command into a positive torque; `torque_per_command` is what one unit of command gives
    (N m), 1 where commands are torques.

    Raises `InputError` for an entry that does not fit the device or is not finite.
    """

    device: Device
    counts_per_turn: float | None = ENCODER_COUNTS
    offsets: tuple[float, ...] = ()
    directions: tuple[int, ...] = ()
    torque_per_command: float = 1.0

    def __post_init__(self) -> None:
        count = self.device.dimension
        for name, default in (("offsets", 0.0), ("directions", 1)):
            given = getattr(self, name)
            values = tuple(given) or (default,) * count
            if len(values) != count or not all(math.isfinite(value) for value in values):
                raise InputError(
                    f"wiring: {name} = {given!r}",
                    why=f"the {self.device.name} has {count} joints, a finite number each",
                )
            object.__setattr__(self, name, values)
        if set(self.directions) - {1, -1}:
            raise InputError(f"wiring: directions = {self.directions!r}", todo="give 1 or -1 for each joint")
        for name, value in (("counts_per_turn", self.counts_per_turn), ("torque_per_command", self.torque_per_command)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise InputError(f"wiring: {name} = {value!r}", why="it must be finite and positive")

    @property
    def step(self) -> float:
        """Radians a raw unit."""
        return 1.0 if self.counts_per_turn is None else 2.0 * math.pi / self.counts_per_turn

    def joints(self, raw: Array) -> Array:
        """Joint angles (..., N), rad, from raw positions (..., N)."""
        turned: Array = np.asarray(self.directions) * (np.asarray(raw, dtype=np.float64) - np.array(self.offsets))
        return np.asarray(turned * self.step)

    def raw(self, joints: Array) -> Array:
        """Raw positions (..., N) from joint angles (..., N), rad; whole counts where there are counts."""
        turned = np.asarray(self.directions) * np.asarray(joints, dtype=np.float64)
        raw = np.asarray(turned / self.step + np.array(self.offsets))
        return raw if self.counts_per_turn is None else np.round(raw)

    def torques(self, commands: Array) -> Array:
        """Joint torques (..., N), N m, from motor commands (..., N)."""
        return np.asarray(self.directions * np.asarray(commands, dtype=np.float64) * self.torque_per_command)

    def commands(self, torques: Array) -> Array:
        """Motor commands (..., N) from joint torques (..., N), N m."""
        return np.asarray(self.directions * np.asarray(torques, dtype=np.float64) / self.torque_per_command)

    def hips(self, raw: Array) -> Array:
        """HIPs (n, N), m, from raw positions (n, N), by the forward kinematics (2.28)."""
        return np.array([self.device.position(joints) for joints in self.joints(raw)])

    def forces(self, raw: Array, commands: Array) -> Array:
        """Forces at the hand (n, N), N, from raw positions and motor commands (n, N): τ = Jᵀ F (2.6), (2.8).

        The static force that the motors put there: what moves or brakes the links themselves is not in it.
        """
        pairs = zip(self.joints(raw), self.torques(commands), strict=True)
        return np.array([np.linalg.solve(self.device.jacobian(joints).T, torques) for joints, torques in pairs])
