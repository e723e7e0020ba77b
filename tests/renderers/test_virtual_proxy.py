"""The virtual proxy of Ruspini, Kolarov and Khatib: a ball keeps its distance, rests in corners, and passes nothing."""

import math

import numpy as np
import pytest
from hand_paths import plate, star_shaped, touching, walks
from hypothesis import given, settings
from hypothesis import strategies as st
from leading import led as led_along

from hapticeval.geometry.catalogue import circle, cube, from_vertices, line, make_model
from hapticeval.renderers.field.catalogue import virtual_proxy
from hapticeval.renderers.field.facets import (
    FACET,
    LISTED_EACH,
    away_from_facet,
    cubes_between,
    facet_grid,
    facets_of,
    listed_in,
)
from hapticeval.scene import Scene
from hapticeval.suite.reading import load_suite

R = 0.5e-3
"""The radius that it has."""
MODELS = {
    "sphere": make_model("icosphere"),
    "cube": cube(),
    "torus": make_model("torus"),
    "star": make_model("star"),
}
L_SHAPE = from_vertices([(0.0, 0.0), (0.1, 0.0), (0.1, 0.05), (0.05, 0.05), (0.05, 0.1), (0.0, 0.1)])


def led(model, hips, radius=R):
    return led_along(virtual_proxy.with_knobs(radius=radius)(Scene(model=model)), np.asarray(hips, dtype=float), 1e-3)


@settings(max_examples=60)
@given(vertices=star_shaped(), hips=walks(), radius=st.sampled_from([1e-4, 5e-4, 3e-3]))
def test_the_ball_is_never_nearer_than_its_radius_and_the_force_is_a_spring_to_it(vertices, hips, radius):
    model = from_vertices(vertices)
    hips = np.vstack([[0.2, 0.0], hips])
    ihips, forces = led(model, hips, radius)
    distances = model.curve.signed_distance(ihips)
    assert distances.min() >= radius * (1.0 - 1e-9)
    np.testing.assert_allclose(forces, 1000.0 * (ihips - hips), atol=1e-12)
    touched = touching(hips, ihips, forces)
    np.testing.assert_allclose(distances[touched], radius, atol=1e-5 * radius)


@settings(max_examples=60)
@given(vertices=star_shaped(), hips=walks())
def test_it_gets_no_farther_from_the_hand_than_it_was(vertices, hips):
    """Each stretch of the way leads nearer to the hand: within a tick the ball cannot lose by moving."""
    hips = np.vstack([[0.2, 0.0], hips])
    ihips, _ = led(from_vertices(vertices), hips)
    before, after = (np.linalg.norm(hips[1:] - place, axis=1) for place in (ihips[:-1], ihips[1:]))
    assert np.all(after <= before + 1e-9)


@given(depth=st.floats(-0.01, 0.05), x=st.floats(-0.5, 0.5))
def test_a_plane_pushes_by_the_depth_of_the_ball(depth, x):
    _, forces = led(line(), [[x, 0.1], [x, -depth]])
    np.testing.assert_allclose(forces[1], [0.0, 1000.0 * max(0.0, depth + R)], atol=1e-5)


CIRCLE = circle()


@given(angle=st.floats(0.0, 2.0 * math.pi), inside=st.floats(1e-3, 0.099))
def test_in_a_circle_it_stands_off_along_the_radius(angle, inside):
    out = np.array([math.cos(angle), math.sin(angle)])
    ihips, _ = led(CIRCLE, [0.2 * out, (0.1 - inside) * out])
    error = facets_of(Scene(model=CIRCLE))[0].chord_error
    assert np.linalg.norm(ihips[1]) == pytest.approx(0.1 + R, abs=error + 1e-8)


def test_in_a_corner_of_two_faces_and_of_three_it_rests_between_all():
    ihips, _ = led(L_SHAPE, [[0.08, 0.08], [0.04, 0.045]])
    np.testing.assert_allclose(ihips[1], [0.05 + R, 0.05 + R], atol=1e-8)
    niche = make_model(**load_suite("solids").case("inner-corner").model)
    ihips, _ = led(niche, [[0.02, 0.02, 0.02], [-0.003, -0.002, -0.001]])
    np.testing.assert_allclose(ihips[1], [R, R, R], atol=1e-8)


def test_it_never_enters_a_notch_that_is_narrower_than_itself():
    slit = from_vertices(
        [(-0.05, -0.05), (0.05, -0.05), (0.05, 0.0), (0.0004, 0.0), (0.0, -0.03), (-0.0004, 0.0), (-0.05, 0.0)]
    )
    ihips, _ = led(slit, [[0.0, 0.01], [0.0, -0.01]])
    assert ihips[1, 1] > 0.0
    assert led(slit, [[0.0, 0.01], [0.0, -0.01]], radius=1e-5)[0][1, 1] == pytest.approx(-0.01, abs=2e-3)


@pytest.mark.parametrize("speed", [0.01, 1.0])
def test_it_goes_through_no_plate(speed):
    ihips, _ = led(plate(1e-6), [[0.0, speed], [0.0, -speed]])
    assert ihips[1, 1] == pytest.approx(R, abs=1e-8)


def test_an_edge_between_two_triangles_of_one_face_is_not_felt():
    share = np.linspace(0.0, 1.0, 4001)[:, np.newaxis]
    hips = np.vstack([[[-0.03, -0.02, 0.06]], [-0.03, -0.02, 0.047] + share * [0.07, 0.05, 0.0]])
    ihips, forces = led(cube(), hips)
    np.testing.assert_allclose(forces[1:, :2], 0.0, atol=1e-9)
    np.testing.assert_allclose(ihips[1:, :2], hips[1:, :2], atol=1e-12)


def test_it_lets_go_of_an_edge_when_the_hand_is_a_radius_past_it():
    past = np.array([0.0, 0.5, 0.98, 1.02]) * R
    hips = [[0.04, 0.06, 0.01], [0.04, 0.045, 0.01], *([0.05 + beyond, 0.045, 0.01] for beyond in past)]
    ihips, forces = led(cube(), hips)
    assert np.all(forces[:-1][1:] @ np.array([1.0, 1.0, 0.0]) > 0.0)
    np.testing.assert_array_equal(ihips[-1], hips[-1])
    # it has rolled round the edge and lies aside of the hand, which one without a radius would have let go
    np.testing.assert_allclose(ihips[-2], [0.05 + R, 0.045, 0.01], atol=1e-8)


@settings(max_examples=30)
@given(
    kind=st.sampled_from(["sphere", "cube", "torus", "star"]),
    margin=st.sampled_from([1e-4, 5e-4, 5e-3]),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_cube_lists_each_facet_that_comes_near_a_point_in_it_and_the_lists_are_short(kind, margin, seed):
    _, rows = facets_of(Scene(model=MODELS[kind]))
    grid = facet_grid(rows, margin)
    random = np.random.default_rng(seed)
    facets = random.integers(0, len(rows), 20)
    corners = rows.view(FACET)[facets, 0]
    shares = random.dirichlet(np.ones(3), 20)[:, :, np.newaxis]
    on_facets = shares[:, 0] * corners["a"] + shares[:, 1] * corners["b"] + shares[:, 2] * corners["c"]
    for facet, point in zip(facets, on_facets + margin * random.uniform(-0.5, 0.5, (20, 3)), strict=True):
        p = tuple(point.tolist())
        x, last_x, y, last_y, z, last_z = cubes_between(grid.grid, p, p)
        assert (x, y, z) == (last_x, last_y, last_z)
        start, end = listed_in(grid.grid, grid.cubes, x, y, z)
        listed = grid.facets[start:end, 0].astype(int)
        assert np.all(np.diff(listed) > 0)
        distance, _ = away_from_facet(rows, int(facet), p)
        assert distance > margin or facet in listed
    assert len(grid.facets) <= LISTED_EACH * len(rows)


def test_outside_the_grid_nothing_is_near():
    _, rows = facets_of(Scene(model=MODELS["cube"]))
    grid = facet_grid(rows, 1e-3)
    for p in ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1e300)):
        x, last_x, y, last_y, z, last_z = cubes_between(grid.grid, p, p)
        assert x > last_x or y > last_y or z > last_z
