"""The results so far, on disk while the run goes on, so that a run that is killed leaves what it had."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any

from hapticeval.discovery import known_renderers, load, parse
from hapticeval.errors import HapticevalError
from hapticeval.phenomena.verdict import Outcome
from hapticeval.quantity import plural
from hapticeval.runner.events import JobFinished
from hapticeval.runner.planning import Plan
from hapticeval.runner.results import (
    Command,
    Environment,
    ResultsDocument,
    RunEntry,
    SuiteEntry,
    Table,
    Timing,
    VerdictEntry,
    environment,
    write_results,
)
from hapticeval.suite.suite import Suite, digest_of_case, digest_of_suite

SAVE_EVERY = 1.0
"""Seconds between two writings of results.json, at least; `resuming.OUTCOMES` has what finished after the last one."""

SAVE_SHARE = 0.02
"""Share of its time that a run spends on writing them, at most: each time there are more verdicts to write."""

RUNNING = "still running, or killed"
"""Why results are incomplete while the run goes on: what a killed run leaves says so."""


class Progress:
    """Takes judged jobs in the order of the plan, and keeps results.json up to date."""

    def __init__(self, plan: Plan, *, earlier_seconds: float = 0.0) -> None:
        self.plan = plan
        self.earlier_seconds = earlier_seconds  # that the run took before it was resumed
        self.directory = plan.options.output
        self.verdicts: list[VerdictEntry] = []
        self.runs: list[RunEntry] = []
        self.started = time.perf_counter()
        self.date = datetime.now(UTC).isoformat(timespec="seconds")
        self.commits = commits(plan)
        self.environment = Environment(**environment())
        self.suites = suite_entries(plan)
        self._save(RUNNING)

    def add(self, job: JobFinished) -> JobFinished:
        """Take what came of a job, and return it with its known failures marked."""
        marked = self._marked(job)
        self.runs.append(marked.run)
        self.verdicts += marked.verdicts
        if time.perf_counter() - self.saved > self._pause:
            self._save(RUNNING)
        return marked

    def stops(self, job: JobFinished) -> bool:
        """Return whether a verdict of a job stops the gate."""
        return any(verdict.stops(strict=self.plan.options.strict) for verdict in self._marked(job).verdicts)

    def _marked(self, job: JobFinished) -> JobFinished:
        return replace(job, verdicts=tuple(map(self.plan.known.marked, job.verdicts)))

    def finish(self, reason: str | None) -> ResultsDocument:
        """Write the results for the last time, incomplete for that `reason` where there is one."""
        planned = {(*job.key, check) for job in self.plan.jobs for check in job.case.checks}
        missing = planned - {(*verdict.key, verdict.check) for verdict in self.verdicts}
        if reason is None and missing:
            reason = f"{plural(len(missing), 'planned verdict')} missing, as of {'/'.join(min(missing))}"
        return self._save(reason)

    def _save(self, reason: str | None) -> ResultsDocument:
        plan = self.plan
        begun = time.perf_counter()  # the results count as read here: what writing takes is not the run's
        results = ResultsDocument(
            planned=plan.planned,
            ran=len(self.verdicts),
            complete=reason is None,
            reason=reason,
            environment=self.environment,
            seed=plan.options.seed,
            command=command(plan),
            runs=list(self.runs),
            verdicts=list(self.verdicts),
            table=fill_table(self.suites, self.verdicts),
            published_table={row.title: dict(row.published) for suite in plan.suites for row in suite.rows},
            suites=self.suites,
            date=self.date,
            commits=self.commits,
            timing=timing(self.runs, self.earlier_seconds + begun - self.started),
        )
        if self.directory is not None:
            write_results(self.directory, results)
        self.saved = time.perf_counter()
        # A writing of t s is followed by t / SAVE_SHARE s without one: it takes at most that share of the time.
        self._pause = max(SAVE_EVERY, (self.saved - begun) / SAVE_SHARE)
        return results


def timing(runs: list[RunEntry], wall: float) -> Timing:
    """Return how long runs took: the seconds that were simulated, and those on the clock, `wall`."""
    simulated = float(sum(run.simulated_seconds for run in runs))
    return Timing(
        simulated_seconds=simulated, wall_seconds=wall, times_real_time=simulated / wall if wall > 0.0 else 0.0
    )


def command(plan: Plan) -> Command:
    """Return what was asked for."""
    return Command(
        suites=[suite.name for suite in plan.suites],
        renderers=list(plan.renderers),
        select=list(plan.options.select),
        strict=plan.options.strict,
        shard=None if plan.options.shard is None else str(plan.options.shard),
    )


def suite_entries(plan: Plan) -> list[SuiteEntry]:
    """Return the suites of a plan as the results hold them."""
    return [suite_entry(suite, *plan.cases_and_renderers.get(suite.name, ((), ()))) for suite in plan.suites]


def suite_entry(suite: Suite, cases: Sequence[str] = (), renderers: Sequence[str] = ()) -> SuiteEntry:
    """Return what the results hold of a suite, of which those `cases` and `renderers` were planned."""
    return SuiteEntry(
        name=suite.name,
        title=suite.title,
        citation=suite.citation,
        rows=[row.title for row in suite.rows],
        cases=list(cases),
        renderers=list(renderers),
        cells={
            row.title: [
                f"{case.name}/{check}"
                for case in suite.cases
                if case.judged and any(fnmatchcase(case.name, pattern) for pattern in row.cases)
                for check in row.checks
                if check in case.checks
            ]
            for row in suite.rows
        },
        version=suite.version,
        digest=digest_of_suite(suite),
        case_digests={case.name: digest_of_case(case) for case in suite.cases if case.name in cases},
    )


GIT_SECONDS = 5.0
"""Seconds that git has for an answer."""


def commits(plan: Plan) -> dict[str, str]:
    """Return the commit of each renderer's repository, followed by "-dirty" where files differ from it.

    Renderers whose source is not a file that a repository tracks, as an installed package's, are left out.
    """
    factories = {job.renderer: job.factory for job in plan.jobs}
    commit_by_renderer = {
        name: _commit(file) for name in plan.renderers if (file := _source(name, factories.get(name))) is not None
    }
    return {name: commit for name, commit in commit_by_renderer.items() if commit}


def _source(name: str, factory: Any) -> Path | None:
    """Return the source file of a renderer, by its name or by its `factory`; None where there is none."""
    if factory is not None:
        module = getattr(factory, "__module__", "")
    else:
        base = parse(name).base
        try:
            load(base)
        except HapticevalError:  # no renderer, as the recorded run of a replay
            return None
        # `package.module:factory` names its module; any other name is an entry point, which does.
        module = (base if ":" in base else known_renderers()[base].value).partition(":")[0].strip()
    file = getattr(sys.modules.get(module), "__file__", None)
    return None if file is None else Path(file).resolve()


@cache
def _commit(file: Path) -> str:
    """Return the commit of the repository that tracks a file, "" where none does."""
    # A file that no commit holds has none, even inside of a repository.
    if not _git(file.parent, "ls-files", "--", file.name):
        return ""
    return _git(file.parent, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")


def _git(folder: Path, *words: str) -> str:
    """Return what git prints, "" where there is no git, no repository, or no answer in time."""
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, timeout=GIT_SECONDS, check=False
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def fill_table(suites: Sequence[SuiteEntry], verdicts: Sequence[VerdictEntry]) -> Table:
    """Return Yes or No for each row and renderer: No where a check of the row fails, Yes where all pass.

    A renderer without a failure is left out of a row where a verdict is missing, undecided or an error: the table never
    says Yes for what was not seen.
    """
    outcome_by_cell = {
        (verdict.suite, verdict.renderer, f"{verdict.case}/{verdict.check}"): verdict.outcome for verdict in verdicts
    }
    renderers = dict.fromkeys(verdict.renderer for verdict in verdicts)
    table: Table = {}
    for suite in suites:
        for title, places in suite.cells.items():
            cells = table.setdefault(title, {})
            for renderer in renderers:
                # None stands for a verdict that is missing: with it among them there is no Yes.
                outcomes = {outcome_by_cell.get((suite.name, renderer, place)) for place in places}
                if Outcome.FAIL in outcomes:
                    cells[renderer] = "No"
                elif outcomes == {Outcome.PASS}:
                    cells[renderer] = "Yes"
    return table
