"""Many cheap jobs with a renderer that draws from the shared generators: whatever changes their seeds changes bytes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import msgspec

from hapticeval.runner.results import read_results

MODULE = """
import os, random, signal, time
from pathlib import Path
import numpy as np
from hapticeval import Response

class Noisy:
    def __init__(self, scene):
        self.stiffness = scene.stiffness
    def reset(self, hip):
        self.last = hip
    def step(self, hip, velocity, dt):
        ihip = np.array([hip[0], max(hip[1], 0.0)])
        lean = np.array([1e-3 * (np.random.random() + random.random()), 1.0])
        return Response(ihip, self.stiffness * (ihip[1] - hip[1]) * lean)

class Slow(Noisy):
    def reset(self, hip):
        time.sleep(0.02)

class Other(Noisy):
    pass

class Killed(Noisy):
    def reset(self, hip):
        Path("killed").open("a").write("x")
        os.kill(os.getpid(), signal.SIGKILL)

class KilledOnce(Noisy):
    def reset(self, hip):
        if not Path("once").exists():
            Path("once").touch()
            os.kill(os.getpid(), signal.SIGKILL)

class KillsWorker(Noisy):
    def reset(self, hip):
        Path("killed").open("a").write("x")
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(3600)
"""

CASE = """
[[case]]
name = "slide-{number}"
title = "Along a plane"
model = {{ kind = "line" }}
checks = ["contact-normal-force", "continuous-contact"]
trajectory = {{ kind = "points", points = [[0.0, -0.001], [0.01, -0.00{depth}]], duration = 0.02 }}
"""

ROWS = """
[[row]]
title = "Slides"
check = "continuous-contact"
cases = ["slide-*"]
"""


def write(folder: Path, cases: int) -> str:
    """Write the module, and a suite of so many cases; its path."""
    (folder / "noisy.py").write_text(MODULE)
    text = 'title = "Many"\n' + ROWS + "".join(CASE.format(number=n, depth=1 + n % 9) for n in range(cases))
    (folder / "many.toml").write_text(text)
    return str(folder / "many.toml")


def found(folder: Path) -> bytes:
    """All that a run found, without the seconds that it took, as bytes; each recording too."""
    results = read_results(folder)
    runs = [msgspec.structs.replace(run, wall_seconds=0.0, step_seconds=None) for run in results.runs]
    files = [(folder / run.recording).read_bytes() for run in results.runs if run.recording]
    return msgspec.json.encode(
        [results.planned, results.ran, results.complete, results.table, results.suites, runs, results.verdicts]
    ) + b"".join(files)


RUN = """
import sys
from hapticeval import api
from hapticeval.commands.terminal import Terminal

scheduler, *renderers = sys.argv[1:]
options = {"workers": 2, "resume": True, "scheduler": scheduler or None, "watch": Terminal()}
api.run(renderers, suites="many.toml", output="out", **options)
"""
"""A run into the folder `out` that goes on with what is there, and draws nothing."""


def start(*renderers: str, here: Path, scheduler: str = "") -> subprocess.Popen[str]:
    """Start `RUN` in the folder, in a group of processes of its own; stdout and stderr are one."""
    return subprocess.Popen(
        [sys.executable, "-c", RUN, scheduler, *renderers],
        cwd=here,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(here)},
    )
