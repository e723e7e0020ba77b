"""Compiled laws answer as `step` and `run` do, to the last bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.compiled import LAW, first_class
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipse, line, sphere, star, torus
from hapticeval.renderer import Compiled
from hapticeval.renderers import constraint, minimum_distance
from hapticeval.renderers.regulation import REGULATIONS
from hapticeval.scene import Scene

CURVES = {
    "cassinian": cassinian(),
    "circle": circle(),
    "dumbbell": dumbbell(),
    "ellipse": ellipse(),
    "line": line(),
    "star": star(),
}
SOLIDS = {"sphere": sphere(), "torus": torus()}
PLAIN = [name for name, regulation in REGULATIONS.items() if not regulation.bends]


def wander(model, seed, count=60):
    """A random smooth hand that goes in and out of the model, with velocities that are not its differences."""
    rng = np.random.default_rng(seed)
    steps = 0.004 * rng.normal(size=(count, model.dimension))
    start = 0.08 * rng.uniform(-1.0, 1.0, model.dimension)
    return start + np.cumsum(steps, axis=0), rng.normal(size=(count, model.dimension))


def by_law(law, hips, velocities, dt):
    """The law, tick by tick."""
    size = hips.shape[1]
    law.data.state[:] = 0.0
    ihips, forces = np.empty_like(hips), np.empty_like(hips)
    for hip, velocity, ihip, force in zip(hips, velocities, ihips, forces, strict=True):
        refusal = law.function(law.data, hip, velocity, np.zeros(size), dt, ihip, force)
        assert refusal == 0
    return ihips, forces


def check_same(renderer, hips, velocities, dt):
    renderer.reset(hips[0])
    steps = [renderer.step(hip, velocity, dt) for hip, velocity in zip(hips, velocities, strict=True)]
    ihips, forces = by_law(renderer.law, hips, velocities, dt)
    np.testing.assert_array_equal(ihips, np.array([step.ihip for step in steps]))
    np.testing.assert_array_equal(forces, np.array([step.force for step in steps]))


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.booleans(), st.sampled_from([1e-3, 3e-4]))
@pytest.mark.parametrize("model", CURVES)
def test_on_curves(model, seed, bilateral, dt):
    scene = Scene(model=CURVES[model], stiffness=730.0, damping=3.7, mass=0.13, bilateral=bilateral)
    hips, velocities = wander(scene.model, seed)
    for name in REGULATIONS:
        check_same(minimum_distance.variant(regulation=name)(scene), hips, velocities, dt)


@settings(max_examples=10)
@given(st.integers(0, 10_000), st.booleans())
def test_on_polygons(seed, bilateral):
    scene = Scene(model=CURVES["cassinian"], stiffness=730.0, damping=3.7, bilateral=bilateral)
    hips, velocities = wander(scene.model, seed)
    for name in PLAIN:
        renderer = minimum_distance.variant(regulation=name, representation="polygon")(scene)
        check_same(renderer, hips, velocities, 1e-3)


@settings(max_examples=10)
@given(st.integers(0, 10_000), st.booleans())
@pytest.mark.parametrize("model", SOLIDS)
def test_on_solids(model, seed, bilateral):
    scene = Scene(model=SOLIDS[model], stiffness=730.0, damping=3.7, bilateral=bilateral)
    hips, velocities = wander(scene.model, seed)
    for name in REGULATIONS:
        check_same(minimum_distance.variant(regulation=name)(scene), hips, velocities, 1e-3)


@pytest.mark.parametrize("name", REGULATIONS)
def test_a_whole_run_is_the_same_too(name):
    model = CURVES["cassinian"]
    renderer = minimum_distance.variant(regulation=name)(Scene(model=model, damping=2.0, bilateral=False))
    hips, _ = wander(model, 5, count=400)
    velocities = np.zeros_like(hips)
    velocities[1:] = np.diff(hips, axis=0) / 1e-3
    ihips, forces = renderer.run(hips, 1e-3)
    by_ticks = by_law(renderer.law, hips, velocities, 1e-3)
    np.testing.assert_array_equal(ihips, by_ticks[0])
    np.testing.assert_array_equal(forces, by_ticks[1])
    touches = np.any(forces != 0.0, axis=1)
    assert 50 < touches.sum() < 350


def test_it_is_offered_as_the_protocol_says_and_has_the_signature_of_laws():
    renderer = minimum_distance(Scene(model=CURVES["circle"]))
    assert isinstance(renderer, Compiled)
    law = renderer.law
    assert all(part.flags.writeable and part.flags.c_contiguous for part in law.data)
    assert first_class(law.function, LAW).__wrapper_address__() != 0


@pytest.mark.parametrize("family", [constraint, minimum_distance.variant(representation="level-set")])
def test_where_there_is_no_compiled_form_there_is_none(family):
    assert family(Scene(model=CURVES["cassinian"])).law is None
