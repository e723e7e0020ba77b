"""A front that is followed by points: its laws, its order, and that the flow on a grid tends to it."""

from __future__ import annotations

import numpy as np
import pytest

from hapticeval.discovery import resolve
from hapticeval.errors import RefusalError
from hapticeval.geometry.catalogue import cassinian, circle, make_model, star
from hapticeval.renderers.maps import front as front_module
from hapticeval.renderers.maps.flow import FlowSettings, line_starts
from hapticeval.renderers.maps.flow_map import FlowMap, build_chart, flow_map
from hapticeval.renderers.maps.front import advance_to, track_front
from hapticeval.study.bench.accuracy import reference_of, workload

MODEL = cassinian(size=0.2)


def angles_of(model, nodes, points):
    """Where points (n, 2), m, go on the disk, rad."""
    return FlowMap(model.curve, build_chart(model, track_front(model, nodes))).to_angle(points)


@pytest.fixture(scope="module")
def points():
    """Points in a lobe and beside its axis, m."""
    return np.array([[0.04, 0.003], [0.06, 0.02], [0.068, -0.0026], [0.02, 0.05], [-0.03, 0.04]])


def test_a_circle_keeps_its_shape_and_shrinks_at_half_a_metre_a_metre():
    flow = track_front(circle(size=0.2), 200)
    # kappa is its own average: v = 1/2 by (5.14)
    radii = np.linalg.norm(flow.points, axis=2)
    assert np.ptp(radii, axis=1).max() < 1e-12
    np.testing.assert_allclose(radii[:, 0], 0.1 - 0.5 * flow.times, rtol=1e-3)


def test_a_front_that_is_kept_is_that_of_its_own_start(monkeypatch):
    first = track_front(MODEL, 200)
    monkeypatch.setattr(front_module, "line_starts", lambda model, nodes: line_starts(model, nodes) + 0.01)
    assert np.array_equal(track_front(MODEL, 200).u, first.u + 0.01)


def test_nodes_stay_at_equal_distances_and_a_front_ends_at_the_area_it_is_asked_for():
    model = MODEL
    front = np.ascontiguousarray(model.curve.position(track_front(model, 400).u))
    lines = np.arange(400.0)
    advance_to(front, lines, 0.012)
    after = np.roll(front, -1, axis=0)
    steps = np.linalg.norm(after - front, axis=1)
    assert np.ptp(steps) < 1e-2 * steps.mean(), "without w they would differ by five times"
    area = 0.5 * np.sum(front[:, 0] * after[:, 1] - front[:, 1] * after[:, 0])
    assert area == pytest.approx(0.012, rel=1e-9)
    assert np.all(np.diff(lines) > 0.0), "lines keep their order"


def test_errors_fall_with_the_square_of_the_distance_of_nodes(points):
    coarse, middle, fine = (angles_of(MODEL, nodes, points) for nodes in (200, 400, 800))
    ratio = np.linalg.norm(middle - coarse) / np.linalg.norm(fine - middle)
    assert 3.0 < ratio < 5.0


def test_the_flow_on_a_grid_tends_to_it(points):
    exact = angles_of(MODEL, 800, points)
    off = [np.abs(flow_map(MODEL, FlowSettings(cells=cells)).to_angle(points) - exact).max() for cells in (50, 100)]
    assert off[1] < off[0] < 0.02


@pytest.mark.parametrize("model", [star(size=0.2), make_model("line")])
def test_a_model_with_corners_or_without_end_is_refused(refused, model):
    with refused(RefusalError):
        track_front(model, 200)


def test_the_bench_counts_from_it_where_it_can_and_tells_its_error():
    work = workload("cassinian", points=20, seed=0)
    reference = reference_of("mapping", resolve("mapping"), work, quick=True)
    assert "another computation with 800 nodes" in reference.what
    assert reference.extrapolated
    assert 0.0 < reference.disagreement["ihip"]["max"] < 3e-5
    assert resolve("mapping").reference.reference is None
