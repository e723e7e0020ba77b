"""Seams: a flat face gives the same answers however many triangles it is made of."""

from __future__ import annotations

from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.restated import NOBODY, check_of_relation, compare_runs
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare a run with the same on the mesh with each triangle cut into unequal ones."""
    assert runs.cut is not None
    return compare_runs(CHECK, runs, scene, runs.cut(), "with the faces cut into other triangles")


CHECK = check_of_relation(
    id="seams",
    formula="IHIP(HIP; cut triangles) = IHIP(HIP; triangles), and F likewise",
    citation="a surface is a set of points; 3.1",
    siblings={
        "cut": "the same path on the mesh with each triangle cut into 36 unequal ones, in its own plane",
        "moved": "the same path with the hand off by what rounding may change",
    },
    needs={"cut": Finding(Outcome.NOT_APPLICABLE, NOBODY)},
    not_with=(),
    judge=judge,
)
