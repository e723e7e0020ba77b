"""Whether the channels of a recording follow from each other: kinematics, torques, the spring, the surface.

A recording of HIP and force alone tells the model that it touched, whatever the renderer. Without damping the force is
K_p (IHIP - HIP) of (6.1), so HIP + F / K_p is where the tool was: on the model in contact, for every renderer that
keeps its tool on the surface. And whatever stiffness and damping are: F = K_p (IHIP - HIP) - K_d v pushes outwards as
long as the HIP is inside and goes deeper, and there is no force where nothing is touched.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings.integrity.issue import Fault, Severity
from hapticeval.recordings.provenance import declared_floor, is_bilateral
from hapticeval.recordings.quantization import grain
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import LAG, joined
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


IMPLIED, CONTACT = "spring and surface", "contact"
IMPLIES = "HIP + F / K_p on the model in contact (6.1)"
TOUCHES = "force where the HIP goes into the model, none outside"


def implied_tool(recording: Recording, model: Model, stiffness: float) -> Check:
    """HIP + F / K_p against the model's boundary wherever there is a force: residual in m. Its quantum is that of the
    HIP and of F / K_p; what the renderer declares of its own representation is allowed. Findings name the stiffness
    that fits best: the least squares of d + n . F / K_p, which is the distance to first order."""
    if not {"hip", "force"} <= recording.channels.keys():
        return Check(IMPLIED, IMPLIES, why="the log has no hip or no force")
    rows = valid_rows(recording)
    grain = coarsest(recording.force[rows].T)
    rows = rows[np.linalg.norm(recording.force[rows], axis=1) > max(QUANTA * grain, declared_floor(recording) or 0.0)]
    if rows.size == 0:
        return Check(IMPLIED, IMPLIES, why="the log has no force beyond its resolution")
    hip, force = recording.hip[rows], recording.force[rows]
    residual = np.abs(model.boundary.frame(hip + force / stiffness).distance)
    step = coarsest(recording.hip[rows].T) + grain / stiffness
    allowed = step + (recording.standoff + recording.resolution) / QUANTA
    check = judged(
        recording, rows, residual, allowed, IMPLIED, "force", "m",
        "see model, stiffness, damping and the frames of HIP and force; the log has no IHIP to tell them apart",
        size=model.size, relation=IMPLIES,
    )  # fmt: skip
    frame = model.boundary.frame(hip)
    along = np.sum(frame.normal * force, axis=1)
    against = -float(np.dot(frame.distance, along))
    return with_stiffness(check, stiffness, float(np.dot(along, along)) / against) if against > 0.0 else check


def contact(recording: Recording, model: Model) -> Check:
    """Whether the force is where the model is: there is one while the HIP is inside and goes deeper, and none while it
    is outside, each through `LAG` ticks, by which a renderer may be late. The residual is how deep without a force, or
    how far off with one, m.

    A surface that holds from both sides (a scene that is `bilateral`) pulls outside: only the inside is told then.
    """
    if not {"hip", "force"} <= recording.channels.keys():
        return Check(CONTACT, TOUCHES, why="the log has no hip or no force")
    rows = valid_rows(recording)
    # the renderer acts on what the sensors gave it
    place = recording.channels.get("measured_hip", recording.hip)
    distance = np.full(len(recording), np.nan)
    distance[rows] = model.boundary.frame(place[rows]).distance
    step = coarsest(place[rows].T)
    allowed = QUANTA * step + recording.standoff + recording.resolution
    size = np.linalg.norm(recording.force, axis=1)
    grain = max(QUANTA * coarsest(recording.force[rows].T), declared_floor(recording) or 0.0)
    nearest, farthest = _through(recording, distance, np.minimum), _through(recording, distance, np.maximum)
    deeper = np.zeros(len(recording), dtype=bool)
    deeper[1:] = np.diff(distance) <= 0.0
    deeper = _through(recording, np.where(deeper, 1.0, 0.0), np.minimum) > 0.0
    bare = (size <= grain) & deeper & (farthest < -allowed)
    held = is_bilateral(recording)
    away = (size > grain) & (nearest > allowed) & (not held)
    off = np.where(bare, -farthest, np.where(away, nearest, 0.0))[rows]
    faults = [
        _fault(recording, wrong, reach, words)
        for wrong, reach, words in (
            (bare, -farthest, "no force though the HIP goes deeper inside the model, by up to {:.3g} mm"),
            (away, nearest, "a force though the HIP is outside the model, by up to {:.3g} mm"),
        )
        if wrong.any()
    ]
    return Check(
        CONTACT, TOUCHES, "m", int(rows.size), float(off.max(initial=0.0)), float(np.median(off)) if off.size else 0.0,
        allowed / QUANTA, tuple(faults), "" if rows.size else "not one row is valid",
    )  # fmt: skip


def _fault(recording: Recording, wrong: BoolArray, reach: Array, words: str) -> Fault:
    at = np.flatnonzero(wrong)
    first, last = int(at[0]), int(at[-1])
    return Fault(
        CONTACT,
        Severity.SUSPICIOUS,
        f"{words.format(1e3 * float(reach[wrong].max()))}, at {at.size} rows",
        "see the model, its size and its frame; a motor that is off or a force of something else does so too",
        "force",
        first,
        last + 1,
        (float(recording.time[first]), float(recording.time[last])),
        {"residual": float(reach[wrong].max()), "rows": int(at.size)},
    )


def _through(recording: Recording, values: Array, extreme: np.ufunc) -> Array:
    """The extreme of each row and the `LAG` before it; NaN where one of these is not there, or behind a gap."""
    out = values.copy()
    broken = np.concatenate([[True], ~joined(recording)])
    for back in range(1, LAG + 1):
        before = np.concatenate([np.full(back, np.nan), values[:-back]])[: values.size]
        out = extreme(out, before)
        out[np.convolve(broken, np.ones(back))[: values.size] > 0.0] = np.nan
    return out


def inverse_checks(
    recording: Recording,
    *,
    device: Kinematics | None = None,
    model: Model | None = None,
    stiffness: float | None = None,
) -> tuple[Check, ...]:
    """The checks that a device, a model and a stiffness K_p (N/m, where K_d = 0) ask for, each made or with its reason.

    Without an IHIP, stiffness and model together are checked against HIP and force.
    """
    checks = []
    if device is not None:
        checks += [forward_kinematics(recording, device), transposed_jacobian(recording, device)]
    if stiffness is not None:
        checks.append(spring(recording, stiffness))
    if model is not None:
        checks.append(on_the_model(recording, model))
        if stiffness is not None and "ihip" not in recording.channels:
            checks.append(implied_tool(recording, model, stiffness))
        checks.append(contact(recording, model))
    return tuple(checks)
