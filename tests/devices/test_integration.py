"""How a device moves between samples: orders, accuracy, and friction against closed forms and scipy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hapticeval.devices.integration import control, default_method
from hapticeval.devices.motion_kernels import Load, advance, motion_of
from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
from hapticeval.devices.point_mass import PointMass
from hapticeval.examples.studies.integrators import (
    METHODS,
    TARGET,
    IntegrationBenchmark,
    Integrator,
    advance_reference,
    integration_benchmark,
    relative_errors,
)

DT = 1e-3
ROBOTS = (Parallelogram2(), Parallelogram3())


@pytest.mark.parametrize("name", METHODS)
def test_a_method_has_its_order(name):
    """The error of equal steps falls as h^p; p is read off a range where rounding does not show."""
    method = METHODS[name]()
    task = integration_benchmark(Parallelogram3(), ticks=4, dt=20e-3)
    astray = []
    counts = (1, 2) if method.order == 8 else (4, 8)
    for substeps in counts:
        states, steps = Integrator(task, method, np.array([0.0, 0.0, float(substeps)]))(afresh=True)
        assert steps == 4 * substeps
        astray.append(np.abs(states - task.states)[2:].max())
    assert math.log2(astray[0] / astray[1]) == pytest.approx(method.order, abs=0.6)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), robot=st.sampled_from(ROBOTS))
def test_the_default_keeps_its_promise_between_samples(seed, robot):
    """A tick from a state, torque and hand of any size that a robot may see, against scipy's DOP853 at its tightest."""
    rng = np.random.default_rng(seed)
    size = robot.dimension
    joints = rng.uniform(-0.45, 0.45, size)
    rates = rng.standard_normal(size) * 10.0 ** rng.uniform(-2, 1)
    torque = rng.standard_normal(size) * 10.0 ** rng.uniform(-2, 1)
    grip = np.array([10.0 ** rng.uniform(0, 3.3), 10.0 ** rng.uniform(-1, 1.3)])
    path = robot.position(joints) + 5e-3 * rng.standard_normal((2, size))
    start = np.concatenate([joints, rates])
    task = IntegrationBenchmark(
        robot, DT, torque[None], path, grip, np.vstack([start, advance_reference(robot, start, torque, path, grip, DT)])
    )
    method = default_method()
    states, _ = Integrator(task, method, control(method))(afresh=True)
    assert relative_errors(states, task.states)[0] < TARGET


def test_the_default_keeps_its_promise_along_a_motion():
    for robot in ROBOTS:
        task = integration_benchmark(robot, ticks=60)
        method = default_method()
        states, _ = Integrator(task, method, control(method))(afresh=True)
        assert relative_errors(states, task.states).max() < TARGET


class Tick:
    """One tick of a device with friction, and without a hand."""

    def __init__(self, device, friction, torque, push=None, dt=DT):
        self.dt, self.torque = dt, np.array(torque, dtype=float)
        push = np.zeros((2, device.dimension)) if push is None else push
        self.motion = motion_of(device, Load(dt, push, None, np.array(friction, dtype=float)), default_method())

    def __call__(self, joints, rates):
        joints, rates = np.array(joints, dtype=float), np.array(rates, dtype=float)
        assert advance(self.motion, 0, 0.0, self.dt, joints, rates, self.torque) > 0
        return joints, rates


def test_friction_stops_a_sliding_mass_where_it_must():
    """m = 0.1 kg at 2e-3 m/s against 0.4 N: at rest after m v / f = 0.5 ms, v²m/2f = 0.5 um further on."""
    joints, rates = Tick(PointMass(0.1), [0.4, 0.4], [0.0, 0.0])([0.0, 0.0], [2e-3, 0.0])
    np.testing.assert_allclose(joints, [0.5e-6, 0.0], rtol=1e-9, atol=1e-18)
    assert np.array_equal(rates, [0.0, 0.0])


def test_friction_holds_what_it_can():
    joints, rates = Tick(PointMass(0.1), [0.4, 0.4], [0.39, -0.4])([0.01, 0.02], [0.0, 0.0])
    assert np.array_equal(joints, [0.01, 0.02])
    assert np.array_equal(rates, [0.0, 0.0])


def test_a_mass_breaks_loose_when_the_push_exceeds_friction():
    """A push of 1 N t/T exceeds 0.4 N at 0.4 T; from there on x'' = (1 N / T)(t - 0.4 T) / m: a cubic."""
    push = np.array([[0.0, 0.0], [1.0, -1.0]])
    joints, rates = Tick(PointMass(0.1), [0.4, 0.4], [0.0, 0.0], push)([0.0, 0.0], [0.0, 0.0])
    left = 0.6 * DT
    np.testing.assert_allclose(joints, np.array([1.0, -1.0]) / (0.1 * DT) * left**3 / 6.0, rtol=1e-9)
    np.testing.assert_allclose(rates, np.array([1.0, -1.0]) / (0.1 * DT) * left**2 / 2.0, rtol=1e-9)


def test_a_pushed_mass_turns_round_without_resting():
    """Against 1 N and friction of 0.4 N it stops at m v / 1.4 N, and comes back with 0.6 N at once."""
    mass, speed = 0.1, 7e-3
    joints, rates = Tick(PointMass(mass), [0.4, 0.4], [-1.0, 0.0])([0.0, 0.0], [speed, 0.0])
    stop = mass * speed / 1.4
    left = DT - stop
    np.testing.assert_allclose(joints[0], 0.5 * speed * stop - 0.5 * 0.6 / mass * left**2, rtol=1e-9)
    np.testing.assert_allclose(rates[0], -0.6 / mass * left, rtol=1e-9)


def piecewise(device, joints, rates, friction, torque, push, dt):
    """The same tick by scipy: smooth pieces, each ended by scipy's own root finder; joints decouple at rest."""
    time, state, size = 0.0, np.concatenate([joints, rates]), device.dimension

    def net(t, y):
        q, v = y[:size], y[size:]
        force = push[0] + t / dt * (push[1] - push[0])
        return torque + device.jacobian(q).T @ force - device.bias(q, v)

    while time < dt:
        signs = np.sign(state[size:])
        still = (signs == 0.0) & (np.abs(net(time, state)) <= friction)
        signs = np.where(signs == 0.0, np.sign(net(time, state)), signs)

        def slope(t, y, signs=signs, still=still):
            drive = np.where(still, 0.0, net(t, y) - signs * friction)
            return np.concatenate([y[size:], np.linalg.solve(device.inertia(y[:size]), drive)])

        def event(i, signs=signs, still=still, since=time):
            def found(t, y):
                if still[i]:
                    return friction - abs(net(t, y)[i])
                return 1.0 if t == since else signs[i] * y[size + i]

            found.terminal = True
            found.direction = -1.0
            return found

        run = solve_ivp(
            slope, (time, dt), state, method="DOP853", rtol=3e-14, atol=1e-16, max_step=dt / 50,
            events=[event(i) for i in range(size)],
        )  # fmt: skip
        time, state = run.t[-1], run.y[:, -1].copy()
        for i in range(size):
            if len(run.t_events[i]):
                if still[i]:
                    time, state = np.nextafter(time, 1.0), state  # beyond the edge, where it no longer holds
                    state[size + i] = 1e-18 * np.sign(net(time, state)[i])
                else:
                    state[size + i] = 0.0
    return state[:size], state[size:]


@pytest.mark.parametrize("seed", range(30))
def test_a_robot_with_friction_moves_as_scipy_says_piece_by_piece(seed):
    """Rates so small and pushes so large that in 5 ms joints stop, break loose and turn round."""
    rng = np.random.default_rng(seed)
    device = ROBOTS[seed % 2]
    size, dt = device.dimension, 5e-3
    joints = rng.uniform(-0.3, 0.3, size)
    rates = rng.standard_normal(size) * 5e-3
    rates[0] = 0.0
    push = rng.standard_normal((2, size)) * 4.0
    torque = rng.standard_normal(size) * 0.3
    expected = piecewise(device, joints, rates, 0.4, torque, push, dt)
    found = Tick(device, np.full(size, 0.4), torque, push, dt)(joints, rates)
    scale = max(np.abs(expected[1]).max(), 1e-3)
    assert np.abs(found[0] - expected[0]).max() < TARGET * np.abs(expected[0]).max()
    assert np.abs(found[1] - expected[1]).max() < TARGET * scale
