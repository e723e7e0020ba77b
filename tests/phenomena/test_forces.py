"""Contact normal force, impulsive collision, centripetal force and memoryless on recordings made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from honest import Spring
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from made import FAIL, NO, PASS, UNDECIDED, changed, found, outcome, recorded

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import circle, from_vertices, line, make_model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks.impulsive_collision import operator_until_met
from hapticeval.phenomena.registry import CHECKS
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment, Hand, Path

PLANE = Scene(model=line(), stiffness=1000.0, mass=0.1)
LOOP = {"source": "experiment"}


def pressed(*, tilt=0.0, gain=1.0, push=2.0, aside=0.0):
    """At rest 2 mm deep under `push` newtons; the answer is `gain` times that, `tilt` radians off the normal."""
    rest = np.zeros((500, 2))
    force = rest + gain * push * np.array([np.sin(tilt), np.cos(tilt)])
    push_on = rest + np.array([0.3, -push])
    return recorded(
        rest + np.array([aside, -push / 1e3]), rest, force, meta=LOOP, velocity=rest, operator_force=push_on
    )


def test_a_force_equal_to_the_operator_s_normal_component_passes():
    finding = found("contact-normal-force", pressed(), PLANE)
    assert finding.outcome is PASS
    assert "equal at rest" in finding.message
    assert outcome("contact-normal-force", pressed(push=1e-6), PLANE) is UNDECIDED, "without a force"


@pytest.mark.parametrize(("tilt", "single", "expected"), [(0.9, True, PASS), (1.1, True, FAIL), (0.9, False, FAIL)])
def test_a_small_triangle_in_single_precision_tilts_by_the_rounding_of_its_corners(tilt, single, expected):
    """The hand rests 20 mm under the middle of a triangle, whose least height is some 3 mm."""
    scene = Scene(model=make_model(kind="icosphere", size=0.2, subdivisions=5), stiffness=1000.0)
    mesh = scene.model.boundary
    middle, normal = mesh.vertices[mesh.triangles[0]].mean(axis=0), mesh.normals[0]
    number = np.float32 if single else np.float64
    ihip = np.tile(middle.astype(number).astype(float), (30, 1))
    aside = np.cross(normal, mesh.vertices[mesh.triangles[0, 0]] - middle)
    aside /= np.linalg.norm(aside)
    known = 4.0 * 2.0**-23
    # Of corners and of depth, and 1e-6 rad.
    angle = known * np.abs(ihip).max() / mesh.least_heights(middle[np.newaxis])[0] + known * 0.2 / 0.02 + 1e-6
    force = 20.0 * (np.cos(tilt * angle) * normal + np.sin(tilt * angle) * aside)
    run = recorded(ihip - 0.02 * normal, ihip, np.tile(force, (30, 1)))
    assert outcome("contact-normal-force", run, scene) is expected


@given(tilt=st.floats(1e-3, 3.0), side=st.sampled_from([-1, 1]))
@settings(max_examples=20)
def test_a_tilted_force_fails_by_its_angle(tilt, side):
    finding = found("contact-normal-force", pressed(tilt=side * tilt), PLANE)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(np.degrees(tilt), rel=1e-6)


@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_without_an_ihip_the_angle_at_the_nearest_point_is_told_and_decides_nothing(tilt):
    run = pressed(tilt=tilt)
    bare = Recording(run.time, {"hip": run.hip, "force": run.force}, run.meta)
    finding = found("contact-normal-force", bare, PLANE)
    assert finding.outcome is UNDECIDED
    assert f"the force is {np.degrees(tilt):.3g} deg off, and it is not declared" in finding.message


def test_hundreds_of_newtons_have_no_power_of_ten():
    message = found("contact-normal-force", pressed(tilt=3.0, push=223.4), PLANE).message
    assert "220 N" in message
    assert "e+" not in message


@given(gain=st.one_of(st.floats(0.1, 0.99), st.floats(1.01, 3.0)))
@settings(max_examples=20)
def test_a_force_of_the_wrong_size_at_rest_fails_by_the_difference(gain):
    finding = found("contact-normal-force", pressed(gain=gain), PLANE)
    assert (finding.outcome, finding.metric.unit) == (FAIL, "N")
    assert finding.metric.value == pytest.approx(2.0 * abs(gain - 1.0), rel=1e-6)


def test_an_error_vector_that_leans_is_reported_where_the_force_does_not():
    """As under the transversal regulation (5.21): normal force, slanted projection."""
    finding = found("contact-normal-force", pressed(aside=2e-3 * np.tan(np.radians(30.0))), PLANE)
    assert finding.outcome is PASS
    assert finding.evidence["error_vector_angle_median_deg"] == pytest.approx(30.0)


@given(tilt=st.floats(0.02, 0.099))
@settings(max_examples=10)
def test_what_the_declared_resolution_forgives_is_reported(tilt):
    """On a circle of 0.1 m a resolution of 10 mm allows 0.1 rad, and the standing hand nothing more."""
    rest = np.zeros((100, 2))
    hand, tool = np.array([0.098, 0.0]), np.array([0.1, 0.0])
    force = rest + 2.0 * np.array([np.cos(tilt), np.sin(tilt)])
    bare, coarse = (
        found(
            "contact-normal-force",
            recorded(rest + hand, rest + tool, force, meta={"resolution": declared}),
            Scene(model=circle(), stiffness=1000.0),
        )
        for declared in (0.0, 0.01)
    )
    assert (bare.outcome, coarse.outcome) == (FAIL, PASS)
    assert coarse.evidence["angle_by_resolution_deg"] == pytest.approx(bare.metric.value, abs=1e-3)
    assert "which its resolution of 10 mm allows)" in coarse.message
    reported = coarse.message.split("(but for up to ")[1].split()[0]
    assert float(reported) == pytest.approx(np.degrees(tilt), rel=0.05)


def collision(*, ticks, restitution=0.0, speed=0.3):
    """The normal velocity goes from -speed to restitution * speed evenly over `ticks` ticks."""
    n, struck = 200, 50
    rising = -speed + (1.0 + restitution) * speed * np.arange(n - struck) / ticks
    along = np.concatenate([np.full(struck, -speed), np.minimum(rising, restitution * speed)])
    force = np.zeros((n, 2))
    force[:-1, 1] = 0.1 * np.diff(along) / 1e-3
    hip = np.column_stack([0.1e-3 * np.arange(n), np.full(n, 1e-3)])
    ihip = np.where(force[:, 1:] > 0, hip * [1.0, 0.0], hip)
    return recorded(hip, ihip, force, meta=LOOP, velocity=np.column_stack([np.full(n, 0.1), along]))


def test_a_spring_gives_an_impulse_by_the_depths_that_the_hand_is_inside():
    run = collision(ticks=4, restitution=0.5)
    depths, struck = np.array([2e-3, 1e-3, -1e-3, 3e-3]), int(np.argmax(run.force[:, 1] > 0.0))
    hip, ihip = run.hip.copy(), run.ihip.copy()
    hip[struck : struck + 4, 1], ihip[struck : struck + 4, 1] = -depths, 0.0
    finding = found("impulsive-collision", changed(run, hip=hip, ihip=ihip), PLANE)
    assert finding.facts.spring_impulse_Ns == pytest.approx(1000.0 * np.maximum(depths, 0.0).sum() * 1e-3)


@pytest.mark.parametrize("restitution", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("ticks", [1, 2, 4])
def test_an_impulse_within_four_ticks_passes(ticks, restitution):
    scene = Scene(model=line(), restitution=restitution)
    assert outcome("impulsive-collision", collision(ticks=ticks, restitution=restitution), scene) is PASS


@pytest.mark.parametrize(("pushes", "least", "largest"), [((9.0, 1.0, 3.0), 0.0, 5.0), ((0.0, -1.0, -3.0), -5.0, 0.0)])
def test_until_a_rigid_tool_is_met_the_operator_pushes_as_before_or_goes_on_to_change(pushes, least, largest):
    free = recorded(np.ones((4, 2)))
    assert operator_until_met(free, np.array([*pushes, 50.0]), 3) == (least, largest)
    met = changed(free, ihip=0.5 * free.hip)
    assert operator_until_met(met, np.array([*pushes, 50.0]), 3) == (0.0, 0.0)


def test_a_collision_in_which_the_tool_slides_over_an_edge_is_not_asked():
    """Beside an edge a late force is along the first face still, when the tool lies on the second."""
    corner = 5.15e-3
    block = from_vertices([[-0.1, -0.1], [corner, -0.1], [corner, 0.0], [-0.1, 0.0]])
    struck = collision(ticks=4)
    over = struck.ihip.copy()
    over[52:54] = [corner, -1e-4]
    finding = found("impulsive-collision", changed(struck, ihip=over), Scene(model=block))
    assert (finding.outcome, "another part of the surface" in finding.message) == (NO, True)
    assert outcome("impulsive-collision", struck, Scene(model=block)) is PASS


@given(ticks=st.integers(5, 60))
@settings(max_examples=20)
def test_the_missing_share_of_a_slow_collision_is_measured(ticks):
    finding = found("impulsive-collision", collision(ticks=ticks), PLANE)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(1.0 - 4.0 / ticks)
    assert finding.evidence["stopped_after_ms"] == pytest.approx(ticks, abs=1e-6)


def test_the_wrong_restitution_fails_and_a_tool_that_never_flies_is_not_asked():
    finding = found("impulsive-collision", collision(ticks=1, restitution=1.0), PLANE)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(1.0)
    assert outcome("impulsive-collision", pressed(), PLANE) is NO


@given(
    speed=st.floats(0.2, 0.9),
    height=st.floats(2e-3, 5e-3),
    push=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 1.0)),
    restitution=st.floats(0.0, 1.0),
)
@settings(max_examples=60)
@example(speed=0.25, height=1 / 256, push=(0.0, 1.0), restitution=0.0)
def test_a_rigid_collision_passes_whatever_the_operator_pushes_meanwhile(speed, height, push, restitution):
    """It meets the surface between two samples, slower or faster than it was at the first of them.

    A tool that the operator turns round before has no collision.
    """
    # v^2 - 2 a h, where it meets the surface; slower than 0.1 m/s a push within a tick may take most of it
    met_squared = speed**2 - 2.0 * push[1] / 0.1 * height
    assume(not 0.0 <= met_squared <= 0.1**2)
    scene = Scene(model=line(), mass=0.1, restitution=restitution)
    thrown = Experiment(0.1, [0.0, height], [0.1, -speed], [0.0], [push])
    recording = resolve("ideal")(scene).simulate(thrown, 1e-3)
    finding = found("impulsive-collision", recording, scene)
    if met_squared < 0.0:
        assert finding.outcome is NO
        assert "the tool does not fly freely into the surface" in finding.message
        return
    assert finding.outcome is PASS
    assert type(finding.metric.value) is type(finding.bound) is float


@given(
    stiffness=st.floats(0.0, 100.0),
    damping=st.floats(0.0, 5.0),
    speed=st.floats(0.2, 0.8),
    height=st.floats(2e-3, 5e-3),
    restitution=st.floats(0.0, 1.0),
)
@settings(max_examples=60)
def test_a_rigid_collision_passes_whatever_the_hand_that_draws_it(stiffness, damping, speed, height, restitution):
    """The hand's damper pushes otherwise as soon as the tool has lost its speed."""
    scene = Scene(model=line(), mass=0.1, restitution=restitution)
    drawn = Hand(
        path=Path([0.0, 0.1], [[0.0, height], [0.01, height - 0.1 * speed]]), stiffness=stiffness + 1.0, damping=damping
    )
    thrown = Experiment(0.1, [0.0, height], [0.1, -speed], [0.0], [[0.0, 0.0]], hand=drawn)
    recording = resolve("ideal")(scene).simulate(thrown, 1e-3)
    assert outcome("impulsive-collision", recording, scene) is PASS


@pytest.mark.parametrize("away", [0.2e-3, 0.6e-3, 3e-3])
def test_a_collision_just_before_a_notch_is_one_only_where_its_end_is_not_reached(away):
    """At the end of a notch the nearest point has the normal of one face, and the tool may rest on both."""
    notch = [[-0.1, 0.0], [-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [0.0, 0.1], [0.0, 0.0]]
    scene = Scene(model=from_vertices(notch), mass=0.3)
    thrown = Experiment(0.1, [-away - 4e-3, 4e-3], [0.3, -0.3], [0.0], [[1.0, -1.0]])
    found_ = outcome("impulsive-collision", resolve("ideal")(scene).simulate(thrown, 1e-3), scene)
    assert found_ is (PASS if away > 1e-3 else NO)


@pytest.mark.parametrize("push", [2.0, 2.4, 2.6])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_push_outwards_excuses_no_spring(push, restitution):
    scene = Scene(model=line(), stiffness=1000.0, mass=0.1, restitution=restitution)
    thrown = Experiment(0.2, [0.0, 5e-4], [0.0, -0.2], [0.0], [[0.0, push]])
    recording = simulate_closed_loop(resolve("minimum-distance")(scene), thrown, scene, 1e-3)
    assert outcome("impulsive-collision", recording, scene) is FAIL


@pytest.mark.parametrize("factor", [1.0, 1e3])
def test_a_velocity_in_another_unit_excuses_no_direction(factor):
    hip = 0.1 * np.column_stack([np.cos(angles := np.linspace(0.0, 1.0, 500)), np.sin(angles)])
    along = np.column_stack([-hip[:, 1], hip[:, 0]])
    scene = Scene(model=circle(), mass=0.1)
    recording = recorded(hip, hip, 10.0 * along, meta=LOOP, velocity=factor * along / 0.5)
    finding = found("contact-normal-force", recording, scene)
    assert finding.outcome is FAIL
    assert finding.metric.value > 45.0


def test_one_row_is_not_at_rest():
    row = np.zeros((1, 2))
    recording = recorded(
        row, row, np.array([[0.0, 1.0]]), meta=LOOP, velocity=row, operator_force=np.array([[0.0, -5.0]])
    )
    assert "equal at rest" not in found("contact-normal-force", recording, PLANE).message


@given(
    turn=st.floats(0.02, 0.2),
    before=st.floats(0.003, 0.05),
    lean=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.2, 1.2)),
    depth=st.floats(0.05, 0.25),
)
@example(turn=0.1475, before=0.0374, lean=(0.24, 0.872), depth=0.1408)
@example(turn=0.0364, before=0.0426, lean=(0.541, 0.667), depth=0.1998)
def test_the_ideal_contact_is_normal_in_a_notch_that_it_slides_to_and_fro_in(turn, before, lean, depth):
    """In ever shorter passes up its faces: the mean force of a tick holds the pushes of both, wherever a sample is."""
    notch = [[-0.1, 0.0], [-0.1, -0.1], [0.1, -0.1], [0.1 * np.cos(turn), 0.1 * np.sin(turn)], [0.0, 0.0]]
    scene = Scene(model=from_vertices(notch), stiffness=1000.0)
    along = [0.5 * turn * (1.0 + each) - 0.5 * np.pi for each in lean]
    ends = [[depth * np.cos(angle), depth * np.sin(angle)] for angle in along]
    path = Path([0.0, 0.5, 0.6], [[-before, 0.02], *ends])
    assert outcome("contact-normal-force", resolve("ideal")(scene).simulate(path, 1e-3), scene) is PASS


ROUND = Scene(model=circle(), stiffness=50.0, mass=0.1, bilateral=True)


@pytest.mark.parametrize(("digits", "lean", "expected"), [(4, 0.0, PASS), (5, 0.0, PASS), (5, 0.1, FAIL)])
def test_a_log_of_few_digits_has_a_tool_in_a_notch_on_one_face_and_is_not_blamed_for_the_other_s_push(
    digits, lean, expected
):
    """Slid to a notch at 12.3456 mm, of which a log keeps 0.1 or 0.01 mm, and held there by both faces."""
    notch = 0.0123456
    notched = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
    scene = Scene(model=from_vertices(notch * np.array(notched)), stiffness=1000.0)
    slides = np.column_stack([np.linspace(1.8, 0.9, 600) * notch, np.full(600, 0.9 * notch)])
    rests = np.column_stack([np.full(200, 0.9 * notch), np.linspace(0.9, 0.4, 200) * notch])
    hip = np.concatenate([slides, rests])
    ihip = np.maximum(hip, notch)
    force = 1000.0 * (ihip - hip) @ np.array([[np.cos(lean), -np.sin(lean)], [np.sin(lean), np.cos(lean)]])
    log = recorded(np.round(hip, digits), np.round(ihip, digits), force)
    assert outcome("contact-normal-force", log, scene) is expected


def orbit(share, *, speed=0.5, noise=0.0, seed=0):
    """Round the circle with `share` of the centripetal force paid for by position error."""
    time = np.arange(2000) * 1e-3
    speeds = speed * (1.0 - 0.3 * time)
    error = share * 10.0 * speeds**2 * 0.1 / 50.0 + noise * np.random.default_rng(seed).standard_normal(time.size)
    error[0] = 0.0
    angle = np.cumsum(speeds) * 1e-3 / 0.1
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    force = -(0.1 * 10.0 * speeds**2)[:, None] * normal
    force[0] *= 1.0 - share
    velocity = speeds[:, None] * np.column_stack([-normal[:, 1], normal[:, 0]])
    return recorded((0.1 + error)[:, None] * normal, 0.1 * normal, force, meta=LOOP, velocity=velocity)


def orbits(share, **more):
    return Runs(orbit(share, **more), at_speed=lambda f: orbit(share, speed=0.5 * f, **more, seed=1))


@given(share=st.one_of(st.floats(0.02, 1.2), st.floats(-1.2, -0.02)))
@settings(max_examples=20)
def test_the_share_of_centripetal_force_that_is_missing_is_measured(share):
    finding = found("centripetal-force", orbits(share), ROUND)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(abs(share), rel=0.01)


def test_what_is_not_centripetal_is_not_called_so():
    assert outcome("centripetal-force", orbits(0.0), ROUND) is PASS
    assert outcome("centripetal-force", orbits(0.0, noise=0.05), ROUND) is UNDECIDED, "not of the speed"
    assert outcome("centripetal-force", collision(ticks=60), PLANE) is NO, "on a line"


def test_a_force_missing_at_zero_error_fails_even_where_the_error_stays_small():
    base = orbit(0.0)
    force = np.array(base.force)
    force[:4] = 0.0
    finding = found("centripetal-force", changed(base, force=force), ROUND)
    assert finding.outcome is FAIL
    assert finding.evidence["force_missing_at_zero_error"] == pytest.approx(1.0)


class Unilateral(Spring):
    """Claims to hold from both sides, and pushes outwards only."""

    supports = ("bilateral",)


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (Unilateral, UNDECIDED),
        (resolve("minimum-distance+pp"), FAIL),
        (resolve("minimum-distance+pp-pd"), FAIL),
        (resolve("set-stabilisation"), PASS),
    ],
)
def test_a_tool_that_flew_off_shows_nothing_of_what_a_bilateral_constraint_costs(make, expected):
    scene = Scene(model=circle(), stiffness=50.0, damping=4.47, mass=0.1, bilateral=True)
    start = Experiment(1.0, np.array([0.1, 0.0]), np.array([0.0, 0.5]), np.zeros(1), np.zeros((1, 2)))
    renderer = make(scene)
    base = simulate_closed_loop(renderer, start, scene, 1e-3)
    runs = Runs(base, at_speed=lambda f: simulate_closed_loop(renderer, start.at_speed(f), scene, 1e-3))
    finding = found("centripetal-force", runs, scene)
    assert finding.outcome is expected
    if make is Unilateral:
        assert "not held" in finding.message
        assert finding.evidence["tick"] == 1000


@pytest.mark.parametrize("check", ["impulsive-collision", "centripetal-force"])
def test_without_the_hands_answer_nothing_is_said_of_momentum(check):
    hip = np.column_stack([1e-4 * np.arange(200), np.full(200, -1e-3)])
    for source, words in (("replay", "does not answer"), ("file", "was not recorded")):
        slide = recorded(hip, hip * [1.0, 0.0], meta={"source": source}, velocity=0.0 * hip)
        finding = found(check, slide, PLANE)
        assert finding.outcome is UNDECIDED
        assert words in finding.message
    pushed = changed(slide, operator_force=-slide.force)
    assert "was not recorded" not in found(check, pushed, PLANE).message
    assert CHECKS[check].needs_loop, "and on a replay that stops no gate"


def slide(shift):
    x = np.linspace(0.0, 0.01, 1000)
    return recorded(np.column_stack([x, 0 * x - 1e-3]), np.column_stack([x + shift(x), 0 * x]))


@given(apart=st.floats(1e-4, 0.02))
@settings(max_examples=20)
def test_two_answers_to_one_hip_are_measured(apart):
    runs = Runs(slide(lambda x: 0 * x), reverse=lambda: slide(lambda x: apart * (x > 5e-3)))
    finding = found("memoryless", runs, PLANE)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(apart, abs=7e-5)  # six ticks of the other path
    assert finding.evidence["share_apart"] == pytest.approx(0.5, abs=0.05)


def test_one_answer_to_one_hip_passes_and_one_recording_alone_shows_no_memory():
    finding = found("memoryless", Runs(slide(np.sin), reverse=lambda: slide(np.sin)), PLANE)
    assert (finding.outcome, finding.metric.value) == (PASS, 0.0)
    assert outcome("memoryless", slide(np.sin), PLANE) is UNDECIDED
