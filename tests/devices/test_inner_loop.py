"""Inner loops against what they are for: (2.8), (2.12), (6.15), (8.8)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
from hapticeval.devices.point_mass import PointMass

DEVICES = (PointMass(0.3), PointMass(0.3, 3), Parallelogram2(), Parallelogram3())
TOOL = 0.8
states = given(seed=st.integers(0, 2**32 - 1), device=st.sampled_from(DEVICES))


def state(seed, device):
    """Joints, rates, the renderer's force and the hand's."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.45, 0.45, device.dimension), *(3.0 * rng.standard_normal((3, device.dimension)))


def drift_of(device, joints, rates):
    """J̇ q̇."""
    n = device.dimension
    drift = np.empty(n)
    device.kernels.kinematics(device.parameters, joints, rates, np.empty(n), np.empty(n), np.empty((n, n)), drift)
    return drift


def acceleration(device, joints, rates, torque, push):
    """ÿ of the device, J q̈ + J̇ q̇, under motors and hand."""
    jacobian = device.jacobian(joints)
    net = torque + jacobian.T @ push - device.bias(joints, rates)
    return jacobian @ np.linalg.solve(device.inertia(joints), net) + drift_of(device, joints, rates)


def close(found, expected, *sizes):
    scale = max(np.abs(each).max() for each in (found, expected, *sizes))
    np.testing.assert_allclose(found, expected, atol=1e-12 * scale, rtol=0.0)


@settings(max_examples=40)
@states
def test_static_does_the_work_of_the_force(seed, device):
    """Virtual work: τᵀ q̇ = Fᵀ ẏ at any rates."""
    joints, rates, force, _ = state(seed, device)
    torque = InnerLoop.STATIC.torque(device, joints, rates, force, mass=TOOL)
    assert torque @ rates == pytest.approx(force @ (device.jacobian(joints) @ rates), rel=1e-12, abs=1e-12)


@settings(max_examples=40)
@states
def test_compensated_leaves_nothing_but_inertia(seed, device):
    """(2.12): M̂ ÿ = F_r + F_o, with M̂ = J⁻ᵀ M J⁻¹ and the J̇ that (2.9) lost."""
    joints, rates, force, push = state(seed, device)
    torque = InnerLoop.COMPENSATED.torque(device, joints, rates, force, mass=TOOL)
    inverse = np.linalg.inv(device.jacobian(joints))
    inertia = inverse.T @ device.inertia(joints) @ inverse
    close(inertia @ acceleration(device, joints, rates, torque, push), force + push, 10.0 * torque @ inverse)


@settings(max_examples=40)
@states
def test_linearised_moves_as_the_virtual_tool(seed, device):
    """(6.15): m_tool ÿ = F_r, where the hand is away."""
    joints, rates, force, _ = state(seed, device)
    torque = InnerLoop.LINEARISED.torque(device, joints, rates, force, mass=TOOL)
    drift = drift_of(device, joints, rates)
    found = acceleration(device, joints, rates, torque, np.zeros(device.dimension))
    close(TOOL * found, force, 100.0 * drift)


@settings(max_examples=40)
@states
def test_a_measured_hand_feels_the_virtual_tool_s_inertia(seed, device):
    """(8.6), (8.8): m_tool ÿ = F_r + F_o."""
    joints, rates, force, push = state(seed, device)
    torque = InnerLoop.LINEARISED.torque(device, joints, rates, force, mass=TOOL, push=push)
    drift = drift_of(device, joints, rates)
    close(TOOL * acceleration(device, joints, rates, torque, push), force + push, 100.0 * drift)


def test_the_thesis_s_own_law_at_a_state():
    """(6.17) at x = (0.3, -0.2, 1.1, -0.7), v = (3, -2), by a computation of its own from the same tables."""
    found = InnerLoop.LINEARISED.torque(
        Parallelogram2(), np.array([0.3, -0.2]), np.array([1.1, -0.7]), np.array([3.0, -2.0]), mass=1.0
    )
    np.testing.assert_allclose(found, [-2.467130976448, -0.174710939647], atol=1e-12)


@pytest.mark.parametrize("loop", list(InnerLoop))
def test_a_point_mass_is_pushed_by_the_force_itself(loop):
    """F_r, and m_point F_r / m_tool (6.16) where linearised."""
    force = np.array([1.25, -0.5])
    found = loop.torque(PointMass(0.3), np.zeros(2), np.array([2.0, 1.0]), force, mass=TOOL)
    expected = force * 0.3 / TOOL if loop is InnerLoop.LINEARISED else force
    np.testing.assert_allclose(found, expected, rtol=1e-15)


@pytest.mark.parametrize("loop", list(InnerLoop))
@pytest.mark.parametrize("pushed", [False, True])
def test_the_torques_of_many_rows_are_those_of_each(loop, pushed):
    rng = np.random.default_rng(1)
    joints, rates, force, push = (scale * rng.normal(size=(5, 3)) for scale in (0.1, 1.0, 1.0, 1.0))
    many = loop.torques(Parallelogram3(), joints, rates, force, mass=TOOL, push=push if pushed else None)
    for row, *state, sensed in zip(many, joints, rates, force, push, strict=True):
        alone = loop.torque(Parallelogram3(), *state, mass=TOOL, push=sensed if pushed else None)
        assert np.array_equal(row, alone)
