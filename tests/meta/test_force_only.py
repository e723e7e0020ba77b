"""One that declares a force and no contact point is judged by its force, and nothing about it stays undecided."""

from __future__ import annotations

from functools import cache

import pytest
from force_only import Afar, Aside, DeadBand, Dodging, Field, Interrupted, Late, Mute, Pulling, Silent, Stiff

from hapticeval.phenomena.verdict import Level, Outcome, Verdict
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite

CASE = "icosphere-1280"


@cache
def verdicts(make: type[Field]) -> dict[str, Verdict]:
    judged = judge(make, "field", "solids", load_suite("solids").case(CASE))
    assert judged.error is None
    return {verdict.check: verdict for verdict in judged.verdicts}


def test_a_potential_field_is_left_alone():
    found = verdicts(Field)
    assert {verdict.outcome for verdict in found.values()} == {Outcome.PASS, Outcome.NOT_APPLICABLE}
    assert found["continuous-contact"].outcome is Outcome.NOT_APPLICABLE
    assert found["contact-normal-force"].outcome is Outcome.PASS


@pytest.mark.parametrize("make", [DeadBand, Late])
def test_one_that_is_late_or_declares_how_coarse_it_is_has_a_force_of_the_right_size(make):
    assert verdicts(make)["force-magnitude"].outcome is Outcome.PASS


def test_one_that_does_not_declare_it_stays_undecided():
    undecided = [verdict for verdict in verdicts(Silent).values() if verdict.outcome is Outcome.INCONCLUSIVE]
    assert any(verdict.level is Level.MUST for verdict in undecided)


@pytest.mark.parametrize(("make", "check"), [(Pulling, "contact-normal-force"), (Aside, "contact-normal-force")])
def test_a_force_in_a_wrong_direction_is_stopped(make, check):
    assert verdicts(make)[check].outcome is Outcome.FAIL
    assert verdicts(make)[check].level is Level.MUST


def test_an_outage_is_called_by_its_name_and_no_dead_band():
    assert "the force is missing for" in verdicts(Interrupted)["force-magnitude"].finding.message


def test_one_that_is_three_times_too_stiff_is_stopped():
    verdict = verdicts(Stiff)["force-magnitude"]
    assert verdict.outcome is Outcome.FAIL
    assert verdict.level is Level.MUST


def test_one_that_has_a_contact_point_is_judged_by_it_whatever_it_declares():
    assert verdicts(Dodging)["continuous-contact"].outcome is Outcome.FAIL


@pytest.mark.parametrize(
    ("make", "check"), [(Interrupted, "force-magnitude"), (Mute, "force-magnitude"), (Afar, "contact-kept")]
)
def test_a_force_that_is_missing_inside_or_felt_outside_is_stopped(make, check):
    assert verdicts(make)[check].outcome is Outcome.FAIL
    assert verdicts(make)[check].level is Level.MUST
