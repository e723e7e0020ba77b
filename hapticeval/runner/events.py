"""What a run tells while it goes on: the one stream that terminal, progress bar, JSON and reports drink from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from hapticeval.errors import HapticevalError, RefusalError
from hapticeval.phenomena.verdict import Verdict
from hapticeval.runner.results import Results


@dataclass(frozen=True)
class RunStarted:
    """Before the first job: how much is planned."""

    planned_verdicts: int
    planned_jobs: int


@dataclass(frozen=True)
class JobFinished:
    """One renderer has gone through one case."""

    suite: str
    case: str
    renderer: str
    verdicts: tuple[Verdict, ...]
    error: HapticevalError | None
    refusal: RefusalError | None
    simulated_seconds: float
    wall_seconds: float


@dataclass(frozen=True)
class Interrupted:
    """After the user's interrupt: no further job begins, and the `begun` ones are finished, or killed `at_once`."""

    begun: int
    at_once: bool = False


@dataclass(frozen=True)
class RunFinished:
    """After the last job, or after the user's interrupt: the results as they stand on disk."""

    results: Results


Event: TypeAlias = RunStarted | JobFinished | Interrupted | RunFinished
