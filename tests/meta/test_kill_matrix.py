"""The checks tested: the ideal contact passes all of them, and each broken renderer fails its own and no other."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import pytest
from mutants import MUTANTS, factory

from hapticeval.ideal import ideal
from hapticeval.judging import judge
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.suite import load_suite

PUBLISHED = Path(__file__).with_name("kill_matrix.md")


@cache
def findings(name: str) -> dict[tuple[str, str], Outcome]:
    made = ideal if name == "ideal" else factory(name)
    found = {}
    for case in load_suite("thesis").cases:
        if not case.judged:
            continue
        judged = judge(made, name, "thesis", case)
        assert judged.error is None, f"{case.name}: {judged.error}"
        for verdict in judged.verdicts:
            found[case.name, verdict.check] = verdict.outcome
    return found


def failed(name: str) -> set[str]:
    return {check for (_, check), outcome in findings(name).items() if outcome is Outcome.FAIL}


def test_the_ideal_contact_passes_every_check_that_applies():
    bad = {
        place: outcome
        for place, outcome in findings("ideal").items()
        if outcome not in (Outcome.PASS, Outcome.NOT_APPLICABLE)
    }
    assert bad == {}


def test_the_ideal_contact_passes_each_check_somewhere():
    passed = {check for (_, check), outcome in findings("ideal").items() if outcome is Outcome.PASS}
    assert passed == set(CHECKS)


@pytest.mark.parametrize("name", MUTANTS)
def test_a_mutant_fails_its_check_and_no_other(name):
    assert failed(name) == {MUTANTS[name][0]}
    others = {place: outcome for place, outcome in findings(name).items() if place[1] != MUTANTS[name][0]}
    assert others == {place: findings("ideal")[place] for place in others}, "and leaves no other check undecided"


def test_no_check_is_without_a_mutant():
    assert {check for check, _ in MUTANTS.values()} == set(CHECKS)


def matrix() -> str:
    lines = [
        "# Kill matrix",
        "",
        "Rows are the ideal rigid contact and the deliberately broken renderers of `mutants.py`; a cross marks a check "
        "that fails in at least one case of the thesis suite. Written by `test_kill_matrix.py`, which compares it.",
        "",
        "| renderer | " + " | ".join(CHECKS) + " |",
        "|---|" + "---|" * len(CHECKS),
    ]
    for name in ("ideal", *MUTANTS):
        cells = ["x" if check in failed(name) else "" for check in CHECKS]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def test_the_published_matrix_is_the_measured_one():
    """To publish a new one: HAPTICEVAL_PUBLISH=1 pytest tests/meta."""
    measured = matrix()
    if os.environ.get("HAPTICEVAL_PUBLISH"):
        PUBLISHED.write_text(measured)
    assert PUBLISHED.read_text() == measured
