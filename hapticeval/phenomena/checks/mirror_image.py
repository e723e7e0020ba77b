"""Mirror image: the same contact in the mirror gives the same answers."""

from __future__ import annotations

from hapticeval.geometry.motion import mirroring
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.restated import NOBODY, check_of_relation, compare_runs
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same in the mirror."""
    assert runs.moved is not None
    other = runs.moved(mirroring(scene.model.dimension), (0.0,) * scene.model.dimension)
    return compare_runs(CHECK, runs, scene, other, "in the mirror")


CHECK = check_of_relation(
    id="mirror-image",
    formula="IHIP(M HIP; M scene) = M IHIP(HIP; scene), and F likewise, for the mirror M: y to -y",
    citation="a rigid, frictionless contact has no left and no right; 3.1",
    siblings={"moved": "the same path on the model, both mirrored in the x axis, in space in the x-z plane"},
    needs={"moved": Finding(Outcome.NOT_APPLICABLE, NOBODY)},
    not_with=(),
    judge=judge,
)
