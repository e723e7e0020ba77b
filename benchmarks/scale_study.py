"""What a job costs beside its own work, and what ten thousand of them take: the numbers of docs/scale.md.

    python benchmarks/scale_study.py --jobs 10000 [--ticks 100] [--workers 2] [--cluster] [--report]

Jobs are short slides on a line through a plain renderer in Python. Seconds are the processor's, which others on the
machine disturb little, unless they are named "of the clock". The jobs' own are what their processes spend on judging
and on writing recordings; the overhead is what all processes spend beyond that: this one, which is the client, the
workers and, with `--cluster`, a dask scheduler. A run of one job a worker gives its fixed part: imports, and what a
process loads for its first job. `idle` is the share of the time between its first job and its last that a worker
neither computes nor waits for a processor. The peak of memory is the client's.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil

from hapticeval import api
from hapticeval.runner.events import Event, RunFinished

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "tests" / "runner"))
from clusters import Cluster  # noqa: E402 - of the tests

RENDERERS = 10

MODULE = """
import functools, os, time
from pathlib import Path
import numpy as np
from hapticeval import Response
from hapticeval.runner import work

class Slide:
    def __init__(self, scene):
        self.stiffness = scene.stiffness
    def reset(self, hip):
        pass
    def step(self, hip, velocity, dt):
        ihip = np.array([hip[0], max(hip[1], 0.0)])
        return Response(ihip, self.stiffness * (ihip - hip))

@functools.cache
def files(pid):
    notes = os.open(Path(__file__).with_name(f"{pid}.times"), os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    return notes, os.open(f"/proc/{pid}/schedstat", os.O_RDONLY)

def clocked(place, name, column):
    # have a function of a job note what it takes, in one of two columns, and when it ends
    function = getattr(place, name)
    @functools.wraps(function)
    def call(*arguments, **options):
        begun = time.process_time()
        done = function(*arguments, **options)
        took = time.process_time() - begun
        notes, schedule = files(os.getpid())
        busy, waited = map(int, os.pread(schedule, 99, 0).split()[:2])
        columns = (0.0, took) if column else (took, 0.0)
        os.write(notes, b"%g %g %r %r\\n" % (*columns, time.monotonic(), 1e-9 * (busy + waited)))
        return done
    setattr(place, name, call)

clocked(work, "judge", 0)
clocked(work, "write_recording", 1)
clocked(work, "recording_bytes", 1)
""" + "".join(f"class Slide{number}(Slide): pass\n" for number in range(RENDERERS))

CASE = """
[[case]]
name = "slide-{number}"
title = "Along a plane"
model = {{ kind = "line" }}
checks = ["contact-normal-force", "continuous-contact", "force-magnitude"]
trajectory = {{ kind = "points", points = [[0.0, -0.001], [0.0{number:05}, -0.001]], duration = {duration} }}
"""


class Spent(NamedTuple):
    """Seconds of one run: of the processor, but for `clock`."""

    clock: float
    all: float
    client: float
    judging: float
    keeping: float
    idle: float
    results: api.Results

    @property
    def own(self) -> float:
        """What the jobs themselves take."""
        return self.judging + self.keeping


def processor() -> float:
    """Return the seconds that this process and all below it have spent, the ended that were waited for included."""
    here = psutil.Process()
    return float(sum(sum(process.cpu_times()[:4]) for process in [here, *here.children(recursive=True)]))


def spend(folder: Path, cases: int, renderers: int, ticks: int, workers: int, cluster: bool) -> Spent:
    """Run so many cases of so many ticks through so many renderers, and leave the results in `folder`/out."""
    text = "".join(CASE.format(number=1 + number, duration=1e-3 * ticks) for number in range(cases))
    (folder / "slides.toml").write_text(f'title = "Slides"\n{text}')
    begun = {"clock": time.perf_counter(), "all": processor(), "client": time.process_time()}
    taken: dict[str, float] = {}

    def watch(event: Event) -> None:
        if isinstance(event, RunFinished):  # the cluster's processes are still there
            taken.update(clock=time.perf_counter(), all=processor(), client=time.process_time())

    with Cluster(folder, workers) if cluster else nullcontext() as there:
        names = [f"slides:Slide{number}" for number in range(renderers)]
        options: dict[str, Any] = {"workers": workers, "scheduler": None if there is None else there.address}
        results = api.run(names, suites=str(folder / "slides.toml"), output=folder / "out", watch=watch, **options)
    times_of_workers = []
    for file in folder.glob("*.times"):
        times_of_workers.append(np.loadtxt(file, ndmin=2))
        file.unlink()
    judging, keeping = np.vstack(times_of_workers)[:, :2].sum(axis=0)
    span, used = np.sum([rows[-1, 2:] - rows[0, 2:] for rows in times_of_workers], axis=0)
    spent = {name: taken[name] - begun[name] for name in begun}
    return Spent(**spent, judging=judging, keeping=keeping, idle=1.0 - used / span, results=results)


def measure(jobs: int, ticks: int, workers: int, cluster: bool, report: bool) -> dict[str, Any]:
    """Run so many jobs of so many ticks, and return what it took."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        sys.path.insert(0, temporary)
        (folder / "slides.py").write_text(MODULE)
        fixed = spend(folder, workers, 1, ticks, workers, cluster)
        spent = spend(folder, max(jobs // RENDERERS, 1), RENDERERS, ticks, workers, cluster)
        runs = len(spent.results.document.runs)
        more = spent.all - spent.own - (fixed.all - fixed.own)
        figures: dict[str, Any] = {
            "jobs": runs,
            "verdicts": len(spent.results.verdicts),
            "complete": spent.results.complete,
            "seconds of the clock": spent.clock,
            "seconds of all processes": spent.all,
            "seconds of the client": spent.client,
            "the jobs' own seconds": spent.own,
            "ms of a job's own": 1e3 * spent.own / runs,
            "of them for its recording": 1e3 * spent.keeping / runs,
            "seconds of overhead, fixed": fixed.all - fixed.own,
            "ms of overhead, a job": 1e3 * more / (runs - workers),
            "overhead, fixed part included": spent.all / spent.own - 1.0,
            "overhead, a job": more / (spent.own - fixed.own),
            "idle": spent.idle,
            "MB of results.json": (folder / "out" / "results.json").stat().st_size / 1e6,
            "MB of the client": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
        }
        if report:
            before, begun = processor(), time.perf_counter()
            spent.results.report()
            figures["seconds of the report"] = processor() - before
            figures["seconds of the report, of the clock"] = time.perf_counter() - begun
            figures["MB of the client with the report"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return figures


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure as the arguments ask, and print what was found as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=1000)
    parser.add_argument("--ticks", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--cluster", action="store_true", help="on a dask scheduler and workers of this machine")
    parser.add_argument("--report", action="store_true")
    options = parser.parse_args(arguments)
    os.environ.setdefault("DASK_CONFIG", str(ROOT / "examples" / "dask.yaml"))
    figures = measure(options.jobs, options.ticks, options.workers, options.cluster, options.report)
    print(json.dumps({name: round(figure, 4) for name, figure in figures.items()}, indent=1))


if __name__ == "__main__":
    main()
