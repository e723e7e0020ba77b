"""Relations: the same contact stated otherwise gives the same answers, whatever the right answers are.

Such metamorphic relations need no truth to compare with, and so apply to any renderer on any path: a mirror, another
order of the model's vertices, other triangles, each step of the hand in two of half the time, and a second renderer
of the kind beside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from hapticeval.geometry.boundary import distance_between
from hapticeval.geometry.motion import mirroring
from hapticeval.phenomena.check import NOBODY, Check, Runs, required
from hapticeval.phenomena.decisions import (
    AMPLIFIED_FACTOR,
    HAND_ROUNDING,
    LAG_TICKS,
    SAME_ANSWER,
    SAME_SIMULATED_ANSWER,
    STEEP_FACTOR,
)
from hapticeval.phenomena.measures.restated import (
    answers_apart,
    apart_beside_ties,
    declared_lengths,
    has_answer,
    steepness,
)
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import mm, rounding, worst_row
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, compared, not_applicable, undecided
from hapticeval.quantity import plural
from hapticeval.recordings.channels import ANSWERED
from hapticeval.recordings.recording import Recording, single_rounding
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray

METRIC = "change of the answer beside what is explained, as a share of the model's size"
UNIT = "1"


def compare_runs(
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
    if other is None:
        return not_applicable(f"the model has no such form, or the renderer refuses it {how}")
    base, restated = runs.observed(scene), Observed(other, scene)
    if not (has_answer(base) | has_answer(restated)).any():
        return undecided("the hand never touches the model")
    change = answers_apart(base, restated)
    # What restating a scene changes of the hand: a rounding of its coordinates.
    hand = HAND_ROUNDING * float(np.abs(base.hip).max())
    declared = declared_lengths((base, restated))
    # A damper takes the velocity from hands that are off by rounding, a step of half a tick apart.
    damped = 2.0 * hand * scene.damping / (scene.stiffness * 0.5 * base.dt)
    allowed = np.full(len(base), hand + declared + damped)
    exempt = np.zeros(len(base), dtype=bool)
    if np.any(change > allowed + SAME_ANSWER * scene.model.size) and runs.moved is not None:
        # Only where something is off are nudged runs made: each costs a run of its own.
        allowed += STEEP_FACTOR * steepness(runs, hand + declared, scene)
        if among is not None:
            exempt = among(runs, scene)
    if base.own_tool:
        # A tool that moves by itself has events at instants that its renderer has to find.
        known = SAME_SIMULATED_ANSWER * scene.model.size
        allowed += known - SAME_ANSWER * scene.model.size
        if np.any(change > allowed + SAME_ANSWER * scene.model.size) and runs.moved is not None:
            # Two tools that are one to `known` may meet an edge on either side. Off by half of it, each is one still.
            change = apart_beside_ties(runs, lambda nudged: answers_apart(nudged, restated), 0.5 * known, scene)
    return relation_finding(base, restated, change, allowed, exempt, how)


def relation_finding(
    base: Observed, other: Observed, change: Array, allowed: Array, exempt: BoolArray, how: str
) -> Finding:
    """Judge the `change` (n,), m, of answers beyond what is `allowed` (n,), m, in rows that are not `exempt` (n,).

    Where the IHIP of the `other` run is the same as that of `base`, it is the force that has changed.
    """
    size = base.scene.model.size
    excess = np.where(exempt, 0.0, np.maximum(change - allowed, 0.0)) / size
    # Without an excess the largest change of a row that counts is shown.
    worst = worst_row(excess if excess.max() > 0.0 else np.where(exempt, -np.inf, change))
    rows_off = int(np.sum(excess > SAME_ANSWER))
    off = f"the answer is off by {mm(change[worst])}, {change[worst] / size:.2g} of the model's size,"
    if distance_between(base.ihip[worst], other.ihip[worst]) <= allowed[worst]:
        off = f"the force is off by {distance_between(base.force[worst], other.force[worst]):.3g} N"
    return compared(
        Metric(METRIC, float(excess.max()), UNIT),
        SAME_ANSWER,
        {
            **base.evidence_at(worst),
            "off_m": float(change[worst]),
            "allowed_m": float(allowed[worst]),
            "rows_off": rows_off,
            "rows_exempt": int(exempt.sum()),
        },
        passes=f"the answers are the same {how}",
        fails=f"{how} {off} at {base.time_and_hip(worst)} ({rows_off} of {len(base)} HIPs)",
    )


def judge_mirrored(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same in the mirror."""
    dimension = scene.model.dimension
    other = required(runs.moved)(mirroring(dimension), (0.0,) * dimension)
    return compare_runs(runs, scene, other, "in the mirror")


def judge_subdivided(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same in steps of half the length and half the time, at the hands that both have."""
    if scene.effects:
        kind = scene.effects[0].kind
        return not_applicable(f"the scene calls for {kind}, which may change with time by itself")
    fine = required(runs.subdivided)()
    finding = compare_runs(runs, scene, _every_second(fine), "in steps of half the time", among=_rows_on_jumps)
    late = _ticks_late(runs.observed(scene), fine) if finding.outcome is Outcome.FAIL else None
    if late is None:
        return finding
    return replace(
        finding,
        message=f"{finding.message}: in either it comes {plural(late, 'tick')} late, so that it is a tick that it "
        "depends on",
        evidence={**finding.evidence, "ticks_late": late},
    )


def _rows_on_jumps(runs: Runs, scene: Scene) -> BoolArray:
    """Return the rows (n,) on a discontinuity, or behind one that a renderer with memory has crossed.

    Steps of half the length may cross it from elsewhere. A hand that is off by half a step on its whole way does so
    too, and its answers are apart by more than tenfold of that there.
    """
    # A subdivided run has a HIP so far from the nearest of the base run.
    half = 0.5 * runs.observed(scene).hip_step
    astride: BoolArray = steepness(runs, half, scene) > AMPLIFIED_FACTOR * half
    return astride


def _every_second(fine: Recording) -> Recording:
    """Return the rows of a subdivided run that the base run has too."""
    channels = {name: fine.channels[name][::2] for name in ANSWERED if name in fine.channels}
    return Recording(fine.time[::2], channels, meta={**fine.meta, "dt": 2.0 * fine.dt})


def _ticks_late(base: Observed, fine: Recording) -> int | None:
    """Return by how many ticks both runs' answers come late, where nothing else is between them; else None.

    The answer to HIP k of an answer that comes L ticks late stands in row k + L of the base, and in row 2 k + L of the
    subdivided run.
    """
    scene = base.scene
    answers = [(base.ihip, fine.ihip), (base.force / scene.stiffness, fine.force / scene.stiffness)]
    same = partial(np.allclose, rtol=0.0, atol=SAME_ANSWER * scene.model.size)
    for late in range(1, LAG_TICKS + 1):
        # HIP k is row 2 k of the subdivided run; both answer `late` rows later.
        rows = np.arange(LAG_TICKS, len(base) - late)
        if rows.size and all(same(coarse[rows + late], finer[2 * rows + late]) for coarse, finer in answers):
            return late
    return None


def judge_in_turns(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same by a renderer that takes turns with another one."""
    base, other = runs.observed(scene), Observed(required(runs.in_turns)(), scene)
    if not has_answer(base).any():
        return undecided("the hand never touches the model")
    # A renderer may answer in single precision.
    step = rounding(scene) + single_rounding(base.hip)
    # A velocity over dt is off by two roundings: K_d 2 step / dt, as a length by the stiffness.
    force = (1.0 + 2.0 * scene.damping / (scene.stiffness * base.dt)) * step
    force += single_rounding(base.force) / scene.stiffness
    ihip_scatter, force_scatter = (float(base.meta.get(f"{name}_scatter", 0.0)) for name in ("ihip", "force"))
    # Beside rounding what the renderer declares to scatter, of IHIP and force, as lengths.
    allowed = np.full(len(base), max(step, force) + max(ihip_scatter, force_scatter / scene.stiffness))
    change = answers_apart(base, other)
    exempt = np.zeros(len(base), dtype=bool)
    return relation_finding(base, other, change, allowed, exempt, "beside another renderer")


OFF_BY_ROUNDING = "the same path with the hand off by what rounding may change"


def check_of_relation(sibling: str, means: str, *, needs: str = NOBODY, **data: Any) -> Check:
    """Return the check of a relation that compares the base run with a `sibling`, which `means` describes."""
    return Check(
        **{
            "phenomenon": "none of the six: a relation that every rigid contact keeps to",
            "channels": ("hip", "ihip", "force"),
            "needs": {sibling: not_applicable(needs)},
            "metric": METRIC,
            "unit": UNIT,
            "level": Level.SHOULD,
            **data,
            "siblings": {sibling: means, **data.get("siblings", {})},
        }
    )


MIRROR_IMAGE = check_of_relation(
    "moved",
    "the same path on the model, both mirrored in the x axis, in space in the x-z plane",
    id="mirror-image",
    formula="IHIP(M HIP; M scene) = M IHIP(HIP; scene), and F likewise, for the mirror M: y to -y",
    citation="a rigid, frictionless contact has no left and no right; 3.1",
    not_with=(),
    judge=judge_mirrored,
)
SEAMS = check_of_relation(
    "cut",
    "the same path on the mesh with each triangle cut into 36 unequal ones, in its own plane",
    id="seams",
    formula="IHIP(HIP; cut triangles) = IHIP(HIP; triangles), and F likewise",
    citation="a surface is a set of points; 3.1",
    siblings={"moved": OFF_BY_ROUNDING},
    not_with=(),
    judge=lambda runs, scene: compare_runs(
        runs, scene, required(runs.cut)(), "with the faces cut into other triangles"
    ),
)
TIME_SUBDIVISION = check_of_relation(
    "subdivided",
    "the same HIPs with one half way between each two, at twice the sampling rate",
    needs=f"{NOBODY}, or the renderer answers a stimulus whole, and not in ticks",
    id="time-subdivision",
    formula="IHIP and F of HIP k of n = those of HIP 2 k of 2 n, with dt / 2",
    citation="a rigid contact answers the hand's way and velocity, and knows no ticks; 3.1, (3.8)",
    siblings={"moved": f"{OFF_BY_ROUNDING}, and by half a step"},
    judge=judge_subdivided,
)
TWO_AT_ONCE = check_of_relation(
    "in_turns",
    "the same path, by turns with another renderer, on the model at half its size where it has one, led backwards",
    id="two-at-once",
    phenomenon="none of the six: a property of the renderer's state",
    formula="(ihip, force) of the run = (ihip, force) of the same run, eight ticks by turns with another renderer",
    citation="the renderer protocol: factory(scene) makes a renderer",
    not_with=(),
    judge=judge_in_turns,
    level=Level.MUST,
)
VERTEX_ORDER = check_of_relation(
    "reordered",
    "the same path on the outline begun half way round its pieces, or on the mesh with vertices and triangles in the "
    "opposite order",
    id="vertex-order",
    formula="IHIP(HIP; p_k, ..., p_n, p_1, ..., p_k-1) = IHIP(HIP; p_1, ..., p_n), and F likewise",
    citation="a surface is a set of points; 3.1",
    siblings={"moved": OFF_BY_ROUNDING},
    not_with=(),
    judge=lambda runs, scene: compare_runs(
        runs, scene, required(runs.reordered)(), "with the vertices in another order"
    ),
)
CHECKS = (MIRROR_IMAGE, SEAMS, TIME_SUBDIVISION, TWO_AT_ONCE, VERTEX_ORDER)
