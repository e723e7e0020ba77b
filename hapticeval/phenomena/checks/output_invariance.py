"""Output invariance (Problem 7.1 b): a tool that starts on the surface stays on it, but for what the sampling does."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.decisions import EXTRAPOLATION_ROUNDING, TELLING_SHARE
from hapticeval.phenomena.measures.refinement import richardson_two_level
from hapticeval.phenomena.measures.surface_motion import DOES_NOT_SLIDE, FINER, SurfaceMotion
from hapticeval.phenomena.sampling import mm, worst_row
from hapticeval.phenomena.verdict import Finding, compared, undecided
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure the largest distance from the surface that faster sampling does not remove."""
    base = runs.observed(scene)
    motion = SurfaceMotion(base)
    if not motion.starts_on_surface:
        return undecided("the tool does not start on the surface with a speed along it")
    if motion.pushed.any():
        return undecided("the operator pushes: what follows is the answer to that")
    if motion.footless is not None or not motion.slides:
        return undecided(motion.footless or DOES_NOT_SLIDE)
    # Problem 7.1 (b): n(0) = n'(0) = 0 implies n(t) = 0. What shrinks with the tick is the sampling's.
    remains = richardson_two_level(runs, scene, lambda run: SurfaceMotion(run).distance)
    distance = np.abs(remains.values)
    tick = worst_row(distance)
    # m kappa v^2 / K_p: what a law without a centripetal term would stand off.
    cost = float(np.max(np.abs(motion.centripetal))) / scene.stiffness
    # Where refinement does not settle it, what a held force may let drift is the bound.
    bound = remains.change if remains.settled else motion.held_distance()
    bound += motion.sensor_error + EXTRAPOLATION_ROUNDING * scene.model.size
    evidence: dict[str, object] = {
        **base.evidence_at(tick),
        "distance_at_this_sampling_m": float(np.max(np.abs(motion.distance))),
        "settled_by_refinement": remains.settled,
        "m_kappa_v2_over_K_m": cost,
    }
    metric = CHECK.measured(distance[tick])
    if cost > 0.0 and bound > TELLING_SHARE * cost:
        message = f"what the sampling may do, {mm(bound)}, hides what a missing centripetal force would"
        return undecided(message, metric, bound, evidence)
    fails = f"the tool leaves the surface by {mm(metric.value)}, at t = {base.time[tick]:.4g} s"
    return compared(metric, bound, evidence, passes="the tool stays on the surface", fails=fails)


CHECK = Check(
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
    judge=judge,
)
