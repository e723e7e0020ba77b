"""The flow map: what it costs to build, and to look a point up in, each beside a yardstick of the same run.

`extra_info` holds the build on 200 cells as a multiple of one numpy addition of 1e8 elements (the bound is 46: 3 s if
the addition takes 65 ms), the time a point for grids of more and more cells, which is to stay
level, and the step of the renderer from Python.
"""

import time

import numpy as np
import pytest

from hapticeval.geometry.catalogue import cassinian, star
from hapticeval.renderers import mapping
from hapticeval.renderers.maps import flow_map as locator
from hapticeval.renderers.maps.flow import FlowSettings, run_flow
from hapticeval.renderers.maps.flow_map import build_chart, flow_map
from hapticeval.scene import Scene

LOOKUPS = 100_000
per_point: dict[int, float] = {}


@pytest.fixture(scope="module")
def addition() -> float:
    """Seconds of one addition of 1e8 elements, median of three."""
    first, second, out = np.ones(100_000_000), np.ones(100_000_000), np.zeros(100_000_000)
    taken = []
    for _ in range(3):
        start = time.perf_counter()
        np.add(first, second, out=out)
        taken.append(time.perf_counter() - start)
    return sorted(taken)[1]


@pytest.mark.parametrize("model", [cassinian(), star()], ids=["cassinian", "star"])
@pytest.mark.slow
def test_build(benchmark, addition, model):
    benchmark.group = "flow map, 200 cells"
    settings = FlowSettings()
    run_flow(model, FlowSettings(cells=60))  # compiled, and the curve's tables made, outside the clock
    benchmark.pedantic(lambda: build_chart(model, run_flow(model, settings)), rounds=3)
    if benchmark.stats is not None:
        benchmark.extra_info["additions of 1e8 elements"] = benchmark.stats.stats.median / addition


@pytest.mark.parametrize("cells", [50, 100, 200])
def test_look_up(benchmark, cells):
    benchmark.group = "flow map, look-up"
    model = cassinian()
    chart = flow_map(model, FlowSettings(cells=cells)).tables
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (2 * LOOKUPS, 2))
    points = np.ascontiguousarray(points[model.curve.contains(points)][: LOOKUPS // 2])
    benchmark.pedantic(locator.map_to_angles, (chart, points), rounds=5, warmup_rounds=1)
    if benchmark.stats is not None:
        per_point[cells] = benchmark.stats.stats.median / points.shape[0]
        benchmark.extra_info["microseconds a point"] = per_point[cells] * 1e6
        if 50 in per_point:
            benchmark.extra_info["growth since 50 cells"] = per_point[cells] / per_point[50]


def test_step_from_python(benchmark):
    benchmark.group = "mapping, one step from Python"
    renderer = mapping(Scene(model=cassinian()))
    hips = np.random.default_rng(1).uniform(-0.04, 0.04, (1000, 2))
    rest = np.zeros(2)

    def walk():
        for hip in hips:
            renderer.step(hip, rest, 1e-3)

    benchmark.pedantic(walk, rounds=10, warmup_rounds=1)
    if benchmark.stats is not None:
        benchmark.extra_info["microseconds a step"] = benchmark.stats.stats.median / len(hips) * 1e6
