"""Closed loops of reference controllers on the robot at 1 kHz: simulated seconds per second, warm, on one core.

What is asked is 300 on the parallelogram with two joints and 100 with three, with the motion between samples true to
1e-9. `extra_info` holds the ratio, and how it compares with the same loop of a renderer that is asked in Python.
"""

import time

import numpy as np
import pytest

from hapticeval.closed_loop import drive
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import make_model
from hapticeval.scene import Scene
from hapticeval.stimulus import Experiment, Hand, Path

DT, SECONDS = 1e-3, 10.0
ASKED = {2: 300.0, 3: 100.0}
CASES = {
    "circle, 2 joints": (Parallelogram2(), {"kind": "circle", "size": 0.2}),
    "cassinian, 2 joints": (Parallelogram2(), {"kind": "cassinian", "size": 0.2}),
    "sphere, 3 joints": (Parallelogram3(), {"kind": "sphere", "size": 0.2}),
}
CONTROLLERS = ("minimum-distance+pp-pd", "set-stabilisation")


class InPython:
    """A renderer without its law."""

    def __init__(self, renderer):
        self.reset, self.step = renderer.reset, renderer.step


def set_up(case, controller, hand):
    """Renderer, scene and experiment: a slide from the model's rightmost point, free or drawn round 2 mm inside."""
    device, spec = CASES[case]
    size = device.dimension
    model = make_model(**spec)
    scene = Scene(
        model=model, stiffness=500.0, damping=44.7, mass=1.0, bilateral=True, device=device,
        inner_loop=InnerLoop.LINEARISED,
    )  # fmt: skip
    position, velocity = np.zeros(size), np.zeros(size)
    position[0], velocity[1] = 0.1, 0.3
    grip = None
    if hand:
        turns = np.linspace(0.0, 4.0 * np.pi, 2001)
        points = np.zeros((turns.size, size))
        points[:, 0], points[:, 1] = 0.098 * np.cos(turns), 0.098 * np.sin(turns)
        if size == 2:
            points -= model.boundary.frame(points).distance[:, None] * model.boundary.frame(points).normal
        grip = Hand(path=Path(np.linspace(0.0, SECONDS, turns.size), points), stiffness=200.0, damping=5.0)
        velocity[:] = 0.0
    experiment = Experiment(SECONDS, position, velocity, np.zeros(1), np.zeros((1, size)), grip)
    return resolve(controller)(scene), scene, experiment


def best(run, rounds=20):
    """The shortest of some rounds, s, of this thread's own time: on a core of its own, as long as the clock's."""
    times = []
    for _ in range(rounds):
        start = time.thread_time()
        run()
        times.append(time.thread_time() - start)
    return min(times)


@pytest.mark.parametrize("hand", [False, True], ids=["free", "drawn"])
@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.benchmark(group="ten seconds of a closed loop on the robot, 1 kHz")
def test_closed_loop(benchmark, case, controller, hand):
    renderer, scene, experiment = set_up(case, controller, hand)
    assert renderer.law is not None
    recording = drive(renderer, experiment, scene, DT)
    simulated = DT * len(recording)
    assert simulated > 0.5 * SECONDS
    ratio = simulated / best(lambda: drive(renderer, experiment, scene, DT))
    slow = simulated / best(lambda: drive(InPython(renderer), experiment, scene, DT), rounds=2)
    benchmark.extra_info["times real time"] = round(ratio)
    benchmark.extra_info["times the loop through Python"] = round(ratio / slow, 1)
    benchmark(drive, renderer, experiment, scene, DT)
    assert ratio > ASKED[scene.robot.dimension]
