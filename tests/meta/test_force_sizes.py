"""A force that is off in size: a must stops it whatever the renderer declares, and no other than what is declared."""

from __future__ import annotations

import force_sizes
import honest
import numpy as np
import pytest
from broken import scaled, spoiled
from honest import Spring
from hypothesis import given, settings
from hypothesis import strategies as st
from made import FAIL, PASS
from msgspec.structs import replace
from outsiders import CASES, case

from hapticeval.discovery import resolve
from hapticeval.errors import RendererError
from hapticeval.phenomena.verdict import Level, Verdict
from hapticeval.renderer import Declaration, Response, wrapped
from hapticeval.renderer import Spring as Along
from hapticeval.runner.judging import judge
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

THESIS = {case.name: case for case in load_suite("thesis").cases}
CONVEX, LOOPS = THESIS["star-convex-corner"], THESIS["cassinian-loops"]
"""Of a default suite: the case that the README runs first, which begins in contact, and one with a way in."""


def verdict(make, judged: Case, check="force-magnitude") -> Verdict:
    (verdict,) = judge(make, "mine", "suite", replace(judged, checks=(check,))).verdicts
    return verdict


@pytest.mark.parametrize("name", force_sizes.MUSTS)
def test_off_by_a_factor_of_two_fails_a_must_in_a_default_suite_without_a_declaration(name):
    found = verdict(force_sizes.faulty(name), LOOPS if "kick" in name else CONVEX)
    assert (found.outcome, found.level) == (FAIL, Level.MUST), found.finding.message
    assert found.finding.metric.value > found.finding.bound


def test_off_by_a_fifth_is_a_warning_and_a_must_for_who_declares_a_spring():
    found = verdict(force_sizes.faulty("by-place"), CONVEX)
    assert (found.outcome, found.level) == (FAIL, Level.SHOULD)
    found = verdict(force_sizes.spoiled(force_sizes.FAULTS["by-place"]), CONVEX)
    assert (found.outcome, found.level) == (FAIL, Level.MUST)


def test_a_push_along_curved_motion_is_not_taken_for_a_lag_that_force_and_position_do_not_show():
    make = force_sizes.spoiled(force_sizes.along_curves, Spring)
    found = verdict(make, LOOPS, "passivity")
    assert (found.outcome, found.level) == (FAIL, Level.MUST), found.finding.message
    assert "creates energy at 1 ms" in found.finding.message
    assert "ticks late" not in found.finding.message
    assert found.finding.evidence["lag_ticks"] == 0.0
    assert found.finding.metric.value > 0.8e-3


def test_a_kick_of_a_thrown_tool_gives_more_than_a_held_spring():
    found = verdict(force_sizes.faulty("hard-kick"), THESIS["plane-impact"], "passivity")
    assert (found.outcome, found.level) == (FAIL, Level.MUST), found.finding.message
    assert found.finding.metric.value > 5.0 * found.finding.bound


@pytest.mark.parametrize("lag", [1, 2, 3])
@pytest.mark.parametrize("name", ["cassinian-loops", "plane-impact"])
def test_what_a_lag_that_shows_gives_is_granted(lag, name):
    found = verdict(honest.factory(f"late-{lag}", Spring), THESIS[name], "passivity")
    assert found.outcome is PASS, found.finding.message


@pytest.mark.parametrize("name", ["cassinian-loops", "plane-impact"])
def test_one_who_answers_in_every_second_tick_is_granted_half_a_tick(name):
    found = verdict(force_sizes.EverySecond, THESIS[name], "passivity")
    assert found.outcome is PASS, found.finding.message


@pytest.mark.parametrize("name", ["kick", "triple-kick", "hard-kick"])
def test_a_kick_where_the_contact_begins_is_called_so(name):
    assert "a kick of up to" in verdict(force_sizes.faulty(name), CASES["slide"]).finding.message


@pytest.mark.parametrize("judged", ["plane-press", "cassinian-loops", "plane-impact"])
def test_a_low_pass_of_the_force_is_called_so_with_its_time(judged):
    """One of 10 Hz, of which a tick of 1 ms lets T = 1 ms / (exp(2 pi 10 Hz 1 ms) - 1) be late."""
    finding = verdict(force_sizes.faulty("slow"), THESIS[judged]).finding
    assert finding.evidence["cause"] == "low-pass"
    assert finding.evidence["cause_numbers"]["seconds"] == pytest.approx(1e-3 / np.expm1(2.0 * np.pi * 0.01), rel=1e-2)


def test_a_force_that_stays_in_free_space_does_not_put_a_tool_at_the_hand_off_the_surface():
    """Behind a low-pass filter of 50 Hz it takes 14 ticks to fade, and the hand is 1 mm away then."""

    class Filtered(Spring):
        def reset(self, hip):
            self.force = np.zeros(2)

        def step(self, hip, velocity, dt):
            ihip, force = super().step(hip, velocity, dt)
            self.force = self.force - np.expm1(-2.0 * np.pi * 50.0 * dt) * (force - self.force)
            return Response(ihip, self.force)

    checks = ("continuous-contact", "contact-kept")
    points = [[0.0, 2e-3], [0.0, -2e-3], [0.01, -2e-3], [0.01, 4e-3]]
    judged = case("out", {"kind": "line"}, checks, trajectory={"kind": "points", "points": points, "duration": 0.25})
    on_surface, kept = (verdict(Filtered, judged, check) for check in checks)
    assert (on_surface.outcome, kept.outcome) == (PASS, FAIL), on_surface.finding.message
    assert kept.finding.evidence["kind"] == "haunts"


def test_a_restitution_above_one_is_told_beside_what_holding_the_force_gives():
    """Late by half a tick a spring is damped by -K T / 2: exp(pi T sqrt(K / m) / 4) over half a period."""
    bounce = verdict(honest.Spring, THESIS["plane-impact"], "impulsive-collision").finding
    assert "leaves with restitution 1.08 (a spring's force that is held for a tick gives 1.08)" in bounce.message
    assert bounce.evidence["apparent_restitution"] == pytest.approx(np.exp(0.25 * np.pi * 0.1), rel=0.01)
    late = verdict(force_sizes.faulty("slow"), THESIS["plane-impact"], "impulsive-collision").finding
    assert late.evidence["apparent_restitution"] > 1.5
    assert "gives 1.08)" in late.message


@pytest.mark.parametrize("name", ["half", "dead-band", "by-place", "outage"])
def test_no_other_force_that_is_off_is_called_late(name):
    assert "low-pass" not in verdict(force_sizes.faulty(name), LOOPS).finding.message


VARYING = [THESIS[name] for name in ("cassinian-loops", "ellipse-loops", "cassinian-deep-slide")]
VARYING += [case for case in load_suite("unilateral-surfaces").cases if case.name == "ellipsoid-deep"]


@pytest.mark.parametrize("judged", VARYING, ids=lambda judged: judged.name)
@pytest.mark.parametrize("renderer", ["homothetic", "combescure", "minimum-distance+square-root"])
def test_a_stiffness_that_varies_as_declared_passes(renderer, judged):
    found = verdict(resolve(renderer), judged)
    assert found.outcome is PASS, found.finding.message


def test_a_range_that_is_declared_is_held():
    declaring = verdict(force_sizes.Declaring, CASES["slide"])
    assert declaring.outcome is PASS, declaring.finding.message

    def narrower(scene):
        renderer = force_sizes.Declaring(scene)
        renderer.declares = Declaration(stiffness_range=(0.8, 32.0))
        return renderer

    assert verdict(narrower, CASES["slide"]).level is Level.MUST


@pytest.mark.parametrize(("shares", "outcome"), [((0.5, 1.5), FAIL), ((1.0 / 32.0, 32.0), PASS)])
def test_a_kick_of_a_thrown_tool_is_not_declared_away_by_a_range_that_says_something(shares, outcome):
    """A range that says next to nothing is named as such by `force-magnitude`, which then can only warn."""

    def declaring(scene):
        renderer = force_sizes.faulty("hard-kick")(scene)
        renderer.declares = Declaration(stiffness_range=shares)
        return renderer

    thrown = THESIS["plane-impact"]
    assert verdict(declaring, thrown, "passivity").outcome is outcome
    said = verdict(declaring, thrown).finding.message
    assert ("of K, which asks little" in said) == (outcome is PASS), said


@pytest.mark.parametrize(("times", "edge"), [(3.0, 0.8), (0.2, 0.6)])
def test_the_bound_is_the_edge_of_the_declared_range_that_is_left(times, edge):
    def declaring(scene):
        renderer = spoiled(scaled(lambda tick: times), Spring)(scene)
        renderer.declares = Declaration(stiffness_range=(0.4, 1.8))
        return renderer

    finding = verdict(declaring, CASES["slide"]).finding
    assert finding.outcome is FAIL
    assert finding.bound == pytest.approx(edge, abs=0.05)


@pytest.mark.parametrize(
    ("shares", "sound"),
    [((1.0 / 32.0, 32.0), True), ((0.99 / 32.0, 2.0), False), ((0.5, 32.1), False), ((1e-6, np.inf), False)],
)
def test_a_range_that_would_ask_nothing_is_refused(refused, shares, sound):
    renderer = Spring(CASES["slide"].build_scene())
    renderer.declares = Declaration(stiffness_range=shares)
    if sound:
        assert wrapped(renderer).declares is renderer.declares
    else:
        with refused(RendererError):
            wrapped(renderer)


def test_what_the_gradient_declares_is_between_its_softest_and_its_stiffest():
    """Of `homothetic` it is H^2 / h^2: 478 to 1,582 N/m on the Cassinian, as docs/continuous-and-passive.md has it."""
    said = wrapped(resolve("homothetic")(LOOPS.build_scene())).declares
    assert said.spring is Along.NORMAL
    assert said.stiffness_range == pytest.approx((0.478, 1.582), rel=2e-3)


def test_a_damper_that_presses_from_the_first_tick_is_no_dead_band():
    """The first forces are below the floor, for the depths are, and are larger than the spring's."""
    found = verdict(force_sizes.Damped, THESIS["plane-press"])
    assert found.outcome is FAIL
    assert "dead band" not in found.finding.message
    assert "no force" not in found.finding.message


@pytest.mark.parametrize("judged", [THESIS["plane-press"], LOOPS])
def test_a_damper_that_the_scene_does_not_ask_for_is_named(judged):
    found = verdict(force_sizes.Damped, judged)
    assert found.outcome is FAIL
    assert "damp" in found.finding.evidence["cause"]
    assert found.finding.evidence["cause_numbers"][found.finding.evidence["cause"]] == pytest.approx([2.0])


def test_a_damper_is_named_by_what_it_is_more_than_the_scene_s():
    """`Damped` shows 2 N s/m and none of the scene's: 1.5 N s/m more than the 0.5 that are called for."""
    damped = replace(THESIS["plane-press"], scene={**THESIS["plane-press"].scene, "damping": 0.5})
    found = verdict(force_sizes.Damped, damped)
    assert found.finding.message.startswith("a damper of 1.5 N s/m acts on the whole velocity in contact")


@settings(max_examples=12)
@given(step=st.floats(0.02e-3, 0.2e-3), deepest=st.floats(2e-3, 4e-3))
def test_a_dead_band_is_judged_alike_whatever_the_step_of_the_path(step, deepest):
    """The hand slides in the band: undeclared that fails a must, and declared nothing is left of it."""
    points = [[0.0, 1e-3], [0.0, -0.05e-3], [0.01, -0.05e-3], [0.01, -deepest], [0.012, -deepest]]
    seconds = 1e-3 * np.linalg.norm(np.diff(points, axis=0), axis=1).sum() / step
    judged = case(
        "band",
        {"kind": "line"},
        ("force-magnitude",),
        trajectory={"kind": "points", "points": points, "duration": float(seconds)},
    )
    bare = verdict(lambda scene: force_sizes.Coarse(scene, declared=False), judged)
    assert (bare.outcome, bare.level) == (FAIL, Level.MUST), bare.finding.message
    assert "dead band" in bare.finding.message
    assert verdict(force_sizes.Coarse, judged).outcome is PASS


@pytest.mark.parametrize("check", ["contact-normal-force", "numerical-stability"])
def test_a_converter_turns_a_force_by_its_quantum_and_may_if_that_is_declared(check):
    told, untold = (
        verdict(lambda scene, said=said: force_sizes.Quantized(scene, declared=said), CONVEX, check)
        for said in (True, False)
    )
    assert (told.outcome, untold.outcome) == (PASS, FAIL), told.finding.message


def test_no_force_is_too_large_that_nobody_feels():
    """A damper of 2 N s/m makes 4 times the spring's force of the first 2.7 nm on the way in, which is 11 uN."""
    found = verdict(force_sizes.Damped, THESIS["plane-press"])
    assert (found.outcome, found.level) == (FAIL, Level.SHOULD), found.finding.message
    assert found.finding.evidence["force_N"] > 1e-3
