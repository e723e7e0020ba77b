"""Level sets: the interpolant, its gradient, the contour, and what is refused."""

import math

import numpy as np
import pytest

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, from_vertices, line, star
from hapticeval.geometry.level_set import LevelSet


def test_nodes_carry_the_exact_signed_distance():
    level_set = star().level_set((30, 40))
    assert level_set.values.shape == (40, 30)
    points = np.column_stack([array.ravel() for array in np.meshgrid(level_set.x, level_set.y)])
    assert level_set.values.ravel() == pytest.approx(star().curve.signed_distance(points), abs=1e-16)
    assert level_set.value(points) == pytest.approx(level_set.values.ravel(), abs=1e-15)


def test_the_grid_covers_the_model_with_a_margin_of_three_cells():
    level_set = cassinian().level_set((100, 100))
    assert level_set.x[0] + 3 * level_set.cell == pytest.approx(-0.1)
    assert level_set.y[-1] - 3 * level_set.cell == pytest.approx(0.1)
    assert min(level_set.values[0].min(), level_set.values[:, 0].min()) > 0.0


def test_bilinear_functions_are_reproduced():
    x, y = np.linspace(-1.0, 1.0, 9), np.linspace(0.0, 1.0, 6)
    gx, gy = np.meshgrid(x, y)
    level_set = LevelSet(x, y, 1.0 + 2.0 * gx - 3.0 * gy)
    points = np.random.default_rng(0).uniform([-1.0, 0.0], [1.0, 1.0], (100, 2))
    assert level_set.value(points) == pytest.approx(1.0 + 2.0 * points[:, 0] - 3.0 * points[:, 1])
    assert level_set.gradient(points) == pytest.approx(np.tile([2.0, -3.0], (100, 1)))
    assert level_set.cell == pytest.approx(0.25)


def test_the_gradient_is_that_of_the_interpolant():
    level_set = cassinian().level_set((40, 40))
    points = np.random.default_rng(1).uniform(-0.1, 0.1, (200, 2))
    step = 1e-9
    for axis in (0, 1):
        offset = np.zeros(2)
        offset[axis] = step
        slope = (level_set.value(points + offset) - level_set.value(points - offset)) / (2 * step)
        assert level_set.gradient(points)[:, axis] == pytest.approx(slope, abs=1e-6)


def test_the_gradient_at_the_surface_is_the_normal():
    curve = cassinian().curve
    u = np.linspace(0.0, 6.0, 50)
    gradient = cassinian().level_set((400, 400)).gradient(curve.position(u))
    cosine = np.sum(gradient * curve.normal(u), axis=1) / np.hypot(*gradient.T)
    assert np.degrees(np.arccos(np.min(cosine))) < 2.0


def test_the_contour_of_a_smooth_model_is_of_second_order():
    """The largest error at 50, 100 and 200 nodes is .14, .03 and .007 mm."""
    model = cassinian()
    errors = [model.level_set((n, n)).contour().standoff_from(model.curve) for n in (50, 100, 200)]
    assert errors[1] < 4e-5
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0


def test_the_contour_of_a_star_loses_less_than_a_cell_and_a_half_at_the_tips():
    model = star()
    level_set = model.level_set((100, 100))
    error = level_set.contour().standoff_from(model.curve)
    assert 0.3 * level_set.cell < error < 1.5 * level_set.cell


def test_a_contour_through_nodes_has_no_repeated_points():
    square = from_vertices([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    level_set = square.level_set((15, 15))
    assert np.any(level_set.values == 0.0)
    assert level_set.contour().standoff_from(square.curve) < level_set.cell


def test_a_neck_thinner_than_a_cell_falls_apart():
    with pytest.raises(InputError, match=r"(?s)2 components.*refine the grid"):
        dumbbell(neck=0.02).level_set((20, 20)).contour()


def test_a_half_plane_has_no_closed_contour():
    level_set = line().level_set((20, 20))
    assert level_set.value([[0.03, -0.02]]) == pytest.approx([-0.02])
    with pytest.raises(InputError, match="runs off the grid"):
        level_set.contour()


def test_points_off_the_grid_are_named():
    level_set = circle().level_set((20, 20))
    points = [[0.0, 0.0], [1.0, 0.0]]
    assert level_set.inside_grid(points).tolist() == [True, False]
    for ask in (level_set.value, level_set.gradient):
        with pytest.raises(InputError, match="row 1"):
            ask(points)
    corner = [[level_set.x[-1], level_set.y[-1]]]
    assert level_set.value(corner) == pytest.approx([level_set.values[-1, -1]])


@pytest.mark.parametrize(
    ("x", "y", "values", "message"),
    [
        ([0, 1], [0, 1, 2], np.zeros((2, 3)), r"values are \(ny, nx\)"),
        ([0, 1], [0, 1], [[0, math.nan], [0, 0]], "not finite"),
        ([0, 1, 3], [0, 1], np.zeros((2, 3)), "equal steps"),
        ([1, 0], [0, 1], np.zeros((2, 2)), "equal steps"),
        ([0], [0, 1], np.zeros((2, 1)), "equal steps"),
    ],
)
def test_grids_that_do_not_fit_are_refused(x, y, values, message):
    with pytest.raises(InputError, match=message):
        LevelSet(np.array(x, float), np.array(y, float), np.array(values, float))


def test_a_grid_of_nothing_but_margin_is_refused():
    with pytest.raises(InputError, match="at least 8"):
        circle().level_set((5, 100))
