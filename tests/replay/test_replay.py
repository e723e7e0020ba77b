"""Replays: bit for bit with the recorded renderer, on the recorded clock, honest about what a path cannot settle."""

from __future__ import annotations

import signal
import sys
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np
import pytest
from leading import led

from hapticeval.cli import main
from hapticeval.discovery import own_renderers
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome
from hapticeval.recordings.hdf5 import read_recording, write_recording
from hapticeval.recordings.recording import Recording, backward_difference
from hapticeval.replay import OPEN_LOOP, RECORDED
from hapticeval.replay.as_recorded import as_recorded
from hapticeval.replay.job import prepare_replay, replay_plan
from hapticeval.replay.subject import make_replay_case
from hapticeval.runner.events import Interrupted, JobFinished, RunFinished, RunStarted
from hapticeval.runner.execution import execute
from hapticeval.runner.judging import merge_findings
from hapticeval.runner.planning import RunOptions, plan
from hapticeval.runner.results import read_results
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path

pytestmark = pytest.mark.usefixtures("in_process")

SUITE = """
title = "two cases"
[[case]]
name = "push"
title = "a closed loop"
model = { kind = "circle" }
scene = { mass = 0.5, damping = 4.0 }
checks = ["continuous-contact", "contact-normal-force", "centripetal-force", "impulsive-collision"]
experiment = { duration = 0.3, position = [0.103, 0.0], velocity = [-0.1, 0.2], force = [[0.0, -2.0, 0.0]] }
[[case]]
name = "slide"
title = "a playback"
model = { kind = "circle" }
scene = { stiffness = 750.0, damping = 3.0 }
checks = ["continuous-contact", "memoryless"]
trajectory = { kind = "scaled", depth = 0.002, from_angle = -10, to_angle = 100, duration = 0.4 }
"""

STEPPED = tuple(name for name in own_renderers() if name != "ideal")
VARIANTS = ("minimum-distance+pp-v", "constraint+pp-d@curve", "minimum-distance@lut")

COUNTING = """
import numpy as np
from hapticeval import Response
from hapticeval.errors import DomainError

class Counting:
    log = []
    def __init__(self, scene):
        pass
    def reset(self, hip):
        self.log.append(("reset", tuple(hip)))
    def step(self, hip, velocity, dt):
        self.log.append(("step", dt, tuple(velocity)))
        return Response(hip, 0 * hip)

class Bounded(Counting):
    def step(self, hip, velocity, dt):
        if hip[1] > 0.05:
            raise DomainError("beyond the edge")
        return super().step(hip, velocity, dt)

class Feeling(Counting):
    def observe_force(self, push):
        self.log.append(("observe_force", tuple(push)))
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The folder of a run of both cases by every built-in renderer, and some variants."""
    folder = tmp_path_factory.mktemp("ran")
    (folder / "two.toml").write_text(SUITE)
    options = RunOptions(output=folder / "out", workers=0)
    events = list(execute(plan([str(folder / "two.toml")], [*own_renderers(), *VARIANTS], options)))
    assert isinstance(events[-1], RunFinished)
    return folder / "out"


@pytest.fixture
def counting(tmp_path, monkeypatch):
    """A renderer that writes down what it is asked, as `countingmodule:Counting`."""
    (tmp_path / "countingmodule.py").write_text(COUNTING)
    monkeypatch.syspath_prepend(str(tmp_path))
    from countingmodule import Counting

    Counting.log.clear()
    yield Counting.log
    sys.modules.pop("countingmodule", None)


def file_of(folder, case, renderer):
    entry = next(e for e in read_results(folder).runs if (e.case, e.renderer) == (case, renderer))
    return folder / entry.recording


def opened(file, **options):
    return make_replay_case(file, read_recording(file), **options)


BESIDE = 0.102
"""Radius (m) of a round outside of the circle: no hand is led in, and a renderer is asked for the log's rows alone."""


def circle_run(time, *, radius=0.098, hip=None, meta=None, channels=("ihip", "force"), valid=None):
    """A slide on the circle by the exact constraint renderer, sampled at any times."""
    from hapticeval.renderers import minimum_distance

    angle = 2.0 * time
    hip = radius * np.column_stack([np.cos(angle), np.sin(angle)]) if hip is None else hip
    scene = Scene(model=make_model("circle"))
    answers = led(minimum_distance(scene), hip, 1e-3)
    given = dict(zip(("ihip", "force"), answers, strict=True))
    said = {"renderer": "minimum-distance", "scene": {"stiffness": 1000.0, "model": {"kind": "circle"}}, **(meta or {})}
    return Recording(time, {"hip": hip, **{name: given[name] for name in channels}}, said, valid=valid)


def replayed(recording, tmp_path, renderers, **options):
    """Results and recordings by renderer of a replay, in this process."""
    made = make_replay_case(tmp_path / "log.h5", recording, **options)
    work = prepare_replay(made)
    out = {}
    for job in replay_plan(made, renderers).jobs:
        judged, file = work(job, tmp_path / "out", 0)
        out[job.renderer] = judged, None if file is None else read_recording(tmp_path / "out" / file)
    return out


@pytest.mark.parametrize("case", ["slide", "push"])
@pytest.mark.parametrize("renderer", [*STEPPED, *VARIANTS])
def test_the_recorded_renderer_gives_the_log_again_to_the_last_bit(ran, case, renderer):
    found = as_recorded(opened(file_of(ran, case, renderer)))
    assert found.renderer == renderer
    assert [each.channel for each in found.channels] == ["ihip", "force"]
    for each in found.channels:
        assert each.largest == 0.0, each.describe()
    assert found.follows


def test_a_rigid_tool_cannot_be_computed_again_from_where_it_was(refused, ran):
    with refused(InputError):
        as_recorded(opened(file_of(ran, "push", "ideal")))


def arguments_of(counting, what):
    """What the counting renderer was asked first, along the path forwards."""
    return [entry[1:] for entry in counting if entry[0] == what]


def test_a_renderer_is_asked_at_the_recorded_samples_steps_velocities_and_pushes(tmp_path, counting):
    rng = np.random.default_rng(3)
    time = 5.0 + np.cumsum(rng.choice([0.007, 0.008], 200))
    log = circle_run(time, radius=BESIDE)
    velocity, push = 0.5 * backward_difference(log.hip, time), rng.standard_normal((200, 2))
    log = Recording(time, {**log.channels, "velocity": velocity, "measured_force": push}, log.meta)
    judged, answer = replayed(log, tmp_path, ["countingmodule:Feeling"])["countingmodule:Feeling"]
    np.testing.assert_array_equal(answer.time, time)
    np.testing.assert_array_equal(answer.hip, log.hip)
    steps = arguments_of(counting, "step")[:200]
    np.testing.assert_array_equal([step for step, _ in steps][1:], np.diff(time))
    np.testing.assert_array_equal([seen for _, seen in steps], velocity)
    np.testing.assert_array_equal([felt for (felt,) in arguments_of(counting, "observe_force")[:200]], push)
    assert judged.replay.clock.startswith("irregular, 7 to 8 ms")


def test_every_gap_starts_the_renderer_anew_and_one_missed_cycle_is_none(tmp_path, counting):
    time = np.delete(np.arange(301) * 1e-3, 50)
    time[200:] += 0.5
    valid = np.ones(300, dtype=bool)
    valid[90:100] = False
    log = circle_run(time, radius=BESIDE, valid=valid)
    judged, answer = replayed(log, tmp_path, ["countingmodule:Counting"], model=None)["countingmodule:Counting"]
    assert arguments_of(counting, "reset")[:3] == [(tuple(log.hip[row]),) for row in (0, 100, 200)]
    assert (judged.replay.stretches, judged.replay.rows, judged.replay.rows_left_out) == (3, 290, 10)
    np.testing.assert_array_equal(answer.time, time[valid])
    assert len(answer.meta["stretches"]) == 3
    assert arguments_of(counting, "step")[50][0] == time[50] - time[49] > 1.5e-3


def test_a_stretch_that_begins_inside_is_led_in_from_the_surface(tmp_path, counting):
    time = np.arange(100) * 1e-3
    recording = circle_run(time)
    _, answer = replayed(recording, tmp_path, ["countingmodule:Counting"])["countingmodule:Counting"]
    starts = np.array([entry[1] for entry in counting if entry[0] == "reset"])
    assert np.all(np.linalg.norm(starts, axis=1) > 0.1)
    np.testing.assert_allclose(starts[0] / np.linalg.norm(starts[0]), recording.hip[0] / 0.098, atol=1e-12)
    np.testing.assert_array_equal(answer.hip, recording.hip)


def test_faults_of_a_real_recording_are_left_out_and_named(tmp_path, counting):
    time = np.arange(400) * 1e-3
    rng = np.random.default_rng(11)
    angle = 2.0 * time
    hip = 0.098 * np.column_stack([np.cos(angle), np.sin(angle)]) + 1e-7 * rng.standard_normal((400, 2))
    recording = circle_run(time, hip=hip, meta={"source": "file"})
    force = np.array(recording.force)
    force[150:152] += 500.0
    hip = np.array(hip)
    hip[300] += 0.05
    log = Recording(time, {**recording.channels, "hip": hip, "force": force}, recording.meta)
    out = replayed(log, tmp_path, ["countingmodule:Counting"])
    assert any(each.startswith("spike in hip") for each in out[RECORDED][0].replay.left_out)
    assert 300 not in np.rint(1e3 * out[RECORDED][1].time)
    assert 300 not in np.rint(1e3 * out["countingmodule:Counting"][1].time)
    assert 150 in np.rint(1e3 * out["countingmodule:Counting"][1].time), "a fault of the force is none of the path"


def test_what_looks_like_a_spike_in_a_simulation_is_the_renderers(tmp_path, counting):
    time = np.arange(400) * 1e-3
    recording = circle_run(time, meta={"source": "experiment"})
    ihip = np.array(recording.ihip)
    ihip[200] += 0.05
    log = Recording(time, {**recording.channels, "ihip": ihip}, recording.meta)
    judged, kept = replayed(log, tmp_path, ["countingmodule:Counting"])[RECORDED]
    assert len(kept) == 400
    outcomes = {verdict.check: verdict.outcome for verdict in judged.verdicts}
    assert outcomes["continuous-contact"] is Outcome.FAIL


def test_what_leads_out_of_a_renderers_domain_ends_the_stretch(tmp_path, counting):
    time = np.arange(600) * 1e-3
    log = circle_run(time)
    beyond = int(np.argmax(log.hip[:, 1] > 0.05))
    judged, recording = replayed(log, tmp_path, ["countingmodule:Bounded"])["countingmodule:Bounded"]
    assert judged.error is None
    assert len(recording) == beyond
    assert judged.replay.left_out == [f"{time[beyond]:.6g} to {time[-1]:.6g} s: beyond the edge"]
    outside = circle_run(1.0 + time[:90])
    judged, recording = replayed(outside, tmp_path, ["countingmodule:Bounded"])["countingmodule:Bounded"]
    assert judged.error is not None
    assert "beyond the edge" in str(judged.error)
    found = as_recorded(make_replay_case(tmp_path / "log.h5", log), ["countingmodule:Bounded"])
    assert not found.follows
    assert "gives no answer from" in found.describe()


def test_the_recorded_run_is_a_column_and_the_difference_is_told(tmp_path):
    time = np.arange(200) * 1e-3
    recording = circle_run(time)
    shifted = np.array(recording.ihip)
    shifted[120] += [0.0, 3e-4]
    log = Recording(time, {**recording.channels, "ihip": shifted}, recording.meta)
    out = replayed(log, tmp_path, ["minimum-distance"])
    assert list(out) == [RECORDED, "minimum-distance"]
    assert out[RECORDED][0].replay.difference is None
    found = out["minimum-distance"][0].replay.difference
    assert found.ihip.row == 120
    assert found.ihip.max == pytest.approx(3e-4, rel=1e-9)
    assert found.ihip.rms == pytest.approx(3e-4 / np.sqrt(200.0), rel=1e-9)
    assert found.force.max == 0.0
    assert out["minimum-distance"][0].replay.note == OPEN_LOOP


def test_what_a_fixed_path_cannot_settle_is_inconclusive_and_stops_no_gate(ran, tmp_path):
    out = replayed(read_recording(file_of(ran, "push", "constraint")), tmp_path, ["minimum-distance", "constraint"])
    for renderer, (judged, _) in out.items():
        found = {verdict.check: verdict for verdict in judged.verdicts}
        assert set(found) == {"continuous-contact", "contact-normal-force", "centripetal-force", "impulsive-collision"}
        if renderer == RECORDED:
            assert found["impulsive-collision"].level is Level.MUST
            assert found["impulsive-collision"].outcome in (Outcome.PASS, Outcome.FAIL)
            continue
        for check in ("centripetal-force", "impulsive-collision"):
            assert found[check].outcome is Outcome.INCONCLUSIVE
            assert "does not answer" in found[check].finding.message
            assert found[check].as_expected


def test_a_recording_without_answers_is_no_failure_of_its_own(tmp_path):
    time = np.arange(100) * 1e-3
    out = replayed(circle_run(time, channels=()), tmp_path, ["minimum-distance"])
    judged, _ = out[RECORDED]
    found = {verdict.check: verdict for verdict in judged.verdicts}
    relations = ("numerical-stability", "mirror-image", "vertex-order", "time-subdivision", "two-at-once")
    unasked = ("broken-contact", "abrupt-switch", "drop-out", "reset-clears", "seams", *relations)
    assert {found.pop(name).outcome for name in unasked} == {Outcome.NOT_APPLICABLE}
    assert {name for name, verdict in found.items() if verdict.outcome is not Outcome.INCONCLUSIVE} == set()
    assert "no channel 'ihip'" in found["continuous-contact"].finding.message
    assert "no channel 'force'" in found["contact-normal-force"].finding.message
    assert all(verdict.as_expected for verdict in judged.verdicts)
    found = out["minimum-distance"][0].replay.difference
    assert found.ihip is None
    assert found.force is None


@pytest.mark.parametrize(
    ("said", "digits", "turn", "outcome", "words"),
    [
        ({"contact_point": "nearest"}, 16, 0.0, Outcome.PASS, "judged at the model's point nearest to the HIP"),
        ({"contact_point": "nearest"}, 4, 0.0, Outcome.PASS, "where it is declared to be"),
        ({"contact_point": "nearest"}, 4, 0.1, Outcome.FAIL, "off every true normal"),
        (
            {"renderer": "minimum-distance"},
            16,
            0.0,
            Outcome.INCONCLUSIVE,
            "not declared that the contact point is there",
        ),
        ({}, 16, 0.0, Outcome.INCONCLUSIVE, "not declared that the contact point is there"),
    ],
)
def test_a_log_without_ihip_is_judged_by_what_it_has(tmp_path, said, digits, turn, outcome, words):
    """A force that is logged with four decimals has no direction where it is weak, and that is no fault of it."""
    time = np.arange(1000) * 1e-3
    depth = np.maximum(0.0, 0.002 * np.sin(8.0 * time))
    hip = (0.1 - depth)[:, None] * np.column_stack([np.cos(2.0 * time), np.sin(2.0 * time)])
    log = circle_run(time, hip=hip, channels=("force",), meta={**said, "source": "file"})
    cos, sin = np.cos(turn), np.sin(turn)
    force = np.round(log.force @ np.array([[cos, sin], [-sin, cos]]), digits)
    log = Recording(time, {"hip": hip, "force": force}, log.meta)
    judged, _ = replayed(log, tmp_path, ["minimum-distance"])[RECORDED]
    found = {verdict.check: verdict.finding for verdict in judged.verdicts}["contact-normal-force"]
    assert found.outcome is outcome, found.message
    assert words in found.message
    assert "nearest" in found.evidence


def test_a_log_without_force_is_judged_by_what_it_has(tmp_path, capsys):
    """Contact is then where the IHIP is not the HIP."""
    log = circle_run(np.arange(200) * 1e-3, channels=("ihip",))
    assert log.contact.all()
    write_recording(tmp_path / "log.h5", log)
    main(["replay", str(tmp_path / "log.h5"), "-r", "minimum-distance", "-o", str(tmp_path / "out")])
    assert "no channel 'force': its own run is not judged by contact-normal-force" in capsys.readouterr().out
    found = {v.check: v for v in read_results(tmp_path / "out").verdicts if v.renderer == RECORDED}
    assert found["continuous-contact"].outcome == "pass"
    (page,) = (tmp_path / "out" / "report" / "cases").rglob("*.html")
    assert "the recording has no channel &#39;force&#39;, which this check reads" in page.read_text()


@pytest.mark.parametrize(
    ("change", "words", "follows"),
    [
        (lambda x: x, "follows to the last bit", True),
        (lambda x: x.astype(np.float32).astype(float), "follows to rounding", True),
        (lambda x: -x, "its sign is turned", False),
        (lambda x: 0.5 * x, "its gain is 0.5", False),
        (lambda x: np.vstack([x[:1], x[:1], x[:-2]]), "the log is 2 ticks late", False),
        (lambda x: np.vstack([x[3:], x[-3:]]), "the log is 3 ticks early", False),
        (lambda x: -np.vstack([x[:1], x[:-1]]), "1 tick late and its sign is turned", False),
        (lambda x: np.where(np.arange(len(x))[:, None] < 70, x, 1.7 * x[::-1]), "from row 70 on", False),
    ],
)
def test_how_a_log_departs_from_its_renderer_is_told(tmp_path, change, words, follows):
    time = np.arange(200) * 1e-3
    depth = 0.002 + 0.001 * np.sin(9.0 * time)
    hip = (0.1 - depth)[:, None] * np.column_stack([np.cos(2 * time), np.sin(2 * time)])
    recording = circle_run(time, hip=hip)
    log = Recording(time, {**recording.channels, "force": change(recording.force)}, recording.meta)
    found = as_recorded(make_replay_case(tmp_path / "log.h5", log))
    assert found.channels[0].largest == 0.0
    assert words in found.channels[1].describe()
    assert found.follows is follows


def test_a_text_log_follows_to_its_last_decimal(tmp_path):
    time = np.arange(200) * 1e-3
    recording = circle_run(time)
    rounded = {name: np.round(values, 5) for name, values in recording.channels.items()}
    found = as_recorded(make_replay_case(tmp_path / "log.h5", Recording(time, rounded, recording.meta)))
    assert found.follows, found.describe()
    assert found.channels[0].largest > 1e-6
    assert found.channels[0].tolerance < 1e-4


@pytest.mark.parametrize(
    ("meta", "options"),
    [
        ({"scene": {"stiffness": 1000.0}}, {}),
        ({"scene": {"model": {"kind": "circle"}}}, {}),
        ({"scene": {}}, {}),
        ({}, {"scene": ["stiffness"]}),
        ({}, {"scene": ["stiffness=-3"]}),
        ({}, {"scene": ["bilateral=2"]}),
        ({}, {"suite_case": "cassinian-deep-slide"}),
    ],
)
def test_what_the_recording_does_not_say_must_be_given(refused, tmp_path, meta, options):
    with refused(InputError):
        make_replay_case(tmp_path / "log.h5", circle_run(np.arange(9) * 1e-3, meta=meta), **options)


def test_the_scene_is_the_given_one_over_the_recordings(refused, tmp_path):
    recording = circle_run(np.arange(9) * 1e-3)
    case = make_replay_case(tmp_path / "log.h5", recording, scene=["stiffness=400", "bilateral=true"]).case
    assert case.scene["stiffness"] == 400.0
    assert case.build_scene().bilateral
    other = make_replay_case(tmp_path / "log.h5", recording, suite_case="thesis/star-convex-corner").case
    assert other.model["kind"] == "star"
    assert "broken-contact" in other.checks
    with refused(UnknownNameError):
        make_replay_case(tmp_path / "log.h5", recording, scene=["stifness=1"])


def finding(outcome, value=None):
    metric = None if value is None else Metric("jump", value, "m")
    return Finding(outcome, outcome.value, metric, None if value is None else 1.0)


def test_stretches_are_weighed_together():
    lost, passed = finding(Outcome.INCONCLUSIVE), finding(Outcome.PASS, 0.2)
    assert merge_findings([lost, passed]).outcome is Outcome.PASS
    worst = merge_findings([finding(Outcome.FAIL, 2.0), passed, finding(Outcome.FAIL, 5.0)])
    assert worst.metric.value == 5.0
    assert worst.evidence["stretches"] == {"fail": 2, "pass": 1}
    assert "stretch 3 of 3" in worst.message
    assert merge_findings([passed]) is passed
    assert merge_findings([]).outcome is Outcome.INCONCLUSIVE


def test_the_command_writes_results_and_a_page_that_says_open_loop(ran, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    file = file_of(ran, "slide", "constraint")
    code = main(["replay", str(file), "-r", "constraint@curve", "-r", "constraint"])
    said = capsys.readouterr().out
    (folder,) = tmp_path.iterdir()
    assert folder.name == "replay-constraint"
    results = read_results(folder)
    assert results.complete
    assert [run.renderer for run in results.runs] == [RECORDED, "constraint@curve", "constraint"]
    assert code == int(any(not verdict.as_expected for verdict in results.verdicts))
    assert OPEN_LOOP in said
    assert "IHIP" in said
    assert "2 renderers and the recorded run in 1 case" in (folder / "report" / "index.html").read_text()
    page = (folder / "report" / "replay.html").read_text()
    assert "Distance from the recorded run" in page
    assert page.count("the hand would have moved otherwise") >= 3
    written = read_recording(folder / results.runs[1].recording)
    assert written.meta["source"] == "replay"


def test_a_replay_whose_renderers_all_refuse_is_no_success(tmp_path, capsys):
    log = circle_run(np.cumsum(np.resize([0.007, 0.008], 100)))
    write_recording(tmp_path / "log.h5", log)
    judged, answer = replayed(log, tmp_path, ["ideal"])["ideal"]
    assert answer is None
    assert {verdict.outcome for verdict in judged.verdicts} == {Outcome.NOT_APPLICABLE}
    assert "clock is not regular" in judged.refusal.what
    assert main(["replay", str(tmp_path / "log.h5"), "-r", "ideal", "-o", str(tmp_path / "refused")]) == 2
    assert "refuses: ideal" in capsys.readouterr().out
    page = (tmp_path / "refused" / "report" / "index.html").read_text()
    assert "Every verdict is as expected" not in page
    assert "Every renderer refused every case" in page


@pytest.mark.parametrize(("channel", "factor", "word"), [("hip", 1e3, "unit hip.x"), ("hip", 1.0, "")])
def test_a_replay_says_what_inspect_finds(undrawn, tmp_path, capsys, channel, factor, word):
    """A press into the circle and out of it, as it is or with millimetres taken for metres."""
    from hapticeval.renderers import minimum_distance

    time = np.arange(2000) * 1e-3
    hip = np.column_stack([0.1 + 0.003 * np.cos(2.0 * np.pi * time), 0.001 * np.sin(2.0 * np.pi * time)])
    force = led(minimum_distance(Scene(model=make_model("circle"))), hip, 1e-3)[1]
    channels = {"hip": hip, "force": force}
    channels[channel] = factor * channels[channel]
    meta = {"source": "file", "scene": {"stiffness": 1000.0, "model": {"kind": "circle"}}}
    file = tmp_path / "log.h5"
    write_recording(file, Recording(time, channels, meta))
    code = main(["replay", str(file), "-r", "minimum-distance", "-o", str(tmp_path / "out")])
    said = capsys.readouterr().err
    results = read_results(tmp_path / "out")
    assert code == int(any(not verdict.as_expected for verdict in results.verdicts))
    assert (f"see `hapticeval inspect {file}`" in said) is bool(word)
    assert f"suspicious: {word}" in said or not word
    page = (tmp_path / "out" / "report" / "index.html").read_text()
    assert ("The recording is suspicious" in page) is bool(word)
    assert all(any(text.startswith(word) for text in run.replay.suspicious) for run in results.runs) or not word
    main(["replay", str(file), "-r", "minimum-distance", "--as-recorded"])
    assert ("suspicious" in capsys.readouterr().err) is bool(word)


def test_as_recorded_decides_the_exit_code(ran, tmp_path, capsys):
    file = file_of(ran, "push", "constraint")
    assert main(["replay", str(file), "--as-recorded"]) == 0
    assert "to the last bit" in capsys.readouterr().out
    log = read_recording(file)
    turned = replace(log, channels={**log.channels, "force": -log.force})
    write_recording(tmp_path / "turned.h5", turned)
    assert main(["replay", str(tmp_path / "turned.h5"), "--as-recorded"]) == 1
    assert "its sign is turned" in capsys.readouterr().out


def test_a_log_that_says_nothing_is_asked_for_everything_at_once(tmp_path, capsys):
    log = circle_run(np.arange(200) * 1e-3)
    write_recording(tmp_path / "log.h5", Recording(log.time, log.channels, {"source": "file"}))
    assert main(["replay", str(tmp_path / "log.h5"), "--as-recorded"]) == 2
    said = capsys.readouterr().err
    assert "the stiffness of its scene, which model was touched and its renderer" in said
    assert "--scene stiffness=1000 --model circle:size=0.2 -r constraint" in said
    given = ["--scene", "stiffness=1000", "--model", "circle", "-r", "minimum-distance"]
    assert main(["replay", str(tmp_path / "log.h5"), "--as-recorded", *given]) == 0


def test_an_interrupt_keeps_what_had_finished(ran, tmp_path):
    made = opened(file_of(ran, "slide", "constraint"))
    names = ["constraint", "minimum-distance"]
    options = RunOptions(output=tmp_path / "out", workers=1)
    stream = execute(replay_plan(made, names, options), work=prepare_replay(made))
    assert isinstance(next(stream), RunStarted)
    assert next(stream).run.renderer == RECORDED
    signal.raise_signal(signal.SIGINT)
    assert [type(event) for event in stream] == [Interrupted, JobFinished, RunFinished]
    results = read_results(tmp_path / "out")
    assert results.reason == "interrupted by the user"
    assert [entry.renderer for entry in results.runs] == [RECORDED, "constraint"]


def test_a_steep_map_is_not_called_pop_through_on_one_sampling(tmp_path):
    """The conformal map runs up a sharp tip as the cube root of the way: steep everywhere, and continuous."""
    from hapticeval.renderers import conformal, minimum_distance

    scene = Scene(model=make_model("star"))
    t = np.linspace(0.0, 1.0, 1001)
    hip = np.column_stack([0.02 * (t - 0.5), np.full(t.size, 0.085)])
    outcomes = {}
    for name, factory in (("conformal", conformal), ("minimum-distance", minimum_distance)):
        recording = play(factory(scene), Path(t, hip), 1e-3)
        meta = {"scene": {"stiffness": 1000.0, "model": {"kind": "star"}}}
        log = Recording(recording.time, recording.channels, {**recording.meta, **meta})
        judged, _ = replayed(log, tmp_path, [name])[name]
        outcomes[name] = next(v.outcome for v in judged.verdicts if v.check == "continuous-contact")
    assert outcomes == {"conformal": Outcome.INCONCLUSIVE, "minimum-distance": Outcome.FAIL}


STROKE = FilePath(__file__).parents[3] / "shared" / "data" / "handwriting_svc" / "signal.svc"
MAPPING = FilePath(__file__).parents[2] / "examples" / "handwriting.toml"


@pytest.mark.skipif(not STROKE.exists(), reason="needs shared/data/handwriting_svc beside the repository")
def test_a_pen_stroke_goes_through_renderers_stretch_by_stretch(tmp_path):
    from hapticeval.recordings.importing.convert import load

    recording = load(STROKE, mapping=MAPPING)
    down = np.loadtxt(STROKE, skiprows=1)[:, 3] == 1
    strokes = int(np.sum(np.diff(np.concatenate([[0], down.astype(int)])) == 1))
    out = replayed(recording, tmp_path, STEPPED, model={"kind": "circle"}, scene=["stiffness=800"])
    for name in STEPPED:
        judged, answer = out[name]
        assert judged.replay.stretches == strokes
        assert judged.replay.rows == down.sum()
        assert judged.replay.clock.startswith("irregular")
        np.testing.assert_array_equal(answer.hip, recording.hip[down])
        found = {verdict.check: verdict.outcome for verdict in judged.verdicts}
        assert found["continuous-contact"] in (Outcome.PASS, Outcome.FAIL, Outcome.INCONCLUSIVE)
        assert answer.contact.any()


TAPPED = """
title = "an effect"
[[case]]
name = "tap"
title = "a tap"
model = { kind = "line" }
scene = { effects = [{ kind = "contact-transient", material = "aluminium" }] }
checks = ["transient-onset", "transient-vibration"]
trajectory = { kind = "points", points = [[0.0, 0.005], [0.0, -0.002], [0.05, -0.002]], duration = 0.2 }
"""


def test_a_check_of_an_effect_gets_the_force_without_it_on_a_replay_and_not_of_the_run_as_recorded(tmp_path):
    (tmp_path / "tapped.toml").write_text(TAPPED)
    list(
        execute(
            plan([str(tmp_path / "tapped.toml")], ["minimum-distance"], RunOptions(output=tmp_path / "out", workers=0))
        )
    )
    found = replayed(read_recording(file_of(tmp_path / "out", "tap", "minimum-distance")), tmp_path, ["constraint"])
    for name, *expected in (
        ("constraint", Outcome.PASS, Level.MUST),
        (RECORDED, Outcome.INCONCLUSIVE, Level.INFO),
    ):
        verdicts = found[name][0].verdicts
        assert [[each.outcome, each.level] for each in verdicts] == [expected] * 2


def test_what_a_recorded_hand_was_not_led_for_is_no_warning(ran, tmp_path):
    slide = read_recording(file_of(ran, "slide", "minimum-distance"))
    asked = Recording(slide.time, dict(slide.channels), {**slide.meta, "checks": ("drift", "drop-out")})
    for judged, _ in replayed(asked, tmp_path, ["constraint"]).values():
        drift, drop_out = judged.verdicts
        assert (drift.outcome, drift.level) == (Outcome.INCONCLUSIVE, Level.INFO)
        assert drop_out.outcome is Outcome.NOT_APPLICABLE
