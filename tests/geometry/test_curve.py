"""The exact curves: golden numbers of the thesis's models, derivatives, arc length, nearest points, sides."""

import math

import mpmath as mp
import numpy as np
import pytest
import shapely
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.compiled import for_kernels
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import EXACT_MAKERS, cassinian, circle, dumbbell, ellipse, from_vertices, line, star
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import curvature_rate, evaluate_many, piece_index

R = 0.1
NOTCHED = [[0.0, 0.0], [0.04, 0.0], [0.04, 0.01], [0.01, 0.01], [0.01, 0.03], [0.04, 0.03], [0.04, 0.04], [0.0, 0.04]]
MAKERS = tuple(maker for maker in EXACT_MAKERS if maker().dimension == 2 and maker().boundary.closed)
CLOSED = {
    **{maker.__name__: maker().curve for maker in MAKERS},
    "hexagram": star(points=6).curve,
    "three lobes": cassinian(lobes=3, a_n=1.2).curve,
    "two lobes": cassinian(lobes=2, a_n=1.05).curve,
    "notched": from_vertices(NOTCHED).curve,
}
every = pytest.mark.parametrize("curve", CLOSED.values(), ids=CLOSED)
names = st.sampled_from(list(CLOSED))
coordinate = st.floats(-0.15, 0.15)
TIP, INFLECTION = 3.8284271247461901, 0.457988434424480233


def parameters(curve, count=400):
    """Parameters that avoid the joints."""
    start, end = curve.u_range
    us = np.linspace(start, end, count, endpoint=False) + (end - start) / (count * math.pi)
    joints = np.append(curve.pieces[:, 1], end)
    return us[np.min(np.abs(us[:, None] - joints), axis=1) > 1e-4]


class TestGoldenNumbers:
    def test_the_cassinian_against_40_digits(self):
        curve, valley = cassinian().curve, math.pi / 4
        assert np.hypot(*curve.position(0.0)) == pytest.approx(R, rel=1e-15)
        assert np.hypot(*curve.position(valley)) == pytest.approx(0.643594252905582625 * R, rel=1e-14)
        assert curve.length == pytest.approx(6.0201150050663570687 * R, rel=1e-14)
        x, y, dx, dy, _, _ = evaluate_many(for_kernels(curve.pieces), np.arange(256) * math.pi / 128).T
        assert math.pi * np.mean(x * dy - y * dx) == pytest.approx(2.1271373467660745 * R**2, rel=1e-14)
        bends = curve.curvature([0.0, valley, INFLECTION]) * R
        assert bends == pytest.approx([TIP, -2.840962479841203, 0.0], rel=1e-14, abs=1e-13)
        assert curve.position(INFLECTION) == pytest.approx([0.06750565816657814, 0.03327663854187934], rel=1e-14)
        lengths = np.array([0.4986951501273255, 0.7525143756332946]) * R
        assert curve.arc_length([INFLECTION, valley]) == pytest.approx(lengths, rel=1e-14)
        # the medial axis ends at a centre of curvature, and its disc lies inside
        assert curve.signed_distance([[0.07387961250362586, 0.0]]) == pytest.approx(-0.02612038749637414, rel=1e-14)

    @pytest.mark.parametrize(
        ("points", "ratio", "area"), [(5, 0.5473181392530234, 1.6085276528254), (6, 3.0**-0.5, 3.0**0.5)]
    )
    def test_stars(self, points, ratio, area):
        corners = star(points=points).curve.corners
        assert [corner.convex for corner in corners] == [True, False] * points
        assert [np.hypot(*corner.position) for corner in corners] == pytest.approx([R, ratio * R] * points, rel=1e-14)
        assert corners[0].turn == pytest.approx(math.radians(120.0), rel=1e-13)
        assert corners[1].turn == pytest.approx(-math.radians(120.0 - 360.0 / points), rel=1e-13)
        assert corners[0].position == pytest.approx([0.0, R], abs=1e-16)
        x, y = star(points=points).polygon().vertices.T
        assert 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) == pytest.approx(area * R**2, rel=1e-13)
        for corner in corners:
            cross = corner.tangent_pre[0] * corner.tangent_post[1] - corner.tangent_pre[1] * corner.tangent_post[0]
            assert math.asin(cross) == pytest.approx(math.asin(math.sin(corner.turn)), abs=1e-14)
            pairs = ((corner.tangent_pre, corner.normal_pre), (corner.tangent_post, corner.normal_post))
            for tangent, normal in pairs:
                assert (tangent @ normal, normal @ normal) == pytest.approx((0.0, 1.0), abs=1e-15)

    def test_the_star_of_five(self):
        corners = star().curve.corners
        assert corners[2].position == pytest.approx(np.array([-0.951056516295, 0.309016994375]) * R, rel=1e-11)
        assert corners[1].position == pytest.approx(np.array([-0.321705530565, 0.442789675985]) * R, rel=1e-11)
        assert star().curve.length == pytest.approx(10 * 0.6434110611301706 * R, rel=1e-14)

    @pytest.mark.parametrize("neck", [0.05, 0.5, 0.9])
    def test_dumbbells_are_smooth_and_as_long_and_thin_as_asked(self, neck):
        curve = dumbbell(neck=neck, size=0.3).curve
        assert curve.corners == ()
        assert curve.bounds[0::2] == pytest.approx((-0.15, 0.15), rel=1e-14)
        assert curve.signed_distance([[0.0, 0.0]]) == pytest.approx(-neck * 0.057)
        joints = np.append(curve.pieces[:, 1], curve.length)
        assert np.max(np.abs(curve.position(joints + 1e-12) - curve.position(joints - 1e-12))) < 1e-11

    def test_ellipses_against_the_elliptic_integral(self):
        for ratio in (1.5, 2.0, 50.0, 1000.0):
            exact = float(2 * R * 2 * sympy.elliptic_e(1 - sympy.Rational(str(ratio)) ** -2).evalf(20))
            assert ellipse(ratio=ratio).curve.length == pytest.approx(exact, rel=1e-14)

    def test_a_half_plane(self):
        curve = line().curve
        assert curve.signed_distance([[3.0, 0.2], [-1e9, -0.5]]) == pytest.approx([0.2, -0.5])
        assert curve.nearest([[3.0, 0.2]]) == pytest.approx([-3.0])
        assert curve.tangent(4.0) == pytest.approx([-1.0, 0.0])
        assert curve.normal(4.0) == pytest.approx([0.0, 1.0])
        assert (curve.u_range, curve.length) == ((-math.inf, math.inf), math.inf)
        assert curve.parameter(-7.0) == curve.arc_length(-7.0) == -7.0
        assert (curve.bounds, curve.corners) == ((-0.1, -0.1, 0.1, 0.1), ())
        assert curve.outline(3) == pytest.approx(np.array([[0.1, 0.0], [0.0, 0.0], [-0.1, 0.0]]))


def rates(curve, us):
    pieces = for_kernels(curve.pieces)
    return np.array([curvature_rate(pieces[piece_index(pieces, u)], u) for u in us])


def lobed(lobes, ratio, u):
    root = sympy.sqrt(ratio - sympy.sin(lobes * u) ** 2)
    radius = ((sympy.cos(lobes * u) + root) / (1 + sympy.sqrt(ratio))) ** sympy.Rational(1, lobes) / 10
    return radius * sympy.cos(u), radius * sympy.sin(u)


class TestDerivatives:
    @pytest.mark.parametrize(
        ("make", "symbolic"),
        [
            (cassinian(), lambda u: lobed(4, 2, u)),
            (cassinian(lobes=3, a_n=1.2), lambda u: lobed(3, sympy.Rational(6, 5), u)),
            (cassinian(lobes=5, a_n=40.0), lambda u: lobed(5, 40, u)),
            (ellipse(ratio=3.0), lambda u: (sympy.cos(u) / 10, sympy.sin(u) / 30)),
        ],
        ids=["cassinian", "three lobes", "flat", "ellipse"],
    )
    def test_curvature_and_its_rate_against_sympy(self, make, symbolic):
        u = sympy.Symbol("u")
        x, y = symbolic(u)
        dx, dy = sympy.diff(x, u), sympy.diff(y, u)
        speed = sympy.sqrt(dx**2 + dy**2)
        bend = (dx * sympy.diff(dy, u) - dy * sympy.diff(dx, u)) / speed**3
        us = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, 20)
        for found, formula in ((make.curve.curvature(us), bend), (rates(make.curve, us), sympy.diff(bend, u) / speed)):
            exact = sympy.lambdify(u, formula, modules="mpmath")
            expected = np.array([float(exact(each)) for each in us])
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())

    @every
    def test_all_of_them_against_differences(self, curve):
        s = curve.arc_length(parameters(curve))
        step = 1e-6
        u, ahead, behind = (curve.parameter(s + h) for h in (0.0, step, -step))
        across = (curve.position(ahead) - curve.position(behind)) / (2 * step)
        assert curve.tangent(u) == pytest.approx(across, abs=1e-8)
        turning = np.sum((curve.tangent(ahead) - curve.tangent(behind)) / (2 * step) * -curve.normal(u), axis=1)
        assert curve.curvature(u) == pytest.approx(turning, rel=1e-5, abs=1e-6)
        step = 1e-5 * curve.length
        ahead, behind = (curve.curvature(curve.parameter(s + h)) for h in (step, -step))
        smooth = np.abs(ahead - behind) < 0.01 * np.abs(curve.curvature(u)).max()  # no joint of arcs between
        found = rates(curve, u)
        bound = 2e-4 * np.abs(found).max() + 1e-6
        np.testing.assert_allclose(found[smooth], ((ahead - behind) / (2 * step))[smooth], atol=bound)

    def test_the_rate_is_symmetric_about_tips_and_valleys(self):
        curve, valley = cassinian(size=2.0).curve, np.pi / 4.0
        np.testing.assert_allclose(rates(curve, np.arange(8) * valley), 0.0, atol=1e-11)
        assert rates(curve, [1e-5])[0] / 1e-5 == pytest.approx(-42.4264068712, rel=1e-6)
        way = float(curve.arc_length(valley + 1e-5) - curve.arc_length(valley - 1e-5))
        assert np.diff(rates(curve, [valley - 1e-5, valley + 1e-5]))[0] / way == pytest.approx(159.14748525, rel=1e-6)
        assert rates(line().curve, [-3.0, 0.0, 2.0]).tolist() == [0.0, 0.0, 0.0]

    @every
    def test_normals_point_outwards_and_turn_once(self, curve):
        u = parameters(curve)
        for way, inside in ((1e-5, False), (-1e-5, True)):
            assert np.all(curve.contains(curve.position(u) + way * curve.normal(u)) == inside)
        s = (np.arange(40_000) + 0.5) / 40_000 * curve.length
        smooth = np.mean(curve.curvature(curve.parameter(s))) * curve.length
        assert smooth + sum(corner.turn for corner in curve.corners) == pytest.approx(2.0 * math.pi, abs=5e-3)

    @every
    def test_shapes_and_wrapping(self, curve):
        u = parameters(curve, 7)
        start, end = curve.u_range
        assert (curve.position(u[0]).shape, np.shape(curve.curvature(u[0]))) == ((2,), ())
        assert np.array_equal(curve.position(u.reshape(1, -1))[0], curve.position(u))
        assert curve.position(u + (end - start)) == pytest.approx(curve.position(u), abs=1e-14)
        assert np.array_equal(curve.position(end), curve.position(start))
        s = curve.arc_length(u)
        assert curve.arc_length(u + (end - start)) == pytest.approx(s + curve.length, rel=1e-13)
        assert curve.parameter(s - curve.length) == pytest.approx(curve.parameter(s), abs=1e-13)


@settings(max_examples=30)
@given(names, st.lists(st.floats(0.0, 1.0, exclude_max=True), min_size=1, max_size=20))
def test_parameter_is_the_inverse_of_arc_length(name, shares):
    curve = CLOSED[name]
    s = np.array(shares) * curve.length
    assert curve.arc_length(curve.parameter(s)) == pytest.approx(s, abs=1e-14 * curve.length)


@pytest.mark.parametrize("ratio", [1.000001, 1.01, 1e6])
def test_lengths_of_nearly_touching_and_nearly_round_cassinians(ratio):
    curve = cassinian(a_n=ratio).curve
    assert curve.arc_length([math.pi, 2.0 * math.pi]) == pytest.approx([curve.length / 2.0, curve.length], rel=1e-12)


class TestNearest:
    @settings(max_examples=40)
    @given(names, st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=8))
    def test_no_sample_is_nearer(self, name, points):
        curve = CLOSED[name]
        points = np.array(points)
        found = np.hypot(*(curve.position(curve.nearest(points)) - points).T)
        samples = curve.position(np.linspace(*curve.u_range, 3001))
        best = np.min(np.hypot(*(points[:, None] - samples).transpose(2, 0, 1)), axis=1)
        assert np.all(found <= best + 1e-15)
        assert np.abs(curve.signed_distance(points)) == pytest.approx(found, abs=1e-16)

    @every
    def test_it_is_a_foot_of_the_perpendicular_on_the_right_side(self, curve):
        points = np.random.default_rng(3).uniform(-0.15, 0.15, (2000, 2))
        u = curve.nearest(points)
        at_corner = np.isin(u, [corner.u for corner in curve.corners])
        along = np.abs(np.sum((points - curve.position(u)) * curve.tangent(u), axis=1))
        assert np.max(along[~at_corner]) < 1e-13
        us = np.unique(np.concatenate([np.linspace(*curve.u_range, 4000, endpoint=False), curve.pieces[:, 1]]))
        fine = shapely.Polygon(curve.position(us))
        clear = np.abs(curve.signed_distance(points)) > 1e-5
        assert np.array_equal(curve.contains(points)[clear], shapely.contains_xy(fine, points)[clear])
        assert np.max(np.abs(curve.signed_distance(curve.position(parameters(curve))))) < 1e-16

    @given(k=st.integers(0, 7), beyond=st.floats(-11.0, -5.0), way=st.sampled_from([-1, 1]), n=st.floats(-5e-3, 5e-3))
    def test_beside_a_smooth_joint_the_foot_keeps_its_digits(self, k, beyond, way, n):
        """The joint is farther than the foot by less than rounding, and is not taken for it."""
        curve = CLOSED["dumbbell"]
        u = curve.pieces[k, 1] + way * 10.0**beyond
        u += curve.length * (u < curve.pieces[0, 1])
        point = curve.position(u) + n * curve.normal(u)
        assert curve.position(curve.nearest([point])[0]) == pytest.approx(curve.position(u), abs=1e-15)

    @pytest.mark.parametrize("beside", [1e-13, -1e-13, 1.6e-11, -1.6e-11, 1e-10, -1e-10, 1e-9])
    def test_beside_a_row_of_the_table_the_foot_keeps_its_digits(self, beside):
        """The row is farther than the foot by less than rounding, and is not taken for it."""
        curve = cassinian(size=2.0).curve
        us = np.mod(curve.samples[:-1, 0] + beside, 2.0 * np.pi)
        points = curve.position(us) + np.array([[-0.02], [0.075]])[:, np.newaxis] * curve.normal(us)
        for each in points:
            np.testing.assert_allclose(curve.position(curve.nearest(each)), curve.position(us), rtol=0.0, atol=4e-15)

    def test_near_the_osculating_centre_where_minima_merge(self):
        """Around the end of the medial axis one minimum turns into two, closer together than any sampling."""
        curve = cassinian().curve
        x = 0.7387961250362586 * R - np.logspace(-14, -3, 10)
        points = np.column_stack([x, np.full_like(x, 1e-12)])
        samples = curve.position(np.linspace(-0.6, 0.6, 200_001))
        for point, far in zip(points, curve.signed_distance(points), strict=True):
            assert -far <= np.min(np.hypot(*(samples - point).T)) + 1e-16

    def test_the_evolute_of_the_ellipse_bounds_the_feet_of_its_vertex(self):
        curve, evolute = ellipse(ratio=2.0).curve, R - 0.05**2 / R
        inside, beyond = evolute + 1e-6, evolute - 1e-6
        assert curve.signed_distance([[inside, 0.0]]) == pytest.approx(-(R - inside), rel=1e-14)
        assert -curve.signed_distance([[beyond, 0.0]]) < R - beyond

    def test_beyond_a_corner(self):
        for corner in star().curve.corners:
            sign = 1.0 if corner.convex else -1.0
            bisector = corner.normal_pre + corner.normal_post
            point = corner.position + sign * 1e-3 * bisector / np.hypot(*bisector)
            assert star().curve.signed_distance([point]) == pytest.approx(sign * 1e-3, rel=1e-12)


NARROW = {(lobes, above): cassinian(lobes=lobes, a_n=1.0 + above).curve for lobes, above in ((4, 1e-9), (2, 1e-13))}
NARROW |= {(lobes, 1e-6): cassinian(lobes=lobes, a_n=1.0 + 1e-6).curve for lobes in (3, 9)}


@pytest.mark.parametrize(("lobes", "above"), NARROW)
class TestNarrowValleys:
    """Cassinians whose valleys are as narrow as the number format allows, against 40 digits."""

    def points(self, curve, count):
        """Half of them anywhere, half close to the middle, where all valleys meet."""
        rng = np.random.default_rng(4)
        reach = float(np.min(np.hypot(*curve.position(np.linspace(0.0, 2.0 * np.pi, 2001)).T)))
        return np.vstack([rng.uniform(-0.11, 0.11, (count, 2)), rng.uniform(-4.0, 4.0, (count, 2)) * reach])

    def test_nearest_points_are_right_to_rounding(self, lobes, above):
        """Every minimum of a fine sampling by arc length, refined in 40 digits by golden sections."""
        curve = NARROW[lobes, above]
        us = curve.parameter(np.linspace(0.0, curve.length, 20_001)[:-1])
        golden = (mp.sqrt(5) - 1) / 2
        points = self.points(curve, 8)
        for point, found in zip(points, np.abs(curve.signed_distance(points)), strict=True):
            squares = np.sum((curve.position(us) - point) ** 2, axis=1)
            low = np.flatnonzero((squares <= np.roll(squares, 1)) & (squares <= np.roll(squares, -1)))
            low = low[np.sqrt(squares[low]) <= np.sqrt(squares.min()) + curve.length / 20_000]
            with mp.workdps(40):
                ratio, best = 1 + (mp.mpf(1.0 + above) - 1), mp.inf

                def distance(u, point=point, ratio=ratio):
                    sin, cos = mp.sin(lobes * u), mp.cos(lobes * u)
                    r = ((cos + mp.sqrt(ratio - sin * sin)) / (1 + mp.sqrt(ratio))) ** (mp.mpf(1) / lobes)
                    z = mp.mpf(0.1) * r * mp.expjpi(u / mp.pi)
                    return abs(z - mp.mpc(*map(float, point)))

                for k in low:
                    a, b = mp.mpf(float(us[k - 1])), mp.mpf(float(us[(k + 1) % us.size]))
                    a, b = a - (2 * mp.pi if k == 0 else 0), b + (2 * mp.pi if k == us.size - 1 else 0)
                    for _ in range(110):
                        c, d = b - golden * (b - a), a + golden * (b - a)
                        a, b = (a, d) if distance(c) < distance(d) else (c, b)
                    best = min(best, distance((a + b) / 2))
            assert found == pytest.approx(float(best), abs=1e-16, rel=1e-15)

    def test_feet_lie_on_the_curve(self, lobes, above):
        """By the value and the gradient of |z^n - 1|^2 = a_n / a_d there."""
        curve = NARROW[lobes, above]
        for x, y in curve.position(curve.nearest(self.points(curve, 200))):
            with mp.workdps(40):
                b = mp.sqrt(1 + (mp.mpf(1.0 + above) - 1))
                scale = (1 + b) ** (mp.mpf(1) / lobes) / mp.mpf(0.1)
                z = mp.mpc(x, y) * scale
                off = abs(abs(z**lobes - 1) - b) / (lobes * abs(z) ** (lobes - 1) * scale)
            assert off < 1e-16


@pytest.mark.parametrize(("lobes", "above"), [(4, 1e-12), (4, 1e-10), (2, 5e-15), (1000, 1e-7)])
def test_valleys_too_narrow_for_the_parameter_are_refused(refused, lobes, above):
    with refused(InputError):
        cassinian(lobes=lobes, a_n=1.0 + above)


class TestLaws:
    @settings(max_examples=25)
    @given(st.floats(1e-3, 1e3), st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=5))
    def test_distance_scales_with_the_model(self, factor, points):
        points = np.array(points)
        for make in MAKERS:
            expected = make(size=0.2).curve.signed_distance(points) * factor
            found = make(size=0.2 * factor).curve.signed_distance(points * factor)
            assert found == pytest.approx(expected, rel=1e-11, abs=1e-13 * factor)

    @settings(max_examples=25)
    @given(st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=5))
    def test_symmetry(self, points):
        points = np.array(points)
        for name, folds in (("star", 5), ("cassinian", 4), ("ellipse", 2), ("dumbbell", 2), ("three lobes", 3)):
            cos, sin = math.cos(2 * math.pi / folds), math.sin(2 * math.pi / folds)
            turned = points @ np.array([[cos, sin], [-sin, cos]])
            expected = CLOSED[name].signed_distance(points)
            assert CLOSED[name].signed_distance(turned) == pytest.approx(expected, abs=1e-15)

    @pytest.mark.parametrize("size", [1e-99, 1e99])
    @pytest.mark.parametrize("make", MAKERS)
    def test_extreme_sizes_keep_their_digits(self, make, size):
        curve, usual = make(size=size).curve, make(size=1.0).curve
        assert curve.length / size == pytest.approx(usual.length, rel=1e-13)
        distance = curve.signed_distance([[0.9 * size, 0.1 * size]])
        assert distance / size == pytest.approx(usual.signed_distance([[0.9, 0.1]]), rel=1e-12)
        assert np.isfinite(curve.curvature(parameters(usual, 5))).all()


@every
def test_bounds_and_outlines(curve):
    points = curve.position(np.append(np.linspace(*curve.u_range, 20_001), curve.pieces[:, 1]))
    low, high = np.reshape(curve.bounds, (2, 2))
    assert np.concatenate([low, high]) == pytest.approx([*points.min(axis=0), *points.max(axis=0)], abs=1e-7)
    assert np.all((points >= low - 1e-16) & (points <= high + 1e-16))
    outline = curve.outline(200)
    assert outline.shape == (200, 2)
    assert np.array_equal(outline[0], outline[-1])
    assert np.max(np.abs(curve.signed_distance(outline))) < 1e-15
    for corner in curve.corners:
        assert np.min(np.hypot(*(outline - corner.position).T)) < 1e-15


def test_pieces_that_make_no_curve_are_refused_and_a_tiny_turn_is_no_corner(refused):
    with refused(InputError):
        Curve("odd", np.zeros((2, 3)), True)
    with refused(InputError):
        Curve("odd", circle().curve.pieces, False)
    nearly_straight = from_vertices([[0, 0], [0.5, -1e-11], [1, 0], [1, 1], [0, 1]]).curve
    assert len(nearly_straight.corners) == 4
