"""Names, variants, knobs, defaults, and what is refused."""

import numpy as np
import pytest
from leading import led

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import cassinian, line, star
from hapticeval.renderer import Knob, choices_of, configured
from hapticeval.renderers import constraint, minimum_distance
from hapticeval.scene import Scene

FAMILIES = {"minimum-distance": minimum_distance, "constraint": constraint}


@pytest.mark.parametrize("family", FAMILIES.values())
def test_unknown_names_are_refused_with_the_closest(refused, family):
    with refused(UnknownNameError):
        family.variant(regulation="pp-dd")
    with refused(UnknownNameError):
        family.variant(representation="polygons")


def test_constraint_on_a_level_set_is_refused(refused):
    with refused(InputError) as caught:
        constraint.variant(representation="level-set")
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
def test_a_variant_keeps_what_it_is_not_given(family):
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


@pytest.mark.parametrize(
    ("family", "representation"),
    [(family, each) for family in FAMILIES.values() for each in family.representations],
)
@pytest.mark.parametrize("bilateral", [False, True])
def test_the_line_is_exact_in_every_representation(family, representation, bilateral):
    renderer = family.variant(representation=representation)(Scene(model=line(), bilateral=bilateral))
    hips = np.array([[0.0, 0.01], [0.5, -0.001], [7.0, -0.3], [-2.0, -0.002], [1.0, 0.002]])
    ihips, forces = led(renderer, hips, 1e-3)
    touches = np.array([bilateral, True, True, True, bilateral])
    np.testing.assert_allclose(ihips, np.where(touches[:, None], hips * (1.0, 0.0), hips), atol=1e-15)
    np.testing.assert_allclose(forces, 1000.0 * (ihips - hips), atol=1e-9)
    assert (renderer.resolution, renderer.standoff) == (0.0, 0.0)


class Foreign:
    """A third party's factory."""

    knobs = {"cells": Knob(values=(1.0, 2.0), unit="mm", meaning="cells")}  # noqa: RUF012

    def __init__(self, cells=1.0):
        self.cells = cells

    def __call__(self, scene):
        return self

    def with_knobs(self, **values):
        return Foreign(**values)


def test_a_third_party_declares_knobs_without_inheriting():
    assert list(choices_of(Foreign()).knobs) == ["cells"]
    assert configured(Foreign(), {"cells": 2.0}, name="mine").cells == 2.0
    assert choices_of(lambda scene: scene).knobs == {}


def test_a_knob_that_is_not_there_is_refused_with_the_closest(refused):
    with refused(UnknownNameError):
        configured(Foreign(), {"cell": 1.0}, name="mine")
    with refused(UnknownNameError):
        configured(lambda scene: scene, {"cell": 1.0}, name="mine")


def test_knobs_that_cannot_be_set_are_refused(refused):
    with refused(InputError):
        choices_of(type("Half", (), {"knobs": Foreign.knobs})())
    with refused(InputError):
        Knob(values=(), unit="", meaning="")


@pytest.mark.parametrize("family", [constraint, minimum_distance])
def test_vertices_set_the_polygon(family):
    on_polygon = family.variant(representation="polygon")
    coarse, fine = (on_polygon.with_knobs(vertices=n)(Scene(model=cassinian())) for n in (40, 160))
    assert coarse.surface.pieces.shape[0] == 40
    assert fine.surface.pieces.shape[0] == 160
    assert fine.standoff < 0.08 * coarse.standoff


def test_the_grid_sets_the_level_set_and_only_there(refused):
    on_grid = minimum_distance.variant(representation="level-set")
    scene = Scene(model=cassinian())
    assert on_grid.with_knobs(grid=50)(scene).resolution > 1.9 * on_grid.with_knobs(grid=100)(scene).resolution
    with refused(UnknownNameError):
        minimum_distance.with_knobs(grid=50)


def test_another_representation_forgets_what_it_has_not():
    set_ = minimum_distance.variant(representation="polygon").with_knobs(vertices=80)
    assert set_.variant(regulation="pp-v").settings == {"vertices": 80}
    assert set_.variant(representation="curve").settings == {}
