"""Set stabilisation on curves: torques against sympy, closed loops against closed forms, force feed-through."""

import numpy as np
import pytest
from hand_paths import SMOOTH, damped, moved
from hypothesis import given, settings
from hypothesis import strategies as st
from torque_by_sympy import (
    GAIN_D,
    GAIN_P,
    TABLE,
    by_feedback_linearisation,
    on_the_cassinian,
    on_the_circle,
    on_the_line,
)

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.parallelogram import Parallelogram2
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.errors import DomainError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, line
from hapticeval.renderers import set_stabilisation
from hapticeval.scene import Scene

MASS = 0.1
ROBOT = Parallelogram2()


def bilateral_scene(model, **more):
    """A bilateral constraint with the thesis's gains for a unit mass."""
    return Scene(model=model, stiffness=GAIN_P * MASS, damping=GAIN_D * MASS, mass=MASS, bilateral=True, **more)


def torque(renderer, state):
    """The joint torque (7.11) at a state of the 2-DOF robot, through the linearised inner loop."""
    joints, rates = state[:2], state[2:]
    renderer.reset(ROBOT.position(joints))
    force = renderer.step(ROBOT.position(joints), ROBOT.jacobian(joints) @ rates, 1e-3).force
    return InnerLoop.LINEARISED.torque(ROBOT, joints, rates, force, mass=MASS)


def states(seed, count, points):
    """States of the robot with the end-effector at `points` and random rates."""
    rates = np.random.default_rng(seed).normal(size=(count, 2))
    return np.column_stack([[ROBOT.joints(point) for point in points], rates])


def near(model, seed, count, reach):
    """Random points within `reach` of a curve, and the parameters that they were made from."""
    rng = np.random.default_rng(seed)
    curve = model.curve
    u = rng.uniform(*((-0.1, 0.1) if not curve.closed else curve.u_range), count)
    return curve.position(u) + rng.uniform(-reach, reach, count)[:, None] * curve.normal(u)


def agree(found, expected):
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_the_inner_loop_is_6_17():
    derived = by_feedback_linearisation()
    for state in states(11, 60, near(circle(), 12, 60, 0.05)):
        v = np.array([3.0, -2.0])
        found = InnerLoop.LINEARISED.torque(ROBOT, state[:2], state[2:], MASS * v, mass=MASS)
        agree(found, np.ravel(derived(*state, *v)))
    golden = InnerLoop.LINEARISED.torque(ROBOT, [0.3, -0.2], [1.1, -0.7], [3.0, -2.0], mass=1.0)
    np.testing.assert_allclose(golden, (-2.467130976448, -0.174710939647), atol=5e-13)


def test_the_torque_on_the_line_is_7_29():
    renderer, derived = set_stabilisation(bilateral_scene(line())), on_the_line()
    for state in states(1, 60, near(line(), 2, 60, 0.1)):
        agree(torque(renderer, state), np.ravel(derived(*state)))


def test_7_29_as_printed_once_its_v_is_ordered():
    """The thesis's own expression, with the transversal input first."""
    renderer = set_stabilisation(bilateral_scene(line()))
    l1, l4, b2, b3, d2, d3 = TABLE.l1, TABLE.l4, TABLE.b2, TABLE.b3, TABLE.d2, TABLE.d3
    for state in states(3, 60, near(line(), 4, 60, 0.1)):
        x1, x2, x3, x4 = state
        (s1, s2), (c1, c2), c12 = np.sin(state[:2]), np.cos(state[:2]), np.cos(x1 - x2)
        outer = np.array([[-s2 * d2 / l1, -c2 * d2 / l1], [c1 * d3 / l4, -s1 * d3 / l4]]) / c12
        inner = [
            c1 * l1 * x3**2 + l4 * s2 * x4**2 - s1 * l1 * b2 * x3 / d2 + l4 * c2 * b3 * x4 / d3,
            -s1 * l1 * x3**2 + l4 * c2 * x4**2 - c1 * l1 * b2 * x3 / d2 - l4 * s2 * b3 * x4 / d3,
        ]
        height, speed = ROBOT.position(state[:2])[1], (ROBOT.jacobian(state[:2]) @ state[2:])[1]
        agree(torque(renderer, state), outer @ (inner + np.array([-GAIN_P * height - GAIN_D * speed, 0.0])))


def test_the_torque_on_the_circle():
    renderer, derived = set_stabilisation(bilateral_scene(circle())), on_the_circle(0.1)
    for state in states(5, 60, near(circle(), 6, 60, 0.03)):
        agree(torque(renderer, state), np.ravel(derived(*state)))
    golden = torque(renderer, np.array([0.3, 0.2, 1.0, -0.5]))
    np.testing.assert_allclose(golden, (-4.943072258729, -0.422325478329), atol=5e-13)


def test_the_torque_on_the_cassinian():
    model = cassinian()
    renderer, derived = set_stabilisation(bilateral_scene(model)), on_the_cassinian()
    for state in states(7, 60, near(model, 8, 60, 0.01)):
        (u,) = model.curve.nearest([ROBOT.position(state[:2])])
        agree(torque(renderer, state), np.array(derived(*state, u)))


def test_the_force_on_a_point_mass_is_7_36():
    renderer = set_stabilisation(bilateral_scene(circle()))
    rng = np.random.default_rng(9)
    for x1, x2, x3, x4 in np.column_stack([near(circle(), 10, 60, 0.05), rng.normal(size=(60, 2))]):
        r2 = x1 * x1 + x2 * x2
        r = np.sqrt(r2)
        outer = MASS * np.array([[x1 / r, -x2], [x2 / r, x1]])
        bracket = [
            -((-x2 * x3 + x1 * x4) ** 2) / r**3,
            2.0 * (-x1 * x3**2 * x2 + x3 * x1**2 * x4 - x3 * x2**2 * x4 + x1 * x4**2 * x2) / r2**2,
        ]
        v = [-GAIN_P * (r - 0.1) - GAIN_D * (x1 * x3 + x2 * x4) / r, 0.0]
        found = renderer.step(np.array([x1, x2]), np.array([x3, x4]), 1e-3).force
        agree(found, outer @ (np.array(bracket) + v))


def test_the_first_force_on_the_circle_is_7_39():
    unit = Scene(model=circle(size=2.0), stiffness=GAIN_P * MASS, damping=GAIN_D * MASS, mass=MASS, bilateral=True)
    force = set_stabilisation(unit).step(np.array([1.0, 0.0]), np.array([0.0, 5.0]), 1e-3).force
    np.testing.assert_allclose(force, (-25.0 * MASS, 0.0), atol=1e-14)


def decay(n, time, rate=0.0):
    """n(t) with the gains of the thesis."""
    return damped(time, n, rate, GAIN_P, GAIN_D)[0]


def along(curve, points):
    """Arc length of the feet, without jumps."""
    angle = np.unwrap(curve.arc_length(curve.nearest(points)) * (2.0 * np.pi / curve.length))
    return angle * (curve.length / (2.0 * np.pi))


def test_depth_on_the_circle_from_rest_is_golden():
    unit = Scene(model=circle(size=2.0), stiffness=GAIN_P * MASS, damping=GAIN_D * MASS, mass=MASS, bilateral=True)
    path = moved(set_stabilisation(unit), np.array([0.0, 1.1, 0.0, 0.0]), np.array([0.05, 0.1, 0.2]), MASS)
    n = unit.model.curve.signed_distance(path[:, :2])
    np.testing.assert_allclose(n, (0.069235893235141, 0.034567393786025, 0.0062344935637), atol=5e-14)


@pytest.mark.parametrize("name", ["cassinian", "circle", "ellipse"])
def test_depth_and_speed_are_independent_along_the_whole_curve(name):
    """n as (7.28) and (7.38) have it, and ṡ constant, while the foot passes tips and valleys."""
    curve = SMOOTH[name].curve
    n, speed, u = 0.004, 1.0, 0.4
    stretch = 1.0 + n * float(curve.curvature(u))
    start = [*(curve.position(u) + n * curve.normal(u)), *(speed * stretch * curve.tangent(u) - 0.1 * curve.normal(u))]
    times = np.linspace(0.0, 0.6, 61)
    path = moved(set_stabilisation(bilateral_scene(SMOOTH[name])), np.array(start), times, MASS)
    np.testing.assert_allclose(curve.signed_distance(path[:, :2]), decay(n, times, -0.1), atol=1e-12)
    s = along(curve, path[:, :2])
    np.testing.assert_allclose(s - s[0], speed * times, atol=1e-12)
    assert s[-1] - s[0] > 0.9 * curve.length


def test_viscosity_slows_the_foot_as_7_18_does():
    model, speed, b = cassinian(), 1.0, 0.3
    curve = model.curve
    start = np.array([*curve.position(0.4), *(speed * curve.tangent(0.4))])
    times = np.linspace(0.0, 0.5, 26)
    path = moved(set_stabilisation(bilateral_scene(model, effects=(Viscosity(b),))), start, times, MASS)
    s = along(curve, path[:, :2])
    np.testing.assert_allclose(s - s[0], speed * MASS / b * (1.0 - np.exp(-b / MASS * times)), atol=1e-11)
    np.testing.assert_allclose(curve.signed_distance(path[:, :2]), 0.0, atol=1e-12)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
@pytest.mark.parametrize("name", SMOOTH)
def test_with_a_force_sensor_the_push_moves_the_foot_and_not_the_depth(name, seed):
    """n̈ = v⊥ whatever the hand does (8.6), and m s̈ = F_o·t (8.9)."""
    model = SMOOTH[name]
    rng = np.random.default_rng(seed)
    hip, velocity, push = near(model, seed, 1, 0.01)[0], rng.normal(size=2), 3.0 * rng.normal(size=2)
    renderer = set_stabilisation(bilateral_scene(model))
    renderer.reset(hip)
    without = renderer.step(hip, velocity, 1e-3).force
    renderer.observe_force(push)
    change = renderer.step(hip, velocity, 1e-3).force + push - without
    frame = model.curve.closest_point(hip[None])
    normal, stretch = frame.normal[0], 1.0 + frame.distance[0] * np.trace(frame.shape[0])
    tangent = np.array([-normal[1], normal[0]])
    np.testing.assert_allclose(change, stretch * (tangent @ push) * tangent, atol=1e-11)


def test_pushed_along_a_circle_with_a_sensor_it_moves_as_the_tool_does():
    push = np.array([0.3, -0.8])
    times = np.linspace(0, 0.4, 9)
    path = moved(set_stabilisation(bilateral_scene(circle())), np.array([0.105, 0.0, 0.0, 0.0]), times, MASS, push)
    n = circle().curve.signed_distance(path[:, :2])
    np.testing.assert_allclose(n, decay(0.005, times), atol=1e-12)
    # the foot's energy is what the push did on it: F_o is constant, and a foot on the circle moves as a tool would
    feet = 0.1 * path[:, :2] / np.linalg.norm(path[:, :2], axis=1)[:, None]
    turning = (path[:, 0] * path[:, 3] - path[:, 1] * path[:, 2]) / np.sum(path[:, :2] ** 2, axis=1)
    foot_speed = 0.1 * turning
    np.testing.assert_allclose(0.5 * MASS * foot_speed**2, (feet - feet[0]) @ push, atol=1e-10)


def test_at_a_centre_of_curvature_the_step_refuses(refused):
    for model, place in ((circle(), (0.0, 0.0)), (cassinian(), (0.07387961250362586, 0.0))):
        renderer = set_stabilisation(bilateral_scene(model))
        hip = np.array(place)
        renderer.reset(hip)
        with refused(DomainError):
            renderer.step(hip, np.array([0.0, 1.0]), 1e-3)


def test_the_force_jumps_at_the_joints_of_a_dumbbell_as_a_rigid_contact_does():
    model = dumbbell()
    renderer, curve = set_stabilisation(bilateral_scene(model)), model.curve
    speed = 0.7
    for u in curve.pieces[1:, 1]:
        sides = []
        for place in (u - 1e-9, u + 1e-9):
            force = renderer.step(curve.position(place), speed * curve.tangent(place), 1e-3).force
            sides.append(float(force @ curve.normal(place)))
            np.testing.assert_allclose(sides[-1], -MASS * float(curve.curvature(place)) * speed**2, atol=1e-6)
        assert abs(sides[1] - sides[0]) > 1e-2
