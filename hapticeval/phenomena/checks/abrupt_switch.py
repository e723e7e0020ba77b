"""Abrupt switch (section 3.2.1): in a concave corner the force turns from one face's normal to the other's at once."""

from __future__ import annotations

import numpy as np

from hapticeval.effects.effect import Alters
from hapticeval.phenomena.check import Check, Runs, Situation, without_ihip
from hapticeval.phenomena.decisions import FACE_TURN_SHARE
from hapticeval.phenomena.measures.crossings import Crossing, angle_between, find_crossings, worst_finding
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import listed, mm
from hapticeval.phenomena.verdict import Finding, compared, not_applicable, undecided
from hapticeval.scene import Scene
from hapticeval.types import BoolArray, IntArray


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure the HIP travel from where the force leaves n_pre for the first time to where it keeps to n_post."""
    base = runs.observed(scene)
    if base.lacks_ihip:
        return without_ihip(base)
    crossings = find_crossings(base, convex=False)
    if not crossings:
        return not_applicable("the hand is not led along a face into a concave corner, and out again")
    pushes = base.pressed
    findings = [_judge_corner(base, crossing, pushes) for crossing in crossings]
    return worst_finding([finding for finding in findings if finding is not None]) or undecided(
        "the force does not go from the first face's normal to the second's"
    )


def _judge_corner(base: Observed, crossing: Crossing, pushes: BoolArray) -> Finding | None:
    """Judge one concave corner; None where the force does not go from the first face's normal to the second's."""
    pressed = crossing.first + np.flatnonzero(pushes[crossing.first : crossing.end])
    if pressed.size == 0:
        return None
    on_pre, on_post = (
        angle_between(base.force[pressed], normal) <= FACE_TURN_SHARE * crossing.turn
        for normal in (crossing.normal_pre, crossing.normal_post)
    )
    if not on_pre.any() or not on_post.any():
        return None
    # A tool that touches another face between two samples, and comes back, does not begin to switch there.
    counted = on_pre | on_post | ~crossing.others[pressed]
    pressed, on_pre, on_post = pressed[counted], on_pre[counted], on_post[counted]
    # As it comes and goes, with no depth yet, a tool that stands off the surface leans: what counts is in between.
    # First tick on n_pre, and last on n_post, of those with a force.
    begin, last = int(np.argmax(on_pre)), on_post.size - 1 - int(np.argmax(on_post[::-1]))
    # The first tick that is not along n_pre any more.
    leaves = begin + int(np.argmin(on_pre[begin:]))
    if leaves > last:
        return None
    left_tick = int(pressed[leaves - 1])
    # Backwards from the last tick on n_post to the first of that run.
    reached = int(pressed[last - int(np.argmin(on_post[last::-1])) + 1])
    # A rigid tool may strike both faces by turns: as long as it is at one place that is one switch.
    within = base.position_tolerance
    left_tick = _last_tick_within(base, pressed[on_pre & (pressed < reached)], left_tick, within)
    reached = _last_tick_within(base, pressed[on_post & (pressed > left_tick)][::-1], reached, within)
    takes = float(base.time[reached] - base.time[left_tick])
    # While nothing pushes no force turns: a tool may fly on along the first face, and be met by the second.
    travel = float(np.sum(crossing.steps[left_tick:reached][pushes[left_tick:reached]]))
    # The usual depth before the switch: travel is told in units of it, and no less than a step.
    depths = np.linalg.norm(base.hip - base.ihip, axis=1)
    depth = max(float(np.median(depths[pressed[pressed <= left_tick]])), base.hip_step)
    return compared(
        CHECK.measured(travel / depth),
        base.position_tolerance / depth,
        {
            **base.evidence_at(reached),
            "corner": listed(crossing.place),
            "switch_starts_s": float(base.time[left_tick]),
            "switch_takes_s": takes,
            "travel_m": travel,
            "depth_m": depth,
            "turn_deg": float(np.degrees(crossing.turn)),
        },
        passes=f"the force switches within {mm(travel)} of HIP travel",
        fails=f"the force turns over {mm(travel)} of HIP travel ({travel / depth:.3g} depths, {takes:.3g} s): "
        "the corner is rounded",
    )


def _last_tick_within(base: Observed, ticks: IntArray, tick: int, within: float) -> int:
    """Return the last of `ticks` (k,) at which the HIP is `within` metres of where it is at `tick`; else `tick`."""
    nearby = ticks[np.linalg.norm(base.hip[ticks] - base.hip[tick], axis=1) <= within]
    return int(nearby[-1]) if nearby.size else tick


CHECK = Check(
    id="abrupt-switch",
    phenomenon="Abrupt Switch",
    formula="travel of the HIP while n_e turns from n_pre to n_post, in penetration depths; 0 for rigid contact",
    citation="thesis 3.2.1, Figure 3.5; Figures 6.6, 6.7, 6.9",
    channels=("hip", "ihip", "force"),
    not_for={
        Situation.NO_CONCAVE_CORNER: "the model has no concave corner or edge",
        Situation.BILATERAL: "a tool that is held from both sides may be pulled as well as pushed",
    },
    not_with=(Alters.FREE_SPACE, Alters.CONTACT_POINT),
    metric="HIP travel of the switch in penetration depths",
    unit="depths",
    judge=judge,
)
