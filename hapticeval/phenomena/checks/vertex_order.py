"""Vertex order: a model whose vertices come in another order gives the same answers."""

from __future__ import annotations

from hapticeval.phenomena.check import Check, Runs, Sibling
from hapticeval.phenomena.restated import NOBODY, OFF, RELATION, compare_runs
from hapticeval.phenomena.verdict import Finding, Level, Outcome
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same on the model with its vertices in another order."""
    assert runs.reordered is not None
    return compare_runs(CHECK, runs, scene, runs.reordered(), "with the vertices in another order")


CHECK = Check(
    id="vertex-order",
    phenomenon=RELATION,
    formula="IHIP(HIP; p_k, ..., p_n, p_1, ..., p_k-1) = IHIP(HIP; p_1, ..., p_n), and F likewise",
    citation="a surface is a set of points; 3.1",
    channels=("hip", "ihip", "force"),
    siblings={
        Sibling.REORDERED: "the same path on the outline begun half way round its pieces, or on the mesh with vertices "
        "and triangles in the opposite order",
        Sibling.MOVED: "the same path with the hand off by what rounding may change",
    },
    needs={Sibling.REORDERED: Finding(Outcome.NOT_APPLICABLE, NOBODY)},
    not_with=(),
    metric=OFF,
    unit="1",
    judge=judge,
    level=Level.SHOULD,
)
