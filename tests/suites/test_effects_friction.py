"""The suite of friction: put on renderers of any kind it passes every check of it, in each of the cases."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from hapticeval.discovery import resolve
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import judge
from hapticeval.suite.outline import suites_named
from hapticeval.suite.reading import load_suite

SUITE = load_suite("effects-friction")
IN_SPACE = tuple(case.name for case in SUITE.cases if case.model["kind"] == "sphere")


# Each case and each renderer, and sphere-slide with all of them; every pair in `make system`.
@pytest.mark.parametrize(
    ("case", "renderer"),
    [
        pytest.param(
            case,
            renderer,
            id=f"{case.name}-{renderer}",
            marks=[pytest.mark.system] * (case.name != "sphere-slide" and (row - column) % len(SUITE.renderers) != 0),
        )
        for row, case in enumerate(SUITE.cases)
        for column, renderer in enumerate(SUITE.renderers)
    ],
)
def test_friction_put_on_a_renderer_passes_its_checks(case, renderer):
    case.check_stimulus()
    asked = tuple(check for check in case.checks if OWN_CHECKS[check].effects)
    judged = judge(resolve(renderer), renderer, SUITE.name, replace(case, checks=asked))
    assert judged.error is None
    expected = Outcome.NOT_APPLICABLE if case.name in IN_SPACE and renderer == "constraint@curve" else Outcome.PASS
    assert {verdict.check: verdict.outcome for verdict in judged.verdicts} == dict.fromkeys(asked, expected)


@pytest.mark.parametrize("renderer", ["minimum-distance", "minimum-distance+square-root"])
def test_no_energy_comes_of_it_in_the_limit(renderer):
    case = SUITE.case("circle-slide")
    judged = judge(resolve(renderer), renderer, SUITE.name, replace(case, checks=("passivity",)))
    assert [verdict.outcome for verdict in judged.verdicts] == [Outcome.PASS]


def test_the_group_holds_it():
    assert SUITE.name in suites_named("effects")
