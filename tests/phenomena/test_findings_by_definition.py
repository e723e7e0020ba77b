"""What checks of laps, of impulses, of shading and of the order of effects say of recordings made by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from made import FAIL, PASS, UNDECIDED, changed, found, recorded
from test_helpers_by_definition import LINE, slide

from hapticeval.effects.friction import Friction
from hapticeval.effects.reliefs import BumpMap, HeightMap
from hapticeval.effects.shading import Shading
from hapticeval.effects.stochastic_texture import StochasticTexture
from hapticeval.effects.transients import ContactImpulse, ContactTransient, RecordedImpulse
from hapticeval.errors import UnknownNameError
from hapticeval.geometry.catalogue import line
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks import shading
from hapticeval.phenomena.checks.transient import impulse_of
from hapticeval.phenomena.decisions import IMPULSE_DECAYS
from hapticeval.phenomena.registry import CHECKS
from hapticeval.recordings.recording import SINGLE
from hapticeval.scene import Scene

STEP = 1e-4


def test_laps_that_are_in_contact_in_part_are_compared():
    """Four laps of ten rows, half of each above a line."""
    angle = 2.0 * np.pi * np.arange(41) / 10
    hip = 0.01 * np.column_stack([np.cos(angle), np.sin(angle)])
    finding = found("drift", recorded(hip, np.column_stack([hip[:, 0], np.maximum(hip[:, 1], 0.0)])), LINE)
    assert finding.outcome is PASS, finding.message
    assert finding.evidence["laps"] == 4


@pytest.mark.parametrize("free", ["forwards", "backwards"])
def test_a_hand_that_is_met_on_one_of_two_ways_alone_has_two_answers(free):
    held = slide()
    let_go = changed(held, ihip=held.hip, force=0.0 * held.force)
    ways = (let_go, held) if free == "forwards" else (held, let_go)
    finding = found("memoryless", Runs(ways[0], reverse=lambda: changed(ways[1])), LINE)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(1e-3, rel=0.1)
    assert "1 mm apart, by the way it was reached (100 per cent of the HIPs)" in finding.message


class TestImpulses:
    PLACE, NORMAL = np.zeros(2), np.array([0.0, 1.0])

    def given(self, effect, speed=0.2):
        scene = Scene(model=line(), mass=0.1, restitution=0.5, effects=(effect,))
        return impulse_of(effect, scene, self.PLACE, self.NORMAL, speed)

    def test_a_contact_impulse_is_what_turns_the_momentum_round(self):
        assert self.given(ContactImpulse()) == (pytest.approx(1.5 * 0.1 * 0.2), 1e-3)
        # 30 mN s under a cap of 3 N take 10 ms more.
        assert self.given(ContactImpulse(cap=3.0))[1] == pytest.approx(1e-3 + 10e-3)

    def test_a_ringing_has_the_integral_of_its_wave(self):
        ringing = ContactTransient(amplitude=5.0, decay=80.0, frequency=150.0)
        omega = 2.0 * math.pi * 150.0
        impulse, lasts = self.given(ringing)
        assert impulse == pytest.approx(5.0 * 0.2 * omega / (80.0**2 + omega**2))
        assert lasts == pytest.approx(IMPULSE_DECAYS / 80.0)
        capped = ContactTransient(amplitude=5.0, decay=80.0, frequency=150.0, cap=0.5)
        assert self.given(capped)[1] == pytest.approx(lasts + 5.0 * 0.2 / 80.0 / 0.5)

    def test_a_recorded_pulse_has_the_sum_of_its_samples(self):
        impulse, lasts = self.given(RecordedImpulse(pulse=(1.0, -2.0, 3.0), step=2e-3))
        assert (impulse, lasts) == (pytest.approx(4e-3), pytest.approx(8e-3))
        capped = self.given(RecordedImpulse(pulse=(1.0, -2.0, 3.0), step=2e-3, cap=0.5))
        assert capped[1] == pytest.approx(8e-3 + 12e-3 / 0.5)


def round_under_a_line(laps=3, *, curl=0.0, factor=1):
    """A hand that goes round 1 mm, 3 mm under a line, in 40 steps a lap; pushed by 3 N, and round by `curl` N/m."""
    angle = 2.0 * np.pi * np.arange(40 * laps * factor + 1) / (40 * factor)
    around = 1e-3 * np.column_stack([np.cos(angle), np.sin(angle)])
    hip = around - [0.0, 3e-3]
    force = np.array([0.0, 3.0]) + curl * np.column_stack([-around[:, 1], around[:, 0]])
    return recorded(hip, hip * [1.0, 0.0], force, dt=1e-3 / factor)


@pytest.mark.parametrize(("curl", "outcome"), [(0.0, PASS), (100.0, FAIL), (-100.0, PASS)])
def test_a_relief_s_work_is_that_of_each_lap_after_the_first(curl, outcome):
    """Round r a force of c r does 2 pi c r^2 in a lap."""
    scene = Scene(model=line(), stiffness=1000.0, effects=(HeightMap(wavelength=2e-3, amplitude=4e-5),))
    runs = Runs(round_under_a_line(curl=curl), refine=lambda factor: round_under_a_line(curl=curl, factor=factor))
    finding = found("texture-work", runs, scene)
    assert finding.outcome is outcome
    assert finding.metric.value == pytest.approx(2.0 * np.pi * curl * 1e-6, rel=0.01, abs=1e-9)
    # 3 N up and down by 2 mm, and what goes round.
    crossed = np.abs(np.diff(round_under_a_line(factor=64, curl=curl).hip[:2561], axis=0) @ np.array([0.0, 3.0]))
    assert finding.evidence["crossed_J"] == pytest.approx(crossed.sum(), rel=0.05)
    assert finding.evidence["laps"] == 2
    assert finding.evidence["time"] - finding.evidence["from_time"] == pytest.approx(0.04)
    assert finding.evidence["from_time"] in (pytest.approx(0.04), pytest.approx(0.08))
    assert ("the hand gets 0.62" in finding.message) is (outcome is FAIL)
    one = Runs(round_under_a_line(1), refine=lambda factor: round_under_a_line(1, factor=factor))
    assert found("texture-work", one, scene).outcome is UNDECIDED


class TestShading:
    """What is recorded, held against what a shaded force would be and against what none is shaded."""

    SCENE = Scene(model=line(), stiffness=1000.0, effects=(Shading(),))

    @pytest.fixture
    def judged(self, monkeypatch):
        def judge(check, base, plain, shaded, *, contact=None, rounding=1e-6):
            contact = np.ones(len(base), dtype=bool) if contact is None else contact
            expected = shading.ExpectedShading(plain, shaded, contact, np.full(len(base), rounding))
            monkeypatch.setattr(shading, "expect_shading", lambda runs, scene: expected)
            return found(check, Runs(base, without=lambda kind: base), self.SCENE)

        return judge

    def turning(self, *turns, size=1.0):
        """A force whose angle goes on by so much in each of 30 ticks, and farther at some, (tick, angle)."""
        angle = 0.01 * np.arange(30.0)
        for tick, more in turns:
            angle[tick:] += more
        return size * np.column_stack([np.sin(angle), np.cos(angle)])

    @pytest.mark.parametrize(("more", "outcome"), [(0.009, PASS), (0.011, FAIL)])
    def test_a_force_turns_by_twice_what_shaded_normals_do_within_a_lag(self, judged, more, outcome):
        hip = np.column_stack([STEP * np.arange(30), np.full(30, -1e-3)])
        base = recorded(hip, hip * [1.0, 0.0], self.turning((16, more), size=2.0))
        flat = self.turning((10, 0.1), (20, 0.2))
        finding = judged("shading-direction", base, flat, self.turning())
        assert finding.outcome is outcome
        # Rounding of 1 uN of 2 N at either end.
        assert finding.bound == pytest.approx(0.02 + 2.0 * 0.5e-6, rel=1e-6)
        assert (finding.metric.value, finding.evidence["tick"]) == (pytest.approx(0.01 + more), 16)
        assert finding.evidence["turns_without_rad"] == pytest.approx(0.21)
        assert finding.evidence["edges_crossed"] == 2
        degrees = f"turns by {math.degrees(0.01 + more):.3g} degrees"
        assert degrees in finding.message
        assert ("would by 12 degrees" if outcome is PASS else "before t = 0.016 s") in finding.message

    def test_where_nothing_presses_or_no_edge_is_crossed_no_turn_is_told(self, judged):
        hip = np.column_stack([STEP * np.arange(30), np.full(30, -1e-3)])
        base = recorded(hip, hip * [1.0, 0.0], self.turning((16, 1.0)))
        without = np.arange(30) != 16
        flat = self.turning((10, 0.1))
        assert judged("shading-direction", base, flat, self.turning(), contact=without).outcome is PASS
        assert "no edge" in judged("shading-direction", base, self.turning(), self.turning()).message
        never = np.arange(30) % 2 == 0
        assert "in a row" in judged("shading-direction", base, flat, self.turning(), contact=never).message

    @pytest.mark.parametrize(("size", "outcome"), [(1.0 + 0.9e-6, PASS), (1.0 - 1.1e-6, FAIL), (1.1, FAIL)])
    def test_a_force_is_as_large_as_without(self, judged, size, outcome):
        hip = np.column_stack([STEP * np.arange(30), np.full(30, -1e-3)])
        force = self.turning()
        force[7] *= size
        finding = judged("shading-magnitude", recorded(hip, hip * [1.0, 0.0], force), self.turning(), self.turning())
        assert finding.outcome is outcome
        assert (finding.metric.value, finding.bound) == (pytest.approx(abs(size - 1.0)), pytest.approx(1e-6))
        assert finding.evidence["tick"] == 7
        assert (finding.evidence["force_N"], finding.evidence["without_N"]) == (pytest.approx(size), pytest.approx(1.0))

    def test_a_force_that_is_added_where_there_is_none_is_told_in_units_of_the_least(self, judged):
        hip = np.column_stack([STEP * np.arange(30), np.full(30, -1e-3)])
        force, plain, contact = self.turning(), self.turning(), np.arange(30) != 7
        plain[7] = 0.0
        for strength, outcome in ((0.9e-3, PASS), (2e-3, FAIL)):
            force[7] = [0.0, strength]
            base = recorded(hip, hip * [1.0, 0.0], force)
            finding = judged("shading-magnitude", base, plain, plain, contact=contact)
            assert finding.outcome is outcome
            if outcome is FAIL:
                assert finding.metric.value == pytest.approx(2.0)
        assert judged("shading-magnitude", base, plain, plain, contact=contact, rounding=0.11).outcome is UNDECIDED

    @pytest.mark.parametrize(("curl", "outcome"), [(100.0, FAIL), (40.0, PASS), (-40.0, FAIL), (0.0, FAIL)])
    def test_the_work_round_a_loop_is_that_of_unit_normals(self, judged, curl, outcome):
        """Shaded by unit normals a force of 40 N/m goes round, and without shading none does."""
        base, shaded, plain = (round_under_a_line(curl=round_by) for round_by in (curl, 40.0, 0.0))
        finding = judged("shading-work", base, plain.force, shaded.force)
        assert finding.outcome is outcome
        # The trapezoid over 40 chords of a circle: c r^2 sin(2 pi / 40) for each.
        work, expected = (round_by * 1e-6 * 40 * math.sin(2.0 * math.pi / 40) for round_by in (curl, 40.0))
        assert finding.metric.value == pytest.approx(abs(work - expected), rel=1e-6, abs=1e-12)
        assert finding.bound == pytest.approx(1e-6 * 40 * 2e-3 * math.sin(math.pi / 40), rel=1e-6)
        assert finding.evidence["work_J"] == pytest.approx(work, abs=1e-12)
        assert finding.evidence["work_of_unit_normals_J"] == pytest.approx(expected)
        assert finding.evidence["shading_adds_J"] == pytest.approx(work, abs=1e-12)
        assert finding.evidence["loops"] == 2
        assert finding.evidence["time"] - finding.evidence["from_time"] == pytest.approx(0.04)
        if outcome is PASS:
            assert f"gives the hand {1e3 * work:.4g} mJ" in finding.message
        elif curl:
            assert (
                f"the hand gets {1e3 * work:.4g} mJ, and shaded by unit normals it would {1e3 * expected:.4g} mJ"
                in (finding.message)
            )
        none = judged("shading-work", plain, plain.force, plain.force)
        assert "no work" in none.message


@pytest.mark.parametrize(("kept", "kind"), [(0, "not met"), (1, "let go"), (2, "let go"), (5, "let go")])
def test_a_tool_that_had_contact_for_a_tick_was_let_go(kept, kind):
    """Down a millimetre a tick, through the line in tick 3."""
    hip = np.column_stack([np.zeros(40), 2.5e-3 - 1e-3 * np.arange(40)])
    held = np.arange(40) < 3 + kept
    ihip = np.where(held[:, np.newaxis], np.maximum(hip, 0.0), hip)
    finding = found("contact-kept", recorded(hip, ihip, meta={"source": "playback"}), Scene(model=line()))
    assert finding.outcome is FAIL
    assert finding.evidence["kind"] == kind
    assert finding.evidence["times_lost"] == 1


class TestOrderOfEffects:
    """Friction draws the tool from p to s, and a force that works on it is F + K (s - p)."""

    SCENE = Scene(
        model=line(),
        stiffness=1000.0,
        effects=(Friction(mu_s=0.5, mu_k=0.3), BumpMap(wavelength=2e-3, amplitude=4e-5)),
    )

    def judged(self, *, late=0, off=0.0, drag=2e-4, scene=None, tick=17):
        plain = slide(count=30)
        shift = np.column_stack([drag * np.sin(0.3 * np.arange(30)), np.zeros(30)])
        answered = np.clip(np.arange(30) - late, 0, 29)
        force = plain.force + 1000.0 * shift[answered]
        force[tick, 0] += off
        base = changed(plain, ihip=plain.ihip + shift, force=force)
        return found("effects-order", Runs(base, without=lambda kind: plain), scene or self.SCENE)

    @pytest.mark.parametrize("late", [-3, 0, 1, 3])
    def test_a_drag_is_the_spring_between_both_tools_up_to_a_lag(self, late):
        assert self.judged(late=late).outcome is PASS
        assert self.judged(late=4).outcome is FAIL

    @pytest.mark.parametrize(("share", "outcome"), [(0.9, PASS), (1.1, FAIL)])
    def test_it_is_known_to_rounding_and_the_least_force(self, share, outcome):
        base = slide(count=30)
        strength = 1.0 + 1000.0 * np.abs(base.hip).max()
        allowed = 4.0 * SINGLE * strength + 1e-3
        finding = self.judged(off=share * allowed)
        assert finding.outcome is outcome
        assert finding.bound == pytest.approx(allowed, rel=1e-3)
        if outcome is FAIL:
            assert (finding.metric.value, finding.evidence["tick"]) == (pytest.approx(share * allowed), 17)
            assert "t = 0.017 s" in finding.message

    @pytest.mark.parametrize(("tick", "outcome"), [(0, PASS), (2, PASS), (3, FAIL), (29, FAIL)])
    def test_the_queue_of_a_late_renderer_is_not_filled_before_three_ticks(self, tick, outcome):
        assert self.judged(off=0.1, tick=tick).outcome is outcome

    def test_it_is_asked_of_friction_and_one_other_where_the_friction_is_felt(self):
        assert self.judged(drag=1e-9).outcome is UNDECIDED
        alone = Scene(model=line(), stiffness=1000.0, effects=(Friction(mu_s=0.5, mu_k=0.3),))
        assert "it alone" in self.judged(scene=alone).message

    @pytest.mark.parametrize(("direction", "outcome"), [("along", PASS), ("normal", FAIL)])
    def test_a_texture_adds_along_its_direction_and_moves_no_tool(self, direction, outcome):
        texture = StochasticTexture(mass=0.05, texture="ribbed", direction=direction)
        scene = Scene(model=line(), stiffness=1000.0, effects=(Friction(mu_s=0.5, mu_k=0.3), texture))
        plain = slide(count=30)
        base = changed(plain, force=plain.force + np.array([0.5, 0.0]))
        assert found("effects-order", Runs(base, without=lambda kind: plain), scene).outcome is outcome
        moved = changed(base, ihip=base.ihip + np.array([1e-4, 0.0]), force=base.force)
        finding = found("effects-order", Runs(moved, without=lambda kind: plain), scene)
        assert finding.outcome is FAIL
        assert finding.metric.value == pytest.approx(0.1 + (0.5 if outcome is FAIL else 0.0))


@pytest.mark.parametrize("check", sorted(CHECKS))
def test_a_check_names_siblings_that_there_are(check):
    assert replace(CHECKS[check]) == CHECKS[check]
    for name in ("siblings", "needs"):
        with pytest.raises(UnknownNameError):
            replace(CHECKS[check], **{name: {"cousin": "of the first degree"}})
