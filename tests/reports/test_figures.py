"""The figures of runs: small, themed, the same for the same recording, and true to every sample that matters."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from reports_synthetic import jump_tick, lobe_recording, tip_recording, verdict

from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.reports.canvas import THEME
from hapticeval.reports.plane import filled_part, labels, samples_along_path
from hapticeval.reports.run_figure import Mark, figure_svg, marks_of


def words(svg):
    return [text.text for text in ET.fromstring(svg).iter("text")]


def test_the_same_recording_gives_the_same_small_themed_figure():
    recording = lobe_recording()
    marks = [Mark(1, float(recording.time[jump_tick(recording)]), True), Mark(2, 0.5, False)]
    svg, again = (
        figure_svg(recording, make_model("cassinian"), marks=marks, prefix="f3", title="a <b> & c") for _ in range(2)
    )
    assert svg == again
    assert len(svg.encode()) < 60_000
    assert ET.fromstring(svg).get("aria-label") == "a <b> & c"
    assert {"HIP", "IHIP", "F₁", "F₂", "|F|", "force (N)", "time (s)", "y₁ (mm)", "1"} <= set(words(svg))
    assert set(re.findall(r"var\(--fig-(\w+)\)", svg)) <= set(THEME)
    assert not re.findall(r"#[0-9a-f]{6}", svg), "the page gives every colour"


def test_the_label_of_the_plane_does_not_reach_into_the_legend_below(monkeypatch):
    figures = []
    monkeypatch.setattr("hapticeval.reports.run_figure.page_svg", lambda fig, **_: figures.append(measure(fig)) or "")

    def measure(fig):
        fig.draw_without_rendering()
        plane, force, _ = fig.axes
        return plane.xaxis.label.get_window_extent().y0 - force.get_legend().get_window_extent().y1

    figure_svg(tip_recording(), make_model("star"))
    assert figures[0] > 0.0


def test_ids_of_two_figures_do_not_collide_and_every_reference_is_met():
    one, two = (figure_svg(lobe_recording(), None, prefix=prefix) for prefix in ("f1", "f2"))
    ids = [set(re.findall(r' id="([^"]+)"', svg)) for svg in (one, two)]
    assert ids[0]
    assert not ids[0] & ids[1]
    for svg, known in zip((one, two), ids, strict=True):
        assert set(re.findall(r'[("]#([^")]+)[)"]', svg)) <= known
        assert svg.count(' id="') == len(known)


def test_a_closed_loop_shows_depth_and_playback_shows_steps():
    assert "IHIP, step a tick" in words(figure_svg(lobe_recording(), None))
    assert "|IHIP − HIP|" in words(figure_svg(tip_recording(), None))  # noqa: RUF001


@pytest.mark.parametrize("kind", ["cassinian", "star", "circle", "dumbbell", "line"])
def test_every_kind_of_model_is_drawn_solid_on_its_inside(kind):
    import shapely

    curve = make_model(kind).curve
    body = filled_part(make_model(kind), (-130.0, -110.0, 130.0, 110.0))
    grid = np.stack(np.meshgrid(np.linspace(-0.12, 0.12, 41), np.linspace(-0.1, 0.1, 37)), axis=-1).reshape(-1, 2)
    far = np.abs(curve.signed_distance(grid)) > 5e-4
    drawn = shapely.contains_xy(body, *(1e3 * grid[far]).T)
    np.testing.assert_array_equal(drawn, curve.contains(grid[far]))


def test_a_strong_zoom_still_follows_the_curve():
    import shapely

    curve = make_model("cassinian").curve
    x, y = 1e3 * curve.position(0.3)
    body = filled_part(make_model("cassinian"), (x - 0.5, y - 0.4, x + 0.5, y + 0.4))
    near = curve.position(np.linspace(0.298, 0.302, 50))
    distances = shapely.distance(shapely.points(1e3 * near), shapely.boundary(body))
    assert distances.max() < 0.005


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_shortest_recordings_and_still_hands_are_drawn(count):
    still = np.zeros((count, 2))
    recording = Recording(
        np.arange(count) * 1e-3, {"hip": still, "ihip": still, "force": still}, {"source": "playback"}
    )
    svg = figure_svg(recording, make_model("circle"), marks=[Mark(1, 0.0, True)])
    assert "HIP" in words(svg)
    assert "nan" not in svg.lower()


def test_a_recording_in_space_shows_three_force_components_and_its_shadow():
    points = np.column_stack([np.linspace(0, 0.1, 50)] * 3)
    recording = Recording(np.arange(50) * 1e-3, {"hip": points, "ihip": points + 0.001, "force": points}, {})
    assert {"F₃", "y₂ (mm), seen along y₁"} <= set(words(figure_svg(recording, None)))


def strokes(svg, role):
    """The paths that are stroked in the colour of a role."""
    return re.findall(rf'<path d="([^"]*)"[^>]*stroke: var\(--fig-{role}\)', svg)


def test_a_long_recording_stays_small_and_loses_no_peak_of_a_single_tick():
    time = np.arange(60_000) * 1e-3
    noise = np.random.default_rng(1).normal(size=(time.size, 2))
    hip = np.column_stack([0.09 * np.cos(time), 0.09 * np.sin(time)]) + 1e-4 * noise
    force = 100.0 * hip + 0.1 * noise
    force[43_210] = [0.0, -1000.0]
    svg = figure_svg(Recording(time, {"hip": hip, "ihip": 1.1 * hip, "force": force}), make_model("circle"))
    assert len(svg.encode()) < 250_000
    panel = figure_svg(Recording(time, {"hip": hip, "ihip": hip, "force": force}), None)
    heights = [float(number) for number in re.findall(r"-?[\d.]+", max(strokes(panel, "two"), key=len))][1::2]
    assert max(heights) - min(heights) > 27.0, "points from zero down to the spike, of 64 in the panel"


def test_no_line_leads_over_a_gap():
    time = np.concatenate([np.arange(900), 5000.0 + np.arange(900)]) * 1e-3
    hip = np.column_stack([np.sin(time), np.cos(time)])
    with_gap, without = (
        figure_svg(Recording(clock, {"hip": hip, "ihip": hip, "force": hip}, {"source": "replay"}), None)
        for clock in (time, np.arange(1800) * 1e-3)
    )
    moves = [
        [path.count("M") for role in ("one", "two", "hip") for path in strokes(svg, role) if path.count("L") > 6]
        for svg in (with_gap, without)
    ]
    assert set(moves[0]) == {2}
    assert set(moves[1]) == {1}


def test_samples_are_even_along_the_path_and_hold_the_evidence():
    recording = lobe_recording()
    tick = jump_tick(recording)
    chosen = samples_along_path(recording, 60, keep=[tick, 0])
    assert {0, tick - 1, tick, len(recording) - 1} <= set(chosen)
    assert 40 <= chosen.size <= 64
    assert np.all(np.diff(chosen) > 0)


def test_marks_are_numbered_and_share_labels_where_they_meet():
    given = [("a", "fail", {"time": 1.0}), ("b", "pass", {}), ("c", "pass", {"time": 1}), ("d", "pass", {"time": None})]
    given.append(("e", "pass", {"time": True}))
    marks = marks_of([verdict("c", "r", name, Finding(Outcome(out), "", evidence=seen)) for name, out, seen in given])
    assert marks == {"a": Mark(1, 1.0, True), "c": Mark(2, 1.0, False)}
    places = [np.array([0.0]), np.array([5.0]), np.array([0.1])]
    assert [text for _, text in labels([1, 2, 3], places, 0.5)] == ["1,3", "2"]
