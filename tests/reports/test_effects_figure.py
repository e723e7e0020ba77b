"""The report's section on effects: what its panels are drawn from, and the page with and without it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from made import recorded

from hapticeval.cli import main
from hapticeval.effects.catalogue import EFFECTS, make_effect
from hapticeval.effects.effect import Stage
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.reports.canvas import figure
from hapticeval.reports.chart import charts_data, draw_chart
from hapticeval.reports.effects_figure import PANELS, contact_stretches, effect_chart, sliding_motion, work_on_hand

NUMBERS = {
    "friction": {"mu_s": 0.5, "mu_k": 0.3},
    "viscous-friction": {"coefficient": 1.0},
    "lugre": {"mu_s": 0.5, "mu_k": 0.3, "stribeck": 0.01, "stiffness": 1e4, "damping": 1.0, "viscosity": 1.0},
    "height-map": {"wavelength": 1e-3, "amplitude": 1e-5},
    "bump-map": {"wavelength": 1e-3, "amplitude": 1e-5},
    "stochastic-texture": {"texture": "ribbed", "mass": 0.05},
    "contact-transient": {"material": "wood"},
    "recorded-impulse": {"pulse": [1.0, 2.0], "step": 1e-3},
}
"""What an effect needs, by kind."""

SUITE = """
title = "Rung"
[[case]]
name = "wood"
title = "A tap on wood"
model = { kind = "line" }
scene = { effects = [{ kind = "contact-transient", material = "wood" }] }
checks = ["contact-normal-force"]
trajectory = { kind = "points", duration = 0.2, points = [[0.0, 0.01], [0.0, -0.01]] }
"""


def rubbed(dimension=2, ratio=0.4):
    """A hand that goes 1 cm along a flat surface and back, 1 mm deep, with Coulomb friction."""
    way = np.concatenate([np.linspace(0.0, 0.01, 51), np.linspace(0.01, 0.0, 51)[1:]])
    sense = np.where(np.arange(way.size) <= 50, 1.0, -1.0)
    hip, force = np.zeros((2, way.size, dimension))
    hip[:, 0], hip[:, 1] = way, -1e-3
    force[:, 1], force[:, 0] = 1.0, -ratio * sense
    return recorded(hip, force=force)


def test_friction_is_a_loop_of_the_force_along_over_the_force_across():
    recording = rubbed()
    way, along, across = sliding_motion(recording, make_model("line"))
    np.testing.assert_allclose(way, recording.hip[:, 0], atol=1e-15)
    np.testing.assert_allclose(along, recording.force[:, 0])
    np.testing.assert_allclose(across, 1.0)


@pytest.mark.parametrize("kind", ["circle", "sphere"])
def test_the_way_along_a_round_surface_goes_round_it_and_back(kind):
    angle = 0.8 * np.sin(np.linspace(0.0, np.pi, 801))
    model = make_model(kind)
    hip = np.zeros((801, model.dimension))
    hip[:, 0], hip[:, 1] = 0.09 * np.cos(angle), 0.09 * np.sin(angle)
    way, _, across = sliding_motion(recorded(hip, force=hip), model)
    np.testing.assert_allclose(way, 0.09 * angle, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(across, 0.09)


def test_work_is_what_the_hand_gets():
    """Against 0.4 N over 2 cm; the tick at which the hand turns counts half for either sense."""
    assert work_on_hand(rubbed())[-1] == pytest.approx(-0.4 * 0.02, rel=2e-2)


def test_contacts_are_where_there_is_a_force():
    recording = rubbed()
    force = recording.force.copy()
    force[10:20] = 0.0
    assert contact_stretches(recorded(recording.hip, force=force)) == [(0, 10), (20, 101)]


@pytest.mark.parametrize("kind", PANELS)
def test_every_chart_is_data_of_finite_numbers_and_is_drawn_into_a_file_too(kind, tmp_path):
    """Of a short contact, and of one that is long enough for a spectrum."""
    once, effect = rubbed(), make_effect({"kind": kind, **NUMBERS.get(kind, {})})
    with figure(4.0, 6.0) as fig:
        for axes, laps in zip(fig.subplots(2), (1, 12), strict=True):
            recording = recorded(np.tile(once.hip, (laps, 1)), force=np.tile(once.force, (laps, 1)))
            chart = effect_chart(effect, recording, make_model("line"))
            [data] = json.loads(charts_data([chart]))
            assert len(data["curves"]) == len(chart.curves)
            for curve, drawn in zip(chart.curves, data["curves"], strict=True):
                np.testing.assert_allclose(np.array(drawn["y"], dtype=float), curve.y, rtol=1e-5, atol=1e-12)
            others = sum(len(part.get_lines()) for part in fig.axes)
            draw_chart(axes, chart)
            assert sum(len(part.get_lines()) for part in fig.axes) - others == len(chart.curves)
        fig.savefig(tmp_path / "chart.pdf")


def test_the_page_shows_effects_where_there_are_any(in_process, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rung.toml").write_text(SUITE)
    main(["run", "rung.toml", "-r", "minimum-distance", "-o", "results"])
    page = (tmp_path / "results" / "report" / "effects.html").read_text()
    assert '<section class="wide" id="effects">' in page
    assert "<b>contact-transient</b>" in page


def test_every_effect_of_the_surface_has_a_panel():
    """Of those that a check asks about: what there is to see of another is not known here."""
    asked = {kind for check in OWN_CHECKS.values() for kind in check.effects}
    assert set(PANELS) == {kind for kind in asked if EFFECTS[kind].of.stage is Stage.ANSWER}
