"""What the commands that run something share: events to the terminal, then reports."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hapticeval.events import Event
    from hapticeval.results import Results
    from hapticeval.terminal import Terminal


def watch(stream: Iterator[Event], terminal: Terminal) -> Results:
    """Give every event to the terminal, and return the results that the last one brings.

    Ctrl-C may come while an event is shown; the stream must learn of it to end the run in good order.
    """
    from hapticeval.events import RunFinished

    results = None
    for event in stream:
        try:
            terminal(event)
        except KeyboardInterrupt:
            if not isinstance(stream, Generator):
                raise
            event = stream.throw(KeyboardInterrupt)
        if isinstance(event, RunFinished):
            results = event.results
    assert results is not None
    return results


def report_on(directory: Path, terminal: Terminal) -> list[Path]:
    """Write the reports of the results in `directory`, and return their paths."""
    from hapticeval.reports import write_reports

    return write_reports(directory, progress=terminal.drawn, workers=cores())


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
