"""A search: cases are drawn and tried until each check has failed once, and each failure is shrunk.

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
from hapticeval.search.drawing import drawn, first_models
from hapticeval.search.shrink import Shrink, size_of
from hapticeval.search.trial import RENDERER, Bench, Fault, Stopped
from hapticeval.suite.case import Case
from hapticeval.types import Array

SMALL = 3e-3
"""A path of this length (m) is small enough: a longer one is looked for again on other models."""

AGAIN = 5
"""How many further failures of a check are shrunk, on other models or of another kind, in search of a smaller one."""

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
    models: set[str] = field(default_factory=set)

    @property
    def size(self) -> float:
        """The length of its path, m, or how long its experiment lasts, s."""
        return size_of(self.case)


@dataclass
class Search:
    """A search for what one renderer breaks: `checks` in turn, on `models` or on those that come with the package.

    `known` are cases of earlier searches, tried first, with the number of examples after which each was met; `told`
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
    told: Callable[[str], None] | None = None
    found: dict[str, Found] = field(default_factory=dict)
    tried: int = 0
    judged: Counter[str] = field(default_factory=Counter)
    refused: str | None = None
    finished: bool = False

    def run(self) -> None:
        """Search until every check has failed, as many cases as `most` were drawn, or it is stopped."""
        left = list(self.checks)
        taken = False
        refusing: set[str] = set()
        models = len(first_models(self.models))
        try:
            for case, before in self._cases(left, refusing):
                model = repr(case.model)
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
                    self._note(case, fault, before)
                for fault in answer.faults:
                    self._meet(case, fault, before)
                for name in [name for name in left if self._enough(name)]:
                    left.remove(name)
                if not left or (self.most is not None and self.tried >= self.most) or RENDERER in self.found:
                    break
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
        yield from ((case, None) for case in drawn(self.models, left, self.seed, refusing))

    def _enough(self, name: str) -> bool:
        """Whether a check need not be looked for any more."""
        found = self.found.get(name)
        if found is None:
            return False
        return found.case.experiment is not None or found.size <= SMALL or len(found.models) > AGAIN

    def _note(self, case: Case, fault: Fault, before: int | None) -> None:
        """Keep a failure of a check that has not failed before, as it is: a shrink of another one may take long."""
        if fault.check not in self.found:
            asked = case.checks if fault.check == RENDERER else (fault.check,)
            examples = self.tried if before is None else before
            self.found[fault.check] = Found(replace(case, checks=asked), fault, examples, complete=False)

    def _meet(self, case: Case, fault: Fault, before: int | None) -> None:
        """Shrink a failure, unless one of that check and kind is known on that model; keep it if it is the smallest."""
        model = repr((case.model, fault.kind))
        best = self.found.get(fault.check)
        if best is not None and not best.models:
            best = None  # only noted
        if best is not None and (model in best.models or self._enough(fault.check)):
            return
        asked = case.checks if fault.check == RENDERER else (fault.check,)
        examples = self.tried if before is None else before
        made = Found(replace(case, checks=asked), fault, examples)
        made.models = (set() if best is None else best.models) | {model}
        self._tell(f"{fault.check} fails after {examples} example{'s' * (examples != 1)}; shrinking")
        shrink = Shrink(made.case, fault, lambda smaller: self._fault_of(smaller, fault))
        try:
            if best is None:
                self.found[fault.check] = made
            if before is None or (case.experiment is None and made.size > SMALL):
                shrink.run()  # what is known and small stays as it was found
            made.case, made.fault = shrink.case, shrink.fault
            if fault.check == JUMPS:
                made.pair = self.bench.pair(made.case, made.fault)
        except Stopped:
            made.case, made.fault, made.complete = shrink.case, shrink.fault, False
            raise
        finally:
            if best is not None:
                best.models.add(model)
                if made.complete and made.size < best.size:
                    self.found[fault.check] = made

    def _tell(self, text: str) -> None:
        if self.told is not None:
            self.told(text)

    def _fault_of(self, case: Case, wanted: Fault) -> Fault | None:
        return next((fault for fault in self.bench(case).faults if fault.same(wanted)), None)


def deadline(seconds: float, interrupted: Callable[[], bool]) -> Callable[[], bool]:
    """Return what is true from `seconds` from now on, and once the user has interrupted."""
    end = time.monotonic() + seconds

    def over() -> bool:
        return interrupted() or time.monotonic() > end

    return over
