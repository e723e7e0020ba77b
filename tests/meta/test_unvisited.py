"""Faults that show in one place only are stopped where a suite goes there, and what is right is left alone there."""

from __future__ import annotations

import numpy as np
import pytest
from honest import Spring
from hypothesis import given
from hypothesis import strategies as st
from made import FAIL, PASS, STIFFNESS, outcome, recorded
from msgspec.structs import replace
from outsiders import case
from unvisited import UNVISITED, Damped, Unvisited

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import line
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.suite.reading import load_suite

VISITS = [(name, place) for name, unvisited in UNVISITED.items() for place in unvisited.cases]


def outcomes(make, place, *checks):
    suite, _, name = place.partition("/")
    case = load_suite(suite).case(name)
    judged = judge(make, "unvisited", suite, replace(case, checks=checks or case.checks))
    assert judged.error is None
    return {verdict.check: verdict.outcome for verdict in judged.verdicts}


@pytest.mark.system
@pytest.mark.parametrize(("name", "place"), VISITS)
def test_a_fault_is_stopped_where_a_suite_visits_it(name, place):
    unvisited: Unvisited = UNVISITED[name]
    assert OWN_CHECKS[unvisited.check].level is Level.MUST
    assert outcomes(unvisited.make, place, unvisited.check)[unvisited.check] is Outcome.FAIL


@pytest.mark.parametrize("place", sorted({place for _, place in VISITS if not place.startswith("effects-")}))
def test_what_is_right_is_left_alone_there(place):
    # The nearest point jumps at an edge (4.1.2), wherever that is, and in a loop too.
    edges = ("solids/box-off-origin", "dynamics-unilateral/star-tip", "dynamics-unilateral/cube-edge")
    jumps = {"continuous-contact", "broken-contact"} if place.startswith(edges) else set()
    blamed = {check for check, outcome in outcomes(Spring, place).items() if outcome is not Outcome.PASS}
    assert blamed == jumps


@pytest.mark.parametrize("place", UNVISITED["velocity-left"].cases)
def test_a_damper_on_a_velocity_of_its_own_is_left_alone(place):
    assert outcomes(Damped, place)["reset-clears"] is Outcome.PASS


@given(late=st.integers(1, 9), size=st.sampled_from([0.9e-6, 1.1e-6, 1e-3]))
def test_a_force_in_free_space_fails_from_the_fourth_tick_after_a_contact_on(late, size):
    """Three ticks are granted, and the force of a depth of 1 um is the least that counts."""
    height = 1e-3 * np.concatenate([np.arange(20.0, -11.0, -1.0), np.arange(-9.0, 21.0)])
    hip = np.column_stack([np.zeros(height.size), height])
    ihip = np.maximum(hip, 0.0)
    force = STIFFNESS * (ihip - hip)
    last = int(np.flatnonzero(height < 0.0)[-1])
    force[last + late, 1] += STIFFNESS * size
    ghost = late > 4 and size > 1e-6  # the tick after the last inside is on the surface, where nothing is outside
    run = recorded(hip, ihip, force, meta={"source": "playback"})
    assert outcome("contact-kept", run, Scene(model=line())) is (FAIL if ghost else PASS)


def test_a_tolerance_in_metres_shows_where_a_mesh_is_looked_at_smaller():
    """Triangles of 1 mm^2 as they are, and of 0.02 mm^2 in the scene a seventh as large."""
    path = {"kind": "points", "points": [[-0.006, 0.001, 0.01], [0.006, 0.002, 0.008]], "duration": 0.1}
    model = {"kind": "icosphere", "size": 0.02, "subdivisions": 3}
    ball = case("ball", model, ("numerical-stability", "contact-kept"), trajectory=path)
    judged = judge(UNVISITED["small-triangles"].make, "unvisited", "s", ball)
    stability, kept = (verdict.finding for verdict in judged.verdicts)
    assert (stability.outcome, kept.outcome) == (FAIL, PASS)
    assert stability.evidence["motion"] == "a seventh as large"


EFFECTS = [
    (place, unvisited.check) for unvisited in UNVISITED.values() for place in unvisited.cases if "effects" in place
]


@pytest.mark.parametrize(("place", "check"), EFFECTS)
def test_what_shows_the_effect_right_is_left_alone_there(place, check):
    """The package's own effect on the nearest point."""
    assert outcomes(resolve("minimum-distance"), place, check)[check] is Outcome.PASS
