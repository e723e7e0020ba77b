"""Trajectories: where they lead, and what a file may get wrong."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, line, star
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.stimulus.paths import build_path, read_path

HERE = FilePath()


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
    ("spec", "model", "message"),
    [
        ({"kind": "scaled", "depth": 0.2, "from_angle": 0, "to_angle": 9, "duration": 1}, circle(), "radius"),
        ({"kind": "scaled", "depth": 0.01, "from_angle": 0, "to_angle": 9, "duration": 1}, line(), "closed model"),
        (
            {"kind": "scaled", "depth": 0.01, "from_angle": 0, "to_angle": 9, "duration": 1},
            dumbbell(neck=0.1),
            "every ray",
        ),
        ({"kind": "points", "points": [[0, 0], [0, 0]], "duration": 1}, circle(), "stays at one point"),
        ({"kind": "corner", "corner": 0, "depth": 0.01, "before": 1, "after": 1, "duration": 1}, circle(), "corner 0"),
    ],
)
def test_paths_that_cannot_be_are_refused(spec, model, message):
    with pytest.raises(InputError, match=message):
        build_path(spec, model.curve, HERE)


def write(tmp_path, text):
    file = tmp_path / "hand.csv"
    file.write_text(text)
    return file


def test_a_file_is_read_with_its_times(tmp_path):
    path = read_path(write(tmp_path, "t,x,y\n0,0.1,0.0\n0.5,0.2,0.0\n2,0.2,0.3\n"))
    np.testing.assert_array_equal(path.time, [0.0, 0.5, 2.0])
    np.testing.assert_array_equal(path.points[2], [0.2, 0.3])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not a CSV table"),
        ("time,x,y\n0,0,0\n1,1,1\n", "columns time, x, y"),
        ("t,x,y\n0,0,0\n", "1 rows"),
        ("t,x,y\n0,0,0\n1,,1\n", "not finite at row 1"),
        ("t,x,y\n0,0,0\n1,nan,1\n", "not finite at row 1"),
        ("t,x,y\n0,0,0\n1,left,1\n", "row 1, column x"),
        ("t,x,y\n0,0,0\n0,1,1\n", "does not increase at row 1"),
    ],
)
def test_bad_files_are_named_with_their_row(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read_path(write(tmp_path, text))
    assert "hand.csv" in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="no trajectory file"):
        read_path(tmp_path / "none.csv")


def test_the_hip_of_any_recording_is_a_path(tmp_path):
    time, hips = np.array([5.0, 5.1, 5.2, 5.4]), np.array([[0.1, 0.0], [0.2, 0.1], [9.0, 9.0], [0.3, 0.5]])
    valid = np.array([True, True, False, True])
    write_recording(tmp_path / "run.h5", Recording(time, {"hip": hips, "force": 0.0 * hips}, valid=valid))
    path = read_path(tmp_path / "run.h5")
    np.testing.assert_array_equal(path.time, time[valid])
    np.testing.assert_array_equal(path.points, hips[valid])


def test_a_recording_that_cannot_be_drawn_is_told(tmp_path):
    with pytest.raises(InputError, match=r"none\.h5"):
        read_path(tmp_path / "none.h5")
    write_recording(tmp_path / "bare.h5", Recording(np.arange(3.0), {"force": np.zeros((3, 2))}))
    with pytest.raises(InputError, match="'hip'"):
        read_path(tmp_path / "bare.h5")
