"""Effects of the surface on the answers of any renderer: compiled, in Python, along a path and in closed loop alike."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from leading import led
from made_up_effect import ENTRY, MAGNET_ENTRY, Magnet, Suction

from hapticeval.discovery import resolve
from hapticeval.effects import catalogue
from hapticeval.effects.catalogue import EFFECTS
from hapticeval.effects.friction import Friction
from hapticeval.effects.lugre import LuGre
from hapticeval.effects.reliefs import BumpMap
from hapticeval.effects.stochastic_texture import StochasticTexture
from hapticeval.effects.transients import ContactImpulse, ContactTransient, RecordedImpulse
from hapticeval.effects.viscous_friction import ViscousFriction
from hapticeval.errors import DomainError, RefusalError
from hapticeval.geometry.catalogue import make_model
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer, put_on_answers

MODELS = ("circle", "star", "cassinian", "sphere")


class Python:
    """What a renderer answers, without what is compiled of it, or all at once."""

    def __init__(self, renderer):
        self.renderer = renderer

    def reset(self, hip):
        self.renderer.reset(hip)

    def step(self, hip, velocity, dt):
        return self.renderer.step(hip, velocity, dt)


def scene_of(kind, *effects, **more):
    return Scene(model=make_model(kind), effects=effects, **more)


def path_into_model(dimension):
    """Into the model from the right, and on along it."""
    t = np.linspace(0.0, 1.0, 60)
    hips = np.zeros((60, dimension))
    hips[:, 0], hips[:, 1] = 0.13 - 0.06 * np.minimum(2.0 * t, 1.0), 0.02 * np.maximum(t - 0.5, 0.0)
    return hips


def steps(renderer, hips, dt=1e-3):
    renderer.reset(hips[0])
    velocities = np.diff(hips, axis=0, prepend=hips[:1]) / dt
    pairs = [renderer.step(hip, velocity, dt) for hip, velocity in zip(hips, velocities, strict=True)]
    return tuple(np.array([pair[k] for pair in pairs]) for k in (0, 1))


@pytest.mark.parametrize(
    ("name", "kind"),
    [*product(["minimum-distance"], MODELS), *product(["constraint"], ["circle", "star", "cassinian"])],
)
def test_an_answer_is_the_base_s_and_the_change_s(kind, name):
    """`run`, `step` and what is not compiled give the same bits; a second run begins anew."""
    scene = scene_of(kind, Suction(0.2))
    hips = path_into_model(scene.model.dimension)
    plain = resolve(name)(scene)
    shown = make_renderer(resolve(name), scene)
    ihips, forces = led(plain, hips, 1e-3)
    found = led(shown, hips, 1e-3)
    frame = scene.model.boundary.closest_point(hips)
    inside = frame.distance < 0.0
    assert 20 < inside.sum() < 60
    faded = 0.2 * 0.99 ** np.maximum(np.cumsum(inside) - 1, 0) * inside
    np.testing.assert_allclose(found[1], forces - faded[:, np.newaxis] * frame.normal, rtol=1e-13, atol=1e-15)
    assert np.array_equal(found[0], ihips)
    interpreted = make_renderer(lambda scene: Python(resolve(name)(scene)), scene)
    for again in (led(shown, hips, 1e-3), steps(shown, hips), steps(interpreted, hips)):
        assert np.array_equal(again, found)


@pytest.mark.parametrize("effect", [ContactTransient(material="wood"), BumpMap(wavelength=0.03, amplitude=1e-4)])
@pytest.mark.parametrize("kind", MODELS)
def test_an_effect_put_on_known_answers_gives_the_bits_of_the_renderer_that_shows_it(kind, effect):
    """Twice: what an effect keeps between ticks begins anew with each run."""
    scene = scene_of(kind, effect)
    hips = path_into_model(scene.model.dimension)
    without, shown = (
        led(make_renderer(resolve("minimum-distance"), called_for), hips, 1e-3)
        for called_for in (scene.without(effect.kind), scene)
    )
    put_on = put_on_answers(effect, scene, len(hips))
    for _ in range(2):
        assert np.array_equal(put_on(hips, *without), shown)
    assert not np.array_equal(without[1], shown[1])


def test_an_effect_is_put_on_known_answers_in_python_too():
    suction = Suction(0.2)
    scene = scene_of("circle", suction)
    hips = path_into_model(2)
    without = led(resolve("minimum-distance")(scene.without(suction.kind)), hips, 1e-3)
    python = replace(scene, model=replace(scene.model, boundary=Interpreted(scene.model.boundary)))
    found, expected = (put_on_answers(suction, each, len(hips))(hips, *without) for each in (python, scene))
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-15)


class Interpreted:
    """A boundary that offers nothing compiled."""

    def __init__(self, boundary):
        self._boundary = boundary

    def __getattr__(self, name):
        if name == "compiled_closest":
            raise AttributeError(name)
        return getattr(self._boundary, name)


OF_ANY_BOUNDARY = [
    Suction(0.2),
    Friction(0.5, 0.3),
    ViscousFriction(0.5),
    LuGre(mu_s=0.5, mu_k=0.3, stribeck=0.01, stiffness=1e4, damping=10.0, viscosity=0.1),
    StochasticTexture(mass=0.05, texture="ribbed"),
    ContactImpulse(),
    ContactTransient(material="wood"),
    RecordedImpulse(pulse=(1.0, 0.5), step=0.7e-3),
]
"""Effects of the answer that ask the boundary for no arc length."""


@pytest.mark.parametrize("effect", OF_ANY_BOUNDARY, ids=lambda effect: effect.kind)
def test_a_boundary_in_python_gives_the_same_to_rounding(effect):
    scene = scene_of("circle", effect)
    hips = path_into_model(2)
    hips[:, 1] += np.linspace(0.0, 0.02, len(hips))  # along the surface too
    answers = Python(resolve("minimum-distance")(scene.without(effect.kind)))
    bare = replace(scene.model, boundary=Interpreted(scene.model.boundary))
    renderer = make_renderer(lambda _: answers, replace(scene, model=bare))
    expected = led(make_renderer(resolve("minimum-distance"), scene), hips, 1e-3)
    np.testing.assert_allclose(led(renderer, hips, 1e-3), expected, rtol=1e-12, atol=1e-15)


def test_who_shows_an_effect_keeps_it_and_who_cannot_get_it_is_refused(refused):
    class Shows(Python):
        supports = frozenset({"suction"})

    scene = scene_of("circle", Suction(0.2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(EFFECTS, Suction.kind, ENTRY)
        assert isinstance(make_renderer(lambda s: Shows(resolve("constraint")(s)), scene).renderer, Shows)
    with refused(RefusalError):
        make_renderer(resolve("ideal"), scene)
    plain = replace(scene, effects=())
    assert type(make_renderer(resolve("constraint"), plain).renderer) is type(resolve("constraint")(plain))


@pytest.mark.parametrize("effect", [ViscousFriction(0.5), Friction(0.5, 0.3)], ids=lambda effect: effect.kind)
def test_a_force_outside_of_contact_is_no_contact_to_others(monkeypatch, effect):
    """A magnet pulls in free space too. Whatever its place in the catalogue, friction has had its turn before."""
    monkeypatch.setattr(catalogue, "EFFECTS", {Magnet.kind: MAGNET_ENTRY, **EFFECTS})
    hips = path_into_model(2)
    hips[:, 1] += np.linspace(0.0, 0.02, len(hips))  # along the surface from the start
    magnet_alone, both, other_alone = (
        led(make_renderer(resolve("minimum-distance"), scene_of("circle", *effects)), hips, 1e-3)
        for effects in ((Magnet(0.2),), (Magnet(0.2), effect), (effect,))
    )
    outside = make_model("circle").boundary.signed_distance(hips) > 0.0
    assert outside.any()
    assert not outside.all()
    np.testing.assert_array_equal(both[0][outside], hips[outside])
    np.testing.assert_array_equal(both[1][outside], magnet_alone[1][outside])
    np.testing.assert_array_equal(both[0], other_alone[0])
    np.testing.assert_allclose(both[1], other_alone[1] - [0.2, 0.0], atol=1e-15)


class Untidy(Python):
    """It turns what it is given into millimetres, and answers in the same two arrays every time."""

    def __init__(self, renderer):
        super().__init__(renderer)
        self.ihip, self.force = np.zeros(2), np.zeros(2)

    def reset(self, hip):
        super().reset(hip.copy())
        hip *= 1e3

    def step(self, hip, velocity, dt):
        self.ihip[:], self.force[:] = self.renderer.step(hip.copy(), velocity.copy(), dt)
        hip *= 1e3
        velocity *= 1e3
        return self.ihip, self.force


def test_what_a_renderer_does_to_its_arrays_changes_no_effect():
    scene, hips = scene_of("circle", Friction(mu_s=0.5, mu_k=0.3), ViscousFriction(coefficient=2.0)), path_into_model(2)
    bare = resolve("minimum-distance")
    right = steps(make_renderer(lambda scene: Python(bare(scene)), scene), hips)
    untidy = make_renderer(lambda scene: Untidy(bare(scene)), scene)
    for answers in (steps(untidy, hips), led(untidy, hips, 1e-3)):
        np.testing.assert_allclose(answers, right, rtol=1e-12)


def test_an_effect_refuses_by_name(refused):
    scene = scene_of("circle", Suction(0.2, deepest=0.02))
    renderer = make_renderer(resolve("minimum-distance"), scene)
    with refused(DomainError):
        led(renderer, path_into_model(2), 1e-3)


@pytest.mark.parametrize("kind", ["circle", "star", "cassinian", "line", "ellipse", "sphere", "torus", "ellipsoid"])
def test_the_compiled_closest_point_is_the_boundary_s(kind):
    from hapticeval.geometry.boundary import closest_in_python, closest_of

    boundary = make_model(kind).boundary
    size = boundary.dimension
    function, data = closest_of(boundary)
    slow = closest_in_python(boundary)
    for point in np.random.default_rng(1).uniform(-0.12, 0.12, (40, size)):
        frame, other = np.zeros((2, 3 + size, size))
        assert function(data, point, frame) == pytest.approx(slow(None, point, other), rel=1e-14)
        np.testing.assert_allclose(frame[: 2 + size], other[: 2 + size], rtol=1e-12, atol=1e-15)
        if size == 2:
            curve = make_model(kind).curve
            assert frame[2 + size, 0] == pytest.approx(float(curve.arc_length(curve.nearest(point[np.newaxis]))[0]))
