"""Searches with several seeds, each in a process of its own or on a worker of a cluster, and what they found as one.

The search with one seed depends on no other: what is found does not depend on how many processes there are.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, NamedTuple

from hapticeval.errors import HapticevalError
from hapticeval.geometry.catalogue import make_model
from hapticeval.runner.execution import INTERRUPT_SECONDS, crew_of
from hapticeval.search.counterexample import StoredCounterexample, stored_counterexample
from hapticeval.search.hunt import Search, deadline
from hapticeval.search.shrink import size_of
from hapticeval.search.trial import RENDERER, Bench
from hapticeval.workers import LostError, ProcessEnded


class Hunt(NamedTuple):
    """What to search for: failures of `checks` by a `renderer`, for so many `seconds` or, if given, `examples`.

    `models` are tables as `make_model` takes them; if there are none, those of `drawing.FIRST_MODELS` in a `dimension`.
    `moving`: their bodies slide and spin.
    `known` counterexamples of earlier searches are tried first.
    """

    renderer: str
    checks: Sequence[str]
    models: Sequence[Mapping[str, Any]]
    known: Sequence[StoredCounterexample]
    seconds: float
    examples: int | None
    dimension: int = 2
    moving: bool = False


class HuntResult(NamedTuple):
    """What came of a hunt, see `hunt.Search`; `tried` counts cases that were drawn, `trials` also those of shrinks.

    `silence` is empty where the renderer answered until the end, or was found to hang.
    """

    counterexamples: list[StoredCounterexample]
    judged: Counter[str]
    tried: int
    trials: int
    refused: str | None
    finished: bool
    silence: str


def run_hunt(
    hunt: Hunt,
    seed: int,
    *,
    interrupted: Callable[[], bool] = lambda: False,
    progress: Callable[[float, str], None] | None = None,
    report: Callable[[str], None] | None = None,
) -> HuntResult:
    """Search with one seed, until the hunt's end or an interrupt.

    `progress` gets the seconds so far, and what there is, a few times a second; `report` a line at each step.
    """
    begun = time.monotonic()
    stop = deadline(hunt.seconds, interrupted)

    def over() -> bool:
        if progress is not None:
            progress(time.monotonic() - begun, f"{search.tried} examples, {len(search.counterexamples)} found")
        return stop()

    with Bench(hunt.renderer, seed, over) as bench:
        known = [(counterexample.case, counterexample.examples) for counterexample in hunt.known]
        models = [make_model(**table) for table in hunt.models]
        search = Search(
            bench,
            hunt.checks,
            seed,
            models,
            known,
            hunt.examples,
            report=report,
            dimension=hunt.dimension,
            moving=hunt.moving,
        )
        search.run()
    counterexamples = [
        stored_counterexample(failing_case, hunt.renderer, seed) for failing_case in search.counterexamples.values()
    ]
    # A renderer that hangs is a counterexample, which says more.
    silence = "" if RENDERER in search.counterexamples else search.silence
    return HuntResult(
        counterexamples, search.judged, search.tried, bench.tried, search.refused, search.finished, silence
    )


def merge_hunts(parts: Sequence[HuntResult]) -> HuntResult:
    """Return what several seeds found as one, in the order of seeds: of each check the smallest counterexample."""
    smallest_by_check: dict[str, StoredCounterexample] = {}
    for counterexample in (counterexample for part in parts for counterexample in part.counterexamples):
        best = smallest_by_check.get(counterexample.fault.check)
        # Of equal ones that of the first seed stays.
        if best is None or size_of(counterexample.case) < size_of(best.case):
            smallest_by_check[counterexample.fault.check] = counterexample
    judged = sum((part.judged for part in parts), Counter[str]())
    return HuntResult(
        list(smallest_by_check.values()),
        judged,
        sum(part.tried for part in parts),
        sum(part.trials for part in parts),
        # one seed that was not refused is enough
        None if judged or smallest_by_check else next((part.refused for part in parts if part.refused), None),
        bool(parts) and all(part.finished for part in parts),
        next((part.silence for part in parts if part.silence), ""),
    )


def run_hunts(
    requests: Sequence[Hunt],
    seeds: Sequence[int],
    *,
    workers: int,
    scheduler: str | None,
    interrupted: Callable[[], bool],
    progress: Callable[[int, int, str], None],
    report: Callable[[str], None],
) -> Iterator[tuple[Hunt, HuntResult, int]]:
    """Search with each of the seeds, in so many processes or on a cluster.

    Yields each hunt as soon as its seeds have ended, what came of it, and how many of them have an answer. Those are
    fewer after an interrupt, where the scheduler is lost, and where a seed's process dies or raises an error, which
    `report` gets. What was found with a seed that did not end is lost.

    `progress` gets how many seeds have ended, of how many, and what that is.
    """
    # Call number = hunt * (number of seeds) + seed.
    calls = [(hunt, seed) for hunt in requests for seed in seeds]
    left = dict(enumerate(requests))
    parts: dict[int, HuntResult | None] = {}
    waiting = iter(enumerate(calls))

    def result_of(hunt_number: int) -> tuple[Hunt, HuntResult, int]:
        # None stands for a seed whose process died or raised an error.
        ended = [part for seed in range(len(seeds)) if (part := parts.get(hunt_number * len(seeds) + seed)) is not None]
        return left.pop(hunt_number), merge_hunts(ended), len(ended)

    with crew_of(run_hunt, workers, scheduler) as crew:
        while not interrupted():
            for number, call in islice(waiting, crew.free):
                crew.begin(number, *call)
            # A hunt is over as soon as each of its seeds has ended, in whatever order.
            for hunt_number in list(left):
                if all(hunt_number * len(seeds) + seed in parts for seed in range(len(seeds))):
                    yield result_of(hunt_number)
            if not crew.busy:
                break
            try:
                answers = crew.answers(INTERRUPT_SECONDS)
            except LostError as lost_error:
                report(f"{lost_error.what}: what was found before is kept")
                break
            progress(len(parts), len(calls), "seeds that have ended")
            for worker, why in crew.refused():
                report(f"refused: the worker {worker} searches nothing: {why}")
            for answer in answers:
                parts[answer.call] = answer.value
                hunt, seed = calls[answer.call]
                outcome = _outcome_text(answer.value, answer.error)
                report(f"[{len(parts)}/{len(calls)}] {hunt.renderer}, seed {seed}: {outcome}")
    # Hunts that were cut short, with what their finished seeds have found.
    for hunt_number in list(left):
        yield result_of(hunt_number)


def _outcome_text(part: HuntResult | None, error: Exception | None) -> str:
    """Return what came of a seed, in words."""
    if part is not None:
        return f"{part.tried} drawn, {len(part.counterexamples)} found"
    if isinstance(error, ProcessEnded):
        return f"its process ended: {error.how}" if not error.killed else "its process was killed, again and again"
    if isinstance(error, HapticevalError):
        return str(error)
    return "\n".join([f"{type(error).__name__}: {error}", *getattr(error, "__notes__", ())])
