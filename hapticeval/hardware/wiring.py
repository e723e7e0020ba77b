"""What a robot's raw numbers mean: encoder counts to joint angles and hand, motor commands to torques, and back.

A wiring stands in the `[device]` table of a TOML file: a mapping's, or one of its own. `load` reads a log of encoders
and motors by it, and adds what the raw numbers are at the hand.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.devices.catalogue import DEVICES, make_device, parameters_of
from hapticeval.devices.device import Device, checked_joints
from hapticeval.devices.parallelogram import MOTOR_TORQUE
from hapticeval.documents import read_toml
from hapticeval.effects.sensors import low_pass_share
from hapticeval.errors import DomainError, InputError, at
from hapticeval.recordings.channels import CHANNELS
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array

WIRING_ENTRIES = (
    "counts_per_turn", "offsets", "directions", "torque_per_command",
    "torque_limit", "force_limit", "soft_start", "speed_limit", "silent_cycles",
)  # fmt: skip
"""Entries of a `[device]` table that are the wiring's; the others but `kind` are the device's."""

FORCE_LIMIT = 10.0
"""N at the hand, *chosen*: what a finger holds for a while (a fingertip presses with 30 to 50 N at most), and more than
the 1.2 N that the thesis's motors give in any direction at the robot's home."""

SOFT_START = 0.5
"""s, *chosen*: three times as long as it takes to feel a force and to give way to it."""

SPEED_LIMIT = 5.0
"""m/s at the hand, *chosen*: above the 3.8 m/s at which the robot's damping holds the printed motors' peak torque (b̂ =
0.28 kg/s upwards, 1.06 N), and above the 2 to 3 m/s of a fast reach of an arm."""

SILENT_CYCLES = 100
"""Cycles, *chosen*: 0.1 s at 1 kHz. Ordinary systems hold up a program by some 10 ms; a hand of 0.2 m/s moves 20 mm."""
LEAST_SILENT_CYCLES = 4

VELOCITY_CUTOFF = 100.0
"""Hz of the low-pass of joint velocities: a count per tick of the robot's encoders is 24 mrad/s before it, 11 after."""


@dataclass(frozen=True, kw_only=True)
class Wiring:
    """What a robot's raw numbers mean: how encoder readings become joint angles, and torques motor commands.

    - `counts_per_turn`: of the encoders, None where the raw positions are radians already (or metres, of a device that
      slides).
    - `offsets`: (N,), the raw reading at joint angle zero, 0 where none is given.
    - `directions`: (N,), +1 or -1, turn a raw step into a positive joint angle and a positive command into a positive
      torque.
    - `torque_per_command`: what one unit of command gives (N m), 1 where commands are torques.

    And what keeps hand and motors from harm, see `hapticeval.hardware.safety`:

    - `torque_limit`: (N,), N m, of each motor, or one of all. Unless a user states the motors' own it is the peak that
      thesis A.1 prints, 0.368 N m, whose unit is doubtful; of a device that slides it is `force_limit`.
    - `force_limit`: N at the hand.
    - `soft_start`: s over which the force grows where a run begins in contact; 0 for none.
    - `speed_limit`: m/s; a hand that is faster from one reading to the next was misread.
    - `silent_cycles`: cycles without a reading after which the run ends.

    Raises `InputError` for an entry that does not fit the device or is not finite.
    """

    device: Device
    counts_per_turn: float | None = None
    offsets: tuple[float, ...] = ()
    directions: tuple[int, ...] = ()
    torque_per_command: float = 1.0
    torque_limit: tuple[float, ...] = ()
    force_limit: float = FORCE_LIMIT
    soft_start: float = SOFT_START
    speed_limit: float = SPEED_LIMIT
    silent_cycles: int = SILENT_CYCLES

    def __post_init__(self) -> None:
        if _number(self.torque_limit):
            object.__setattr__(self, "torque_limit", (self.torque_limit,) * self.device.dimension)
        motor = MOTOR_TORQUE if self.device.turning else self.force_limit
        for name, default in (("offsets", 0.0), ("directions", 1), ("torque_limit", motor)):
            object.__setattr__(self, name, self._of_each_joint(name, default))
        if set(self.directions) - {1, -1}:
            raise InputError(f"wiring: directions = {self.directions!r}", todo="give 1 or -1 for each joint")
        for name in ("counts_per_turn", "torque_per_command", "force_limit", "speed_limit", "silent_cycles"):
            value = getattr(self, name)
            if value is not None and not (_number(value) and value > 0.0):
                raise InputError(f"wiring: {name} = {value!r}", why="it must be a number, finite and positive")
        if self.silent_cycles < LEAST_SILENT_CYCLES:
            raise InputError(
                f"wiring: silent_cycles = {self.silent_cycles!r}", why=f"fewer than {LEAST_SILENT_CYCLES} are ordinary"
            )
        if not min(self.torque_limit) > 0.0:
            raise InputError(f"wiring: torque_limit = {self.torque_limit!r}", why="each must be positive")
        if not (_number(self.soft_start) and self.soft_start >= 0.0):
            raise InputError(f"wiring: soft_start = {self.soft_start!r}", why="it must be seconds, 0 or more")

    def _of_each_joint(self, name: str, default: float) -> tuple[float, ...]:
        """Return entry `name` as one finite number a joint, `default` where none is given."""
        entry, count = getattr(self, name), self.device.dimension
        values = tuple(entry) if isinstance(entry, list | tuple) else (entry,)
        # An empty entry is one that was not given.
        values = values or (default,) * count
        if len(values) != count or not all(map(_number, values)):
            raise InputError(
                f"wiring: {name} = {entry!r}", why=f"the {self.device.name} has {count} joints, a finite number each"
            )
        return values

    @classmethod
    def described(cls, table: Mapping[str, Any]) -> Wiring:
        """Return the wiring of a `[device]` table, as mappings and `hapticeval record --wiring` have it.

        `kind` is the device, `WIRING_ENTRIES` are the wiring's, and all others override the device's own parameters,
        those of Table A.1. Raises `UnknownNameError` and `InputError` for what neither has.
        """
        if not isinstance(table.get("kind"), str):
            raise InputError("[device] lacks its kind", todo='write for instance kind = "parallelogram-2dof"')
        own = {name: table[name] for name in WIRING_ENTRIES if name in table}
        return cls(device=make_device(**{name: table[name] for name in table if name not in WIRING_ENTRIES}), **own)

    def description(self) -> dict[str, Any]:
        """Return the `[device]` table that `described` makes this wiring of."""
        # Some devices keep their parameters in a table of constants, others as attributes.
        constants = getattr(self.device, "constants", self.device)
        known = {
            name: getattr(constants, name, getattr(self.device, name, None)) for name in parameters_of(self.device.name)
        }
        return {
            "kind": self.device.name,
            **({} if self.counts_per_turn is None else {"counts_per_turn": self.counts_per_turn}),
            "offsets": list(self.offsets),
            "directions": list(self.directions),
            "torque_per_command": self.torque_per_command,
            "torque_limit": list(self.torque_limit),
            **{name: getattr(self, name) for name in ("force_limit", "soft_start", "speed_limit", "silent_cycles")},
            **{name: str(value) if isinstance(value, str) else value for name, value in known.items()},
        }

    @property
    def step(self) -> float:
        """Radians per raw unit."""
        return 1.0 if self.counts_per_turn is None else 2.0 * math.pi / self.counts_per_turn

    def joints(self, raw: Array) -> Array:
        """Return joint angles (..., N), rad, from raw positions (..., N)."""
        # q = direction (raw - offset) step, rad.
        turned: Array = np.asarray(self.directions) * (np.asarray(raw, dtype=np.float64) - np.array(self.offsets))
        return np.asarray(turned * self.step)

    def raw(self, joints: Array) -> Array:
        """Return raw positions (..., N) from joint angles (..., N), rad; whole counts where there are counts."""
        turned = np.asarray(self.directions) * np.asarray(joints, dtype=np.float64)
        # The inverse, raw = direction q / step + offset; an encoder has whole counts.
        raw = np.asarray(turned / self.step + np.array(self.offsets))
        return raw if self.counts_per_turn is None else np.rint(raw)

    def torques(self, commands: Array) -> Array:
        """Return joint torques (..., N), N m, from motor commands (..., N)."""
        return np.asarray(
            np.asarray(self.directions) * np.asarray(commands, dtype=np.float64) * self.torque_per_command
        )

    def commands(self, torques: Array) -> Array:
        """Return motor commands (..., N) from joint torques (..., N), N m."""
        # A direction is 1 or -1, and so its own inverse.
        turned = np.asarray(self.directions) * np.asarray(torques, dtype=np.float64)
        return np.asarray(turned / self.torque_per_command)


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def read_wiring(path: Path) -> Wiring:
    """Return the wiring in a TOML file. Raises `InputError`, naming the file, for one that has none or a wrong one."""
    table = read_toml(path).get("device")
    if not isinstance(table, dict):
        raise InputError(f"{path.name} has no table [device]", todo='write for instance [device], and kind = "..."')
    with at(f"{path.name}: [device]"):
        return Wiring.described(table)


class Rates:
    """Joint velocities from differences of positions, through a first-order low-pass, from rest on (Section 2.6)."""

    def __init__(self, dimension: int) -> None:
        self._before: Array | None = None
        self._rates = np.zeros(dimension)

    def after(self, elapsed: float, joints: Array) -> Array:
        """Return velocities (N,), rad/s, at `joints` (N,), `elapsed` s after the ones before; zero the first time."""
        if self._before is not None:
            # v + share (dq / dt - v): the low-pass takes this share of the newest difference, more after a longer step.
            share = low_pass_share(VELOCITY_CUTOFF, elapsed)
            self._rates = self._rates + share * ((joints - self._before) / elapsed - self._rates)
        self._before = joints
        return self._rates


class Kinematics:
    """A device's compiled kinematics, callable from Python pose by pose: as closed loops compute them, bit for bit."""

    def __init__(self, device: Device) -> None:
        from hapticeval.compiled import first_class
        from hapticeval.laws import KINEMATICS, MARGIN

        self.device = device
        self._run = first_class(device.kernels.kinematics, KINEMATICS)
        self._margin = first_class(device.kernels.margin, MARGIN)
        self._parameters = device.parameters
        size = device.dimension
        self._jacobian, self._drift = np.empty((size, size)), np.empty(size)

    def hand(self, joints: Array, rates: Array) -> tuple[Array, Array]:
        """Return the HIP (N,), m, and its velocity (N,), m/s, by (2.28) and (2.29)."""
        hip, velocity = np.empty_like(joints), np.empty_like(joints)
        # Fills hip, velocity and the Jacobian, in the order of the kernels' signature.
        self._run(self._parameters, joints, rates, hip, velocity, self._jacobian, self._drift)
        return hip, velocity

    def reach(self) -> float:
        """Return how far a radian in every joint moves the hand at the pose of the last `hand`, m, at the most."""
        return float(np.sum(np.linalg.norm(self._jacobian, axis=0)))

    def force(self, joints: Array, torques: Array) -> Array:
        """Return the force at the hand (N,), N, that joint torques (N,), N m, put there at rest: τ = Jᵀ F (2.8)."""
        self.hand(joints, np.zeros_like(joints))
        # F = J^-T tau.
        return np.asarray(np.linalg.solve(self._jacobian.T, torques), dtype=np.float64)

    def inside(self, joints: Array) -> bool:
        """Return whether joints (N,) lie in the functional configuration space."""
        return bool(self._margin(self._parameters, joints) > 0.0)

    def check(self, joints: Array) -> None:
        """Raise `DomainError` for joints (N,), rad, outside of the functional configuration space, naming the limit."""
        if self.inside(joints):
            return
        # Raises with the limit that is passed; what is left is a device that names none.
        checked_joints(self.device, joints)
        raise DomainError(
            f"the {self.device.name} is outside of its functional configuration space: joints {joints.tolist()}"
        )


OUTSIDE_WORKSPACE = "outside of the robot's workspace"


def at_the_hand(recording: Recording) -> Recording:
    """Add joint angles, HIP, velocity and force to a log of encoders and motors, where they are not in it.

    - Joint angles are `joint_position`, else what the wiring of `meta["device_parameters"]` makes of `raw`; torques are
      `joint_torque`, or of `command`.
    - Where there is no `hip`, it is added by the forward kinematics (2.28), with its `velocity` by `Rates`.
    - Where there is no `force`, the static one that the torques put at the hand is added, τ = Jᵀ F (2.8): what moves or
      brakes the links themselves is not in it.

    A recording that has a HIP, or no joints of a known device, is given back as it is. Rows with joints outside of the
    functional configuration space, where none of this holds, are kept and not valid; `meta["import"]` counts them.
    Raises `InputError` for a wiring that does not fit, and where every row is outside.
    """
    kind = recording.meta.get("device")
    # A HIP that was logged is never computed anew.
    if "hip" in recording.channels or kind not in DEVICES or not {"raw", "joint_position"} & recording.channels.keys():
        return recording
    parameters = recording.meta.get(
        "device_parameters", {}
    )  # `hardware` in it is neither the wiring's nor the device's
    table = {name: value for name, value in parameters.items() if name != "hardware" and value is not None}
    with at("[device]"):
        wiring = Wiring.described({**table, "kind": kind})
    joint_channels = _joints(recording, wiring)
    hand, outside = _hand(recording, wiring, joint_channels)
    # Outside of the functional configuration space the kinematics do not hold.
    valid = recording.measured & ~outside
    if not valid.any():
        first_angles = joint_channels["joint_position"][0]
        raise InputError(
            "every row of the log is outside of the robot's functional workspace",
            why=f"at row 0 the joints would be {', '.join(f'{angle:.6g}' for angle in first_angles)} rad",
            todo="check [device]: offsets, directions and counts_per_turn",
        )
    added = {name: values for name, values in {**joint_channels, **hand}.items() if name not in recording.channels}
    channels = {**recording.channels, **added}
    # The recording states of each added channel where it comes from.
    static = "static: J^-T of the joint torques"
    signs = {name: static if name == "force" else "by [device]" for name in added}
    signals = {**recording.signals, **{name: CHANNELS[name]._replace(sign=sign) for name, sign in signs.items()}}
    return replace(recording, channels=channels, signals=signals, valid=valid, meta=_counted(recording.meta, outside))


def _joints(recording: Recording, wiring: Wiring) -> dict[str, Array]:
    """Return angles (n, N), rad, and torques (n, N), N m, where they are known."""
    channels, size = {}, wiring.device.dimension
    for name, raw, to_joints in (("joint_position", "raw", wiring.joints), ("joint_torque", "command", wiring.torques)):
        # Logged joints come before raw ones: the device may have calibrated them itself.
        source = name if name in recording.channels else raw
        if source in recording.channels:
            values = recording.channels[source]
            if values.shape[1:] != (size,):
                raise InputError(
                    f"'{source}' has {values.shape[-1]} columns", why=f"the {wiring.device.name} has {size} joints"
                )
            channels[name] = values if source == name else to_joints(values)
    return channels


def _hand(recording: Recording, wiring: Wiring, joint_channels: Mapping[str, Array]) -> tuple[dict[str, Array], Any]:
    """Return HIP, velocity and, where torques are known, force, NaN where a row is not valid; and the rows outside."""
    kinematics, rates, before = Kinematics(wiring.device), Rates(wiring.device.dimension), 0.0
    joints, torques = np.array(joint_channels["joint_position"]), joint_channels.get("joint_torque")
    names = ("hip", "velocity") if torques is None else ("hip", "velocity", "force")
    hand = {name: np.full_like(joints, np.nan) for name in names}
    outside = np.zeros(len(recording), dtype=bool)
    for row in np.flatnonzero(recording.measured):
        if not kinematics.inside(joints[row]):
            outside[row] = True
            continue
        # Only valid rows count: a velocity is taken over the time since the last of them.
        now = float(recording.time[row])
        speeds = rates.after(now - before, joints[row])
        before = now
        hand["hip"][row], hand["velocity"][row] = kinematics.hand(joints[row], speeds)
        if torques is not None:
            # Static: tau = J^T F (2.8) solved for F, without inertia and friction of the links.
            hand["force"][row] = kinematics.force(joints[row], torques[row])
    return hand, outside


def _counted(meta: Mapping[str, Any], outside: Any) -> Mapping[str, Any]:
    """Return `meta` with the number of rows `outside` (n,) of the workspace, beside what the import left out."""
    count = int(np.sum(outside))
    if not count:
        return meta
    notes = meta.get("import", {})
    return {**meta, "import": {**notes, "left out": {**notes.get("left out", {}), OUTSIDE_WORKSPACE: count}}}
