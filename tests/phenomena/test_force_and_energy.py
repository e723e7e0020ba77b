"""Passivity, force magnitude and what a reset clears: what is broken is stopped, what is honest is not blamed."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path as FilePath

import honest
import numpy as np
import outsiders
import pytest
import sympy
from broken import OVERPOWERING, spoiled
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from hapticeval.discovery import resolve
from hapticeval.effects.delay import Delay
from hapticeval.effects.velocity_filter import VelocityFilter
from hapticeval.errors import RendererError
from hapticeval.geometry.catalogue import cassinian, circle, line, make_model
from hapticeval.phenomena import passivity
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.passivity import laps
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Level, Outcome, Verdict
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import Declaration, Response, Spring
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.simulation.playback import declared, play
from hapticeval.stimulus.paths import build_path
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.reading import load_suite

OURS = ("passivity", "force-magnitude", "reset-clears")
FEW = ("cassinian-loops", "plane-impact", "plane-press", "star-convex-corner")
K = 1000.0


@cache
def verdicts(renderer: str, *names: str) -> tuple[Verdict, ...]:
    """Of one of ours, by its name, or of a broken or an honest one."""
    return judged(spoiled(renderer) if renderer in OVERPOWERING else resolve(renderer), *names)


def judged(make, *names: str) -> tuple[Verdict, ...]:
    found = []
    for case in load_suite("thesis").cases:
        checks = tuple(check for check in case.checks if check in OURS)
        if case.name in names and checks:
            done = judge(make, "mine", "thesis", replace(case, checks=checks))
            assert done.error is None, done.error
            found += done.verdicts
    return tuple(found)


def led(field, path, dt, *, lag=0):
    """What a force field gives along a path, `lag` ticks late; the IHIP is where a spring K would have it."""
    time, hip = path.sampled(dt)
    force = np.array([field(point) for point in hip])
    force = force[np.maximum(np.arange(time.size) - lag, 0)]
    channels = {"hip": hip, "ihip": hip + force / K, "force": force}
    return Recording(time, channels, meta={"source": "playback", "dt": dt})


def judged_field(field, path, *, lag=0, dt=1e-3, scene=None):
    def refine(factor):
        return led(field, path, dt / factor, lag=lag)

    return CHECKS["passivity"](Runs(refine(1), refine=refine).remembered(), scene or Scene(model=circle(), stiffness=K))


def loop(centre=(0.01, 0.0), radius=0.004, lap=0.2, start=(0.3, 0.0), laps=3, approach=0.1):
    spec = {"start": start, "centre": centre, "radius": radius, "laps": laps, "lap": lap, "approach": approach}
    return build_path({"kind": "loop", **spec}, circle().curve, FilePath())


# The laws


@given(
    st.floats(-0.02, 0.02),
    st.floats(-0.02, 0.02),
    st.floats(1e-3, 8e-3),
    st.floats(-1.0, 1.0),
    st.integers(0, 3),
)
def test_the_work_of_a_gradient_round_a_loop_is_none_in_the_limit(x, y, radius, bend, lag):
    """U = (K/2)(x^2 + 2 y^2 + c x y^2 / 10 mm): a force without curl, however late, is not taken for active."""
    c = bend / 0.01

    def force(p):
        return -K * np.array([p[0] + 0.5 * c * p[1] ** 2, 2.0 * p[1] + c * p[0] * p[1]])

    found = judged_field(force, loop((x, y), radius), lag=lag)
    assert found.outcome is Outcome.PASS, found.message
    assert abs(found.metric.value) <= found.bound


@given(st.floats(0.05, 1.0), st.floats(1e-3, 8e-3), st.integers(0, 3), st.sampled_from([-1.0, 1.0]))
def test_the_work_of_a_curl_is_its_integral_over_the_loop(share, radius, lag, sense):
    """Green: F = -K x + s c K (-y, x) has the curl 2 s c K everywhere, and W = 2 s c K pi r^2 a lap, one way round."""
    found = judged_field(lambda p: -K * p + sense * share * K * np.array([-p[1], p[0]]), loop(radius=radius), lag=lag)
    assert found.outcome is Outcome.FAIL
    assert found.metric.value == pytest.approx(2.0 * share * K * math.pi * radius**2, rel=2e-3)


@pytest.mark.parametrize("lag", [0, 1, 2, 3])
def test_holding_a_late_penalty_gains_l_and_a_half_times_k_times_the_squared_steps(lag):
    """The difference to the formula is of order (L a)^2, a the turn of a step: see the next test."""
    path, dt = loop(), 1e-3
    found = judged_field(lambda p: -K * p, path, lag=lag, dt=dt)
    steps = np.linalg.norm(np.diff(path.sampled(dt)[1], axis=0), axis=1)[100:300]
    square = K * float(np.sum(steps**2))
    assert found.outcome is Outcome.PASS
    assert found.evidence["way"] == passivity.LAP
    assert found.evidence["hold_J"] == pytest.approx(0.5 * square, rel=1e-2)
    assert found.evidence["lag_J"] == pytest.approx(lag * square, rel=1e-2, abs=1e-6)


def test_the_hold_alone_by_symbols():
    """On a circle of radius r, -K x[i - L] . (x[i + 1] - x[i]) = K r^2 (cos L a - cos (L + 1) a)."""
    a, i, lag, r, stiffness = sympy.symbols("a i L r K", positive=True)

    def at(k):
        return sympy.Matrix([r * sympy.cos(a * k), r * sympy.sin(a * k)])

    one = sympy.simplify((-stiffness * at(i - lag)).dot(at(i + 1) - at(i)))
    assert sympy.simplify(one - stiffness * r**2 * (sympy.cos(lag * a) - sympy.cos((lag + 1) * a))) == 0
    series = sympy.series(one, a, 0, 4).removeO()
    assert sympy.simplify(series - (lag + sympy.Rational(1, 2)) * stiffness * (r * a) ** 2) == 0


def test_the_projection_onto_a_circle_is_a_gradient_and_onto_an_ellipse_by_scaling_is_not():
    """PP is conservative where p is a gradient: R x / |x| is that of R |x|; a radial map onto an ellipse has a curl."""
    x, y, size, ratio = sympy.symbols("x y R q", positive=True)

    def curl(p):
        return sympy.simplify(sympy.diff(p[1], x) - sympy.diff(p[0], y))

    away = sympy.sqrt(x**2 + y**2)
    assert curl((size * x / away, size * y / away)) == 0
    scaled = sympy.sqrt(x**2 + (y / ratio) ** 2)
    assert curl((size * x / scaled, size * y / scaled)).subs({x: 1, y: 1, size: 1, ratio: 2}) != 0


def test_pp_d_drives_the_hand_along_under_a_convex_surface():
    """ė_p = v - J v, J = t t^T / (1 + n kappa): along the surface it gives K_d v^2 |n| kappa / (1 - |n| kappa)."""
    radius, depth, speed, damping = 0.1, 0.01, 0.05, 5.0
    scene = Scene(model=circle(), stiffness=K, damping=damping)
    turn = np.linspace(0.0, 2.0, 8001)
    inner = radius - depth
    path = Path(turn * inner / speed, inner * np.column_stack([np.cos(turn), np.sin(turn)]))
    gained = {}
    for scheme in ("pp", "pp-v", "pp-pd", "pp-d"):
        run = play(resolve(f"minimum-distance+{scheme}")(scene), path, 1e-3)
        moved = np.diff(run.hip, axis=0)
        gained[scheme] = float(np.sum(0.5 * (run.force[1:] + run.force[:-1]) * moved)) / path.duration
    bent = depth / radius
    assert gained["pp"] == pytest.approx(0.0, abs=1e-6)
    assert gained["pp-pd"] == pytest.approx(0.0, abs=1e-5)
    assert gained["pp-v"] == pytest.approx(-damping * speed**2, rel=1e-2)
    assert gained["pp-d"] == pytest.approx(damping * speed**2 * bent / (1.0 - bent), rel=1e-2)


def test_set_stabilisation_below_the_surface_does_the_work_of_its_curvature_force():
    """From (7.14) and (7.22) its power is m kappa n' s' w with w = (1 + n kappa) s': m kappa w s' dn over a loop."""
    (found,) = [v for v in verdicts("set-stabilisation", "cassinian-loops") if v.check == "passivity"]
    path = loop(centre=(0.08, 0.012), radius=0.004, lap=0.5, start=(0.11, 0.02), approach=0.25)
    scene = Scene(model=cassinian())
    hip = path.sampled(1e-4)[1][2500 : 2500 + 5001]
    frame = scene.model.boundary.frame(hip)
    n, moved = frame.distance, np.diff(hip, axis=0)
    kappa = np.trace(frame.shape, axis1=1, axis2=2)
    tangent = np.column_stack([-frame.normal[:, 1], frame.normal[:, 0]])
    w = np.sum(0.5 * (tangent[1:] + tangent[:-1]) * moved, axis=1) / 1e-4
    middle = 0.5 * (kappa[1:] + kappa[:-1]), 0.5 * (n[1:] + n[:-1])
    work = scene.mass * float(np.sum(middle[0] * w**2 / (1.0 + middle[0] * middle[1]) * np.diff(n)))
    assert found.finding.metric.value == pytest.approx(abs(work), rel=5e-2)


def test_a_god_object_gives_back_less_than_it_took_and_that_only_once():
    """What a proxy had stored comes back in one lap and not in the next: the least of the laps decides."""
    runs = {v.case: v.finding for v in verdicts("constraint", *FEW) if v.check == "passivity"}
    assert {finding.outcome for finding in runs.values()} == {Outcome.PASS}


@pytest.mark.parametrize("name", ["mapping", "conformal", "conformal+pp"])
def test_a_map_creates_energy_by_its_curl(name):
    found = [v for v in verdicts(name, "cassinian-loops") if v.check == "passivity"]
    assert found[0].outcome is Outcome.FAIL
    assert 5e-3 < found[0].finding.metric.value < 30e-3
    assert "creates energy: in each lap after the first, round (80, 12) mm" in found[0].finding.message


# Laps


def test_laps_are_found_both_ways_and_only_where_there_are_two():
    hip = loop().sampled(1e-3)[1]
    assert laps(hip, 0.2) == [(100, 200, 3), (700, 200, 3)]
    assert laps(loop(lap=0.2004).sampled(1e-3)[1], 0.2) == [], "laps that miss each other's samples are none"
    assert laps(np.zeros((500, 2)), 0.2) == [], "a hand at rest"
    there = np.linspace(0.0, 1.0, 101)[:, None] * [1.0, 0.0]
    assert laps(np.vstack([there, there[::-1]]), 0.2) == [], "there and back is no lap"
    assert laps(np.zeros((2, 2)), 0.2) == []


def test_without_a_closed_way_nothing_is_known():
    inside = Path([0.0, 1.0], [[0.0, 0.0], [0.01, 0.0]])
    found = judged_field(lambda p: -K * (p + 1.0), inside)
    assert found.outcome is Outcome.INCONCLUSIVE
    assert "what is stored is not known" in found.message


@pytest.mark.parametrize("duration", [0.45, 0.22, 0.17, 0.11, 0.07])
@pytest.mark.parametrize("late", ["late-2", "late-3"])
def test_a_late_spring_is_not_blamed_where_the_hand_turns_within_its_lag(late, duration):
    slide = outsiders.CASES["slide"]
    fast = replace(slide, checks=("passivity",), trajectory=replace(slide.trajectory, duration=duration))
    (verdict,) = judge(honest.factory(late, outsiders.Spring), late, "mine", fast).verdicts
    assert verdict.outcome in (Outcome.PASS, Outcome.INCONCLUSIVE), verdict.finding.message


def test_late_motors_give_energy_whatever_the_renderer():
    scene = Scene(model=circle(), stiffness=K, effects=(Delay(1e-3),))
    found = judged_field(lambda p: -K * p + 0.5 * K * np.array([-p[1], p[0]]), loop(), scene=scene)
    assert (found.outcome, found.level) == (Outcome.FAIL, Level.INFO)
    filtered = Scene(model=circle(), damping=1.0, effects=(VelocityFilter(50.0),))
    assert passivity.active_by_nature(filtered) is not None
    assert passivity.active_by_nature(Scene(model=circle(), damping=1.0)) is None


def test_a_recording_that_cannot_be_refined_is_judged_by_itself():
    path = loop()
    curl = led(lambda p: 1e3 * max(0.02 - np.hypot(*p), 0.0) * np.array([-p[1], p[0]]), path, 1e-3)
    assert CHECKS["passivity"](Runs(curl), Scene(model=circle())).outcome is Outcome.FAIL
    made = play(resolve("minimum-distance")(Scene(model=circle())), path, 1e-3)
    found = CHECKS["passivity"](Runs(made), Scene(model=circle()))
    assert found.outcome is Outcome.PASS
    assert "weaker test" in found.message


# The broken and the honest


@pytest.mark.parametrize("name", OVERPOWERING)
def test_what_is_overpowering_fails_its_checks_and_no_other(name):
    found = verdicts(name, *FEW)
    assert {v.check for v in found if v.outcome is Outcome.FAIL} == OVERPOWERING[name][0]
    assert all(v.level is Level.MUST for v in found), "it declares a spring"


RIGHT_IN_SIZE = honest.HONEST | {"late-tool": honest.LateTool}


@pytest.mark.parametrize("declares", [False, True])
@pytest.mark.parametrize("name", RIGHT_IN_SIZE)
def test_what_is_honest_is_not_blamed(name, declares):
    class Promising(RIGHT_IN_SIZE[name]):
        declares = Declaration(spring=Spring.ERROR)

    class Silent(RIGHT_IN_SIZE[name]):
        declares = None

    kind = Promising if declares else Silent
    found = judged(lambda scene: kind(scene, resolve("minimum-distance")(scene)), *FEW)
    wanted = {Outcome.PASS} if name != "force-only" else {Outcome.PASS, Outcome.INCONCLUSIVE}
    assert {v.outcome for v in found} == wanted, [v.finding.message for v in found if v.outcome not in wanted]
    assert all(v.as_expected for v in found)


def test_damped_schemes_are_not_blamed():
    for scheme in ("pp-v", "pp-d", "pp-pd"):
        scene = Scene(model=line(), stiffness=K, damping=5.0)
        path = Path([0.0, 1.0, 2.0], [[-0.05, 0.01], [0.0, -0.01], [0.05, 0.01]])
        renderer = resolve(f"minimum-distance+{scheme}")(scene)

        def run(factor, renderer=renderer, path=path):
            return play(renderer, path, 1e-3 / factor)

        runs = Runs(run(1), refine=run, again=lambda run=run: run(1)).remembered()
        for check in ("passivity", "force-magnitude", "reset-clears"):
            found = CHECKS[check](runs, scene)
            assert found.outcome is Outcome.PASS, (scheme, found.message)


def test_a_law_that_is_not_proportional_is_warned_of():
    found = [v for v in verdicts("minimum-distance+square-root", *FEW) if v.check == "force-magnitude"]
    assert {(v.outcome, v.level, v.as_expected) for v in found} == {(Outcome.FAIL, Level.SHOULD, True)}
    assert "depends on the depth" in found[0].finding.message


@pytest.mark.parametrize(
    ("name", "case", "words"),
    [
        ("third", "plane-press", "softer throughout, by 66.7 per cent"),
        ("stiffer", "cassinian-loops", "stiffer throughout, by 5 per cent"),
        ("spikes", "plane-press", "spikes: 40 ticks off, every 50 ticks"),
        ("kicks", "plane-impact", "it depends on the direction (1 of the scene's stiffness on the way in, 1.1"),
        ("drifts", "plane-press", "it drifts with time"),
        ("one-newton", "star-convex-corner", "it depends on the depth"),
    ],
)
def test_a_deviation_is_told_by_what_it_goes_with(name, case, words):
    (found,) = [v for v in verdicts(name, *FEW) if (v.case, v.check) == (case, "force-magnitude")]
    assert words in found.finding.message
    assert found.finding.evidence["tick"] >= 0


def test_plane_press_tells_the_depth_that_k_asks_for():
    (right,) = [v for v in verdicts("minimum-distance", "plane-press") if v.check == "force-magnitude"]
    (soft,) = [v for v in verdicts("third", *FEW) if (v.case, v.check) == ("plane-press", "force-magnitude")]
    for found, times in ((right, 1.0), (soft, 3.0)):
        evidence = found.finding.evidence
        assert evidence["depth_m"] == pytest.approx(times * evidence["depth_asked_m"], rel=1e-9)
    assert "where K = 1000 N/m asks for" in soft.finding.message


def test_a_force_only_renderer_that_is_too_soft_fails():
    class Soft(honest.ForceOnly):
        def step(self, hip, velocity, dt):
            answer = super().step(hip, velocity, dt)
            return Response(answer.ihip, answer.force / 3.0)

    found = judged(lambda scene: Soft(scene, resolve("minimum-distance")(scene)), *FEW)
    assert {v.outcome for v in found if v.check == "force-magnitude"} == {Outcome.FAIL}


def test_the_ideal_contact_has_no_stiffness_and_no_energy_to_give():
    found = verdicts("ideal", *FEW)
    assert {v.outcome for v in found if v.check == "force-magnitude"} == {Outcome.NOT_APPLICABLE}
    assert {v.outcome for v in found if v.check != "force-magnitude"} == {Outcome.PASS}


# Resets and declarations


def test_what_a_reset_leaves_is_told_by_its_size():
    (found,) = [v for v in verdicts("wears", *FEW) if (v.case, v.check) == ("cassinian-loops", "reset-clears")]
    assert "3 per cent softer" in found.finding.message


class Noisy:
    """Its force scatters by up to 1 mN, as it declares."""

    declares = Declaration(spring=None, force_scatter=2e-3)

    def __init__(self, inner, seed=0):
        self.inner, self.random = inner, np.random.default_rng(seed)

    def reset(self, hip):
        self.inner.reset(hip)

    def step(self, hip, velocity, dt):
        ihip, force = self.inner.step(hip, velocity, dt)
        return Response(ihip, force + self.random.uniform(-7e-4, 7e-4, 2) * np.any(force != 0.0))


def test_a_declared_scatter_is_allowed_and_no_more():
    scene = Scene(model=circle())
    path = loop(centre=(0.08, 0.0))
    for allowed, outcome in ((2e-3, Outcome.PASS), (1e-4, Outcome.FAIL)):
        noisy = Noisy(resolve("minimum-distance")(scene))
        noisy.declares = Declaration(force_scatter=allowed)
        found = CHECKS["reset-clears"](
            Runs(play(noisy, path, 1e-3), again=lambda noisy=noisy: play(noisy, path, 1e-3)), scene
        )
        assert found.outcome is outcome
    assert CHECKS["reset-clears"](Runs(play(noisy, path, 1e-3)), scene).outcome is Outcome.NOT_APPLICABLE


def test_a_declaration_is_metadata_of_the_recording():
    scene = Scene(model=circle())
    assert declared(resolve("minimum-distance")(scene))["spring"] == Spring.ERROR
    assert declared(resolve("conformal")(scene))["spring"] == Spring.NORMAL
    assert "spring" not in declared(resolve("minimum-distance+square-root")(scene))
    for wrong in ("error", Declaration(force_scatter=math.nan), Declaration(ihip_scatter=-1.0)):
        noisy = Noisy(None)
        noisy.declares = wrong
        with pytest.raises(RendererError, match="declares"):
            declared(noisy)


def test_a_loop_begins_outside_its_circle():
    with pytest.raises(Exception, match="its start lies outside"):
        loop(start=(0.01, 0.001))


@pytest.mark.parametrize("kind", ["cassinian", "ellipse", "star"])
def test_loops_of_the_suite_lie_inside_their_models_and_begin_outside(kind):
    (case,) = [case for case in load_suite("thesis").cases if case.name == f"{kind}-loops"]
    boundary = make_model(**case.model).boundary
    hip = case.build_stimulus(case.build_scene(), None).sampled(1e-3)[1]
    assert boundary.signed_distance(hip[[0, -1]]).min() > 5e-3
    assert boundary.signed_distance(hip[260:-260]).max() < -4e-3


class DeadSpot:
    """The right spring to the nearest point, and no force at all beyond 4 mm of depth."""

    def __init__(self, scene, spring):
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness
        self.declares = None if spring is None else Declaration(spring=spring)

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        at = self.boundary.frame([hip])
        ihip = at.foot[0] if at.distance[0] < 0.0 else hip
        return Response(ihip, (at.distance[0] > -4e-3) * self.stiffness * (ihip - hip))


@pytest.mark.parametrize("spring", [None, *Spring])
def test_a_contact_point_without_a_force_deep_inside_is_not_taken_for_a_spring(spring):
    scene = Scene(model=circle())
    path = Path(np.array([0.0, 0.5, 1.0]), np.array([[0.105, 0.0], [0.083, 0.0], [0.083, 0.02]]))
    found = CHECKS["force-magnitude"](Runs(play(DeadSpot(scene, spring), path, 1e-3)), scene)
    assert found.outcome is Outcome.FAIL
    assert found.level is (Level.SHOULD if spring is None else Level.MUST)
