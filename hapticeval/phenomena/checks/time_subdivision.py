"""Time subdivision: steps of half the length and half the time give the same answers at the same hands."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.decisions import (
    AMPLIFIED_FACTOR,
    LAG_TICKS,
    SAME_ANSWER,
)
from hapticeval.phenomena.restated import NOBODY, check_of_relation, compare_runs, steepness
from hapticeval.phenomena.sampling import hip_step
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.quantity import plural
from hapticeval.recordings.channels import ANSWERED
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same in steps of half the length and half the time, at the hands that both have."""
    assert runs.subdivided is not None
    if scene.effects:
        kind = scene.effects[0].kind
        return Finding(Outcome.NOT_APPLICABLE, f"the scene calls for {kind}, which may change with time by itself")
    fine = runs.subdivided()
    finding = compare_runs(
        CHECK, runs, scene, _every_second(fine, 0), "in steps of half the time", among=_rows_on_jumps
    )
    if finding.outcome is not Outcome.FAIL:
        return finding
    late = _ticks_late(runs.base, fine, scene)
    if late is None:
        return finding
    many = plural(late, "tick")
    message = f"{finding.message}: in either it comes {many} late, so that it is a tick that it depends on"
    evidence = {**finding.evidence, "ticks_late": late}
    return Finding(finding.outcome, message, finding.metric, finding.bound, evidence)


def _rows_on_jumps(runs: Runs, scene: Scene) -> BoolArray:
    """Return the rows (n,) on a discontinuity, or behind one that a renderer with memory has crossed.

    Steps of half the length may cross it from elsewhere. A hand that is off by half a step on its whole way does so
    too, and its answers are apart by more than tenfold of that there.
    """
    # A subdivided run has a HIP so far from the nearest of the base run.
    half = 0.5 * hip_step(runs.base, scene)
    astride: BoolArray = steepness(runs, half, scene) > AMPLIFIED_FACTOR * half
    return astride


def _every_second(fine: Recording, first: int) -> Recording:
    """Return every second row of a subdivided run, from row `first` on."""
    rows = slice(first, None, 2)
    channels = {name: fine.channels[name][rows] for name in ANSWERED if name in fine.channels}
    return Recording(fine.time[rows], channels, meta={**fine.meta, "dt": 2.0 * fine.dt})


def _ticks_late(base: Recording, fine: Recording, scene: Scene) -> int | None:
    """Return by how many ticks both runs' answers come late, where nothing else is between them; else None.

    The answer to HIP k of an answer that comes L ticks late stands in row k + L of the base, and in row 2 k + L of the
    subdivided run.
    """
    ways: Mapping[str, Array] = {"ihip": base.ihip, "force": base.force / scene.stiffness}
    finer: Mapping[str, Array] = {"ihip": fine.ihip, "force": fine.force / scene.stiffness}
    for late in range(1, LAG_TICKS + 1):
        # HIP k is row 2 k of the subdivided run; both answer `late` rows later.
        rows = np.arange(LAG_TICKS, len(base) - late)
        if rows.size and all(
            np.allclose(
                ways[name][rows + late], finer[name][2 * rows + late], rtol=0.0, atol=SAME_ANSWER * scene.model.size
            )
            for name in ways
        ):
            return late
    return None


CHECK = check_of_relation(
    id="time-subdivision",
    formula="IHIP and F of HIP k of n = those of HIP 2 k of 2 n, with dt / 2",
    citation="a rigid contact answers the hand's way and velocity, and knows no ticks; 3.1, 3.8",
    siblings={
        "subdivided": "the same HIPs with one half way between each two, at twice the sampling rate",
        "moved": "the same path with the hand off by what rounding may change, and by half a step",
    },
    needs={
        "subdivided": Finding(
            Outcome.NOT_APPLICABLE, f"{NOBODY}, or the renderer answers a stimulus whole, and not in ticks"
        )
    },
    judge=judge,
)
