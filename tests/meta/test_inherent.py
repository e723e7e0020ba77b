"""What a declaration excuses, and what it does not: a failure is inherent only where a theorem makes it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from honest import Spring as Nearest

from hapticeval import Declaration, Response, Scene, Spring
from hapticeval.documents import convert
from hapticeval.phenomena.inherent import LIMITS, declaration_words, reason_inherent
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.runner.judging import judge
from hapticeval.runner.results import VerdictEntry
from hapticeval.runner.standing import Standing
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

CASES = {case.name: case for case in load_suite("thesis").cases}


class Declared(Nearest):
    """The nearest point and a spring, which says so."""

    declares = Declaration(spring=Spring.ERROR, memoryless=True)


class Remembers(Declared):
    """It declares no memory, and drags its contact point 3 mm behind where it came from."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        if np.linalg.norm(ihip - hip) > 0.0 and np.linalg.norm(velocity) > 0.0:
            behind = ihip - 3e-3 * velocity / np.linalg.norm(velocity)
            ihip = self.boundary.closest_point(behind[np.newaxis]).foot[0]
        return Response(ihip, force)


class ThreeTimesAsFar(Declared):
    """The same, but across the medial axis its contact point goes on to a third face."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        if np.linalg.norm(ihip - hip) > 0.0 and ihip[0] < 0.0:
            away = self.boundary.closest_point(np.array([[ihip[0], -ihip[1] - 0.1]])).foot[0]
            return Response(away, self.stiffness * (away - hip))
        return Response(ihip, force)


class PopsBeside(Declared):
    """Beside the medial axis it rounds its contact point to 2 mm: pops that are shorter than the honest one."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, _ = super().step(hip, velocity, dt)
        if np.linalg.norm(ihip - hip) > 0.0 and hip[0] > 2e-3:
            ihip = self.boundary.closest_point(2e-3 * np.round(ihip[np.newaxis] / 2e-3)).foot[0]
        return Response(ihip, self.stiffness * (ihip - hip))


class ManyTimesTheForce(Declared):
    """A spring that is so many times as stiff as the one that it declares to be."""

    ratio = 4.0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, self.ratio * force)


class NearlyTheForce(ManyTimesTheForce):
    """One that is off by a twentieth."""

    ratio = 0.95


@cache
def standings(factory: type, case: str) -> dict[str, Standing]:
    judged = judge(factory, "mine:R", "thesis", CASES[case])
    assert judged.error is None
    return {verdict.check: VerdictEntry.of(verdict).standing for verdict in judged.verdicts}


@pytest.mark.parametrize(
    ("case", "check"),
    [
        ("star-convex-corner", "continuous-contact"),
        ("star-convex-corner", "broken-contact"),
        ("star-concave-corner", "abrupt-switch"),
        ("plane-impact", "impulsive-collision"),
        ("circle-slide", "centripetal-force"),
    ],
)
def test_one_algorithm_is_judged_by_what_it_declares(case: str, check: str) -> None:
    """Without a declaration each of these stops a gate; with it none does, and all others of the case pass alike."""
    plain, declared = standings(Nearest, case), standings(Declared, case)
    assert plain[check] is Standing.FAIL
    assert declared[check] is Standing.INHERENT
    assert Standing.FAIL not in declared.values()


def test_a_jump_that_is_farther_than_the_nearest_points_is_no_theorems() -> None:
    assert standings(ThreeTimesAsFar, "star-convex-corner")["continuous-contact"] is Standing.FAIL


def test_pops_do_not_hide_behind_a_longer_jump_that_is_the_nearest_points() -> None:
    assert standings(PopsBeside, "star-convex-corner")["continuous-contact"] is Standing.FAIL


def test_a_spring_that_is_stiffer_than_it_declares_is_no_theorems() -> None:
    """On a curve no other check of the case asks how large the force is."""
    assert standings(ManyTimesTheForce, "circle-slide")["centripetal-force"] is Standing.FAIL
    assert standings(NearlyTheForce, "circle-slide")["centripetal-force"] is Standing.INHERENT


def test_a_plate_thinner_than_three_steps_of_the_hand_is_tunnelled_by_the_nearest_point() -> None:
    plate = load_suite("solids").case("plate")
    plain, declared = (judge(factory, "mine:R", "solids", plate).verdicts for factory in (Nearest, Declared))
    assert [VerdictEntry.of(verdict).standing for verdict in plain].count(Standing.FAIL) == 1
    assert {verdict.check for verdict in declared if verdict.inherent} == {"contact-kept"}
    assert Standing.FAIL not in [VerdictEntry.of(verdict).standing for verdict in declared]


def test_who_declares_to_be_without_memory_is_held_to_it() -> None:
    assert standings(Remembers, "cassinian-deep-slide")["memoryless"] is Standing.FAIL


def finding(outcome: Outcome = Outcome.FAIL, value: float = 1.0, **evidence: object) -> Finding:
    return Finding(outcome, "seen", Metric("jump", value, "m"), 0.01, evidence)


STRUCK = {"impulse_in_window_Ns": 0.002, "impulse_wanted_Ns": 0.03, "stopped_after_ms": 16.0}


@pytest.mark.parametrize(
    ("changes", "is_inherent"),
    [
        ({}, True),
        ({"impulse_in_window_Ns": 0.031}, False),
        ({"impulse_in_window_Ns": -0.001}, False),
        ({"stopped_after_ms": None}, False),
        ({"impulse_in_window_Ns": 0.031, "spring_impulse_Ns": 0.031}, True),
        ({"impulse_in_window_Ns": 0.031, "spring_impulse_Ns": 0.0309}, False),
        ({"impulse_in_window_Ns": 0.029, "spring_impulse_Ns": 0.028}, True),
    ],
)
def test_a_spring_takes_the_momentum_later_and_never_otherwise(changes: dict[str, float], is_inherent: bool) -> None:
    evidence = {name: value for name, value in (STRUCK | changes).items() if value is not None}
    assert bool(reason_inherent("impulsive-collision", finding(**evidence), {"spring": "error"})) is is_inherent


@pytest.mark.parametrize(("ratio", "standing"), [(1.0, Standing.INHERENT), (1.25, Standing.FAIL)])
def test_a_spring_that_is_pressed_before_it_counts_as_contact_gives_what_its_depths_make(ratio, standing):
    """It slides along a face, into it at 5 um/s: at 40 nm, where contact begins to count, 0.16 mN press already."""
    grazing = {
        "position": [-0.08376410213776271, -0.02812140000389391, -0.021507985450097335],
        "velocity": [0.2, -0.3464, 0.0],
        "force": [[0.0, -0.25, 0.433, 0.0]],
        "duration": 0.05,
    }
    table = {
        "name": "grazing",
        "title": "Along a face",
        "model": {"kind": "cylinder", "size": 0.2, "length": 0.05, "sides": 6},
        "scene": {"stiffness": 4000.0, "mass": 0.3},
        "experiment": grazing,
        "checks": ["impulsive-collision"],
    }
    stiff = type("Stiff", (ManyTimesTheForce,), {"ratio": ratio})
    judged = judge(stiff, "mine:R", "drawn", convert(table, Case, "grazing"))
    (verdict,) = judged.verdicts
    evidence = verdict.finding.evidence
    assert evidence["impulse_in_window_Ns"] > 1.05 * evidence["impulse_wanted_Ns"]
    assert VerdictEntry.of(verdict).standing is standing


@pytest.mark.parametrize(
    ("error", "least", "is_inherent"),
    [(1.09, 1.0, True), (1.11, 1.0, False), (2.05, 0.5, True)],
)
def test_a_spring_sinks_by_its_own_error_and_no_more(error: float, least: float, is_inherent: bool) -> None:
    declared = {"spring": "error", "stiffness_least": least}
    assert bool(reason_inherent("centripetal-force", finding(value=error), declared)) is is_inherent


@pytest.mark.parametrize("region", ["medial axis", "surface"])
@pytest.mark.parametrize("deepest", [0.0, 1e-3])
@pytest.mark.parametrize("kind", ["let go", "tunnelled"])
def test_a_contact_that_is_let_go_is_no_theorems(kind: str, deepest: float, region: str) -> None:
    lost = finding(region=region, kind=kind, deepest_m=deepest)
    is_inherent = kind == "tunnelled" and (deepest == 0.0 or region == "medial axis")
    assert bool(reason_inherent("contact-kept", lost, {"memory": "none"})) is is_inherent


def test_a_point_off_the_surface_is_no_theorems() -> None:
    jump = finding(region="medial axis", nearest_jump_m=9.0, off_surface_m=0.015)
    assert not reason_inherent("continuous-contact", jump, {"memory": "none"})


@pytest.mark.parametrize(("value", "is_inherent"), [(0.99, True), (1.0, True), (1.0101, False)])
def test_the_nearest_points_jump_and_the_checks_bound_are_the_limit(value: float, is_inherent: bool) -> None:
    jump = finding(value=value, region="medial axis", nearest_jump_m=0.99 + 0.01)
    assert bool(reason_inherent("continuous-contact", jump, {"memory": "none"})) is is_inherent


@pytest.mark.parametrize("region", ["surface", "free space", "convex corner", "concave corner"])
def test_a_jump_elsewhere_is_a_failure(region: str) -> None:
    assert not reason_inherent("continuous-contact", finding(region=region, nearest_jump_m=9.0), {"memory": "none"})


@pytest.mark.parametrize("outcome", [outcome for outcome in Outcome if outcome is not Outcome.FAIL])
def test_only_failures_are_inherent(outcome: Outcome) -> None:
    assert not reason_inherent("impulsive-collision", finding(outcome, **STRUCK), {"spring": "error"})


def test_a_loop_that_ran_away_is_a_failure() -> None:
    assert not reason_inherent("impulsive-collision", finding(ended={"ran_away": True}, **STRUCK), {"spring": "error"})


def test_who_declares_nothing_has_nothing_inherent() -> None:
    jump = finding(region="medial axis", nearest_jump_m=9.0)
    assert not any(reason_inherent(check, jump, {}) for check in CHECKS)


def test_each_limit_names_checks_that_there_are_and_its_source() -> None:
    for limit in LIMITS:
        assert limit.checks <= CHECKS.keys()
        assert "thesis" in limit.because


def test_a_declaration_is_kept_with_the_recording() -> None:
    scene = Scene(model=CASES["plane-impact"].build_scene().model)
    assert Declared(scene).declares.meta["memory"] == "none"
    assert Declaration(smooth_only=True).meta["surfaces"] == "smooth"
    assert Declaration(closed_form="pp").meta["closed_form"] == "pp"
    assert Declaration(memoryless="yes").faults  # type: ignore[arg-type]


@pytest.mark.parametrize("limit", LIMITS, ids=lambda limit: limit.declared)
def test_what_explain_says_of_declaring_is_python_that_declares_it(limit):
    names = {"Declaration": Declaration, "Spring": Spring}
    exec(declaration_words(limit.declared).split(", or")[0], names)
    assert names["declares"] != Declaration()
    assert not names["declares"].faults


class Halved(Declared):
    """Half the force that its declared spring gives."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, 0.5 * force)


@pytest.mark.parametrize(("factory", "excused"), [(Declared, True), (Halved, False)], ids=["spring", "half of it"])
def test_a_soft_spring_that_a_tool_slides_off_before_it_is_stopped_is_excused_where_it_pressed_as_declared(
    factory, excused
):
    case = Case(
        name="slides-off",
        title="A tool flies into the end of an L, and slides off it",
        model={"kind": "l-block", "size": 0.1, "thickness": 0.04, "length": 0.1},
        checks=("impulsive-collision",),
        scene={"mass": 0.3, "stiffness": 200.0},
        experiment=ExperimentTable(
            duration=0.4,
            position=[0.016, -0.0275, -0.052],
            velocity=[-0.64, 0.0, 0.18],
            force=[[0.0, -0.5, 0.0, 4.0], [0.4, -2.0, 0.0, 3.5]],
        ),
    )
    (verdict,) = judge(factory, "sliding", "suite", case).verdicts
    assert verdict.outcome is Outcome.FAIL
    assert verdict.finding.facts.stopped_after_ms is None
    assert bool(verdict.inherent) is excused
