"""The suite of moving bodies stops each wrong way to take a pose by name, and leaves the right ones alone."""

from __future__ import annotations

import pytest
from led_astray import RIGHT, WRONG

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite

SUITE = load_suite("moving")


def failures(factory, case):
    """The musts that a renderer fails in a case, with what they say."""
    judged = judge(factory, "astray", SUITE.name, SUITE.case(case))
    assert judged.error is None
    assert judged.refusal is None
    return {
        verdict.check: verdict.finding.message
        for verdict in judged.verdicts
        if verdict.outcome is Outcome.FAIL and verdict.level is Level.MUST
    }


@pytest.mark.parametrize("wrong", WRONG)
def test_a_pose_that_is_taken_wrongly_is_stopped_by_a_must(wrong):
    factory, case, checks = WRONG[wrong]
    assert checks <= failures(factory, case).keys()


CONVEX = ("circle-comes", "circle-comes-fast", "circle-jumps")
AROUND = ("circle-slides", "star-tip-turns", "plate-swings", "cube-corners-pass", *CONVEX)


@pytest.mark.parametrize(
    ("right", "case"),
    [(right, case) for right in RIGHT for case in (CONVEX if right == "swept" else AROUND)],
)
def test_a_pose_that_is_taken_rightly_fails_nothing_that_the_body_at_rest_does_not(right, case):
    assert failures(RIGHT[right], case).keys() <= failures(resolve("constraint"), case).keys()
