"""What the thesis shows, as `items.toml` has it: all that is numbered is there, names cases and checks that exist, and
is compared as it is printed."""

import tomllib
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hapticeval.commands.reproduce import case_of, suite_of
from hapticeval.errors import UnknownNameError
from hapticeval.phenomena.registry import CHECKS
from hapticeval.reports.thesis_page import PICTURES
from hapticeval.study.thesis.measures import ALONE, OF_RUNS
from hapticeval.study.thesis.printed import CLAIM_UNITS, Claim, full_name, items_named, numbers_of, read_items

ROOT = Path(__file__).parents[2]
PRINTED = tomllib.loads((ROOT / "tests" / "thesis.toml").read_text(encoding="utf-8"))
ITEMS = list(read_items().items())


@pytest.mark.parametrize("kind", ["figures", "equations"])
def test_all_that_is_numbered_is_there(kind):
    printed = {f"{chapter}.{k}" for chapter, count in PRINTED[kind].items() for k in range(1, count + 1)}
    listed = [place if kind == "figures" else item.equations for place, item in ITEMS]
    assert set().union(*(numbers_of(words) for words in listed if kind == "equations" or "Figure" in words)) >= printed


def test_all_tables_and_problems_are_there():
    places = [f"Table {number}" for number in PRINTED["tables"]] + [
        f"Problem {number}" for number in PRINTED["problems"]
    ]
    assert set(places) <= {place for place, _ in ITEMS}


def test_an_item_is_shown_by_what_exists():
    for place, item in ITEMS:
        shown = (item.drawn_cases, item.studies, item.outlines, item.grid, item.suite, item.claims)
        assert item.not_computed or any(shown), place
        assert {*item.each, *item.together} <= set(PICTURES), place
        for case in item.drawn_cases:
            assert case_of(case).checks, place
        for case, _, check in item.runs():
            assert not check or check in case_of(case).checks, place
        if item.suite:
            # The page shows its rows as the print does: each has an answer for each renderer.
            renderers = {full_name(renderer) for renderer in item.renderers}
            for row in suite_of(item.suite).rows:
                assert not row.published or renderers <= set(row.published), place


def test_a_claim_is_decided_by_one_thing_that_exists():
    for place, item in ITEMS:
        for claim in item.claims:
            where = f"{place}: {claim.says}"
            assert sum(map(bool, (claim.check, claim.measure, claim.entry))) == 1, where
            assert claim.unit in CLAIM_UNITS, where
            if claim.check:
                assert claim.check in CHECKS, where
                assert claim.outcome in ("pass", "fail"), where
            if claim.measure:
                assert claim.measure in (ALONE if claim.measure in ALONE else OF_RUNS), where
                assert claim.measure in ALONE or ((claim.case or item.case) and item.renderer_of(claim)), where
            if claim.entry:
                assert claim.study <= len(item.studies), where


@pytest.mark.parametrize(
    ("name", "places"),
    [
        ("figure-6.22", ["Figure 6.22"]),
        ("6.22", ["Figure 6.22"]),
        ("Figure 7.7", ["Figures 7.6 to 7.8"]),
        ("table-6.3", ["Table 6.3"]),
        ("6.3", ["Figures 6.2 and 6.3", "Table 6.3"]),
        ("(4.12)", ["Table 4.1"]),
        ("equation-7.38", ["Figure 7.3"]),
        ("section-6.2", ["Section 6.2"]),
        ("A", ["Figure A.1", "Table A.1"]),
    ],
)
def test_a_name_means_what_bears_its_number(name, places):
    assert list(items_named(name)) == places


def test_a_chapter_is_all_of_it():
    assert set(items_named("chapter-3")) == {
        place for place, _ in ITEMS if numbers_of(place) & {f"3.{k}" for k in range(1, 9)}
    }
    assert items_named("all") == read_items()


@pytest.mark.parametrize("name", ["figure-6.99", "(9.1)", "table-6.22", "pop-through", "chapter-9"])
def test_what_the_thesis_has_not_is_refused(name, refused):
    with refused(UnknownNameError):
        items_named(name)


@pytest.mark.parametrize(
    ("value", "measured", "agrees"),
    [
        ("2.4e-5", 2.39684e-5, True),
        ("2.4e-5", 2.5001e-5, False),
        ("5.12", 5.1249, True),
        ("5.12", 5.1251, False),
        ("-25", -25.4, True),
        ("-25", -25.6, False),
        ("> 5", 5.0, False),
        ("> 5", 5.1, True),
        ("< 5", 5.0, False),
        ("< 5", 4.9, True),
    ],
)
def test_a_number_is_compared_to_the_last_digit_in_print(value, measured, agrees):
    assert Claim(says="", measure="", value=value).compare(measured).agrees is agrees


@example(0, 1.5)
@given(st.integers(0, 6), st.floats(-1e3, 1e3))
def test_a_number_agrees_with_itself_as_it_is_printed(digits, number):
    assert Claim(says="", value=f"{number:.{digits}f}").compare(number).agrees
    assert not Claim(says="", value=f"{number:.{digits}f}").compare(number + 1.001 * 10.0**-digits).agrees


def test_a_unit_is_that_of_the_print():
    comparison = Claim(says="", value="0.8", unit="mm").compare(0.00083)
    assert (comparison.agrees, comparison.ours, comparison.difference) == (True, "0.83 mm", "0.03 mm")
