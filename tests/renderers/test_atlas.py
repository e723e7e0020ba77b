"""The sphere's atlas against a derivation from the definitions, its golden torque, and the law without charts."""

import math
from functools import cache

import numpy as np
import pytest
import sympy as sp

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.parallelogram import BaseInertia, Dynamics, Parallelogram3, ParallelogramParameters
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.errors import RefusalError
from hapticeval.geometry.catalogue import ellipsoid, sphere
from hapticeval.laws import law_data
from hapticeval.renderers.atlas import active_chart, active_charts, chart_acceleration, charts, jacobian, to_chart_axes
from hapticeval.renderers.stabilisation import SurfaceStabilisation
from hapticeval.scene import Scene

RADIUS, K_P, K_D, MASS, B_D = 0.1, 200.0, 28.3, 0.1, 0.3
"""Of the experiment in 7.4.1; the gains are accelerations, K/m_tool."""

DATA = law_data((K_P * MASS, K_D * MASS, MASS, B_D, 1.0), pieces=sphere(2.0 * RADIUS).surface.row[None])
ROBOT = Parallelogram3(dynamics=Dynamics.PRINTED, base_inertia=BaseInertia.SIN)

Y = sp.symbols("y1:4", real=True)
T = sp.symbols("t1:3", real=True)
RATES = sp.symbols("td1:3", real=True)
PUSH = sp.symbols("F1:4", real=True)
R = sp.Symbol("r", positive=True)


def phi(chart, y):
    """(7.54) and (7.55) with atan2, as they are defined."""
    length = sp.sqrt(sum(each**2 for each in y))
    if chart == 1:
        return sp.Matrix([sp.atan2(y[1], y[0]), sp.acos(y[2] / length)])
    return sp.Matrix([sp.atan2(y[2], y[1]), sp.acos(y[0] / length)])


def psi(chart):
    """(7.66), with sine and cosine of the second chart's first coordinate in their places."""
    around = (sp.cos(T[0]) * sp.sin(T[1]), sp.sin(T[0]) * sp.sin(T[1]))
    height = sp.cos(T[1])
    return R * sp.Matrix([*around, height] if chart == 1 else [height, *around])


def tangential(chart):
    """v∥ of (7.22), (8.9) with the transpose, the second derivative as a form, and a of (7.18) with its minus."""
    inverse = psi(chart)
    slope = inverse.jacobian(T)
    rates = sp.Matrix(RATES)
    second = sp.Matrix([(rates.T * sp.hessian(each, T) * rates)[0] for each in inverse])
    desired = -B_D / MASS * slope * rates + sp.Matrix(PUSH) / MASS
    return (slope.T * slope).inv() * slope.T * (desired - second)


@cache
def derived_torque(chart):
    """u of (7.11) less Jᵀ F_o (8.6), as a function of state and push, from (2.26), (2.28), (7.43), (7.14), (7.22)."""
    x = sp.symbols("x1:7", real=True)
    given = ParallelogramParameters()
    l1, l4 = given.l1, given.l4
    out = l4 * sp.cos(x[2]) - l1 * sp.sin(x[1])
    h = sp.Matrix([sp.cos(x[0]) * out - l4, sp.sin(x[0]) * out, l4 * sp.sin(x[2]) + l1 * sp.cos(x[1]) - l1])
    d0 = given.d1 + given.d2 * sp.sin(x[1]) ** 2 + given.d3 * sp.sin(x[2]) ** 2
    d = (d0, given.d2, given.d3)
    b = (given.b1, given.b2, given.b3)
    f = sp.Matrix([*x[3:], *(-b[i] * x[3 + i] / d[i] for i in range(3))])
    g = sp.zeros(3, 3).col_join(sp.diag(*(1 / each for each in d)))
    length = sp.sqrt(sum(each**2 for each in Y))
    # φ∘ρ = φ: ρ (7.57) stays on the ray, as `test_jacobian_and_determinant` sees
    sigma = sp.Matrix([length - R, *phi(chart, Y)])
    alpha = sigma.subs(dict(zip(Y, h, strict=True)), simultaneous=True)
    first = alpha.jacobian(x) * f
    drift, gain = first.jacobian(x) * f, first.jacobian(x) * g
    values = {T[0]: alpha[1], T[1]: alpha[2], RATES[0]: first[1], RATES[1]: first[2]}
    v = sp.Matrix([-K_P * alpha[0] - K_D * first[0], *tangential(chart).subs(values)])
    numbers = {R: RADIUS}
    made = sp.lambdify([*x, *PUSH], [m.subs(numbers) for m in (gain, v - drift, h.jacobian(x[:3]))], cse=True)

    def torque(state, push):
        gain, rest, jac = made(*state, *push)
        return np.linalg.solve(gain, np.ravel(rest)) - jac.T @ push

    return torque


def states(n, seed=1):
    """Positions of the robot around the sphere, within and outside, joint rates and pushes."""
    rng = np.random.default_rng(seed)
    for _ in range(n):
        way = rng.normal(size=3)
        y = way / np.linalg.norm(way) * rng.uniform(0.3, 1.4) * RADIUS
        yield ROBOT.joints(y), rng.normal(size=3), rng.normal(size=3)


def torque_of(joints, rates, force, push=None):
    return InnerLoop.LINEARISED.torque(ROBOT, joints, rates, force, mass=MASS, push=push)


@pytest.mark.parametrize("chart", [1, 2])
@pytest.mark.parametrize("pushed", [False, True])
def test_each_chart_gives_the_torque_of_the_definitions(chart, pushed):
    exact = derived_torque(chart)
    for joints, rates, push in states(40):
        push = push if pushed else np.zeros(3)
        y, yd = ROBOT.position(joints)[None], (ROBOT.jacobian(joints) @ rates)[None]
        answer = charts(DATA, y, yd, push[None])[chart - 1]
        assert answer.defined[0]
        found = torque_of(joints, rates, answer.force[0], push)
        expected = exact((*joints, *rates), push)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.linalg.norm(expected))


@pytest.mark.parametrize("both", [False, True])
def test_the_renderer_gives_the_torque_of_the_active_chart(both):
    scene = Scene(
        model=sphere(2.0 * RADIUS),
        stiffness=K_P * MASS,
        damping=K_D * MASS,
        mass=MASS,
        effects=(Viscosity(B_D),),
        bilateral=True,
        device=ROBOT,
        inner_loop=InnerLoop.LINEARISED,
    )
    renderer = SurfaceStabilisation(scene, atlas=both)
    seen = set()
    for joints, rates, push in states(60, seed=2):
        y = ROBOT.position(joints)
        renderer.observe_force(push)
        force = renderer.step(y, ROBOT.jacobian(joints) @ rates, 1e-3).force
        chart = int(active_charts(y[None])[0])
        seen.add(chart)
        expected = derived_torque(chart)((*joints, *rates), push)
        found = torque_of(joints, rates, force, push)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.linalg.norm(expected))
    assert seen == {1, 2}


def test_golden_torque_at_the_switch():
    joints, rates = np.array([0.10500167219, -0.228020956224, 0.228800232408]), np.array([0.4, -0.3, 0.5])
    y, yd = ROBOT.position(joints), ROBOT.jacobian(joints) @ rates
    assert math.acos(y[2] / np.linalg.norm(y)) == pytest.approx(math.pi / 4.0, abs=1e-9)
    for answer in charts(DATA, y[None], yd[None]):
        torque = torque_of(joints, rates, answer.force[0])
        np.testing.assert_allclose(torque, [-3.794468818767, 3.072058741665, -0.250164191242], atol=2e-12)


def test_the_charts_agree_wherever_both_are_defined():
    rng = np.random.default_rng(3)
    y, yd, push = (scale * rng.normal(size=(5000, 3)) for scale in (0.1, 1.0, 1.0))
    one, two = charts(DATA, y, yd, push)
    assert one.defined.all()
    assert two.defined.all()
    size = np.linalg.norm(one.force, axis=1)
    # near an axis a chart loses digits as the square of the angle from it
    angle = np.minimum(np.hypot(y[:, 0], y[:, 1]), np.hypot(y[:, 1], y[:, 2])) / np.linalg.norm(y, axis=1)
    assert np.max(np.linalg.norm(one.force - two.force, axis=1) / size * angle**2) < 1e-13


def test_jacobian_and_determinant():
    length = sp.sqrt(sum(each**2 for each in Y))
    rng = np.random.default_rng(4)
    across = sp.sqrt(Y[0] ** 2 + Y[1] ** 2)
    printed = sp.Matrix(
        [
            [each / length for each in Y],
            [-Y[1] / across**2, Y[0] / across**2, 0],
            [Y[2] * Y[0] / (length**2 * across), Y[2] * Y[1] / (length**2 * across), -across / length**2],
        ]
    )
    determinant = -1 / (across * length)
    for chart in (1, 2):
        sigma = sp.Matrix([length - R, *phi(chart, [R * each / length for each in Y])])
        defined = sp.lambdify(Y, sigma.jacobian(Y).subs(R, RADIUS))
        as_printed = sp.lambdify(Y, (printed, determinant))
        for y in rng.normal(size=(50, 3)):
            q = to_chart_axes(chart, tuple(y))
            rows = np.array(jacobian(q))
            back = rows if chart == 1 else rows[:, [2, 0, 1]]
            np.testing.assert_allclose(back, defined(*y), atol=1e-11 * np.abs(rows).max())
            expected, volume = as_printed(*q)
            assert np.linalg.det(back) == pytest.approx(volume, rel=1e-9)
            np.testing.assert_allclose(rows, expected, rtol=1e-12)


def test_the_tangential_controller_as_printed_is_that_of_its_definition():
    eta2, eta3, eta4 = RATES[0], T[1], RATES[1]
    printed = sp.Matrix(
        [
            -(B_D * sp.sin(eta3) + 2 * sp.cos(eta3) * eta4 * MASS) * eta2 / (MASS * sp.sin(eta3)),
            (sp.cos(eta3) * MASS * sp.sin(eta3) * eta2**2 - B_D * eta4) / MASS,
        ]
    )
    free = dict.fromkeys(PUSH, 0)
    for chart in (1, 2):
        difference = sp.lambdify([*T, *RATES], (tangential(chart).subs(free) - printed).subs(R, RADIUS))
        for values in np.random.default_rng(5).uniform(0.3, 2.8, (20, 4)):
            np.testing.assert_allclose(difference(*values), 0.0, atol=1e-12)


def test_eta_are_the_angles_and_their_rates():
    rng = np.random.default_rng(6)
    y, yd, h = rng.normal(size=(200, 3)), rng.normal(size=(200, 3)), 1e-6
    for chart, answer in enumerate(charts(DATA, y, yd), start=1):
        here = np.array([[float(each) for each in phi(chart, list(row))] for row in y[:20]])
        np.testing.assert_allclose(answer.eta[:20, [0, 2]], here, atol=1e-13)
        before, after = (charts(DATA, y + s * h * yd, yd)[chart - 1].eta for s in (-1.0, 1.0))
        moved = after[:, [0, 2]] - before[:, [0, 2]]
        moved[:, 0] = np.remainder(moved[:, 0] + math.pi, 2.0 * math.pi) - math.pi
        rate = answer.eta[:, [1, 3]]
        np.testing.assert_allclose(moved / (2.0 * h), rate, atol=1e-6 * np.abs(rate).max())


def test_the_switching_law():
    angles = np.linspace(0.0, math.pi, 181) + 1e-3
    y = 0.1 * np.column_stack([np.sin(angles), 0.0 * angles, np.cos(angles)])
    expected = np.where((angles >= math.pi / 4.0) & (angles <= 3.0 * math.pi / 4.0), 1, 2)
    assert np.array_equal(active_charts(y), expected)
    assert [active_chart(tuple(row)) for row in y] == expected.tolist()


def test_a_chart_on_its_axis_says_so_and_the_other_answers():
    y = np.array([[0.0, 0.0, 0.09], [-0.11, 0.0, 0.0], [1e-12, 0.0, 0.09], [0.0, 0.0, 0.0]])
    one, two = charts(DATA, y, np.ones_like(y))
    assert one.defined.tolist() == [False, True, False, False]
    assert two.defined.tolist() == [True, False, True, False]
    for answer in (one, two):
        assert np.all(np.isfinite(answer.eta))
        assert np.all(np.isfinite(answer.force))
        assert np.all(answer.force[~answer.defined] == 0.0)


def test_the_active_chart_never_comes_near_its_axis():
    rng = np.random.default_rng(7)
    for y in rng.normal(size=(2000, 3)):
        q = to_chart_axes(active_chart(tuple(y)), tuple(y))
        assert math.hypot(q[0], q[1]) >= 0.7071 * np.linalg.norm(y) * (1.0 - 1e-12)
    assert np.all(
        np.isfinite(chart_acceleration(0.1, (0.0707, 0.0, 0.0707), (1.0, 2.0, 3.0), 1.0, 1.0, (0.0, 0.0, 0.0)))
    )


@pytest.mark.parametrize("bilateral", [False, True])
def test_it_answers_as_the_law_without_charts(bilateral):
    scene = Scene(
        model=sphere(),
        stiffness=20.0,
        damping=2.83,
        mass=0.1,
        effects=(Viscosity(0.3),),
        bilateral=bilateral,
        sampling_time=1e-3,
    )
    ours, other = SurfaceStabilisation(scene, atlas=True), SurfaceStabilisation(scene, atlas=False)
    rng = np.random.default_rng(8)
    touched = 0
    for k in range(1000):
        y, yd, push = 0.06 * rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
        if k % 10 == 0:
            ours.reset(y)
            other.reset(y)
        ours.observe_force(push)
        other.observe_force(push)
        one, two = ours.step(y, yd, 1e-3), other.step(y, yd, 1e-3)
        np.testing.assert_allclose(one.ihip, two.ihip, atol=1e-16)
        np.testing.assert_allclose(one.force, two.force, atol=1e-12 * max(1.0, np.linalg.norm(two.force)))
        touched += bool(np.any(one.force))
    assert touched > 150


def test_only_a_sphere_has_this_atlas(refused):
    with refused(RefusalError):
        SurfaceStabilisation(Scene(model=ellipsoid()), atlas=True)
