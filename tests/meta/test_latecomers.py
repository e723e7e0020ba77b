"""Who is late by one number of ticks is not blamed, whole or between; a latency that changes hides nothing."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from finger import FingerProxy
from honest import Changed, Spring
from hypothesis import example, given, settings
from hypothesis import strategies as st
from latecomers import Latecomer, LateTool, late
from msgspec.structs import replace
from outsiders import CASES, LED, case

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.renderer import Declaration, Response
from hapticeval.renderer import Spring as Declared
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite


def finding_of(place, check, make) -> Finding:
    suite, _, name = place.rpartition("/")
    judged_case = load_suite(suite).case(name) if suite else CASES[name]
    judged = judge(make, "late", suite or "any", replace(judged_case, checks=(check,)))
    assert judged.error is None
    return judged.verdicts[0].finding


class ChangingLatency(Changed):
    """A tangential force of about a fifth, that the hand's travel of 0, 1, 2 or 3 ticks is just as long as."""

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.hips = [np.array(hip)]

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.hips.append(np.array(hip))
        ihip, force = super().step(hip, velocity, dt)
        lag = len(self.hips) % 4
        if not np.any(force) or len(self.hips) < 5:
            return Response(ihip, force)
        return Response(ihip, force - self.scene.stiffness * (hip - self.hips[-1 - lag]))


class LateByTurns(ChangingLatency):
    """The same, and the IHIP is that of 0, 1, 2 or 3 ticks ago: the spring pulls to where the tool was."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.hips.append(np.array(hip))
        lag = min(3 * len(self.hips) % 4, len(self.hips) - 1)
        old = self.hips[-1 - lag]
        ihip = Changed.step(self, old, velocity, dt).ihip
        if np.array_equal(ihip, old):
            return Response(hip, np.zeros_like(hip))
        return Response(ihip, self.scene.stiffness * (ihip - hip))


class Pushing(Changed):
    """A tangential force of a sixth of the other, that two ticks of travel explain, beside an IHIP that is not late."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force - 2.0 * self.scene.stiffness * dt * velocity * np.any(force))


@pytest.mark.parametrize("mutant", [ChangingLatency, LateByTurns, Pushing])
def test_a_tangential_force_is_not_hidden_by_a_latency_that_changes_or_that_no_position_shows(mutant):
    finding = finding_of("slide", "contact-normal-force", lambda scene: mutant(scene, Spring(scene)))
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value > 4.0
    assert " degrees) off every true normal" in finding.message


DIRECTION = ["slide", "unilateral-surfaces/sphere-pressed", "unilateral-surfaces/torus-press", "solids/l-block-notch"]


@pytest.mark.parametrize("place", DIRECTION)
@pytest.mark.parametrize("lag", [0.5, 1.0, 2.3])
def test_a_tool_late_by_one_number_of_ticks_pulls_along_the_normal(place, lag):
    finding = finding_of(place, "contact-normal-force", late(LateTool, ihip=lag))
    assert finding.outcome is Outcome.PASS, finding.message


@settings(max_examples=8)
@given(ihip=st.floats(0.0, 3.0), force=st.floats(0.0, 3.0))
def test_channels_that_are_late_by_themselves_do_not_change_the_direction(ihip, force):
    finding = finding_of("slide", "contact-normal-force", late(ihip=ihip, force=force))
    assert finding.outcome is Outcome.PASS, finding.message


class FromTheFace(FingerProxy):
    """Starts a third of a micrometre off one face of the corner, and stops the margin off the others."""

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        at = self.boundary.closest_point(hip[np.newaxis])
        self.proxy = at.foot[0] + 3.3e-7 * at.normal[0]


@pytest.mark.parametrize("make", [FingerProxy, FromTheFace])
def test_three_faces_hold_a_tool_that_is_nearer_to_one(make):
    finding = finding_of("solids/corner-press", "contact-normal-force", make)
    assert finding.outcome is Outcome.PASS, finding.message


class OffTheSurface(Spring):
    """Its contact point lies up to a micrometre beside, as it declares."""

    resolution = 1e-6

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        if not np.any(force):
            return Response(ihip, force)
        ihip = ihip + 0.7e-6 * np.array([1.0, -1.0])[: hip.size] * (-1.0) ** int(1e6 * abs(hip[1]))
        return Response(ihip, self.stiffness * (ihip - hip))


def test_a_declared_resolution_tilts_a_spring_near_the_floor_and_an_undeclared_one_may_not():
    silent = type("Silent", (OffTheSurface,), {"resolution": 0.0})
    declared, undeclared = (finding_of("press", "contact-normal-force", make) for make in (OffTheSurface, silent))
    assert (declared.outcome, undeclared.outcome) == (Outcome.PASS, Outcome.FAIL)


@cache
def tiny(size: float):
    slide = CASES["slide"]
    points = (np.array(slide.trajectory.points) * size / 0.2).tolist()
    return replace(slide, model={"kind": "circle", "size": size}, trajectory=replace(slide.trajectory, points=points))


@pytest.mark.parametrize("name", ["ideal", "minimum-distance", "constraint"])
def test_no_verdict_depends_on_the_size_of_everything(name):
    """The force floor goes with the model's size, as all tolerances do."""
    small, usual, large = (
        {verdict.check: verdict.outcome for verdict in judge(resolve(name), name, "any", tiny(size)).verdicts}
        for size in (1e-6, 0.2, 1e3)
    )
    assert small == usual == large
    assert {usual[check] for check in ("contact-kept", "continuous-contact", "contact-normal-force")} == {Outcome.PASS}


def test_a_force_that_pulls_inwards_is_said_to_pull():
    class Pulling(Changed):
        def step(self, hip, velocity, dt):
            ihip, force = super().step(hip, velocity, dt)
            return Response(ihip, -force)

    finding = finding_of("slide", "contact-normal-force", lambda scene: Pulling(scene, Spring(scene)))
    assert "it pulls where it should push" in finding.message


SQUARE = {"kind": "polygon", "vertices": [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]}
RELEASE = case(
    "release",
    SQUARE,
    LED,
    trajectory={
        "kind": "points",
        "points": [[0.06, 0.11], [0.07, 0.095], [0.105, 0.095], [0.12, 0.095]],
        "duration": 0.4,
    },
)
"""5 mm under a face and out past its edge: the tool is free there, and the hand 5 mm away from it."""


def held_late(**ticks: float):
    tool = resolve("constraint")

    def make(scene):
        return Latecomer(scene, tool(scene), **ticks)

    make.supports = tool.supports
    return make


@pytest.mark.parametrize(
    "ticks", [{}, {"force": 1.0}, {"force": 3.0}, {"ihip": 1.0}, {"ihip": 3.0}, {"ihip": 2.0, "force": 2.0}], ids=str
)
@pytest.mark.parametrize(
    "check", ["contact-kept", "continuous-contact", "contact-normal-force", "memoryless", "reset-clears"]
)
def test_after_a_release_a_channel_has_three_ticks_to_end_the_contact_too(check, ticks):
    judged = judge(held_late(**ticks), "late", "any", replace(RELEASE, checks=(check,)))
    bare = judge(held_late(), "prompt", "any", replace(RELEASE, checks=(check,)))
    finding = judged.verdicts[0].finding
    assert judged.error is None
    assert finding.outcome in (bare.verdicts[0].outcome, Outcome.INCONCLUSIVE), finding.message


@pytest.mark.parametrize("ticks", [1.0, 3.0])
def test_a_force_may_be_late_past_a_sharp_corner_where_the_hand_was_outside_for_long(ticks):
    """10 mm under a face of the star's tip the hand leaves through the other face long before the corner."""
    finding = finding_of("thesis/star-convex-corner", "contact-kept", held_late(force=ticks))
    assert finding.outcome is Outcome.PASS, finding.message


@pytest.mark.parametrize("ticks", [{"ihip": 5.0}, {"force": 5.0}], ids=str)
def test_more_than_three_ticks_are_a_fault(ticks):
    judged = judge(held_late(**ticks), "late", "any", RELEASE)
    assert any(verdict.outcome is Outcome.FAIL for verdict in judged.verdicts)


def declared(make):
    """The same, which declares that it is a spring."""

    def promising(scene):
        renderer = make(scene)
        renderer.declares = Declaration(spring=Declared.ERROR)
        return renderer

    return promising


lags = st.one_of(st.just(0.0), st.just(1.0), st.floats(0.0, 3.0))


@settings(max_examples=8)
@given(ihip=lags, force=lags, tool=lags)
# Between two ticks a place on a circle is off the straight line, by more than rounding.
@example(ihip=1.5, force=0.0, tool=0.0)
def test_a_declared_spring_may_be_late_by_one_number_of_ticks_a_channel(ihip, force, tool):
    for make in (late(ihip=ihip, force=ihip), late(force=force), late(ihip=ihip), late(LateTool, ihip=tool)):
        for place in ("slide", "press"):
            finding = finding_of(place, "force-magnitude", declared(make))
            assert finding.outcome is Outcome.PASS, finding.message


def test_a_force_that_is_dropped_is_not_called_a_tool_that_trails():
    """The tool stays where the surface holds it, in front of a plate that the hand has passed."""
    plate = case(
        "plate",
        {"kind": "polygon", "vertices": [[-0.1, -0.001], [0.1, -0.001], [0.1, 0.001], [-0.1, 0.001]]},
        ("contact-kept",),
        trajectory={"kind": "points", "points": [[0.0, 0.02], [0.0, -0.02]], "duration": 0.2},
    )
    tool = resolve("constraint")

    class Dropping(Changed):
        def step(self, hip, velocity, dt):
            ihip, force = super().step(hip, velocity, dt)
            return Response(ihip, force * (hip[1] > -0.01))

    finding = judge(lambda scene: Dropping(scene, tool(scene)), "drops", "any", plate).verdicts[0].finding
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["kind"] == "dropped"
    assert "the force is dropped" in finding.message


def test_a_tool_that_leaves_late_is_not_called_a_force_that_is_dropped():
    """Contact ends 0.5 mm outside of a floor; the force is none from the surface on."""
    floor = case(
        "floor",
        {"kind": "line"},
        ("contact-kept",),
        trajectory={"kind": "points", "points": [[0.0, 5e-3], [0.0, -2e-3], [0.0, 5e-3]], "duration": 0.4},
    )

    class Sticking(Changed):
        def reset(self, hip):
            super().reset(hip)
            self.contact = False

        def step(self, hip, velocity, dt):
            self.contact = bool(hip[1] < (0.5e-3 if self.contact else 0.0))
            force = super().step(hip, velocity, dt).force
            return Response(hip * [1.0, 0.0], force) if self.contact else Response(hip, 0.0 * hip)

    made = judge(lambda scene: Sticking(scene, resolve("minimum-distance")(scene)), "sticks", "any", floor)
    finding = made.verdicts[0].finding
    assert (finding.outcome, finding.evidence["kind"]) == (Outcome.FAIL, "stays"), finding.message
    assert "the tool stays on the surface though its way to the hand is open" in finding.message


def test_three_ticks_of_force_in_free_space_are_not_called_a_renderer_without_ihip():
    class Haunting(Changed):
        def reset(self, hip):
            super().reset(hip)
            self.free = 0

        def step(self, hip, velocity, dt):
            ihip, force = super().step(hip, velocity, dt)
            self.free = 0 if np.any(force) else self.free + 1
            return Response(ihip, force + np.array([0.5, 0.0]) * (10 < self.free <= 13))

    judged = judge(lambda scene: Haunting(scene, Spring(scene)), "haunts", "any", CASES["slide"])
    findings = {verdict.check: verdict.finding for verdict in judged.verdicts}
    assert findings["contact-kept"].outcome is Outcome.FAIL
    assert not any("no IHIP" in finding.message for finding in findings.values())


def test_a_run_that_ends_in_contact_does_not_know_what_a_late_ihip_would_have_been():
    for ticks in (0.5, 1.0, 3.0):
        finding = finding_of("solids/cube-cut-off", "force-magnitude", declared(late(ihip=ticks)))
        assert finding.outcome is Outcome.PASS, finding.message
