"""Effects that renderers show by themselves: right ones are left alone, and what is not shown right is stopped."""

from __future__ import annotations

from functools import partial

import felt
import numpy as np
import pytest
from made import FAIL, PASS, found

from hapticeval.runner.judging import judge
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment


def findings(outsider, case):
    judged = judge(outsider.make, "it", "felt", felt.CASES[case])
    assert judged.error is None
    return {verdict.check: verdict.finding for verdict in judged.verdicts}


@pytest.mark.parametrize("case", ["height-map-line", "bump-map-line"])
@pytest.mark.parametrize(("high", "expected"), [(1.0001, PASS), (0.9999, PASS), (1.001, FAIL), (0.999, FAIL)])
def test_a_thousandth_of_a_relief_is_found(case, high, expected):
    """Of the 0.25 N that it adds 0.0001 N are open where the relief is least steep."""
    (finding,) = findings(felt.Outsider(partial(felt.Carved, high=high)), case).values()
    assert finding.outcome is expected
    assert finding.evidence["share"] == pytest.approx(high, abs=1e-4)
    assert finding.bound < 1e-3


def test_a_relief_is_judged_in_a_closed_loop_too():
    loop = Experiment(0.4, np.array([2e-4, 5e-4]), np.array([5e-3, 0.0]), np.array([0.0]), np.array([[0.02, -0.5]]))
    scene = felt.CASES["height-map-line"].build_scene()
    for high, expected in ((1.0, PASS), (1.3, FAIL)):
        run = simulate_closed_loop(felt.Carved(scene, high=high), loop, scene, 1e-3)
        assert found("texture-relief", run, scene).outcome is expected
