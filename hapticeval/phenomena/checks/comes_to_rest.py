"""Stability of the sampled loop: a tool on which the hand's pull stays the same comes to rest, and stays there."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.decisions import ANSWER_CHANGE, EARLY_SHARE, LATE_SHARE, QUIET_SAMPLES, RETURN_RATIO
from hapticeval.phenomena.sampling import mm, worst_row
from hapticeval.phenomena.verdict import Finding, Metric, Outcome, compared, undecided
from hapticeval.quantity import format_number
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the largest speed in the last half of the quiet time with that in the quarter before it."""
    base, size = runs.observed(scene), scene.model.size
    quiet = base.meta.get("quiet_from")
    if quiet is None:
        return undecided("it is not known from when on the operator keeps still")
    rows = np.flatnonzero(base.time >= quiet)
    if rows.size < QUIET_SAMPLES:
        return undecided(f"the operator keeps still for {rows.size} samples only")
    # Two windows of the quiet time: its second quarter, and its last half, which begins at twice the time.
    since = base.time[rows] - base.time[rows[0]]
    span = float(since[-1])
    speed = np.linalg.norm(base.velocity[rows], axis=1)
    late, early = since > LATE_SHARE * span, (since >= EARLY_SHARE * span) & (since <= LATE_SHARE * span)
    if not (late.any() and early.any()):
        return undecided("rows are missing where the tool should come to rest")
    distance = np.abs(base.distance)
    farthest = worst_row(distance)
    # A tool that is farther off than it was at the start, by the model's size, is driven away.
    reach = size + float(distance[0])
    worst = int(rows[late][worst_row(speed[late])])
    before, after = float(speed[early].max()), float(speed[late].max())
    evidence: dict[str, object] = {
        **base.evidence_at(worst),
        "quiet_from_s": float(quiet),
        "speed_before_m_s": before,
        "farthest_m": float(distance[farthest]),
    }
    metric = CHECK.measured(after)
    # Below a speed of 1e-9 of the model's size a second it rests, whatever it did before.
    resting_speed = ANSWER_CHANGE * size
    if "ihip" in base.channels:
        # A spring K that knows its depth to r lets a mass m swing by r: at up to sqrt(K / m) r.
        resting_speed = max(resting_speed, math.sqrt(scene.stiffness / scene.mass) * base.answered_rounding)
    bound = max(RETURN_RATIO * before, resting_speed)
    if distance[farthest] > reach:
        message = f"the tool gets {mm(distance[farthest])} off the surface, farther than the model is large"
        reach_metric = Metric("largest distance from the surface", float(distance[farthest]), "m")
        return Finding(Outcome.FAIL, message, reach_metric, reach, {**evidence, **base.evidence_at(farthest)})
    # For the message alone; nothing moved before where this is not a number.
    ratio = after / before if before > 0.0 else math.nan
    return compared(
        metric,
        bound,
        evidence,
        passes=f"the tool comes to rest: from {_speed(float(speed.max()))} to {_speed(after)} in the last half",
        fails=f"the tool does not come to rest: {_speed(before)}, then {_speed(after)}, {ratio:.3g} times as fast",
    )


def _speed(value: float) -> str:
    return f"{format_number(1e3 * value, 3)} mm/s"


CHECK = Check(
    id="comes-to-rest",
    phenomenon="none of the six: stability of the sampled loop",
    formula="y'(t) -> 0 for a push and a hand's place that stay the same",
    citation="thesis 2.6, (2.40), 8.2.4",
    channels=("hip", "velocity"),
    reads_also=("ihip",),
    not_for={Situation.LED: "a hand led along a given path moves as it is led"},
    holds=True,
    needs_loop=True,
    metric="largest speed in the last half",
    unit="m/s",
    judge=judge,
)
