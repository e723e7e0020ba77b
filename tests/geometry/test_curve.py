"""The exact curves: golden numbers of the thesis's models, frames, arc length, nearest points, sides."""

import math

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.compiled import for_kernels
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipse, from_vertices, line, star
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import evaluate_many

R = 0.1
NOTCHED = [[0.0, 0.0], [0.04, 0.0], [0.04, 0.01], [0.01, 0.01], [0.01, 0.03], [0.04, 0.03], [0.04, 0.04], [0.0, 0.04]]
CLOSED = {
    "star": star(),
    "hexagram": star(points=6),
    "cassinian": cassinian(),
    "two lobes": cassinian(lobes=2, a_n=1.05),
    "circle": circle(),
    "ellipse": ellipse(),
    "dumbbell": dumbbell(),
    "notched": from_vertices(NOTCHED),
}
SMOOTH = [name for name in CLOSED if not CLOSED[name].curve.corners]
coordinate = st.floats(-0.15, 0.15)


@pytest.fixture(params=list(CLOSED))
def curve(request) -> Curve:
    return CLOSED[request.param].curve


def parameters(curve: Curve, count: int = 400) -> np.ndarray:
    """Parameters that avoid the joints."""
    start, end = curve.u_range
    us = np.linspace(start, end, count, endpoint=False) + (end - start) / (count * math.pi)
    joints = np.append(curve.pieces[:, 1], end)
    return us[np.min(np.abs(us[:, None] - joints), axis=1) > 1e-4]


class TestCassinian:
    """The four-lobed model of thesis (4.1), against 40-digit values."""

    curve = cassinian().curve

    def test_radii(self):
        assert np.hypot(*self.curve.position(0.0)) == pytest.approx(R, rel=1e-15)
        assert np.hypot(*self.curve.position(math.pi / 4)) == pytest.approx(0.643594252905582625 * R, rel=1e-14)

    def test_length(self):
        assert self.curve.length == pytest.approx(6.0201150050663570687 * R, rel=1e-14)

    def test_area(self):
        u = np.linspace(0.0, 2.0 * math.pi, 256, endpoint=False)
        x, y, dx, dy, _, _ = evaluate_many(for_kernels(self.curve.pieces), u).T
        assert math.pi * np.mean(x * dy - y * dx) == pytest.approx(2.1271373467660745 * R**2, rel=1e-14)

    def test_curvature_at_tip_valley_and_inflection(self):
        tip, valley, inflection = self.curve.curvature([0.0, math.pi / 4, 0.457988434424480233]) * R
        assert tip == pytest.approx(3.8284271247461901, rel=1e-14)
        assert valley == pytest.approx(-2.840962479841203, rel=1e-14)
        assert inflection == pytest.approx(0.0, abs=1e-13)

    def test_inflection(self):
        assert self.curve.position(0.457988434424480233) == pytest.approx(
            np.array([0.6750565816657814, 0.3327663854187934]) * R, rel=1e-14
        )

    def test_arc_lengths(self):
        assert self.curve.arc_length([0.457988434424480233, math.pi / 4]) == pytest.approx(
            np.array([0.4986951501273255, 0.7525143756332946]) * R, rel=1e-14
        )

    def test_medial_axis_end_is_the_centre_of_curvature_and_its_disc_lies_inside(self):
        end = np.array([[0.7387961250362586 * R, 0.0]])
        assert self.curve.signed_distance(end) == pytest.approx(-0.2612038749637414 * R, rel=1e-14)

    def test_curvature_against_sympy(self):
        s = sympy.symbols("s")
        radius = ((sympy.cos(4 * s) + sympy.sqrt(2 - sympy.sin(4 * s) ** 2)) / (1 + sympy.sqrt(2))) ** sympy.Rational(
            1, 4
        )
        x, y = radius * sympy.cos(s), radius * sympy.sin(s)
        dx, dy = x.diff(s), y.diff(s)
        curvature = sympy.lambdify(s, (dx * dy.diff(s) - dy * dx.diff(s)) / (dx**2 + dy**2) ** sympy.Rational(3, 2))
        u = np.linspace(0.1, 6.1, 50)
        assert self.curve.curvature(u) * R == pytest.approx(curvature(u), rel=1e-11, abs=1e-12)


class TestStar:
    @pytest.mark.parametrize(("points", "ratio"), [(5, 0.5473181392530234), (6, 1.0 / math.sqrt(3.0))])
    def test_tips_and_notches(self, points, ratio):
        corners = star(points=points).curve.corners
        assert [corner.convex for corner in corners] == [True, False] * points
        assert [np.hypot(*corner.position) for corner in corners] == pytest.approx([R, ratio * R] * points, rel=1e-14)
        tip, notch = corners[:2]
        assert tip.turn == pytest.approx(math.radians(120.0), rel=1e-13)
        assert notch.turn == pytest.approx(-math.radians(120.0 - 360.0 / points), rel=1e-13)
        assert tip.position == pytest.approx([0.0, R], abs=1e-16)

    def test_five_points(self):
        corners = star().curve.corners
        assert corners[2].position == pytest.approx(np.array([-0.951056516295, 0.309016994375]) * R, rel=1e-11)
        assert corners[1].position == pytest.approx(np.array([-0.321705530565, 0.442789675985]) * R, rel=1e-11)
        assert star().curve.length == pytest.approx(10 * 0.6434110611301706 * R, rel=1e-14)

    def test_areas(self):
        for points, area in ((5, 1.6085276528254), (6, math.sqrt(3.0))):
            x, y = star(points=points).polygon().vertices.T
            shoelace = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
            assert shoelace == pytest.approx(area * R**2, rel=1e-13)

    def test_frames_at_a_corner(self):
        for corner in star().curve.corners:
            cross = corner.tangent_pre[0] * corner.tangent_post[1] - corner.tangent_pre[1] * corner.tangent_post[0]
            assert math.asin(cross) == pytest.approx(math.asin(math.sin(corner.turn)), abs=1e-14)
            for tangent, normal in (
                (corner.tangent_pre, corner.normal_pre),
                (corner.tangent_post, corner.normal_post),
            ):
                assert tangent @ normal == pytest.approx(0.0, abs=1e-16)
                assert normal @ normal == pytest.approx(1.0)


class TestDumbbell:
    def test_is_smooth_and_as_long_as_asked(self):
        for neck in (0.05, 0.5, 0.9):
            curve = dumbbell(neck=neck, size=0.3).curve
            assert curve.corners == ()
            assert curve.bounds[0::2] == pytest.approx((-0.15, 0.15), rel=1e-14)
            joints = np.append(curve.pieces[:, 1], curve.length)
            before, after = curve.position(joints - 1e-12), curve.position(joints + 1e-12)
            assert np.max(np.abs(after - before)) < 1e-11

    def test_neck(self):
        curve = dumbbell(neck=0.25).curve
        assert curve.signed_distance([[0.0, 0.0]]) == pytest.approx(-0.25 * 0.038)


class TestFrame:
    @pytest.mark.parametrize("name", list(CLOSED))
    def test_tangent_and_curvature_against_differences(self, name):
        curve = CLOSED[name].curve
        s = curve.arc_length(parameters(curve))
        step = 1e-6
        ahead, here, behind = (curve.position(curve.parameter(s + h)) for h in (step, 0.0, -step))
        u = curve.parameter(s)
        assert curve.tangent(u) == pytest.approx((ahead - behind) / (2 * step), abs=1e-8)
        turning = (curve.tangent(curve.parameter(s + step)) - curve.tangent(curve.parameter(s - step))) / (2 * step)
        assert curve.curvature(u) == pytest.approx(np.sum(turning * -curve.normal(u), axis=1), rel=1e-5, abs=1e-6)
        assert np.max(np.abs(here - curve.position(u))) == 0.0

    def test_normal_points_outwards(self, curve):
        u = parameters(curve)
        outside = curve.position(u) + 1e-5 * curve.normal(u)
        inside = curve.position(u) - 1e-5 * curve.normal(u)
        assert not curve.contains(outside).any()
        assert curve.contains(inside).all()

    def test_total_turn_is_one_revolution(self, curve):
        s = (np.arange(40_000) + 0.5) / 40_000 * curve.length
        smooth = np.mean(curve.curvature(curve.parameter(s))) * curve.length
        assert smooth + sum(corner.turn for corner in curve.corners) == pytest.approx(2.0 * math.pi, abs=5e-3)

    def test_scalars_and_arrays_agree(self, curve):
        u = parameters(curve, 6)
        assert curve.position(u[0]).shape == (2,)
        assert np.shape(curve.curvature(u[0])) == ()
        assert curve.position(u.reshape(1, -1)).shape == (1, u.size, 2)
        assert np.array_equal(curve.position(u)[0], curve.position(u[0]))

    def test_u_wraps(self, curve):
        start, end = curve.u_range
        u = parameters(curve, 7)
        assert curve.position(u + (end - start)) == pytest.approx(curve.position(u), abs=1e-14)
        assert np.array_equal(curve.position(end), curve.position(start))


class TestArcLength:
    @settings(max_examples=30)
    @given(st.sampled_from(list(CLOSED)), st.lists(st.floats(0.0, 1.0, exclude_max=True), min_size=1, max_size=20))
    def test_parameter_is_the_inverse(self, name, shares):
        curve = CLOSED[name].curve
        s = np.array(shares) * curve.length
        assert curve.arc_length(curve.parameter(s)) == pytest.approx(s, abs=1e-14 * curve.length)

    def test_wraps(self, curve):
        s = np.linspace(0.01, 0.9, 5) * curve.length
        assert curve.parameter(s - curve.length) == pytest.approx(curve.parameter(s), abs=1e-13)
        start, end = curve.u_range
        u = curve.parameter(s)
        assert curve.arc_length(u + (end - start)) == pytest.approx(s + curve.length, rel=1e-13)

    def test_ellipse_against_the_elliptic_integral(self):
        for ratio in (1.5, 2.0, 50.0, 1000.0):
            exact = float(2 * R * 2 * sympy.elliptic_e(1 - sympy.Rational(str(ratio)) ** -2).evalf(20))
            assert ellipse(ratio=ratio).curve.length == pytest.approx(exact, rel=1e-14)

    @pytest.mark.parametrize("ratio", [1.000001, 1.01, 1e6])
    def test_nearly_touching_and_nearly_round_cassinians(self, ratio):
        curve = cassinian(a_n=ratio).curve
        assert curve.arc_length(2.0 * math.pi) == pytest.approx(curve.length, rel=1e-14)
        assert curve.arc_length(math.pi) == pytest.approx(curve.length / 2.0, rel=1e-12)


class TestNearest:
    @settings(max_examples=40)
    @given(st.sampled_from(list(CLOSED)), st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=8))
    def test_no_sample_is_nearer(self, name, points):
        curve = CLOSED[name].curve
        points = np.array(points)
        found = np.hypot(*(curve.position(curve.nearest(points)) - points).T)
        samples = curve.position(np.linspace(*curve.u_range, 3001))
        best = np.min(np.hypot(*(points[:, None] - samples).transpose(2, 0, 1)), axis=1)
        assert np.all(found <= best + 1e-15)
        assert np.abs(curve.signed_distance(points)) == pytest.approx(found, abs=1e-16)

    def test_it_is_a_foot_of_the_perpendicular(self, curve):
        points = np.random.default_rng(3).uniform(-0.15, 0.15, (500, 2))
        u = curve.nearest(points)
        at_corner = np.isin(u, [corner.u for corner in curve.corners])
        offset = points - curve.position(u)
        along = np.abs(np.sum(offset * curve.tangent(u), axis=1))
        assert np.max(along[~at_corner]) < 1e-13

    def test_points_on_the_curve_are_their_own_nearest(self, curve):
        points = curve.position(parameters(curve))
        assert np.max(np.abs(curve.signed_distance(points))) < 1e-16

    def test_near_the_osculating_centre_where_minima_merge(self):
        """Around the end of the medial axis one minimum turns into two, closer together than any sampling."""
        curve = cassinian().curve
        x = 0.7387961250362586 * R - np.logspace(-14, -3, 200)
        points = np.column_stack([x, np.full_like(x, 1e-12)])
        u = curve.nearest(points)
        wide = np.linspace(-0.6, 0.6, 200_001)
        samples = curve.position(wide)
        for point, found in zip(points[::20], u[::20], strict=True):
            best = np.min(np.hypot(*(samples - point).T))
            assert np.hypot(*(curve.position(found) - point)) <= best + 1e-16

    def test_curvature_radius_of_the_ellipse_bounds_its_foot(self):
        curve = ellipse(ratio=2.0).curve
        half = 0.05
        evolute = R - half**2 / R
        inside, beyond = evolute + 1e-6, evolute - 1e-6
        assert curve.signed_distance([[inside, 0.0]]) == pytest.approx(-(R - inside), rel=1e-14)
        assert -curve.signed_distance([[beyond, 0.0]]) < R - beyond

    def test_refuses_points_that_are_not_finite(self, curve):
        with pytest.raises(InputError, match="row 1"):
            curve.nearest([[0.0, 0.0], [math.nan, 0.0]])
        with pytest.raises(InputError, match="shape"):
            curve.nearest([0.0, 0.0])


class TestSide:
    def test_agrees_with_shapely(self, curve):
        import shapely

        start, end = curve.u_range
        us = np.unique(np.concatenate([np.linspace(start, end, 4000, endpoint=False), curve.pieces[:, 1]]))
        fine = shapely.Polygon(curve.position(us))
        points = np.random.default_rng(5).uniform(-0.15, 0.15, (2000, 2))
        clear = np.abs(curve.signed_distance(points)) > 1e-5
        assert np.array_equal(curve.contains(points)[clear], shapely.contains_xy(fine, points)[clear])

    def test_beyond_a_corner(self):
        for corner in star().curve.corners:
            sign = 1.0 if corner.convex else -1.0
            bisector = corner.normal_pre + corner.normal_post
            point = corner.position + sign * 1e-3 * bisector / np.hypot(*bisector)
            assert star().curve.signed_distance([point]) == pytest.approx(sign * 1e-3, rel=1e-12)

    def test_half_plane(self):
        curve = line().curve
        assert curve.signed_distance([[3.0, 0.2], [-1e9, -0.5]]) == pytest.approx([0.2, -0.5])
        assert curve.nearest([[3.0, 0.2]]) == pytest.approx([-3.0])
        assert curve.tangent(4.0) == pytest.approx([-1.0, 0.0])
        assert curve.normal(4.0) == pytest.approx([0.0, 1.0])
        assert curve.u_range == (-math.inf, math.inf)
        assert curve.length == math.inf
        assert curve.parameter(-7.0) == curve.arc_length(-7.0) == -7.0
        assert curve.bounds == (-0.1, -0.1, 0.1, 0.1)
        assert curve.corners == ()


class TestLaws:
    @settings(max_examples=25)
    @given(st.floats(1e-3, 1e3), st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=5))
    def test_distance_scales_with_the_model(self, factor, points):
        points = np.array(points)
        for make in (star, cassinian, circle, ellipse, dumbbell):
            small, large = make(size=0.2).curve, make(size=0.2 * factor).curve
            expected = small.signed_distance(points) * factor
            assert large.signed_distance(points * factor) == pytest.approx(expected, rel=1e-11, abs=1e-13 * factor)

    @settings(max_examples=25)
    @given(st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=5))
    def test_symmetry(self, points):
        points = np.array(points)
        for model, folds in ((star(), 5), (cassinian(), 4), (ellipse(), 2), (dumbbell(), 2), (cassinian(lobes=3), 3)):
            cos, sin = math.cos(2 * math.pi / folds), math.sin(2 * math.pi / folds)
            turned = points @ np.array([[cos, sin], [-sin, cos]])
            expected = model.curve.signed_distance(points)
            assert model.curve.signed_distance(turned) == pytest.approx(expected, abs=1e-15)

    def test_extreme_sizes_keep_their_digits(self):
        for size in (1e-99, 1e99):
            for make in (star, cassinian, circle, ellipse, dumbbell):
                curve = make(size=size).curve
                assert curve.length / size == pytest.approx(make(size=1.0).curve.length, rel=1e-13)
                distance = curve.signed_distance([[0.9 * size, 0.1 * size]])
                assert distance / size == pytest.approx(make(size=1.0).curve.signed_distance([[0.9, 0.1]]), rel=1e-12)
                assert np.isfinite(curve.curvature(parameters(make(size=1.0).curve, 5))).all()


class TestBoundsAndOutline:
    def test_bounds_hold_the_curve_tightly(self, curve):
        points = curve.position(np.append(np.linspace(*curve.u_range, 20_001), curve.pieces[:, 1]))
        xmin, ymin, xmax, ymax = curve.bounds
        assert (xmin, ymin) == pytest.approx(points.min(axis=0), abs=1e-7)
        assert (xmax, ymax) == pytest.approx(points.max(axis=0), abs=1e-7)
        assert np.all(points >= np.array([xmin, ymin]) - 1e-16)
        assert np.all(points <= np.array([xmax, ymax]) + 1e-16)

    def test_outline_is_closed_on_the_curve_and_keeps_corners(self, curve):
        outline = curve.outline(200)
        assert outline.shape == (200, 2)
        assert np.array_equal(outline[0], outline[-1])
        assert np.max(np.abs(curve.signed_distance(outline))) < 1e-15
        for corner in curve.corners:
            assert np.min(np.hypot(*(outline - corner.position).T)) < 1e-15

    def test_outline_of_a_half_plane(self):
        assert line().curve.outline(3) == pytest.approx(np.array([[0.1, 0.0], [0.0, 0.0], [-0.1, 0.0]]))


def test_pieces_that_make_no_curve_are_refused():
    with pytest.raises(InputError, match="shape"):
        Curve("odd", np.zeros((2, 3)), True)
    with pytest.raises(InputError, match="open"):
        Curve("odd", circle().curve.pieces, False)


def test_a_tiny_turn_is_no_corner():
    nearly_straight = from_vertices([[0, 0], [0.5, -1e-11], [1, 0], [1, 1], [0, 1]]).curve
    assert len(nearly_straight.corners) == 4
