"""Sphere, ellipsoid and torus: nearest points, shape operators and their derivatives against their definitions."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.errors import RefusalError
from hapticeval.geometry.catalogue import circle, ellipsoid, sphere, torus
from hapticeval.geometry.surface import Surface, shape_operator_change

MODELS = [
    sphere(0.2),
    ellipsoid(0.1, 0.07, 0.05),
    ellipsoid(0.05, 0.1, 0.1),
    ellipsoid(0.05, 0.1, 0.05),
    torus(0.07, 0.03),
    torus(0.1, 0.01),
]
every = pytest.mark.parametrize(
    "surface", [m.surface for m in MODELS], ids=[f"{m.name}{tuple(m.surface.reals)}" for m in MODELS]
)
NUMBER = st.floats(-0.2, 0.2).map(lambda x: round(x, 4))
POINTS = st.lists(st.tuples(NUMBER, NUMBER, NUMBER), min_size=1, max_size=20).map(np.array)


def implicit(surface, points):
    """Negative inside, zero on the surface; without a unit."""
    x, y, z = np.asarray(points).T
    if surface.kind == "torus":
        major, minor = surface.reals
        return np.hypot(np.hypot(x, y) - major, z) / minor - 1.0
    a, b, c = surface.reals * (3 if surface.kind == "sphere" else 1)
    return np.sqrt((x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2) - 1.0


def points_and_tangents(surface, seed=1):
    """Points of the surface, and a random tangent vector at each."""
    points = surface.points(60)
    normal = surface.closest_point(points).normal
    v = np.random.default_rng(seed).normal(size=points.shape)
    return points, v - np.sum(v * normal, axis=1)[:, None] * normal


def shape_derivative(surface, points, directions):
    """∇_v W (n, 3, 3), 1/m^2, at the feet of points (n, 3), with v the tangent part of `directions` (n, 3)."""
    foot, normal, _, _ = surface.closest_point(points)
    out = np.empty((len(foot), 3, 3))
    for i, (p, n, v) in enumerate(zip(foot, normal, directions, strict=True)):
        for k, unit in enumerate(np.eye(3)):
            along = (tuple((v - v @ n * n).tolist()), tuple((unit - n[k] * n).tolist()))
            out[i, k] = shape_operator_change(surface.row, tuple(p.tolist()), tuple(n.tolist()), *along)
    return out


@every
@settings(max_examples=50)
@given(points=POINTS)
def test_the_foot_is_on_the_surface_and_nothing_on_it_is_nearer(surface, points):
    foot, normal, distance, shape = surface.closest_point(points)
    size = max(surface.reals)
    np.testing.assert_allclose(implicit(surface, foot), 0.0, atol=1e-14)
    np.testing.assert_allclose(foot + distance[:, None] * normal, points, atol=4e-16)
    clear = np.abs(distance) > 1e-15 * size  # nearer than that, rounding decides
    assert np.array_equal(np.sign(distance[clear]), np.sign(implicit(surface, points)[clear]))
    nearest = np.linalg.norm(points[:, None] - surface.points(4000), axis=2).min(axis=1)
    assert np.all(np.abs(distance) <= nearest + 1e-15 * size)
    assert np.array_equal(shape, np.swapaxes(shape, 1, 2))


@every
def test_the_normal_is_the_gradient_of_the_distance(surface):
    points = np.random.default_rng(2).uniform(-0.15, 0.15, (300, 3))
    _, normal, distance, _ = surface.closest_point(points)
    inward, outward = surface.medial_distance(points).T
    clear = (distance + inward > 1e-4) & (outward - distance > 1e-4)
    assert np.count_nonzero(clear) > 200
    for axis, step in enumerate(1e-6 * np.eye(3)):
        slope = (surface.signed_distance(points + step) - surface.signed_distance(points - step)) / 2e-6
        np.testing.assert_allclose(slope[clear], normal[clear, axis], atol=1e-6)


@every
def test_the_shape_operator_turns_the_normal_and_its_derivative_turns_it(surface):
    points, v = points_and_tangents(surface)
    _, normal, _, shape = surface.closest_point(points)
    h, size = 1e-5 * min(surface.reals), np.abs(shape).max()
    before, after = surface.closest_point(points - h * v), surface.closest_point(points + h * v)
    turned = (after.normal - before.normal) / (2.0 * h)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", shape, v), turned, rtol=1e-6, atol=1e-6 * size)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", shape, normal), 0.0, atol=1e-14 * size)
    tangential = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    found, change = shape_derivative(surface, points, v), (after.shape - before.shape) / (2.0 * h)
    np.testing.assert_allclose(found, tangential @ change @ tangential, atol=1e-6 * size**2)
    np.testing.assert_allclose(found, np.swapaxes(found, 1, 2), atol=1e-13 * size**2)
    np.testing.assert_allclose(shape_derivative(surface, points, v + 3.0 * normal), found, atol=1e-13 * size**2)
    _, w = points_and_tangents(surface, seed=5)  # Codazzi: alike in both directions
    other = np.einsum("nij,nj->ni", shape_derivative(surface, points, w), v)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", found, w), other, atol=1e-12 * size**2)


@every
@pytest.mark.parametrize("factor", [1e-3, 7.0, 1e20])
def test_all_of_it_scales(surface, factor):
    larger = Surface(surface.name, surface.kind, tuple(factor * each for each in surface.reals))
    points = np.random.default_rng(3).uniform(-0.12, 0.12, (100, 3))
    here, there = surface.closest_point(points), larger.closest_point(factor * points)
    for k, (one, other) in enumerate(zip(here, there, strict=True)):
        scale = factor ** (1, 0, 1, -1)[k]
        np.testing.assert_allclose(other, scale * one, atol=1e-12 * scale * np.abs(one).max())


@every
def test_the_medial_set_is_where_another_foot_is_as_near(surface):
    points = surface.points(200)
    _, normal, _, shape = surface.closest_point(points)
    for side, reach in zip((-1.0, 1.0), surface.medial_distance(points).T, strict=True):
        near = np.isfinite(reach)
        assert near.all() or (side > 0.0 and near.any() == (surface.kind == "torus"))
        way = (side * reach[near])[:, None] * normal[near]
        np.testing.assert_allclose(surface.closest_point(points[near] + 0.999 * way).foot, points[near], atol=1e-12)
        beyond = surface.closest_point(points[near] + 1.02 * way).foot
        assert np.all(np.linalg.norm(beyond - points[near], axis=1) > 1e-3 * min(surface.reals))
        shrunk = np.eye(3) + 0.999 * (side * reach[near])[:, None, None] * shape[near]
        assert np.all(np.linalg.eigvalsh(shrunk) > 0.0)


@pytest.mark.parametrize(
    ("model", "point", "distance"),
    [
        (sphere(0.2), (0.0, 0.0, 0.0), -0.1),
        (ellipsoid(0.1, 0.07, 0.05), (0.0, 0.0, 0.0), -0.05),
        (ellipsoid(0.05, 0.07, 0.1), (0.0, 0.0, 0.0), -0.05),
        (ellipsoid(0.07, 0.05, 0.1), (0.0, 0.0, 0.0), -0.05),
        (ellipsoid(0.05, 0.05, 0.1), (0.0, 0.0, 0.0), -0.05),
        (torus(0.07, 0.03), (0.0, 0.0, 0.0), 0.04),
        (torus(0.07, 0.03), (0.0, 0.07, 0.0), -0.03),
        (torus(0.07, 0.03), (0.0, 0.0, 0.03), math.hypot(0.07, 0.03) - 0.03),
        # the medial disc of x^2 / a^2 + z^2 / c^2 = 1: foot at x a^2 / (a^2 - c^2), so x = 0.03 has its foot at 0.04
        (ellipsoid(0.1, 0.1, 0.05), (0.03, 0.0, 0.0), -math.hypot(0.01, 0.05 * math.sqrt(1.0 - 0.16))),
        # past the disc's rim, 0.075: the vertex
        (ellipsoid(0.1, 0.1, 0.05), (0.08, 0.0, 0.0), -0.02),
    ],
)
def test_points_with_many_nearest_ones(model, point, distance):
    foot, normal, found, _ = model.surface.closest_point([point])
    assert found[0] == pytest.approx(distance, abs=1e-16)
    np.testing.assert_allclose(foot + found[:, None] * normal, [point], atol=1e-16)
    np.testing.assert_allclose(implicit(model.surface, foot), 0.0, atol=1e-14)


@pytest.mark.parametrize("axes", [(1.0, 1e-6, 1e-3), (1e-6, 1.0, 1.0), (1.0, 1e-6, 1e-6), (1.0, 0.999999, 1.000001)])
@settings(max_examples=50)
@given(point=st.tuples(*[st.floats(-2.0, 2.0)] * 3), share=st.floats(1e-12, 1.0))
def test_needles_plates_and_almost_spheres(axes, point, share):
    surface = Surface("extreme", "ellipsoid", axes)
    points = np.array([point, (point[0], share * point[1], share * point[2])])
    foot, normal, distance, _ = surface.closest_point(points)
    np.testing.assert_allclose(implicit(surface, foot), 0.0, atol=1e-13)
    np.testing.assert_allclose(foot + distance[:, None] * normal, points, atol=1e-14)
    for each, far in zip(points, np.abs(distance), strict=True):
        assert far <= np.linalg.norm(surface.points(500) - each, axis=1).min() + 1e-14


@every
def test_points_are_spread_by_area_and_within_the_bounds(surface):
    points = surface.points(3000)
    np.testing.assert_allclose(implicit(surface, points), 0.0, atol=1e-13)
    low, high = np.array(surface.bounds).reshape(2, 3)
    assert np.all((points >= low) & (points <= high))
    np.testing.assert_allclose(points.max(axis=0), high, rtol=0.01)
    octants = np.bincount((points > 0.0) @ [1, 2, 4], minlength=8)
    np.testing.assert_allclose(octants, 375, rtol=0.05)
    if surface.kind == "torus":  # the share of its area outside the core circle is 1/2 + minor / (pi major)
        major, minor = surface.reals
        share = np.mean(np.hypot(points[:, 0], points[:, 1]) > major)
        assert share == pytest.approx(0.5 + minor / (math.pi * major), abs=2e-3)


def test_plane_and_space_are_separated(refused):
    with refused(RefusalError):
        _ = sphere().curve
    with refused(RefusalError):
        _ = circle().surface
    assert sphere().dimension == 3
    assert torus().size == pytest.approx(0.2)
