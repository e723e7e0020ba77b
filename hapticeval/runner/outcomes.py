"""The file to which each outcome is added as soon as its job ends, so that a run that was killed can be resumed.

A line of `FILE` is one job's entry and verdicts as JSON, in the order in which jobs end. Where the run was killed in
the middle of a line, that job is done again.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Self

import msgspec

from hapticeval.errors import HapticevalError
from hapticeval.runner.events import JobFinished
from hapticeval.runner.results import Entry, RunEntry, VerdictEntry

FILE = "outcomes.jsonl"


class Line(Entry, frozen=True, kw_only=True):
    """The outcome of one job."""

    run: RunEntry
    verdicts: list[VerdictEntry]


class Outcomes:
    """The file of outcomes in a result folder, open for appending: a context manager. It does nothing without one."""

    def __init__(self, directory: Path | None) -> None:
        self._path = None if directory is None else directory / FILE
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
        try:
            # The system may write a part of it only.
            while line:
                line = line[os.write(self._file, line) :]
        except OSError as error:
            raise HapticevalError(f"cannot write {self._path}", why=error.strerror or str(error)) from error

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
    path = directory / FILE
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
