"""Names, variants, defaults, and what is refused."""

import subprocess
import sys
from importlib.metadata import entry_points

import numpy as np
import pytest
from hapticeval.renderers import constraint, minimum_distance

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import cassinian, line, star
from hapticeval.scene import Scene

FAMILIES = {"minimum-distance": minimum_distance, "constraint": constraint}


@pytest.mark.parametrize("name", FAMILIES)
def test_the_entry_point_is_the_factory(name):
    (found,) = entry_points(group="hapticeval.renderers", name=name)
    assert found.load() is FAMILIES[name]


def test_naming_a_renderer_compiles_nothing():
    code = "import sys, hapticeval.renderers; sys.exit('numba' in sys.modules or 'scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("family", FAMILIES.values())
def test_unknown_names_are_refused_with_the_closest(family):
    with pytest.raises(UnknownNameError, match="unknown regulation scheme 'pp-dd'") as caught:
        family.variant(regulation="pp-dd")
    assert "pp-d" in caught.value.todo
    with pytest.raises(UnknownNameError, match="unknown representation 'polygons'") as caught:
        family.variant(representation="polygons")
    assert "polygon" in caught.value.todo


def test_constraint_on_a_level_set_is_refused():
    with pytest.raises(InputError, match="level-set") as caught:
        constraint.variant(representation="level-set")
    assert "boundary to slide on" in caught.value.why
    assert "polygon, curve" in caught.value.todo or "curve, polygon" in caught.value.todo


def test_the_representations_are_those_of_section_4_1_1():
    model = cassinian()
    scene = Scene(model=model)
    on_grid = minimum_distance.variant(representation="level-set")(scene)
    assert on_grid.resolution == model.level_set((100, 100)).cell
    assert 0.0 < on_grid.standoff < 3e-5
    on_polygon = constraint.variant(representation="polygon")(scene)
    assert on_polygon.resolution == model.polygon(40).resolution
    assert on_polygon.standoff == pytest.approx(1.17e-3, abs=5e-6)
    assert on_polygon.surface.pieces.shape[0] == 40


def test_defaults():
    assert (constraint.regulation, constraint.representation) == ("pp", "polygon")
    assert (minimum_distance.regulation, minimum_distance.representation) == ("pp", "curve")


@pytest.mark.parametrize("family", FAMILIES.values())
def test_a_variant_keeps_what_it_is_not_told(family):
    assert family.variant() == family
    assert family.variant(regulation="pp-v").representation == family.representation
    assert family.variant(regulation="pp-v", representation="curve").variant(
        representation="polygon"
    ) == family.variant(regulation="pp-v", representation="polygon")
    for name in family.regulations:
        assert family.variant(regulation=name)(Scene(model=star())).regulation.name == name


@pytest.mark.parametrize("family", FAMILIES.values())
def test_exact_representations_declare_no_standoff(family):
    for model, representation in ((cassinian(), "curve"), (star(), "curve"), (star(), "polygon")):
        renderer = family.variant(representation=representation)(Scene(model=model))
        assert (renderer.resolution, renderer.standoff) == (0.0, 0.0)
        assert renderer.surface is model.curve


@pytest.mark.parametrize("family", FAMILIES.values())
@pytest.mark.parametrize("representation", ["curve", "polygon"])
@pytest.mark.parametrize("bilateral", [False, True])
def test_the_line_is_exact_in_every_representation(family, representation, bilateral):
    renderer = family.variant(representation=representation)(Scene(model=line(), bilateral=bilateral))
    hips = np.array([[0.0, 0.01], [0.5, -0.001], [7.0, -0.3], [-2.0, -0.002], [1.0, 0.002]])
    ihips, forces = renderer.run(hips, 1e-3)
    touches = np.array([bilateral, True, True, True, bilateral])
    np.testing.assert_allclose(ihips, np.where(touches[:, None], hips * (1.0, 0.0), hips), atol=1e-15)
    np.testing.assert_allclose(forces, 1000.0 * (ihips - hips), atol=1e-9)
    assert (renderer.resolution, renderer.standoff) == (0.0, 0.0)


def test_minimum_distance_on_the_level_set_of_a_line_is_exact():
    renderer = minimum_distance.variant(representation="level-set")(Scene(model=line()))
    response = renderer.step(np.array([3.0, -1e-3]), np.zeros(2), 1e-3)
    np.testing.assert_allclose(response.ihip, (3.0, 0.0))
    np.testing.assert_allclose(response.force, (0.0, 1.0))


def test_summaries_cite_the_thesis():
    for family in FAMILIES.values():
        assert "thesis (4." in family.summary
        assert "\n" not in family.summary
