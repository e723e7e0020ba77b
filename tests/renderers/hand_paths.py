"""Models, hand paths and motions that the tests of the renderers share."""

import math

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipse, from_vertices, line
from hapticeval.recordings.recording import backward_difference

SMOOTH = {model.name: model for model in (cassinian(), circle(), dumbbell(), ellipse(), line())}


@st.composite
def star_shaped(draw):
    """A random polygon that is star-shaped about the origin: arms, notches, and slivers, about 0.1 m in radius."""
    count = draw(st.integers(3, 14))
    steps = draw(st.lists(st.floats(0.3, 1.0), min_size=count, max_size=count))
    assume(max(steps) < 0.49 * sum(steps))  # else the origin may lie outside
    radii = draw(st.lists(st.floats(0.02, 0.12), min_size=count, max_size=count))
    angles = np.cumsum(steps) * (2.0 * math.pi / sum(steps))
    return np.column_stack([np.cos(angles), np.sin(angles)]) * np.array(radii)[:, None]


@st.composite
def walks(draw, *, most=60):
    """HIPs (n, 2), m: leaps of any size within 0.15 m, or a random walk, from anywhere."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    count = draw(st.integers(2, most))
    step = draw(st.sampled_from([None, 0.02, 0.005]))
    if step is None:
        return rng.uniform(-0.15, 0.15, (count, 2))
    return rng.uniform(-0.12, 0.12, 2) + np.cumsum(rng.normal(size=(count, 2)) * step, axis=0) * 0.6


def plate(thickness, length=0.2):
    """A thin plate along x, its upper face at y = 0."""
    half = length / 2.0
    return from_vertices([(-half, -thickness), (half, -thickness), (half, 0.0), (-half, 0.0)])


def ticked(renderer, hips, dt=1e-3):
    """What `reset` and a `step` a row answer, with the velocity that `run` uses."""
    velocities = backward_difference(hips, dt * np.arange(len(hips)))
    renderer.reset(hips[0])
    responses = [renderer.step(hip, velocity, dt) for hip, velocity in zip(hips, velocities, strict=True)]
    return np.array([r.ihip for r in responses]), np.array([r.force for r in responses])


def touching(hips, ihips, forces):
    """Where the renderer is in contact (n,)."""
    return np.any(hips != ihips, axis=1) | np.any(forces != 0.0, axis=1)


def damped(time, n, rate, k_p, k_d):
    """n(t) and ṅ(t) of n̈ + k_d ṅ + k_p n = 0 from `n` and `rate`, in closed form."""
    first, second = np.roots([1.0, k_d, k_p]).astype(complex)
    a, b = np.linalg.solve([[1.0, 1.0], [first, second]], [n, rate])
    one, two = a * np.exp(first * time), b * np.exp(second * time)
    return (one + two).real, (first * one + second * two).real


def moved(renderer, start, times, mass, push=None, *, sensed=True, rtol=3e-14):
    """States (n, 2 N) at `times` of a mass that the renderer's force and a `push` move, nothing sampled."""
    size = len(start) // 2
    given = np.zeros(size) if push is None else np.array(push)

    def rate(_, state):
        if sensed and push is not None:
            renderer.observe_force(given)
        force = renderer.step(state[:size], state[size:], 1e-3).force
        return np.concatenate([state[size:], (force + given) / mass])

    renderer.reset(start[:size])
    solution = solve_ivp(rate, (0.0, times[-1]), start, t_eval=times, method="DOP853", rtol=rtol, atol=rtol / 20.0)
    assert solution.success
    return solution.y.T
