"""What holds for every projective renderer: run is its steps, symmetry, scaling, and where the IHIP lies."""

import math
from functools import partial

import numpy as np
import pytest
from hand_paths import star_shaped, ticked, touching, walks
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from leading import led

from hapticeval.discovery import resolve
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.errors import DomainError
from hapticeval.geometry.catalogue import (
    cassinian,
    circle,
    dumbbell,
    ellipse,
    ellipsoid,
    from_vertices,
    line,
    sphere,
    star,
    torus,
)
from hapticeval.renderers import constraint, minimum_distance
from hapticeval.renderers.regulation import REGULATIONS
from hapticeval.scene import Scene

MODELS = {m.name: m for m in (star(), cassinian(), circle(), ellipse(), dumbbell(), line())}
VARIANTS = [
    (family, representation)
    for family in (minimum_distance, constraint)
    for representation in family.representations
    if representation != "lut"  # a table holds these laws to its declared standoff only: test_lut.py
]
IDS = [f"{'md' if family is minimum_distance else 'constraint'}@{rep}" for family, rep in VARIANTS]
each_variant = pytest.mark.parametrize(("family", "representation"), VARIANTS, ids=IDS)
models = st.sampled_from(list(MODELS.values()))
quick = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


COARSE = {"lut": {"cell": 2e-3}, "mapping": {"cells": 60.0}}
NAMES = ["minimum-distance", "minimum-distance@polygon", "minimum-distance@level-set", "minimum-distance@lut"]
NAMES += ["constraint", "constraint@curve", "conformal", "conformal@lut", "mapping", "set-stabilisation"]
NAMES += ["homothetic", "homothetic@polygon", "homothetic@lut", "combescure", "combescure@lut"]
EVERY = {
    (name, model): MODELS[model]
    for name in NAMES
    for model in ("cassinian", "star", "dumbbell", "line")
    if (name, model) not in {("set-stabilisation", "star"), ("mapping", "dumbbell")}
    and not (name.startswith(("homothetic", "combescure")) and model in ("dumbbell", "line"))
}
SOLIDS = {m.name: m for m in (sphere(), ellipsoid(), torus())}
EVERY |= {(name, model): SOLIDS[model] for name in ("minimum-distance", "set-stabilisation") for model in SOLIDS}
EVERY |= {(name, model): SOLIDS[model] for name in ("homothetic", "combescure") for model in ("sphere", "ellipsoid")}
EVERY |= {("set-stabilisation@atlas", "sphere"): SOLIDS["sphere"]}


@pytest.mark.parametrize("bilateral", [False, True])
@pytest.mark.parametrize(("name", "model"), EVERY, ids=" ".join)
def test_run_is_reset_and_steps_to_the_last_bit_with_every_scheme(name, model, bilateral):
    """Along leaps, and along a slow walk in and out; where a renderer is not defined both say so, in the same words."""
    scene = Scene(model=EVERY[name, model], damping=3.0, mass=0.13, effects=(Viscosity(0.2),), bilateral=bilateral)
    factory = resolve(name)
    knobs = {knob: value for key in COARSE if key in name for knob, value in COARSE[key].items()}
    if knobs:
        factory = factory.with_knobs(**knobs)
    rng, size = np.random.default_rng(1), scene.model.dimension
    slow = 0.08 * rng.uniform(-1.0, 1.0, size) + np.cumsum(0.005 * rng.normal(size=(80, size)), axis=0)
    exact = getattr(factory, "representation", "") == "curve"
    # Set stabilisation has no scheme; what it can be besides is tested in test_predicted.
    schemes = [scheme for scheme in getattr(factory, "regulations", ()) if scheme in REGULATIONS]
    for scheme in schemes or [None]:
        if scheme is not None and REGULATIONS[scheme].bends and not exact:
            continue
        renderer = (factory if scheme is None else factory.variant(regulation=scheme))(scene)
        for hips in (rng.uniform(-0.12, 0.12, (20, size)), slow):
            found, expected = (tried(way, hips) for way in (partial(led, renderer, dt=1e-3), partial(ticked, renderer)))
            assert np.array_equal(found, expected)


def tried(way, hips):
    """IHIPs and forces, or the words of the error."""
    try:
        return np.hstack(way(hips))
    except DomainError as error:
        return str(error)


@each_variant
@quick
@given(model=models, hips=walks(), bilateral=st.booleans())
def test_pp_is_a_spring_from_hip_to_ihip(family, representation, model, hips, bilateral):
    renderer = family.variant(representation=representation)(Scene(model=model, stiffness=700.0, bilateral=bilateral))
    ihips, forces = led(renderer, hips, 1e-3)
    np.testing.assert_allclose(forces, -700.0 * (hips - ihips), rtol=1e-12)
    if bilateral:
        assert np.all(np.any(hips != ihips, axis=1))


@each_variant
@quick
@given(model=models, hips=walks(), bilateral=st.booleans())
def test_the_ihip_lies_on_the_renderers_own_surface(family, representation, model, hips, bilateral):
    renderer = family.variant(representation=representation)(Scene(model=model, bilateral=bilateral))
    ihips, forces = led(renderer, hips, 1e-3)
    on = touching(hips, ihips, forces)
    blur = 5e-6 if representation == "level-set" and model.curve.closed else 1e-15
    if on.any():
        assert np.max(np.abs(renderer.surface.signed_distance(ihips[on]))) <= blur
    # a hand that is felt nowhere is inside nothing
    if not on.all():
        assert np.min(renderer.surface.signed_distance(hips[~on])) >= -blur


@each_variant
@quick
@given(model=models, hips=walks())
def test_pp_pd_and_transversal_agree_on_straight_normal_projections(family, representation, model, hips):
    scene = Scene(model=model, damping=5.0)
    answers = [
        led(family.variant(regulation=name, representation=representation)(scene), hips, 1e-3)[1]
        for name in ("pp-pd", "transversal")
    ]
    np.testing.assert_allclose(*answers, atol=1e-7)


def moved(points, angle, mirror, scale):
    c, s = math.cos(angle), math.sin(angle)
    turned = points @ np.array([[c, s], [-s, c]]) * scale
    return turned * (-1.0, 1.0) if mirror else turned


@pytest.mark.parametrize("family", [minimum_distance, constraint])
@settings(max_examples=50)
@given(
    vertices=star_shaped(),
    hips=walks(),
    angle=st.floats(0.0, 6.28),
    mirror=st.booleans(),
    scale=st.sampled_from([1.0, 0.5, 1e-3, 4.0, 1e3]),
)
def test_a_moved_model_and_path_give_the_moved_answer(family, vertices, hips, angle, mirror, scale):
    there = moved(vertices, angle, mirror, scale)
    model, other = from_vertices(vertices), from_vertices(there[::-1] if mirror else there)
    make = family.variant(representation="polygon")
    ihips, forces = led(make(Scene(model=model)), hips, 1e-3)
    ihips_there, forces_there = led(make(Scene(model=other)), moved(hips, angle, mirror, scale), 1e-3)
    np.testing.assert_allclose(ihips_there, moved(ihips, angle, mirror, scale), atol=1e-9 * scale)
    np.testing.assert_allclose(forces_there, moved(forces, angle, mirror, scale), atol=1e-6 * scale)


@each_variant
@quick
@given(hips=walks(), quarter=st.integers(0, 3), mirror=st.booleans())
def test_the_cassinian_answers_alike_in_each_of_its_lobes(family, representation, hips, quarter, mirror):
    renderer = family.variant(representation=representation)(Scene(model=MODELS["cassinian"]))
    ihips, _ = led(renderer, hips, 1e-3)
    there, _ = led(renderer, moved(hips, quarter * math.pi / 2.0, mirror, 1.0), 1e-3)
    # level set: rounding turns into 1e-11 of tangential play
    np.testing.assert_allclose(there, moved(ihips, quarter * math.pi / 2.0, mirror, 1.0), atol=1e-9)


@each_variant
def test_free_space_is_free(family, representation):
    renderer = family.variant(regulation="pp-v", representation=representation)(
        Scene(model=MODELS["circle"], damping=5.0)
    )
    hip = np.array([0.11, 0.0])
    renderer.reset(hip)
    response = renderer.step(hip, np.array([1.0, 2.0]), 1e-3)
    np.testing.assert_array_equal(response.ihip, hip)
    np.testing.assert_array_equal(response.force, (0.0, 0.0))
    hip[0] = 5.0
    assert response.ihip[0] == 0.11


@each_variant
def test_the_error_rate_starts_at_zero_with_each_contact(family, representation):
    renderer = family.variant(regulation="pp-d", representation=representation)(
        Scene(model=line(), stiffness=1000.0, damping=1.0)
    )
    ys = np.array([1e-3, -1e-3, -3e-3, 1e-3, -2e-3, -1e-3])
    _, forces = led(renderer, np.column_stack([np.zeros(6), ys]), 1e-3)
    np.testing.assert_allclose(forces[:, 1], [0.0, 1.0, 3.0 + 2.0, 0.0, 2.0, 1.0 - 1.0], atol=1e-12)


@each_variant
def test_damping_is_not_clipped_and_may_pull(family, representation):
    renderer = family.variant(regulation="pp-v", representation=representation)(
        Scene(model=line(), stiffness=1000.0, damping=10.0)
    )
    hip = np.array([0.0, -1e-3])
    renderer.reset(hip)
    response = renderer.step(hip, np.array([0.0, 1.0]), 1e-3)
    np.testing.assert_allclose(response.force, (0.0, 1.0 - 10.0), atol=1e-12)
