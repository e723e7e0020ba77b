"""The measures behind claims about the print, on motions whose numbers are known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import recorded

from hapticeval.geometry.catalogue import make_model
from hapticeval.scene import Scene
from hapticeval.study.thesis.measures import Run, encoder_grid, measure, outlines

CIRCLE = Scene(model=make_model("circle"))


def run(hip, ihip=None, scene=CIRCLE, **channels):
    return Run("mine", scene, recorded(hip, ihip, **channels))


def on_circle(radius, angles):
    angles = np.asarray(angles)
    return np.broadcast_to(radius, angles.shape)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


@given(st.floats(0.05, 0.099), st.floats(0.2, 3.0))
def test_a_slide_under_a_circle(radius, speed):
    angles = speed * 1e-3 * np.arange(400)
    slide = run(on_circle(radius, angles), on_circle(0.1, angles))
    assert measure("typical_depth", slide, {}) == pytest.approx(0.1 - radius)
    assert measure("largest_distance", slide, {"after": 0.1}) == pytest.approx(0.1 - radius)
    assert measure("last_distance", slide, {}) == pytest.approx(radius - 0.1)
    # The chord of an angle, and the force turns by it.
    assert measure("largest_step", slide, {}) == pytest.approx(2.0 * 0.1 * math.sin(speed * 5e-4))
    assert measure("largest_turn", slide, {}) == pytest.approx(speed * 1e-3)
    # A tenth to nine tenths of a turn that is even.
    assert measure("turning_angle", slide, {}) == pytest.approx(0.8 * angles[-1], abs=3.0 * speed * 1e-3)
    assert measure("turning_time", slide, {}) == pytest.approx(0.8 * 0.399, abs=3e-3)
    assert measure("backwards", slide, {}) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(1e-3, 0.1))
def test_a_hand_that_goes_back_is_told_by_how_far(back):
    angles = np.concatenate(
        [np.linspace(0.0, 0.5, 200), np.linspace(0.5, 0.5 - back, 50), np.linspace(0.5 - back, 1.0, 200)]
    )
    assert measure("backwards", run(on_circle(0.08, angles)), {}) == pytest.approx(0.08 * back)
    assert measure("backwards", run(on_circle(0.08, -angles)), {}) == pytest.approx(0.08 * back)


def test_a_step_counts_within_a_contact_only():
    hip = np.array([[0.09, 0.0], [0.09, 0.001], [0.2, 0.0], [0.2, 0.0]])
    ihip = np.array([[0.1, 0.0], [0.1, 0.001], [0.2, 0.0], [0.2, 0.0]])
    slide = run(hip, ihip)
    assert measure("largest_step", slide, {}) == pytest.approx(0.001)
    assert measure("release_time", slide, {}) == pytest.approx(1e-3)


@given(st.floats(0.1, 3.0), st.floats(0.1, 3.0))
def test_a_swing_that_grows(first, last):
    time = 1e-3 * np.arange(4001)
    off = 1e-3 * np.where(time < 2.0, first, last) * np.sin(20.0 * time)
    swing = run(on_circle(0.1 + off, 0.5 * time))
    options = {"first": [0.0, 1.9], "last": [2.1, 4.0]}
    assert measure("growth", swing, options) == pytest.approx(last / first, rel=1e-3)


def test_a_speed_that_comes_back():
    speed = np.concatenate([np.linspace(1.0, 0.4, 500), np.linspace(0.4, 0.6, 300), np.linspace(0.6, 0.1, 300)])
    hip = on_circle(0.1, np.cumsum(1e-3 * speed / 0.1))
    velocity = speed[:, None] * np.column_stack([-hip[:, 1], hip[:, 0]]) / 0.1
    slide = run(hip, velocity=velocity)
    assert measure("speed_rise", slide, {"after": 0.0}) == pytest.approx(0.2, abs=1e-9)
    assert measure("last_speed", slide, {}) == pytest.approx(0.1)


def test_one_run_over_another():
    angles = np.linspace(0.0, 1.0, 100)
    deep, shallow = (run(on_circle(0.1 - depth, angles), on_circle(0.1, angles)) for depth in (0.004, 0.001))
    assert measure("relative", deep, {"of": "largest_distance", "from": "x"}, shallow) == pytest.approx(4.0)
    assert measure("hands_apart", deep, {"from": "x"}, shallow) == pytest.approx(0.003)
    assert measure("ihips_apart", deep, {"from": "x"}, shallow) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("representation", ["curve", "level-set"])
def test_lines_under_an_outline_are_as_deep_as_they_say(representation):
    boundary = make_model("cassinian").boundary
    surface, inset = outlines("cassinian", representation, (0.01,))
    assert np.abs(boundary.signed_distance(surface)).max() < 1e-4
    assert boundary.signed_distance(inset) == pytest.approx(-0.01, abs=1e-4)


def test_a_front_of_points_has_swallowtails_and_a_level_set_has_none():
    """Section 5.2.3, Figure 5.6: beyond 1 / κ of the tip points cross over, and lie less deep than they were pushed."""
    boundary = make_model("cassinian").boundary
    _, points = outlines("cassinian", "curve", (0.035,))
    _, level = outlines("cassinian", "level-set", (0.035,))
    assert boundary.signed_distance(points).max() > -0.034
    assert boundary.signed_distance(level) == pytest.approx(-0.035, abs=5e-4)


def test_encoders_know_places_some_micrometres_apart():
    points, circle = encoder_grid("parallelogram-2dof")
    steps = np.linalg.norm(np.diff(points.reshape(11, 11, 2), axis=1), axis=2)
    # l4 times a count: 0.346 m of 2.397e-5 rad.
    assert steps == pytest.approx(0.346 * 2.39684498e-5, rel=1e-4)
    assert np.linalg.norm(circle, axis=1) == pytest.approx(0.1)


def test_the_schemes_of_table_4_1_are_told_apart():
    """A formula in place of another's is off by newtons."""
    for scheme in ("pp", "pp-v", "pp-d", "pp-pd"):
        assert measure("scheme_error", None, {"scheme": scheme}) < 1e-5
