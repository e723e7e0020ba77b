"""True renderers of other publications are not blamed for what they declare, and what they do wrong is named."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from honest import Spring
from msgspec.structs import replace

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.renderer import Response
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite


def finding_of(factory, check: str, place: str, *, alone: bool = False) -> Finding:
    """What a check finds of a renderer in a case named as `suite/case`, among all that the case asks or `alone`."""
    suite, name = place.split("/")
    case = next(case for case in cases(suite) if case.name == name)
    case = replace(case, checks=(check,)) if alone else case
    judged = judge(factory, "renderer", suite, case)
    return next(verdict.finding for verdict in judged.verdicts if verdict.check == check)


@cache
def cases(suite: str):
    return load_suite(suite).cases


class Claiming(Spring):
    """The nearest point, which pops, and claims a standoff of 0.5 mm that it does not have."""

    standoff = 5e-4


class Raised(Spring):
    """The nearest point 0.5 mm in front of the surface, as declared: it pops from face to face inside of the solid."""

    standoff = 5e-4

    def step(self, hip, velocity, dt):
        near = self.boundary.closest_point(hip[np.newaxis])
        raised = near.foot[0] + self.standoff * near.normal[0]
        ihip = raised if near.distance[0] < self.standoff else hip
        return Response(ihip, self.stiffness * (ihip - hip))


@pytest.mark.parametrize("place", ["cube-edge", "cube-vertex", "nut-rim"])
def test_a_ball_that_rolls_over_an_edge_until_the_hand_is_out_by_its_radius_is_continuous(place):
    finding = finding_of(resolve("virtual-proxy"), "continuous-contact", f"solids/{place}")
    assert finding.outcome is Outcome.PASS, finding.message


@pytest.mark.parametrize("factory", [Claiming, Raised])
def test_a_standoff_is_no_licence_to_pop_inside_of_the_solid(factory):
    finding = finding_of(factory, "continuous-contact", "solids/cube-edge")
    assert finding.outcome is Outcome.FAIL
    assert "pop-through" in finding.message


def test_a_standoff_that_is_believed_in_part_is_said_so():
    finding = finding_of(resolve("virtual-proxy"), "continuous-contact", "solids/fine-ball")
    assert finding.outcome is Outcome.FAIL
    assert "declares a standoff of 0.5 mm, of which 0.4 mm count" in finding.message


def endowed(scene):
    """A passivity controller that begins with a joule which no hand has put in."""
    renderer = resolve("conformal+pc")(scene)
    controlled = renderer.renderer
    reset = controlled.reset

    def reset_with_gift(hip):
        reset(hip)
        controlled.energy = 1.0

    controlled.reset = reset_with_gift
    return renderer


@pytest.mark.parametrize(
    ("factory", "expected"),
    [(resolve("conformal+pc"), Outcome.PASS), (resolve("conformal"), Outcome.FAIL), (endowed, Outcome.FAIL)],
    ids=["controlled", "bare", "endowed"],
)
def test_what_a_controller_has_stored_is_no_energy_created(factory, expected):
    finding = finding_of(factory, "passivity", "thesis/cassinian-loops")
    assert finding.outcome is expected, finding.message
    assert ("spent" in finding.message) is (expected is Outcome.PASS)


def test_a_coupling_that_trails_behind_a_plate_is_no_contact():
    finding = finding_of(resolve("coupled"), "contact-kept", "solids/plate")
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["kind"] == "tunnelled"
    assert finding.metric.value == pytest.approx(0.01925, rel=1e-6)  # the hand's depth under the plate's upper face


@pytest.mark.parametrize("place", ["solids/cube-edge", "thesis/cassinian-shallow-slide", "thesis/star-convex-corner"])
def test_a_simulated_tool_in_front_of_the_surface_keeps_its_contact(place):
    finding = finding_of(resolve("coupled"), "contact-kept", place, alone=True)
    assert finding.outcome is Outcome.PASS, finding.message
