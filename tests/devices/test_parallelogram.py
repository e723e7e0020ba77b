"""The parallelogram robot against a symbolic derivation, its kernels, its inverse, and what leads out of its domain."""

import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from hapticeval.compiled import first_class
from hapticeval.devices.device import checked_joints
from hapticeval.devices.parallelogram import (
    BaseInertia,
    Dynamics,
    Parallelogram2,
    Parallelogram3,
    ParallelogramParameters,
)
from hapticeval.errors import DomainError, InputError
from hapticeval.examples.studies.device_criteria import cartesian_damping
from hapticeval.laws import DYNAMICS, KINEMATICS, MARGIN

L1, L4, B, D = 0.300, 0.346, (0.461, 0.105, 0.0336), (0.799, 0.204, 0.01825)

FREE = ParallelogramParameters(b1=0.0, b2=0.0, b3=0.0)
DEVICES = (
    Parallelogram2(),
    Parallelogram3(),
    Parallelogram3(dynamics=Dynamics.PRINTED),
    Parallelogram3(base_inertia=BaseInertia.COS),
)
IDS = ("2dof", "3dof", "3dof-printed", "3dof-cos")


def symbolic(device):
    """Position, J, J̇ q̇, M and bias at (q, q̇), by (2.28) and kinetic energy alone.

    Lagrange's equations are applied to T = ½ q̇ᵀ M q̇; the printed model has no velocity terms by definition.
    """
    n = device.dimension
    t = sp.Symbol("t")
    q = [sp.Function(f"q{i}")(t) for i in range(n)]
    rates = [each.diff(t) for each in q]
    x1, x2, x3 = (sp.Integer(0), *q) if n == 2 else q
    reach = L4 * sp.cos(x3) - L1 * sp.sin(x2)
    w = sp.Matrix([sp.cos(x1) * reach - L4, sp.sin(x1) * reach, L4 * sp.sin(x3) + L1 * sp.cos(x2) - L1])
    if n == 2:
        w = sp.Matrix([w[0], w[2]])
    share = sp.cos(x3) if getattr(device, "base_inertia", None) is BaseInertia.COS else sp.sin(x3)
    base = D[0] + D[1] * sp.sin(x2) ** 2 + D[2] * share**2
    mass = sp.diag(*([base, D[1], D[2]][-n:]))
    bias = sp.diag(*B[-n:]) * sp.Matrix(rates)
    if getattr(device, "dynamics", None) is Dynamics.LAGRANGIAN:
        kinetic = (sp.Matrix(rates).T * mass * sp.Matrix(rates))[0] / 2
        for i in range(n):
            equation = kinetic.diff(rates[i]).diff(t) - kinetic.diff(q[i])
            bias[i] += equation.subs({each.diff(t): 0 for each in rates})
    plain = [sp.Symbol(f"a{i}") for i in range(2 * n)]
    swap = dict(zip([*rates, *q], [*plain[n:], *plain[:n]], strict=True))
    wanted = {
        "position": w,
        "jacobian": w.jacobian(q),
        "drift": w.jacobian(q).diff(t) * sp.Matrix(rates),
        "inertia": mass,
        "bias": bias,
    }
    functions = {name: sp.lambdify(plain, each.subs(swap), "numpy") for name, each in wanted.items()}
    return lambda *state: {
        name: np.array(function(*np.concatenate(state)), dtype=float).squeeze() for name, function in functions.items()
    }


def poses(device, count, *, least, seed=0):
    """Random joints in the functional configuration space at least `least` rad inside."""
    rng = np.random.default_rng(seed)
    low, high = ((-2.4, -2.0, -1.0), (2.4, 2.4, 2.3)) if device.dimension == 3 else ((-2.0, -1.0), (2.4, 2.3))
    drawn = (rng.uniform(low, high) for _ in range(100 * count))
    kept = [joints for joints in drawn if device.margin(joints) > least][:count]
    assert len(kept) == count
    return np.array(kept)


def drift_of(device, joints, rates):
    """J̇ q̇, from the kernel."""
    n = device.dimension
    drift = np.empty(n)
    device.kernels.kinematics(device.parameters, joints, rates, np.empty(n), np.empty(n), np.empty((n, n)), drift)
    return drift


@pytest.mark.parametrize("device", DEVICES, ids=IDS)
def test_everything_agrees_with_a_symbolic_derivation(device):
    """To 1e-12, and B̂ at rest."""
    derived = symbolic(device)
    rng = np.random.default_rng(1)
    for joints in poses(device, 100, least=0.1):
        rates = rng.uniform(-3.0, 3.0, device.dimension)
        expected = derived(joints, rates)
        found = {
            "position": device.position(joints),
            "jacobian": device.jacobian(joints),
            "drift": drift_of(device, joints, rates),
            "inertia": device.inertia(joints),
            "bias": device.bias(joints, rates),
        }
        for name, value in found.items():
            assert_allclose(value, expected[name], rtol=0.0, atol=1e-12)
        still = np.linalg.solve(expected["jacobian"].T, np.diag(B[-device.dimension :]))
        assert_allclose(cartesian_damping(device, joints) @ expected["jacobian"], still, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("device", [Parallelogram3(FREE), Parallelogram3(FREE, base_inertia=BaseInertia.COS)])
def test_the_velocity_terms_do_no_work(device):
    """d/dt ½ q̇ᵀ M q̇ = q̇ᵀ (½ Ṁ q̇ - bias) is zero without friction and torque."""
    rng = np.random.default_rng(7)
    step = 1e-5
    for joints in poses(device, 20, least=0.2):
        rates = rng.uniform(-1.0, 1.0, 3)
        ahead, behind = (device.inertia(joints + sign * step * rates) for sign in (1.0, -1.0))
        change = (ahead - behind) / (2.0 * step)
        assert rates @ (0.5 * change @ rates - device.bias(joints, rates)) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("device", DEVICES, ids=IDS)
def test_kernels_and_methods_agree_to_the_last_bit(device):
    """Also as values for other compiled code, and with J q̇ formed apart."""
    n = device.dimension
    kernels = device.kernels
    first_class(kernels.kinematics, KINEMATICS)
    first_class(kernels.dynamics, DYNAMICS)
    first_class(kernels.margin, MARGIN)
    rng = np.random.default_rng(2)
    for joints in poses(device, 40, least=0.0, seed=3):
        rates = rng.uniform(-3.0, 3.0, n)
        position, velocity, drift, bias = (np.full(n, np.nan) for _ in range(4))
        jacobian, inertia = np.full((n, n), np.nan), np.full((n, n), np.nan)
        kernels.kinematics(device.parameters, joints, rates, position, velocity, jacobian, drift)
        kernels.dynamics(device.parameters, joints, rates, inertia, bias)
        assert np.array_equal(position, device.position(joints))
        assert np.array_equal(jacobian, device.jacobian(joints))
        assert np.array_equal(inertia, device.inertia(joints))
        assert np.array_equal(bias, device.bias(joints, rates))
        assert kernels.margin(device.parameters, joints) == device.margin(joints)
        assert_allclose(velocity, device.jacobian(joints) @ rates, rtol=0.0, atol=1e-14)


def test_parameters_are_given_as_a_copy():
    device = Parallelogram2()
    before = device.position((0.1, 0.2))
    device.parameters[:] = 7.0
    assert np.array_equal(device.position((0.1, 0.2)), before)


angle = st.floats(-2.4, 2.4)


@given(shoulder=angle, elbow=angle)
def test_inverse_kinematics_in_the_plane(shoulder, elbow):
    device = Parallelogram2()
    assume(device.margin((shoulder, elbow)) > 1e-12)
    assert_allclose(device.joints(device.position((shoulder, elbow))), (shoulder, elbow), rtol=0.0, atol=2e-14)


@given(base=angle, shoulder=angle, elbow=angle)
def test_inverse_kinematics_in_space(base, shoulder, elbow):
    """x₁ is as well determined as the hand is far from the base's axis; the hand's place always is.

    The hand's place is rounded to about 1e-16 m, which at r from the axis turns x₁ by 1e-16 m / r.
    """
    device = Parallelogram3()
    joints = np.array([base, shoulder, elbow])
    assume(device.margin(joints) > 1e-12)
    position = device.position(joints)
    reach = math.hypot(position[0] + L4, position[1])
    found = device.joints(position)
    assert_allclose(found[1:], joints[1:], rtol=0.0, atol=3e-14)
    assert abs(found[0] - base) <= 1e-14 + 3e-16 / reach
    assert_allclose(device.position(found), position, rtol=0.0, atol=1e-14)


@given(st.tuples(st.floats(-0.75, 0.35), st.floats(-0.7, 0.5)))
def test_a_place_has_joints_or_an_error_with_the_reason(place):
    device = Parallelogram2()
    try:
        joints = device.joints(place)
    except DomainError as error:
        why = error.why
    else:
        assert device.margin(joints) > 0.0
        assert_allclose(device.position(joints), place, rtol=0.0, atol=1e-14)
        return
    assert "limit of" in why or "links reach" in why


@pytest.mark.parametrize("device", DEVICES[:2], ids=IDS[:2])
def test_the_margin_is_the_nearest_limit_and_no_shorter_move_leaves(device):
    rng = np.random.default_rng(5)
    assert isinstance(device, Parallelogram2 | Parallelogram3)
    for joints in poses(device, 100, least=0.0, seed=6):
        margin = device.margin(joints)
        assert margin == pytest.approx(min(limit.distance for limit in device.limits(joints)), abs=1e-15)
        moves = rng.normal(size=(20, device.dimension))
        moves *= (1.0 - 1e-9) * margin / np.linalg.norm(moves, axis=1, keepdims=True)
        assert all(device.margin(joints + move) > 0.0 for move in moves)


def test_the_margin_is_zero_on_every_edge():
    flat, deep = Parallelogram2(), Parallelogram3()
    for edge in ((2.4, 2.0), (-0.5, -1.0), (2.0, 2.3), (0.5, -0.5), (-0.25, 0.75)):
        assert flat.margin(edge) == 0.0
    singular = (0.3, 0.9, math.acos(L1 * math.sin(0.9) / L4))
    assert abs(deep.margin(singular)) < 1e-16
    assert abs(np.linalg.det(deep.jacobian(singular))) < 1e-16
    assert deep.margin((-2.4, 0.0, 0.0)) == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_state_that_is_not_finite_is_outside(refused, bad):
    assert Parallelogram2().margin((bad, 0.0)) == -math.inf
    assert Parallelogram2().margin((0.0, bad)) == -math.inf
    for place in range(3):
        joints = np.zeros(3)
        joints[place] = bad
        assert Parallelogram3().margin(joints) == -math.inf
        with refused(InputError):
            checked_joints(Parallelogram3(), joints)
        with refused(InputError):
            Parallelogram3().joints(joints)


@pytest.mark.parametrize(
    "joints",
    [
        (2.5, 0, 0),
        (0, -0.02, -1.05),
        (0, 1, -0.2),
        (0, 0.5, -0.5),
        (0, 1.2, 1.1),
    ],
)
def test_joints_out_of_the_domain_are_refused_with_limit_and_amount(refused, joints):
    with refused(DomainError):
        checked_joints(Parallelogram3(), joints)


@pytest.mark.parametrize(
    ("device", "position"),
    [
        (Parallelogram2(), (0.4, 0.0)),
        (Parallelogram2(), (0.2, 0.0)),
        (Parallelogram3(), (-0.346, 0.0, 0.1)),
        (Parallelogram3(), (-0.6, 0.0, 0.0)),
    ],
)
def test_places_out_of_reach_are_refused(refused, device, position):
    with refused(DomainError):
        device.joints(position)


@pytest.mark.parametrize("method", ["position", "jacobian", "inertia", "margin", "limits", "joints"])
def test_the_wrong_number_of_coordinates_is_refused(method):
    """Compiled code would read beyond the end."""
    for device, values in ((Parallelogram3(), (0.0, 0.0)), (Parallelogram2(), 0.0), (Parallelogram2(), ("a", "b"))):
        with pytest.raises(InputError):
            getattr(device, method)(values)


def test_the_wrong_number_of_rates_is_refused(refused):
    with refused(InputError):
        Parallelogram3().bias((0, 0, 0), (1, 2))


@pytest.mark.parametrize("changes", [{"l1": 0.25, "l4": 0.25}, {"l1": 0.5, "l4": 0.1}, {"l1": 1e-3, "l4": 2.0}])
def test_other_link_lengths_work_alike(changes):
    device = Parallelogram3(ParallelogramParameters(**changes))
    scale = max(changes.values())
    for joints in poses(device, 30, least=0.05):
        assert_allclose(
            device.position(device.joints(device.position(joints))), device.position(joints), atol=1e-14 * scale
        )


# Golden numbers, computed apart from the package, and the energy that free motion keeps

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
