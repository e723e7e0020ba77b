"""Level sets: the nodes, the contour, and what is refused."""

import numpy as np
import pytest

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, from_vertices, line, star


def test_nodes_carry_the_exact_signed_distance_with_a_margin_of_three_cells():
    level_set = star().level_set((30, 40))
    assert level_set.values.shape == (40, 30)
    points = np.column_stack([array.ravel() for array in np.meshgrid(level_set.x, level_set.y)])
    assert np.array_equal(level_set.values.ravel(), star().curve.signed_distance(points))
    level_set = cassinian().level_set((100, 100))
    assert level_set.x[0] + 3 * level_set.cell == pytest.approx(-0.1)
    assert level_set.y[-1] - 3 * level_set.cell == pytest.approx(0.1)
    assert min(level_set.values[0].min(), level_set.values[:, 0].min()) > 0.0
    model = cassinian()
    assert model.level_set((20, 20)) is model.level_set((20, 20))


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
    assert 0.3 * level_set.cell < level_set.contour().standoff_from(model.curve) < 1.5 * level_set.cell


def test_a_contour_through_nodes_has_no_repeated_points():
    square = from_vertices([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    level_set = square.level_set((15, 15))
    assert np.any(level_set.values == 0.0)
    assert level_set.contour().standoff_from(square.curve) < level_set.cell


def test_zero_sets_that_are_not_one_closed_curve_are_refused(refused):
    with refused(InputError):
        dumbbell(neck=0.02).level_set((20, 20)).contour()
    with refused(InputError):
        line().level_set((20, 20)).contour()


def test_a_grid_of_nothing_but_margin_is_refused(refused):
    with refused(InputError):
        circle().level_set((5, 100))
