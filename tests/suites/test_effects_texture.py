"""The suite of textures: every case can be run, and shows what it says."""

from __future__ import annotations

import pytest

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite

SUITE = load_suite("effects-texture")


@pytest.mark.parametrize("case", SUITE.cases, ids=lambda case: case.name)
def test_a_case_can_be_run(case):
    case.check_stimulus()


@pytest.mark.parametrize(
    "name",
    [
        "height-map-line",
        "height-map-sphere",
        "ribbed-stroke",
        "gritty-stroke",
        "woven-strokes",
        "ribbed-circle-stroke",
        "ribbed-sphere-stroke",
        "gritty-loop-stroke",
    ],
)
def test_the_nearest_point_passes(name):
    verdicts = judge(resolve("minimum-distance"), "minimum-distance", SUITE.name, SUITE.case(name)).verdicts
    assert [verdict.outcome for verdict in verdicts] == [Outcome.PASS] * len(verdicts)


def test_the_constraint_is_refused_on_a_polygon_and_passes_on_the_curve():
    for name, outcome in (("constraint", Outcome.NOT_APPLICABLE), ("constraint@curve", Outcome.PASS)):
        verdicts = judge(resolve(name), name, SUITE.name, SUITE.case("height-map-circle")).verdicts
        assert {verdict.outcome for verdict in verdicts} == {outcome}


def test_a_bump_map_s_work_is_shown():
    verdicts = judge(resolve("minimum-distance"), "minimum-distance", SUITE.name, SUITE.case("bump-map-line")).verdicts
    shown = {verdict.check: verdict.outcome for verdict in verdicts if verdict.level is Level.INFO}
    assert shown == {"texture-work": Outcome.FAIL, "passivity": Outcome.FAIL}
    assert all(verdict.as_expected for verdict in verdicts)
