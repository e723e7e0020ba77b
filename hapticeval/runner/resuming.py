"""What an earlier run into a folder has finished: the file to which each outcome is added, and what is left of a plan.

A line of `OUTCOMES` is the entry and the verdicts of a job as JSON, in the order in which jobs end. Where the run was
killed in the middle of a line, that job is done again.
"""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple, Self

import msgspec

from hapticeval.errors import InputError
from hapticeval.files import writing
from hapticeval.runner.events import JobFinished
from hapticeval.runner.planning import Plan
from hapticeval.runner.progress import command, suite_entries
from hapticeval.runner.results import (
    RESULTS_FILE,
    Entry,
    Environment,
    ResultsDocument,
    RunEntry,
    RunKey,
    VerdictEntry,
    environment,
    read_results,
)

OUTCOMES = "outcomes.jsonl"

MOST_NAMES = 3
"""Renderers of an earlier run that are named where it is replaced."""


class Line(Entry, frozen=True, kw_only=True):
    """The outcome of one job."""

    run: RunEntry
    verdicts: list[VerdictEntry]


class Outcomes:
    """The file of outcomes in a result folder, open for appending: a context manager. It does nothing without one."""

    def __init__(self, directory: Path | None) -> None:
        self._path = None if directory is None else directory / OUTCOMES
        self._file = -1

    def __enter__(self) -> Self:
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
        return self

    def __exit__(self, *_: object) -> None:
        if self._path is not None:
            os.close(self._file)

    def add(self, job: JobFinished) -> None:
        """Add what came of a job."""
        if self._path is None:
            return
        line = msgspec.json.encode(Line(run=job.run, verdicts=list(job.verdicts))) + b"\n"
        with writing(self._path):
            # The system may write a part of it only.
            while line:
                line = line[os.write(self._file, line) :]

    def clear(self) -> None:
        """Empty the file."""
        if self._path is not None:
            os.truncate(self._file, 0)

    def forget(self) -> None:
        """Remove the file once results.json holds all of it."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)


def read_outcomes(directory: Path) -> list[JobFinished]:
    """Return the outcomes in a folder's file, and cut off an incomplete last line, so that more may be appended."""
    path = directory / OUTCOMES
    if not path.exists():
        return []
    # What follows the last newline was cut off in the middle of its writing.
    complete_lines, _, cut_line = path.read_bytes().rpartition(b"\n")
    if cut_line:
        os.truncate(path, len(complete_lines) + bool(complete_lines))
    jobs = []
    for text in complete_lines.splitlines():
        try:
            line = msgspec.json.decode(text, type=Line)
        except (msgspec.DecodeError, ValueError):
            continue  # a damaged disk: that job is done again
        jobs.append(JobFinished(line.run, tuple(line.verdicts)))
    return jobs


class _Header(msgspec.Struct):
    """What tells one run from another in results.json."""

    date: str
    runs: list[dict[str, Any]]


def describe_replaced_run(directory: Path) -> str:
    """Return what a new run into `directory` replaces: "the run of constraint, 18:40"; "" where there is none."""
    try:
        header = msgspec.json.decode((directory / RESULTS_FILE).read_bytes(), type=_Header)
        begun = datetime.fromisoformat(header.date).astimezone()
    except (OSError, ValueError):  # no run, or none that can be read
        return ""
    renderers = list(dict.fromkeys(str(run.get("renderer", "")) for run in header.runs))
    names = ", ".join(renderers[:MOST_NAMES]) + (", ..." if len(renderers) > MOST_NAMES else "")
    today = begun.date() == datetime.now().astimezone().date()
    return f"the run of {names or 'nothing'}, {begun:{'%H:%M' if today else '%Y-%m-%d %H:%M'}}"


class EarlierRun(NamedTuple):
    """What an earlier run into a folder has left of a plan: the jobs that it finished, and the seconds that it took."""

    jobs: dict[RunKey, JobFinished]
    wall_seconds: float


def read_earlier_run(plan: Plan, directory: Path) -> EarlierRun:
    """Return what came of the jobs of `plan` that an earlier run into `directory` has finished; none where none did.

    A job whose recording is missing counts as not done. Raises `InputError` where that run was of another plan or of
    other versions, naming what differs.
    """
    if not (directory / RESULTS_FILE).is_file():
        return EarlierRun({}, 0.0)
    document = read_results(directory)
    _refuse_another(plan, document, directory)
    earlier_jobs = {run.key: JobFinished(run, tuple(document.verdicts_of.get(run.key, ()))) for run in document.runs}
    # results.json is written now and then only; each finished job is a line of the other file at once.
    earlier_jobs |= {job.run.key: job for job in read_outcomes(directory)}
    checks = {job.key: job.case.checks for job in plan.jobs}
    kept_jobs = {
        key: job
        for key, job in earlier_jobs.items()
        # Verdicts of other checks than this plan asks, or of a case that it has not, do not count.
        if checks.get(key) == tuple(verdict.check for verdict in job.verdicts)
        and (job.run.recording is None or (directory / job.run.recording).is_file())
    }
    return EarlierRun(kept_jobs, document.timing.wall_seconds if kept_jobs else 0.0)


def _refuse_another(plan: Plan, document: ResultsDocument, directory: Path) -> None:
    """Raise `InputError` where results in a folder are not of this plan, or were made by other versions."""
    now, before = command(plan), document.command
    differs = [
        f"{name} {_as_text(getattr(before, name))}, now {_as_text(getattr(now, name))}"
        for name in ("suites", "renderers", "select", "strict", "shard")
        if getattr(before, name) != getattr(now, name)
    ]
    if document.seed != plan.options.seed:
        differs.append(f"seed {document.seed}, now {plan.options.seed}")
    # Other arguments explain other suites: those are compared where the arguments are the same.
    if not differs:
        old = {suite.name: suite for suite in document.suites}
        differs += [
            f"the suite '{suite.name}' has been changed"
            for suite in suite_entries(plan)
            if old.get(suite.name) != suite
        ]
    differs += differing_versions(document.environment, Environment(**environment()))
    if differs:
        raise InputError(
            f"the results in '{directory}' are of another run",
            why="; ".join(differs),
            todo="resume with the same arguments and versions, or name another folder with -o",
        )


def _as_text(value: object) -> str:
    return ", ".join(map(str, value)) or "none" if isinstance(value, list) else str(value)


def differing_versions(one: Environment, other: Environment, *, then: str = ", now") -> list[str]:
    """Return what differs between two environments in versions: ["numpy 1.26.4, now 2.1.0"].

    `then` stands between the two: of results of one day none is of now.
    """
    pairs: dict[str, tuple[str | None, str | None]] = {"python": (one.python, other.python)}
    pairs |= {name: (one.versions.get(name), other.versions.get(name)) for name in one.versions | other.versions}
    return [f"{name} {before}{then} {now}" for name, (before, now) in pairs.items() if before != now]
