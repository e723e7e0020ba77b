"""What a robot's raw numbers mean: encoder counts to joint angles, motor commands to torques, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticeval.devices.catalogue import make_device, parameters_of
from hapticeval.devices.device import Device
from hapticeval.errors import InputError
from hapticeval.types import Array

OWN = ("counts_per_turn", "offsets", "directions", "torque_per_command")
"""Entries of a `[device]` table that are the wiring's; the others but `kind` are the device's."""


@dataclass(frozen=True, kw_only=True)
class Wiring:
    """How the parallelogram (or any other `device`) is wired.

    `counts_per_turn` of the encoders, None where the raw positions are radians already (or metres, of a device that
    slides); `offsets` (N,) is the raw reading at joint angle zero, 0 where none is given; `directions` (N,) of +1 or
    -1 turn a raw step into a positive joint angle and a positive command into a positive torque; `torque_per_command`
    is what one unit of command gives (N m), 1 where commands are torques.

    Raises `InputError` for an entry that does not fit the device or is not finite.
    """

    device: Device
    counts_per_turn: float | None = None
    offsets: tuple[float, ...] = ()
    directions: tuple[int, ...] = ()
    torque_per_command: float = 1.0

    def __post_init__(self) -> None:
        for name, default in (("offsets", 0.0), ("directions", 1)):
            object.__setattr__(self, name, self._of_each_joint(name, default))
        if set(self.directions) - {1, -1}:
            raise InputError(f"wiring: directions = {self.directions!r}", todo="give 1 or -1 for each joint")
        for name, value in (("counts_per_turn", self.counts_per_turn), ("torque_per_command", self.torque_per_command)):
            if value is not None and not (_number(value) and value > 0.0):
                raise InputError(f"wiring: {name} = {value!r}", why="it must be a number, finite and positive")

    def _of_each_joint(self, name: str, default: float) -> tuple[float, ...]:
        given, count = getattr(self, name), self.device.dimension
        values = tuple(given) if isinstance(given, list | tuple) else (given,)
        values = values or (default,) * count
        if len(values) != count or not all(map(_number, values)):
            raise InputError(
                f"wiring: {name} = {given!r}", why=f"the {self.device.name} has {count} joints, a finite number each"
            )
        return values

    @classmethod
    def described(cls, table: Mapping[str, Any]) -> Wiring:
        """The wiring of a `[device]` table, as mappings and `hapticeval record --wiring` have it.

        `kind` is the device, `OWN` entries are the wiring's, and all others override the device's own parameters, those
        of Table A.1. Raises `UnknownNameError` and `InputError` for what neither has.
        """
        if not isinstance(table.get("kind"), str):
            raise InputError("[device] lacks its kind", todo='write for instance kind = "parallelogram-2dof"')
        own = {name: table[name] for name in OWN if name in table}
        rest = {name: value for name, value in table.items() if name not in OWN and name != "kind"}
        return cls(device=make_device(table["kind"], **rest), **own)

    def description(self) -> dict[str, Any]:
        """The `[device]` table that `described` makes this wiring of."""
        constants = {name: getattr(self.device, name, None) for name in parameters_of(self.device.name)}
        known = getattr(self.device, "constants", None)
        constants |= {} if known is None else {name: getattr(known, name) for name in type(known).__dataclass_fields__}
        own = {"offsets": list(self.offsets), "directions": list(self.directions)}
        counts = {} if self.counts_per_turn is None else {"counts_per_turn": self.counts_per_turn}
        told = {"kind": self.device.name, **counts, **own, "torque_per_command": self.torque_per_command}
        return told | {name: str(value) if isinstance(value, str) else value for name, value in constants.items()}

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
        return raw if self.counts_per_turn is None else np.rint(raw)

    def torques(self, commands: Array) -> Array:
        """Joint torques (..., N), N m, from motor commands (..., N)."""
        return np.asarray(
            np.asarray(self.directions) * np.asarray(commands, dtype=np.float64) * self.torque_per_command
        )

    def commands(self, torques: Array) -> Array:
        """Motor commands (..., N) from joint torques (..., N), N m."""
        turned = np.asarray(self.directions) * np.asarray(torques, dtype=np.float64)
        return np.asarray(turned / self.torque_per_command)


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
