"""A tool that nothing holds shows nothing of what a bilateral constraint costs: undecided, and not failed."""

from __future__ import annotations

import numpy as np
import pytest

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import circle
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import drive
from hapticeval.stimulus.stimulus import Experiment

SCENE = Scene(model=circle(), stiffness=50.0, damping=4.47, mass=0.1, bilateral=True)
START = Experiment(1.0, np.array([0.1, 0.0]), np.array([0.0, 0.5]), np.zeros(1), np.zeros((1, 2)))


class Unilateral:
    """Claims to hold from both sides, and pushes outwards only."""

    supports = ("bilateral",)

    def __init__(self, scene):
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        at = self.boundary.frame(hip[None])
        ihip = at.foot[0] if at.distance[0] < 0 else hip
        return Response(ihip, self.stiffness * (ihip - hip))


def judged(factory):
    made = factory(SCENE)
    base = drive(made, START, SCENE, 1e-3)
    runs = Runs(base, at_speed=lambda f: drive(made, START.at_speed(f), SCENE, 1e-3))
    return CHECKS["centripetal-force"](runs, SCENE)


def test_a_tool_that_flew_off_decides_nothing():
    found = judged(Unilateral)
    assert found.outcome is Outcome.INCONCLUSIVE
    assert "not held" in found.message
    assert found.evidence["tick"] == 1000


@pytest.mark.parametrize(
    ("name", "outcome"),
    [
        ("minimum-distance+pp", Outcome.FAIL),
        ("minimum-distance+pp-pd", Outcome.FAIL),
        ("set-stabilisation", Outcome.PASS),
        ("ideal", Outcome.PASS),
    ],
)
def test_a_tool_that_is_held_is_judged_as_before(name, outcome):
    assert judged(resolve(name)).outcome is outcome
