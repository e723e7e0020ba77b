"""Every verdict of our renderers in every suite is the recorded one, with its metric: see `golden.py`."""

from __future__ import annotations

import golden
import measured
import pytest
from publishing import concerned

from hapticeval.discovery import own_renderers, resolve
from hapticeval.runner.judging import judge
from hapticeval.suite.outline import find_suites
from hapticeval.suite.reading import load_suite
from hapticeval.suite.suite import Suite

pytestmark = pytest.mark.system

SUITES = [load_suite(name) for name in sorted(find_suites()) if name != "thesis"]


def renderers_of(suite: Suite) -> tuple[str, ...]:
    """Those that run in a suite where none is named."""
    return tuple(suite.renderers) or own_renderers()


RUNS = [
    pytest.param(suite, name, case, id=f"{suite.name}-{name}-{case.name}")
    for suite in SUITES
    for name in renderers_of(suite)
    for case in concerned(suite.cases)
]


@pytest.mark.parametrize(("suite", "name", "case"), RUNS)
def test_every_verdict_is_the_recorded_one(suite, name, case):
    judged = judge(resolve(name), name, suite.name, case)
    assert judged.error is None
    golden.compare(suite, renderers_of(suite), name, judged.verdicts)
    findings = {(verdict.case, verdict.check): verdict.finding for verdict in judged.verdicts}
    measured.compare(suite.name, name, findings)
    assert [entry.message for entry in golden.unexpected(judged.verdicts) if entry.published is not None] == []


def test_each_suite_has_its_table_of_all_its_cases_and_no_other_is_there():
    names = {file.name.removesuffix("_verdicts.csv") for file in golden.table_of("").parent.glob("*_verdicts.csv")}
    assert names == set(find_suites())
    for suite in SUITES:
        assert set(golden.recorded(suite.name)) == {(case.name, check) for case in suite.cases for check in case.checks}


def test_a_cell_reads_as_it_was_written():
    cells = [text for row in golden.recorded("thesis").values() for text in row.values()]
    assert [golden.Cell.read(text).text for text in cells] == cells
    assert sum(golden.Cell.read(text).bound is not None for text in cells) > len(cells) // 2
