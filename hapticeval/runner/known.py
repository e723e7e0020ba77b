"""Known failures: a list that a project keeps, each with a reason, so that a gate stops at new ones only.

Verdicts are marked where `Progress` takes them: reports, summary, `diff` and the pytest plugin see the same.

[[known]]
renderer = "mine:Nearest"
outcome = "fail"                  # or "inconclusive"; fail if not given
reason = "the nearest point jumps across the medial axis, #41"
verdicts = [
  { verdict = "thesis/star-convex-corner/continuous-contact", metric = 0.0333, unit = "m", kind = "major" },
  "thesis/cassinian-deep-slide/memoryless",      # of any size
]
"""

from __future__ import annotations

import difflib
import math
import re
import textwrap
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta, Struct, to_builtins
from msgspec.structs import replace

from hapticeval.discovery import known_renderers, shipped_lists
from hapticeval.documents import convert, read_toml, toml_text
from hapticeval.errors import InputError, UnknownNameError, at
from hapticeval.files import write_text
from hapticeval.phenomena.verdict import UNSATISFIED, Facts, Outcome
from hapticeval.quantity import format_quantity, plural
from hapticeval.runner.results import ResultsDocument, VerdictEntry
from hapticeval.suite.outline import find_suites

if TYPE_CHECKING:
    from hapticeval.suite.suite import Suite

UNEXPLAINED = "not explained yet"
"""How a reason begins that was made up here, until somebody writes one."""

REASON_LENGTH = 100
"""Length to which a message is cut where it becomes a reason."""

TODO = 'write renderer, reason and verdicts = ["suite/case/check"] as docs/gate.md shows, or have --write-known do it'

REPEAT_SHARE = 1e-3
"""Share of a metric by which it may differ when it is measured again.

The list has four digits of it, which are 5e-4, and rounding may make as much between two machines. *Chosen*: doubled, a
failure may grow by 0.2 per cent unseen.
"""


class KnownVerdict(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """A verdict, as `suite/case/check`, with the failure that is known of it: its `metric` in `unit`, if it has one.

    `kind` is which of the faults that the check tells apart, and `region` where on the model: see `inherent.Region`.
    """

    verdict: str
    metric: float | None = None
    unit: str = ""
    kind: str = ""
    region: str = ""

    def __post_init__(self) -> None:
        if self.metric is not None and math.isnan(self.metric):
            raise ValueError(f"the metric of '{self.verdict}' is not a number")

    @classmethod
    def of(cls, verdict: VerdictEntry) -> KnownVerdict:
        """Return the failure that a verdict is. Kinds that a check measures by another metric go by that one's name."""
        from hapticeval.phenomena.registry import CHECKS  # which loads all that checks need

        metric = verdict.metric
        facts = Facts.of(verdict.evidence)
        kind, region = facts.fault, facts.region or ""
        if metric is None:
            return cls(verdict=verdict.place, kind=kind, region=region)
        # A check that measures some of its faults by another metric tells their kinds apart by its name.
        usual_metric = CHECKS[verdict.check].metric if verdict.check in CHECKS else metric.name
        # None stands for a number that was not finite. Four digits are what the list shows.
        value = math.inf if metric.value is None else float(f"{metric.value:.4g}")
        kind = kind or (metric.name if metric.name != usual_metric else "")
        return cls(verdict=verdict.place, metric=value, unit=metric.unit, kind=kind, region=region)

    def surpassed_by(self, other: KnownVerdict, bound: float) -> str:
        """Return in words how another failure of this verdict goes beyond this one; "" where it does not.

        Another kind, or another region of the model, is another failure. So is one that is larger by more than
        `bound` (in the metric's unit): the check grants that much to the sampling.
        """
        if (self.kind, self.unit) != (other.kind, other.unit):
            return f"another failure than the known one: '{other._sort}', and known is '{self._sort}'"
        if self.region != other.region:
            return f"at another place than the known one: '{other.region}', and known is '{self.region}'"
        if self.metric is None or other.metric is None:
            return ""
        # The same failure where m' <= m + r |m| + b: r for rounding, the check's bound b for the sampling.
        if other.metric <= self.metric + REPEAT_SHARE * abs(self.metric) + bound:
            return ""
        now = format_quantity(other.metric if math.isfinite(other.metric) else None, self.unit)
        return f"worse than known: {now}, and known is {format_quantity(self.metric, self.unit)}"

    @property
    def _sort(self) -> str:
        return self.kind or f"the usual{f', in {self.unit}' if self.unit else ''}"


class KnownEntry(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A `[[known]]` table: verdicts of one renderer that fail for one reason.

    A verdict without a size, as a mere `suite/case/check`, is excused whatever it measures: old lists have such.
    """

    renderer: str
    reason: str
    verdicts: Annotated[tuple[str | KnownVerdict, ...], Meta(min_length=1)]
    outcome: Literal["fail", "inconclusive"] = "fail"

    def __post_init__(self) -> None:
        if not self.reason.strip():
            raise ValueError(f"the reason why '{place_of(self.verdicts[0])}' is known to {self.outcome} is empty")

    def surpassed_by(self, verdict: VerdictEntry) -> str:
        """Return in words how a failure goes beyond what this entry, of one verdict, excuses; else ""."""
        listed = self.verdicts[0]
        if isinstance(listed, str) or verdict.outcome is not Outcome.FAIL:
            return ""
        return listed.surpassed_by(KnownVerdict.of(verdict), verdict.bound or 0.0)

    def renewed(self, verdict: VerdictEntry) -> KnownEntry:
        """Return the entry, of one verdict, with what that measures now, where it is less or had no size."""
        listed, current = self.verdicts[0], KnownVerdict.of(verdict)
        # Larger than listed, though within the bound: a size on the list never creeps upwards.
        grown = isinstance(listed, KnownVerdict) and (listed.metric or 0.0) < (current.metric or 0.0)
        if grown or verdict.outcome is not Outcome.FAIL:
            return self
        return replace(self, verdicts=(current,))


def place_of(listed: str | KnownVerdict) -> str:
    """Return what an entry lists, as `suite/case/check`."""
    return listed if isinstance(listed, str) else listed.verdict


class KnownFile(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A file of known failures as it is written."""

    known: tuple[KnownEntry, ...] = ()


Place = tuple[str, str]
"""A verdict's renderer, and its `suite/case/check`."""


@dataclass(frozen=True)
class Known:
    """Known failures by renderer and place, an entry of one verdict each; `source` is the file that lists them.

    `shipped` are those that packages list of their own renderers, see `with_shipped`; the file has the last word.
    """

    entries: Mapping[Place, KnownEntry] = field(default_factory=dict)
    source: str = ""
    shipped: Mapping[Place, KnownEntry] = field(default_factory=dict)

    def check(self, suites: Iterable[Suite]) -> None:
        """Raise `UnknownNameError` for an entry about one of these suites that has no such case or check.

        Such an entry excuses nothing and nobody would notice: its case was renamed, or its name is misspelt.
        """
        checks = {suite.name: {case.name: case.checks for case in suite.cases} for suite in suites}
        for _, place in self.entries:
            suite, case, check = place.split("/")
            with at(f"{self.source}: '{place}'"):
                # Nothing is known of a suite that is not among these, and any case will do.
                if case not in checks.get(suite, {case: ()}):
                    raise UnknownNameError(f"case of {suite}", case, checks[suite])
                if suite in checks and check not in checks[suite][case]:
                    raise UnknownNameError(f"check of {suite}/{case}", check, checks[suite][case])

    def remarks(self, renderers: Collection[str], suites: Collection[str]) -> tuple[str, ...]:
        """Return what there is to say of the list before these renderers run on these suites, a sentence each."""
        return self.unplanned(renderers, suites) + self.unsized() + self.unexplained()

    def unplanned(self, renderers: Collection[str], suites: Collection[str]) -> tuple[str, ...]:
        """Return a sentence for each renderer and suite on the list that does not run here, with what may be meant.

        That is not an error, since a list may hold more than runs now. A name that is installed is not misspelt, and is
        left out.
        """
        listed = (
            ("", renderers, known_renderers(), (name for name, _ in self.entries)),
            ("suite ", suites, find_suites(), (place.partition("/")[0] for _, place in self.entries)),
        )
        return tuple(
            f"{self.source} lists {kind}'{name}' ({plural(count, 'verdict')}), which does not run here"
            + "".join(f": did you mean {close}?" for close in difflib.get_close_matches(name, planned, n=1))
            for kind, planned, installed, names in listed
            for name, count in Counter(names).items()
            if name not in planned and name not in installed
        )

    def unsized(self) -> tuple[str, ...]:
        """Return a sentence on failures that are listed without what they measure, if there are such."""
        entries = self.entries.values()
        count = sum(entry.outcome == "fail" and isinstance(entry.verdicts[0], str) for entry in entries)
        if not count:
            return ()
        which = f"{plural(count, 'failure')} without a size, and so excuses them at any size"
        return (f"{self.source} lists {which}: `hapticeval run --write-known {self.source}` adds what is measured now",)

    def unexplained(self) -> tuple[str, ...]:
        """Return a sentence on reasons that nobody has given yet, if there are such: they excuse as any reason does."""
        count = sum(entry.reason.startswith(UNEXPLAINED) for entry in self.entries.values())
        if not count:
            return ()
        return (f"{self.source} lists {plural(count, 'verdict')} with a reason that is '{UNEXPLAINED}': write why",)

    def marked(self, verdict: VerdictEntry) -> VerdictEntry:
        """Return the verdict with the reason why it is known, if it is.

        A known failure is as expected. One that fails in another way than the known one, or worse, is judged as any
        other.
        """
        place = (verdict.renderer, verdict.place)
        entry = self.entries.get(place, self.shipped.get(place))
        if entry is None or verdict.outcome is Outcome.ERROR:
            return verdict
        # It passes now. Marked all the same, so that it can be told to come off the list.
        if verdict.outcome not in UNSATISFIED:
            return replace(verdict, known=entry.reason) if place in self.entries else verdict
        # Known to be inconclusive and fails now, or the other way round: judged as any other.
        if verdict.outcome.value != entry.outcome:
            return verdict
        excess = entry.surpassed_by(verdict)
        if excess:
            return replace(verdict, beyond_known=f"{excess} ({entry.reason})")
        return replace(verdict, known=entry.reason, as_expected=True, beyond_known=None)

    def renewed(self, results: ResultsDocument) -> Known:
        """Return the list as these results have it: what stops the gate is on it, and what passes now is not.

        - Reasons stay, and so does what has not run.
        - Sizes go down and never up: a failure beyond the listed one is new.
        - A reason that nobody has given begins with `UNEXPLAINED` and goes on with the message of its worst verdict.
        """
        verdict_by_place = {(verdict.renderer, verdict.place): verdict for verdict in results.verdicts}
        entries = {place: entry for place, entry in self.entries.items() if place not in verdict_by_place}
        new_failures: dict[tuple[str, str, Outcome], list[VerdictEntry]] = {}
        for place, verdict in verdict_by_place.items():
            if verdict.outcome not in UNSATISFIED:
                continue
            if verdict.known is not None:
                # Known already: the reason stays, and the size may only go down. What a package lists is not copied.
                if place in self.entries or place not in self.shipped:
                    listed = self.entries.get(place) or _entry(verdict, verdict.known)
                    entries[place] = listed.renewed(verdict)
            elif results.stops(verdict):
                new_failures.setdefault((verdict.renderer, verdict.check, verdict.outcome), []).append(verdict)
        # New failures of one renderer, check and outcome share a reason, that of the worst.
        for (renderer, _, _), verdicts in new_failures.items():
            worst = max(verdicts, key=lambda verdict: verdict.severity)
            reason = f"{UNEXPLAINED}: {_short(worst.message)} ({worst.suite}/{worst.case})"
            entries |= {(renderer, verdict.place): _entry(verdict, reason) for verdict in verdicts}
        return Known(entries, self.source, self.shipped)

    def with_shipped(self) -> Known:
        """Return the list with what installed packages list of their own renderers behind it."""
        return Known(self.entries, self.source, _shipped(tuple(shipped_lists())))


@lru_cache(maxsize=1)
def _shipped(files: tuple[Path, ...]) -> Mapping[Place, KnownEntry]:
    """Return the entries of all files; of two for one verdict the first."""
    entries: dict[Place, KnownEntry] = {}
    for file in files:
        entries = {**read_known(file).entries, **entries}
    return entries


NONE_KNOWN = Known()


def describe_outdated(verdict: VerdictEntry) -> tuple[str, str]:
    """Return in words that a verdict on the list fails no more, and what to do."""
    return (
        f"known, and {verdict.outcome} now: {verdict.renderer} on {verdict.place}",
        f"take it off the list: {verdict.known}",
    )


def _short(message: str) -> str:
    """Return the first statement of a message, cut to `REASON_LENGTH`."""
    return textwrap.shorten(re.split(r"; |\. |, and ", message)[0], REASON_LENGTH, placeholder=" ...")


def _entry(verdict: VerdictEntry, reason: str) -> KnownEntry:
    """Return the entry of a verdict; an undecided one has no size, since its metric decides nothing."""
    if verdict.outcome is Outcome.FAIL:
        return KnownEntry(renderer=verdict.renderer, reason=reason, verdicts=(KnownVerdict.of(verdict),))
    return KnownEntry(renderer=verdict.renderer, reason=reason, verdicts=(verdict.place,), outcome="inconclusive")


def read_known(file: Path) -> Known:
    """Read a list of known failures.

    Raises `InputError`, naming the entry, for a file that cannot be read or does not fit `KnownFile`, an empty reason,
    what is not a `suite/case/check`, and one that is listed twice.
    """
    if not file.exists():
        raise InputError(f"no list of known failures {file}", todo=f"make it of what fails now: --write-known {file}")
    known_file: KnownFile = convert(read_toml(file), KnownFile, file.name, todo=TODO)
    entries: dict[Place, KnownEntry] = {}
    with at(file.name):
        for entry in known_file.known:
            for listed in entry.verdicts:
                place = place_of(listed)
                if place.count("/") != 2 or not all(place.split("/")):
                    raise InputError(f"'{place}' names no verdict", why="one is named suite/case/check", todo=TODO)
                if (entry.renderer, place) in entries:
                    raise InputError(
                        f"'{place}' of {entry.renderer} is listed twice",
                        why=f"the reasons are '{entries[entry.renderer, place].reason}' and '{entry.reason}'",
                        todo="keep one of them",
                    )
                entries[entry.renderer, place] = replace(entry, verdicts=(listed,))
    return Known(entries, file.name)


def write_known(file: Path, known: Known) -> None:
    """Write a list of known failures, a table for each renderer, outcome and reason. Raises `HapticevalError`."""
    grouped: dict[tuple[str, str, str], list[str | KnownVerdict]] = {}
    for (renderer, _), entry in known.entries.items():
        grouped.setdefault((renderer, entry.outcome, entry.reason), []).extend(entry.verdicts)
    # Sorted, so that two versions of the file compare line by line.
    tables = [_table(*key, verdicts) for key, verdicts in sorted(grouped.items(), key=lambda group: group[0])]
    write_text(file, "\n".join([HEAD, *tables]))


HEAD = """\
# Known failures: they do not stop `hapticeval run --known` of this file. Give each a reason.
# `hapticeval run --write-known` of this file adds new ones, drops what passes now, and keeps your reasons.
# What fails in another way, elsewhere on the model, or worse by more than its check's bound is a new failure.
"""


def _table(renderer: str, outcome: str, reason: str, verdicts: Sequence[str | KnownVerdict]) -> str:
    texts = {"renderer": renderer, "outcome": outcome, "reason": reason}
    lines = [f"{name} = {toml_text(text)}" for name, text in texts.items()]
    listed = [f"  {toml_text(to_builtins(verdict))}," for verdict in sorted(verdicts, key=place_of)]
    return "\n".join(["[[known]]", *lines, "verdicts = [", *listed, "]", ""])
