"""What the checks of friction say in words is what they have measured, and a break-away is told from other ends."""

from __future__ import annotations

import re

import numpy as np
import pytest
from made import FAIL, PASS, UNDECIDED, changed, found, recorded

from hapticeval.effects.friction import Friction
from hapticeval.geometry.catalogue import circle, line, star
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks import friction, friction_work
from hapticeval.phenomena.checks.friction import break_away_ticks
from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.phenomena.measures.friction_check import judge_with_lag
from hapticeval.phenomena.measures.surface_force import surface_force_of
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.verdict import Finding, Metric
from hapticeval.scene import Scene

SCENE = Scene(model=line(), stiffness=1000.0, mass=0.1, effects=(Friction(mu_s=0.5, mu_k=0.3),))
STEP = 1e-4


def numbers(text):
    return [float(number) for number in re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text)]


def asked(judge, base):
    return judge(Runs(base), surface_force_of(Observed(base, SCENE)), SCENE)


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
        return break_away_ticks(Observed(base, SCENE), surface_force_of(Observed(base, SCENE)), 0.6 * 0.3).tolist()

    def test_it_has_rested_for_longer_than_the_granted_lag(self):
        for rest in range(1, 10):
            ticks = self.ticks(self.ends_with(1e-3, rest=rest))
            assert ticks == ([rest + 3] if rest > LAG_TICKS else []), rest

    def test_one_that_rests_at_a_corner_may_change_its_face(self):
        corner = star().curve.corners[0].position
        scene = Scene(model=star(), stiffness=1000.0, mass=0.1, effects=SCENE.effects)
        base = self.ends_with(1e-3)
        for place, ticks in ((corner, []), (corner + np.array([5e-3, 0.0]), [13])):
            there = changed(base, hip=base.hip + place, ihip=base.ihip + place - [2.0 * STEP, 0.0])
            # What presses and pulls is that of the line.
            parts = surface_force_of(Observed(base, SCENE))
            assert break_away_ticks(Observed(there, scene), parts, 0.6 * 0.3).tolist() == ticks

    def test_what_is_open_is_a_share_of_what_holds_in_the_tick_before(self):
        """2 K |dx| + mu_s |dF_n| of mu_s F_n, of a press of 2 N that grows with the slip; the rest is rounding."""
        for more in (0.0, 0.02):
            base = self.ends_with(1e-3, normal=np.where(np.arange(16) < 13, 2.0, 2.0 + more))
            finding = asked(friction.judge_break_away, base)
            steps = np.linalg.norm(np.diff(base.hip, axis=0), axis=1)
            # Of the ticks within three of the slip, and the one before: the foot slips, and not the hand.
            open_ = 2.0 * 1000.0 * steps[8:].max() + 0.5 * more
            assert finding.evidence["tick"] == 13
            assert finding.bound * 0.5 * 2.0 == pytest.approx(open_, rel=1e-5)

    def test_a_slip_while_the_press_changes_by_more_than_it_is_known_from_decides_nothing(self):
        even, pressed_on = (self.ends_with(1e-3, normal=np.where(np.arange(16) < 13, 2.0, later)) for later in (2, 3))
        stays = [*range(16), *[15] * 6]  # the way from one to the other is not near a slip
        for first, second, tick in ((even, pressed_on, 13), (pressed_on, even, 22 + 13)):
            hip, ihip, force = (
                np.vstack([first.channels[name][stays], second.channels[name][stays]]) for name in first.channels
            )
            hip[22:, 0], ihip[22:, 0] = hip[22:, 0] + 1e-2, ihip[22:, 0] + 1e-2
            finding = asked(friction.judge_break_away, recorded(hip, ihip, force))
            assert (finding.evidence["tick"], finding.evidence["slips"]) == (tick, 1)


@pytest.mark.parametrize(("factor", "outcome"), [(1.0, PASS), (1.5, FAIL)])
def test_energy_is_told_in_millijoules_with_what_holding_gives(factor, outcome):
    """In and out again under a line: on the way out the force is that, or half as much again."""
    height = 1e-4 * np.concatenate([np.arange(3, -20, -1), np.arange(-20, 4)])
    hip = np.column_stack([np.zeros(height.size), height])
    ihip = np.maximum(hip, 0.0)
    force = 1000.0 * (ihip - hip)
    force[23:] *= factor
    finding = asked(friction_work.judge_energy, recorded(hip, ihip, force))
    assert finding.outcome is outcome
    _, first, last, _ = numbers(finding.message)
    assert f"{1e3 * finding.metric.value:.4g} mJ from" in finding.message
    assert f"may give {1e3 * finding.bound:.4g} mJ" in finding.message
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
    along, time, mu_s, holds, across = numbers(finding.message)
    assert (along, mu_s, holds, across) == (pytest.approx(1.2), 0.5, pytest.approx(1.0), pytest.approx(2.0))
    assert (time, finding.evidence["tick"]) == (pytest.approx(9e-3), 9)
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


def test_energy_counts_to_the_last_row_and_a_damper_holds_the_step_before():
    """Along a line at an even pace, free in the first row alone, and pushed on in the last step alone."""
    scene = Scene(model=line(), stiffness=1000.0, mass=0.1, damping=2.0, effects=SCENE.effects)
    ihip = np.column_stack([STEP * np.arange(12), np.zeros(12)])
    force = np.tile([0.0, 0.02], (12, 1))
    force[0], force[10, 0] = 0.0, 5.0
    finding = friction_work.judge_energy(
        Runs(base := recorded(ihip - force * [0.0, 1e-3], ihip, force)), surface_force_of(Observed(base, scene)), scene
    )
    assert (finding.evidence["tick"], finding.evidence["from_time"]) == (11, 0.0)
    # F . dx of a force that is held
    assert finding.metric.value == pytest.approx(5.0 * STEP)
    lengths = np.linalg.norm(np.diff(base.hip, axis=0), axis=1)
    held = 500.0 * np.sum(lengths**2) + 2.0 / 1e-3 * np.sum(lengths[1:] * lengths[:-1])
    assert finding.bound == pytest.approx(held, rel=1e-4)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_a_slide_is_known_to_the_rounding_of_its_places(precision):
    ihip, _, force = pressed_and_pulled(np.full(30, 0.6))
    ihip = np.array(ihip)
    ihip[:, 0] = (STEP * np.arange(30)).astype(precision)
    base = recorded(ihip - force / 1000.0, ihip, force)
    finding = asked(friction.judge_sliding, base)
    place = 16.0 * np.finfo(precision).eps * np.abs(base.hip).max()
    reach = 1000.0 * np.abs(base.hip).max() + np.hypot(0.6, 2.0)
    rounded = 16.0 * np.finfo(precision).eps * reach / 0.6
    tick = finding.evidence["tick"]
    assert finding.bound == pytest.approx(rounded + place / (ihip[tick, 0] - ihip[tick - 1, 0]) + 1e-9, rel=1e-6)


def test_on_a_curve_the_force_may_turn_by_the_square_of_what_the_hand_is_ahead():
    scene = Scene(model=circle(size=0.2), stiffness=1000.0, mass=0.1, effects=SCENE.effects)
    angle = 1e-3 * np.arange(30)
    out, ahead = np.column_stack([np.cos(angle), np.sin(angle)]), np.column_stack([-np.sin(angle), np.cos(angle)])
    force = 2.0 * out - 0.6 * ahead
    base = recorded(0.1 * out - force / 1000.0, 0.1 * out, force)
    finding = friction.judge_sliding(Runs(base), surface_force_of(Observed(base, scene)), scene)
    assert finding.outcome is PASS
    assert finding.bound == pytest.approx((10.0 * (1e-4 + (0.6 + 2.0) / 1000.0)) ** 2, rel=1e-2)


def test_facets_of_the_declared_resolution_lean_from_the_surface():
    """Chords of 1 mm on a circle of 100 mm turn a force by up to 10 mrad, of which 33 mrad of mu_k = 0.3 are made."""
    scene = Scene(model=circle(size=0.2), stiffness=1000.0, mass=0.1, effects=SCENE.effects)
    angle = 1e-3 * np.arange(30)
    out, ahead = np.column_stack([np.cos(angle), np.sin(angle)]), np.column_stack([-np.sin(angle), np.cos(angle)])
    force = 2.0 * out - (0.6 + 2.0 * 9e-3) * ahead
    base = recorded(0.1 * out - force / 1000.0, 0.1 * out, force)
    asked_of = {0.0: FAIL, 0.3e-3: FAIL, 1e-3: PASS, 5e-3: UNDECIDED}
    for resolution, expected in asked_of.items():
        assert found("friction-sliding", changed(base, {"resolution": resolution}), scene).outcome is expected
    # A right one is not worse for what it declares.
    right = recorded(0.1 * out - (2.0 * out - 0.6 * ahead) / 1000.0, 0.1 * out, 2.0 * out - 0.6 * ahead)
    assert found("friction-sliding", changed(right, {"resolution": 5e-3}), scene).outcome is PASS


@pytest.mark.parametrize(("resolution", "expected"), [(0.0, FAIL), (1e-3, PASS)])
def test_a_cone_leans_with_the_facets_of_the_declared_resolution(resolution, expected):
    scene = Scene(model=circle(size=0.2), stiffness=1000.0, mass=0.1, effects=SCENE.effects)
    # 1 N a little outside of the cone of mu_s = 0.5
    force = np.tile([1.0, -0.509], (10, 1))
    ihip = np.tile([0.1, 0.0], (10, 1))
    base = recorded(ihip - force / 1000.0, ihip, force, meta={"resolution": resolution})
    assert found("friction-cone", base, scene).outcome is expected


def test_what_is_open_between_ticks_is_open_of_the_force():
    ihip, hip, force = pressed_and_pulled(np.full(5, 0.3))
    base, between = recorded(hip, ihip, force), 0.1 * np.arange(5.0)
    known, unknown = surface_force_of(Observed(base, SCENE)), surface_force_of(Observed(base, SCENE), between)
    np.testing.assert_allclose(unknown.open_force - known.open_force, between)


def test_a_tool_that_is_never_pressed_tells_nothing_of_a_friction():
    hip = np.column_stack([STEP * np.arange(20), np.full(20, 1e-3)])
    finding = found("friction-cone", recorded(hip), SCENE)
    assert finding.outcome is UNDECIDED
    assert "pull" not in finding.message, "nothing is said of a pull where nothing presses"


class TestLateChannels:
    BASE = recorded(
        np.column_stack([STEP * np.sin(np.arange(30.0)), np.full(30, -2e-3)]),
        np.zeros((30, 2)),
        np.column_stack([np.cos(np.arange(30.0)), np.full(30, 2.0)]),
    )
    ON_TIME = (("hip", "ihip"), ("force",))

    def judged(self, keeps, on_time=ON_TIME):
        """What comes of a law that is kept by the recordings that `keeps` is true of."""

        def judge(runs, parts):
            np.testing.assert_array_equal(
                parts.tangential_force,
                surface_force_of(Observed(runs.base, SCENE)).tangential_force,
            )
            outcome, words = (PASS, "kept") if keeps(runs.base) else (FAIL, "broken")
            return Finding(outcome, words, Metric("off", 1.0, "N"), 0.5)

        return judge_with_lag(Runs(self.BASE), judge, on_time, SCENE)

    def held_back(self, names, ticks):
        rows = np.maximum(np.arange(30) - ticks, 0)
        return {name: self.BASE.channels[name][rows] for name in names}

    @pytest.mark.parametrize(
        ("names", "late"),
        [
            (("force",), "the IHIP is"),
            (("hip", "ihip"), "the force is"),
            (("hip",), "the IHIP and force are"),
        ],
    )
    @pytest.mark.parametrize(("ticks", "granted"), [(1, True), (3, True), (4, False)])
    def test_a_law_that_is_kept_with_a_channel_up_to_three_ticks_late_is_kept(self, names, late, ticks, granted):
        wanted = self.held_back(names, ticks)

        def keeps(base):
            return all(
                np.array_equal(base.channels[name], wanted.get(name, self.BASE.channels[name]))
                for name in self.BASE.channels
            )

        finding = self.judged(keeps, (names,))
        assert finding.outcome is (PASS if granted else FAIL)
        assert finding.message == (f"kept; {late} {ticks} tick{'s' * (ticks > 1)} late" if granted else "broken")

    def test_one_that_is_kept_as_it_is_needs_no_lag(self):
        assert self.judged(lambda base: base is self.BASE).message == "kept"
