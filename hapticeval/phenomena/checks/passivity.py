"""Passivity: over a path that closes, the hand gets back no more work than it has put in."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import FINER_RATES, MOST_LAPS, UNDECLARED_RANGE
from hapticeval.phenomena.lag import force_only_lag
from hapticeval.phenomena.measures.closed_paths import LapRun, SampledWork, contact_spans, laps, running_sums
from hapticeval.phenomena.measures.gained_work import Gain, Span, gain_over, stored_before
from hapticeval.phenomena.measures.stiffness import largest_other_force
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import mm, worst_of, worst_row
from hapticeval.phenomena.verdict import Finding, Outcome, shown_only, undecided
from hapticeval.quantity import format_number
from hapticeval.recordings.energy_balance import balance
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray


@dataclass(frozen=True)
class AtOwnRate:
    """The work, J, that the hand gets over a `span` up to row `last` at the scene's own rate, and what is explained.

    `explained` is what `explained_work` makes of a `lag` of the force, ticks.
    """

    span: Span
    last: int
    work: float
    explained: float
    lag: float

    @property
    def excess(self) -> float:
        """How far the work is beyond what explains it, J."""
        return self.work - self.explained


def explained_work(base: Observed, lag: float) -> Array:
    """Return what a spring and a damper give the hand for being held and late, J from the first row to each, (n,).

    Let F = -K (x - p) with an IHIP p that is nowhere led against the hand, dp . dx >= 0, as no nearest point is.

    - Held for a tick, F . dx is the work of its law and at most (K/2) |dx|^2 more, for at a share s of the step it has
      changed by (F(s) - F) . dx >= -K s |dx|^2.
    - Each tick of lag adds K |dx|^2.
    - A force G beside it adds (1/2 + lag) |dG| |dx|: that of a damper, and of what the curvature asks for, is as large
      as it may be at most.
    - A stiffness that is declared to vary, with K within its range, changes the force by |dK| |x - p| as well.
    """
    scene = base.scene
    error, moved = base.hip - base.ihip, np.linalg.norm(np.diff(base.hip, axis=0), axis=1)
    touches = base.contact
    # As stiff as `force-magnitude` lets it be.
    along_error, full_spring = -np.sum(base.force * error, axis=1), scene.stiffness * np.sum(error**2, axis=1)
    declared = base.stiffness_range
    softest, stiffest = declared or (1.0, UNDECLARED_RANGE[1])
    # K / K_p = -F . e / (K_p e^2), within what is declared
    share = np.clip(
        np.divide(along_error, full_spring, out=np.ones_like(along_error), where=full_spring > 0.0), softest, stiffest
    )
    other_force = base.force + (scene.stiffness * share)[:, np.newaxis] * error
    largest_other = largest_other_force(base)
    size = np.linalg.norm(other_force, axis=1)
    # G is cut to the largest that a damper and the curvature may give.
    other_force *= np.divide(np.minimum(size, largest_other), size, out=np.zeros_like(size), where=size > 0.0)[
        :, np.newaxis
    ]
    changed = np.linalg.norm(np.diff(other_force, axis=0), axis=1)
    if declared is not None:
        depth = np.linalg.norm(error, axis=1)
        changed += scene.stiffness * np.abs(np.diff(share)) * np.maximum(depth[1:], depth[:-1])
    # Only steps that begin or end in contact: in free space there is no force to be held.
    steps = np.where(touches[1:] | touches[:-1], moved, 0.0)
    stiffness = scene.stiffness * np.maximum(share[1:], share[:-1])
    # The lag reaches back: to the longest of the steps, and the largest change, that it may be made of.
    steps, changed = _largest_of_recent(steps, math.ceil(lag)), _largest_of_recent(changed, math.ceil(lag))
    # (1/2 + lag) (K |dx|^2 + |dG| |dx|)
    return running_sums((0.5 + lag) * (stiffness * steps**2 + changed * steps))


def _largest_of_recent(values: Array, ticks: int) -> Array:
    """Return the largest of each of `values` (n,), as m or N, and of so many `ticks` before it: (n,)."""
    later = [
        np.concatenate([np.zeros(ticks_back), values[: values.size - ticks_back]])
        for ticks_back in range(min(ticks, values.size) + 1)
    ]
    return np.asarray(np.max(later, axis=0))


def _at_own_rate(base: Observed, sampled: SampledWork, closed_paths: list[ClosedPath]) -> AtOwnRate | None:
    """Return over what rows the hand gets most beyond what is explained; None where nothing says what is.

    A scene's effects have laws of their own, and a stiffness that varies by much may have any slope.
    """
    if base.scene.effects or base.declares_wide_range or "ihip" not in base.channels:
        return None
    alone = base.lacks_ihip
    # For a force alone, the surface's nearest point shows how stiff and how late it is.
    base = base.with_nearest_points if alone else base
    lag = float(force_only_lag(base.recording, base.pressed)) if alone else base.force_lag
    rounding = base.rounding_floor(sampled.effort, base.scene.stiffness * sampled.path)
    work, explained = sampled.held, explained_work(base, lag) + rounding

    def largest(span: Span) -> AtOwnRate:
        """Return the work, J, of a span up to where it is farthest beyond what is explained."""
        last = int(span.ends[worst_row((work - explained)[span.ends])])
        gained, granted = (float(sums[last] - sums[span.first]) for sums in (work, explained))
        return AtOwnRate(span, last, gained, granted + stored_before(base, span), lag)

    # Of each closed path the span that gains least.
    gains = [worst_of([largest(span) for span in spans], lambda gain: -gain.excess) for spans in closed_paths]
    return worst_of(gains, lambda gain: gain.excess)


def active_by_nature(scene: Scene) -> str | None:
    """Say what the scene calls for that gives energy away whatever the renderer does; None where nothing does."""
    return next((why for effect in scene.effects if (why := effect.active(scene.damping)) is not None), None)


def judge(runs: Runs, scene: Scene) -> Finding:
    """Ask whether the hand gets work out of a path that closes, at the start and end of which the same is stored."""
    active = active_by_nature(scene)
    finding = _judge_fixed(runs.observed(scene)) if runs.refine is None else _judge_spending(runs, runs.refine, scene)
    if active is None:
        return finding
    return shown_only(finding, active)


def _judge_spending(runs: Runs, refine: Callable[[int], Recording], scene: Scene) -> Finding:
    """Judge all paths that close, but for laps that only give what was stored before."""
    base, set_aside = runs.observed(scene), ""
    if not base.contact.any():
        return undecided("the tool is never in contact")
    lap_runs = laps(base.hip, scene.model.size)
    while True:
        finding, failing_span = _judge(base, refine, partial(_find_closed_paths, lap_runs=lap_runs))
        if failing_span is None or not failing_span.closes_lap:
            return replace(finding, message=finding.message + set_aside)
        lap_run = next(
            lap_run
            for lap_run in lap_runs
            if failing_span.last in range(lap_run.first, lap_run.first + lap_run.number * lap_run.period + 1)
        )
        if not _spends_store(runs, lap_run, scene):
            return finding
        lap_runs.remove(lap_run)
        set_aside = "; laps that give are set aside: led on until what the hand had put in is spent, they give no more"


ClosedPath: TypeAlias = list[Span]
"""A path that closes: one span, or those of a round lap_run's laps, of which the one that gives least counts."""

PathSearch: TypeAlias = Callable[[BoolArray], list[ClosedPath]]
"""From where nothing touches, (n,), the paths that close."""


def _since_free_space(free: BoolArray, first: int, last: int) -> Span:
    return Span(first, last, "from free space to free space" if free[last] else "since free space")


def _find_closed_paths(free: BoolArray, lap_runs: list[LapRun]) -> list[ClosedPath]:
    """Return the paths that close: from free space on, and the laps after the first in which something is touched."""
    closed_paths = [[_since_free_space(free, *rows)] for rows in contact_spans(free)]
    for lap_run in lap_runs:
        # What one lap alone gives may have been stored; what is created comes in every lap.
        after = [Span.of_lap(first, last) for first, last in lap_run.later if not free[first:last].all()]
        if after:
            closed_paths.append(after)
    return closed_paths


def _judge(
    base: Observed, refine: Callable[[int], Recording], find_closed_paths: PathSearch
) -> tuple[Finding, Span | None]:
    """Return what the paths that close show, and over which span the hand gets work where that is a failure."""
    sampled = SampledWork(base, 1)
    if not find_closed_paths(sampled.free):
        return undecided(
            "the hand neither comes from free space nor goes round a closed loop twice: what is stored is not known"
        ), None
    # Refined until a gain is certain, or nothing is open.
    for finest_rate in FINER_RATES:
        gains = _gains(base, sampled, refine, find_closed_paths, finest_rate)
        telling = [gain for gain in gains if gain.telling]
        if any(gain.excess > 0.0 for gain in telling) or len(telling) == len(gains):
            break
    # First the limit of fast sampling, then what sampling at this rate may add.
    finding = judge_law(base, gains, telling)
    if finding.outcome is Outcome.FAIL:
        return finding, _worst(telling).span
    at_own_rate = _at_own_rate(base, sampled, find_closed_paths(sampled.free))
    if finding.outcome is Outcome.PASS and base.declares_wide_range:
        words = "what that adds is not asked of so wide a declared stiffness"
        return replace(finding, message=f"{finding.message}; {words}"), None
    if at_own_rate is None or at_own_rate.excess <= 0.0:
        return finding, None
    return _hold_failure(base, at_own_rate), at_own_rate.span


def _spends_store(runs: Runs, lap_run: LapRun, scene: Scene) -> bool:
    """Return whether laps give only what was stored before: led on until that is spent, they give no more.

    A passivity controller stores what the hand puts in, and gives it back later. Since free space the hand has put in
    E; of a gain W a lap the first E / W laps prove nothing, and the one after them does.
    """
    base = runs.observed(scene)
    free = np.flatnonzero(~base.contact[: lap_run.first + 1])
    if runs.led_on is None or free.size == 0:
        return False
    work, closes = SampledWork(base, 1), lap_run.first + lap_run.period
    # As a controller sums it up, which knows in each tick the force and the step before it: F[i] . (x[i] - x[i-1]).
    # Twice the trapezoid less the rectangle of the step's begin, which is the held force's, is that of its end.
    observed = 2.0 * work.smooth - work.held
    stored, gained = observed[free[-1]] - observed[closes], observed[closes + lap_run.period] - observed[closes]
    if not 0.0 < stored <= MOST_LAPS * gained:
        return False
    # One lap to load a memory, those that spend the store, and one that shows what comes after.
    led = runs.led_on(math.ceil(stored / gained) + 2, lap_run.first, lap_run.period)
    if led.refine is None:
        return False
    after = [[Span.of_lap(len(led.base) - 1 - lap_run.period, len(led.base) - 1)]]
    _, failing_span = _judge(led.observed(scene), led.refine, lambda _: after)
    return failing_span is None


def _worst(telling: Sequence[Gain]) -> Gain:
    """Return the gain that is farthest beyond what is open of it."""
    return worst_of(telling, lambda gain: gain.excess)


def judge_law(base: Observed, gains: Sequence[Gain], telling: Sequence[Gain]) -> Finding:
    """Judge the limit to which refinement leads, J."""
    if not telling:
        return undecided("refinement does not settle the work that crosses between hand and renderer")
    untold_gains = [gain for gain in gains if not gain.telling]
    worst = _worst(telling)
    metric = CHECK.measured(worst.law)
    evidence = {
        **base.evidence_at(worst.last),
        "from_time": float(base.time[worst.span.first]),
        "way": worst.span.what,
        "hold_J": worst.hold,
        "lag_J": worst.lag,
        "law_J": worst.law,
        "crossed_J": worst.crossed,
        "ways": len(telling),
        "laps": sum(gain.span.closes_lap for gain in telling),
    }
    if worst.excess > 0.0:
        where = mm(*base.hip[worst.span.first : worst.last].mean(axis=0))
        message = (
            f"creates energy: {worst.span.what}, round {where} until t = {base.time[worst.last]:.4g} s, the hand gets "
            f"{_millijoules(worst.law)} that it never gave"
        )
        return Finding(Outcome.FAIL, message, metric, worst.granted, evidence)
    if untold_gains:
        largest = worst_of(untold_gains, lambda gain: gain.law)
        message = (
            f"refinement does not settle {len(untold_gains)} of {len(gains)} ways, as {largest.span.what} from "
            f"t = {base.time[largest.span.first]:.4g} s to {base.time[largest.last]:.4g} s; over the others it gets no "
            "energy"
        )
        return undecided(message, metric, worst.granted, evidence)
    by_holding = f"at {1e3 * base.dt:.3g} ms holding the force adds {_millijoules(worst.hold)}"
    message = f"the hand gets back no more than it put in; {worst.span.what} {by_holding}"
    return Finding(Outcome.PASS, message, metric, worst.granted, evidence)


def _gains(
    base: Observed,
    base_sums: SampledWork,
    refine: Callable[[int], Recording],
    find_closed_paths: PathSearch,
    finest: int,
) -> list[Gain]:
    """Return the gains over all closed paths of the base run, extrapolated from `finest` times its rate."""
    factors = (finest // 4, finest // 2, finest)
    sampled = (
        base_sums,
        *(
            base_sums if factor == 1 else SampledWork(Observed(refine(factor), base.scene), factor)
            for factor in factors
        ),
    )
    count = min(sums.free.size for sums in sampled)
    last = sampled[-1]
    rounding = base.rounding_floor(last.effort, base.scene.stiffness * last.path)
    # Free in all of the runs: their contacts may begin a tick apart.
    free = np.logical_and.reduce([sums.free[:count] for sums in sampled])
    return [
        min(
            (gain_over(sampled, span, rounding, stored_before(base, span)) for span in spans),
            key=lambda gain: (not gain.telling, gain.excess),
        )
        for spans in find_closed_paths(free)
    ]


def _hold_failure(base: Observed, gain: AtOwnRate) -> Finding:
    """Return the failure of a renderer whose law creates nothing, and that gives more than a held spring does."""
    where = mm(*base.hip[gain.span.first : gain.last].mean(axis=0))
    lag_shown = f", {gain.lag:.2g} ticks late," if gain.lag > 0.0 else ""
    message = (
        f"creates energy at {1e3 * base.dt:.3g} ms: {gain.span.what}, round {where} until "
        f"t = {base.time[gain.last]:.4g} s, the hand gets {_millijoules(gain.work)}; a spring that is held for a tick"
        f"{lag_shown} gives {_millijoules(gain.explained)}"
    )
    evidence = {
        **base.evidence_at(gain.last),
        "from_time": float(base.time[gain.span.first]),
        "way": gain.span.what,
        "held_J": gain.work,
        "explained_J": gain.explained,
        "lag_ticks": gain.lag,
    }
    return Finding(Outcome.FAIL, message, CHECK.measured(gain.work), gain.explained, evidence)


def _millijoules(energy: float) -> str:
    return f"{format_number(1e3 * energy, 3)} mJ"


def _judge_fixed(base: Observed) -> Finding:
    """Apply the weaker test, of a recording that cannot be refined: see `recordings.energy_balance`."""
    note = "judged on one sampling only, which is the weaker test"
    gifts = balance(base.hip, base.force, base.time)
    if not gifts:
        return undecided(f"no two rows bound what is stored; {note}")
    # All lags must agree: the least counts.
    worst = worst_of(gifts, lambda gift: -gift.excess)
    metric = CHECK.measured(worst.energy)
    evidence = {
        **base.evidence_at(worst.last),
        "from_time": float(base.time[worst.first]),
        "way": worst.how,
    }
    if worst.explained:
        return Finding(Outcome.PASS, f"the hand gets back no more than it put in; {note}", metric, worst.open, evidence)
    message = (
        f"creates energy: from t = {base.time[worst.first]:.4g} s to {base.time[worst.last]:.4g} s the hand gets "
        f"{_millijoules(worst.energy)} that it never gave; {note}"
    )
    return Finding(Outcome.FAIL, message, metric, worst.open, evidence)


CHECK = Check(
    id="passivity",
    phenomenon="none of the six: a rigid, frictionless surface gives the hand no energy (3.2, 3.5)",
    formula="W = sum of F . dx <= 0 since free space, and over each closed lap after the first, as h -> 0",
    citation="thesis 2.6, 3.2",
    channels=("hip", "force"),
    reads_also=("ihip",),
    siblings={
        "refine": "the same stimulus at 2, 4 and, while undecided, 8 and 16 times the sampling rate",
        "led_on": "where laps give energy: as many more as spend what the hand has put in before",
    },
    needs_loop=True,
    metric="work that the hand gets back beyond what it put in",
    unit="J",
    judge=judge,
)
