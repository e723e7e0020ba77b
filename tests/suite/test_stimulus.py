"""Paths and experiments: sampling, refinement, reversal, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.stimulus.stimulus import Experiment, Path


def path():
    return Path(np.array([2.0, 3.0, 4.0]), np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]]))


@given(dt=st.floats(1e-3, 0.3), factor=st.sampled_from([2, 4, 8]))
def test_refining_keeps_every_sample(dt, factor):
    time, points = path().sampled(dt)
    fine_time, fine_points = path().sampled(dt / factor)
    np.testing.assert_allclose(fine_time[: factor * (time.size - 1) + 1 : factor], time, atol=1e-12)
    np.testing.assert_allclose(fine_points[: factor * (time.size - 1) + 1 : factor], points, atol=1e-11)


def test_sampling_includes_the_end_when_it_is_a_whole_number_of_ticks():
    time, points = path().sampled(0.001)
    assert time[0] == 0.0
    assert time[-1] == pytest.approx(2.0)
    np.testing.assert_allclose(points[-1], [1.0, 2.0])


def test_reversed_twice_is_the_same_path():
    once = path().reversed()
    np.testing.assert_array_equal(once.points, path().points[::-1])
    again = once.reversed()
    np.testing.assert_allclose(again.time, path().time - 2.0)


@pytest.mark.parametrize(
    ("time", "points", "message"),
    [
        ([0.0, 1.0], [[0.0, 0.0], [np.nan, 0.0]], "position is not finite at row 1"),
        ([0.0, 1.0, 1.0], [[0.0, 0.0]] * 3, "does not increase at row 2"),
        ([0.0], [[0.0, 0.0]], "at least two rows|shape"),
        ([0.0, 1.0], [[0.0, 0.0]], "shape"),
        ([0.0, np.inf], [[0.0, 0.0]] * 2, "time is not finite at row 1"),
    ],
)
def test_bad_paths_name_the_row(time, points, message):
    with pytest.raises(InputError, match=message):
        Path(np.array(time), np.array(points))


def experiment(**changed):
    values = {
        "duration": 1.0,
        "position": np.zeros(2),
        "velocity": np.array([1.0, 0.0]),
        "force_time": np.array([0.0, 1.0]),
        "force": np.array([[0.0, 0.0], [0.0, -2.0]]),
    }
    return Experiment(**{**values, **changed})


def test_the_push_is_straight_between_rows_and_held_outside():
    push = experiment().operator_force(np.array([-1.0, 0.5, 2.0]))
    np.testing.assert_allclose(push, [[0.0, 0.0], [0.0, -1.0], [0.0, -2.0]])


def test_another_pace_scales_velocity_up_and_times_down():
    fast = experiment().at_speed(2.0)
    assert fast.duration == 0.5
    np.testing.assert_array_equal(fast.velocity, [2.0, 0.0])
    np.testing.assert_array_equal(fast.force_time, [0.0, 0.5])


@pytest.mark.parametrize(
    "changed",
    [
        {"duration": 0.0},
        {"duration": np.nan},
        {"velocity": np.zeros(3)},
        {"position": np.array([np.nan, 0.0])},
        {"force": np.zeros((3, 2))},
        {"force": np.zeros((2, 3))},
        {"force_time": np.array([1.0, 0.0])},
    ],
)
def test_bad_experiments_are_refused(changed):
    with pytest.raises(InputError):
        experiment(**changed)
