"""Two result documents compared: verdicts that changed, that came or went, and margins that moved."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal

from msgspec import Struct

from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.results import ResultsDocument, VerdictEntry

ROUNDING = 1e-6
"""Bounds by which a margin may move from machine to machine, by rounding in float64."""

Standing = Literal["worse", "better", "changed", "new", "gone"]


class VerdictChange(Struct, frozen=True, kw_only=True):
    """A verdict whose outcome differs between two runs, or that only one of them has.

    `standing`: "worse" where it stops the gate now and did not before, or was not there; "better" the other way round.
    """

    standing: Standing
    renderer: str
    place: str
    before: Outcome | None
    now: Outcome | None
    message: str


class MarginMove(Struct, frozen=True, kw_only=True):
    """A margin that moved, `by` so many bounds; one that moved by less than 0 is nearer to failing, or fails by more.

    `before` and `now` are the metric in its unit.
    """

    renderer: str
    place: str
    metric: str
    unit: str
    before: float
    now: float
    by: float


class Diff(Struct, frozen=True, kw_only=True):
    """What differs between two runs: `verdicts` with the worse ones first, `margins` with the largest moves first.

    `compared` counts the verdicts that both have. `suites` says which suites are not the same in both runs.
    """

    compared: int
    suites: list[str]
    verdicts: list[VerdictChange]
    margins: list[MarginMove]
    incomplete: str | None

    def stops(self, *, strict: bool) -> bool:
        """Return whether something got worse or the new run is incomplete; if `strict` also what changed or is gone."""
        bad = ("worse", "gone", "changed") if strict else ("worse",)
        return self.incomplete is not None or any(verdict.standing in bad for verdict in self.verdicts)


def compare_results(before: ResultsDocument, now: ResultsDocument) -> Diff:
    """Compare two runs verdict by verdict, each found by renderer, suite, case and check."""
    old, new = _by_name(before), _by_name(now)
    changes = []
    moves = []
    for name in [*old, *(name for name in new if name not in old)]:
        first, second = old.get(name), new.get(name)
        standing = _standing(before, first, now, second)
        if standing is not None:
            verdict = second or first
            assert verdict is not None
            changes.append(
                VerdictChange(
                    standing=standing,
                    renderer=verdict.renderer,
                    place=verdict.place,
                    before=None if first is None else first.outcome,
                    now=None if second is None else second.outcome,
                    message=verdict.message,
                )
            )
        if first is not None and second is not None:
            moves += _moved(first, second)
    # What asks for a look comes first.
    order: Mapping[str, int] = {name: rank for rank, name in enumerate(("worse", "changed", "gone", "better", "new"))}
    return Diff(
        compared=len(old.keys() & new.keys()),
        suites=list(_changed_suites(before, now)),
        verdicts=sorted(changes, key=lambda change: order[change.standing]),
        margins=sorted(moves, key=lambda move: -abs(move.by)),
        incomplete=None if now.complete else now.reason,
    )


def _changed_suites(before: ResultsDocument, now: ResultsDocument) -> Iterator[str]:
    """Yield, for each suite that asks something else than before, its two versions and the cases that changed."""
    earlier = {suite.name: suite for suite in before.suites}
    for suite in now.suites:
        other = earlier.get(suite.name, suite)
        changed = [
            case
            for case, digest in suite.case_digests.items()
            # a case that only one of the runs has shows as new or gone verdicts
            if digest != other.case_digests.get(case, digest)
        ]
        cases = f"; cases that ask something else: {', '.join(changed)}" if changed else ""
        if other.version != suite.version:
            yield f"{other.label} before, {suite.label} now: verdicts may differ for the suite's sake{cases}"
        elif changed:
            yield f"{suite.label} was changed{cases}"


def _by_name(results: ResultsDocument) -> dict[tuple[str, str], VerdictEntry]:
    return {(verdict.renderer, verdict.place): verdict for verdict in results.verdicts}


def _standing(
    before: ResultsDocument, first: VerdictEntry | None, now: ResultsDocument, second: VerdictEntry | None
) -> Standing | None:
    """Return how a verdict stands to that of the run before; None where outcome and weight are the same."""
    if second is None:
        return "gone"
    stopped, stops = first is not None and before.stops(first), now.stops(second)
    if stops and not stopped:
        return "worse"
    if first is None:
        return "new"
    # Better is what stops the gate no more: also a failure that is on the list of known ones since.
    if stopped and not stops:
        return "better"
    return "changed" if first.outcome != second.outcome else None


def _moved(first: VerdictEntry, second: VerdictEntry) -> list[MarginMove]:
    """Return how the margin of one verdict moved in bounds, where it has the same metric as before and did move."""
    one, two = first.metric, second.metric
    # Metrics of different names or units cannot be subtracted.
    if one is None or two is None or (one.name, one.unit) != (two.name, two.unit):
        return []
    if one.value is None or two.value is None or not first.bound or not second.bound:
        return []
    # A margin in bounds is 1 - value / bound: by = (1 - v2 / b2) - (1 - v1 / b1) = v1 / b1 - v2 / b2.
    by = one.value / first.bound - two.value / second.bound
    # Rounding grows with the metric where that is many bounds large.
    if abs(by) <= ROUNDING * max(1.0, abs(one.value / first.bound)):
        return []
    return [
        MarginMove(
            renderer=second.renderer,
            place=second.place,
            metric=one.name,
            unit=one.unit,
            before=one.value,
            now=two.value,
            by=by,
        )
    ]
