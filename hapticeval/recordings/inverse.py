"""Whether the channels of a recording follow from each other: kinematics, torques, the spring, the surface."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Protocol

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings.finding import Fault, Severity
from hapticeval.recordings.grain import grain
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array, BoolArray

QUANTA = 3.0
"""Residuals of so many quanta still come from encoders: one each for rounding, filtering and a tick of lag.

A quantum is what the numbers of all channels involved can tell: see `grain`.
"""

ROUNDING = 1e-9
"""Share of the signal's size that computing in double precision may cost over a chain of transformations."""


class Kinematics(Protocol):
    """What is read of a device: see `hapticeval.devices.Device`."""

    def position(self, joints: Array) -> Array:
        """Forward kinematics (2.3), (N,), m."""

    def jacobian(self, joints: Array) -> Array:
        """dw/dq (2.4), (N, N)."""


def forward_kinematics(recording: Recording, device: Kinematics) -> list[Fault]:
    """The HIP against the forward kinematics of the joints (2.28); residual in m and in quanta of the encoders."""
    if not {"hip", "joint_position"} <= recording.channels.keys():
        return []
    rows = _rows(recording)
    joints = recording.channels["joint_position"][rows]
    expected = _each(device.position, joints)
    reach = max(float(np.abs(_each(device.jacobian, joints)).sum(axis=2).max()), 0.0)
    residual = np.linalg.norm(recording.hip[rows] - expected, axis=1)
    step = reach * _step(joints.T) + _step(recording.hip[rows].T)
    return _residual(
        recording, rows, residual, step, "forward kinematics", "hip", "m",
        "see zero offsets, directions and lengths of the device, and the frame of the HIP",
    )  # fmt: skip


def transposed_jacobian(recording: Recording, device: Kinematics) -> list[Fault]:
    """The joint torques against J^T F (2.8), F being the force on the hand; residual in N m.

    A loop that adds the device's own dynamics (2.11) has more torque than that: the residual is told, not judged,
    where it is no rounding.
    """
    if not {"joint_position", "joint_torque", "force"} <= recording.channels.keys():
        return []
    rows = _rows(recording)
    jacobians = _each(device.jacobian, recording.channels["joint_position"][rows])
    expected = np.einsum("nij,ni->nj", jacobians, recording.force[rows])
    residual = np.linalg.norm(recording.channels["joint_torque"][rows] - expected, axis=1)
    lever = max(float(np.abs(jacobians).sum(axis=1).max()), 0.0)
    step = _step(recording.channels["joint_torque"][rows].T) + lever * _step(recording.force[rows].T)
    return _residual(
        recording, rows, residual, step, "torque", "joint_torque", "N m",
        "see the signs of motors and force; an inner loop that adds its own dynamics differs too",
    )  # fmt: skip


def spring(recording: Recording, stiffness: float) -> list[Fault]:
    """F = K_p (IHIP - HIP) of (6.1), where there is no damping: residual in N, and the stiffness that fits best."""
    if not {"hip", "ihip", "force"} <= recording.channels.keys():
        return []
    rows = _rows(recording)
    reach = recording.ihip[rows] - recording.hip[rows]
    force = recording.force[rows]
    residual = np.linalg.norm(force - stiffness * reach, axis=1)
    step = stiffness * (_step(recording.hip[rows].T) + _step(recording.ihip[rows].T)) + _step(force.T)
    faults = _residual(
        recording, rows, residual, step, "spring", "force", "N",
        "see the stiffness, the sign of the force, and whether all three were logged in the same tick",
        size=float(np.max(np.abs(force), initial=0.0)),
    )  # fmt: skip
    square = float(np.sum(reach * reach))
    if faults and square > 0.0:
        fitted = float(np.sum(force * reach)) / square
        words = f"; {fitted:.6g} N/m fits best, {stiffness:.6g} N/m is declared"
        faults = [
            replace(fault, message=fault.message + words, measures={**fault.measures, "stiffness": fitted})
            for fault in faults
        ]
    return faults


def on_the_model(recording: Recording, model: Model) -> list[Fault]:
    """The IHIP in contact against the model's boundary; residual in m. What the renderer declares of its own
    representation is allowed."""
    if "ihip" not in recording.channels or "hip" not in recording.channels:
        return []
    rows = _rows(recording)
    apart = np.linalg.norm(recording.ihip[rows] - recording.hip[rows], axis=1)
    rows = rows[apart > 1e-6 * float(np.max(np.abs(recording.hip[rows]), initial=0.0))]
    if rows.size == 0:
        return []
    residual = np.abs(model.boundary.frame(recording.ihip[rows]).distance)
    step = _step(recording.ihip[rows].T)
    allowed = step + (recording.standoff + recording.resolution) / QUANTA
    return _residual(
        recording, rows, residual, allowed, "surface", "ihip", "m",
        "see the model and its frame; a renderer with a coarser representation declares its resolution",
        size=model.size,
    )  # fmt: skip


def _step(columns: Iterable[Array]) -> float:
    """The coarsest grain of the columns."""
    return max((grain(column) for column in columns), default=0.0)


def _rows(recording: Recording) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    return np.arange(len(recording)) if recording.valid is None else np.flatnonzero(recording.valid)


def _each(function: Callable[[Array], Array], joints: Array) -> Array:
    return np.array([function(row) for row in joints])


def _residual(
    recording: Recording,
    rows: np.ndarray[tuple[int], np.dtype[np.intp]],
    residual: Array,
    step: float,
    kind: str,
    channel: str,
    unit: str,
    todo: str,
    *,
    size: float | None = None,
) -> list[Fault]:
    """One finding where residuals are beyond rounding and `QUANTA` steps; it names the stretch from first to last."""
    if size is None:
        size = float(np.max(np.abs(recording.channels[channel][rows]), initial=0.0))
    bound = QUANTA * step + ROUNDING * size
    bad: BoolArray = residual > bound
    if not bad.any():
        return []
    first, last = int(rows[np.argmax(bad)]), int(rows[bad.size - 1 - np.argmax(bad[::-1])])
    quanta = f", {residual.max() / step:.3g} quanta" if step > 0.0 else ""
    return [
        Fault(
            kind,
            Severity.SUSPICIOUS,
            f"off by up to {residual.max():.3g} {unit}{quanta}, at {np.sum(bad)} of {bad.size} rows "
            f"(typically {np.median(residual):.3g} {unit})",
            todo,
            channel,
            first,
            last + 1,
            (float(recording.time[first]), float(recording.time[last])),
            {"residual": float(residual.max()), "bound": bound, "rows": int(np.sum(bad))},
        )
    ]
