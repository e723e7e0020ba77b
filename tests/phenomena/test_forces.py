"""Contact normal force, impulsive collision, centripetal force and memoryless on recordings made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.geometry.catalogue import circle, line
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene

PLANE = Scene(model=line(), stiffness=1000.0, mass=0.1)


def pressed(*, tilt=0.0, gain=1.0, push=2.0):
    """At rest 2 mm deep under `push` newtons; the answer is `gain` times that, `tilt` radians off the normal."""
    n = 500
    hip = np.tile([0.0, -push / 1000.0], (n, 1))
    force = gain * push * np.tile([np.sin(tilt), np.cos(tilt)], (n, 1))
    channels = {
        "hip": hip,
        "ihip": np.zeros((n, 2)),
        "force": force,
        "velocity": np.zeros((n, 2)),
        "operator_force": np.tile([0.3, -push], (n, 1)),
    }
    return Recording(np.arange(n) * 1e-3, channels, {"source": "experiment"})


def test_a_force_equal_to_the_operator_s_normal_component_passes():
    finding = CHECKS["contact-normal-force"](Runs(pressed()), PLANE)
    assert finding.outcome is Outcome.PASS
    assert "equal at rest" in finding.message


@given(tilt=st.floats(1e-3, 3.0), side=st.sampled_from([-1, 1]))
@settings(max_examples=20)
def test_a_tilted_force_fails_by_its_angle(tilt, side):
    finding = CHECKS["contact-normal-force"](Runs(pressed(tilt=side * tilt)), PLANE)
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value == pytest.approx(np.degrees(tilt), rel=1e-6)


@given(gain=st.one_of(st.floats(0.1, 0.99), st.floats(1.01, 3.0)))
@settings(max_examples=20)
def test_a_force_of_the_wrong_size_at_rest_fails_by_the_difference(gain):
    finding = CHECKS["contact-normal-force"](Runs(pressed(gain=gain)), PLANE)
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.unit == "N"
    assert finding.metric.value == pytest.approx(2.0 * abs(gain - 1.0), rel=1e-6)


def test_an_error_vector_that_leans_is_reported_where_the_force_does_not():
    """As under the transversal regulation (5.21): normal force, slanted projection."""
    base = pressed()
    hip = np.tile([2e-3 * np.tan(np.radians(30.0)), -2e-3], (len(base), 1))
    leaning = Recording(base.time, {**base.channels, "hip": hip}, base.meta)
    finding = CHECKS["contact-normal-force"](Runs(leaning), PLANE)
    assert finding.outcome is Outcome.PASS
    assert finding.evidence["error_vector_angle_median_deg"] == pytest.approx(30.0)


@given(tilt=st.floats(0.02, 0.099))
@settings(max_examples=10)
def test_what_the_declared_resolution_forgives_is_said(tilt):
    """On a circle of 0.1 m a resolution of 10 mm allows 0.1 rad, and the standing hand nothing more."""
    scene = Scene(model=circle(), stiffness=1000.0, mass=0.1)
    force = 2.0 * np.tile([np.cos(tilt), np.sin(tilt)], (100, 1))
    channels = {"hip": np.tile([0.098, 0.0], (100, 1)), "ihip": np.tile([0.1, 0.0], (100, 1)), "force": force}
    judged = {
        declared: CHECKS["contact-normal-force"](
            Runs(Recording(np.arange(100) * 1e-3, channels, {"resolution": declared})), scene
        )
        for declared in (0.0, 0.01)
    }
    assert judged[0.0].outcome is Outcome.FAIL
    assert judged[0.01].outcome is Outcome.PASS
    assert judged[0.01].evidence["angle_by_resolution_deg"] == pytest.approx(judged[0.0].metric.value, abs=1e-3)
    assert "which its declared resolution of 10 mm allows)" in judged[0.01].message
    said = judged[0.01].message.split("(but for up to ")[1].split()[0]
    assert float(said) == pytest.approx(np.degrees(tilt), rel=0.05)


def test_no_force_decides_nothing():
    assert CHECKS["contact-normal-force"](Runs(pressed(push=1e-6)), PLANE).outcome is Outcome.INCONCLUSIVE


def collision(*, ticks, restitution=0.0, speed=0.3):
    """The normal velocity goes from -speed to restitution * speed evenly over `ticks` ticks."""
    n, struck = 200, 50
    along = np.full(n, -speed)
    along[struck:] = np.minimum(
        -speed + (1.0 + restitution) * speed * np.arange(n - struck) / ticks, restitution * speed
    )
    velocity = np.column_stack([np.full(n, 0.1), along])
    force = np.zeros((n, 2))
    force[:-1, 1] = 0.1 * np.diff(along) / 1e-3
    hip = np.column_stack([0.1e-3 * np.arange(n), np.full(n, 1e-3)])
    ihip = hip.copy()
    touching = force[:, 1] > 0
    ihip[touching, 1] = 0.0
    channels = {"hip": hip, "ihip": ihip, "force": force, "velocity": velocity}
    return Recording(np.arange(n) * 1e-3, channels, {"source": "experiment"})


@pytest.mark.parametrize("restitution", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("ticks", [1, 2, 4])
def test_an_impulse_within_four_ticks_passes(ticks, restitution):
    scene = Scene(model=line(), restitution=restitution)
    finding = CHECKS["impulsive-collision"](Runs(collision(ticks=ticks, restitution=restitution)), scene)
    assert finding.outcome is Outcome.PASS


@given(ticks=st.integers(5, 60))
@settings(max_examples=20)
def test_the_missing_share_of_a_slow_collision_is_measured(ticks):
    finding = CHECKS["impulsive-collision"](Runs(collision(ticks=ticks)), PLANE)
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value == pytest.approx(1.0 - 4.0 / ticks)
    assert finding.evidence["stopped_after_ms"] == pytest.approx(ticks, abs=1e-6)


def test_the_wrong_restitution_fails():
    finding = CHECKS["impulsive-collision"](Runs(collision(ticks=1, restitution=1.0)), PLANE)
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value == pytest.approx(1.0)


def test_a_tool_that_never_flies_decides_nothing():
    assert CHECKS["impulsive-collision"](Runs(pressed()), PLANE).outcome is Outcome.INCONCLUSIVE


ROUND = Scene(model=circle(), stiffness=50.0, mass=0.1, bilateral=True)


def orbit(share, *, speed=0.5, noise=0.0, seed=0):
    """Round the circle with `share` of the centripetal force paid for by position error."""
    n = 2000
    time = np.arange(n) * 1e-3
    speeds = speed * (1.0 - 0.3 * time)
    cost = 10.0 * speeds**2 * 0.1 / 50.0
    error = share * cost + noise * np.random.default_rng(seed).standard_normal(n)
    error[0] = 0.0
    angle = np.cumsum(speeds) * 1e-3 / 0.1
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    force = -(0.1 * 10.0 * speeds**2)[:, None] * normal
    force[0] *= 1.0 - share
    channels = {
        "hip": (0.1 + error)[:, None] * normal,
        "ihip": 0.1 * normal,
        "force": force,
        "velocity": speeds[:, None] * tangent,
    }
    return Recording(time, channels, {"source": "experiment"})


@given(share=st.one_of(st.floats(0.02, 1.2), st.floats(-1.2, -0.02)))
@settings(max_examples=20)
def test_the_share_of_centripetal_force_that_is_missing_is_measured(share):
    finding = CHECKS["centripetal-force"](Runs(orbit(share), at_speed=lambda f: orbit(share, speed=0.5 * f)), ROUND)
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value == pytest.approx(abs(share), rel=0.01)


def test_a_force_that_needs_no_error_passes():
    finding = CHECKS["centripetal-force"](Runs(orbit(0.0), at_speed=lambda f: orbit(0.0, speed=0.5 * f)), ROUND)
    assert finding.outcome is Outcome.PASS


def test_an_error_that_has_nothing_to_do_with_speed_is_not_called_centripetal():
    runs = Runs(orbit(0.0, noise=0.05), at_speed=lambda f: orbit(0.0, speed=0.5 * f, noise=0.05, seed=1))
    assert CHECKS["centripetal-force"](runs, ROUND).outcome is Outcome.INCONCLUSIVE


def test_a_force_missing_at_zero_error_fails_even_where_the_error_stays_small():
    base = orbit(0.0)
    force = np.array(base.force)
    force[:4] = 0.0
    late = Recording(base.time, {**base.channels, "force": force}, base.meta)
    finding = CHECKS["centripetal-force"](Runs(late), ROUND)
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["force_missing_at_zero_error"] == pytest.approx(1.0)


def test_a_straight_line_calls_for_no_centripetal_force():
    assert CHECKS["centripetal-force"](Runs(collision(ticks=60)), PLANE).outcome is Outcome.NOT_APPLICABLE


def slide(shift):
    x = np.linspace(0.0, 0.01, 1000)
    hip = np.column_stack([x, np.full(1000, -1e-3)])
    ihip = np.column_stack([x + shift(x), np.zeros(1000)])
    return Recording(np.arange(1000) * 1e-3, {"hip": hip, "ihip": ihip, "force": 1e3 * (ihip - hip)})


@given(apart=st.floats(1e-4, 0.02))
@settings(max_examples=20)
def test_two_answers_to_one_hip_are_measured(apart):
    finding = CHECKS["memoryless"](
        Runs(slide(lambda x: 0 * x), reverse=lambda: slide(lambda x: apart * (x > 5e-3))), PLANE
    )
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value == pytest.approx(apart, abs=7e-5)  # six ticks of the other path
    assert finding.evidence["share_apart"] == pytest.approx(0.5, abs=0.05)


def test_one_answer_to_one_hip_passes():
    finding = CHECKS["memoryless"](Runs(slide(np.sin), reverse=lambda: slide(np.sin)), PLANE)
    assert finding.outcome is Outcome.PASS
    assert finding.metric.value == 0.0


def test_one_recording_alone_cannot_show_memory():
    assert CHECKS["memoryless"](Runs(slide(np.sin)), PLANE).outcome is Outcome.INCONCLUSIVE
