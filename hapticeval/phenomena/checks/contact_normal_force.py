"""Contact normal force (3.3), (3.4): the force is along the contact normal and balances the operator's push."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hapticeval.devices.device import heaviest_mass
from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.catalogue import JOINT_FRICTION, SATURATION
from hapticeval.effects.effect import Alters
from hapticeval.geometry.mesh import Mesh
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import ANGLE_ROUNDING, LAG_TICKS, SINGLE_ROUNDINGS, STATIC_SHARE, TELLING_SHARE
from hapticeval.phenomena.lag import delayed, largest_in_lag, over_lag, resting_ticks
from hapticeval.phenomena.measures.stiffness import force_coarseness
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import mm, newtons, steps_to, worst_row
from hapticeval.phenomena.verdict import Finding, Metric, Outcome, undecided
from hapticeval.recordings.recording import SINGLE
from hapticeval.scene import Scene
from hapticeval.types import Array, IntArray


class StaticBalance(NamedTuple):
    """A run that ends at rest: force less push along the normal, what the momentum allows of that, and the push, N."""

    difference: float
    allowed: float
    push: float


class Unbalanced(NamedTuple):
    """A run of which the size of the force at rest is not judged; without a `reason` where nobody would ask."""

    reason: str


def judge(runs: Runs, scene: Scene) -> Finding:
    """Judge the direction first; then, where the run ends in rest under an operator's push, the magnitude."""
    base = runs.observed(scene)
    if not base.pressed.any():
        return undecided("no force above the floor: the tool never presses on the surface")
    return _judge(base) if "ihip" in base.channels else _judge_without_ihip(base)


def _judge(base: Observed) -> Finding:
    finding, granted = _judge_direction(base)
    return finding if finding.outcome is Outcome.FAIL else _judge_balance(base, finding, granted)


def _judge_direction(base: Observed) -> tuple[Finding, str]:
    """Return what the force's direction shows, and in words what a declared resolution had to grant it."""
    scene, pressed_rows = base.scene, np.flatnonzero(base.pressed)
    declared, near = base.resolution, normal_reach(base)[pressed_rows]
    # Around the IHIP every normal within its lag and the declared resolution is a true one.
    angle_outside = base.boundary.normal_cone(base.ihip[pressed_rows], near + declared)
    rounded = _rounding_angle(base, pressed_rows)
    lag = _ihip_lag(base, pressed_rows, angle_outside, rounded)
    deviation = _force_deviation(base, pressed_rows, angle_outside, lag)
    # What rounding leaves, and what a lag leaves of a path that bends.
    allowed = rounded + bend_angle(base, pressed_rows, lag)
    worst = worst_row(deviation - allowed)
    angle, bound = math.degrees(float(deviation[worst])), math.degrees(float(allowed[worst]))
    tick = int(pressed_rows[worst])
    leans = _error_vector_angles(base, pressed_rows, angle_outside)
    evidence: dict[str, object] = {**base.evidence_at(tick), "samples": int(pressed_rows.size), **leans}
    if lag is not None:
        evidence["lag_ticks"] = lag
    metric = Metric("angle of the force outside the true normals", angle, "deg")
    where = f"every true normal near the IHIP at {base.time_and_hip(tick)}"
    if angle > bound:
        size = float(np.linalg.norm(base.force[tick]))
        evidence["force_N"] = size
        # The part of the force, N, that no normal explains.
        aside = size * math.sin(min(float(deviation[worst]), 0.5 * math.pi))
        # Pulled to the solid: more than a right angle from every outward normal.
        inwards = not scene.bilateral and float(angle_outside(base.force[pressed_rows])[worst]) > 0.5 * math.pi
        direction = "pulls inwards," if inwards else "points"
        late = (
            f" (with the lag of {lag:.3g} ticks that its positions show)"
            if lag is not None and lag >= TELLING_SHARE
            else ""
        )
        off = f"{newtons(aside, 2)} ({angle:.3g} degrees) off {where}{late}"
        known = base.as_sensed.diagnosis.cause is not None
        message = f"{base.as_sensed.cause}: {off}" if known else f"the force of {newtons(size)} {direction} {off}"
        return Finding(Outcome.FAIL, message, metric, bound, evidence | base.as_sensed.cause_evidence), ""
    granted = ""
    if declared > 0.0:
        # How far the force would be off without the declared resolution: said, though it is granted.
        deviation_without = _force_deviation(
            base, pressed_rows, base.boundary.normal_cone(base.ihip[pressed_rows], near), lag
        )
        needs_resolution = deviation_without - (allowed - _resolution_angle(base, pressed_rows))
        neediest = worst_row(needs_resolution)
        if needs_resolution[neediest] > 0.0:
            leaning = math.degrees(float(deviation_without[neediest]))
            evidence["angle_by_resolution_deg"] = leaning
            granted = f" (but for up to {leaning:.2g} degrees, which its resolution of {mm(declared)} allows)"
    message = f"the force is along the surface normal throughout{granted}"
    return Finding(Outcome.PASS, message, metric, bound, evidence), granted


def _judge_balance(base: Observed, finding: Finding, granted: str) -> Finding:
    """Add to the pass of a force's direction what its size at rest shows."""
    balance = static_balance(base)
    if isinstance(balance, Unbalanced):
        if base.meta.get("source") != "experiment" or not balance.reason:
            return finding
        return replace(finding, message=f"{finding.message}; {balance.reason}, so the size of the force is not judged")
    depth = float(np.linalg.norm(base.hip[-1] - base.ihip[-1]))
    evidence = {
        **finding.evidence,
        "static_difference_N": balance.difference,
        "static_bound_N": balance.allowed,
        "operator_normal_N": balance.push,
        "static_depth_m": depth,
        "apparent_stiffness_N_m": balance.push / depth if depth > 0.0 else None,
    }
    off, push = abs(balance.difference), f"{balance.push:.3g} N"
    if off > balance.allowed:
        message = f"at rest the force is {balance.difference:.3g} N off the operator's normal component of {push} (3.3)"
        magnitude = Metric("static force less the operator's normal component", off, "N")
        return Finding(Outcome.FAIL, message, magnitude, balance.allowed, evidence)
    message = (
        f"normal throughout{granted}, and equal at rest to the operator's {push} to within {off:.2g} N, "
        f"{mm(depth)} deep"
    )
    return replace(finding, message=message, evidence=evidence)


def _judge_without_ihip(base: Observed) -> Finding:
    """Judge the force of a recording without IHIP against the normal at the model's point nearest to the HIP.

    A renderer may declare that its contact point is there. Others, with a memory or a map, have theirs elsewhere: of
    these nothing is decided.
    """
    finding = _judge(base.with_channels(ihip=np.where(base.pressed[:, np.newaxis], base.nearest.foot, base.hip)))
    # The evidence names the point that was assumed, and not an IHIP that nobody recorded.
    evidence = {"nearest" if name == "ihip" else name: value for name, value in finding.evidence.items()}
    assumed = "no IHIP was recorded: judged at the model's point nearest to the HIP"
    if base.meta.get("contact_point") == "nearest":
        return replace(finding, message=f"{finding.message} ({assumed}, where it is declared to be)", evidence=evidence)
    angle = "" if finding.metric is None else f" the force is {finding.metric.value:.3g} {finding.metric.unit} off, and"
    message = f"{assumed},{angle} it is not declared that the contact point is there"
    return replace(finding, outcome=Outcome.INCONCLUSIVE, message=message, evidence=evidence)


def _error_vector_angles(
    recording: Observed, pressed_rows: IntArray, angle_outside: Callable[[Array], Array]
) -> dict[str, float]:
    """Return how far the error vector HIP to IHIP leans from the normal, degrees: median and 95th percentile.

    Thesis section 5.1 asks that it vanishes at shallow depth.
    """
    error = (recording.ihip - recording.hip)[pressed_rows]
    deep = np.any(error != 0.0, axis=1)
    if not deep.any():
        return {}
    angles = np.degrees(angle_outside(error)[deep])
    return {
        "error_vector_angle_median_deg": float(np.median(angles)),
        "error_vector_angle_95_deg": float(np.percentile(angles, 95)),
    }


def normal_reach(recording: Observed) -> Array:
    """Return how far (n,), m, along the surface the normal of each force may lie from the IHIP of its row.

    - IHIP and force may each be up to three ticks late, so that the force belongs to where the tool was or will be
      within three ticks: three of its own steps, however the projection stretches those of the hand.
    - A rigid tool may get to a corner and back between two samples: its steps are as long as its velocity makes them,
      as far as its step and the contact's force explain that.
    - Positions in single precision, or in a log's steps, and the declared standoff come to it, that one as declared: in
      a corner the tool may lie on one face, and so far off the others that hold it.
    """
    steps = steps_to(recording.ihip)
    if "velocity" in recording.channels and np.array_equal(recording.ihip, recording.hip):
        # x = F dt^2 / m: as far as the contact's force may have thrown the tool in a tick.
        pushed = recording.dt**2 * recording.force_size / recording.scene.mass
        travel = recording.dt * np.linalg.norm(recording.velocity, axis=1)
        steps = np.maximum(steps, np.minimum(travel, steps + pushed))
    off = recording.believed_standoff + recording.rounding + recording.log_step("ihip")
    return np.asarray(LAG_TICKS * largest_in_lag(steps) + off)


def _force_deviation(
    recording: Observed,
    pressed_rows: IntArray,
    angle_outside: Callable[[Array], Array],
    lag: float | None,
) -> Array:
    """Return the angle (n,), rad, of each force above the floor outside of the true normals around its IHIP.

    `angle_outside` measures it. A spring from a late IHIP to the present HIP is tilted by the HIP's travel since: with
    a `lag` (ticks) the spring to the HIP that the IHIP answers is measured, too. Where a contact has just begun that
    HIP may be less late: a tool that is late in contact alone waits for its first answers.
    """
    deviation = _deviation_with_lag(recording, pressed_rows, angle_outside, None)
    if lag is None:
        return deviation
    # Rows within three ticks of a begin, (n,): in the row before them nothing was pressed.
    pressed = np.pad(recording.pressed, (LAG_TICKS, 0))
    around = np.lib.stride_tricks.sliding_window_view(pressed, LAG_TICKS + 1)[pressed_rows]
    begins = ~np.all(around, axis=1)
    for ticks in (*range(1, math.ceil(lag)), lag):
        late = _deviation_with_lag(recording, pressed_rows, angle_outside, ticks)
        counts = begins | (ticks == lag)
        deviation[counts] = np.minimum(deviation, late)[counts]
    return deviation


def _deviation_with_lag(
    recording: Observed,
    pressed_rows: IntArray,
    angle_outside: Callable[[Array], Array],
    lag: float | None,
) -> Array:
    """Return the angles (n,), rad, of `_force_deviation` with one `lag` (ticks), None for the forces as they are."""
    force = recording.force[pressed_rows]
    if lag is not None:
        depth = np.linalg.norm(recording.hip - recording.ihip, axis=1)[pressed_rows]
        strength = np.linalg.norm(force, axis=1)
        # k = |F| / |e|: the apparent stiffness of each row, as the spring is linear in the error.
        stiffness = np.divide(strength, depth, out=np.zeros_like(depth), where=depth > 0.0)[:, np.newaxis]
        # F = k (IHIP - HIP) drawn to the HIP of the lag: F + k (HIP_now - HIP_then)
        # the HIPs that the IHIPs answer: of `lag` ticks before, and those that it has rested
        answered = delayed(recording.hip, pressed_rows - resting_ticks(recording.ihip)[pressed_rows], lag)
        force = force + stiffness * (recording.hip[pressed_rows] - answered)
    return _angles(force, recording.scene, angle_outside)


def _angles(vectors: Array, scene: Scene, angle_outside: Callable[[Array], Array]) -> Array:
    """Return what `angle_outside` measures of vectors (n, N): (n,), rad, up to sign on a bilateral constraint."""
    return np.minimum(angle_outside(vectors), angle_outside(-vectors)) if scene.bilateral else angle_outside(vectors)


def _ihip_lag(
    recording: Observed, pressed_rows: IntArray, angle_outside: Callable[[Array], Array], rounded: Array
) -> float | None:
    """Return the one lag of the run's IHIPs, ticks, where forces ask for one; None where none does.

    A tangential force beside an IHIP that is not late asks for none.
    """
    depth = np.linalg.norm(recording.hip - recording.ihip, axis=1)[pressed_rows]
    asks = np.flatnonzero(
        (_force_deviation(recording, pressed_rows, angle_outside, None) > rounded) & (depth > recording.force_depth)
    )
    # The error vector itself leans where a lag is behind it; a force that leans alone has another cause.
    present = _angles(recording.ihip[pressed_rows] - recording.hip[pressed_rows], recording.scene, angle_outside)
    return recording.lag.ihip if np.any(present[asks] > rounded[asks]) else None


def bend_angle(recording: Observed, pressed_rows: IntArray, lag: float | None) -> Array:
    """Return the angle (n,), rad, that a path which bends between ticks leaves in forces that are `lag` ticks late.

    A way of acceleration a is off its chord by a h^2 / 8 at the most, an eighth of the second difference of its rows:
    so far beside may the HIP have been that the spring was drawn to.
    """
    if lag is None or lag == 0.0:
        return np.zeros(pressed_rows.size)
    bends = np.zeros(len(recording))
    # a h^2 / 8, the sagitta of a parabola over a tick
    bends[1:-1] = np.linalg.norm(np.diff(recording.hip, n=2, axis=0), axis=1) / 8.0
    return _tilt_angle(recording, pressed_rows, over_lag(bends, pressed_rows).max(axis=0))


def _tilt_angle(recording: Observed, pressed_rows: IntArray, aside: Array | float) -> Array:
    """Return the angle (n,), rad, by which a spring tilts whose end lies `aside` by m; 0 where a force has no depth."""
    depth = least_depth(recording, pressed_rows)
    return np.asarray(np.arcsin(np.minimum(np.divide(aside, depth, out=np.zeros_like(depth), where=depth > 0.0), 1.0)))


def least_depth(recording: Observed, pressed_rows: IntArray) -> Array:
    """Return the least depth (n,), m, of the three ticks that a force may be late; 0 where it has none in any."""
    depths = np.linalg.norm(recording.hip - recording.ihip, axis=1)
    # A row without a depth does not bound it.
    depths[depths == 0.0] = np.inf
    depth = over_lag(depths, pressed_rows).min(axis=0)
    depth[np.isinf(depth)] = 0.0
    return np.asarray(depth)


def _resolution_angle(recording: Observed, pressed_rows: IntArray) -> Array:
    """Return the angle (n,), rad, by which a spring tilts to a point that the declared resolution puts beside.

    At most a HIP step beside: what is coarser are facets, in whose contact a spring is normal to the facet, and that is
    a normal within the resolution.
    """
    return _tilt_angle(recording, pressed_rows, min(recording.resolution, recording.hip_step))


def _rounding_angle(recording: Observed, pressed_rows: IntArray) -> Array:
    """Return the angle (n,), rad, that the rounding of numbers and the declared resolution leave in each force.

    Two positions in single precision, of the model's size, are subtracted to give a vector as long as the depth; a
    force that is there without a depth was not built so, and has the rounding of its own components only.

    Each component of a force that a log gives in steps of q is off by up to q / 2; a force of a declared resolution, by
    as much to any side. Who answers in single precision may have the corners of a triangle in it.
    """
    depth = least_depth(recording, pressed_rows)
    stretch = np.divide(recording.scene.model.size, depth, out=np.ones_like(depth), where=depth > 0.0)
    # Rounding of two positions over their difference: SINGLE size / depth.
    angle = (
        ANGLE_ROUNDING
        + SINGLE_ROUNDINGS * SINGLE * np.maximum(stretch, 1.0)
        + _resolution_angle(recording, pressed_rows)
        + _corner_rounding_angle(recording, pressed_rows)
    )
    # Aside by a declared quantum, or by half a step of a log in every component.
    sizes = np.linalg.norm(recording.force[pressed_rows], axis=1)
    return np.asarray(angle + np.arcsin(np.minimum(force_coarseness(recording) / sizes, 1.0)))


def _corner_rounding_angle(recording: Observed, pressed_rows: IntArray) -> Array:
    """Return the angle (n,), rad, by which the triangle under each IHIP tilts where its corners are rounded.

    That is the rounding over the least height, of a renderer that answers in single precision; 0 of others.
    """
    rounded, mesh = recording.answered_rounding, recording.boundary
    if rounded == 0.0 or not isinstance(mesh, Mesh):
        return np.zeros(pressed_rows.size)
    heights = mesh.least_heights(recording.ihip[pressed_rows])
    return np.asarray(np.arctan2(rounded, heights))


def static_balance(recording: Observed) -> StaticBalance | Unbalanced:
    """Return how force and push balance at rest, or why there is nothing to balance.

    Over a window of W seconds the mean of all forces is m (v_end - v_start) / W, so a tool whose speed stays below
    v_max may show up to 2 m v_max / W. At rest means that this is a small part of the operator's push.

    Nobody asks without an operator, or of a constraint that holds from both sides.
    """
    scene = recording.scene
    if "operator_force" not in recording.channels or scene.bilateral:
        return Unbalanced("")
    count = max(int(STATIC_SHARE * len(recording)), 2)
    if count > len(recording):
        return Unbalanced("")
    window = slice(len(recording) - count, len(recording))
    ihip, velocity = recording.ihip[window], recording.velocity[window]
    travel = float(np.linalg.norm(np.ptp(ihip, axis=0)))
    # At one place as well as one can be told: and so with one normal.
    still = recording.position_tolerance
    if not recording.contact[window].all():
        return Unbalanced("the tool is not in contact to the end")
    if travel > still:
        return Unbalanced("the tool is not at rest at the end")
    normal = recording.boundary.closest_point(ihip[-1:]).normal[0]
    # The last force acts behind the last velocity that is known.
    acting = slice(window.start, window.stop - 1)
    force = float(np.mean(recording.force[acting] @ normal))
    # The push is positive into the surface.
    push = -float(np.mean(recording.channels["operator_force"][acting] @ normal))
    if motors_hold_back(recording, acting):
        return Unbalanced("at the end motors hold back what the renderer asks for")
    momentum = scene.mass * float(np.max(np.abs(velocity @ normal)))
    if not isinstance(scene.robot, PointMass):
        # The inertia of a robot differs with the direction: what moves along the surface has a momentum across it too.
        heaviest = heaviest_mass(scene.robot, recording.hip[-1])
        momentum = max(scene.mass, heaviest) * float(np.max(np.linalg.norm(velocity, axis=1)))
    # 2 m v_max / W, and the rounding of a push in single precision
    allowed = 2.0 * momentum / ((count - 1) * recording.dt) + SINGLE * abs(push)
    if push <= 0.0:
        return Unbalanced("at the end the operator does not push into the surface")
    if allowed > TELLING_SHARE * push:
        return Unbalanced("at the end the tool's momentum may make a tenth of the push or more")
    # (3.3): F_n = -(n_e . F_o) n_e, so the difference is zero at rest.
    return StaticBalance(force - push, allowed, push)


def motors_hold_back(recording: Observed, rows: slice) -> bool:
    """Return whether in some of the rows motors hold back what the renderer asks for: at their limit, or rubbing."""
    saturation = recording.scene.effect(SATURATION)
    limited = saturation is not None and "joint_torque" in recording.channels
    at_limit = limited and bool(np.any(np.abs(recording.channels["joint_torque"][rows]) >= saturation.limit))
    return at_limit or recording.scene.effect(JOINT_FRICTION) is not None


CHECK = Check(
    id="contact-normal-force",
    phenomenon="Contact Normal Force",
    formula="F_n = -(n_e . F_o) n_e (3.3), with n_e = n_c (3.4); at a corner n_e lies between the faces' normals",
    citation="thesis 3.2.1, (3.3), (3.4), Figures 3.3 to 3.5; (6.1)",
    channels=("hip", "force"),
    reads_also=("ihip", "operator_force", "velocity", "joint_torque"),
    siblings={
        "fresh": "for a failure without a known cause, through a new renderer",
    },
    not_with=(Alters.FREE_SPACE, Alters.MOTION),
    metric="angle of the force outside the true normals; at rest, the difference in newtons",
    unit="deg",
    judge=judge,
)
