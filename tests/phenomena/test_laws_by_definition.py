"""Laws that checks compute anew, against derivatives of their energy; angles and reaches, term by term."""

from __future__ import annotations

import math

import numpy as np
import pytest
from made import FAIL, PASS, UNDECIDED, changed, found, recorded

from hapticeval.devices.catalogue import make_device
from hapticeval.devices.device import heaviest_mass
from hapticeval.effects.actuators import JointFriction, Saturation
from hapticeval.effects.reliefs import BumpMap, HeightMap
from hapticeval.geometry.catalogue import line
from hapticeval.phenomena.checks.contact_normal_force import (
    bend_angle,
    least_depth,
    motors_hold_back,
    normal_reach,
    static_balance,
)
from hapticeval.phenomena.lag import delayed
from hapticeval.phenomena.measures.effect_law import EffectLaw, Lags
from hapticeval.phenomena.observed import Observed
from hapticeval.recordings.recording import SINGLE
from hapticeval.scene import Scene

LINE = Scene(model=line(), stiffness=1000.0, mass=0.1)
LOOP = {"source": "experiment"}


def relief_law(effect, hips, *, force=None, bare=None):
    """The law of an effect along HIPs (n, 2), with a recorded force of 3 N along y where none is given."""
    run = recorded(hips, hips * [1.0, 0.0], np.tile([0.0, 3.0], (len(hips), 1)) if force is None else force)
    scene = LINE.with_effects(effect)
    return EffectLaw(effect, Observed(run, scene), None if bare is None else Observed(bare, scene))


def on_waves(along, high=2e-4, long=8e-3):
    """Heights of a sine on the line, whose arc length runs towards negative x, and its slope by x."""
    return -high * np.sin(2.0 * np.pi * along / long), -high * 2.0 * np.pi / long * np.cos(2.0 * np.pi * along / long)


HEIGHTS, BUMPS = (kind(wavelength=8e-3, amplitude=2e-4) for kind in (HeightMap, BumpMap))
PLACES = np.column_stack([np.linspace(0.0, 7e-3, 15), np.full(15, -2e-3)])


def test_without_known_answers_a_height_map_is_that_of_a_spring_to_the_nearest_point():
    """F = K (d + h)(n - grad h) on a line, d = 2 mm."""
    answers = relief_law(HEIGHTS, PLACES).answers(Lags(0.0, 0.0))
    height, slope = on_waves(PLACES[:, 0])
    press = 1000.0 * (2e-3 + height)
    np.testing.assert_allclose(answers.force, np.column_stack([-press * slope, press]), rtol=1e-9)
    np.testing.assert_allclose(answers.ihip, np.column_stack([PLACES[:, 0], height]), atol=1e-15)
    np.testing.assert_allclose(answers.bare_force, np.tile([0.0, 2.0], (15, 1)))
    np.testing.assert_array_equal(answers.bare_ihip, PLACES * [1.0, 0.0])


def test_what_the_renderer_adds_to_its_spring_is_kept():
    damped = recorded(PLACES, PLACES * [1.0, 0.0], np.tile([0.3, 1.8], (15, 1)))
    known, unknown = (relief_law(HEIGHTS, PLACES, bare=bare).answers(Lags(0.0, 0.0)) for bare in (damped, None))
    np.testing.assert_allclose(known.force - unknown.force, np.tile([0.3, -0.2], (15, 1)), atol=1e-12)


@pytest.mark.parametrize("known", [True, False])
def test_a_bump_map_turns_the_normal_force_by_the_slope(known):
    """Where the force without it is not known, it is as large as what is recorded along unit(n - grad h)."""
    _, slope = on_waves(PLACES[:, 0])
    tilted = np.column_stack([-slope, np.ones(15)]) / np.hypot(1.0, slope)[:, np.newaxis]
    bare = recorded(PLACES, PLACES * [1.0, 0.0], np.tile([0.0, 3.0], (15, 1)))
    answers = relief_law(BUMPS, PLACES, force=3.0 * tilted, bare=bare if known else None).answers(Lags(0.0, 0.0))
    np.testing.assert_allclose(answers.force, 3.0 * tilted, atol=1e-12)
    np.testing.assert_allclose(answers.bare_force, bare.force, atol=1e-12)


@pytest.mark.parametrize(("effect", "lags", "seen"), [(HEIGHTS, (2.0, 0.0), 2), (BUMPS, (0.0, 2.0), 2)])
def test_a_law_answers_the_place_of_a_lag(effect, lags, seen):
    bare = recorded(PLACES, PLACES * [1.0, 0.0], np.tile([0.0, 2.0], (15, 1)))
    law = relief_law(effect, PLACES, bare=bare)
    now, late = (law.answers(Lags(*each)) for each in ((0.0, 0.0), lags))
    np.testing.assert_allclose(late.force[seen:], now.force[:-seen], atol=1e-12)


@pytest.mark.parametrize("channel", ["force", "ihip"])
@pytest.mark.parametrize("effect", [HEIGHTS, BUMPS], ids=["heights", "bumps"])
def test_a_hand_elsewhere_changes_no_more_than_the_law_s_steepness_says(effect, channel):
    """By no more than a per cent, and in some direction by a part of it that tells."""
    law = relief_law(effect, PLACES)
    steepness, right = law.steepness(channel, Lags(0.0, 0.0)), getattr(law.answers(Lags(0.0, 0.0)), channel)
    step = 1e-6
    changes = [
        np.linalg.norm(getattr(law.answers(Lags(0.0, 0.0), step * np.array(way)), channel) - right, axis=1) / step
        for way in ((1.0, 0.0), (0.0, -1.0), (0.6, 0.8), (-0.8, 0.6))
    ]
    share = np.max(changes, axis=0) / steepness
    assert share.max() <= 1.01
    assert share.max() > 0.1


class TestNormalForce:
    STEP, COUNT = 1e-4, 20
    ROWS = np.arange(3, 17)

    def slide(self, depth=2e-3, **more):
        along = self.STEP * np.arange(self.COUNT)
        hip = np.column_stack([along, np.full(self.COUNT, -depth)])
        simulated = {"source": "playback", **more.pop("meta", {})}
        return recorded(hip, np.column_stack([along, np.zeros(self.COUNT)]), meta=simulated, **more)

    def test_a_rigid_tool_s_steps_are_as_long_as_velocity_and_force_explain(self):
        hip = np.column_stack([self.STEP * np.arange(self.COUNT), np.zeros(self.COUNT)])
        force = np.tile([0.0, 2.0], (self.COUNT, 1))
        for speed, longest in ((0.11, 1.1e-4), (0.5, self.STEP + 1e-6 * 2.0 / 0.1)):
            velocity = np.tile([speed, 0.0], (self.COUNT, 1))
            tool = recorded(hip, hip, force, velocity=velocity, meta={"source": "experiment"})
            reach = normal_reach(Observed(tool, LINE)) - 4.0 * SINGLE * LINE.model.size
            np.testing.assert_allclose(reach, 3.0 * longest, rtol=1e-6)

    def test_a_path_that_bends_leaves_a_late_force_its_sagitta(self):
        base = self.slide()
        hip = np.array(base.hip)
        hip[10:, 1] -= self.STEP * np.arange(10)  # it bends in row 10
        bent = changed(base, hip=hip)
        assert not bend_angle(bent, self.ROWS, None).any()
        assert not bend_angle(bent, self.ROWS, 0.0).any()
        angles = bend_angle(bent, self.ROWS, 0.5)
        sagitta = self.STEP * np.array([1.0, 0.0])[0] / 8.0
        least = least_depth(bent, self.ROWS)
        expected = [
            math.asin(sagitta / depth) if 10 <= row <= 13 else 0.0 for row, depth in zip(self.ROWS, least, strict=True)
        ]
        np.testing.assert_allclose(angles, expected, rtol=1e-6, atol=1e-15)

    def pressed(self, *, push=2.0, gain=1.0, speed=0.0, drift=0.0, count=500):
        rest = np.zeros((count, 2))
        ihip = rest + np.column_stack([drift * np.arange(count), np.zeros(count)])
        velocity = rest + np.array([0.0, speed])
        force = rest + np.array([0.0, gain * push])
        hip = ihip - np.array([0.0, 2e-3])
        return recorded(hip, ihip, force, meta=LOOP, velocity=velocity, operator_force=rest + np.array([0.1, -push]))

    def test_a_robot_s_momentum_is_that_of_its_heaviest_direction_at_its_largest_speed(self):
        robot = make_device("parallelogram-2dof")
        scene = Scene(model=line(), stiffness=1000.0, mass=1e-3, device=robot)
        base = self.pressed(push=200.0)
        hip = base.hip + np.array([0.0, 0.2])  # where it reaches
        hip[-1, 0] += 0.01
        velocity = np.zeros((500, 2))
        velocity[-50] = [3e-3, 4e-3]
        _, allowed, _ = static_balance(Observed(changed(base, hip=hip, velocity=velocity), scene))
        momentum = heaviest_mass(robot, hip[-1]) * 5e-3
        assert allowed == pytest.approx(2.0 * momentum / (99 * 1e-3) + SINGLE * 200.0)

    def test_motors_hold_back_at_their_limit_and_where_they_rub(self):
        limited = LINE.with_effects(Saturation(limit=2.0))
        torque = np.zeros((500, 2))
        torque[450, 1] = -2.0
        base = changed(self.pressed(), joint_torque=torque)
        assert motors_hold_back(Observed(base, limited), slice(400, 499))
        assert not motors_hold_back(Observed(base, limited), slice(451, 499))
        assert not motors_hold_back(Observed(changed(base, joint_torque=0.99 * torque), limited), slice(400, 499))
        assert not motors_hold_back(Observed(base, LINE), slice(400, 499))
        assert not motors_hold_back(Observed(self.pressed(), limited), slice(400, 499)), "no torque was recorded"
        assert motors_hold_back(Observed(base, LINE.with_effects(JointFriction(torque=0.01))), slice(0, 1))

    def test_at_rest_the_depth_is_that_of_the_last_row(self):
        base = self.pressed()
        hip = np.array(base.hip)
        hip[-1, 1] = -1e-3
        evidence = found("contact-normal-force", changed(base, hip=hip), LINE).evidence
        assert evidence["static_depth_m"] == pytest.approx(1e-3)
        assert evidence["apparent_stiffness_N_m"] == pytest.approx(2.0 / 1e-3)


class TestReliefChannel:
    """Heights of 0.2 mm every 8 mm, crossed 2 mm deep: what is told of a run whose force or IHIP is off by itself."""

    HIP = np.column_stack([1.3e-4 * np.arange(120.0), -2e-3 + 1e-4 * np.sin(0.1 * np.arange(120.0))])

    def judged(self, *, lag=0.0, share=1.0, off=0.0, channel="force", declared=0.0, length="standoff"):
        """A run so late, with so much of the relief, and a channel that is `off` in tick 63."""
        answers = relief_law(HEIGHTS, self.HIP).answers(Lags(0.0, 0.0))
        rows = np.arange(len(self.HIP))
        right = {
            name: delayed(bare + share * (values - bare), rows, lag)
            for name, values, bare in (
                ("ihip", answers.ihip, answers.bare_ihip),
                ("force", answers.force, answers.bare_force),
            )
        }
        right[channel][63, 0] += off
        run = recorded(self.HIP, right["ihip"], right["force"], meta={length: declared})
        return found("texture-relief", run, LINE.with_effects(HEIGHTS))

    @pytest.mark.parametrize("lag", [0.0, 1.0, 3.0])
    @pytest.mark.parametrize(("channel", "off", "unit"), [("force", 0.05, "N"), ("ihip", 2e-5, "m")])
    def test_a_channel_is_held_against_the_law_at_its_lag(self, lag, channel, off, unit):
        assert self.judged(lag=lag).outcome is PASS
        finding = self.judged(lag=lag, channel=channel, off=off)
        assert (finding.outcome, finding.metric.unit) == (FAIL, unit)
        assert finding.metric.value == pytest.approx(off, rel=1e-3)
        assert (finding.evidence["tick"], finding.evidence["lag_ticks"]) == (63, pytest.approx(lag, abs=1e-6))

    def test_between_two_ticks_hand_and_answer_may_be_off_the_straight_way(self):
        late, on_time = self.judged(lag=0.5), self.judged()
        assert late.outcome is PASS
        assert late.evidence["lag_ticks"] == pytest.approx(0.5, abs=1e-2)
        assert late.bound > on_time.bound

    def test_what_is_declared_opens_the_law_by_its_steepness(self):
        """A spring of 1,000 N/m on a relief that is no steeper than 2 pi / 40: at least K, and no more than thrice."""
        widened = self.judged(declared=1e-6).bound - self.judged().bound
        assert 1e-3 < widened < 3e-3

    @pytest.mark.parametrize("length", ["standoff", "resolution"])
    def test_it_is_told_where_a_tenth_of_what_the_relief_adds_is_more_than_what_is_open(self, length):
        assert self.judged(declared=1e-5, length=length).outcome is PASS
        assert self.judged(declared=1e-4, length=length).outcome is UNDECIDED
        never = recorded(np.full((20, 2), 1e-3))
        assert found("texture-relief", never, LINE.with_effects(HEIGHTS)).outcome is UNDECIDED

    @pytest.mark.parametrize("share", [0.0, 0.5, 1.3])
    def test_the_share_is_how_much_of_the_relief_the_channel_shows(self, share):
        finding = self.judged(share=share)
        assert finding.outcome is FAIL
        assert finding.evidence["share"] == pytest.approx(share, abs=1e-9)
