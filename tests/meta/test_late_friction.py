"""Friction that is late by one lag for the run, also between two ticks, is right; one that is wrong besides is not."""

from __future__ import annotations

import pytest
from latecomers import Latecomer
from rubbing import CASES, Chatters, Grips, Rubbing, Thins

from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import judge

LAGS = [{"force": 1.0}, {"force": 0.4}, {"ihip": 0.4}, {"ihip": 0.4, "force": 0.4}, {"ihip": 2.3, "force": 2.3}]


def failing(kind, lag, name):
    def make(scene):
        return Latecomer(scene, kind(scene), **lag)

    make.supports = Rubbing.supports
    judged = judge(make, "late", "effects-friction", CASES[name])
    assert judged.error is None
    decided = {verdict.check: verdict.outcome for verdict in judged.verdicts}
    assert Outcome.PASS in decided.values()
    return {check for check, outcome in decided.items() if outcome not in (Outcome.PASS, Outcome.NOT_APPLICABLE)}


@pytest.mark.parametrize("name", ["plane-to-and-fro", "circle-to-and-fro"])
@pytest.mark.parametrize("lag", LAGS, ids=str)
def test_friction_may_be_late_by_one_number_of_ticks(lag, name):
    assert failing(Rubbing, lag, name) == set()


@pytest.mark.parametrize(
    ("kind", "name", "check"),
    [
        (Grips, "circle-to-and-fro", "friction-cone"),
        (Chatters, "plane-to-and-fro", "friction-sliding"),
        (Thins, "viscous-plane", "friction-work"),
    ],
)
@pytest.mark.parametrize("lag", [{}, {"force": 0.4}], ids=str)
def test_a_lag_hides_no_wrong_friction(lag, kind, name, check):
    assert check in failing(kind, lag, name)
