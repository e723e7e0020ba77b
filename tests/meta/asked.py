"""What checks say of a renderer in a case: one of `outsiders.CASES` or of a suite ("suite/case") by name, or any."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

import pytest
from made import FAIL, NO, PASS, UNDECIDED
from msgspec.structs import replace
from outsiders import CASES

from hapticeval.phenomena.verdict import Finding, Verdict
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

read_suite = cache(load_suite)


def case_at(place: str | Case) -> Case:
    if isinstance(place, Case):
        return place
    suite, _, name = place.rpartition("/")
    return read_suite(suite).case(name) if suite else CASES[name]


def verdicts(make: Any, place: str | Case, *checks: str) -> dict[str, Verdict]:
    """Judge a renderer in a case by some checks, or by all that the case asks: verdict by check."""
    case = case_at(place)
    judged = judge(make, "asked", "any", replace(case, checks=checks or case.checks))
    assert judged.error is None, judged.error
    assert judged.refusal is None, judged.refusal
    return {verdict.check: verdict for verdict in judged.verdicts}


def finding(make: Any, place: str | Case, check: str) -> Finding:
    return verdicts(make, place, check)[check].finding


class Row(NamedTuple):
    """A renderer in a case: the checks that it fails or that leave it undecided there, and those that it passes.

    - `fails`, `passes` and `undecided` name checks, with blanks between. Where none is named, all of the case are
      asked, and none blames it; where it passes "the rest", it fails those that are named alone.
    - `words`: a pattern that is in the message of each that it fails, or else that is undecided, or that it passes.
    - `metric`, `evidence`: what each of these measures, to a hundredth or by `approx`, and some of the evidence.
    - `times`: so many times its bound each that it fails measures at the least.
    - `level`: of each that it fails: "must", "should", "inherent" where a theorem excuses it.
    - `name`: of the renderer, where its factory has none.
    """

    make: Callable[[Scene], Any]
    place: str | Case
    fails: str = ""
    passes: str = ""
    undecided: str = ""
    words: str = ""
    metric: Any = None
    evidence: Mapping[str, Any] = {}
    times: float = 0.0
    level: str = "must"
    name: str = ""

    def __str__(self) -> str:
        make = self.name or getattr(self.make, "__name__", type(self.make).__name__)
        place = self.place if isinstance(self.place, str) else self.place.name
        return f"{make}-{place}-{(self.fails or self.passes or self.undecided or 'all').replace(' ', '+')}"


def rows(makes: Any, places: Any, *verdicts: Any, **more: Any) -> list[Row]:
    """Return a row of each renderer, of a list or by its name, in each of some places."""
    named = makes.items() if isinstance(makes, Mapping) else [("", make) for make in makes]
    return [Row(make, place, *verdicts, **more, name=name) for name, make in named for place in places]


def hold(row: Row) -> None:
    """Assert that a renderer gets the verdicts of its row."""
    fails, undecided = row.fails.split(), row.undecided.split()
    passes = row.passes.removesuffix("the rest").split()
    all_others = row.passes.endswith("the rest") or not fails + passes + undecided
    judged = verdicts(row.make, row.place, *([] if all_others else fails + passes + undecided))
    if all_others:
        asked = [check for check, verdict in judged.items() if verdict.outcome is not NO and not verdict.inherent]
        passes += [check for check in asked if check not in fails + undecided]
    expected = dict.fromkeys(fails, FAIL) | dict.fromkeys(passes, PASS) | dict.fromkeys(undecided, UNDECIDED)
    messages = {check: verdict.finding.message for check, verdict in judged.items()}
    assert {check: judged[check].outcome for check in expected} == expected, messages
    for check in fails or undecided or passes:
        found = judged[check].finding
        assert re.search(row.words, messages[check]), messages[check]
        metric = pytest.approx(row.metric, rel=0.01) if isinstance(row.metric, float) else row.metric
        assert row.metric is None or found.metric.value == metric, messages[check]
        assert {name: found.evidence.get(name) for name in row.evidence} == row.evidence
    for check in fails:
        found = judged[check]
        assert row.times == 0.0 or found.finding.metric.value >= row.times * found.finding.bound, messages[check]
        assert row.level == ("inherent" if found.inherent else found.level), messages[check]
