"""Contact has one meaning: what is reported, else a force, else a tool held back while the hand is inside."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from finger import FingerProxy
from msgspec.structs import replace
from reporting import ALWAYS, NEVER, TRUE, Banded, Dropping, Rounded

from hapticeval.geometry.catalogue import line
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.suite.reading import load_suite

CHECKS = ("contact-kept", "continuous-contact", "numerical-stability", "vertex-order", "two-at-once")


@cache
def findings(make: type[FingerProxy], case: str = "solids/cube-edge") -> dict[str, Finding]:
    suite, _, name = case.partition("/")
    chosen = load_suite(suite).case(name)
    checks = tuple(check for check in CHECKS if check in chosen.checks)
    judged = judge(make, "reporting", suite, replace(chosen, checks=checks))
    assert judged.error is None
    assert judged.recording is not None
    assert ("contact" in judged.recording.channels) is hasattr(make, "contact")
    return {verdict.check: verdict.finding for verdict in judged.verdicts}


@pytest.mark.parametrize("make", [Rounded, Banded, TRUE, NEVER])
def test_right_ones_are_left_alone(make):
    """A hand that is off its tool by rounding is in free space; a force is contact, whatever is denied."""
    for check, finding in findings(make).items():
        assert finding.outcome is Outcome.PASS, f"{check}: {finding.message}"


def test_a_contact_that_is_reported_in_free_space_is_held_against_it():
    assert findings(ALWAYS)["continuous-contact"].outcome is Outcome.FAIL


def test_free_space_that_is_reported_inside_is_contact_let_go():
    finding = findings(Dropping)["contact-kept"]
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["kind"] == "let go"


def test_contact_of_each_row():
    """Rows: free; a force alone; a tool held back; the same with the hand outside; a tool on the hand inside."""
    hip = np.array([[0.0, 0.01], [0.0, -0.01], [0.0, -0.01], [0.0, 0.01], [0.0, -0.01]])
    ihip = np.array([[0.0, 0.01], [0.0, -0.01], [0.0, 0.0], [0.0, 0.02], [0.0, -0.01]])
    force = np.array([[0.0, 0.0], [0.0, 5.0], [0.0, 0.0], [0.0, 0.0], [0.0, 1e-9]])
    scene, time = Scene(model=line()), 1e-3 * np.arange(5)

    def told(*report: float) -> list[list[bool]]:
        channels = {"hip": hip, "ihip": ihip, "force": force}
        recording = Recording(time, channels | ({"contact": np.array(report)} if report else {}))
        return [Observed(recording, scene).contact.tolist(), Observed(recording, scene).trailing.tolist()]

    assert told() == [[False, True, True, False, False], [False, False, False, True, False]]
    assert told(0, 0, 0, 0, 0) == [[False, True, False, False, False], [False, False, False, True, False]]
    assert told(1, 1, 1, 1, 1) == [[True] * 5, [False] * 5]
