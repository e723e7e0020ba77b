"""A loop that runs away has failed, with its time, and is no renderer that broke; what refuses a model is not asked."""

from __future__ import annotations

import honest
import numpy as np
import pytest
from msgspec.structs import replace
from outsiders import CASES, case

from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.renderer import Response
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite


class AtOnce(honest.Spring):
    """A spring with a stiffness that takes the tool beyond any number in a tick."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, 1e30 * force)


class Explodes(honest.Spring):
    """A force away from the surface that grows with the distance, inside and outside."""

    supports = frozenset({"bilateral", "viscosity"})

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, _ = super().step(hip, velocity, dt)
        foot = self.boundary.closest_point(hip[np.newaxis]).foot[0]
        return Response(ihip, 1e9 * self.stiffness * (hip - foot + 1e-6))


LOOPS = [CASES["press"], CASES["rest"], load_suite("dynamics-line").cases[0], load_suite("solids").case("cube-press")]


@pytest.mark.parametrize("judged_in", LOOPS, ids=lambda each: each.name)
@pytest.mark.parametrize("level", list(Level))
def test_a_loop_that_runs_away_fails_with_its_time(judged_in, level):
    checks = tuple(check for check in CHECKS if check in judged_in.checks or CHECKS[check].level is level)
    judged = judge(Explodes, "explodes", "s", replace(judged_in, checks=checks, published={}, closed_form={}))
    assert judged.error is None
    assert judged.recording is not None
    assert judged.ended["ran_away"]
    assert judged.ended["tick"] == len(judged.recording)
    asked = [verdict for verdict in judged.verdicts if verdict.outcome is not Outcome.NOT_APPLICABLE]
    assert asked
    for verdict in asked:
        assert (verdict.outcome, verdict.level) == (Outcome.FAIL, Level.MUST), verdict
        assert f"the run ended at t = {judged.ended['time']:.4g} s: the closed loop ran away" in verdict.finding.message


def test_a_loop_that_runs_away_at_once_fails_too():
    experiment = replace(CASES["press"].experiment, position=[0.0, -0.01])

    judged = judge(AtOnce, "at-once", "s", replace(CASES["press"], experiment=experiment))
    assert (judged.error, judged.recording) == (None, None)
    assert {verdict.outcome for verdict in judged.verdicts} == {Outcome.FAIL}
    assert all("at t = 0 s: the closed loop ran away" in verdict.finding.message for verdict in judged.verdicts)


class OfAPolygon(honest.Spring):
    """A renderer that works on the model's polygon."""

    def __init__(self, scene):
        super().__init__(scene)
        self.boundary = scene.model.polygon(40)


def test_a_polygon_asked_of_a_line_is_a_refusal():
    judged = judge(OfAPolygon, "of-a-polygon", "s", CASES["press"])
    assert judged.refusal is not None
    assert {verdict.outcome for verdict in judged.verdicts} == {Outcome.NOT_APPLICABLE}
    assert "unbounded" in judged.verdicts[0].finding.message
    with pytest.raises(InputError) as caught:
        make_model("extruded", model={"kind": "line"})
    assert not isinstance(caught.value, RefusalError), "a model that cannot be is nobody's refusal"


class FlickersFine(honest.Spring):
    """Its first contact point is 10 mm aside; sampled finely enough it has contact in every other tick only."""

    def reset(self, hip):
        self.ticks = 0

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        if np.array_equal(ihip, hip):
            self.ticks = 0
            return Response(ihip, force)
        self.ticks += 1
        if dt < 1e-8 and self.ticks % 2 == 0:
            return Response(hip, np.zeros_like(hip))
        return Response(ihip + np.array([0.01 if self.ticks == 1 else 0.0, 0.0]), force)


def test_a_look_without_a_step_in_contact_shows_nothing():
    """Whatever finer steps lack, the jump is there at the path's own rate, and at twice that."""
    path = {"kind": "points", "points": [[0.0, 0.01], [0.0, -0.003], [0.02, -0.003], [0.02, 0.01]], "duration": 0.5}
    judged = judge(FlickersFine, "f", "s", case("dip", {"kind": "line"}, ("continuous-contact",), trajectory=path))
    finding = judged.verdicts[0].finding
    assert finding.outcome is Outcome.FAIL, finding.message
    assert "pop-through" in finding.message
    assert finding.metric.value == pytest.approx(0.01, rel=0.01)
