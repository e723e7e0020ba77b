"""The runner: the stream, what is kept when something dies, and that the same command gives the same verdicts."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pytest

from hapticeval.errors import NothingSelectedError, UnknownNameError
from hapticeval.events import JobFinished, RunFinished, RunStarted
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.hdf5 import read_recording
from hapticeval.results import read_results
from hapticeval.runner import execute, plan

MODULE = """
import os, random
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
        return Response(answer.ihip, answer.force * (1 + 1e-3 * np.random.random()))

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
    assert [(event.case, event.renderer) for event in events[1:-1]] == [
        ("press", "thirdparty:Good"),
        ("press", "constraint"),
        ("slide", "thirdparty:Good"),
        ("slide", "constraint"),
    ]
    assert isinstance(events[-1], RunFinished)
    results = read_results(tmp_path / "out")
    assert (results.planned, results.ran, results.complete) == (6, 6, True)
    for entry in results.runs:
        recording = read_recording(tmp_path / "out" / entry["recording"])
        assert len(recording) == 201
        assert entry["simulated_seconds"] >= 0.2


def test_a_renderer_that_breaks_does_not_take_the_others_along(short, tmp_path):
    events = run(short, ["thirdparty:Raises", "constraint"], tmp_path / "out")
    jobs = {(event.case, event.renderer): event for event in events if isinstance(event, JobFinished)}
    broken = jobs["slide", "thirdparty:Raises"]
    assert "out of its depth" in str(broken.error)
    assert broken.error.exit_code == 3
    assert broken.error.hip[0] < -0.03
    assert {verdict.outcome for verdict in broken.verdicts} == {Outcome.ERROR}
    assert jobs["press", "thirdparty:Raises"].error is None
    assert jobs["slide", "constraint"].error is None
    assert events[-1].results.complete


def test_what_is_no_renderer_is_said(short, tmp_path):
    events = run(short, ["thirdparty:no_renderer"], tmp_path / "out")
    assert "int" in str(events[1].error)
    assert events[1].error.exit_code == 2


def test_a_process_that_dies_leaves_what_had_finished(short, tmp_path):
    chosen = plan([short], ["constraint", "thirdparty:Dies"])
    events = list(execute(chosen, tmp_path / "out", workers=1))
    assert isinstance(events[-1], RunFinished)
    results = read_results(tmp_path / "out")
    assert not results.complete
    assert "died" in results.reason
    assert results.ran < results.planned


def test_an_interrupt_keeps_what_had_finished(short, tmp_path, monkeypatch):
    stream = execute(plan([short], ["constraint", "minimum-distance"]), tmp_path / "out", workers=1)
    assert isinstance(next(stream), RunStarted)
    assert isinstance(next(stream), JobFinished)
    stream_end = [stream.throw(KeyboardInterrupt), *stream]
    assert isinstance(stream_end[-1], RunFinished)
    results = read_results(tmp_path / "out")
    assert results.reason == "interrupted by the user"
    assert 0 < results.ran <= results.planned
    assert not results.complete


def test_the_seed_makes_a_random_renderer_repeatable(short, tmp_path):
    def forces(seed, name):
        events = run(short, ["thirdparty:Noisy"], tmp_path / name, seed=seed)
        entry = events[-1].results.runs[1]
        return read_recording(tmp_path / name / entry["recording"]).force

    first, again, other = forces(1, "a"), forces(1, "b"), forces(2, "c")
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize(
    ("select", "planned"), [("slide", 1), ("s*", 1), ("*", 3), ("*/continuous-contact", 2), ("press/*", 2)]
)
def test_a_selection_is_by_case_or_by_check(short, select, planned):
    assert plan([short], ["constraint"], select=select).planned == planned


def test_nothing_selected_has_its_own_exit_code(short):
    with pytest.raises(NothingSelectedError) as caught:
        plan([short], ["constraint"], select="glide")
    assert caught.value.exit_code == 4
    assert "press, slide" in str(caught.value)


def test_unknown_renderers_are_refused_before_anything_runs(short):
    with pytest.raises(UnknownNameError, match="constraint"):
        plan([short], ["constrain"])
