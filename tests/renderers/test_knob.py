"""Knobs: found on any factory by name, set, and refused when a renderer does not have them."""

import pytest

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import cassinian
from hapticeval.knob import Knob
from hapticeval.renderer import choices_of, configured
from hapticeval.renderers import constraint, minimum_distance
from hapticeval.scene import Scene


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


def test_a_knob_that_is_not_there_is_refused_with_the_closest():
    with pytest.raises(UnknownNameError, match="unknown knob of mine 'cell'") as caught:
        configured(Foreign(), {"cell": 1.0}, name="mine")
    assert "cells" in caught.value.todo
    with pytest.raises(UnknownNameError, match="unknown knob of mine 'cell'") as caught:
        configured(lambda scene: scene, {"cell": 1.0}, name="mine")
    assert "none" in caught.value.todo


def test_knobs_that_cannot_be_set_are_refused():
    with pytest.raises(InputError, match="cannot set them"):
        choices_of(type("Half", (), {"knobs": Foreign.knobs})())
    with pytest.raises(InputError, match="without values"):
        Knob(values=(), unit="", meaning="")


@pytest.mark.parametrize("family", [constraint, minimum_distance])
def test_vertices_set_the_polygon(family):
    on_polygon = family.variant(representation="polygon")
    coarse, fine = (on_polygon.with_knobs(vertices=n)(Scene(model=cassinian())) for n in (40, 160))
    assert coarse.surface.pieces.shape[0] == 40
    assert fine.surface.pieces.shape[0] == 160
    assert fine.standoff < 0.08 * coarse.standoff


def test_the_grid_sets_the_level_set_and_only_there():
    on_grid = minimum_distance.variant(representation="level-set")
    scene = Scene(model=cassinian())
    assert on_grid.with_knobs(grid=50)(scene).resolution > 1.9 * on_grid.with_knobs(grid=100)(scene).resolution
    with pytest.raises(UnknownNameError, match="knob of the curve representation 'grid'"):
        minimum_distance.with_knobs(grid=50)


def test_another_representation_forgets_what_it_has_not():
    set_ = minimum_distance.variant(representation="polygon").with_knobs(vertices=80)
    assert set_.variant(regulation="pp-v").settings == {"vertices": 80}
    assert set_.variant(representation="curve").settings == {}
