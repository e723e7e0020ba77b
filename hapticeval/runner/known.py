"""Known failures: a list that a project keeps, each with a reason, so that a gate stops at new ones only.

[[known]]
renderer = "mine:Nearest"
outcome = "fail"                  # or "inconclusive"; fail if not given
reason = "the nearest point jumps across the medial axis, #41"
verdicts = ["thesis/star-convex-corner/continuous-contact", "thesis/cassinian-deep-slide/memoryless"]
"""

from __future__ import annotations

import difflib
import json
import re
import textwrap
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta, Struct
from msgspec.structs import replace

from hapticeval.discovery import known_renderers
from hapticeval.documents import convert, read_toml
from hapticeval.errors import HapticevalError, InputError, UnknownNameError, at
from hapticeval.files import replacing
from hapticeval.phenomena.verdict import UNSATISFIED, Outcome
from hapticeval.runner.results import ResultsDocument, VerdictEntry
from hapticeval.suite.installed import find_suites

if TYPE_CHECKING:
    from hapticeval.suite.suite import Suite

UNEXPLAINED = "not explained yet"
"""How the reason of an entry begins that nobody has written a reason for."""

REASON = 100
"""Characters of a message that a reason begins with."""

TODO = 'write renderer, reason and verdicts = ["suite/case/check"] as docs/gate.md shows, or have --write-known do it'


class KnownEntry(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A `[[known]]` table: verdicts, as `suite/case/check`, of one renderer that fail for one reason."""

    renderer: str
    reason: str
    verdicts: Annotated[tuple[str, ...], Meta(min_length=1)]
    outcome: Literal["fail", "inconclusive"] = "fail"

    def __post_init__(self) -> None:
        if not self.reason.strip():
            raise ValueError(f"the reason why '{self.verdicts[0]}' is known to {self.outcome} is empty")


class KnownFile(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A file of known failures as it is written."""

    known: tuple[KnownEntry, ...] = ()


Place = tuple[str, str]
"""Renderer and `suite/case/check`."""


@dataclass(frozen=True)
class Known:
    """Known failures by renderer and place; `source` is the file that lists them."""

    entries: Mapping[Place, KnownEntry] = field(default_factory=dict)
    source: str = ""

    def check(self, suites: Iterable[Suite]) -> None:
        """Raise `UnknownNameError` for an entry about one of these suites that has no such case or check.

        Such an entry would never be missed: its case has been renamed, or its name is misspelt.
        """
        checks = {suite.name: {case.name: case.checks for case in suite.cases} for suite in suites}
        for _, place in self.entries:
            suite, case, check = place.split("/")
            with at(f"{self.source}: '{place}'"):
                if case not in checks.get(suite, {case: ()}):
                    raise UnknownNameError(f"case of {suite}", case, checks[suite])
                if suite in checks and check not in checks[suite][case]:
                    raise UnknownNameError(f"check of {suite}/{case}", check, checks[suite][case])

    def unplanned(self, renderers: Collection[str], suites: Collection[str]) -> tuple[str, ...]:
        """Return a sentence for each renderer and suite on the list that is none of these, with what may be meant.

        A list may hold more than runs now, so that this is no error. What is installed is not misspelt.
        """
        listed = (
            ("", renderers, known_renderers(), (name for name, _ in self.entries)),
            ("suite ", suites, find_suites(), (place.partition("/")[0] for _, place in self.entries)),
        )
        return tuple(
            f"{self.source} lists {kind}'{name}' ({count} verdict{'s' * (count > 1)}), which does not run here"
            + "".join(f": did you mean {close}?" for close in difflib.get_close_matches(name, planned, n=1))
            for kind, planned, installed, names in listed
            for name, count in Counter(names).items()
            if name not in planned and name not in installed
        )

    def marked(self, verdict: VerdictEntry) -> VerdictEntry:
        """Return the verdict with the reason why it is known, if it is.

        A known failure is as expected. One that fails in another way than the known one is judged as any other.
        """
        entry = self.entries.get((verdict.renderer, verdict.place))
        if entry is None or verdict.outcome is Outcome.ERROR:
            return verdict
        if verdict.outcome not in UNSATISFIED:
            return replace(verdict, known=entry.reason)
        if verdict.outcome.value != entry.outcome:
            return verdict
        return replace(verdict, known=entry.reason, as_expected=True)

    def renewed(self, results: ResultsDocument) -> Known:
        """Return the list as these results have it: what stops the gate is on it, and what passes now is not.

        Reasons that were given stay, and so does what has not run. A reason that nobody has given begins with
        `UNEXPLAINED` and goes on with what was measured at the worst of its verdicts.
        """
        ran = {(verdict.renderer, verdict.place): verdict for verdict in results.verdicts}
        kept = {place: entry for place, entry in self.entries.items() if place not in ran}
        fresh: dict[tuple[str, str, Outcome], list[VerdictEntry]] = {}
        for place, verdict in ran.items():
            if verdict.outcome not in UNSATISFIED:
                continue
            if verdict.known is not None:
                kept[place] = KnownEntry(
                    renderer=verdict.renderer, reason=verdict.known, verdicts=(place[1],), outcome=_word(verdict)
                )
            elif results.stops(verdict):
                fresh.setdefault((verdict.renderer, verdict.check, verdict.outcome), []).append(verdict)
        for (renderer, _, _), verdicts in fresh.items():
            worst = max(verdicts, key=lambda each: each.severity)
            entry = KnownEntry(
                renderer=renderer,
                reason=f"{UNEXPLAINED}: {_short(worst.message)} ({worst.suite}/{worst.case})",
                verdicts=tuple(each.place for each in verdicts),
                outcome=_word(worst),
            )
            kept |= {(renderer, place): entry for place in entry.verdicts}
        return Known(kept, self.source)


NONE_KNOWN = Known()


def outdated(verdict: VerdictEntry) -> tuple[str, str]:
    """Return in words that a verdict on the list fails no more, and what to do."""
    return (
        f"known, and {verdict.outcome} now: {verdict.renderer} on {verdict.place}",
        f"take it off the list: {verdict.known}",
    )


def _short(message: str) -> str:
    """Return what a message says first."""
    return textwrap.shorten(re.split(r"; |\. |, and ", message)[0], REASON, placeholder=" ...")


def _word(verdict: VerdictEntry) -> Literal["fail", "inconclusive"]:
    return "fail" if verdict.outcome is Outcome.FAIL else "inconclusive"


def read_known(file: Path) -> Known:
    """Read a list of known failures.

    Raises `InputError`, naming the entry, for a file that cannot be read or does not fit `KnownFile`, an empty reason,
    what is no `suite/case/check`, and one that is listed twice.
    """
    if not file.exists():
        raise InputError(f"no list of known failures {file}", todo=f"make it of what fails now: --write-known {file}")
    given: KnownFile = convert(read_toml(file), KnownFile, file.name, todo=TODO)
    entries: dict[Place, KnownEntry] = {}
    with at(file.name):
        for entry in given.known:
            for place in entry.verdicts:
                if place.count("/") != 2 or not all(place.split("/")):
                    raise InputError(f"'{place}' names no verdict", why="one is named suite/case/check", todo=TODO)
                if (entry.renderer, place) in entries:
                    raise InputError(
                        f"'{place}' of {entry.renderer} is listed twice",
                        why=f"the reasons are '{entries[entry.renderer, place].reason}' and '{entry.reason}'",
                        todo="keep one of them",
                    )
                entries[entry.renderer, place] = entry
    return Known(entries, file.name)


def write_known(file: Path, known: Known) -> None:
    """Write a list of known failures, a table for each renderer, outcome and reason. Raises `HapticevalError`."""
    grouped: dict[tuple[str, str, str], list[str]] = {}
    for (renderer, place), entry in known.entries.items():
        grouped.setdefault((renderer, entry.outcome, entry.reason), []).append(place)
    tables = [_table(*key, places) for key, places in sorted(grouped.items())]
    try:
        with replacing(file) as temporary:
            temporary.write_text("\n".join([HEAD, *tables]), encoding="utf-8")
    except OSError as error:
        raise HapticevalError(f"cannot write {file}", why=error.strerror or str(error)) from error


HEAD = """\
# Known failures: they do not stop `hapticeval run --known` of this file. Give each a reason.
# `hapticeval run --write-known` of this file adds new ones, drops what passes now, and keeps your reasons.
"""


def _table(renderer: str, outcome: str, reason: str, places: Sequence[str]) -> str:
    texts = {"renderer": renderer, "outcome": outcome, "reason": reason}
    lines = [f"{name} = {_quoted(text)}" for name, text in texts.items()]
    listed = [f"  {_quoted(place)}," for place in sorted(places)]
    return "\n".join(["[[known]]", *lines, "verdicts = [", *listed, "]", ""])


def _quoted(text: str) -> str:
    """Return a basic string of TOML: those of JSON, but that the delete character is escaped as well."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
