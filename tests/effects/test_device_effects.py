"""Imperfections of a real device in closed loop (thesis 2.6): what the sensors say, and what the motors do."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.parallelogram import ENCODER_STEP, Parallelogram2, Parallelogram3
from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.actuators import Delay
from hapticeval.effects.catalogue import read_effects
from hapticeval.effects.sensors import ForceSensor, low_pass_share
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import line
from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment

DT = 1e-3
ROBOTS = (Parallelogram2(), Parallelogram3())


class Script:
    """Answers forces (n, N) one after the other, and keeps what it is given."""

    def __init__(self, forces):
        self.forces = np.asarray(forces, dtype=float)

    def reset(self, hip):
        self.given, self.felt = [], []

    def observe_force(self, push):
        self.felt.append(push)

    def step(self, hip, velocity, dt):
        self.given.append((hip, velocity))
        return Response(hip, self.forces[min(len(self.given), len(self.forces)) - 1])


def run(forces, device, *, ticks=40, velocity=None, push=None, loop=InnerLoop.STATIC, **effects):
    size = device.dimension
    scene = Scene(model=line(), device=device, inner_loop=loop, effects=read_effects({"imperfections": effects})[1])
    rest = np.zeros(size)
    push = np.zeros((1, size)) if push is None else np.asarray(push, dtype=float)
    times = np.linspace(0.0, ticks * DT, len(push)) if len(push) > 1 else np.zeros(1)
    trial = Experiment((ticks - 1) * DT, rest, rest if velocity is None else np.asarray(velocity), times, push)
    renderer = Script(forces)
    return simulate_closed_loop(renderer, trial, scene, DT), renderer


def noise(seed, ticks, size, scale):
    return scale * np.random.default_rng(seed).standard_normal((ticks, size))


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), robot=st.sampled_from(ROBOTS), step=st.sampled_from([ENCODER_STEP, 1e-3, 0.02]))
def test_an_encoder_is_off_by_half_a_step_at_the_most(seed, robot, step):
    recording, renderer = run(noise(seed, 40, robot.dimension, 2.0), robot, encoder_step=step)
    seen = np.array([robot.joints(hip) for hip in recording.channels["measured_hip"]])
    astray = np.abs(seen - recording.channels["joint_position"])
    assert astray.max() <= 0.5 * step + 1e-13
    np.testing.assert_allclose(seen / step, np.rint(seen / step), atol=1e-12 / step)
    assert np.array_equal(recording.channels["measured_hip"], [hip for hip, _ in renderer.given])


def test_a_filtered_velocity_is_the_low_pass_of_the_differences():
    """Against the recursion written down here, on a point mass that is pushed about; it starts from the truth."""
    recording, renderer = run(noise(1, 40, 2, 2.0), PointMass(0.3), velocity=[0.2, -0.1], velocity_cutoff=60.0)
    share = 1.0 - math.exp(-2.0 * math.pi * 60.0 * DT)
    expected = [np.array([0.2, -0.1])]
    for difference in np.diff(recording.hip, axis=0) / DT:
        expected.append((1.0 - share) * expected[-1] + share * difference)
    np.testing.assert_allclose(recording.channels["measured_velocity"], expected, atol=1e-13)
    assert np.array_equal(recording.channels["measured_velocity"], [velocity for _, velocity in renderer.given])
    assert "measured_hip" not in recording.channels


def test_a_steady_motion_is_measured_as_it_is():
    recording, _ = run(np.zeros((1, 2)), PointMass(0.3), velocity=[0.2, -0.1], velocity_cutoff=5.0)
    np.testing.assert_allclose(recording.channels["measured_velocity"], recording.velocity, atol=1e-13)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), robot=st.sampled_from((*ROBOTS, PointMass(0.3))), limit=st.floats(0.01, 1.0))
def test_motors_never_give_more_than_they_can(seed, robot, limit):
    forces = noise(seed, 40, robot.dimension, 3.0)
    recording, _ = run(forces, robot, torque_limit=limit)
    if "joint_torque" in recording.channels:
        torque = recording.channels["joint_torque"]
        asked = np.array(
            [
                robot.jacobian(q).T @ f
                for q, f in zip(recording.channels["joint_position"], recording.force, strict=True)
            ]
        )
        np.testing.assert_allclose(torque, np.clip(asked, -limit, limit), rtol=1e-13, atol=1e-15)
        assert np.abs(torque).max() <= limit
    else:
        given_, _ = run(np.clip(forces, -limit, limit), robot)
        assert np.array_equal(recording.hip, given_.hip)


@settings(deadline=None, max_examples=30)
@given(
    seed=st.integers(0, 2**32 - 1), ticks=st.integers(1, 12), robot=st.sampled_from((PointMass(0.3), PointMass(0.3, 3)))
)
def test_a_delay_of_whole_ticks_shifts_the_force(seed, ticks, robot):
    forces = noise(seed, 40, robot.dimension, 2.0)
    late, _ = run(forces, robot, delay=ticks * DT)
    shifted, _ = run(np.vstack([np.zeros((ticks, robot.dimension)), forces]), robot)
    assert np.array_equal(late.hip, shifted.hip)
    assert np.array_equal(late.velocity, shifted.velocity)


@pytest.mark.parametrize("ticks", [0.25, 0.999, 1.0, 2.4, 7.5])
def test_a_delay_may_end_within_a_tick(ticks):
    """A constant force that comes after d seconds: y = F (t - d)² / 2 m from then on."""
    recording, _ = run([[2.0, -1.0]], PointMass(0.5), delay=ticks * DT)
    since = np.maximum(recording.time - ticks * DT, 0.0)[:, None]
    np.testing.assert_allclose(recording.hip, np.array([2.0, -1.0]) * since**2 / (2.0 * 0.5), atol=1e-15)
    np.testing.assert_allclose(recording.velocity, np.array([2.0, -1.0]) * since / 0.5, atol=1e-14)


def test_a_robot_under_a_delay_records_the_mean_torque():
    robot = ROBOTS[0]
    recording, _ = run([[1.0, -0.5]], robot, delay=1.25 * DT)
    asked = [robot.jacobian(q).T @ [1.0, -0.5] for q in recording.channels["joint_position"]]
    asked = np.vstack([np.zeros((2, 2)), asked])
    torque = recording.channels["joint_torque"]
    np.testing.assert_allclose(torque, 0.25 * asked[:-2][: len(torque)] + 0.75 * asked[1:-1], atol=1e-15)


@pytest.mark.parametrize(("delay", "whole", "rest"), [(3e-3, 3, 0.0), (0.3e-3, 0, 0.3e-3), (1e-3 - 1e-14, 1, 0.0)])
def test_a_delay_is_split_into_ticks_and_what_is_left(delay, whole, rest):
    np.testing.assert_allclose(Delay(delay).part(40, 2, DT).params, [whole, rest], atol=1e-15)


def test_a_force_sensor_rounds_what_the_hand_does():
    push = noise(3, 41, 2, 1.0)
    recording, renderer = run([[0.0, 0.0]], PointMass(0.3), push=push, force_sensor={"step": 0.05})
    measured = recording.channels["measured_force"]
    assert np.abs(measured - push[:-1]).max() <= 0.025 + 1e-12
    np.testing.assert_allclose(measured / 0.05, np.rint(measured / 0.05), atol=1e-9)
    assert np.array_equal(measured, renderer.felt)


def test_a_force_sensor_s_noise_has_its_size_and_its_seed():
    """The standard deviation of 2 x 2,000 samples is known to 1/sqrt(8,000): five of that are allowed."""

    def measured(seed):
        sensor = {"noise": 0.2, "seed": seed}
        return run([[0.0, 0.0]], PointMass(0.3), ticks=2000, force_sensor=sensor)[0].channels["measured_force"]

    assert abs(measured(0).std() / 0.2 - 1.0) < 5.0 / math.sqrt(8000.0)
    assert np.array_equal(measured(0), measured(0))
    assert not np.array_equal(measured(0), measured(1))


def test_a_force_sensor_s_low_pass_follows_a_step():
    """From 0 to 1 N at the second sample: 1 - (1 - share)^k."""
    push = np.zeros((41, 2))
    push[1:] = 1.0
    recording, _ = run([[0.0, 0.0]], PointMass(0.3), push=push, force_sensor={"cutoff": 50.0})
    share = 1.0 - math.exp(-2.0 * math.pi * 50.0 * DT)
    expected = 1.0 - (1.0 - share) ** np.arange(40)
    np.testing.assert_allclose(recording.channels["measured_force"][:, 0], expected, atol=1e-13)


def test_a_measured_hand_moves_the_virtual_tool_s_mass():
    """(8.8) in closed loop: without a sensor the hand feels the robot, with one a mass of 0.1 kg, but for sampling."""
    robot, push = ROBOTS[0], np.array([[1.0, 0.5]])
    expected = push[0] * 0.039**2 / (2.0 * 0.1)
    ideal, _ = run([[0.0, 0.0]], robot, push=push, loop=InnerLoop.LINEARISED)
    shaped, _ = run([[0.0, 0.0]], robot, push=push, loop=InnerLoop.LINEARISED, force_sensor={})
    assert np.abs(shaped.hip[-1] - expected).max() < 0.01 * np.abs(expected).max()
    assert np.abs(ideal.hip[-1] - expected).max() > 0.3 * np.abs(expected).max()


@pytest.mark.parametrize("robot", [*ROBOTS, PointMass(0.3)], ids=lambda robot: f"{robot.name}{robot.dimension}")
def test_an_effect_that_changes_nothing_leaves_the_same_numbers(robot):
    """Motors that could do more than they are asked, and a sensor that no one heeds: the compiled code is another."""
    forces = noise(7, 40, robot.dimension, 1.0)
    ideal, _ = run(forces, robot)
    idle, _ = run(forces, robot, torque_limit=1e9, force_sensor={})
    for name, values in ideal.channels.items():
        assert np.array_equal(values, idle.channels[name]), name


def test_nothing_is_measured_where_sensors_are_exact():
    recording, renderer = run(noise(5, 40, 2, 1.0), ROBOTS[0])
    assert not [name for name in recording.channels if name.startswith("measured")]
    assert np.array_equal(recording.hip, [hip for hip, _ in renderer.given])
    assert renderer.felt == []


@pytest.mark.parametrize("cutoff", [1e-3, 50.0, math.inf])
def test_a_low_pass_takes_a_share_of_the_new(cutoff):
    assert low_pass_share(cutoff, DT) == pytest.approx(1.0 - math.exp(-2.0 * math.pi * cutoff * DT), rel=1e-9)


@pytest.mark.parametrize(
    "wrong",
    [{"step": -1.0}, {"noise": math.nan}, {"cutoff": 0.0}, {"cutoff": math.nan}, {"noise": math.inf}],
)
def test_a_force_sensor_that_cannot_be_is_refused(refused, wrong):
    with refused(InputError):
        ForceSensor(**wrong)
