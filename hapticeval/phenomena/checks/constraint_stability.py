"""Constraint stability (7.1a): a tool that is off the surface comes back to it, and stays."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.decisions import (
    EARLY_SHARE,
    GROWS,
    LATE_SHARE,
    LENGTH_ROUNDING,
    QUIET_SAMPLES,
    RETURN_RATIO,
    STANDS,
)
from hapticeval.phenomena.measures.surface_motion import SurfaceMotion, decay_rate, never_across
from hapticeval.phenomena.sampling import mm, worst_row
from hapticeval.phenomena.verdict import Facts, Finding, Outcome, compared, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the largest distance in the last half of the run with that in the quarter before it."""
    base = runs.observed(scene)
    ended = base.meta.get("ended")
    if ended is not None:
        message = f"the run ended at t = {ended['time']:.4g} s: {ended['what']}"
        evidence = {**base.evidence_at(len(base) - 1), **Facts(ended=dict(ended)).evidence}
        return Finding(Outcome.FAIL, message, evidence=evidence)
    motion = SurfaceMotion(base)
    # Judged from the last push on: while it is pushed a tool may well be off.
    first = int(np.flatnonzero(motion.pushed).max(initial=-1)) + 1
    free = base.time[first:] - base.time[min(first, len(base) - 1)]
    if free.size < QUIET_SAMPLES:
        if first > 0:
            return undecided("the operator pushes to the end, so nothing has to come to rest")
        return undecided(f"the run is too short to decide: {free.size} samples")
    if motion.footless is not None:
        return undecided(motion.footless)
    span, rate = float(free[-1]), decay_rate(scene)
    # Two windows: the second quarter of the free time, and its last half, which begins at twice the time.
    late = free > LATE_SHARE * span
    early = (free >= EARLY_SHARE * span) & ~late
    distance = np.abs(motion.distance[first:])
    # Nearer than this no law can hold it: a held force, and what the sensors are off by.
    floor = (
        motion.held_distance(first + int(np.argmax(early))) + motion.sensor_error + LENGTH_ROUNDING * scene.model.size
    )
    farthest = worst_row(distance)
    evidence = {
        **base.evidence_at(first + farthest),
        "largest_distance_m": float(distance[farthest]),
        "floor_m": floor,
        "assigned_decay_rate_1_s": rate,
    }
    if distance[farthest] <= floor:
        message = f"the tool is never further off the surface than sampling and sensors may let it: {mm(floor)}"
        return never_across(base, message, evidence)
    # n'' = -(K_p / m) n - (K_d / m) n' would itself not be home by then.
    if rate > 0.0 and math.exp(-EARLY_SHARE * rate * span) > RETURN_RATIO:
        message = f"{span:.3g} s are too short: the assigned dynamics decay at {rate:.3g} 1/s themselves"
        return undecided(message, evidence=evidence)
    before, after = float(distance[early].max()), float(distance[late].max())
    return compared(
        CHECK.measured(after),
        max(RETURN_RATIO * before, floor),
        evidence | {"distance_before_m": before, "distance_after_m": after},
        passes=f"the tool comes to the surface: from {mm(distance[farthest])} to {mm(after)} in the last half",
        fails=_describe_failure(motion.distance[first:][late], before, after),
    )


def _describe_failure(late: Array, before: float, after: float) -> str:
    """Describe in what way the tool does not come to the surface."""
    if after > before / RETURN_RATIO:
        return f"the distance grows: {mm(before)}, then {mm(after)}"
    # `late` is signed: a constant distance, on one side of the surface.
    if float(np.ptp(late)) < STANDS * after:
        return f"the tool stands {mm(after)} off the surface and comes no nearer"
    # Far off on either side: an undamped spring that is held for a tick gains energy.
    if min(float(late.max()), -float(late.min())) > STANDS * after:
        swing = f"the tool swings about the surface, {mm(after)} to either side"
        if after > GROWS * before:
            return f"{swing}, after {mm(before)} before: it grows, as a held spring without damping does"
        return f"{swing}, and is not damped: marginal stability"
    return f"the tool does not come to the surface: up to {mm(before)} off, then up to {mm(after)}"


CHECK = Check(
    id="constraint-stability",
    phenomenon="Stability of the constraint",
    formula="h(x(t)) -> S (7.1 a): n(t) -> 0",
    citation="thesis 7.1, Problem 7.1 (a); 6.3.2, 6.3.3, Tables 6.1 and 6.2",
    channels=("hip", "velocity"),
    reads_also=("operator_force", "measured_hip"),
    not_for={
        Situation.LED: "a hand led along a given path is drawn nowhere",
        Situation.UNILATERAL: "a surface that only pushes holds nothing from outside",
    },
    holds=True,
    metric="largest distance from the surface in the last half",
    unit="m",
    judge=judge,
)
