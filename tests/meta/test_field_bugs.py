"""Each fault that users report is named by the check that is about it, and by a message that says what it is."""

from __future__ import annotations

import re

import numpy as np
import pytest
from field_bugs import BROKEN, CASES, HONEST
from honest import Spring
from made import FAIL, NO, PASS, UNDECIDED, changed, found, outcome, recorded

from hapticeval.geometry.catalogue import line, sphere
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.verdict import Level
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene

FLAT = Scene(model=line())


def test_every_fault_says_where_it_was_reported_and_every_case_has_a_fault():
    assert all(outsider.reported for outsider in BROKEN.values())
    assert len(BROKEN) >= 18
    assert len(HONEST) >= 9
    asked = {case for outsider in (*BROKEN.values(), *HONEST.values()) for case in outsider.cases}
    assert {name for name, case in CASES.items() if "update-rate" in case.checks} <= asked


def pressed(depths, force_of, *, dt=1e-3):
    """A hand over a line, at some depths (n,), m, with the force `force_of(depth, velocity)`."""
    depths = np.asarray(depths)
    hip = np.column_stack([np.zeros_like(depths), -depths])
    ihip = np.column_stack([np.zeros_like(depths), np.maximum(-depths, 0.0)])
    velocity = np.diff(hip[:, 1], prepend=hip[0, 1]) / dt
    force = np.array([force_of(max(d, 0.0), v) if d > 0.0 else 0.0 for d, v in zip(depths, velocity, strict=True)])
    return recorded(hip, ihip, np.column_stack([np.zeros_like(force), force]))


IN_AND_OUT = 0.004 * np.sin(np.linspace(-0.3, np.pi + 0.3, 200))


@pytest.mark.parametrize(("damping", "expected"), [(0.0, PASS), (5.0, FAIL)])
def test_a_damper_that_pulls_is_named(damping, expected):
    run = pressed(IN_AND_OUT, lambda depth, speed: 1000.0 * depth - damping * speed)
    finding = found("never-pulls", run, FLAT)
    assert finding.outcome is expected, finding.message
    assert ("leaves at" in finding.message) is (expected is FAIL)


def test_a_clipped_damper_does_not_pull():
    run = pressed(IN_AND_OUT, lambda depth, speed: max(1000.0 * depth - 5.0 * speed, 0.0))
    assert outcome("never-pulls", run, FLAT) is PASS


@pytest.mark.parametrize(("asked", "expected"), [(5.0, PASS), (0.0, FAIL)])
@pytest.mark.parametrize("clip", [0.0, -np.inf])
def test_a_damper_is_right_where_the_scene_asks_for_it_clipped_or_not(asked, expected, clip):
    """|max(K d - K_d v, 0) - K d| <= K_d |v|: the bound of a damper holds for a clipped one."""
    run = pressed(IN_AND_OUT, lambda depth, speed: max(1000.0 * depth - 5.0 * speed, clip))
    finding = found("force-magnitude", run, Scene(model=line(), damping=asked))
    assert finding.outcome is expected, finding.message


def test_who_declares_a_spring_must_not_pull():
    run = pressed(IN_AND_OUT, lambda depth, speed: 1000.0 * depth - 5.0 * speed)
    assert found("never-pulls", run, FLAT).level is None
    assert found("never-pulls", changed(run, {"spring": "error"}), FLAT).level is Level.MUST


def test_a_hand_that_only_goes_in_shows_no_pull():
    run = pressed(np.linspace(-0.001, 0.004, 100), lambda depth, speed: 1000.0 * depth)
    assert outcome("never-pulls", run, FLAT) is UNDECIDED


def stood(run, ticks):
    """The same run with its forces held for so many ticks."""
    rows = np.arange(len(run)) // ticks * ticks
    return recorded(run.hip, run.ihip, run.force[rows])


@pytest.mark.parametrize(("ticks", "rate", "expected"), [(1, "1000 Hz", PASS), (2, "500 Hz", FAIL), (16, "62.5", FAIL)])
def test_the_rate_of_the_force_is_measured(ticks, rate, expected):
    run = stood(pressed(IN_AND_OUT, lambda depth, speed: 1000.0 * depth), ticks)
    finding = found("update-rate", run, FLAT)
    assert finding.outcome is expected, finding.message
    assert finding.metric.value == pytest.approx(ticks * 1e-3)
    assert rate in finding.message


def test_one_late_answer_in_fifty_is_no_slow_loop():
    run = pressed(IN_AND_OUT, lambda depth, speed: 1000.0 * depth)
    rows = np.arange(len(run))
    rows[49::50] -= 1
    assert outcome("update-rate", recorded(run.hip, run.ihip, run.force[rows]), FLAT) is PASS


def test_a_force_that_is_rightly_constant_is_not_called_stale():
    x = np.linspace(0.0, 0.02, 200)
    hip = np.column_stack([x, np.full_like(x, -0.002)])
    run = recorded(hip, np.column_stack([x, np.zeros_like(x)]))
    assert outcome("update-rate", run, FLAT) is UNDECIDED


def test_a_drop_out_is_asked_only_where_a_renderer_can_be():
    run = pressed(IN_AND_OUT, lambda depth, speed: 1000.0 * depth)
    assert outcome("drop-out", run, FLAT) is NO


@pytest.mark.parametrize(
    ("answers", "expected", "words"),
    [
        ((None, np.ones(2)), PASS, "is refused"),
        ((np.zeros(2), np.ones(2)), PASS, "gets no force"),
        ((np.array([0.0, 3.0]), np.ones(2)), FAIL, "gets 3 N"),
        ((np.full(2, np.nan), np.ones(2)), FAIL, "no number"),
        ((None, np.full(2, np.nan)), FAIL, "any more"),
        ((None, None), FAIL, "next one is refused"),
        ((np.zeros(2), None), FAIL, "next one is refused"),
    ],
)
def test_what_a_missing_position_gets(answers, expected, words):
    run = pressed(IN_AND_OUT, lambda depth, speed: 1000.0 * depth)
    finding = found("drop-out", Runs(run, dropped_out=lambda tick: answers), FLAT)
    assert finding.outcome is expected
    assert re.search(words, finding.message)


def test_a_spring_answers_alike_however_its_faces_are_cut():
    case = CASES["normal-equal"]
    judged = judge(Spring, "spring", "seams", case)
    assert [v.check for v in judged.verdicts if v.finding.outcome is not PASS] == []
    assert sphere().cut() is None
