"""The page of a case: what of its runs it holds, its figures, its verdicts and their places, the data of its script."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from reports_synthetic import HOSTILE, jump_tick, lobe_recording, synthetic_run, tip_recording, verdict, verdicts
from result_entries import SCENE, changed, run_entry

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.recordings.recording import OWN_TOOL, Recording
from hapticeval.reports import case_data, thinning, write_reports
from hapticeval.reports.canvas import looks_of
from hapticeval.reports.case_data import (
    EYE_AXES,
    case_panels,
    case_text,
    contact_events,
    drawable_recording,
    floats,
    model_document,
    sample_tracks,
    surface_motion,
)
from hapticeval.reports.case_page import (
    CASE_ASSETS,
    CheckSection,
    asset,
    case_section,
    differing_renderers,
    write_assets,
    write_case_page,
    write_view,
)
from hapticeval.reports.plane import solid_mesh
from hapticeval.reports.templates import case_file, environment, evidence_words
from hapticeval.reports.thinning import jump_rows, step_lengths, thinned_rows
from hapticeval.runner.results import Measure, Problem, Refusal

# What of a run is kept, and how it is packed.


def numbers(text, count=1, kind="<f4"):
    """What the page's script reads of a text of `floats`."""
    return np.frombuffer(base64.b64decode(text), dtype=kind).reshape(-1, count)


@given(
    arrays(
        np.float64,
        st.tuples(st.integers(1, 40), st.integers(1, 3)),
        elements=st.floats(-1e3, 1e3).filter(lambda value: value == 0.0 or abs(value) > 1e-30),
    )
)
def test_numbers_are_written_row_by_row_to_seven_digits(values):
    np.testing.assert_allclose(numbers(floats(values), values.shape[1]), values, rtol=1e-7)
    np.testing.assert_array_equal(numbers(floats(values, double=True), values.shape[1], "<f8"), values)


def test_of_a_long_run_ends_jump_extremes_and_places_of_verdicts_are_kept_exactly():
    recording = lobe_recording()
    tick = jump_tick(recording)
    rows = thinned_rows([recording], [7, 1234], 300)
    assert {0, len(recording) - 1, tick - 1, tick, 6, 7, 8, 1233, 1234} <= set(rows.tolist())
    for signal in (np.linalg.norm(recording.force, axis=1), np.linalg.norm(recording.ihip - recording.hip, axis=1)):
        assert signal[rows].max() == signal.max()
        assert signal[rows].min() == signal.min()
    assert rows.size <= 400
    assert np.all(np.diff(rows) > 0)
    assert jump_rows(recording).tolist() == [tick]


@given(st.lists(st.integers(2, 1995), min_size=1, max_size=12, unique=True), st.integers(0, 2**32 - 1))
def test_no_jump_is_lost_wherever_it_is(where, seed):
    where = sorted({10 * (row // 10) + 3 for row in where if row > 10})
    hip = np.column_stack([np.linspace(0.0, 0.1, 2000), np.zeros(2000)])
    ihip = hip.copy()
    rng = np.random.default_rng(seed)
    for row in where:
        ihip[row:] += rng.choice([-1.0, 1.0]) * rng.uniform(1e-3, 1e-2)
    run = Recording(np.arange(2000) * 1e-3, {"hip": hip, "ihip": ihip, "force": ihip - hip}, {"source": "playback"})
    assert jump_rows(run).tolist() == where
    assert {row + side for row in where for side in (-1, 0)} <= set(thinned_rows([run], [], 200).tolist())


def test_lines_between_the_samples_are_as_good_as_the_rest():
    time = np.arange(6000) * 1e-3
    hip = np.column_stack([np.cos(time), np.sin(3.0 * time)]) * 0.1
    run = Recording(time, {"hip": hip, "ihip": 1.1 * hip, "force": 100.0 * hip}, {"source": "playback"})
    rows = thinned_rows([run], [])
    assert rows.size < 500
    for channel in ("hip", "force"):
        values = run.channels[channel]
        lines = np.column_stack([np.interp(time, time[rows], column[rows]) for column in values.T])
        assert np.abs(lines - values).max() <= thinning.CHANNEL_TOLERANCE * np.ptp(values, axis=0).max()


def test_of_laps_that_samples_cannot_follow_both_ends_are_drawn_and_no_line_leads_across():
    turn = 2.0 * np.pi * np.arange(40_000) / 500.0
    hip = 0.1 * np.column_stack([np.cos(turn), np.sin(turn)])
    run = Recording(np.arange(40_000) * 1e-3, {"hip": hip, "ihip": hip, "force": 0.0 * hip}, {"source": "playback"})
    (track,) = sample_tracks({"r": run}, {"r": [20.0]})
    assert len(track.time) < 1100
    first, last = track.left_out
    assert first > 0.9
    assert last < 39.1
    between = (track.time > first) & (track.time < last)
    assert track.time[between] == pytest.approx([19.999, 20.0, 20.001])
    bounds = [0, *track.starts, len(track.time)]
    assert [b - a for a, b in pairwise(bounds)][1] == 3, "the place of the verdict stands alone"
    for a, b in pairwise(bounds):
        middle = 0.5 * (track.hip[a : b - 1] + track.hip[a + 1 : b])
        assert np.abs(np.linalg.norm(middle, axis=1) - 0.1).max() < 0.001, "lines lie on the circle"


def test_round_a_fault_each_tick_is_drawn_for_the_close_up():
    turn = 2.0 * np.pi * np.arange(6000) / 6000.0
    hip = 0.1 * np.column_stack([np.cos(turn), np.sin(turn)])
    run = Recording(np.arange(6000) * 1e-3, {"hip": hip, "ihip": hip, "force": 0.0 * hip}, {"source": "playback"})
    for faults in ((), [3.0]):
        (track,) = sample_tracks({"r": run}, {"r": [1.0, 3.0]}, faults=faults)
        counts = [np.sum(np.abs(track.time - at) < 0.0205) for at in (1.0, 3.0)]
        assert counts[0] < 10
        assert (counts[1] == 2 * case_data.CLOSE_TICKS + 1) == bool(faults)
    assert f"CLOSE_TICKS = {case_data.CLOSE_TICKS};" in asset("draw.js").decode()


def test_between_jumps_the_steps_are_as_small_as_they_were():
    recording = lobe_recording()
    step = step_lengths(recording, recording.ihip)
    rows = thinned_rows([recording], [], 300)
    lines = np.interp(recording.time, recording.time[rows], step[rows])
    assert np.abs(lines - step).max() <= thinning.CHANNEL_TOLERANCE * np.ptp(step)


def test_runs_along_one_path_share_its_samples_and_their_place_in_the_data():
    plain = lobe_recording()
    other = Recording(plain.time, {**plain.channels, "ihip": plain.hip, "force": 0.0 * plain.hip}, plain.meta)
    alone = Recording(plain.time + 5.0, plain.channels, plain.meta)
    found = sample_tracks({"a": plain, "b": other, "c": alone}, {"b": [0.777]})
    assert np.array_equal(found[0].time, found[1].time)
    assert plain.time[777] in found[0].time
    document = case_data.tracks_document(found)
    assert [run["path"] for run in document["runs"]] == [0, 0, 1]
    for run, track in zip(document["runs"], found, strict=True):
        path = document["paths"][run["path"]]
        np.testing.assert_array_equal(numbers(path["time"], 1, "<f8")[:, 0], track.time)
        np.testing.assert_allclose(numbers(path["hip"], 2), track.hip, rtol=1e-7)


def test_a_shallow_contact_is_held_finer_than_its_depth():
    hip = np.column_stack([np.linspace(-0.05, 0.05, 50), np.full(50, -1e-8)])
    ihip = hip * [1.0, 0.0]
    [track] = sample_tracks({"r": Recording(np.arange(50) * 1e-3, {"hip": hip, "ihip": ihip, "force": ihip - hip})}, {})
    document = case_data.tracks_document([track])
    np.testing.assert_allclose(numbers(document["paths"][0]["hip"], 2)[:, 1], -1e-8, rtol=1e-6)
    np.testing.assert_allclose(numbers(document["runs"][0]["apart"], 2)[:, 1], 1e-8, rtol=1e-6)


def test_gaps_and_rows_that_are_no_measurement_part_a_run():
    time = np.concatenate([np.arange(30), 100 + np.arange(30)]) * 1e-3
    hip = np.column_stack([time, time])
    valid = np.ones(60, dtype=bool)
    valid[10:20] = False
    [track] = sample_tracks({"r": drawable_recording(Recording(time, {"hip": hip, "ihip": hip}, valid=valid))}, {})
    assert track.starts.tolist() == [10, 20]
    assert track.time[10] == pytest.approx(0.02)
    assert track.force is None


def test_contacts_begin_and_end_and_fast_ones_in_a_loop_are_impacts():
    height = np.array([3.0, 2.0, -1.0, -2.0, 1.0, 2.0, 1.001, -0.001, -0.002, 0.5])[:, np.newaxis] * [0.0, 1e-3]
    ihip = np.maximum(height, 0.0)
    channels = {"hip": height, "ihip": ihip, "force": 1e3 * (ihip - height)}
    time = np.arange(10) * 0.04
    run = Recording(time, channels, {"source": "experiment", "dt": 0.04})
    expected = [(0.08, "impact"), (0.16, "release"), (0.28, "impact"), (0.36, "release")]
    assert contact_events(run) == [(pytest.approx(at), kind) for at, kind in expected]
    slow = Recording(10.0 * time, channels, {"source": "experiment", "dt": 0.4})
    assert [kind for _, kind in contact_events(slow)] == ["contact", "release"] * 2, "7.5 and 2.5 mm/s"
    led = Recording(time, channels, {"source": "playback", "dt": 0.04})
    assert [kind for _, kind in contact_events(led)] == ["contact", "release"] * 2
    force = Recording(time, {"hip": height, "force": channels["force"]}, {"source": "experiment", "dt": 0.04})
    assert contact_events(force) == contact_events(run)
    assert contact_events(Recording(time, {"hip": height})) == []


def outcomes(**by_renderer):
    """Verdicts of checks a, b, ... by renderer: P passes, F fails."""
    return [
        verdict("x", name, check, Finding(Outcome.PASS if letter == "P" else Outcome.FAIL, ""))
        for name, letters in by_renderer.items()
        for check, letter in zip("abcd", letters, strict=False)
    ]


@pytest.mark.parametrize(
    ("given", "worst", "shown"),
    [
        ({"r": "PP", "s": "PP", "t": "PP", "u": "FP", "v": "PF"}, "u", ["u", "v", "r"]),
        ({"r": "PPP", "s": "FFP", "t": "PPF", "u": "PPP"}, "s", ["s", "t", "r"]),
        ({"r": "PP", "s": "PP", "t": "PP", "u": "PP"}, None, ["r", "s"]),
        ({"r": "P", "s": "P", "t": "F"}, "t", ["r", "s", "t"]),
    ],
)
def test_a_page_shows_the_renderers_first_that_differ(given, worst, shown):
    judged = outcomes(**given)
    chosen = next((entry for entry in judged if entry.renderer == worst), None)
    assert list(differing_renderers(judged, list(given), chosen)) == shown


def test_a_recording_of_one_dimension_is_shown_before_its_wall():
    along = np.linspace(0.01, -0.002, 40)[:, None]
    run = drawable_recording(
        Recording(np.arange(40) * 1e-3, {"hip": along, "ihip": np.maximum(along, 0.0), "force": -along})
    )
    [track] = sample_tracks({"r": run}, {})
    assert track.hip.shape == (40, 2)
    shown = case_panels([track])
    assert [each.label for each in shown] == ["place (mm)", "force (N)", "depth (mm)"]


def test_steps_of_an_even_motion_do_not_begin_with_a_ramp():
    time = np.delete(np.arange(400), np.arange(200, 300)) * 1e-3
    hip = np.column_stack([0.02 * time, 0.0 * time])
    [track] = sample_tracks({"r": Recording(time, {"hip": hip, "ihip": hip, "force": 0.0 * hip})}, {})
    # m: 0.02 m/s at 1 kHz, also at the beginning and after the gap.
    assert np.allclose(track.hip_step, 2e-5)
    assert np.allclose(track.step, 2e-5)
    assert track.starts.size == 1


def orbit(radius, speed, count=500, dt=1e-3):
    time = np.arange(count) * dt
    angle = speed / radius * time
    hip = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    velocity = speed * np.column_stack([-np.sin(angle), np.cos(angle)])
    foot = hip * (0.1 / radius)
    return Recording(time, {"hip": hip, "ihip": foot, "force": np.zeros_like(hip), "velocity": velocity})


@pytest.mark.parametrize("radius", [0.08, 0.1, 0.13])
def test_the_foot_of_an_orbit_moves_slower_outside_and_faster_inside(radius):
    plane = orbit(radius, 0.5)
    distance, speed = surface_motion(plane, make_model("circle", size=0.2))
    np.testing.assert_allclose(distance, radius - 0.1, atol=1e-12)
    np.testing.assert_allclose(speed, 0.5 * 0.1 / radius, rtol=1e-9)
    lifted = {name: np.column_stack([each, np.zeros(len(plane))]) for name, each in plane.channels.items()}
    distance, speed = surface_motion(Recording(plane.time, lifted), make_model("sphere", size=0.2))
    np.testing.assert_allclose(distance, radius - 0.1, atol=1e-12)
    np.testing.assert_allclose(speed, 0.5 * 0.1 / radius, rtol=1e-9)


# Models.


@pytest.mark.parametrize("kind", ["sphere", "ellipsoid", "torus", "icosphere", "box"])
def test_a_solid_becomes_closed_triangles_that_face_outwards(kind):
    model = make_model(kind)
    vertices, rows = solid_mesh(model).vertices, solid_mesh(model).triangles
    corners = vertices[rows]
    volume = np.sum(np.cross(corners[:, 0], corners[:, 1]) * corners[:, 2]) / 6.0
    assert volume > 0.0
    ends = np.sort(np.concatenate([rows[:, [0, 1]], rows[:, [1, 2]], rows[:, [2, 0]]]), axis=1)
    assert np.all(np.unique(ends, axis=0, return_counts=True)[1] == 2)
    assert np.abs(model.boundary.signed_distance(corners.mean(axis=1))).max() < 0.004 * model.size


def test_the_eye_turns_and_does_not_stretch():
    np.testing.assert_allclose(EYE_AXES @ EYE_AXES.T, np.eye(3), atol=2e-3)
    assert np.linalg.det(EYE_AXES) > 0.0


@pytest.mark.parametrize("kind", ["circle", "star", "line"])
def test_the_outline_of_a_model_lies_on_it(kind):
    model = make_model(kind)
    hip = np.column_stack([np.linspace(-0.05, 0.05, 20), np.full(20, -0.001)])
    [track] = sample_tracks({"r": Recording(np.arange(20) * 1e-3, {"hip": hip, "ihip": hip})}, {})
    outline = numbers(model_document(model, [track])["rings"][0], 2)
    if model.boundary.closed:
        assert np.abs(model.boundary.signed_distance(outline)).max() < 1e-4
    else:
        assert np.abs(outline[:, 1]).min() < 1e-9


# What the script draws.


def test_no_two_of_many_renderers_look_alike():
    looks = list(looks_of(map(str, range(49))).values())
    assert len({(look.role, look.marker) for look in looks}) == 49
    for one, two in pairwise(looks):
        assert one.role != two.role
        assert one.dash != two.dash
        assert one.marker != two.marker


def test_of_tools_on_a_surface_the_script_gets_the_distance_and_the_speed_and_its_powers_of_ten():
    model = make_model("circle", size=0.2)
    runs = {"near": orbit(0.1 + 2e-7, 0.5), "off": orbit(0.104, 0.5), "leaves": orbit(50.0, 20.0)}
    tracks = sample_tracks({name: drawable_recording(run) for name, run in runs.items()}, {}, held_on=model)
    document = json.loads(case_text("three", tracks, model, looks_of(runs)))
    assert [panel["label"] for panel in document["panels"]] == [
        "force (N)", "off the surface (mm)", "the same, size (mm)", "speed along it (m/s)"
    ]  # fmt: skip
    low, high = document["panels"][2]["range"]
    assert low <= 2e-4, "the nearest, 0.2 um off, is not below the panel"
    assert high >= 49_900.0
    for run, radius in zip(document["runs"], (0.1 + 2e-7, 0.104, 50.0), strict=True):
        np.testing.assert_allclose(numbers(run["off"]), radius - 0.1, rtol=1e-6)
    assert {run["role"] for run in document["runs"]} == {look.role for look in looks_of(runs).values()}


def test_a_model_that_all_refuse_is_drawn_whole_without_a_run():
    document = json.loads(case_text("refused", [], make_model("star"), {}, crosses={"r": [0.0, 0.1]}))
    assert document["runs"] == document["panels"] == []
    outline = numbers(document["model"]["rings"][0], 2)
    assert np.ptp(outline, axis=0).max() > 0.15
    assert np.abs(make_model("star").boundary.signed_distance(outline)).max() < 1e-4


# The page.


class Page(HTMLParser):
    """What a test asks of a page: ids, links, and that elements are closed."""

    VOID = ("meta", "link", "input", "br", "path", "use", "circle", "rect")
    IMPLIED = ("p", "li", "tr", "th", "td")
    """Elements whose end HTML knows by what follows."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.open = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, given):
        at = dict(given)
        self.ids += [at["id"]] if "id" in at else []
        self.links += [at["href"]] if tag == "a" else []
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            while self.open[-1] != tag:
                assert self.open.pop() in self.IMPLIED
            self.open.pop()


def section(entries, recordings, given, **more):
    by_renderer = {}
    for each in given:
        by_renderer.setdefault(each.renderer, []).append(each)
    return case_section(entries, recordings, verdicts=by_renderer, **more)


def test_a_page_has_every_verdict_at_its_anchor_with_a_link_to_its_time():
    recording = lobe_recording()
    time = float(recording.time[jump_tick(recording)])
    text = section(
        [synthetic_run("lobe", "plain", "cassinian")], {"plain": recording}, verdicts("lobe", "plain", recording)
    )
    page = Page(text)
    assert not page.open
    assert len(page.ids) == len(set(page.ids))
    for check in ("continuous-contact", "contact-normal-force", "impulsive-collision"):
        assert f"plain/{check}" in page.ids
    assert f"data-time={time:.12g} data-mark=1>" in text
    assert "pop-through &lt;here&gt;" in text
    document = json.loads(re.search(r'class="case-data">(.*?)</script>', text)[1])
    times = numbers(document["paths"][0]["time"], 1, "<f8")[:, 0]
    assert np.abs(times - time).min() == 0.0
    steps = numbers(document["runs"][0]["step"])[:, 0]
    assert steps[np.argmin(np.abs(times - time))] == pytest.approx(steps.max())


@pytest.mark.parametrize("own", [True, False])
def test_a_page_says_whose_hand_is_no_hand_that_is_led_but_a_tool_of_its_own(own):
    recording = lobe_recording()
    drawn = Recording(recording.time, recording.channels, {**recording.meta, **({OWN_TOOL: True} if own else {})})
    text = section([synthetic_run("lobe", "rigid", "cassinian")], {"rigid": drawn}, [])
    assert ("rigid has a tool of its own" in text) is own


def test_hostile_names_end_no_element_and_reach_no_attribute():
    text = section(
        [synthetic_run("tip", HOSTILE, "star")], {HOSTILE: tip_recording()}, verdicts("tip", HOSTILE, tip_recording())
    )
    assert "<script>alert" not in text
    assert text.count("<script") == text.count("</script>") == 1
    assert not Page(text).open


def test_a_run_without_recording_a_refusal_and_an_error_are_described():
    entries = [
        run_entry(renderer="lost"),
        run_entry(
            renderer="refuses",
            refusal=Refusal(what="no corners", why="they are sharp", todo="smooth", position=[0.1, 0.0]),
        ),
    ]
    text = section(entries, {"lost": "the file is damaged"}, [])
    assert "the file is damaged" in text
    assert "refuses this model: no corners" in text
    assert "The cross marks the place" in text
    assert "No check gave a verdict" in text
    assert "case-data" not in text
    assert json.loads(re.search(r'still refused"><script[^>]*>(.*?)</script>', text)[1])["crosses"] == {
        "refuses": [0.1, 0.0]
    }


def test_of_a_run_that_broke_in_one_checks_sibling_the_other_verdicts_and_the_paths_are_shown():
    broke = Problem(what="step() raised", why="no way back", todo="mend it")
    judged = verdicts("lobe", "plain", lobe_recording())
    lost = verdict("lobe", "plain", "drift", Finding(Outcome.ERROR, "step() raised; no way back"))
    run = synthetic_run("lobe", "plain", "cassinian", error=broke)
    text = section([run], {"plain": lobe_recording()}, [*judged, lost])
    assert "Not judged for it: <span" in text
    assert text.partition("Not judged for it:")[2].partition("</p>")[0].count("<span") == 1
    assert {f"plain/{entry.check}" for entry in [*judged, lost]} <= set(Page(text).ids)
    assert "pop-through &lt;here&gt;" in text
    assert "case-data" in text


def test_verdicts_that_say_the_same_share_a_row_and_what_fails_comes_first():
    nothing = Finding(Outcome.NOT_APPLICABLE, "there is no corner")
    bad = Finding(Outcome.FAIL, "it jumps", Metric("jump", 1.0, "m"), 0.1)
    given = [verdict("lobe", name, "broken-contact", nothing, suite="s") for name in ("a", "b")]
    given += [verdict("lobe", "a", "continuous-contact", bad, suite="s")]
    text = section([run_entry(renderer="a", case="lobe"), run_entry(renderer="b", case="lobe")], {}, given)
    assert text.index("it jumps") < text.index("there is no corner")
    assert text.count("there is no corner") == 1
    assert {"a/broken-contact", "b/broken-contact"} <= set(Page(text).ids)


def test_pages_and_what_they_share_are_written_and_nothing_is_asked_of_a_network(tmp_path):
    write_case_page(
        tmp_path, [synthetic_run("lobe", "plain", "cassinian")], {"plain": lobe_recording()},
        verdicts={"plain": verdicts("lobe", "plain", lobe_recording())},
    )  # fmt: skip
    write_assets(tmp_path)
    path = tmp_path / case_file("synthetic", "lobe")
    text = path.read_text(encoding="utf-8")
    links = re.findall(r'(?:src|href)="([^"#]+)"', text)
    assert len(links) == len(CASE_ASSETS)
    for link in links:
        assert (path.parent / link).resolve().is_file()
    assert "http" not in text
    assert sum(each.stat().st_size for each in (tmp_path / "assets").iterdir()) < 150_000


def test_without_script_a_page_names_the_command_that_draws(folder):
    write_reports(folder, workers=0)
    page = (folder / "report" / case_file("synthetic", "lobe")).read_text(encoding="utf-8")
    [sentence] = re.findall(r"<noscript>(.*?)</noscript>", page)
    assert "<code>hapticeval figure synthetic/lobe --from .</code>" in sentence
    assert "<noscript>" in (folder / "report" / "index.html").read_text(encoding="utf-8")


def test_a_view_is_never_written_over_other_files(refused, tmp_path):
    entry = changed(run_entry(model={"kind": "unknown"}), scene=SCENE, judged=False)
    runs = {entry.renderer: tip_recording()}
    page = write_view(tmp_path / "view", [entry], runs, verdicts={}, note="Not judged.")
    assert "Not judged." in page.read_text(encoding="utf-8")
    write_view(tmp_path / "view", [entry], runs, verdicts={})
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with refused(InputError):
        write_view(tmp_path / "mine", [entry], runs, verdicts={})


def test_a_site_or_a_report_is_no_earlier_view(folder, tmp_path):
    entry = changed(run_entry(model={"kind": "unknown"}), scene=SCENE, judged=False)
    runs = {entry.renderer: tip_recording()}
    write_reports(folder, workers=0)
    case_page = next((folder / "report" / "cases").rglob("*.html")).parent
    (tmp_path / "site" / "assets").mkdir(parents=True)
    (tmp_path / "site" / "index.html").write_bytes(b"<html>caf\xe9")
    (tmp_path / "file").touch()
    for place in (folder / "report", case_page, tmp_path / "site", tmp_path / "file"):
        before = {file: file.read_bytes() for file in place.rglob("*") if file.is_file()}
        with pytest.raises(InputError):
            write_view(place, [entry], runs, verdicts={})
        assert {file: file.read_bytes() for file in place.rglob("*") if file.is_file()} == before


@pytest.mark.parametrize(
    ("name", "words_"),
    [
        ("foot_speed_at_end_m_s", "foot speed at end (m/s)"),
        ("apparent_stiffness_N_m", "apparent stiffness (N/m)"),
        ("impulse_Ns", "impulse (N s)"),
        ("rms_m_s2", "rms (m/s²)"),
        ("ihip_before", "IHIP before (mm)"),
        ("hip_step_m", "HIP step (mm)"),
        ("from_time", "from time (s)"),
        ("share_deep", "share deep"),
    ],
)
def test_evidence_has_units(name, words_):
    assert evidence_words(name) == words_


def test_evidence_that_rows_share_is_one_cell():
    found = [
        verdict("x", name, "drift", Finding(Outcome.PASS, "", evidence={"rows": rows, "kind": "led"}))
        for name, rows in (("a", 1), ("b", 2), ("c", 2))
    ]
    cells = dict(CheckSection("x", [[each] for each in found]).evidence)
    assert cells == {"a": [(1, 0, 1), ("led", 1, 3)], "b": [(2, 0, 2)], "c": []}


@pytest.mark.parametrize(
    ("value", "name", "shown"),
    [
        (0.0125, "jump_m", "12.5"), ([0.1, -0.02], "ihip_before", "100, −20"), (0.5, "from_time", "0.5"),  # noqa: RUF001
        (2e-6, "hold_J", "0.002"), (3, "laps", "3"),
    ],
)  # fmt: skip
def test_lengths_of_evidence_are_in_millimetres_and_energies_in_millijoules_as_in_the_words_of_verdicts(
    value, name, shown
):
    assert environment().filters["evidence_text"](value, name) == shown


def test_metric_and_bound_have_the_unit_of_the_words():
    measure = environment().filters["measure"]
    assert measure(0.0151, Measure(name="work", value=1.0, unit="J")) == "15.1 mJ"
    assert measure(0.927, Measure(name="share of the impulse", value=1.0, unit="")) == "92.7 %"
    assert measure(0.02, Measure(name="jump", value=1.0, unit="m")) == "20 mm"
    assert measure(None, Measure(name="share", value=None, unit="")) == "not finite"
