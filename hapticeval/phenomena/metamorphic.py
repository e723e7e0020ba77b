"""Metamorphic relations: the same contact stated otherwise gives the same answers, whatever the right answers are.

They need no truth to compare with, and so apply to any renderer on any path: a mirror, another order of the model's
vertices, each step of the hand taken in two of half the time, and a second renderer of the same kind beside.

Of the same kind are `numerical-stability`, for a turn, a shift and a scale, and `reset-clears`, for a run after a
reset.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from hapticeval.geometry.motion import mirroring
from hapticeval.phenomena.check import Check, Runs, Sibling
from hapticeval.phenomena.decisions import (
    AMPLIFIED_FACTOR,
    HAND_ROUNDING,
    LAG_TICKS,
    SAME_ANSWER,
    SAME_SIMULATED_ANSWER,
    SINGLE_ROUNDINGS,
    STEEP_FACTOR,
)
from hapticeval.phenomena.nudges import answers_apart, has_answer, steepness
from hapticeval.phenomena.sampling import believed_standoff, evidence_at, hip_step, mm, resolution, rounding
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, compared, undecided
from hapticeval.recordings.channels import ANSWERED
from hapticeval.recordings.recording import SINGLE, Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray

NOBODY = "a recording shows one run only, and nobody can be asked for another"


def judge_mirror(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same in the mirror."""
    assert runs.moved is not None
    other = runs.moved(mirroring(scene.model.dimension), (0.0,) * scene.model.dimension)
    return _compare_runs(MIRROR, runs, scene, other, "in the mirror")


def judge_order(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same on the model with its vertices in another order."""
    assert runs.reordered is not None
    return _compare_runs(ORDER, runs, scene, runs.reordered(), "with the vertices in another order")


def judge_subdivision(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same in steps of half the length and half the time, at the hands that both have."""
    assert runs.subdivided is not None
    if scene.effects:
        kind = scene.effects[0].kind
        return Finding(Outcome.NOT_APPLICABLE, f"the scene calls for {kind}, which may change with time by itself")
    fine = runs.subdivided()
    finding = _compare_runs(
        SUBDIVISION, runs, scene, _every_second(fine, 0), "in steps of half the time", among=_rows_on_jumps
    )
    if finding.outcome is not Outcome.FAIL:
        return finding
    late = _ticks_late(runs.base, fine, scene)
    if late is None:
        return finding
    many = f"{late} tick{'s' * (late > 1)}"
    message = f"{finding.message}: in either it comes {many} late, so that it is a tick that it depends on"
    evidence = {**finding.evidence, "ticks_late": late}
    return Finding(finding.outcome, message, finding.metric, finding.bound, evidence)


def judge_in_turns(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same by a renderer that takes turns with another one."""
    assert runs.in_turns is not None
    base, other = runs.base, runs.in_turns()
    if not has_answer(base).any():
        return undecided("the hand never touches the model")
    # What `run` answers at once, `step` may answer to single precision.
    step = rounding(scene) + SINGLE_ROUNDINGS * SINGLE * float(np.abs(base.hip).max())
    # A velocity over dt is off by two roundings: K_d 2 step / dt, as a length by the stiffness.
    force = (1.0 + 2.0 * scene.damping / (scene.stiffness * base.dt)) * step
    force += SINGLE_ROUNDINGS * SINGLE * float(np.abs(base.force).max()) / scene.stiffness
    scatter = [float(base.meta.get(f"{name}_scatter", 0.0)) for name in ("ihip", "force")]
    # Beside rounding what the renderer declares to scatter, of IHIP and force, as lengths.
    allowed = np.full(len(base), max(step, force) + max(scatter[0], scatter[1] / scene.stiffness))
    change = answers_apart(runs, other, scene)
    return _relation_finding(
        IN_TURNS, base, scene, change, allowed, np.zeros(len(base), dtype=bool), "beside another renderer"
    )


def _compare_runs(
    check: Check,
    runs: Runs,
    scene: Scene,
    other: Recording | None,
    how: str,
    *,
    among: Callable[[Runs, Scene], BoolArray] | None = None,
) -> Finding:
    """Compare the base run with `other`, which is the same contact stated otherwise, in the words of `how`.

    Rows that `among` returns are exempt: those on a discontinuity.
    """
    base = runs.base
    if other is None:
        return Finding(Outcome.NOT_APPLICABLE, f"the model has no such form, or the renderer refuses it {how}")
    if not (has_answer(base) | has_answer(other)).any():
        return undecided("the hand never touches the model")
    change = answers_apart(runs, other, scene)
    # What restating a scene changes of the hand: a rounding of its coordinates.
    hand = HAND_ROUNDING * float(np.abs(base.hip).max())
    declared = max(resolution(recording, scene) + believed_standoff(recording, scene) for recording in (base, other))
    # A damper takes the velocity from hands that are off by rounding, a step of half a tick apart.
    damped = 2.0 * hand * scene.damping / (scene.stiffness * 0.5 * base.dt)
    allowed = np.full(len(base), hand + declared + damped)
    exempt = np.zeros(len(base), dtype=bool)
    if np.any(change > allowed + SAME_ANSWER * scene.model.size) and runs.moved is not None:
        # Only where something is off are nudged runs made: each costs a run of its own.
        allowed += STEEP_FACTOR * steepness(runs, hand + declared, scene)
        if among is not None:
            exempt = among(runs, scene)
    # A renderer that answers a stimulus whole has events at instants that it has to find.
    allowed += 0.0 if runs.subdivided is not None else (SAME_SIMULATED_ANSWER - SAME_ANSWER) * scene.model.size
    return _relation_finding(check, base, scene, change, allowed, exempt, how)


def _relation_finding(
    check: Check,
    base: Recording,
    scene: Scene,
    change: Array,
    allowed: Array,
    exempt: BoolArray,
    how: str,
) -> Finding:
    """Judge the `change` (n,), m, of answers beyond what is `allowed` (n,), m, in rows that are not `exempt` (n,)."""
    size = scene.model.size
    excess = np.where(exempt, 0.0, np.maximum(change - allowed, 0.0)) / size
    # Without an excess the largest change of a row that counts is shown.
    worst = int(np.argmax(excess if excess.max() > 0.0 else np.where(exempt, -1.0, change)))
    return compared(
        Metric(check.metric, float(excess.max()), check.unit),
        SAME_ANSWER,
        {
            **evidence_at(base, worst),
            "off_m": float(change[worst]),
            "allowed_m": float(allowed[worst]),
            "rows_off": int(np.sum(excess > SAME_ANSWER)),
            "rows_exempt": int(exempt.sum()),
        },
        passes=f"the answers are the same {how}",
        fails=f"{how} the answer is off by {mm(change[worst])}, {change[worst] / size:.2g} of the model's size, "
        f"at {int(np.sum(excess > SAME_ANSWER))} of {len(base)} HIPs",
    )


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


NONE = "none of the six: a relation that every rigid contact keeps to"
OFF = "change of the answer beside what is explained, as a share of the model's size"
MIRROR = Check(
    id="mirror-image",
    phenomenon=NONE,
    formula="IHIP(M HIP; M scene) = M IHIP(HIP; scene), and F likewise, for the mirror M: y to -y",
    citation="a rigid, frictionless contact has no left and no right; 3.1",
    channels=("hip", "ihip", "force"),
    siblings={Sibling.MOVED: "the same path on the model, both mirrored in the x axis, in space in the x-z plane"},
    needs={Sibling.MOVED: Finding(Outcome.NOT_APPLICABLE, NOBODY)},
    metric=OFF,
    unit="1",
    judge=judge_mirror,
    level=Level.SHOULD,
)

ORDER = Check(
    id="vertex-order",
    phenomenon=NONE,
    formula="IHIP(HIP; p_k, ..., p_n, p_1, ..., p_k-1) = IHIP(HIP; p_1, ..., p_n), and F likewise",
    citation="a surface is a set of points; 3.1",
    channels=("hip", "ihip", "force"),
    siblings={
        Sibling.REORDERED: "the same path on the outline begun half way round its pieces, or on the mesh with vertices "
        "and triangles in the opposite order",
        Sibling.MOVED: "the same path with the hand off by what rounding may change",
    },
    needs={Sibling.REORDERED: Finding(Outcome.NOT_APPLICABLE, NOBODY)},
    metric=OFF,
    unit="1",
    judge=judge_order,
    level=Level.SHOULD,
)

SUBDIVISION = Check(
    id="time-subdivision",
    phenomenon=NONE,
    formula="IHIP and F of HIP k of n = those of HIP 2 k of 2 n, with dt / 2",
    citation="a rigid contact answers the hand's way and velocity, and knows no ticks; 3.1, 3.8",
    channels=("hip", "ihip", "force"),
    siblings={
        Sibling.SUBDIVIDED: "the same HIPs with one half way between each two, at twice the sampling rate",
        Sibling.MOVED: "the same path with the hand off by what rounding may change, and by half a step",
    },
    needs={
        Sibling.SUBDIVIDED: Finding(
            Outcome.NOT_APPLICABLE, f"{NOBODY}, or the renderer answers a stimulus whole, and not in ticks"
        )
    },
    metric=OFF,
    unit="1",
    judge=judge_subdivision,
    level=Level.SHOULD,
)

IN_TURNS = Check(
    id="two-at-once",
    phenomenon="none of the six: a property of the renderer's state",
    formula="(ihip, force) of the run = (ihip, force) of the same run, eight ticks by turns with another renderer",
    citation="the renderer protocol: factory(scene) makes a renderer",
    channels=("hip", "ihip", "force"),
    siblings={
        Sibling.IN_TURNS: "the same path, by turns with another renderer, on the model at half its size where it has "
        "one, led backwards"
    },
    needs={Sibling.IN_TURNS: Finding(Outcome.NOT_APPLICABLE, NOBODY)},
    metric=OFF,
    unit="1",
    judge=judge_in_turns,
)

CHECKS = (MIRROR, ORDER, SUBDIVISION, IN_TURNS)
