"""Logs of a robot's encoders and motors as recordings: what its raw numbers are at the hand."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.devices.catalogue import DEVICES
from hapticeval.errors import HapticevalError, InputError
from hapticeval.hardware.kinematics import Kinematics, Rates
from hapticeval.hardware.wiring import Wiring
from hapticeval.recordings.channels import CHANNELS
from hapticeval.recordings.importing import convert
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array, BoolArray

BESIDE = ("hardware",)
"""Entries of `meta["device_parameters"]` that are neither the wiring's nor the device's."""

OUTSIDE = "outside of the robot's workspace"


def load(
    path: Path | str, *, mapping: Path | str | None = None, format: str | None = None, salvaging: bool = False
) -> Recording:
    """`convert.load`, with what follows from a robot's encoders and motors: see `at_the_hand`."""
    return at_the_hand(convert.load(path, mapping=mapping, format=format, salvaging=salvaging))


def at_the_hand(recording: Recording) -> Recording:
    """A recording with the joints and the hand that its raw channels and its device mean, where it lacks them.

    Joint angles are `joint_position`, else what the wiring of `meta["device_parameters"]` makes of `raw`; torques
    `joint_torque`, or of `command`. Where there is no `hip`, it is added by the forward kinematics (2.28), with its
    `velocity` by `Rates`; where there is no `force`, the static one that the torques put at the hand, τ = Jᵀ F (2.8):
    what moves or brakes the links themselves is not in it.

    A recording that has a HIP, or no joints of a known device, is given back as it is. Rows with joints outside of the
    functional configuration space, where none of this holds, are kept and not valid; `meta["import"]` counts them.
    Raises `InputError` for a wiring that does not fit, and where every row is outside.
    """
    kind = recording.meta.get("device")
    if "hip" in recording.channels or kind not in DEVICES or not {"raw", "joint_position"} & recording.channels.keys():
        return recording
    wiring = _wiring(str(kind), recording.meta.get("device_parameters", {}))
    found = _joints(recording, wiring)
    size = wiring.device.dimension
    for name, values in found.items():
        if values.shape[1:] != (size,):
            raise InputError(
                f"'{name}' has {values.shape[-1]} columns", why=f"the {wiring.device.name} has {size} joints"
            )
    valid = recording.measured.copy()
    kinematics = Kinematics(wiring.device)
    outside = _outside(kinematics, found["joint_position"], valid)
    valid &= ~outside
    if not valid.any():
        raise InputError(
            "every row of the log is outside of the robot's functional workspace",
            why=f"at row 0 the joints would be {found['joint_position'][0].tolist()} rad",
            todo="see [device]: offsets, directions and counts_per_turn",
        )
    hand = _hand(recording, kinematics, found, valid)
    channels = {**recording.channels, **found, **{k: v for k, v in hand.items() if k not in recording.channels}}
    static = "static: J^-T of the joint torques"
    signals = {**recording.signals}
    for name in channels.keys() - signals.keys():
        signals[name] = CHANNELS[name]._replace(sign=static if name == "force" else "as [device] says")
    return Recording(
        recording.time, channels, _told(recording.meta, outside), clock=recording.clock, valid=valid, signals=signals,
        events=recording.events,
    )  # fmt: skip


def _wiring(kind: str, parameters: Mapping[str, Any]) -> Wiring:
    table = {name: value for name, value in parameters.items() if name not in BESIDE and value is not None}
    try:
        return Wiring.described({"kind": kind, **table})
    except HapticevalError as error:
        raise InputError(f"[device]: {error.what}", why=error.why, todo=error.todo) from error


def _joints(recording: Recording, wiring: Wiring) -> dict[str, Array]:
    """Angles, and torques where they are known."""
    found = {}
    for name, raw, made in (("joint_position", "raw", wiring.joints), ("joint_torque", "command", wiring.torques)):
        if name in recording.channels:
            found[name] = recording.channels[name]
        elif raw in recording.channels:
            given = recording.channels[raw]
            if given.shape[1] != wiring.device.dimension:
                raise InputError(
                    f"'{raw}' has {given.shape[1]} columns",
                    why=f"the {wiring.device.name} has {wiring.device.dimension} joints",
                )
            found[name] = made(given)
    return found


def _outside(kinematics: Kinematics, joints: Array, valid: BoolArray) -> BoolArray:
    outside = np.zeros_like(valid)
    for row in np.flatnonzero(valid):
        outside[row] = not kinematics.inside(np.ascontiguousarray(joints[row]))
    return outside


def _hand(
    recording: Recording, kinematics: Kinematics, found: Mapping[str, Array], valid: BoolArray
) -> dict[str, Array]:
    """HIP, velocity and, of torques, force; NaN where a row is not valid."""
    joints = np.array(found["joint_position"])
    torques = found.get("joint_torque")
    hand = {name: np.full_like(joints, np.nan) for name in ("hip", "velocity")}
    if torques is not None:
        hand["force"] = np.full_like(joints, np.nan)
    rates, before = Rates(joints.shape[1]), 0.0
    for row in np.flatnonzero(valid):
        now = float(recording.time[row])
        speeds = rates.after(now - before, joints[row])
        before = now
        hand["hip"][row], hand["velocity"][row] = kinematics.hand(joints[row], speeds)
        if torques is not None:
            hand["force"][row] = kinematics.force(joints[row], torques[row])
    return hand


def _told(meta: Mapping[str, Any], outside: BoolArray) -> Mapping[str, Any]:
    count = int(np.sum(outside))
    if not count:
        return meta
    notes = meta.get("import", {})
    return {**meta, "import": {**notes, "left out": {**notes.get("left out", {}), OUTSIDE: count}}}
