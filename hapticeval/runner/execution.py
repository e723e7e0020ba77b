"""A plan carried out: its jobs over processes, its events in order, and what an interrupt leaves of it."""

from __future__ import annotations

import math
import shlex
import shutil
from collections.abc import Iterator
from contextlib import nullcontext
from itertools import islice
from pathlib import Path

from hapticeval.errors import RendererError
from hapticeval.runner.events import Event, Interrupted, RunFinished, RunStarted
from hapticeval.runner.interrupts import Interrupts
from hapticeval.runner.judging import error_verdicts
from hapticeval.runner.planning import Job, Plan
from hapticeval.runner.progress import Progress
from hapticeval.runner.work import Done, Work, run_job
from hapticeval.workers import Answer, Ended, Overdue, Workers

PATIENCE = 0.1
"""Seconds after which an interrupt is seen at the latest."""


def execute(
    plan: Plan, directory: Path | None, *, workers: int = 2, work: Work = run_job, timeout: float = math.inf
) -> Iterator[Event]:
    """Run the plan in `workers` processes, and keep results.json in `directory` up to date while it goes on.

    Each job is run and judged as its case says, or by another `work`. Without a directory nothing is written, and the
    events bring the recordings. With 0 workers jobs run in this process. Elsewhere a job that takes longer than
    `timeout` seconds is ended, and its verdicts are errors.

    Events come in the order of the plan. A renderer that ends its process makes its own verdicts errors. On Ctrl-C no
    further job begins, those that have begun are finished, and `Interrupted` reports it; on a second one, or in this
    process, they are given up. What has finished is kept, the results say that they are incomplete and why, and
    `RunFinished` is still the last event.
    """
    waiting = iter(enumerate(plan.jobs))
    finished: dict[int, Done] = {}
    added = 0
    warned = False
    with Interrupts() as interrupts:
        if directory is not None:
            directory.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(directory / "recordings", ignore_errors=True)  # of an earlier run, whose results go as well
        yield RunStarted(plan.planned, len(plan.jobs))
        progress = Progress(plan, directory)
        with Workers(work, workers) as crew:
            while True:
                if not interrupts.count:
                    try:
                        with nullcontext() if workers else interrupts.raised():
                            for number, job in islice(waiting, crew.free):
                                crew.begin(number, job, directory, plan.seed)
                    except KeyboardInterrupt:
                        yield Interrupted(1, at_once=True)
                        break
                while added in finished:
                    yield progress.add(plan.jobs[added], *finished.pop(added))
                    added += 1
                if interrupts.count and not warned:
                    yield Interrupted(crew.busy)
                    warned = True
                if not crew.busy:
                    break
                for answer in (*crew.answers(PATIENCE), *crew.give_up(timeout)):
                    finished[answer.call] = _done(answer, plan.jobs[answer.call], timeout)
                if interrupts.count > 1 and crew.busy:
                    yield Interrupted(crew.busy, at_once=True)
                    break
        for number in sorted(finished):
            yield progress.add(plan.jobs[number], *finished[number])
            added += 1
        yield RunFinished(progress.finish("interrupted by the user" if added < len(plan.jobs) else None))


def _done(answer: Answer[Done], job: Job, timeout: float) -> Done:
    """What came of a job; a renderer that ends the process, or takes too long, is a broken renderer."""
    alone = f"run the case alone under a debugger: -k {job.case.name}"
    if isinstance(answer.error, Ended):
        error = RendererError(
            f"the renderer ended the process that it ran in: {answer.error.how}",
            why="a crash in compiled code, os._exit(), or memory that ran out",
            todo=f"see what `hapticeval doctor -r {shlex.quote(job.renderer)}` finds, or {alone}",
        )
        return error_verdicts(error, job.renderer, job.suite, job.case), None
    if isinstance(answer.error, Overdue):
        error = RendererError(
            f"the renderer was ended after {timeout:g} s in this case",
            why="it hangs, or takes longer than --timeout",
            todo=f"give it more time with --timeout, or {alone}",
        )
        return error_verdicts(error, job.renderer, job.suite, job.case), None
    if answer.error is not None:
        raise answer.error
    assert answer.value is not None
    return answer.value
