"""Paths and experiments: where they lead, how they are sampled, and what a table or a file may get wrong."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, line, star
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.stimulus.experiments import build_path
from hapticeval.stimulus.paths import read_path
from hapticeval.stimulus.stimulus import Experiment, Path, sample_times
from hapticeval.suite.reading import load_suite

HERE = FilePath()
SCALED = {"kind": "scaled", "from_angle": 0, "to_angle": 9, "duration": 1}


def scaled(model, depth, start, stop):
    return build_path(
        {"kind": "scaled", "depth": depth, "from_angle": start, "to_angle": stop, "duration": 2.0}, model.curve, HERE
    )


@given(depth=st.floats(1e-4, 0.09), start=st.floats(-180, 180), sweep=st.floats(10, 350))
def test_scaled_paths_are_the_surface_made_smaller(depth, start, sweep):
    model = cassinian()
    points = scaled(model, depth, start, start + sweep).points
    on_surface = points / (1.0 - depth / 0.1)
    assert np.max(np.abs(model.curve.signed_distance(on_surface[::997]))) < 1e-9
    angles = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert np.degrees(angles[-1] - angles[0]) == pytest.approx(sweep, abs=1e-3)


def test_paths_run_at_constant_speed():
    _, points = scaled(cassinian(), 0.005, -45, 45).sampled(1e-3)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    np.testing.assert_allclose(steps, np.median(steps), rtol=2e-3)


def corner(number, depth):
    spec = {"kind": "corner", "corner": number, "depth": depth, "before": 0.03, "after": 0.02, "duration": 1.0}
    return build_path(spec, star().curve, HERE)


@given(depth=st.floats(1e-4, 0.01), number=st.sampled_from([1, 3, 5, 7, 9]))
def test_a_concave_corner_is_rounded_at_the_depth(depth, number):
    path = corner(number, depth)
    distances = star().curve.signed_distance(path.sampled(0.01)[1])
    np.testing.assert_allclose(distances, -depth, atol=2e-7)


@given(depth=st.floats(1e-4, 0.005), number=st.sampled_from([0, 2, 4, 6, 8]))
def test_a_convex_corner_is_passed_straight(depth, number):
    path = corner(number, depth)
    assert path.points.shape == (2, 2)
    bend = star().curve.corners[number]
    np.testing.assert_allclose((path.points - bend.position) @ bend.normal_pre, -depth, atol=1e-15)
    assert star().curve.signed_distance(path.points[-1:])[0] > 0.0


@pytest.mark.parametrize(
    ("spec", "model"),
    [
        ({**SCALED, "depth": 0.2}, circle()),
        ({**SCALED, "depth": 0.01}, line()),
        ({**SCALED, "depth": 0.01}, dumbbell(neck=0.1)),
        (SCALED, circle()),
        ({"kind": "points", "points": [[0, 0], [0, 0]], "duration": 1}, circle()),
        ({"kind": "corner", "corner": 0, "depth": 0.01, "before": 1, "after": 1, "duration": 1}, circle()),
    ],
)
def test_paths_that_cannot_be_are_refused(refused, spec, model):
    with refused(InputError):
        build_path(spec, model.curve, HERE)


@pytest.fixture
def written(tmp_path):
    """Read the path of a file with a text."""

    def read(text):
        (tmp_path / "hand.csv").write_text(text)
        return read_path(tmp_path / "hand.csv")

    return read


def test_a_file_is_read_with_its_times(written):
    path = written("t,x,y\n0,0.1,0.0\n0.5,0.2,0.0\n2,0.2,0.3\n")
    np.testing.assert_array_equal(path.time, [0.0, 0.5, 2.0])
    np.testing.assert_array_equal(path.points[2], [0.2, 0.3])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "time,x,y\n0,0,0\n1,1,1\n",
        "t,x,y\n0,0,0\n",
        "t,x,y\n0,0,0\n1,,1\n",
        "t,x,y\n0,0,0\n1,nan,1\n",
        "t,x,y\n0,0,0\n1,left,1\n",
        "t,x,y\n0,0,0\n0,1,1\n",
    ],
)
def test_bad_files_are_named_with_their_row(refused, written, text):
    with refused(InputError):
        written(text)


def test_the_hip_of_any_recording_is_a_path(tmp_path):
    time, hips = np.array([5.0, 5.1, 5.2, 5.4]), np.array([[0.1, 0.0], [0.2, 0.1], [9.0, 9.0], [0.3, 0.5]])
    valid = np.array([True, True, False, True])
    write_recording(tmp_path / "run.h5", Recording(time, {"hip": hips, "force": 0.0 * hips}, valid=valid))
    path = read_path(tmp_path / "run.h5")
    np.testing.assert_array_equal(path.time, time[valid])
    np.testing.assert_array_equal(path.points, hips[valid])


def test_a_file_that_has_no_path_is_named(refused, tmp_path):
    with refused(InputError):
        read_path(tmp_path / "none.csv")
    with refused(InputError):
        read_path(tmp_path / "none.h5")
    write_recording(tmp_path / "bare.h5", Recording(np.arange(3.0), {"force": np.zeros((3, 2))}))
    with refused(InputError):
        read_path(tmp_path / "bare.h5")


def three():
    return Path(np.array([2.0, 3.0, 4.0]), np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]]))


@given(dt=st.floats(1e-3, 0.3), factor=st.sampled_from([2, 4, 8]))
def test_refining_keeps_every_sample(dt, factor):
    time, points = three().sampled(dt)
    fine_time, fine_points = three().sampled(dt / factor)
    np.testing.assert_allclose(fine_time[: factor * (time.size - 1) + 1 : factor], time, atol=1e-12)
    np.testing.assert_allclose(fine_points[: factor * (time.size - 1) + 1 : factor], points, atol=1e-11)


def test_sampling_includes_the_end_when_it_is_a_whole_number_of_ticks():
    time, points = three().sampled(0.001)
    assert time[0] == 0.0
    assert time[-1] == pytest.approx(2.0)
    np.testing.assert_allclose(points[-1], [1.0, 2.0])


def test_reversed_twice_is_the_same_three():
    once = three().reversed()
    np.testing.assert_array_equal(once.points, three().points[::-1])
    again = once.reversed()
    np.testing.assert_allclose(again.time, three().time - 2.0)


@pytest.mark.parametrize(
    ("time", "points"),
    [
        ([0.0, 1.0], [[0.0, 0.0], [np.nan, 0.0]]),
        ([0.0, 1.0, 1.0], [[0.0, 0.0]] * 3),
        ([0.0], [[0.0, 0.0]]),
        ([0.0, 1.0], [[0.0, 0.0]]),
        ([0.0, np.inf], [[0.0, 0.0]] * 2),
    ],
)
def test_bad_paths_name_the_row(refused, time, points):
    with refused(InputError):
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


@pytest.mark.parametrize("duration", [2.0**31, 1e300, math.inf, math.nan])
def test_a_run_that_no_memory_holds_is_refused(refused, duration):
    with refused(InputError):
        sample_times(duration, 1e-3)


class Rendered:
    """A renderer whose own surface is a circle of half the size."""

    surface = circle(size=0.1).boundary

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        return hip, 0.0 * hip


def test_depths_count_from_the_renderer_s_surface_where_the_case_says_so_and_a_renderer_is_there():
    suite = load_suite("thesis")
    for name, of_renderer in (("cassinian-shallow-slide", True), ("cassinian-deep-slide", False)):
        case = suite.case(name)
        scene = case.build_scene()
        bare, own = (case.build_stimulus(scene, renderer).points for renderer in (None, Rendered()))
        if of_renderer:
            np.testing.assert_allclose(np.linalg.norm(own, axis=1), 0.05 - 0.0008, rtol=1e-3)
            assert np.linalg.norm(bare, axis=1).max() > 0.09
        else:
            np.testing.assert_array_equal(own, bare)
