"""Models moved: distances, normals and curvature of a model turned, shifted and scaled are those of the model."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import EXACT_MAKERS, from_vertices, make_model
from hapticeval.geometry.motion import Motion, mirroring, rigid_motion, scaling

MOVABLE = ("star", "dumbbell", "circle", "line")
BOUND = tuple(maker.__name__ for maker in EXACT_MAKERS if maker.__name__ not in MOVABLE)

motions = st.builds(
    lambda angle, flip, scale, x, y: Motion(
        rigid_motion(angle, (0.0, 0.0)).matrix @ np.diag([1.0, flip]), scale, np.array([x, y])
    ),
    st.floats(-math.pi, math.pi),
    st.sampled_from([1.0, -1.0]),
    st.floats(0.01, 100.0),
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
)


@given(kind=st.sampled_from(MOVABLE), motion=motions, seed=st.integers(0, 99))
def test_a_plane_model_moves_with_all_that_belongs_to_it(kind, motion, seed):
    model = make_model(kind)
    points = np.random.default_rng(seed).uniform(-0.12, 0.12, (20, 2))
    here, there = model.boundary.closest_point(points), model.moved(motion).boundary.closest_point(motion(points))
    far = 1e-12 * (motion.scale + np.abs(motion.shift).max())
    np.testing.assert_allclose(there.distance, motion.scale * here.distance, atol=far)
    same = np.linalg.norm(there.foot - motion(here.foot), axis=1) <= 1e-6 * motion.scale  # beside ties
    assert same.sum() >= 18
    for corner in model.boundary.corners:  # which has two normals: mirrored, the face before it is the one behind
        same &= np.linalg.norm(here.foot - corner.position, axis=1) > 1e-6
    np.testing.assert_allclose(motion.turned_back(there.normal)[same], here.normal[same], atol=1e-6)
    assert model.moved(motion).size == pytest.approx(motion.scale * model.size, rel=0.5) or kind == "line"


@given(kind=st.sampled_from(BOUND), scale=st.floats(0.01, 100.0), seed=st.integers(0, 99))
def test_a_model_about_the_origin_is_scaled(kind, scale, seed):
    model = make_model(kind)
    size = model.dimension
    points = np.random.default_rng(seed).uniform(-0.12, 0.12, (20, size))
    moved = model.moved(scaling(scale, size))
    here, there = model.boundary.closest_point(points), moved.boundary.closest_point(scale * points)
    np.testing.assert_allclose(there.distance, scale * here.distance, rtol=1e-9, atol=1e-13 * scale)
    np.testing.assert_allclose(there.shape * scale, here.shape, rtol=1e-4, atol=1e-4)
    assert model.moved(rigid_motion(0.3, np.zeros(size))) is None


def same_frames(here, there, motion):
    """Whether two models answer alike, the second in the scene moved."""
    np.testing.assert_allclose(there.distance, motion.scale * here.distance, atol=1e-14)
    np.testing.assert_allclose(motion.back(there.foot), here.foot, atol=1e-13)
    smooth = np.linalg.norm(here.normal - motion.turned_back(there.normal), axis=1) < 1e-9  # at a corner either face's
    assert smooth.mean() > 0.3
    np.testing.assert_allclose(there.shape, motion.matrix @ here.shape @ motion.matrix.T, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("kind", [*MOVABLE, *BOUND, "cube", "l-block"])
def test_every_model_has_a_mirror_image(kind):
    model = make_model(kind)
    mirror = mirroring(model.dimension)
    points = np.random.default_rng(1).uniform(-0.12, 0.12, (40, model.dimension))
    image = model.moved(mirror)
    same_frames(model.boundary.closest_point(points), image.boundary.closest_point(mirror(points)), mirror)
    assert mirror.mirrors
    assert not mirror.is_identity
    again = image.moved(mirror)
    same_frames(
        model.boundary.closest_point(points), again.boundary.closest_point(points), scaling(1.0, points.shape[1])
    )


@pytest.mark.parametrize("kind", ["star", "dumbbell", "cube", "l-block"])
def test_a_model_is_the_same_with_its_vertices_in_another_order(kind):
    model = make_model(kind)
    points = np.random.default_rng(1).uniform(-0.12, 0.12, (40, model.dimension))
    other = model.reordered()
    here = getattr(model.boundary, "pieces", None)
    assert here is None or not np.array_equal(here[:, 3:], other.boundary.pieces[:, 3:])
    same_frames(
        model.boundary.closest_point(points), other.boundary.closest_point(points), scaling(1.0, points.shape[1])
    )


@pytest.mark.parametrize("kind", ["circle", "ellipse", "line", "sphere"])
def test_a_model_of_one_piece_has_no_other_order(kind):
    assert make_model(kind).reordered() is None


@given(motion=motions, seed=st.integers(0, 99))
def test_a_motion_has_a_way_back(motion, seed):
    points = np.random.default_rng(seed).uniform(-1.0, 1.0, (5, 2))
    far = 1e-14 * (motion.scale + np.abs(motion.shift).max()) / motion.scale
    np.testing.assert_allclose(motion.back(motion(points)), points, atol=4.0 * far)


def test_a_motion_in_space_turns_about_an_axis():
    motion = rigid_motion(0.7, np.zeros(3))
    np.testing.assert_allclose(motion(np.array([[1.0, 2.0, 3.0]])), [[1.0, 2.0, 3.0]], atol=1e-14)
    assert np.trace(motion.matrix) == pytest.approx(1.0 + 2.0 * math.cos(0.7))
    assert scaling(1.0, 3).is_identity
    assert not motion.is_identity


@pytest.mark.parametrize(
    "wrong",
    [(np.eye(2), 0.0, np.zeros(2)), (np.eye(2), np.nan, np.zeros(2)), (2.0 * np.eye(2), 1.0, np.zeros(2))],
)
def test_what_is_no_motion_is_refused(refused, wrong):
    with refused(InputError):
        Motion(*wrong)


def test_a_boundary_that_offers_no_motion_has_none():
    class Still:
        name, dimension = "still", 2

    from dataclasses import replace

    model = from_vertices([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    assert replace(model, boundary=Still()).moved(scaling(2.0, 2)) is None
