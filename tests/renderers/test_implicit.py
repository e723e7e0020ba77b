"""Implicit surfaces of Salisbury and Tarr, and distances on a grid: the interpolant, its gradient, what they feel."""

import numpy as np
import pytest
from hand_paths import ticked, walks
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, cube, line, sphere
from hapticeval.renderers.field.catalogue import implicit
from hapticeval.renderers.field.implicit import DistanceGrid
from hapticeval.scene import Scene

GRIDS = [DistanceGrid(cassinian().boundary, 40), DistanceGrid(cube().boundary, 24)]


def led(model, hips, regulation="tracked", representation="exact", **knobs):
    family = implicit.variant(regulation=regulation, representation=representation).with_knobs(**knobs)
    return ticked(family(Scene(model=model)), np.asarray(hips, dtype=float))


@pytest.mark.parametrize("grid", GRIDS, ids=["plane", "space"])
@given(seed=st.integers(0, 2**32 - 1))
def test_the_interpolant_is_scipys_and_its_gradient_the_difference(grid, seed):
    dimension = grid.values.ndim
    axes = [start + grid.cell * np.arange(count) for start, count in zip(grid.origin, grid.values.shape, strict=True)]
    point = np.array(
        [np.random.default_rng(seed + axis).uniform(nodes[0], nodes[-1]) for axis, nodes in enumerate(axes)]
    )
    value, gradient = grid(point)
    assert value == pytest.approx(RegularGridInterpolator(axes, grid.values)(point)[0], abs=1e-15)
    step = 1e-7 * grid.cell
    for axis in range(dimension):
        nudge = step * np.eye(dimension)[axis]
        slope = (grid(point + nudge)[0] - grid(point - nudge)[0]) / (2.0 * step)
        on_a_node = min(abs((point[axis] - axes[axis]) / grid.cell)) < 1e-6
        assert on_a_node or gradient[axis] == pytest.approx(slope, abs=1e-6)


def test_its_error_falls_with_the_square_of_the_cell():
    points = 0.08 * np.column_stack([np.cos(np.arange(200.0)), np.sin(np.arange(200.0))])
    worst = []
    for nodes in (47, 87):  # 40 and 80 cells
        grid = DistanceGrid(circle().boundary, nodes)
        worst.append(max(abs(grid(point)[0] - (np.linalg.norm(point) - 0.1)) for point in points))
    assert worst[1] == pytest.approx(worst[0] / 4.0, rel=0.3)


def test_a_grid_of_a_few_nodes_is_refused(refused):
    with refused(InputError):
        implicit.variant(representation="grid").with_knobs(grid=7.0)(Scene(model=circle()))


@pytest.mark.parametrize("grid", GRIDS, ids=["plane", "space"])
@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
@example(seed=3068826)
def test_the_true_gradient_is_conservative_and_the_unit_normal_is_not_where_the_slope_is_not_one(grid, seed):
    """Round a closed way the work of -K phi grad phi is that of the potential K phi^2 / 2: none."""
    rng = np.random.default_rng(seed)
    model = cassinian() if grid.values.ndim == 2 else cube()
    centre = 0.02 * rng.uniform(-1.0, 1.0, model.dimension)
    angle = np.linspace(0.0, 2.0 * np.pi, 4001)
    hips = np.tile(centre, (angle.size, 1))
    hips[:, 0] += 0.01 * np.cos(angle)
    hips[:, 1] += 0.01 * np.sin(angle)
    _, forces = led(model, hips, "gradient", "grid", grid=float(24 if model.dimension == 3 else 40))
    steps = np.diff(hips, axis=0)
    work = np.sum(0.5 * (forces[1:] + forces[:-1]) * steps)
    crossed = np.sum(np.abs(np.sum(forces[1:] * steps, axis=1)))
    # Along a level of phi nothing crosses but what the force is rounded by, over the way.
    rounding = np.finfo(float).eps * np.sum(np.linalg.norm(forces[1:], axis=1) * np.linalg.norm(steps, axis=1))
    assert abs(work) <= 2e-3 * crossed + rounding


@pytest.mark.parametrize("model", [circle(), sphere()], ids=lambda model: model.name)
@settings(max_examples=20)
@given(hips=walks(most=20))
def test_a_tracked_point_in_a_ball_is_the_nearest(model, hips):
    hips = np.column_stack([hips, 0.3 * hips[:, 0]])[:, : model.dimension]
    inside = 0.06 * hips / np.maximum(np.linalg.norm(hips, axis=1), 0.06)[:, np.newaxis]
    approach = np.linspace(0.13 * inside[0] / np.linalg.norm(inside[0]), inside[0], 50)
    last, first = approach[-1], inside[0]
    turn = np.linspace(0.0, 1.0, 100)[:, np.newaxis]
    path = np.vstack([approach, last + turn * (0.9 * first - last)])
    ihips, _ = led(model, path)
    touch = np.linalg.norm(path, axis=1) < model.size / 2.0
    near = model.boundary.closest_point(path[touch]).foot
    np.testing.assert_allclose(ihips[touch], near, atol=1e-6)


def test_first_contact_is_found_on_the_way_of_the_hand():
    ihips, forces = led(line(), [[0.0, 0.01], [0.02, -0.01], [0.02, 0.001]])
    np.testing.assert_allclose(ihips[1], [0.02, 0.0], atol=1e-12)
    np.testing.assert_allclose(forces[:, 1], [0.0, 10.0, 0.0], atol=1e-9)


def test_a_tracked_point_stays_on_its_side_of_a_medial_axis():
    """Past the middle of a cube's thickness the nearest face is the lower one; the point stays on the upper."""
    hips = np.column_stack([np.zeros(200), np.zeros(200), np.linspace(0.06, -0.02, 200)])
    for representation in ("exact", "grid"):
        tracked, _ = led(cube(), hips, "tracked", representation)
        assert tracked[-1, 2] == pytest.approx(0.05, abs=1e-6)
    nearest, _ = led(cube(), hips, "normal", "exact")
    assert nearest[-1, 2] == pytest.approx(-0.05, abs=1e-6)
