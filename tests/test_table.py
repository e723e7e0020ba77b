"""The summary table: Yes only for what was seen to pass everywhere."""

from __future__ import annotations

import pytest

from hapticeval.phenomena.verdict import Finding, Level, Outcome, Verdict
from hapticeval.suite.reading import load_suite
from hapticeval.table import fill_table

SUITE = load_suite("thesis")
ROW = "Resists Pop-Through on Corners"
CASES = ("star-concave-corner", "star-convex-corner")


def verdicts(*outcomes, renderer="mine"):
    return [
        Verdict(renderer, "thesis", case, "continuous-contact", Level.MUST, Finding(outcome, "said"))
        for case, outcome in zip(CASES, outcomes, strict=False)
    ]


@pytest.mark.parametrize(
    ("outcomes", "cell"),
    [
        ((Outcome.PASS, Outcome.PASS), "Yes"),
        ((Outcome.PASS, Outcome.FAIL), "No"),
        ((Outcome.FAIL,), "No"),
        ((Outcome.PASS,), None),
        ((Outcome.PASS, Outcome.INCONCLUSIVE), None),
        ((Outcome.PASS, Outcome.ERROR), None),
        ((Outcome.ERROR, Outcome.FAIL), "No"),
        ((), None),
    ],
)
def test_a_row_is_decided_by_its_cases(outcomes, cell):
    assert fill_table([SUITE], verdicts(*outcomes))[ROW].get("mine") == cell


def test_renderers_do_not_mix():
    mixed = verdicts(Outcome.PASS, Outcome.PASS) + verdicts(Outcome.FAIL, renderer="other")
    assert fill_table([SUITE], mixed)[ROW] == {"mine": "Yes", "other": "No"}


def test_other_checks_and_suites_do_not_count():
    foreign = [
        Verdict("mine", "another", CASES[0], "continuous-contact", Level.MUST, Finding(Outcome.FAIL, "")),
        Verdict("mine", "thesis", CASES[0], "broken-contact", Level.MUST, Finding(Outcome.FAIL, "")),
    ]
    assert fill_table([SUITE], foreign)[ROW] == {}
