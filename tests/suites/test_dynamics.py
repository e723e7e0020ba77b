"""The suites of the closed loop: what chapters 6.3 and 7 say comes out, on the point mass and on the robot."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import golden
import numpy as np
import pytest

from hapticeval.discovery import own_renderers, resolve
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.execution import execute
from hapticeval.runner.judging import Judged, judge
from hapticeval.runner.planning import RunOptions, plan
from hapticeval.runner.results import Robot, read_results
from hapticeval.suite.case import Case
from hapticeval.suite.outline import suites_named
from hapticeval.suite.reading import load_suite

GROUP = suites_named("dynamics")
SCHEMES = tuple(f"minimum-distance+{scheme}" for scheme in ("pp", "pp-v", "pp-d", "pp-pd", "pp-pd-c"))


def named(suite: str, name: str) -> Case:
    return next(case for case in load_suite(f"dynamics-{suite}").cases if case.name == name)


@cache
def judged(suite: str, name: str, renderer: str) -> Judged:
    case = named(suite, name)
    case.check_stimulus()
    found = judge(resolve(renderer), renderer, f"dynamics-{suite}", case)
    assert found.error is None
    assert found.refusal is None
    return found


def outcomes(suite: str, name: str, renderer: str) -> dict[str, Outcome]:
    return {verdict.check: verdict.outcome for verdict in judged(suite, name, renderer).verdicts}


@pytest.mark.parametrize("start", ["", "-off"])
@pytest.mark.parametrize("model", ["ellipsoid", "torus"])
def test_the_tool_runs_on_a_geodesic_where_its_curvature_changes(model, start):
    """It keeps Clairaut's constant on a torus and Joachimsthal's, of second degree in the speed, on an ellipsoid.

    But for what a force that is held, and so T/2 late, adds at most: v' = kappa^2 v^3 T/2.
    """
    name, dt = f"{model}{start}-robot", 1e-3
    recording = judged("surfaces", name, "set-stabilisation").recording
    surface = named("surfaces", name).build_scene().model.surface
    foot, normal, n, shape = surface.closest_point(recording.hip)
    across = np.sum(normal * recording.velocity, axis=1)
    along = recording.velocity - across[:, None] * normal
    rate = np.linalg.solve(np.eye(3) + n[:, None, None] * shape, along[..., None])[..., 0]
    if model == "torus":
        kept, degree = np.cross(foot, rate)[:, 2], 1
    else:
        squares = np.array(surface.reals) ** 2
        kept, degree = np.sum((foot / squares) ** 2, axis=1) * np.sum(rate**2 / squares, axis=1), 2
    squared = np.sum(rate**2, axis=1)
    steepest = np.max(np.linalg.eigvalsh(shape) ** 2, axis=1)
    assert np.abs(kept / kept[0] - 1.0).max() <= degree * 0.5 * dt * np.sum(steepest * squared) * dt < 0.1
    bend = np.einsum("ti,tij,tj->t", rate, shape, rate) / squared
    assert bend.max() > 2.0 * bend.min()


@pytest.mark.parametrize("name", ["sphere-viscous", "sphere-driven"])
@pytest.mark.parametrize("renderer", SCHEMES)
def test_what_knows_no_viscosity_is_not_asked_for_it(name, renderer):
    case = named("sphere", name)
    found = judge(resolve(renderer), renderer, "dynamics-sphere", case)
    assert found.recording is None
    assert {verdict.outcome for verdict in found.verdicts} == {Outcome.NOT_APPLICABLE}
    assert all(verdict.as_expected and "'viscosity'" in verdict.finding.message for verdict in found.verdicts)


def test_charts_and_chart_free_stabilisation_are_one_on_the_sphere_over_both_poles():
    for name in ("sphere", "sphere-viscous", "sphere-driven"):
        free = judged("sphere", name, "set-stabilisation").recording
        charts = judged("sphere", name, "set-stabilisation@atlas").recording
        np.testing.assert_allclose(charts.hip, free.hip, atol=1e-9)
    height = charts.hip[:, 2]
    assert (height.max() > 0.09, height.min() < -0.09) == (True, True), "the hand leads the tool"
    assert np.abs(charts.channels["operator_force"]).max() > 0.1


@pytest.mark.parametrize("effect", ["encoder", "velocity-filter", "delay", "torque-limit", "friction", "static"])
def test_an_effect_is_shown_and_never_counts(effect):
    case = named("circle", f"circle-robot-{effect}")
    assert not case.judged
    assert "closed-form" not in case.checks
    assert case.published == {}


def tangential(effect):
    found = judged("circle", f"circle-robot-{effect}", "set-stabilisation").verdicts
    (verdict,) = [verdict for verdict in found if verdict.check == "tangential-dynamics"]
    assert verdict.outcome is Outcome.FAIL
    return verdict.finding


@pytest.mark.system
def test_an_encoder_is_too_fine_to_hurt_friction_stops_the_tool_and_a_delay_drives_it():
    """A force that is late by D points ahead of the normal: v' = kappa^2 v^3 D, 1.25 per cent a second here."""
    assert set(outcomes("circle", "circle-robot-encoder", "set-stabilisation").values()) == {Outcome.PASS}
    assert tangential("friction").evidence["apparent_viscosity_kg_s"] > 0.05
    assert tangential("delay").metric.value == pytest.approx(5.0**2 * 0.0005, rel=0.1)


@pytest.mark.system
def test_where_no_renderer_is_named_each_suite_runs_its_own():
    planned = plan(["dynamics", "thesis"], (), RunOptions(select=("circle*", "star-*")))
    per_suite = {suite: {job.renderer for job in planned.jobs if job.suite == suite} for suite in (*GROUP, "thesis")}
    assert per_suite["dynamics-circle"] == set(load_suite("dynamics-circle").renderers)
    assert per_suite["dynamics-line"] == set()
    assert per_suite["thesis"] == set(own_renderers())
    assert {job.renderer for job in plan(["dynamics"], ["constraint"]).jobs} == {"constraint"}


FAR = """
title = "far"
[[case]]
name = "out"
title = "Out of the workspace"
model = { kind = "circle" }
checks = ["constraint-stability", "output-invariance", "decoupling", "continuous-contact"]
scene = { stiffness = 50.0, bilateral = true, device = "parallelogram-2dof", inner_loop = "linearised" }
experiment = { duration = 1.0, position = [0.1, 0.0], velocity = [4.0, 0.0] }
"""


def test_a_run_that_leaves_the_workspace_ends_there_and_says_so_in_every_verdict(tmp_path):
    (tmp_path / "far.toml").write_text(FAR)
    events = list(
        execute(plan([str(tmp_path / "far.toml")], [SCHEMES[0]], RunOptions(output=tmp_path / "out", workers=0)))
    )
    results = read_results(tmp_path / "out")
    ended = results.runs[0].ended
    assert 0.0 < ended.time < 1.0
    assert ended.tick == round(1000 * ended.time)
    found = {verdict.check: verdict for verdict in results.verdicts}
    assert {check: verdict.outcome for check, verdict in found.items()} == {
        "constraint-stability": "fail",
        "output-invariance": "inconclusive",
        "decoupling": "inconclusive",
        "continuous-contact": "inconclusive",
    }
    for verdict in found.values():
        assert f"ended at t = {ended.time:.4g} s: {ended.what}" in verdict.message
    assert events[-1].results == results


def test_results_say_what_robot_was_driven(tmp_path):
    options = RunOptions(select=("line-robot-enc*",), output=tmp_path / "out", workers=0)
    list(execute(plan(["dynamics-line"], [SCHEMES[0]], options)))
    run = read_results(tmp_path / "out").runs[0]
    assert run.scene.device == Robot(kind="parallelogram-2dof", dynamics="lagrangian", base_inertia="sin")
    assert run.scene.inner_loop == "linearised"
    assert run.scene.effects == [{"kind": "encoder", "step": pytest.approx(2.0 * np.pi / 262144)}]
    assert (run.ended, run.closed_form) == (None, None)


def test_results_say_which_constants_a_robot_of_its_own_has(tmp_path):
    text = files("hapticeval.suites").joinpath("dynamics-line.toml").read_text(encoding="utf-8")
    own = 'device = { kind = "parallelogram-2dof", b1 = 0.4, l1 = 0.3 }'
    (tmp_path / "own.toml").write_text(text.replace('device = "parallelogram-2dof"', own), encoding="utf-8")
    options = RunOptions(select=("line-robot-enc*",), output=tmp_path / "out", workers=0)
    list(execute(plan([str(tmp_path / "own.toml")], [SCHEMES[0]], options)))
    # l1 is that of Table A.1
    assert read_results(tmp_path / "out").runs[0].scene.device.constants == {"b1": 0.4}


def test_a_sensed_push_moves_the_tool_along_the_surface_and_not_across():
    """0.3 N against 50 N/m would be 6 mm; along, the hand feels 0.1 kg and no more (8.9)."""
    for renderer in load_suite("dynamics-circle").renderers:
        found = judged("circle", "circle-pushed-robot", renderer)
        assert golden.unexpected(found.verdicts) == []
    recording = judged("circle", "circle-pushed-robot", "set-stabilisation").recording
    assert np.abs(np.linalg.norm(recording.hip, axis=1) - 0.1).max() < 1e-4
    springy = judged("circle", "circle-pushed-robot", SCHEMES[3]).recording
    assert np.abs(np.linalg.norm(springy.hip, axis=1) - 0.1).max() > 1e-3
