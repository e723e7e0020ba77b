"""The suites of solids and of unilateral surfaces: each verdict of the reference renderers is as its reasons expect."""

from __future__ import annotations

from fnmatch import fnmatch

import golden
import pytest
from msgspec.structs import replace

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import judge
from hapticeval.runner.progress import fill_table, suite_entry
from hapticeval.suite.reading import load_suite

SOLIDS, SURFACES = load_suite("solids"), load_suite("unilateral-surfaces")
RIGID = "ideal"
"""No renderer: it has no depth and no memory to judge, and nothing of it is in print."""
LARGE = ("icosphere-20480", "icosphere-81920")
"""Left to `hapticeval run solids`: what they add to icosphere-5120 is the time that they take."""


@pytest.mark.parametrize("suite", [SOLIDS, SURFACES], ids=lambda suite: suite.name)
def test_each_unilateral_case_asks_for_the_contact_to_be_kept_and_each_expectation_has_its_case(suite):
    assert all("contact-kept" in case.checks for case in suite.cases)
    assert all(case.published for case in suite.cases)
    for renderer in set(suite.renderers) - {RIGID}:
        published = {outcome for case in suite.cases for outcome in case.published.get(renderer, {}).values()}
        assert published == {"pass", "fail"}


@pytest.mark.parametrize("renderer", SOLIDS.renderers)
@pytest.mark.parametrize("name", [case.name for case in SOLIDS.cases if case.name not in LARGE])
def test_solids_are_judged_as_expected(name, renderer):
    expected_on(SOLIDS, name, renderer)


@pytest.mark.parametrize("renderer", SURFACES.renderers)
@pytest.mark.parametrize("name", [case.name for case in SURFACES.cases])
def test_unilateral_surfaces_are_judged_as_expected(name, renderer):
    expected_on(SURFACES, name, renderer)


def expected_on(suite, name, renderer):
    judged = judge(resolve(renderer), renderer, suite.name, suite.case(name))
    assert judged.error is None
    assert golden.unexpected(judged.verdicts) == []
    if renderer == RIGID:
        return
    undecided = {Outcome.INCONCLUSIVE, Outcome.NOT_APPLICABLE}
    assert [verdict.check for verdict in judged.verdicts if verdict.outcome in undecided] == []


@pytest.mark.parametrize("renderer", [renderer for renderer in SOLIDS.renderers if renderer != RIGID])
def test_the_rows_of_the_thesis_come_out_for_solids(renderer):
    rows = [row for row in SOLIDS.rows if "Edges" in row.title or "LUT" in row.title]
    asked = [case for case in SOLIDS.cases if any(fnmatch(case.name, each) for row in rows for each in row.cases)]
    checks = {check for row in rows for check in row.checks}
    found = [
        verdict
        for case in asked
        for verdict in judge(
            resolve(renderer), renderer, "solids", replace(case, checks=tuple(c for c in case.checks if c in checks))
        ).verdicts
    ]
    table = fill_table([suite_entry(SOLIDS)], found)
    assert {row.title: table[row.title][renderer] for row in rows} == {
        row.title: row.published[renderer] for row in rows
    }
