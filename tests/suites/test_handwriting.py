"""A real human stroke, scaled onto the Cassinian, goes through every reference renderer."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
import pytest

from hapticeval.discovery import own_renderers
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.events import JobFinished
from hapticeval.runner.execution import execute
from hapticeval.runner.planning import RunOptions, plan

STROKE = FilePath(__file__).parents[3] / "shared" / "data" / "handwriting_svc" / "signal.svc"

SUITE = """
title = "a human stroke"
[[case]]
name = "stroke"
title = "A pen stroke across the Cassinian"
model = { kind = "cassinian" }
checks = ["continuous-contact", "contact-normal-force", "memoryless"]
trajectory = { kind = "file", path = "stroke.csv" }
"""


def longest_stroke():
    """Time (s) and position (m) of the longest pen-down stretch, centred and scaled to 180 mm across."""
    rows = np.loadtxt(STROKE, skiprows=1)
    down = np.concatenate([[0], (rows[:, 3] == 1).astype(int), [0]])
    starts, ends = np.flatnonzero(np.diff(down) == 1), np.flatnonzero(np.diff(down) == -1)
    longest = int(np.argmax(ends - starts))
    stretch = rows[starts[longest] : ends[longest]]
    points = stretch[:, :2] - 0.5 * (stretch[:, :2].max(axis=0) + stretch[:, :2].min(axis=0))
    return stretch[:, 2] - stretch[0, 2], points * (0.18 / np.ptp(points, axis=0).max())


@pytest.mark.skipif(not STROKE.exists(), reason="needs shared/data/handwriting_svc beside the repository")
def test_a_pen_stroke_runs_through_every_reference_renderer(tmp_path):
    time, points = longest_stroke()
    table = np.column_stack([time, points])
    np.savetxt(tmp_path / "stroke.csv", table, delimiter=",", header="t,x,y", comments="")
    (tmp_path / "stroke.toml").write_text(SUITE)
    *events, last = execute(
        plan([str(tmp_path / "stroke.toml")], own_renderers(), RunOptions(output=tmp_path / "out", workers=0))
    )
    assert last.results.complete
    jobs = [event for event in events if isinstance(event, JobFinished)]
    assert {job.run.renderer for job in jobs} == set(own_renderers())
    for job in jobs:
        assert job.error is None
        outcomes = {verdict.check: verdict.outcome for verdict in job.verdicts}
        decided = {Outcome.PASS, Outcome.FAIL}
        assert {outcomes["continuous-contact"], outcomes["contact-normal-force"]} <= decided, outcomes
