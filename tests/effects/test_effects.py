"""Effects by their one mechanism: a class and a line in the catalogue take one from a suite file to every place."""

from __future__ import annotations

import json
from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from hapticeval.devices.parallelogram import Parallelogram2
from hapticeval.effects.actuators import Delay, JointFriction, Saturation
from hapticeval.effects.catalogue import EFFECTS, Entry, make_effect, read_effects
from hapticeval.effects.effect import Effect, Part, Stage, number
from hapticeval.effects.sensors import Encoder, ForceSensor, VelocityFilter
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.errors import InputError, RefusalError, UnknownNameError
from hapticeval.geometry.catalogue import circle, line
from hapticeval.renderer import Response
from hapticeval.reports.templates import robot_words
from hapticeval.runner.results import Robot, SceneEntry
from hapticeval.runner.work import scene_document
from hapticeval.scene import Scene, requirements
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment
from hapticeval.suite.reading import load_suite

ONE_OF_EACH = (
    Viscosity(0.3), Encoder(1e-4), VelocityFilter(80.0), ForceSensor(step=0.01, noise=0.02, cutoff=300.0, seed=3),
    Saturation(0.5), Delay(1.4e-3), JointFriction(0.02),
)  # fmt: skip


@dataclass(frozen=True)
class Weak(Effect):
    """Motors that give a share of what they are asked for."""

    share: float = number("")

    kind: ClassVar[str] = "weak-motors"
    stage: ClassVar[Stage] = Stage.COMMAND
    words: ClassVar[str] = "motors of {share} of their torque"

    def part(self, ticks, size, dt):
        return Part(weaken, np.array([self.share]))


def weaken(params, samples, state, tick, dt, torque, before):
    for i in range(torque.shape[0]):
        torque[i] *= params[0]
    return 0.0


class Pushing:
    """A renderer with a constant force, which declares what it supports."""

    supports = frozenset({"weak-motors"})

    def __init__(self, scene):
        self.force = np.full(scene.model.dimension, 1.0)

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        return Response(hip, self.force)


SUITE = """
title = "Weak motors"
[[case]]
name = "pushed"
title = "Pushed by weak motors"
model = { kind = "line" }
scene = { device = "parallelogram-2dof", %s }
checks = ["contact-normal-force"]
experiment = { duration = 0.02, position = [0.0, 0.0] }
"""


@pytest.mark.parametrize(
    "written", ['effects = [{ kind = "weak-motors", share = 0.25 }]', "imperfections = { weakness = 0.25 }"]
)
def test_one_more_effect_takes_a_class_and_a_line(refused, tmp_path, monkeypatch, written):
    entry = Entry(f"{__name__}:Weak", "the motors are weak", {"imperfections.weakness": "share"})
    monkeypatch.setitem(EFFECTS, Weak.kind, entry)
    (tmp_path / "weak.toml").write_text(SUITE % written)
    (case,) = load_suite(str(tmp_path / "weak.toml")).cases
    scene = case.build_scene()
    assert scene.effects == (Weak(0.25),)
    assert requirements()["weak-motors"] == "the motors are weak"

    renderer = make_renderer(Pushing, scene)
    run = simulate_closed_loop(renderer, case.build_stimulus(scene, renderer), scene, 1e-3)
    asked = [scene.robot.jacobian(q).T @ f for q, f in zip(run.channels["joint_position"], run.force, strict=True)]
    np.testing.assert_allclose(run.channels["joint_torque"], 0.25 * np.array(asked), rtol=1e-14)

    document = json.loads(json.dumps(scene_document(scene)))
    assert document["effects"] == [{"kind": "weak-motors", "share": 0.25}]
    entry = SceneEntry(**document, device=Robot(kind=scene.robot.name), inner_loop=scene.inner_loop)
    assert robot_words(SimpleNamespace(scene=entry)).endswith("; motors of 0.25 of their torque")
    with refused(RefusalError):
        make_renderer(type("Strong", (Pushing,), {"supports": {"bilateral"}}), scene)


def test_documents_and_short_forms_give_the_same_effects():
    documents = [json.loads(json.dumps(each.document())) for each in ONE_OF_EACH]
    assert tuple(make_effect(each) for each in documents) == ONE_OF_EACH
    imperfections = {
        "encoder_step": 1e-4, "velocity_cutoff": 80.0, "torque_limit": 0.5, "delay": 1.4e-3, "friction": 0.02,
        "force_sensor": {"step": 0.01, "noise": 0.02, "cutoff": 300.0, "seed": 3},
    }  # fmt: skip
    rest, short = read_effects({"mass": 1.0, "viscosity": 0.3, "imperfections": imperfections})
    listed = read_effects({"mass": 1.0, "effects": documents})
    assert read_effects({"mass": 1.0, "effects": documents[:3], "effect": documents[3:]}) == listed
    assert (rest, set(short)) == (listed[0], set(listed[1])) == ({"mass": 1.0}, set(ONE_OF_EACH))
    assert Scene(model=line(), effects=short[::-1]).effects == ONE_OF_EACH


def test_a_scene_leaves_out_what_is_off_and_replaces_by_kind():
    scene = Scene(model=line(), effects=(Viscosity(0.0), Delay(0.0), JointFriction(0.1)))
    assert scene.effects == (JointFriction(0.1),)
    assert "effects" not in scene_document(Scene(model=line()))
    late = scene.with_effects(Delay(1e-3), JointFriction(0.2))
    assert late.effects == (Delay(1e-3), JointFriction(0.2))
    assert (late.effect(Delay), scene.effect(Delay)) == (Delay(1e-3), None)


def test_a_scene_without_effects_assembles_and_compiles_none():
    """Nor is anything of `effects` compiled: the fields that they would fill are None."""
    from hapticeval.simulation.closed_loop import loop_of

    trial = Experiment(0.02, np.array([0.0, 0.01]), np.zeros(2), np.zeros(1), np.zeros((1, 2)))
    loop = loop_of(trial, Scene(model=line(), device=Parallelogram2()), 1e-3)
    assert (loop.sensors, loop.feeling, loop.motors, loop.motion.load.friction) == (None, None, None, None)


@pytest.mark.parametrize(
    ("table", "error"),
    [
        ({"effects": [{"kind": "dely", "time": 1.0}]}, UnknownNameError),
        ({"effects": [{"kind": "delay", "tme": 1.0}]}, UnknownNameError),
        ({"effects": [{"kind": "delay"}]}, InputError),
        ({"imperfections": {"frictoin": 0.1}}, UnknownNameError),
        ({"imperfections": {"friction": -0.1}}, InputError),
        ({"imperfections": {"velocity_cutoff": 0.0}}, InputError),
        ({"imperfections": {"delay": float("nan")}}, InputError),
        ({"viscosity": -0.2}, InputError),
        ({"viscosity": "much"}, InputError),
        ({"imperfections": {"encoder_counts": 100, "encoder_step": 0.1}}, InputError),
        ({"effects": [{"kind": "encoder"}]}, InputError),
    ],
)
def test_what_cannot_be_meant_is_refused(refused, table, error):
    with refused(error):
        read_effects(table)


def test_two_effects_of_a_kind_and_counts_of_a_point_mass_are_refused(refused):
    with refused(InputError):
        Scene(model=circle(), effects=(Delay(1e-3), Delay(2e-3)))
    with refused(InputError):
        Scene(model=circle(), effects=(Encoder(counts=1000),))
    assert Scene(model=circle(), device=Parallelogram2(), effects=(Encoder(counts=1000),)).effects
