"""Paths in space that hypothesis draws: each renderer of ours that takes the model gets what is written down."""

from __future__ import annotations

import pytest

from hapticeval.discovery import own_renderers, resolve
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite

SUITE = load_suite("generated")
IN_SPACE = [case for case in SUITE.cases if case.build_scene().model.dimension == 3]


@pytest.mark.parametrize("case", IN_SPACE, ids=lambda case: case.name)
def test_drawn_paths_in_space_are_judged_as_expected(case):
    decided = set()
    for name in own_renderers():
        judged = judge(resolve(name), name, SUITE.name, case)
        assert judged.error is None
        assert [verdict for verdict in judged.verdicts if not verdict.as_expected] == []
        decided |= {name for verdict in judged.verdicts if verdict.outcome in (Outcome.PASS, Outcome.FAIL)}
    assert "minimum-distance" in decided
    assert len(decided) > 1
