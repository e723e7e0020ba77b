"""The neighbourhood watch of Ho, Basdogan and Srinivasan: a local nearest point, that walks and never leaps."""

import numpy as np
import pytest
from hand_paths import plate, star_shaped, touching, walks
from hypothesis import given, settings
from leading import led as led_along

from hapticeval.geometry.catalogue import circle, cube, from_vertices, line, sphere
from hapticeval.renderers.field.catalogue import neighbourhood
from hapticeval.renderers.field.facets import FACET, facets_of
from hapticeval.renderers.field.neighbourhood import neighbours
from hapticeval.scene import Scene


def led(model, hips):
    return led_along(neighbourhood(Scene(model=model)), np.asarray(hips, dtype=float), 1e-3)


@settings(max_examples=60)
@given(vertices=star_shaped(), hips=walks())
def test_in_contact_the_ihip_is_on_the_surface_and_nearest_of_its_surroundings(vertices, hips):
    model = from_vertices(vertices)
    ihips, forces = led(model, hips)
    on = touching(hips, ihips, forces)
    assert np.abs(model.curve.signed_distance(ihips[on])).max(initial=0.0) <= 1e-15
    np.testing.assert_allclose(forces, 1000.0 * (ihips - hips), atol=1e-12)
    for hip, ihip in zip(hips[on], ihips[on], strict=True):
        for aside in model.boundary.around(ihip, 1e-7):
            assert np.linalg.norm(hip - aside) >= np.linalg.norm(hip - ihip) - 1e-12


@pytest.mark.parametrize("model", [circle(), sphere()], ids=lambda model: model.name)
def test_inside_a_ball_it_is_the_nearest_point(model):
    rng = np.random.default_rng(3)
    out = rng.normal(size=(300, model.dimension))
    out /= np.linalg.norm(out, axis=1)[:, np.newaxis]
    order = np.cumsum(rng.normal(size=(300, model.dimension)) * 2e-3, axis=0)
    hips = np.vstack([0.2 * out[:1], 0.08 * out[:1] + np.clip(order, -0.01, 0.01)])
    ihips, _ = led(model, hips)
    near = model.boundary.closest_point(hips[1:]).foot
    _, rows = facets_of(Scene(model=model))
    np.testing.assert_allclose(ihips[1:], near, atol=2.0 * float(rows.view(FACET)["reach"].max()))


def test_faces_around_are_those_that_share_a_corner():
    cells = facets_of(Scene(model=cube()))[0].cells
    for face, row in enumerate(neighbours(cells)):
        shared = {k for k, other in enumerate(cells) if set(other) & set(cells[face])}
        assert set(row[row >= 0.0].astype(int)) == shared


def test_a_hand_that_crosses_a_plate_in_a_tick_is_met():
    ihips, forces = led(plate(1e-4), [[0.0, 0.01], [0.0, -0.01]])
    np.testing.assert_allclose(ihips[1], [0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(forces[1], [0.0, 10.0], atol=1e-6)


def test_it_walks_round_an_edge_past_its_bisector():
    hips = [[0.0, 0.04, 0.06], *([0.0, 0.04 + along, 0.045] for along in np.linspace(0.0, 0.0095, 96))]
    _, forces = led(cube(), hips)
    on_side = np.abs(forces[1:, 1]) > 1e-9
    hand = np.array(hips)[1:, 1]
    np.testing.assert_array_equal(on_side, hand > 0.045 + 1e-12)


def test_it_lets_go_outside_of_its_face_and_takes_hold_again():
    hips = [[0.0, 0.01], [0.0, -0.01], [0.3, -0.01], [0.3, 0.001], [0.1, 0.02], [0.1, -0.005]]
    _, forces = led(line(), hips)
    np.testing.assert_allclose(forces[:, 1], [0.0, 10.0, 10.0, 0.0, 0.0, 5.0], atol=1e-6)
