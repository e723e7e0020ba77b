"""Each effect gives the same bits along a path, step by step, once more, round a renderer in Python, and in a loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from leading import led
from made_up_effect import Suction

from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
from hapticeval.discovery import resolve
from hapticeval.effects.friction import Friction
from hapticeval.effects.lugre import LuGre
from hapticeval.effects.reliefs import BumpMap, HeightMap
from hapticeval.effects.shading import Shading
from hapticeval.effects.stochastic_texture import StochasticTexture
from hapticeval.effects.transients import ContactImpulse, ContactTransient, RecordedImpulse
from hapticeval.effects.viscous_friction import ViscousFriction
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.recording import backward_difference
from hapticeval.renderer import wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment

DT = 1e-3
TURN = 2.0 * np.pi * np.arange(8) / 8
OCTAGON = {"kind": "polygon", "vertices": (0.1 * np.column_stack([np.cos(TURN), np.sin(TURN)])).tolist()}
LINE, CIRCLE, STAR, SPHERE = ({"kind": kind} for kind in ("line", "circle", "star", "sphere"))
SINE = {"wavelength": 0.5e-3, "amplitude": 20e-6}
PROFILE = tuple(2e-5 * np.cos(2.0 * np.pi * np.arange(12) / 12) + 5e-6 * np.sin(4.0 * np.pi * np.arange(12) / 12))
DRY = Friction(0.5, 0.3)
BRISTLES = LuGre(0.5, 0.3, stribeck=5e-3, stiffness=5e3, damping=6.0, viscosity=4.0)
STRUCK = (
    ContactImpulse(),
    ContactImpulse(10.0),
    ContactTransient(material="wood"),
    ContactTransient(40.0, 60.0, 90.0),
    RecordedImpulse((3.0, -1.0, 0.7, 0.1), DT),
)


def texture(**more):
    return StochasticTexture(mass=0.5, texture="ribbed", **more)


WAYS = [
    # effects, models, renderers
    ((Suction(0.2),), [CIRCLE], ["minimum-distance"]),
    ((DRY,), [CIRCLE, STAR, SPHERE], ["minimum-distance"]),
    ((DRY, ViscousFriction(2.0)), [CIRCLE, STAR, SPHERE], ["minimum-distance"]),
    ((BRISTLES,), [CIRCLE], ["minimum-distance"]),
    ((HeightMap(**SINE),), [LINE, CIRCLE, SPHERE], ["minimum-distance"]),
    ((BumpMap(wavelength=1e-3, profile=PROFILE),), [LINE, CIRCLE, SPHERE], ["minimum-distance"]),
    ((Shading(60.0),), [OCTAGON], ["minimum-distance", "constraint", "minimum-distance+pp-pd"]),
    ((texture(),), [CIRCLE], ["minimum-distance", "constraint", "mapping"]),
    ((texture(direction="normal"),), [CIRCLE], ["minimum-distance", "constraint", "mapping"]),
    *(((effect,), [LINE, SPHERE], ["minimum-distance"]) for effect in STRUCK),
]
ROBOTS = {"line": Parallelogram2(), "circle": Parallelogram2(), "sphere": Parallelogram3()}
"""The others are in reach of a point mass alone."""


class Python:
    """What a renderer answers, without what is compiled of it."""

    def __init__(self, renderer):
        self.reset, self.step = renderer.reset, renderer.step


def taps(model, ticks=200):
    """Above a surface, into it and out again, twice, and along it: HIPs (ticks, N)."""
    beside = np.zeros((ticks, model.dimension))
    beside[:, 0] = 1e-4 * np.arange(ticks)
    beside[:, -1] = 0.0 if model.name == "line" else 0.1
    at = model.boundary.closest_point(beside)
    depth = -1.005e-3 * np.cos(4.0 * np.pi * np.arange(ticks) / ticks)
    return at.foot - depth[:, np.newaxis] * at.normal


@pytest.mark.parametrize(
    ("effects", "model", "base"),
    [
        pytest.param(effects, model, base, id="-".join([*(each.kind for each in effects), model["kind"], base]))
        for effects, models, bases in WAYS
        for model in models
        for base in bases
    ],
)
def test_an_effect_gives_the_same_bits_in_each_way(effects, model, base):
    made = make_model(**model)
    scene = Scene(model=made, effects=effects, damping=1.0, mass=0.3, device=ROBOTS.get(made.name))
    hips, factory = taps(made), resolve(base)
    renderer = make_renderer(factory, scene)
    whole = led(renderer, hips, DT)
    assert not np.array_equal(led(make_renderer(factory, replace(scene, effects=())), hips, DT), whole)
    assert np.array_equal(led(renderer, hips, DT), whole), "a run begins anew"
    interpreted = make_renderer(lambda scene: Python(factory(scene)), scene)
    velocities = backward_difference(hips, DT * np.arange(len(hips)))
    for stepped, tolerance in ((renderer, 0.0), (interpreted, 1e-12)):
        stepped.reset(hips[0])
        answers = [stepped.step(hip, velocity, DT) for hip, velocity in zip(hips, velocities, strict=True)]
        assert np.array_equal([answer.ihip for answer in answers], whole[0])
        np.testing.assert_allclose([answer.force for answer in answers], whole[1], rtol=tolerance, atol=tolerance)
    into = np.zeros(made.dimension)
    into[-1] = -1.0
    trial = Experiment(0.06, hips[0], 0.2 * into + 0.05 * np.eye(made.dimension)[0], np.zeros(1), into[np.newaxis])
    loops = [simulate_closed_loop(each, trial, scene, DT) for each in (renderer, replace(renderer, law=None))]
    assert wrapped(renderer).law is not None
    for channel, values in loops[0].channels.items():
        assert np.array_equal(values, loops[1].channels[channel]), channel
    assert np.abs(loops[0].force).max() > 0.01
