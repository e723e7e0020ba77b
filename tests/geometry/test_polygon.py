"""Polygons: the tree's answers against brute force and shapely, crossings, and how far they are from the curve."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hapticeval.compiled import for_kernels
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipse, line, star
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import PIECE
from hapticeval.geometry.polygon_kernels import first_entry_kernel
from hapticeval.geometry.representations import Polygon
from hapticeval.records import as_records

NOTCHED = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [4, 3], [4, 4], [0, 4]]
SLIVER = [[0.0, 0.0], [1.0, -1e-6], [2.0, 0.0], [1.0, 1e-6]]
POLYGONS = {
    "star": star().polygon(),
    "cassinian": cassinian().polygon(40),
    "cassinian, 1000": cassinian().polygon(1000),
    "dumbbell": dumbbell(neck=0.02).polygon(60),
    "triangle": Polygon([[0, 0], [1, 0], [0, 1]]),
    "notched": Polygon(NOTCHED),
    "sliver": Polygon(SLIVER),
    "far away": Polygon(np.array(NOTCHED) + 1e6),
}
share = st.floats(0.0, 1.0)


def test_a_point_that_slides_stops_at_a_minimum_however_near_the_next_edge_leads_downhill():
    """The foot on the edge is 1e-7 before the corner, behind which it leads down to where the goal is nearer."""
    bent = Polygon([[0.0, 0.0], [4.0, -0.2], [4.0, 1.0], [1.0, 1.2], [0.0, 1.0]])
    corner, edge = np.array([1.0, 1.2]), np.array([3.0, -0.2]) / math.hypot(3.0, 0.2)
    goal = corner + 1e-7 * edge - 0.9 * np.array([0.2, 3.0]) / math.hypot(3.0, 0.2)
    rest = bent.descend(np.array([3.0, 1.2 - 0.4 / 3.0]), goal, step=1e-3)
    np.testing.assert_allclose(rest, corner + 1e-7 * edge, atol=1e-12)


@given(
    start=st.floats(0.0, 1.0), goal=st.tuples(*[st.floats(-0.1, 0.1)] * 2), name=st.sampled_from(["star", "cassinian"])
)
@settings(max_examples=100)
def test_a_point_that_slides_from_edge_to_edge_rests_where_small_steps_lead_it(start, goal, name):
    polygon = POLYGONS[name]
    begin = polygon.position([start * polygon.length])[0]
    rest = polygon.descend(begin, np.array(goal), step=1e-6)
    stepped = Curve.descend(polygon, begin, np.array(goal), step=1e-6)
    distances = [float(np.linalg.norm(point - goal)) for point in (rest, stepped)]
    # Steps may miss a minimum that is shallower than they are, and then lead to one that is nearer.
    assert distances[0] == pytest.approx(distances[1], abs=2e-6) or distances[1] < distances[0]
    assert polygon.signed_distance(rest[np.newaxis])[0] == pytest.approx(0.0, abs=1e-15)


def brute(polygon, points):
    """Distances to every edge, the smallest of each row."""
    a, d = polygon.vertices, polygon.edges
    r = points[:, None] - a
    t = np.clip(np.sum(r * d, axis=2) / np.sum(d * d, axis=1), 0.0, 1.0)
    return np.min(np.hypot(*(r - t[..., None] * d).transpose(2, 0, 1)), axis=1)


def around(polygon, shares):
    """Shares of 0 to 1 spread over the polygon's box and a third of it all around."""
    low, high = polygon.vertices.min(axis=0), polygon.vertices.max(axis=0)
    return low + (np.asarray(shares) * 5.0 / 3.0 - 1.0 / 3.0) * (high - low)


every = pytest.mark.parametrize("polygon", POLYGONS.values(), ids=POLYGONS)


def scattered(polygon):
    """Points all around, every vertex, and points on the edges."""
    rng = np.random.default_rng(11)
    edge = rng.integers(len(polygon.vertices), size=300)
    on = polygon.vertices[edge] + rng.random((300, 1)) * polygon.edges[edge]
    return np.vstack([around(polygon, rng.random((1500, 2))), polygon.vertices, on])


@every
def test_distances_and_sides_equal_brute_force_and_shapely(polygon):
    points, size = scattered(polygon), np.max(np.abs(polygon.vertices))
    distance = np.abs(polygon.signed_distance(points))
    assert distance == pytest.approx(brute(polygon, points), rel=1e-12, abs=1e-15 * size)
    filled = shapely.Polygon(polygon.vertices)
    assert distance == pytest.approx(
        shapely.distance(filled.exterior, shapely.points(points)), rel=1e-12, abs=1e-15 * size
    )
    clear = distance > 1e-12 * size
    assert np.array_equal(polygon.contains(points)[clear], shapely.contains_xy(filled, points)[clear])
    far = polygon.vertices[0] + np.array([[1e9, 3e8], [-1e9, 0.0]])
    assert np.abs(polygon.signed_distance(far)) == pytest.approx(brute(polygon, far), rel=1e-14)
    assert np.array_equal(polygon.nearest(polygon.vertices), as_records(polygon.pieces, PIECE).u0)


@every
def test_no_run_of_edges_leaves_its_capsule(polygon):
    tree, vertices = polygon.tree, polygon.vertices
    n, leaves = len(vertices), len(tree) // 2
    for row in range(1, 2 * leaves):
        level = 2 ** int(math.log2(row))
        j = row - level
        run = np.arange(j * n // level, (j + 1) * n // level + 1) % n
        start, chord, inverse, radius = tree[row, 0:2], tree[row, 2:4], tree[row, 4], tree[row, 5]
        assert np.array_equal(start, vertices[run[0]])
        offset = vertices[run] - start
        t = np.clip(offset @ chord * inverse, 0.0, 1.0)
        assert np.max(np.hypot(*(offset - t[:, None] * chord).T)) <= radius


def test_the_work_grows_no_faster_than_log_n():
    """Ten times the edges cost the same number of further runs each time, counted by the rule of the query."""
    points = np.random.default_rng(2).uniform(-0.12, 0.12, (60, 2))
    counts = []
    for n in (600, 6_000, 60_000):
        polygon = cassinian().polygon(n)
        best = np.abs(polygon.signed_distance(points))
        tree = polygon.tree[1:]
        offset = points[:, None] - tree[:, 0:2]
        t = np.clip(np.sum(offset * tree[:, 2:4], axis=2) * tree[:, 4], 0.0, 1.0)
        chord = np.hypot(*(offset - t[..., None] * tree[:, 2:4]).transpose(2, 0, 1))
        counts.append(np.mean(np.sum(chord <= best[:, None] + tree[:, 5], axis=1)))
    first, second = np.diff(counts)
    assert second <= 1.5 * first
    assert counts[-1] < 40


def test_points_on_the_outline_are_not_inside_and_straight_vertices_decide_nothing():
    square = Polygon([[0, 0], [0.5, 0], [1, 0], [1, 1], [0, 1]])
    assert not square.contains([[0.25, 0.0], [1.0, 0.25], [0.0, 0.0], [1.0, 1.0]]).any()
    assert square.signed_distance([[0.5, 0.1], [0.5, -0.1]]) == pytest.approx([-0.1, 0.1])


L_SHAPE = np.array([[-0.1, -0.05], [0.1, -0.05], [0.1, 0.0], [0.0, 0.0], [0.0, 0.05], [-0.1, 0.05]])


@settings(max_examples=60)
@given(
    st.lists(st.tuples(st.integers(0, 5), share, st.integers(1, 3)), min_size=1, max_size=4, unique_by=lambda e: e[0]),
    st.sampled_from([1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 1e-16]),
    st.floats(0.0, 6.3),
    st.sampled_from([0.0, 1.0, 1e3]),
)
@example([(4, 0.5, 1)], 1e-3, 0.7, 0.2)
def test_vertices_on_an_edge_decide_no_side(clusters, gap, turn, shift):
    """One or some near each other: they turn by rounding alone, and points off them are as near to either edge."""
    turned = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    vertices, places = [], []
    for k, corner in enumerate(L_SHAPE):
        vertices.append(corner)
        edge = L_SHAPE[(k + 1) % 6] - corner
        way = edge / np.hypot(*edge)
        for _, at, count in [each for each in clusters if each[0] == k]:
            on = [corner + (0.3 + 0.4 * at) * edge + gap * j * way for j in range(count)]
            vertices += on
            places += [(place, np.array([way[1], -way[0]])) for place in on]
    moved = np.array(vertices) @ turned + shift
    polygon = Polygon(moved[np.any(moved != np.roll(moved, 1, axis=0), axis=1)])
    for place, out in places:
        for depth in (1e-6, 1e-3, 0.01):
            above, below = polygon.signed_distance(
                np.array([place + depth * out, place - depth * out]) @ turned + shift
            )
            assert below < 0.0 < above


def first_crossing(polygon, start, end):
    """Where the segment first goes inside: (edge, t along the edge, fraction of the segment), or None."""
    (x0, y0), (x1, y1) = np.array([start, end], dtype=np.float64)
    edge, along, fraction = first_entry_kernel(for_kernels(polygon.vertices), polygon.tree, x0, y0, x1, y1)
    return (edge, along, fraction) if edge >= 0 else None


def deep_from(polygon, start, part, rounding):
    """How far from `start` a part of a segment is deeper than rounding: it may run along an edge before that."""
    ends = shapely.get_coordinates(part)
    near, far = sorted(np.hypot(*(ends - start).T))
    places = np.linspace(near, far, 401)
    way = (ends - start)[np.argmax(np.hypot(*(ends - start).T))] / far
    k = int(np.argmax(polygon.signed_distance(start + places[:, None] * way) < -rounding))
    low, high = places[max(k - 1, 0)], places[k]
    for _ in range(60):
        middle = 0.5 * (low + high)
        deep = polygon.signed_distance([start + middle * way])[0] < -rounding
        low, high = (low, middle) if deep else (middle, high)
    return float(high)


def check_crossing(polygon, start, end):
    """A segment's first crossing is on the edge it names, and not behind where shapely sees it go inside."""
    extent = float(np.max(np.ptp(polygon.vertices, axis=0)))
    rounding = 1e-11 * extent + 1e-14 * np.max(np.abs(polygon.vertices))
    if polygon.signed_distance([start])[0] < -rounding or np.hypot(*(end - start)) < rounding:
        return
    inside = shapely.intersection(shapely.LineString([start, end]), shapely.Polygon(polygon.vertices))
    parts = [part for part in shapely.get_parts(inside) if part.length > rounding]
    middles = [part.interpolate(0.5, normalized=True) for part in parts]
    deep = [
        part for part, at in zip(parts, middles, strict=True) if polygon.signed_distance([at.coords[0]]) < -rounding
    ]
    found = first_crossing(polygon, start, end)
    if found is None:
        assert not deep
        return
    edge, t, fraction = found
    place = start + fraction * (end - start)
    assert 0.0 <= t <= 1.0
    assert 0.0 <= fraction <= 1.0
    assert np.hypot(*(polygon.vertices[edge] + t * polygon.edges[edge] - place)) <= 10 * rounding
    if deep:
        first = min(deep, key=lambda part: np.min(np.hypot(*(shapely.get_coordinates(part) - start).T)))
        assert np.hypot(*(place - start)) <= deep_from(polygon, start, first, rounding) + 1e-8 * extent


names = st.sampled_from(list(POLYGONS))


class TestFirstCrossing:
    @settings(max_examples=50)
    @given(names, share, share, share, share)
    def test_from_anywhere(self, name, a, b, c, d):
        check_crossing(POLYGONS[name], around(POLYGONS[name], [a, b]), around(POLYGONS[name], [c, d]))

    @settings(max_examples=50)
    @given(names, st.integers(0, 10**6), share, share, share)
    @example("star", 1, 0.5, 0.5, 0.5)
    def test_from_the_outline(self, name, which, along, c, d):
        polygon = POLYGONS[name]
        edge = which % len(polygon.vertices)
        check_crossing(polygon, polygon.vertices[edge] + along * polygon.edges[edge], around(polygon, [c, d]))

    @settings(max_examples=50)
    @given(names, st.integers(0, 10**6), share, share, st.floats(1.0, 2.0))
    def test_aimed_at_a_vertex(self, name, which, a, b, beyond):
        polygon = POLYGONS[name]
        start, vertex = around(polygon, [a, b]), polygon.vertices[which % len(polygon.vertices)]
        check_crossing(polygon, start, start + beyond * (vertex - start))

    def test_along_an_edge_and_on(self):
        """What runs along an edge to its end, within rounding, goes inside there if the vertex is concave."""
        rng = np.random.default_rng(7)
        for _ in range(4000):
            polygon = POLYGONS[rng.choice(list(POLYGONS))]
            edge = rng.integers(len(polygon.vertices))
            noise = rng.choice([0.0, 1.0]) * 10.0 ** rng.uniform(-18, -3) * rng.normal(size=2)
            shares = [rng.choice([0.0, rng.random(), 1.0]), rng.uniform(-1.0, 2.0)]
            on, end = polygon.vertices[edge] + np.outer(shares, polygon.edges[edge])
            check_crossing(polygon, on, end + noise)

    @pytest.mark.parametrize("shift", [0.0, 1e6])
    @pytest.mark.parametrize(
        ("start", "end", "expected"),
        [
            # off the end of an edge into the inside
            *(((1, y), (1, end), (4, 0.0, (3.0 - y) / (end - y))) for y in (1.0, 2.0) for end in (3.5, 4.5)),
            ((1, 1), (1, 2.9), None),
            # from corners
            ((1, 1), (0.5, 0.5), 0.0),
            ((1, 1), (2, 2), None),
            ((4, 1), (0.5, 2), (3, 3.0 / 7.0, 3.0 / 3.5)),
            # leaving and sliding are no crossings, nor is standing still
            ((2, 0), (2, -1), None),
            ((1, 0), (3, 0), None),
            ((0, 0), (4, 0), None),
            ((2, 0.5), (2, 0.5), None),
        ],
    )
    def test_of_a_notched_square(self, start, end, expected, shift):
        found = first_crossing(Polygon(np.array(NOTCHED) + shift), np.add(start, shift), np.add(end, shift))
        if isinstance(expected, float):
            assert found[2] == expected
        else:
            assert found == (None if expected is None else pytest.approx(expected, abs=1e-9))

    def test_of_thin_parts_and_touched_tips(self):
        assert first_crossing(POLYGONS["sliver"], [1.0, 1.0], [1.0, -1.0])[2] == pytest.approx((1.0 - 1e-6) / 2.0)
        for offset in (0.0, 1e-18):
            assert first_crossing(star().polygon(), [-0.1, 0.1 + offset], [0.1, 0.1 + offset]) is None

    def test_a_start_that_rounding_put_inside(self):
        polygon = cassinian().polygon(40)
        for edge in range(40):
            outward = np.array([polygon.edges[edge, 1], -polygon.edges[edge, 0]])
            outward /= np.hypot(*outward)
            start = polygon.vertices[edge] + 0.3 * polygon.edges[edge] - 1e-15 * outward
            assert first_crossing(polygon, start, start - 1e-4 * outward) == (edge, pytest.approx(0.3), 0.0)


@pytest.mark.parametrize(("n", "millimetres"), [(40, 1.17), (80, 0.29), (160, 0.074)])
def test_standoff_of_the_cassinian(n, millimetres):
    model = cassinian()
    assert model.polygon(n).standoff_from(model.curve) * 1e3 == pytest.approx(millimetres, abs=0.006)


@pytest.mark.parametrize("model", [cassinian(), ellipse(), dumbbell()], ids=lambda model: model.name)
def test_standoff_is_of_second_order(model):
    errors = [model.polygon(n).standoff_from(model.curve) for n in (160, 640)]
    assert math.log(errors[0] / errors[1], 4) == pytest.approx(2.0, abs=0.15)


def test_standoff_of_a_circle_is_its_sagitta_and_is_measured_both_ways():
    for n in (7, 40, 1000):
        sagitta = 0.1 * (1.0 - math.cos(math.pi / n))
        assert circle().polygon(n).standoff_from(circle().curve) == pytest.approx(sagitta, abs=1e-12)
    spiked = Polygon([[0, 0], [1, 0], [1, 1], [0.51, 1], [0.5, 2], [0.49, 1], [0, 1]])
    square = Polygon([[0, 0], [1, 0], [1, 1], [0, 1]])
    assert spiked.standoff_from(square) == square.standoff_from(spiked) == pytest.approx(1.0)


def test_polygons_of_models(refused):
    model = star()
    assert np.array_equal(model.polygon(7).vertices, [corner.position for corner in model.curve.corners])
    assert model.polygon().standoff_from(model.curve) < 1e-16
    u = 2.0 * math.pi * np.arange(40) / 40
    assert np.array_equal(cassinian().polygon(40).vertices, cassinian().curve.position(u))
    assert len(dumbbell().polygon(60).vertices) == 60
    assert POLYGONS["notched"].resolution == 4.0
    assert model.polygon(40) is model.polygon(40)
    assert not model.polygon(40).vertices.flags.writeable
    assert (cassinian(size=0.3).size, line().size) == (pytest.approx(0.3), 0.2)
    with refused(InputError):
        line().polygon()
    with refused(InputError):
        circle().polygon(2)


@pytest.mark.parametrize("size", [1e-99, 1e99])
@pytest.mark.parametrize("make", [star, cassinian, circle, ellipse, dumbbell])
def test_extreme_sizes_keep_their_digits(make, size):
    extreme, usual = make(size=size).polygon(), make(size=1.0).polygon()
    points = np.random.default_rng(1).uniform(-0.6, 0.6, (100, 2))
    distance = extreme.signed_distance(points * size) / size
    assert distance == pytest.approx(usual.signed_distance(points), rel=1e-12, abs=1e-15)
    assert first_crossing(extreme, [size, 0.9 * size], [0.0, 0.0]) == pytest.approx(
        first_crossing(usual, [1.0, 0.9], [0.0, 0.0]), rel=1e-9
    )
