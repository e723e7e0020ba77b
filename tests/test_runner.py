"""The runner: the stream, what is kept when something dies, and that the same command gives the same verdicts."""

from __future__ import annotations

import multiprocessing
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from hapticeval.errors import InputError, NothingSelectedError, UnknownNameError
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.hdf5 import read_recording
from hapticeval.runner.events import Interrupted, JobFinished, RunFinished, RunStarted
from hapticeval.runner.execution import execute
from hapticeval.runner.planning import plan
from hapticeval.runner.results import read_results

MODULE = """
import os, random, time
import numpy as np
from hapticeval import Response

class Good:
    def __init__(self, scene):
        self.curve, self.stiffness = scene.model.curve, scene.stiffness
    def reset(self, hip):
        pass
    def step(self, hip, velocity, dt):
        inside = self.curve.contains([hip])[0]
        ihip = self.curve.position(self.curve.nearest([hip]))[0] if inside else hip
        return Response(ihip, self.stiffness * (ihip - hip))

class Raises(Good):
    def step(self, hip, velocity, dt):
        if hip[0] < -0.03:
            raise RuntimeError("out of its depth")
        return super().step(hip, velocity, dt)

class Noisy(Good):
    def step(self, hip, velocity, dt):
        answer = super().step(hip, velocity, dt)
        noise = np.random.random() + random.random()
        return Response(answer.ihip, answer.force * (1 + 1e-3 * noise))

class Exits(Good):
    def step(self, hip, velocity, dt):
        raise SystemExit(0)

class Overwrites(Good):
    def run(self, hips, dt):
        answers = [self.step(hip, 0 * hip, dt) for hip in hips]
        hips[:] = 7.0
        return [each.ihip for each in answers], [each.force for each in answers]

class Talks(Good):
    standoff = "0.1 mm"

class Idle(Good):
    def step(self, hip, velocity, dt):
        return Response(hip, 0 * hip)

class Sideways(Good):
    surface = "model"

class Waits(Good):
    def step(self, hip, velocity, dt):
        time.sleep(3600)

class Dies(Good):
    def step(self, hip, velocity, dt):
        os._exit(7)

def no_renderer(scene):
    return 42
"""

SUITE = """
title = "short"
[[case]]
name = "press"
title = "press"
model = { kind = "line" }
scene = { mass = 1.0 }
checks = ["contact-normal-force", "continuous-contact"]
experiment = { duration = 0.2, position = [0.0, 0.001], force = [[0.0, 0.0, -1.0]] }
[[case]]
name = "slide"
title = "slide"
model = { kind = "circle" }
checks = ["continuous-contact"]
trajectory = { kind = "scaled", depth = 0.002, from_angle = 0, to_angle = 120, duration = 0.2 }
"""


@pytest.fixture
def short(tmp_path, monkeypatch) -> Iterator[str]:
    """The suite's path, with the module of renderers importable as `thirdparty`."""
    (tmp_path / "thirdparty.py").write_text(MODULE)
    (tmp_path / "short.toml").write_text(SUITE)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield str(tmp_path / "short.toml")
    sys.modules.pop("thirdparty", None)


def run(suite, renderers, directory, **options):
    return list(execute(plan([suite], renderers, **options), directory, workers=2))


def test_the_stream_tells_the_plan_every_job_and_the_end(short, tmp_path):
    events = run(short, ["thirdparty:Good", "constraint"], tmp_path / "out")
    assert events[0] == RunStarted(planned_verdicts=6, planned_jobs=4)
    assert [(event.run.case, event.run.renderer) for event in events[1:-1]] == [
        ("press", "thirdparty:Good"),
        ("press", "constraint"),
        ("slide", "thirdparty:Good"),
        ("slide", "constraint"),
    ]
    assert isinstance(events[-1], RunFinished)
    results = read_results(tmp_path / "out")
    assert (results.planned, results.ran, results.complete) == (6, 6, True)
    for entry in results.runs:
        recording = read_recording(tmp_path / "out" / entry.recording)
        assert len(recording) == 201
        assert entry.simulated_seconds >= 0.2


def test_a_renderer_that_breaks_does_not_take_the_others_along(short, tmp_path):
    events = run(short, ["thirdparty:Raises", "constraint"], tmp_path / "out")
    jobs = {(event.run.case, event.run.renderer): event for event in events if isinstance(event, JobFinished)}
    broken = jobs["slide", "thirdparty:Raises"]
    assert "out of its depth" in str(broken.error)
    assert "in thirdparty.py, line 19, in step" in broken.error.why
    assert broken.error.exit_code == 3
    assert broken.error.hip[0] < -0.03
    assert {verdict.outcome for verdict in broken.verdicts} == {Outcome.ERROR}
    assert jobs["press", "thirdparty:Raises"].error is None
    assert jobs["slide", "constraint"].error is None
    assert events[-1].results.complete


@pytest.mark.parametrize(
    ("name", "message"),
    [("Exits", "SystemExit"), ("Talks", "standoff = '0.1 mm'"), ("Sideways", "surface is a str")],
)
def test_whatever_a_renderer_gets_wrong_is_its_own_error(short, tmp_path, name, message):
    events = run(short, [f"thirdparty:{name}", "constraint"], tmp_path / "out")
    jobs = {(event.run.case, event.run.renderer): event for event in events if isinstance(event, JobFinished)}
    assert message in str(jobs["slide", f"thirdparty:{name}"].error)
    assert jobs["slide", f"thirdparty:{name}"].error.exit_code == 3
    assert jobs["slide", "constraint"].error is None


def test_a_batch_cannot_change_the_recorded_hip(short, tmp_path):
    events = run(short, ["thirdparty:Overwrites", "constraint"], tmp_path / "out")
    first, second = (
        read_recording(tmp_path / "out" / entry.recording) for entry in events[-1].results.runs if entry.case == "slide"
    )
    np.testing.assert_array_equal(first.hip, second.hip)


def test_a_renderer_that_never_touches_does_not_pass_a_gate(short, tmp_path):
    events = run(short, ["thirdparty:Idle"], tmp_path / "out")
    assert not all(verdict.as_expected for verdict in events[-1].results.verdicts)


def test_suites_of_one_name_are_refused(short, tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "short.toml").write_text(SUITE)
    with pytest.raises(InputError, match="two suites are named 'short'"):
        plan([short, str(tmp_path / "other" / "short.toml")], ["constraint"])


def test_a_stimulus_that_cannot_be_is_told_once_and_before_anything_runs(short, tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text(SUITE.replace("position = [0.0, 0.001]", "position = [0.0, nan]"))
    with pytest.raises(InputError, match=r"case 'press'.*not finite"):
        plan([str(bad)], ["constraint", "minimum-distance"])


def test_what_is_no_renderer_is_said(short, tmp_path):
    events = run(short, ["thirdparty:no_renderer"], tmp_path / "out")
    assert "int" in str(events[1].error)
    assert events[1].error.exit_code == 3


def test_a_renderer_that_ends_its_process_breaks_alone(short, tmp_path):
    events = run(short, ["constraint", "thirdparty:Dies", "minimum-distance"], tmp_path / "out")
    assert isinstance(events[-1], RunFinished)
    jobs = {(event.run.case, event.run.renderer): event for event in events if isinstance(event, JobFinished)}
    for (_, renderer), event in jobs.items():
        if renderer == "thirdparty:Dies":
            assert "ended the process" in str(event.error)
            assert event.error.exit_code == 3
        else:
            assert event.error is None
    assert read_results(tmp_path / "out").complete


def test_an_interrupt_lets_what_has_begun_finish(short, tmp_path):
    """One process: the second job begins before the first is told, and the third and the fourth never do."""
    stream = execute(plan([short], ["constraint", "minimum-distance"]), tmp_path / "out", workers=1)
    assert isinstance(next(stream), RunStarted)
    assert isinstance(next(stream), JobFinished)
    signal.raise_signal(signal.SIGINT)
    told, finished, end = stream
    assert told == Interrupted(begun=1)
    assert (finished.run.case, finished.run.renderer) == ("press", "minimum-distance")
    assert isinstance(end, RunFinished)
    results = read_results(tmp_path / "out")
    assert (results.reason, results.complete, results.ran) == ("interrupted by the user", False, 4)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_after_the_last_job_makes_nothing_incomplete(short, tmp_path):
    stream = execute(plan([short], ["constraint"], select=["slide"]), tmp_path / "out")
    assert [type(next(stream)) for _ in range(2)] == [RunStarted, JobFinished]
    signal.raise_signal(signal.SIGINT)
    assert list(stream)[-1].results.complete


def test_a_second_interrupt_kills_what_has_begun(short, tmp_path):
    stream = execute(plan([short], ["constraint", "thirdparty:Waits"], select=["slide"]), tmp_path / "out", workers=2)
    assert isinstance(next(stream), RunStarted)
    assert next(stream).run.renderer == "constraint"
    working = set(multiprocessing.active_children())
    assert working
    signal.raise_signal(signal.SIGINT)
    assert next(stream) == Interrupted(begun=1)
    signal.raise_signal(signal.SIGINT)
    assert next(stream) == Interrupted(begun=1, at_once=True)
    assert isinstance(next(stream), RunFinished)
    assert not working & set(multiprocessing.active_children())
    results = read_results(tmp_path / "out")
    assert (results.reason, results.ran) == ("interrupted by the user", 1)


def test_who_leaves_the_stream_leaves_no_process(short, tmp_path):
    before = multiprocessing.active_children()
    stream = execute(plan([short], ["constraint", "thirdparty:Waits"], select=["slide"]), tmp_path / "out", workers=2)
    assert [type(next(stream)) for _ in range(2)] == [RunStarted, JobFinished]
    assert len(multiprocessing.active_children()) > len(before)
    stream.close()
    assert multiprocessing.active_children() == before
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_it_runs_in_another_thread_too(short, tmp_path):
    with ThreadPoolExecutor() as thread:
        events = thread.submit(run, short, ["constraint"], tmp_path / "out").result()
    assert events[-1].results.complete


def test_the_seed_makes_a_random_renderer_repeatable(short, tmp_path):
    def forces(seed, name):
        events = run(short, ["thirdparty:Noisy"], tmp_path / name, seed=seed)
        entry = events[-1].results.runs[1]
        return read_recording(tmp_path / name / entry.recording).force

    first, again, other = forces(1, "a"), forces(1, "b"), forces(2, "c")
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize(
    ("select", "planned"),
    [("slide", 1), ("s*", 1), ("*", 3), ("*/continuous-contact", 2), ("press/*", 2), ("short/slide", 1)],
)
def test_a_selection_is_by_case_or_by_check(short, select, planned):
    assert plan([short], ["constraint"], select=[select]).planned == planned


def test_selections_add_up(short):
    assert plan([short], ["constraint"], select=["slide", "press/continuous-contact"]).planned == 2


def test_nothing_selected_has_its_own_exit_code(short):
    with pytest.raises(NothingSelectedError) as caught:
        plan([short], ["constraint"], select=["glide"])
    assert caught.value.exit_code == 4
    assert "press, slide" in str(caught.value)


def test_unknown_renderers_are_refused_before_anything_runs(short):
    with pytest.raises(UnknownNameError, match="constraint"):
        plan([short], ["constrain"])
