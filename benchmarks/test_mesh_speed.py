"""Triangle meshes: the cost of a closest point along a path and anywhere, of a crossing, and of the tables, by size.

The mesh is a sphere of 100 mm with bumps. Yardstick is libigl in the same run: its tree, asked for the same points.
`extra_info` holds how many times faster than libigl we are, and the exponent of the cost in the number of triangles
since the mesh before, where 0 would be log n at best.
"""

import math
from functools import cache

import igl
import numpy as np
import pytest

from hapticeval.compiled import compiled
from hapticeval.geometry import mesh_kernels as kernels
from hapticeval.geometry import solids
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.model import Model
from hapticeval.renderers import constraint, minimum_distance
from hapticeval.scene import Scene
from hapticeval.simulation.playback import answers_along

SUBDIVISIONS = (1, 4, 6)
STEP = 1e-4
per_query: dict[tuple[str, int], float] = {}


def triangles(subdivisions: int) -> solids.Triangles:
    points, rows = solids.icosphere(subdivisions, 1.0)
    x, y, z = points.T[..., np.newaxis]
    return 0.1 * points * (1.0 + 0.15 * np.sin(7.0 * x) * np.cos(9.0 * y + 3.0 * z)), rows


@cache
def bumpy(subdivisions: int) -> Mesh:
    return Mesh("bumpy", *triangles(subdivisions))


@compiled
def first_entries(
    faces: np.ndarray, vertices: np.ndarray, tree: np.ndarray, starts: np.ndarray, ends: np.ndarray, touch: float
) -> np.ndarray:
    """At which shares of segments from starts to ends (n, 3), m, they enter the mesh, (n,)."""
    shares, k = np.empty(starts.shape[0]), 0
    for row in range(starts.shape[0]):
        start, end = (starts[row, 0], starts[row, 1], starts[row, 2]), (ends[row, 0], ends[row, 1], ends[row, 2])
        _, k, _, shares[row] = kernels.first_entry(faces, vertices, tree, start, end, touch, k)
    return shares


@cache
def tree(subdivisions: int) -> igl.AABB:
    made = igl.AABB()
    made.init(bumpy(subdivisions).vertices, bumpy(subdivisions).triangles)
    return made


def path(count: int) -> np.ndarray:
    """A hand that winds round the sphere, 2 mm below its mean radius, in steps of 0.1 mm."""
    turn = np.arange(count) * (STEP / 0.098)
    high = 0.3 * turn
    return 0.098 * np.column_stack([np.cos(turn) * np.cos(high), np.sin(turn) * np.cos(high), np.sin(high)])


def scattered(count: int) -> np.ndarray:
    return np.random.default_rng(4).uniform(-0.15, 0.15, (count, 3))


QUERIES = {"along a path": path(20_000), "anywhere": scattered(2_000)}


def keep(benchmark, way: str, subdivisions: int, count: int, yardstick: str = "") -> None:
    if benchmark.stats is None:  # --benchmark-disable
        return
    per_query[way, subdivisions] = benchmark.stats.stats.min / count  # what other work disturbs least
    benchmark.extra_info["microseconds"] = per_query[way, subdivisions] * 1e6
    if (yardstick, subdivisions) in per_query:
        benchmark.extra_info["times faster than libigl"] = (
            per_query[yardstick, subdivisions] / per_query[way, subdivisions]
        )
    before = SUBDIVISIONS[SUBDIVISIONS.index(subdivisions) - 1]
    if before < subdivisions and (way, before) in per_query:
        growth = per_query[way, subdivisions] / per_query[way, before]
        benchmark.extra_info["exponent in n"] = math.log(growth) / math.log(4.0 ** (subdivisions - before))


@pytest.mark.parametrize("subdivisions", SUBDIVISIONS)
@pytest.mark.parametrize("where", QUERIES)
def test_libigl(benchmark, where, subdivisions):
    benchmark.group = f"closest point {where}, {20 * 4**subdivisions} triangles"
    mesh, points = bumpy(subdivisions), QUERIES[where][:2_000]
    vertices, rows = np.ascontiguousarray(mesh.vertices), mesh.triangles
    benchmark.pedantic(lambda: tree(subdivisions).squared_distance(vertices, rows, points), rounds=5, warmup_rounds=1)
    keep(benchmark, f"libigl {where}", subdivisions, len(points))


@pytest.mark.parametrize("subdivisions", SUBDIVISIONS)
@pytest.mark.parametrize("where", QUERIES)
def test_closest_point(benchmark, where, subdivisions):
    benchmark.group = f"closest point {where}, {20 * 4**subdivisions} triangles"
    mesh, points = bumpy(subdivisions), QUERIES[where]
    benchmark.pedantic(mesh.closest_point, (points,), rounds=5, warmup_rounds=1)
    keep(benchmark, where, subdivisions, len(points), f"libigl {where}")


@pytest.mark.parametrize("subdivisions", SUBDIVISIONS)
def test_crossing(benchmark, subdivisions):
    """A tool that flies straight to the hand, a millimetre."""
    benchmark.group = f"first crossing, {20 * 4**subdivisions} triangles"
    mesh, points = bumpy(subdivisions), path(5_000)
    starts, ends = points * 1.01, points
    benchmark.pedantic(lambda: first_entries(*mesh.tables, starts, ends, mesh.touch), rounds=5, warmup_rounds=1)
    keep(benchmark, "crossing", subdivisions, len(points))


@pytest.mark.parametrize("subdivisions", SUBDIVISIONS)
@pytest.mark.parametrize("base", [minimum_distance, constraint], ids=["minimum-distance", "constraint"])
def test_tick(benchmark, base, subdivisions):
    """A tick of a renderer whose hand is led along the path, a millimetre below the surface."""
    name = "minimum-distance" if base is minimum_distance else "constraint"
    benchmark.group = f"a tick, {20 * 4**subdivisions} triangles"
    renderer = base.variant(representation="curve")(Scene(model=Model("bumpy", {}, bumpy(subdivisions))))
    below = bumpy(subdivisions).closest_point(path(20_000))
    hips = below.foot - 1e-3 * below.normal
    benchmark.pedantic(answers_along, (renderer, hips, 1e-3), rounds=5, warmup_rounds=1)
    keep(benchmark, name, subdivisions, len(hips), "libigl along a path")


@pytest.mark.parametrize("subdivisions", SUBDIVISIONS)
def test_building(benchmark, subdivisions):
    """With all checks: closed, a manifold, outward, and free of crossings."""
    benchmark.group = f"tables, {20 * 4**subdivisions} triangles"
    given = triangles(subdivisions)
    benchmark.pedantic(Mesh, ("bumpy", *given), rounds=3, warmup_rounds=1)
    keep(benchmark, "building", subdivisions, 1)
