"""The parallelogram robot against golden numbers that were computed apart from it, and the energy it keeps."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from hapticeval.devices.parallelogram import (
    BaseInertia,
    Dynamics,
    Parallelogram2,
    Parallelogram3,
    ParallelogramParameters,
)

FREE = ParallelogramParameters(b1=0.0, b2=0.0, b3=0.0)
START = np.array([0.0, 0.2, -0.1, 2.0, 1.0, 1.5])


def test_home():
    flat, deep = Parallelogram2(), Parallelogram3()
    assert_allclose(flat.position((0, 0)), (0, 0), atol=1e-16)
    assert_allclose(flat.jacobian((0, 0)), np.diag((-0.3, 0.346)), atol=1e-16)
    assert_allclose(np.linalg.det(flat.jacobian((0, 0))), -0.1038, rtol=1e-14)
    assert_allclose(deep.position((0, 0, 0)), (0, 0, 0), atol=1e-16)
    assert_allclose(deep.jacobian((0, 0, 0)), [[0, -0.3, 0], [0.346, 0, 0], [0, 0, 0.346]], atol=1e-16)
    assert_allclose(np.linalg.det(deep.jacobian((0, 0, 0))), 0.0359148, rtol=1e-14)


def test_poses():
    flat, deep = Parallelogram2(), Parallelogram3()
    assert_allclose(flat.position((0.3, 0.2)), (-0.095553026065, 0.055340535193), atol=5e-13)
    assert_allclose(np.linalg.det(flat.jacobian((0.3, 0.2))), -0.103281432356, atol=5e-13)
    assert_allclose(deep.position((0.5, 0.3, 0.2)), (-0.126212102997, 0.12007067537, 0.055340535193), atol=5e-13)
    assert_allclose(np.linalg.det(deep.jacobian((0.5, 0.3, 0.2))), 0.025866522197, atol=5e-13)


def test_the_determinant_in_the_plane_stays_within_its_published_range():
    """|det J₂| = ℓ₁ ℓ₄ cos(x₁ - x₂), least at the stop and greatest where the linkage is a rectangle."""
    flat = Parallelogram2()
    assert_allclose(abs(np.linalg.det(flat.jacobian((1.0, 0.0)))), 0.0560833793, atol=5e-11)
    assert_allclose(abs(np.linalg.det(flat.jacobian((0.7, 0.7)))), 0.1038, rtol=1e-13)


def moved(device, *, duration=0.5):
    """The state after free motion, to about 1e-13."""

    def rate(_, state):
        joints, rates = state[:3], state[3:]
        return np.concatenate([rates, -device.bias(joints, rates) / np.diag(device.inertia(joints))])

    solution = solve_ivp(rate, (0.0, duration), START, method="DOP853", rtol=3e-14, atol=1e-15)
    assert solution.success
    return solution.y[:, -1]


def energy(device, state):
    return float(0.5 * state[3:] @ device.inertia(state[:3]) @ state[3:])


@pytest.mark.parametrize(
    ("base_inertia", "joints", "rates", "expected"),
    [
        (
            "sin",
            (0.949448427787, 0.856000074663, 0.711382497670),
            (1.748897923741, 1.691424988680, 1.913631407481),
            1.736998592178,
        ),
        (
            "cos",
            (0.954238967874, 0.856918801629, 0.589552417662),
            (1.777990148364, 1.699791343394, 1.098359981562),
            1.772771022269,
        ),
    ],
)
def test_lagrangian_dynamics_move_as_published_and_conserve_energy(base_inertia, joints, rates, expected):
    device = Parallelogram3(FREE, Dynamics.LAGRANGIAN, BaseInertia(base_inertia))
    end = moved(device)
    assert_allclose(end, (*joints, *rates), atol=1.5e-12)
    assert_allclose(energy(device, START), expected, atol=1e-12)
    assert_allclose(energy(device, end), energy(device, START), rtol=1e-13)


def test_printed_dynamics_create_energy():
    """(2.26) lets all joints coast while d₀ grows: 9.6 % more energy after half a second."""
    device = Parallelogram3(FREE, Dynamics.PRINTED)
    end = moved(device)
    assert_allclose(end, START + 0.5 * np.concatenate([START[3:], np.zeros(3)]), atol=1e-13)
    assert_allclose(energy(device, START), 1.7369986, atol=5e-8)
    assert_allclose(energy(device, end), 1.9032261, atol=5e-8)
    assert energy(device, end) / energy(device, START) - 1.0 == pytest.approx(0.096, abs=5e-4)


def test_printed_and_lagrangian_dynamics_are_one_with_the_base_locked():
    rng = np.random.default_rng(4)
    for joints, rates in rng.uniform(-0.5, 0.5, (50, 2, 2)):
        lagrangian, printed = (Parallelogram2(dynamics=each) for each in Dynamics)
        assert np.array_equal(printed.inertia(joints), lagrangian.inertia(joints))
        assert np.array_equal(printed.bias(joints, rates), lagrangian.bias(joints, rates))
