"""The figure that shows all renderers of a case: what it measures, and that it is drawn."""

from __future__ import annotations

import re

import numpy as np
import pytest

from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.recording import Recording
from hapticeval.reports.comparison import comparison_svg, surface_motion


def orbit(radius, speed, count=500, dt=1e-3):
    time = np.arange(count) * dt
    angle = speed / radius * time
    hip = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    velocity = speed * np.column_stack([-np.sin(angle), np.cos(angle)])
    foot = hip * (0.1 / radius)
    return Recording(time, {"hip": hip, "ihip": foot, "force": np.zeros_like(hip), "velocity": velocity})


@pytest.mark.parametrize("radius", [0.08, 0.1, 0.13])
def test_the_foot_of_an_orbit_moves_slower_outside_and_faster_inside(radius):
    distance, speed = surface_motion(orbit(radius, 0.5), make_model("circle", size=0.2))
    np.testing.assert_allclose(distance, radius - 0.1, atol=1e-12)
    np.testing.assert_allclose(speed, 0.5 * 0.1 / radius, rtol=1e-9)


def test_speed_in_space_is_that_of_the_foot_too():
    plane = orbit(0.12, 0.5)
    lifted = {name: np.column_stack([each, np.zeros(len(plane))]) for name, each in plane.channels.items()}
    distance, speed = surface_motion(Recording(plane.time, lifted), make_model("sphere", size=0.2))
    np.testing.assert_allclose(distance, 0.02, atol=1e-12)
    np.testing.assert_allclose(speed, 0.5 * 0.1 / 0.12, rtol=1e-9)


def test_every_renderer_has_its_curve_and_its_name_in_the_legend():
    runs = {"first": orbit(0.1, 0.5), "second": orbit(0.11, 0.5), "a third": orbit(0.105, 0.4)}
    svg = comparison_svg(runs, make_model("circle", size=0.2), prefix="c", title="three")
    assert svg.startswith("<svg")
    assert 'aria-label="three"' in svg
    assert all(name in svg for name in runs)


def test_a_run_that_leaves_does_not_shrink_the_others():
    runs = {"stays": orbit(0.1, 0.5), "also": orbit(0.101, 0.5), "leaves": orbit(50.0, 20.0)}
    svg = comparison_svg(runs, make_model("circle", size=0.2), prefix="c", title="t")
    shown = [float(each) for each in re.findall(r"(\d+(?:\.\d+)?)</text>", svg)]
    assert max(shown) < 1000.0


def test_what_set_stabilisation_leaves_is_seen_beside_millimetres():
    runs = {"near": orbit(0.1 + 2e-7, 0.5), "off": orbit(0.104, 0.5)}
    svg = comparison_svg(runs, make_model("circle", size=0.2), prefix="c", title="t")
    shown = re.findall(r"10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)</text>", svg)
    assert "⁻⁷" in shown
    assert "⁻³" in shown


def test_runs_in_space_are_drawn_by_their_shadow():
    angle = np.linspace(0.0, 6.0, 300)
    hip = 0.1 * np.column_stack([np.cos(angle), np.zeros(300), np.sin(angle)])
    run = Recording(np.arange(300) * 1e-3, {"hip": hip, "ihip": hip, "force": np.zeros_like(hip)})
    svg = comparison_svg({"one": run}, make_model("sphere", size=0.2), prefix="c", title="t")
    assert "y₁ (mm)" in svg
    assert "y₃ (mm)" in svg
    assert "seen along y₂" in svg
    assert "y₂ (mm)" not in svg
