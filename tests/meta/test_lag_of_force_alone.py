"""A renderer with a force and no contact point: how late it is shows in the force, and more energy is not granted."""

from __future__ import annotations

import numpy as np
import pytest
from force_only import Field
from latecomers import Latecomer
from msgspec.structs import replace

from hapticeval.phenomena.lag import force_only_lag
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.verdict import Level, Outcome, Verdict
from hapticeval.renderer import Declaration, Response
from hapticeval.runner.judging import judge
from hapticeval.simulation.playback import play
from hapticeval.suite.reading import load_suite

CASE = load_suite("thesis").case("cassinian-loops")


def passivity(make, case=CASE) -> Verdict:
    (verdict,) = judge(make, "field", "thesis", replace(case, checks=("passivity",))).verdicts
    return verdict


def late(ticks: float, kind=Field):
    def make(scene):
        renderer = Latecomer(scene, kind(scene), force=ticks)
        renderer.declares = Declaration(force_only=True)
        return renderer

    return make


class Kicking(Field):
    """Pushes 30 N more in the first three ticks of a contact. Wrong."""

    def reset(self, hip: np.ndarray) -> None:
        self.ticks = 0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        response = super().step(hip, velocity, dt)
        size = float(np.linalg.norm(response.force))
        self.ticks = self.ticks + 1 if size else 0
        return Response(hip, response.force * (1.0 + 30.0 / size)) if 0 < self.ticks <= 3 else response


class Steeper(Field):
    """A force that grows with the depth to the 1.5: no spring, linear or a root."""

    def force(self, depth: float, normal: np.ndarray) -> np.ndarray:
        return self.stiffness * 10.0 * depth**1.5 * normal


def test_a_kick_gives_more_than_the_lag_that_the_force_shows_explains():
    verdict = passivity(Kicking, load_suite("thesis").case("plane-impact"))
    assert (verdict.outcome, verdict.level) == (Outcome.FAIL, Level.MUST), verdict.finding.message
    assert verdict.finding.evidence["lag_ticks"] == 1.0
    assert verdict.finding.metric.value > 10.0 * verdict.finding.bound


@pytest.mark.parametrize("kind", [Field, Steeper])
@pytest.mark.parametrize(("ticks", "lag"), [(0.0, 0), (0.4, 1), (2.0, 2), (3.0, 3)])
def test_the_lag_is_that_at_which_a_spring_from_the_nearest_point_fits_best(kind, ticks, lag):
    scene = CASE.build_scene()
    renderer = late(ticks, kind)(scene)
    recording = play(renderer, CASE.build_stimulus(scene, renderer), scene.sampling_time)
    base = Observed(recording, scene).with_nearest_points
    assert force_only_lag(base.recording, base.pressed) == lag
