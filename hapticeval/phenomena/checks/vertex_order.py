"""Vertex order: a model whose vertices come in another order gives the same answers."""

from __future__ import annotations

from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.restated import NOBODY, check_of_relation, compare_runs
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same on the model with its vertices in another order."""
    assert runs.reordered is not None
    return compare_runs(CHECK, runs, scene, runs.reordered(), "with the vertices in another order")


CHECK = check_of_relation(
    id="vertex-order",
    formula="IHIP(HIP; p_k, ..., p_n, p_1, ..., p_k-1) = IHIP(HIP; p_1, ..., p_n), and F likewise",
    citation="a surface is a set of points; 3.1",
    siblings={
        "reordered": "the same path on the outline begun half way round its pieces, or on the mesh with vertices "
        "and triangles in the opposite order",
        "moved": "the same path with the hand off by what rounding may change",
    },
    needs={"reordered": Finding(Outcome.NOT_APPLICABLE, NOBODY)},
    not_with=(),
    judge=judge,
)
