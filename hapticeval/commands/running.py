"""What the commands that run something share: events to the terminal, then reports."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hapticeval.commands.terminal import Terminal
    from hapticeval.runner.events import Event
    from hapticeval.runner.interrupts import Interrupts
    from hapticeval.runner.results import ResultsDocument


def watch(stream: Iterator[Event], terminal: Terminal) -> ResultsDocument:
    """Give every event to the terminal, and return the results that the last one brings."""
    from hapticeval.runner.events import RunFinished

    if kernels_are_new():
        terminal.line("compiling kernels as they are first used, once: this run takes longer than later ones")
    for event in stream:
        terminal(event)
        if isinstance(event, RunFinished):
            results = event.results
    return results


def kernels_are_new(package: Path = Path(__file__).parents[1]) -> bool:
    """Whether none is compiled yet; no, where they would be kept elsewhere than in the package."""
    elsewhere = "NUMBA_CACHE_DIR" in os.environ or not os.access(package, os.W_OK)
    return not elsewhere and next(package.rglob("*.nbi"), None) is None


def report_on(directory: Path, terminal: Terminal, interrupts: Interrupts) -> list[Path]:
    """Write the reports of the results in `directory`, and return their paths.

    Not where the user has stopped the run at once, or stops the drawing: then it says how to have them later. A first
    interrupt that has ended the run early does not stop the drawing as well.
    """
    from hapticeval.reports import write_reports
    from hapticeval.workers import cores

    meant_for_the_run = int(terminal.interrupted)

    def stopped() -> bool:
        return interrupts.count > meant_for_the_run

    if not stopped():
        try:
            return write_reports(directory, progress=terminal.drawn, workers=cores(), stopped=stopped)
        except KeyboardInterrupt:
            pass
    terminal.stopped = True
    terminal.line(f"no reports are written: hapticeval report {directory} makes them of what is kept")
    return []
