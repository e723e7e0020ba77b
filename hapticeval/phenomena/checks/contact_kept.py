"""Contact kept (section 3.2): a tool that the solid bars from the hand is in contact, and leaves when its way opens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hapticeval.geometry.boundary import Boundary, distance_between
from hapticeval.phenomena.check import FREE_THROUGHOUT, Check, Runs, Situation, without_ihip
from hapticeval.phenomena.decisions import COARSEST_GRAIN, FINEST_GRAIN, LAG_TICKS, TOOL_GRAIN
from hapticeval.phenomena.measures.closed_paths import running_sums
from hapticeval.phenomena.measures.free_space import find_felt_in_free_space, follow
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import listed, mm, newtons, worst_row
from hapticeval.phenomena.verdict import Facts, Finding, Metric, Outcome, undecided
from hapticeval.recordings.recording import runs_of
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray

TRAILING_CAUSES = ("lag", "low-pass", "hold")
"""Causes by which a tool trails the hand."""

KIND_WORDS = {
    "let go": "contact is lost inside the model",
    "not met": "the hand is led into the model and not met",
    "tunnelled": "the tool tunnels through the model",
}
"""Words for `Facts.kind`: whether there was contact before; tunnelled, where the hand is never deep inside."""


def judge(runs: Runs, scene: Scene) -> Finding:
    """Wherever the renderer gives no contact, follow the hand with a rigid tool from the renderer's own last IHIP."""
    base = runs.observed(scene)
    haunted = _find_force_in_free_space(base)
    if haunted is not None:
        return haunted
    if base.lacks_ihip:
        return without_ihip(base)
    steps, size = base.hip_steps, scene.model.size
    grain = float(np.clip(TOOL_GRAIN * steps.max(initial=0.0), FINEST_GRAIN * size, COARSEST_GRAIN * size))
    across = base.across_allowed
    # How far the HIP has moved in the last three ticks: (n,), m.
    along = running_sums(steps)
    moved = along - along[np.maximum(np.arange(along.size) - LAG_TICKS, 0)]
    # A late tool is where the hand was up to three ticks ago; the rest is where the surface may lie.
    allowed = moved + (across + grain)
    trailing_tool = _find_trailing_tool(base, allowed)
    barred = _judge_barred(base, grain, moved, allowed)
    if trailing_tool is None:
        return barred
    if barred.outcome is not Outcome.FAIL:
        return trailing_tool
    # Both in metres: the larger first.
    lost_contact = f"the hand gets {mm(_size_of(barred))} past the surface without contact"
    trails = f"the IHIP is {mm(_size_of(trailing_tool))} away from the HIP in free space"
    first, other = (barred, trails) if _size_of(barred) > _size_of(trailing_tool) else (trailing_tool, lost_contact)
    return replace(first, message=f"{first.message}; besides, {other}")


def _size_of(finding: Finding) -> float:
    return 0.0 if finding.metric is None else finding.metric.value


def _judge_barred(base: Observed, grain: float, moved: Array, allowed: Array) -> Finding:
    """Judge how far the hand gets past the surface that bars the tool's way to it, m, against `allowed` (n,), m.

    The rigid tool moves in steps of `grain` (m), and the hand has `moved` (n,), m, in the last three ticks.
    """
    scene, across = base.scene, base.across_allowed
    contact = base.contact.copy()
    # A tool that is simulated pulls at the hand by its coupling in free space, too: that force is not a contact.
    rows = np.flatnonzero(contact)
    in_free_space = base.boundary.signed_distance(base.hip[rows]) > 0.0
    contact[rows] = ~(in_free_space & base.clear_of_surface(rows))
    sunk = np.zeros(len(base), dtype=bool)
    sunk[rows] = base.boundary.signed_distance(base.ihip[rows]) < -(across + grain)
    sunk |= _begun_behind(base, contact, base.boundary, grain, across)
    # An edge may lie off along the surface as well, by what the renderer's resolution leaves.
    reach = moved + (across + base.resolution) + grain
    gap, since = _distances_past_surface(base, contact, sunk, base.boundary, grain, allowed, reach)
    if not contact.any() and not gap.any():
        away = float(base.distance.min())
        reason = "the hand is never led into the model, and the tool never in contact"
        # So far off that somebody may have taken millimetres for metres.
        is_far = away > scene.model.size
        if is_far:
            reason += f"; the hand stays {mm(away)} away, farther than the model is large: is its unit the metre?"
        if is_far or not base.stays_free:
            return undecided(reason)
        return Finding(Outcome.PASS, FREE_THROUGHOUT, CHECK.measured(0.0), float(allowed.max()))
    worst = worst_row(gap - allowed)
    metric = CHECK.measured(gap[worst])
    bound = float(allowed[worst])
    if gap[worst] <= bound:
        message = "the tool is in contact wherever the model bars its way to the hand"
        return Finding(Outcome.PASS, message, metric, bound, base.evidence_at(worst))
    # Rows in which the hand is past the surface by more than that.
    without_contact = gap > allowed
    durations = np.diff(base.time, append=base.time[-1] + base.dt)
    depth = -base.distance
    first = int(since[worst])
    had_contact = first > 0 and bool(contact[first - 1])
    kind = (
        "tunnelled"
        if np.all(depth[without_contact] <= allowed[without_contact])
        else "let go"
        if had_contact
        else "not met"
    )
    ticks, seconds = int(without_contact.sum()), float(durations[without_contact].sum())
    evidence: dict[str, object] = {
        **base.evidence_at(first),
        **Facts(kind=kind, deepest_m=max(float(depth[without_contact].max()), 0.0)).evidence,
        "farthest_time": float(base.time[worst]),
        "farthest_hip": listed(base.hip[worst]),
        "lost_ticks": ticks,
        "lost_s": seconds,
        "times_lost": int(np.unique(since[without_contact]).size),
    }
    if had_contact:
        evidence["last_ihip"] = listed(base.ihip[first - 1])
    message = (
        f"{KIND_WORDS[kind]} at {base.time_and_hip(first)}: without contact for {seconds:.3g} s the hand gets "
        f"{mm(metric.value)} past the surface"
    )
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


def _find_force_in_free_space(base: Observed) -> Finding | None:
    """Return a failure where a hand in free space feels a force; None where none does, or nobody can know.

    It is asked of a renderer that gives a contact point elsewhere, or declares that it gives none.
    """
    if not (base.apart.any() or base.declares_force_only):
        return None
    felt = find_felt_in_free_space(base)
    if not felt.any():
        return None
    # The largest force first; of a contact without one, where the hand is farthest off.
    size = np.where(felt, base.force_size, 0.0)
    pushes = float(size.max()) > base.force_floor
    worst = worst_row(size if pushes else np.where(felt, base.distance, -np.inf))
    away, ticks = float(base.distance[worst]), int(felt.sum())
    evidence = {**base.evidence_at(worst), **Facts(kind="haunts").evidence, "felt_ticks": ticks, "away_m": away}
    where = f"{mm(away)} outside of the model at {base.time_and_hip(worst)} ({ticks} of {len(base)} ticks)"
    tool = (
        f"with the tool {mm(float(np.linalg.norm(base.ihip[worst] - base.hip[worst])))} away from it"
        if base.apart[worst]
        else "with the tool at it"
    )
    if not pushes:
        metric = Metric("distance of a contact from the model", away, "m")
        message = f"a contact without force in free space: the hand is {where}, {tool}"
        return Finding(Outcome.FAIL, message, metric, base.across_allowed, evidence)
    metric = Metric("force in free space", float(size[worst]), "N")
    message = f"the hand feels {newtons(metric.value)} in free space: it is {where}, {tool}"
    return Finding(Outcome.FAIL, message, metric, base.force_floor, evidence)


def _find_trailing_tool(base: Observed, allowed: Array) -> Finding | None:
    """Return a failure where the tool does not follow the hand in free space: it could then meet no surface in time.

    `allowed` (n,), m, is how far the IHIP may be from the HIP there.
    """
    scene = base.scene
    distance = np.where(base.trailing, np.linalg.norm(base.hip - base.ihip, axis=1), 0.0)
    # A late IHIP rests for up to three ticks where the contact was.
    distance[_rests_where_contact_ended(base, allowed)] = 0.0
    worst = worst_row(distance - allowed)
    if distance[worst] <= allowed[worst]:
        return None
    many = int(np.sum(distance > allowed))
    # A tool that the surface still holds is not in free space, though the hand is outside, as behind a plate.
    lies = float(np.abs(base.boundary.signed_distance(base.ihip[worst : worst + 1]))[0])
    dropped = bool(base.contact[:worst].any()) and lies <= allowed[worst]
    kind = "dropped" if dropped else "trails"
    # From the surface its way to the hand may be open.
    grain = FINEST_GRAIN * scene.model.size
    if dropped and follow(base.boundary, base.ihip[worst], base.hip[worst], grain) is None:
        kind = "stays"
    what = {
        "dropped": "the force is dropped: none, with the IHIP on the surface,",
        "stays": "the tool stays on the surface though its way to the hand is open: no force, and the IHIP",
        "trails": "the tool trails the hand in free space: no force, and the IHIP",
    }[kind]
    message = (
        f"{what} {mm(distance[worst])} away from the HIP at t = {base.time[worst]:.4g} s ({many} of {len(base)} ticks)"
    )
    metric = Metric("distance of the IHIP from the HIP in free space", float(distance[worst]), "m")
    evidence = {**base.evidence_at(worst), **Facts(kind=kind).evidence, "trailing_ticks": many}
    if base.diagnosis.kind in TRAILING_CAUSES:
        message = f"{base.cause}: {message}"
        evidence |= base.cause_evidence
    return Finding(Outcome.FAIL, message, metric, float(allowed[worst]), evidence)


def _rests_where_contact_ended(base: Observed, allowed: Array) -> BoolArray:
    """Return where the IHIP is still where the contact has ended, (n,): for three ticks, as a late one is.

    It is no farther from the last contact point than the hand has moved, and what a surface may be off.
    """
    contact = base.contact
    rows = np.arange(len(base))
    # The last row in contact up to each, where there was one.
    last = np.maximum.accumulate(np.where(contact, rows, 0))
    near = np.linalg.norm(base.ihip - base.ihip[last], axis=1) <= allowed
    return np.asarray(np.logical_or.accumulate(contact) & (rows - last <= LAG_TICKS) & near)


def _begun_behind(base: Observed, contact: BoolArray, boundary: Boundary, grain: float, across: float) -> BoolArray:
    """Return the rows of contacts, (n,), that begin where a rigid tool does not get to, as on the back of a plate.

    The IHIP may lie `across` (m) under the surface, and is placed to `grain` (m).
    """
    behind = np.zeros(len(base), dtype=bool)
    for begin, end in runs_of(contact):
        # Before it the tool was free.
        if begin == 0 or not boundary.signed_distance(base.ihip[begin - 1 : begin])[0] >= 0.0:
            continue
        held_at = follow(boundary, base.ihip[begin - 1], base.ihip[begin], grain)
        behind[begin:end] = held_at is not None and distance_between(held_at, base.ihip[begin]) > across + grain
    return behind


def _carried(base: Observed, sunk: BoolArray, boundary: Boundary, tick: int, grain: float) -> Array:
    """Return where a rigid tool is, (N,), m, that has followed the renderer's own up to the row before `tick`.

    That is the IHIP; where it has `sunk` (n,) into the solid, or is behind it, the tool is led along outside, from
    where it was last.
    """
    outside = np.flatnonzero(~sunk[:tick])
    start = int(outside[-1]) if outside.size else tick - 1
    tool: Array = base.ihip[start]
    for ihip in base.ihip[start + 1 : tick]:
        held_at = follow(boundary, tool, ihip, grain)
        tool = ihip if held_at is None else held_at
    return tool


def _distances_past_surface(
    base: Observed,
    contact: BoolArray,
    sunk: BoolArray,
    boundary: Boundary,
    grain: float,
    allowed: Array,
    reach: Array,
) -> tuple[Array, IntArray]:
    """Return how far the HIP is past the surface that holds a rigid tool, in each tick without contact: (n,), m.

    It is 0 where the tool is free. The second result, (n,), is the tick since which it is held. The rigid tool starts
    where the renderer's was: at its last IHIP in contact, or with the hand in free space. One that has `sunk` (n,) into
    the solid is led along outside: where it comes out on the other side, it has gone through.

    Farther than `allowed` (n,), m, it counts as held only where neither a place nor a start within `reach` (n,), m, has
    an open way.
    """
    hip, steps = base.hip, base.hip_steps
    frame = boundary.closest_point(hip)
    clear = frame.distance > 0.0
    # No point of a way is inside where the clear distances at its ends cover it.
    clear[1:] &= clear[:-1] & (frame.distance[1:] + frame.distance[:-1] >= steps)
    gap, since = np.zeros(len(base)), np.zeros(len(base), dtype=np.int64)
    tool: Array | None = None
    # In contact the renderer's own tool counts; only without it the rigid one is led on.
    for tick in np.flatnonzero(~contact).tolist():
        released = tick > 0 and bool(contact[tick - 1])
        if released:
            tool = None
        # Free, and the way from the last HIP clear of the solid: there is nothing to be held by.
        elif tool is None and clear[tick]:
            continue
        if tool is None:
            first = tick
            # A recording may begin inside: there the tool starts at the foot of the first HIP.
            start = (
                _carried(base, sunk, boundary, tick, grain) if released else hip[tick - 1] if tick else frame.foot[0]
            )
        else:
            start = tool
        tool = follow(boundary, start, hip[tick], grain)
        if tool is None:
            continue
        hand_past = float(np.linalg.norm(hip[tick] - tool))
        if hand_past > allowed[tick]:
            alternatives = boundary.around(tool, float(reach[tick]))
            is_free = any(boundary.first_crossing(other, hip[tick], grain=grain) is None for other in alternatives)
            if not is_free and released:
                # Where the hand is as near both ways round, the tool may slide either way from a start so placed.
                starts = boundary.around(start, float(reach[tick]))
                is_free = any(follow(boundary, other, hip[tick], grain) is None for other in starts)
            if is_free:
                tool = None
                continue
        gap[tick], since[tick] = hand_past, first
    return gap, since


CHECK = Check(
    id="contact-kept",
    phenomenon="Continuous Contact Point",
    formula="no contact at t only if a rigid tool, from the last IHIP, gets to HIP(t) outside of the solid",
    citation="thesis 3.2, 3.2.1; 4.1.2 (pop-through)",
    channels=("hip", "ihip"),
    reads_also=("force",),
    siblings={
        "fresh": "for a failure without a known cause, through a new renderer",
    },
    not_for={Situation.BILATERAL: "a surface that holds the tool from both sides is never left"},
    metric="how far the hand gets past the surface without contact",
    unit="m",
    judge=judge,
)
