"""Force magnitude: the force is as large as the scene's stiffness makes it at that depth, always and everywhere.

A declared stiffness may vary with place and depth, so that one HIP has one force by any way, in any tick. Forces at the
same HIP are compared between a run and the same led backwards, which comes from the other side and at another time, and
between a run and the same at twice the rate, whose ticks have other numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import LAG_STEPS, LAG_TICKS, TELLING_SHARE, TWO_FORCES_ROWS, UNDECLARED_RANGE
from hapticeval.phenomena.lag import beside_straight, delayed, largest_in_lag, over_lag
from hapticeval.phenomena.measures.stiffness import (
    ApparentStiffness,
    find_pressed_ticks,
    force_coarseness,
    largest_other_force,
    measure_stiffness,
)
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import lengths_of, mm, newtons, steps_to, worst_row
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, undecided
from hapticeval.quantity import format_number
from hapticeval.recordings.recording import backward_difference
from hapticeval.renderer import Spring
from hapticeval.scene import Scene
from hapticeval.types import Array, IntArray


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure the stiffness at every tick in contact, and look for what explains its deviations."""
    base = runs.observed(scene).as_sensed
    if base.lacks_ihip:
        return _without_ihip(base)
    if not base.pressed.any():
        return undecided(NO_FORCE)
    declared = base.meta.get("spring")
    level = Level.MUST if declared is not None and base.stiffness_range is None else Level.SHOULD
    depths = np.linalg.norm(base.hip - base.ihip, axis=1)
    if not depths[base.pressed].any():
        message = "a rigid contact: its force comes without a depth, and has no stiffness that could be measured"
        return Finding(Outcome.NOT_APPLICABLE, message, level=level)
    # Where no law is declared: along the error, across the surface, and by size alone, as of normals that are shaded.
    springs = (*Spring, None) if declared is None else (Spring(declared),)
    pressed_ticks = find_pressed_ticks(base)
    measured = [measure_stiffness(base, pressed_ticks, spring) for spring in springs]
    # One who does not declare a law is measured by the one that fits best.
    finding = judge_stiffness(base, min(measured, key=lambda stiffness: misfit_of(stiffness, base)), level)
    if base.stiffness_range is not None and finding.outcome is not Outcome.FAIL:
        two_forces = _judge_two_forces(runs, base)
        if two_forces is not None:
            return two_forces
    if not base.declares_wide_range:
        return finding
    softest, stiffest = base.stiffness_range or (1.0, 1.0)
    declares = f"declared {softest:.3g} to {stiffest:.3g} of K, which asks little"
    return replace(finding, message=f"{finding.message}; {declares}")


def _judge_two_forces(runs: Runs, base: Observed) -> Finding | None:
    """Return a failure where a stiffness that is declared to vary does so with direction, time or tick; else None."""
    if base.scene.answer_effects_except():
        return None
    two = find_two_forces(runs, base)
    if two is None:
        return None
    message = (
        f"one HIP has two forces: {newtons(two.size)} at {base.time_and_hip(two.tick)}, and {newtons(two.other)} "
        f"{two.how}; a declared stiffness may vary with place and depth alone"
    )
    forces = {"force_N": two.size, "other_force_N": two.other, "other_way": two.how}
    evidence = {**base.evidence_at(two.tick), "cause": "two forces", **forces}
    metric = Metric("difference of two forces at one HIP", two.difference, "N")
    return Finding(Outcome.FAIL, message, metric, two.allowed, evidence, Level.MUST)


def misfit_of(measured: ApparentStiffness, base: Observed) -> tuple[float, bool, float, float]:
    """Rank how ill a law fits: beyond the declared range, with nothing clear, in more ticks, by a larger excess."""
    coarse = float(measured.beyond(base.stiffness_range or UNDECLARED_RANGE, measured.allowed_in_lag).max(initial=0.0))
    clear = measured.rows(measured.allowed <= TELLING_SHARE)
    excess = clear.beyond(base.stiffness_range or (1.0, 1.0), clear.allowed)
    deviates = excess > 0.0
    fine = float(deviates.mean()) if deviates.size else 0.0, float(excess.max(initial=0.0))
    return max(coarse, 0.0), not deviates.size, *fine


def _without_ihip(base: Observed) -> Finding:
    """Judge a force without an IHIP against the depth of the HIP under the model, the least that any IHIP could have.

    A tool that lags behind is farther away, and makes a larger force of it: only one that is too soft is seen, unless
    it is declared that there is no tool.
    """
    scene = base.scene
    depth, no_tool = np.maximum(-base.distance, 0.0), base.declares_force_only
    # A force-only renderer must give a force at every depth > 0, and not only where it gives one.
    ticks = np.flatnonzero(base.pressed | (no_tool & (depth > 0.0)))
    if not ticks.size:
        return undecided(NO_FORCE)
    # Depths (lags, n) that a late force may answer.
    late = over_lag(depth, ticks)
    size = np.linalg.norm(base.force[ticks], axis=1)
    shares = np.divide(size, scene.stiffness * late, out=np.full(late.shape, np.inf), where=late > 0.0)
    speed = np.linalg.norm(base.velocity[ticks], axis=1)
    with np.errstate(divide="ignore"):
        other_depth = (scene.damping * speed + force_coarseness(base)) / scene.stiffness
        allowed = (other_depth + base.rounding + 0.5 * base.log_step("hip") + base.standoff) / late[0]
    high = shares.max(axis=0)
    rate = backward_difference(depth[:, np.newaxis], base.time)[ticks, 0]
    low, begins = shares.min(axis=0) if no_tool else np.minimum(high, 1.0), np.zeros(ticks.size, dtype=bool)
    measured = ApparentStiffness(ticks, shares[0], low, high, allowed, allowed, late[0], rate, begins)
    note = "no IHIP was given: measured against the depth of the HIP under the model"
    finding = judge_stiffness(base, measured.rows(late[0] > 0.0), Level.SHOULD)
    if finding.outcome is Outcome.PASS and not no_tool:
        message = f"the force is nowhere too small for its depth; {note}, which does not show one that is too large"
        return replace(finding, outcome=Outcome.INCONCLUSIVE, message=message)
    return replace(finding, message=f"{finding.message} ({note})")


def judge_stiffness(base: Observed, measured: ApparentStiffness, level: Level) -> Finding:
    """Judge by the must first, over all samples, and then to what is allowed where that is little."""
    shares = base.stiffness_range or UNDECLARED_RANGE
    outside = _excess_felt(base, measured, measured.beyond(shares, measured.allowed_in_lag))
    if base.scene.answer_effects_except():
        level = Level.SHOULD  # what is called for beside the spring changes the force by a law of its own
    elif outside.size and outside.max() > 0.0:
        worst = worst_row(outside)
        bound = _edge_left(measured, worst, shares) + float(measured.allowed_in_lag[worst])
        return replace(_failed_finding(base, measured, outside, worst, bound), level=Level.MUST)
    # What is declared is what is asked for: within it no share is off.
    declared = base.stiffness_range or (1.0, 1.0)
    measured = measured.rows(measured.allowed <= TELLING_SHARE)
    if measured.begins.all():  # or there are none
        return undecided(
            "a damper, m kappa v^2 of the curvature or rounding may make a tenth of the force or more throughout: "
            "its stiffness cannot be measured"
        )
    excess = _excess_felt(base, measured, measured.beyond(declared, measured.allowed))
    worst = worst_row(excess)
    bound = float(measured.allowed[worst])
    if excess[worst] > 0.0:
        bound += _edge_left(measured, worst, declared)
        return replace(_failed_finding(base, measured, excess, worst, bound), level=level)
    # Within a lag's reach the ends of the share enclose one, wherever the present HIP alone would put it.
    metric = CHECK.measured(np.maximum(excess + measured.allowed, 0.0)[worst])
    evidence = _evidence(base, measured, worst)
    median = evidence["apparent_stiffness_N_m"]
    at_deepest = _describe_deepest(evidence, base.scene)
    message = f"the force fits the depth, with an apparent stiffness of {format_number(median)} N/m; {at_deepest}"
    return Finding(Outcome.PASS, message, metric, bound, evidence, level)


def _edge_left(measured: ApparentStiffness, worst: int, shares: tuple[float, float]) -> float:
    """Return the edge of a range of `shares` that the stiffness of a sample leaves, as a distance from one."""
    return shares[1] - 1.0 if measured.low[worst] > shares[1] else 1.0 - shares[0]


def _excess_felt(base: Observed, measured: ApparentStiffness, excess: Array) -> Array:
    """Return an `excess` (n,) that is none where depth and force are both below the floor, and nothing is felt."""
    felt = base.pressed[measured.ticks] | (measured.depth > base.force_depth)
    return np.where(felt, excess, np.minimum(excess, 0.0))


def _evidence(base: Observed, measured: ApparentStiffness, worst: int) -> dict[str, Any]:
    """Return as evidence the spread of the apparent stiffness (N/m), and force and depth where it is deepest."""
    inner = measured.rows(~measured.begins) if not measured.begins.all() else measured
    low, median, high = (base.scene.stiffness * float(share) for share in np.percentile(inner.ratio, (5, 50, 95)))
    # Where the contact begins or ends the depth is the largest that a late force may answer, and not that of its tick.
    deepest = worst_row(inner.depth)
    size, depth = float(np.linalg.norm(base.force[inner.ticks[deepest]])), float(inner.depth[deepest])
    return {
        **base.evidence_at(int(measured.ticks[worst])),
        "apparent_stiffness_N_m": median,
        "stiffness_05_N_m": low,
        "stiffness_95_N_m": high,
        "samples": int(measured.ticks.size),
        "force_N": size,
        "depth_m": depth,
        "depth_asked_m": size / base.scene.stiffness,
    }


def _describe_deepest(evidence: Mapping[str, Any], scene: Scene) -> str:
    return (
        f"at the deepest {newtons(evidence['force_N'])} at {mm(evidence['depth_m'])}, where K = {scene.stiffness:g} "
        f"N/m asks for {mm(evidence['depth_asked_m'])}"
    )


def _failed_finding(base: Observed, measured: ApparentStiffness, excess: Array, worst: int, bound: float) -> Finding:
    tick, share = int(measured.ticks[worst]), float(measured.ratio[worst])
    force, depth = float(base.force_size[tick]), float(measured.depth[worst])
    spring_force = base.scene.stiffness * depth
    # Two numbers that differ are printed so that they do.
    digits = 3 if newtons(force) != newtons(spring_force) else 6
    message = (
        f"{base.cause}: {newtons(force, digits)} {mm(depth)} deep at {base.time_and_hip(tick)}, where K asks for "
        f"{newtons(spring_force, digits)}"
    )
    evidence = _evidence(base, measured, worst) | base.cause_evidence | {"share_off": float(np.mean(excess > 0.0))}
    return Finding(Outcome.FAIL, message, CHECK.measured(abs(share - 1.0)), bound, evidence)


class TwoForces(NamedTuple):
    """Two forces, N, at the HIP of `tick`: the run's, and `other`, which came `how`; and what of it is explained."""

    tick: int
    size: float
    other: float
    how: str
    difference: float
    allowed: float

    @property
    def excess(self) -> float:
        """How far the forces differ beyond what is explained, N."""
        return self.difference - self.allowed


class _Pairs(NamedTuple):
    """Rows (k,) of a run and of an `other`, at which the hand is at one place; `lag_steps` is how many lags are tried.

    Where ticks have other numbers no lag between ticks is tried: it would make one of two that are apart.
    """

    rows: IntArray
    other: Observed
    other_rows: IntArray
    how: str
    lag_steps: int


def find_two_forces(runs: Runs, base: Observed) -> TwoForces | None:
    """Return the farthest two forces at one HIP of a path that nothing explains; None where one HIP has one force.

    Explained are one lag of up to three ticks, a damper, the curvature of one that declares no spring, coarse numbers,
    and IHIPs apart by as much. In a loop, where the hand cannot be led back, it is for `passivity` to say.
    """
    if runs.reverse is None:
        return None
    backwards = Observed(runs.reverse(), base.scene).as_sensed
    pairs = [_of_nearest(base, backwards, "on the way back")]
    if runs.refine is not None:
        finer = Observed(runs.refine(2), base.scene).as_sensed
        rows = np.arange(min(len(base), -(-len(finer) // 2)))
        pairs.append(_Pairs(rows, finer, 2 * rows, "at twice the rate", LAG_TICKS))
    return next((two for two in (_least_of_lags(base, pair) for pair in pairs) if two is not None), None)


def _of_nearest(base: Observed, other: Observed, how: str) -> _Pairs:
    """Pair each row with that of the `other` run whose HIP is nearest, within a HIP step."""
    from scipy.spatial import cKDTree

    distance, match = map(np.asarray, cKDTree(other.hip).query(base.hip))
    rows = np.flatnonzero(distance <= base.hip_step)
    return _Pairs(rows, other, match[rows], how, LAG_STEPS)


def _least_of_lags(base: Observed, pairs: _Pairs) -> TwoForces | None:
    """Return the two forces with the lag that makes least of them; None where with one of the lags there are none."""
    smallest: TwoForces | None = None
    for lag in np.linspace(0.0, LAG_TICKS, pairs.lag_steps + 1).tolist():
        two = _worst_with_lag(base, pairs, lag)
        if two is None:
            return None
        if smallest is None or two.excess < smallest.excess:
            smallest = two
    return smallest


def _worst_with_lag(base: Observed, pairs: _Pairs, lag: float) -> TwoForces | None:
    """Return the farthest two forces at one HIP, which come so many ticks after it; None of none."""
    other, late = pairs.other, math.ceil(lag)
    answered = (pairs.rows + late < len(base)) & (pairs.other_rows + late < len(other))
    rows, other_rows = pairs.rows[answered], pairs.other_rows[answered]
    pressed = base.pressed[rows + late] | other.pressed[other_rows + late]
    rows, other_rows = rows[pressed], other_rows[pressed]
    if rows.size == 0:
        return None
    # The answers to a HIP stand `lag` rows behind it, or the force's alone.
    force, other_force = delayed(base.force, rows, -lag), delayed(other.force, other_rows, -lag)
    ihips_apart = np.minimum(
        lengths_of(delayed(base.ihip, rows, -lag) - delayed(other.ihip, other_rows, -lag)),
        lengths_of(base.ihip[rows] - other.ihip[other_rows]),
    )
    # Another contact point is another place.
    same_place = ihips_apart <= base.position_tolerance + base.resolution
    if not same_place.any():
        return None
    rows, other_rows, ihips_apart = rows[same_place], other_rows[same_place], ihips_apart[same_place]
    force, other_force = force[same_place], other_force[same_place]
    difference = lengths_of(force - other_force)
    # The spring's force, by how hands and IHIPs are apart.
    apart = lengths_of(base.hip[rows] - other.hip[other_rows]) + ihips_apart
    allowed = base.scene.stiffness * _stiffest(base) * apart
    for run, ticks in ((base, rows), (other, other_rows)):
        # A lag is known to so much of a tick, and between ticks a force may lie off the straight line.
        step = LAG_TICKS / pairs.lag_steps * largest_in_lag(steps_to(run.hip))
        allowed += (run.scene.stiffness * _stiffest(run) * (step + run.rounding) + largest_other_force(run))[ticks]
        allowed += beside_straight(run.force)[ticks] if lag != late else 0.0
        allowed += force_coarseness(run)
    off = np.zeros(len(base))
    off[rows] = difference > allowed
    # So many of twice as many rows, one after the other; the whole convolution, from the first row's window on.
    many = np.convolve(off, np.ones(2 * TWO_FORCES_ROWS))[TWO_FORCES_ROWS - 1 :] >= TWO_FORCES_ROWS
    excess = np.where(many[rows], difference - allowed, -np.inf)
    worst = worst_row(excess)
    if not excess[worst] > 0.0:
        return None
    sizes = float(np.linalg.norm(force[worst])), float(np.linalg.norm(other_force[worst]))
    return TwoForces(int(rows[worst]), *sizes, pairs.how, float(difference[worst]), float(allowed[worst]))


def _stiffest(run: Observed) -> float:
    """Return the largest stiffness that a run shows in contact, as a share of the scene's, within what is declared."""
    depth = lengths_of(run.hip - run.ihip)
    deep = run.pressed & (depth > run.force_depth)
    largest_share = float((run.force_size[deep] / (run.scene.stiffness * depth[deep])).max(initial=1.0))
    return min(largest_share, (run.stiffness_range or (1.0, 1.0))[1])


NO_FORCE = "no force above the floor: the tool never presses on the surface"


CHECK = Check(
    id="force-magnitude",
    phenomenon="none of the six: the regulation scheme's stiffness, (4.6) and (6.1)",
    formula="K = -F.e / e^2 with e = HIP - IHIP; along the normal, K = F^2 / (-F.e); K = K_p at every tick in contact",
    citation="thesis 4.2, (4.8), (5.21), (6.1)",
    channels=("hip", "ihip", "force"),
    reads_also=("velocity", "measured_hip", "measured_velocity"),
    siblings={
        "reverse": "of a stiffness that is declared to vary, the same HIPs backwards",
        "refine": "and at twice the sampling rate",
        "fresh": "for a failure without a known cause, through a new renderer",
    },
    metric="apparent stiffness less the scene's, as a share of it",
    unit="",
    judge=judge,
    level=Level.SHOULD,
)
