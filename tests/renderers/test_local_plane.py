"""The local plane of Adachi: exact under a flat face, as old as its slow loop under a curve; recovery keeps size."""

import math

import numpy as np
import pytest
from hand_paths import ticked
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.geometry.catalogue import circle, line
from hapticeval.renderers.field.catalogue import local_plane
from hapticeval.scene import Scene

RATES = {"30hz": 30.0, "60hz": 60.0, "100hz": 100.0}


def led(model, hips, *, dt=1e-3, regulation="plain", **knobs):
    return ticked(local_plane.variant(regulation=regulation).with_knobs(**knobs)(Scene(model=model)), hips, dt)


def lap(speed, radius=0.09, ticks=2000, dt=1e-3):
    """A hand that goes round at a depth of 10 mm under a circle of 100 mm: HIPs (n, 2), m."""
    angle = speed * dt / radius * np.arange(ticks)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.mark.parametrize("name", RATES)
def test_a_name_chooses_the_rate_and_a_knob_any_other(name):
    assert local_plane.variant(representation=name)(Scene(model=circle())).rate == RATES[name]
    assert local_plane.with_knobs(rate=44.0)(Scene(model=circle())).rate == 44.0


@given(rate=st.floats(5.0, 1000.0), speed=st.floats(0.01, 0.2))
def test_on_a_circle_the_force_is_as_old_as_its_plane(rate, speed):
    """n is the direction of the hand at the last k / f_s, and d = R - n . h: kappa v^2 t^2 / 2 more than the depth."""
    hips = lap(speed)
    _, forces = led(circle(), hips, rate=rate)
    planes = np.floor(np.arange(len(hips)) * 1e-3 * rate + 1e-6)
    first = np.array([np.flatnonzero(planes == plane)[0] for plane in planes])
    normals = hips[first] / np.linalg.norm(hips[first], axis=1)[:, np.newaxis]
    depths = 0.1 - np.sum(normals * hips, axis=1)
    late = np.abs(np.sum(forces / 1000.0 - depths[:, np.newaxis] * normals, axis=1)) > 1e-12
    assert np.count_nonzero(late) <= 2 + planes[-1] * 0.01  # a plane may come a tick to either side, for rounding


@pytest.mark.parametrize("rate", [30.0, 100.0])
def test_a_new_plane_jumps_by_the_turn_times_the_depth(rate):
    """Between two planes the normal turns by v / (R f_s): the IHIP jumps by that times the depth along the surface."""
    ihips, _ = led(circle(), lap(0.05), rate=rate)
    jumps = np.linalg.norm(np.diff(ihips, axis=0), axis=1)
    expected = 0.05 / (0.09 * rate) * 0.01
    assert jumps.max() == pytest.approx(expected + 0.05e-3, rel=0.3)


@settings(max_examples=20)
@given(rate=st.sampled_from([30.0, 100.0]), recovery_time=st.floats(2e-3, 20e-3))
def test_recovery_keeps_the_size_of_the_force_at_a_new_plane(rate, recovery_time):
    hips = lap(0.2)
    plain, kept = (
        np.linalg.norm(led(circle(), hips, regulation=law, rate=rate, recovery_time=recovery_time)[1], axis=1)
        for law in ("plain", "recovery")
    )
    # on the circle all planes are the same but for a turn: a jump of kappa (v / f_s)^2 / 2 becomes a slope
    sag = 1000.0 * 0.5 * (0.2 / rate) ** 2 / 0.09
    assert np.abs(np.diff(plain)).max() == pytest.approx(sag, rel=0.2)
    steep = sag / recovery_time * 1e-3 + 1000.0 * 0.2 / rate * 0.2e-3 / 0.09
    assert np.abs(np.diff(kept)).max() <= 1.3 * steep


def test_recovery_begins_a_contact_without_a_step_and_ends_at_the_plain_force():
    hips = np.vstack([np.tile([0.0, 0.01], (5, 1)), np.tile([0.02, -0.005], (200, 1))])
    _, plain = led(line(), hips)
    _, soft = led(line(), hips, regulation="recovery")
    assert plain[5, 1] == pytest.approx(5.0)  # the plane of a line is the line from anywhere
    np.testing.assert_allclose(soft[5], plain[5])
    assert math.isclose(soft[-1, 1], plain[-1, 1], rel_tol=1e-6)


@pytest.mark.parametrize("dt", [1e-3, 1e-4, 1.0 / 300.0])
def test_planes_come_at_their_rate_whatever_the_tick(dt):
    hips = lap(0.1, ticks=int(0.5 / dt), dt=dt)
    _, forces = led(circle(), hips, dt=dt, rate=30.0)
    turns = np.arctan2(forces[:, 1], forces[:, 0])
    assert np.count_nonzero(np.abs(np.diff(turns)) > 1e-9) == pytest.approx(0.5 * 30.0, abs=1.0)
