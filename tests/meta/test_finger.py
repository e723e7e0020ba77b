"""A finger proxy as haptic libraries have it gets the verdicts of physics, and its margin is no fault."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from finger import MARGIN, FingerProxy
from msgspec.structs import replace

from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.renderer import Response
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite


class Undeclared(FingerProxy):
    """The same, and says nothing of its margin."""

    standoff = 0.0


class Coarse(FingerProxy):
    """The same, and declares the facets of the mesh that it is given as its resolution."""

    resolution = 0.014


class Unswept(FingerProxy):
    """Looks for the surface only where the hand is inside: what it has passed in a tick it does not meet."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        if self.boundary.signed_distance(hip[np.newaxis])[0] > MARGIN and not self.touches:
            self.proxy = np.array(hip)
            return Response(hip, np.zeros_like(hip))
        answer = super().step(hip, velocity, dt)
        self.touches = bool(np.any(answer.force))
        return answer

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.touches = False


@cache
def finding_of(case: str, check: str, make: type[FingerProxy] = FingerProxy) -> Finding:
    suite, _, name = case.partition("/")
    judged = judge(make, "finger", suite, replace(load_suite(suite).case(name), checks=(check,)))
    assert judged.error is None
    return judged.verdicts[0].finding


@pytest.mark.parametrize(
    ("case", "check", "outcome"),
    [
        ("solids/cube-edge", "broken-contact", Outcome.PASS),
        ("solids/cube-edge", "continuous-contact", Outcome.PASS),
        ("solids/cube-vertex", "broken-contact", Outcome.PASS),
        ("solids/wedge-30", "broken-contact", Outcome.PASS),
        ("solids/l-block-notch", "abrupt-switch", Outcome.FAIL),
        ("solids/inner-corner", "abrupt-switch", Outcome.FAIL),
        ("solids/inner-corner", "continuous-contact", Outcome.PASS),
        ("solids/icosphere-chord", "continuous-contact", Outcome.FAIL),
        ("solids/plate", "contact-kept", Outcome.PASS),
        ("solids/cube-impact", "impulsive-collision", Outcome.FAIL),
        ("unilateral-surfaces/sphere-pressed", "centripetal-force", Outcome.FAIL),
        ("unilateral-surfaces/sphere-pressed", "contact-kept", Outcome.PASS),
        ("thesis/circle-slide", "centripetal-force", Outcome.FAIL),
    ],
)
def test_it_gets_the_verdicts_of_physics(case, check, outcome):
    assert finding_of(case, check).outcome is outcome


def test_deep_under_facets_it_is_blamed_for_a_jump():
    finding = finding_of("solids/icosphere-chord", "continuous-contact")
    assert "pop-through" in finding.message
    assert finding.metric.value > 5.0 * MARGIN


def test_from_facet_to_facet_it_is_not_called_more_than_its_declared_resolution():
    """Its tool goes to the next facet, 14 mm wide: a mini pop-through. Where nothing is declared, it is a major one."""
    for make, severity in ((Coarse, "mini"), (FingerProxy, "major")):
        finding = finding_of("solids/icosphere-1280", "continuous-contact", make)
        assert finding.outcome is Outcome.FAIL
        assert finding.evidence["severity"] == severity
        assert ("mini" in finding.message) is (severity == "mini")


def test_on_a_concave_edge_it_turns_over_the_arc():
    finding = finding_of("solids/l-block-notch", "abrupt-switch")
    assert finding.evidence["switch_takes_s"] > 0.09
    assert finding.metric.value == pytest.approx(0.5 * np.pi * 0.9, abs=0.05)


def test_its_margin_is_a_standoff_where_it_is_declared_and_a_fault_where_it_is_not():
    declared, silent = (
        finding_of("solids/cube-edge", "continuous-contact", make) for make in (FingerProxy, Undeclared)
    )
    assert declared.outcome is Outcome.PASS
    assert "0.1 mm of the declared standoff" in declared.message
    assert silent.outcome is Outcome.FAIL


def test_one_that_does_not_sweep_the_hand_s_way_tunnels():
    finding = finding_of("solids/plate", "contact-kept", Unswept)
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["kind"] == "tunnelled"
