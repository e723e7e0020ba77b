"""The suite of closed loops on surfaces that only push: each verdict is as its reasons expect."""

from __future__ import annotations

import golden
import pytest

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import Judged, judge
from hapticeval.suite.reading import load_suite

SUITE = load_suite("dynamics-unilateral")


def judged(name: str, renderer: str) -> Judged:
    return judge(resolve(renderer), renderer, SUITE.name, SUITE.case(name))


@pytest.mark.system
@pytest.mark.parametrize("case", SUITE.cases, ids=lambda case: case.name)
def test_each_case_is_judged_as_expected(case):
    case.check_stimulus()
    for renderer in SUITE.renderers:
        answer = judged(case.name, renderer)
        assert answer.error is None
        assert golden.unexpected(answer.verdicts) == []
    corner = {"broken-contact", "abrupt-switch"} & set(case.checks)
    decided = {verdict.outcome for verdict in judged(case.name, "constraint@curve").verdicts if verdict.check in corner}
    assert decided <= {Outcome.PASS, Outcome.FAIL}


@pytest.mark.parametrize("variant", ["", "-encoder", "-saturation", "-delay"])
def test_on_the_robot_at_rest_the_force_is_the_operator_s_whatever_sensors_and_motors_are(variant):
    """(3.3); what is left of the robot's momentum, with its own inertia, is a ten-thousandth of the push."""
    answer = judged(f"circle-pressed-robot{variant}", "minimum-distance")
    (finding,) = (verdict.finding for verdict in answer.verdicts if verdict.check == "contact-normal-force")
    assert finding.outcome is Outcome.PASS
    assert abs(finding.evidence["static_difference_N"]) < 1e-4 * finding.evidence["operator_normal_N"]
