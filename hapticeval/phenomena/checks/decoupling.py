"""Decoupling (6.3.3, 7.3.2): moving across the surface leaves the speed along it as assigned."""

from __future__ import annotations

import numpy as np

from hapticeval.effects.effect import Alters
from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.decisions import DIED_OUT_SHARE, PLACE_ROUNDING, SHARE_ROUNDING, SLIDE_SHARE, TELLING_SHARE
from hapticeval.phenomena.measures.refinement import richardson_two_level
from hapticeval.phenomena.measures.surface_motion import (
    DOES_NOT_SLIDE,
    FINER,
    SPEED_GIVEN,
    TOO_MUCH,
    SurfaceMotion,
    never_across,
)
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import mm, worst_row
from hapticeval.phenomena.verdict import Finding, compared, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure how far the foot's speed strays from the assigned one while the tool moves across the surface."""
    base = runs.observed(scene)
    motion = SurfaceMotion(base)
    if motion.footless is not None:
        return undecided(motion.footless)
    distance = np.abs(motion.distance)
    farthest = float(distance.max())
    if farthest <= motion.held_distance() + motion.sensor_error + PLACE_ROUNDING * scene.model.size:
        return never_across(base, "the tool does not move across the surface")
    if motion.pushed.any():
        return undecided("the operator pushes, which changes the speed too")
    start = float(motion.foot_speed[0])
    if start * (base.time[-1] - base.time[0]) <= SLIDE_SHARE * scene.model.size:
        return undecided(DOES_NOT_SLIDE)
    remains = richardson_two_level(runs, scene, _speed_deviation)
    # Judged while the tool moves across: from the start until it is nearly home.
    last = min(int(np.flatnonzero(distance > DIED_OUT_SHARE * farthest)[-1]), len(remains.values) - 1)
    deviation = np.abs(remains.values[: last + 1])
    tick = worst_row(deviation)
    metric = CHECK.measured(deviation[tick])
    bound = (remains.change if remains.settled else float(motion.held_speed[last]) / start) + SHARE_ROUNDING
    evidence: dict[str, object] = {
        **base.evidence_at(tick),
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


def _speed_deviation(recording: Observed) -> Array:
    """Return |p'| over the assigned one less 1, where b_d alone slows the foot: (n,)."""
    scene = recording.scene
    speed = SurfaceMotion(recording).foot_speed
    # |p'(t)| = |p'(0)| exp(-b_d t / m)
    assigned = speed[0] * np.exp(-scene.viscosity / scene.mass * (recording.time - recording.time[0]))
    return np.asarray(speed / assigned - 1.0)


CHECK = Check(
    id="decoupling",
    phenomenon="Decoupling of across and along",
    formula="p' = (I + n W)^-1 P_T y'; |p'(t)| = |p'(0)| exp(-b_d t / m) while n moves",
    citation="thesis 6.3.3, 7.3.2, (7.38)",
    channels=("hip", "velocity", "force"),
    reads_also=("operator_force", "measured_hip"),
    siblings=FINER,
    not_for={Situation.LED: SPEED_GIVEN},
    holds=True,
    not_with=(Alters.FREE_SPACE, Alters.MOTION),
    metric="change of the foot's speed while the tool moves across",
    unit="",
    judge=judge,
)
