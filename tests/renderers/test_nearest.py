"""The minimum distance projection on curve, polygon and level set, and on solids."""

import math

import numpy as np
import pytest
from hand_paths import star_shaped, walks
from hypothesis import given, settings
from leading import led
from scipy.interpolate import RegularGridInterpolator

from hapticeval.errors import RefusalError
from hapticeval.geometry.catalogue import (
    cassinian,
    circle,
    dumbbell,
    ellipsoid,
    from_vertices,
    sphere,
    star,
    torus,
)
from hapticeval.renderers import minimum_distance
from hapticeval.renderers.nearest import contour_of
from hapticeval.scene import Scene

MODELS = [star(), cassinian(), circle(), dumbbell()]
exact = minimum_distance.variant(representation="curve")
on_grid = minimum_distance.variant(representation="level-set")


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
@settings(max_examples=25)
@given(hips=walks())
def test_it_is_the_nearest_point_of_the_model(model, hips):
    ihips, _ = led(exact(Scene(model=model, bilateral=True)), hips, 1e-3)
    distances = np.abs(model.curve.signed_distance(hips))
    np.testing.assert_allclose(np.hypot(*(hips - ihips).T), distances, atol=1e-15)


@settings(max_examples=50)
@given(vertices=star_shaped(), hips=walks())
def test_it_is_the_nearest_point_of_a_polygon(vertices, hips):
    model = from_vertices(vertices)
    ihips, _ = led(exact(Scene(model=model)), hips, 1e-3)
    depth = np.maximum(-model.curve.signed_distance(hips), 0.0)
    np.testing.assert_allclose(np.hypot(*(hips - ihips).T), depth, atol=1e-15)


def test_a_convex_corner_pops_at_its_bisector():
    model, depth = star(), 1e-3
    tip = next(corner for corner in model.curve.corners if corner.convex)
    along = np.linspace(-0.01, 0.0, 2001)
    hips = tip.position + along[:, None] * tip.tangent_pre - depth * tip.normal_pre
    ihips, _ = led(exact(Scene(model=model)), hips, 1e-3)
    jumps = np.hypot(*np.diff(ihips, axis=0).T)
    # the bisector of a 60 degree tip is met at depth d where the tip is d / tan 30 degrees away
    assert along[np.argmax(jumps)] == pytest.approx(-depth / math.tan(math.pi / 6.0), abs=1e-5)
    assert np.max(jumps) == pytest.approx(math.sqrt(3.0) * depth, rel=0.01)


@pytest.mark.parametrize(
    ("model", "off"), [(cassinian(), 3e-5), (circle(), 1e-5), (star(), 2.4e-3)], ids=lambda m: getattr(m, "name", "")
)
def test_the_level_set_lies_off_the_model_by_what_it_declares(model, off):
    renderer = on_grid(Scene(model=model, bilateral=True))
    rng = np.random.default_rng(3)
    ihips, _ = led(renderer, rng.uniform(-0.1, 0.1, (20_000, 2)), 1e-3)
    assert np.max(np.abs(model.curve.signed_distance(ihips))) <= renderer.standoff * 1.001
    # at the sharpest place of the model, a tip, its own surface is farthest from the contour
    points = model.curve.outline(20_000)
    farthest = np.max(np.abs(renderer.surface.signed_distance(points)))
    assert farthest == pytest.approx(renderer.standoff, rel=0.2)
    assert renderer.standoff < off


def interpolant(level_set):
    """The bilinear interpolant of rows (y, x); NaN off the grid."""
    return RegularGridInterpolator((level_set.y, level_set.x), level_set.values, bounds_error=False)


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
def test_the_contour_is_the_zero_of_the_interpolant_and_the_nearest_one(model):
    level_set = model.level_set()
    renderer = on_grid(Scene(model=model, bilateral=True))
    rng = np.random.default_rng(4)
    hips = rng.uniform(-0.09, 0.09, (3000, 2))
    ihips, _ = led(renderer, hips, 1e-3)
    assert np.max(np.abs(interpolant(level_set)(ihips[:, ::-1]))) < 1e-15
    _, outline = contour_of(level_set)
    far = np.hypot(*(hips - ihips).T)
    # cutting arcs into chords takes a corner off: the outline is no nearer, but for what the chords stray
    np.testing.assert_allclose(far, np.abs(outline.signed_distance(hips)), atol=5e-6)
    # and between the ends of each arc the interpolant is level: nothing on it is nearer
    points = outline.vertices
    nearest = np.min(np.hypot(points[:, 0] - hips[:200, :1], points[:, 1] - hips[:200, 1:]), axis=1)
    assert np.all(far[:200] <= nearest + 5e-6)


def test_contact_on_the_level_set_begins_where_the_interpolant_is_negative():
    model = star()
    renderer = on_grid(Scene(model=model))
    rng = np.random.default_rng(5)
    hips = rng.uniform(-0.1, 0.1, (5000, 2))
    ihips, _ = led(renderer, hips, 1e-3)
    value = interpolant(model.level_set())(hips[:, ::-1])
    clear = ~(np.abs(value) < 1e-15)  # NaN off the grid
    np.testing.assert_array_equal(np.any(hips != ihips, axis=1)[clear], value[clear] < 0.0)


def test_a_hand_off_the_grid_is_in_free_space():
    renderer = on_grid(Scene(model=star()))
    response = renderer.step(np.array([5.0, -7.0]), np.zeros(2), 1e-3)
    np.testing.assert_array_equal(response.ihip, (5.0, -7.0))
    np.testing.assert_array_equal(response.force, (0.0, 0.0))


SLIT = [[0, 0], [0.1, 0], [0.1, 0.1], [0.05 + 1e-9, 0.1], [0.05 + 1e-9, 0.03], [0.05, 0.03], [0.05, 0.1], [0, 0.1]]


@pytest.mark.parametrize(
    "model",
    [
        star(tip_angle=1.0),
        dumbbell(neck=1e-6),
        from_vertices([[0.0, 0.0], [0.1, 0.0], [0.05, 1e-9]]),
        from_vertices(SLIT),
    ],
    ids=["tip of 1 degree", "neck of 1e-6", "flat triangle", "slit of 1 nm"],
)
def test_a_part_that_a_level_set_cannot_hold_is_refused(refused, model):
    with refused(RefusalError):
        minimum_distance.variant(representation="level-set")(Scene(model=model))
    minimum_distance(Scene(model=model))


def test_a_level_set_holds_a_triangle_however_it_is_turned():
    """Its tip of 48 degrees is narrower than the diagonal of a cell for 1.61 cells, which may leave islands.

    A quarter of a turn lays it on the grid's cells as it was.
    """
    corners = np.array([[-0.06, -0.02], [0.09, -0.03], [0.01, 0.07]])
    for angle in np.radians([0.0, 15.0, 45.0, 70.0]):
        c, s = math.cos(angle), math.sin(angle)
        model = from_vertices(corners @ np.array([[c, s], [-s, c]]))
        renderer = minimum_distance.variant(representation="level-set")(Scene(model=model))
        assert 0.0 < renderer.standoff < 1.61 * renderer.resolution
        tips = model.curve.outline(4000)
        inside = tips + 1e-4 * (np.mean(tips, axis=0) - tips)
        ihips, _ = led(renderer, inside, 1e-3)
        held = np.any(ihips != inside, axis=1)
        assert np.max(np.abs(renderer.surface.signed_distance(ihips[held]))) < 5e-6
        np.testing.assert_array_equal(held, renderer.surface.signed_distance(inside) < 0.0)


SOLIDS = [sphere(), ellipsoid(), torus()]
every = pytest.mark.parametrize("model", SOLIDS, ids=lambda m: m.name)


def a_walk(n=2000, seed=1):
    """A smooth path in and out of every model."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 2.0 * math.pi, n)
    waves = [rng.normal(size=3) * np.sin(k * t[:, None] + rng.uniform(0.0, 6.0, 3)) for k in (1, 2, 3)]
    return 0.06 * np.sum(waves, axis=0)


@every
@pytest.mark.parametrize("bilateral", [False, True])
def test_it_is_the_nearest_point_of_a_solid(model, bilateral):
    hips = a_walk()
    renderer = minimum_distance(Scene(model=model, bilateral=bilateral))
    ihips, forces = led(renderer, hips, 1e-3)
    foot, _, distance, _ = model.surface.closest_point(hips)
    touches = bilateral | (distance < 0.0)
    assert 100 < np.count_nonzero(distance < 0.0) < 1900
    np.testing.assert_allclose(ihips[touches], foot[touches], atol=1e-16)
    np.testing.assert_array_equal(ihips[~touches], hips[~touches])
    np.testing.assert_array_equal(forces[~touches], 0.0)
    np.testing.assert_allclose(forces[touches], 1000.0 * (foot - hips)[touches], atol=1e-12)
    assert renderer.surface is model.surface
    assert renderer.resolution == renderer.standoff == 0.0


def test_pp_pd_on_the_sphere():
    # K_p = 1000 at 10 mm depth: 10 N outwards; inwards at 0.2 m/s against K_d = 5: 1 N more; along the surface nothing
    renderer = minimum_distance.variant(regulation="pp-pd")(Scene(model=sphere(), damping=5.0))
    renderer.reset(np.array([0.0, 0.09, 0.0]))
    ihip, force = renderer.step(np.array([0.0, 0.09, 0.0]), np.array([0.3, -0.2, 0.0]), 1e-3)
    np.testing.assert_allclose(ihip, [0.0, 0.1, 0.0], atol=1e-17)
    np.testing.assert_allclose(force, [0.0, 11.0, 0.0], atol=1e-12)
