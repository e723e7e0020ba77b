"""What suites are for, read off the recorded verdicts: `test_golden.py` and `test_thesis.py` hold these at each run."""

from __future__ import annotations

from types import SimpleNamespace

import golden
import pytest

from hapticeval.discovery import resolve
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.progress import fill_table, suite_entry
from hapticeval.suite.outline import suites_named
from hapticeval.suite.reading import load_suite

PASS, FAIL, NO = Outcome.PASS, Outcome.FAIL, Outcome.NOT_APPLICABLE
DECIDED = {PASS, FAIL}
SCHEMES = tuple(f"minimum-distance+{scheme}" for scheme in ("pp", "pp-v", "pp-d", "pp-pd", "pp-pd-c"))


def outcomes(suite: str, renderer: str, *cases: str) -> dict[tuple[str, str], Outcome]:
    """What is recorded of a renderer, by case and check; of some cases or of all."""
    table = golden.recorded(suite)
    return {
        place: Outcome(golden.Cell.read(row[renderer]).outcome)
        for place, row in table.items()
        if not cases or place[0] in cases
    }


def by_check(suite: str, case: str, renderer: str) -> dict[str, Outcome]:
    return {check: outcome for (_, check), outcome in outcomes(suite, renderer, case).items()}


def rows_of(suite: str) -> dict[str, dict[str, str]]:
    """The suite's rows of Table 6.3 or of its own, filled from what is recorded."""
    loaded = load_suite(suite)
    verdicts = [
        SimpleNamespace(suite=suite, renderer=renderer, case=case, check=check, outcome=outcome)
        for renderer in loaded.renderers
        for (case, check), outcome in outcomes(suite, renderer).items()
    ]
    return fill_table([suite_entry(loaded)], verdicts)


@pytest.mark.parametrize("suite", ["solids", "unilateral-surfaces"])
def test_on_solids_and_surfaces_that_only_push_every_verdict_is_decided(suite):
    """Of the ideal contact, which has no depth and no memory to judge, it need not be."""
    for renderer in set(load_suite(suite).renderers) - {"ideal"}:
        assert set(outcomes(suite, renderer).values()) <= DECIDED


def test_the_rows_of_the_thesis_come_out_for_solids():
    rows = [row for row in load_suite("solids").rows if "Edges" in row.title or "LUT" in row.title]
    table = rows_of("solids")
    for row in rows:
        assert {name: table[row.title][name] for name in row.published} == row.published


LOOPS = ("line", "line-robot", "line-along", "circle", "circle-off", "circle-robot", "circle-off-robot")
LOOPS += ("cassinian", "cassinian-robot", "sphere", "sphere-off-robot")


@pytest.mark.parametrize("case", LOOPS)
@pytest.mark.parametrize("renderer", [*SCHEMES, "set-stabilisation"])
def test_every_closed_form_is_met(case, renderer):
    assert by_check(f"dynamics-{case.split('-')[0]}", case, renderer)["closed-form"] is PASS


@pytest.mark.parametrize("case", [case.name for case in load_suite("dynamics-surfaces").cases])
@pytest.mark.parametrize("renderer", [*SCHEMES, "set-stabilisation"])
def test_on_an_ellipsoid_and_a_torus_the_outcomes_are_those_on_the_sphere(case, renderer):
    sphere = by_check("dynamics-sphere", "sphere-off-robot" if "-off-" in case else "sphere-robot", renderer)
    del sphere["closed-form"]
    assert by_check("dynamics-surfaces", case, renderer) == sphere


@pytest.mark.parametrize("device", ["", "-robot"])
def test_set_stabilisation_alone_passes_all_that_the_circle_asks(device):
    cases = (f"circle{device}", f"circle-off{device}")
    passing = {
        renderer
        for renderer in (*SCHEMES, "set-stabilisation")
        if set(outcomes("dynamics-circle", renderer, *cases).values()) == {PASS}
    }
    assert passing == {"set-stabilisation"}


def test_the_table_of_the_circle_comes_out():
    table = rows_of("dynamics-circle")
    added = {title: cells.pop("minimum-distance+pp-pd-c") for title, cells in table.items()}
    assert table == {row.title: row.published for row in load_suite("dynamics-circle").rows}
    apart = "Keeps across and along apart on the circle"
    assert added == {title: "No" if title == apart else "Yes" for title in table}, "what its one added term can do"


@pytest.mark.parametrize("case", ["sphere-viscous", "sphere-driven"])
@pytest.mark.parametrize("renderer", SCHEMES)
def test_what_knows_no_viscosity_is_not_asked_for_it(case, renderer):
    assert set(by_check("dynamics-sphere", case, renderer).values()) == {NO}


ASKED_OF_EFFECTS = {
    (suite, case.name): [check for check in case.checks if OWN_CHECKS[check].effects]
    for suite in ("effects-friction", "effects-shading", "effects-transient", "effects-texture")
    for case in load_suite(suite).cases
}
INFORMS = {("bump-map-line", "texture-work")}
"""The work of a bump map, which is no force of a potential, is shown and fails."""


@pytest.mark.parametrize(("suite", "case"), [place for place, checks in ASKED_OF_EFFECTS.items() if checks])
def test_an_effect_that_is_put_on_a_renderer_passes_its_checks(suite, case):
    """Or the renderer is refused there, for the model's sake, as a constraint on a smooth surface in space is."""
    for renderer in load_suite(suite).renderers:
        asked = ASKED_OF_EFFECTS[suite, case]
        found = by_check(suite, case, renderer)
        refused = {found[check] for check in asked} == {NO} and renderer != "minimum-distance"
        expected = {check: NO if refused else FAIL if (case, check) in INFORMS else PASS for check in asked}
        assert {check: found[check] for check in asked} == expected, renderer


def test_groups_hold_their_suites():
    kinds = ("cassinian", "circle", "line", "sphere", "surfaces", "unilateral")
    assert tuple(f"dynamics-{kind}" for kind in kinds) == suites_named("dynamics")
    assert {suite for suite, _ in ASKED_OF_EFFECTS} <= set(suites_named("effects"))


OF_LOOPS = ("generated", "hard-cases-loops", *suites_named("dynamics"))


@pytest.mark.parametrize("suite", ["solids", "unilateral-surfaces", "field", "seams", *OF_LOOPS])
def test_what_fails_in_a_case_that_counts_is_published(suite):
    published = {case.name: case.published for case in load_suite(suite).cases if case.judged}
    unpublished = [
        (case, check, renderer)
        for (case, check), row in golden.recorded(suite).items()
        for renderer, text in row.items()
        if case in published and golden.Cell.read(text).outcome == FAIL
        if published[case].get(renderer, {}).get(check) != FAIL
    ]
    assert unpublished == []


def test_corners_of_closed_loops_are_decided():
    corner = {"broken-contact", "abrupt-switch"}
    found = outcomes("dynamics-unilateral", "constraint@curve")
    assert {outcome for (_, check), outcome in found.items() if check in corner} <= DECIDED


@pytest.mark.parametrize("suite", ["generated", "hard-cases-loops"])
def test_in_each_case_in_space_two_renderers_are_decided_about(suite):
    for case in load_suite(suite).cases:
        if case.build_scene().model.dimension == 3:
            rows = [row for (name, _), row in golden.recorded(suite).items() if name == case.name]
            decided = {name for row in rows for name, text in row.items() if golden.Cell.read(text).outcome in DECIDED}
            assert "minimum-distance" in decided
            assert len(decided) > 1


@pytest.mark.parametrize("renderer", ["conformal", "set-stabilisation"])
def test_no_more_fails_on_a_dumbbell_than_is_published(renderer):
    published = load_suite("generated").case("dumbbell-hand").published.get(renderer, {})
    found = by_check("generated", "dumbbell-hand", renderer)
    assert {check for check, outcome in found.items() if outcome is not PASS} == set(published)


@pytest.mark.parametrize("suite", suites_named("dynamics"))
def test_every_renderer_of_a_suite_can_be_found_and_alone_has_outcomes_in_print(suite):
    loaded = load_suite(suite)
    for name in loaded.renderers:
        resolve(name)
    for case in loaded.cases:
        assert set(case.published) | set(case.closed_form) <= set(loaded.renderers)


@pytest.mark.parametrize("suite", ["solids", "unilateral-surfaces"])
def test_each_case_asks_for_the_contact_to_be_kept_and_each_expectation_has_its_case(suite):
    loaded = load_suite(suite)
    assert all("contact-kept" in case.checks for case in loaded.cases)
    assert all(case.published for case in loaded.cases)
    for renderer in set(loaded.renderers) - {"ideal"}:
        assert {outcome for case in loaded.cases for outcome in case.published.get(renderer, {}).values()} == DECIDED
