"""What differs between two runs, and whether it stops a gate."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from result_entries import changed, results_of

from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.runner.diff import compare_results
from hapticeval.runner.results import SuiteEntry, VerdictEntry


def verdict(outcome=Outcome.PASS, *, case="c", level=Level.MUST, value=1e-4, bound=1e-3, published=None):
    finding = Finding(outcome, "what was seen", Metric("jump", value, "m"), bound)
    return VerdictEntry.of(Verdict("r", "s", case, "memoryless", level, finding, published))


FAIL, PASS, UNDECIDED = Outcome.FAIL, Outcome.PASS, Outcome.INCONCLUSIVE


@pytest.mark.parametrize(
    ("before", "now", "standing", "stops", "strict"),
    [
        (verdict(PASS), verdict(FAIL), "worse", True, True),
        (verdict(PASS), verdict(UNDECIDED), "worse", True, True),
        (verdict(FAIL), verdict(PASS), "better", False, False),
        (verdict(FAIL), verdict(UNDECIDED), "changed", False, True),
        (verdict(PASS, level=Level.SHOULD), verdict(FAIL, level=Level.SHOULD), "changed", False, True),
        (verdict(FAIL, published=FAIL), verdict(PASS, published=FAIL), "changed", False, True),
        (verdict(FAIL), changed(verdict(FAIL), known="a limit", as_expected=True), "better", False, False),
        (verdict(PASS), verdict(PASS), None, False, False),
        (verdict(FAIL), verdict(FAIL), None, False, False),
    ],
)
def test_a_verdict_that_changed(before, now, standing, stops, strict):
    found = compare_results(results_of(before), results_of(now))
    assert [each.standing for each in found.verdicts] == [standing] * (standing is not None)
    assert (found.stops(strict=False), found.stops(strict=True)) == (stops, strict)


def test_what_comes_and_goes():
    found = compare_results(
        results_of(verdict(case="a"), verdict(case="b")), results_of(verdict(case="b"), verdict(case="c"))
    )
    assert [(each.standing, each.place, each.before, each.now) for each in found.verdicts] == [
        ("gone", "s/a/memoryless", "pass", None),
        ("new", "s/c/memoryless", None, "pass"),
    ]
    assert (found.compared, found.stops(strict=False), found.stops(strict=True)) == (1, False, True)
    assert compare_results(results_of(), results_of(verdict(FAIL))).stops(strict=False), "a new failure is worse"


def test_an_incomplete_run_does_not_pass():
    cut = results_of(verdict(), planned=2, complete=False, reason="killed")
    assert compare_results(results_of(verdict()), cut).stops(strict=False)
    assert not compare_results(cut, results_of(verdict())).stops(strict=False)


def test_margins_that_moved_by_the_largest_move():
    before = results_of(*(verdict(case=name) for name in "abcd"))
    now = results_of(
        verdict(case="a", value=3e-4),
        verdict(case="b", value=1e-4 + 1e-13),
        verdict(case="c", bound=2e-3),
        verdict(FAIL, case="d", value=2e-3),
    )
    found = compare_results(before, now).margins
    assert [(each.place, round(each.by, 12)) for each in found] == [
        ("s/d/memoryless", -1.9),
        ("s/a/memoryless", -0.2),
        ("s/c/memoryless", 0.05),
    ]


@pytest.mark.parametrize("bound", [0.0, None])
def test_a_margin_without_a_bound_cannot_move(bound):
    run = results_of(verdict(FAIL, bound=bound)), results_of(verdict(FAIL, bound=bound, value=1.0))
    assert compare_results(*run).margins == []


OUTCOMES = st.dictionaries(st.sampled_from("abcdef"), st.sampled_from([PASS, FAIL, UNDECIDED]))


@given(OUTCOMES, OUTCOMES)
def test_the_other_way_round_worse_is_better_and_new_is_gone(first, second):
    runs = [results_of(*(verdict(outcome, case=name) for name, outcome in each.items())) for each in (first, second)]
    there, back = compare_results(*runs), compare_results(*reversed(runs))

    def of(found, *standings):
        return {each.place for each in found.verdicts if each.standing in standings}

    assert of(there, "better") == of(back, "worse") - {f"s/{name}/memoryless" for name in first.keys() - second.keys()}
    assert of(there, "changed") == of(back, "changed")
    assert {place.split("/")[1] for place in of(there, "gone")} == first.keys() - second.keys()
    assert compare_results(runs[0], runs[0]).verdicts == []


def suite_entry(version, **case_digests):
    return SuiteEntry(
        name="solids",
        title="t",
        citation="",
        rows=[],
        version=version,
        digest=str(case_digests),
        case_digests=case_digests,
    )


def test_what_warns_only_since_is_measured_by_the_wider_bound():
    """0.6 of a bound of 0.45 that must hold, then 0.4, which a bound of 1e-6 warns of: that is better."""
    before, now = verdict(FAIL, value=0.6, bound=0.45), verdict(FAIL, level=Level.SHOULD, value=0.4, bound=1e-6)
    (move,) = compare_results(results_of(before), results_of(now)).margins
    assert move.by == pytest.approx(0.2 / 0.45)


@pytest.mark.parametrize(
    ("now", "words"),
    [
        (suite_entry("1.0", cube="a", nut="b"), []),
        (suite_entry("1.0", cube="a"), []),
        (
            suite_entry("2.0", cube="c", nut="b"),
            [
                "solids 1.0 before, solids 2.0 now: verdicts may differ for the suite's sake; "
                "cases that ask something else: cube"
            ],
        ),
        (suite_entry("1.1", cube="a"), ["solids 1.0 before, solids 1.1 now: verdicts may differ for the suite's sake"]),
        (suite_entry("1.0", cube="c"), ["solids 1.0 was changed; cases that ask something else: cube"]),
        (
            suite_entry("", cube="c"),
            [
                "solids 1.0 before, solids now: verdicts may differ for the suite's sake; "
                "cases that ask something else: cube"
            ],
        ),
    ],
)
def test_suites_that_ask_something_else_are_named(now, words):
    before, after = (changed(results_of(verdict()), suites=[suite]) for suite in (suite_entry("1.0", cube="a"), now))
    assert compare_results(before, after).suites == words
