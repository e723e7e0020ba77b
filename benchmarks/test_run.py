"""The whole suite against real time, and how soon the command answers."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from hapticeval.discovery import own_renderers
from hapticeval.runner.execution import execute
from hapticeval.runner.planning import RunOptions, plan

DIRECT = (sys.executable, "-c")


def run_suite(directory: Path) -> float:
    *_, finished = execute(plan(["thesis"], own_renderers(), RunOptions(output=directory, workers=2)))
    return float(finished.results.timing.times_real_time)


@pytest.mark.slow
def test_the_thesis_suite_on_all_reference_renderers(benchmark, tmp_path):
    """Simulated seconds a wall second, all renderers added up, compiled code warm: at least 100."""
    run_suite(tmp_path / "warm")
    speeds = []
    benchmark.pedantic(lambda: speeds.append(run_suite(tmp_path / "out")), rounds=3)
    benchmark.extra_info["times_real_time"] = sorted(speeds)


@pytest.mark.parametrize(
    ("what", "command"),
    [
        ("bare interpreter", (*DIRECT, "pass")),
        ("import hapticeval: under 0.5 s", (*DIRECT, "import hapticeval")),
        ("hapticeval --help: under 1 s", (sys.executable, "-m", "hapticeval", "--help")),
    ],
)
def test_how_soon_it_answers(benchmark, what, command):
    benchmark.extra_info["what"] = what
    benchmark.pedantic(lambda: subprocess.run(command, check=True, capture_output=True), rounds=5, warmup_rounds=1)
