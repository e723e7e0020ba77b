"""Twins without a clock, scenes to run on them, and what a live run of one records."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.catalogue import make_device
from hapticeval.devices.parallelogram import ENCODER_COUNTS, MOTOR_TORQUE
from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import read_effects
from hapticeval.geometry.catalogue import make_model
from hapticeval.hardware.live import channels, run, signals
from hapticeval.hardware.twin import COULOMB_FRICTION, MOTOR_DELAY, Twin
from hapticeval.hardware.wiring import Wiring
from hapticeval.recordings.journal import recover
from hapticeval.recordings.recorder import Recorder
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Hand, Path

DT = 1e-3
RENDERER = "minimum-distance+pp-pd"
REAL = {"torque_limit": MOTOR_TORQUE, "delay": MOTOR_DELAY, "friction": COULOMB_FRICTION}


UNLIMITED = {"torque_limit": 1e3, "force_limit": 1e3, "soft_start": 0.0}
PATIENCE = 60.0


def wired(dimension=2, **wiring):
    """A parallelogram robot with its own encoders, wired as given, whose limits take nothing away unless given."""
    device = make_device(f"parallelogram-{dimension}dof")
    return Wiring(device=device, counts_per_turn=ENCODER_COUNTS, **{**UNLIMITED, **wiring})


def scene_of(wiring, **scene):
    """A circle or a sphere, 200 mm across."""
    kind = "circle" if wiring.device.dimension == 2 else "sphere"
    given = {"stiffness": 300.0, "damping": 1.0, "sampling_time": DT, **scene}
    return Scene(model=make_model(kind, size=0.2), device=wiring.device, **given)


def hand_of(dimension=2, *, seconds=2.0, start=0.104):
    """A hand that presses 6 mm into the surface from outside and slides along it."""
    time = np.linspace(0.0, seconds, 41)
    angle = 0.6 * np.sin(2.5 * time)
    radius = np.interp(time, [0.0, 0.2, seconds], [start, 0.094, 0.094])
    points = np.zeros((time.size, dimension))
    points[:, 0], points[:, dimension - 1] = radius * np.cos(angle), radius * np.sin(angle)
    return Hand(path=Path(time, points), stiffness=250.0, damping=4.0)


def twin_of(wiring, *, seconds=2.0, effects=REAL):
    """The simulated robot under `hand_of`, without a clock."""
    hand = hand_of(wiring.device.dimension, seconds=seconds)
    return Twin(wiring, read_effects({"imperfections": effects})[1], position=hand.path.points[0], hand=hand, dt=DT)


def meta_of(wiring, scene, renderer=RENDERER):
    """What a recording has to say so that it can be replayed."""
    device = wiring.description()
    gains = {"stiffness": scene.stiffness, "damping": scene.damping, "mass": scene.mass}
    model = {"kind": scene.model.name, **scene.model.parameters}
    return {
        "source": "hardware",
        "renderer": renderer,
        "scene": {**gains, "sampling_time": DT, "model": model},
        "device": device.pop("kind"),
        "device_parameters": device,
        "dt": DT,
    }


def recorded(folder, hardware, wiring, *, cycles, scene=None, renderer=RENDERER, name="run"):
    """A live run on `hardware`: how it went, and its recording."""
    scene = scene_of(wiring) if scene is None else scene
    journal = folder / f"{name}.journal"
    made = resolve(renderer)(scene) if isinstance(renderer, str) else renderer
    told = meta_of(wiring, scene, renderer if isinstance(renderer, str) else "")
    with Recorder(journal, channels(wiring.device.dimension), signals=signals(wiring), meta=told) as recorder:
        live = run(lambda: hardware, wiring, made, scene, recorder, cycles=cycles, patience=PATIENCE)
    return live, recover(journal)
