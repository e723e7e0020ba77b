"""What an earlier run into a folder has finished of a plan, so that the rest can be run."""

from __future__ import annotations

from pathlib import Path

from hapticeval.errors import InputError
from hapticeval.runner.events import JobFinished
from hapticeval.runner.outcomes import read_outcomes
from hapticeval.runner.planning import Plan
from hapticeval.runner.progress import command, suite_entries
from hapticeval.runner.results import FILE, Environment, ResultsDocument, RunKey, environment, read_results


def finished_jobs(plan: Plan, directory: Path) -> dict[RunKey, JobFinished]:
    """Return what came of the jobs of `plan` that an earlier run into `directory` has finished; none where none did.

    A job whose recording is missing counts as not done. Raises `InputError` where that run was of another plan or of
    other versions, naming what differs.
    """
    if not (directory / FILE).is_file():
        return {}
    document = read_results(directory)
    _refuse_another(plan, document, directory)
    earlier_jobs = {run.key: JobFinished(run, tuple(document.verdicts_of.get(run.key, ()))) for run in document.runs}
    # results.json is written now and then only; each finished job is a line of the other file at once.
    earlier_jobs |= {job.run.key: job for job in read_outcomes(directory)}
    checks = {job.key: job.case.checks for job in plan.jobs}
    return {
        key: job
        for key, job in earlier_jobs.items()
        # Verdicts of other checks than this plan asks, or of a case that it has not, do not count.
        if checks.get(key) == tuple(verdict.check for verdict in job.verdicts)
        and (job.run.recording is None or (directory / job.run.recording).is_file())
    }


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


def differing_versions(one: Environment, other: Environment) -> list[str]:
    """Return what differs between two environments in versions: ["numpy 1.26.4, now 2.1.0"]."""
    pairs: dict[str, tuple[str | None, str | None]] = {"python": (one.python, other.python)}
    pairs |= {name: (one.versions.get(name), other.versions.get(name)) for name in one.versions | other.versions}
    return [f"{name} {before}, now {now}" for name, (before, now) in pairs.items() if before != now]
