"""The charts of the sphere along a run, from what set stabilisation by an atlas records."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hapticeval.devices.catalogue import make_device
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.discovery import resolve
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.recording import Recording
from hapticeval.reports.atlas_figure import atlas_charts, charts_words, has_charts
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment, Hand, Path

SCENE = Scene(
    model=make_model("sphere", size=0.2), stiffness=20.0, damping=2.83, mass=0.1, effects=(Viscosity(0.3),),
    bilateral=True, device=make_device("parallelogram-3dof"), inner_loop=InnerLoop.LINEARISED,
)  # fmt: skip


@cache
def round_the_meridian(name):
    angle = np.linspace(0.0, np.pi, 50)
    around = 0.1 * np.column_stack([np.cos(angle), np.zeros(50), np.sin(angle)])
    hand = Hand(path=Path(0.2 * angle, around), stiffness=200.0, damping=5.0)
    start = np.array([0.1, 0.0, 0.0])
    experiment = Experiment(0.6, start, np.zeros(3), np.zeros(1), np.zeros((1, 3)), hand)
    return simulate_closed_loop(resolve(name)(SCENE), experiment, SCENE, 1e-3)


def test_the_charts_ask_for_the_torque_that_the_motors_gave():
    run = round_the_meridian("set-stabilisation@atlas")
    assert has_charts(run)
    chart = run.channels["chart"]
    assert set(chart) == {1.0, 2.0}
    asked = np.where(chart[:, None] == 1.0, run.channels["torque1"], run.channels["torque2"])
    np.testing.assert_allclose(asked, run.channels["joint_torque"], rtol=1e-9, atol=1e-12)


def test_the_coordinates_of_a_chart_are_those_of_its_definition():
    run = round_the_meridian("set-stabilisation@atlas")
    y = run.hip
    np.testing.assert_allclose(run.channels["eta1"][:, 0], np.arctan2(y[:, 1], y[:, 0]), atol=1e-12)
    np.testing.assert_allclose(run.channels["eta2"][:, 2], np.arccos(y[:, 0] / np.linalg.norm(y, axis=1)), atol=1e-7)


def test_the_charts_show_what_was_recorded_and_shade_where_a_chart_is_idle():
    run = round_the_meridian("set-stabilisation@atlas")
    charts = atlas_charts(run, SCENE.model)
    assert [chart.y.label for chart in charts] == ["distance (mm)", "chart 1 (°)", "chart 2 (°)", "torque 2 (N m)"]
    np.testing.assert_allclose(charts[0].curves[0].y, 1e3 * (np.linalg.norm(run.hip, axis=1) - 0.1), atol=1e-9)
    for number in (1, 2):
        middles = [0.5 * (begin + end) for begin, end in charts[number].shades]
        assert middles
        at_work = run.channels["chart"][np.searchsorted(run.time, middles)]
        assert set(at_work) == {3.0 - number}
    switches = np.count_nonzero(np.diff(run.channels["chart"]))
    assert {len(chart.rules) for chart in charts} == {switches}


def test_the_words_count_the_turns_and_say_where_torques_differ():
    run = round_the_meridian("set-stabilisation@atlas")
    turns = np.count_nonzero(np.diff(run.channels["chart"]))
    words = charts_words(run)
    assert words.startswith(f"The charts take turns {turns} time")
    assert "does not spike" in words
    spiking = run.channels["torque2"].copy()
    spiking[[200, 203]] += np.array([[0.0, 3.0, 0.0], [0.0, -7.5, 0.0]])
    words = charts_words(Recording(run.time, {**run.channels, "torque2": spiking}, run.meta, signals=run.signals))
    assert f"Not so in 2 of {len(run)} samples, between t = 0.2 and 0.203 s" in words
    assert "up to 7.5 N m apart" in words
    assert "does not spike" not in words


@pytest.mark.parametrize("name", ["set-stabilisation", "minimum-distance+pp-pd"])
def test_others_have_no_charts_to_show(name):
    assert not has_charts(round_the_meridian(name))
