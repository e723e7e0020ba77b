"""Golden numbers of the ideal contact, each from a closed form or an independent integration (m = 0.1 kg)."""

import math

import numpy as np
import pytest

from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, from_vertices, line
from hapticeval.rigid_contact import ideal
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Experiment

VALLEY_FORCE = -np.array([1.0, 1.0]) / math.sqrt(2.0)


def run(model, position, velocity, force, *, duration, dt=1e-3, **scene):
    experiment = Experiment(duration, position, velocity, [0.0], [force])
    return ideal(Scene(model=model, mass=0.1, **scene)).simulate(experiment, dt)


def events(recording, *kinds):
    return [e for e in recording.meta["events"] if not kinds or e["kind"] in kinds]


def at(recording, time):
    return round(time / recording.dt)


def wedge(turn_degrees):
    """A flat face along -x that ends at the origin in a face turned down by so much: a convex corner."""
    turn = math.radians(turn_degrees)
    return from_vertices([[0, 0], [-0.1, 0], [-0.1, -0.3], [0.1 * math.cos(turn), -0.1 * math.sin(turn)]])


def notch(turn_degrees):
    """A flat face along -x that ends at the origin in a face turned up by so much: a concave corner."""
    turn = math.radians(turn_degrees)
    tip = [0.1 * math.cos(turn), 0.1 * math.sin(turn)]
    return from_vertices([[0, 0], [-0.1, 0], [-0.1, -0.1], [0.2, -0.1], tip])


def test_sliding_on_a_plane_follows_the_parabola():
    recording = run(line(), [0, 0], [0.2, 0], [0.3, -2], duration=1.0)
    for time, x in ((0.1, 0.035), (0.5, 0.475), (1.0, 1.7)):
        np.testing.assert_allclose(recording.hip[at(recording, time)], [x, 0.0], atol=1e-13)
    np.testing.assert_allclose(recording.force, np.tile([0.0, 2.0], (1001, 1)), atol=1e-13)
    assert events(recording) == []


@pytest.mark.parametrize(
    ("v0", "angle", "time", "speed"),
    [
        (0.05, 0.83995007676902, 0.352977960462437, 0.81700673191841),
        (0.5, 0.722734247813416, 0.116774258406095, 0.866025403784439),
    ],
)
def test_leaving_a_circle_where_the_normal_force_ends(v0, angle, time, speed):
    recording = run(circle(), [0, 0.1], [v0, 0], [0, -1], duration=time + 0.05)
    (leave,) = events(recording)
    assert leave["kind"] == "leave"
    assert leave["time"] == pytest.approx(time, abs=1e-12)
    np.testing.assert_allclose(leave["position"], [0.1 * math.sin(angle), 0.1 * math.cos(angle)], atol=1e-13)
    flown = recording.time[-1] - time
    from_leave = recording.velocity[-1] - np.array([0.0, -10.0]) * flown
    np.testing.assert_allclose(from_leave, [speed * math.cos(angle), -speed * math.sin(angle)], atol=1e-11)
    assert np.all(recording.force[at(recording, time) + 1 :] == 0.0)


def test_flight_after_the_circle_and_the_force_before():
    recording = run(circle(), [0, 0.1], [0.5, 0], [0, -1], duration=0.1668, dt=1e-4)
    (leave,) = events(recording)
    flight = leave["time"] + 0.05 - recording.time[-1]
    place = recording.hip[-1] + recording.velocity[-1] * flight + [0.0, -5.0 * flight**2]
    np.testing.assert_allclose(place, [0.0986197354185, 0.0338589019065], atol=1e-12)
    # The mean force of a sample belongs to its middle.
    angle = np.arctan2(recording.hip[:, 0], recording.hip[:, 1])
    middle = 0.5 * (angle[:-1] + angle[1:])
    size = np.hypot(*recording.force.T)[:-1]
    assert np.interp(0.3, middle[:1000], size[:1000]) == pytest.approx(0.616009467376818, abs=1e-6)


def test_a_circle_is_left_at_once_when_the_tool_is_fast_enough():
    recording = run(circle(), [0, 0.1], [1.0 + 1e-9, 0], [0, -1], duration=0.05)
    assert events(recording) == []
    assert np.all(recording.force == 0.0)


@pytest.mark.parametrize(
    ("force", "time", "place", "along", "s"),
    [
        ([0, -1], 0.023094010767585, [0.00461880215352, -0.00266666666667], 0.288675134594813, 0.134641016151378),
        ([0.2, -1], 0.0261087946968767, [0.0059034280999, -0.00340834580262], 0.348970813180647, 0.169282032302755),
    ],
)
def test_a_convex_corner_is_left_and_the_next_face_hit(force, time, place, along, s):
    model = from_vertices([[0, 0], [-0.5, 0], [-0.5, -1], [0.5 * math.cos(math.pi / 6), -0.25]])
    recording = run(model, [0, 0], [0.2, 0], force, duration=0.2)
    (impact,) = events(recording)
    tangent, normal = np.array([math.cos(math.pi / 6), -0.5]), np.array([0.5, math.cos(math.pi / 6)])
    assert impact["kind"] == "impact"
    assert impact["time"] == pytest.approx(time, abs=1e-11)
    np.testing.assert_allclose(impact["position"], place, atol=1e-12)
    np.testing.assert_allclose(impact["impulse"], 0.1 * 0.1 * normal, atol=1e-12)
    after = recording.velocity[at(recording, 0.2)] - (np.dot(force, tangent) / 0.1 * (0.2 - time)) * tangent
    np.testing.assert_allclose(after, along * tangent, atol=1e-10)
    np.testing.assert_allclose(recording.hip[-1], s * tangent, atol=1e-12)


def test_a_tool_that_slides_onto_the_corner_leaves_it():
    recording = run(wedge(30.0), [-0.01, 0], [0.2, 0], [0, -1], duration=0.1)
    leave, impact = events(recording)
    assert (leave["kind"], impact["kind"]) == ("leave", "impact")
    assert leave["time"] == pytest.approx(0.05, abs=1e-14)
    assert impact["time"] - leave["time"] == pytest.approx(0.023094010767585, abs=1e-11)


@pytest.mark.parametrize("speed", [0.0, 0.5])
@pytest.mark.parametrize("make", [circle, lambda: cassinian()])
def test_a_tool_on_the_joint_of_a_closed_curve_goes_either_way_alike(make, speed):
    there, back = (
        run(make(), [0.1, 0], [0, way * speed], [-10.0, way], duration=0.01, bilateral=True).hip for way in (1.0, -1.0)
    )
    assert abs(there[1, 1]) > 1e-6
    np.testing.assert_allclose(back * [1.0, -1.0], there, atol=1e-15)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("k", range(8))
def test_a_tool_that_lands_on_a_smooth_joint_slides_on(k, way):
    curve = dumbbell().curve
    u = curve.pieces[k, 1]
    at, along, normal = curve.position(u), curve.tangent(u), curve.normal(u)
    velocity, flown, push = 0.3 * way * along - 0.2 * normal, 2.5e-3, -5.0 * normal
    start = at - velocity * flown - 0.5 * push / 0.1 * flown**2
    recording = run(dumbbell(), start, velocity, push, duration=0.02)
    (impact,) = events(recording)
    assert impact["position"] == pytest.approx(at, abs=1e-15)
    steps = np.hypot(*np.diff(recording.hip[3:6], axis=0).T)
    assert np.all(steps > 2e-4)


def test_a_sixty_degree_tip_is_never_touched_again():
    recording = run(wedge(120.0), [0, 0], [0.2, 0], [0, -1], duration=0.5)
    assert events(recording) == []
    assert np.all(recording.force == 0.0)


@pytest.mark.parametrize(("turn", "rest"), [(48.0, 0.241684366594555), (60.0, 0.101478392929169)])
def test_an_inelastic_notch_ends_in_rest(turn, rest):
    recording = run(notch(turn), [0, 0], [0.2, 0], [0.2, -1], duration=0.3)
    slope = math.radians(turn)
    first, second = events(recording)[:2]
    assert np.hypot(*first["impulse"]) == pytest.approx(0.1 * 0.2 * math.sin(slope), abs=1e-15)
    stop = events(recording)[-1]
    assert stop["kind"] == "rest"
    assert stop["time"] == pytest.approx(rest, abs=1e-13)
    # Speeds at the passes, from the impulses, down to hops of 1 pm: the arriving speed times sin(turn).
    sizes = np.array([np.hypot(*e["impulse"]) for e in events(recording)[:-1]])
    assert sizes.size > 15
    np.testing.assert_allclose(sizes[1:] / sizes[:-1], math.cos(slope), rtol=1e-14)
    assert np.all(recording.velocity[at(recording, rest) + 1 :] == 0.0)
    np.testing.assert_allclose(recording.force[-1], [-0.2, 1.0], atol=1e-12)
    if turn == 48.0:
        assert np.hypot(*first["impulse"]) == pytest.approx(0.0148628965095479, abs=1e-15)
        assert second["time"] == pytest.approx(0.0439264773420152, abs=1e-12)
        np.testing.assert_allclose(
            np.diff(recording.velocity[1:20], axis=0) @ [math.cos(slope), math.sin(slope)] / 1e-3,
            -6.09318704205623,
            atol=1e-9,
        )
        highest = np.hypot(*recording.hip[:40].T).max()
        assert highest == pytest.approx(0.00146962752095356, abs=1e-6)


@pytest.mark.parametrize(
    ("restitution", "hits"),
    [
        (
            1.0,
            [
                (0.03635028443168, [0.000561415304, 0.000623514863]),
                (0.051462995904, [-0.00176591362365, 0.0]),
            ],
        ),
        (0.5, [(0.01817514221584, None), (0.02726271332376, None)]),
    ],
)
def test_an_elastic_notch_throws_the_tool_about(restitution, hits):
    recording = run(notch(48.0), [0, 0], [0.2, 0], [0.2, -1], duration=0.06, restitution=restitution)
    start, *impacts = events(recording, "impact")
    after = np.array([0.2, 0.0]) + np.array(start["impulse"]) / 0.1
    expected = {1.0: [-0.0209056926535, 0.198904379074], 0.5: [0.0343207305099, 0.149178284305]}
    np.testing.assert_allclose(after, expected[restitution], atol=1e-12)
    for event, (time, place) in zip(impacts, hits, strict=False):
        assert event["time"] == pytest.approx(time, abs=1e-11)
        if place is not None:
            np.testing.assert_allclose(event["position"], place, atol=1e-11)


@pytest.mark.parametrize("opening", [23.0, 5.0, 0.5])
def test_a_tool_thrown_into_a_sharp_notch_stays_at_its_end(opening):
    """Its speed falls by cos(opening) at each of the hits, which all come at once: the limit is rest."""
    far = [-0.2 * math.cos(math.radians(opening)), 0.2 * math.sin(math.radians(opening))]
    model = from_vertices([[0, 0], [-0.2, 0], [-0.2, -0.1], [0.1, -0.1], [0.1, 0.2], far])
    aside = math.radians(0.5 * opening)
    recording = run(model, [-0.1 * math.cos(aside), 0.1 * math.sin(aside)], [0.3, 0.0], [2.0, -1.0], duration=1.0)
    assert events(recording)[-1]["kind"] == "rest"
    assert len(events(recording)) < 100
    np.testing.assert_allclose(recording.hip[-1], [0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(recording.force[-1], [-2.0, 1.0], atol=1e-9)


def test_the_cassinian_flank_is_left_and_hit_again():
    recording = run(cassinian(), [0.1, 0], [0, 0.05], [-1, 0], duration=0.22, dt=1e-4)
    leave, impact = events(recording)[:2]
    curve = cassinian().curve
    where, again = curve.nearest([leave["position"], impact["position"]])
    assert where == pytest.approx(0.258138343581538, abs=1e-10)
    assert again == pytest.approx(0.612807962390282, abs=1e-10)
    assert leave["time"] == pytest.approx(0.15816769566817, abs=1e-11)
    assert impact["time"] == pytest.approx(0.208847987029115, abs=1e-11)
    # Back from the last sample in flight to the two events.
    k = at(recording, 0.2)
    gone, left = recording.time[k] - leave["time"], impact["time"] - recording.time[k]
    assert np.hypot(*(recording.velocity[k] + [10.0 * gone, 0.0])) == pytest.approx(0.49791674849454, abs=1e-10)
    hit = recording.velocity[k] - [10.0 * left, 0.0]
    assert hit @ curve.tangent(again) == pytest.approx(0.937752171891131, abs=1e-10)
    assert hit @ curve.normal(again) == pytest.approx(-0.155005953418834, abs=1e-10)
    assert np.hypot(*impact["impulse"]) == pytest.approx(0.0155005953418834, abs=1e-11)


def test_the_force_at_the_cassinian_tip():
    sizes = [
        np.hypot(*run(cassinian(), [0.1, 0], [0, 0.05], [-1, 0], duration=dt, dt=dt).force[0]) for dt in (2e-5, 1e-5)
    ]
    assert 2.0 * sizes[1] - sizes[0] == pytest.approx(0.990428932188135, abs=1e-8)


def test_the_oscillation_in_the_cassinian_valley():
    curve = cassinian().curve
    start = float(math.pi / 4.0 + 0.2)
    recording = run(cassinian(), curve.position(start), [0, 0], VALLEY_FORCE, duration=0.5, dt=1e-4)
    along = np.array([-1.0, 1.0]) / math.sqrt(2.0)
    x, v = recording.hip @ along, recording.velocity @ along
    # Cubic Hermite through the two samples about each pass of the bottom.
    passes = []
    for k in np.flatnonzero(x[:-1] * x[1:] < 0.0):
        h = recording.dt
        cubic = np.array([2 * (x[k] - x[k + 1]) + h * (v[k] + v[k + 1]), 0.0, h * v[k], x[k]])
        cubic[1] = x[k + 1] - cubic[0] - cubic[2] - cubic[3]
        roots = np.roots(cubic)
        s = float(next(r.real for r in roots if abs(r.imag) < 1e-12 and 0.0 <= r.real <= 1.0))
        passes.append((recording.time[k] + s * h, abs(v[k] + s * (v[k + 1] - v[k])), k))
    assert 2.0 * (passes[1][0] - passes[0][0]) == pytest.approx(0.400239140864, abs=1e-9)
    assert passes[0][1] == pytest.approx(0.222432153781413, abs=1e-7)
    assert np.hypot(*recording.force[passes[0][2]]) == pytest.approx(1.14055963873507, abs=1e-6)
    assert np.ptp([np.hypot(*v) for v in recording.velocity]) > 0.2
    assert events(recording) == []


def test_small_oscillations_in_the_valley_have_the_linear_period():
    curve = cassinian().curve
    bottom = curve.position(math.pi / 4.0)
    recording = run(cassinian(), curve.position(math.pi / 4.0 + 1e-4), [0, 0], VALLEY_FORCE, duration=0.3)
    along = np.array([-1.0, 1.0]) / math.sqrt(2.0)
    expected = (recording.hip[0] - bottom) @ along * np.cos(2.0 * math.pi / 0.372775292205273 * recording.time)
    np.testing.assert_allclose((recording.hip - bottom) @ along, expected, atol=1e-11)


@pytest.mark.parametrize("dt", [1e-3, 1e-4])
def test_a_held_tool_runs_round_the_circle(dt):
    recording = run(circle(size=2.0), [1, 0], [0, 5], [0, 0], duration=2.0, dt=dt, bilateral=True)
    angle = 5.0 * recording.time
    np.testing.assert_allclose(recording.hip, np.column_stack([np.cos(angle), np.sin(angle)]), atol=1e-12)
    middle = angle + 2.5 * dt
    inward = -2.5 * np.column_stack([np.cos(middle), np.sin(middle)])
    np.testing.assert_allclose(recording.force, inward * np.sinc(2.5 * dt / math.pi), atol=1e-9)
