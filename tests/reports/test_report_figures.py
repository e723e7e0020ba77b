import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hapticeval.reports.figures import extremes, figure_svg
from hapticeval.reports.marks import Mark, labels, marks_of
from hapticeval.reports.plane import along_path, solid
from hapticeval.reports.svg import THEME
from hypothesis import given, settings
from hypothesis import strategies as st
from reports_synthetic import jump_tick, lobe_recording, tip_recording

from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.recording import Recording


def words(svg):
    return [text.text for text in ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]


def test_the_same_recording_gives_the_same_small_figure():
    recording = lobe_recording()
    marks = [Mark(1, float(recording.time[jump_tick(recording)]), True)]
    svg = figure_svg(recording, make_model("cassinian"), marks=marks, prefix="f3", title="a <b> & c")
    assert svg == figure_svg(recording, make_model("cassinian"), marks=marks, prefix="f3", title="a <b> & c")
    assert len(svg.encode()) < 60_000
    assert ET.fromstring(svg).get("aria-label") == "a <b> & c"
    assert {"HIP", "IHIP", "F₁", "F₂", "|F|", "response force (N)", "time (s)", "y₁ (mm)", "1"} <= set(words(svg))


def test_ids_of_two_figures_do_not_collide_and_every_reference_is_met():
    one, two = (figure_svg(lobe_recording(), None, prefix=prefix) for prefix in ("f1", "f2"))
    ids = [set(re.findall(r' id="([^"]+)"', svg)) for svg in (one, two)]
    assert ids[0]
    assert not ids[0] & ids[1]
    for svg, known in zip((one, two), ids, strict=True):
        assert set(re.findall(r'[("]#([^")]+)[)"]', svg)) == known
        assert svg.count(' id="') == len(known)


def test_the_page_gives_every_colour():
    svg = figure_svg(tip_recording(), make_model("star"), marks=[Mark(1, 0.5, False)])
    assert set(re.findall(r"var\(--fig-(\w+)\)", svg)) <= set(THEME)
    assert not re.findall(r"#[0-9a-f]{6}", svg)


def test_a_closed_loop_shows_depth_and_playback_shows_steps():
    assert "step a tick" in words(figure_svg(lobe_recording(), None))
    assert "|IHIP − HIP|" in words(figure_svg(tip_recording(), None))  # noqa: RUF001


@pytest.mark.parametrize("kind", ["cassinian", "star", "circle", "dumbbell", "line"])
def test_every_kind_of_model_is_drawn_solid_on_its_inside(kind):
    import shapely

    curve = make_model(kind).curve
    view = (-130.0, -110.0, 130.0, 110.0)
    body = solid(make_model(kind), view)
    grid = np.stack(np.meshgrid(np.linspace(-0.12, 0.12, 41), np.linspace(-0.1, 0.1, 37)), axis=-1).reshape(-1, 2)
    far = np.abs(curve.signed_distance(grid)) > 5e-4
    drawn = shapely.contains_xy(body, *(1e3 * grid[far]).T)
    np.testing.assert_array_equal(drawn, curve.contains(grid[far]))


def test_a_strong_zoom_still_follows_the_curve():
    import shapely

    curve = make_model("cassinian").curve
    x, y = 1e3 * curve.position(0.3)
    body = solid(make_model("cassinian"), (x - 0.5, y - 0.4, x + 0.5, y + 0.4))
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


def test_a_recording_in_space_shows_three_force_components():
    points = np.column_stack([np.linspace(0, 0.1, 50)] * 3)
    recording = Recording(np.arange(50) * 1e-3, {"hip": points, "ihip": points + 0.001, "force": points}, {})
    assert "F₃" in words(figure_svg(recording, None))


def test_a_long_recording_stays_small():
    time = np.arange(60_000) * 1e-3
    noise = np.random.default_rng(1).normal(size=(time.size, 2))
    hip = np.column_stack([0.09 * np.cos(time), 0.09 * np.sin(time)]) + 1e-4 * noise
    recording = Recording(time, {"hip": hip, "ihip": 1.1 * hip, "force": 100.0 * hip + noise}, {"source": "playback"})
    assert len(figure_svg(recording, make_model("circle")).encode()) < 70_000


@settings(max_examples=40)
@given(count=st.integers(1, 5000), peak=st.integers(0, 4999), buckets=st.integers(1, 60))
def test_no_peak_of_a_single_tick_is_lost(count, peak, buckets):
    values = np.zeros(count)
    values[peak % count] = 1.0
    kept = extremes(values, buckets)
    assert values[kept].max() == 1.0
    assert kept[0] == 0
    assert kept[-1] == count - 1
    assert np.all(np.diff(kept) > 0)
    assert kept.size <= max(4 * buckets, 3 * buckets + 2)


def test_samples_are_even_along_the_path_and_hold_the_evidence():
    recording = lobe_recording()
    tick = jump_tick(recording)
    chosen = along_path(recording, 60, keep=[tick, 0])
    assert {0, tick - 1, tick, len(recording) - 1} <= set(chosen)
    assert 40 <= chosen.size <= 64
    assert np.all(np.diff(chosen) > 0)


def test_marks_are_numbered_and_share_labels_where_they_meet():
    verdicts = [
        {"check": "a", "outcome": "fail", "evidence": {"time": 1.0}},
        {"check": "b", "outcome": "pass", "evidence": {}},
        {"check": "c", "outcome": "pass", "evidence": {"time": 1}},
        {"check": "d", "outcome": "pass", "evidence": {"time": None}},
        {"check": "e", "outcome": "pass", "evidence": {"time": True}},
    ]
    marks = marks_of(verdicts)
    assert marks == {"a": Mark(1, 1.0, True), "c": Mark(2, 1.0, False)}
    places = [np.array([0.0]), np.array([5.0]), np.array([0.1])]
    assert [text for _, text in labels([1, 2, 3], places, 0.5)] == ["1,3", "2"]
