"""A search: cases are drawn and tried until each check has failed once, and each failure is shrunk.

What fails on one model is shrunk when all that is drawn on it was tried, by turns: a fault that takes long to shrink
keeps no other from being found, or made smaller.

The clock decides where a search stops, and never what it tries: cases come in the order of `drawing.draw_cases`. What
was found by then is what any longer search with the same seed and versions finds first, to the byte. A case is marked
if its shrink was cut short.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from msgspec.structs import replace

from hapticeval.geometry.model import Model
from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.quantity import plural
from hapticeval.runner.work import seed_all
from hapticeval.search.drawing import draw_cases, first_models
from hapticeval.search.shrink import MOST_TRIALS, Shrink, size_of
from hapticeval.search.trial import RENDERER, Bench, Fault, Stopped, factory_of
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import answers_along
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.case import Case
from hapticeval.types import Array

SMALL_PATH = 3e-3
"""Length (m) of a path that is small enough; after a longer one the search goes on for a shorter, on other models."""

MORE_SHRINKS = 5
"""How many further failures of a check are shrunk, on other models or of another kind, in search of a smaller one."""

TRIALS_PER_TURN = 100
"""Cases that a shrink tries before the next one has its turn."""

DECIDED = (Outcome.PASS, Outcome.FAIL)
"""Outcomes of a check that has something to say of a case."""

JUMP_CHECK = "continuous-contact"
"""The check whose faults are jumps of the IHIP, which a bisection confirms."""


@dataclass
class FailingCase:
    """A counterexample in the making: the smallest case so far, what it breaks, and after how many examples it was met.

    `complete`: its shrink has ended. `pair`: two HIPs (N,), m, a nanometre apart, and how far the IHIP jumps between
    them, m.
    """

    case: Case
    fault: Fault
    examples: int
    complete: bool = True
    pair: tuple[Array, Array, float] | None = None

    @property
    def size(self) -> float:
        """Length of its path, m, or duration of its experiment, s."""
        return size_of(self.case)


@dataclass
class Search:
    """A search for the checks that one renderer fails, on `models` or on `FIRST_MODELS` in a `dimension`.

    - `known`: cases of earlier searches, tried first, with the number of examples after which each was met.
    - `most_examples`: how many cases are drawn at most; None for no end.
    - `report`: gets a line at each step.

    After `run`:

    - `counterexamples`: what was found, by check.
    - `tried`: how many cases were drawn.
    - `judged`: in how many cases each check has passed or failed.
    - `refused`: why the renderer would not take any case, if so.
    - `finished`: whether nothing has stopped the search.
    - `silence`: where the renderer was, if it gave no answer when the search was stopped.
    """

    bench: Bench
    checks: Sequence[str]
    seed: int
    models: Sequence[Model] = ()
    known: Iterable[tuple[Case, int]] = ()
    most_examples: int | None = None
    report: Callable[[str], None] | None = None
    dimension: int = 2
    moving: bool = False
    counterexamples: dict[str, FailingCase] = field(default_factory=dict)
    tried: int = 0
    judged: Counter[str] = field(default_factory=Counter)
    refused: str | None = None
    finished: bool = False
    silence: str = ""
    _looked: dict[str, set[str]] = field(default_factory=dict)
    _waiting: list[tuple[FailingCase, Shrink, bool]] = field(default_factory=list)

    def run(self) -> None:
        """Search until every check has failed, as many cases as `most_examples` were drawn, or it is stopped."""
        open_checks = list(self.checks)
        takes_any = False
        refusing: set[str] = set()
        models = len(first_models(self.models, self.dimension))
        last_group: tuple[str, bool] | None = None
        try:
            for case, examples_before in self._cases(open_checks, refusing):
                model = repr(case.model)
                # Another model, or the first case that is drawn: shrink what has failed until here.
                if (model, examples_before is None) != last_group:
                    self._settle(open_checks)
                    last_group = model, examples_before is None
                if not open_checks:
                    break
                if model in refusing:
                    continue
                self.tried += examples_before is None
                answer = self.bench(case)
                if answer.refused is not None:
                    refusing.add(model)
                    self.refused = answer.refused
                    # It has refused each of the models that come first, and would refuse any.
                    if not takes_any and len(refusing) >= models:
                        break
                    continue
                takes_any = True
                self.judged.update(name for name, outcome in answer.outcomes.items() if outcome in DECIDED)
                for fault in answer.faults:
                    self._meet(case, fault, examples_before)
                if (
                    self.most_examples is not None and self.tried >= self.most_examples
                ) or RENDERER in self.counterexamples:
                    break
            self._settle(open_checks)
            self.finished = True
        except Stopped as stopped:
            self.silence = str(stopped)
        if takes_any:
            self.refused = None

    def _cases(self, open_checks: Sequence[str], refusing: set[str]) -> Iterator[tuple[Case, int | None]]:
        """Yield known cases, with the number of examples after which each was met, then drawn ones, with None."""
        for case, examples in self.known:
            asked_checks = tuple(name for name in case.checks if name in open_checks)
            if asked_checks:
                yield replace(case, checks=asked_checks), examples
        draws = draw_cases(
            self.models,
            open_checks,
            self.seed,
            refusing,
            dimension=self.dimension,
            moving=self.moving,
            call=self.bench.aside,
        )
        yield from ((case, None) for case in draws)

    def _enough(self, name: str) -> bool:
        """Whether the counterexample of a check is good enough, or enough others have been shrunk."""
        smallest = self.counterexamples.get(name)
        if smallest is None:
            return False
        return (
            smallest.case.experiment is not None
            or smallest.size <= SMALL_PATH
            or len(self._looked[name]) > MORE_SHRINKS
        )

    def _meet(self, case: Case, fault: Fault, examples_before: int | None) -> None:
        """Queue a failure to be shrunk, unless that model has shown one of that check and kind already."""
        # One fault of each kind is shrunk on each model: more of them would shrink to the same.
        model = repr((case.model, fault.kind))
        shrunk_faults = self._looked.setdefault(fault.check, set())
        if model in shrunk_faults or (fault.check in self.counterexamples and self._enough(fault.check)):
            return
        shrunk_faults.add(model)
        # A renderer may break on account of what any of the checks asks.
        asked_checks = case.checks if fault.check == RENDERER else (fault.check,)
        failing_case = FailingCase(
            replace(case, checks=asked_checks),
            fault,
            self.tried if examples_before is None else examples_before,
            complete=False,
        )
        self.counterexamples.setdefault(fault.check, failing_case)
        shrink = Shrink(failing_case.case, fault, lambda smaller: self._fault_of(smaller, fault))
        # What is known and small stays as it was found.
        is_small = examples_before is not None and (case.experiment is not None or failing_case.size <= SMALL_PATH)
        self._waiting.append((failing_case, shrink, is_small))

    def _settle(self, open_checks: list[str]) -> None:
        """Shrink all queued failures, by turns, and take from `open_checks` those that are done with."""
        waiting, self._waiting = self._waiting, []
        # A turn of a few trials for each first, so that none waits for one that is hard to shrink.
        for most_trials in (TRIALS_PER_TURN, MOST_TRIALS):
            for failing_case, shrink, is_small in waiting:
                if failing_case.complete:
                    continue
                if most_trials == TRIALS_PER_TURN and self.report is not None:
                    after_examples = plural(failing_case.examples, "example")
                    self.report(f"{failing_case.fault.check} fails after {after_examples}; shrinking")
                try:
                    done = is_small or shrink.run(most_trials)
                # Also where the time is over in the middle of it.
                finally:
                    failing_case.case, failing_case.fault = shrink.case, shrink.fault
                if done or most_trials == MOST_TRIALS:
                    if failing_case.fault.check == JUMP_CHECK:
                        failing_case.pair = self.bench.call_in_case(
                            failing_case.case, jump_between, failing_case.case, failing_case.fault
                        )
                    failing_case.complete = True
                best = self.counterexamples[failing_case.fault.check]
                if failing_case.complete and (failing_case.size < best.size or not best.complete):
                    self.counterexamples[failing_case.fault.check] = failing_case
        for name in [name for name in open_checks if self._enough(name)]:
            open_checks.remove(name)

    def _fault_of(self, case: Case, original: Fault) -> Fault | None:
        """Return the fault of a case that is the same as the original one; None where it does not fail so."""
        return next((fault for fault in self.bench(case).faults if fault.same(original)), None)


def deadline(seconds: float, interrupted: Callable[[], bool]) -> Callable[[], bool]:
    """Return the function that says whether the time is over: `seconds` from now, or once the user has interrupted."""
    end = time.monotonic() + seconds

    def over() -> bool:
        return interrupted() or time.monotonic() > end

    return over


FINEST_STEP = 1e-9
"""Distance (m) of the two HIPs between which a jump is placed."""

REMAINING_SHARE = 0.5
"""Share of the jump between two samples that must be left between HIPs a nanometre apart."""


def jump_between(renderer: str, seed: int, case: Case, fault: Fault) -> tuple[Array, Array, float] | None:
    """Return two HIPs (N,), m, a nanometre apart between which the IHIP jumps, and how far it does, m.

    `fault` says at which time of the path the jump was seen. Each time the hand is led along the path to the sample
    before that, and on to a point between it and the next sample. There it rests until a proxy that lags has come.
    Bisection of that point closes in on the jump.

    None where the renderer answers a path as a whole, where the case is not a path, and where less than half of the
    jump is left: then the IHIP moves fast there, and does not jump.
    """
    scene = case.build_scene()
    renderer_instance = make_renderer(factory_of(renderer), scene)
    path = case.build_stimulus(scene, renderer_instance)
    if fault.time is None or not renderer_instance.steps or not isinstance(path, Path):
        return None
    hips = path.sampled(scene.sampling_time)[1]
    tick = round(fault.time / scene.sampling_time)

    def answer(before: int, hip: Array) -> Array:
        """Return the IHIP (N,), m, with the hand at rest at `hip` (N,), m, after the path up to sample `before`."""
        seed_all(seed)
        hand_path = np.vstack([hips[: before + 1], np.tile(hip, (LAG_TICKS + 1, 1))])
        return np.asarray(answers_along(renderer_instance, hand_path, scene.sampling_time, scene=scene).ihip[-1])

    # Where a proxy lags, the hand has made the step before the IHIP jumps.
    for tick_after in range(min(tick, len(hips) - 1), max(tick - LAG_TICKS - 1, 0), -1):
        hip_low, hip_high = hips[tick_after - 1], hips[tick_after]
        ihip_low, ihip_high = answer(tick_after - 1, hip_low), answer(tick_after - 1, hip_high)
        jump = float(np.linalg.norm(ihip_high - ihip_low))
        if fault.value is None or jump < REMAINING_SHARE * fault.value:
            continue
        # The jump is between HIPs low and high: the middle goes to the side whose IHIP is nearer to its own.
        while np.linalg.norm(hip_high - hip_low) > FINEST_STEP:
            hip_middle = 0.5 * (hip_low + hip_high)
            # Neighbouring floats have nothing between them.
            if np.array_equal(hip_middle, hip_low) or np.array_equal(hip_middle, hip_high):
                break
            ihip_middle = answer(tick_after - 1, hip_middle)
            if np.linalg.norm(ihip_middle - ihip_low) < np.linalg.norm(ihip_middle - ihip_high):
                hip_low, ihip_low = hip_middle, ihip_middle
            else:
                hip_high, ihip_high = hip_middle, ihip_middle
        final_jump = float(np.linalg.norm(ihip_high - ihip_low))
        # What shrinks with the HIP's step is a steep place and no jump.
        return (hip_low, hip_high, final_jump) if final_jump >= REMAINING_SHARE * jump else None
    return None
