"""Digits that hold: hard places to lead the hand to, and feet of the nearest projection against 50 digits."""

from __future__ import annotations

from pathlib import Path

import mpmath
import numpy as np
import pytest
from asked import verdicts
from honest import Changed, Spring
from leading import led
from made import found, outcome, recorded
from outsiders import case

from hapticeval.discovery import resolve
from hapticeval.errors import DomainError, InputError
from hapticeval.geometry.catalogue import line, make_model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.decisions import FEWEST_DIGITS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.renderer import Response
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.stimulus.experiments import build_path
from hapticeval.stimulus.hard_places import PLACES_OF_KIND
from hapticeval.suite.reading import load_suite

CHECK = "numerical-stability"
SHAPES = ("star", "cassinian", "dumbbell", "ellipse", "sphere", "torus")


def digits_of(make, model, of=("surface", "medial"), **scene):
    verdict = verdicts(make, case("c", model, (CHECK,), scene=scene, trajectory=hard_places(*of)))[CHECK]
    return verdict.outcome, verdict.finding


def hard_places(*of):
    return {"kind": "hard-places", "of": of}


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("place", PLACES_OF_KIND)
def test_hard_places_are_met_as_they_are(kind, place):
    boundary = make_model(kind).boundary
    path = build_path({"kind": "hard-places", "of": [place]}, boundary, Path())
    hips = path.sampled(1e-3)[1]
    assert np.array_equal(hips, path.points)
    wanted = PLACES_OF_KIND[place](boundary)
    assert all(np.any(np.all(hips == each, axis=1)) for each in wanted)
    assert not boundary.signed_distance(hips[:1]) < 0.0


def test_places_are_where_they_are_said_to_be():
    star, circle = make_model("star").boundary, make_model("circle").boundary
    corners = np.array([corner.position for corner in star.corners])
    assert np.array_equal(PLACES_OF_KIND["vertices"](star)[: len(corners)], corners)
    np.testing.assert_allclose(PLACES_OF_KIND["focal"](circle), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(PLACES_OF_KIND["medial"](circle), axis=1), 0.0, atol=1e-6)
    assert np.abs(star.signed_distance(PLACES_OF_KIND["surface"](star))).max() < 1e-16


@pytest.mark.parametrize("kind", SHAPES)
def test_the_nearest_projection_keeps_its_digits(kind):
    result, finding = digits_of(resolve("minimum-distance"), {"kind": kind})
    assert result is Outcome.PASS
    assert finding.evidence["digits"] > 13.0


@pytest.mark.parametrize(("step", "digits"), [(1e-3, 1), (1e-6, 4)])
def test_what_is_lost_is_counted(step, digits):
    """A grid of so many metres on a model of 0.19 m, which is looked at a seventh as large too."""

    class Snapping(Spring):
        def step(self, hip, velocity, dt):
            ihip, _ = super().step(np.rint(hip / step) * step, velocity, dt)
            at_hand = np.array_equal(ihip, np.rint(hip / step) * step)
            ihip = hip if at_hand else ihip
            return Response(ihip, self.stiffness * (ihip - hip))

    result, finding = digits_of(Snapping, {"kind": "star"}, of=("teleports",))
    assert result is Outcome.FAIL
    assert f"{digits} digits are left" in finding.message
    assert finding.evidence["motion"] in ("turned and shifted", "seven times as large", "a seventh as large")


def test_a_tool_that_is_struck_behind_its_last_sample_lies_off_the_model_there():
    """The ideal contact flies at the last sample, and the force until the next holds the impact."""

    def judged(seconds):
        points = [[0.0, 0.01055], [0.0, 0.01055 - 0.1 * seconds]]
        path = {"kind": "points", "duration": seconds, "points": points}
        return judge(resolve("ideal"), "ideal", "s", case("c", {"kind": "line"}, (CHECK,), trajectory=path))

    hip = judged(0.2).recording.hip
    last = 1e-3 * float(np.argmin(hip[:, 1] > 0.0) - 1)
    ending = judged(last)
    assert ending.recording.hip[-1, 1] > 1e-5
    assert ending.recording.force[-1, 1] > 0.0
    assert ending.verdicts[0].outcome is Outcome.PASS


def test_a_hand_that_was_far_away_excuses_no_digit():
    """Centres of curvature of the Cassinian's inflections lie at 1e17 m, where a coordinate is known to 16 m."""
    result, finding = digits_of(resolve("minimum-distance"), {"kind": "cassinian"}, of=("focal", "medial"))
    assert result is Outcome.PASS
    assert finding.evidence["digits"] > 13.0
    assert finding.evidence["rounding_m"] < 1e-15


@pytest.mark.parametrize(
    ("renderer", "name", "why"),
    [
        ("minimum-distance@polygon", "neck-1e-6", "within the declared resolution and standoff of 15.1 mm"),
        ("constraint", "neck-1e-6", "within the declared resolution and standoff of 15.1 mm"),
        ("minimum-distance", "offset-1e9-m", "within the rounding of "),
    ],
)
def test_fewer_than_six_digits_are_no_pass_and_few_name_their_excuse(renderer, name, why):
    verdict = verdicts(resolve(renderer), f"hard-cases-places/{name}", CHECK)[CHECK]
    assert verdict.finding.evidence["digits"] < 9.0
    assert verdict.finding.metric.unit == "digits"
    if verdict.finding.evidence["digits"] < FEWEST_DIGITS:
        assert verdict.outcome is Outcome.INCONCLUSIVE
        assert verdict.finding.message.startswith("undecided, ")
    else:
        assert verdict.outcome is Outcome.PASS
    assert why in verdict.finding.message


def test_a_pass_that_keeps_its_digits_needs_no_excuse():
    _, finding = digits_of(resolve("minimum-distance"), {"kind": "star"})
    assert finding.message.endswith("when the scene is moved")


@pytest.mark.parametrize("kind", ["circle", "sphere"])
def test_of_a_run_that_ends_at_a_singular_place_the_digits_before_it_are_given(kind):
    places = hard_places("surface", "centre", "teleports")
    ends = case("c", {"kind": kind}, (CHECK, "reset-clears"), trajectory=places)
    judged = judge(resolve("set-stabilisation"), "r", "s", ends)
    assert judged.error is None
    assert "centre of curvature" in judged.ended["what"]
    assert 0 < len(judged.recording) == judged.ended["tick"]
    for verdict in judged.verdicts:
        assert verdict.outcome is Outcome.INCONCLUSIVE
        assert "centre of curvature" in verdict.finding.message
    evidence = judged.verdicts[0].finding.evidence
    assert (evidence["digits"] > 15.0, evidence["rows_in_contact"] > 20) == (True, True)


class Bounded(Changed):
    """The nearest point, defined for steps of a millisecond only, and not in a scene that has been moved."""

    def __init__(self, scene):
        super().__init__(scene, resolve("minimum-distance")(scene))
        self.moved = abs(scene.model.boundary.signed_distance(np.zeros((1, 2)))[0] + 0.1) > 1e-9

    def step(self, hip, velocity, dt):
        if dt < 1e-3 or self.moved:
            raise DomainError("off the map")
        return super().step(hip, velocity, dt)


@pytest.mark.parametrize("check", ["numerical-stability", "time-subdivision"])
def test_a_check_is_undecided_whose_other_run_leaves_the_domain(check):
    path = {"kind": "points", "duration": 0.1, "points": [[0.2, 0.0], [0.09, 0.01]]}
    judged = judge(Bounded, "r", "s", case("c", {"kind": "circle"}, (check, "contact-kept"), trajectory=path))
    first, second = judged.verdicts
    assert (first.outcome, "off the map" in first.finding.message) == (Outcome.INCONCLUSIVE, True)
    assert (second.outcome, judged.ended) == (Outcome.PASS, None)


def test_a_recording_is_not_asked():
    assert outcome(CHECK, recorded(np.full((3, 2), 0.01)), Scene(model=make_model("star"))) is Outcome.NOT_APPLICABLE


def exact_distance(vertices, point):
    """The distance of a point from a polygon, to 50 digits."""
    best = mpmath.inf
    corners = [mpmath.matrix([mpmath.mpf(x), mpmath.mpf(y)]) for x, y in vertices.tolist()]
    hand = mpmath.matrix([mpmath.mpf(x) for x in point.tolist()])
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        edge = b - a
        square = edge[0] ** 2 + edge[1] ** 2
        share = ((hand - a)[0] * edge[0] + (hand - a)[1] * edge[1]) / square
        off = hand - (a + min(max(share, mpmath.mpf(0)), mpmath.mpf(1)) * edge)
        best = min(best, mpmath.sqrt(off[0] ** 2 + off[1] ** 2))
    return best


POLYGONS = [
    case.name
    for case in load_suite("hard-cases-places").cases
    if case.model["kind"] in ("polygon", "star") and case.model.get("points", 5) == 5
]


@pytest.mark.parametrize("name", POLYGONS)
def test_no_foot_is_farther_than_the_nearest_by_more_than_rounding(name):
    """A foot is start + (u - u0) direction, with u counted round the outline, and roundings of 2^-53 in a coordinate.

    They are two of the outline's length P for u and u0, three of the edge's L for the direction and the product, and
    one of the largest coordinate M for the sum.
    """
    (case,) = (each for each in load_suite("hard-cases-places").cases if each.name == name)
    scene = case.build_scene()
    renderer = resolve("minimum-distance")(scene)
    hips = case.build_stimulus(scene, renderer).sampled(scene.sampling_time)[1]
    ihips, _ = led(renderer, hips, scene.sampling_time)
    pressed = np.flatnonzero(np.any(ihips != hips, axis=1))
    polygon = scene.model.polygon()
    vertices, longest = polygon.vertices, float(np.linalg.norm(polygon.edges, axis=1).max())
    largest = float(np.abs(vertices).max())
    rounding = np.sqrt(2.0) * 2.0**-53 * (2.0 * polygon.length + 3.0 * longest + largest)
    with mpmath.workdps(50):
        for row in pressed[:: max(1, pressed.size // 40)]:
            off = [mpmath.mpf(float(a)) - mpmath.mpf(float(b)) for a, b in zip(hips[row], ihips[row], strict=True)]
            more = mpmath.sqrt(off[0] ** 2 + off[1] ** 2) - exact_distance(vertices, hips[row])
            assert abs(more) <= rounding


@pytest.mark.parametrize(
    "vertices",
    [
        [[-0.1, -1e-15], [0.1, -1e-15], [0.1, 1e-15], [-0.1, 1e-15]],
        [[0.0, 0.0], [1e-320, 0.0], [0.0, 1e-320]],
        [[1e15, 0.0], [1e15 + 0.1, 0.0], [1e15, 0.1]],
    ],
    ids=["a sliver below rounding", "denormal", "an offset beyond the digits"],
)
def test_models_that_rounding_leaves_nothing_of_are_refused(vertices):
    with pytest.raises(InputError):
        make_model("polygon", vertices=vertices)


def test_of_two_motions_that_which_is_further_off_is_named_and_forces_are_none_under_a_scale():
    """The force is off by 5 N when turned (5 mm of the spring), and by 50 N on other scales; IHIPs there by 1 mm."""
    scene = Scene(model=line(), stiffness=1000.0)
    rest = np.zeros((20, 2))

    def run(ihip, force):
        return recorded(rest - [0.0, 2e-3], rest + np.array([ihip, 0.0]), np.tile([0.0, 2.0 + force], (20, 1)))

    def named(turned, scaled):
        def moved(motion, nudge):
            return run(*((0.0, 0.0) if any(nudge) else turned if motion.scale == 1.0 else scaled))

        runs = Runs(run(0.0, 0.0), moved=moved)
        finding = found(CHECK, runs, scene)
        return finding.evidence["motion"], finding.metric.value * scene.model.size

    assert named((0.0, 5.0), (1e-3, 50.0)) == ("turned and shifted", pytest.approx(5e-3))
    assert named((0.0, 0.5), (1e-3, 50.0)) == ("seven times as large", pytest.approx(1e-3))


class LateForce(Spring):
    """The force comes two ticks late, and the tool at once: right by what is granted to any renderer."""

    def reset(self, hip):
        self.forces = [np.zeros_like(hip)] * 2

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        self.forces = [*self.forces[-2:], force]
        return Response(ihip, self.forces[0])


@pytest.mark.parametrize("shape", ["star", "sphere"])
def test_a_force_that_comes_late_does_not_put_its_tool_off_the_surface(shape):
    """The hand leaps in and out within the two ticks, so that the force comes when it is outside again."""
    result, finding = digits_of(LateForce, {"kind": shape}, ("surface", "teleports"))
    assert result is Outcome.PASS, finding.message
