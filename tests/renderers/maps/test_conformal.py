"""The conformal map: against closed forms, its analytic properties, its convergence, and where it must give up."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ellipj, ellipk

from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipse, from_vertices, line, star
from hapticeval.renderers.maps import conformal
from hapticeval.renderers.maps.conformal import TABLE_STEPS, CrowdingError, conformal_map
from hapticeval.renderers.maps.conformal_kernels import double_layer_matrix, map_to_disk, parameters_at

SQUARE = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]])
SHAPES = {
    "cassinian": cassinian(),
    "star": star(),
    "star of 6": star(points=6),
    "dumbbell": dumbbell(neck=0.1),
    "ellipse 8:1": ellipse(ratio=8.0),
    "square": from_vertices(SQUARE),
    "L": from_vertices([[0.0, 0.0], [0.1, 0.0], [0.1, 0.02], [0.02, 0.02], [0.02, 0.1], [0.0, 0.1]]),
}


@cache
def mapped(name):
    return conformal_map(SHAPES[name].curve)


@pytest.fixture(params=SHAPES)
def made(request):
    """The map of each shape."""
    return mapped(request.param)


def inside(curve, count, *, depth=0.0):
    """Random points at least `depth` (m) inside."""
    xmin, ymin, xmax, ymax = curve.bounds
    points = np.random.default_rng(3).uniform((xmin, ymin), (xmax, ymax), (20 * count, 2))
    chosen = points[curve.signed_distance(points) < -depth][:count]
    assert len(chosen) == count
    return chosen


def to_disk(made, points):
    """The images f (n, 2) in the unit disk of points (n, 2), m, inside the curve."""
    return np.array([map_to_disk(made.tables, *point) for point in np.asarray(points, dtype=np.float64)])


def image(made, points):
    """f, complex."""
    images = to_disk(made, points)
    return images[:, 0] + 1j * images[:, 1]


def correspondence(made):
    """The curve's parameters u (n,) at the boundary nodes, and their angles (n,), rad, on the circle."""
    disk = made.tables
    places = np.arange(made.nodes, dtype=np.float64)
    return parameters_at(disk.pieces, made.nodes, disk.per_piece, places), disk.angles[:-1:TABLE_STEPS]


def cassinian_form(model, points):
    """f(z) = z (b / (b^2 - 1 + z^n))^(1/n), b^2 = a_n / a_d, on the Cassinian whose interior is |z^n - 1| < b."""
    lobes = int(model.parameters["lobes"])
    b = math.sqrt(model.parameters["a_n"] / model.parameters["a_d"])
    z = (points[:, 0] + 1j * points[:, 1]) * (1.0 + b) ** (1.0 / lobes) / (model.parameters["size"] / 2.0)
    return z * (b / (b * b - 1.0 + z**lobes)) ** (1.0 / lobes)


class TestClosedForms:
    @pytest.mark.parametrize(("nodes", "bound"), [(64, 2e-5), (128, 6e-9), (256, 2e-14), (512, 5e-14)])
    def test_the_cassinian(self, nodes, bound):
        model = cassinian()
        made = conformal_map(model.curve, nodes=nodes)
        points = inside(model.curve, 3000)
        assert np.max(np.abs(image(made, points) - cassinian_form(model, points))) < bound
        u, angles = correspondence(made)
        assert np.max(np.abs(np.exp(1j * angles) - cassinian_form(model, model.curve.position(u)))) < bound

    def test_the_cassinian_up_to_the_boundary_and_back(self):
        model, made = cassinian(), mapped("cassinian")
        assert (made.nodes, made.error < 1e-5) == (256, True)
        u = np.random.default_rng(5).uniform(0.0, 2.0 * math.pi, 500)
        for depth in (1e-3, 1e-6, 1e-9, 1e-12):
            points = model.curve.position(u) - depth * model.curve.normal(u)
            assert np.max(np.abs(image(made, points) - cassinian_form(model, points))) < 5e-14
        angles = np.angle(cassinian_form(model, model.curve.position(u)))
        for turns in (0.0, 6.0 * math.pi):
            assert np.max(np.abs(np.exp(1j * (made.surface(angles + turns) - u)) - 1.0)) < 1e-10

    @given(st.integers(2, 5), st.floats(1.5, 8.0))
    @settings(max_examples=10)
    def test_every_cassinian(self, lobes, ratio):
        model = cassinian(lobes=lobes, a_n=ratio)
        made = conformal_map(model.curve)
        points = inside(model.curve, 200)
        assert np.max(np.abs(image(made, points) - cassinian_form(model, points))) < max(1e-12, 0.2 * made.error**2)

    def test_a_circle_is_mapped_as_it_is(self):
        made = conformal_map(circle(size=0.2).curve)
        points = inside(made.curve, 500)
        np.testing.assert_allclose(to_disk(made, points), points / 0.1, atol=5e-15)
        assert made.crowding == pytest.approx(1.0, abs=1e-9)

    def test_an_ellipse_against_schwarz(self):
        """H. A. Schwarz: f(z) = sqrt(k) sn((2K/π) arcsin(z / c)), with the nome q = ((a - b) / (a + b))^2, foci at ±c.

        Along the long axis; sn's parameter m from the nome by the theta functions.
        """
        a, b = 0.1, 0.05
        q, j = ((a - b) / (a + b)) ** 2, np.arange(-12, 13)
        root = (np.sum(q ** ((j + 0.5) ** 2)) / np.sum(q ** (j.astype(float) ** 2))) ** 2
        share = np.linspace(0.0, 0.999, 50)
        expected = math.sqrt(root) * ellipj(2.0 * ellipk(root**2) / math.pi * np.arcsin(share), root**2)[0]
        x = share * math.sqrt(a * a - b * b)
        found = to_disk(conformal_map(ellipse(ratio=2.0, size=0.2).curve), np.column_stack([x, 0.0 * x]))
        np.testing.assert_allclose(found, np.column_stack([expected, 0.0 * x]), atol=1e-13)

    def test_a_square_against_schwarz_and_christoffel(self):
        """The inverse map is the integral of (1 + w^4)^(-1/2) where the corners lie at odd multiples of 45 degrees."""
        r = np.array([0.1, 0.5, 0.9, 0.99])
        nodes, weights = np.polynomial.legendre.leggauss(200)
        along = [0.5 * x * np.sum(weights / np.sqrt(1.0 + (0.5 * x * (nodes + 1.0)) ** 4)) for x in (*r, 1.0)]
        points = np.column_stack([0.05 + 0.05 * np.array(along[:-1]) / along[-1], np.full(4, 0.05)])
        np.testing.assert_allclose(to_disk(mapped("square"), points), np.column_stack([r, 0.0 * r]), atol=1e-7)


class TestLaws:
    def test_it_is_analytic(self, made):
        """The Cauchy-Riemann equations, by central differences."""
        points, step = inside(made.curve, 300, depth=5e-4), 1e-6
        along = [(image(made, points + step * d) - image(made, points - step * d)) / (2.0 * step) for d in np.eye(2)]
        np.testing.assert_allclose(along[1], 1j * along[0], atol=2e-6 * np.max(np.abs(along[0])))

    def test_the_centre_is_the_one_singular_point(self, made):
        assert np.hypot(*to_disk(made, [made.centre])[0]) < 1e-7
        beside = image(made, made.centre + np.array([[1e-6, 0.0], [0.0, 1e-6]]))
        np.testing.assert_allclose(np.angle(beside), [0.0, math.pi / 2.0], atol=1e-4)
        # the winding of f along a loop near the boundary counts its zeros
        deep = made.curve.position(np.linspace(*made.curve.u_range, 4001)[:-1])
        loop = made.centre + 0.98 * (deep - made.centre)
        if np.all(made.curve.contains(loop)):
            angles = np.unwrap(made.to_angle(loop))
            assert (angles[-1] - angles[0]) / (2.0 * math.pi) == pytest.approx(1.0, abs=0.01)

    def test_it_is_one_to_one_into_the_disk(self, made):
        """Koebe: at a distance d from the boundary (1 - |f|^2) / (4 d) <= |f'| <= (1 - |f|^2) / d."""
        points = inside(made.curve, 400, depth=1e-4)
        images, depth = image(made, points), -made.curve.signed_distance(points)
        assert np.all(np.abs(images) < 1.0)
        step = 1e-4 * depth[:, np.newaxis] * np.array([1.0, 0.0])
        slope = np.abs(image(made, points + step) - image(made, points - step)) / (2e-4 * depth)
        room = (1.0 - np.abs(images) ** 2) / depth
        noticeable = room * depth > 1e-10
        assert np.mean(noticeable) > 0.5
        assert np.all(slope[noticeable] >= 0.249 * room[noticeable])
        assert np.all(slope[noticeable] <= 1.001 * room[noticeable])
        assert np.min(np.abs(images[:, np.newaxis] - images) + np.eye(400)) > 0.0

    def test_the_boundary_angle_rises_once_around(self, made):
        u, angles = correspondence(made)
        assert np.all(np.diff(angles) >= 0.0)
        assert angles[-1] - angles[0] <= 2.0 * math.pi + 1e-12
        start, end = made.curve.u_range
        back = made.surface(np.linspace(-math.pi, math.pi, 20_001))
        assert np.all((back >= start) & (back < end))
        assert np.count_nonzero(np.diff(back) < 0.0) == 1  # where u starts again
        found = made.to_angle(made.curve.position(u))
        assert np.max(np.abs(np.exp(1j * (found - angles)) - 1.0)) < 1e-7

    @pytest.mark.parametrize("name", ["cassinian", "dumbbell", "ellipse 8:1"])
    def test_shallow_points_go_to_the_nearest_point_and_ever_straighter(self, name):
        """On a smooth boundary the angle between error vector and normal falls linearly with the depth."""
        made = mapped(name)
        u = np.random.default_rng(2).uniform(*made.curve.u_range, 300)
        foot, normal = made.curve.position(u), made.curve.normal(u)
        angles = []
        for depth in (4e-5, 2e-5, 1e-5):
            points = foot - depth * normal
            vectors = made.curve.position(made.surface(made.to_angle(points))) - points
            across = vectors[:, 0] * normal[:, 1] - vectors[:, 1] * normal[:, 0]
            angles.append(np.median(np.abs(np.arctan2(across, np.sum(vectors * normal, axis=1)))))
        assert angles[2] < 1e-2
        assert np.divide(angles[:2], angles[1:]) == pytest.approx(2.0, rel=0.05)

    @pytest.mark.parametrize(("name", "fold"), [("cassinian", 4), ("star", 5), ("star of 6", 6), ("dumbbell", 2)])
    def test_a_symmetric_shape_has_a_symmetric_map(self, name, fold):
        made, turn = mapped(name), 2.0 * math.pi / fold
        points, (c, s) = inside(made.curve, 300), (math.cos(turn), math.sin(turn))
        turned = image(made, points @ np.array([[c, s], [-s, c]]))
        np.testing.assert_allclose(turned, image(made, points) * np.exp(1j * turn), atol=1e-9)

    def test_the_centre_balances_the_arc_length_on_the_circle(self, made):
        """Seen from the centre the mean of f over the boundary's arc length is zero."""
        s = (np.arange(20_000) + 0.5) / 20_000 * made.curve.length
        assert abs(np.mean(image(made, made.curve.position(made.curve.parameter(s))))) < 2e-6

    def test_no_other_centre_has_less_entropy(self):
        """The mean of log(dΘ/ds) over the arc length is largest at the centre, and falls away from it."""
        system = conformal.factored_system(SHAPES["L"].curve, 768)

        def entropy(centre):
            found = conformal.solve_correspondence(system, centre)
            weights = np.abs(found.nodes.steps)
            return float(np.average(np.log(np.maximum(found.density, 1e-300) / weights), weights=weights))

        centre = mapped("L").centre
        for offset in 2e-3 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]):
            assert entropy(centre + offset) < entropy(centre) - 1e-4

    def test_size_and_place_do_not_matter(self):
        points = inside(SHAPES["square"].curve, 100)
        expected = to_disk(mapped("square"), points)
        for scale in (1e-60, 1e60):
            made = conformal_map(from_vertices(scale * SQUARE).curve)
            np.testing.assert_allclose(to_disk(made, scale * points), expected, atol=1e-9)
        shifted = conformal_map(from_vertices(SQUARE * [1.08, 1.0] - [0.008, 0.05]).curve)
        np.testing.assert_allclose(shifted.centre, [0.046, 0.0], atol=1e-15)

    def test_the_matrix_keeps_the_whole_charge(self):
        nodes = conformal.boundary_nodes(SHAPES["star"].curve, 160)
        np.testing.assert_allclose(
            double_layer_matrix(nodes.anchors, nodes.offsets, nodes.steps).sum(axis=0), 1.0, atol=1e-13
        )


@pytest.mark.parametrize("name", ["star", "square", "L"])
def test_polygons_converge_fast(name):
    """Twice the nodes are worth an order of five and more, down to rounding."""
    curve = SHAPES[name].curve
    points = inside(curve, 500)
    images = [to_disk(conformal_map(curve, nodes=n * len(curve.pieces)), points) for n in (32, 64, 96)]
    errors = [np.max(np.abs(each - images[-1])) for each in images[:-1]]
    assert math.log2(errors[0] / errors[1]) > 5.0
    assert errors[1] < (1e-4 if name == "L" else 1e-8)


def test_smooth_shapes_converge_like_powers_of_a_number():
    curve = SHAPES["ellipse 8:1"].curve
    points = inside(curve, 500)
    images = [to_disk(conformal_map(curve, nodes=n), points) for n in (128, 256, 512, 1024)]
    errors = [np.max(np.abs(each - images[-1])) for each in images[:-1]]
    assert errors[1] < 20.0 * errors[0] ** 2
    assert errors[2] < max(20.0 * errors[1] ** 2, 1e-12)


def test_crowding_of_ellipses_grows_like_a_power_of_e_squared():
    """The strip's estimate: between the ends of a body of ratio r the density falls like exp(-π r / 2) and squared."""
    crowding = [conformal_map(ellipse(ratio=r).curve).crowding for r in (2.0, 4.0, 6.0, 8.0)]
    assert crowding[1] == pytest.approx(980.0, rel=0.01)
    np.testing.assert_allclose(np.diff(np.log(crowding))[1:], math.pi * 2.0 * 0.75, rtol=0.03)
    assert mapped("ellipse 8:1").blur < 1e-8


@pytest.mark.parametrize("neck", [0.25, 0.1, 0.05])
def test_a_dumbbell_that_the_flow_splits_is_mapped(neck):
    curve = dumbbell(neck=neck).curve
    made = conformal_map(curve)
    np.testing.assert_allclose(made.centre, 0.0, atol=1e-15)
    points = inside(curve, 300, depth=1e-3)
    points = points[np.abs(points[:, 0]) > 0.05]
    ihips = curve.position(made.surface(made.to_angle(points)))
    assert np.all(np.sign(ihips[:, 0]) == np.sign(points[:, 0]))


@pytest.mark.parametrize("model", [dumbbell(neck=0.01), ellipse(ratio=20.0), star(tip_angle=10.0)])
def test_exhausted_precision_is_refused_with_number_and_place(model):
    with pytest.raises(CrowdingError) as caught:
        conformal_map(model.curve)
    assert caught.value.crowding > 1e10
    assert caught.value.blur > 0.002
    assert abs(model.curve.signed_distance([caught.value.place])[0]) < 1e-9


@pytest.mark.parametrize(
    ("model", "nodes", "error"),
    [
        (line(), None, RefusalError),
        (cassinian(), 4, InputError),
        (cassinian(), 100_000, InputError),
        (star(), 40, InputError),
        (from_vertices(cassinian().polygon(400).vertices), None, RefusalError),
        (cassinian(lobes=200, a_n=1.5), None, RefusalError),
        (from_vertices(cassinian().polygon(160).vertices), None, RefusalError),
        (from_vertices(star(80).polygon().vertices), None, RefusalError),
    ],
)
def test_what_cannot_be_mapped_is_refused(refused, model, nodes, error):
    with refused(error):
        conformal_map(model.curve, nodes=nodes)
