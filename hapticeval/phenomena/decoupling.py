"""Decoupling (7.3.2): motion across the surface does not change the speed along it."""

from __future__ import annotations

import numpy as np

from hapticeval.effects.viscosity import viscosity_of
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.refinement import left
from hapticeval.phenomena.sampling import LED, TELLS, place
from hapticeval.phenomena.surface_motion import SLIDES, SurfaceMotion
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array

GONE = 0.05
"""Share of the largest distance below which the motion across counts as over."""


def judge(runs: Runs, scene: Scene) -> Finding:
    """How far the foot's speed strays from the assigned one while the tool moves across."""
    base = runs.base
    if base.meta.get("source") in LED:
        return Finding(Outcome.NOT_APPLICABLE, "a hand led along a given path has the speed that it is given")
    motion = SurfaceMotion(base, scene)
    if motion.footless is not None:
        return Finding(Outcome.INCONCLUSIVE, motion.footless)
    distance = np.abs(motion.distance)
    floor = motion.held_distance() + motion.sensor_error + 1e-9 * scene.model.size
    if distance.max() <= floor:
        return Finding(Outcome.INCONCLUSIVE, "the tool does not move across the surface")
    if motion.pushed.any():
        return Finding(Outcome.INCONCLUSIVE, "the operator pushes, which changes the speed too")
    start = float(motion.foot_speed[0])
    if start * (base.time[-1] - base.time[0]) <= SLIDES * scene.model.size:
        return Finding(Outcome.INCONCLUSIVE, "the tool does not slide")
    moving = np.arange(len(base)) <= int(np.flatnonzero(distance > GONE * distance.max())[-1])
    remains = left(runs, lambda recording: _deviation(recording, scene))
    moving = moving[: len(remains.values)]
    deviation = np.where(moving, np.abs(remains.values), 0.0)
    tick = int(np.argmax(deviation))
    bound = remains.change if remains.settled else float(motion.held_speed[: moving.size][moving][-1]) / start
    bound += 1e-9
    evidence: dict[str, object] = {
        **place(base, tick),
        "largest_distance_m": float(distance.max()),
        "moves_across_until_s": float(base.time[: moving.size][moving][-1]),
        "foot_speed_at_start_m_s": start,
        "foot_speed_there_m_s": float(motion.foot_speed[tick]),
        "settled_by_refinement": remains.settled,
    }
    metric = Metric("change of the foot's speed while the tool moves across", float(deviation[tick]), "")
    if bound > TELLS:
        message = "what the sampling may do to the speed is too much to tell"
        return Finding(Outcome.INCONCLUSIVE, message, metric, bound, evidence)
    if metric.value <= bound:
        return Finding(
            Outcome.PASS, "the speed along the surface is kept while the tool moves across", metric, bound, evidence
        )
    message = (
        f"while the tool moves up to {1e3 * float(distance.max()):.3g} mm across, its speed along the surface "
        f"strays by {100.0 * metric.value:.3g} per cent"
    )
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


def _deviation(recording: Recording, scene: Scene) -> Array:
    """|p'| over the assigned one less 1, where b_d alone slows the foot: (n,)."""
    speed = SurfaceMotion(recording, scene).foot_speed
    assigned = speed[0] * np.exp(-viscosity_of(scene) / scene.mass * (recording.time - recording.time[0]))
    return np.asarray(speed / assigned - 1.0)


CHECK = Check(
    id="decoupling",
    phenomenon="Decoupling of across and along",
    asks="Is the speed along the surface kept while the tool moves across it?",
    formula="p' = (I + n W)^-1 P_T y'; |p'(t)| = |p'(0)| exp(-b_d t / m) while n moves",
    citation="thesis 6.3.3, 7.3.2, (7.38)",
    channels=("hip", "velocity", "force", "operator_force where it was recorded"),
    siblings="the same experiment at 2 and 4 times the sampling rate",
    metric="change of the foot's speed while the tool moves across",
    unit="",
    bound=(
        "Judged from the start until the distance stays below a twentieth of its largest. The foot's speed is arc "
        "length a second, so that moving across has no share in it by itself; a law that leaves out 2 kappa n' s' "
        "changes it by 2 kappa n. 2 q(T/4) - q(T/2) of the relative change q removes the first order of sampling, "
        "and the bound is what that leaves at the most, as for output-invariance. Where halving the tick does not "
        "settle it, the impulse that 1.5 ticks of the force's change along the surface may have given, over m "
        "|p'(0)|. A bound above a tenth is inconclusive."
    ),
    judge=judge,
)
