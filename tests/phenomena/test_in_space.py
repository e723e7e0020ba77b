"""The checks in space: on a great circle of the sphere they say what they say on a circle in the plane."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.geometry.catalogue import circle, sphere
from hapticeval.geometry.curve import NORMAL_SAMPLES
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene

RADIUS = 0.1
PLANE = Scene(model=circle(2.0 * RADIUS), stiffness=1000.0, mass=0.1)
SPACE = Scene(model=sphere(2.0 * RADIUS), stiffness=1000.0, mass=0.1)

turns = st.tuples(*[st.floats(-1.0, 1.0)] * 6)


def tilted(drawn):
    """An orthonormal base (2, 3) of a plane through the origin."""
    return np.linalg.qr(np.reshape(drawn, (3, 2)) + np.eye(3, 2))[0].T


def in_space(recording, base):
    return Recording(recording.time, {name: each @ base for name, each in recording.channels.items()}, recording.meta)


def turned(vectors, angle):
    c, s = np.cos(angle), np.sin(angle)
    return vectors @ np.array([[c, s], [-s, c]])


def slide(*, lean=0.0, jump=0.0, depth=2e-3):
    """Round a part of the circle 2 mm deep; the force leans off the normal, the IHIP jumps along in the middle."""
    k = np.arange(200)
    outward = np.column_stack([np.cos(0.4 + 2e-3 * k), np.sin(0.4 + 2e-3 * k)])
    ihip = RADIUS * np.where(k[:, None] < 100, outward, turned(outward, jump))
    channels = {"hip": (RADIUS - depth) * outward, "ihip": ihip, "force": 1000.0 * depth * turned(outward, lean)}
    return Recording(1e-3 * k, channels, {"source": "file"})


def flight(*, stop, sideways=0.05):
    """Into the circle at its right: a tool that loses the share `stop` of its normal velocity in the first tick."""
    k = np.arange(60)
    hit = 30
    into = np.where(k <= hit, -0.2, -0.2 * (1.0 - stop))
    velocity = np.column_stack([into, np.full(60, sideways)])
    hip = np.cumsum(velocity, axis=0) * 1e-3
    hip += np.array([RADIUS - 1e-4, 0.0]) - hip[hit]
    touching = (k >= hit)[:, None]
    ihip = np.where(touching, RADIUS * hip / np.linalg.norm(hip, axis=1)[:, None], hip)
    channels = {
        "hip": hip,
        "ihip": ihip,
        "force": 1000.0 * (ihip - hip),
        "velocity": velocity,
        "operator_force": np.zeros((60, 2)),
    }
    return Recording(1e-3 * k, channels, {"source": "experiment"})


CASES = [
    (CHECKS["contact-normal-force"], slide()),
    (CHECKS["contact-normal-force"], slide(lean=0.2)),
    (CHECKS["continuous-contact"], slide()),
    (CHECKS["continuous-contact"], slide(jump=0.3)),
    (CHECKS["impulsive-collision"], flight(stop=1.0)),
    (CHECKS["impulsive-collision"], flight(stop=0.3)),
]


@given(drawn=turns)
@settings(max_examples=10, deadline=None)
@pytest.mark.parametrize(("check", "recording"), CASES)
def test_a_great_circle_is_judged_like_a_circle_in_the_plane(check, recording, drawn):
    plane = check(Runs(recording), PLANE)
    space = check(Runs(in_space(recording, tilted(drawn))), SPACE)
    assert space.outcome is plane.outcome
    # The interval of angles in the plane is wider by up to two cells of its table.
    cells = np.degrees(2.0 * 2.0 * np.pi / NORMAL_SAMPLES)
    assert space.metric.value == pytest.approx(plane.metric.value, rel=1e-6, abs=cells)
    assert space.bound == pytest.approx(plane.bound, rel=1e-6, abs=1e-12)


def test_the_cases_above_have_both_outcomes():
    outcomes = {}
    for check, recording in CASES:
        outcomes.setdefault(check.id, []).append(check(Runs(recording), PLANE).outcome)
    assert set(map(tuple, outcomes.values())) == {(Outcome.PASS, Outcome.FAIL)}


@pytest.mark.parametrize("check", [CHECKS["broken-contact"], CHECKS["abrupt-switch"]])
def test_a_smooth_surface_has_no_corner_to_judge(check):
    finding = check(Runs(in_space(slide(), np.eye(2, 3))), SPACE)
    assert finding.outcome is Outcome.NOT_APPLICABLE
    assert "corner" in finding.message
