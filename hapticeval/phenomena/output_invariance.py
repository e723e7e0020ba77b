"""Output invariance (7.1b): a tool that starts on the surface and moves along it stays on it."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.refinement import left
from hapticeval.phenomena.sampling import LED, TELLS, place
from hapticeval.phenomena.surface_motion import SurfaceMotion
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """The largest distance from the surface that faster sampling does not remove."""
    base = runs.base
    if base.meta.get("source") in LED:
        return Finding(Outcome.NOT_APPLICABLE, "a hand led along a given path does not move by itself")
    if not scene.bilateral:
        return Finding(Outcome.NOT_APPLICABLE, "a surface that only pushes does not keep a tool from leaving")
    motion = SurfaceMotion(base, scene)
    if not motion.starts_on_surface:
        return Finding(Outcome.INCONCLUSIVE, "the tool does not start on the surface with a speed along it")
    if motion.pushed.any():
        return Finding(Outcome.INCONCLUSIVE, "the operator pushes: what follows is the answer to that")
    if motion.footless is not None:
        return Finding(Outcome.INCONCLUSIVE, motion.footless)
    if not motion.slides:
        return Finding(Outcome.INCONCLUSIVE, "the tool does not slide")
    remains = left(runs, lambda recording: SurfaceMotion(recording, scene).distance)
    distance = np.abs(remains.values)
    tick = int(np.argmax(distance))
    value = float(distance[tick])
    cost = float(np.max(np.abs(motion.centripetal))) / scene.stiffness
    bound = remains.change if remains.settled else motion.held_distance()
    bound += motion.sensor_error + 1e-10 * scene.model.size
    evidence: dict[str, object] = {
        **place(base, tick),
        "distance_at_this_sampling_m": float(np.max(np.abs(motion.distance))),
        "settled_by_refinement": remains.settled,
        "m_kappa_v2_over_K_m": cost,
    }
    metric = Metric("distance from the surface that refinement leaves", value, "m")
    if cost > 0.0 and bound > TELLS * cost:
        message = f"what the sampling may do, {1e3 * bound:.3g} mm, hides what a missing centripetal force would"
        return Finding(Outcome.INCONCLUSIVE, message, metric, bound, evidence)
    if value <= bound:
        return Finding(Outcome.PASS, "the tool stays on the surface", metric, bound, evidence)
    message = f"the tool leaves the surface by {1e3 * value:.3g} mm, at t = {base.time[tick]:.4g} s"
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


CHECK = Check(
    id="output-invariance",
    phenomenon="Output invariance of the constraint",
    asks="Does a tool that starts on the surface, moving along it, stay on the surface?",
    formula="n(0) = n'(0) = 0 => n(t) = 0 (7.1 b)",
    citation="thesis 7.1, Problem 7.1 (b); 7.3.2, Figure 7.3",
    channels=("hip", "velocity", "operator_force and measured_hip where they were recorded"),
    siblings="the same experiment at 2 and 4 times the sampling rate",
    metric="distance from the surface that refinement leaves",
    unit="m",
    bound=(
        "A held force is late by half a tick on average, which costs a distance of first order in the tick T or "
        "smaller. 2 n(T/4) - n(T/2) is free of that first order, and is wrong by less than d' = n(T/4) - n(T/2) or, "
        "where two orders cancel in that, by a third of 2 d' - d, d = n(T/2) - n(T): the larger of |d'| and half of "
        "|2 d' - d| is the bound. Where halving the tick does not shrink the change by a quarter at least, as with "
        "an encoder or with friction, or no finer run can be had, n itself must stay within what a held force "
        "leaves: 1.5 ticks of change of the centripetal force over K_p, with the overshoot of the assigned "
        "dynamics. To both comes what the position sensors are wrong by, and 1e-10 of the model for rounding. A "
        "bound above a tenth of m kappa v^2 / K_p, what a renderer without the centripetal force pays, is "
        "inconclusive."
    ),
    judge=judge,
)
