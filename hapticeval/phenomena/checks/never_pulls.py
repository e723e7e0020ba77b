"""Never pulls: a surface that only pushes never draws the hand in, also while it leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hapticeval.effects.effect import Alters
from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.checks.contact_normal_force import normal_reach
from hapticeval.phenomena.lag import largest_in_lag
from hapticeval.phenomena.measures.free_space import find_felt_in_free_space
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import steps_to, worst_row
from hapticeval.phenomena.verdict import Finding, Level, Outcome, compared, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array


def find_outward(recording: Observed) -> Array:
    """Return the unit vector from the hand to its contact point in each row, (n, N); the normal where both are one."""
    normal = recording.nearest.normal
    if "ihip" not in recording.channels:
        return normal
    stretch = recording.ihip - recording.hip
    length = np.linalg.norm(stretch, axis=1, keepdims=True)
    return np.where(length > recording.rounding, stretch / np.where(length > 0.0, length, 1.0), normal)


def judge(runs: Runs, scene: Scene) -> Finding:
    """Find the largest part of the force that draws the hand away from its contact point, deeper in."""
    base = runs.observed(scene)
    # A hand in free space is drawn in by what points to the model, wherever the IHIP is said to be.
    free = find_felt_in_free_space(base) & base.pressed
    inside = base.pressed & (base.distance < 0.0)
    rows = np.flatnonzero(inside | free)
    never_inside = undecided("the hand never feels a force inside of the model")
    if rows.size == 0:
        return never_inside
    outward = np.where(free[:, np.newaxis], base.nearest.normal, find_outward(base))
    pull = np.maximum(-np.sum(base.force * outward, axis=1), 0.0)
    if "ihip" in base.channels:
        # A rigid tool is at the hand, where each face that it touches within its step may push.
        at_hand = np.flatnonzero(inside & ~free & ~base.apart)
        cone = base.boundary.normal_cone(base.hip[at_hand], normal_reach(base)[at_hand])
        pull[at_hand] = np.maximum(-base.force_size[at_hand] * np.cos(cone(base.force[at_hand])), 0.0)
    lag = base.force_lag
    # A force of the IHIP and the HIP of L ticks ago may be off by as much as each of them has moved since.
    moved = lag * largest_in_lag(steps_to(base.hip))
    allowed = base.force_floor + scene.stiffness * (2.0 * moved + base.rounding + base.believed_standoff)
    worst = int(rows[worst_row((pull - allowed)[rows])])
    # How fast the hand goes outwards, m/s: (n,).
    velocity = np.gradient(base.hip, base.time, axis=0) if len(base) > 1 else np.zeros_like(base.hip)
    leaving = np.sum(velocity * outward, axis=1)
    speed = float(leaving[worst])
    where = f"at t = {base.time[worst]:.4g} s, while the hand {'leaves' if speed > 0.0 else 'enters'} at "
    where += f"{abs(speed):.3g} m/s"
    metric = CHECK.measured(pull[worst])
    cause = {"cause": "leaving" if speed > 0.0 else "entering"} if pull[worst] > allowed[worst] else {}
    finding = compared(
        metric,
        float(allowed[worst]),
        {**base.evidence_at(worst), "leaving_m_s": speed, "lag_ticks": lag} | cause,
        passes="the force never draws the hand in",
        fails=f"the force draws the hand in by {metric.value:.3g} N {where}"
        + (": a damper that is not clipped does that" if speed > 0.0 else ""),
    )
    if finding.outcome is Outcome.FAIL and "spring" in base.meta:
        return replace(finding, level=Level.MUST)
    if finding.outcome is Outcome.PASS and not inside.any():
        return never_inside
    if finding.outcome is Outcome.PASS and not np.any(leaving[rows] > 0.0):
        return undecided("the hand never leaves: whether it is let go of freely is not known")
    return finding


CHECK = Check(
    id="never-pulls",
    phenomenon="Contact Normal Force: a surface that only pushes (3.2)",
    formula="F . (IHIP - HIP) >= 0 while the hand is inside",
    citation="thesis 3.2, (3.2) with a normal force that is never negative",
    channels=("hip", "force"),
    reads_also=("ihip",),
    not_for={Situation.BILATERAL: "a surface that holds the tool from both sides pulls as well"},
    not_with=(Alters.FREE_SPACE, Alters.CONTACT_POINT, Alters.MOTION),
    metric="force that draws the hand in",
    unit="N",
    level=Level.SHOULD,
    judge=judge,
)
