"""The suites of force shading and of what begins with a contact: what the checks find in them."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from hapticeval.discovery import resolve
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import judge
from hapticeval.suite.outline import suites_named
from hapticeval.suite.reading import load_suite

SUITES = ("effects-shading", "effects-transient")
CASES = [(suite, case.name) for suite in SUITES for case in load_suite(suite).cases]


@pytest.mark.parametrize("renderer", ["minimum-distance", "constraint"])
@pytest.mark.parametrize(("suite", "name"), CASES)
def test_a_spring_with_the_effect_put_on_it_passes_its_checks(suite, name, renderer):
    case = load_suite(suite).case(name)
    case.check_stimulus()
    asked = tuple(check for check in case.checks if OWN_CHECKS[check].effects)
    if not asked:
        pytest.skip("the case is shown only")
    judged = judge(resolve(renderer), renderer, suite, replace(case, checks=asked))
    assert judged.error is None
    refused = name == "taps-robot" and renderer == "constraint"  # a smooth surface in space
    expected = Outcome.NOT_APPLICABLE if refused else Outcome.PASS
    assert {verdict.check: verdict.outcome for verdict in judged.verdicts} == dict.fromkeys(asked, expected)


def test_the_group_holds_them():
    assert set(SUITES) <= set(suites_named("effects"))
