"""The one lag of each channel is found, whole or between ticks, and who has none is said to have none."""

from __future__ import annotations

import numpy as np
import pytest
from force_only import Field
from honest import Spring, declaring
from hypothesis import given, settings
from hypothesis import strategies as st
from latecomers import LateTool, late
from made import recorded

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import circle, line, sphere
from hapticeval.phenomena.lag import Lag, delayed, force_only_lag, least_misfit, likely_force_lags
from hapticeval.phenomena.observed import Observed
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.reading import load_suite

DT = 1e-3
ROUND, PLANE, BALL = (Scene(model=model, stiffness=1000.0) for model in (circle(), line(), sphere()))


def slide(scene, depth=2e-3, duration=0.3):
    """From free space in, along the surface at a speed that changes, and out again."""
    t = np.linspace(0.0, 1.0, 60)
    under = depth * (1.0 - 2.0 * np.cos(np.pi * t) ** 6)
    along = 0.04 * (t + 0.3 * t**2)
    if scene is PLANE:
        points = np.column_stack([along, -under])
    else:
        angle = along / 0.1
        points = (0.1 - under)[:, np.newaxis] * np.column_stack([np.cos(angle), np.sin(angle)])
        if scene is BALL:
            points = np.column_stack([points, 0.02 * t])
    return Path(duration * t, points)


ticks = st.one_of(st.sampled_from([1.0, 2.0, 3.0]), st.floats(0.1, 3.0))
scenes = st.sampled_from([ROUND, PLANE, BALL])


def lag_of(make, scene):
    return Observed(play(make(scene), slide(scene), DT, scene=scene), scene).lag


@settings(max_examples=10)
@given(scene=scenes, lag=ticks)
def test_an_answer_that_is_late_is_found_so_late(scene, lag):
    seen = lag_of(late(ihip=lag, force=lag), scene)
    assert seen.ihip == pytest.approx(lag, abs=0.02)
    assert seen.force == pytest.approx(lag, abs=0.02)


@settings(max_examples=10)
@given(scene=scenes, lag=ticks)
def test_a_force_that_is_late_behind_the_tool_is_found_so_late(scene, lag):
    seen = lag_of(late(force=lag), scene)
    assert seen == pytest.approx(Lag(0.0, lag, lag), abs=0.02)
    assert seen.ihip == 0.0


@settings(max_examples=10)
@given(scene=scenes, lag=ticks)
def test_a_tool_that_is_late_under_a_force_that_is_not_is_found_so_late(scene, lag):
    seen = lag_of(late(kind=LateTool, ihip=lag), scene)
    assert seen == pytest.approx(Lag(lag, 0.0, 0.0), abs=0.02)
    assert (seen.force_hip, seen.force_ihip) == (0.0, 0.0)


@settings(max_examples=10)
@given(scene=scenes, lag=ticks)
def test_an_ihip_that_is_told_later_than_the_force_is_found_so_late(scene, lag):
    seen = lag_of(late(ihip=lag), scene)
    assert seen == pytest.approx(Lag(lag, 0.0, -lag), abs=0.02)
    assert seen.force == pytest.approx(0.0, abs=0.02)


RIGHT = ["minimum-distance", "constraint", "mapping", "constraint+square-root", "constraint+pp-d", "ideal"]


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.parametrize("scene", [ROUND, PLANE])
def test_who_is_not_late_has_exactly_no_lag(name, scene):
    assert lag_of(resolve(name), scene) == Lag(0.0, 0.0, 0.0)


@pytest.mark.parametrize("scene", [ROUND, PLANE, BALL])
def test_a_spring_has_exactly_no_lag_not_even_in_single_precision(scene):
    recording = play(Spring(scene), slide(scene), DT, scene=scene)
    rounded = [recording.channels[name].astype(np.float32).astype(float) for name in ("hip", "ihip", "force")]
    assert Observed(recording, scene).lag == Observed(recorded(*rounded, dt=DT), scene).lag == Lag(0.0, 0.0, 0.0)


def test_a_latency_that_changes_from_tick_to_tick_is_no_lag():
    recording = play(Spring(ROUND), slide(ROUND), DT, scene=ROUND)
    rows = np.arange(len(recording))
    changing = np.maximum(rows - np.random.default_rng(1).integers(0, 4, rows.size), 0)
    ihip = recording.ihip[changing]
    made = recorded(recording.hip, ihip, 1000.0 * (ihip - recording.hip), dt=DT)
    assert Observed(made, ROUND).lag == Lag(0.0, 0.0, 0.0)


@pytest.mark.parametrize("lag", [0, 1, 3])
def test_a_tool_that_is_late_in_free_space_is_found_so_late(lag):
    along = 1e-3 * np.arange(40)
    hip = np.column_stack([along + 1e-2 * np.sin(30.0 * along), np.full(40, 0.3) + along])
    made = recorded(hip, hip[np.maximum(np.arange(40) - lag, 0)], np.zeros_like(hip), dt=DT)
    assert Observed(made, ROUND).lag.ihip == pytest.approx(lag, abs=1e-3)


def test_a_channel_that_was_not_recorded_has_none():
    recording = play(Spring(ROUND), slide(ROUND), DT, scene=ROUND)
    for name in ("ihip", "force"):
        channels = {key: values for key, values in recording.channels.items() if key != name}
        assert Observed(type(recording)(recording.time, channels, recording.meta), ROUND).lag == Lag(0.0, 0.0, 0.0)


@settings(max_examples=30)
@given(st.floats(0.0, 3.0))
def test_the_least_misfit_is_found_between_ticks(lag):
    assert least_misfit(lambda tried: abs(tried - lag)) == pytest.approx(lag, abs=1e-8)


@pytest.mark.parametrize("lag", [0.25, 1.0, 1.75, 3.0])
def test_a_tool_deeper_than_a_hand_that_goes_straight_out_is_late_and_one_above_it_may_be_deep(lag):
    """In contact a depth is no misfit of an IHIP above the hand, and all of one below it is."""
    rows = np.arange(200)
    out = np.column_stack([np.zeros(200), -2e-2 + 2e-7 * rows**2])
    push = np.tile([0.0, 5.0], (200, 1))
    for hip, seen in ((out, lag), (out[::-1], 0.0)):
        assert Observed(recorded(hip, delayed(hip, rows, lag), push), PLANE).lag.ihip == pytest.approx(seen, abs=0.02)


def test_a_hand_inside_has_its_nearest_point_for_an_ihip_and_one_outside_itself():
    hip = np.column_stack([np.linspace(-0.01, 0.01, 7), np.linspace(0.02, -0.02, 7)])
    points = Observed(recorded(hip, hip), PLANE).with_nearest_points.ihip
    np.testing.assert_allclose(points, np.column_stack([hip[:, 0], np.maximum(hip[:, 1], 0.0)]), atol=1e-15)


@pytest.mark.parametrize(("ticks", "likely"), [(1.5, True), (3.0, True), (5.0, False)])
def test_a_force_later_than_three_ticks_has_no_likely_lag(ticks, likely):
    recording = play(Spring(ROUND), slide(ROUND), DT, scene=ROUND)
    rows = np.arange(len(recording))
    force = 1000.0 * (recording.ihip - delayed(recording.hip, rows, ticks))
    made = recorded(recording.hip, recording.ihip, force, dt=DT)
    lags = likely_force_lags(made, Observed(made, ROUND).pressed)
    assert any(lag == pytest.approx((ticks, 0.0), abs=1e-3) for lag in lags) is likely


class Steeper(Field):
    """A force that grows with the depth to the 1.5: no spring, linear or a root."""

    def force(self, depth, normal):
        return self.stiffness * 10.0 * depth**1.5 * normal


@pytest.mark.parametrize("kind", [Field, Steeper])
@pytest.mark.parametrize(("ticks", "lag"), [(0.0, 0), (0.4, 1), (2.0, 2), (3.0, 3)])
def test_the_lag_of_a_force_alone_is_that_at_which_a_spring_from_the_nearest_point_fits_best(kind, ticks, lag):
    case = load_suite("thesis").case("cassinian-loops")
    scene = case.build_scene()
    renderer = declaring(late(kind, force=ticks), force_only=True)(scene)
    recording = play(renderer, case.build_stimulus(scene, renderer), scene.sampling_time)
    base = Observed(recording, scene).with_nearest_points
    assert force_only_lag(base.recording, base.pressed) == lag
