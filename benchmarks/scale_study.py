"""What a job costs beside its own work, and what ten thousand of them take: the numbers of docs/scale.md.

    python benchmarks/scale_study.py --jobs 10000 [--ticks 100] [--workers 2] [--scheduler tcp://HOST:8786] [--report]

Jobs are short slides on a line through a plain renderer in Python. `overhead` is the share of the workers' time that is
no job's: travel, writing, waiting. On a machine that is shared with others it says little, and the processor's time
of this process, which is the client, says more. The peak of memory is the client's as well.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hapticeval import api
from hapticeval.runner.events import Event, JobFinished, RunStarted

RENDERERS = 10

MODULE = """
import numpy as np
from hapticeval import Response

class Slide:
    def __init__(self, scene):
        self.stiffness = scene.stiffness
    def reset(self, hip):
        pass
    def step(self, hip, velocity, dt):
        ihip = np.array([hip[0], max(hip[1], 0.0)])
        return Response(ihip, self.stiffness * (ihip - hip))

""" + "".join(f"class Slide{number}(Slide): pass\n" for number in range(RENDERERS))

CASE = """
[[case]]
name = "slide-{number}"
title = "Along a plane"
model = {{ kind = "line" }}
checks = ["contact-normal-force", "continuous-contact", "force-magnitude"]
trajectory = {{ kind = "points", points = [[0.0, -0.001], [0.0{number:05}, -0.001]], duration = {duration} }}
"""


def measure(folder: Path, jobs: int, ticks: int, workers: int, scheduler: str | None, report: bool) -> dict[str, Any]:
    """Run so many jobs of so many ticks, and return what it took."""
    cases = max(jobs // RENDERERS, 1)
    (folder / "slides.py").write_text(MODULE)
    suite = 'title = "Slides"\n' + "".join(
        CASE.format(number=1 + number, duration=1e-3 * ticks) for number in range(cases)
    )
    (folder / "slides.toml").write_text(suite)
    sys.path.insert(0, str(folder))
    times: dict[str, float] = {}

    def watch(event: Event) -> None:
        if isinstance(event, RunStarted):
            times["planned"] = time.perf_counter()
        elif isinstance(event, JobFinished):
            times.setdefault("first", time.perf_counter())

    begun, busy = time.perf_counter(), -1e3 * time.process_time()
    names = [f"slides:Slide{number}" for number in range(RENDERERS)]
    options: dict[str, Any] = {"suites": str(folder / "slides.toml"), "output": folder / "out", "watch": watch}
    results = api.run(names, workers=workers, scheduler=scheduler, **options)
    ended, busy = time.perf_counter(), busy + 1e3 * time.process_time()
    work = sum(run.wall_seconds for run in results.document.runs)
    found: dict[str, Any] = {
        "jobs": len(results.document.runs),
        "verdicts": len(results.verdicts),
        "complete": results.complete,
        "seconds of planning": times["planned"] - begun,
        "seconds of running": ended - times["planned"],
        "seconds to the first job": times["first"] - times["planned"],
        "seconds of the jobs' own work": work,
        "ms a job": 1e3 * (ended - begun) / len(results.document.runs),
        "ms of the client's processor a job": busy / len(results.document.runs),
        "overhead": 1.0 - work / workers / (ended - times["first"]),
        "MB of results.json": (folder / "out" / "results.json").stat().st_size / 1e6,
    }
    if report:
        before = time.perf_counter()
        results.report()
        found["seconds of the report"] = time.perf_counter() - before
    found["MB of the client"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure as the arguments ask, and print what was found as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=1000)
    parser.add_argument("--ticks", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2, help="of this machine, or how many threads a cluster has")
    parser.add_argument("--scheduler")
    parser.add_argument("--folder", type=Path, help="where workers of the cluster import from")
    parser.add_argument("--report", action="store_true")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as made:
        folder = given.folder or Path(made)
        found = measure(folder, given.jobs, given.ticks, given.workers, given.scheduler, given.report)
    print(json.dumps({name: round(each, 4) for name, each in found.items()}, indent=1))


if __name__ == "__main__":
    main()
