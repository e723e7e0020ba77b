"""Two result documents compared: verdicts that changed, that came or went, and margins that moved; and their history.

A history is of a renderer's checks over the runs of its commits or versions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

from msgspec import Struct

from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.results import ResultsDocument, VerdictEntry
from hapticeval.runner.standing import Standing, counts_in_words

MARGIN_ROUNDING = 1e-6
"""Bounds by which a margin may move from machine to machine, by rounding in float64."""

Turn = Literal["worse", "better", "changed", "new", "gone"]
"""How a verdict stands to that of the run before."""


class VerdictChange(Struct, frozen=True, kw_only=True):
    """A verdict whose outcome differs between two runs, or that only one of them has.

    `standing`: "worse" where it stops the gate now and did not before, or was not there; "better" the other way round.
    """

    standing: Turn
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
) -> Turn | None:
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
    # A check may have two bounds, of which one must hold: what moved from one to the other is measured by the wider.
    bounds = (first.bound, second.bound) if first.level == second.level else (max(first.bound, second.bound),) * 2
    # A margin in bounds is 1 - value / bound: by = (1 - v2 / b2) - (1 - v1 / b1) = v1 / b1 - v2 / b2.
    by = one.value / bounds[0] - two.value / bounds[1]
    # Rounding grows with the metric where that is many bounds large.
    if abs(by) <= MARGIN_ROUNDING * max(1.0, abs(one.value / bounds[0])):
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


SHORT_COMMIT = 10
"""Signs of a commit that are shown: enough to tell commits apart, and what git takes."""


@dataclass(frozen=True)
class Edition:
    """One run of the renderer: the `folder` of its results, and its `commit`, "" where none is known."""

    folder: Path
    results: ResultsDocument
    commit: str

    @property
    def name(self) -> str:
        """The commit, short, with "-dirty" where files differed from it; else the name of the folder."""
        commit, _, dirty = self.commit.partition("-")
        return commit[:SHORT_COMMIT] + (f"-{dirty}" if dirty else "") if commit else self.folder.name

    @property
    def words(self) -> str:
        """The name with the folder that has the results."""
        return f"{self.name} ({self.folder})" if self.commit else str(self.folder)

    @property
    def day(self) -> str:
        """The day on which it ran, "" where that is not known."""
        return self.results.date[:10]


@dataclass(frozen=True)
class Stand:
    """How a check stood in one edition: all of its verdicts there, at least one.

    `unasked` are those that stopped an earlier gate, of cases that have not been run since.
    """

    edition: Edition
    verdicts: Sequence[VerdictEntry]
    unasked: Sequence[VerdictEntry] = ()

    @cached_property
    def is_red(self) -> bool:
        """Whether it stopped the gate of that run, or would have for all that is known."""
        return any(map(self.edition.results.stops, self.verdicts)) or bool(self.unasked)

    @cached_property
    def gravest(self) -> VerdictEntry:
        """The verdict that calls for attention the most."""
        order = list(Standing).index
        return min(self.verdicts, key=lambda verdict: (order(verdict.standing), *(-part for part in verdict.severity)))

    @property
    def count(self) -> int:
        """How many verdicts stand as the gravest does."""
        return sum(verdict.standing is self.gravest.standing for verdict in self.verdicts)

    @property
    def words(self) -> str:
        """How many verdicts stand how."""
        return counts_in_words(verdict.standing for verdict in self.verdicts)


@dataclass(frozen=True)
class CheckHistory:
    """A check over the editions; None where an edition has no verdict of it."""

    check: str
    stands: Sequence[Stand | None]

    @cached_property
    def _judged(self) -> list[Stand]:
        return [stand for stand in self.stands if stand is not None]

    @property
    def is_red(self) -> bool:
        """Whether it is red in the last edition that asked it."""
        return self._judged[-1].is_red

    @cached_property
    def first_red(self) -> Stand | None:
        """Where the last stretch of red began, which may have ended since; None where it never was red."""
        first = None
        for before, stand in zip([None, *self._judged], self._judged, strict=False):
            if stand.is_red and (before is None or not before.is_red):
                first = stand
        return first

    @property
    def last_green(self) -> Stand | None:
        """What was green just before `first_red`; None where nothing was."""
        if self.first_red is None:
            return None
        position = self._judged.index(self.first_red)
        return self._judged[position - 1] if position else None

    @property
    def mended(self) -> Stand | None:
        """Where it turned green again after `first_red`; None where it is red still."""
        if self.first_red is None or self.is_red:
            return None
        return next(stand for stand in self._judged[self._judged.index(self.first_red) :] if not stand.is_red)

    @property
    def words(self) -> str:
        """Where it turned red, after what, and where it was mended; "" for a check that never was red."""
        if self.first_red is None:
            return ""
        before = f", after {self.last_green.edition.words}" if self.last_green else ", the first that asked it"
        mended = f"; green again in {self.mended.edition.words}" if self.mended else ""
        unasked = self._judged[-1].unasked
        cases = ", ".join(f"{verdict.suite}/{verdict.case}" for verdict in unasked)
        return (
            f"red from {self.first_red.edition.words}{before}{mended}{f'; not run since: {cases}' if unasked else ''}"
        )


@dataclass(frozen=True)
class History:
    """A renderer over its editions, the earliest first. Checks that are red now come first, then those that were."""

    renderer: str
    editions: Sequence[Edition]
    checks: Sequence[CheckHistory]

    @property
    def first_red(self) -> Edition | None:
        """The earliest edition from which on a check is red to the last; None where none is."""
        firsts = [check.first_red.edition for check in self.checks if check.is_red and check.first_red]
        return min(firsts, key=self.editions.index, default=None)


def histories_of(runs: Sequence[tuple[Path, ResultsDocument]], renderers: Sequence[str] = ()) -> list[History]:
    """Return a history of each renderer, or of those that are named, over runs in the order that is given."""
    names = list(dict.fromkeys(name for _, results in runs for name in results.renderers))
    return [_history(name, runs) for name in names if not renderers or name in renderers]


def _history(name: str, runs: Sequence[tuple[Path, ResultsDocument]]) -> History:
    editions = [
        Edition(folder, results, results.commits.get(name, "")) for folder, results in runs if name in results.renderers
    ]
    verdicts_by_place: dict[tuple[str, int], list[VerdictEntry]] = {}
    for number, edition in enumerate(editions):
        for verdict in edition.results.verdicts:
            if verdict.renderer == name:
                verdicts_by_place.setdefault((verdict.check, number), []).append(verdict)
    checks = [
        CheckHistory(
            check, _stands([verdicts_by_place.get((check, number), []) for number in range(len(editions))], editions)
        )
        for check in dict.fromkeys(check for check, _ in verdicts_by_place)
    ]
    # Sorting keeps the order of the suites among equals.
    return History(name, editions, sorted(checks, key=lambda check: (not check.is_red, check.first_red is None)))


def _stands(verdicts: Sequence[Sequence[VerdictEntry]], editions: Sequence[Edition]) -> list[Stand | None]:
    """Return how a check stood in each edition, by its verdicts there; a case stays red until it is run again."""
    stands: list[Stand | None] = []
    red: dict[tuple[str, str], VerdictEntry] = {}
    for edition, of_edition in zip(editions, verdicts, strict=True):
        for verdict in of_edition:
            red.pop((verdict.suite, verdict.case), None)
        stands.append(Stand(edition, of_edition, tuple(red.values())) if of_edition else None)
        red |= {(verdict.suite, verdict.case): verdict for verdict in of_edition if edition.results.stops(verdict)}
    return stands
