"""The ideal contact with a hand that draws the tool, against the closed loop's integrator and a stiff spring."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.discovery import resolve
from hapticeval.errors import RefusalError
from hapticeval.geometry.boundary import SurfaceInSpace
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.model import Model
from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment, Hand, Path

MASS = 0.1


class Nothing:
    """Free space."""

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        return Response(hip, np.zeros(2))


def drawn(points, *, stiffness=200.0, damping=5.0, start=None):
    path = Path(np.linspace(0.0, 1.0, len(points)), np.array(points, dtype=float))
    hand = Hand(path=path, stiffness=stiffness, damping=damping)
    begin = np.array(points[0] if start is None else start, dtype=float)
    return Experiment(1.0, begin, np.array([0.1, 0.0]), np.array([0.0, 0.4]), np.array([[0.3, 0.0], [0.1, 0.2]]), hand)


@settings(max_examples=25)
@given(share=st.sampled_from([0.0, 0.3, 1.0, 4.0]), stiffness=st.floats(5.0, 2000.0))
def test_free_flight_is_the_integrators_whatever_the_grips_damping(share, stiffness):
    """Ringing, critical and creeping hands: closed form against the plant's integrator."""
    damping = share * 2.0 * np.sqrt(stiffness * MASS)
    experiment = drawn([[0.0, 0.3], [0.1, 0.35], [0.05, 0.3]], stiffness=stiffness, damping=damping)
    scene = Scene(model=make_model("line"), mass=MASS)
    ideal, loop = (simulate_closed_loop(each, experiment, scene, 1e-3) for each in (resolve("ideal")(scene), Nothing()))
    np.testing.assert_allclose(ideal.hip, loop.hip, atol=1e-9)
    np.testing.assert_allclose(ideal.velocity, loop.velocity, atol=1e-7)


@pytest.mark.parametrize(
    ("model", "points"),
    [("line", [[0.0, 0.02], [0.1, -0.02], [0.2, 0.03]]), ("circle", [[0.0, 0.12], [0.05, 0.08], [0.1, 0.05]])],
)
def test_a_stiff_spring_tends_to_the_rigid_contact(model, points):
    """Pressed in and drawn off again: the distance falls with the spring's softness."""
    experiment, apart = drawn(points), []
    ideal = simulate_closed_loop(resolve("ideal")(Scene(model=make_model(model), mass=MASS)), experiment, Scene(
        model=make_model(model), mass=MASS), 1e-3)  # fmt: skip
    for stiffness, ticks in ((1e5, 40), (1.6e6, 160)):
        scene = Scene(model=make_model(model), stiffness=stiffness, damping=2.0 * np.sqrt(stiffness * MASS), mass=MASS)
        soft = simulate_closed_loop(resolve("minimum-distance+pp-pd")(scene), experiment, scene, 1e-3 / ticks)
        apart.append(float(np.max(np.abs(soft.hip[::ticks][: len(ideal)] - ideal.hip[: len(soft.hip[::ticks])]))))
    assert ideal.contact.any()
    assert not ideal.contact.all()
    assert apart[1] < 0.5 * apart[0] < 1e-4


def test_what_it_cannot_do_is_refused(refused):
    scene = Scene(model=make_model("line"), mass=MASS)
    with refused(RefusalError):
        simulate_closed_loop(resolve("ideal")(scene), drawn([[0.0, 0.1], [0.1, 0.1]], stiffness=0.0), scene, 1e-3)
    blob = SurfaceInSpace()
    blob.name = "blob"
    with refused(RefusalError):
        resolve("ideal")(Scene(model=Model("blob", {}, blob)))


@pytest.mark.timeout(120)
@pytest.mark.parametrize("start", ["flies", "slides"])
@pytest.mark.parametrize("kind", ["circle", "sphere", "cube"])
def test_a_run_that_would_take_days_is_refused_with_time_and_place(kind, start, refused):
    """1e18 N/m pull 1 mg: a sample of 1 ms has 1e10 steps of 0.1 rad."""
    model = make_model(kind)
    path = np.zeros((2, model.dimension))
    path[:, 0] = [-0.3, -0.04] if start == "flies" else [-0.01, -0.0099]
    path[:, 1] = 1e-3
    with refused(RefusalError):
        resolve("ideal")(Scene(model=model, stiffness=1e18, mass=1e-6)).simulate(Path([0.0, 1e-3], path), 1e-3)


@pytest.mark.timeout(120)
def test_a_flight_whose_numbers_overflow_ends(refused):
    """At 1e300 m/s the square of the speed is infinite: no step is short enough to look along it."""
    experiment = Experiment(0.01, [-0.3, 0.0, 0.0], [1e300, 0.0, 0.0], [0.0], [[0.0, 0.0, 0.0]])
    with refused(RefusalError):
        resolve("ideal")(Scene(model=make_model("sphere"))).simulate(experiment, 1e-3)
