"""The map of a flow: barycentric cells, the locator, one-to-one, and refusals."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, ellipse, star
from hapticeval.renderers.disk import by_flow_map
from hapticeval.renderers.maps import flow_map as locator
from hapticeval.renderers.maps.flow import Flow, FlowSettings, FoldedGridError
from hapticeval.renderers.maps.flow_map import build_chart, flow_map, folded_cells
from hapticeval.scene import Scene

COARSE = FlowSettings(cells=60, lines=100, levels=20)
MODELS = {"cassinian": cassinian(), "star": star(), "hexagram": star(6), "ellipse": ellipse(2.0)}


def inside(model, count, seed=0):
    points = np.random.default_rng(seed).uniform(-0.1, 0.1, (count, 2))
    return points[model.curve.contains(points)]


def grid_of(points, disk):
    """One cell as a grid for `map_in_cell`: two levels of three lines, of which cell 0 is looked at."""
    full, image = np.zeros((2, 3, 2)), np.zeros((2, 3, 2))
    full[0, :2], full[1, :2] = points[:2], (points[3], points[2])
    image[0, :2], image[1, :2] = disk[:2], (disk[3], disk[2])
    return full, image


@settings(max_examples=40)
@given(
    corners=st.lists(st.floats(-0.4, 0.4), min_size=8, max_size=8),
    affine=st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6),
    place=st.tuples(st.floats(0.05, 0.95), st.floats(0.05, 0.95)),
)
def test_the_map_of_a_cell_is_exact_for_affine_maps(corners, affine, place):
    """Convex cells or not: an affine image maps barycentric coordinates to themselves."""
    cell = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) + np.array(corners).reshape(4, 2)
    matrix = np.array(affine[:4]).reshape(2, 2)
    (a, b), (c, d) = matrix
    if folded_cells(grid_of(cell, cell)[0])[0, 0] or a * d - b * c < 0.1:
        return
    image = cell @ matrix.T + affine[4:]
    points, disk = grid_of(cell, image)
    low, high = cell.min(axis=0), cell.max(axis=0)
    x, y = low + np.array(place) * (high - low)
    out_x, out_y, least = locator.map_in_cell(points, disk, 0, x, y)
    if least >= 0.0:
        assert (out_x, out_y) == pytest.approx(tuple(matrix @ (x, y) + affine[4:]), abs=1e-9)


def test_a_cell_that_is_not_convex_is_cut_inside():
    cell = np.array([[0.0, 0.0], [1.0, 0.0], [0.3, 0.3], [0.0, 1.0]])  # an arrow: e is pushed in
    disk = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    points, image = grid_of(cell, disk)
    assert not folded_cells(points)[0, 0]
    for corner, expected in zip(cell, disk, strict=True):
        assert locator.map_in_cell(points, image, 0, *corner)[:2] == pytest.approx(tuple(expected), abs=1e-12)
    assert locator.map_in_cell(points, image, 0, 0.5, 0.5)[2] < 0.0
    assert locator.map_in_cell(points, image, 0, 0.1, 0.6)[2] > 0.0


def test_a_bow_tie_is_folded():
    crossed = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    assert folded_cells(grid_of(crossed, crossed)[0])[0, 0]


@pytest.mark.parametrize("name", MODELS)
def test_the_locator_finds_what_brute_force_finds(name):
    chart = flow_map(MODELS[name], COARSE).tables
    cells = (chart.points.shape[0] - 1) * chart.points.shape[1]
    for x, y in inside(MODELS[name], 150, seed=1).tolist():
        level, disk_x, disk_y = locator.map_to_disk(chart, x, y)
        found = [locator.map_in_cell(chart.points, chart.disk, cell, x, y) for cell in range(cells)]
        best = max(found, key=lambda each: each[2])
        if best[2] > 1e-7:
            assert (disk_x, disk_y) == pytest.approx(best[:2], abs=1e-9)
        else:
            assert level in (locator.OUTSIDE_CELLS, chart.points.shape[0] - 1)


@pytest.mark.parametrize("name", MODELS)
def test_a_valid_grid_is_one_to_one(name):
    """Every point of the disk within the cells has one preimage, found by walking its circle: the cells tile."""
    made = flow_map(MODELS[name], COARSE)
    points, disk = made.tables.points, made.tables.disk
    assert not folded_cells(points).any()
    centres = 0.25 * (points[:-1] + points[1:] + np.roll(points[:-1], -1, 1) + np.roll(points[1:], -1, 1))
    flat = centres.reshape(-1, 2)
    held = [
        sum(locator.map_in_cell(points, disk, cell, x, y)[2] > 1e-6 for cell in range(flat.shape[0]))
        for x, y in flat[:: flat.shape[0] // 40].tolist()
    ]
    assert max(held) == 1
    area = 0.5 * np.abs(
        np.sum(points[0, :, 0] * np.roll(points[0, :, 1], -1) - points[0, :, 1] * np.roll(points[0, :, 0], -1))
    )
    a, b, e, d = points[:-1], np.roll(points[:-1], -1, 1), np.roll(points[1:], -1, 1), points[1:]
    cells = 0.5 * ((e - a)[..., 0] * (d - b)[..., 1] - (e - a)[..., 1] * (d - b)[..., 0])
    last = points[-1] - made.tables.centre
    core = 0.5 * np.sum(last[:, 0] * np.roll(last[:, 1], -1) - last[:, 1] * np.roll(last[:, 0], -1))
    assert cells.sum() + core == pytest.approx(area, rel=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_the_surface_is_mapped_to_itself(name):
    made = flow_map(MODELS[name], COARSE)
    curve = MODELS[name].curve
    u = curve.parameter((np.arange(300) + 0.37) * curve.length / 300)
    hips = curve.position(u) - 1e-7 * curve.normal(u)
    ihips = curve.position(made.surface(made.to_angle(hips)))
    assert np.hypot(*(ihips - hips).T).max() < 0.02 * made.spacing


def test_a_circle_is_projected_radially():
    made = flow_map(circle(), COARSE)
    points = inside(circle(), 300)
    points = points[np.hypot(*points.T) > 0.02]
    ihips = circle().curve.position(made.surface(made.to_angle(points)))
    radial = 0.1 * points / np.hypot(*points.T)[:, np.newaxis]
    assert np.hypot(*(ihips - radial).T).max() < 1e-3


def test_the_sliver_beside_the_grid_is_mapped_too():
    for model in (cassinian(), star()):
        made = flow_map(model, COARSE)
        points = inside(model, 400)
        points = np.vstack([points, model.curve.position(made.tables.us[:50] + 1e-3) * (1.0 - 1e-7)])
        points = np.ascontiguousarray(points[model.curve.contains(points)])
        us = made.surface(made.to_angle(points))
        projected = by_flow_map(Scene(model=model), "curve", cells=60, lines=100, levels=20).trace(points)
        np.testing.assert_allclose(projected.ihip, model.curve.position(us), atol=1e-12)
        start, end = model.curve.u_range
        assert np.all((us >= start) & (us < end))


def test_a_map_is_built_once_for_models_alike():
    assert flow_map(cassinian(), COARSE) is flow_map(cassinian(), COARSE)
    assert flow_map(cassinian(), COARSE) is not flow_map(cassinian(size=0.1), COARSE)


def test_points_off_the_map_are_named(refused):
    made = flow_map(cassinian(), COARSE)
    for bad in ([[0.0, 0.01], [0.3, 0.0]], [[math.nan, 0.0]]):
        with refused(InputError):
            made.to_angle(np.array(bad))


def folded_flow(points):
    times = np.arange(points.shape[0], dtype=float)
    areas = np.linspace(1.0, 0.1, points.shape[0])
    return Flow(points, np.linspace(0, 2 * math.pi, points.shape[1], endpoint=False), times, areas, areas, 0.01)


def test_folded_cells_are_refused_with_their_place(refused):
    angles = np.linspace(0.0, 2.0 * math.pi, 40, endpoint=False)
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    points = 0.1 * np.linspace(1.0, 0.2, 6)[:, np.newaxis, np.newaxis] * rays
    assert build_chart(circle(), folded_flow(points)).points.shape == (6, 40, 2)
    points[3, [7, 9]] = points[3, [9, 7]]
    with refused(FoldedGridError) as caught:
        build_chart(circle(), folded_flow(points))
    assert math.hypot(*caught.value.position) == pytest.approx(0.068)


def test_a_last_level_that_is_no_star_shape_is_refused():
    angles = np.linspace(0.0, 2.0 * math.pi, 40, endpoint=False)
    bean = np.column_stack([np.cos(angles), np.sin(angles) * 0.3 + 0.9 * np.cos(angles) ** 2])
    points = np.array([0.1 * bean, 0.099 * bean])
    with pytest.raises(FoldedGridError):
        build_chart(circle(), folded_flow(points))


def test_a_kept_flow_is_that_of_this_code_of_the_curve(monkeypatch):
    names = []

    def shared_arrays(module, name, make):
        names.append(name)
        raise LookupError(module)

    monkeypatch.setattr(locator, "shared_arrays", shared_arrays)
    for code in ("before", "after", "after"):
        monkeypatch.setattr(locator, "digest_of", lambda module, code=code: code)
        with pytest.raises(LookupError):
            flow_map(circle(size=0.123))
    assert names[0] != names[1] == names[2]
