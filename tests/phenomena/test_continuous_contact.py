"""Continuous contact on maps whose continuity is known beforehand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.geometry.catalogue import circle, line
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.continuous_contact import amplification
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene

SCENE = Scene(model=line())
ROUND = Scene(model=circle())


def runs(answer, *, refinable=True, meta=None):
    """HIPs moving 40 mm along x in 2 s, 1 mm deep, and `answer(x)` as the IHIP's place along x."""

    def record(factor):
        x = np.linspace(0.0, 0.04, 2000 * factor + 1)
        hip = np.column_stack([x, np.full_like(x, -1e-3)])
        ihip = np.column_stack([answer(x), np.zeros_like(x)])
        time = np.linspace(0.0, 2.0, x.size)
        return Recording(time, {"hip": hip, "ihip": ihip, "force": 1e3 * (ihip - hip)}, meta or {})

    return Runs(record(1), refine=record if refinable else None)


@given(size=st.floats(1e-4, 0.05), where=st.floats(0.002, 0.038))
def test_a_jump_stays_whatever_its_size_and_place(size, where):
    finding = CHECKS["continuous-contact"](runs(lambda x: x + size * (x > where)), SCENE)
    assert finding.outcome is Outcome.FAIL
    assert size - 1e-9 <= finding.metric.value <= size + 2.1e-5  # and the HIP's own step
    assert finding.evidence["time"] == pytest.approx(50.0 * where, abs=2e-3)
    assert finding.margin < 0.0


@given(slope=st.floats(0.0, 100.0), where=st.floats(0.002, 0.038))
@settings(max_examples=30)
def test_a_steep_but_continuous_map_passes(slope, where):
    finding = CHECKS["continuous-contact"](runs(lambda x: x + slope * np.clip(x - where, 0.0, 1e-3)), SCENE)
    assert finding.outcome is Outcome.PASS


@pytest.mark.parametrize("slope", [0.5, 1.0, 11.0])
def test_the_amplification_is_the_steepest_stretch(slope):
    finding = CHECKS["continuous-contact"](runs(lambda x: 0.3 * x + slope * np.clip(x - 0.02, 0.0, 5e-3)), SCENE)
    assert finding.evidence["amplification"] == pytest.approx(0.3 + slope)


def test_a_hand_that_rests_amplifies_nothing():
    """Where the HIP hardly moves the IHIP may still catch up; that is lag and no stretch."""
    hip = np.array([[0.0, -1e-3], [1e-3, -1e-3], [1e-3, -1e-3], [2e-3, -1e-3]])
    ihip = np.array([[0.0, 0.0], [0.5e-3, 0.0], [1e-3, 0.0], [2e-3, 0.0]])
    recording = Recording(1e-3 * np.arange(4.0), {"hip": hip, "ihip": ihip, "force": 1e3 * (ihip - hip)}, {})
    assert amplification(recording, SCENE) == pytest.approx(1.0)
    assert amplification(Recording(recording.time, {"hip": hip, "ihip": hip, "force": 0.0 * hip}, {}), SCENE) == 0.0


def test_the_steepest_map_met_in_practice_passes():
    """A Hoelder map of order 1/3, as a conformal map at a 60-degree tip."""
    finding = CHECKS["continuous-contact"](runs(lambda x: 0.1 * np.cbrt(x - 0.02)), SCENE)
    assert finding.outcome is Outcome.PASS
    assert finding.evidence["slope"] == pytest.approx(1 / 3, abs=0.05)


def test_a_jump_hidden_under_long_steps_is_found():
    """At the coarsest sampling the steep ramp steps farther than the jump; refinement shrinks only the ramp."""

    def answer(x):
        return x + 50.0 * np.clip(x - 0.01, 0.0, 2e-3) + 6e-4 * (x > 0.03)

    finding = CHECKS["continuous-contact"](runs(answer), SCENE)
    assert finding.outcome is Outcome.FAIL


def test_a_lagging_proxy_that_moves_in_every_third_tick_passes():
    def record(factor):
        x = np.linspace(0.0, 0.04, 2000 * factor + 1)
        hip = np.column_stack([x, np.full_like(x, -1e-3)])
        ihip = np.column_stack([x[3 * (np.arange(x.size) // 3)], np.zeros_like(x)])
        return Recording(np.linspace(0.0, 2.0, x.size), {"hip": hip, "ihip": ihip, "force": 1e3 * (ihip - hip)})

    assert CHECKS["continuous-contact"](Runs(record(1), refine=record), SCENE).outcome is Outcome.PASS


def test_a_jump_between_neighbouring_facets_is_a_mini_pop_through():
    mini = CHECKS["continuous-contact"](runs(lambda x: x + 1e-3 * (x > 0.02), meta={"resolution": 0.015}), SCENE)
    major = CHECKS["continuous-contact"](runs(lambda x: x + 0.03 * (x > 0.02), meta={"resolution": 0.015}), SCENE)
    assert mini.outcome is major.outcome is Outcome.FAIL
    assert (mini.evidence["severity"], major.evidence["severity"]) == ("mini", "major")


def test_a_jump_within_the_declared_standoff_passes_and_is_reported():
    def record(factor, meta):
        base = runs(lambda x: x + 1e-3 * (x > 0.02)).refine(factor)
        ihip = base.ihip + 1.2e-3 * np.array([0.0, 1.0])  # and the surface stands off as far as it says
        return Recording(base.time, {**base.channels, "ihip": ihip}, meta)

    declared = {"standoff": 0.0012}
    finding = CHECKS["continuous-contact"](Runs(record(1, declared), refine=lambda k: record(k, declared)), SCENE)
    assert finding.outcome is Outcome.PASS
    assert "standoff" in finding.message
    silent = CHECKS["continuous-contact"](Runs(record(1, {}), refine=lambda k: record(k, {})), SCENE)
    assert silent.outcome is Outcome.FAIL
    assert "pop-through: the IHIP jumps 1" in silent.message
    assert "off the surface" in silent.message


def test_a_jump_that_finer_runs_of_the_whole_lack_depends_on_the_rate():
    def pops(factor):
        fine = runs(lambda x: x).refine(factor)
        aside = (fine.hip[:, 0] > 0.02) * 0.01 if factor == 1 else np.zeros(len(fine))
        ihip = fine.ihip + np.column_stack([aside, np.zeros_like(aside)])
        return Recording(fine.time, {**fine.channels, "ihip": ihip, "force": 1e3 * (ihip - fine.hip)})

    finding = CHECKS["continuous-contact"](Runs(pops(1), refine=pops), SCENE)
    assert finding.outcome is Outcome.FAIL
    assert "depends on the sampling rate" in finding.message
    assert finding.metric.value == pytest.approx(0.01, abs=1e-4)


def test_a_finer_run_that_lets_go_is_no_sign_that_a_jump_vanished():
    jumps = runs(lambda x: x + 0.01 * (x > 0.02))

    def lets_go(factor):
        fine = jumps.refine(factor)
        held = (fine.hip[:, 0] <= 0.01)[:, np.newaxis]
        ihip = np.where(held, fine.ihip, fine.hip)
        return Recording(fine.time, {**fine.channels, "ihip": ihip, "force": 1e3 * (ihip - fine.hip)})

    finding = CHECKS["continuous-contact"](Runs(jumps.base, refine=lets_go), SCENE)
    assert finding.outcome is Outcome.FAIL
    assert "depends on the sampling rate" in finding.message


def test_a_smooth_path_through_the_solid_is_no_contact():
    """The chord that a smeared table draws across a circle is continuous, and not on the surface."""
    x = np.linspace(-0.08, 0.08, 4001)
    ihip = np.column_stack([x, np.full_like(x, 0.06)])
    hip = np.column_stack([x, np.full_like(x, 0.05)])
    chord = Recording(np.arange(x.size) * 1e-3, {"hip": hip, "ihip": ihip, "force": 1e3 * (ihip - hip)})
    finding = CHECKS["continuous-contact"](Runs(chord, refine=lambda factor: chord), ROUND)
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value == pytest.approx(0.04, abs=1e-4)


def test_a_jump_between_two_contacts_is_no_pop_through():
    base = runs(lambda x: x + 0.01 * (x > 0.02)).base
    ihip, force = np.array(base.ihip), np.array(base.force)
    gap = slice(1000, 1010)
    ihip[gap], force[gap] = base.hip[gap], 0.0
    broken = Recording(base.time, {"hip": base.hip, "ihip": ihip, "force": force})
    assert CHECKS["continuous-contact"](Runs(broken, refine=lambda factor: broken), SCENE).outcome is not Outcome.FAIL


def test_no_contact_decides_nothing():
    base = runs(lambda x: x).base
    free = Recording(base.time, {"hip": base.hip, "ihip": base.hip, "force": np.zeros_like(base.hip)})
    assert CHECKS["continuous-contact"](Runs(free), SCENE).outcome is Outcome.INCONCLUSIVE


def test_a_fixed_recording_is_judged_by_the_weaker_test_and_says_so():
    passed = CHECKS["continuous-contact"](runs(lambda x: x, refinable=False), SCENE)
    failed = CHECKS["continuous-contact"](runs(lambda x: x + 0.01 * (x > 0.02), refinable=False), SCENE)
    assert (passed.outcome, failed.outcome) == (Outcome.PASS, Outcome.FAIL)
    assert "weaker" in passed.message
    assert "weaker" in failed.message


def test_a_fixed_recording_near_the_medial_axis_is_inconclusive():
    """At the centre of the circle every IHIP step is honest."""
    angle = np.linspace(0.0, 2.0, 50)
    ihip = 0.1 * np.column_stack([np.cos(angle), np.sin(angle)])
    base = Recording(np.linspace(0, 1, 50), {"hip": 1e-3 * ihip, "ihip": ihip, "force": ihip})
    assert CHECKS["continuous-contact"](Runs(base), ROUND).outcome is Outcome.INCONCLUSIVE
