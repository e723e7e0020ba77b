"""Minimum distance on polygons of the Cassinian: what a point costs, against shapely, by number of edges.

Every test of a group answers the same question for random points around the model. `extra_info` holds the time a
point, how many times faster than shapely the tree is, and how much the tree's cost has grown since 80 edges beside
how much log n has.
"""

import math
from functools import cache

import numpy as np
import pytest
import shapely

from hapticeval.geometry.catalogue import cassinian
from hapticeval.geometry.representations import Polygon

EDGES = (80, 8_000, 80_000)
TREE_POINTS = 50_000
SHAPELY_POINTS = {80: 2_000, 8_000: 200, 80_000: 50}
per_point: dict[tuple[str, int], float] = {}


@cache
def outline(edges: int) -> Polygon:
    return cassinian().polygon(edges)


def points(count: int) -> np.ndarray:
    return np.random.default_rng(4).uniform(-0.12, 0.12, (count, 2))


def keep(benchmark, way: str, edges: int, count: int) -> None:
    if benchmark.stats is None:  # --benchmark-disable
        return
    per_point[way, edges] = benchmark.stats.stats.median / count
    benchmark.extra_info["microseconds a point"] = per_point[way, edges] * 1e6


@pytest.mark.parametrize("edges", EDGES)
def test_shapely_one_at_a_time(benchmark, edges):
    benchmark.group = f"minimum distance, {edges} edges"
    ring = shapely.Polygon(outline(edges).vertices).exterior
    shapely.prepare(ring)
    queries = [shapely.Point(point) for point in points(SHAPELY_POINTS[edges])]

    def ask():
        return [(ring.distance(point), ring.interpolate(ring.project(point))) for point in queries]

    benchmark.pedantic(ask, rounds=5, warmup_rounds=1)
    keep(benchmark, "shapely one at a time", edges, len(queries))


@pytest.mark.parametrize("edges", EDGES)
def test_shapely_vectorised(benchmark, edges):
    benchmark.group = f"minimum distance, {edges} edges"
    ring = shapely.Polygon(outline(edges).vertices).exterior
    shapely.prepare(ring)
    queries = shapely.points(points(SHAPELY_POINTS[edges]))

    def ask():
        return shapely.distance(ring, queries), shapely.line_interpolate_point(
            ring, shapely.line_locate_point(ring, queries)
        )

    benchmark.pedantic(ask, rounds=5, warmup_rounds=1)
    keep(benchmark, "shapely vectorised", edges, len(queries))


@pytest.mark.parametrize("edges", EDGES)
def test_tree(benchmark, edges):
    benchmark.group = f"minimum distance, {edges} edges"
    polygon, queries = outline(edges), points(TREE_POINTS)
    benchmark.pedantic(polygon.nearest, (queries,), rounds=10, warmup_rounds=1)
    keep(benchmark, "tree", edges, TREE_POINTS)
    for way in ("shapely one at a time", "shapely vectorised"):
        if (way, edges) in per_point:
            benchmark.extra_info[f"times faster than {way}"] = per_point[way, edges] / per_point["tree", edges]
    if ("tree", EDGES[0]) in per_point:
        benchmark.extra_info["growth since 80 edges"] = per_point["tree", edges] / per_point["tree", EDGES[0]]
        benchmark.extra_info["growth of log n since 80 edges"] = math.log(edges) / math.log(EDGES[0])
