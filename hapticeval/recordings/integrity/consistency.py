"""Whether the channels of a recording follow from each other: kinematics, torques, the spring, the surface.

A recording of HIP and force alone shows whether the model was touched, whatever the renderer:

- Without damping the force is K_p (IHIP - HIP) of (6.1), so HIP + F / K_p is where the tool was: on the model in
  contact, for every renderer that keeps its tool on the surface.
- Whatever stiffness and damping are, F = K_p (IHIP - HIP) - K_d v pushes outwards as long as the HIP is inside and
  goes deeper, and there is no force where nothing is touched.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.quantity import format_number, plural
from hapticeval.recordings.energy_balance import NOISE_DEVIATIONS
from hapticeval.recordings.integrity.issue import Issue, make_issue
from hapticeval.recordings.provenance import declared_floor, is_bilateral
from hapticeval.recordings.quantization import coarsest, noise_deviation
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import LAG_TICKS, continuing_steps
from hapticeval.types import Array, BoolArray, IntArray

RESIDUAL_QUANTA = 3.0
"""Residuals of so many quanta still come from encoders: one each for rounding, filtering and a tick of lag.

A quantum is what the numbers of all channels involved resolve: see `coarsest`.
"""

NOISE_ORDER = 4
"""Order of the differences of a residual that show its noise: what changes smoothly leaves next to nothing in them."""

NOISE_SHARE = 0.2
"""Share of the largest value up to which a residual may be noise: what is noisier than that is not a measurement."""

FREE_DEVIATIONS = 7.5
"""Standard deviations of what a sensor reads in free motion below which a force is none: with three axes chance passes
five of them once in 66,000 rows, which is a minute at 1 kHz, and 7.5 once in 10^12."""

COLOURED_TIMES = 10.0
"""Noise of so many times what its steps from row to row show is still noise, behind a low-pass of up to a hundred rows.
What is larger changes with the hand: it is a force."""

FREE_ROWS_KNOWN = 100
"""Rows in free motion that show what a sensor reads there."""

BARRED_GRAIN, MOST_BARRED = 1e-6, 10_000
"""Share of the model's size over which solid between hand and tool may be missed; the rows at which it is sought."""

CHAIN_ROUNDING = 1e-9
"""Share of the signal's size that computing in double precision may cost over a chain of transformations."""

KINEMATICS_RELATION, TORQUE_RELATION = "forward kinematics", "torque"
SPRING_RELATION, SURFACE_RELATION = "spring", "surface"
IMPLIED_RELATION, CONTACT_RELATION = "spring and surface", "contact"
RELATIONS = {
    KINEMATICS_RELATION: ("HIP = FK(q) (2.28)", ("hip", "joint_position")),
    TORQUE_RELATION: ("tau = J^T F (2.8)", ("joint_position", "joint_torque", "force")),
    SPRING_RELATION: ("F = K_p (IHIP - HIP) (6.1)", ("hip", "ihip", "force")),
    SURFACE_RELATION: ("IHIP on the model in contact", ("hip", "ihip")),
    IMPLIED_RELATION: ("HIP + F / K_p on the model in contact (6.1)", ("hip", "force")),
    CONTACT_RELATION: ("force where the HIP goes into the model, none outside", ("hip", "force")),
}
"""What should hold by each check, and the channels that it reads."""


@dataclass(frozen=True)
class ConsistencyTest:
    """An inverse check, see `RELATIONS`: made over `rows` rows, or not made, and `why`.

    The `largest` residual is in `unit`, and so is the `quantum` that the numbers of its channels resolve.
    `noisy` says that some residuals are beyond that, but within the noise. `issues` are what contradicts it, and
    `notes` what was granted.
    """

    name: str
    unit: str = ""
    rows: int = 0
    largest: float = 0.0
    quantum: float = 0.0
    noisy: bool = False
    issues: tuple[Issue, ...] = ()
    why: str = ""
    notes: tuple[str, ...] = ()

    @property
    def relation(self) -> str:
        """What should hold, in symbols."""
        return RELATIONS[self.name][0]

    @property
    def made(self) -> bool:
        """Whether anything was checked."""
        return not self.why


class Kinematics(Protocol):
    """What is read of a device: see `hapticeval.devices.device.Device`."""

    def position(self, joints: Array) -> Array:
        """Forward kinematics (2.3): the HIP (N,), m, at `joints` (N,), rad."""

    def jacobian(self, joints: Array) -> Array:
        """The Jacobian dw/dq (2.4), (N, N), m/rad, at `joints` (N,), rad."""


def inverse_checks(
    recording: Recording,
    *,
    device: Kinematics | None = None,
    model: Model | None = None,
    stiffness: float | None = None,
) -> tuple[ConsistencyTest, ...]:
    """Make the checks that a device, a model and a stiffness K_p (N/m, where K_d = 0) allow, or give each reason.

    Without an IHIP, stiffness and model together are checked against HIP and force.
    """
    rows = np.flatnonzero(recording.measured)
    makers: dict[str, Callable[[], ConsistencyTest]] = {}
    if device is not None:
        makers[KINEMATICS_RELATION] = partial(forward_kinematics, recording, rows, device)
        makers[TORQUE_RELATION] = partial(transposed_jacobian, recording, rows, device)
    if stiffness is not None:
        makers[SPRING_RELATION] = partial(_at_some_lag, recording, rows, partial(spring, stiffness=stiffness))
    if model is not None:
        makers[SURFACE_RELATION] = partial(on_the_model, recording, rows, model)
        if stiffness is not None and "ihip" not in recording.channels:
            # Without an IHIP the tool is where the spring says: at HIP + F / K_p.
            implied = partial(implied_tool, model=model, stiffness=stiffness)
            makers[IMPLIED_RELATION] = partial(_at_some_lag, recording, rows, implied)
        makers[CONTACT_RELATION] = partial(contact, recording, rows, model)
    checks = []
    for name, make in makers.items():
        missing = [channel for channel in RELATIONS[name][1] if channel not in recording.channels]
        # A check that cannot be made is reported with its reason, never left out silently.
        why = "" if rows.size else "not one row is valid"
        why = f"the log has no {' and no '.join(missing)}" if missing else why
        if name == TORQUE_RELATION and recording.meta.get("inner_loop", "static") != "static":
            why = f"the inner loop is {recording.meta['inner_loop']}: its torques are more than the force's"
        checks.append(ConsistencyTest(name, why=why) if why else make())
    return tuple(checks)


def _at_some_lag(
    recording: Recording, rows: IntArray, check_of: Callable[[Recording, IntArray], ConsistencyTest]
) -> ConsistencyTest:
    """Make a check of the force at the least lag at which it holds, up to `LAG_TICKS`; as it is where there is none."""
    as_logged = check = check_of(recording, rows)
    for lag in range(1, LAG_TICKS + 1):
        # Those whose late force is in the recording too; fewer of them than the lag has rows tell no lag.
        answered_rows = rows[rows < len(recording) - lag]
        if not check.issues or answered_rows.size < lag:
            break
        force = np.concatenate([recording.force[lag:], np.repeat(recording.force[-1:], lag, axis=0)])
        earlier = recording.with_channels(force=force)
        check = check_of(earlier, answered_rows)
        check = replace(check, notes=(*check.notes, f"the force is {plural(lag, 'row')} late"))
    return as_logged if check.issues else check


def forward_kinematics(recording: Recording, rows: IntArray, device: Kinematics) -> ConsistencyTest:
    """Check the HIP against the forward kinematics of the joints (2.28), at `rows` (n,); the residual is in m."""
    joints, hip = recording.channels["joint_position"][rows], recording.hip[rows]
    # (2.28): the HIP less the forward kinematics of the joints, m.
    residual = hip - np.array([device.position(row) for row in joints])
    # Largest row sum of |J|, m/rad: what one quantum in every joint moves the HIP at the most.
    reach = float(np.abs([device.jacobian(row) for row in joints]).sum(axis=2).max())
    step = reach * coarsest(joints) + coarsest(hip)
    return _checked(recording, rows, KINEMATICS_RELATION, "hip", "m", residual, step)


def transposed_jacobian(recording: Recording, rows: IntArray, device: Kinematics) -> ConsistencyTest:
    """Check the joint torques against J^T F (2.8), F being the force on the hand, at `rows` (n,); residual in N m.

    Where limits were between a renderer and the motors, F is what they left. A loop that adds the device's own dynamics
    (2.11) has more torque than that, which is an issue too.
    """
    forces, torque = recording.channels.get("sent_force", recording.force), recording.channels["joint_torque"][rows]
    force = forces[rows]
    jacobians = np.array([device.jacobian(row) for row in recording.channels["joint_position"][rows]])
    # (2.8): tau - J^T F, row by row, N m.
    residual = torque - np.einsum("nij,ni->nj", jacobians, force)
    # Largest column sum of |J|, m: what one quantum of force in every direction does to a torque.
    lever = float(np.abs(jacobians).sum(axis=1).max())
    step = coarsest(torque) + lever * coarsest(force)
    return _checked(recording, rows, TORQUE_RELATION, "joint_torque", "N m", residual, step)


def spring(recording: Recording, rows: IntArray, stiffness: float) -> ConsistencyTest:
    """Check that the force is that of a spring, F = K_p (IHIP - HIP) of (6.1), at `rows` (n,): residual in N.

    `stiffness` is K_p, N/m.
    """
    hip, ihip, force = recording.hip[rows], recording.ihip[rows], recording.force[rows]
    reach = ihip - hip
    # (6.1) without damping: F - K_p (IHIP - HIP), N.
    residual = force - stiffness * reach
    step = stiffness * (coarsest(hip) + coarsest(ihip)) + coarsest(force)
    # Least squares of F = K reach: K = sum F . reach / sum reach^2. What that leaves may be noise, a wrong K_p is none.
    share, square = float(np.sum(force * reach)), float(np.sum(reach * reach))
    noise = _noise(force - (share / square if square > 0.0 else 0.0) * reach, force)
    return _checked(recording, rows, SPRING_RELATION, "force", "N", residual, step, noise=noise)


def on_the_model(recording: Recording, rows: IntArray, model: Model) -> ConsistencyTest:
    """Check that the IHIP lies on the model's boundary in contact, at those of `rows` (n,) that touch; residual in m.

    What the renderer declares of its own representation is allowed.
    """
    hip = recording.hip[rows]
    apart = np.linalg.norm(recording.ihip[rows] - hip, axis=1)
    # In free space the IHIP is the HIP, to what single precision may make of it: only contact is judged.
    rows = rows[apart > 1e-6 * float(np.max(np.abs(hip), initial=0.0))]
    if rows.size == 0:
        return ConsistencyTest(SURFACE_RELATION, why="the IHIP is the HIP throughout: there is no contact")
    tool = recording.ihip[rows]
    # Distance from the boundary, m: its sign says only on which side the IHIP is off.
    residual = model.boundary.closest_point(tool).distance[:, np.newaxis]
    step = coarsest(tool) + _blurred(recording)
    return _checked(recording, rows, SURFACE_RELATION, "ihip", "m", residual, step, size=model.size, noise=0.0)


def implied_tool(recording: Recording, rows: IntArray, model: Model, stiffness: float) -> ConsistencyTest:
    """Check the tool that the force implies, HIP + F / K_p (6.1), against the model's boundary: residual in m.

    Of `rows` (n,) those with a force are checked; `stiffness` is K_p, N/m. What the renderer declares of its own
    representation is allowed.
    """
    quantum, floor = coarsest(recording.force[rows]), force_floor(recording, rows, model)
    known_noise = free_noise(recording, rows, model) / stiffness
    rows = rows[np.linalg.norm(recording.force[rows], axis=1) > floor]
    if rows.size == 0:
        return ConsistencyTest(IMPLIED_RELATION, why="the log has no force beyond its resolution")
    hip, force = recording.hip[rows], recording.force[rows]
    # (6.1) solved for the tool: IHIP = HIP + F / K_p, which has to lie on the boundary.
    residual = model.boundary.closest_point(hip + force / stiffness).distance[:, np.newaxis]
    step = coarsest(hip) + quantum / stiffness + _blurred(recording)
    noise = max(_noise(residual, force / stiffness), known_noise)
    return _checked(recording, rows, IMPLIED_RELATION, "force", "m", residual, step, size=model.size, noise=noise)


def force_floor(recording: Recording, rows: IntArray, model: Model) -> float:
    """Return the largest force that counts as none at `rows` (n,), N: the one that the recording declares, or what the
    sensor's steps and its noise make in free motion."""
    declared = declared_floor(recording)
    if declared is not None:
        return declared
    return RESIDUAL_QUANTA * coarsest(recording.force[rows]) + free_noise(recording, rows, model)


def free_noise(recording: Recording, rows: IntArray, model: Model) -> float:
    """Return how far noise takes a force off none, N: as free motion shows it, outside of the model for `LAG_TICKS`.

    Where hardly anything of `rows` (n,) is free, the steps of the force show its white noise alone.
    """
    force, free = recording.force, _free_rows(recording, rows, model)
    if free.size < FREE_ROWS_KNOWN:
        return _noise(force[rows], force[rows])
    readings = force[free] - np.median(force[free], axis=0)
    consecutive = np.diff(free) == 1
    steps = np.abs(np.diff(readings, axis=0)[consecutive])
    white = float(np.max(np.median(steps, axis=0), initial=0.0)) / math.sqrt(2.0)
    coloured = float(np.max(np.median(np.abs(readings), axis=0)))
    # The median of |z| / 0.6745 is the deviation of normal noise z.
    return FREE_DEVIATIONS * (coloured if white < coloured < COLOURED_TIMES * white else white) / 0.6745


def _free_rows(recording: Recording, rows: IntArray, model: Model) -> IntArray:
    """Return those of `rows` (n,) at which the hand has been outside of the model for `LAG_TICKS` rows."""
    return rows[_through(recording, _distance(recording, rows, model), np.minimum)[rows] > _allowed(recording, rows)]


def _distance(recording: Recording, rows: IntArray, model: Model) -> Array:
    """Return how far the hand is outside of the model, (n,), m, negative inside; NaN but at `rows`."""
    place = recording.channels.get("measured_hip", recording.hip)  # the renderer acts on what the sensors gave it
    distance = np.full(len(recording), np.nan)
    distance[rows] = model.boundary.closest_point(place[rows]).distance
    return distance


def _allowed(recording: Recording, rows: IntArray) -> float:
    """Return by how much the hand's place may be off, m: its steps, and what a renderer declares of its surface."""
    place = recording.channels.get("measured_hip", recording.hip)
    return RESIDUAL_QUANTA * coarsest(place[rows]) + recording.standoff + recording.resolution


def _noise(values: Array, signal: Array) -> float:
    """Return how far noise takes one of `values` (n, N) off, in their unit: no more than `NOISE_SHARE` of `signal`."""
    largest = float(np.max(np.abs(signal), initial=0.0))
    return min(NOISE_DEVIATIONS * noise_deviation(values, order=NOISE_ORDER), NOISE_SHARE * largest)


def _blurred(recording: Recording) -> float:
    """Return what the renderer declares of its own representation, m, as a quantum."""
    # Divided by RESIDUAL_QUANTA, which `_checked` multiplies with: the declared lengths are allowed once.
    return (recording.standoff + recording.resolution) / RESIDUAL_QUANTA


def contact(recording: Recording, rows: IntArray, model: Model) -> ConsistencyTest:
    """Check that the force is where the model is, at `rows` (n,): how deep without one, or how far off with one, m.

    There is a force while the HIP is inside and goes deeper, and none while it is outside, each for `LAG_TICKS` rows,
    by which a renderer may be late. A hand that has come out of another face is still held: see `_barred`. It is not
    asked of a surface that holds from both sides, which pulls outside, and whose law may push to turn the tool.
    """
    if is_bilateral(recording):
        why = "the surface holds from both sides: it pulls outside, and inside the force that turns the tool may cancel"
        return ConsistencyTest(CONTACT_RELATION, why=f"{why} the spring's")
    place = recording.channels.get("measured_hip", recording.hip)
    distance, allowed = _distance(recording, rows, model), _allowed(recording, rows)
    # Signed distances: negative inside. `bare` lacks a force inside, `away` has one outside, for LAG_TICKS rows.
    size = np.linalg.norm(recording.force, axis=1)
    floor = force_floor(recording, rows, model)
    # N: noise that is known may lower a force of twice the floor to it.
    unseen_force = floor * (2.0 if _free_rows(recording, rows, model).size >= FREE_ROWS_KNOWN else 1.0)
    # m: a hand may be so deep with a force that is lost so, by the stiffness that most forces have.
    pressed = rows[(size[rows] > floor) & (distance[rows] < 0.0)]
    unfelt = unseen_force * float(np.median(-distance[pressed] / size[pressed])) if pressed.size else 0.0
    nearest, farthest = _through(recording, distance, np.minimum), _through(recording, distance, np.maximum)
    # 1 where the HIP does not come out; damping may take the force away while it does.
    deeper = np.concatenate([[0.0], np.diff(distance) <= 0.0])
    bare = (size <= floor) & (_through(recording, deeper, np.minimum) > 0.0) & (farthest < -allowed - unfelt)
    away = (size > floor) & (nearest > allowed)
    away &= ~_barred(recording, np.flatnonzero(away), place, distance, model)
    off = np.where(bare, -farthest, np.where(away, nearest, 0.0))
    issues = []
    for words, at in (
        ("no force though the HIP goes deeper inside the model", np.flatnonzero(bare)),
        ("a force though the HIP is outside the model", np.flatnonzero(away)),
    ):
        if at.size:
            message = (
                f"{words}, by up to {format_number(1e3 * float(off[at].max()), 3)} mm, at {plural(at.size, 'row')}"
            )
            span = int(at[0]), int(at[-1]) + 1
            issues.append(make_issue(recording, CONTACT_RELATION, message, "force", span, rows=int(at.size)))
    largest, quantum = float(off[rows].max(initial=0.0)), allowed / RESIDUAL_QUANTA
    notes = (f"a force below {format_number(floor, 2)} N counts as none, by what free motion reads",)
    return ConsistencyTest(
        CONTACT_RELATION, "m", int(rows.size), largest, quantum, issues=tuple(issues), notes=notes if floor else ()
    )


def _barred(recording: Recording, rows: IntArray, place: Array, distance: Array, model: Model) -> BoolArray:
    """Return where the solid lies between the HIP, outside of it, and the tool on another face, (n,); sought at `rows`.

    The tool is the IHIP. Without one it is where the hand last went in, if the force points there: a hand that comes
    out where it went in has not gone through. It may still be held `LAG_TICKS` rows later.
    """
    tools = recording.channels.get("ihip")
    if tools is None:
        # The last row outside before each time that the hand goes in, at every later row; -1 before the first.
        enters = np.concatenate([[False], (distance[1:] < 0.0) & (distance[:-1] >= 0.0)])
        entry = np.maximum.accumulate(np.where(enters, np.arange(len(place)) - 1, -1))
        tools = place[np.maximum(entry, 0)]
        rows = rows[entry[rows] >= 0]
        rows = rows[np.sum(recording.force[rows] * (tools - place)[rows], axis=1) > 0.0]
    barred = np.zeros(len(recording))
    # More rows than so many are a fault of another kind, and take long.
    for row in rows[:MOST_BARRED]:
        crossing = model.boundary.first_crossing(place[row], tools[row], grain=BARRED_GRAIN * model.size)
        barred[row] = crossing is not None
    return np.convolve(barred, np.ones(LAG_TICKS + 1))[: len(recording)] > 0.0


def _through(recording: Recording, values: Array, extreme: np.ufunc) -> Array:
    """Return the extreme of each row and `LAG_TICKS` before it, (n,); NaN where one is missing, or behind a gap."""
    out = values.copy()
    # Row k is broken where nothing joins it to row k - 1.
    broken = np.concatenate([[True], ~continuing_steps(recording)])
    for back in range(1, LAG_TICKS + 1):
        before = np.concatenate([np.full(back, np.nan), values[:-back]])[: values.size]
        out = extreme(out, before)
        # Any break within the last `back` rows hides what was before it.
        out[np.convolve(broken, np.ones(back))[: values.size] > 0.0] = np.nan
    return out


def _checked(
    recording: Recording,
    rows: IntArray,
    name: str,
    channel: str,
    unit: str,
    residual: Array,
    step: float,
    *,
    size: float | None = None,
    noise: float | None = None,
) -> ConsistencyTest:
    """Judge a residual (n, N) at `rows` (n,): one issue where some are beyond `RESIDUAL_QUANTA` steps, rounding, noise.

    It names the stretch from the first to the last of them. `size` is that of the signal of which rounding is a share,
    the channel's unless it is given, and `noise` how far that may take a residual, in its unit: as far as it does.
    """
    signal = recording.channels[channel][rows]
    if size is None:
        size = float(np.max(np.abs(signal), initial=0.0))
    off = np.linalg.norm(residual, axis=1)
    bound = RESIDUAL_QUANTA * step + CHAIN_ROUNDING * size
    largest, median = float(off.max()), float(np.median(off))
    noisy = largest > bound
    # Beyond quanta, rounding and noise it is a contradiction, whatever its size.
    bound += _noise(residual, signal) if noise is None else noise
    check = ConsistencyTest(name, unit, int(rows.size), largest, step, noisy)
    bad = rows[off > bound]
    if bad.size == 0:
        return check
    quanta = f", {format_number(largest / step, 3)} quanta" if step > 0.0 else ""
    message = (
        f"off by up to {largest:.3g} {unit}{quanta}, at {bad.size} of {rows.size} rows (typically {median:.3g} {unit})"
    )
    span = int(bad[0]), int(bad[-1]) + 1
    issue = make_issue(recording, name, message, channel, span, bound=bound, rows=int(bad.size))
    return replace(check, issues=(issue,))
