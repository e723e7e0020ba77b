"""Motion along and across a surface (Problem 7.1 b, c): output invariance, decoupling and tangential dynamics.

Each measures how far the loop is from what the scene assigns, and takes away what only the sampling does.
"""

from __future__ import annotations

import numpy as np

from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.catalogue import FORCE_SENSOR, FRICTION, LUGRE, VISCOUS_FRICTION
from hapticeval.phenomena.check import Check, Runs, Sibling, Situation
from hapticeval.phenomena.decisions import (
    CAUSE_SHARE,
    DIED_OUT_SHARE,
    EXTRAPOLATION_ROUNDING,
    PLACE_ROUNDING,
    SLIDE_SHARE,
    SPEED_ROUNDING,
    TELLING_SHARE,
)
from hapticeval.phenomena.refinement import richardson_two_level
from hapticeval.phenomena.sampling import evidence_at, mm
from hapticeval.phenomena.surface_motion import SurfaceMotion
from hapticeval.phenomena.verdict import Finding, Metric, compared, undecided
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array

SPEED_GIVEN = "a hand led along a given path has the speed that it is given"
TOO_MUCH = "what the sampling may do to the speed is too much to decide"
DOES_NOT_SLIDE = "the tool does not slide"


def judge_output_invariance(runs: Runs, scene: Scene) -> Finding:
    """Measure the largest distance from the surface that faster sampling does not remove."""
    base = runs.base
    motion = SurfaceMotion(base, scene)
    if not motion.starts_on_surface:
        return undecided("the tool does not start on the surface with a speed along it")
    if motion.pushed.any():
        return undecided("the operator pushes: what follows is the answer to that")
    if motion.footless is not None or not motion.slides:
        return undecided(motion.footless or DOES_NOT_SLIDE)
    # Problem 7.1 (b): n(0) = n'(0) = 0 implies n(t) = 0. What shrinks with the tick is the sampling's.
    remains = richardson_two_level(runs, lambda recording: SurfaceMotion(recording, scene).distance)
    distance = np.abs(remains.values)
    tick = int(np.argmax(distance))
    # m kappa v^2 / K_p: what a law without a centripetal term would stand off.
    cost = float(np.max(np.abs(motion.centripetal))) / scene.stiffness
    # Where refinement does not settle it, what a held force may let drift is the bound.
    bound = remains.change if remains.settled else motion.held_distance()
    bound += motion.sensor_error + EXTRAPOLATION_ROUNDING * scene.model.size
    evidence: dict[str, object] = {
        **evidence_at(base, tick),
        "distance_at_this_sampling_m": float(np.max(np.abs(motion.distance))),
        "settled_by_refinement": remains.settled,
        "m_kappa_v2_over_K_m": cost,
    }
    metric = Metric(OUTPUT_INVARIANCE.metric, float(distance[tick]), "m")
    if cost > 0.0 and bound > TELLING_SHARE * cost:
        message = f"what the sampling may do, {mm(bound)}, hides what a missing centripetal force would"
        return undecided(message, metric, bound, evidence)
    fails = f"the tool leaves the surface by {mm(metric.value)}, at t = {base.time[tick]:.4g} s"
    return compared(metric, bound, evidence, passes="the tool stays on the surface", fails=fails)


def judge_decoupling(runs: Runs, scene: Scene) -> Finding:
    """Measure how far the foot's speed strays from the assigned one while the tool moves across the surface."""
    base = runs.base
    motion = SurfaceMotion(base, scene)
    if motion.footless is not None:
        return undecided(motion.footless)
    distance = np.abs(motion.distance)
    farthest = float(distance.max())
    if farthest <= motion.held_distance() + motion.sensor_error + PLACE_ROUNDING * scene.model.size:
        return undecided("the tool does not move across the surface")
    if motion.pushed.any():
        return undecided("the operator pushes, which changes the speed too")
    start = float(motion.foot_speed[0])
    if start * (base.time[-1] - base.time[0]) <= SLIDE_SHARE * scene.model.size:
        return undecided(DOES_NOT_SLIDE)
    remains = richardson_two_level(runs, lambda recording: _speed_deviation(recording, scene))
    # Judged while the tool moves across: from the start until it is nearly home.
    last = min(int(np.flatnonzero(distance > DIED_OUT_SHARE * farthest)[-1]), len(remains.values) - 1)
    deviation = np.abs(remains.values[: last + 1])
    tick = int(np.argmax(deviation))
    metric = Metric(DECOUPLING.metric, float(deviation[tick]), "")
    bound = (remains.change if remains.settled else float(motion.held_speed[last]) / start) + SPEED_ROUNDING
    evidence: dict[str, object] = {
        **evidence_at(base, tick),
        "largest_distance_m": farthest,
        "moves_across_until_s": float(base.time[last]),
        "foot_speed_at_start_m_s": start,
        "foot_speed_there_m_s": float(motion.foot_speed[tick]),
        "settled_by_refinement": remains.settled,
    }
    if bound > TELLING_SHARE:
        return undecided(TOO_MUCH, metric, bound, evidence)
    return compared(
        metric,
        bound,
        evidence,
        passes="the speed along the surface is kept while the tool moves across",
        fails=f"while the tool moves up to {mm(farthest)} across, its speed along the surface "
        f"strays by {100.0 * metric.value:.3g} per cent",
    )


def _speed_deviation(recording: Recording, scene: Scene) -> Array:
    """Return |p'| over the assigned one less 1, where b_d alone slows the foot: (n,)."""
    speed = SurfaceMotion(recording, scene).foot_speed
    # |p'(t)| = |p'(0)| exp(-b_d t / m)
    assigned = speed[0] * np.exp(-scene.viscosity / scene.mass * (recording.time - recording.time[0]))
    return np.asarray(speed / assigned - 1.0)


def judge_tangential_dynamics(runs: Runs, scene: Scene) -> Finding:
    """Measure the speed that the foot has gained or lost beyond what the assigned acceleration adds up to."""
    base = runs.base
    motion = SurfaceMotion(base, scene)
    if motion.footless is not None or not motion.slides:
        return undecided(motion.footless or DOES_NOT_SLIDE)
    # A point mass obeys the push as the law says; a robot's own inertia has to be told by a sensor (8.9).
    sensed = isinstance(scene.robot, PointMass) or scene.effect(FORCE_SENSOR) is not None
    if motion.pushed.any() and not sensed:
        return undecided(
            "the operator pushes a robot without a force sensor: its own inertia has a share in the motion"
        )
    top = float(motion.foot_speed.max())
    remains = richardson_two_level(runs, lambda recording: _unexplained_velocity(recording, scene))
    excess = np.linalg.norm(remains.values, axis=1) / top
    tick = int(np.argmax(excess))
    metric = Metric(TANGENTIAL_DYNAMICS.metric, float(excess[tick]), "")
    bound = remains.change * np.sqrt(remains.values.shape[1]) if remains.settled else float(motion.held_speed[-1])
    bound = bound / top + SPEED_ROUNDING
    viscosity = _apparent_viscosity(motion)
    evidence: dict[str, object] = {
        **evidence_at(base, tick),
        "assigned_viscosity_kg_s": scene.viscosity,
        "apparent_viscosity_kg_s": viscosity,
        "foot_speed_at_start_m_s": float(motion.foot_speed[0]),
        "foot_speed_at_end_m_s": float(motion.foot_speed[-1]),
        "settled_by_refinement": remains.settled,
    }
    if bound > TELLING_SHARE:
        return undecided(TOO_MUCH, metric, bound, evidence)
    fails = (
        f"{100.0 * metric.value:.3g} per cent of the sliding speed come or go unassigned"
        f"{_describe_unexplained(motion, remains.values, viscosity, tick)}"
    )
    return compared(metric, bound, evidence, passes="the tool slides as assigned", fails=fails)


def _describe_unexplained(motion: SurfaceMotion, unexplained: Array, viscosity: float, tick: int) -> str:
    """Say what the unexplained velocity, (n, N - 1), m/s, is like: another viscosity (kg/s) where that makes most."""
    moved = motion.components(motion.foot_velocity)[: len(unexplained)]
    assigned = motion.scene.viscosity
    # A viscosity b' instead of b takes (b' - b) / m of the velocity per second of sliding.
    slid = np.cumsum(moved * motion.recording.dt, axis=0)
    remainder = unexplained + (viscosity - assigned) / motion.scene.mass * slid
    if np.sum(remainder**2) <= CAUSE_SHARE * np.sum(unexplained**2):
        return f", as if the surface had a viscosity of {viscosity:.3g} kg/s instead of {assigned:.3g}"
    along = float(np.sum(unexplained[tick] * moved[tick]))
    return f": by t = {motion.recording.time[tick]:.4g} s the tool is {'driven on' if along > 0.0 else 'braked'}"


def _pushed_along(motion: SurfaceMotion) -> Array:
    """Return what the hand adds to the assigned covariant acceleration of the foot, (n, N), m/s^2.

    A force that is sensed is fed to the foot (8.9); else it moves the tool, and so the foot by (I + n W)^-1 of that.
    """
    push = motion.recording.channels.get("operator_force")
    if push is None:
        return np.zeros_like(motion.foot_velocity)
    normal = motion.frame.normal
    # P_T F_o / m
    along = (push - np.sum(push * normal, axis=1)[:, np.newaxis] * normal) / motion.scene.mass
    sensed = motion.scene.effect(FORCE_SENSOR) is not None
    return along if sensed else motion.pulled_back(along)


def _unexplained_velocity(recording: Recording, scene: Scene) -> Array:
    """Return the velocity that nothing assigned explains, in transported bases: (n, N - 1), m/s.

    That is p'(t) - p'(0) less the integral of the assigned acceleration: -(b_d / m) p' (7.18), and what the hand adds.
    Viscous terms by the trapezoidal rule; the
    operator's force is recorded as its mean until the next sample.
    """
    motion = SurfaceMotion(recording, scene)
    moved = motion.components(motion.foot_velocity)
    # Transported components: their rate of change is the covariant acceleration Dp'/dt.
    viscous = -(scene.viscosity / scene.mass) * moved
    assigned = -(scene.viscosity / scene.mass) * motion.foot_velocity + _pushed_along(motion)
    pushed = motion.components(assigned) - viscous
    step = np.diff(recording.time)[:, np.newaxis]
    # Trapezoid of the viscous part; the push of a row holds until the next.
    gained = np.cumsum(step * (0.5 * (viscous[:-1] + viscous[1:]) + pushed[:-1]), axis=0)
    return np.asarray(moved - moved[0] - np.vstack([np.zeros((1, moved.shape[1])), gained]))


def _apparent_viscosity(motion: SurfaceMotion) -> float:
    """Return b (kg/s) that explains the loss of speed best: least squares of p'' - push / m = -(b / m) p', integrated.

    The sum of p' . dp' is half the change of |p'|^2, so that no derivative is taken.
    """
    scene, recording = motion.scene, motion.recording
    speed2 = motion.foot_speed**2
    step = np.diff(recording.time)
    viscous = (scene.viscosity / scene.mass) * motion.foot_velocity
    driven = -viscous + _pushed_along(motion) + viscous
    # <p', dp'> = d|p'|^2 / 2 = <p', push / m> dt - (b / m) |p'|^2 dt, summed and solved for b.
    work = float(np.sum(step * np.sum(motion.foot_velocity * driven, axis=1)[:-1]))
    slid = float(np.sum(step * 0.5 * (speed2[:-1] + speed2[1:])))
    return scene.mass * (work - 0.5 * float(speed2[-1] - speed2[0])) / slid if slid > 0.0 else 0.0


FINER = {Sibling.REFINE: "the same experiment at 2 and 4 times the sampling rate"}

OUTPUT_INVARIANCE = Check(
    id="output-invariance",
    phenomenon="Output invariance of the constraint",
    formula="n(0) = n'(0) = 0 => n(t) = 0 (7.1 b)",
    citation="thesis 7.1, Problem 7.1 (b); 7.3.2, Figure 7.3",
    channels=("hip", "velocity"),
    reads_also=("operator_force", "measured_hip"),
    siblings=FINER,
    not_for={
        Situation.LED: "a hand led along a given path does not move by itself",
        Situation.UNILATERAL: "a surface that only pushes does not keep a tool from leaving",
    },
    holds=True,
    metric="distance from the surface that refinement leaves",
    unit="m",
    judge=judge_output_invariance,
)

DECOUPLING = Check(
    id="decoupling",
    phenomenon="Decoupling of across and along",
    formula="p' = (I + n W)^-1 P_T y'; |p'(t)| = |p'(0)| exp(-b_d t / m) while n moves",
    citation="thesis 6.3.3, 7.3.2, (7.38)",
    channels=("hip", "velocity", "force"),
    reads_also=("operator_force", "measured_hip"),
    siblings=FINER,
    not_for={Situation.LED: SPEED_GIVEN},
    holds=True,
    not_with=(FRICTION, VISCOUS_FRICTION, LUGRE),
    metric="change of the foot's speed while the tool moves across",
    unit="",
    judge=judge_decoupling,
)

TANGENTIAL_DYNAMICS = Check(
    id="tangential-dynamics",
    phenomenon="Tangential dynamics",
    formula=(
        "P_T(y'' - a) = 0 on S (7.1 c): Dp'/dt = -(b_d / m) p' (7.18), plus P_T F_o / m where F_o is sensed (8.9), "
        "else (I + n W)^-1 of that"
    ),
    citation="thesis 7.1, Problem 7.1 (c); (7.17), (7.18); 6.3.2, 6.3.3",
    channels=("hip", "velocity", "force"),
    reads_also=("operator_force",),
    siblings=FINER,
    not_for={Situation.LED: SPEED_GIVEN},
    holds=True,
    not_with=(FRICTION, VISCOUS_FRICTION, LUGRE),
    metric="speed along the surface that the assigned dynamics do not explain, of the top speed",
    unit="",
    judge=judge_tangential_dynamics,
)

CHECKS = (OUTPUT_INVARIANCE, DECOUPLING, TANGENTIAL_DYNAMICS)
