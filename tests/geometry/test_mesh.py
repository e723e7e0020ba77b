"""Triangle meshes: exact queries on any shape, watertight crossings, and a refusal for whatever bounds no solid."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache

import igl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hapticeval.compiled import first_class
from hapticeval.errors import InputError
from hapticeval.geometry import mesh_kernels as kernels
from hapticeval.geometry import solids
from hapticeval.geometry.boundary import closest_of, march_to_crossing
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_input import meeting_points
from hapticeval.laws import CLOSEST

FAR = np.array([1e6, -1e6, 1e6])
ASLANT = np.array([0.013, -0.02, 0.3])


def bumpy(subdivisions: int) -> Mesh:
    """A sphere of 100 mm with bumps and hollows."""
    points, triangles = solids.icosphere(subdivisions, 1.0)
    x, y, z = points.T[..., np.newaxis]
    return Mesh("bumpy", 0.1 * points * (1.0 + 0.15 * np.sin(7.0 * x) * np.cos(9.0 * y + 3.0 * z)), triangles)


def sliver(thickness: float) -> Mesh:
    """A plate whose sides are slivers, one of which has a vertex in the middle of its long edge: a cap."""
    outline = np.array([[0.0, 0.0], [0.07, 0.02], [0.1, 0.0285714], [0.03, 0.08]])
    return Mesh("plate", *solids.prism(outline, thickness))


SHAPES = {
    "bumpy": lambda: bumpy(4),
    "cube": lambda: make_model("cube").boundary,
    "wedge of 1 degree": lambda: make_model("wedge", angle=1.0).boundary,
    "l-block": lambda: make_model("l-block").boundary,
    "star": lambda: make_model("extruded", model={"kind": "star", "tip_angle": 20.0}).boundary,
    "plate": lambda: sliver(1e-9),
    "cylinder": lambda: make_model("cylinder", sides=400).boundary,
    "far away": lambda: Mesh("far", bumpy(2).vertices + FAR, bumpy(2).triangles),
}
each = pytest.mark.parametrize("shape", SHAPES)


@cache
def mesh_of(shape: str) -> Mesh:
    return SHAPES[shape]()


def size_of(mesh: Mesh) -> float:
    low, high = np.reshape(mesh.bounds, (2, 3))
    return float(np.max(high - low))


def scattered(mesh: Mesh, count: int, seed: int = 5) -> np.ndarray:
    """Points round a mesh, on its vertices, on its edges, on its faces, and close to these."""
    low, high = np.reshape(mesh.bounds, (2, 3))
    random = np.random.default_rng(seed)
    a, b, c = mesh.vertices[mesh.triangles[random.integers(0, len(mesh.triangles), count // 2)].T]
    shares = random.dirichlet([0.3, 0.3, 0.3], count // 2)
    shares[::4] = np.eye(3)[shares[::4].argmax(axis=1)]
    shares[1::4, 2], shares[1::4, 0] = 0.0, 1.0 - shares[1::4, 1]
    on = shares[:, :1] * a + shares[:, 1:2] * b + shares[:, 2:] * c
    on += np.repeat([0.0, 1e-12, 1e-6, 1e-3], -(-len(on) // 4))[: len(on), np.newaxis] * random.normal(size=on.shape)
    wide = random.uniform(low - 0.5 * (high - low), high + 0.5 * (high - low), (count - len(on), 3))
    return np.concatenate([on, wide])


@each
def test_distances_are_those_of_libigl(shape):
    mesh = mesh_of(shape)
    points = scattered(mesh, 10_000)
    found = mesh.closest_point(points)
    centre = mesh.vertices[0]
    far2, _, _ = igl.point_mesh_squared_distance(points - centre, mesh.vertices - centre, mesh.triangles)
    tolerance = 1e-12 * size_of(mesh) + 4.0 * np.spacing(np.abs(points).max())
    # On slivers libigl's closest points are the worse ones: none may be closer than ours.
    assert np.max(np.abs(found.distance) - np.sqrt(far2)) <= tolerance
    if shape != "plate":
        np.testing.assert_allclose(np.abs(found.distance), np.sqrt(far2), atol=tolerance)
    np.testing.assert_allclose(np.linalg.norm(points - found.foot, axis=1), np.abs(found.distance), atol=tolerance)
    # Where points of a plate's rim are equally far to rounding, any is the closest; at an edge a direction may be lost.
    blur = max(2e-9 if shape == "plate" else tolerance, 2.0 * kernels.ON_FEATURE * np.abs(points).sum(axis=1).max())
    np.testing.assert_allclose(found.foot + found.distance[:, None] * found.normal, points, rtol=0.0, atol=blur)


@each
def test_sides_are_those_of_the_winding_number(shape):
    mesh = mesh_of(shape)
    points = scattered(mesh, 10_000)
    found = mesh.closest_point(points)
    centre = mesh.vertices[0]
    winding = igl.winding_number(mesh.vertices - centre, mesh.triangles, points - centre)
    clear = np.abs(found.distance) > mesh.touch
    np.testing.assert_array_equal(found.distance[clear] < 0.0, winding[clear] > 0.5)
    assert clear.mean() > 0.5


@pytest.mark.parametrize("shape", ["bumpy", "plate", "wedge of 1 degree"])
def test_the_distance_is_the_least_over_all_triangles_in_wide_arithmetic(shape):
    mesh = mesh_of(shape)
    points = scattered(mesh, 60)
    found = mesh.closest_point(points)
    for point, distance in zip(points, np.abs(found.distance), strict=True):
        assert distance == pytest.approx(_distance(mesh, point), abs=1e-16)


def entries(mesh: Mesh, starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which segments from starts to ends (n, 3), m, enter the mesh, and at which share of them: (n,) both."""
    segments = zip(map(tuple, starts.tolist()), map(tuple, ends.tolist()), strict=True)
    answers = [kernels.first_entry(*mesh.tables, start, end, mesh.touch, 0) for start, end in segments]
    return np.array([inside for inside, *_ in answers]), np.array([share for *_, share in answers])


def _distance(mesh: Mesh, point: np.ndarray) -> float:
    """By the closest point of each triangle's plane, edges and corners, in 80 bits, all triangles at once."""
    wide = mesh.vertices.astype(np.longdouble) - point.astype(np.longdouble)
    corners = wide[mesh.triangles.T]
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    inside = np.ones(len(normal), dtype=bool)
    least2 = np.full(len(normal), np.inf, dtype=np.longdouble)
    for i in range(3):
        start, edge = corners[i], corners[(i + 1) % 3] - corners[i]
        share = np.clip(-np.sum(start * edge, axis=1) / np.sum(edge * edge, axis=1), 0.0, 1.0)
        least2 = np.minimum(least2, np.sum((start + share[:, None] * edge) ** 2, axis=1))
        inside &= np.sum(np.cross(normal, edge) * start, axis=1) <= 0.0
    height2 = np.sum(normal * a, axis=1) ** 2 / np.sum(normal * normal, axis=1)
    return float(np.sqrt(np.min(np.where(inside, height2, least2))))


@each
def test_the_answer_does_not_depend_on_where_the_search_begins(shape):
    mesh = mesh_of(shape)
    points = scattered(mesh, 200)
    function, data = closest_of(mesh)
    law, frame = first_class(function, CLOSEST), np.empty((6, 3))
    found = mesh.closest_point(points)
    for row, point in enumerate(points):
        for start in (0, len(mesh.triangles) - 1, row % len(mesh.triangles)):
            data.state[0] = start
            assert law(data, point, frame) == found.distance[row]
            np.testing.assert_array_equal(frame[:2], [found.foot[row], found.normal[row]])
            np.testing.assert_array_equal(frame[2:5], 0.0)
            assert np.isnan(frame[5]).all()


@each
def test_no_segment_leaks_through_vertices_and_edges(shape):
    mesh = mesh_of(shape)
    random = np.random.default_rng(6)
    count = 3000
    on = scattered(mesh, 2 * count)[: count // 4]
    inside = on[random.integers(0, len(on), count)]
    inside = mesh.closest_point(inside)
    inner = inside.foot - random.choice([1e-3, 1e-2], (count, 1)) * size_of(mesh) * inside.normal
    inner = inner[mesh.signed_distance(inner) < -mesh.touch]
    corners = mesh.vertices[mesh.triangles]
    aims = corners[random.integers(0, len(corners), len(inner)), random.integers(0, 3, len(inner))]
    halves = random.integers(0, 2, len(inner)).astype(bool)
    others = corners[random.integers(0, len(corners), len(inner))]
    aims[halves] = others[halves, 0] + 0.5 * (others[halves, 1] - others[halves, 0])
    starts = inner + 4.0 * size_of(mesh) * (aims - inner) / np.linalg.norm(aims - inner, axis=1)[:, None]
    enters, shares = entries(mesh, starts, inner)
    assert len(inner) > 500
    assert enters.all()
    assert (shares < 1.0).all()  # 1 would mean that only the end was found inside


def test_a_plate_of_any_thickness_is_met_where_a_segment_aims_between_its_vertices():
    for thickness in (1e-3, 1e-6, 1e-9):
        mesh = sliver(thickness)
        a, b, c = mesh.vertices[mesh.triangles[np.abs(mesh.normals[:, 2]) > 0.5].T]
        shares = np.random.default_rng(7).dirichlet([1.0, 1.0, 1.0], 400)
        aims = np.einsum("sk,tkx->stx", shares, np.stack([a, b, c], axis=1)).reshape(-1, 3)
        starts, ends = aims + ASLANT, aims - ASLANT
        enters, shares = entries(mesh, starts, ends)
        assert enters.all()
        high = starts + shares[:, np.newaxis] * (ends - starts)
        assert np.abs(high[:, 2]).max() <= 0.5 * thickness + 1e-15


@pytest.mark.parametrize("shape", ["bumpy", "l-block", "star", "wedge of 1 degree"])
def test_crossings_are_those_that_small_steps_find(shape):
    mesh = mesh_of(shape)
    low, high = np.reshape(mesh.bounds, (2, 3))
    random = np.random.default_rng(8)
    starts, ends = random.uniform(low - 0.02, high + 0.02, (2, 300, 3))
    outside = mesh.signed_distance(starts) > 0.0
    met = 0
    for start, end in zip(starts[outside], ends[outside], strict=True):
        exact, stepped = mesh.first_crossing(start, end, grain=1e-4), march_to_crossing(mesh, start, end, 1e-4)
        assert stepped is None or exact is not None
        if exact is not None and stepped is not None:
            met += 1
            assert np.linalg.norm(exact - start) <= np.linalg.norm(stepped - start) + 2e-4
            assert abs(mesh.signed_distance([exact])[0]) < 1e-15
    assert met > 20


CUBE = make_model("cube", size=0.1).boundary


@pytest.mark.parametrize(
    ("start", "end", "where"),
    [
        pytest.param((0, 0, 0.1), (0, 0, 0), (0, 0, 0.05), id="through the diagonal of a face"),
        pytest.param((0.1, 0.1, 0.1), (0, 0, 0), (0.05, 0.05, 0.05), id="through a vertex"),
        pytest.param((0.1, 0.1, 0.02), (0, 0, 0.02), (0.05, 0.05, 0.02), id="through an edge"),
        pytest.param((0.1, 0.0, 0.1), (0.0, 0.0, 0.1), None, id="past it"),
        pytest.param((0.1, 0.0, 0.05), (-0.1, 0.0, 0.05), None, id="along a face"),
        pytest.param((0.1, 0.05, 0.05), (-0.1, 0.05, 0.05), None, id="along an edge"),
        pytest.param((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), None, id="touches an edge"),
        pytest.param((0.15, 0.0, 0.0), (0.0, 0.15, 0.0), None, id="past an edge"),
        pytest.param((0, 0, 0.05), (0, 0, 0.1), None, id="off the face that it starts on"),
        pytest.param((0, 0, 0.05), (0.02, 0, 0.04), (0, 0, 0.05), id="into the face that it starts on"),
        pytest.param((0, 0, 0.05), (0.03, 0, 0.05), None, id="on the face that it starts on"),
        pytest.param((0.05, 0.05, 0.05), (0.1, 0.0, 0.0), None, id="from a vertex past the solid"),
        pytest.param((0.05, 0.05, 0.05), (0.0, 0.0, 0.0), (0.05, 0.05, 0.05), id="from a vertex into the solid"),
        pytest.param((0.05, 0.05, 0.0), (-0.05, 0.05, 0.0), None, id="from an edge along a face"),
        pytest.param((0, 0, 0.05 - 1e-17), (0, 0, 0.1), None, id="out from inside by rounding"),
        pytest.param((0, 0, 0.2), (0, 0, 0.2), None, id="nowhere"),
        pytest.param((0, 0, 0.2), (0, 0, 0.05), None, id="up to the face"),
    ],
)
def test_crossings_of_a_cube(start, end, where):
    found = CUBE.first_crossing(np.array(start, dtype=float), np.array(end, dtype=float), grain=1e-5)
    assert (found is None) is (where is None)
    if where is not None:
        np.testing.assert_allclose(found, where, atol=1e-15)


class TestCones:
    @pytest.mark.parametrize(
        ("at", "count"), [((0.05, 0.01, 0.02), 1), ((0.05, 0.05, 0.01), 2), ((0.05, -0.05, 0.05), 3), ((0.05, 0, 0), 1)]
    )
    def test_a_cube_has_one_normal_on_a_face_two_on_an_edge_and_three_at_a_vertex(self, at, count):
        starts, normals = kernels.normals_in_reach(*CUBE.tables, np.array([at]), np.zeros(1))
        assert starts.tolist() == [0, count]
        active = np.abs(np.abs(at) - 0.05) < 1e-12
        np.testing.assert_allclose(normals.sum(axis=0), np.where(active, np.sign(at), 0.0), atol=1e-15)

    def test_reach_goes_round_edges_but_not_through_plates(self):
        plate = make_model("box", x=0.1, y=0.1, z=1e-3).boundary
        for reach, count in ((1e-3, 1), (0.03, 2), (0.0311, 3)):
            starts, _ = kernels.normals_in_reach(*plate.tables, np.array([[0.02, 0.0, 5e-4]]), np.array([reach]))
            assert starts[1] == count

    @given(
        drawn=st.lists(st.tuples(*[st.integers(-9, 9)] * 3), min_size=1, max_size=7),
        d=st.tuples(*[st.integers(-9, 9)] * 3),
    )
    @settings(max_examples=400)
    def test_the_closest_of_a_cone_leaves_a_rest_that_no_normal_faces(self, drawn, d):
        """The conditions of Karush, Kuhn and Tucker, which hold for the closest point of a convex cone alone."""
        normals = np.array([each for each in drawn if any(each)] or [[1, 0, 0]], dtype=float)
        normals /= np.linalg.norm(normals, axis=1)[:, np.newaxis]
        goal = np.array(d, dtype=float)
        found = np.array(kernels.closest_in_cone(normals, 0, len(normals), tuple(goal)))
        rest, size = goal - found, np.linalg.norm(goal)
        assert np.all(normals @ rest <= 1e-12 * size)
        assert abs(rest @ found) <= 1e-12 * size * size

    @given(angle=st.floats(-3.1, 3.1), tilt=st.floats(-1.5, 1.5))
    def test_off_an_edge_the_angle_is_that_to_the_fan(self, angle, tilt):
        direction = [math.cos(tilt) * math.cos(angle), math.cos(tilt) * math.sin(angle), math.sin(tilt)]
        found = CUBE.normal_cone(np.array([[0.05, 0.05, 0.01]]), np.zeros(1))(np.array([direction]))[0]
        share = min(max(angle, 0.0), math.pi / 2) if -math.pi / 4 * 3 < angle else math.pi / 2
        closest = max(math.cos(tilt) * math.cos(angle - turn) for turn in (0.0, math.pi / 2, share))
        assert found == pytest.approx(math.acos(min(closest, 1.0)), abs=2e-8)


TETRAHEDRON = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def mended(**change):
    vertices, triangles = TETRAHEDRON
    return change.get("vertices", vertices), change.get("triangles", triangles)


def two(shift, *, share=()):
    """Two tetrahedra, the second shifted, some of its vertices those of the first."""
    vertices, triangles = (np.array(each) for each in TETRAHEDRON)
    number = np.array([share[k] if k < len(share) else 4 + k for k in range(4)])
    return np.concatenate([vertices, vertices + shift]), np.concatenate([triangles, number[triangles]])


def spiked():
    """A cube whose top is one pyramid that reaches down through the bottom."""
    vertices, triangles = solids.box((0.1, 0.1, 0.1))
    low = np.flatnonzero((vertices[triangles][:, :, 2] > 0.0).all(axis=1))
    rim = [4, 5, 6, 7]
    fan = [[rim[i], rim[(i + 1) % 4], 8] for i in range(4)]
    return np.vstack([vertices, [0.01, 0.02, -0.07]]), np.vstack([np.delete(triangles, low, axis=0), fan])


@pytest.mark.parametrize(
    "given",
    [
        mended(triangles=[*TETRAHEDRON[1][:3], [2, 0, 1]]),
        mended(triangles=[[0, 2, 1], [0, 1, 3], [1, 2, 3]]),
        (two([3.0, 0.0, 0.0])[0], two([3.0, 0.0, 0.0])[1][:-1]),
        mended(triangles=[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 3, 0]]),
        mended(triangles=[each[::-1] for each in TETRAHEDRON[1]]),
        mended(vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, 0.0]]),
        mended(triangles=[[0, 2, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
        two([3.0, 0.0, 0.0]),
        two([-0.2, 0.1, 0.1], share=(0,)),
        two([0.0, 0.0, 0.0], share=(0, 1)),
        spiked(),
        mended(vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, math.nan, 1]]),
        mended(vertices=[[0, 0], [1, 0], [0, 1], [0, 1]]),
        mended(vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0], ["a", 0, 1]]),
        mended(triangles=[[0, 2, 1], [0, 1, 4], [1, 2, 3], [2, 0, 3]]),
        mended(triangles=[[0, 2, 1], [0, 1, 2.5], [1, 2, 3], [2, 0, 3]]),
        mended(triangles=[[0, 2, 1, 3]] * 4),
        mended(vertices=[[1e9 + x, y, z] for x, y, z in TETRAHEDRON[0]]),
    ],
)  # fmt: skip
def test_what_bounds_no_solid_is_refused_with_the_triangle(refused, given):
    with refused(InputError):
        Mesh("mesh", *given)


def test_a_sliver_is_no_degenerate_triangle():
    assert sliver(1e-9).signed_distance([[0.05, 0.03, 0.0]])[0] == pytest.approx(-5e-10, rel=1e-6)


@given(drawn=st.lists(st.tuples(*[st.integers(-3, 3)] * 3), min_size=6, max_size=6))
@settings(max_examples=300)
def test_triangles_meet_where_a_linear_programme_finds_a_common_point(drawn):
    from scipy.optimize import linprog

    first, second = (np.array(each, dtype=float) for each in (drawn[:3], drawn[3:]))
    if any(not np.linalg.norm(np.cross(t[1] - t[0], t[2] - t[0])) for t in (first, second)):
        return
    equal = np.zeros((5, 6))
    equal[:3, :3], equal[:3, 3:], equal[3, :3], equal[4, 3:] = first.T, -second.T, 1.0, 1.0
    feasible = linprog(np.zeros(6), A_eq=equal, b_eq=[0, 0, 0, 1, 1]).status == 0
    exact = [[tuple(map(Fraction, corner.tolist())) for corner in each] for each in (first, second)]
    assert feasible is bool(list(meeting_points(*exact)))


@pytest.mark.parametrize(
    ("kind", "parameters", "volume"),
    [
        ("cube", {"size": 0.2}, 8e-3),
        ("box", {"x": 0.1, "y": 0.2, "z": 1e-9}, 2e-11),
        ("wedge", {"angle": 90.0, "size": 0.1, "length": 0.3}, 3e-3),
        ("l-block", {"size": 0.1, "thickness": 0.04, "length": 0.1}, 6.4e-4),
        ("cylinder", {"size": 2.0, "length": 1.0, "sides": 4}, 2.0),
        ("icosphere", {"size": 2.0, "subdivisions": 0}, 2.53615071),
        ("extruded", {"model": {"kind": "polygon", "vertices": [[0, 0], [1, 0], [1, 2]]}, "length": 3.0}, 3.0),
    ],
)
def test_solids_have_their_volumes_and_lie_round_the_origin(kind, parameters, volume):
    mesh = make_model(kind, **parameters).boundary
    assert mesh_volume(mesh) == pytest.approx(volume, rel=1e-7)
    if kind != "extruded":
        low, high = np.reshape(mesh.bounds, (2, 3))
        np.testing.assert_allclose(low, -high, atol=0.02)


def mesh_volume(mesh: Mesh) -> float:
    a, b, c = mesh.vertices[mesh.triangles.T]
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@pytest.mark.parametrize("subdivisions", range(4))
def test_an_icosphere_has_its_corners_on_the_sphere(subdivisions):
    mesh = make_model("icosphere", subdivisions=subdivisions, size=0.2).boundary
    assert len(mesh.triangles) == 20 * 4**subdivisions
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.1, rtol=1e-15)


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("wedge", {"angle": 180.0}),
        ("l-block", {"size": 0.1, "thickness": 0.1}),
        ("icosphere", {"subdivisions": 9}),
        ("extruded", {"model": {"kind": "sphere"}}),
        ("extruded", {"model": {"kind": "line"}}),
        ("extruded", {"model": {"size": 1.0}}),
        ("box", {"x": -1.0}),
        ("mesh", {}),
        ("mesh", {"vertices": [[0, 0, 0]]}),
        ("mesh", {"file": "a.stl"}),
        ("mesh", {"vertices": TETRAHEDRON[0], "triangles": TETRAHEDRON[1], "unit": "ft"}),
        ("mesh", {"vertices": TETRAHEDRON[0], "triangles": [[0, 1], [1, 2, 3]]}),
        ("mesh", {"vertices": TETRAHEDRON[0], "triangles": [["a", "b", "c"]] * 4}),
    ],
)
def test_bad_parameters_are_refused(refused, kind, parameters):
    with refused(InputError):
        make_model(kind, **parameters)


@pytest.mark.slow
class TestAMillion:
    """The same laws on a million points and segments, round meshes of up to 81,920 triangles."""

    def test_distances(self):
        mesh = bumpy(6)
        points = scattered(mesh, 1_000_000)
        found = mesh.closest_point(points)
        far2, _, _ = igl.point_mesh_squared_distance(points, mesh.vertices, mesh.triangles)
        np.testing.assert_allclose(np.abs(found.distance), np.sqrt(far2), rtol=0.0, atol=1e-12 * size_of(mesh))

    def test_sides(self):
        """On 1,280 triangles: the exact winding number visits each of them for each point."""
        mesh = bumpy(3)
        points = scattered(mesh, 1_000_000)
        distances = mesh.signed_distance(points)
        winding = igl.winding_number(np.ascontiguousarray(mesh.vertices), mesh.triangles, points)
        clear = np.abs(distances) > mesh.touch
        np.testing.assert_array_equal(distances[clear] < 0.0, winding[clear] > 0.5)

    def test_segments_through_vertices_and_edges(self):
        mesh = bumpy(6)
        random = np.random.default_rng(9)
        corners = mesh.vertices[mesh.triangles[random.integers(0, len(mesh.triangles), 1_000_000)]]
        shares = random.random((1_000_000, 1)) * random.integers(0, 2, (1_000_000, 1))
        aims = corners[:, 0] + shares * (corners[:, 1] - corners[:, 0])
        inner = 0.02 * random.uniform(-1.0, 1.0, aims.shape)
        starts = inner + 4.0 * (aims - inner)
        enters, shares = entries(mesh, starts, inner)
        assert enters.all()
        assert (shares < 1.0).all()


@pytest.mark.parametrize("seed", range(4))
def test_along_the_diagonal_of_a_flat_face_the_tool_keeps_up_with_the_hand(seed):
    """Turned and shifted, rounding decides at each step on which of both triangles it is, and on neither it gains."""
    rng = np.random.default_rng(seed)
    turn, shift = Rotation.random(random_state=seed).as_matrix(), rng.uniform(-0.5, 0.5, 3)
    cube = make_model("cube")
    boundary = Mesh("cube", cube.boundary.vertices @ turn.T + shift, cube.boundary.triangles)
    along = np.linspace(-0.045, 0.045, 2001) ** 3 / 0.045**2
    # Both diagonals of the top: one of them is an edge of its triangles.
    for sign in (1.0, -1.0):
        hips = np.column_stack([along, sign * along, np.full(along.size, 0.05 - 7e-4)])
        hips[0, 2] = 0.051
        tools = boundary.rigid_tool(hips @ turn.T + shift)[2]
        feet = np.column_stack([along, sign * along, np.full(along.size, 0.05)])
        assert np.abs((tools - shift) @ turn - feet)[1:].max() < 1e-12
