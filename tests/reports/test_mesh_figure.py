"""Figures of runs on triangle meshes: the shadow of the solid, and its sharp edges that face the eye."""

import numpy as np
import pytest
import shapely

from hapticeval.geometry.catalogue import make_model
from hapticeval.reports.plane import model_shadow

VIEW = (-100.0, -100.0, 100.0, 100.0)


@pytest.mark.parametrize(
    ("shown", "area", "edges"), [((0, 1), 6400.0, 6), ((0, 2), 10_000.0, 4), ((1, 2), 10_000.0, 7)]
)
def test_an_l_is_drawn_as_its_shadow_with_the_edges_that_are_seen(shown, area, edges):
    parts = shapely.get_parts(model_shadow(make_model("l-block"), shown, VIEW))
    assert shapely.area(parts[0]) == pytest.approx(area)
    assert len(shapely.get_parts(parts[1])) >= edges


def test_a_fine_mesh_of_a_smooth_surface_has_its_outline_alone():
    parts = shapely.get_parts(model_shadow(make_model("icosphere", subdivisions=4), (0, 1), VIEW))
    assert shapely.area(parts[0]) == pytest.approx(np.pi * 100.0**2, rel=2e-3)
    assert parts[-1].is_empty
