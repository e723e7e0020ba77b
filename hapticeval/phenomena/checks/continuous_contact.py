"""Continuous contact (section 3.2): the contact point traces a continuous path until the contact is broken."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hapticeval.effects.effect import Alters
from hapticeval.geometry.boundary import Boundary
from hapticeval.phenomena.check import Check, Refinable, Runs, required, without_ihip
from hapticeval.phenomena.decisions import (
    CHORD_STEPS,
    COARSENINGS,
    CONFIRMED_SHARE,
    CONFIRMING_RATES,
    HALF_LAG_STEPS,
    JUMP_SLOPE,
    LAG_TICKS,
    LEAST_REFINEMENT,
    MEDIAL_BENDING,
    MINI_JUMP_EDGES,
    POWER_LAW_SCATTER,
    REFINEMENTS,
    SHRINKING_SLOPE,
    STILL_STEP_SHARE,
)
from hapticeval.phenomena.lag import largest_in_lag
from hapticeval.phenomena.measures.jumps import (
    Remains,
    RoughPlace,
    aitken,
    bounds_with_flights,
    jump_at_rate,
    largest_jump,
    lets_go,
    look_closer,
    step_bounds,
    with_steps_of_pieces,
    worst_step,
)
from hapticeval.phenomena.measures.under_the_hand import find_aside
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import listed, mm, rounding, steps_to, worst_row
from hapticeval.phenomena.verdict import Facts, Finding, Metric, Outcome, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array


def amplification(recording: Observed) -> float:
    """Return the largest ratio of IHIP step to HIP step in contact: how far a map stretches; 0 without two samples."""
    contact = recording.holding
    steps = recording.hip_steps
    # Steps next to nothing divide rounding by rounding.
    judged = contact[1:] & contact[:-1] & (steps > STILL_STEP_SHARE * np.max(steps, initial=0.0))
    if not judged.any():
        return 0.0
    return float(np.max(np.linalg.norm(np.diff(recording.ihip, axis=0), axis=1)[judged] / steps[judged]))


def judge(runs: Runs, scene: Scene) -> Finding:
    """Refine the HIP trajectory where the IHIP moves far, until each step is within the bound or is seen to stay.

    A place of a path is looked at by itself; of what cannot be led there again the whole run is refined.

    Besides, the IHIP has to lie on the surface and under the hand: a path through the solid, or elsewhere, is no
    contact point's, however smooth.
    """
    # Where sensors are not exact, the hand's way is the one that the renderer was given.
    base = runs.observed(scene).as_sensed
    if base.lacks_ihip:
        return without_ihip(base)
    tick = largest_jump(base)[1]
    if tick == 0:
        return undecided("the tool is never in contact for two samples in a row")
    astray = _find_off_surface(base)
    if astray is not None and (astray.margin or 0.0) < -scene.model.size:
        # Whether it jumps besides is no question, and costs many finer runs.
        return replace(astray, message=f"{astray.message}, farther than the model is large: is its unit the metre?")

    def finer(factor: int) -> Observed:
        """Return the run at so many times the rate."""
        return Observed(required(runs.refine)(factor), scene).as_sensed

    # Three tests, the stronger the more can be run again: one recording, the whole run, each place of a path.
    if runs.refine is None:
        finding = _judge_fixed(base)
    elif runs.look is not None:
        finding = _judge_closely(runs.look, Observed(runs.look.recording, scene), finer, runs.pieces)
    else:
        finding = _judge_refined(base, finer)
    # On the surface, but elsewhere than under the hand.
    astray = astray or find_aside(base)
    if astray is not None:
        if finding.outcome is not Outcome.FAIL:
            return astray
        evidence = {**astray.evidence, **finding.evidence}
        # Its time and place are evidence.
        besides = astray.message.partition(" at t = ")[0].partition(":")[0]
        return replace(finding, message=f"{finding.message}; besides, {besides}", evidence=evidence)
    # Deeper inside than this a late answer does not explain a tick without contact.
    depth = LAG_TICKS * base.hip_step + base.believed_standoff + rounding(scene)
    let_go_tick = lets_go(base, slice(None), depth)
    if finding.outcome is Outcome.FAIL or let_go_tick is None:
        return finding
    let_go_note = f"inside the model without contact at t = {base.time[let_go_tick]:.4g} s, which contact-kept judges"
    return replace(
        finding, message=f"{finding.message}; {let_go_note}", evidence={**finding.evidence, "let_go_tick": let_go_tick}
    )


def _find_off_surface(base: Observed) -> Finding | None:
    """Return a failure where an IHIP in contact lies off the model, farther than it may; else None.

    A late contact point lies on the surface too, or on a chord of it. Three ticks are granted

    - to what begins a contact and to what ends it: a late tool is where the hand was before, and one that learns of an
      edge at the next sample has gone on past it;
    - to a rigid tool, which is the HIP: struck between two samples, it flies at one yet.

    A tool that is at the hand in free space is right there, whatever the force: that is for contact-kept.
    """
    contact = base.holding
    if base.apart.any():
        contact = contact & ~base.pushed_in_free_space
    # A run that ends in contact does not end the contact.
    around = np.pad(np.pad(contact, (LAG_TICKS, 0)), (0, LAG_TICKS), mode="edge")
    # In contact in all of the seven ticks around: not where a contact begins or ends.
    settled = np.lib.stride_tricks.sliding_window_view(around, 2 * LAG_TICKS + 1).all(axis=1)
    settled &= np.any(base.ihip != base.hip, axis=1)
    # Half a step for a chord over an edge, three steps where a contact begins or ends.
    allowed = np.where(settled, CHORD_STEPS, LAG_TICKS) * base.recent_steps + base.across_allowed
    distance = np.zeros(len(base))
    distance[contact] = np.abs(base.boundary.signed_distance(base.ihip[contact]))
    worst = worst_row(distance - allowed)
    largest_distance = float(distance[worst])
    if largest_distance <= allowed[worst]:
        return None
    message = f"the IHIP in contact lies {mm(largest_distance)} off the surface at {base.time_and_hip(worst)}"
    metric = Metric("distance of the IHIP in contact from the surface", largest_distance, "m")
    evidence = {**base.evidence_at(worst), **Facts(off_surface_m=largest_distance).evidence, "cause": "off the surface"}
    return Finding(Outcome.FAIL, message, metric, float(allowed[worst]), evidence)


def _jump_evidence(base: Observed, tick: int) -> dict[str, object]:
    """Return where and when the IHIP moved far, and how far."""
    jump = _ihip_step_to(base, tick)
    return {
        **base.evidence_at(tick),
        "ihip_before": listed(base.ihip[tick - 1]),
        "jump_m": jump,
        "hip_step_m": base.hip_step,
        "amplification": amplification(base),
        "jump_in_hip_steps": jump / float(max(base.hip_steps[tick - 1], 1e-12)),
    }


def _ihip_step_to(base: Observed, tick: int) -> float:
    return float(np.linalg.norm(base.ihip[tick] - base.ihip[tick - 1]))


def _pop_through(base: Observed, jump: float, evidence: dict[str, object]) -> str:
    """Return what a `jump` (m) that stays is called; note as evidence whether it is mini or major (section 4.1.2)."""
    # Mini pop-through: between neighbouring pieces of the renderer's own representation.
    mini = jump <= MINI_JUMP_EDGES * base.resolution
    evidence |= Facts(severity="mini" if mini else "major").evidence
    return "mini pop-through" if mini else "pop-through"


def _pop_through_message(base: Observed, jump: float, where: str, evidence: dict[str, object]) -> str:
    """Return the message for a `jump` (m) that stays."""
    what = _pop_through(base, jump, evidence)
    return f"{what}: the IHIP jumps {where}, and stays so in finer steps"


def _continuous_message(base: Observed, jump: float) -> str:
    step = base.hip_step
    times = jump / step if step else 0.0
    return f"continuous while in contact: the largest IHIP step is {times:.3g} times the largest HIP step"


def _judge_refined(base: Observed, refine: Callable[[int], Observed], tick: int | None = None) -> Finding:
    """Refine the whole run until its worst jump is within the bound, or is seen to stay; `tick` is where to look."""
    surface_gap = base.hop_tolerance
    jump, worst = worst_step(base, bounds_with_flights(base, LAG_TICKS, surface_gap))
    tick = worst if tick is None else tick
    evidence = _jump_evidence(base, tick)
    jumps = [jump]
    slope = bound = math.nan
    for factor in REFINEMENTS[1:]:
        fine = refine(factor)
        bounds = bounds_with_flights(fine, LAG_TICKS, surface_gap)
        jump, worst = worst_step(fine, bounds)
        jumps.append(jump)
        evidence |= {"jumps_m": jumps, "refinements": list(REFINEMENTS[: len(jumps)])}
        fault = _fault_of_sibling(base, fine, factor, tick)
        if fault is not None:
            return replace(fault, evidence=evidence | {"cause": "sampling rate"})
        # Lag shrinks with the step and a jump does not, so the finest run sets the bound.
        bound = float(bounds[worst])
        slope = _shrinking_slope(jumps)
        # h, h/2 and h/4 are always run; finer ones only while it is neither small nor seen to stay.
        if factor >= LEAST_REFINEMENT and (jumps[-1] <= bound or slope < JUMP_SLOPE):
            break
    evidence["slope"] = slope
    # A jump that stays is the finest one; of what shrinks only the limit is left.
    remaining = jumps[-1] if slope < JUMP_SLOPE or jumps[-1] <= bound else limit_of_jumps(jumps)
    metric = CHECK.measured(remaining)
    where = f"{mm(remaining)} at {base.time_and_hip(tick)}"
    if remaining > bound:
        message = _pop_through_message(base, remaining, where, evidence)
        # Between the two slopes a steep map and a jump beside one look alike.
        if slope < JUMP_SLOPE or slope > SHRINKING_SLOPE:
            return Finding(Outcome.FAIL, message, metric, bound, evidence)
        message = f"steep: the IHIP moves {where}, in one step, and refinement does not settle it"
        return undecided(message, metric, bound, evidence)
    if slope < JUMP_SLOPE and remaining > bound - surface_gap:
        message = f"a jump of {where}, stays within the {mm(surface_gap)} of the declared standoff and resolution"
    elif jumps[-1] > bound:
        message = (
            f"continuous while in contact, but steep: refinement takes the largest IHIP step down to {mm(jumps[-1])}"
        )
    else:
        message = _continuous_message(base, jumps[0])
    return Finding(Outcome.PASS, message, metric, bound, evidence)


def _fault_of_sibling(base: Observed, fine: Observed, factor: int, tick: int) -> Finding | None:
    """Return a failure where a finer run lets go at the step to `tick`, or has no such step: it then shows nothing.

    A step is at most as long as the sum of the finer ones that it is made of, so the largest of k is a k-th of it at
    the least.

    A run in which the hand takes another way, as in closed loop, may lack the step without a fault.
    """
    allowed = float(step_bounds(base, LAG_TICKS, base.hop_tolerance)[tick])
    # Tick k of the base is row k `factor` of the finer run; begun as much earlier as an answer may be late.
    rows = slice(factor * max(tick - 1 - LAG_TICKS, 0), factor * tick + 1)
    if rows.stop > len(fine):
        return None
    # In closed loop the finer run may have gone another way: then it shows nothing of this step.
    hand_distance = np.linalg.norm(
        fine.hip[factor * (tick - 1) : rows.stop : factor] - base.hip[tick - 1 : tick + 1], axis=1
    )
    if hand_distance.max() > allowed:
        return None
    jump = _ihip_step_to(base, tick)
    if jump > allowed and lets_go(fine, rows, allowed) is not None:
        fine_answer = "it lets go there"
    # k steps of the finer run, of the largest length, do not add up to the jump.
    elif factor * largest_jump(fine)[0] < jump - allowed:
        fine_answer = "it does not"
    else:
        return None
    where = f"{mm(jump)} at {base.time_and_hip(tick)}"
    message = f"depends on the sampling rate: the IHIP jumps {where}; at {factor} times the rate {fine_answer}"
    return Finding(Outcome.FAIL, message, Metric("IHIP jump that only this sampling rate has", jump, "m"), allowed)


def _judge_closely(
    path: Refinable, base: Observed, refine: Callable[[int], Observed], pieces: Boundary | None
) -> Finding:
    """Look at each place where the IHIP moves far in finer steps, and at the whole run only where a jump stays."""
    surface_gap = base.hop_tolerance
    bounds = bounds_with_flights(base, HALF_LAG_STEPS, surface_gap)
    if pieces is not None:
        bounds = with_steps_of_pieces(base, bounds, pieces)
    place = look_closer(path, base, bounds=bounds, standoff=surface_gap)
    if place is None:
        steps = base.contact_steps
        jump, tick = worst_step(base, bounds)
        bound = float(bounds[tick])
        # What is measured is a step within its bound, and the evidence is of that one.
        longest = worst_row(np.where(steps <= bounds, steps, -np.inf))
        evidence = _jump_evidence(base, longest)
        if jump > bound:
            evidence |= {"steep_step_m": jump, "steep_time": float(base.time[tick])}
            message = (
                f"continuous while in contact, but steep: the IHIP moves {mm(jump)} at {base.time_and_hip(tick)}, in "
                "one step; finer ones shrink it"
            )
        elif jump > bound - surface_gap:
            message = f"a step of {mm(jump)} is within the {mm(surface_gap)} of the declared standoff and resolution"
        else:
            message = _continuous_message(base, float(steps.max()))
        metric = CHECK.measured(steps[longest])
        return Finding(Outcome.PASS, message, metric, float(bounds[longest]), evidence)
    bound = float(bounds[place.tick])
    if place.kind is Remains.UNRESOLVED:
        return _judge_refined(base, refine, place.tick)
    # How many times finer than the path's each scale is.
    finer = [2 ** round(scale.halvings) for scale in place.scales]
    evidence = _jump_evidence(base, place.tick) | {
        "jumps_m": [scale.jump for scale in place.scales],
        "refinements": finer,
        "slope": place.slope,
    }
    metric = CHECK.measured(place.remaining)
    where = f"{mm(place.remaining)} at {base.time_and_hip(place.tick)}"
    if place.kind is Remains.STEEP:
        message = (
            f"steep: the IHIP moves {where}, in a HIP step {finer[-1]} times finer than the path's; its steps shrink "
            f"with the exponent {place.slope:.2g} of the HIP's, and 1/6 is the least that counts as continuous"
        )
        return undecided(message, metric, bound, evidence)
    confirming = [jump_at_rate(factor, path, base.scene, place.tick) for factor in CONFIRMING_RATES]
    evidence["jumps_at_2_and_4_times_the_rate_m"] = confirming
    if min(confirming) < CONFIRMED_SHARE * place.remaining:
        message = f"depends on the sampling rate: the IHIP jumps {where}, and not at 2 and 4 times the rate"
    else:
        message = _pop_through_message(base, place.remaining, where, evidence)
    other = _jump_without_nearest_point(path, base, bounds, surface_gap) if base.meta.get("memory") == "none" else None
    if other is not None and other.tick != place.tick:
        evidence |= Facts(unexplained_jump_m=other.remaining).evidence
        evidence["unexplained_time"] = float(base.time[other.tick])
        message += (
            f"; besides, it jumps {mm(other.remaining)} at t = {base.time[other.tick]:.4g} s, where the nearest point "
            "does not"
        )
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


def _jump_without_nearest_point(
    path: Refinable, base: Observed, bounds: Array, surface_gap: float
) -> RoughPlace | None:
    """Return a jump that stays and that the model's own nearest point does not make within three ticks; else None.

    Of several jumps a finding has the longest only. A renderer without memory may owe that one to the medial axis, and
    not the others: the longest steps of the nearest point are allowed for here, in the `bounds` (n,), m.
    """
    nearest_steps = largest_in_lag(steps_to(base.nearest_as_rendered(slice(None))))
    place = look_closer(path, base, bounds=bounds + nearest_steps, standoff=surface_gap)
    return place if place is not None and place.kind is Remains.STAYS else None


def _shrinking_slope(jumps: list[float]) -> float:
    """Return how fast the jump shrinks with the step: the slope of log2(jump) over halvings, over all refinements.

    0 is a jump that stays, 1 what a Lipschitz map has. Where the samples fall beside a steep place shifts single jumps;
    over all of them that averages out.
    """
    if min(jumps) <= 0.0:
        return math.inf
    halvings = np.arange(len(jumps))
    # jump = c h^s with h = 2^-k, so that log2(jump) = log2(c) - s k
    return -float(np.polyfit(halvings, np.log2(jumps), 1)[0])


def limit_of_jumps(jumps: list[float]) -> float:
    """Return what is left of `jumps` (m) at infinite refinement, within [0, finest].

    Nothing, where jump = c r^k fits all to a tenth; else jump = limit + c r^k through the last three (Aitken).

    The power law comes first, for where the samples fall beside a steep place shifts single jumps, and of three of them
    Aitken's limit makes a jump.
    """
    halvings = np.arange(len(jumps))
    logs = np.log2(jumps)
    # The scatter about the power law, in log2.
    if float(np.std(logs - np.polyval(np.polyfit(halvings, logs, 1), halvings))) < POWER_LAW_SCATTER:
        return 0.0
    return aitken(*jumps[-3:])


def coarsened_slope(recording: Observed, tick: int) -> float:
    """Return how fast the largest IHIP step around `tick` grows with the samples left out: log2 a doubling.

    0 is a jump, 1 a smooth way; not a number where contact is too short.

    Over the widest window that all steps fit in; steps that leave the contact are none.
    """
    contact = recording.contact
    widest = COARSENINGS[-1]
    jumps = []
    # Every sample, every second, every fourth: the step over `width` ticks.
    for width in COARSENINGS:
        starts = np.arange(max(tick - widest, 0), min(tick + widest, len(recording)) - width)
        in_contact = [start for start in starts if contact[start : start + width + 1].all()]
        if not in_contact:
            break
        jumps.append(
            float(
                np.max(np.linalg.norm(recording.ihip[np.add(in_contact, width)] - recording.ihip[in_contact], axis=1))
            )
        )
    return -_shrinking_slope(jumps) if len(jumps) > 1 else math.nan


def _judge_fixed(base: Observed) -> Finding:
    """Apply the weaker test, for a recording that cannot be refined: the jump against the HIP step.

    Near a convex surface of curvature kappa, projecting from depth d stretches distances by 1 / (1 - kappa d). One
    recording cannot decide

    - where kappa d comes close to 1: there a long step may be honest;
    - where the step grows when samples are left out: a jump stays as long as it is, and a steep way does not.
    """
    bounds = bounds_with_flights(base, LAG_TICKS, base.hop_tolerance)
    jump, tick = worst_step(base, bounds)
    ends = base.boundary.closest_point(base.ihip[tick - 1 : tick + 1])
    # kappa d, with the largest curvature at either end of the step
    depth = float(np.linalg.norm(base.hip[tick] - base.ihip[tick]))
    bent = depth * max(0.0, float(np.linalg.eigvalsh(ends.shape).max()))
    on_axis = bent >= MEDIAL_BENDING
    # A step of the hand of length h moves the nearest point by h / (1 - kappa d).
    stretch = 1.0 if on_axis else 1.0 / (1.0 - bent)
    bound = float(bounds[tick] + (stretch - 1.0) * LAG_TICKS * base.recent_steps[tick])
    evidence = _jump_evidence(base, tick)
    metric = Metric("largest IHIP jump", jump, "m")
    moved, note = f"{mm(jump)} at {base.time_and_hip(tick)}", "judged on one sampling only, which is the weaker test"
    if jump <= bound:
        return Finding(
            Outcome.PASS, f"no jump beyond the HIP's own steps while in contact; {note}", metric, bound, evidence
        )
    if on_axis:
        message = f"the IHIP moves {moved}, in one step near the medial axis; {note}"
        return undecided(message, metric, bound, evidence)
    slope = coarsened_slope(base, tick)
    evidence["coarsened_slope"] = slope
    if not slope < JUMP_SLOPE:
        message = f"the IHIP moves {moved}, in one step, and whether finer HIP steps shrink it is not known; {note}"
        return undecided(message, metric, bound, evidence)
    what = _pop_through(base, jump, evidence)
    whose = f", over facets of {mm(base.resolution)} that the renderer declares" * what.startswith("mini")
    return Finding(Outcome.FAIL, f"{what} of {moved}{whose}; {note}", metric, bound, evidence)


CHECK = Check(
    id="continuous-contact",
    phenomenon="Continuous Contact Point",
    formula="J(h) = max |IHIP(t + h) - IHIP(t)| in contact; J at h, h/2, h/4, ... tends to 0",
    citation="thesis 3.2, Figure 3.2; pop-through: 4.1.2, 4.1.3, 6.1.3",
    channels=("hip", "ihip"),
    reads_also=("force", "measured_hip"),
    siblings={
        "pieces": "the edges that it was given",
        "look": "each place of a path where the IHIP moves far, in sub-steps",
        "refine": "or the run at 2 to 32 times the rate",
    },
    not_with=(Alters.FREE_SPACE, Alters.CONTACT_POINT),
    metric="IHIP jump that refinement leaves",
    unit="m",
    judge=judge,
)
