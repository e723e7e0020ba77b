"""Which cases and checks of suites run: expressions over their names, and few cases that have every check."""

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
        """Whether a glob matches case or check; one with a slash suite/case, case/check or suite/case/check."""
        suite, case, check = self
        # Without a slash a glob is for case or check alone.
        names = (f"{suite}/{case}", f"{case}/{check}", "/".join(self)) if "/" in glob else (case, check)
        return any(fnmatchcase(name, glob) for name in names)


Places: TypeAlias = frozenset[Place]
Selected: TypeAlias = Sequence[tuple[Suite, Case]]
"""Cases with only the checks that are to run, in the order of their suites."""


def select(suites: Iterable[Suite], expressions: Sequence[str]) -> Selected:
    """Return what any of the expressions selects, or everything where there are none.

    An expression has globs, `and`, `or`, `not` and parentheses. A glob is matched as `Place.matches` does; a word
    without `*`, `?` and `[` that names nothing is taken for `*word*`.

    Raises `InputError` for what is not an expression, and `NothingSelectedError` for a glob that matches nothing, with
    what may be meant, and where nothing is left.
    """
    cases = [(suite, case) for suite in suites for case in suite.cases]
    everything = frozenset(Place(suite.name, case.name, check) for suite, case in cases for check in case.checks)
    selected_places = everything if not expressions else frozenset[Place]()
    for expression in expressions:
        places = _Expression(expression, everything).places()
        if not places:
            raise NothingSelectedError(
                f"nothing is left by -k {expression!r}", why="its parts match something, and never the same verdict"
            )
        selected_places |= places
    cases_with_checks = (
        (suite, case, tuple(check for check in case.checks if (suite.name, case.name, check) in selected_places))
        for suite, case in cases
    )
    return [(suite, replace(case, checks=checks)) for suite, case, checks in cases_with_checks if checks]


def covering(selected: Selected) -> Selected:
    """Return few of the `selected` cases that have, between them, every check of the judged ones; in their order.

    Greedy: the next case is the one with the most checks that no earlier one has; of several the first.
    """
    # Unjudged cases only show something: they count where there are no others.
    judged = [suite_and_case for suite_and_case in selected if suite_and_case[1].judged] or list(selected)
    missing_checks = {check for _, case in judged for check in case.checks}
    covering_cases: list[tuple[Suite, Case]] = []
    while missing_checks:
        # max takes the first of equals
        best_case = max(judged, key=lambda suite_and_case: len(missing_checks.intersection(suite_and_case[1].checks)))
        covering_cases.append(best_case)
        missing_checks -= set(best_case[1].checks)
    # By identity, for cases cannot be hashed.
    return [suite_and_case for suite_and_case in judged if any(suite_and_case is other for other in covering_cases)]


class _Expression:
    """Parses an expression by recursive descent; what each part selects is a set of places."""

    def __init__(self, text: str, everything: Places) -> None:
        self._text = text
        self._everything = everything
        self._tokens = re.findall(r"[()]|[^\s()]+", text)

    def places(self) -> Places:
        """Return the places that the expression selects. Raises `InputError` and `NothingSelectedError`."""
        places = self._parse_alternatives()
        if self._tokens:
            raise self._syntax_error(f"'{self._tokens[0]}' follows without 'and' or 'or'")
        return places

    def _parse_alternatives(self) -> Places:
        """Parse operands that `and` and `or` join, up to the end or a parenthesis; return what they select."""
        # `or` binds less than `and`, and `and` less than `not`.
        return self._parse_sequence(
            "or", lambda: self._parse_sequence("and", self._parse_operand, Places.__and__), Places.__or__
        )

    def _parse_sequence(
        self, word: str, part: Callable[[], Places], join: Callable[[Places, Places], Places]
    ) -> Places:
        """Parse one `part` or several with a `word` between them, and return what they select, joined."""
        places = part()
        while self._tokens[:1] == [word]:
            del self._tokens[0]
            places = join(places, part())
        return places

    def _parse_operand(self) -> Places:
        """Parse a glob, a parenthesis, or `not` before one of these; return what it selects."""
        token = self._tokens.pop(0) if self._tokens else ""
        if token == "not":
            return self._everything - self._parse_operand()
        if token == "(":
            places = self._parse_alternatives()
            if self._tokens[:1] != [")"]:
                raise self._syntax_error("a parenthesis is never closed")
            del self._tokens[0]
            return places
        if token in ("", ")", "and", "or"):
            raise self._syntax_error(
                f"a name is missing before '{token}'" if token else "it ends where a name is missing"
            )
        return self._places_matching(token)

    def _places_matching(self, glob: str) -> Places:
        """Return the places that a glob matches. Raises `NothingSelectedError` where there are none."""
        # The name itself first: a word that is a case's name does not mean those that contain it.
        globs = [glob] if "/" in glob or re.search(r"[*?\[]", glob) else [glob, f"*{glob}*"]
        for pattern in globs:
            places = frozenset(place for place in self._everything if place.matches(pattern))
            if places:
                return places
        raise self._no_match_error(glob)

    def _syntax_error(self, why: str) -> InputError:
        called = self._checks_called()
        todo = f"did you mean {' or '.join(called)}?" if called else "write for instance -k 'star-* and not memoryless'"
        return InputError(f"-k {self._text!r} is not an expression", why=why, todo=todo)

    def _checks_called(self, word: str = "") -> list[str]:
        """Return the checks that are called as the text, which may be words of the field, or else as a word of it."""
        from hapticeval.phenomena.registry import checks_called

        known = {place.check for place in self._everything}
        return [name for name in checks_called(self._text) or checks_called(word) if name in known]

    def _no_match_error(self, glob: str) -> NothingSelectedError:
        """Return the error for a glob that matches nothing: after a case's name it lists the checks of that case."""
        within = f" of -k {self._text!r}" if self._text.strip() != glob else ""
        what = f"nothing matches {glob!r}{within}" if within else f"nothing matches -k {glob!r}"
        before, _, last = glob.rpartition("/")
        checks = {check for suite, case, check in self._everything if before and before in (case, f"{suite}/{case}")}
        if checks:
            close = difflib.get_close_matches(last, sorted(checks), n=1, cutoff=0.5)
            todo = f"did you mean {before}/{close[0]}?" if close else "`hapticeval list checks` explains each"
            return NothingSelectedError(what, why=f"the checks of {before} are: {', '.join(sorted(checks))}", todo=todo)
        cases = {place.case for place in self._everything}
        # Suggestions compare with what is left of the glob as a name.
        bare = re.sub(r"[*?\[\]]", "", before.rpartition("/")[2] or last)
        known = sorted(cases | {place.check for place in self._everything})
        # A part of a name, if not a short one; else a word of the field, as `pop-through`; else what is spelt alike.
        within_names = [name for name in known if len(bare) > 3 and bare in name][:3]
        close = within_names or self._checks_called(bare) or difflib.get_close_matches(bare, known, n=3, cutoff=0.5)
        hint = "a glob is matched against the whole name: try -k '*slide*' or -k '*/memoryless'"
        return NothingSelectedError(
            what,
            why=f"the cases are: {', '.join(sorted(cases))}",
            todo=f"did you mean {' or '.join(close)}?" if close else hint,
        )
