"""A renderer over several runs of its commits or versions: how each check stood, and where it turned red."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from hapticeval.runner.results import ResultsDocument, VerdictEntry
from hapticeval.runner.standing import Standing, counts_in_words

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
