"""Which cases and checks of suites run: expressions over their names, and the fewest cases that have every check."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple, TypeAlias

from msgspec.structs import replace

from hapticeval.errors import InputError, NothingSelectedError
from hapticeval.suite.case import Case
from hapticeval.suite.suite import Suite


class Place(NamedTuple):
    """A check of a case of a suite."""

    suite: str
    case: str
    check: str

    def matches(self, glob: str) -> bool:
        """Whether case or check match; where the glob has a slash: suite/case, case/check or suite/case/check."""
        suite, case, check = self
        names = (f"{suite}/{case}", f"{case}/{check}", "/".join(self)) if "/" in glob else (case, check)
        return any(fnmatchcase(name, glob) for name in names)


Places: TypeAlias = frozenset[Place]
Selected: TypeAlias = Sequence[tuple[Suite, Case]]
"""Cases with only the checks that are to run, in the order of their suites."""


def select(suites: Iterable[Suite], expressions: Sequence[str]) -> Selected:
    """Return what any of the expressions selects, or everything where there are none.

    An expression has globs, `and`, `or`, `not` and parentheses. A glob is matched as `Place.matches` does; a word
    without `*`, `?` and `[` that names nothing is taken for `*word*`. Raises `InputError` for an expression that is
    none, and `NothingSelectedError` for a glob that matches nothing, with what may be meant, and where nothing is left.
    """
    cases = [(suite, case) for suite in suites for case in suite.cases]
    everything = frozenset(Place(suite.name, case.name, check) for suite, case in cases for check in case.checks)
    wanted = everything if not expressions else frozenset[Place]()
    for expression in expressions:
        found = _Expression(expression, everything).places()
        if not found:
            raise NothingSelectedError(
                f"nothing is left by -k {expression!r}", why="its parts match something, and never the same verdict"
            )
        wanted |= found
    kept = (
        (suite, case, tuple(each for each in case.checks if (suite.name, case.name, each) in wanted))
        for suite, case in cases
    )
    return [(suite, replace(case, checks=checks)) for suite, case, checks in kept if checks]


def covering(selected: Selected) -> Selected:
    """Return few cases that have every check of the `selected` ones that are judged, in their order.

    Time after time the case is taken that has the most checks that no other has had; of several the first.
    """
    judged = [each for each in selected if each[1].judged] or list(selected)
    left = {check for _, case in judged for check in case.checks}
    taken: list[tuple[Suite, Case]] = []
    while left:
        best = max(judged, key=lambda each: len(left.intersection(each[1].checks)))
        taken.append(best)
        left -= set(best[1].checks)
    return [each for each in judged if any(each is other for other in taken)]


class _Expression:
    """A recursive descent over the tokens of an expression; what each part selects is a set of places."""

    def __init__(self, text: str, everything: Places) -> None:
        self._text = text
        self._everything = everything
        self._tokens = re.findall(r"[()]|[^\s()]+", text)

    def places(self) -> Places:
        found = self._either()
        if self._tokens:
            raise self._misread(f"'{self._tokens[0]}' follows without 'and' or 'or'")
        return found

    def _either(self) -> Places:
        return self._joined("or", lambda: self._joined("and", self._one, Places.__and__), Places.__or__)

    def _joined(self, word: str, part: Callable[[], Places], join: Callable[[Places, Places], Places]) -> Places:
        found = part()
        while self._tokens[:1] == [word]:
            del self._tokens[0]
            found = join(found, part())
        return found

    def _one(self) -> Places:
        token = self._tokens.pop(0) if self._tokens else ""
        if token == "not":
            return self._everything - self._one()
        if token == "(":
            found = self._either()
            if self._tokens[:1] != [")"]:
                raise self._misread("a parenthesis is never closed")
            del self._tokens[0]
            return found
        if token in ("", ")", "and", "or"):
            raise self._misread(f"a name is missing before '{token}'" if token else "it ends where a name is missing")
        return self._matched(token)

    def _matched(self, glob: str) -> Places:
        globs = [glob] if "/" in glob or re.search(r"[*?\[]", glob) else [glob, f"*{glob}*"]
        for each in globs:
            found = frozenset(place for place in self._everything if place.matches(each))
            if found:
                return found
        raise self._unmatched(glob)

    def _misread(self, why: str) -> InputError:
        return InputError(
            f"-k {self._text!r} is no expression", why=why, todo="write for instance -k 'star-* and not memoryless'"
        )

    def _unmatched(self, glob: str) -> NothingSelectedError:
        """Return the error for a name that nothing has: with the case's checks where it is a check's."""
        within = f" of -k {self._text!r}" * (self._text.strip() != glob)
        what = f"nothing matches {glob!r}{within}" if within else f"nothing matches -k {glob!r}"
        before, _, last = glob.rpartition("/")
        checks = {check for suite, case, check in self._everything if before and before in (case, f"{suite}/{case}")}
        if checks:
            close = difflib.get_close_matches(last, sorted(checks), n=1, cutoff=0.5)
            todo = f"did you mean {before}/{close[0]}?" if close else "`hapticeval list checks` explains each"
            return NothingSelectedError(what, why=f"the checks of {before} are: {', '.join(sorted(checks))}", todo=todo)
        cases = {place.case for place in self._everything}
        bare = re.sub(r"[*?\[\]]", "", before.rpartition("/")[2] or last)
        known = sorted(cases | {place.check for place in self._everything})
        close = difflib.get_close_matches(bare, known, n=3, cutoff=0.5)
        hint = "a glob is matched against the whole name: try -k '*slide*' or -k '*/memoryless'"
        return NothingSelectedError(
            what,
            why=f"the cases are: {', '.join(sorted(cases))}",
            todo=f"did you mean {' or '.join(close)}?" if close else hint,
        )
