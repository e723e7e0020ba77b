"""Tangential dynamics (Problem 7.1 c): the tool slides as assigned, but for what the sampling does."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.effect import Alters
from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.decisions import CAUSE_SHARE, SHARE_ROUNDING, TELLING_SHARE
from hapticeval.phenomena.measures.refinement import richardson_two_level
from hapticeval.phenomena.measures.surface_force import along_surface
from hapticeval.phenomena.measures.surface_motion import DOES_NOT_SLIDE, FINER, SPEED_GIVEN, TOO_MUCH, SurfaceMotion
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import worst_row
from hapticeval.phenomena.verdict import Finding, compared, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure the speed that the foot has gained or lost beyond what the assigned acceleration adds up to."""
    base = runs.observed(scene)
    motion = SurfaceMotion(base)
    if motion.footless is not None or not motion.slides:
        return undecided(motion.footless or DOES_NOT_SLIDE)
    # A point mass obeys the push as the law says; a robot's own inertia has to be told by a sensor (8.9).
    sensed = isinstance(scene.robot, PointMass) or scene.senses_force
    if motion.pushed.any() and not sensed:
        return undecided(
            "the operator pushes a robot without a force sensor: its own inertia has a share in the motion"
        )
    top = float(motion.foot_speed.max())
    remains = richardson_two_level(runs, scene, unexplained_velocity)
    excess = np.linalg.norm(remains.values, axis=1) / top
    tick = worst_row(excess)
    metric = CHECK.measured(excess[tick])
    bound = remains.change * np.sqrt(remains.values.shape[1]) if remains.settled else float(motion.held_speed[-1])
    bound = bound / top + SHARE_ROUNDING
    viscosity = apparent_viscosity(motion)
    evidence: dict[str, object] = {
        **base.evidence_at(tick),
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
        f"{describe_unexplained(motion, remains.values, viscosity, tick)}"
    )
    return compared(metric, bound, evidence, passes="the tool slides as assigned", fails=fails)


def describe_unexplained(motion: SurfaceMotion, unexplained: Array, viscosity: float, tick: int) -> str:
    """Say what the unexplained velocity (n, M), m/s, is like: another viscosity (kg/s) where that makes most.

    M = N - 1 are the directions along the surface.
    """
    moved = motion.components(motion.foot_velocity)[: len(unexplained)]
    assigned = motion.base.scene.viscosity
    # A viscosity b' instead of b takes (b' - b) / m of the velocity per second of sliding.
    slid = np.cumsum(moved * motion.base.dt, axis=0)
    remainder = unexplained + (viscosity - assigned) / motion.base.scene.mass * slid
    if np.sum(remainder**2) <= CAUSE_SHARE * np.sum(unexplained**2):
        return f", as if the surface had a viscosity of {viscosity:.3g} kg/s instead of {assigned:.3g}"
    along = float(np.sum(unexplained[tick] * moved[tick]))
    return f": by t = {motion.base.time[tick]:.4g} s the tool is {'driven on' if along > 0.0 else 'braked'}"


def apparent_viscosity(motion: SurfaceMotion) -> float:
    """Return b (kg/s) that explains the loss of speed best: least squares of p'' - push / m = -(b / m) p', integrated.

    The sum of p' . dp' is half the change of |p'|^2, so that no derivative is taken.
    """
    scene, recording = motion.base.scene, motion.base
    speed2 = motion.foot_speed**2
    step = np.diff(recording.time)
    # <p', dp'> = d|p'|^2 / 2 = <p', push / m> dt - (b / m) |p'|^2 dt, summed and solved for b.
    work = float(np.sum(step * np.sum(motion.foot_velocity * _pushed_along(motion), axis=1)[:-1]))
    slid = float(np.sum(step * 0.5 * (speed2[:-1] + speed2[1:])))
    return scene.mass * (work - 0.5 * float(speed2[-1] - speed2[0])) / slid if slid > 0.0 else 0.0


def _pushed_along(motion: SurfaceMotion) -> Array:
    """Return what the hand adds to the assigned covariant acceleration of the foot, (n, N), m/s^2.

    A force that is sensed is fed to the foot (8.9); else it moves the tool, and so the foot by (I + n W)^-1 of that.
    """
    push = motion.base.channels.get("operator_force")
    if push is None:
        return np.zeros_like(motion.foot_velocity)
    # P_T F_o / m
    along = along_surface(push, motion.frame.normal) / motion.base.scene.mass
    return along if motion.base.scene.senses_force else motion.pulled_back(along)


def unexplained_velocity(recording: Observed) -> Array:
    """Return the velocity that nothing assigned explains, in transported bases: (n, N - 1), m/s.

    That is p'(t) - p'(0) less the integral of the assigned acceleration: -(b_d / m) p' (7.18), and what the hand adds.
    Viscous terms by the trapezoidal rule; the
    operator's force is recorded as its mean until the next sample.
    """
    scene = recording.scene
    motion = SurfaceMotion(recording)
    moved = motion.components(motion.foot_velocity)
    # Transported components: their rate of change is the covariant acceleration Dp'/dt.
    viscous = -(scene.viscosity / scene.mass) * moved
    assigned = -(scene.viscosity / scene.mass) * motion.foot_velocity + _pushed_along(motion)
    pushed = motion.components(assigned) - viscous
    step = np.diff(recording.time)[:, np.newaxis]
    # Trapezoid of the viscous part; the push of a row holds until the next.
    gained = np.cumsum(step * (0.5 * (viscous[:-1] + viscous[1:]) + pushed[:-1]), axis=0)
    return np.asarray(moved - moved[0] - np.vstack([np.zeros((1, moved.shape[1])), gained]))


CHECK = Check(
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
    not_with=(Alters.FREE_SPACE, Alters.MOTION),
    metric="speed along the surface that the assigned dynamics do not explain, of the top speed",
    unit="",
    judge=judge,
)
