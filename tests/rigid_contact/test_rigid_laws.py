"""Laws that hold whatever the model and the push: momentum, energy, no pulling, no entering, symmetry, order."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hapticeval.geometry.catalogue import cassinian, circle, cube, dumbbell, ellipse, from_vertices, line, sphere, star
from hapticeval.geometry.kernels import evaluate_many
from hapticeval.records import as_record, room_for
from hapticeval.rigid_contact import ideal
from hapticeval.rigid_contact.force import LOAD
from hapticeval.rigid_contact.plane_search import slide_for
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Experiment, Path

MODELS = [star(), star(6), cassinian(), circle(), ellipse(4.0), dumbbell(0.3), line()]
MASS_KG, DT = 0.1, 1e-3

numbers = st.floats(-1.0, 1.0)
pushes = st.lists(st.tuples(numbers, numbers), min_size=2, max_size=4)


def contact(model, **scene):
    return ideal(Scene(model=model, mass=MASS_KG, **scene))


def pushed(position, velocity, forces, duration=0.4):
    forces = np.array(forces)
    return Experiment(duration, position, velocity, np.linspace(0.0, duration, len(forces)), forces)


@st.composite
def experiments(draw, models=tuple(MODELS)):
    model = draw(st.sampled_from(models))
    if model.name == "line":
        position = [draw(numbers) * 0.1, draw(st.floats(0.0, 0.1))]
    else:
        angle, radius = draw(st.floats(0.0, 2.0 * math.pi)), draw(st.floats(0.101, 0.14))
        position = [radius * math.cos(angle), radius * math.sin(angle)]
    velocity = np.array([draw(numbers), draw(numbers)])
    # Towards the origin on the whole, so that the tool meets the model.
    lean = -3.0 * np.array(position) / max(np.hypot(*position), 1e-3)
    forces = [lean + 2.0 * np.array(push) for push in draw(pushes)]
    return model, pushed(position, velocity, forces)


def check_laws(model, recording, *, bilateral=False):
    momentum = MASS_KG * recording.velocity
    impulses = (recording.force + recording.channels["operator_force"]) * recording.dt
    np.testing.assert_allclose(np.diff(momentum, axis=0), impulses[:-1], atol=1e-13)
    distance = model.curve.signed_distance(recording.hip)
    if bilateral:
        assert np.abs(distance).max() < 1e-12
        return
    assert distance.min() > -1e-12
    # A unilateral contact pushes along an outward normal of the boundary near by.
    away = np.minimum(distance[:-1], distance[1:])
    travel = np.maximum(*np.hypot(*np.stack([recording.velocity[:-1], recording.velocity[1:]]).transpose(2, 0, 1)))
    reach = 2.0 * travel * recording.dt + 0.01 * recording.dt
    assert np.all(recording.force[:-1][away > reach] == 0.0)


TURNING_AWAY = pushed(
    [0.11462366463932318, 0.02632540234945606],
    [-0.31199659055659923, 0.0],
    [[-2.4551273834158795, -0.43324019176422957], [-2.4707523834158795, -0.45277144176422957]],
)
"""Hops that end where the boundary turns from concave to convex: the last rises, dips in by 8 nm, and rises again."""


@example((cassinian(), TURNING_AWAY), 0.3)
@settings(max_examples=50)
@given(experiments(), st.sampled_from([0.0, 0.3, 0.9]))
def test_momentum_balances_and_the_tool_stays_outside(drawn, restitution):
    model, experiment = drawn
    recording = contact(model, restitution=restitution).simulate(experiment, DT)
    check_laws(model, recording)
    middle = 0.5 * (recording.time + recording.time + DT)
    # The operator's mean force, where no knot of it lies within the sample, is its value in the middle.
    knots = np.isin(np.floor(recording.time / DT), np.floor(experiment.force_time / DT))
    expected = experiment.operator_force(middle)
    near = ~knots & ~np.roll(knots, -1) & ~np.roll(knots, 1)
    np.testing.assert_allclose(recording.channels["operator_force"][near], expected[near], atol=1e-7)


@settings(max_examples=60)
@given(experiments(), st.sampled_from([0.0, 0.5, 1.0]))
def test_energy_never_grows_beyond_the_work_of_a_constant_push(drawn, restitution):
    model, experiment = drawn
    force = experiment.force[0]
    experiment = pushed(experiment.position, experiment.velocity, [force, force])
    recording = contact(model, restitution=restitution).simulate(experiment, DT)
    energy = 0.5 * MASS_KG * (recording.velocity**2).sum(axis=1) - recording.hip @ force
    assert np.diff(energy).max() < 1e-11
    if restitution == 1.0:
        assert np.ptp(energy) < 1e-9
    # What is lost is lost at impacts: between them the energy stands still.
    hits = {math.floor(e["time"] / DT + 1e-9) for e in recording.meta["events"] if e["kind"] != "leave"}
    quiet = np.array([k not in hits for k in range(len(recording) - 1)])
    assert np.abs(np.diff(energy)[quiet]).max(initial=0.0) < 1e-9


@settings(max_examples=40)
@given(experiments(models=(cassinian(), circle(), ellipse(4.0), dumbbell(0.3))))
def test_a_unilateral_contact_never_pulls(drawn):
    model, experiment = drawn
    recording = contact(model).simulate(experiment, DT)
    normal = model.curve.normal(model.curve.nearest(recording.hip))
    steady = np.ones(len(recording), dtype=bool)
    for event in recording.meta["events"]:
        steady[math.floor(event["time"] / DT + 1e-9)] = False
    assert (recording.force * normal).sum(axis=1)[steady].min(initial=0.0) > -1e-12


@settings(max_examples=30)
@given(experiments(models=(cassinian(), circle(), star(), dumbbell(0.3))))
def test_a_held_tool_stays_on_the_boundary(drawn):
    model, experiment = drawn
    recording = contact(model, bilateral=True).simulate(experiment, DT)
    check_laws(model, recording, bilateral=True)
    assert all(e["kind"] in ("impact", "corner", "rest") for e in recording.meta["events"])


def turned(points, angle):
    cos, sin = math.cos(angle), math.sin(angle)
    return np.asarray(points) @ np.array([[cos, sin], [-sin, cos]])


def mirrored(points):
    return np.asarray(points) * [1.0, -1.0]


SYMMETRIES = [
    (star(), lambda points: turned(points, 2.0 * math.pi / 5.0)),
    (cassinian(), mirrored),
    (ellipse(2.0), mirrored),
    (ellipse(2.0), lambda points: turned(points, math.pi)),
]


def test_where_two_cells_meet_a_tool_is_on_the_one_that_it_comes_to():
    """Some pm beside the seam of a curve: mirrored, the parameter is at its other end."""
    for aside in (1e-12, 3e-11, 4e-10):
        for y in (aside, -aside):
            experiment = pushed([0.125, y], [-1.0, 0.0], [[-1.0, 0.0], [-1.0, 0.0]], duration=0.026)
            (impact,) = contact(cassinian()).simulate(experiment, DT).meta["events"]
            assert impact["position"][1] == pytest.approx(y, rel=1e-3)


@settings(max_examples=40)
@given(st.data(), st.sampled_from(SYMMETRIES), st.sampled_from([0.0, 0.6]))
def test_a_turned_or_mirrored_world_gives_the_turned_or_mirrored_motion(data, symmetry, restitution):
    _, moved = symmetry
    model, one = data.draw(experiments(models=symmetry[:1]))
    other = Experiment(one.duration, moved(one.position), moved(one.velocity), one.force_time, moved(one.force))
    a, b = (contact(model, restitution=restitution).simulate(each, DT) for each in (one, other))
    # Up to the first event that rounding may decide: a bounce amplifies it, so compare the first few.
    end = np.inf if len(a.meta["events"]) < 4 else a.meta["events"][3]["time"]
    same = a.time < end
    np.testing.assert_allclose(moved(a.hip)[same], b.hip[same], atol=1e-9)


@settings(max_examples=30)
@given(
    st.sampled_from([star(), cassinian(), dumbbell(0.3), circle()]),
    st.lists(st.tuples(numbers, numbers), min_size=2, max_size=5),
    st.floats(0.1, 2.0),
    st.sampled_from([0.0, 0.5]),
)
def test_playback_stays_physical_wherever_the_hand_goes(model, corners, duration, restitution):
    points = 0.13 * np.array(corners)
    path = Path(np.linspace(0.0, duration, len(points)), points)
    recording = contact(model, restitution=restitution).simulate(path, DT)
    check_laws(model, recording)


@pytest.mark.parametrize("spring", [0.0, 400.0])
def test_sliding_converges_with_order_six(spring):
    """The method's own order, on the curve with the strongest bends: errors fall by 2^6 when the step halves."""
    pieces = cassinian().curve.pieces
    load = as_record(np.zeros(room_for(LOAD)), LOAD)
    load.mass, load.spring, load.damper = MASS_KG, spring, 2.0 * math.sqrt(spring * MASS_KG)
    load.g0[:2] = -1.0, 0.5

    def end(steps):
        du, w, h = 0.0, 0.5, 0.04 / steps
        for k in range(steps):
            du, w, _, _ = slide_for(pieces[0], (0.3, du, w), k * h, h, load)
        return np.array([*evaluate_many(pieces, np.array([0.3 + du]))[0, :2], w])

    exact = end(4096)
    errors = [np.abs(end(steps) - exact).max() for steps in (8, 16, 32)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 5.5)
    assert np.all(orders < 7.5)


def test_a_refined_run_holds_the_coarse_one():
    curve = cassinian().curve
    path = Path(np.linspace(0.0, 2.0, 401), 0.8 * curve.position(np.linspace(0.0, 2.0 * math.pi, 401)))
    coarse, fine = (contact(cassinian()).simulate(path, dt) for dt in (1e-3, 1e-3 / 8))
    np.testing.assert_allclose(fine.hip[::8][: len(coarse)], coarse.hip, atol=1e-10)
    whole = len(fine) // 8
    means = fine.force[: whole * 8].reshape(-1, 8, 2).mean(axis=1)
    np.testing.assert_allclose(means, coarse.force[:whole], atol=1e-6)


@pytest.mark.parametrize("bounces", [0.0, 0.3, 0.5, 0.8, 0.9])
@pytest.mark.parametrize(
    ("model", "top"), [(line(), 0.0), (cube(), 0.05), (sphere(), 0.1)], ids=["line", "cube", "sphere"]
)
def test_a_dropped_tool_comes_to_rest_after_the_geometric_series(model, top, bounces):
    """From 20 mm it falls for sqrt(2 m h / F), and each hop is c_r as long and as hard as the one before."""
    up = np.eye(model.dimension)[-1]
    dropped = pushed((top + 0.02) * up, 0.0 * up, [-up, -up], 2.5)
    recording = contact(model, restitution=bounces).simulate(dropped, DT)
    fall = math.sqrt(2.0 * 0.02 / 10.0)
    end = fall * (1.0 + bounces) / (1.0 - bounces)
    events = recording.meta["events"]
    times = [event["time"] for event in events]
    assert times[0] == pytest.approx(fall, abs=1e-12)
    assert times[-1] == pytest.approx(end, abs=1e-5)
    after = recording.force[recording.time > end + DT]
    np.testing.assert_allclose(after, np.tile(up, (len(after), 1)), atol=1e-9)
    np.testing.assert_allclose(recording.hip[-1], top * up, atol=1e-12)
    blows = np.linalg.norm(
        [event["impulse"] for event in recording.meta["events"] if event["kind"] == "impact"], axis=1
    )
    np.testing.assert_allclose(blows[1:6], bounces * blows[:5][: len(blows) - 1], rtol=1e-9)


def test_a_thin_part_is_not_passed_through():
    blade = from_vertices([[-0.05, -1e-7], [0.05, -1e-7], [0.05, 1e-7], [-0.05, 1e-7]])
    for speed in (0.1, 1.0, 50.0):
        recording = contact(blade).simulate(pushed([0.001, 0.03], [0.0, -speed], [[0, -1], [0, -1]], 0.5), DT)
        assert recording.hip[:, 1].min() > 1e-7 - 1e-12
        assert recording.meta["events"][0]["kind"] == "impact"


@pytest.mark.parametrize("depth", [1e-4, 1e-7, 1e-10])
@pytest.mark.parametrize("angle", [0.0, 0.1, 1.0])
def test_a_graze_between_two_samples_is_a_collision(depth, angle):
    """A straight path cuts so deep through a circle: in and out within one sample, from any side."""
    hit, start = -math.sqrt(depth * (0.2 - depth)), -0.1023
    forward, outward = turned([1.0, 0.0], angle), turned([0.0, 1.0], angle)

    def shot(height):
        begin = start * forward + height * outward
        return contact(circle()).simulate(pushed(begin, 5.0 * forward, [[0, 0], [0, 0]], 0.03), DT).meta["events"]

    impact = shot(0.1 - depth)[0]
    assert impact["kind"] == "impact"
    assert impact["time"] == pytest.approx((hit - start) / 5.0, abs=1e-8)
    np.testing.assert_allclose(impact["position"], hit * forward + (0.1 - depth) * outward, atol=1e-8)
    assert shot(0.1 + depth) == []
