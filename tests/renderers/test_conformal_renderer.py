"""The conformal renderer: on the exact surface, without memory, the same a tick at a time and in batch."""

import numpy as np
import pytest
from leading import led

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipse, line, star
from hapticeval.renderers import conformal, minimum_distance
from hapticeval.renderers.maps.conformal import CrowdingError, conformal_map
from hapticeval.scene import Scene

MODELS = {
    "cassinian": cassinian(),
    "star": star(),
    "dumbbell": dumbbell(neck=0.1),
    "ellipse 8:1": ellipse(ratio=8.0),
    "circle": circle(),
}

all_models = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


def around(model, count):
    xmin, ymin, xmax, ymax = model.curve.bounds
    return np.random.default_rng(8).uniform((xmin, ymin), (xmax, ymax), (count, 2)) * 1.1


@all_models
def test_a_step_is_the_batch_within_rounding_of_the_surface_and_beyond_the_float_range(model):
    renderer = conformal(Scene(model=model))
    rng = np.random.default_rng(0)
    u = rng.uniform(*model.curve.u_range, 400)
    off = rng.uniform(-1.0, 1.0, (400, 1)) * 10.0 ** rng.uniform(-19.0, -1.0, (400, 1))
    foot, normal = model.curve.position(u), model.curve.normal(u)
    beside = np.column_stack([foot, foot + off * normal]).reshape(-1, 2)
    hips = np.vstack([beside, [[1e160, 0.0], [0.0, 0.01], [1e200, -1e300], [0.01, 0.01]]])
    ihips, _ = led(renderer, hips, 1e-3)
    renderer.reset(hips[0])
    np.testing.assert_array_equal([renderer.step(hip, np.zeros(2), 1e-3).ihip for hip in hips], ihips)
    np.testing.assert_array_equal(ihips[[-4, -2]], hips[[-4, -2]])


@all_models
def test_the_ihip_is_on_the_exact_curve_and_the_outside_is_free(model):
    renderer = conformal(Scene(model=model))
    assert renderer.standoff == 0.0
    assert renderer.resolution < 1e-5
    hips = around(model, 2000)
    ihips, forces = led(renderer, hips, 1e-3)
    inside = model.curve.contains(hips)
    assert 0 < np.count_nonzero(inside) < 2000
    assert np.max(np.abs(model.curve.signed_distance(ihips[inside]))) < 1e-15
    np.testing.assert_array_equal(ihips[~inside], hips[~inside])
    np.testing.assert_array_equal(forces[~inside], 0.0)
    assert np.all(np.isfinite(forces))


@all_models
def test_outside_a_bilateral_scene_has_the_nearest_point(model):
    scene = Scene(model=model, bilateral=True)
    hips = around(model, 500)
    outside = ~model.curve.contains(hips)
    expected, _ = led(minimum_distance(scene), hips, 1e-3)
    found, _ = led(conformal(scene), hips, 1e-3)
    np.testing.assert_array_equal(found[outside], expected[outside])


@pytest.mark.parametrize("bilateral", [False, True])
def test_the_plane_is_projected_straight(bilateral):
    scene = Scene(model=line(), bilateral=bilateral)
    hips = np.array([[0.3, -0.02], [-5.0, 0.01], [0.0, -1e-9]])
    for found, expected in zip(
        led(conformal(scene), hips, 1e-3), led(minimum_distance(scene), hips, 1e-3), strict=True
    ):
        np.testing.assert_array_equal(found, expected)


def test_the_circle_is_projected_along_its_radii():
    hips = around(circle(), 300)
    hips = hips[np.hypot(*hips.T) < 0.1]
    ihips, forces = led(conformal(Scene(model=circle())), hips, 1e-3)
    radii = np.hypot(*hips.T)[:, np.newaxis]
    np.testing.assert_allclose(ihips, 0.1 * hips / radii, atol=1e-15)
    np.testing.assert_allclose(forces, 1000.0 * (0.1 - radii) * hips / radii, atol=1e-9)


def test_the_force_is_along_the_normal_at_any_depth():
    model = cassinian()
    hips = around(model, 500)
    hips = hips[model.curve.contains(hips)]
    ihips, forces = led(conformal(Scene(model=model)), hips, 1e-3)
    normals = model.curve.normal(model.curve.nearest(ihips))
    across = forces[:, 0] * normals[:, 1] - forces[:, 1] * normals[:, 0]
    assert np.max(np.abs(across)) < 1e-6 * np.max(np.abs(forces))


def test_it_does_not_pop_through_where_minimum_distance_does():
    """Along the way across the Cassinian's lobe at 35 mm, the IHIP's largest step halves with the HIP's."""
    model = cassinian()
    scene = Scene(model=model)
    largest = []
    for count in (2000, 4000):
        u = np.linspace(-np.pi / 4.0, np.pi / 4.0, count)
        hips = model.curve.position(u) * 0.65
        ihips, _ = led(conformal(scene), hips, 1e-3)
        popped, _ = led(minimum_distance(scene), hips, 1e-3)
        largest.append(np.max(np.hypot(*np.diff(ihips, axis=0).T)))
        assert np.max(np.hypot(*np.diff(popped, axis=0).T)) > 0.02
    assert largest[1] == pytest.approx(largest[0] / 2.0, rel=0.02)


def test_the_factory_is_not_hidden_by_a_module():
    conformal(Scene(model=cassinian()))
    assert resolve("hapticeval.renderers:conformal") is conformal


def test_a_hopeless_neck_is_refused():
    with pytest.raises(CrowdingError):
        conformal(Scene(model=dumbbell(neck=0.01)))


def test_the_map_is_made_once_for_a_model():
    model = cassinian()
    first, second = (conformal(Scene(model=model, stiffness=k)).projection for k in (1.0, 2.0))
    assert first.map is second.map
    assert first.map.centre.tolist() == conformal_map(model.curve).centre.tolist()
