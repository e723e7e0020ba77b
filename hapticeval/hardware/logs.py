"""Logs of a robot's encoders and motors as recordings: what its raw numbers are at the hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.devices.catalogue import DEVICES
from hapticeval.errors import InputError, at
from hapticeval.hardware.wiring import Kinematics, Rates, Wiring
from hapticeval.recordings.channels import CHANNELS
from hapticeval.recordings.importing import convert
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array

OUTSIDE_WORKSPACE = "outside of the robot's workspace"


def load(
    path: Path | str,
    *,
    mapping: Path | str | None = None,
    format: str | None = None,
    trial: str | None = None,
    salvaging: bool = False,
) -> Recording:
    """Return what `convert.load` gives, with what follows from a robot's encoders and motors: see `at_the_hand`."""
    return at_the_hand(convert.load(path, mapping=mapping, format=format, trial=trial, salvaging=salvaging))


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
