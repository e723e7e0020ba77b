"""A case tried on a renderer, in a process of its own: what it broke, and whether the process lived through it."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import lru_cache
from operator import call
from typing import Any, TypeVar, cast

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from hapticeval.discovery import resolve
from hapticeval.errors import RendererError, kind_of, place_in_stack
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import RendererFactory
from hapticeval.runner.judging import judge
from hapticeval.runner.work import seed_all
from hapticeval.suite.case import Case
from hapticeval.workers import Overdue, ProcessEnded, Workers

T = TypeVar("T")

RENDERER = "renderer"
"""In place of a check's id, where the renderer itself broke: it raised, answered nonsense, died or hung."""

SUITE = "search"

FIRST_SILENCE, SILENCE = 30.0, 10.0
"""Seconds without an answer after which a renderer hangs: in its first case on a model, and later.

In its first case it may prepare the model. Time in which its process compiles or waits for a processor does not count.
"""

TOLD_SILENCE = 1.0
"""Seconds without an answer that are told where the time is over before they are a hang. *Chosen*."""

POLL = 0.1


class Fault(Struct, frozen=True):
    """What fails in a case: the `check`, its message, and the metric's `value` and `unit`.

    `kind` tells faults of one check apart: mini and major pop-throughs, contacts let go and not met, types of errors.
    `time` (s) is that of the evidence, if it has one.
    """

    check: str
    kind: str
    message: str
    value: float | None = None
    unit: str = ""
    time: float | None = None

    def same(self, other: Fault) -> bool:
        """Whether it is the same fault, by check and kind."""
        return (self.check, self.kind) == (other.check, other.kind)


class TrialResult(Struct, frozen=True):
    """What came of a case: its faults, `outcomes` by check, and why the renderer `refused` it, if so."""

    faults: tuple[Fault, ...] = ()
    outcomes: dict[str, str] = {}
    refused: str | None = None


class Stopped(Exception):
    """The time is over, or the user has stopped the search, before the case was answered.

    Its text says where the renderer was, if it had given no answer for a while.
    """


class Bench:
    """A process in which one renderer is tried; another takes its place when it dies or hangs. A context manager.

    `over` returns whether there is no time left; it is asked a few times a second, and a case that has begun is then
    given up with `Stopped`.
    """

    def __init__(self, renderer: str, seed: int, over: Callable[[], bool]) -> None:
        self._renderer = renderer
        self._seed = seed
        self._over = over
        self._workers: Workers[Any] | None = None
        self._answered_models: set[str] = set()
        self._longest_silence = 0.0
        self._drawing: Workers[Any] | None = None
        self.tried = 0

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()
        if self._drawing is not None:
            self._drawing.__exit__(None, None, None)

    def __call__(self, case: Case) -> TrialResult:
        """Return what comes of a case. Raises `Stopped`, and whatever stops the search itself."""
        self.tried += 1
        tried = self._call_renderer(case, _try_case, case)
        return TrialResult((tried,)) if isinstance(tried, Fault) else tried

    def call_in_case(self, case: Case, function: Callable[..., T], *arguments: Any) -> T | None:
        """Call a function of renderer, seed and more, about that case; return None where the renderer dies or hangs.

        Raises as `__call__` does.
        """
        outcome = self._call_renderer(case, function, *arguments)
        return None if isinstance(outcome, Fault) else outcome

    def aside(self, function: Callable[..., T], *arguments: Any) -> T:
        """Call a function that needs no renderer in another process, so that the end of the time ends it as well.

        Raises `Stopped`, and what the function raises.
        """
        if self._over():
            raise Stopped
        if self._drawing is None:
            # Apart from the renderer's process, which may end at any time.
            self._drawing = Workers(call, 1)
        self._drawing.begin(0, function, *arguments)
        while not (answers := self._drawing.answers(POLL)):
            if self._over():
                raise Stopped
        if answers[0].error is not None:
            raise answers[0].error
        return cast("T", answers[0].value)

    def _call_renderer(self, case: Case, function: Callable[..., T], *arguments: Any) -> T | Fault:
        """Call a function in the renderer's process; return its value, or the fault where it dies or hangs."""
        if self._over():  # answers may come faster than one is waited for
            raise Stopped
        # Checks have the model turned, scaled and halved too, and the renderer may prepare each of these anew: twice as
        # long as ever before is not a hang.
        model = repr(case.model)
        limit = max(SILENCE if model in self._answered_models else FIRST_SILENCE, 2.0 * self._longest_silence)
        if self._workers is None:
            self._workers = Workers(call, 1)
        self._workers.begin(0, function, self._renderer, self._seed, *arguments)
        silent = longest = 0.0
        looked, waited, answered_before = time.monotonic(), self._workers.starved(0), 0
        while True:
            answers = self._workers.answers(POLL)
            now, waited_now = time.monotonic(), self._workers.starved(0)
            # Seconds since the last look in which the process could have run; waits are counted until it has answered.
            silent += now - looked - max(waited_now - waited, 0.0)
            looked, waited, longest = now, waited_now, max(longest, silent)
            for answer in answers:
                if isinstance(answer.error, ProcessEnded):
                    self._end()
                    return Fault(RENDERER, "dies", f"the renderer ends the process that it runs in: {answer.error.how}")
                if answer.error is not None:
                    raise answer.error
                self._answered_models.add(model)
                self._longest_silence = max(self._longest_silence, longest)
                return cast("T", answer.value)
            answered, compiles = self._workers.pulse(0)
            if compiles or answered != answered_before:
                silent, answered_before = 0.0, answered
            # Silent for too long: the process is ended, and says where it was.
            if silent > limit:
                return Fault(RENDERER, "hangs", f"the renderer gives no answer in {limit:.3g} s{self._end_at_place()}")
            if self._over():
                place = self._end_at_place()
                quiet = f"the renderer had given no answer for {silent:.3g} s{place}"
                raise Stopped(f"{quiet}; after {limit:.3g} s that is a hang" if silent > TOLD_SILENCE else "")

    def _end_at_place(self) -> str:
        """End the renderer's process, and return where it was in words that follow a sentence; empty if unknown."""
        answers = [] if self._workers is None else self._workers.give_up(0.0)
        self._end()
        places = [place_in_stack(answer.error.stack) for answer in answers if isinstance(answer.error, Overdue)]
        return "".join(f": it is {place}" for place in places if place)

    def _end(self) -> None:
        if self._workers is not None:
            self._workers.__exit__(None, None, None)
            self._workers = None


@lru_cache(maxsize=4)
def factory_of(renderer: str) -> RendererFactory:
    """Return the factory of a renderer's name, looked up once."""
    return resolve(renderer)


def _try_case(renderer: str, seed: int, case: Case) -> TrialResult:
    """Judge a renderer in a case, and return what came of it."""
    seed_all(seed)
    judged = judge(factory_of(renderer), renderer, SUITE, case)
    if judged.refusal is not None:
        return TrialResult(refused=judged.refusal.what)
    faults = []
    if isinstance(judged.error, RendererError):
        faults.append(_broken(judged.error, case))
    # A renderer that broke is one fault: the verdicts that it cost say no more.
    for verdict in judged.verdicts if judged.error is None else ():
        finding = verdict.finding
        if verdict.outcome not in (Outcome.FAIL, Outcome.ERROR):
            continue
        kind = "the check itself failed" if verdict.outcome is Outcome.ERROR else finding.facts.fault
        time_ = finding.evidence.get("time")
        metric = finding.metric
        faults.append(
            Fault(
                verdict.check,
                kind,
                finding.message,
                None if metric is None or not np.isfinite(metric.value) else float(metric.value),
                "" if metric is None else metric.unit,
                float(time_) if isinstance(time_, int | float) else None,
            )
        )
    return TrialResult(tuple(faults), {verdict.check: str(verdict.outcome) for verdict in judged.verdicts})


def record_case(renderer: str, seed: int, case: Case) -> Recording | None:
    """Return the recording of a renderer in a case, without checks; None where it breaks."""
    seed_all(seed)
    return judge(factory_of(renderer), renderer, SUITE, replace(case, checks=())).recording


def _broken(error: RendererError, case: Case) -> Fault:
    """Return the fault of a renderer that broke."""
    time_ = None if error.tick is None else error.tick * case.build_scene().sampling_time
    return Fault(RENDERER, kind_of(error.what), error.what, time=time_)
