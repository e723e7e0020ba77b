"""The figure for papers: real size, fonts that journals take, every curve named, and the plane that shows the paths."""

import re

import numpy as np
import pytest
from reports_synthetic import jump_tick, lobe_recording, verdict

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.reports.canvas import colour_of, looks_of
from hapticeval.reports.paper_figure import RING, PaperRun, clearest_coordinates, paper_figure


def two_runs(**evidence):
    recording = lobe_recording()
    outcomes = {"one": Outcome.FAIL, "two": Outcome.PASS}
    return [
        PaperRun(name, recording, verdict("lobe", name, "continuous-contact", Finding(outcome, "", evidence=evidence)))
        for name, outcome in outcomes.items()
    ]


def texts(fig):
    return [text.get_text() for text in fig.legends[0].get_texts()]


@pytest.mark.parametrize("width", [0.088, 0.1778])
def test_a_pdf_has_its_real_size_and_truetype_fonts(tmp_path, width):
    fig = paper_figure(two_runs(time=0.5), make_model("cassinian"), width=f"{1e3 * width}mm", height="10cm")
    fig.savefig(tmp_path / "fig.pdf")
    content = (tmp_path / "fig.pdf").read_bytes()
    assert re.search(rb"/CIDFontType2|/TrueType", content)
    assert b"/Type3" not in content
    box = [float(number) for number in re.search(rb"/MediaBox \[ ([^]]*)\]", content)[1].split()]
    assert box == pytest.approx([0.0, 0.0, width / 0.0254 * 72.0, 0.1 / 0.0254 * 72.0], abs=0.5)


def test_nothing_is_cut_off_and_nothing_overlaps_the_legend():
    runs = [PaperRun(f"minimum-distance@polygon+pp-v-{number}", lobe_recording()) for number in range(5)]
    fig = paper_figure(runs, make_model("cassinian"))
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
    fig = paper_figure(two_runs(time=time), make_model("cassinian"))
    assert texts(fig) == ["HIP", "IHIP, one (fail)", "IHIP, two (pass)", "where continuous-contact fails"]
    plane, force = fig.axes
    rings = [line for line in plane.lines if line.get_markersize() >= RING]
    np.testing.assert_allclose([ring.get_xydata()[0] for ring in rings], 1e3 * lobe_recording().ihip[[tick]])
    assert [line.get_xdata()[0] for line in force.lines if line.get_xdata()[0] == line.get_xdata()[-1]] == [time]
    assert texts(paper_figure(two_runs(), None)) == texts(fig)[:3], "no place is named, no mark is explained"
    passing = two_runs(time=time)[1:]
    assert texts(paper_figure(passing, None)) == ["HIP", "IHIP, two (pass)"], "there is nothing to look at"


def test_a_renderer_looks_as_on_the_pages_of_its_report():
    looks = looks_of(["zero", "one", "two"])
    plane, force = paper_figure(two_runs(), None, looks=looks).axes
    for axes, count in ((plane, 3), (force, 2)):
        curves = axes.lines[-2:] if axes is force else axes.lines[1:]
        assert len(axes.lines) == count
        for name, line in zip(("one", "two"), curves, strict=True):
            assert (line.get_color(), line.get_marker()) == (colour_of(looks[name].role), looks[name].marker)


def test_a_place_without_a_time_is_found_by_its_hip():
    recording = lobe_recording()
    assert two_runs(hip=list(recording.hip[700]))[0].tick == 700
    assert two_runs(hip=[0.0])[0].tick is None


@pytest.mark.parametrize("options", [{"width": "10mm"}, {"height": "200cm"}, {"font_size": 1.0}])
def test_a_size_that_no_figure_can_have_is_refused(refused, options):
    with refused(InputError):
        paper_figure(two_runs(), None, **options)


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
    fig = paper_figure([PaperRun("one", recording)], make_model("icosphere", subdivisions=1))
    assert fig.axes[0].get_xlabel() == "y₂ (mm), seen along y₁"
    assert fig.axes[0].get_ylabel() == "y₃ (mm)"
