"""Broken contact (section 3.2.1): the force keeps n_pre up to a convex corner, and is gone past it."""

from __future__ import annotations

import numpy as np

from hapticeval.effects.effect import Alters
from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.decisions import FACE_TURN_SHARE, HELD_FORCE_SHARE, LAG_TICKS, SAME_DEPTH_SHARE, SAME_NORMAL
from hapticeval.phenomena.measures.crossings import Crossing, angle_between, find_crossings, worst_finding
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import listed, mm
from hapticeval.phenomena.verdict import Finding, compared, not_applicable, undecided
from hapticeval.quantity import plural
from hapticeval.scene import Scene
from hapticeval.types import BoolArray, IntArray


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure how far from the corner, before or after it, the force stops being what a rigid corner gives."""
    base = runs.observed(scene)
    crossings = find_crossings(base, convex=True)
    if not crossings:
        return not_applicable("the hand is not led along a face past a convex corner into free space")
    pushes = base.pressed
    findings = [_judge_corner(base, crossing, pushes) for crossing in crossings]
    judged = worst_finding([finding for finding in findings if finding is not None])
    if judged is None and all(pushes[crossing.first : crossing.crossed].any() for crossing in crossings):
        message = "the tool is on another face while the hand goes under one past its convex corner"
        return not_applicable(message)
    return judged or undecided("no force is felt under a face before its convex corner")


def _judge_corner(base: Observed, crossing: Crossing, pushes: BoolArray) -> Finding | None:
    """Judge one convex corner; None where the tool does not press before it on the face that the hand is under."""
    along, under = crossing.along, crossing.under
    crossed, end = crossing.crossed, crossing.end
    # Along n_pre: within a share of the angle that the corner turns by.
    first_face = pushes & (angle_between(base.force, crossing.normal_pre) <= FACE_TURN_SHARE * crossing.turn)
    # A tool that another part of the solid bars from the hand, or a late one, comes to this face when it does.
    pressed = np.flatnonzero((pushes & crossing.tool)[crossing.first : crossed])
    if pressed.size == 0:
        return None
    # A tool that is struck is given its impulse at once, and what it presses with from then on may begin at nothing.
    settled = pressed[pressed > pressed[0] + LAG_TICKS]
    first = crossing.first + int((settled if settled.size else pressed)[0])
    strength = base.force_size
    # The force that is usual on the first face, N.
    usual = float(np.median(strength[first:crossed][crossing.tool[first:crossed]]))
    # A hand that is no deeper than the floor of forces presses by less than that: it may rest on the face.
    rests = ~pushes & (under <= base.force_depth)
    # What a rigid corner gives up to its place: n_pre, with the tool on that face.
    holding = ((first_face | rests) & crossing.tool)[first:crossed]
    # A spring's force goes with the depth, and a rigid contact's with what the hand does: only at one depth is it held.
    depth = float(np.median(under[first:crossed]))
    if depth > base.rounding and np.ptp(under[first:crossed]) <= SAME_DEPTH_SHARE * depth:
        holding = holding & (strength[first:crossed] >= HELD_FORCE_SHARE * usual)
    early_ticks = first + np.flatnonzero(~holding)
    # `along` is negative before the corner: the distance from it at which n_pre is lost.
    early = -float(along[early_ticks[0]]) if early_ticks.size else 0.0
    end = _next_contact_of_standoff(base, crossed, end)
    # A simulated tool's force is the mean until the next sample: where it comes to the solid anew within the last one
    # before that, the force that begins there is the next contact's.
    if end < len(base) and pushes[end - 1 : end + 1].all() and not pushes[end - 2]:
        end -= 1
    struck_anew = _struck_anew(base, np.arange(crossed, end), pushes & ~first_face)
    after = pushes[crossed:end] & ~struck_anew[crossed:end]
    # A force that is only late is gone after a few ticks; up to there it remains wrongly, too.
    ticks_to_zero = int(np.argmax(~after)) if not after.all() else after.size
    # Past the corner no force may remain, and none may come back from the face that was left.
    wrong = first_face[crossed:end] | (np.arange(after.size) < ticks_to_zero)
    late = float(np.max(along[crossed:end], where=wrong, initial=0.0))
    allowed = base.position_tolerance
    # A force that remains is excused by no theorem, as an early loss may be: neither hides the other.
    too_early = early >= late and not late > allowed
    tick = int(early_ticks[0]) if too_early and early_ticks.size else min(crossed + ticks_to_zero, len(base) - 1)
    if too_early:
        cause, fails = _describe_loss(
            pushes=bool(pushes[tick]),
            at_face=bool(crossing.tool[tick]),
            along_n_pre=bool(first_face[tick]),
            early=early,
        )
    else:
        besides = f"; besides, n_pre is lost {mm(early)} before it" if early > allowed else ""
        cause, fails = "remains", f"a force remains up to {mm(late)} past the corner{besides}"
    ticks_off = early if too_early else late
    return compared(
        CHECK.measured(ticks_off),
        allowed,
        {
            **({"cause": cause} if ticks_off > allowed else {}),
            **base.evidence_at(tick),
            "corner": listed(crossing.place),
            "lost_before_corner_m": early,
            "remains_after_corner_m": late,
            "ticks_to_zero_after_corner": ticks_to_zero,
            "force_pre_N": usual,
        },
        passes=f"the force keeps n_pre to the corner and is gone {plural(ticks_to_zero, 'tick')} after it",
        fails=fails,
    )


def _describe_loss(*, pushes: bool, at_face: bool, along_n_pre: bool, early: float) -> tuple[str, str]:
    """Return what is lost `early` (m) before a corner, kind and words: the force, its face, direction or size."""
    before = f"{mm(early)} before the corner"
    if not pushes:
        return "lost", f"the force is lost {before}"
    if not at_face:
        return "another face", f"the force leaves n_pre {before}: another face pushes"
    if along_n_pre:
        return "falls", f"the force falls below half of the usual {before}"
    return "turns", f"the force leaves n_pre {before}"


def _next_contact_of_standoff(base: Observed, first: int, end: int) -> int:
    """Return the first of the rows [first, end) in which a tool that stands off touches a face anew; else `end`.

    It does while the hand is yet outside, nearer than the standoff, after it has been farther.
    """
    gap = base.believed_standoff
    if gap == 0.0:
        return end
    clear = base.boundary.signed_distance(base.hip[first:end]) > gap
    left = int(np.argmax(clear))
    if not clear.any() or clear[left:].all():
        return end
    return first + left + int(np.argmin(clear[left:]))


def _struck_anew(base: Observed, rows: IntArray, pushes: BoolArray) -> BoolArray:
    """Return where the tool comes to another face between a row and the next, and is off the surface at both: (n,).

    The mean force of such a tick is that of an impact which no sample shows. So it is of a rigid tool alone, whose IHIP
    is the HIP: in those of `rows` (k,) in which it `pushes` (n,), a step off the surface at most, along normals of
    faces within that step.
    """
    struck = np.zeros(len(base), dtype=bool)
    if "ihip" not in base.channels or base.lacks_ihip:
        return struck
    steps = np.append(base.hip_steps, 0.0)
    rows = rows[pushes[rows] & np.all(base.ihip[rows] == base.hip[rows], axis=1)]
    rows = rows[base.boundary.signed_distance(base.hip[rows]) <= steps[rows]]
    if rows.size:
        angles = base.boundary.normal_cone(base.hip[rows], steps[rows])(base.force[rows])
        struck[rows] = np.cos(angles) > 1.0 - SAME_NORMAL
    return struck


CHECK = Check(
    id="broken-contact",
    phenomenon="Broken Contact",
    formula="F = |F| n_pre for (HIP - corner) . t_pre < 0, then F = 0",
    citation="thesis 3.2.1, Figure 3.4; Figures 6.10, 6.11",
    channels=("hip", "force"),
    reads_also=("ihip",),
    not_for={
        Situation.NO_CONVEX_CORNER: "the model has no convex corner or edge",
        Situation.BILATERAL: "a tool that is held from both sides does not leave at a corner",
    },
    not_with=(Alters.FREE_SPACE, Alters.CONTACT_POINT),
    metric="distance from the corner at which n_pre is lost or force remains",
    unit="m",
    judge=judge,
)
