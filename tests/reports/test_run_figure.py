"""The figure of runs in a file: its real size, fonts that journals take, every curve named, the paths in sight."""

import re

import numpy as np
import pytest
from reports_synthetic import jump_tick, lobe_recording, tip_recording, verdict

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.reports.canvas import colour_of, looks_of
from hapticeval.reports.plane import filled_part
from hapticeval.reports.plane import labels as label_groups
from hapticeval.reports.run_figure import RING, DrawnRun, Mark, clearest_coordinates, marks_of, run_figure


def two_runs(**evidence):
    recording = lobe_recording()
    outcomes = {"one": Outcome.FAIL, "two": Outcome.PASS}
    judged = [
        verdict("lobe", name, "continuous-contact", Finding(outcome, "", evidence=evidence))
        for name, outcome in outcomes.items()
    ]
    return [DrawnRun(each.renderer, recording, marks_of([each], recording), str(each.outcome)) for each in judged]


def texts(fig):
    return [text.get_text() for text in fig.legends[0].get_texts()]


@pytest.mark.parametrize("width", [0.088, 0.1778])
def test_a_pdf_has_its_real_size_and_truetype_fonts(tmp_path, width):
    fig = run_figure(two_runs(time=0.5), make_model("cassinian"), width=f"{1e3 * width}mm", height="10cm")
    fig.savefig(tmp_path / "fig.pdf")
    content = (tmp_path / "fig.pdf").read_bytes()
    assert re.search(rb"/CIDFontType2|/TrueType", content)
    assert b"/Type3" not in content
    box = [float(number) for number in re.search(rb"/MediaBox \[ ([^]]*)\]", content)[1].split()]
    assert box == pytest.approx([0.0, 0.0, width / 0.0254 * 72.0, 0.1 / 0.0254 * 72.0], abs=0.5)


def test_nothing_is_cut_off_and_nothing_overlaps_the_legend():
    runs = [DrawnRun(f"minimum-distance@polygon+pp-v-{number}", lobe_recording()) for number in range(5)]
    fig = run_figure(runs, make_model("cassinian"))
    fig.draw_without_rendering()
    inside = fig.bbox.padded(1.0)
    for axes in fig.axes:
        box = axes.get_tightbbox()
        assert inside.x0 <= box.x0
        assert inside.y0 <= box.y0
        assert box.x1 <= inside.x1
        assert box.y1 <= fig.legends[0].get_window_extent().y0 + 1.0
    plane = fig.axes[0]
    view, paper = np.ptp([plane.get_xlim(), plane.get_ylim()], axis=1), plane.get_window_extent().size
    assert view[0] / paper[0] == pytest.approx(view[1] / paper[1], rel=0.02), "a millimetre is as long both ways"


def test_the_legend_names_what_is_drawn_and_the_mark_stands_where_the_verdict_points():
    tick = jump_tick(lobe_recording())
    time = float(lobe_recording().time[tick])
    fig = run_figure(two_runs(time=time), make_model("cassinian"), mark_words="where it fails")
    assert texts(fig) == ["HIP", "IHIP, one (fail)", "IHIP, two (pass)", "where it fails"]
    plane, force = fig.axes
    rings = [line for line in plane.lines if line.get_markersize() >= RING]
    np.testing.assert_allclose([ring.get_xydata()[0] for ring in rings], 1e3 * lobe_recording().ihip[[tick]])
    assert [line.get_xdata()[0] for line in force.lines if line.get_xdata()[0] == line.get_xdata()[-1]] == [time]
    assert texts(run_figure(two_runs(), None, mark_words="where")) == texts(fig)[:3], (
        "no place is named, no mark is explained"
    )
    passing = two_runs(time=time)[1:]
    assert texts(run_figure(passing, None, mark_words="where")) == ["HIP", "IHIP, two (pass)"], (
        "there is nothing to look at"
    )


def test_a_renderer_looks_as_on_the_pages_of_its_report():
    looks = looks_of(["zero", "one", "two"])
    plane, force = run_figure(two_runs(), None, looks=looks).axes
    for axes, count in ((plane, 3), (force, 2)):
        curves = axes.lines[-2:] if axes is force else axes.lines[1:]
        assert len(axes.lines) == count
        for name, line in zip(("one", "two"), curves, strict=True):
            assert (line.get_color(), line.get_marker()) == (colour_of(looks[name].role), looks[name].marker)


def test_a_place_without_a_time_is_found_by_its_hip():
    recording = lobe_recording()
    run, passing = two_runs(hip=list(recording.hip[700]))
    assert [run.tick(mark) for mark in run.marks] == [700]
    assert passing.marks == two_runs(hip=[0.0])[0].marks == []


@pytest.mark.parametrize("options", [{"width": "10mm"}, {"height": "200cm"}, {"font_size": 1.0}])
def test_a_size_that_no_figure_can_have_is_refused(refused, options):
    with refused(InputError):
        run_figure(two_runs(), None, **options)


def in_space(hip, depth):
    return Recording(
        np.arange(len(hip)) * 1e-3, {"hip": hip, "ihip": hip + depth, "force": 1e3 * (0.0 * hip + depth)}, {}
    )


def test_paths_in_space_are_drawn_where_they_spread_and_never_edge_on():
    angle = np.linspace(0.0, 6.0, 200)
    circle = 0.1 * np.column_stack([np.cos(angle), 0.0 * angle, np.sin(angle)])
    assert clearest_coordinates([in_space(circle, [0.0, 0.01, 0.0])]) == (0, 2)
    # Seen along y₃, the HIP of a path along the diagonal would hide its IHIP.
    diagonal = np.linspace(0.0, 0.1, 200)[:, np.newaxis] * np.array([0.9, 1.0, 0.0])
    recording = in_space(diagonal, [0.0, 0.0, 0.01])
    assert clearest_coordinates([recording]) == (1, 2)
    fig = run_figure([DrawnRun("one", recording)], make_model("icosphere", subdivisions=1))
    assert fig.axes[0].get_xlabel() == "y₂ (mm), seen along y₁"
    assert fig.axes[0].get_ylabel() == "y₃ (mm)"


# A run that is alone.


def alone(recording, model=None, **options):
    return run_figure([DrawnRun("one", recording)], model, **options)


def key_words(fig):
    return [text.get_text() for axes in fig.axes if axes.get_legend() for text in axes.get_legend().get_texts()]


@pytest.mark.parametrize(("width", "beside"), [("88mm", False), ("180mm", True)])
def test_of_a_run_that_is_alone_the_components_and_the_motion_are_drawn(width, beside):
    led = alone(lobe_recording(), width=width)
    assert key_words(led) == ["|F|", "F₁", "F₂", "IHIP", "HIP"]
    assert [axes.get_ylabel() for axes in led.axes[1:]] == ["force (N)", "step a tick (mm)"]
    led.draw_without_rendering()
    plane, force = (axes.get_window_extent() for axes in led.axes[:2])
    assert bool(plane.x1 < force.x0) is beside
    assert bool(plane.y0 > force.y1) is not beside


def test_a_long_title_takes_lines_and_covers_nothing():
    """Of a hand that is pushed, whose motion is its depth."""
    fig = alone(tip_recording(), make_model("star"), title="a long title " * 20, width="180mm")
    assert [axes.get_ylabel() for axes in fig.axes[1:]] == ["force (N)", "depth (mm)"]
    fig.draw_without_rendering()
    [title] = fig.texts[:1] or [fig._suptitle]
    assert title.get_window_extent().x1 <= fig.bbox.x1
    assert title.get_window_extent().y0 >= fig.axes[0].get_window_extent().y1


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_shortest_recordings_and_still_hands_are_drawn(count, tmp_path):
    still = np.zeros((count, 2))
    channels = {"hip": still, "ihip": still, "force": still}
    recording = Recording(np.arange(count) * 1e-3, channels, {"source": "playback"})
    run = DrawnRun("one", recording, [Mark(0.0)])
    run_figure([run], make_model("circle")).savefig(tmp_path / "still.svg")
    assert "nan" not in (tmp_path / "still.svg").read_text().lower()


def test_no_line_leads_over_a_gap():
    time = np.concatenate([np.arange(900), 5000.0 + np.arange(900)]) * 1e-3
    hip = np.column_stack([np.sin(time), np.cos(time)])
    gap = alone(Recording(time, {"hip": hip, "ihip": hip + 0.1, "force": hip}, {"source": "replay"}))
    for axes in gap.axes:
        for line in (line for line in axes.lines if len(line.get_xdata()) >= 1800):
            x, y = np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
            assert np.isnan(x + y)[900], "a row that is no number between both parts"


def test_no_peak_of_a_single_tick_is_lost_of_a_long_recording(tmp_path):
    time = np.arange(60_000) * 1e-3
    noise = np.random.default_rng(1).normal(size=(time.size, 2))
    hip = np.column_stack([0.09 * np.cos(time), 0.09 * np.sin(time)]) + 1e-4 * noise
    force = 100.0 * hip + 0.1 * noise
    force[43_210] = [0.0, -1000.0]
    fig = alone(Recording(time, {"hip": hip, "ihip": 1.1 * hip, "force": force}), make_model("circle"))
    assert fig.axes[1].get_ylim()[0] < -1000.0
    fig.savefig(tmp_path / "long.svg")
    assert (tmp_path / "long.svg").stat().st_size < 2_000_000


def test_a_shallow_contact_is_seen_through_a_lens_and_a_small_part_beside_the_whole_model():
    angle = np.linspace(0.0, 0.1, 200)
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    channels = {"hip": 0.0999 * around, "ihip": 0.1 * around, "force": around}
    shallow = Recording(np.arange(200) * 1e-3, channels, {"source": "playback"})
    insets = alone(shallow, make_model("circle", size=0.2)).axes[0].child_axes
    assert len(insets) == 2
    assert [text.get_text() for inset in insets for text in inset.texts if text.get_text().startswith("×")]  # noqa: RUF001
    assert not alone(lobe_recording(), make_model("cassinian")).axes[0].child_axes


def test_marks_are_numbered_where_they_are_several_and_share_labels_where_they_meet():
    recording = lobe_recording()
    seen = [("a", "fail", {"time": 1.0}), ("b", "pass", {}), ("c", "inconclusive", {"time": 1}), ("d", "fail", {})]
    seen += [("e", "fail", {"time": None}), ("f", "fail", {"time": True}), ("g", "pass", {"time": 0.5})]
    judged = [verdict("c", "r", name, Finding(Outcome(out), "", evidence=each)) for name, out, each in seen]
    assert marks_of(judged, recording) == [Mark(1.0, 1), Mark(1.0, 2)]
    assert marks_of(judged[:1], recording) == [Mark(1.0)]
    places = [np.array([0.0]), np.array([5.0]), np.array([0.1])]
    assert [text for _, text in label_groups([1, 2, 3], places, 0.5)] == ["1,3", "2"]


# The model.


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
