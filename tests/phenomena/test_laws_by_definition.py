"""Laws that checks compute anew, against derivatives of their energy; angles and reaches, term by term."""

from __future__ import annotations

import math

import numpy as np
import pytest
from made import changed, found, recorded

from hapticeval.devices.catalogue import make_device
from hapticeval.devices.device import heaviest_mass
from hapticeval.effects.actuators import JointFriction, Saturation
from hapticeval.effects.reliefs import BumpMap, HeightMap
from hapticeval.geometry.catalogue import circle, line, sphere
from hapticeval.phenomena.checks.contact_normal_force import (
    StaticBalance,
    _angles,
    _bend_angle,
    _error_vector_angles,
    _force_deviation,
    _least_depth,
    _motors_hold_back,
    _normal_reach,
    _resolution_angle,
    _rounding_angle,
    _tilt_angle,
    static_balance,
)
from hapticeval.phenomena.checks.texture_relief import (
    ReliefAnswer,
    Waves,
    _compare_channel,
    bump_map_answer,
    height_map_answer,
)
from hapticeval.phenomena.observed import Observed
from hapticeval.recordings.recording import SINGLE
from hapticeval.scene import Scene

LINE = Scene(model=line(), stiffness=1000.0, mass=0.1)
LOOP = {"source": "experiment"}
PROFILE = tuple(2e-4 * x for x in (0.0, 1.0, 0.4, -0.8))
RELIEFS = [{"amplitude": 2e-4}, {"profile": PROFILE}]


def relief_scene(model, kind, **shape):
    effect = kind(wavelength=8e-3, **shape, **({"direction": (1.0, 0.5, 0.0)} if model.dimension == 3 else {}))
    return Scene(model=model, stiffness=1000.0, effects=(effect,)), effect


def hips_under(model, depth=2e-3, count=12):
    random = np.random.default_rng(3)
    if model.dimension == 3:
        out = random.standard_normal((count, 3))
        out /= np.linalg.norm(out, axis=1)[:, np.newaxis]
    else:
        angle = random.uniform(0.0, 2.0 * np.pi, count)
        out = np.column_stack([np.cos(angle), np.sin(angle)])
    return (0.1 - depth) * out


@pytest.mark.parametrize("shape", RELIEFS, ids=["sine", "profile"])
@pytest.mark.parametrize("model", [circle(size=0.2), sphere(size=0.2)], ids=["plane", "space"])
def test_a_height_map_s_force_is_the_gradient_of_its_energy(model, shape):
    scene, effect = relief_scene(model, HeightMap, **shape)
    waves, hips = Waves(effect, scene), hips_under(model)

    def energy(points):
        frame = model.boundary.closest_point(points)
        height, _ = waves.over(points, frame.foot, frame.normal)
        return 0.5 * scene.stiffness * np.maximum(height - frame.distance, 0.0) ** 2

    answer = height_map_answer(waves, scene, hips, None)
    step = 1e-7
    ways = step * np.eye(model.dimension)
    slopes = np.column_stack([(energy(hips + way) - energy(hips - way)) / (2.0 * step) for way in ways])
    np.testing.assert_allclose(answer.force, -slopes, rtol=1e-4, atol=1e-4)
    frame = model.boundary.closest_point(hips)
    height, _ = waves.over(hips, frame.foot, frame.normal)
    np.testing.assert_allclose(answer.ihip, frame.foot + height[:, np.newaxis] * frame.normal)
    np.testing.assert_allclose(answer.bare_force, -1000.0 * frame.distance[:, np.newaxis] * frame.normal)
    np.testing.assert_allclose(answer.bare_ihip, frame.foot)
    # A HIP a little elsewhere changes force and IHIP by no more than is said, and by a part of it that tells.
    for what, most in (("force", answer.stiff()), ("ihip", answer.moving())):
        changes = [
            np.linalg.norm(
                getattr(height_map_answer(waves, scene, hips + way, None), what) - getattr(answer, what), axis=1
            )
            for way in ways
        ]
        share = np.max(changes, axis=0) / step / most
        assert share.max() <= 1.001
        assert share.max() > 0.2


@pytest.mark.parametrize("shape", RELIEFS, ids=["sine", "profile"])
def test_slope_and_bend_of_a_relief_are_its_largest(shape):
    scene, effect = relief_scene(circle(size=0.2), HeightMap, **shape)
    waves = Waves(effect, scene)
    assert waves.wave == pytest.approx(math.pi * 0.2 / round(math.pi * 0.2 / 8e-3)), "a whole number closes up"
    at = np.linspace(0.0, waves.wave, 4001)
    slope, bend = np.gradient(waves.height(at), at), np.gradient(waves.rise(at), at)
    np.testing.assert_allclose(slope[2:-2], waves.rise(at)[2:-2], atol=1e-3 * np.abs(slope).max())
    assert np.abs(bend[2:-2]).max() == pytest.approx(waves.bend, rel=0.01)
    assert np.abs(slope).max() <= waves.steep * 1.001
    if "amplitude" in shape:
        assert np.abs(slope).max() == pytest.approx(waves.steep, rel=1e-3)
    assert waves.height(0.0) == pytest.approx(waves.height(waves.wave), abs=1e-12)


def test_a_hand_above_the_relief_is_free_and_what_is_beside_the_spring_is_kept():
    scene, effect = relief_scene(line(), HeightMap, amplitude=2e-4)
    waves = Waves(effect, scene)
    along = np.column_stack([np.linspace(0.0, 8e-3, 801), np.zeros(801)])
    height, _ = waves.over(along, along, np.tile([0.0, 1.0], (801, 1)))
    crest, trough = along[np.argmax(height)], along[np.argmin(height)]
    above = np.array([[0.0, 1.9e-4], [0.0, 2.1e-4], [0.0, -1.9e-4], [0.0, -2.1e-4]])
    hips = np.array([crest, crest, trough, trough]) + above
    answer = height_map_answer(waves, scene, hips, None)
    assert (answer.force[:, 1] > 0.0).tolist() == [True, False, False, True]
    np.testing.assert_array_equal(answer.ihip[[1, 2]], hips[[1, 2]])
    assert np.any(answer.bare_force != 0.0, axis=1).tolist() == [False, False, True, True]
    damper = np.array([[0.3, -0.2]])
    deep = np.array([[1e-3, -2e-3]])
    damped = height_map_answer(Waves(effect, scene), scene, deep, np.array([[0.0, 2.0]]) + damper)
    bare = height_map_answer(Waves(effect, scene), scene, deep, None)
    np.testing.assert_allclose(damped.force - bare.force, damper, atol=1e-12)


@pytest.mark.parametrize("known", [True, False])
def test_a_bump_map_turns_the_normal_force_by_the_slope(known):
    scene, effect = relief_scene(circle(size=0.2), BumpMap, amplitude=2e-4)
    waves = Waves(effect, scene)
    feet = hips_under(scene.model, depth=0.0)
    frame = scene.model.boundary.closest_point(feet)
    _, gradient = waves.over(feet, frame.foot, frame.normal)
    tilted = (frame.normal - gradient) / np.linalg.norm(frame.normal - gradient, axis=1)[:, np.newaxis]
    forces = 3.0 * frame.normal
    answer = bump_map_answer(waves, feet, forces if known else None, 3.0 * tilted)
    np.testing.assert_allclose(answer.force, 3.0 * tilted, atol=1e-12)
    np.testing.assert_allclose(answer.bare_force, forces, atol=1e-12)
    np.testing.assert_allclose(answer.stiff(), 3.0 * (waves.bend + 10.0), rtol=1e-6)
    np.testing.assert_array_equal(answer.moving(), 1.0)
    np.testing.assert_allclose(np.degrees(np.arccos(np.sum(tilted * frame.normal, axis=1))),
                               np.degrees(np.arctan(np.linalg.norm(gradient, axis=1))), atol=1e-6)  # fmt: skip


class TestNormalForce:
    STEP, COUNT = 1e-4, 20
    ROWS = np.arange(3, 17)

    def slide(self, depth=2e-3, **more):
        along = self.STEP * np.arange(self.COUNT)
        hip = np.column_stack([along, np.full(self.COUNT, -depth)])
        simulated = {"source": "playback", **more.pop("meta", {})}
        return recorded(hip, np.column_stack([along, np.zeros(self.COUNT)]), meta=simulated, **more)

    def test_a_normal_is_looked_for_within_three_steps_of_the_tool_the_standoff_and_rounding(self):
        rounding = 4.0 * SINGLE * LINE.model.size
        np.testing.assert_allclose(_normal_reach(Observed(self.slide(), LINE)), 3.0 * self.STEP + rounding)
        off = self.slide(meta={"standoff": 5e-4})
        np.testing.assert_allclose(_normal_reach(Observed(off, LINE)), 3.0 * self.STEP + rounding + 5e-4)
        # On a ramp a log's step is the ramp's.
        logged = _normal_reach(Observed(self.slide(meta={"source": "log"}), LINE))
        np.testing.assert_allclose(logged, 4.0 * self.STEP + rounding)
        ihip = np.array(self.slide().ihip)
        ihip[10:, 0] += self.STEP  # one step is twice as long: three ticks to either side see it
        reach = _normal_reach(Observed(changed(self.slide(), ihip=ihip), LINE)) - rounding
        np.testing.assert_allclose(reach, [3.0 * self.STEP * (2.0 if 7 <= row <= 13 else 1.0) for row in range(20)])

    def test_a_rigid_tool_s_steps_are_as_long_as_velocity_and_force_explain(self):
        hip = np.column_stack([self.STEP * np.arange(self.COUNT), np.zeros(self.COUNT)])
        force = np.tile([0.0, 2.0], (self.COUNT, 1))
        for speed, longest in ((0.11, 1.1e-4), (0.5, self.STEP + 1e-6 * 2.0 / 0.1)):
            velocity = np.tile([speed, 0.0], (self.COUNT, 1))
            tool = recorded(hip, hip, force, velocity=velocity, meta={"source": "experiment"})
            reach = _normal_reach(Observed(tool, LINE)) - 4.0 * SINGLE * LINE.model.size
            np.testing.assert_allclose(reach, 3.0 * longest, rtol=1e-6)

    def test_the_least_depth_within_a_lag_counts_and_a_row_without_one_does_not(self):
        base = self.slide()
        hip = np.array(base.hip)
        hip[8, 1], hip[12, 1] = -1e-3, 0.0
        depths = _least_depth(changed(base, hip=hip), np.arange(20))
        assert depths.tolist() == [1e-3 if 8 <= row <= 11 else 2e-3 for row in range(20)]
        rigid = changed(base, hip=base.ihip)
        assert not _least_depth(rigid, np.arange(20)).any()
        np.testing.assert_allclose(_tilt_angle(base, self.ROWS, 1e-3), math.asin(0.5))
        np.testing.assert_allclose(_tilt_angle(base, self.ROWS, 5e-3), 0.5 * math.pi)
        assert not _tilt_angle(rigid, self.ROWS, 1e-3).any()

    def test_rounding_and_resolution_tilt_a_spring_by_their_share_of_the_depth(self):
        simulated = {"source": "playback"}
        base = self.slide(meta=simulated)
        rounded = 1e-6 + 4.0 * SINGLE * LINE.model.size / 2e-3
        np.testing.assert_allclose(_rounding_angle(Observed(base, LINE), self.ROWS), rounded, rtol=1e-6)
        for declared, counts in ((5e-5, 5e-5), (1e-2, self.STEP)):
            coarse = self.slide(meta={**simulated, "resolution": declared})
            tilt = math.asin(counts / 2e-3)
            np.testing.assert_allclose(_resolution_angle(Observed(coarse, LINE), self.ROWS), tilt, rtol=1e-6)
            np.testing.assert_allclose(_rounding_angle(Observed(coarse, LINE), self.ROWS), rounded + tilt, rtol=1e-6)
        rigid = changed(base, hip=base.ihip, force=np.tile([0.0, 2.0], (20, 1)))
        np.testing.assert_allclose(_rounding_angle(Observed(rigid, LINE), self.ROWS), 1e-6 + 4.0 * SINGLE)

    def test_a_log_s_force_is_off_by_half_a_step_in_each_component(self):
        step = 0.02
        random = np.random.default_rng(1)
        force = step * np.column_stack([random.integers(0, 9, 3000), random.integers(90, 110, 3000)])
        hip = np.column_stack([self.STEP * np.arange(3000), np.full(3000, -2e-3)])
        logged = recorded(hip, hip * [1.0, 0.0], force)
        simulated = changed(logged, meta={"source": "playback"})
        rows = np.arange(3, 2990)
        added = _rounding_angle(Observed(logged, LINE), rows) - _rounding_angle(Observed(simulated, LINE), rows)
        size = np.linalg.norm(force[rows], axis=1)
        np.testing.assert_allclose(added, np.arcsin(0.5 * step * math.sqrt(2.0) / size), rtol=1e-6)

    def test_a_path_that_bends_leaves_a_late_force_its_sagitta(self):
        base = self.slide()
        hip = np.array(base.hip)
        hip[10:, 1] -= self.STEP * np.arange(10)  # it bends in row 10
        bent = changed(base, hip=hip)
        assert not _bend_angle(bent, self.ROWS, None).any()
        assert not _bend_angle(bent, self.ROWS, 0.0).any()
        angles = _bend_angle(bent, self.ROWS, 0.5)
        sagitta = self.STEP * np.array([1.0, 0.0])[0] / 8.0
        least = _least_depth(bent, self.ROWS)
        expected = [
            math.asin(sagitta / depth) if 10 <= row <= 13 else 0.0 for row, depth in zip(self.ROWS, least, strict=True)
        ]
        np.testing.assert_allclose(angles, expected, rtol=1e-6, atol=1e-15)

    def test_a_force_is_drawn_to_the_hip_of_the_lag(self):
        base = self.slide()
        late = changed(base, ihip=base.ihip - np.array([2.0 * self.STEP, 0.0]))
        springs = changed(late, force=1000.0 * (late.ihip - late.hip))
        angle = LINE.model.boundary.normal_cone(springs.ihip[self.ROWS], np.zeros(self.ROWS.size))
        leans = math.atan(2.0 * self.STEP / 2e-3)
        np.testing.assert_allclose(_force_deviation(Observed(springs, LINE), self.ROWS, angle, None), leans, rtol=1e-6)
        np.testing.assert_allclose(_force_deviation(Observed(springs, LINE), self.ROWS, angle, 2.0), 0.0, atol=2e-3)
        downwards = np.tile([0.1, -1.0], (self.ROWS.size, 1))
        assert _angles(downwards, LINE, angle)[0] == pytest.approx(math.pi - math.atan(0.1))
        held = Scene(model=line(), stiffness=1000.0, bilateral=True)
        assert _angles(downwards, held, angle)[0] == pytest.approx(math.atan(0.1))
        leaning = _error_vector_angles(springs, self.ROWS, angle)
        assert leaning["error_vector_angle_median_deg"] == pytest.approx(math.degrees(leans))

    def pressed(self, *, push=2.0, gain=1.0, speed=0.0, drift=0.0, count=500):
        rest = np.zeros((count, 2))
        ihip = rest + np.column_stack([drift * np.arange(count), np.zeros(count)])
        velocity = rest + np.array([0.0, speed])
        force = rest + np.array([0.0, gain * push])
        hip = ihip - np.array([0.0, 2e-3])
        return recorded(hip, ihip, force, meta=LOOP, velocity=velocity, operator_force=rest + np.array([0.1, -push]))

    def test_at_rest_the_force_is_compared_with_the_push_within_the_momentum_s_share(self):
        difference, allowed, push = static_balance(Observed(self.pressed(gain=1.2), LINE))
        assert (difference, push) == (pytest.approx(0.4), pytest.approx(2.0))
        assert allowed == pytest.approx(SINGLE * 2.0)
        speed = 5e-3
        _, allowed, _ = static_balance(Observed(self.pressed(speed=speed), LINE))
        assert allowed == pytest.approx(2.0 * 0.1 * speed / (99 * 1e-3) + SINGLE * 2.0)
        fast = 1.01 * 0.1 * 2.0 * 99e-3 / (2.0 * 0.1)
        assert "momentum may make a tenth" in static_balance(Observed(self.pressed(speed=fast), LINE)).reason
        assert isinstance(static_balance(Observed(self.pressed(speed=0.97 * fast), LINE)), StaticBalance)
        assert "not at rest" in static_balance(Observed(self.pressed(drift=1e-4), LINE)).reason
        assert "does not push" in static_balance(Observed(self.pressed(push=-2.0), LINE)).reason
        held = Scene(model=line(), stiffness=1000.0, mass=0.1, bilateral=True)
        assert static_balance(Observed(self.pressed(), held)).reason == ""
        assert static_balance(Observed(self.pressed(count=1), LINE)).reason == ""

    @pytest.mark.parametrize(("drift", "rests"), [(1.03e-5, True), (1.05e-5, False)])
    def test_a_tool_that_stands_off_is_at_rest_within_three_steps_and_the_standoff(self, drift, rests):
        """Over 100 rows it drifts by 99 steps, of which 96 have to be within the millimetre that it stands off by."""
        base = self.pressed(drift=drift)
        off = changed(base, ihip=base.ihip + np.array([0.0, 1e-3]), meta={"standoff": 1e-3})
        assert isinstance(static_balance(Observed(off, LINE)), StaticBalance) is rests

    def test_force_and_push_are_taken_along_the_normal_where_the_tool_ends(self):
        round_scene = Scene(model=circle(size=0.2), stiffness=1000.0, mass=0.1)
        angle = np.where(np.arange(50) < 49, 0.0, 0.01)  # the last step is within what counts as one place
        out = np.column_stack([np.cos(angle), np.sin(angle)])
        push = np.tile([-2.0, 0.0], (50, 1))
        base = recorded(0.098 * out, 0.1 * out, -1.1 * push, meta=LOOP, velocity=0.0 * out, operator_force=push)
        difference, _, pushed = static_balance(Observed(base, round_scene))
        assert pushed == pytest.approx(2.0 * math.cos(0.01), rel=1e-9)
        assert difference == pytest.approx(0.2 * math.cos(0.01), rel=1e-9)

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
        assert _motors_hold_back(Observed(base, limited), slice(400, 499))
        assert not _motors_hold_back(Observed(base, limited), slice(451, 499))
        assert not _motors_hold_back(Observed(changed(base, joint_torque=0.99 * torque), limited), slice(400, 499))
        assert not _motors_hold_back(Observed(base, LINE), slice(400, 499))
        assert not _motors_hold_back(Observed(self.pressed(), limited), slice(400, 499)), "no torque was recorded"
        assert _motors_hold_back(Observed(base, LINE.with_effects(JointFriction(torque=0.01))), slice(0, 1))

    def test_at_rest_the_depth_is_that_of_the_last_row(self):
        base = self.pressed()
        hip = np.array(base.hip)
        hip[-1, 1] = -1e-3
        evidence = found("contact-normal-force", changed(base, hip=hip), LINE).evidence
        assert evidence["static_depth_m"] == pytest.approx(1e-3)
        assert evidence["apparent_stiffness_N_m"] == pytest.approx(2.0 / 1e-3)

    def test_a_path_that_bends_after_its_first_row_leaves_that_row_nothing(self):
        base = self.slide()
        hip = np.array(base.hip)
        hip[2:, 1] -= self.STEP
        angles = _bend_angle(changed(base, hip=hip), np.arange(4), 0.5)
        assert angles[0] == 0.0
        assert np.all(angles[1:] > 0.0)


class TestReliefChannel:
    """A law of waves of 0.5 N over 1 N, as a function of a lag, and of 0.2 mm over the line."""

    ROWS = np.arange(3, 60)

    def felt(self, lag):
        wave = np.sin(0.2 * (self.ROWS - lag))[:, np.newaxis] * np.array([0.0, 1.0])
        force, ihip = np.tile([0.0, 1.0], (57, 1)), np.zeros((57, 2))
        stiff, moving = (lambda: np.full(57, 2000.0)), (lambda: np.full(57, 0.5))
        return ReliefAnswer(force + 0.5 * wave, ihip + 2e-4 * wave, force, ihip, stiff, moving)

    def compared(self, lag, channel="force", *, off=0.0, doubt=1e-6, turns=False):
        along = 1e-4 * np.arange(60.0)
        hip = np.column_stack([along, np.full(60, -1e-3)])
        hip[40:, 1] += 1e-5 * np.arange(20)  # it bends in row 40
        answer = self.felt(lag)
        values = {name: np.vstack([np.zeros((3, 2)), getattr(answer, name)]) for name in ("force", "ihip")}
        values[channel][23, 0] += off
        base = recorded(hip, values["ihip"], values["force"])
        return _compare_channel(
            self.felt, Observed(base, LINE), self.ROWS, np.full(57, doubt), channel, 2e-4, turns_answers=turns
        )

    @pytest.mark.parametrize("lag", [0.0, 1.0, 3.0])
    @pytest.mark.parametrize(("channel", "off", "moves"), [("force", 0.05, 2000.0), ("ihip", 2e-5, 0.5)])
    def test_a_channel_is_held_against_the_law_at_its_lag(self, lag, channel, off, moves):
        deviation = self.compared(lag, channel, off=off)
        assert (deviation.channel, deviation.tick, deviation.lag) == (channel, 23, pytest.approx(lag, abs=1e-6))
        assert deviation.off == pytest.approx(off, rel=1e-3)
        size = np.linalg.norm(getattr(self.felt(lag), channel)[20])
        rounded = SINGLE * (size + (1000.0 if channel == "force" else 1.0) * 1e-4 * 59)
        assert deviation.allowed == pytest.approx(moves * 1e-6 + 4.0 * rounded, rel=1e-3)
        assert deviation.share == pytest.approx(1.0)

    def test_between_two_ticks_hand_and_answer_may_be_off_the_straight_way(self):
        deviation = self.compared(0.5, off=0.05)
        bends = 0.5 * 0.5 * np.abs(np.diff(np.sin(0.2 * (self.ROWS - 0.5)), n=2))
        near = bends[max(20 - 4, 0) : 20 + 3].max()  # within a lag of row 23 of the law
        assert deviation.lag == pytest.approx(0.5)
        assert deviation.allowed == pytest.approx(2000.0 * 1e-6 + near, rel=0.02)
        assert self.compared(0.5, doubt=1e-5).allowed > 2e-2

    @pytest.mark.parametrize("lag", [-2.0, 2.0])
    def test_an_ihip_may_be_recorded_later_than_the_force_that_is_made_of_it(self, lag):
        assert self.compared(lag, turns=True).lag == pytest.approx(lag)
        assert self.compared(abs(lag)).lag == pytest.approx(abs(lag))

    @pytest.mark.parametrize(("doubt", "told"), [(2.4e-5, True), (2.6e-5, False)])
    def test_it_is_told_where_a_tenth_of_what_the_relief_adds_is_more_than_what_is_open(self, doubt, told):
        assert (self.compared(0.0, doubt=doubt) is not None) is told

    @pytest.mark.parametrize("share", [0.0, 0.5, 1.3])
    def test_the_share_is_how_much_of_the_relief_the_channel_shows(self, share):
        answer = self.felt(0.0)
        force = np.vstack([np.zeros((3, 2)), answer.bare_force + share * (answer.force - answer.bare_force)])
        hip = np.column_stack([1e-4 * np.arange(60.0), np.full(60, -1e-3)])
        base = recorded(hip, 0.0 * hip, force)
        deviation = _compare_channel(
            self.felt, Observed(base, LINE), self.ROWS, np.full(57, 1e-6), "force", 2e-4, turns_answers=False
        )
        assert deviation.share == pytest.approx(share, abs=1e-9)
        assert deviation.off == pytest.approx(abs(1.0 - share) * 0.5, rel=1e-2)
