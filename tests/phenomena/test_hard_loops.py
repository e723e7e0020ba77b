"""Hard cases in time: closed loops on either side of their bounds, and long runs that add up no rounding."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from asked import finding
from made import FAIL, NO, PASS, UNDECIDED, found, recorded
from msgspec import structs
from scipy.linalg import expm
from scipy.optimize import brentq

from hapticeval.discovery import resolve
from hapticeval.effects.actuators import Delay
from hapticeval.laws import law_value
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import wrapped
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.simulation import kernels
from hapticeval.simulation.closed_loop import loop_of
from hapticeval.simulation.playback import Rows, Ticks, lead_on
from hapticeval.stimulus.stimulus import Experiment
from hapticeval.suite.reading import load_suite

SUITE = load_suite("hard-cases-loops")
CIRCLE = SUITE.case("loop-1-gram").build_scene()


def growth(stiffness, mass, damping, pull, late, dt=1e-3):
    """Per tick, of a mass between a hand and a spring that is held and whole ticks late: by the matrix exponential."""
    flow = np.zeros((3, 3))
    flow[0, 1], flow[1] = 1.0, np.array([-pull, -damping, 1.0]) / mass
    moved = expm(dt * flow)[:2]
    state = np.zeros((2 + late, 2 + late))
    state[:2, :2] = moved[:, :2]
    spring = np.zeros(2 + late)
    spring[0] = -stiffness
    if late:
        state[:2, 2], state[2] = moved[:, 2], spring
    else:
        state[:2] += np.outer(moved[:, 2], spring)
    return float(np.abs(np.linalg.eigvals(state)).max())


def stated(case):
    """Stiffness, mass, the hand's damping and stiffness, and ticks of delay of a case."""
    scene, hand = case.build_scene(), case.experiment.hand
    delay = scene.effect(Delay)
    late = 0 if delay is None else round(delay.time / scene.sampling_time)
    return scene.stiffness, scene.mass, hand.damping, hand.stiffness, late


@pytest.mark.parametrize("name", ["loop-stiff-star", "loop-stiff-dumbbell", "loop-1-gram", "loop-late"])
def test_stiffness_is_within_a_hundredth_of_what_is_passive(name):
    stiffness, _, damping, _, late = stated(SUITE.case(name))
    assert stiffness / (2.0 * damping / (1e-3 * (1 + 2 * late))) == pytest.approx(0.99, abs=1e-9)


def test_stiffness_over_mass_is_within_a_hundredth_of_what_is_stable():
    stiffness, *rest = stated(SUITE.case("loop-k-over-m"))
    assert growth(stiffness / 0.99, *rest) == pytest.approx(1.0, abs=1e-3)
    assert growth(1.01 * stiffness / 0.99, *rest) > 1.0 > growth(stiffness, *rest)


@pytest.mark.parametrize("name", ["loop-stiff-dumbbell", "loop-k-over-m", "loop-late"])
@pytest.mark.parametrize("share", [0.97, 1.03])
def test_a_loop_comes_to_rest_up_to_its_bound_and_not_beyond(name, share):
    """Of one that is pressed on the surface, where eigenvalues say so, by a renderer with the scene's stiffness."""
    case = SUITE.case(name)
    _, *rest = stated(case)
    limit = brentq(lambda each: growth(each, *rest) - 1.0, 1e3, 1.2e4)
    other = {**case.scene, "stiffness": share * limit}
    changed = structs.replace(case, scene=other, checks=("comes-to-rest",))
    (verdict,) = judge(resolve("minimum-distance"), "r", "s", changed).verdicts
    assert verdict.outcome is (Outcome.PASS if share < 1.0 else Outcome.FAIL), verdict.finding.message


def test_digits_are_kept_in_closed_loop():
    """Of other renderers and loops that stands in the recorded verdicts of the suite."""
    evidence = finding(resolve("minimum-distance"), SUITE.case("loop-1-gram"), "numerical-stability").evidence
    assert evidence["motions"] == ["turned and shifted"]
    assert evidence["digits"] > 9.0


def swung(rate, *, quiet=0.0, source="experiment"):
    """A tool that swings about a place 10 mm inside a circle with an amplitude that goes as exp(rate t)."""
    time = 1e-3 * np.arange(4000)
    swing = 1e-3 * np.exp(rate * time + 20j * time)
    hip = np.column_stack([0.09 + swing.real, swing.imag])
    velocity = np.column_stack([((rate + 20j) * swing).real, ((rate + 20j) * swing).imag])
    meta = {"source": source} | ({} if quiet is None else {"quiet_from": quiet})
    return Runs(recorded(hip, meta=meta, velocity=velocity))


@pytest.mark.parametrize(
    ("runs", "outcome", "words"),
    [
        (swung(-1.0), PASS, "comes to rest"),
        (swung(0.0), FAIL, "1 times as fast"),
        (swung(-0.2), FAIL, "0.819 times as fast"),
        (swung(1.5), FAIL, "farther than the model is large"),
        (swung(-1.0, quiet=3.995), UNDECIDED, "5 samples only"),
        (swung(-1.0, quiet=None), UNDECIDED, "not known from when on"),
        (swung(-1.0, source="playback"), NO, "moves as it is led"),
    ],
    ids=["damped", "undamped", "slow", "runaway", "short", "unknown", "led"],
)
def test_what_comes_to_rest_is_told_from_what_does_not(runs, outcome, words):
    finding = found("comes-to-rest", runs, CIRCLE)
    assert (finding.outcome, words in finding.message) == (outcome, True), finding.message


def moving(speed, *, away=0.0, keep=slice(None)):
    """A tool on the circle along x with speeds (n,), m/s, its first row `away` (m) from the surface."""
    hip = np.column_stack([0.1 + 1e-3 * np.cumsum(speed), np.zeros(len(speed))])
    hip[0, 0] += away
    run = recorded(hip, meta={"source": "experiment", "quiet_from": 0.0}, velocity=np.column_stack([speed, 0 * speed]))
    return Recording(run.time[keep], {name: each[keep] for name, each in run.channels.items()}, dict(run.meta))


def test_what_is_below_any_digit_of_the_model_is_rest():
    assert found("comes-to-rest", moving(np.full(100, 1e-10)), CIRCLE).outcome is PASS
    assert found("comes-to-rest", moving(np.full(100, 1e-9)), CIRCLE).outcome is FAIL


@pytest.mark.parametrize(("times", "single", "outcome"), [(0.9, True, PASS), (1.1, True, FAIL), (0.9, False, FAIL)])
def test_a_spring_that_is_known_in_single_precision_swings_by_its_rounding(times, single, outcome):
    """K = 1000 N/m, m = 0.1 kg: 100 rad/s times 4 * 2^-23 of the 0.1 m at which the tool rests."""
    known = 4.0 * 2.0**-23 * float(np.float32(0.1))
    speed = times * math.sqrt(CIRCLE.stiffness / CIRCLE.mass) * known
    run = moving(np.full(100, speed))
    ihip = np.tile([float(np.float32(0.1)) if single else 0.1, 0.0], (100, 1))
    channels = {**run.channels, "hip": run.hip - np.array([1e-3, 0.0]), "ihip": ihip}
    assert found("comes-to-rest", Recording(run.time, channels, dict(run.meta)), CIRCLE).outcome is outcome


@pytest.mark.parametrize("row", range(9))
def test_the_second_quarter_of_the_quiet_time_is_compared_with_its_last_half(row):
    """Nine rows: the second quarter are the rows 2 to 4, and the last half 5 to 8."""
    speed = np.full(9, 1e-4)
    speed[row] = 1e-2
    finding = found("comes-to-rest", moving(speed), CIRCLE)
    assert finding.evidence["speed_before_m_s"] == (1e-2 if 2 <= row <= 4 else 1e-4)
    assert finding.metric.value == (1e-2 if row >= 5 else 1e-4)


def test_what_begins_to_move_late_does_not_come_to_rest():
    finding = found("comes-to-rest", moving(np.where(np.arange(100) < 70, 0.0, 1e-3)), CIRCLE)
    assert (finding.outcome, finding.evidence["speed_before_m_s"]) == (FAIL, 0.0)
    assert finding.evidence["tick"] >= 70


def test_a_tool_may_begin_farther_away_than_the_model_is_large():
    speed = np.geomspace(1.0, 1e-6, 100)
    assert found("comes-to-rest", moving(0.01 * speed, away=1.0), CIRCLE).outcome is PASS
    assert "farther" in found("comes-to-rest", moving(100.0 * speed), CIRCLE).message


def test_rows_that_are_missing_where_speeds_are_compared_leave_it_undecided():
    gap = np.flatnonzero((np.arange(100) < 20) | (np.arange(100) > 60))
    finding = found("comes-to-rest", moving(np.zeros(100), keep=gap), CIRCLE)
    assert (finding.outcome, "rows are missing" in finding.message) == (UNDECIDED, True)


def test_when_an_operator_keeps_still_is_known():
    still = Experiment(1.0, np.zeros(2), np.zeros(2), np.array([0.1, 0.3, 0.5]), np.array([[1.0, 0], [2, 0], [2, 0]]))
    assert still.quiet_from == 0.3
    assert replace(still, force=np.ones((3, 2))).quiet_from == 0.0


def lapped(change):
    """Five laps of 400 ticks on a circle in a circle, whose IHIPs are off by `change(lap)` times 1 mm."""
    turn = np.tile(np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False), 5)
    out = np.column_stack([np.cos(turn), np.sin(turn)])
    off = 1e-3 * np.repeat([change(lap) for lap in range(5)], 400)
    force = 3960.0 * 0.02 * out
    return Runs(recorded(0.08 * out, ihip=(0.1 + off[:, np.newaxis]) * out, force=force, meta={"source": "playback"}))


@pytest.mark.parametrize(
    ("change", "outcome"),
    [
        (lambda _: 0.0, PASS),
        (lambda lap: float(lap == 0), PASS),
        (lambda lap: 1e-6 * lap, FAIL),
        (lambda lap: float(lap == 3), FAIL),
    ],
    ids=["alike", "loads", "creeps", "once"],
)
def test_what_changes_from_lap_to_lap_is_drift(change, outcome):
    finding = found("drift", lapped(change), CIRCLE)
    assert finding.outcome is outcome, finding.message
    if outcome is FAIL:
        assert finding.evidence["digits"] < 9.0


def laps_of(hip, ihip):
    return Runs(recorded(hip, ihip=ihip, meta={"source": "playback"}))


@pytest.mark.parametrize(("off", "outcome"), [(0.9e-9, PASS), (3e-9, FAIL)])
def test_ten_times_the_rounding_of_the_hand_is_no_drift(off, outcome):
    base = lapped(lambda _: 0.0).base
    out = base.ihip / 0.1
    rounded = np.repeat([0.0, 0.0, 0.0, 1.0, 0.0], 400)[:, np.newaxis]
    finding = found("drift", laps_of(base.hip + 1e-10 * rounded * out, base.ihip + off * rounded * out), CIRCLE)
    assert finding.outcome is outcome, finding.message


def test_laps_in_free_space_show_no_drift():
    free = 1.5 * lapped(lambda _: 0.0).base.hip
    assert found("drift", laps_of(free, free), CIRCLE).outcome is NO


@pytest.mark.parametrize("creeps", [0, 1])
def test_of_several_closed_ways_the_one_that_drifts_most_counts(creeps):
    still, drifting = lapped(lambda _: 0.0).base, lapped(lambda lap: 1e-6 * lap).base
    parts = [drifting if creeps == at else still for at in (0, 1)]
    scale = np.repeat([1.0, 0.9], 2000)[:, np.newaxis]
    hip = scale * np.vstack([part.hip for part in parts])
    finding = found("drift", laps_of(hip, np.vstack([part.ihip for part in parts])), CIRCLE)
    assert finding.outcome is FAIL
    assert finding.evidence["tick"] // 2000 == creeps
    assert finding.evidence["off_m"] == pytest.approx(2e-9, rel=1e-3)
    assert finding.evidence["ticks"] == 3200, "laps count with the row that closes them"


def test_two_laps_show_no_drift():
    runs = lapped(lambda _: 0.0)
    short = recorded(
        runs.base.hip[:801], ihip=runs.base.ihip[:801], force=runs.base.force[:801], meta={"source": "playback"}
    )
    assert found("drift", Runs(short), CIRCLE).outcome is UNDECIDED


def test_what_a_rigid_tool_passes_on_is_no_answer_that_could_drift():
    """Its HIP is the tool's own place, which the hand may press at as it likes."""
    turn = np.tile(np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False), 5)
    out = np.column_stack([np.cos(turn), np.sin(turn)])
    force = np.linspace(1.0, 2.0, 2000)[:, np.newaxis] * out
    finding = found("drift", Runs(recorded(0.1 * out, force=force, meta={"source": "playback"})), CIRCLE)
    assert (finding.outcome, "rigid" in finding.message) == (UNDECIDED, True)
    # A force without an IHIP, felt inside, is an answer to the place.
    felt = Runs(recorded(0.08 * out, force=force, meta={"source": "playback"}))
    assert found("drift", felt, CIRCLE).outcome is FAIL


TICKS, PART = 10_000_000, 100_000


@pytest.mark.slow
@pytest.mark.parametrize("name", ["minimum-distance", "constraint@curve", "combescure", "set-stabilisation"])
def test_ten_million_ticks_of_rest_do_not_drift(name):
    """The compiled loop, pressed on a Cassinian, in parts of which each goes on from the last to the bit."""
    case = SUITE.case("rest-1e5-ticks")
    scene = case.build_scene()
    renderer = resolve(name)(scene)
    experiment = replace(case.build_stimulus(scene, renderer), duration=(PART - 1) * 1e-3)
    loop, law = loop_of(experiment, scene, 1e-3), wrapped(renderer).law
    renderer.reset(loop.out.measured_hip[0])
    ends = []
    for _ in range(TICKS // PART):
        assert kernels.run(law_value(law.function, law.data), law.data, loop) == (PART, kernels.DONE, 0)
        ends.append(np.concatenate([channel[-1] for channel in (loop.out.hip, loop.out.ihip, loop.out.velocity)]))
    drift = np.abs(np.array(ends) - ends[0]).max(axis=0)
    print(f"\n{name}: {TICKS:.0e} ticks, HIP {drift[:2].max():.2g} m, IHIP {drift[2:4].max():.2g} m")
    assert drift.max() < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("name", ["minimum-distance", "constraint@curve", "combescure", "set-stabilisation"])
def test_ten_million_ticks_of_laps_do_not_drift(name):
    """The compiled law round a circle inside a Cassinian, 20,000 laps of 500 ticks over the same HIPs."""
    scene = Scene(model=SUITE.case("laps-1e5-ticks").build_scene().model)
    renderer = resolve(name)(scene)
    turn = np.linspace(0.0, 2.0 * np.pi, 500, endpoint=False)
    lap = np.array([0.06, 0.0]) + 0.035 * np.column_stack([np.cos(turn), np.sin(turn)])
    hips = np.tile(lap, (PART // 500, 1))
    renderer.reset(np.array([0.2, 0.0]))
    rows = Rows(hips, np.zeros_like(hips), np.full(PART, 1e-3))
    first, drift = None, 0.0
    for _ in range(TICKS // PART):
        answers = np.hstack(lead_on(wrapped(renderer), rows, Ticks(0))[:2]).reshape(-1, 500, 4)
        first = answers[1] if first is None else first
        drift = max(drift, float(np.abs(answers[1:] - first).max()))
    print(f"\n{name}: {TICKS:.0e} ticks, answers {drift:.2g}")
    assert drift == 0.0
