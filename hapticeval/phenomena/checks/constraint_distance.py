"""Constraint distance: how far off the surface a tool is that slides by itself, in millimetres.

Constraint stability asks whether the distance dies out, and says nothing of its size: one that stands twelve
micrometres off fails it. Here the size counts, so that schemes can be ranked that all keep the tool near, on a robot
whose friction, encoders and delay let none come home.
"""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.decisions import CONSTRAINT_DISTANCE, QUIET_SAMPLES, STOPPED_SHARE
from hapticeval.phenomena.measures.closed_paths import running_sums
from hapticeval.phenomena.measures.surface_motion import SurfaceMotion
from hapticeval.phenomena.sampling import mm, worst_row
from hapticeval.phenomena.verdict import Facts, Finding, Level, Outcome, compared, undecided
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the largest distance from the surface after the last push, while the tool slides, with a millimetre."""
    base = runs.observed(scene)
    ended = base.meta.get("ended")
    if ended is not None:
        message = f"the run ended at t = {ended['time']:.4g} s: {ended['what']}"
        evidence = {**base.evidence_at(len(base) - 1), **Facts(ended=dict(ended)).evidence}
        return Finding(Outcome.FAIL, message, evidence=evidence)
    motion = SurfaceMotion(base)
    first = int(np.flatnonzero(motion.pushed).max(initial=-1)) + 1
    if len(base) - first < QUIET_SAMPLES:
        return undecided("the operator pushes to the end: what the law alone holds does not show")
    # m: how far the tool slides along the surface by itself, whatever its distance does.
    speed = np.linalg.norm(motion.along[first:], axis=1)
    slid = float(running_sums(speed[:-1] * np.diff(base.time[first:]))[-1])
    evidence = {"slid_m": slid, "speed_at_first_m_s": float(speed[0])}
    if slid < STOPPED_SHARE * scene.model.size:
        message = f"the tool stops after {mm(slid)} along the surface: one that stands is not compared"
        return Finding(Outcome.NOT_APPLICABLE, message, evidence=evidence)
    distance = np.abs(motion.distance[first:])
    farthest = worst_row(distance)
    return compared(
        CHECK.measured(distance[farthest]),
        CONSTRAINT_DISTANCE,
        evidence | base.evidence_at(first + farthest),
        passes=f"over {mm(slid)} along the surface the tool is never further off it than {mm(distance[farthest])}",
        fails=f"over {mm(slid)} along the surface the tool is up to {mm(distance[farthest])} off it",
    )


CHECK = Check(
    id="constraint-distance",
    phenomenon="Distance from the constraint",
    formula="max |n(t)| after the last push, while the tool slides",
    citation="thesis 6.3.2, 6.3.3, 7.3.2, Figures 6.20, 6.21, 6.23 and 7.4",
    channels=("hip", "velocity"),
    reads_also=("operator_force",),
    not_for={
        Situation.LED: "a hand led along a given path goes where it is led",
        Situation.UNILATERAL: "a surface that only pushes holds nothing from outside",
    },
    holds=True,
    level=Level.SHOULD,
    metric="largest distance from the surface while the tool slides",
    unit="m",
    judge=judge,
)
