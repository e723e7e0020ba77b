"""The summary table: Yes only for what was seen to pass everywhere."""

from __future__ import annotations

import pytest
from result_entries import results_of

from hapticeval.commands.summary import summary
from hapticeval.phenomena.verdict import Finding, Level, Outcome, Verdict
from hapticeval.reports.table import markdown
from hapticeval.runner.progress import fill_table, suite_entry
from hapticeval.runner.results import VerdictEntry
from hapticeval.suite.reading import load_suite

SUITE = load_suite("thesis")
ENTRY = suite_entry(SUITE)
ROW = "Resists Pop-Through on Corners"
CHECKS = ("continuous-contact", "contact-kept")
CASES = ("star-concave-corner", "star-convex-corner")


def verdicts(*outcomes, renderer="mine", check="continuous-contact", other=Outcome.PASS):
    """Of `check` the outcomes case by case, and of the row's other check `other`."""
    return [
        Verdict(renderer, "thesis", case, each, Level.MUST, Finding(outcome if each == check else other, "found"))
        for case, outcome in zip(CASES, outcomes, strict=False)
        for each in CHECKS
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
    assert fill_table([ENTRY], verdicts(*outcomes))[ROW].get("mine") == cell


@pytest.mark.parametrize("check", CHECKS)
def test_each_check_of_a_row_decides_it(check):
    passed, failed = (Outcome.PASS, Outcome.PASS), (Outcome.PASS, Outcome.FAIL)
    assert fill_table([ENTRY], verdicts(*passed, check=check))[ROW]["mine"] == "Yes"
    assert fill_table([ENTRY], verdicts(*failed, check=check))[ROW]["mine"] == "No"
    undecided = verdicts(*passed, check=check, other=Outcome.INCONCLUSIVE)
    assert "mine" not in fill_table([ENTRY], undecided)[ROW]
    assert "mine" not in fill_table([ENTRY], [each for each in verdicts(*passed) if each.check == check])[ROW]


def test_renderers_do_not_mix():
    mixed = verdicts(Outcome.PASS, Outcome.PASS) + verdicts(Outcome.FAIL, renderer="other")
    assert fill_table([ENTRY], mixed)[ROW] == {"mine": "Yes", "other": "No"}


def test_other_checks_and_suites_do_not_count():
    foreign = [
        Verdict("mine", "another", CASES[0], "continuous-contact", Level.MUST, Finding(Outcome.FAIL, "")),
        Verdict("mine", "thesis", CASES[0], "broken-contact", Level.MUST, Finding(Outcome.FAIL, "")),
    ]
    assert fill_table([ENTRY], foreign)[ROW] == {}


@pytest.mark.parametrize(
    ("jumps", "normal", "more", "noted"),
    [
        (Outcome.PASS, Outcome.FAIL, {}, True),
        (Outcome.PASS, Outcome.PASS, {}, False),
        (Outcome.FAIL, Outcome.FAIL, {}, False),
        (Outcome.PASS, Outcome.FAIL, {"inherent": "a theorem"}, False),
    ],
)
def test_a_yes_for_a_tool_that_may_not_follow_the_hand_has_a_note(jumps, normal, more, noted):
    off = Verdict(
        "mine", "thesis", CASES[0], "contact-normal-force", Level.MUST, Finding(normal, "off the normal"), **more
    )
    entries = [VerdictEntry.of(verdict) for verdict in [*verdicts(jumps, jumps), off]]
    results = results_of(*entries, suites=[ENTRY], table=fill_table([ENTRY], entries))
    note = (
        f"mine: Yes for '{ROW}' says that its tool jumps nowhere, not that it follows the hand: "
        "contact-normal-force fails in 1 case"
    )
    assert results.table_notes == [note] * noted
    for shown in (summary(results, []), markdown(results)):
        assert (note in shown) is noted
