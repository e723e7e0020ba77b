"""The closed loop against errata-checked solutions of thesis Tables 6.1 and 6.2."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.closed_loop import drive
from hapticeval.discovery import resolve
from hapticeval.errors import RendererError
from hapticeval.geometry.catalogue import circle, line
from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.stimulus import Experiment

K, D = 500.0, 44.7


def final(name, model, position, velocity, time, dt):
    scene = Scene(model=model, stiffness=K, damping=D, mass=1.0, bilateral=True)
    rest = Experiment(time, np.array(position), np.array(velocity), np.zeros(1), np.zeros((1, 2)))
    recording = drive(resolve(name)(scene), rest, scene, dt)
    assert recording.time[-1] == pytest.approx(time, abs=1e-12)
    return recording.hip[-1], recording.velocity[-1]


def continuous(name, model, position, velocity, time):
    """The limit of no sampling: the held force is wrong by c1 T + c2 T^2 + ..., eliminated from three runs."""
    runs = [np.concatenate(final(name, model, position, velocity, time, dt)) for dt in (1e-3, 5e-4, 2.5e-4, 1.25e-4)]
    first = [2.0 * fine - coarse for coarse, fine in pairwise(runs)]
    second = [(4.0 * fine - coarse) / 3.0 for coarse, fine in pairwise(first)]
    return (8.0 * second[1] - second[0]) / 7.0, np.abs(runs[1] - runs[0]), np.abs(runs[2] - runs[1])


@pytest.mark.parametrize(
    ("scheme", "r", "theta", "rate"),
    [
        ("pp", 1.01038366961, 2.28837605467, 4.89775850843),
        ("pp-v", 1.00000247881, 0.111444857817, 9.82847598e-10),
        ("pp-d", 1.01838386010, 1.83829638290, 2.76900536881),
        ("pp-pd", 1.04394916959, 2.32569936046, 4.58787205567),
    ],
)
def test_circle_reaches_the_continuous_solution_as_sampling_refines(scheme, r, theta, rate):
    """Table 6.2 at t = 0.5 s, r_c = 1 m, 5 m/s along the circle."""
    state, coarse, fine = continuous(f"minimum-distance+{scheme}@curve", circle(size=2.0), (1.0, 0.0), (0.0, 5.0), 0.5)
    hip, velocity = state[:2], state[2:]
    assert np.hypot(*hip) == pytest.approx(r, abs=2e-6)
    assert np.arctan2(hip[1], hip[0]) == pytest.approx(theta, abs=2e-6)
    assert (hip[0] * velocity[1] - hip[1] * velocity[0]) / (hip @ hip) == pytest.approx(rate, abs=2e-5)
    assert np.max(fine) < 0.6 * np.max(coarse)


@pytest.mark.parametrize(
    ("scheme", "y1", "y2", "rate1", "rate2"),
    [
        ("pp", 0.5, -0.43960172525948, 3.0, 1.8371612815547),
        ("pp-d", 0.5, 6.8715367402718e-5, 3.0, -1.4038703463303e-3),
        ("pp-pd", 0.5, 6.8715367402718e-5, 3.0, -1.4038703463303e-3),
        ("transversal", 0.5, 6.8715367402718e-5, 3.0, -1.4038703463303e-3),
        ("pp-v", -0.93288590605346, 6.8715367402718e-5, 5.8971148e-10, -1.4038703463303e-3),
    ],
)
def test_line_reaches_the_closed_form_as_sampling_refines(scheme, y1, y2, rate1, rate2):
    """Table 6.1 at t = 0.5 s from (-1, 0) with (3, 10) m/s."""
    state, _, _ = continuous(f"constraint+{scheme}", line(), (-1.0, 0.0), (3.0, 10.0), 0.5)
    np.testing.assert_allclose(state, [y1, y2, rate1, rate2], atol=2e-5)


def test_a_held_spring_grows_as_its_sampled_eigenvalue_says():
    """PP alone at 1 kHz: |z| = 1.000124992188 a tick, so an undamped loop gains energy."""
    dt, ticks = 1e-3, 4000
    scene = Scene(model=line(), stiffness=K, mass=1.0, bilateral=True)
    start = Experiment(ticks * dt, np.array([0.0, 1e-3]), np.zeros(2), np.zeros(1), np.zeros((1, 2)))
    recording = drive(resolve("constraint")(scene), start, scene, dt)
    # The quadratic form of the sampled map y+ = y + T v - a y/2, v+ = v - a y/T is multiplied by z z* a tick.
    a = K * dt * dt
    y, v = recording.hip[:, 1], recording.velocity[:, 1] * dt
    form = a * y**2 + v**2 - 0.5 * a * y * v
    growth = (form[-1] / form[0]) ** (1.0 / (2 * ticks))
    assert growth == pytest.approx(1.000124992188, abs=1e-12)


def test_centripetal_error_of_a_steady_orbit():
    """PP+PD settles on r = 1.043947486858864 (K_p r^3 (r - r_c) = L^2) in the limit of no sampling."""
    state, _, _ = continuous("minimum-distance+pp-pd@curve", circle(size=2.0), (1.0, 0.0), (0.0, 5.0), 2.0)
    assert np.hypot(*state[:2]) == pytest.approx(1.04394748686, abs=2e-6)


class Constant:
    def __init__(self, force):
        self.force = np.array(force)

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        return Response(hip, self.force)


@given(
    force=st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
    slope=st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
    mass=st.floats(0.05, 5.0),
)
def test_a_point_mass_integrates_a_ramp_exactly(force, slope, mass):
    """With a constant renderer and a linear push the motion is a cubic, whatever the sampling."""
    force, slope = np.array(force), np.array(slope)
    ramp = Experiment(
        0.5, np.zeros(2), np.array([0.3, -0.1]), np.array([0.0, 0.5]), np.array([[0.0, 0.0], 0.5 * slope])
    )
    recording = drive(Constant(force), ramp, Scene(model=line(), mass=mass), 0.01)
    t = recording.time[:, None]
    expected = np.array([0.3, -0.1]) * t + (force * t**2 / 2 + slope * t**3 / 6) / mass
    np.testing.assert_allclose(recording.hip, expected, atol=1e-12 * (1 + np.abs(expected).max()))
    moved = mass * np.diff(recording.velocity, axis=0)
    pushed = 0.01 * (recording.force + recording.channels["operator_force"])[:-1]
    np.testing.assert_allclose(moved, pushed, atol=1e-12)


def test_a_loop_that_runs_away_is_stopped_at_its_tick():
    class Explosive:
        def reset(self, hip):
            pass

        def step(self, hip, velocity, dt):
            return Response(hip, 1e9 * hip)

    push = Experiment(1.0, np.array([1e-3, 0.0]), np.zeros(2), np.zeros(1), np.zeros((1, 2)))
    with pytest.raises(RendererError, match="ran away") as caught:
        drive(Explosive(), push, Scene(model=line(), mass=0.1), 1e-3)
    assert caught.value.tick > 0
