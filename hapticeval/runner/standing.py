"""What a verdict amounts to, and the one set of words, signs and counts of it: terminal, reports, badge, pytest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from enum import StrEnum

from hapticeval.phenomena.verdict import UNSATISFIED, Level, Outcome


class Standing(StrEnum):
    """What a verdict means for the reader, the gravest first: its outcome compared with what was expected.

    - `symbol`: a shape of its own, so that no standing is told by its colour alone.
    - `plural`: the standing of several verdicts, in a sentence after their number.
    - `meaning`: what it says, for a legend.
    """

    symbol: str
    plural: str
    meaning: str

    def __new__(cls, value: str, symbol: str, plural: str, meaning: str) -> Standing:
        """Make a standing of its row below."""
        standing = str.__new__(cls, value)
        standing._value_ = value
        standing.symbol, standing.plural, standing.meaning = symbol, plural, meaning
        return standing

    ERROR = "error", "!", "in error", "the renderer broke"
    FAIL = "fail", "✗", "failed", "fails, and nothing beforehand said so"
    DIFFERS = "differs", "≠", "differ from what is published", "another outcome than the published one"
    UNDECIDED = "undecided", "?", "undecided", "a check that must decide could not"
    WARNING = (
        "warning", "▲", "warn",
        "a check of level should fails or cannot decide: stops a gate with --strict only",
    )  # fmt: skip
    OUTDATED = (
        "outdated", "△", "listed as known, and passed",
        "on the list of known failures, and fails no more: stops a gate with --strict only",
    )  # fmt: skip
    KNOWN = "known", "◇", "failed as known", "fails as a list of known failures has it, with a reason"
    INHERENT = "inherent", "◆", "inherent", "fails by a theorem of the thesis, for what the renderer declares to be"
    PASS = "pass", "✓", "passed", "passes"
    NOT_JUDGED = (
        "not-judged", "○", "shown and not judged",
        "shown only: what a case or a check of level info finds is not a verdict on the renderer",
    )  # fmt: skip
    NOT_APPLICABLE = (
        "not-applicable", "–", "not applicable",  # noqa: RUF001 - a dash as wide as the other signs
        "not applicable: the question does not arise, or the renderer refuses the model",
    )  # fmt: skip

    @property
    def words(self) -> str:
        """The standing of one verdict as a reader sees it."""
        return {Standing.NOT_JUDGED: "not judged", Standing.NOT_APPLICABLE: "n/a"}.get(self, str(self))

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


def standing_of(
    outcome: Outcome, *, level: Level, published: Outcome | None, as_expected: bool, known: bool, inherent: bool
) -> Standing:
    """Return what a verdict amounts to: the first line that holds decides.

    `known`: it is on a list of known failures, which comes before all else. `as_expected`: see `Verdict.as_expected`.
    """
    unsatisfied = outcome in UNSATISFIED
    if known:
        return Standing.KNOWN if unsatisfied else Standing.OUTDATED
    if outcome is Outcome.ERROR:
        return Standing.ERROR
    if published is not None and outcome is not published:
        return Standing.DIFFERS
    if outcome is Outcome.NOT_APPLICABLE:
        return Standing.NOT_APPLICABLE
    if not as_expected:
        return Standing.FAIL if outcome is Outcome.FAIL else Standing.UNDECIDED
    if level is Level.INFO:
        return Standing.NOT_JUDGED
    if inherent:
        return Standing.INHERENT
    return Standing.WARNING if unsatisfied else Standing.PASS


def count_standings(standings: Iterable[Standing]) -> list[tuple[Standing, int]]:
    """Return how many verdicts have each standing that there is: what calls for attention, what passed, the others."""
    counts = Counter(standings)
    order = sorted(Standing, key=lambda standing: (not standing.stops_strict, standing is not Standing.PASS))
    return [(standing, counts[standing]) for standing in order if counts[standing]]


def counts_in_words(standings: Iterable[Standing]) -> str:
    """Return how many verdicts have each standing, for instance `3 failed, 120 passed, 7 inherent`."""
    return ", ".join(f"{count:,} {standing.plural}" for standing, count in count_standings(standings)) or "no verdicts"
