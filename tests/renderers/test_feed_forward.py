"""The cheap alternative to set stabilisation: PP+PD and the centripetal force; what it does, and what it lacks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hapticeval.compiled import for_kernels
from hapticeval.discovery import resolve
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, ellipse, line, sphere, torus
from hapticeval.geometry.kernels import curvature_rate
from hapticeval.renderers import constraint, minimum_distance, set_stabilisation
from hapticeval.scene import Scene

MASS, K, D = 0.1, 500.0, 44.7
follows = minimum_distance.variant(regulation="pp-pd-c")


def bilateral_scene(model):
    return Scene(model=model, stiffness=K * MASS, damping=D * MASS, mass=MASS, bilateral=True)


def test_its_name_is_found_and_offered_where_it_can_work():
    assert resolve("minimum-distance+pp-pd-c") == follows
    assert "pp-pd-c" in minimum_distance.regulations
    assert "pp-pd-c" not in constraint.regulations


@pytest.mark.parametrize(
    ("family", "representation"),
    [*((minimum_distance, each) for each in ("polygon", "level-set", "lut")), (constraint, "curve")],
)
def test_other_projections_and_representations_have_no_curvature(refused, family, representation):
    with refused(InputError):
        family.variant(regulation="pp-pd-c", representation=representation)


def circling(family, model, n, speed, duration=2.0):
    """Distance from a circle, after a start at n beside it, across nothing and along it at `speed`."""
    renderer = family(bilateral_scene(model))

    def rate(_, state):
        return np.concatenate([state[2:], renderer.step(state[:2], state[2:], 1e-3).force / MASS])

    times = np.linspace(0.0, duration, 41)
    solution = solve_ivp(
        rate, (0.0, duration), [0.1 + n, 0.0, 0.0, speed], t_eval=times, method="DOP853", rtol=1e-12, atol=1e-14
    )
    assert solution.success
    return np.hypot(*solution.y[:2]) - 0.1


def test_on_the_circle_it_stays_where_pp_pd_runs_out():
    model = circle()
    assert np.max(np.abs(circling(follows, model, 0.0, 0.5))) < 1e-10
    assert circling(minimum_distance.variant(regulation="pp-pd"), model, 0.0, 0.5)[-1] == pytest.approx(
        0.0043947486858864, rel=1e-6
    )


@given(st.integers(0, 10_000))
@pytest.mark.parametrize("model", [cassinian(), ellipse(), circle()], ids=lambda model: model.name)
def test_what_it_lacks_off_the_surface(model, seed):
    """n̈ - v⊥ = κ w^2 (1/(1 + n κ) - 1) and (1 + n κ) s̈ = -(2 κ ṅ ṡ + n κ' ṡ^2); set stabilisation makes both zero."""
    rng, curve = np.random.default_rng(seed), model.curve
    u, n, (along, across) = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-5e-3, 5e-3), rng.normal(size=2)
    if model.name == "circle":
        u *= 0.1
    kappa, normal, tangent = float(curve.curvature(u)), curve.normal(u), curve.tangent(u)
    hip, velocity = curve.position(u) + n * normal, along * tangent + across * normal
    stretch = 1.0 + n * kappa
    foot = along / stretch

    def coordinates(family):
        """n̈ and s̈ that a force gives, as `curve_law` has them."""
        renderer = family(bilateral_scene(model))
        renderer.reset(hip)
        acceleration = renderer.step(hip, velocity, 1e-3).force / MASS
        turning = 2.0 * kappa * across * foot + n * curvature_rate(for_kernels(curve.pieces[0]), u) * foot**2
        return (
            normal @ acceleration + kappa * stretch * foot**2 + K * n + D * across,
            (tangent @ acceleration - turning) / stretch,
            turning,
        )

    depth, slide, turning = coordinates(follows)
    scale = 1.0 + abs(kappa) * (along**2 + abs(along * across))
    assert depth == pytest.approx(kappa * along**2 * (1.0 / stretch - 1.0), abs=1e-9 * scale)
    assert slide == pytest.approx(-turning / stretch, abs=1e-8 * scale)
    depth, slide, _ = coordinates(set_stabilisation)
    assert depth == pytest.approx(0.0, abs=1e-9 * scale)
    assert slide == pytest.approx(0.0, abs=1e-8 * scale)


def test_on_a_line_it_is_pp_pd():
    rng = np.random.default_rng(1)
    pair = [family(bilateral_scene(line())) for family in (follows, minimum_distance.variant(regulation="pp-pd"))]
    for hip, velocity in rng.normal(size=(20, 2, 2)):
        forces = [renderer.step(hip, velocity, 1e-3).force for renderer in pair]
        np.testing.assert_array_equal(*forces)


@pytest.mark.parametrize("model", [sphere(), torus()], ids=lambda model: model.name)
def test_in_space_the_term_is_that_of_the_shape_operator(model):
    rng = np.random.default_rng(2)
    pair = [family(bilateral_scene(model)) for family in (follows, minimum_distance.variant(regulation="pp-pd"))]
    for hip, velocity in zip(0.08 * rng.normal(size=(30, 3)), rng.normal(size=(30, 3)), strict=True):
        frame = model.boundary.closest_point(hip[None])
        with_term, without = (renderer.step(hip, velocity, 1e-3).force for renderer in pair)
        expected = -MASS * (velocity @ frame.shape[0] @ velocity) * frame.normal[0]
        np.testing.assert_allclose(with_term - without, expected, rtol=1e-9, atol=1e-12)
