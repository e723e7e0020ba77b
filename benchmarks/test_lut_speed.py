"""Look-up tables of the Cassinian at 0.5 mm: a million random points, and one at a time, against what memory allows.

The floor of a batch is measured in the same run, in two parts: the loads of four random nodes a point, and the streams
of points in and answers out. `over the whole grid` asks for points of the grid, two in five of which are outside of the
model; `inside` for points that are all interpolated. One at a time is compared with a compiled function of the same
arguments that does nothing: what is left of a call from Python. `extra_info` holds the ratios.
"""

from functools import cache

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from hapticeval.compiled import compiled
from hapticeval.geometry.catalogue import cassinian
from hapticeval.renderers.lut import TOUCHES, Table, look_up, tabulate
from hapticeval.renderers.nearest import nearest
from hapticeval.scene import Scene

COUNT = 1_000_000
CALLS = 10_000
WHERE = ("over the whole grid", "inside")
BATCH = "look-up table, a million points"
AT = (0.05, 0.01)
taken: dict[str, float] = {}


@cache
def projection():
    return nearest(Scene(model=cassinian(), bilateral=True), "curve")


@cache
def table() -> Table:
    return tabulate(projection())


@cache
def points(where: str) -> np.ndarray:
    grid = table().grid
    low = np.array(grid.origin)
    everywhere = np.random.default_rng(4).uniform(low, low + grid.cell * np.array(grid.cells), (COUNT, 2))
    if where == "over the whole grid":
        return everywhere
    return np.resize(everywhere[table().look_up(everywhere)[2] == TOUCHES], (COUNT, 2))


@compiled
def four_random_cells(nodes, which):
    total = 0.0
    for k in range(which.shape[0]):
        total += nodes[which[k, 0], 0] + nodes[which[k, 1], 0] + nodes[which[k, 2], 0] + nodes[which[k, 3], 0]
    return total


@compiled
def streams(hips):
    ihips, normals, status = np.empty_like(hips), np.empty_like(hips), np.empty(hips.shape[0], np.uint8)
    for k in range(hips.shape[0]):
        x, y = hips[k, 0], hips[k, 1]
        ihips[k, 0], ihips[k, 1], normals[k, 0], normals[k, 1], status[k] = x, y, y, x, 1
    return ihips, normals, status


@compiled
def nothing(_table, _hip, _ihip, _normal):
    return 1


def keep(benchmark, way: str, count: int) -> None:
    if benchmark.stats is None:  # --benchmark-disable
        return
    taken[way] = benchmark.stats.stats.min / count
    benchmark.extra_info["nanoseconds a point"] = taken[way] * 1e9
    if "four random cells" in taken and "streams" in taken and way.startswith(("table", "tree")):
        floor = taken["four random cells"] + taken["streams"]
        benchmark.extra_info["times the memory floor"] = taken[way] / floor


def compare(benchmark, way: str, other: str, what: str) -> None:
    """Keep how many times longer `way` took than `other`, as `what`."""
    if way in taken and other in taken:
        benchmark.extra_info[what] = taken[way] / taken[other]


def test_four_random_cells(benchmark):
    benchmark.group = BATCH
    nodes = table().nodes.reshape(-1, 4)
    which = np.random.default_rng(5).integers(0, len(nodes), (COUNT, 4))
    benchmark.pedantic(four_random_cells, (nodes, which), rounds=20, warmup_rounds=2)
    keep(benchmark, "four random cells", COUNT)


def test_streams(benchmark):
    benchmark.group = BATCH
    benchmark.pedantic(streams, (points(WHERE[0]),), rounds=20, warmup_rounds=2)
    keep(benchmark, "streams", COUNT)


@pytest.mark.parametrize("where", WHERE)
def test_table(benchmark, where):
    benchmark.group = BATCH
    benchmark.pedantic(table().look_up, (points(where),), rounds=20, warmup_rounds=2)
    keep(benchmark, f"table {where}", COUNT)


@pytest.mark.parametrize("where", WHERE)
def test_map_coordinates(benchmark, where):
    benchmark.group = BATCH
    grid = table().grid
    planes = [np.ascontiguousarray(table().nodes[..., k]) for k in range(4)]
    places = ((points(where) - grid.origin) / grid.cell).T[::-1].copy()

    def ask():
        return [map_coordinates(plane, places, order=1) for plane in planes]

    benchmark.pedantic(ask, rounds=5, warmup_rounds=1)
    keep(benchmark, f"map_coordinates {where}", COUNT)
    compare(benchmark, f"map_coordinates {where}", f"table {where}", "times the table")


@pytest.mark.parametrize("function", [nothing, look_up], ids=["empty call", "look-up"])
def test_one_at_a_time(benchmark, function):
    benchmark.group = "look-up table, one at a time"
    arrays, hip, ihip, normal = table().arrays, np.array(AT), np.empty(2), np.empty(2)
    assert look_up(arrays, hip, ihip, normal) == TOUCHES

    def ask():
        for _ in range(CALLS):
            function(arrays, hip, ihip, normal)

    benchmark.pedantic(ask, rounds=20, warmup_rounds=2)
    way = "empty call" if function is nothing else "one look-up"
    keep(benchmark, way, CALLS)
    compare(benchmark, way, "empty call", "times an empty call")


def test_build(benchmark):
    benchmark.group = "look-up table, building 403 x 403 nodes"
    benchmark.pedantic(tabulate, (projection(),), rounds=3, warmup_rounds=1)
    benchmark.extra_info["bytes"] = table().nbytes
