"""How many digits of an answer hold: a contact does not depend on where its scene lies, or on its size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hapticeval.geometry.motion import Motion, rigid_motion, scaling
from hapticeval.phenomena.check import Check, Runs, required
from hapticeval.phenomena.decisions import (
    AMPLIFIED_FACTOR,
    ANSWER_CHANGE,
    FEWEST_DIGITS,
    HAND_ROUNDING,
    MOVED_SCALE,
    MOVED_SHIFT,
    MOVED_TURN,
    STEEP_FACTOR,
    SUSPECT_SHARE,
)
from hapticeval.phenomena.measures.restated import (
    answers_apart,
    apart_beside_ties,
    declared_lengths,
    has_answer,
    steepness,
)
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import digits_kept, mm, worst_row
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, not_applicable, undecided
from hapticeval.quantity import plural
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray


def motions(scene: Scene) -> tuple[tuple[str, Motion], ...]:
    """Return the motions that the scene is looked at under, with words for each. No scale is a power of two."""
    dimension, size = scene.model.dimension, scene.model.size
    shift = size * np.array(MOVED_SHIFT)[:dimension]
    return (
        ("turned and shifted", rigid_motion(MOVED_TURN, shift)),
        ("seven times as large", scaling(MOVED_SCALE, dimension)),
        ("a seventh as large", scaling(1.0 / MOVED_SCALE, dimension)),
    )


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same in the scene moved, beside what the rounding of the hand's position explains."""
    base, moved = runs.observed(scene), required(runs.moved)
    contact = _in_contact(base)
    if not contact.any():
        return undecided("the hand never touches the model")
    # Each run comes back moved back, so that rows compare as they are.
    moved_runs = [(name, motion, moved(motion, (0.0,) * base.hip.shape[1])) for name, motion in motions(scene)]
    answering_runs = [(name, motion, Observed(run, scene)) for name, motion, run in moved_runs if run is not None]
    if not answering_runs:
        return undecided("the model cannot be moved or scaled, or the renderer refuses it then")
    return _finding(base, contact, [name for name, *_ in answering_runs], _change(runs, base, contact, answering_runs))


class _Change(NamedTuple):
    """How far answers are off, and what explains it: of each row (n,) or (motions, n), m, or a length for all, m.

    - `total`: the worst of all motions, and of `off_model`, the IHIP's distance from the surface; `apart`: each motion.
    - `hand`: what the rounding of the hand's position makes, `declared`: what renderers declare, and `steep`: what both
      become where the answer is steep.
    """

    total: Array
    apart: Array
    off_model: Array
    steep: Array
    hand: float
    declared: float

    @property
    def allowed(self) -> Array:
        """How far an answer may be off, (n,), m."""
        return np.asarray(self.hand + self.declared + STEEP_FACTOR * self.steep)


def _change(
    runs: Runs, base: Observed, contact: BoolArray, answering_runs: Sequence[tuple[str, Motion, Observed]]
) -> _Change:
    """Return how far the answers in each motion are from those of the scene as it is."""
    scene, size = base.scene, base.scene.model.size
    hips = base.hip[contact]  # a hand in free space may be as far away as centres of curvature are
    farthest = max(float(np.abs(motion(hips)).max()) / motion.scale for _, motion, _ in answering_runs)
    # Moved coordinates are rounded where they are; moved back, that is divided by the scale.
    hand = HAND_ROUNDING * max(farthest, float(np.abs(hips).max()))
    declared = declared_lengths((base, *(run for *_, run in answering_runs)))

    def apart_in_motions(nudged: Observed) -> Array:
        """Return how far the answers in each motion are from those of a `nudged` run, (motions, n), m."""
        # Under a scale the IHIPs alone are compared.
        return np.array([answers_apart(nudged, run, forces=motion.scale == 1.0) for _, motion, run in answering_runs])

    apart = apart_in_motions(base)
    # The worst of all motions.
    worst = apart.max(axis=0)
    # Where no answer is off by more than a thousandth of the bound there is nothing that nudges need explain.
    suspect = bool(worst.max() > hand + declared + SUSPECT_SHARE * ANSWER_CHANGE * size)
    steep = steepness(runs, hand + declared, scene) if suspect else np.zeros(len(base))
    # An IHIP that is off the surface in every motion alike is no less wrong.
    change = _Change(worst, apart, _distance_off_model(base, contact), steep, hand, declared)
    if base.own_tool and np.any(worst > change.allowed + ANSWER_CHANGE * size):
        # A tool that moves by itself is known to the bound: what it meets within half of that is a tie on which side.
        worst = apart_beside_ties(runs, apart_in_motions, 0.5 * ANSWER_CHANGE * size, scene).max(axis=0)
    return change._replace(total=np.maximum(worst, change.off_model))


def _finding(base: Observed, contact: BoolArray, motion_names: Sequence[str], change: _Change) -> Finding:
    """Judge the largest change that nothing explains, and show the digits that hold."""
    size = base.scene.model.size
    # Rows beside a discontinuity tell nothing of digits: nudges change their answers by more than tenfold.
    known = change.hand + change.declared
    clear = contact & (change.steep <= AMPLIFIED_FACTOR * known + ANSWER_CHANGE * size)
    excess = np.where(contact, np.maximum(change.total - change.allowed, 0.0), 0.0) / size
    # Without an excess the answer with the fewest digits is shown.
    worst = worst_row(excess if excess.max() > 0.0 else np.where(clear, change.total, -np.inf))
    off = float(change.total[worst])
    digits = digits_kept(float(change.total[clear].max(initial=0.0)), size)
    # The distance from the surface is that of the run as it is, and not of a motion.
    as_it_is = change.off_model[worst] == change.total[worst]
    motion_name = "as it is" if as_it_is else motion_names[worst_row(change.apart[:, worst])]
    evidence = {
        **base.evidence_at(worst),
        "digits": digits,
        "off_m": off,
        "rounding_m": float(change.hand),
        "declared_m": float(change.declared),
        "motion": motion_name,
        "motions": list(motion_names),
        "rows_in_contact": int(contact.sum()),
        "rows_exempt": int((contact & ~clear).sum()),
    }
    if excess.max() > ANSWER_CHANGE:
        evidence["cause"] = motion_name
        return Finding(
            Outcome.FAIL,
            f"with the scene {motion_name}, the answer is off by {mm(off)}, {off / size:.2g} of "
            f"the model's size, at {base.time_and_hip(worst)}: "
            f"{math.floor(max(0.0, digits_kept(off, size)))} digits are left",
            CHECK.measured(excess.max()),
            ANSWER_CHANGE,
            evidence,
        )
    least_digits = worst_row(np.where(clear, change.total, 0.0))
    how = "when the scene is moved"
    if clear[least_digits] and change.total[least_digits] > ANSWER_CHANGE * size:
        lengths = (change.total[least_digits], change.hand, change.declared, change.steep[least_digits])
        how += _describe_excuse(*map(float, lengths))
    # Whole ones, up to those of the bound: beyond, rounding decides, and another machine has others.
    whole_digits = min(max(0, math.floor(digits)), round(-math.log10(ANSWER_CHANGE)))
    metric = Metric("digits of the answer that hold", float(whole_digits), "digits")
    if digits < FEWEST_DIGITS:
        # What is declared explains the rest, and so nothing is certified.
        return undecided(f"undecided, {plural(whole_digits, 'digit')} {how}", metric, evidence=evidence)
    return Finding(Outcome.PASS, f"the answers keep {math.floor(digits)} digits {how}", metric, evidence=evidence)


def _in_contact(base: Observed) -> BoolArray:
    """Return the rows (n,) in contact, or with an answer to compare of a hand on the surface up to rounding."""
    near = np.asarray(base.distance <= base.rounding)
    return base.contact | (has_answer(base) & near)


def _distance_off_model(base: Observed, contact: BoolArray) -> Array:
    """Return how far (n,), m, the IHIP lies off the model in `contact` (n,); 0 elsewhere, and where there is none."""
    off_model = np.zeros(len(base))
    if not base.lacks_ihip:
        # Where a late force alone is left of a contact there is no contact point.
        contact = contact & ~base.lingering
        off_model[contact] = np.abs(base.boundary.signed_distance(base.ihip[contact]))
        # A rigid tool is struck between two samples: at the first it flies yet, and is there before the next.
        flies = np.all(base.ihip == base.hip, axis=1)
        ahead = np.append(base.hip_steps, _step_behind(base))
        off_model[flies] = np.maximum(off_model[flies] - ahead[flies], 0.0)
    return off_model


def _step_behind(base: Observed) -> float:
    """Return how far the tool gets behind the last sample at the most, m: its last step, and what the push adds."""
    step = float(base.hip_steps[-1:].sum())
    if "operator_force" in base.channels:
        step += base.dt**2 * float(np.linalg.norm(base.channels["operator_force"][-1])) / base.scene.mass
    return step


def _describe_excuse(change: float, rounding: float, declared: float, steep: float) -> str:
    """Return why an answer may be off by more than `ANSWER_CHANGE` allows; `steep` is what nudges change; all in m."""
    what = f"the declared resolution and standoff of {mm(declared)}"
    if declared <= rounding:
        what = f"the rounding of {mm(rounding)} of the largest coordinates"
    how_far = f": they are off by up to {mm(change)}"
    if change <= rounding + declared:
        return f"{how_far}, within {what}"
    return f"{how_far}, which {what} may cause: nudges of that size change it by {mm(steep)}"


CHECK = Check(
    id="numerical-stability",
    phenomenon="none of the six: what rounding does to all of them",
    formula="IHIP(M HIP; M scene) = M IHIP(HIP; scene), and F likewise, for a turn and shift M, and a scale M",
    citation="a rigid contact has no origin, no axes and no length of its own; 3.1",
    channels=("hip", "ihip", "force"),
    siblings={"moved": "the same path in the scene turned and shifted, and scaled by 7 and by 1/7"},
    needs={
        "moved": not_applicable(
            "a recording shows one place and size of the scene, and nobody can be asked for others",
        ),
    },
    not_with=(),
    metric="change of the answer beside what rounding explains, as a share of the model's size",
    unit="1",
    judge=judge,
    level=Level.SHOULD,
)
