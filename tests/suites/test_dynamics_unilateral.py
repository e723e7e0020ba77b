"""The suite of closed loops on surfaces that only push: each verdict is as its reasons expect."""

from __future__ import annotations

import pytest

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import Judged, judge
from hapticeval.suite.reading import load_suite

SUITE = load_suite("dynamics-unilateral")


def judged(name: str, renderer: str) -> Judged:
    return judge(resolve(renderer), renderer, SUITE.name, SUITE.case(name))


@pytest.mark.parametrize("variant", ["", "-encoder", "-saturation", "-delay"])
def test_on_the_robot_at_rest_the_force_is_the_operator_s_whatever_sensors_and_motors_are(variant):
    """(3.3); what is left of the robot's momentum, with its own inertia, is a ten-thousandth of the push."""
    answer = judged(f"circle-pressed-robot{variant}", "minimum-distance")
    (finding,) = (verdict.finding for verdict in answer.verdicts if verdict.check == "contact-normal-force")
    assert finding.outcome is Outcome.PASS
    assert abs(finding.evidence["static_difference_N"]) < 1e-4 * finding.evidence["operator_normal_N"]
