"""A plan carried out: its jobs over processes, its events in order, and what an interrupt leaves of it."""

from __future__ import annotations

import math
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TypeAlias, TypeVar

from hapticeval.errors import InputError
from hapticeval.extras import install_command
from hapticeval.files import replacing
from hapticeval.runner.events import AtWork, Event, Interrupted, JobFinished, RunFinished, RunStarted, WorkerRefused
from hapticeval.runner.interrupts import Interrupts
from hapticeval.runner.outcome import carry_out_afar, carry_out_here, outcome_of_ended, outcome_of_overdue
from hapticeval.runner.outcomes import Outcomes
from hapticeval.runner.planning import Job, Plan
from hapticeval.runner.progress import Progress
from hapticeval.runner.results import RunKey
from hapticeval.runner.work import Work, derived_seed, run_job
from hapticeval.suite.files import files_of
from hapticeval.workers import TRIES, Answer, Crew, Ended, LostError, Overdue, Workers

T = TypeVar("T")

JobAndFile: TypeAlias = tuple[JobFinished, bytes | None]
"""A finished job, and its recording as a file's bytes where the machine that did it cannot see the result folder."""

PATIENCE = 0.1
"""Seconds after which an interrupt is seen at the latest."""

BEAT = 10.0
"""Seconds between two reports of what is at work."""

STOPPED_AT_FIRST = "it ends at the first verdict that stops the gate (-x)"
"""Why a run is incomplete whose plan has `exit_first`."""


def execute(
    plan: Plan,
    directory: Path | None,
    *,
    workers: int = 2,
    work: Work = run_job,
    timeout: float = math.inf,
    scheduler: str | None = None,
    earlier_jobs: Mapping[RunKey, JobFinished] | None = None,
) -> Iterator[Event]:
    """Run the plan, yield what happens as events, and keep results.json in `directory` up to date meanwhile.

    - `directory`: None to write nothing; the events then bring the recordings.
    - `workers`: how many processes do the jobs; with 0 they run in this process.
    - `work`: what is done with a job; if not given, it is run and judged as its case says.
    - `timeout`: seconds after which a job is ended, its verdicts errors; not in this process.
    - `scheduler`: address of a dask scheduler, whose cluster then does the jobs.
    - `earlier_jobs`: what an earlier run into the directory has finished, see `resuming.finished_jobs`.

    What comes of a job depends on none of these, nor on the order in which jobs end: each has a seed of its own.
    Events come in the order of the plan, and the last one is always `RunFinished`.

    A run that is cut short keeps what has finished, and its results say that they are incomplete and why:

    - On Ctrl-C no further job begins, those that have begun are finished, and `Interrupted` reports it.
    - On a second Ctrl-C, or on the first in this process, they are given up.
    - With the plan's `exit_first` no further job begins after a verdict that stops the gate.
    - Where the scheduler is lost nothing more can be done.

    A renderer that ends its process makes its own verdicts errors, and the run goes on.
    """
    # Finished jobs by their number in the plan, until those before them are reported.
    known_jobs = earlier_jobs or {}
    finished = {at: known_jobs[job.key] for at, job in enumerate(plan.jobs) if job.key in known_jobs}
    earlier_numbers = set(finished)
    waiting = iter([(at, job) for at, job in enumerate(plan.jobs) if at not in earlier_numbers])
    reported_count = 0
    begun_at: dict[int, float] = {}
    reported = time.monotonic()
    warned = stopped = False
    lost_error: LostError | None = None
    with Interrupts() as interrupts:
        with _crew(work, workers, scheduler, plan, timeout) as crew, Outcomes(directory) as outcomes:
            # What is in the folder is of an earlier run, whose results go as well.
            if directory is not None and earlier_jobs is None:
                shutil.rmtree(directory / "recordings", ignore_errors=True)
                outcomes.clear()
            jobs_of = Counter(job.suite for at, job in enumerate(plan.jobs) if at not in earlier_numbers)
            unplanned = plan.known.unplanned(plan.renderers, [suite.name for suite in plan.suites])
            remarks = unplanned + plan.known.unsized()
            yield RunStarted(plan.planned, len(plan.jobs), len(earlier_numbers), jobs_of, remarks)
            progress = Progress(plan, directory)
            # Each turn begins jobs, reports in the plan's order what has finished, and waits a little for answers.
            while True:
                if not interrupts.count and not stopped:
                    try:
                        # Without processes `begin` does the job itself, and only an exception can interrupt that.
                        with nullcontext() if workers else interrupts.raised():
                            for number, job in islice(waiting, crew.free):
                                begun_at[number] = time.monotonic()
                                crew.begin(number, job, directory, derived_seed(plan.seed, *job.key))
                    except KeyboardInterrupt:
                        yield Interrupted(1, at_once=True)
                        break
                # Jobs end in any order: a slow one holds back the reports of those behind it.
                while reported_count in finished:
                    marked_job = progress.add(finished[reported_count])
                    if reported_count not in earlier_numbers:
                        yield marked_job
                    del finished[reported_count]
                    reported_count += 1
                if interrupts.count and not warned:
                    yield Interrupted(crew.busy)
                    warned = True
                # All that could begin has ended: the plan is done, or no further job may begin.
                if not crew.busy:
                    break
                try:
                    answers = [*crew.answers(PATIENCE), *crew.give_up(timeout)]
                except LostError as error:
                    lost_error = error
                    break
                for answer in answers:
                    begun_at.pop(answer.call, None)
                    finished[answer.call] = done = _finished_job(answer, plan.jobs[answer.call], directory, timeout)
                    # Written before its turn in the plan comes: a run that is killed now has it.
                    outcomes.add(done)
                    stopped |= plan.exit_first and progress.stops(done)
                yield from (WorkerRefused(*refusal) for refusal in crew.refused())
                now = time.monotonic()
                if begun_at and now - reported >= BEAT:
                    reported = now
                    runs = tuple(plan.jobs[number].key for number in begun_at)
                    yield AtWork(reported_count + len(finished), runs, now - min(begun_at.values()))
                # A second Ctrl-C: leaving the block ends the processes, without waiting for their jobs.
                if interrupts.count > 1 and crew.busy:
                    yield Interrupted(crew.busy, at_once=True)
                    break
        # What has finished behind a job that never did.
        for number in sorted(finished):
            marked_job = progress.add(finished[number])
            if number not in earlier_numbers:
                yield marked_job
            reported_count += 1
        reason = None
        if reported_count < len(plan.jobs):
            reason = "interrupted by the user" if interrupts.count or not stopped else STOPPED_AT_FIRST
            reason = reason if lost_error is None else f"{lost_error.what}, and --resume goes on"
        results = progress.finish(reason)
        if results.complete:
            outcomes.forget()
        yield RunFinished(results)


def _crew(work: Work, workers: int, scheduler: str | None, plan: Plan, timeout: float) -> Crew[JobAndFile]:
    """Return the crew that does the jobs of a plan; workers of a cluster must have all files of its cases."""
    if scheduler is None:
        return crew_of(partial(carry_out_here, work), workers)
    cases = {(job.suite, job.case.name): job.case for job in plan.jobs}
    files = {path: digest for case in cases.values() for path, digest in files_of(case).items()}
    return crew_of(partial(carry_out_afar, work), 0, scheduler, timeout=timeout, files=files)


def crew_of(
    function: Callable[..., T],
    workers: int,
    scheduler: str | None = None,
    *,
    timeout: float = math.inf,
    files: Mapping[str, str] | None = None,
) -> Crew[T]:
    """Return what calls a function: so many processes, or the workers of the dask scheduler at an address.

    See `Cluster` for `timeout` and `files`. Raises `InputError` where dask.distributed is missing.
    """
    if scheduler is None:
        return Workers(function, workers, tries=TRIES)
    try:
        from hapticeval.runner.cluster import Cluster
    except ImportError as error:
        raise InputError(
            f"--scheduler {scheduler} needs dask.distributed", why=str(error), todo=install_command("cluster")
        ) from error
    return Cluster(function, scheduler, timeout=timeout, files=files)


def _finished_job(answer: Answer[JobAndFile], job: Job, directory: Path | None, timeout: float) -> JobFinished:
    """Return what came of a job, from its answer, with its recording put into the result folder."""
    if isinstance(answer.error, Ended):
        return outcome_of_ended(job, answer.error)
    if isinstance(answer.error, Overdue):
        return outcome_of_overdue(job, timeout, answer.error)
    # What a renderer does wrong is in its verdicts: this is a fault of the framework.
    if answer.error is not None:
        raise answer.error
    assert answer.value is not None
    finished, content = answer.value
    # The job ran where this folder cannot be seen: its recording's file came as bytes.
    if content is not None and directory is not None and finished.run.recording is not None:
        with replacing(directory / finished.run.recording) as temporary:
            temporary.write_bytes(content)
    return finished
