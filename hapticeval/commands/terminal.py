"""The terminal as a sink of the run's events: progress on stderr, one closing summary on stdout."""

from __future__ import annotations

import os
import shutil
import sys
import textwrap
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from hapticeval.phenomena.verdict import Outcome
from hapticeval.quantity import aligned
from hapticeval.runner.events import Event, Interrupted, JobFinished, RunStarted, WorkerRefused

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from hapticeval.runner.results import Problem, ResultsDocument, RunEntry, VerdictEntry

FEW = 10
"""Figures that are drawn before anyone wonders what goes on."""

PATIENCE = 2.0
"""Seconds after which a person wants to see that something moves."""


class Terminal:
    """Shows a run as it goes on: a bar on a terminal when the run is not quick, elsewhere a line a job.

    A context manager, so that the bar leaves the terminal as it found it whatever happens.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._begun = time.monotonic()
        self._planned_jobs = 0
        self._finished_jobs = 0
        self.interrupted = False
        """Whether an interrupt has ended the run early."""
        self._bar: Progress | None = None
        self._task: TaskID | None = None

    def __enter__(self) -> Terminal:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, event: Event) -> None:
        """Take one event of the stream."""
        if isinstance(event, RunStarted):
            self._planned_jobs = event.planned_jobs
            kept = f", {_plural(event.kept_jobs, 'run')} of them finished before" if event.kept_jobs else ""
            self._finished_jobs = event.kept_jobs
            planned = f"{_plural(event.planned_jobs, 'run')}, {_plural(event.planned_verdicts, 'verdict')} planned"
            self.line(planned + kept)
        elif isinstance(event, JobFinished):
            self._finished_jobs += 1
            if self._stream.isatty():
                self._advance(self._finished_jobs, self._planned_jobs, f"{event.run.renderer} on {event.run.case}")
            else:
                count = f"[{self._finished_jobs}/{self._planned_jobs}]"
                self.line(f"{count} {event.run.renderer} on {event.run.suite}/{event.run.case}: {_told(event)}")
        elif isinstance(event, WorkerRefused):
            self.line(f"refused: the worker {event.worker} is given no run: {event.why}")
        elif isinstance(event, Interrupted):
            self.interrupted = True
            self.line(_interrupted(event))

    def working(self, done: int, total: int, what: str) -> None:
        """Take how much of a bench is done and what comes next: a bar on a terminal, elsewhere a line each."""
        if self._stream.isatty():
            self._advance(done, total, what)
        elif what:
            self.line(f"[{done + 1}/{total}] {what}")

    def searching(self, done: float, total: float, what: str) -> None:
        """Take how many seconds of a search are over, and what it has found: a bar on a terminal, elsewhere nothing."""
        if self._stream.isatty():
            self._advance(min(int(done), int(total)), int(total), what)

    def drawn(self, done: int, total: int) -> None:
        """Take how many of the report's figures are drawn: a bar on a terminal, elsewhere one line before many."""
        if self._stream.isatty():
            self._advance(done, total, "drawing figures")
        elif done == 0 and total > FEW:
            self.line(f"drawing {_plural(total, 'figure')}")

    def _advance(self, done: int, total: int, what: str) -> None:
        """Move the bar; it appears with the first step that ends after `PATIENCE` seconds."""
        if self._bar is None:
            if time.monotonic() - self._begun < PATIENCE:
                return
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

            self._bar = Progress(
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TextColumn("{task.description}", markup=False),
                console=Console(file=self._stream),
                auto_refresh=False,
                transient=True,
            )
            self._task = self._bar.add_task("")
            self._bar.tasks[0].start_time = self._begun  # the bar shows the time since the run began, not its own
            self._bar.start()
        if self._task is not None:
            self._bar.update(self._task, completed=done, total=total, description=what, refresh=True)

    def line(self, text: str) -> None:
        """Print something on a line of its own."""
        if self._bar is not None:
            self._bar.stop()  # it comes again below with the next step
            self._bar = None
        print(text, file=self._stream, flush=True)


def _told(event: JobFinished) -> str:
    if event.error is not None:
        return f"broke: {event.error.what}"
    if event.run.refusal is not None:
        return f"refuses: {event.run.refusal.what}"
    counts = Counter(verdict.outcome for verdict in event.verdicts)
    surprises = sum(not verdict.as_expected for verdict in event.verdicts)
    warnings = sum(verdict.warns for verdict in event.verdicts)
    notes = [f"{surprises} not as expected"] * bool(surprises) + [_plural(warnings, "warning")] * bool(warnings)
    return _counted(counts) + (f" ({', '.join(notes)})" if notes else "")


def _interrupted(event: Interrupted) -> str:
    runs = f"{_plural(event.begun, 'run')} that had begun {'is' if event.begun == 1 else 'are'}"
    kept = "what is done is kept"
    if event.at_once:
        return f"stopped: {runs} given up; {kept}"
    if not event.begun:
        return f"interrupted: {kept}"
    return f"interrupted: {runs} being finished, {kept}; press Ctrl-C again to stop at once"


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _counted(counts: Counter[Outcome]) -> str:
    """For instance `12 pass, 3 fail`, in the order of `Outcome`."""
    return ", ".join(f"{counts[outcome]} {outcome}" for outcome in Outcome if counts[outcome]) or "no verdicts"


def summary(results: ResultsDocument, written: Iterable[Path]) -> str:
    """Return the closing words of a run: table, what is not as it must be, counts, time, files."""
    return paragraphs(
        *_tables(results),
        lines(_stopped("broke", run, run.error) for run in results.runs if run.error),
        lines(_stopped("refuses", run, run.refusal) for run in _refused(results) if run.refusal),
        lines(_surprise(verdict) for verdict in _surprising(results)),
        lines(_surprise(verdict, "warning: ") for verdict in results.verdicts if verdict.warns),
        lines(_not_applicable(results)),
        _totals(results),
        wrote(written),
    )


def lines(parts: Iterable[str]) -> str:
    """Join parts, each on a line of its own."""
    return "\n".join(parts)


def paragraphs(*parts: str) -> str:
    """Join the parts that are not empty, with an empty line between them."""
    return "\n\n".join(part for part in parts if part)


def columns(rows: Iterable[tuple[str, str]]) -> str:
    """Names in a column, and what they are wrapped beside them."""
    pairs = list(rows)
    room = min(shutil.get_terminal_size().columns, 100)
    width = max((len(name) for name, _ in pairs), default=0) + 2
    lines = []
    for name, text in pairs:
        wrapped = textwrap.wrap(text, max(room - width, 20), break_on_hyphens=False) or [""]
        lines.append(f"{name:{width}}{wrapped[0]}".rstrip())
        lines += [" " * width + line for line in wrapped[1:]]
    return "\n".join(lines)


def wrote(paths: Iterable[Path]) -> str:
    """Return a line for each file that was written."""
    return lines(f"wrote {path}" for path in paths)


def say(text: str) -> None:
    """Print on stdout. A reader that has gone away (`| head`) changes no exit code."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _not_applicable(results: ResultsDocument) -> Iterator[str]:
    """Yield why checks were not applicable, once for each reason, less the refusals, which are shown as such."""
    refused = {run.key for run in results.runs if run.refusal}
    reasons = Counter(
        (verdict.check, verdict.message)
        for verdict in results.verdicts
        if verdict.outcome is Outcome.NOT_APPLICABLE and verdict.key not in refused
    )
    for (check, why), count in reasons.items():
        yield f"not applicable: {check}{f' ({count} times)' if count > 1 else ''}: {why}"


def _tables(results: ResultsDocument) -> Iterator[str]:
    """A table a suite that has rows, each with the renderers that ran there."""
    titles = [(suite.title, suite.rows) for suite in results.suites if suite.rows]
    told = {title for _, rows in titles for title in rows}
    left = [title for title in results.table if title not in told]
    for name, rows in [*titles, ("", left)]:
        found = {title: results.table[title] for title in rows if title in results.table}
        if any(found.values()):
            heading = f"{name}\n" if name and len(titles) > 1 else ""
            yield heading + _table(found, results.published_table)


def _table(table: Mapping[str, Mapping[str, str]], published_table: Mapping[str, Mapping[str, str]]) -> str:
    """Rows by renderers, in aligned columns; a cell that differs from what is in print says so."""
    renderers = list(dict.fromkeys(renderer for row in table.values() for renderer in row))
    lines = [["", *renderers]]
    for title, row in table.items():
        published = published_table.get(title, {})
        lines.append([title, *(_cell(row.get(name, "-"), published.get(name)) for name in renderers)])
    return "\n".join(aligned(lines))


def _cell(found: str, published: str | None) -> str:
    return found if published in (None, found) or found == "-" else f"{found} (published {published})"


def _stopped(how: str, run: RunEntry, said: Problem) -> str:
    lines = [f"{how}: {run.renderer} on {run.suite}/{run.case}", f"  {said.what}"]
    lines += [f"  {label}: {each}" for label, each in (("why", said.why), ("what to do", said.todo)) if each]
    return "\n".join(lines)


def _refused(results: ResultsDocument) -> Iterator[RunEntry]:
    """The first run of each renderer that has refused all that it was given: it has not been judged at all."""
    judged = {run.renderer for run in results.runs if not run.refusal}
    told: set[str] = set()
    for run in results.runs:
        if run.renderer not in judged | told:
            told.add(run.renderer)
            yield run


def _surprising(results: ResultsDocument) -> Iterator[VerdictEntry]:
    """The verdicts that are not as expected, less those of runs that broke: these are shown as one."""
    broken = {run.key for run in results.runs if run.error}
    for verdict in results.verdicts:
        if not verdict.as_expected and not (verdict.key in broken and verdict.outcome is Outcome.ERROR):
            yield verdict


def _surprise(verdict: VerdictEntry, mark: str = "") -> str:
    """A verdict that fails, or differs from what is published, with its measure and its bound."""
    outcome, published = verdict.outcome, verdict.published
    place = f"{verdict.renderer} on {verdict.suite}/{verdict.case}/{verdict.check}"
    head = f"differs: {place}: {outcome}, published {published}" if published else f"{mark}{outcome}: {place}"
    measured = _measured(verdict)
    return "\n".join([head, *([f"  {measured}"] if measured else []), f"  {verdict.message}"])


def _measured(verdict: VerdictEntry) -> str:
    metric = verdict.metric
    if metric is None or metric.value is None:
        return ""
    text = f"{metric.name} = {metric.value:.4g} {metric.unit}".rstrip()
    return text if verdict.bound is None else f"{text}, bound {verdict.bound:.4g} {metric.unit}".rstrip()


def _totals(results: ResultsDocument) -> str:
    counts = Counter(verdict.outcome for verdict in results.verdicts)
    unexpected = sum(not verdict.as_expected for verdict in results.verdicts)
    warnings = sum(verdict.warns for verdict in results.verdicts)
    warned = f", {_plural(warnings, 'warning')}" + (" that count" if results.command.strict else "")
    ran = f"{results.ran} of {_plural(results.planned, 'planned verdict')} ran"
    if not results.complete:
        ran += f" (incomplete: {results.reason})"
    timing = results.timing
    return (
        f"{ran}: {_counted(counts)}; {unexpected or 'none'} not as expected{warned * bool(warnings)}\n"
        f"simulated {timing.simulated_seconds:.1f} s in {timing.wall_seconds:.1f} s: "
        f"{timing.times_real_time:.1f} times real time"
    )
