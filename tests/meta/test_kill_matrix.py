"""The checks tested: what is right passes them, and each broken renderer fails those that it must, and no other."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import felt
import field_bugs
import lawbreakers
import measured
import mutants
import numpy as np
import outsiders
import pytest
import rubbing
import struck_and_shaded
import textured
from lawbreakers import LAWBREAKERS
from mutants import BESIDES, MUTANTS
from publishing import concerned, only_check, publishing

from hapticeval.files import replacing
from hapticeval.phenomena.pages import read_page
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.phenomena.verdict import Finding, Level, Outcome, kind_of_fault
from hapticeval.rigid_contact import ideal
from hapticeval.runner.judging import judge
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

pytestmark = pytest.mark.system

PUBLISHED = Path(__file__).with_name("kill_matrix.md")

FAULTLESS = "faultless"
"""The law that the lawbreakers break."""

DYNAMIC = (FAULTLESS, *LAWBREAKERS)
BROKEN = {name: check for name, (check, _) in (MUTANTS | LAWBREAKERS).items()}
GROUPS = (outsiders, felt, rubbing, struck_and_shaded, textured, field_bugs)
FAULTY = {name: each for group in GROUPS for name, each in group.BROKEN.items()}
HONEST = {name: each for group in GROUPS for name, each in group.HONEST.items()}
OUTSIDERS = FAULTY | HONEST
CASES = {name: group.CASES for group in GROUPS for name in (*group.BROKEN, *group.HONEST)}
"""The cases of a renderer's own group: one name may be a case in several."""

JUDGED = ("ideal", *MUTANTS, *DYNAMIC, *HONEST, *FAULTY)
"""Every renderer of this folder, in the order of the matrix."""


@cache
def cases(suite: str) -> tuple[Case, ...]:
    """What is judged, without what others show too: the depth sweep and the shallow slide, and the robot's dynamics.

    The deep slide follows the same curve, and the robot behind its inner loop moves as the point mass does.
    """
    judged = [case for case in load_suite(suite).cases if case.judged and "device" not in case.scene]
    return tuple(case for case in judged if "-sweep-" not in case.name and case.name != "cassinian-shallow-slide")


@cache
def findings(name: str) -> dict[tuple[str, str], Finding]:
    """Judge a renderer of this folder once, in all cases that are meant for it: finding by case and check."""
    if name in OUTSIDERS:
        make, suite = OUTSIDERS[name].make, "outsiders"
        judged_in = [CASES[name][case] for case in OUTSIDERS[name].cases]
    else:
        suite = "dynamics-circle" if name in DYNAMIC else "thesis"
        make = lawbreakers.factory(name) if name in DYNAMIC else ideal if name == "ideal" else mutants.factory(name)
        judged_in = [case for case in cases(suite) if name not in MUTANTS or mutants.touches(name, case)]
    if name in read_matrix():  # one that is new is judged by every check
        judged_in = concerned(judged_in)
    # Where a fault changes nothing the verdicts are those of the right contact.
    found = dict(findings("ideal")) if name in MUTANTS else {}
    for case in judged_in:
        judged = judge(make, name, suite, case)
        assert judged.error is None or name in OUTSIDERS, f"{case.name}: {judged.error}"
        found |= {(case.name, verdict.check): verdict.finding for verdict in judged.verdicts}
    return found


def outcomes(name: str) -> dict[tuple[str, str], Outcome]:
    return {place: finding.outcome for place, finding in findings(name).items()}


def of_check(name: str, outcome: Outcome) -> set[str]:
    return {check for (_, check), found in outcomes(name).items() if found is outcome}


@pytest.mark.parametrize("name", ["ideal", FAULTLESS])
def test_what_is_right_passes_every_check_that_applies(name):
    assert set(outcomes(name).values()) <= {Outcome.PASS, Outcome.NOT_APPLICABLE}, outcomes(name)


def test_what_is_right_passes_each_check_somewhere():
    right = ("ideal", FAULTLESS, *HONEST)
    assert set().union(*(of_check(name, Outcome.PASS) for name in right)) == set(OWN_CHECKS)


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_fails_its_check_and_no_other(name):
    fails = {BROKEN[name], *BESIDES.get(name, {})}
    own = fails if name not in LAWBREAKERS else fails | {"closed-form"}
    assert of_check(name, Outcome.FAIL) == fails, f"what '{name}' fails beside stands in `BESIDES`, with the cause"
    right = outcomes(FAULTLESS if name in LAWBREAKERS else "ideal")
    others = {place: outcome for place, outcome in outcomes(name).items() if place[1] not in own}
    assert others == {place: right[place] for place in others}, "and leaves no other check undecided"


@pytest.mark.parametrize("name", HONEST)
def test_what_is_honest_is_not_blamed(name):
    assert of_check(name, Outcome.FAIL) | of_check(name, Outcome.ERROR) == set()
    assert of_check(name, Outcome.PASS)


@pytest.mark.parametrize("name", FAULTY)
def test_what_an_outsider_breaks_is_found(name):
    broken = FAULTY[name]
    if broken.breaks:
        assert all(broken.breaks in finding.message for finding in findings(name).values())
        assert set(outcomes(name).values()) == {Outcome.ERROR}
        return
    failed = of_check(name, Outcome.FAIL)
    assert failed == set(broken.fails), f"`fails` of '{name}' names each of them, with the cause"
    assert any(OWN_CHECKS[check].level is not Level.INFO for check in failed), "and does not pass"


def test_no_check_is_without_a_renderer_that_it_stops():
    assert set(BROKEN.values()) | {check for each in FAULTY.values() for check in each.fails} == set(OWN_CHECKS)


@pytest.mark.parametrize("name", [*BROKEN, *FAULTY])
def test_each_failure_leads_to_an_item_of_its_checks_page(name):
    failures = {place: finding for place, finding in findings(name).items() if finding.outcome is Outcome.FAIL}
    kinds = {
        (check, kind_of_fault(finding.evidence))
        for (_, check), finding in failures.items()
        if read_page(OWN_CHECKS[check]).item_of(finding.evidence) is None
    }
    assert not kinds, "the page of the check lists that kind in a comment of the item that is about it"


@pytest.mark.parametrize("name", JUDGED)
def test_a_message_is_no_longer_than_is_read_at_a_glance(name):
    """Errors apart, which quote what a renderer raised."""
    messages = [finding.message for finding in findings(name).values() if finding.outcome is not Outcome.ERROR]
    assert [message for message in messages if len(message) > measured.LONGEST_MESSAGE] == []


def test_half_of_the_messages_are_shorter_than_that():
    lengths = [len(finding.message) for name in JUDGED for finding in findings(name).values()]
    assert np.median(lengths) <= measured.USUAL_MESSAGE


@pytest.mark.parametrize("name", JUDGED)
def test_what_is_measured_is_as_recorded(name):
    measured.compare("faults", name, findings(name))


HEAD = """# Kill matrix

The checks that each renderer fails in at least one case. Written by `test_kill_matrix.py`, which compares it.

- The ideal rigid contact, and its answer spoiled (`mutants.py`): in the cases of the thesis suite.
- A faultless set stabilisation, and broken laws (`lawbreakers.py`): in those of `dynamics-circle` with a point mass.
- A spring to the nearest point, in the ways in which honest renderers differ, and the broken ones that answer step by
  step (`outsiders.py`): on a short way round a circle, pressed on a line, and through a thin plate. One whose
  `run()` is not its `step()` breaks the contract, and is not judged.
- Friction round the nearest point, and with one fault each (`rubbing.py`): in cases of `effects-friction`.
- The same spring with force shading, or with what begins with a contact, and broken ones that claim to show that
  (`struck_and_shaded.py`): round a loop under a facet of an octagon, over its edges, and in taps on a line.
- The same spring with a height map or a stochastic texture, and broken ones that claim to show that (`textured.py`):
  in cases of `effects-texture`.
- What users of renderers and engines report, each in a few lines, and honest relatives (`field_bugs.py`): in cases of
  the suites `field` and `seams`.
- Effects that renderers show by code of their own (`felt.py`), right and wrong: in cases of the suites of effects.

Why one fails a check besides the one that has to stop it is given beside it.

"""
TITLES = "| renderer | fails |"
NOT_JUDGED = "not judged: it breaks the contract"


def read_matrix() -> dict[str, str]:
    """The published matrix: what each renderer fails. A line a renderer: who adds one or a check changes no other."""
    lines = PUBLISHED.read_text(encoding="utf-8").splitlines()
    cells = [line.split("|") for line in lines if line.startswith("| ") and line != TITLES]
    return {name.strip(): fails.strip() for _, name, fails, _ in cells}


def page(matrix: Mapping[str, str]) -> str:
    lines = [f"| {name} | {matrix[name]} |" for name in JUDGED if name in matrix]
    return HEAD + "\n".join([TITLES, "|---|---|", *lines]) + "\n"


def fails_of(name: str) -> str:
    """The checks that a renderer fails; where one check alone is asked, with those that are published of the others."""
    if of_check(name, Outcome.ERROR):
        return NOT_JUDGED
    failed = of_check(name, Outcome.FAIL)
    published = read_matrix().get(name, "")
    if only_check() is None or not published:
        return ", ".join(sorted(failed))
    if not findings(name):
        return published
    return ", ".join(sorted(failed | {*published.split(", ")} - {only_check()}))


@pytest.mark.parametrize("name", JUDGED)
def test_the_published_matrix_has_what_a_renderer_fails(name):
    """`make tables` writes it anew, a line at a time."""
    fails = fails_of(name)
    if publishing():
        with replacing(PUBLISHED) as temporary:
            temporary.write_text(page(read_matrix() | {name: fails}), encoding="utf-8")
    assert read_matrix()[name] == fails


def test_the_published_matrix_has_a_line_for_each_renderer_and_no_other():
    assert list(read_matrix()) == list(JUDGED)
    assert PUBLISHED.read_text(encoding="utf-8") == page(read_matrix())
