"""What is right is not stopped where suites once blamed it; what is late is blamed for its force, not for its tool."""

from __future__ import annotations

import pytest
from made import FAIL, NO, PASS
from misblamed import CORNERS, LATE, RIGHT
from msgspec.structs import replace
from outsiders import LED, case

from hapticeval.discovery import resolve
from hapticeval.runner.judging import judge
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite


def verdicts(make, place: str | Case):
    suite, _, name = ("any", "", "") if isinstance(place, Case) else place.partition("/")
    asked = place if isinstance(place, Case) else load_suite(suite).case(name)
    judged = judge(make, "outside", suite, asked)
    assert judged.error is None
    return {verdict.check: verdict for verdict in judged.verdicts}


PLACES = [(name, place) for name, right in RIGHT.items() for place in right.places]


@pytest.mark.parametrize(("name", "place"), PLACES)
def test_what_is_right_is_not_stopped(name, place):
    """A nearest point may jump across the medial axis: by a theorem, and no farther than it has to."""
    blamed = {
        check: verdict.finding.message
        for check, verdict in verdicts(RIGHT[name].make, place).items()
        if verdict.outcome is not PASS and not verdict.inherent
    }
    assert blamed == {}


@pytest.mark.parametrize("place", CORNERS)
@pytest.mark.parametrize("name", LATE)
def test_a_force_that_outlasts_the_contact_is_no_jump_of_the_tool(name, place):
    found = verdicts(LATE[name], place)
    assert found["continuous-contact"].outcome is PASS, found["continuous-contact"].finding.message
    assert found["contact-kept"].outcome is FAIL
    assert "N in free space" in found["contact-kept"].finding.message


SENSED = {"imperfections": {"encoder_counts": 262144}}


def test_a_check_of_what_a_sensor_gave_keeps_the_channels_that_a_renderer_adds():
    """The atlas of set stabilisation records its chart."""
    asked = load_suite("dynamics-sphere").case("sphere-robot")
    asked = replace(asked, checks=("continuous-contact", "force-magnitude"), scene={**asked.scene, **SENSED})
    judged = judge(resolve("set-stabilisation@atlas"), "set-stabilisation@atlas", "any", asked)
    assert "chart" in judged.recording.channels
    assert [verdict.finding.message for verdict in judged.verdicts if verdict.outcome.value == "error"] == []


def outside(checks):
    points = [[0.15, 0.0], [0.15, 0.05], [0.0, 0.15]]
    return case("outside", {"kind": "star"}, checks, trajectory={"kind": "points", "points": points, "duration": 0.3})


@pytest.mark.parametrize("renderer", ["minimum-distance", "constraint", "ideal"])
def test_a_case_in_free_space_stops_no_gate(renderer):
    found = verdicts(resolve(renderer), outside(LED))
    assert {verdict.outcome for verdict in found.values()} <= {PASS, NO}
    assert found["contact-kept"].outcome is PASS


def test_and_what_is_felt_there_fails():
    from overlooked import OVERLOOKED

    found = verdicts(OVERLOOKED["pushes-from-afar"].make, outside(("contact-kept",)))
    assert found["contact-kept"].outcome is PASS  # 30 mm away at the least
    near = case(
        "near",
        {"kind": "circle"},
        ("contact-kept",),
        trajectory={"kind": "points", "points": [[0.15, 0.0], [0.11, 0.0], [0.11, 0.05]], "duration": 0.3},
    )
    assert verdicts(OVERLOOKED["pushes-from-afar"].make, near)["contact-kept"].outcome is FAIL
