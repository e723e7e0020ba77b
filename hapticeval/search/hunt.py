"""A search: cases are drawn and tried until each check has failed once, and each failure is shrunk.

What fails on one model is shrunk when all that is drawn on it was tried, by turns: one fault that takes long to shrink
keeps no other from being found, or made smaller.

The clock decides where a search stops, and never what it tries: cases come in the order of `drawing.drawn`, a shrink
tries what it tries, and both are cut short where the time is over. What was found before that is what any longer search
with the same seed and versions finds first, to the byte; a case whose shrink was cut short is marked.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from msgspec.structs import replace

from hapticeval.geometry.model import Model
from hapticeval.phenomena.verdict import Outcome
from hapticeval.search.bisection import jump_between
from hapticeval.search.drawing import drawn, first_models
from hapticeval.search.shrink import MOST, Shrink, size_of
from hapticeval.search.trial import RENDERER, Bench, Fault, Stopped
from hapticeval.suite.case import Case
from hapticeval.types import Array

SMALL = 3e-3
"""A path of this length (m) is small enough: a longer one is looked for again on other models."""

AGAIN = 5
"""How many further failures of a check are shrunk, on other models or of another kind, in search of a smaller one."""

TURN = 100
"""Cases that a shrink tries before the next one has its turn."""

DECIDED = (Outcome.PASS, Outcome.FAIL)
"""Outcomes of a check that has something to say of a case."""

JUMPS = "continuous-contact"
"""The check whose faults are jumps of the IHIP, which a bisection confirms."""


@dataclass
class Found:
    """A counterexample: the smallest case known, what it breaks, after how many `examples` it was first met.

    `complete`: its shrink was not cut short. `pair`: HIPs a nanometre apart between which the IHIP jumps, and by how
    much, m.
    """

    case: Case
    fault: Fault
    examples: int
    complete: bool = True
    pair: tuple[Array, Array, float] | None = None

    @property
    def size(self) -> float:
        """The length of its path, m, or how long its experiment lasts, s."""
        return size_of(self.case)


@dataclass
class Search:
    """A search for what one renderer breaks: `checks` in turn, on `models` or on those of that `dimension`.

    `known` are cases of earlier searches, tried first, with the number of examples after which each was met; `report`
    gets a line at each step. After `run`, `found` has what was found by check, `tried` how many cases were drawn,
    `judged` in how many cases each check has passed or failed, `refused` why the renderer would not take any, and
    `finished` whether nothing has stopped it.
    """

    bench: Bench
    checks: Sequence[str]
    seed: int
    models: Sequence[Model] = ()
    known: Iterable[tuple[Case, int]] = ()
    most: int | None = None
    report: Callable[[str], None] | None = None
    dimension: int = 2
    found: dict[str, Found] = field(default_factory=dict)
    tried: int = 0
    judged: Counter[str] = field(default_factory=Counter)
    refused: str | None = None
    finished: bool = False
    _looked: dict[str, set[str]] = field(default_factory=dict)
    _waiting: list[tuple[Found, Shrink, bool]] = field(default_factory=list)

    def run(self) -> None:
        """Search until every check has failed, as many cases as `most` were drawn, or it is stopped."""
        left = list(self.checks)
        taken = False
        refusing: set[str] = set()
        models = len(first_models(self.models, self.dimension))
        last: tuple[str, bool] | None = None
        try:
            for case, before in self._cases(left, refusing):
                model = repr(case.model)
                if (model, before is None) != last:
                    self._settle(left)
                    last = model, before is None
                if not left:
                    break
                if model in refusing:
                    continue
                self.tried += before is None
                answer = self.bench(case)
                if answer.refused is not None:
                    refusing.add(model)
                    self.refused = answer.refused
                    if not taken and len(refusing) >= models:
                        break
                    continue
                taken = True
                self.judged.update(name for name, outcome in answer.outcomes.items() if outcome in DECIDED)
                for fault in answer.faults:
                    self._meet(case, fault, before)
                if (self.most is not None and self.tried >= self.most) or RENDERER in self.found:
                    break
            self._settle(left)
            self.finished = True
        except Stopped:
            pass
        if taken:
            self.refused = None

    def _cases(self, left: Sequence[str], refusing: set[str]) -> Iterator[tuple[Case, int | None]]:
        """Yield cases that are known, with their number of examples, and then drawn ones."""
        for case, examples in self.known:
            asked = tuple(name for name in case.checks if name in left)
            if asked:
                yield replace(case, checks=asked), examples
        draws = drawn(self.models, left, self.seed, refusing, dimension=self.dimension, call=self.bench.aside)
        yield from ((case, None) for case in draws)

    def _enough(self, name: str) -> bool:
        """Whether a check need not be looked for any more."""
        found = self.found.get(name)
        if found is None:
            return False
        return found.case.experiment is not None or found.size <= SMALL or len(self._looked[name]) > AGAIN

    def _meet(self, case: Case, fault: Fault, before: int | None) -> None:
        """Keep a failure and queue its shrinking; ignore one of a check and kind that is known on that model."""
        model = repr((case.model, fault.kind))
        looked = self._looked.setdefault(fault.check, set())
        if model in looked or (fault.check in self.found and self._enough(fault.check)):
            return
        looked.add(model)
        asked = case.checks if fault.check == RENDERER else (fault.check,)
        made = Found(replace(case, checks=asked), fault, self.tried if before is None else before, complete=False)
        self.found.setdefault(fault.check, made)
        shrink = Shrink(made.case, fault, lambda smaller: self._fault_of(smaller, fault))
        # What is known and small stays as it was found.
        stays = before is not None and (case.experiment is not None or made.size <= SMALL)
        self._waiting.append((made, shrink, stays))

    def _settle(self, left: list[str]) -> None:
        """Shrink what waits for it, by turns, and take from `left` what need not be looked for any more."""
        waiting, self._waiting = self._waiting, []
        for most in (TURN, MOST):
            for made, shrink, stays in waiting:
                if made.complete:
                    continue
                if most == TURN:
                    many = f"{made.examples} example{'s' * (made.examples != 1)}"
                    self._tell(f"{made.fault.check} fails after {many}; shrinking")
                try:
                    done = stays or shrink.run(most)
                finally:
                    made.case, made.fault = shrink.case, shrink.fault
                if done or most == MOST:
                    if made.fault.check == JUMPS:
                        made.pair = self.bench.asked(made.case, jump_between, made.case, made.fault)
                    made.complete = True
                best = self.found[made.fault.check]
                if made.complete and (made.size < best.size or not best.complete):
                    self.found[made.fault.check] = made
        for name in [name for name in left if self._enough(name)]:
            left.remove(name)

    def _tell(self, text: str) -> None:
        if self.report is not None:
            self.report(text)

    def _fault_of(self, case: Case, wanted: Fault) -> Fault | None:
        return next((fault for fault in self.bench(case).faults if fault.same(wanted)), None)


def deadline(seconds: float, interrupted: Callable[[], bool]) -> Callable[[], bool]:
    """Return what is true from `seconds` from now on, and once the user has interrupted."""
    end = time.monotonic() + seconds

    def over() -> bool:
        return interrupted() or time.monotonic() > end

    return over
