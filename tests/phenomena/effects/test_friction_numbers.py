"""What the checks of friction say in words is what they have measured, and a break-away is told from other ends."""

from __future__ import annotations

import re

import numpy as np
import pytest
from made import FAIL, PASS, UNDECIDED, recorded

from hapticeval.effects.friction import Friction
from hapticeval.geometry.catalogue import line
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks import friction
from hapticeval.phenomena.checks.friction import _break_away_ticks, surface_force_of
from hapticeval.scene import Scene

SCENE = Scene(model=line(), stiffness=1000.0, mass=0.1, effects=(Friction(mu_s=0.5, mu_k=0.3),))
STEP = 1e-4


def numbers(text):
    return [float(number) for number in re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text)]


def asked(judge, base):
    return judge(Runs(base), surface_force_of(base, SCENE), SCENE)


def pressed_and_pulled(aside, *, normal=2.0):
    """A tool that stays where it is, while it is pulled by `aside` (n,), N, and pressed by `normal` N."""
    aside, normal = np.asarray(aside, dtype=float), np.broadcast_to(normal, len(aside))
    ihip = np.zeros((len(aside), 2))
    force = np.column_stack([-aside, normal])
    return ihip, ihip - force / SCENE.stiffness, force


class TestBreakAway:
    def ends_with(self, slips, *, normal=2.0, rest=10):
        """A tool that slides, rests for so many ticks, and then slips by so much in a tick, or does not."""
        ihip, hip, force = pressed_and_pulled(np.linspace(0.1, 0.3, rest + 6), normal=normal)
        ihip = np.array(ihip)
        ihip[:3, 0] = STEP * np.arange(3)
        ihip[3:, 0] = ihip[2, 0]
        ihip[rest + 3 :, 0] += slips
        return recorded(hip, ihip, force)

    def ticks(self, base):
        return _break_away_ticks(base, surface_force_of(base, SCENE), SCENE, 0.6 * 0.3).tolist()

    def test_a_tool_that_has_rested_for_longer_than_a_lag_breaks_away_where_it_slips(self):
        assert self.ticks(self.ends_with(1e-3)) == [13]
        assert self.ticks(self.ends_with(0.0)) == []
        assert self.ticks(self.ends_with(1e-3, rest=3)) == []
        assert self.ticks(self.ends_with(1e-3, rest=4)) == [7]

    def test_one_that_is_lifted_off_does_not(self):
        lifted = np.where(np.arange(16) < 13, 2.0, 0.0)
        assert self.ticks(self.ends_with(0.0, normal=lifted)) == []

    def test_one_that_was_never_pulled_less_than_it_slides_under_has_not_surely_stuck(self):
        base = self.ends_with(1e-3)
        hard = np.array(base.force)
        hard[:, 0] = -0.7 * 0.3 * 2.0
        assert self.ticks(recorded(base.hip, base.ihip, hard)) == []


@pytest.mark.parametrize(("factor", "outcome"), [(1.0, PASS), (1.5, FAIL)])
def test_energy_is_told_in_millijoules_with_what_holding_gives(factor, outcome):
    """In and out again under a line: on the way out the force is that, or half as much again."""
    height = 1e-4 * np.concatenate([np.arange(3, -20, -1), np.arange(-20, 4)])
    hip = np.column_stack([np.zeros(height.size), height])
    ihip = np.maximum(hip, 0.0)
    force = 1000.0 * (ihip - hip)
    force[23:] *= factor
    finding = asked(friction.judge_energy, recorded(hip, ihip, force))
    assert finding.outcome is outcome
    gained, first, last, granted = numbers(finding.message)
    assert gained == pytest.approx(1e3 * finding.metric.value, rel=1e-3)
    assert granted == pytest.approx(1e3 * finding.bound, rel=1e-3)
    assert (first, last) == (pytest.approx(finding.evidence["from_time"]), pytest.approx(finding.evidence["time"]))
    # By hand, on the way out: F . dx of a force that is held, of 20 steps; in: less by a step of the spring each.
    if factor > 1.0:
        depths = 1e-4 * np.arange(20, 0, -1)
        out, inwards = factor * np.sum(1000.0 * depths * 1e-4), np.sum(1000.0 * (depths - 1e-4) * 1e-4)
        assert finding.metric.value == pytest.approx(out - inwards, rel=0.02)


def test_the_cone_is_told_with_both_forces():
    ihip, hip, force = pressed_and_pulled(np.linspace(0.0, 1.2, 10))
    finding = asked(friction.judge_cone, recorded(hip, ihip, force))
    assert finding.outcome is FAIL
    along, time, tick, mu_s, holds, across = numbers(finding.message)
    assert (along, mu_s, holds, across) == (pytest.approx(1.2), 0.5, pytest.approx(1.0), pytest.approx(2.0))
    assert (time, tick) == (pytest.approx(9e-3), 9)
    assert finding.metric.value == pytest.approx(1.2, rel=1e-5)
    within = asked(friction.judge_cone, recorded(hip[:8], ihip[:8], force[:8]))
    assert within.outcome is PASS
    assert numbers(within.message) == [0.5, pytest.approx(within.metric.value, rel=1e-3)]


def test_sticking_is_told_as_way_time_and_share():
    count = 1201
    ihip, hip, force = pressed_and_pulled(np.full(count, 0.3))
    creeping = ihip + np.column_stack([2e-6 * 1e-3 * np.arange(count), np.zeros(count)])
    finding = asked(friction.judge_sticking, recorded(hip, creeping, force))
    assert finding.outcome is FAIL
    way, seconds, share, since = numbers(finding.message)
    assert (way, seconds) == (pytest.approx(2.4, rel=1e-2), pytest.approx(1.2))
    assert (share, since) == (pytest.approx(0.5), 0.0)
    assert finding.metric.value == pytest.approx(2e-6)
    assert finding.evidence["drift_m"] == pytest.approx(2.4e-6)
    assert finding.evidence["to_time"] == pytest.approx(1.2)
    assert asked(friction.judge_sticking, recorded(hip, ihip, force)).outcome is PASS
    assert asked(friction.judge_sticking, recorded(hip[:900], ihip[:900], force[:900])).outcome is UNDECIDED


@pytest.mark.parametrize(("brake", "outcome"), [(0.3, PASS), (0.36, FAIL)])
def test_sliding_is_told_as_the_force_against_the_motion(brake, outcome):
    ihip, _, force = pressed_and_pulled(np.full(30, brake * 2.0))
    ihip = np.array(ihip)
    ihip[:, 0] = STEP * np.arange(30)
    finding = asked(friction.judge_sliding, recorded(ihip - force / 1000.0, ihip, force))
    assert finding.outcome is outcome
    said = numbers(finding.message)
    against, mu_k, asked_for = said[-3:]
    assert (against, mu_k, asked_for) == (pytest.approx(2.0 * brake, rel=1e-3), 0.3, pytest.approx(0.6, rel=1e-3))
    assert finding.evidence["ticks"] == 29
    assert finding.evidence["against_N"] == pytest.approx(2.0 * brake)
    assert finding.metric.value == pytest.approx(brake / 0.3 - 1.0, abs=1e-9)


def test_the_way_of_a_free_tool_to_the_surface_is_no_slip_that_is_braked():
    ihip, _, force = pressed_and_pulled(np.full(30, 0.6))
    ihip = np.array(ihip)
    ihip[:, 0] = STEP * np.arange(30)
    # Free at first, and not braked yet in the tick in which it touches.
    force[:12], force[12, 0] = 0.0, 0.0
    finding = asked(friction.judge_sliding, recorded(ihip - force / 1000.0, ihip, force))
    assert finding.evidence["ticks"] == 17
    assert finding.outcome is PASS
