"""Drift: lap after lap over the same points, a renderer's answers stay what they are."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import ANSWER_CHANGE, STEEP_FACTOR
from hapticeval.phenomena.measures.closed_paths import laps
from hapticeval.phenomena.sampling import digits_kept, mm, worst_row
from hapticeval.phenomena.verdict import Finding, Level, compared, undecided
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the answers of each later lap with those of the second, tick by tick, where a path is repeated."""
    base, size = runs.observed(scene), scene.model.size
    contact = base.contact
    if contact.any() and np.array_equal(base.ihip, base.hip) and not base.lacks_ihip:
        return undecided("the tool is rigid: its force is what the hand pushes then, and no answer to where it is")
    # Three laps at least: the first settles, the second is what later ones are compared with.
    lap_runs = [
        lap_run
        for lap_run in laps(base.hip, size)
        if lap_run.number > 2 and contact[lap_run.first :][: lap_run.period * lap_run.number].any()
    ]
    if not lap_runs:
        return undecided("the hand never goes round a closed loop three times in contact")
    largest_excess, largest_change, worst, number = -math.inf, -math.inf, 0, 0
    for first, period, count in lap_runs:
        # (laps - 1, period, N), from the second lap on; forces as lengths, by the stiffness.
        rows = slice(first + period, first + count * period)
        hip, ihip, force = (
            channel[rows].reshape(count - 1, period, -1)
            for channel in (base.hip, base.ihip, base.force / scene.stiffness)
        )
        hand_changes, *answers = (np.linalg.norm(channel - channel[0], axis=2) for channel in (hip, ihip, force))
        changed = np.maximum(*answers)
        # Points are the same within `PLACE_ROUNDING` only: what that may change of a steep answer is not a drift, nor
        # what rounds to another number of single precision.
        excess = np.maximum(changed - STEEP_FACTOR * hand_changes - base.answered_rounding, 0.0)
        # Without any drift the tick with the largest change is shown.
        row = worst_row(np.where(excess.max() > 0.0, excess, changed))
        excess_and_change = float(excess.flat[row]), float(changed.flat[row])
        if excess_and_change > (largest_excess, largest_change):
            (largest_excess, largest_change), worst, number = excess_and_change, first + period + row, count
    digits = digits_kept(largest_change, size)
    ticks = sum(period * count for _, period, count in lap_runs)
    evidence = {**base.evidence_at(worst), "digits": digits, "off_m": largest_change, "laps": number, "ticks": ticks}
    return compared(
        CHECK.measured(largest_excess / size),
        ANSWER_CHANGE,
        evidence,
        passes=f"after {number} laps the answers are those of the second, to {math.floor(digits)} digits",
        fails=f"the answers drift: in {number} laps over the same points by up to {mm(largest_change)}",
    )


CHECK = Check(
    id="drift",
    phenomenon="none of the six: what rounding adds up to in all of them",
    formula="(ihip, force)(lap k) = (ihip, force)(lap 2) for every k > 2",
    citation="a rigid contact does not age; 3.1",
    channels=("hip", "ihip", "force"),
    metric="change of the answers in later laps, as a share of the model's size",
    unit="1",
    judge=judge,
    level=Level.SHOULD,
)
