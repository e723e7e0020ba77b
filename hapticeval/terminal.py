"""The terminal as a sink of the run's events: progress on stderr, one closing summary on stdout."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO

from hapticeval.errors import HapticevalError, RendererError
from hapticeval.events import Event, JobFinished, RunStarted
from hapticeval.phenomena.verdict import Outcome

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from hapticeval.results import Results

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
            self._line(f"{event.planned_jobs} runs, {event.planned_verdicts} verdicts planned")
        elif isinstance(event, JobFinished):
            self._finished_jobs += 1
            if event.error is not None:
                self.errors.append(event.error)
            if self._stream.isatty():
                self._advance(event)
            else:
                count = f"[{self._finished_jobs}/{self._planned_jobs}]"
                self._line(f"{count} {event.renderer} on {event.suite}/{event.case}: {_told(event)}")

    def _advance(self, event: JobFinished) -> None:
        """Move the bar; it appears with the first job that ends after `PATIENCE` seconds."""
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
            self._task = self._bar.add_task("", total=self._planned_jobs)
            self._bar.start()
        if self._task is not None:
            self._bar.update(
                self._task,
                completed=self._finished_jobs,
                description=f"{event.renderer} on {event.case}",
                refresh=True,
            )

    def _line(self, text: str) -> None:
        print(text, file=self._stream, flush=True)


def _told(event: JobFinished) -> str:
    if event.error is not None:
        return f"broke: {event.error.what}"
    counts = Counter(verdict.outcome for verdict in event.verdicts)
    surprises = sum(not verdict.as_expected for verdict in event.verdicts)
    return _counted(counts) + (f" ({surprises} not as expected)" if surprises else "")


def _counted(counts: Counter[Outcome]) -> str:
    """For instance `12 pass, 3 fail`, in the order of `Outcome`."""
    return ", ".join(f"{counts[outcome]} {outcome}" for outcome in Outcome if counts[outcome]) or "no verdicts"


def exit_code(results: Results, errors: Iterable[HapticevalError]) -> int:
    """0 all as it must be; 3 a renderer broke; 1 anything else that differs, failed, or did not run."""
    broke = list(errors)
    if any(error.exit_code == RendererError.exit_code for error in broke):
        return RendererError.exit_code
    surprised = any(not verdict["as_expected"] for verdict in results.verdicts)
    return int(bool(broke) or surprised or not results.complete or results.ran < results.planned)


def summary(results: Results, written: Sequence[Path]) -> str:
    """The closing words of a run: the table, what is not as it must be, the counts, the time, the files."""
    parts = [
        _table(results.table),
        "\n".join(_broken(run) for run in results.runs if run["error"]),
        "\n".join(_surprise(verdict) for verdict in results.verdicts if not verdict["as_expected"]),
        _totals(results),
        "\n".join(f"wrote {path}" for path in written),
    ]
    return "\n\n".join(part for part in parts if part)


def _table(table: Mapping[str, Mapping[str, str]]) -> str:
    """Rows by renderers, in aligned columns."""
    renderers = list(dict.fromkeys(renderer for row in table.values() for renderer in row))
    if not renderers:
        return ""
    first = max(len(title) for title in table) + 2
    head = " " * first + "  ".join(renderers)
    lines = [
        f"{title:{first}}" + "  ".join(f"{row.get(name, '-'):{len(name)}}" for name in renderers)
        for title, row in table.items()
    ]
    return "\n".join(line.rstrip() for line in [head, *lines])


def _broken(run: Mapping[str, Any]) -> str:
    error = run["error"]
    lines = [f"broke: {run['renderer']} on {run['suite']}/{run['case']}", f"  {error['what']}"]
    lines += [f"  {label}: {error[key]}" for label, key in (("why", "why"), ("what to do", "todo")) if error[key]]
    return "\n".join(lines)


def _surprise(verdict: Mapping[str, Any]) -> str:
    """A verdict that fails, or differs from what is published, with its measure and its bound."""
    outcome, published = verdict["outcome"], verdict["published"]
    place = f"{verdict['renderer']} on {verdict['suite']}/{verdict['case']}/{verdict['check']}"
    head = f"differs: {place}: {outcome}, published {published}" if published else f"{outcome}: {place}"
    measured = _measured(verdict)
    return "\n".join([head, *([f"  {measured}"] if measured else []), f"  {verdict['message']}"])


def _measured(verdict: Mapping[str, Any]) -> str:
    metric = verdict["metric"]
    if metric is None or metric["value"] is None:
        return ""
    text = f"{metric['name']} = {metric['value']:.4g} {metric['unit']}".rstrip()
    bound = verdict["bound"]
    return text if bound is None else f"{text}, bound {bound:.4g} {metric['unit']}".rstrip()


def _totals(results: Results) -> str:
    counts = Counter(Outcome(verdict["outcome"]) for verdict in results.verdicts)
    unexpected = sum(not verdict["as_expected"] for verdict in results.verdicts)
    ran = f"{results.ran} of {results.planned} planned verdicts ran"
    if not results.complete:
        ran += f" (incomplete: {results.reason})"
    timing = results.timing
    return (
        f"{ran}: {_counted(counts)}; {unexpected or 'none'} not as expected\n"
        f"simulated {timing['simulated_seconds']:.1f} s in {timing['wall_seconds']:.1f} s: "
        f"{timing['times_real_time']:.1f} times real time"
    )
