"""What the renderers of the field have in common: names, knobs, a spring on a plane and in a ball, silence outside."""

import math

import numpy as np
import pytest
from hand_paths import SMOOTH, ticked, walks
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.discovery import FIELD, known_renderers, own_renderers, resolve
from hapticeval.errors import InputError, RefusalError, UnknownNameError
from hapticeval.geometry.catalogue import circle, cube, line, sphere
from hapticeval.renderer import choices_of, configured, wrapped
from hapticeval.scene import Scene

NAMES = sorted(name for name, entry in known_renderers().items() if entry.group == FIELD)
SPRINGS = [
    "virtual-proxy",
    "local-plane",
    "local-plane+recovery@30hz",
    "neighbourhood",
    "implicit",
    "implicit@grid",
    "implicit+normal@grid",
    "implicit+gradient@grid",
    "constraint+pc",
]
"""Those that are silent in free space."""
LINE, CIRCLE, CUBE, SPHERE = line(), circle(), cube(), sphere()
"""A renderer prepares a model once: its grid, and its facets."""


def test_they_are_named_and_are_none_of_those_that_run_by_themselves():
    assert NAMES
    assert set(NAMES).isdisjoint(own_renderers())
    assert all(choices_of(resolve(name)).summary for name in NAMES)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "1"])
def test_a_knob_that_is_no_positive_number_is_refused_by_name(refused, name, value):
    for knob in choices_of(resolve(name)).knobs:
        with refused(InputError):
            configured(resolve(name), {knob: value}, name=name)


@pytest.mark.parametrize("name", NAMES)
def test_an_unknown_knob_or_variant_is_refused(refused, name):
    with refused(UnknownNameError):
        configured(resolve(name), {"size": 1.0}, name=name)
    with pytest.raises(UnknownNameError):
        resolve(f"{name}+no-such-law")
    with pytest.raises(UnknownNameError):
        resolve(name).variant(representation="no-such-one")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("model", [CIRCLE, CUBE], ids=lambda model: model.name)
def test_a_hand_that_is_nowhere_is_refused(name, model):
    renderer = resolve(name)(Scene(model=model))
    outside = np.full(model.dimension, 0.2)
    renderer.reset(outside)
    renderer.step(outside, 0.0 * outside, 1e-3)
    with pytest.raises(InputError):
        renderer.step(np.full(model.dimension, math.nan), 0.0 * outside, 1e-3)
    with pytest.raises(InputError):
        renderer.reset(np.full(model.dimension, math.nan))


@pytest.mark.parametrize("name", SPRINGS)
@settings(max_examples=15)
@given(hips=walks(), model=st.sampled_from([CIRCLE, SMOOTH["cassinian"]]))
def test_clear_of_the_model_nothing_is_felt(name, hips, model):
    far = hips + np.array([0.5, 0.0])
    ihips, forces = ticked(resolve(name)(Scene(model=model)), far)
    np.testing.assert_array_equal(ihips, far)
    np.testing.assert_array_equal(forces, 0.0)


@pytest.mark.parametrize("name", SPRINGS)
@settings(max_examples=15)
@given(depth=st.floats(1e-4, 0.03), x=st.floats(-0.03, 0.03))
def test_under_a_flat_face_the_force_is_k_times_the_depth_along_its_normal(name, depth, x):
    model = CUBE if "grid" in name else LINE
    top = 0.05 if "grid" in name else 0.0
    renderer = resolve(name)(Scene(model=model))
    low = np.array([x, 0.001, top - min(depth, 0.015)]) if model.dimension == 3 else np.array([x, -depth])
    share = np.linspace(1.0, 0.0, 200)[:, np.newaxis]
    hips = low + share * np.eye(model.dimension)[-1] * 0.04
    hips = np.vstack([hips, np.repeat(hips[-1:], 100, axis=0)])
    _, forces = ticked(renderer, hips)
    deep = top - hips[-1, -1] + wrapped(renderer).standoff * ("virtual-proxy" in name)
    np.testing.assert_allclose(forces[-1], 1000.0 * deep * np.eye(model.dimension)[-1], rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("name", SPRINGS)
@pytest.mark.parametrize("model", [CIRCLE, SPHERE], ids=lambda model: model.name)
def test_into_a_ball_the_tool_lies_on_the_radius_and_no_farther_off_than_declared(name, model):
    if "constraint" in name and model.dimension == 3:
        pytest.skip("the constraint is for meshes in space")
    renderer = resolve(name)(Scene(model=model))
    out = np.array([0.6, 0.8, 0.0])[: model.dimension]
    hips = np.linspace(0.13, 0.085, 300)[:, np.newaxis] * out
    ihips, forces = ticked(renderer, np.vstack([hips, np.repeat(hips[-1:], 100, axis=0)]))
    radius = model.size / 2.0
    off = np.linalg.norm(ihips[-1]) - radius
    allowed = wrapped(renderer).standoff + 0.2 * wrapped(renderer).resolution + 1e-6
    assert abs(off) <= allowed
    np.testing.assert_allclose(ihips[-1] / np.linalg.norm(ihips[-1]), out, atol=0.02)
    assert np.linalg.norm(forces[-1]) == pytest.approx(1000.0 * (radius - 0.085 + off), rel=0.02)


def test_a_grid_covers_no_half_plane(refused):
    with refused(RefusalError):
        resolve("implicit@grid")(Scene(model=LINE))
