"""Drop-out: a hand position that is missing gets no force, never the last one."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Check, Runs, required
from hapticeval.phenomena.sampling import force_floor, worst_row
from hapticeval.phenomena.verdict import Finding, Outcome, not_applicable, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array

FORCE_STAYS, FORCE_IS_NAN, STATE_SPOILED = "force stays", "no number", "spoiled"
"""Which fault it is: a force without a hand, NaN for one, and a state that has seen one."""


def fault_without_hip(answer: Array | None, after: Array | None, floor: float) -> tuple[str, str]:
    """Return what is wrong with forces (N,), N, in a tick without a HIP and in the next, which has one: kind, words.

    Both are "" for nothing. None stands for a refusal, and what is at most the `floor` (N) for no force. The doctor
    asks by the same rule.
    """
    if answer is not None and not np.isfinite(answer).all():
        return FORCE_IS_NAN, "a HIP that is missing gets a force that is no number"
    if answer is not None and np.linalg.norm(answer) > floor:
        return FORCE_STAYS, f"a HIP that is missing gets {np.linalg.norm(answer):.3g} N"
    if after is None:
        return STATE_SPOILED, "after a HIP that was missing for a tick, the next one is refused"
    if not np.isfinite(after).all():
        return STATE_SPOILED, "after a HIP that was missing for a tick, the force is no number any more"
    return "", ""


def judge(runs: Runs, scene: Scene) -> Finding:
    """Lead the hand to its largest force, give a HIP that is none, and then the next one of the path."""
    base, floor = runs.observed(scene), force_floor(scene)
    size = base.force_size
    tick = worst_row(size[:-1]) + 1
    before = float(size[tick - 1])
    if before <= floor:
        return undecided("the hand feels no force that could stay on")
    answer, after = required(runs.dropped_out)(tick)
    evidence = {**base.evidence_at(tick), "force_before_N": before, "refused": answer is None}
    kind, fault = fault_without_hip(answer, after, floor)
    if fault:
        evidence["cause"] = kind
    left = 0.0 if answer is None else float(np.linalg.norm(answer))
    if not np.isfinite(left):
        return Finding(Outcome.FAIL, fault, evidence=evidence)
    metric = CHECK.measured(left)
    if fault:
        message = f"{fault}; the tick before it was {before:.3g} N" if left > floor else fault
        return Finding(Outcome.FAIL, message, metric, floor, evidence)
    how = "is refused" if answer is None else "gets no force"
    return Finding(Outcome.PASS, f"a HIP that is missing {how}", metric, floor, evidence)


CHECK = Check(
    id="drop-out",
    phenomenon="none of the six: a force belongs to a place of the hand",
    formula="|F| = 0, or a refusal, in the tick whose HIP is not finite; a finite F in the next",
    citation="thesis 3.2: without a HIP there is no contact",
    channels=("hip", "force"),
    siblings={"dropped_out": "the path up to its largest force, a HIP that is not finite, and the next one"},
    needs={"dropped_out": not_applicable("a HIP can be left out of a path of ours alone")},
    metric="force without a hand position",
    unit="N",
    judge=judge,
)
