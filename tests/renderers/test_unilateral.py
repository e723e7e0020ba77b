"""A unilateral contact whose damper knows only a filtered velocity: it gives no energy, and bounces as it must."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.parallelogram import ENCODER_STEP, Parallelogram2, Parallelogram3
from hapticeval.discovery import resolve
from hapticeval.effects.sensors import Encoder, VelocityFilter, low_pass_share
from hapticeval.geometry.catalogue import circle, line, sphere
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment

STIFFNESS, MASS = 1000.0, 0.1
CRITICAL = 2.0 * np.sqrt(STIFFNESS * MASS)
WAYS = {
    "line": (line(), "set-stabilisation", (0.0, 0.0)),
    "circle": (circle(), "set-stabilisation", (0.0, 0.1)),
    "sphere": (sphere(), "set-stabilisation", (0.0, 0.0, 0.1)),
    "atlas": (sphere(), "set-stabilisation@atlas", (0.0, 0.0, 0.1)),
}
"""Model, renderer, and a point of the surface whose outward normal is the last axis."""


def touching(ratio, **more):
    return Scene(stiffness=STIFFNESS, damping=ratio * CRITICAL, mass=MASS, **more)


def contact(run):
    """Whether there is contact, at each sample: off the surface the IHIP is the HIP."""
    return np.any(run.ihip != run.channels.get("measured_hip", run.hip), axis=1)


def flights(touches):
    """Ticks out of contact between two touches, one number a flight."""
    changes = np.flatnonzero(touches[1:] != touches[:-1])
    return np.diff(changes)[1::2] if not touches[0] else np.diff(changes)[::2]


def late(forces, hips):
    """What forces may give more, at the most, as each is held for a tick over the step (n - 1, N) that it moves."""
    change, step = (np.linalg.norm(np.diff(each, axis=0), axis=1) for each in (forces, hips))
    return float(np.sum(change * step))


def bounces(ratio, cutoff, press, speed, duration, step=1e-5):
    """The times of flight (s) on a plane in continuous time, touched at `speed` and pressed with `press`, N.

    m n̈ = N - F with N = max(0, -K n - D v) while n <= 0, v̇ = a (ṅ - v), by the exponential of each linear piece.
    """
    damping, a = ratio * CRITICAL, 2.0 * np.pi * cutoff
    free = np.array([[0, 1, 0, 0], [0, 0, 0, -press / MASS], [0, a, -a, 0], [0, 0, 0, 0]], dtype=float)
    held = free.copy()
    held[1, :3] = -STIFFNESS / MASS, 0.0, -damping / MASS
    flow = expm(free * step), expm(held * step)
    state, touch = np.array([0.0, -speed, -speed, 1.0]), True
    made, left = [], 0.0
    for k in range(round(duration / step)):
        state = flow[bool(touch and -STIFFNESS * state[0] > damping * state[2])] @ state
        if touch and state[0] > 0.0:
            touch, left = False, k
        elif not touch and state[0] <= 0.0:
            touch = True
            made.append((k - left) * step)
    return made


def pressed(scene, press, speed, duration, dt):
    """A run on a plane that begins a tick before the touch."""
    start, velocity = np.array([0.0, speed * dt]), np.array([0.1, -speed])
    trial = Experiment(duration, start, velocity, np.zeros(1), np.array([[0.0, -press]]))
    return simulate_closed_loop(resolve("set-stabilisation")(scene), trial, scene, dt)


@pytest.mark.parametrize("press", [0.3, 2.0])
@pytest.mark.parametrize("cutoff", [5.0, 20.0, 50.0, 200.0])
@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0, 4.0])
def test_it_bounces_as_its_springs_and_dampers_do_and_no_more(ratio, cutoff, press):
    """A force that is a tick late by hold and filter is wrong by an impulse of dt times its variation, at the most."""
    dt, speed, duration = 2e-5, 0.2, 0.15
    scene = touching(ratio, model=line(), sampling_time=dt, effects=(VelocityFilter(cutoff),))
    run = pressed(scene, press, speed, duration, dt)
    found, expected = dt * flights(contact(run)), bounces(ratio, cutoff, press, speed, duration)
    impulse = dt * np.sum(np.abs(np.diff(run.force[:, 1])))
    assert len(found) == len(expected)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=2.0 * impulse / press + dt)
    given_back = np.cumsum(np.sum(run.force[:-1] * np.diff(run.hip, axis=0), axis=1))
    assert given_back.max() <= 0.0


@pytest.mark.parametrize("way", WAYS)
@given(
    st.lists(st.floats(-3.0, 1.0), min_size=3, max_size=8),
    st.floats(0.0, 4.0),
    st.floats(3.0, 300.0),
    st.floats(0.02, 0.3),
)
def test_no_hand_gets_energy_out_of_a_lagging_damper(way, depths, ratio, cutoff, duration):
    """Led in and out along the normal, through depths in mm. A filter that says outwards at a touch is worth that."""
    model, name, foot = WAYS[way]
    dt = 2.5e-4
    scene = touching(ratio, model=model, sampling_time=dt, effects=(VelocityFilter(cutoff),))
    ticks = np.linspace(0.0, len(depths) + 1.0, round(duration / dt) + 1)
    n = 1e-3 * np.interp(ticks, np.arange(len(depths) + 2), [0.5, *depths, 0.5])
    hips = np.array(foot) + n[:, None] * np.eye(len(foot))[-1]
    share, rate = low_pass_share(cutoff, dt), np.zeros_like(n)
    for k in range(1, n.size):
        rate[k] = rate[k - 1] + share * ((n[k] - n[k - 1]) / dt - rate[k - 1])
    renderer = resolve(name)(scene)
    renderer.reset(hips[0])
    answers = [renderer.step(hip, v * np.eye(len(foot))[-1], dt) for hip, v in zip(hips, rate, strict=True)]
    forces = np.array([answer.force for answer in answers])
    energy = float(np.sum(forces[:-1] * np.diff(hips, axis=0)))
    begins = np.flatnonzero((n[1:] <= 0.0) & (n[:-1] > 0.0)) + 1
    # a filter of this share stores K_d T (1 - b) / 2b v^2, as a spring of stiffness K_d b / (1 - b) T in series would
    series = scene.damping * share / ((1.0 - share) * dt)
    unfelt = STIFFNESS * scene.damping * np.maximum(rate[begins], 0.0) / (STIFFNESS + series)
    assert energy <= np.sum(unfelt**2) * (0.5 / STIFFNESS + 0.5 / max(series, 1e-12)) + late(forces, hips) + 1e-15


@pytest.mark.parametrize("cutoff", [50.0, 100.0, 200.0, 400.0])
@pytest.mark.parametrize(
    ("device", "model"), [(Parallelogram2(), circle()), (Parallelogram3(), sphere())], ids=["2dof", "3dof"]
)
def test_the_robot_presses_slides_and_leaves_as_often_as_the_loop_says(device, model, cutoff):
    """With encoders too. At 50 Hz the loop is damped by half and throws the tool off once; above, it touches once."""
    press, speed = 1.0, 0.3
    scene = touching(
        1.0, model=model, device=device, inner_loop=InnerLoop.LINEARISED,
        effects=(Encoder(ENCODER_STEP), VelocityFilter(cutoff)),
    )  # fmt: skip
    size = device.dimension
    start, velocity, push = np.zeros(size), np.zeros(size), np.zeros((4, size))
    start[-1], velocity[0], velocity[-1] = 0.101, 0.05, -speed
    push[:, -1] = -press, -press, 0.5, 0.5
    trial = Experiment(0.35, start, velocity, np.array([0.0, 0.2, 0.201, 0.35]), push)
    run = simulate_closed_loop(resolve("set-stabilisation")(scene), trial, scene, 1e-3)
    touches = contact(run)
    assert not touches[0]
    assert not touches[-1]
    assert len(flights(touches)) == len(bounces(1.0, cutoff, press, speed, 0.2))
    assert np.sum(run.force[:-1] * np.diff(run.hip, axis=0)) < 0.0
