"""Cases in space of suites that are of the plane: each renderer of ours that takes the model gets what is expected."""

from __future__ import annotations

import golden
import pytest

from hapticeval.discovery import own_renderers, resolve
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite

SUITES = [load_suite(name) for name in ("generated", "hard-cases-loops")]
IN_SPACE = [(suite, case) for suite in SUITES for case in suite.cases if case.build_scene().model.dimension == 3]


@pytest.mark.system
@pytest.mark.parametrize(("suite", "case"), IN_SPACE, ids=lambda each: each.name)
def test_a_case_in_space_is_judged_as_expected(suite, case):
    decided = set()
    for name in suite.renderers or own_renderers():
        judged = judge(resolve(name), name, suite.name, case)
        assert judged.error is None
        assert golden.unexpected(judged.verdicts) == []
        decided |= {name for verdict in judged.verdicts if verdict.outcome in (Outcome.PASS, Outcome.FAIL)}
    assert "minimum-distance" in decided
    assert len(decided) > 1
