"""Tangential dynamics (7.1c): along the surface the tool moves as the scene assigns, and as nothing else does."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.force_sensor import ForceSensor
from hapticeval.effects.viscosity import viscosity_of
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.refinement import left
from hapticeval.phenomena.sampling import LED, TELLS, place
from hapticeval.phenomena.surface_motion import SurfaceMotion
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array


def judge(runs: Runs, scene: Scene) -> Finding:
    """The speed that the foot has gained or lost beyond what the assigned acceleration adds up to."""
    base = runs.base
    if base.meta.get("source") in LED:
        return Finding(Outcome.NOT_APPLICABLE, "a hand led along a given path has the speed that it is given")
    motion = SurfaceMotion(base, scene)
    if motion.footless is not None:
        return Finding(Outcome.INCONCLUSIVE, motion.footless)
    if not motion.slides:
        return Finding(Outcome.INCONCLUSIVE, "the tool does not slide")
    sensed = isinstance(scene.robot, PointMass) or scene.effect(ForceSensor) is not None
    if motion.pushed.any() and not sensed:
        message = "the operator pushes a robot without a force sensor: what that adds is the robot's own inertia's"
        return Finding(Outcome.INCONCLUSIVE, message)
    top = float(motion.foot_speed.max())
    remains = left(runs, lambda recording: _unexplained(recording, scene))
    excess = np.linalg.norm(remains.values, axis=1) / top
    tick = int(np.argmax(excess))
    value = float(excess[tick])
    bound = remains.change * np.sqrt(remains.values.shape[1]) if remains.settled else float(motion.held_speed[-1])
    bound = bound / top + 1e-9
    evidence: dict[str, object] = {
        **place(base, tick),
        "assigned_viscosity_kg_s": viscosity_of(scene),
        "apparent_viscosity_kg_s": _apparent_viscosity(motion),
        "foot_speed_at_start_m_s": float(motion.foot_speed[0]),
        "foot_speed_at_end_m_s": float(motion.foot_speed[-1]),
        "settled_by_refinement": remains.settled,
    }
    metric = Metric("speed along the surface that the assigned dynamics do not explain, of the top speed", value, "")
    if bound > TELLS:
        message = "what the sampling may do to the speed is too much to tell"
        return Finding(Outcome.INCONCLUSIVE, message, metric, bound, evidence)
    if value <= bound:
        return Finding(Outcome.PASS, "the tool slides as assigned", metric, bound, evidence)
    message = (
        f"{100.0 * value:.3g} per cent of the sliding speed come or go unassigned, as if the surface had a viscosity "
        f"of {_apparent_viscosity(motion):.3g} kg/s instead of {viscosity_of(scene):.3g}"
    )
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


def _assigned(motion: SurfaceMotion) -> Array:
    """The assigned covariant acceleration of the foot (n, N): -(b_d / m) p' (7.18), and what the hand adds.

    A force that is sensed is fed to the foot (8.9); else it moves the tool, and so the foot by (I + n W)^-1 of that.
    """
    scene, recording = motion.scene, motion.recording
    acceleration = -(viscosity_of(scene) / scene.mass) * motion.foot_velocity
    push = recording.channels.get("operator_force")
    if push is not None:
        normal = motion.frame.normal
        along = (push - np.sum(push * normal, axis=1)[:, np.newaxis] * normal) / scene.mass
        sensed = scene.effect(ForceSensor) is not None
        acceleration = acceleration + (along if sensed else motion.pulled_back(along))
    return np.asarray(acceleration)


def _unexplained(recording: Recording, scene: Scene) -> Array:
    """p'(t) - p'(0) less the integral of the assigned acceleration, in transported bases: (n, N - 1), m/s.

    Viscous terms by the trapezoidal rule; the operator's force is recorded as its mean until the next sample.
    """
    motion = SurfaceMotion(recording, scene)
    moved = motion.components(motion.foot_velocity)
    viscous = -(viscosity_of(scene) / scene.mass) * moved
    pushed = motion.components(_assigned(motion)) - viscous
    step = np.diff(recording.time)[:, np.newaxis]
    gained = np.cumsum(step * (0.5 * (viscous[:-1] + viscous[1:]) + pushed[:-1]), axis=0)
    return np.asarray(moved - moved[0] - np.vstack([np.zeros((1, moved.shape[1])), gained]))


def _apparent_viscosity(motion: SurfaceMotion) -> float:
    """b (kg/s) that explains the loss of speed best: least squares of p'' - push / m = -(b / m) p', integrated.

    The sum of p' . dp' is half the change of |p'|^2, so that no derivative is taken.
    """
    scene, recording = motion.scene, motion.recording
    speed2 = motion.foot_speed**2
    step = np.diff(recording.time)
    given = _assigned(motion) + (viscosity_of(scene) / scene.mass) * motion.foot_velocity
    work = float(np.sum(step * np.sum(motion.foot_velocity * given, axis=1)[:-1]))
    slid = float(np.sum(step * 0.5 * (speed2[:-1] + speed2[1:])))
    return scene.mass * (work - 0.5 * float(speed2[-1] - speed2[0])) / slid if slid > 0.0 else 0.0


CHECK = Check(
    id="tangential-dynamics",
    phenomenon="Tangential dynamics",
    asks="Along the surface, does the tool move as assigned: freely, or with the surface's viscosity?",
    formula=(
        "P_T(y'' - a) = 0 on S (7.1 c): Dp'/dt = -(b_d / m) p' (7.18), plus P_T F_o / m where F_o is sensed (8.9), "
        "else (I + n W)^-1 of that"
    ),
    citation="thesis 7.1, Problem 7.1 (c); (7.17), (7.18); 6.3.2, 6.3.3",
    channels=("hip", "velocity", "force", "operator_force where it was recorded"),
    siblings="the same experiment at 2 and 4 times the sampling rate",
    metric="speed along the surface that the assigned dynamics do not explain, of the top speed",
    unit="",
    bound=(
        "The foot's velocity, in bases carried along the surface without turning, changes at the covariant "
        "acceleration's rate; what it has changed since the start less the assigned acceleration's integral must "
        "vanish at all times. That is an integral, so that no noise is amplified. 2 q(T/4) - q(T/2) removes the "
        "first order of sampling, and the bound is what that leaves at the most, as for output-invariance. Where "
        "halving the tick does not settle it, the impulse that 1.5 ticks of the force's change along the surface "
        "may have given. A bound above a tenth is inconclusive; so is a hand that pushes a robot without a force "
        "sensor, for the assigned dynamics do not say what it should feel. The apparent viscosity is the "
        "least-squares one of the whole run."
    ),
    judge=judge,
)
