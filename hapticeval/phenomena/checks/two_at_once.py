"""Two at once: a renderer that takes turns with another of its factory gives the same answers."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.restated import NOBODY, answers_apart, check_of_relation, has_answer, relation_finding
from hapticeval.phenomena.sampling import rounding
from hapticeval.phenomena.verdict import Finding, Level, Outcome, undecided
from hapticeval.recordings.recording import single_rounding
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same by a renderer that takes turns with another one."""
    assert runs.in_turns is not None
    base, other = runs.base, runs.in_turns()
    if not has_answer(base).any():
        return undecided("the hand never touches the model")
    # What `run` answers at once, `step` may answer to single precision.
    step = rounding(scene) + single_rounding(base.hip)
    # A velocity over dt is off by two roundings: K_d 2 step / dt, as a length by the stiffness.
    force = (1.0 + 2.0 * scene.damping / (scene.stiffness * base.dt)) * step
    force += single_rounding(base.force) / scene.stiffness
    scatter = [float(base.meta.get(f"{name}_scatter", 0.0)) for name in ("ihip", "force")]
    # Beside rounding what the renderer declares to scatter, of IHIP and force, as lengths.
    allowed = np.full(len(base), max(step, force) + max(scatter[0], scatter[1] / scene.stiffness))
    change = answers_apart(runs, other, scene)
    return relation_finding(
        CHECK, base, scene, change, allowed, np.zeros(len(base), dtype=bool), "beside another renderer"
    )


CHECK = check_of_relation(
    id="two-at-once",
    phenomenon="none of the six: a property of the renderer's state",
    formula="(ihip, force) of the run = (ihip, force) of the same run, eight ticks by turns with another renderer",
    citation="the renderer protocol: factory(scene) makes a renderer",
    siblings={
        "in_turns": "the same path, by turns with another renderer, on the model at half its size where it has "
        "one, led backwards"
    },
    needs={"in_turns": Finding(Outcome.NOT_APPLICABLE, NOBODY)},
    not_with=(),
    judge=judge,
    level=Level.MUST,
)
