"""The factory, the gains that it takes, and the unilateral contact: no pull, no chatter, what energy it can give."""

import numpy as np
import pytest
from hand_paths import SMOOTH
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.parallelogram import ENCODER_STEP, Parallelogram2, Parallelogram3
from hapticeval.devices.point_mass import PointMass
from hapticeval.discovery import resolve
from hapticeval.effects.sensors import Encoder
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.errors import InputError, RefusalError, UnknownNameError
from hapticeval.geometry.catalogue import cassinian, circle, line, sphere, star
from hapticeval.renderers import set_stabilisation
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment

STIFFNESS, MASS = 1000.0, 0.1
CRITICAL = 2.0 * np.sqrt(STIFFNESS * MASS)


class TestFactory:
    def test_it_has_no_schemes(self, refused):
        with refused(InputError):
            resolve("set-stabilisation+pp")
        with refused(UnknownNameError):
            resolve("set-stabilisation@polygon")

    def test_an_atlas_is_for_surfaces(self, refused):
        with refused(RefusalError):
            set_stabilisation.variant(representation="atlas")(Scene(model=circle()))

    def test_corners_have_no_curvature(self, refused):
        model = star()
        with refused(RefusalError) as caught:
            set_stabilisation(Scene(model=model))
        np.testing.assert_array_equal(caught.value.position, model.curve.corners[0].position)


def largest_eigenvalue(k, d, period):
    """Of n̈ = -k n - d ṅ with the right side held for `period`, by the exponential of the held system."""
    held = np.zeros((3, 3))
    held[0, 1], held[1, 2] = 1.0, 1.0
    flow = expm(held * period)
    return float(np.max(np.abs(np.linalg.eigvals(flow[:2, :2] + np.outer(flow[:2, 2], [-k, -d])))))


class TestGains:
    @given(st.floats(1.0, 1e5), st.floats(0.0, 1e3), st.floats(0.01, 5.0), st.sampled_from([1e-4, 1e-3, 1e-2]))
    def test_they_are_refused_when_the_sampled_loop_is_unstable(self, stiffness, damping, mass, period):
        scene = Scene(
            model=circle(), stiffness=stiffness, damping=damping, mass=mass, bilateral=True, sampling_time=period
        )
        size = largest_eigenvalue(stiffness / mass, damping / mass, period)
        if size > 1.0 + 1e-9:
            with pytest.raises(InputError) as caught:
                set_stabilisation(scene)
            assert float(caught.value.why.split("size ")[1].split(";")[0]) == pytest.approx(size, rel=1e-6)
        elif size < 1.0 - 1e-9:
            set_stabilisation(scene)

    def test_the_error_says_which_gains_are_stable(self, refused):
        """A damping below 2 m / T = 200 N s/m, with a stiffness below 2 K_d / T = 8000 N/m."""
        with refused(InputError):
            set_stabilisation(Scene(model=circle(), stiffness=9000.0, damping=4.0, mass=0.1, bilateral=True))

    def test_not_where_the_hand_or_another_mass_is_in_the_loop(self, refused):
        stiff = {"stiffness": 9000.0, "damping": 0.0, "mass": 0.1}
        set_stabilisation(Scene(model=circle(), **stiff))
        set_stabilisation(Scene(model=circle(), bilateral=True, device=Parallelogram2(), **stiff))
        set_stabilisation(Scene(model=circle(), bilateral=True, device=PointMass(0.2), **stiff))
        with refused(InputError):
            set_stabilisation(Scene(model=circle(), bilateral=True, device=PointMass(0.1), **stiff))
        linearised = {"device": Parallelogram2(), "inner_loop": InnerLoop.LINEARISED}
        with refused(InputError):
            set_stabilisation(Scene(model=circle(), bilateral=True, **linearised, **stiff))

    def test_viscosity_too(self, refused):
        gains = {"stiffness": 50.0, "damping": 4.47, "mass": 0.1, "bilateral": True}
        set_stabilisation(Scene(model=circle(), effects=(Viscosity(199.0),), **gains))
        with refused(InputError):
            set_stabilisation(Scene(model=circle(), effects=(Viscosity(200.0),), **gains))


def driven(scene, position, velocity, push, count, dt=1e-3):
    """A point mass in closed loop: rows of position, velocity and force, and whether a force is felt."""
    renderer, device = set_stabilisation(scene), PointMass(scene.mass)
    renderer.reset(position)
    rows = np.empty((count, 6))
    for tick in range(count):
        force = renderer.step(position, velocity, dt).force
        rows[tick] = *position, *velocity, *force
        given = push(tick * dt, position)
        position, velocity = device.advance(position, velocity, force, given, given, dt)
    return rows, np.any(rows[:, 4:] != 0.0, axis=1)


def switches(felt):
    return int(np.sum(felt[1:] != felt[:-1]))


def touching(damping=CRITICAL, **more):
    return Scene(stiffness=STIFFNESS, damping=damping, mass=MASS, **more)


class TestContact:
    @pytest.mark.parametrize("name", SMOOTH)
    def test_it_never_pulls_and_is_normal(self, name):
        model = SMOOTH[name]
        renderer, curve = set_stabilisation(touching(model=model)), model.curve
        rng = np.random.default_rng(1)
        u = rng.uniform(*((-0.1, 0.1) if not curve.closed else curve.u_range), 3000)
        hips = curve.position(u) + rng.uniform(-2e-3, 1e-3, 3000)[:, None] * curve.normal(u)
        frame = curve.closest_point(hips)
        forces = np.array(
            [renderer.step(*pair, 1e-3).force for pair in zip(hips, rng.normal(size=(3000, 2)), strict=True)]
        )
        pressing = np.sum(forces * frame.normal, axis=1)
        assert np.all(pressing >= 0.0)
        assert np.mean(pressing > 0.0) > 0.2
        assert np.any(pressing[frame.distance < 0.0] == 0.0)
        np.testing.assert_allclose(forces, pressing[:, None] * frame.normal, atol=1e-12)

    @pytest.mark.parametrize("damping", [0.5 * CRITICAL, CRITICAL, 2.0 * CRITICAL])
    @pytest.mark.parametrize("name", ["circle", "line"])
    def test_a_press_touches_once_and_leaves_once(self, name, damping):
        """At 0.3 m/s and 0.2 m/s along, pressed with 1 N for half a second, and then drawn away."""
        scene = touching(damping, model=SMOOTH[name])
        curve = scene.model.curve

        def push(t, y):
            normal = curve.closest_point(y[None]).normal[0]
            return (-1.0 if t < 0.5 else 0.5) * normal

        start = np.array([0.0, 0.01 if name == "line" else 0.11])
        rows, felt = driven(scene, start, np.array([0.2, -0.3]), push, 1000)
        assert switches(felt) == 2
        assert not felt[-1]
        depth = -curve.signed_distance(rows[450:500, :2])
        np.testing.assert_allclose(depth, 1.0 / STIFFNESS, rtol=2e-3)

    @pytest.mark.parametrize("encoders", [(), (Encoder(ENCODER_STEP),)], ids=["exact", "encoders"])
    @pytest.mark.parametrize("loop", list(InnerLoop))
    @pytest.mark.parametrize(
        ("device", "model"), [(Parallelogram2(), circle()), (Parallelogram3(), sphere())], ids=["2dof", "3dof"]
    )
    def test_so_does_the_robot_and_is_given_nothing(self, device, model, loop, encoders):
        """Whatever the inner loop makes of the force, it takes energy from the tool between touching and leaving."""
        scene = touching(model=model, device=device, inner_loop=loop, effects=encoders)
        size = device.dimension
        start, velocity, push = np.zeros(size), np.zeros(size), np.zeros((4, size))
        start[-1], velocity[0], velocity[-1] = 0.11, 0.05, -0.3
        push[:, -1] = -1.0, -1.0, 0.5, 0.5
        trial = Experiment(0.35, start, velocity, np.array([0.0, 0.2, 0.201, 0.35]), push)
        run = simulate_closed_loop(set_stabilisation(scene), trial, scene, 1e-3)
        felt = np.any(run.force != 0.0, axis=1)
        assert "ended" not in run.meta
        assert switches(felt) == 2
        assert not felt[0]
        assert not felt[-1]
        assert np.sum(run.force[:-1] * np.diff(run.hip, axis=0)) < -1e-3

    def test_sliding_through_a_valley_it_lets_go_once_where_the_surface_turns_convex(self):
        """Nothing presses but the bend of the way, and sampling lays the tool on both sides of the surface."""
        scene = touching(model=cassinian())
        curve = scene.model.curve
        u = np.pi / 4.0 - 0.2
        rows, felt = driven(scene, curve.position(u), 0.5 * curve.tangent(u), lambda *_: np.zeros(2), 300)
        frame = curve.closest_point(rows[:, :2])
        assert felt[0]
        assert switches(felt) == 1
        last = int(np.flatnonzero(felt)[-1])
        assert 0 <= int(np.argmax(np.trace(frame.shape, axis1=1, axis2=2) > 0.0)) - last <= 5
        assert frame.distance[felt].min() < 0.0 < frame.distance[felt].max() < 2e-5

    def test_with_a_sensor_it_carries_what_the_hand_presses_and_rests_on_the_surface(self):
        renderer, push = set_stabilisation(touching(model=line())), np.array([0.3, -2.0])
        position, velocity, device = np.array([0.0, 1e-3]), np.array([0.1, -0.2]), PointMass(MASS)
        renderer.reset(position)
        felt = []
        for _ in range(500):
            renderer.observe_force(push)
            force = renderer.step(position, velocity, 1e-3).force
            felt.append(bool(np.any(force != 0.0)))
            position, velocity = device.advance(position, velocity, force, push, push, 1e-3)
        assert switches(np.array(felt)) == 1
        np.testing.assert_allclose(force, (0.0, 2.0), atol=1e-9)
        np.testing.assert_allclose(position[1], 0.0, atol=1e-9)
        np.testing.assert_allclose(velocity[0], 0.1 + 0.5 * 0.3 / MASS, rtol=1e-12)


def led(scene, hips, velocities, dt):
    """Forces on a hand that is led, sampled, and the energy that they give it while they are held (J)."""
    renderer = set_stabilisation(scene)
    renderer.reset(hips[0])
    forces = np.array([renderer.step(*pair, dt).force for pair in zip(hips, velocities, strict=True)])
    return forces, float(np.sum(forces[:-1] * np.diff(hips, axis=0)))


def in_and_out(curve, times, seed=None):
    """A hand along a curve, in and out of contact, that starts and ends 1 mm outside: (points, velocities).

    Without a seed on a circle, with r θ̇^2 constant, which leaves its centripetal force as it is.
    """
    end = times[-1]
    rng = np.random.default_rng(seed)
    turns = np.arange(1, 6)
    weights = np.array([2.0, 0.5, 0.5, 0.5, 0.5]) * (rng.uniform(0.5, 1.0, 5) if seed is not None else 1.0) * 1e-3
    phase = 2.0 * np.pi * turns * times[:, None] / end
    n = 1e-3 - np.sum(weights * (1.0 - np.cos(phase)), axis=1)
    across = -np.sum(weights * 2.0 * np.pi * turns / end * np.sin(phase), axis=1)
    if seed is None:
        r = 0.1 + n
        turning = np.sqrt(3.0 / r)
        angle = np.concatenate([[0.0], np.cumsum(0.5 * (turning[1:] + turning[:-1]) * np.diff(times))])
        out, round_ = (
            np.column_stack([np.cos(angle), np.sin(angle)]),
            np.column_stack([-np.sin(angle), np.cos(angle)]),
        )
        return r[:, None] * out, across[:, None] * out + (r * turning)[:, None] * round_
    swing = rng.normal(size=3) * 0.3
    rates = 2.0 * np.pi * np.arange(1, 4) / end
    u = rng.uniform(0.0, 2.0 * np.pi) + np.sum(swing * np.sin(rates * times[:, None]), axis=1)
    du = np.sum(swing * rates * np.cos(rates * times[:, None]), axis=1)
    speed = du * np.hypot(*curve._evaluate(u)[..., 2:4].T)
    normal, tangent = curve.normal(u), curve.tangent(u)
    stretch = 1.0 + n * curve.curvature(u)
    return curve.position(u) + n[:, None] * normal, (stretch * speed)[:, None] * tangent + across[:, None] * normal


class TestEnergy:
    def test_a_cycle_at_a_constant_centripetal_force_gives_nothing_but_what_sampling_does(self):
        """Undamped. The held force lags by T/2, so that W = -(T/2) ∫ Ḟ·ẏ dt = (T/2) ∫ (K ṅ^2 - N κ ṡ w) dt + O(T^2)."""
        scene = touching(0.0, model=circle())
        given, lag = [], []
        for dt in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
            times = np.linspace(0.0, 0.5, round(0.5 / dt) + 1)
            hips, velocities = in_and_out(scene.model.curve, times)
            forces, energy = led(scene, hips, velocities, dt)
            r = np.linalg.norm(hips, axis=1)
            press, across = np.linalg.norm(forces, axis=1), np.sum(hips * velocities, axis=1) / r
            w = np.sqrt(np.sum(velocities**2, axis=1) - across**2)
            felt = press > 0.0
            lag.append(0.5 * dt * np.sum(np.where(felt, STIFFNESS * across**2 - press * w**2 / r, 0.0)) * dt)
            given.append(energy)
        assert 0.05 < np.mean(felt) < 0.95
        stored = 0.5 * STIFFNESS * (np.max(0.1 - r)) ** 2
        assert 1e-3 < abs(given[0]) / stored < 0.2
        np.testing.assert_allclose(given[1:], lag[1:], rtol=0.02)
        np.testing.assert_allclose(np.divide(given[:-1], given[1:]), 2.0, rtol=0.05)

    @pytest.mark.parametrize("damping", [0.0, CRITICAL])
    @pytest.mark.parametrize("seed", range(6))
    def test_any_cycle_gives_no_more_than_the_storage_function_allows(self, seed, damping):
        """∫ F·ẏ <= Σ C^2 / 2K at touches of concave stretches + ∫ (S / K) (-Ċ)+ dt, up to what is held too long."""
        scene = touching(damping, model=cassinian())
        curve = scene.model.curve
        excess = []
        for dt in (2e-4, 1e-4):
            hips, velocities = in_and_out(curve, np.linspace(0.0, 0.5, round(0.5 / dt) + 1), seed)
            forces, energy = led(scene, hips, velocities, dt)
            frame = curve.closest_point(hips)
            n, kappa = frame.distance, np.trace(frame.shape, axis1=1, axis2=2)
            along = velocities[:, 1] * frame.normal[:, 0] - velocities[:, 0] * frame.normal[:, 1]
            centripetal = MASS * kappa * along**2 / (1.0 + n * kappa)
            stored = np.maximum(-STIFFNESS * n - centripetal, 0.0)
            on = (n <= 0.0) | np.any(forces != 0.0, axis=1)
            begins = np.flatnonzero(on[1:] & ~on[:-1]) + 1
            loaded = np.sum(np.maximum(-centripetal[begins], 0.0) ** 2) / (2.0 * STIFFNESS)
            falls = np.maximum(-np.diff(centripetal), 0.0) * stored[:-1] * on[:-1]
            late = np.sum(
                np.linalg.norm(np.diff(forces, axis=0), axis=1) * np.linalg.norm(np.diff(hips, axis=0), axis=1)
            )
            assert len(begins) >= 1
            assert energy <= loaded + np.sum(falls) / STIFFNESS + late
            excess.append(late)
        assert excess[1] < 0.6 * excess[0]

    def test_what_a_loaded_surface_gives_as_the_tool_is_braked(self):
        """Pressed at 0.8 m/s, braked at depth, and let go: the bound is sharp, so the statement needs its last term."""
        scene, dt = touching(0.0, model=circle()), 2e-5
        times = np.arange(0.0, 0.6, dt)
        depth = 3e-3 * np.interp(times, [0.0, 0.2, 0.4, 0.6], [0.0, 1.0, 1.0, 0.0])
        w = np.interp(times, [0.0, 0.2, 0.4, 0.6], [0.8, 0.8, 0.0, 0.0])
        r = 0.1 - depth
        angle = np.cumsum(w / r) * dt
        out = np.column_stack([np.cos(angle), np.sin(angle)])
        hips = r[:, None] * out
        velocities = w[:, None] * np.column_stack([-out[:, 1], out[:, 0]]) - np.gradient(depth, dt)[:, None] * out
        _, energy = led(scene, hips, velocities, dt)
        centripetal = MASS * w**2 / r
        expected = np.sum(np.maximum(STIFFNESS * depth - centripetal, 0.0)[:-1] * -np.diff(centripetal)) / STIFFNESS
        assert expected > 1e-3
        assert energy == pytest.approx(expected, rel=0.02)
