"""The map of plates against borders that follow from what a renderer knows: its last tick, or the path."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.examples.studies import plates
from hapticeval.examples.studies.plates import (
    HELD_SHARE,
    RATIO,
    RUN_UP,
    THICKEST_PLATE,
    THINNEST_PLATE,
    approach,
    describe_border,
    find_thinnest,
    holds,
    main,
    plate_scene,
)
from hapticeval.renderers import constraint, minimum_distance
from hapticeval.scene import Scene


class SeesTicks:
    """A spring from the upper face, which begins where a tick has the hand inside of the plate, and ends above it."""

    supports = frozenset({"space"})

    def __init__(self, scene: Scene) -> None:
        self.stiffness, self.half = scene.stiffness, -float(scene.model.boundary.signed_distance(np.zeros((1, 3)))[0])

    def reset(self, hip):
        self.inside = False

    def step(self, hip, velocity, dt):
        self.inside = bool(hip[2] < self.half and (self.inside or hip[2] > -self.half))
        ihip = np.array([*hip[:2], self.half if self.inside else hip[2]])
        return ihip, self.stiffness * (ihip - hip)


@given(
    thickness=st.floats(THINNEST_PLATE, THICKEST_PLATE),
    speed=st.floats(0.05, 5.0),
    push=st.floats(0.5, 50.0),
    phase=st.floats(0.0, 1.0),
)
def test_the_hand_comes_straight_at_its_speed_and_rests_where_a_spring_gives_the_push(thickness, speed, push, phase):
    scene = plate_scene(thickness)
    path = approach(scene, thickness, speed, push, phase)
    steps = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    face = 0.5 * thickness
    assert path.points[0, 2] - face == pytest.approx(RUN_UP + phase * speed * scene.sampling_time)
    assert scene.stiffness * (face - path.points[-1, 2]) == pytest.approx(push)
    assert steps.max() <= speed * scene.sampling_time * (1.0 + 1e-9)
    assert np.ptp(path.points[-200:], axis=0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("push", [1.0, 3.0])
def test_the_nearest_point_holds_what_is_thicker_than_twice_the_hands_depth(push):
    border = 2.0 * push / 1000.0
    assert border < find_thinnest(minimum_distance, 1.0, push) <= RATIO * border


def test_the_nearest_point_holds_no_plate_that_the_hand_is_through():
    assert find_thinnest(minimum_distance, 1.0, 10.0) is None


def test_a_constraint_holds_the_thinnest():
    assert find_thinnest(constraint, 3.0, 30.0) == THINNEST_PLATE


@pytest.mark.parametrize("speed", [0.3, 3.0])
def test_who_knows_of_ticks_only_holds_what_no_tick_leaps(speed):
    case = plate_scene(THICKEST_PLATE)
    points = approach(case, THICKEST_PLATE, speed, 10.0, 0.0).points
    leap = points[0, 2] - points[1, 2]
    # Starts a quarter of a tick apart leave a quarter of the step in which a thinner plate may be met.
    assert 0.75 * leap <= find_thinnest(SeesTicks, speed, 10.0) <= RATIO * leap


def test_a_plate_is_held_where_half_of_the_push_comes_back():
    class Weak(SeesTicks):
        share = HELD_SHARE + 0.01

        def step(self, hip, velocity, dt):
            ihip, force = super().step(hip, velocity, dt)
            return ihip, self.share * force

    assert holds(Weak, 5e-3, 0.1, 1.0)
    Weak.share = HELD_SHARE - 0.01
    assert not holds(Weak, 5e-3, 0.1, 1.0)


def test_a_border_in_words():
    assert describe_border(None) == "no plate up to 10 mm is held"
    assert describe_border(THINNEST_PLATE) == "a plate of 0.1 mm is held, the thinnest tried"
    assert describe_border(2.034e-3) == "plates of 2.03 mm and more are held"


def test_the_command_says_the_number_and_draws_the_map(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(plates, "HAND_SPEEDS", (0.3, 1.0))
    monkeypatch.setattr(plates, "HAND_PUSHES", (1.0, 10.0))
    assert main(["-r", "minimum-distance", "-r", "constraint", "-o", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "at 1 m/s and 10 N no plate up to 10 mm is held" in out
    document = json.loads((tmp_path / "plates-minimum-distance-constraint.json").read_text())
    borders = document["renderers"]["minimum-distance"]
    assert [border["thinnest"] is None for border in borders] == [False, False, True, True]
    svg = (tmp_path / "plates-minimum-distance-constraint.svg").read_text()
    assert "thinnest plate held (mm)" in svg
    assert main([]) == 2
    assert "no renderer is named" in capsys.readouterr().err
