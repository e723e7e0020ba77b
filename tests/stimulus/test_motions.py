"""How bodies move: rigid and smooth at every instant, as fast as they say, and refused where they make no sense."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.documents import convert
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.scene import Scene
from hapticeval.stimulus.motions import (
    AnyMotion,
    Poses,
    Slide,
    Spin,
    Swing,
    path_in_body,
    unjudged_rows,
)
from hapticeval.stimulus.stimulus import Path
from hapticeval.strategies import motions

DT = 1e-3
STAR, CUBE = make_model("star"), make_model("cube")


def row(time, angle, *shift):
    c, s = math.cos(angle), math.sin(angle)
    return (time, c, -s, s, c, *shift)


TABLE = Poses(poses=(row(0.0, 0.0, 0.0, 0.0), row(0.4, 1.0, 0.1, 0.0), row(1.0, -2.0, 0.1, 0.2)))
IN_SPACE = Poses(
    poses=(
        (0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
        (0.5, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.1),
    )
)
MOTIONS = [
    Slide(velocity=(0.3, -0.2)),
    Spin(rate=-1.5, centre=(0.05, 0.02)),
    Spin(rate=2.0, axis=(1.0, 2.0, 3.0), centre=(0.05, 0.0, 0.01)),
    Swing(amplitude=(0.03, 0.0), hertz=3.0, across=(0.0, 0.02)),
    Swing(amplitude=(0.03, 0.0, 0.01), hertz=3.0),
    TABLE,
    IN_SPACE,
]


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: f"{motion.kind}-{motion.dimension}")
def test_a_body_is_rigid_and_goes_no_faster_than_it_says(motion):
    time = np.linspace(0.0, 1.2, 12_001)
    poses, size = motion.pose(time), 0.1
    turned = poses.rotation @ np.swapaxes(poses.rotation, 1, 2)
    assert np.abs(turned - np.eye(motion.dimension)).max() < 1e-12
    assert np.linalg.det(poses.rotation) == pytest.approx(1.0, abs=1e-12)
    # a point at the model's size from the origin, and the way that it goes in a tenth of a tick
    directions = np.vstack([np.eye(motion.dimension), -np.eye(motion.dimension)])
    ways = [np.linalg.norm(np.diff(poses.to_world(size * direction), axis=0), axis=1) for direction in directions]
    assert np.max(ways) <= motion.largest_step(size, 1e-4) * (1.0 + 1e-9)
    # smooth: the velocity changes by little from one tenth of a tick to the next
    velocity = np.diff(poses.to_world(size * directions[0]), axis=0) / 1e-4
    assert np.linalg.norm(np.diff(velocity, axis=0), axis=1).max() < 0.01
    for instant in (0.0, 0.123456, 1.0):
        alone, row_of = motion.pose(instant), motion.pose(np.array([instant]))
        assert np.array_equal(alone.rotation, row_of.rotation[0])
        assert np.array_equal(alone.translation, row_of.translation[0])


def test_each_kind_goes_where_it_says():
    assert Slide(velocity=(0.3, -0.2)).pose(2.0).translation == pytest.approx([0.6, -0.4])
    spin = Spin(rate=0.25, centre=(1.0, 0.0))
    assert spin.pose(1.0).to_world(np.array([2.0, 0.0])) == pytest.approx([1.0, 1.0])
    about_z = Spin(rate=0.25, axis=(0.0, 0.0, 7.0))
    assert about_z.pose(1.0).to_world(np.array([1.0, 0.0, 5.0])) == pytest.approx([0.0, 1.0, 5.0])
    ring = Swing(amplitude=(0.03, 0.0), hertz=1.0, across=(0.0, 0.03))
    places = ring.pose(np.linspace(0.0, 1.0, 101)).translation
    assert np.linalg.norm(places - [0.0, 0.03], axis=1) == pytest.approx(0.03)
    assert Swing(amplitude=(0.03, 0.0), hertz=2.0).pose(0.125).translation == pytest.approx([0.03, 0.0])


@pytest.mark.parametrize("motion", [TABLE, IN_SPACE])
def test_a_table_is_met_at_its_rows_and_rests_there(motion):
    for line in motion.poses:
        pose, size = motion.pose(line[0]), motion.dimension
        assert pose.rotation.ravel() == pytest.approx(line[1 : 1 + size**2], abs=1e-12)
        assert pose.translation == pytest.approx(line[1 + size**2 :], abs=1e-12)
    late, later = motion.pose(5.0), motion.pose(6.0)
    assert np.array_equal(late.rotation, later.rotation)
    # half way in time is half way in the turn: 1.0 to -2.0 rad by the shorter way
    if motion is TABLE:
        half = motion.pose(0.7).rotation
        assert math.atan2(half[1, 0], half[0, 0]) == pytest.approx(-0.5)


def test_a_jump_takes_no_time_and_three_answers_after_it_are_not_judged():
    motion = Poses(poses=(row(0.0, 0.0, 0.0, 0.0), row(0.3, 1.0, 0.5, 0.0), row(0.6, 1.0, 0.5, 0.1)), jump_at=(0.3,))
    time = np.arange(601) * DT
    places = motion.pose(time).translation
    assert np.array_equal(places[:300], np.zeros((300, 2)))
    assert places[300] == pytest.approx([0.5, 0.0])
    assert np.flatnonzero(unjudged_rows(motion, time)).tolist() == [300, 301, 302]
    assert motion.largest_step(0.1, DT) < 0.01
    assert not unjudged_rows(TABLE, time).any()


@given(st.sampled_from(["star", "cube"]).flatmap(lambda kind: motions(make_model(kind))))
def test_drawn_motions_fit_their_model(motion: AnyMotion):
    model = STAR if motion.dimension == 2 else CUBE
    assert Scene(model=model, motion=motion).requirements.keys() >= {"moving"}


def test_a_hand_at_rest_in_the_world_goes_round_in_a_body_that_spins():
    path = Path(np.array([0.0, 1.0]), np.array([[0.1, 0.0], [0.1, 0.0]]))
    led = path_in_body(path, Spin(rate=1.0), 2.5e-4)
    assert np.linalg.norm(led.points, axis=1) == pytest.approx(0.1)
    assert led.sampled(DT)[1][250] == pytest.approx([0.0, -0.1])


MOVED = {"kind": "slide", "velocity": [0.1, 0.0]}


@pytest.mark.parametrize(
    "motion",
    [
        {"kind": "slide", "velocity": [0.1, float("nan")]},
        {"kind": "slide", "velocity": [0.1, 0.0, 0.0]},
        {"kind": "slide", "velocity": [250.0, 0.0]},
        {"kind": "spin", "rate": 170.0},
        {"kind": "spin", "rate": 1.0, "axis": [0.0, 0.0, 1.0]},
        {"kind": "swing", "amplitude": [0.1, 0.0], "hertz": 400.0},
        {"kind": "points", "poses": [row(0.0, 0.0, 0.0, 0.0), row(1e-3, 0.0, 0.2, 0.0)]},
        {"kind": "points", "poses": [row(0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0)]},
        {"kind": "points", "poses": [row(0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 1e-6, 0.0, 1.0, 0.0, 0.0)]},
        {"kind": "points", "poses": [row(0.0, 0.0, 0.0, 0.0), row(1.0, 0.0, float("inf"), 0.0)]},
    ],
)
def test_a_motion_that_makes_no_sense_is_refused_before_a_run(motion, refused):
    with refused(InputError):
        Scene(model=STAR, motion=convert(motion, AnyMotion, "motion"))


@pytest.mark.parametrize(
    "motion",
    [
        {"kind": "roll"},
        {"kind": "slide", "velocity": [0.1, 0.0], "frame": "hand"},
        {"kind": "spin", "rate": 1.0, "axis": [0.0, 0.0, 0.0]},
        {"kind": "spin", "rate": 1.0, "centre": [0.0, 0.0, 0.0]},
        {"kind": "swing", "amplitude": [0.1, 0.0], "hertz": 1.0, "across": [0.0, 0.0, 1.0]},
        {"kind": "points", "poses": [row(0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 0.0)]},
        {"kind": "points", "poses": [row(0.0, 0.0, 0.0, 0.0), row(0.0, 0.0, 0.1, 0.0)]},
        {"kind": "points", "poses": [row(0.0, 0.0, 0.0, 0.0), row(1.0, 0.0, 0.1, 0.0)], "jump_at": [0.5]},
    ],
)
def test_a_table_that_says_nothing_of_a_motion_is_refused(motion, refused):
    with refused(InputError):
        convert(motion, AnyMotion, "motion")
