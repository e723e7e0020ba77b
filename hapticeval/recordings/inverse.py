"""Whether the channels of a recording follow from each other: kinematics, torques, the spring, the surface."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings.finding import Fault, Severity
from hapticeval.recordings.grain import grain
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array, BoolArray, IntArray

QUANTA = 3.0
"""Residuals of so many quanta still come from encoders: one each for rounding, filtering and a tick of lag.

A quantum is what the numbers of all channels involved can tell: see `grain`.
"""

ROUNDING = 1e-9
"""Share of the signal's size that computing in double precision may cost over a chain of transformations."""


@dataclass(frozen=True)
class Check:
    """An inverse check: made over `rows` rows, with its largest and median residual in `unit`s and the `quantum` that
    the numbers of its channels can tell, in the same; or not made, and `why`.

    `relation` is what should hold, in symbols. `faults` are what contradicts it.
    """

    name: str
    relation: str
    unit: str = ""
    rows: int = 0
    largest: float = 0.0
    median: float = 0.0
    quantum: float = 0.0
    faults: tuple[Fault, ...] = ()
    why: str = ""

    @property
    def made(self) -> bool:
        """Whether anything was checked."""
        return not self.why


class Kinematics(Protocol):
    """What is read of a device: see `hapticeval.devices.Device`."""

    def position(self, joints: Array) -> Array:
        """Forward kinematics (2.3), (N,), m."""

    def jacobian(self, joints: Array) -> Array:
        """dw/dq (2.4), (N, N)."""


KINEMATICS, TORQUE = "forward kinematics", "torque"
SPRING, SURFACE = "spring", "surface"
RELATIONS = {
    KINEMATICS: "HIP = FK(q) (2.28)",
    TORQUE: "tau = J^T F (2.8)",
    SPRING: "F = K_p (IHIP - HIP) (6.1)",
    SURFACE: "IHIP on the model in contact",
}


def forward_kinematics(recording: Recording, device: Kinematics) -> Check:
    """The HIP against the forward kinematics of the joints (2.28); residual in m and in quanta of the encoders."""
    lacking = _lacking(recording, KINEMATICS, "hip", "joint_position")
    if lacking is not None:
        return lacking
    rows = valid_rows(recording)
    joints = recording.channels["joint_position"][rows]
    expected = _each(device.position, joints)
    reach = max(float(np.abs(_each(device.jacobian, joints)).sum(axis=2).max()), 0.0)
    residual = np.linalg.norm(recording.hip[rows] - expected, axis=1)
    step = reach * coarsest(joints.T) + coarsest(recording.hip[rows].T)
    return judged(
        recording, rows, residual, step, KINEMATICS, "hip", "m",
        "see zero offsets, directions and lengths of the device, and the frame of the HIP",
    )  # fmt: skip


def transposed_jacobian(recording: Recording, device: Kinematics) -> Check:
    """The joint torques against J^T F (2.8), F being the force on the hand; residual in N m.

    A loop that adds the device's own dynamics (2.11) has more torque than that: the residual is told, not judged,
    where it is no rounding.
    """
    lacking = _lacking(recording, TORQUE, "joint_position", "joint_torque", "force")
    if lacking is not None:
        return lacking
    rows = valid_rows(recording)
    jacobians = _each(device.jacobian, recording.channels["joint_position"][rows])
    expected = np.einsum("nij,ni->nj", jacobians, recording.force[rows])
    residual = np.linalg.norm(recording.channels["joint_torque"][rows] - expected, axis=1)
    lever = max(float(np.abs(jacobians).sum(axis=1).max()), 0.0)
    step = coarsest(recording.channels["joint_torque"][rows].T) + lever * coarsest(recording.force[rows].T)
    return judged(
        recording, rows, residual, step, TORQUE, "joint_torque", "N m",
        "see the signs of motors and force; an inner loop that adds its own dynamics differs too",
    )  # fmt: skip


def spring(recording: Recording, stiffness: float) -> Check:
    """F = K_p (IHIP - HIP) of (6.1), where there is no damping: residual in N, and the stiffness that fits best."""
    lacking = _lacking(recording, SPRING, "hip", "ihip", "force")
    if lacking is not None:
        return lacking
    rows = valid_rows(recording)
    reach = recording.ihip[rows] - recording.hip[rows]
    force = recording.force[rows]
    residual = np.linalg.norm(force - stiffness * reach, axis=1)
    step = stiffness * (coarsest(recording.hip[rows].T) + coarsest(recording.ihip[rows].T)) + coarsest(force.T)
    check = judged(
        recording, rows, residual, step, SPRING, "force", "N",
        "see the stiffness, the sign of the force, and whether all three were logged in the same tick",
        size=float(np.max(np.abs(force), initial=0.0)),
    )  # fmt: skip
    square = float(np.sum(reach * reach))
    return with_stiffness(check, stiffness, float(np.sum(force * reach)) / square) if square > 0.0 else check


def on_the_model(recording: Recording, model: Model) -> Check:
    """The IHIP in contact against the model's boundary; residual in m. What the renderer declares of its own
    representation is allowed."""
    lacking = _lacking(recording, SURFACE, "hip", "ihip")
    if lacking is not None:
        return lacking
    rows = valid_rows(recording)
    apart = np.linalg.norm(recording.ihip[rows] - recording.hip[rows], axis=1)
    rows = rows[apart > 1e-6 * float(np.max(np.abs(recording.hip[rows]), initial=0.0))]
    if rows.size == 0:
        return Check(SURFACE, RELATIONS[SURFACE], why="the IHIP is the HIP throughout: there is no contact")
    residual = np.abs(model.boundary.frame(recording.ihip[rows]).distance)
    step = coarsest(recording.ihip[rows].T)
    allowed = step + (recording.standoff + recording.resolution) / QUANTA
    return judged(
        recording, rows, residual, allowed, SURFACE, "ihip", "m",
        "see the model and its frame; a renderer with a coarser representation declares its resolution",
        size=model.size,
    )  # fmt: skip


def _lacking(recording: Recording, name: str, *channels: str) -> Check | None:
    """The check that cannot be made, where a channel is missing."""
    missing = [channel for channel in channels if channel not in recording.channels]
    if not missing:
        return None
    return Check(name, RELATIONS[name], why=f"the log has no {' and no '.join(missing)}")


def with_stiffness(check: Check, declared: float, fitted: float) -> Check:
    """A check whose findings name the stiffness that fits best."""
    words = f"; {fitted:.6g} N/m fits best, {declared:.6g} N/m is declared"
    faults = tuple(
        replace(fault, message=fault.message + words, measures={**fault.measures, "stiffness": fitted})
        for fault in check.faults
    )
    return replace(check, faults=faults)


def coarsest(columns: Iterable[Array]) -> float:
    """The coarsest grain of the columns."""
    return max((grain(column) for column in columns), default=0.0)


def valid_rows(recording: Recording) -> IntArray:
    """The rows that are measurements, (n,)."""
    return np.flatnonzero(recording.measured)


def _each(function: Callable[[Array], Array], joints: Array) -> Array:
    return np.array([function(row) for row in joints])


def judged(
    recording: Recording,
    rows: IntArray,
    residual: Array,
    step: float,
    kind: str,
    channel: str,
    unit: str,
    todo: str,
    *,
    size: float | None = None,
    relation: str = "",
) -> Check:
    """The check of a residual (n,) at `rows` (n,): one finding where some are beyond rounding and `QUANTA` steps, which
    names the stretch from the first to the last of them. `size` is that of the signal that rounding is a share of."""
    if size is None:
        size = float(np.max(np.abs(recording.channels[channel][rows]), initial=0.0))
    relation = relation or RELATIONS[kind]
    if rows.size == 0:
        return Check(kind, relation, why="not one row is valid")
    bound = QUANTA * step + ROUNDING * size
    largest, median = float(residual.max()), float(np.median(residual))
    check = Check(kind, relation, unit, int(rows.size), largest, median, step)
    bad: BoolArray = residual > bound
    if not bad.any():
        return check
    first, last = int(rows[np.argmax(bad)]), int(rows[bad.size - 1 - np.argmax(bad[::-1])])
    quanta = f", {largest / step:.3g} quanta" if step > 0.0 else ""
    fault = Fault(
        kind,
        Severity.SUSPICIOUS,
        f"off by up to {largest:.3g} {unit}{quanta}, at {np.sum(bad)} of {bad.size} rows (typically {median:.3g} "
        f"{unit})",
        todo,
        channel,
        first,
        last + 1,
        (float(recording.time[first]), float(recording.time[last])),
        {"residual": largest, "bound": bound, "rows": int(np.sum(bad))},
    )
    return replace(check, faults=(fault,))
