"""Models and hand paths that the tests of the renderers share."""

import math

import numpy as np
from hypothesis import strategies as st

from hapticeval.geometry.catalogue import from_vertices
from hapticeval.recordings.recording import backward_difference


@st.composite
def star_shaped(draw):
    """A random polygon that is star-shaped about the origin: arms, notches, and slivers, about 0.1 m in radius."""
    count = draw(st.integers(3, 14))
    steps = draw(st.lists(st.floats(0.3, 1.0), min_size=count, max_size=count))
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
