"""A plan carried out: its jobs over processes, its events in order, and what an interrupt leaves of it."""

from __future__ import annotations

import shutil
from collections import Counter
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
from hapticeval.workers import Answer, Ended, Workers

PATIENCE = 0.1
"""Seconds after which an interrupt is seen at the latest."""


def execute(plan: Plan, directory: Path | None, *, workers: int = 2, work: Work = run_job) -> Iterator[Event]:
    """Run the plan in `workers` processes, and keep results.json in `directory` up to date while it goes on.

    Each job is run and judged as its case says, or by another `work`. Without a directory nothing is written, and the
    events bring the recordings. With 0 workers jobs run in this process.

    Events come in the order of the plan. A renderer that ends its process makes its own verdicts errors. On Ctrl-C no
    further job begins, those that have begun are finished, and `Interrupted` reports it; on a second one, or in this
    process, they are given up. After a verdict that stops the gate no further job begins either, where the plan has
    `exit_first`. What has finished is kept, the results say that they are incomplete and why, and `RunFinished` is
    still the last event.
    """
    waiting = iter(enumerate(plan.jobs))
    finished: dict[int, Done] = {}
    added = 0
    warned = stopped = False
    with Interrupts() as interrupts:
        if directory is not None:
            directory.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(directory / "recordings", ignore_errors=True)  # of an earlier run, whose results go as well
        yield RunStarted(plan.planned, len(plan.jobs), Counter(job.suite for job in plan.jobs))
        progress = Progress(plan, directory)
        with Workers(work, workers) as crew:
            while True:
                if not interrupts.count and not stopped:
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
                for answer in crew.answers(PATIENCE):
                    finished[answer.call] = done = _done(answer, plan.jobs[answer.call])
                    stopped |= plan.exit_first and progress.stops(done[0])
                if interrupts.count > 1 and crew.busy:
                    yield Interrupted(crew.busy, at_once=True)
                    break
        for number in sorted(finished):
            yield progress.add(plan.jobs[number], *finished[number])
            added += 1
        why = "interrupted by the user" if interrupts.count else "it ends at the first verdict that stops the gate (-x)"
        yield RunFinished(progress.finish(why if added < len(plan.jobs) else None))


def _done(answer: Answer[Done], job: Job) -> Done:
    """What came of a job; a renderer that ends the process is a broken renderer."""
    if isinstance(answer.error, Ended):
        error = RendererError(
            "the renderer ended the process that it ran in",
            why="a crash in compiled code, os._exit(), or memory that ran out",
            todo="run it alone under a debugger: python -X faulthandler",
        )
        return error_verdicts(error, job.renderer, job.suite, job.case), None
    if answer.error is not None:
        raise answer.error
    assert answer.value is not None
    return answer.value
