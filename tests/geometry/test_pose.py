"""Poses: there and back, of places and of velocities, and what is no pose."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.geometry.pose import POSE_ROUNDING, Pose, check_pose, resting_pose, turn_about, turn_in_plane

NUMBERS = st.integers(-200, 200).map(lambda number: number / 100.0)


@st.composite
def poses(draw, dimension):
    angle = math.pi * draw(NUMBERS)
    if dimension == 2:
        rotation = turn_in_plane(angle)
    else:
        axis = np.array([draw(NUMBERS), draw(NUMBERS), 1.0])
        rotation = turn_about(axis / np.linalg.norm(axis), angle)
    return Pose(rotation, np.array([draw(NUMBERS) for _ in range(dimension)]))


@pytest.mark.parametrize("dimension", [2, 3])
@given(data=st.data())
def test_a_hand_in_the_world_has_the_velocity_of_its_places_there(dimension, data):
    before, now = (data.draw(poses(dimension)) for _ in range(2))
    early, late = (np.array([data.draw(NUMBERS) for _ in range(dimension)]) for _ in range(2))
    dt = 1e-3
    relative = (late - early) / dt
    of_places = (now.to_world(late) - before.to_world(early)) / dt
    velocity = now.velocity_in_world(before, late, relative, dt)
    assert velocity == pytest.approx(of_places, rel=1e-9, abs=1e-9)
    assert now.velocity_in_body(before, late, velocity, dt) == pytest.approx(relative, rel=1e-9, abs=1e-9)
    assert now.to_body(now.to_world(late)) == pytest.approx(late, abs=1e-12)
    assert now.turned_back(now.turned(late)) == pytest.approx(late, abs=1e-12)
    assert np.linalg.norm(now.turned(late)) == pytest.approx(np.linalg.norm(late), abs=1e-12)


def test_a_turn_is_anticlockwise_and_rows_of_poses_are_taken_row_by_row():
    quarter = turn_in_plane(np.array([0.0, 0.5 * np.pi]))
    rows = Pose(quarter, np.array([[1.0, 0.0], [0.0, 2.0]]))
    points = np.array([[1.0, 0.0], [1.0, 0.0]])
    assert rows.to_world(points) == pytest.approx(np.array([[2.0, 0.0], [0.0, 3.0]]))
    assert rows.to_body(rows.to_world(points)) == pytest.approx(points)
    about_z = turn_about(np.array([0.0, 0.0, 1.0]), 0.5 * np.pi)
    assert about_z @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("rotation", "translation"),
    [
        (np.diag([1.0, -1.0]), [0.0, 0.0]),
        (np.eye(2) * (1.0 + POSE_ROUNDING), [0.0, 0.0]),
        ([[1.0, 1e-8], [0.0, 1.0]], [0.0, 0.0]),
        (np.eye(2), [np.nan, 0.0]),
        (np.eye(3), [0.0, 0.0, 0.0]),
        (np.eye(2), [0.0, 0.0, 0.0]),
        ([["one", 0.0], [0.0, 1.0]], [0.0, 0.0]),
    ],
)
def test_what_is_no_pose_is_refused_by_name(rotation, translation, refused):
    with refused(InputError):
        check_pose(rotation, translation, 2)


def test_a_pose_may_be_off_by_rounding():
    off = np.eye(2) + 0.3 * POSE_ROUNDING * np.array([[0.0, 1.0], [0.0, 0.0]])
    assert np.array_equal(check_pose(off, [1.0, 2.0], 2).rotation, off)
    assert resting_pose(3).to_world(np.array([1.0, 2.0, 3.0])) == pytest.approx([1.0, 2.0, 3.0])
