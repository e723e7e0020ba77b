"""The checks tested: what is right passes them, and each broken renderer fails those that it must, and no other."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import lawbreakers
import mutants
import outsiders
import pytest
from lawbreakers import LAWBREAKERS
from mutants import BESIDES, MUTANTS
from outsiders import HONEST

from hapticeval.ideal import ideal
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Finding, Level, Outcome
from hapticeval.runner.judging import judge
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

PUBLISHED = Path(__file__).with_name("kill_matrix.md")

FAULTLESS = "faultless"
"""The law that the lawbreakers break."""

BROKEN = {name: check for name, (check, _) in (MUTANTS | LAWBREAKERS).items()}


@cache
def cases(suite: str) -> tuple[Case, ...]:
    """What is judged, without what others show too: the depth sweep and the shallow slide, and the robot's dynamics.

    The deep slide follows the same curve, and the robot behind its inner loop moves as the point mass does.
    """
    judged = [case for case in load_suite(suite).cases if case.judged and "device" not in case.scene]
    return tuple(case for case in judged if "-sweep-" not in case.name and case.name != "cassinian-shallow-slide")


OUTSIDERS = outsiders.BROKEN | HONEST


@cache
def outsider(name: str) -> dict[tuple[str, str], Finding]:
    each = OUTSIDERS[name]
    return {
        (case, verdict.check): verdict.finding
        for case in each.cases
        for verdict in judge(each.make, name, "outsiders", outsiders.CASES[case]).verdicts
    }


@cache
def findings(name: str) -> dict[tuple[str, str], Outcome]:
    if name in OUTSIDERS:
        return {place: finding.outcome for place, finding in outsider(name).items()}
    dynamic = name == FAULTLESS or name in LAWBREAKERS
    make = lawbreakers.factory(name) if dynamic else ideal if name == "ideal" else mutants.factory(name)
    # A closed form is about the law without a fault; a law with another fault than in its gains has none.
    known_as = "set-stabilisation" if name in (FAULTLESS, "hurries") else name
    found = {}
    suite = "dynamics-circle" if dynamic else "thesis"
    for case in cases(suite):
        judged = judge(make, known_as, suite, case)
        assert judged.error is None, f"{case.name}: {judged.error}"
        for verdict in judged.verdicts:
            found[case.name, verdict.check] = verdict.outcome
    return found


def failed(name: str) -> set[str]:
    return {check for (_, check), outcome in findings(name).items() if outcome is Outcome.FAIL}


@pytest.mark.parametrize("name", ["ideal", FAULTLESS])
def test_what_is_right_passes_every_check_that_applies(name):
    bad = {
        place: outcome
        for place, outcome in findings(name).items()
        if outcome not in (Outcome.PASS, Outcome.NOT_APPLICABLE)
    }
    assert bad == {}


def test_what_is_right_passes_each_check_somewhere():
    passed = {
        check
        for name in ("ideal", FAULTLESS, *HONEST)
        for (_, check), outcome in findings(name).items()
        if outcome is Outcome.PASS
    }
    assert passed == set(CHECKS)


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_fails_its_check_and_no_other(name):
    fails = {BROKEN[name], *BESIDES.get(name, {})}
    own = fails if name not in LAWBREAKERS else fails | {"closed-form"}
    assert failed(name) == fails
    right = findings(FAULTLESS if name in LAWBREAKERS else "ideal")
    others = {place: outcome for place, outcome in findings(name).items() if place[1] not in own}
    assert others == {place: right[place] for place in others}, "and leaves no other check undecided"


@pytest.mark.parametrize("name", HONEST)
def test_what_is_honest_is_not_blamed(name):
    blamed = {place for place, outcome in findings(name).items() if outcome in (Outcome.FAIL, Outcome.ERROR)}
    assert blamed == set()
    assert Outcome.PASS in findings(name).values()


@pytest.mark.parametrize("name", outsiders.BROKEN)
def test_what_an_outsider_breaks_is_found(name):
    broken = outsiders.BROKEN[name]
    if broken.breaks:
        assert all(broken.breaks in finding.message for finding in outsider(name).values())
        assert set(findings(name).values()) == {Outcome.ERROR}
        return
    assert failed(name) == set(broken.fails)
    assert any(CHECKS[check].level is not Level.INFO for check in failed(name)), "and does not pass"


def test_no_check_is_without_a_renderer_that_it_stops():
    assert set(BROKEN.values()) | {check for each in outsiders.BROKEN.values() for check in each.fails} == set(CHECKS)


def matrix() -> str:
    lines = [
        "# Kill matrix",
        "",
        "A cross marks a check that fails in at least one case. Written by `test_kill_matrix.py`, which compares it.",
        "",
        "- The ideal rigid contact, and its answer spoiled (`mutants.py`): in the cases of the thesis suite.",
        "- A faultless set stabilisation, and broken laws (`lawbreakers.py`): in those of "
        "`dynamics-circle` with a point mass.",
        "- A spring to the nearest point, in the ways in which honest renderers differ, and the broken ones that "
        "answer step by step (`outsiders.py`): on a short way round a circle, pressed on a line, and through a thin "
        "plate. An `e` marks one whose `run()` is not its `step()`: it breaks the contract, and is not judged.",
        "",
        "Why one fails a check besides the one that has to stop it is given beside it.",
        "",
        "| renderer | " + " | ".join(CHECKS) + " |",
        "|---|" + "---|" * len(CHECKS),
    ]
    for name in ("ideal", *MUTANTS, FAULTLESS, *LAWBREAKERS, *HONEST, *outsiders.BROKEN):
        cells = [MARKS.get(_worst(name, check), "") for check in CHECKS]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


MARKS = {Outcome.ERROR: "e", Outcome.FAIL: "x"}


def _worst(name: str, check: str) -> Outcome | None:
    found = {outcome for (_, of), outcome in findings(name).items() if of == check}
    return next((outcome for outcome in MARKS if outcome in found), None)


def test_the_published_matrix_is_the_measured_one():
    """To publish a new one: HAPTICEVAL_PUBLISH=1 pytest tests/meta."""
    measured = matrix()
    if os.environ.get("HAPTICEVAL_PUBLISH"):
        PUBLISHED.write_text(measured)
    assert PUBLISHED.read_text() == measured
