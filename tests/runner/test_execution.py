"""The runner: the stream, what is kept when something dies, and that the same command gives the same verdicts."""

from __future__ import annotations

import math
import multiprocessing
import signal
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
import pytest

from hapticeval.errors import InputError, NothingSelectedError, UnknownNameError
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.hdf5 import read_recording
from hapticeval.runner import execution
from hapticeval.runner.events import AtWork, Interrupted, JobFinished, RunFinished, RunStarted
from hapticeval.runner.execution import execute
from hapticeval.runner.planning import RunOptions, plan
from hapticeval.runner.results import read_results

MODULE = """
import os, random, time, warnings
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
        return Response(answer.ihip, answer.force * (1 + 1e-3 * (np.random.random() + random.random())))

class Exits(Good):
    def step(self, hip, velocity, dt):
        raise SystemExit(0)

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

class Crashes(Good):
    def step(self, hip, velocity, dt):
        if hip[0] < -0.03:
            os.abort()
        return super().step(hip, velocity, dt)

class Leaves(Good):
    def step(self, hip, velocity, dt):
        if hip[0] < -0.03:
            raise GeneratorExit
        return super().step(hip, velocity, dt)

class Interrupts(Good):
    def step(self, hip, velocity, dt):
        raise KeyboardInterrupt

def no_renderer(scene):
    return 42

class Warns(Good):
    def step(self, hip, velocity, dt):
        warnings.warn(f"ill conditioned at {hip[0]:.6f}")
        return super().step(hip, velocity, dt)
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


def line_of(words: str) -> int:
    """Return the number of the module's one line with these words."""
    (number,) = (number for number, line in enumerate(MODULE.splitlines(), 1) if words in line)
    return number


@contextmanager
def short_suite(folder) -> Iterator[str]:
    """Write a suite, whose path is given, and make the module of renderers importable as `thirdparty`."""
    (folder / "thirdparty.py").write_text(MODULE)
    (folder / "short.toml").write_text(SUITE)
    with pytest.MonkeyPatch.context() as patch:
        # On a busy machine a job may take longer than a beat, and an AtWork would come between the events.
        patch.setattr(execution, "BEAT", math.inf)
        patch.syspath_prepend(str(folder))
        yield str(folder / "short.toml")
        sys.modules.pop("thirdparty", None)


@pytest.fixture
def short(tmp_path) -> Iterator[str]:
    with short_suite(tmp_path) as suite:
        yield suite


def executed(suite, renderers, output, *, workers=2, **options):
    """Run renderers, in two processes; the events, and those of jobs by case and renderer."""
    events = list(execute(plan([suite], renderers, RunOptions(output=output, workers=workers, **options))))
    return events, {(each.run.case, each.run.renderer): each for each in events if isinstance(each, JobFinished)}


@pytest.fixture
def run(short, tmp_path):
    return lambda *renderers, directory="out", **options: executed(short, renderers, tmp_path / directory, **options)


@pytest.fixture(scope="module")
def broken_run(tmp_path_factory):
    """The folder and the jobs of a run in which nine renderers break between two that do not."""
    folder = tmp_path_factory.mktemp("broken")
    names = [f"thirdparty:{name}" for name in BREAKS]
    with short_suite(folder) as suite:
        _, jobs = executed(suite, ["constraint", *names, "minimum-distance"], folder / "out")
    return folder / "out", jobs


@pytest.mark.parametrize("workers", [0, 2])
def test_the_stream_reports_the_plan_every_job_and_the_end(run, tmp_path, workers):
    events, jobs = run("thirdparty:Good", "constraint", workers=workers)
    assert events[0] == RunStarted(planned_verdicts=6, planned_jobs=4, jobs_of={"short": 4})
    assert list(jobs) == [(case, name) for case in ("press", "slide") for name in ("thirdparty:Good", "constraint")]
    assert isinstance(events[-1], RunFinished)
    results = read_results(tmp_path / "out")
    assert (results.planned, results.ran, results.complete) == (6, 6, True)
    for entry in results.runs:
        assert len(read_recording(tmp_path / "out" / entry.recording)) == 201
        assert entry.simulated_seconds >= 0.2


@pytest.mark.filterwarnings("default:ill conditioned")
def test_a_place_that_warns_in_every_job_and_process_is_reported_once(run):
    _, jobs = run("thirdparty:Warns", "thirdparty:Good")
    assert all(job.error is None for job in jobs.values())
    [reported] = [job.warnings for job in jobs.values() if job.warnings]
    [(place, text)] = reported.items()
    assert place.endswith(f"thirdparty.py:{line_of('warnings.warn')}: UserWarning")
    assert "UserWarning: ill conditioned at " in text
    assert "warnings.warn(f" in text
    assert reported is jobs["press", "thirdparty:Warns"].warnings


@pytest.mark.filterwarnings("default:ill conditioned")
def test_a_warning_in_this_process_is_left_to_python(run):
    with pytest.warns(UserWarning, match="ill conditioned"):
        _, jobs = run("thirdparty:Warns", workers=0)
    assert not any(job.warnings for job in jobs.values())


def test_without_a_folder_the_events_bring_the_recordings(short, tmp_path):
    before = set(tmp_path.iterdir())
    *_, job, end = execute(plan([short], ["constraint"], RunOptions(select=("slide",), workers=0)))
    assert len(job.recording) == 201
    assert end.results.runs[0].recording is None
    assert set(tmp_path.iterdir()) == before


BREAKS = {
    "Raises": ("out of its depth", True),
    "Exits": ("SystemExit", False),
    "Talks": ("standoff = '0.1 mm'", False),
    "Sideways": ("surface is a str", False),
    "no_renderer": ("int", False),
    "Dies": ("ended the process that it ran in: exit code 7 at tick 0 (counted from 0), HIP (", False),
    "Crashes": ("ended the process that it ran in: SIGABRT at tick ", True),
    "Leaves": ("step() raised GeneratorExit at tick ", True),
    "Interrupts": ("step() raised KeyboardInterrupt at tick 0 (counted from 0), HIP (", False),
}
"""What the slide breaks with, by renderer, and whether the press comes to its end."""


def test_beside_those_that_break_the_others_are_judged(broken_run):
    folder, jobs = broken_run
    assert [job.error for (_, name), job in jobs.items() if not name.startswith("thirdparty:")] == [None] * 4
    assert read_results(folder).complete


@pytest.mark.parametrize("name", BREAKS)
def test_a_renderer_that_breaks_breaks_alone(broken_run, name):
    _, jobs = broken_run
    message, pressed = BREAKS[name]
    broken = jobs["slide", f"thirdparty:{name}"]
    assert message in str(broken.error)
    assert broken.error.exit_code == 3
    assert {verdict.outcome for verdict in broken.verdicts} == {Outcome.ERROR}
    assert (jobs["press", f"thirdparty:{name}"].error is None) is pressed
    if name == "Crashes":
        assert f"it was in thirdparty.py, line {line_of('os.abort')}, in step" in broken.error.why
        assert broken.error.tick > 0
        assert broken.error.hip[0] < -0.03
    if name == "Leaves":
        assert broken.error.tick > 0
    if name == "Raises":
        assert f"in thirdparty.py, line {line_of('RuntimeError')}, in step" in broken.error.why
        assert broken.error.hip[0] < -0.03


def test_a_renderer_that_never_touches_does_not_pass_a_gate(run):
    events, _ = run("thirdparty:Idle")
    assert not all(verdict.as_expected for verdict in events[-1].results.verdicts)


def test_an_interrupt_lets_what_has_begun_finish(short, tmp_path):
    """One process: the second job begins before the first is reported, and the third and the fourth never do."""
    stream = execute(plan([short], ["constraint", "minimum-distance"], RunOptions(output=tmp_path / "out", workers=1)))
    assert isinstance(next(stream), RunStarted)
    assert isinstance(next(stream), JobFinished)
    signal.raise_signal(signal.SIGINT)
    interrupted, finished, end = stream
    assert interrupted == Interrupted(begun=1, grace=execution.FINISH_GRACE)
    assert 0.0 < interrupted.seconds < 600.0, "since the second began"
    assert finished.run.key == ("short", "press", "minimum-distance")
    assert isinstance(end, RunFinished)
    results = read_results(tmp_path / "out")
    assert (results.reason, results.complete, results.ran) == ("interrupted by the user", False, 4)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_after_the_last_job_makes_nothing_incomplete(short, tmp_path):
    stream = execute(plan([short], ["constraint"], RunOptions(select=("slide",), output=tmp_path / "out", workers=2)))
    assert [type(next(stream)) for _ in range(2)] == [RunStarted, JobFinished]
    signal.raise_signal(signal.SIGINT)
    assert list(stream)[-1].results.complete


def test_a_second_interrupt_kills_what_has_begun(short, tmp_path):
    options = RunOptions(select=("slide",), output=tmp_path / "out", workers=2)
    stream = execute(plan([short], ["constraint", "thirdparty:Waits"], options))
    assert isinstance(next(stream), RunStarted)
    assert next(stream).run.renderer == "constraint"
    working = set(multiprocessing.active_children())
    assert working
    signal.raise_signal(signal.SIGINT)
    assert next(stream) == Interrupted(begun=1, grace=execution.FINISH_GRACE)
    signal.raise_signal(signal.SIGINT)
    given_up = (("short", "slide", "thirdparty:Waits"),)
    assert next(stream) == Interrupted(begun=1, at_once=True, runs=given_up)
    assert isinstance(next(stream), RunFinished)
    assert not working & set(multiprocessing.active_children())
    results = read_results(tmp_path / "out")
    assert (results.reason, results.ran) == ("interrupted by the user", 1)


def test_one_interrupt_gives_up_what_hangs(short, tmp_path, monkeypatch):
    """Not before its grace has passed, and then without a second interrupt."""
    monkeypatch.setattr(execution, "FINISH_GRACE", 0.3)
    options = RunOptions(select=("slide",), output=tmp_path / "out", workers=2)
    stream = execute(plan([short], ["constraint", "thirdparty:Waits"], options))
    assert [type(next(stream)) for _ in range(2)] == [RunStarted, JobFinished]
    signal.raise_signal(signal.SIGINT)
    assert next(stream) == Interrupted(begun=1, grace=0.3)
    interrupted_at = time.monotonic()
    given_up = (("short", "slide", "thirdparty:Waits"),)
    assert next(stream) == Interrupted(begun=1, at_once=True, runs=given_up)
    assert time.monotonic() - interrupted_at > 0.25
    assert isinstance(next(stream), RunFinished)
    assert read_results(tmp_path / "out").ran == 1


def test_what_takes_long_is_reported_while_it_runs(short, tmp_path, monkeypatch):
    monkeypatch.setattr(execution, "BEAT", 0.0)
    options = RunOptions(select=("slide",), output=tmp_path / "out", workers=2)
    stream = execute(plan([short], ["constraint", "thirdparty:Waits"], options))
    beats = (event for event in stream if isinstance(event, AtWork))
    last = next(event for event in beats if event.finished_jobs == 1)
    assert last.runs == (("short", "slide", "thirdparty:Waits"),)
    assert 0.0 < last.seconds < 600.0
    stream.close()


def test_who_leaves_the_stream_leaves_no_process(short, tmp_path):
    before = multiprocessing.active_children()
    options = RunOptions(select=("slide",), output=tmp_path / "out", workers=2)
    stream = execute(plan([short], ["constraint", "thirdparty:Waits"], options))
    assert [type(next(stream)) for _ in range(2)] == [RunStarted, JobFinished]
    assert len(multiprocessing.active_children()) > len(before)
    stream.close()
    assert multiprocessing.active_children() == before
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_it_runs_in_another_thread_too(run):
    with ThreadPoolExecutor() as thread:
        events, _ = thread.submit(run, "constraint").result()
    assert events[-1].results.complete


def test_the_seed_makes_a_random_renderer_repeatable(run, tmp_path):
    def forces(seed, name, workers):
        events, _ = run("thirdparty:Noisy", directory=name, seed=seed, select=("slide",), workers=workers)
        return read_recording(tmp_path / name / events[-1].results.runs[0].recording).force

    first, again, other = forces(1, "a", 1), forces(1, "b", 0), forces(2, "c", 1)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize(
    ("select", "planned"),
    [
        (["slide"], 1),
        (["s*"], 1),
        (["*"], 3),
        (["*/continuous-contact"], 2),
        (["press/*"], 2),
        (["short/slide"], 1),
        (["slide", "press/continuous-contact"], 2),
    ],
)
def test_a_selection_is_by_case_or_by_check_and_adds_up(short, select, planned):
    assert plan([short], ["constraint"], RunOptions(select=tuple(select))).planned == planned


@pytest.mark.parametrize("select", [["glide"], ["slide", "glide"]])
def test_a_pattern_that_matches_nothing_has_its_own_exit_code(refused, short, select):
    with refused(NothingSelectedError) as at:
        plan([short], ["constraint"], RunOptions(select=tuple(select)))
    assert at.value.exit_code == 4


def test_what_cannot_run_is_refused_before_anything_runs(refused, short, tmp_path):
    with refused(UnknownNameError):
        plan([short], ["constrain"])
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "short.toml").write_text(SUITE)
    with refused(InputError):
        plan([short, str(tmp_path / "other" / "short.toml")], ["constraint"])
    (tmp_path / "bad.toml").write_text(SUITE.replace("position = [0.0, 0.001]", "position = [0.0, nan]"))
    with refused(InputError):
        plan([str(tmp_path / "bad.toml")], ["constraint", "minimum-distance"])
