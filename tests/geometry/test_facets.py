"""Models as edges and triangles, with the error that this makes."""

import math

import numpy as np
import pytest

from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.catalogue import (
    cassinian,
    circle,
    cube,
    dumbbell,
    ellipse,
    ellipsoid,
    line,
    sphere,
    star,
    torus,
)
from hapticeval.geometry.model import Model
from hapticeval.geometry.representations import HALF_PLANE_EXTENT, MOST_CELLS

SMOOTH = {
    "circle": circle(),
    "cassinian": cassinian(),
    "dumbbell": dumbbell(neck=0.1),
    "flat ellipse": ellipse(ratio=20.0),
    "sphere": sphere(),
    "ellipsoid": ellipsoid(),
    "torus": torus(),
    "thin torus": torus(major=0.1, minor=0.005),
}


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("max_error", [2e-3, 2e-4])
def test_the_facets_lie_off_the_model_by_no_more_than_they_state(name: str, max_error: float) -> None:
    model = SMOOTH[name]
    facets = model.mesh(max_error=max_error)
    assert facets.chord_error <= max_error
    assert facets.cells.shape[1] == facets.vertices.shape[1] == model.dimension
    assert model.boundary.signed_distance(facets.vertices) == pytest.approx(0.0, abs=1e-15)
    from_mesh = np.abs(model.boundary.signed_distance(facets.boundary.points(20_000))).max()
    from_model = np.abs(facets.boundary.signed_distance(model.boundary.points(20_000))).max()
    assert 0.8 * facets.chord_error < max(from_mesh, from_model) <= facets.chord_error
    assert model.mesh(max_error=max_error) is facets


@pytest.mark.parametrize(("model", "share"), [(circle(), 1e-4), (sphere(), 1e-3)])
def test_without_an_error_the_facets_are_fine_by_the_size(model, share):
    assert 0.0 < model.mesh().chord_error <= share * model.size


@pytest.mark.parametrize("name", ["circle", "cassinian", "torus"])
def test_no_more_facets_are_made_than_the_error_asks_for(name: str) -> None:
    coarse, fine = (SMOOTH[name].mesh(max_error=error) for error in (4e-3, 4e-5))
    assert fine.chord_error > 0.8 * 4e-5
    assert len(fine.cells) / len(coarse.cells) < 1.5 * 100 ** (0.5 * (SMOOTH[name].dimension - 1))


def test_the_error_of_a_circle_and_a_sphere_is_the_sagitta() -> None:
    facets = circle().mesh(max_error=1e-4)
    assert facets.chord_error == pytest.approx(0.1 * (1.0 - math.cos(math.pi / len(facets.cells))), rel=1e-9)
    facets = sphere().mesh(max_error=1.2e-4)
    middles = facets.vertices[facets.cells].mean(axis=1)
    # Its flattest triangle is equilateral: the middle of its plane is nearest to the centre.
    assert facets.chord_error == pytest.approx(0.1 - np.linalg.norm(middles, axis=1).min(), rel=0.03)


@pytest.mark.parametrize("model", [star(), cube()], ids=["star", "cube"])
def test_straight_models_are_their_own(model: Model) -> None:
    facets = model.mesh(max_error=1e-9)
    assert facets.chord_error == 0.0
    assert model.boundary.signed_distance(facets.boundary.points(100)) == pytest.approx(0.0, abs=1e-16)


def test_edges_run_with_the_inside_on_their_left() -> None:
    facets = cassinian().mesh(max_error=1e-3)
    start, end = facets.vertices[facets.cells.T]
    left = np.column_stack([start[:, 1] - end[:, 1], end[:, 0] - start[:, 0]])
    assert np.all(cassinian().boundary.signed_distance(0.5 * (start + end) + 0.2 * left) < 0.0)


def test_a_half_plane_is_cut_off_far_away() -> None:
    facets = line().mesh(max_error=1e-3)
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (100, 2))
    for ours, its in zip(facets.boundary.closest_point(points), line().boundary.closest_point(points), strict=True):
        assert ours == pytest.approx(its, abs=1e-13)
    assert facets.chord_error == 0.0
    assert np.ptp(facets.vertices, axis=0) == pytest.approx([2 * HALF_PLANE_EXTENT, 2 * HALF_PLANE_EXTENT])


@pytest.mark.parametrize("max_error", [0.0, -1.0, math.nan])
def test_an_error_has_to_be_positive(refused, max_error: float) -> None:
    with refused(InputError):
        circle().mesh(max_error=max_error)


def test_what_takes_too_many_facets_is_refused(refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MOST_CELLS, 2, 500)
    with refused(InputError):
        circle().mesh(max_error=1e-8)


def test_a_boundary_of_another_kind_is_refused(refused) -> None:
    class Own:
        pass

    with refused(RefusalError):
        Model("own", {}, Own()).mesh(max_error=1e-3)  # type: ignore[arg-type]
