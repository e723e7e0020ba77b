"""The virtual coupling of Colgate: a simulated tool sinks in by a known share, and gives no energy."""

import math

import numpy as np
import pytest
from hand_paths import plate, ticked
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hapticeval.geometry.catalogue import circle, line
from hapticeval.renderers.field.catalogue import coupled
from hapticeval.scene import Scene

K, M = 1000.0, 0.1
B = 2.0 * math.sqrt(K * M)


def led(model, hips, ratio=10.0, dt=1e-3, **scene):
    return ticked(coupled.with_knobs(ratio=ratio)(Scene(model=model, **scene)), np.asarray(hips, dtype=float), dt)


@given(depth=st.floats(1e-4, 0.03), ratio=st.floats(1.0, 50.0), stiffness=st.floats(100.0, 2000.0))
def test_at_rest_both_springs_are_in_series(depth, ratio, stiffness):
    hips = np.vstack([[[0.0, 0.001]], np.tile([0.0, -depth], (3000, 1))])
    ihips, forces = led(line(), hips, ratio, stiffness=stiffness)
    np.testing.assert_allclose(ihips[-1], [0.0, -depth / (1.0 + ratio)], rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(forces[-1, 1], stiffness * depth * ratio / (1.0 + ratio), rtol=1e-3)


def test_in_free_space_the_tool_follows_as_its_equation_says():
    """m x'' = K (h - x) + B (h' - x'), solved to rounding: the tick's error goes with the tick."""

    def hand(t):
        return 0.01 * np.sin(10.0 * t), 0.1 * np.cos(10.0 * t)

    exact = solve_ivp(
        lambda t, s: [s[1], (K * (hand(t)[0] - s[0]) + B * (hand(t)[1] - s[1])) / M], (0.0, 0.5), [0.0, 0.0],
        rtol=1e-10, atol=1e-12, dense_output=True,
    )  # fmt: skip
    worst = []
    for dt in (1e-3, 5e-4):
        t = dt * np.arange(int(0.5 / dt))
        hips = np.column_stack([hand(t)[0], np.full_like(t, 0.5)])
        ihips, _ = led(line(), hips, dt=dt)
        worst.append(np.abs(ihips[:, 0] - exact.sol(t)[0]).max())
    assert worst[0] < 6e-4
    assert worst[1] == pytest.approx(0.5 * worst[0], rel=0.15)


@settings(max_examples=20)
@given(speed=st.floats(0.01, 0.3), ratio=st.sampled_from([2.0, 10.0, 50.0]))
def test_the_surface_never_pulls_the_tool(speed, ratio):
    heights = np.concatenate([np.linspace(0.01, -0.005, 300), np.linspace(-0.005, 0.05, int(0.055 / speed / 1e-3))])
    hips = np.column_stack([np.zeros_like(heights), heights])
    ihips, _ = led(line(), hips, ratio)
    # what is left of m v' when the coupling is taken off: the contact's force on the tool
    moved, hand = np.diff(ihips, axis=0) / 1e-3, np.diff(hips, axis=0)[1:] / 1e-3
    coupling = K * (hips[1:-1] - ihips[1:-1]) + B * (hand - moved[1:])
    contact = M * np.diff(moved, axis=0) / 1e-3 - coupling
    assert contact[:, 1].min() >= -1e-9
    np.testing.assert_allclose(contact[:, 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(contact[ihips[1:-1, 1] > 0.0], 0.0, atol=1e-9)


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_hand_gets_no_more_than_it_has_put_in(seed):
    rng = np.random.default_rng(seed)
    phases, rates = rng.uniform(0.0, 6.28, 2), rng.uniform(0.5, 6.0, 2)
    t = 1e-3 * np.arange(2000)
    path = np.column_stack([np.sin(rates[0] * t + phases[0]), 2.0 * np.sin(rates[1] * t + phases[1])])
    start = np.array([0.115, 0.0])  # in free space, where nothing is stored
    hips = start + (np.minimum(t / 0.5, 1.0) ** 2)[:, np.newaxis] * ([0.1, 0.0] + 0.01 * path - start)
    _, forces = led(circle(), hips)
    work = np.cumsum(np.sum(0.5 * (forces[1:] + forces[:-1]) * np.diff(hips, axis=0), axis=1))
    assert work.max() <= 1e-6


def test_with_the_hand_at_one_speed_in_free_space_nothing_is_felt():
    renderer = coupled(Scene(model=line()))
    start, velocity = np.array([0.0, 0.05]), np.array([0.1, -0.3])
    renderer.reset(start)
    for tick in range(100):
        hip = start + 1e-3 * tick * velocity
        ihip, force = renderer.step(hip, velocity, 1e-3)
        np.testing.assert_allclose(ihip, hip, atol=1e-15)
        np.testing.assert_allclose(force, 0.0, atol=1e-12)


def test_it_tunnels_through_a_plate_by_the_nearest_face():
    hips = np.vstack([np.tile([0.0, 0.005], (5, 1)), np.column_stack([np.zeros(600), np.linspace(0.005, -0.03, 600)])])
    assert led(plate(1e-3), hips)[0][-1, 1] < -1e-3
    assert led(plate(2e-2), hips)[0][-1, 1] > -5e-3


def test_it_says_whether_the_tool_touches():
    renderer = coupled(Scene(model=line()))
    renderer.reset(np.array([0.0, 0.01]))
    _, force = renderer.step(np.array([0.001, 0.01]), np.array([1.0, 0.0]), 1e-3)
    assert renderer.contact is False
    assert np.linalg.norm(force) > 0.0
    ticked(renderer, np.array([[0.0, 0.001], *[[0.0, -0.005]] * 200]))
    assert renderer.contact is True
