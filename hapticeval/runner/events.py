"""What a run reports while it goes on: the one stream that terminal, progress bar, JSON and reports read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from hapticeval.errors import HapticevalError
from hapticeval.recordings.recording import Recording
from hapticeval.runner.results import ResultsDocument, RunEntry, RunKey, VerdictEntry


@dataclass(frozen=True)
class RunStarted:
    """The first event: how much is planned."""

    planned_verdicts: int
    planned_jobs: int
    kept_jobs: int = 0
    """Jobs that an earlier run has finished which this one resumes: they are not reported again."""
    jobs_of: Mapping[str, int] = field(default_factory=dict)
    """How many jobs of each suite are to be reported."""
    notes: tuple[str, ...] = ()
    """Remarks on the list of known failures: renderers that do not run, and failures without a size."""
    replaces: str = ""
    """The earlier run in the folder whose results go, as `resuming.describe_replaced_run` says it."""


@dataclass(frozen=True)
class JobFinished:
    """One renderer has gone through one case; `error` is what stopped it, `recording` its run where no file has it.

    `warnings` are those that Python code gave in another process, as text by the place that gave it; a run reports each
    place once. `printed` is the end of what was printed there.
    """

    run: RunEntry
    verdicts: tuple[VerdictEntry, ...]
    error: HapticevalError | None = None
    recording: Recording | None = None
    warnings: Mapping[str, str] = field(default_factory=dict)
    printed: str = ""


@dataclass(frozen=True)
class AtWork:
    """A sign of life while runs take long: how many have ended, and which are at work, the first since `seconds`."""

    finished_jobs: int
    runs: tuple[RunKey, ...]
    seconds: float


@dataclass(frozen=True)
class Interrupted:
    """The user has interrupted: no further job begins, those that have `begun` are finished, or killed `at_once`.

    The first of them has been at work for `seconds`. They have `grace` (s) to finish; the `runs` are what is killed.
    """

    begun: int
    at_once: bool = False
    seconds: float = field(default=0.0, compare=False)
    grace: float = math.inf
    runs: tuple[RunKey, ...] = ()


@dataclass(frozen=True)
class RunFinished:
    """The last event: the results as they are on disk, complete or not."""

    results: ResultsDocument


@dataclass(frozen=True)
class WorkerRefused:
    """A worker of a cluster gets no job, and why."""

    worker: str
    why: str


Event: TypeAlias = RunStarted | JobFinished | AtWork | Interrupted | WorkerRefused | RunFinished
