"""The conformal map: building it, a table of 401 x 401 IHIPs through it, and a tick.

`extra_info` holds the times beside a sum of two arrays of 1e8 numbers in the same run, on the same core: the target
for building the map and filling the table is 0.3 s on a machine whose sum takes 0.12 s, a ratio of 2.5.
"""

import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hapticeval.geometry.catalogue import cassinian, star
from hapticeval.renderers import conformal
from hapticeval.renderers.disk import by_conformal_map
from hapticeval.renderers.maps.conformal import conformal_map
from hapticeval.scene import Scene

TARGET = 2.5
MODELS = {"cassinian": cassinian(), "star": star()}
CASES = [("cassinian", 512), ("cassinian", 1024), ("star", 640)]


@cache
def sum_of_many() -> float:
    """Seconds of one sum of 1e8 numbers each, into memory that has been written before."""
    first, second = np.ones(100_000_000), np.ones(100_000_000)
    total = np.empty_like(first)
    times = []
    for _ in range(4):
        started = time.perf_counter()
        np.add(first, second, out=total)
        times.append(time.perf_counter() - started)
    return min(times)


@pytest.fixture(scope="module")
def grid() -> np.ndarray:
    axis = np.linspace(-0.1, 0.1, 401)
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


def keep(benchmark) -> None:
    if benchmark.stats is not None:
        benchmark.extra_info["sums of 1e8"] = benchmark.stats.stats.median / sum_of_many()


@pytest.mark.parametrize(("name", "nodes"), CASES)
def test_build(benchmark, name, nodes):
    benchmark.group = "conformal, build"
    benchmark.pedantic(conformal_map, (MODELS[name].curve,), {"nodes": nodes}, rounds=5, warmup_rounds=1)
    keep(benchmark)


@pytest.mark.parametrize(("name", "nodes"), CASES)
def test_build_and_table(benchmark, name, nodes, grid):
    benchmark.group = f"conformal, build and table; target {TARGET} sums"
    model = MODELS[name]

    def build_with_table():
        anew = replace(model)  # the map is kept as long as the model
        return by_conformal_map(Scene(model=anew), "curve", nodes=nodes).trace(grid)

    benchmark.pedantic(build_with_table, rounds=5, warmup_rounds=1)
    keep(benchmark)


@pytest.mark.parametrize("name", MODELS)
def test_step(benchmark, name):
    benchmark.group = "conformal, one tick"
    model = MODELS[name]
    renderer = conformal(Scene(model=model))
    points = np.random.default_rng(4).uniform(-0.1, 0.1, (4000, 2))
    points, still = points[model.curve.contains(points)][:1000], np.zeros(2)

    def ticks():
        return [renderer.step(point, still, 1e-3) for point in points]

    benchmark.pedantic(ticks, rounds=10, warmup_rounds=1)
    if benchmark.stats is not None:
        benchmark.extra_info["microseconds a tick"] = benchmark.stats.stats.median / len(points) * 1e6
