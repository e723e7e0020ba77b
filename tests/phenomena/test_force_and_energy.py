"""Passivity and force magnitude: what is broken is stopped, and what is honest is not blamed."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import force_sizes
import honest
import numpy as np
import outsiders
import pytest
import sympy
from broken import scaled, spoiled
from hypothesis import given, settings
from hypothesis import strategies as st
from made import FAIL, PASS, UNDECIDED, changed, found, outcome, recorded
from msgspec.structs import replace

from hapticeval.discovery import resolve
from hapticeval.effects.actuators import Delay
from hapticeval.effects.sensors import VelocityFilter
from hapticeval.errors import InputError, RendererError
from hapticeval.geometry.catalogue import cassinian, circle, line, make_model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks import passivity
from hapticeval.phenomena.measures import gained_work
from hapticeval.phenomena.measures.closed_paths import laps
from hapticeval.phenomena.verdict import Level
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import Declaration, Response, Spring, wrapped
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play
from hapticeval.stimulus.experiments import build_path
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.reading import load_suite

K = 1000.0
ROUND = Scene(model=circle(), stiffness=K)
PLANE = Scene(model=line(), stiffness=K)
IN_AND_OUT = Path([0.0, 0.4, 0.8], [[-0.02, 0.004], [0.0, -0.004], [0.02, 0.004]])
"""4 mm into a plane, aslant, and out again."""


def led(field, path, dt, *, lag=0, stiffness=K):
    """What a force field gives along a path, `lag` ticks late; the IHIP is where a spring would have it."""
    time, hip = path.sampled(dt)
    rows = np.maximum(np.arange(time.size) - lag, 0)
    force = np.array([field(point) for point in hip])[rows]
    return recorded(hip, hip[rows] + force / stiffness, force, dt=dt, meta={"source": "playback", "dt": dt})


def judged_field(field, path, *, lag=0, dt=1e-3, scene=ROUND):
    def refine(factor):
        return led(field, path, dt / factor, lag=lag, stiffness=scene.stiffness)

    return found("passivity", Runs(refine(1), refine=refine).remembered(), scene)


def loop(centre=(0.01, 0.0), radius=0.004, lap=0.2, start=(0.3, 0.0), laps=3, approach=0.1):
    spec = {"start": start, "centre": centre, "radius": radius, "laps": laps, "lap": lap, "approach": approach}
    return build_path({"kind": "loop", **spec}, circle().curve, FilePath())


def runs(make, scene=PLANE, path=IN_AND_OUT, **meta):
    """A renderer led along a path, with a way to refine it, and to lead it once more."""
    renderer = make(scene)

    def at(factor):
        return changed(play(renderer, path, scene.sampling_time / factor, scene=scene), meta)

    return Runs(at(1), refine=at, again=lambda: at(1)).remembered()


# The laws


@given(
    st.floats(-0.02, 0.02),
    st.floats(-0.02, 0.02),
    st.floats(1e-3, 8e-3),
    st.floats(-1.0, 1.0),
    st.integers(0, 3),
)
@settings(max_examples=20)
def test_the_work_of_a_gradient_round_a_loop_is_none_in_the_limit(x, y, radius, bend, lag):
    """U = (K/2)(x^2 + 2 y^2 + c x y^2 / 10 mm): a force without curl, however late, is not taken for active.

    Its slope is at most 8 K, the scene's stiffness, so that no more than that explains is added by holding it.
    """
    c = bend / 0.01
    scene = Scene(model=circle(), stiffness=8.0 * K)

    def force(p):
        return -K * np.array([p[0] + 0.5 * c * p[1] ** 2, 2.0 * p[1] + c * p[0] * p[1]])

    found = judged_field(force, loop((x, y), radius), lag=lag, scene=scene)
    assert found.outcome is PASS, found.message
    assert abs(found.metric.value) <= found.bound


@given(st.floats(0.05, 1.0), st.floats(1e-3, 8e-3), st.integers(0, 3), st.sampled_from([-1.0, 1.0]))
@settings(max_examples=20)
def test_the_work_of_a_curl_is_its_integral_over_the_loop(share, radius, lag, sense):
    """Green: F = -K x + s c K (-y, x) has the curl 2 s c K everywhere, and W = 2 s c K pi r^2 a lap, one way round."""
    found = judged_field(lambda p: -K * p + sense * share * K * np.array([-p[1], p[0]]), loop(radius=radius), lag=lag)
    assert found.outcome is FAIL
    assert found.metric.value == pytest.approx(2.0 * share * K * math.pi * radius**2, rel=2e-3)


@pytest.mark.parametrize("lag", [0, 1, 2, 3])
def test_holding_a_late_penalty_gains_l_and_a_half_times_k_times_the_squared_steps(lag):
    """The difference to the formula is of order (L a)^2, a the turn of a step: see the next test."""
    path, dt = loop(), 1e-3
    found = judged_field(lambda p: -K * p, path, lag=lag, dt=dt)
    steps = np.linalg.norm(np.diff(path.sampled(dt)[1], axis=0), axis=1)[100:300]
    square = K * float(np.sum(steps**2))
    assert found.outcome is PASS
    assert found.evidence["way"] == gained_work.LAP
    assert found.evidence["hold_J"] == pytest.approx(0.5 * square, rel=1e-2)
    assert found.evidence["lag_J"] == pytest.approx(lag * square, rel=1e-2, abs=1e-6)


def test_the_hold_alone_by_symbols():
    """On a circle of radius r, -K x[i - L] . (x[i + 1] - x[i]) = K r^2 (cos L a - cos (L + 1) a)."""
    a, i, lag, r, stiffness = sympy.symbols("a i L r K", positive=True)
    at = {k: sympy.Matrix([r * sympy.cos(a * k), r * sympy.sin(a * k)]) for k in (i - lag, i, i + 1)}
    one = sympy.simplify((-stiffness * at[i - lag]).dot(at[i + 1] - at[i]))
    assert sympy.simplify(one - stiffness * r**2 * (sympy.cos(lag * a) - sympy.cos((lag + 1) * a))) == 0
    series = sympy.series(one, a, 0, 4).removeO()
    assert sympy.simplify(series - (lag + sympy.Rational(1, 2)) * stiffness * (r * a) ** 2) == 0


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
    (case,) = [case for case in load_suite("thesis").cases if case.name == "cassinian-loops"]
    (verdict,) = judge(resolve("set-stabilisation"), "", "", replace(case, checks=("passivity",))).verdicts
    path = loop(centre=(0.08, 0.012), radius=0.004, lap=0.5, start=(0.11, 0.02), approach=0.25)
    scene = Scene(model=cassinian())
    hip = path.sampled(1e-4)[1][2500 : 2500 + 5001]
    frame = scene.model.boundary.closest_point(hip)
    n, moved = frame.distance, np.diff(hip, axis=0)
    kappa = np.trace(frame.shape, axis1=1, axis2=2)
    tangent = np.column_stack([-frame.normal[:, 1], frame.normal[:, 0]])
    w = np.sum(0.5 * (tangent[1:] + tangent[:-1]) * moved, axis=1) / 1e-4
    middle = 0.5 * (kappa[1:] + kappa[:-1]), 0.5 * (n[1:] + n[:-1])
    work = scene.mass * float(np.sum(middle[0] * w**2 / (1.0 + middle[0] * middle[1]) * np.diff(n)))
    assert verdict.finding.metric.value == pytest.approx(abs(work), rel=5e-2)


# Laps


def drifting_laps(radius, gap):
    """Five laps of eight ticks round (10, 0) mm, each nearer to the origin by `gap` (m) than the one before."""
    ticks = np.arange(41)
    angle = 2.0 * np.pi * ticks / 8.0
    x = 0.01 + radius * np.cos(angle) - gap * ticks / 8.0
    return Path(1e-3 * ticks, np.column_stack([x, radius * np.sin(angle)]))


@pytest.mark.parametrize("radius", [2e-9, 2e-6])
def test_a_spring_is_not_blamed_for_what_it_had_stored_where_laps_do_not_quite_close(radius):
    """10 N over a gap of 0.18 nm a lap: points 0.2 nm apart are one."""
    path = drifting_laps(radius, 0.18e-9)
    assert laps(path.points, ROUND.model.size)
    assert judged_field(lambda p: -K * p, path).outcome is PASS


def test_what_a_lap_creates_beyond_its_gap_is_seen():
    """The gap stores 10 N times 0.18 nm = 1.8 nJ at the most, and a curl of 2 K gives 2 K pi r^2 = 25 nJ."""
    path = drifting_laps(2e-6, 0.18e-9)
    finding = judged_field(lambda p: -K * p + K * np.array([-p[1], p[0] - 0.01]), path)
    assert finding.outcome is FAIL
    assert finding.evidence["way"] == gained_work.LAP


INTO_CONTACT = Path([0.0, 0.005, 0.01, 0.015], [[0.0, 1e-12], [0.0, 1e-12], [4e-8, -1e-12], [4e-8, -1e-12]])
"""Beside a plane and then in it, by a picometre, and 40 nm along it: with an IHIP apart it is contact only there."""


@pytest.mark.parametrize(("stiffness", "expected"), [(K, PASS), (0.0, FAIL)])
def test_a_spring_below_the_floor_of_contact_may_give_what_it_had_stored_and_a_push_may_not(stiffness, expected):
    """47 uN: a spring of 1,000 N/m stores F^2 / (2 K) = 1.10 pJ and gives 1.08 pJ of it, a steady push 1.88 pJ."""
    finding = judged_field(lambda p: np.array([47e-6 - stiffness * p[0], 0.0]), INTO_CONTACT, scene=PLANE)
    assert finding.outcome is expected, finding


def test_without_a_closed_way_nothing_is_known():
    finding = judged_field(lambda p: -K * (p + 1.0), Path([0.0, 1.0], [[0.0, 0.0], [0.01, 0.0]]))
    assert finding.outcome is UNDECIDED
    assert "what is stored is not known" in finding.message


def test_a_way_that_refinement_leaves_open_is_no_pass():
    """In and out of a plane, and once more beside it with a force on the way out that tends to nothing."""

    def at(factor):
        dt = 1e-3 / factor
        y = np.interp(dt * np.arange(1600 * factor + 1), [0.0, 0.4, 0.8, 1.2, 1.6], [2e-3, -4e-3, 2e-3, -4e-3, 2e-3])
        time = dt * np.arange(y.size)
        noise = np.random.default_rng(factor).uniform(0.0, 2.0, y.size) * (time > 1.2) * (factor > 1)
        hip = np.column_stack([0.01 * (time > 0.8), y])
        ihip = np.column_stack([hip[:, 0], np.maximum(y, 0.0)])
        return recorded(hip, ihip, K * (ihip - hip) * (1.0 + noise)[:, None], dt=dt)

    finding = found("passivity", Runs(at(1), refine=at), PLANE)
    assert finding.outcome is UNDECIDED
    assert "1 of 2 ways" in finding.message


@pytest.mark.parametrize("dt", [1e-3, 4e-3])
def test_a_pass_says_what_holding_the_force_adds(dt):
    """In and out of a plane: a held spring gives sum of F_k (x_k+1 - x_k), its law nothing."""

    def at(factor):
        time = dt / factor * np.arange(round(0.8 / dt) * factor + 1)
        hip = np.column_stack([np.zeros_like(time), np.interp(time, [0.0, 0.4, 0.8], [2e-3, -4e-3, 2e-3])])
        ihip = np.maximum(hip, 0.0)
        return recorded(hip, ihip, K * (ihip - hip), dt=dt / factor)

    finding = found("passivity", Runs(at(1), refine=at), PLANE)
    held = 1e3 * np.sum(at(1).force[:-1] * np.diff(at(1).hip, axis=0))
    assert finding.message.endswith(f"at {1e3 * dt:.3g} ms holding the force adds {held:.3g} mJ")


@pytest.mark.parametrize("duration", [0.45, 0.22, 0.17, 0.11, 0.07])
@pytest.mark.parametrize("late", ["late-2", "late-3"])
def test_a_late_spring_is_not_blamed_where_the_hand_turns_within_its_lag(late, duration):
    slide = outsiders.CASES["slide"]
    fast = replace(slide, checks=("passivity",), trajectory=replace(slide.trajectory, duration=duration))
    (verdict,) = judge(honest.factory(late, honest.Spring), late, "mine", fast).verdicts
    assert verdict.outcome in (PASS, UNDECIDED), verdict.finding.message


def test_late_motors_give_energy_whatever_the_renderer():
    scene = Scene(model=circle(), stiffness=K, effects=(Delay(1e-3),))
    finding = judged_field(lambda p: -K * p + 0.5 * K * np.array([-p[1], p[0]]), loop(), scene=scene)
    assert (finding.outcome, finding.level) == (FAIL, Level.INFO)
    filtered = Scene(model=circle(), damping=1.0, effects=(VelocityFilter(50.0),))
    assert passivity.active_by_nature(filtered) is not None
    assert passivity.active_by_nature(Scene(model=circle(), damping=1.0)) is None


def test_a_recording_that_cannot_be_refined_is_judged_by_itself():
    path = loop()
    curl = led(lambda p: 1e3 * max(0.02 - np.hypot(*p), 0.0) * np.array([-p[1], p[0]]), path, 1e-3)
    assert outcome("passivity", curl, ROUND) is FAIL
    finding = found("passivity", play(resolve("minimum-distance")(ROUND), path, 1e-3), ROUND)
    assert finding.outcome is PASS
    assert "weaker test" in finding.message


# The size of the force


@pytest.mark.parametrize("scheme", ["pp-v", "pp-d", "pp-pd", "square-root"])
def test_damped_schemes_and_a_root_that_declares_its_range_are_not_blamed(scheme):
    scene = Scene(model=line(), stiffness=K, damping=0.0 if scheme == "square-root" else 5.0)
    asked = runs(resolve(f"minimum-distance+{scheme}"), scene)
    assert {outcome(check, asked, scene) for check in ("passivity", "reset-clears", "force-magnitude")} == {PASS}


def test_a_root_that_declares_nothing_is_warned_of():
    asked = runs(resolve("minimum-distance+square-root"), PLANE)
    undeclared = {name: value for name, value in asked.base.meta.items() if not name.startswith("stiffness_")}
    base = Recording(asked.base.time, asked.base.channels, undeclared)
    finding = found("force-magnitude", base, PLANE)
    assert finding.outcome is FAIL
    assert "the force grows with the depth to the power 0.5" in finding.message


SWAYS = Path([0.0, 0.1, 0.2, 0.3, 0.4, 0.45], [[0, 4e-3], [0, -4e-3], [0, -2e-3], [0, -4e-3], [0, -2e-3], [0, 4e-3]])
TO_AND_FRO = Path(
    np.r_[0.0, np.linspace(0.1, 4.0, 9)], [[0.0, 4e-3], *([0.02 * (each % 2), -4e-3] for each in range(9))]
)
ONE_WAY = Path([0.0, 0.1, 4.0], [[0.0, 4e-3], [0.0, -4e-3], [0.02, -4e-3]])
SHORT_WAY_OUT = Path([0.0, 0.8, 0.84], [[0.0, 4e-3], [0.0, -4e-3], [0.0, 4e-3]])


def leaning(lean):
    """A fault: the force is turned by so many rad, about the z axis in space."""
    turn = np.eye(3)
    turn[:2, :2] = [[math.cos(lean), -math.sin(lean)], [math.sin(lean), math.cos(lean)]]
    return lambda tick: (tick.ihip, turn[: tick.force.size, : tick.force.size] @ tick.force)


@pytest.mark.parametrize("lean", [0.3, 1.05, 1.5])
def test_the_size_of_a_force_is_right_whatever_its_direction_and_a_pull_is_not(lean):
    for turned, expected in ((lean, PASS), (math.pi - lean, FAIL)):
        assert (
            found("force-magnitude", runs(spoiled(leaning(turned), honest.Spring), path=TO_AND_FRO), PLANE).outcome
            is expected
        )


SIZED = {
    **force_sizes.FAULTS,
    "weak-stretch": scaled(lambda tick: 0.5 if 1000 <= tick.number < 1057 else 1.0),
    "pulls": scaled(lambda tick: -2.0),
    "drops": scaled(lambda tick: 0.0 if tick.number % 700 == 699 else 1.0),
    "limited": scaled(lambda tick: min(1.0, 2.0 / float(np.linalg.norm(tick.force) or 1.0))),
    "sags": scaled(lambda tick: 0.7 if 1000 <= tick.number < 2500 else 1.0),
}


@pytest.mark.parametrize(
    ("name", "path", "words"),
    [
        ("third", IN_AND_OUT, "the force is 0.333 times what is asked"),
        ("pulls", IN_AND_OUT, "the force pulls, 2 times as hard as it should push"),
        ("stiffer", IN_AND_OUT, "the force is 1.05 times what is asked"),
        ("spikes", IN_AND_OUT, "in 8 ticks, every 50 ticks, first at 0.249 s"),
        ("kicks", IN_AND_OUT, "the force is 1.1 times what is asked on the way out"),
        ("kicks", SWAYS, "the force is 1.1 times what is asked on the way out"),
        ("kicks", SHORT_WAY_OUT, "the force is 1.1 times what is asked on the way out"),
        ("drifts", TO_AND_FRO, "it drifts: the stiffness grows by 0.05 of what is asked a second"),
        ("drifts", ONE_WAY, "it drifts: the stiffness grows by 0.05 of what is asked a second"),
        ("by-place", TO_AND_FRO, "the stiffness varies with the place along x, from 0.795 to 1.2 of what is asked"),
        ("by-place", ONE_WAY, "the stiffness varies with the time"),
        ("dead-band", IN_AND_OUT, "the force begins 0.5 mm inside the model"),
        ("outage", TO_AND_FRO, "the force is missing at times from 1 to 1.06 s"),
        ("weak-stretch", TO_AND_FRO, "the force is 0.5 times what is asked at times from 1 to 1.06 s"),
        ("drops", TO_AND_FRO, "the force is missing in 5 ticks, every 700 ticks, first at 0.699 s"),
        ("limited", IN_AND_OUT, "the force never exceeds 2 N"),
        ("sags", TO_AND_FRO, "the force is 0.7 times what is asked at times from 1 to 2.5 s"),
        ("kick", IN_AND_OUT, "a kick of up to 3 N where the contact begins or ends"),
        ("one-newton", IN_AND_OUT, "the force in contact is 1 N at any depth"),
    ],
)
def test_a_deviation_is_named_by_what_it_goes_with(name, path, words):
    finding = found("force-magnitude", runs(spoiled(SIZED.get(name, name)), path=path), PLANE)
    assert finding.outcome is FAIL
    assert words in finding.message


@pytest.mark.parametrize(("name", "times"), [("minimum-distance", 1.0), ("third", 3.0)])
def test_the_depth_that_k_asks_for_is_beside_the_measured_one(name, times):
    make = resolve(name) if times == 1.0 else spoiled(name)
    finding = found("force-magnitude", runs(make), PLANE)
    assert finding.evidence["depth_m"] == pytest.approx(times * finding.evidence["depth_asked_m"], rel=1e-9)


def test_a_force_only_renderer_that_is_too_soft_fails():
    soft = spoiled(lambda tick: (tick.hip, tick.force / 3.0))
    assert outcome("force-magnitude", runs(soft), PLANE) is FAIL


class DeadSpot(honest.Spring):
    """The right spring to the nearest point, and no force at all beyond 4 mm of depth."""

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force * (np.linalg.norm(ihip - hip) < 4e-3))


@pytest.mark.parametrize("spring", [None, *Spring])
def test_a_contact_point_without_a_force_deep_inside_is_not_taken_for_a_spring(spring):
    make = DeadSpot if spring is None else honest.declaring(DeadSpot, spring=spring)
    path = Path([0.0, 0.5, 1.0], [[0.105, 0.0], [0.083, 0.0], [0.083, 0.02]])
    finding = found("force-magnitude", runs(make, ROUND, path), ROUND)
    assert finding.outcome is FAIL
    assert finding.level is Level.MUST


@given(
    place_step=st.floats(1e-7, 2e-5),
    force_step=st.floats(1e-5, 5e-3),
    gain=st.sampled_from([1.0, 1.2, 0.85]),
)
@settings(max_examples=30)
def test_a_log_is_judged_to_the_steps_that_it_is_written_in(place_step, force_step, gain):
    """Of a spring at depths up to 4 mm, where steps make up to 1.7 per cent of the force: a fifth is never hidden."""
    angle = np.linspace(0.0, 5.0, 1000)
    hip = np.column_stack([0.03 * np.sin(angle), 0.002 * np.cos(7.3 * angle) - 0.002])
    ihip = np.where(hip[:, 1:] < 0.0, hip * [1.0, 0.0], hip)
    places, force = np.array([hip, ihip]), gain * K * (ihip - hip)
    hip, ihip = place_step * np.round(places / place_step)
    finding = found("force-magnitude", recorded(hip, ihip, force_step * np.round(force / force_step)), PLANE)
    assert finding.outcome is (PASS if gain == 1.0 else FAIL), finding.message


# Declarations


def test_a_declaration_is_metadata_of_the_recording(refused):
    assert wrapped(resolve("minimum-distance")(ROUND)).meta["spring"] == Spring.ERROR
    assert wrapped(resolve("conformal")(ROUND)).meta["spring"] == Spring.NORMAL
    assert "spring" not in wrapped(resolve("minimum-distance+square-root")(ROUND)).meta
    for wrong in ("error", Declaration(force_scatter=math.nan), Declaration(ihip_scatter=-1.0)):
        renderer = honest.Spring(ROUND)
        renderer.declares = wrong
        with refused(RendererError):
            wrapped(renderer)


# The loops of the suite


def test_a_loop_begins_outside_its_circle(refused):
    with refused(InputError):
        loop(start=(0.01, 0.001))


@pytest.mark.parametrize("kind", ["cassinian", "ellipse", "star"])
def test_loops_of_the_suite_lie_inside_their_models_and_begin_outside(kind):
    (case,) = [case for case in load_suite("thesis").cases if case.name == f"{kind}-loops"]
    boundary = make_model(**case.model).boundary
    hip = case.build_stimulus(case.build_scene(), None).sampled(1e-3)[1]
    assert boundary.signed_distance(hip[[0, -1]]).min() > 5e-3
    assert boundary.signed_distance(hip[260:-260]).max() < -4e-3


def test_a_tool_that_may_be_on_the_surface_yet_needs_no_force_and_may_not_pull():
    """The first half of the way is pressed 1 mm deep, the other 0.1 mm: less than the tool stands off."""
    along, deep = 1e-4 * np.arange(400), np.where(np.arange(400) < 200, 1e-3, 1e-4)
    hip, ihip = np.column_stack([along, -deep]), np.column_stack([along, np.full(400, 2e-4)])
    for share, expected in ((1.0, PASS), (0.0, PASS), (-1.0, FAIL)):
        force = K * np.column_stack([0.0 * along, np.where(deep > 5e-4, 1.0, share) * (ihip - hip)[:, 1]])
        meta = {"source": "playback", "standoff": 4e-4}
        finding = found("force-magnitude", recorded(hip, ihip, force, meta=meta), PLANE)
        assert finding.outcome is expected, (share, finding.message)


@pytest.mark.parametrize(("braking", "expected"), [(1.0, PASS), (0.0, PASS), (-1.0, FAIL)])
def test_a_damper_brakes_and_does_not_drive(braking, expected):
    """A hand that goes 1 to 5 mm deep and back, in a scene with a damper of 5 N s/m: at 42 mm/s that makes 0.21 N."""
    depth, aside = 3e-3 - 2e-3 * np.cos(2.0 * np.pi * np.arange(600) / 300), np.zeros(600)
    push = K * depth + braking * 5.0 * np.diff(depth, prepend=depth[:1]) / 1e-3
    base = recorded(np.column_stack([aside, -depth]), np.column_stack([aside, aside]), np.column_stack([aside, push]))
    assert outcome("force-magnitude", base, Scene(model=line(), stiffness=K, damping=5.0)) is expected
