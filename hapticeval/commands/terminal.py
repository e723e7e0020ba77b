"""The terminal as a sink of the run's events: progress on stderr, one closing summary on stdout."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, TextIO

from hapticeval.errors import HapticevalError
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.events import Event, Interrupted, JobFinished, RunStarted

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
        self.errors: list[HapticevalError] = []
        self.interrupted = False
        """Whether an interrupt has ended the run early."""
        self.stopped = False
        """Whether the user has asked for the end at once."""
        self._bar: Progress | None = None
        self._task: TaskID | None = None

    def __enter__(self) -> Terminal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, event: Event) -> None:
        """Take one event of the stream."""
        if isinstance(event, RunStarted):
            self._planned_jobs = event.planned_jobs
            self.line(f"{_plural(event.planned_jobs, 'run')}, {_plural(event.planned_verdicts, 'verdict')} planned")
        elif isinstance(event, JobFinished):
            self._finished_jobs += 1
            if event.error is not None:
                self.errors.append(event.error)
            if self._stream.isatty():
                self._advance(self._finished_jobs, self._planned_jobs, f"{event.run.renderer} on {event.run.case}")
            else:
                count = f"[{self._finished_jobs}/{self._planned_jobs}]"
                self.line(f"{count} {event.run.renderer} on {event.run.suite}/{event.run.case}: {_told(event)}")
        elif isinstance(event, Interrupted):
            self.interrupted = True
            self.stopped = event.at_once
            self.line(_interrupted(event))

    def working(self, done: int, total: int, what: str) -> None:
        """Take how much of a bench is done and what comes next: a bar on a terminal, elsewhere a line each."""
        if self._stream.isatty():
            self._advance(done, total, what)
        elif what:
            self.line(f"[{done + 1}/{total}] {what}")

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
            self._bar.tasks[0].start_time = self._begun  # the bar tells the time since the run began, not its own
            self._bar.start()
        if self._task is not None:
            self._bar.update(self._task, completed=done, total=total, description=what, refresh=True)

    def line(self, text: str) -> None:
        """Tell something on a line of its own."""
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


def exit_code(results: ResultsDocument, errors: Iterable[HapticevalError]) -> int:
    """0 all as it must be; 1 something differs, failed, or did not run, or warns in a run that is strict.

    What stopped a job outranks that: 3 where a renderer broke, else 2 where a job's input was not usable or every run
    was refused.
    """
    stopped = any(map(results.stops, results.verdicts))
    differs = stopped or not results.complete or results.ran < results.planned
    return max([int(differs), 2 * int(results.all_refused), *(error.exit_code for error in errors)])


def summary(results: ResultsDocument, written: Sequence[Path]) -> str:
    """The closing words of a run: the table, what is not as it must be, the counts, the time, the files."""
    parts = [
        *_tables(results),
        "\n".join(_stopped("broke", run, run.error) for run in results.runs if run.error),
        "\n".join(_stopped("refuses", run, run.refusal) for run in _refused(results) if run.refusal),
        "\n".join(_surprise(verdict) for verdict in _surprising(results)),
        "\n".join(_surprise(verdict, "warning: ") for verdict in results.verdicts if verdict.warns),
        _totals(results),
        "\n".join(f"wrote {path}" for path in written),
    ]
    return "\n\n".join(part for part in parts if part)


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
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(f"{cell:{width}}" for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines
    )


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
    """The verdicts that are not as expected, less those of runs that broke: these are told as one."""
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
