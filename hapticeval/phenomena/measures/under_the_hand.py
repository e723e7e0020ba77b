"""Under the hand: a contact point's path begins and ends where the hand's does, and nears the hand as the depth goes.

In free space the IHIP is the HIP. A path that is continuous where a contact begins and ends therefore has an IHIP whose
distance from the HIP's nearest surface point vanishes with the depth, whatever the projection: to the nearest point, of
a god-object or by a map.

A tool that stays behind, or creeps away over the surface, is never off it and never jumps.

Where the hand comes in beside a convex edge, the nearest point may be on the other face from the first sample on, and a
right tool on the one that the hand came through: there the IHIP is held against a rigid tool as well.
"""

from __future__ import annotations

import numpy as np

from hapticeval.geometry.boundary import ClosestPoint
from hapticeval.phenomena.decisions import ASIDE_DEPTHS, DESCENT_SHARE, LAG_TICKS, STRETCHED_STEPS
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import mm, steps_to, worst_row
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.recording import runs_of
from hapticeval.types import Array, BoolArray


def find_aside(base: Observed) -> Finding | None:
    """Return a failure where an IHIP in contact stands farther aside of the hand than its depth explains; else None.

    Aside is how far the IHIP is from the model's point nearest to the HIP, m.

    The nearest point moves by up to `STRETCHED_STEPS` HIP steps in a tick, and an IHIP may be three ticks late; the
    surface that is rendered may lie off the model, and be blurred along it, by what is declared.
    """
    feet = base.nearest
    depth = np.abs(feet.distance)
    judged, branch_doubt = followed_rows(base, feet.foot, feet.distance)
    if not judged.any():
        return None
    across = base.across_allowed
    recent = base.recent_steps
    # Aside grows with the depth; beside that a lag's way, what is declared, and what a branch may have hidden.
    allowed = (
        ASIDE_DEPTHS * (depth + across) + across + base.resolution + STRETCHED_STEPS * LAG_TICKS * recent + branch_doubt
    )
    aside = np.where(judged, np.linalg.norm(base.ihip - feet.foot, axis=1), 0.0)
    _excuse_rigid_tool(base, feet, aside, allowed)
    worst = worst_row(aside - allowed)
    if aside[worst] <= allowed[worst]:
        return None
    message = (
        f"the IHIP is not under the hand: {mm(aside[worst])} from the surface point nearest to it at "
        f"{base.time_and_hip(worst)}"
    )
    metric = Metric("distance of the IHIP from the HIP's nearest surface point", float(aside[worst]), "m")
    evidence = {**base.evidence_at(worst), "depth_m": float(depth[worst])}
    return Finding(Outcome.FAIL, message, metric, float(allowed[worst]), evidence)


def _excuse_rigid_tool(base: Observed, feet: ClosestPoint, aside: Array, allowed: Array) -> None:
    """Lower `aside` (n,), m, to the distance from a rigid tool, in contacts in which it is more than `allowed` (n,), m.

    Such a tool begins where the hand comes in, or at the nearest of `feet` (n rows), and slides on the model downhill
    in distance to the hand; an IHIP may follow it up to three ticks late.
    """
    boundary = base.boundary
    for first, end in runs_of(base.contact):
        astray = np.flatnonzero(aside[first:end] > allowed[first:end])
        if not astray.size:
            continue
        step = DESCENT_SHARE * float(allowed[first:end].min())
        # A renderer may report a contact three ticks late: the hand came in within the last few.
        before, entry = base.hip[max(first - 1 - LAG_TICKS, 0)], base.hip[first]
        crossing = boundary.first_crossing(before, entry, grain=step)
        starts = [feet.foot[first] if crossing is None else crossing]
        if may_begin_at_ihip(base, feet.distance, first):
            starts.append(base.ihip[first])
        for start in starts:
            tools = [start]
            for hip in base.hip[first : first + int(astray[-1]) + 1]:
                tools.append(boundary.descend(tools[-1], hip, step=step))
            tool_path = np.array(tools[1:])
            for row in astray:
                late = tool_path[max(int(row) - LAG_TICKS, 0) : row + 1]
                distance = float(np.linalg.norm(late - base.ihip[first + row], axis=1).min())
                aside[first + row] = min(aside[first + row], distance)


def may_begin_at_ihip(base: Observed, distance: Array, first: int) -> bool:
    """Return whether a rigid tool may be where the IHIP is in row `first`, in which a contact is seen first.

    A hand that comes in through an edge itself enters by either face. A tool that began with it there has moved no
    farther since than the hand, from where that was last outside by its signed `distance` (n,), m.
    """
    outside = np.flatnonzero(distance[: first + 1] > base.rounding)
    if not outside.size:
        return False
    moved = float(base.hip_steps[outside[-1] : first].sum())
    off = float(np.linalg.norm(base.ihip[first] - base.hip[outside[-1]]))
    return off <= moved + base.across_allowed


def followed_rows(base: Observed, feet: Array, distance: Array) -> tuple[BoolArray, Array]:
    """Return in which rows a contact has followed the hand's nearest point since it began, and how far it may be off.

    `feet` (n, N), m, are the model's points nearest to the HIPs, and `distance` (n,), m, is signed. A contact follows
    from where the hand comes in, or the run begins, up to where it is outside again or its nearest point jumps: there
    are then two branches of what is nearest, and a god-object may be on either.

    The second result, (n,), m, is what a shorter step of the nearest point may have hidden in that way.
    """
    scene = base.scene
    contact = base.holding
    steps, moved = steps_to(base.hip), steps_to(feet)
    # A nearest point moves by 1 / (1 - kappa d) HIP steps; more than `STRETCHED_STEPS` is another branch.
    jumps = moved > STRETCHED_STEPS * steps + base.rounding
    near = LAG_TICKS * base.recent_steps + base.across_allowed
    outside = (distance > near) & (not scene.bilateral)
    judged, branch_doubt = np.zeros(len(base), dtype=bool), np.zeros(len(base))
    for first, end in runs_of(contact):
        # A log that begins in contact does not tell where the contact began.
        known = base.meta.get("source") in SIMULATED if first == 0 else abs(distance[first]) <= near[first]
        ends = np.flatnonzero((jumps | outside)[first + 1 : end])
        last = first + 1 + int(ends[0]) if ends.size else end
        # Up to the first jump, or the first row outside.
        judged[first:last] = known
        branch_doubt[first:last] = np.maximum.accumulate(np.maximum(moved - steps, 0.0)[first:last])
    return judged & (scene.bilateral | (distance < 0.0)), branch_doubt
