"""Set stabilisation without charts: its closed loop on sphere, ellipsoids and torus against what it must conserve."""

import math

import numpy as np
import pytest
from hand_paths import damped, moved

from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.errors import DomainError, InputError, RefusalError
from hapticeval.geometry.catalogue import circle, ellipsoid, sphere, torus
from hapticeval.renderers.stabilisation import SurfaceStabilisation
from hapticeval.scene import Scene

K_P, K_D, MASS = 200.0, 28.3, 0.1
"""Of the experiment in 7.4.1; the gains are accelerations, K/m_tool."""

MODELS = [
    sphere(0.2),
    ellipsoid(0.1, 0.07, 0.05),
    ellipsoid(0.07, 0.07, 0.1),
    ellipsoid(0.1, 0.05, 0.1),
    torus(0.07, 0.03),
]
every = pytest.mark.parametrize("model", MODELS, ids=lambda m: f"{m.name}{tuple(m.surface.reals)}")


def renderer_of(model, *, bilateral=True, viscosity=0.0):
    return SurfaceStabilisation(
        Scene(
            model=model,
            stiffness=K_P * MASS,
            damping=K_D * MASS,
            mass=MASS,
            effects=(Viscosity(viscosity),),
            bilateral=bilateral,
        ),
        atlas=False,
    )


def start_of(model, offset, seed=1):
    """A state at `offset` m from a random foot, with a speed of some 0.5 m/s along and 0.1 m/s across."""
    rng = np.random.default_rng(seed)
    foot = model.surface.points(101)[rng.integers(101)]
    normal = model.surface.closest_point([foot]).normal[0]
    way = np.cross(normal, rng.normal(size=3))
    across = 0.1 if offset else 0.0
    return np.concatenate([foot + offset * normal, 0.5 * way / np.linalg.norm(way) + across * normal])


def foot_motion(model, states):
    """Foot, its velocity, n and ṅ of states (n, 6), from the frame alone."""
    foot, normal, n, shape = model.surface.closest_point(states[:, :3])
    velocity = states[:, 3:]
    rate = np.sum(normal * velocity, axis=1)
    stretch = np.eye(3) + n[:, None, None] * shape
    return foot, np.linalg.solve(stretch, (velocity - rate[:, None] * normal)[..., None])[..., 0], n, rate


def clairaut(model, foot, velocity):
    """What a geodesic keeps beside its speed: Clairaut's constant about the axis, Joachimsthal's on an ellipsoid."""
    if model.name == "ellipsoid":
        squares = np.array(model.surface.reals) ** 2
        return np.sum((foot / squares) ** 2, axis=1) * np.sum(velocity**2 / squares, axis=1)
    return np.cross(foot, velocity)[:, 2]


@every
@pytest.mark.parametrize("offset", [0.0, 0.006, -0.008])
def test_the_foot_runs_on_a_geodesic_and_the_distance_is_linear(model, offset):
    state = start_of(model, offset)
    time = np.linspace(0.0, 0.6, 60)
    states = moved(renderer_of(model), state, time, MASS, rtol=1e-12)
    foot, velocity, n, rate = foot_motion(model, states)
    expected, expected_rate = damped(time, offset, 0.1 if offset else 0.0, K_P, K_D)
    np.testing.assert_allclose(n, expected, atol=1e-12)
    np.testing.assert_allclose(rate, expected_rate, atol=1e-10)
    speed = np.linalg.norm(velocity, axis=1)
    np.testing.assert_allclose(speed, speed[0], rtol=1e-9)
    kept = clairaut(model, foot, velocity)
    np.testing.assert_allclose(kept, kept[0], rtol=1e-9, atol=1e-9 * np.abs(kept[0]))
    assert np.linalg.norm(foot[-1] - foot[0]) > 0.02


@pytest.mark.parametrize("offset", [0.0, 0.01])
def test_a_sphere_s_geodesic_is_a_great_circle_at_constant_angular_speed(offset):
    model = sphere(0.2)
    state = start_of(model, offset)
    time = np.linspace(0.0, 0.6, 60)
    states = moved(renderer_of(model), state, time, MASS, rtol=1e-12)
    foot, velocity, _, _ = foot_motion(model, states)
    angle = np.linalg.norm(velocity[0]) / 0.1 * time[:, None]
    way = velocity[0] / np.linalg.norm(velocity[0])
    np.testing.assert_allclose(foot, np.cos(angle) * foot[0] + np.sin(angle) * 0.1 * way, atol=1e-11)


@every
def test_viscosity_slows_the_foot_on_the_same_geodesic(model):
    viscosity = 0.3
    state = start_of(model, 0.006)
    time = np.linspace(0.0, 0.6, 60)
    states = moved(renderer_of(model, viscosity=viscosity), state, time, MASS, rtol=1e-12)
    foot, velocity, n, _ = foot_motion(model, states)
    np.testing.assert_allclose(n, damped(time, 0.006, 0.1, K_P, K_D)[0], atol=1e-12)
    speed = np.linalg.norm(velocity, axis=1)
    np.testing.assert_allclose(speed, speed[0] * np.exp(-viscosity / MASS * time), rtol=1e-9)
    kept = clairaut(model, foot, velocity / speed[:, None])
    np.testing.assert_allclose(kept, kept[0], rtol=1e-9, atol=1e-9 * np.abs(kept[0]))


@every
def test_a_push_that_is_sensed_moves_the_foot_as_the_tool_s_mass_and_leaves_the_distance_alone(model):
    push = np.array([0.3, -0.2, 0.25])
    time = np.linspace(0.0, 0.5, 60)
    states = moved(renderer_of(model), start_of(model, 0.006), time, MASS, push, rtol=1e-12)
    foot, velocity, n, _ = foot_motion(model, states)
    np.testing.assert_allclose(n, damped(time, 0.006, 0.1, K_P, K_D)[0], atol=1e-12)
    # m a = P_T F_o of the foot: its energy in the field of the constant push is kept
    energy = 0.5 * MASS * np.sum(velocity**2, axis=1) - foot @ push
    np.testing.assert_allclose(energy, energy[0], atol=1e-10)


@every
def test_a_push_that_is_not_sensed_is_a_disturbance(model):
    push = np.array([0.3, -0.2, 0.25])
    states = moved(
        renderer_of(model), start_of(model, 0.0), np.linspace(0.0, 0.5, 60), MASS, push, sensed=False, rtol=1e-12
    )
    n = foot_motion(model, states)[2]
    # n̈ = -K_p n - K_d ṅ + F_o·ν/m, critically damped: no farther than the largest push, at rest
    assert 1e-4 < np.max(np.abs(n)) < np.linalg.norm(push) / (MASS * K_P)


def test_on_the_sphere_it_is_the_closed_form():
    rng = np.random.default_rng(2)
    renderer = renderer_of(sphere(0.2), viscosity=0.3)
    renderer.reset(np.zeros(3))
    for _ in range(300):
        y, yd = 0.07 * rng.normal(size=3), rng.normal(size=3)
        length = np.linalg.norm(y)
        up = y / length
        rate = up @ yd
        along = yd - rate * up
        across = -K_P * (length - 0.1) - K_D * rate
        expected = (across - along @ along / length) * up + (2.0 * rate / length - 3.0) * along
        # |w|^2 / |y|: the foot's <W ṗ, (I + nW) ṗ>
        answer = renderer.step(y, yd, 1e-3)
        np.testing.assert_allclose(answer.force, MASS * expected, rtol=0.0, atol=1e-13 * np.linalg.norm(expected))
        np.testing.assert_allclose(answer.ihip, 0.1 * up, atol=1e-16)


@every
def test_a_unilateral_contact_never_pulls_and_is_off_outside(model):
    renderer = renderer_of(model, bilateral=False, viscosity=0.3)
    rng = np.random.default_rng(4)
    pressed = 0
    for foot in model.surface.points(400):
        normal = model.surface.closest_point([foot]).normal[0]
        n = rng.uniform(-0.01, 0.005)
        y, yd = foot + n * normal, rng.normal(size=3)
        renderer.reset(y)
        answer = renderer.step(y, yd, 1e-3)
        if n > 0.0:
            np.testing.assert_array_equal(answer.ihip, y)
            np.testing.assert_array_equal(answer.force, 0.0)
            continue
        np.testing.assert_allclose(answer.ihip, foot, atol=1e-14)
        push = answer.force @ normal
        pressed += push > 0.0
        along = answer.force - push * normal
        assert push >= -1e-16
        w = yd - (yd @ normal) * normal
        np.testing.assert_allclose(along, -0.3 * w if push > 1e-15 else 0.0 * w, atol=1e-13)
    assert 40 < pressed < 260


def test_pressing_is_what_a_rigid_surface_would_take():
    # on top of the sphere at 0.5 m/s: m v^2 / r = 0.25 N of a push of 1 N turn the tool, the rest is the contact's
    renderer = renderer_of(sphere(0.2), bilateral=False)
    top, along = np.array([0.0, 0.0, 0.1]), np.array([0.5, 0.0, 0.0])
    for push, pressing in ((1.0, 0.75), (0.3, 0.05), (0.2, 0.0)):
        renderer.reset(top)
        renderer.observe_force(np.array([0.0, 0.0, -push]))
        force = renderer.step(top, along, 1e-3).force
        np.testing.assert_allclose(force, [0.0, 0.0, pressing], atol=1e-15)


def test_a_contact_lasts_outside_where_the_surface_is_hollow_and_pushes_there():
    # round the inside of the torus' hole the surface holds the tool in: m v^2 / (R - r) = 0.1 * 0.25 / 0.04 N
    renderer = renderer_of(torus(0.07, 0.03), bilateral=False)
    y, yd = np.array([0.04 + 1e-12, 0.0, 0.0]), np.array([0.0, 0.5, 0.0])
    renderer.reset(y)
    np.testing.assert_allclose(renderer.step(y, yd, 1e-3).force, [-0.625, 0.0, 0.0], atol=1e-9)
    beside = np.array([0.04 - 1e-6, 0.0, 0.0])
    held = renderer.step(beside, yd, 1e-3)
    assert held.force[0] == pytest.approx(-0.625, rel=1e-3)
    np.testing.assert_allclose(held.ihip, [0.04, 0.0, 0.0], atol=1e-17)
    renderer.reset(beside)
    free = renderer.step(beside, yd, 1e-3)
    np.testing.assert_array_equal(free.force, 0.0)
    np.testing.assert_array_equal(free.ihip, beside)


@pytest.mark.parametrize(
    ("model", "hip", "charts"),
    [
        (sphere(0.2), (0.0, 0.0, 0.0), False),
        (sphere(0.2), (0.0, 0.0, 0.0), True),
        (torus(0.07, 0.03), (0.07, 0.0, 0.0), False),
        (torus(0.07, 0.03), (0.0, 0.0, 0.01), False),
        # the rim of the medial disc: the centre of curvature of the vertex, c^2 / a from it
        (ellipsoid(0.1, 0.1, 0.05), (0.075, 0.0, 0.0), False),
    ],
)
def test_a_focal_point_is_a_named_error_and_a_refusal(refused, model, hip, charts):
    renderer = SurfaceStabilisation(Scene(model=model, bilateral=True, damping=5.0), atlas=charts)
    hip = np.array(hip)
    renderer.reset(hip)
    with refused(DomainError):
        renderer.step(hip, np.ones(3), 1e-3)


@pytest.mark.parametrize("charts", [False, True])
def test_a_place_that_is_no_number_is_an_error(refused, charts):
    renderer = SurfaceStabilisation(Scene(model=sphere()), atlas=charts)
    with refused(InputError):
        renderer.step(np.array([math.nan, 0.0, 0.09]), np.ones(3), 1e-3)


def test_what_it_cannot_hold_is_refused(refused):
    with refused(RefusalError):
        SurfaceStabilisation(Scene(model=circle()), atlas=False)
    with refused(InputError):
        SurfaceStabilisation(Scene(model=sphere(), bilateral=True, damping=0.0), atlas=False)
