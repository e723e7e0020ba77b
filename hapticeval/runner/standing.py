"""What a verdict amounts to: the one set of words, signs and counts of terminal, reports, JUnit, badge and pytest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from enum import StrEnum
from types import MappingProxyType


class Standing(StrEnum):
    """What a verdict means for the reader, the gravest first: its outcome compared with what was expected."""

    ERROR = "error"
    FAIL = "fail"
    DIFFERS = "differs"
    UNDECIDED = "undecided"
    WARNING = "warning"
    OUTDATED = "outdated"
    KNOWN = "known"
    INHERENT = "inherent"
    PASS = "pass"
    NOT_JUDGED = "not-judged"
    NOT_APPLICABLE = "not-applicable"

    @property
    def words(self) -> str:
        """The standing of one verdict as a reader sees it."""
        return {Standing.NOT_JUDGED: "not judged", Standing.NOT_APPLICABLE: "n/a"}.get(self, str(self))

    @property
    def plural(self) -> str:
        """The standing of several verdicts, in a sentence after their number."""
        return PLURALS[self]

    @property
    def symbol(self) -> str:
        """A shape of its own, so that no standing is told by its colour alone."""
        return SYMBOLS[self]

    @property
    def meaning(self) -> str:
        """What it says, for a legend."""
        return MEANINGS[self]

    @property
    def unexpected(self) -> bool:
        """Whether it stops a gate."""
        return self in (Standing.ERROR, Standing.FAIL, Standing.DIFFERS, Standing.UNDECIDED)

    @property
    def stops_strict(self) -> bool:
        """Whether it stops a gate that is strict."""
        return self.unexpected or self in (Standing.WARNING, Standing.OUTDATED)

    @property
    def excused(self) -> bool:
        """Whether it is a failure that stops no gate, for a reason that is given."""
        return self in (Standing.KNOWN, Standing.INHERENT)

    @property
    def judged(self) -> bool:
        """Whether it is a verdict on the renderer: the question arose, and its answer counts."""
        return self not in (Standing.NOT_JUDGED, Standing.NOT_APPLICABLE)


PLURALS: Mapping[Standing, str] = MappingProxyType(
    {
        Standing.ERROR: "in error",
        Standing.FAIL: "failed",
        Standing.DIFFERS: "differ from what is published",
        Standing.UNDECIDED: "undecided",
        Standing.WARNING: "warn",
        Standing.OUTDATED: "listed as known, and passed",
        Standing.KNOWN: "failed as known",
        Standing.INHERENT: "inherent",
        Standing.PASS: "passed",
        Standing.NOT_JUDGED: "shown and not judged",
        Standing.NOT_APPLICABLE: "not applicable",
    }
)

SYMBOLS: Mapping[Standing, str] = MappingProxyType(
    {
        Standing.ERROR: "!",
        Standing.FAIL: "✗",
        Standing.DIFFERS: "≠",
        Standing.UNDECIDED: "?",
        Standing.WARNING: "▲",
        Standing.OUTDATED: "△",
        Standing.KNOWN: "◇",
        Standing.INHERENT: "◆",
        Standing.PASS: "✓",
        Standing.NOT_JUDGED: "○",
        Standing.NOT_APPLICABLE: "–",  # noqa: RUF001 - a dash as wide as the other signs
    }
)

MEANINGS: Mapping[Standing, str] = MappingProxyType(
    {
        Standing.ERROR: "the renderer broke",
        Standing.FAIL: "fails, and nothing beforehand said so",
        Standing.DIFFERS: "another outcome than the published one",
        Standing.UNDECIDED: "a check that must decide could not",
        Standing.WARNING: "a check of level should fails or cannot decide: stops a gate with --strict only",
        Standing.OUTDATED: "on the list of known failures, and fails no more: stops a gate with --strict only",
        Standing.KNOWN: "fails as a list of known failures has it, with a reason",
        Standing.INHERENT: "fails by a theorem of the thesis, for what the renderer declares to be",
        Standing.PASS: "passes",
        Standing.NOT_JUDGED: "shown only: what a case or a check of level info finds is no verdict on the renderer",
        Standing.NOT_APPLICABLE: "not applicable: the question does not arise, or the renderer refuses the model",
    }
)


def count_standings(standings: Iterable[Standing]) -> list[tuple[Standing, int]]:
    """Return how many verdicts have each standing that there is: what calls for attention, what passed, the others."""
    counts = Counter(standings)
    order = sorted(Standing, key=lambda standing: (not standing.stops_strict, standing is not Standing.PASS))
    return [(standing, counts[standing]) for standing in order if counts[standing]]


def counts_in_words(standings: Iterable[Standing]) -> str:
    """Return how many verdicts have each standing, for instance `3 failed, 120 passed, 7 inherent`."""
    return ", ".join(f"{count:,} {standing.plural}" for standing, count in count_standings(standings)) or "no verdicts"
