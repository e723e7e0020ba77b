"""What checks say of a renderer in a case: one of `outsiders.CASES` or of a suite ("suite/case") by name, or any."""

from __future__ import annotations

from functools import cache
from typing import Any

from msgspec.structs import replace
from outsiders import CASES

from hapticeval.phenomena.verdict import Finding, Verdict
from hapticeval.runner.judging import judge
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
