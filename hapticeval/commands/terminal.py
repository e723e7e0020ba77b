"""The terminal as a sink of the run's events: progress on stderr; and how text is laid out on it."""

from __future__ import annotations

import math
import os
import shutil
import sys
import textwrap
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from hapticeval.errors import printable
from hapticeval.quantity import plural
from hapticeval.runner.events import AtWork, Event, Interrupted, JobFinished, RunFinished, RunStarted, WorkerRefused
from hapticeval.runner.standing import counts_in_words

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from hapticeval.runner.results import RunKey, VerdictEntry

FIGURES_UNANNOUNCED = 10
"""Figures that are drawn before anyone wonders what goes on."""

BAR_AFTER = 2.0
"""Seconds after which a person wants to see that something moves."""

REMINDER_SECONDS = 5.0
"""Seconds between two lines about what is waited for."""

WORK_LINE_SECONDS = 30.0
"""Seconds without a line, where there is no bar, after which one says what is at work."""

PRINTED_LINES = 20
"""Lines that are shown of what a renderer printed, the last ones."""

COMPILING = (
    "compiling kernels as they are first used, once: with --quick some 10 s of a processor for a renderer in Python, "
    "20 s for a built-in one, 50 s for all of these; more for whole suites"
)
"""What a run says first where no kernel is compiled yet: 8, 20 and 50 s of CPU time were measured."""


@dataclass
class _SuiteProgress:
    """What has come of the jobs of a suite."""

    planned: int
    finished: int = 0
    refused: int = 0
    verdicts: tuple[VerdictEntry, ...] = ()


class Terminal:
    """Shows a run as it goes on: a bar on a terminal when the run is not quick, elsewhere a line a suite.

    Elsewhere it also prints:

    - a line a job if it is `verbose`, else one for the first job in which a renderer breaks in some way
    - what is at work, after a silence of `WORK_LINE_SECONDS`

    Lines of jobs and suites count verdicts, unless `counts` is false: where the end settles what they amount to.

    A context manager, so that the bar leaves the terminal as it found it whatever happens.
    """

    def __init__(self, stream: TextIO | None = None, *, verbose: bool = False, counts: bool = True) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._verbose = verbose
        self._counts = counts
        self._suites: dict[str, _SuiteProgress] = {}
        self._broken: set[tuple[str, tuple[str, str]]] = set()
        # Renderers whose prints were shown.
        self._shown: set[str] = set()
        self._begun = time.monotonic()
        self._reminded = 0.0
        # When the last line was printed, s of the monotonic clock.
        self._spoke = self._begun
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
            if kernels_are_new():
                self.line(COMPILING)
            self._planned_jobs = event.planned_jobs
            kept_words = f", {plural(event.kept_jobs, 'run')} of them finished before" if event.kept_jobs else ""
            self._finished_jobs = event.kept_jobs
            self._suites = {name: _SuiteProgress(planned) for name, planned in event.jobs_of.items()}
            planned = f"{plural(event.planned_jobs, 'run')}, {plural(event.planned_verdicts, 'verdict')} planned"
            self.line(planned + kept_words + (f"; replaces {event.replaces}" if event.replaces else ""))
            for note in event.notes:
                self.line(note)
        elif isinstance(event, JobFinished):
            self._finished_jobs += 1
            for text in event.warnings.values():
                self.line(text)
            if self._stream.isatty():
                self._advance(self._finished_jobs, self._planned_jobs, f"{event.run.renderer} on {event.run.case}")
            elif self._verbose or self._breaks_anew(event):
                count = f"[{self._finished_jobs}/{self._planned_jobs}]"
                self.line(f"{count} {event.run.renderer} on {event.run.suite}/{event.run.case}{self._job_words(event)}")
            if not self._stream.isatty() and not self._verbose:
                self._add(event)
            self._show_printed(event)
        elif isinstance(event, AtWork):
            at_work = f"at work for {event.seconds:.0f} s: {_first_run_words(event.runs)}"
            self.still(event.finished_jobs, self._planned_jobs, at_work)
        elif isinstance(event, WorkerRefused):
            self.line(f"refused: the worker {event.worker} is given no run: {event.why}")
        elif isinstance(event, Interrupted):
            self.interrupted = True
            self.line(_interrupted_words(event))
        elif isinstance(event, RunFinished):
            # Suites that the run's end has cut short; _close changes the dict.
            for name in [name for name, suite in self._suites.items() if suite.finished]:
                self._close(name)

    def _show_printed(self, event: JobFinished) -> None:
        """Print the end of what a renderer printed, in the first run of it that is not as required; verbose, in each.

        Each line begins with a bar: at a line's beginning a CI log would take some texts for commands.
        """
        in_trouble = event.run.error is not None or any(verdict.standing.unexpected for verdict in event.verdicts)
        if not event.printed or not (self._verbose or (in_trouble and event.run.renderer not in self._shown)):
            return
        self._shown.add(event.run.renderer)
        lines = event.printed.splitlines()
        self.line(f"{event.run.renderer} printed on {event.run.suite}/{event.run.case}:")
        if not self._verbose and len(lines) > PRINTED_LINES:
            lines = [f"({plural(len(lines) - PRINTED_LINES, 'line')} before these: -v)", *lines[-PRINTED_LINES:]]
        for line in lines:
            self.line(f"| {line}")

    def _breaks_anew(self, event: JobFinished) -> bool:
        """Return whether a renderer broke in a way in which it has not broken before."""
        if event.run.error is None:
            return False
        # A set: it grows only by a way that is new.
        before = len(self._broken)
        self._broken.add((event.run.renderer, event.run.error.kind))
        return len(self._broken) > before

    def _add(self, event: JobFinished) -> None:
        """Count a job of a suite, and print the suite's line after its last one."""
        suite = self._suites.setdefault(event.run.suite, _SuiteProgress(0))
        suite.finished += 1
        suite.refused += event.run.refusal is not None
        suite.verdicts += event.verdicts
        if suite.finished == suite.planned:
            self._close(event.run.suite)

    def _close(self, name: str) -> None:
        """Print the line of a suite, of which no more runs come."""
        suite = self._suites.pop(name)
        runs = plural(suite.finished, "run")
        if suite.finished < suite.planned:
            runs = f"{suite.finished} of {plural(suite.planned, 'run')}"
        refused = f", {suite.refused} refused" if suite.refused else ""
        count = f"[{self._finished_jobs}/{self._planned_jobs}]"
        self.line(f"{count} {name}: {runs}{refused}{self._verdicts_words(suite.verdicts)}")

    def _job_words(self, event: JobFinished) -> str:
        """Return what came of one run: that it broke, was refused, or its verdicts."""
        if event.error is not None:
            return f": broke: {event.error.what}"
        if event.run.refusal is not None:
            return f": refuses: {event.run.refusal.what}"
        return self._verdicts_words(event.verdicts)

    def _verdicts_words(self, verdicts: Sequence[VerdictEntry]) -> str:
        """Return how many verdicts have each standing, in words; nothing where they are counted at the end only."""
        return f": {counts_in_words(verdict.standing for verdict in verdicts)}" if self._counts else ""

    def working(self, done: int, total: int, what: str) -> None:
        """Take how much of a bench is done and what comes next: a bar on a terminal, elsewhere a line each."""
        if self._stream.isatty():
            self._advance(done, total, what)
        elif what:
            self.line(f"[{done + 1}/{total}] {what}")

    def searching(self, done: float, total: float, what: str) -> None:
        """Take how many seconds of a search are over, and what it has found: a bar, else a line after each silence."""
        # Whole seconds; a search may run a little over its time.
        self.still(min(int(done), int(total)), int(total), what, " s")

    def still(self, done: int, total: int, what: str, unit: str = "") -> None:
        """Move the bar on a terminal; elsewhere print what is at work, after a silence of `WORK_LINE_SECONDS`."""
        if self._stream.isatty():
            self._advance(done, total, what)
        elif time.monotonic() - self._spoke >= WORK_LINE_SECONDS:
            self.line(f"[{done}/{total}{unit}] {what}")

    def waiting(self, what: str, seconds: float, limit: float) -> None:
        """Take what is waited for since how many of `limit` seconds: a bar on a terminal, else a line now and then."""
        if self._stream.isatty():
            self._advance(int(seconds), int(limit), what)
        elif seconds < self._reminded:  # another wait
            self._reminded = 0.0
        elif seconds >= self._reminded + REMINDER_SECONDS:
            self._reminded = seconds
            self.line(f"{what}: {seconds:.0f} of {limit:.0f} s")

    def drawn(self, done: int, total: int) -> None:
        """Take how many of the report's figures are drawn: a bar on a terminal, elsewhere a line before many."""
        if done == 0 and total > FIGURES_UNANNOUNCED and not self._stream.isatty():
            self.line(f"drawing {plural(total, 'figure')}")
        self.still(done, total, "drawing figures")

    def clear(self) -> None:
        """Leave the terminal to what comes on stdout."""
        if self._bar is not None:
            self._bar.stop()  # it comes again below with the next step
            self._bar = None

    def _advance(self, done: int, total: int, what: str) -> None:
        """Move the bar; it appears with the first step that ends after `BAR_AFTER` seconds."""
        if self._bar is None:
            # What is over soon needs no bar.
            if time.monotonic() - self._begun < BAR_AFTER:
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
            self._bar.update(self._task, completed=done, total=total, description=printable(what), refresh=True)

    def line(self, text: str) -> None:
        """Print something on a line of its own."""
        self.clear()
        self._spoke = time.monotonic()
        print(printable(text), file=self._stream, flush=True)


def kernels_are_new() -> bool:
    """Return whether none is compiled yet."""
    from hapticeval.kernel_cache import kernel_folder

    return next(kernel_folder().rglob("*.nbi"), None) is None


def _first_run_words(runs: Sequence[RunKey]) -> str:
    """Return the first of some runs, and how many others there are."""
    (suite, case, renderer), *others = runs
    more = f", and {plural(len(others), 'other run')}" if others else ""
    return f"{renderer} on {suite}/{case}{more}"


def _interrupted_words(event: Interrupted) -> str:
    """Return what happens to the runs that are at work after Ctrl-C."""
    runs = f"{plural(event.begun, 'run')} that had begun {'is' if event.begun == 1 else 'are'}"
    kept_words = "what is done is kept"
    if event.at_once:
        named = f" ({_first_run_words(event.runs)})" if event.runs else ""
        return f"stopped: {runs} given up{named}; {kept_words}"
    if not event.begun:
        return f"interrupted: {kept_words}"
    # How long the rest takes is not known, but what a run that is slow has taken already.
    since = f", the first at work for {event.seconds:.0f} s" if event.seconds >= WORK_LINE_SECONDS else ""
    limit = f", for {event.grace:.0f} s at most" * math.isfinite(event.grace)
    return f"interrupted: {runs} being finished{since}{limit}, {kept_words}; press Ctrl-C again to stop at once"


def on_github() -> bool:
    """Return whether this is a job of GitHub, which shows annotations."""
    return os.environ.get("GITHUB_ACTIONS") == "true"


def annotation(kind: str, title: str, message: str) -> str:
    """Return a workflow command that GitHub shows as an annotation of the job."""

    def escaped(text: str) -> str:
        # The runner's own escapes of a workflow command.
        return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")

    # In a property also : and , are signs of the command.
    return f"::{kind} title={escaped(title).replace(':', '%3A').replace(',', '%2C')}::{escaped(message)}"


def lines(parts: Iterable[str]) -> str:
    """Join parts, each on a line of its own."""
    return "\n".join(parts)


def paragraphs(*parts: str) -> str:
    """Join the parts that are not empty, with an empty line between them."""
    return "\n\n".join(part for part in parts if part)


def columns(rows: Iterable[tuple[str, str]]) -> str:
    """Names in a column, and what they are wrapped beside them."""
    pairs = list(rows)
    # Longer lines are hard to read.
    room = min(shutil.get_terminal_size().columns, 100)
    width = max((len(name) for name, _ in pairs), default=0) + 2
    lines = []
    for name, text in pairs:
        wrapped = textwrap.wrap(text, max(room - width, 20), break_on_hyphens=False) or [""]
        lines.append(f"{name:{width}}{wrapped[0]}".rstrip())
        lines += [" " * width + line for line in wrapped[1:]]
    return "\n".join(lines)


def wrote_lines(paths: Iterable[Path]) -> str:
    """Return a line for each file that was written."""
    return lines(f"wrote {path}" for path in paths)


def say(text: str) -> None:
    """Print on stdout. A reader that has gone away (`| head`) changes no exit code."""
    try:
        print(printable(text), flush=True)
    except BrokenPipeError:
        # Later output goes nowhere, also what Python flushes at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
