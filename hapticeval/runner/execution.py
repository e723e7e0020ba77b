"""A plan carried out: its jobs over processes, its events in order, and what an interrupt leaves of it."""

from __future__ import annotations

import math
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import TypeAlias, TypeVar

from hapticeval.errors import InputError
from hapticeval.extras import install_command
from hapticeval.files import replacing
from hapticeval.runner.events import AtWork, Event, Interrupted, JobFinished, RunFinished, RunStarted, WorkerRefused
from hapticeval.runner.interrupts import Interrupts
from hapticeval.runner.planning import Job, Plan, RunOptions
from hapticeval.runner.progress import Progress
from hapticeval.runner.results import RunKey
from hapticeval.runner.resuming import EarlierRun, Outcomes, describe_replaced_run
from hapticeval.runner.work import Work, carry_out, derived_seed, finished_by_end, finished_by_timeout, run_job
from hapticeval.suite.suite import files_of
from hapticeval.workers import TRIES, Answer, Crew, LostError, Overdue, ProcessEnded, Workers, default_workers

T = TypeVar("T")

JobAndFile: TypeAlias = tuple[JobFinished, bytes | None]
"""A finished job, and its recording as a file's bytes where the machine that did it cannot see the result folder."""

INTERRUPT_SECONDS = 0.1
"""Seconds after which an interrupt is seen at the latest."""

BEAT = 10.0
"""Seconds between two reports of what is at work."""

FINISH_GRACE = 5.0
"""Seconds in which runs that have begun may finish after Ctrl-C: one that hangs never would."""

STOPPED_AT_FIRST = "it ends at the first verdict that stops the gate (-x)"
"""Why a run is incomplete whose plan has `exit_first`."""


def execute(plan: Plan, *, work: Work = run_job, earlier: EarlierRun | None = None) -> Iterator[Event]:
    """Run the plan as its options say, yield what happens as events, and keep results.json up to date meanwhile.

    - `work`: what is done with a job; if not given, it is run and judged as its case says.
    - `earlier`: what an earlier run into the folder has finished, see `resuming.read_earlier_run`.

    Without a folder nothing is written, and the events bring the recordings. What comes of a job depends neither on who
    does it nor on the order in which jobs end: each has a seed of its own. Events come in the order of the plan, and
    the last one is always `RunFinished`.

    A run that is cut short keeps what has finished, and its results say that they are incomplete and why:

    - On Ctrl-C no further job begins, those that have begun are finished, and `Interrupted` reports it.
    - After `FINISH_GRACE`, on a second Ctrl-C, or on the first in this process, they are given up.
    - With `exit_first` no further job begins after a verdict that stops the gate.
    - Where the scheduler is lost nothing more can be done.

    A renderer that ends its process makes its own verdicts errors, and the run goes on.
    """
    output = plan.options.output
    with Interrupts() as interrupts:
        with _crew(work, plan) as crew, Outcomes(output) as outcomes:
            replaced = ""
            # What is in the folder is of an earlier run, whose results go as well.
            if output is not None and earlier is None:
                replaced = describe_replaced_run(output)
                shutil.rmtree(output / "recordings", ignore_errors=True)
                outcomes.clear()
            execution = _Execution(plan, crew, outcomes, interrupts, earlier.jobs if earlier else {})
            yield execution.opening(replaced)
            execution.progress = Progress(plan, earlier_seconds=earlier.wall_seconds if earlier else 0.0)
            cut_by: BaseException | None = None
            try:
                # Each turn begins jobs, reports in the plan's order what has finished, and waits a little for answers.
                execution.begin_jobs()
                yield from execution.report()
                while crew.busy:
                    yield from execution.take_answers()
                    execution.begin_jobs()
                    yield from execution.report()
            except KeyboardInterrupt as interrupt:
                cut_by = interrupt
                yield Interrupted(max(crew.busy, 1), at_once=True, runs=execution.runs_at_work)
            except LostError as error:
                cut_by = error
        # Leaving the block above has ended the processes, without waiting for their jobs.
        yield from execution.report_behind_gaps()
        results = execution.progress.finish(execution.reason(cut_by))
        if results.complete:
            outcomes.forget()
        yield RunFinished(results)


class _Execution:
    """The state of a run: which jobs wait, are worked on, or are finished and not reported yet."""

    progress: Progress
    """Takes what is reported; made when the run has been announced, for it looks commits up."""

    def __init__(
        self,
        plan: Plan,
        crew: Crew[JobAndFile],
        outcomes: Outcomes,
        interrupts: Interrupts,
        earlier_jobs: Mapping[RunKey, JobFinished],
    ) -> None:
        self.plan, self.crew, self.outcomes, self.interrupts = plan, crew, outcomes, interrupts
        # Finished jobs by their number in the plan, until those before them are reported.
        self.finished = {at: earlier_jobs[job.key] for at, job in enumerate(plan.jobs) if job.key in earlier_jobs}
        self.earlier_numbers = frozenset(self.finished)
        self.waiting = iter([(at, job) for at, job in enumerate(plan.jobs) if at not in self.earlier_numbers])
        self.reported_count = 0
        self.begun_at: dict[int, float] = {}
        self.last_beat = time.monotonic()
        self.warning_places: set[str] = set()
        self.warned = self.stopped = False
        self.given_up_at = math.inf

    @property
    def runs_at_work(self) -> tuple[RunKey, ...]:
        """The runs that have begun and are not finished, the first one first."""
        return tuple(self.plan.jobs[number].key for number in self.begun_at)

    def opening(self, replaced: str) -> RunStarted:
        """Return the first event, of what is planned, and of the earlier run that is `replaced`."""
        plan = self.plan
        jobs_of = Counter(job.suite for at, job in enumerate(plan.jobs) if at not in self.earlier_numbers)
        remarks = plan.known.remarks(plan.renderers, [suite.name for suite in plan.suites])
        return RunStarted(plan.planned, len(plan.jobs), len(self.earlier_numbers), jobs_of, remarks, replaced)

    def begin_jobs(self) -> None:
        """Begin as many jobs as the crew has room for. Raises `KeyboardInterrupt` where this process does them."""
        if self.interrupts.count or self.stopped:
            return
        # Without processes `begin` does the job itself, and only an exception can interrupt that.
        with self.interrupts.raised() if self.plan.options.workers == 0 else nullcontext():
            for number, job in islice(self.waiting, self.crew.free):
                self.begun_at[number] = time.monotonic()
                seed = derived_seed(self.plan.options.seed, *job.key)
                self.crew.begin(number, job, self.plan.options.output, seed)

    def report(self) -> Iterator[Event]:
        """Yield what has finished in the plan's order: a slow job holds back the reports of those behind it."""
        while self.reported_count in self.finished:
            yield from self._reported(self.reported_count)
        if self.interrupts.count and not self.warned:
            self.warned = True
            now = time.monotonic()
            self.given_up_at = now + FINISH_GRACE
            since = min(self.begun_at.values(), default=now)
            yield Interrupted(self.crew.busy, seconds=now - since, grace=FINISH_GRACE)

    def report_behind_gaps(self) -> Iterator[Event]:
        """Yield what has finished behind a job that never did."""
        for number in sorted(self.finished):
            yield from self._reported(number)

    def _reported(self, number: int) -> Iterator[Event]:
        marked_job = self.progress.add(self.finished.pop(number))
        self.reported_count += 1
        # One line of a renderer that warns does so in every job and process.
        fresh = {place: text for place, text in marked_job.warnings.items() if place not in self.warning_places}
        self.warning_places |= fresh.keys()
        marked_job = replace(marked_job, warnings=fresh)
        # Those of the run that is resumed were reported then.
        if number not in self.earlier_numbers:
            yield marked_job

    def take_answers(self) -> Iterator[Event]:
        """Wait a little for answers, and take them. Raises `LostError` where none will come.

        Raises `KeyboardInterrupt` on a second Ctrl-C while jobs are worked on, or a while after the first.
        """
        timeout = self.plan.options.timeout
        for answer in [*self.crew.answers(INTERRUPT_SECONDS), *self.crew.give_up(timeout)]:
            self.begun_at.pop(answer.call, None)
            done = _finished_job(answer, self.plan.jobs[answer.call], self.plan.options)
            self.finished[answer.call] = done
            # Written before its turn in the plan comes: a run that is killed now has it.
            self.outcomes.add(done)
            self.stopped |= self.plan.options.exit_first and self.progress.stops(done)
        yield from (WorkerRefused(*refusal) for refusal in self.crew.refused())
        now = time.monotonic()
        if self.begun_at and now - self.last_beat >= BEAT:
            self.last_beat = now
            finished_count = self.reported_count + len(self.finished)
            yield AtWork(finished_count, self.runs_at_work, now - min(self.begun_at.values()))
        if self.crew.busy and (self.interrupts.count > 1 or now > self.given_up_at):
            raise KeyboardInterrupt

    def reason(self, cut_by: BaseException | None) -> str | None:
        """Return why the results are incomplete; None where they are not."""
        if self.reported_count == len(self.plan.jobs):
            return None
        if isinstance(cut_by, LostError):
            return f"{cut_by.what}, and --resume goes on"
        return STOPPED_AT_FIRST if self.stopped and not self.interrupts.count else "interrupted by the user"


def _crew(work: Work, plan: Plan) -> Crew[JobAndFile]:
    """Return the crew that does the jobs of a plan; workers of a cluster must have all files of its cases."""
    options = plan.options
    if options.scheduler is None:
        workers = default_workers() if options.workers is None else options.workers
        return crew_of(partial(carry_out, work, shares_folder=True), workers)
    cases = {(job.suite, job.case.name): job.case for job in plan.jobs}
    files = {path: digest for case in cases.values() for path, digest in files_of(case).items()}
    return crew_of(
        partial(carry_out, work, shares_folder=False), 0, options.scheduler, timeout=options.timeout, files=files
    )


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
        return Workers(function, workers, tries=TRIES, captures=True)
    try:
        from hapticeval.runner.cluster import Cluster
    except ImportError as error:
        raise InputError(
            f"--scheduler {scheduler} needs dask.distributed", why=str(error), todo=install_command("cluster")
        ) from error
    return Cluster(function, scheduler, timeout=timeout, files=files)


def _finished_job(answer: Answer[JobAndFile], job: Job, options: RunOptions) -> JobFinished:
    """Return what came of a job, from its answer, with its recording put into the result folder."""
    return replace(_judged_job(answer, job, options), printed=answer.printed)


def _judged_job(answer: Answer[JobAndFile], job: Job, options: RunOptions) -> JobFinished:
    if isinstance(answer.error, ProcessEnded):
        return finished_by_end(job, answer.error)
    if isinstance(answer.error, Overdue):
        return finished_by_timeout(job, options.timeout, answer.error)
    # What a renderer does wrong is in its verdicts: this is a fault of the framework.
    if answer.error is not None:
        raise answer.error
    assert answer.value is not None
    finished, content = answer.value
    # The job ran where this folder cannot be seen: its recording's file came as bytes.
    if content is not None and options.output is not None and finished.run.recording is not None:
        with replacing(options.output / finished.run.recording) as temporary:
            temporary.write_bytes(content)
    return finished
