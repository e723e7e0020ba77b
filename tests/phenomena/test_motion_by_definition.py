"""What the checks of motion are made of, term by term: the centripetal share, starts, strikes, a spring that is off."""

from __future__ import annotations

import math

import numpy as np
import pytest
from made import FAIL, changed, found, recorded
from scipy.linalg import block_diag

from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.geometry.boundary import ClosestPoint
from hapticeval.geometry.catalogue import circle, line
from hapticeval.phenomena.checks.centripetal_force import (
    _after_strike,
    _fit_share,
    _force_off_spring,
    _missing_at_zero_error,
    _normal_turning,
    _regression_terms,
    _under_way,
    _unheld_tick,
)
from hapticeval.phenomena.checks.constraint_stability import _describe_failure
from hapticeval.phenomena.checks.tangential_dynamics import (
    _apparent_viscosity,
    _describe_unexplained,
    _pushed_along,
    _unexplained_velocity,
)
from hapticeval.phenomena.decisions import BLOCK_TICKS, EXPLAINING_PUSH, GROWS, HOLD_TICKS, STANDS, START_DECAY
from hapticeval.phenomena.measures.surface_motion import SurfaceMotion
from hapticeval.phenomena.observed import Observed
from hapticeval.scene import Scene

LINE = Scene(model=line(), stiffness=1000.0, mass=0.1)
ROUND = Scene(model=circle(), stiffness=50.0, mass=0.1, bilateral=True)
"""A circle of 0.1 m: at 0.5 m/s the normal turns by 5 rad/s, and m kappa v^2 is 0.25 N."""
SPEED, TURNING, CENTRIPETAL = 0.5, 5.0, 0.25


def on_circle(count, *, share=0.0, off=0.0, push=(0.0, 0.0), **more):
    """Round the circle, with `share` of the centripetal force lacking, and a `push` outwards and along, N."""
    angle = TURNING * 1e-3 * np.arange(count)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    ahead = np.column_stack([-out[:, 1], out[:, 0]])
    pushed = push[0] * out + push[1] * ahead
    force = -(1.0 - np.broadcast_to(share, count))[:, np.newaxis] * CENTRIPETAL * out - push[0] * out
    return recorded((0.1 + off) * out, 0.1 * out, force, velocity=SPEED * ahead, operator_force=pushed, **more)


class TestForceAtZeroError:
    @pytest.mark.parametrize("share", [1.0, 0.3, -0.3])
    def test_it_lacks_a_share_of_the_centripetal_one(self, share):
        assert _missing_at_zero_error(Observed(on_circle(8, share=share), ROUND)) == pytest.approx(share)

    @pytest.mark.parametrize(("tick", "missing"), [(0, 0.0), (3, 0.0), (4, 0.3)])
    def test_the_best_of_the_first_four_ticks_counts(self, tick, missing):
        """A force is that of its sample or a mean until the next one: of five samples four are told."""
        share = np.full(8, 0.3)
        share[tick] = 0.0
        assert _missing_at_zero_error(Observed(on_circle(8, share=share), ROUND)) == pytest.approx(missing, abs=1e-12)

    def test_four_samples_are_too_few_and_five_are_enough(self):
        assert _missing_at_zero_error(Observed(on_circle(4, share=0.3), ROUND)) is None
        assert _missing_at_zero_error(Observed(on_circle(5, share=0.3), ROUND)) == pytest.approx(0.3)

    @pytest.mark.parametrize("push", [(0.0, 4.0), (-3.0, 0.0), (3.0, 4.0)])
    def test_a_push_counts_and_leaves_open_what_the_normal_turns_of_it_while_a_force_is_held(self, push):
        open_ = HOLD_TICKS * 1e-3 * TURNING * math.hypot(*push) / CENTRIPETAL
        assert _missing_at_zero_error(Observed(on_circle(8, share=0.5, push=push), ROUND)) == pytest.approx(0.5 - open_)
        assert _missing_at_zero_error(Observed(on_circle(8, share=0.5 * open_, push=push), ROUND)) == 0.0

    def test_it_is_told_of_a_moving_tool_that_starts_on_a_constraint(self):
        assert _missing_at_zero_error(Observed(on_circle(8, share=0.3, off=1e-6), ROUND)) is None
        one_sided = Scene(model=circle(), stiffness=50.0, mass=0.1)
        assert _missing_at_zero_error(Observed(on_circle(8, share=0.3), one_sided)) is None
        halting = on_circle(8, share=0.3)
        velocity = np.array(halting.velocity)
        velocity[2] = 0.0
        assert _missing_at_zero_error(Observed(changed(halting, velocity=velocity), ROUND)) is None


class TestForceOffTheSpring:
    def sinking(self, gain, *, speed=0.0, deep=slice(None), meta=None):
        """A tool 2 mm deep in rows `deep` and free elsewhere, with the line's spring times `gain`."""
        hip = np.column_stack([np.zeros(6), np.full(6, 1e-3)])
        hip[deep, 1] = -2e-3
        ihip = np.maximum(hip, 0.0)
        velocity = np.tile([0.0, -speed], (6, 1))
        meta = {"spring": "error"} if meta is None else meta
        return recorded(hip, ihip, gain * 1000.0 * (ihip - hip), velocity=velocity, meta=meta)

    @pytest.mark.parametrize(("gain", "off"), [(0.49, True), (0.51, False), (1.99, False), (2.01, True)])
    def test_a_stiffness_is_off_by_a_factor_of_two(self, gain, off):
        ratio = _force_off_spring(Observed(self.sinking(gain, deep=slice(3, None)), LINE))
        assert ratio == (pytest.approx(gain) if off else None)

    @pytest.mark.parametrize(("gain", "off"), [(0.24, True), (0.26, False), (5.9, False), (6.1, True)])
    def test_from_what_is_declared(self, gain, off):
        meta = {"spring": "error", "stiffness_least": 0.5, "stiffness_largest": 3.0}
        assert (_force_off_spring(Observed(self.sinking(gain, meta=meta), LINE)) is not None) is off

    @pytest.mark.parametrize(("gain", "ratio"), [(3.0, 2.9), (0.2, 0.3)])
    def test_what_a_damper_may_add_is_taken_off(self, gain, ratio):
        damped = Scene(model=line(), stiffness=1000.0, mass=0.1, damping=2.0)
        # 2 N s/m at 0.1 m/s are a tenth of the spring's 2 N.
        assert _force_off_spring(Observed(self.sinking(gain, speed=0.1), damped)) == pytest.approx(ratio)

    def test_without_a_spring_or_a_contact_none_is_off(self):
        assert _force_off_spring(Observed(self.sinking(3.0, meta={"source": "file"}), LINE)) is None
        assert _force_off_spring(Observed(self.sinking(3.0, deep=slice(0)), LINE)) is None

    def test_a_tool_on_the_surface_has_no_depth_to_tell_it_by(self):
        base = self.sinking(3.0, deep=slice(3, None))
        hip, force = np.array(base.hip), np.array(base.force)
        hip[:2, 1], force[:2, 1] = 0.0, 1.0
        assert _force_off_spring(Observed(changed(base, hip=hip, ihip=np.maximum(hip, 0.0), force=force), LINE)) == (
            pytest.approx(3.0)
        )


@pytest.mark.parametrize(("rows", "tick"), [((5, 6), None), ((5, 6, 7), 6)])
def test_a_constraint_does_not_hold_a_tool_that_is_off_it_without_a_force_for_over_a_tenth_of_the_run(rows, tick):
    held = Scene(model=line(), stiffness=1000.0, mass=0.1, bilateral=True)
    hip = np.column_stack([np.zeros(20), np.full(20, 5e-3)])
    hip[6, 1] += 1e-5
    hip[9, 1] += 2e-5
    base = recorded(hip, hip * [1.0, 0.0])
    force = np.array(base.force)
    force[list(rows)] = 0.0
    assert _unheld_tick(Observed(changed(base, force=force), held)) == tick
    assert _unheld_tick(Observed(changed(base, force=force), LINE)) is None, "nor does one that only pushes have to"


@pytest.mark.parametrize(("depths", "tick"), [(0.9, None), (1.1, 0)])
def test_nor_one_that_is_farther_off_than_the_depth_of_the_least_force(depths, tick):
    held = Scene(model=line(), stiffness=1000.0, mass=0.1, bilateral=True)
    # 5e-6 of 0.2 m: a hand at rest has nothing else to be off by.
    hip = np.tile([0.0, depths * 1e-6], (20, 1))
    assert _unheld_tick(Observed(recorded(hip, hip, 0.0 * hip), held)) == tick


def test_a_strike_lasts_for_as_long_as_an_answer_may_lag():
    bearing = np.array([1, 0, 1, 1, 1, 1, 1, 1, 0, 1], dtype=bool)
    assert np.flatnonzero(_after_strike(bearing)).tolist() == [2, 3, 4, 5, 9]


@pytest.mark.parametrize(("count", "first"), [(24, 4), (25, 14)])
def test_a_contact_is_under_way_once_its_dynamics_have_died_out_where_the_run_is_twice_as_long(count, first):
    """Critically damped, they die out by m: K = m w^2 with w = ln(100) / 10 ms, and the contact begins in row 4."""
    rate = math.log(START_DECAY) / 9.9e-3
    scene = Scene(model=line(), stiffness=0.1 * rate**2, mass=0.1, damping=0.2 * rate)
    base = recorded(np.zeros((count, 2)))
    bearing = np.arange(count) >= 4
    assert np.flatnonzero(_under_way(Observed(base, scene), bearing)).tolist() == list(range(first, count))
    undamped = Scene(model=line(), stiffness=0.1 * rate**2, mass=0.1)
    assert np.flatnonzero(_under_way(Observed(base, undamped), bearing)).tolist() == list(range(4, count))


def test_a_normal_turns_by_the_shape_operator():
    frame = ClosestPoint(*[np.zeros((1, 2))] * 2, np.zeros(1), np.array([[[2.0, 0.0], [0.0, 5.0]]]))
    turning, speed2 = _normal_turning(frame, np.array([[1.0, 2.0]]))
    assert turning[0] == pytest.approx(math.hypot(2.0, 10.0))
    assert speed2[0] == pytest.approx(2.0 + 20.0)


class TestRegression:
    def test_its_columns_are_distance_push_and_cost_as_lengths_of_the_spring(self):
        base = on_circle(12, off=3e-4, push=(0.2, 0.0))
        ticks, error, push, cost, rings, fastest = _regression_terms(Observed(base, ROUND))
        assert ticks.tolist() == list(range(12))
        np.testing.assert_allclose(error, 3e-4)
        np.testing.assert_allclose(push, 0.2 / 50.0)
        # kappa v^2 m / K
        np.testing.assert_allclose(cost, 10.0 * SPEED**2 * 0.1 / 50.0, rtol=1e-2)
        assert rings.shape == (12, 0)
        assert fastest == pytest.approx(TURNING, rel=1e-2)

    def test_of_a_surface_that_only_pushes_what_comes_after_the_strike_counts(self):
        one_sided = Scene(model=circle(), stiffness=50.0, mass=0.1)
        base = on_circle(12, share=2.0, off=-1e-3)
        force = np.array(base.force)
        force[:3] = 0.0
        ticks = _regression_terms(Observed(changed(base, force=force), one_sided))[0]
        assert ticks.tolist() == list(range(7, 12))

    @pytest.mark.parametrize("blocks", [1, 2, 3, 20])
    @pytest.mark.parametrize("pushed", [0.9, 1.1])
    def test_a_share_has_the_error_of_its_residual_counted_in_blocks(self, blocks, pushed):
        count = int(blocks * BLOCK_TICKS)
        cost = np.linspace(1e-3, 2e-3, count)
        wave = np.cos(math.pi * np.arange(count))
        # A push that does not go with the cost, and explains nothing of what is left, as a parabola does.
        bow = np.linspace(-1.0, 1.0, count) ** 2
        push = pushed * EXPLAINING_PUSH * 2e-3 * bow / np.ptp(bow)
        share, deviation = _fit_share(0.3 * cost + 1e-4 + 1e-6 * wave, push, cost, np.zeros((count, 0)))
        assert share == pytest.approx(0.3, abs=1e-3)
        free = max(blocks - (3 if pushed > 1.0 else 2), 1)
        assert deviation == pytest.approx(1e-6 / math.sqrt(np.var(cost) * free), rel=3e-2)

    def test_what_goes_with_another_column_is_not_known(self):
        cost = np.linspace(1e-3, 2e-3, 100)
        share, deviation = _fit_share(0.3 * cost, 2.0 * cost, cost, np.zeros((100, 0)))
        assert deviation == math.inf
        assert math.isfinite(share)

    def test_what_rings_in_several_runs_is_none_of_the_share(self):
        cost = np.linspace(1e-3, 2e-3, 200)
        phase = 0.3 * np.arange(100)
        rings = block_diag(*[np.column_stack([np.cos(phase), np.sin(phase)])] * 2)
        error = 0.3 * cost + rings @ np.array([1e-3, 2e-3, -3e-3, 0.5e-3])
        share, deviation = _fit_share(error, 0.0 * cost, cost, rings)
        assert share == pytest.approx(0.3)
        assert deviation < 1e-9


class TestComingHome:
    @pytest.mark.parametrize(
        ("late", "before", "words"),
        [
            ([-2.01e-3, 2.01e-3], 1e-3, "the distance grows: 1 mm, then 2.01 mm"),
            ([1e-3, 1.0 * 1e-3 * (1.0 - 0.9 * STANDS)], 1e-3, "the tool stands 1 mm off the surface"),
            ([-1e-3, 1.1 * STANDS * 1e-3], 1e-3, "swings about the surface, 1 mm to either side, and is not damped"),
            ([-1e-3, 1e-3], 0.99e-3 / GROWS, "after"),
            ([-1e-3, 0.9 * STANDS * 1e-3], 1e-3, "does not come to the surface: up to 1 mm off, then up to 1 mm"),
        ],
    )
    def test_a_tool_grows_stands_or_swings(self, late, before, words):
        late = np.array(late)
        assert words in _describe_failure(late, before, float(np.abs(late).max()))

    def test_a_run_that_ended_is_told_at_its_last_row(self):
        ended = {"time": 0.004, "what": "the loop ran away"}
        base = recorded(1e-3 * np.arange(10.0).reshape(5, 2), velocity=np.ones((5, 2)), meta={"ended": ended})
        finding = found("constraint-stability", changed(base, meta={"source": "experiment"}), ROUND)
        assert (finding.outcome, finding.evidence["tick"]) == (FAIL, 4)
        assert "ended at t = 0.004 s: the loop ran away" in finding.message


class TestSliding:
    SCENE = Scene(model=line(), stiffness=1000.0, mass=0.1, bilateral=True)

    def sliding(self, viscosity, *, push=0.0, count=400, scene=SCENE):
        """A tool on the line that a viscosity, kg/s, slows from 0.5 m/s, and a push, N, drives on."""
        time = 1e-3 * np.arange(count)
        decay = viscosity / scene.mass
        steady = push / viscosity if viscosity else 0.0
        speed = steady + (0.5 - steady) * np.exp(-decay * time)
        way = np.cumsum(speed) * 1e-3
        hip, still = np.column_stack([way, 0.0 * way]), np.zeros(count)
        pushes = np.column_stack([np.full(count, push), np.full(count, -3.0)])
        return SurfaceMotion(
            Observed(recorded(hip, hip, velocity=np.column_stack([speed, still]), operator_force=pushes), scene)
        )

    @pytest.mark.parametrize("viscosity", [0.0, 0.2])
    @pytest.mark.parametrize("push", [0.0, 0.05])
    def test_the_viscosity_that_explains_the_loss_of_speed_is_found(self, viscosity, push):
        if viscosity or not push:
            assert _apparent_viscosity(self.sliding(viscosity, push=push)) == pytest.approx(viscosity, abs=1e-3)

    def test_what_hand_and_viscosity_explain_is_assigned_and_the_rest_is_not(self):
        viscous = Scene(model=line(), stiffness=1000.0, mass=0.1, bilateral=True, effects=(Viscosity(0.2),))
        motion = self.sliding(0.2, push=0.05, scene=viscous)
        np.testing.assert_allclose(_unexplained_velocity(Observed(motion.base.recording, viscous)), 0.0, atol=1e-6)
        np.testing.assert_allclose(_pushed_along(motion), np.tile([0.5, 0.0], (400, 1)))
        # Without the viscosity what it took since the start is missing, and the push alone is explained.
        unexplained = np.linalg.norm(_unexplained_velocity(Observed(motion.base.recording, self.SCENE)), axis=1)
        lost = 0.5 + 0.5 * motion.base.time - motion.base.velocity[:, 0]
        np.testing.assert_allclose(unexplained, lost, atol=1e-9)

    def test_what_is_unexplained_is_told_as_another_viscosity_or_as_a_drive(self):
        motion = self.sliding(0.2)
        unexplained = _unexplained_velocity(Observed(motion.base.recording, self.SCENE))
        words = _describe_unexplained(motion, unexplained, _apparent_viscosity(motion), 399)
        assert words == ", as if the surface had a viscosity of 0.2 kg/s instead of 0"
        moved = motion.components(motion.foot_velocity)
        for sign, verb in ((1.0, "driven on"), (-1.0, "braked")):
            kicked = np.where(np.arange(400)[:, np.newaxis] > 200, sign * 0.1 * moved / np.abs(moved), 0.0)
            assert _describe_unexplained(motion, kicked, 0.0, 250) == f": by t = 0.25 s the tool is {verb}"
