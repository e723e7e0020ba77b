"""The header promises a free start: a sphere as large as the declared standoff begins outside of every face."""

from __future__ import annotations

import numpy as np
import pytest
from finger import FingerProxy
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.adapters.outside import CLEARANCE_SHARE, Outside
from hapticeval.geometry.catalogue import from_vertices, torus
from hapticeval.geometry.model import Model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.reading import load_suite

RADIUS = 1.1e-3
NOTCH = from_vertices([[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.1, 0.1], [0.1, 0.2], [0.0, 0.2]])
SLOT = from_vertices(
    [[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.101, 0.1], [0.101, 0.05], [0.1, 0.05], [0.1, 0.1], [0.0, 0.1]]
)
"""A millimetre wide: no room for the sphere."""
CORNER = load_suite("solids").case("inner-corner").build_scene().model
MODELS = {"notch": NOTCH, "slot": SLOT, "corner": CORNER, "torus": torus()}


@settings(max_examples=60)
@given(
    name=st.sampled_from(sorted(MODELS)),
    at=st.tuples(*[st.floats(-0.1, 1.1)] * 3),
    standoff=st.sampled_from([0.0, 1e-4, RADIUS]),
)
def test_a_start_is_clear_of_every_face(name: str, at: tuple[float, ...], standoff: float) -> None:
    scene = Scene(model=MODELS[name])
    outside = Outside(scene)
    low, high = np.reshape(outside.facets.boundary.bounds, (2, -1))
    hip = low + (high - low) * np.array(at[: low.size])
    tool = outside.tool(hip, standoff)
    clear = standoff + CLEARANCE_SHARE * scene.model.size
    assert outside.facets.boundary.signed_distance(tool[np.newaxis])[0] >= (1.0 - 1e-8) * clear


@pytest.mark.parametrize(("model", "tip"), [(NOTCH, [0.1, 0.1])])
def test_in_a_corner_it_is_beside_the_hand(model: Model, tip: list[float]) -> None:
    hip = np.array(tip) + 2e-4
    tool = Outside(Scene(model=model)).tool(hip, RADIUS)
    assert np.linalg.norm(tool - hip) < 1.5 * np.sqrt(2.0) * (RADIUS + CLEARANCE_SHARE * model.size)


class Ball(FingerProxy):
    """A ball of the declared radius. Begun nearer than that to a face, it is inside of its own surface and falls."""

    standoff = RADIUS

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.outside = Outside(scene)

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        start = self.outside.tool(hip, RADIUS)
        self.falls = bool(self.boundary.signed_distance(start[np.newaxis])[0] < RADIUS)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        return Response(hip, np.zeros_like(hip)) if self.falls else super().step(hip, velocity, dt)


def test_a_ball_that_begins_in_a_corner_is_left_alone() -> None:
    scene, dt = Scene(model=NOTCH), 1e-3
    path = Path(np.array([0.0, 0.5]), np.array([[0.0995, 0.0992], [0.14, 0.0992]]))
    runs = Runs(play(Ball(scene), path, dt, scene=scene))
    finding = CHECKS["contact-kept"](runs, scene)
    assert finding.outcome is Outcome.PASS, finding.message
