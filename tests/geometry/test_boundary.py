"""What every boundary answers: the laws of the protocol, normal cones, and a kind that the package does not know."""

import numpy as np
import pytest
from honest import Spring
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from hapticeval.errors import InputError
from hapticeval.geometry import catalogue
from hapticeval.geometry.boundary import Boundary, ClosestPoint, SurfaceInSpace
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipsoid, from_vertices, line, sphere, star
from hapticeval.geometry.catalogue import torus as torus_model
from hapticeval.geometry.kernels import PIECE
from hapticeval.geometry.model import Model
from hapticeval.geometry.validate import checked_size, not_finite_error, points_for_kernels
from hapticeval.records import as_record
from hapticeval.renderer import Response
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite

CASSINIAN, STAR = cassinian().curve, star().curve
WAVY = cassinian(lobes=7, a_n=1.1, size=0.05).curve
DUMBBELLS = {neck: dumbbell(neck=neck).curve for neck in (0.1, 0.3, 0.5)}
BODIES = {"sphere": sphere().surface, "ellipsoid": ellipsoid().surface, "torus": torus_model().surface}
turns = st.tuples(*[st.floats(-1.0, 1.0)] * 6)


class Cube(SurfaceInSpace):
    """A cube by its faces: `name`, `bounds` and `closest_point`, and cones for its edges and corners."""

    def __init__(self, half):
        self.name, self.half = "cube", half

    @property
    def bounds(self):
        return (*[-self.half] * 3, *[self.half] * 3)

    def closest_point(self, points):
        array = points_for_kernels(points, 3)
        if not np.isfinite(array).all():
            raise not_finite_error(array)
        face = np.argmax(np.abs(array), axis=1)
        rows = np.arange(len(array))
        normal = np.zeros_like(array)
        normal[rows, face] = np.where(array[rows, face] < 0.0, -1.0, 1.0)
        foot = np.clip(array, -self.half, self.half)
        foot[rows, face] = self.half * normal[rows, face]
        away = array - foot
        distance = np.where((np.abs(array) < self.half).all(axis=1), -1.0, 1.0) * np.linalg.norm(away, axis=1)
        outside = (distance > 0.0) & (np.count_nonzero(away, axis=1) > 1)
        normal[outside] = away[outside] / distance[outside, None]
        return ClosestPoint(foot, normal, distance, np.zeros((len(array), 3, 3)))

    def normal_cone(self, points, reach):
        foot = self.closest_point(points).foot
        active = self.half - np.abs(foot) <= np.maximum(reach, 1e-12)[:, None]

        def beyond(directions):
            along = np.where(active, np.sign(foot) * directions, 0.0).clip(min=0.0)
            inside = np.linalg.norm(along, axis=1)
            return np.arctan2(np.linalg.norm(np.sign(foot) * directions - along, axis=1), inside)

        return beyond


def cube(size=0.1):
    """What a maker of the catalogue is."""
    return Model("cube", {"size": size}, Cube(checked_size(size) / 2.0))


MADE = {kind: make for kind, make in catalogue.MODELS.items() if kind not in catalogue.KINDS_FROM_USER}
BOUNDARIES: dict[str, Boundary] = {
    **{kind: catalogue.make_model(kind).boundary for kind in catalogue.MODELS if kind not in catalogue.KINDS_FROM_USER},
    "polygon": from_vertices([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.05, 0.02], [0.0, 0.1]]).boundary,
    "40-gon": cassinian().polygon(40),
    "a cube by its faces": Cube(0.05),
}
each = pytest.mark.parametrize("boundary", BOUNDARIES.values(), ids=BOUNDARIES)


def scattered(boundary, count=400):
    low, high = np.reshape(boundary.bounds, (2, boundary.dimension))
    return np.random.default_rng(3).uniform(low - 0.3 * (high - low), high + 0.3 * (high - low), (count, low.size))


@each
def test_every_kind_keeps_the_protocol(boundary):
    assert isinstance(boundary, Boundary)
    points = scattered(boundary)
    frame = boundary.closest_point(points)
    np.testing.assert_array_equal(boundary.signed_distance(points), frame.distance)
    np.testing.assert_allclose(np.abs(frame.distance), np.linalg.norm(points - frame.foot, axis=1), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(frame.normal, axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", frame.shape, frame.normal), 0.0, atol=1e-9)
    alone = [boundary.closest_point(point[np.newaxis]) for point in points[:20]]
    for k, part in enumerate(frame):
        np.testing.assert_array_equal(part[:20], np.concatenate([one[k] for one in alone]))
    np.testing.assert_allclose(boundary.signed_distance(boundary.points(300)), 0.0, atol=1e-15)


@each
def test_segments_first_go_inside_where_the_surface_is(boundary):
    points = scattered(boundary, 60)
    for start, end in zip(points[::2], points[1::2], strict=True):
        if boundary.signed_distance(start[np.newaxis])[0] <= 0.0:
            continue
        crossing = boundary.first_crossing(start, end, grain=1e-5)
        shares = np.linspace(0.0, 1.0, 4001)[:, np.newaxis]
        depths = boundary.signed_distance(start + shares * (end - start))
        inside = np.flatnonzero(depths < -1e-5)
        if crossing is None:
            assert not inside.size
            continue
        assert abs(boundary.signed_distance(crossing[np.newaxis])[0]) < 1e-15
        before = start + np.linspace(0.0, 1.0, 50)[:-1, np.newaxis] * (crossing - start)
        assert boundary.signed_distance(before).min() > -3e-5


@each
def test_walks_slides_and_neighbours_stay_on_it(boundary):
    start, goal = scattered(boundary, 2)
    way = boundary.walk(start, np.linspace(-0.02, 0.02, 9))
    np.testing.assert_allclose(boundary.signed_distance(way.foot), 0.0, atol=1e-15)
    np.testing.assert_allclose(way.foot[4], boundary.closest_point(start[np.newaxis]).foot[0], atol=1e-14)
    around = boundary.around(way.foot[4], 1e-3)
    np.testing.assert_allclose(boundary.signed_distance(around), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(around - way.foot[4], axis=1), 1e-3, rtol=0.3)
    rest = boundary.descend(start, goal, step=1e-5)
    assert abs(boundary.signed_distance(rest[np.newaxis])[0]) < 1e-15
    assert np.linalg.norm(rest - goal) <= np.linalg.norm(way.foot[4] - goal) + 1e-12


@each
def test_its_own_normal_is_in_the_cone_and_the_opposite_one_is_not(boundary):
    frame = boundary.closest_point(boundary.points(40)[1:-1])
    off = boundary.normal_cone(frame.foot, np.full(38, 1e-9))
    np.testing.assert_allclose(off(3.0 * frame.normal), 0.0, atol=1e-6)
    assert np.all(off(-frame.normal) > 0.5)


@each
@pytest.mark.parametrize("ask", ["closest_point", "signed_distance"])
def test_bad_points_are_refused_by_row(refused, boundary, ask):
    points = np.zeros((2, boundary.dimension))
    points[1, 0] = np.nan
    with refused(InputError):
        getattr(boundary, ask)(points)
    with refused(InputError):
        getattr(boundary, ask)(points[0])
    with refused(InputError):
        getattr(boundary, ask)([["a"] * boundary.dimension])


class TestConesOfCurves:
    @given(u=st.floats(0.0, 6.283), reach=st.sampled_from([1e-5, 1e-3, 1e-2]), tilt=st.floats(-1.5, 1.5))
    @settings(max_examples=200)
    def test_a_direction_is_outside_by_its_tilt_less_the_surface_s_own_turn(self, u, reach, tilt):
        cos, sin = np.cos(tilt), np.sin(tilt)
        turned = np.array([[cos, -sin], [sin, cos]]) @ CASSINIAN.normal(u)
        off = float(CASSINIAN.normal_cone(CASSINIAN.position([u]), np.array([reach]))(turned[None])[0])
        s = CASSINIAN.arc_length(u)
        around = CASSINIAN.normal(CASSINIAN.parameter(np.linspace(s - reach, s + reach, 401)))
        angles = np.arctan2(around @ [-turned[1], turned[0]], around @ turned)
        exact = 0.0 if angles.min() < 0.0 < angles.max() else np.abs(angles).min()
        # Between two of the 401 samples the surface turns by kappa ds at the most.
        assert off == pytest.approx(exact, abs=1e-5 + 38.3 * reach / 200)

    @given(lobe=st.integers(0, 6), side=st.sampled_from([-1, 1]), off=st.floats(-1e-4, 1e-4), reach=st.floats(0, 1e-3))
    def test_the_extreme_normal_of_an_inflection_is_allowed(self, lobe, side, off, reach):
        u = 2.0 * np.pi * lobe / 7 + side * brentq(WAVY.curvature, 0.01, np.pi / 7)
        s = WAVY.arc_length(u) + np.clip(off, -reach, reach)
        cone = WAVY.normal_cone(WAVY.position(WAVY.parameter([s])), np.array([reach + 1e-9]))
        assert cone(WAVY.normal([u]))[0] <= 1e-10

    @given(
        neck=st.sampled_from(sorted(DUMBBELLS)),
        k=st.integers(0, 7),
        off=st.floats(-1e-4, 1e-4),
        reach=st.floats(0, 1e-3),
    )
    def test_the_normal_of_the_point_itself_is_allowed_at_a_joint_of_arcs_too(self, neck, k, off, reach):
        """There the turning changes its sense, so that the normal has an extreme between any two samples."""
        curve = DUMBBELLS[neck]
        u = curve.parameter(curve.arc_length(as_record(curve.pieces, PIECE, k).u0) + off)
        assert curve.normal_cone(curve.position([u]), np.array([reach]))(curve.normal([u]))[0] <= 1e-9

    @given(k=st.integers(0, 9), share=st.floats(-0.5, 1.5), reach=st.sampled_from([0.0, 1e-5]))
    def test_at_a_corner_every_direction_between_the_faces_normals_is_allowed(self, k, share, reach):
        corner = STAR.corners[k]
        angle = np.arctan2(corner.normal_pre[1], corner.normal_pre[0]) + share * corner.turn
        direction = np.array([[np.cos(angle), np.sin(angle)]])
        off = STAR.normal_cone(corner.position[None], np.array([reach]))(direction)[0]
        assert off == pytest.approx(max(0.0, -share, share - 1.0) * abs(corner.turn), abs=1e-9)

    def test_away_from_a_corner_only_the_face_s_normal_is_allowed(self):
        corner = STAR.corners[0]
        point = corner.position - 0.01 * corner.tangent_pre
        off = STAR.normal_cone(point[None], np.array([1e-3]))(corner.normal_post[None])[0]
        assert off == pytest.approx(corner.turn)

    @pytest.mark.parametrize("count", [3, 6, 9, 12, 24])
    @pytest.mark.parametrize("radius", [0.07, 0.1, 1.0])
    def test_a_joint_may_lie_a_last_place_beside_a_sample(self, count, radius):
        angles = 2.0 * np.pi * np.arange(count) / count
        curve = from_vertices(radius * np.column_stack([np.cos(angles), np.sin(angles)])).curve
        point = curve.position([1e-3 * radius])
        assert curve.normal_cone(point, np.array([1e-6]))(curve.normal([1e-3 * radius]))[0] <= 1e-9

    def test_the_plane_has_one_normal(self):
        off = line().curve.normal_cone(np.array([[5.0, 0.0], [0.0, 0.0]]), np.full(2, 1e-3))
        np.testing.assert_allclose(off(np.array([[0.0, 2.0], [1.0, 1.0]])), [0.0, np.pi / 4])

    def test_the_seam_of_a_closed_curve_is_no_corner(self):
        points = circle().curve.position(np.array([0.0, 1e-9, 2 * np.pi - 1e-9]))
        np.testing.assert_allclose(circle().curve.normal_cone(points, np.full(3, 1e-4))(points), 0.0, atol=1e-12)


class TestConesInSpace:
    @given(angle=st.floats(0.0, 3.0), reach=st.floats(0.0, 0.05), drawn=turns)
    def test_on_a_sphere_the_cone_is_as_wide_as_the_arc(self, angle, reach, drawn):
        radial, along = np.linalg.qr(np.reshape(drawn, (3, 2)) + np.eye(3, 2))[0].T
        direction = np.cos(angle) * radial + np.sin(angle) * along
        off = BODIES["sphere"].normal_cone(0.1 * radial[None], np.array([reach]))(3.0 * direction[None])[0]
        assert off == pytest.approx(max(0.0, angle - reach / 0.1), abs=1e-9)

    @given(
        name=st.sampled_from(sorted(BODIES)),
        number=st.integers(0, 499),
        way=st.floats(0.0, 6.3),
        reach=st.floats(0.0, 2e-3),
    )
    @settings(max_examples=200)
    def test_it_holds_the_normals_in_reach_and_is_no_wider_than_the_surface_turns(self, name, number, way, reach):
        body = BODIES[name]
        frame = body.closest_point(body.points(500)[number : number + 1])
        one, other = np.linalg.svd(frame.normal)[2][1:]
        off = body.normal_cone(frame.foot, np.array([reach]))
        # Where the surface is concave, the foot lies a little farther along than the point on the tangent plane.
        there = body.closest_point(frame.foot + 0.9 * reach * (np.cos(way) * one + np.sin(way) * other))
        assert off(there.normal)[0] <= 1e-9
        steepest = {"sphere": 10.0, "ellipsoid": 0.1 / 0.05**2, "torus": 1.0 / 0.03}[name]
        assert off(one[None])[0] >= np.pi / 2 - reach * steepest - 1e-9


SUITE = """
title = "A cube"
[[case]]
name = "over-the-edge"
title = "Along a face, past an edge, and pushed in far from it"
model = { kind = "cube", size = 0.1 }
checks = ["continuous-contact", "contact-kept", "contact-normal-force", "broken-contact"]
[case.trajectory]
kind = "points"
points = [[-0.03, 0.01, 0.06], [-0.03, 0.01, 0.048], [0.06, 0.012, 0.048]]
duration = 1.0
"""


class Tilted(Spring):
    """A spring whose force is tilted."""

    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force + 0.5 * np.linalg.norm(force) * np.array([0.0, 1.0, 0.0]))


@pytest.mark.parametrize(
    ("renderer", "expected"),
    [
        (Spring, {"continuous-contact": "fail", "contact-kept": "pass", "contact-normal-force": "pass"}),
        (Tilted, {"contact-normal-force": "fail"}),
    ],
)
def test_a_kind_of_its_own_is_judged_through_the_whole_flow(renderer, expected, tmp_path, monkeypatch):
    """A class that keeps the protocol and a line in the catalogue are all that a further kind of boundary takes."""
    monkeypatch.setattr(catalogue, "MODELS", {**catalogue.MODELS, "cube": cube})
    (tmp_path / "cubes.toml").write_text(SUITE)
    suite = load_suite(str(tmp_path / "cubes.toml"))
    judged = judge(renderer, "mine", suite.name, suite.cases[0])
    assert judged.error is None
    outcomes = {verdict.check: str(verdict.outcome) for verdict in judged.verdicts}
    assert outcomes["broken-contact"] == "not-applicable"
    assert expected.items() <= outcomes.items(), [(v.check, v.message) for v in judged.verdicts]
