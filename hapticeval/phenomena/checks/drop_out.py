"""Drop-out: a hand position that is missing gets no force, never the last one."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.sampling import evidence_at, force_floor
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, undecided
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Lead the hand to its largest force, give a HIP that is none, and then the next one of the path."""
    assert runs.dropped_out is not None
    base = runs.base
    size = np.linalg.norm(base.force, axis=1)
    tick = int(np.argmax(size[:-1])) + 1
    if size[tick - 1] <= force_floor(scene):
        return undecided("the hand feels no force that could stay on")
    answer, after = runs.dropped_out(tick)
    evidence = {**evidence_at(base, tick), "force_before_n": float(size[tick - 1]), "refused": answer is None}
    if answer is not None and not np.isfinite(answer).all():
        return Finding(Outcome.FAIL, "a HIP that is missing gets a force that is no number", evidence=evidence)
    left = 0.0 if answer is None else float(np.linalg.norm(answer))
    metric = Metric(CHECK.metric, left, "N")
    if left > force_floor(scene):
        message = f"a HIP that is missing gets {left:.3g} N; the tick before it was {size[tick - 1]:.3g} N"
        return Finding(Outcome.FAIL, message, metric, force_floor(scene), evidence)
    if after is not None and not np.isfinite(after).all():
        message = "after a HIP that was missing for a tick, the force is no number any more"
        return Finding(Outcome.FAIL, message, metric, force_floor(scene), evidence)
    how = "is refused" if answer is None else "gets no force"
    return Finding(Outcome.PASS, f"a HIP that is missing {how}", metric, force_floor(scene), evidence)


CHECK = Check(
    id="drop-out",
    phenomenon="none of the six: a force belongs to a place of the hand",
    formula="|F| = 0, or a refusal, in the tick whose HIP is not finite",
    citation="thesis 3.2: without a HIP there is no contact",
    channels=("hip", "force"),
    siblings={"dropped_out": "the path up to its largest force, a HIP that is not finite, and the next one"},
    needs={"dropped_out": undecided("a tick that is missing can be put into a path of ours only")},
    metric="force without a hand position",
    unit="N",
    level=Level.SHOULD,
    judge=judge,
)
