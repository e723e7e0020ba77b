"""Closed loops of reference controllers on the robot at 1 kHz, warm, on one core, beside the motion of the robot alone.

The yardstick is that motion: the same number of ticks integrated by the same method to 1e-9, drawn by a hand, without
renderer, inner loop and recording. A closed loop took 0.7 to 1.5 times as long, and may take `ALLOWED` times.
`extra_info` holds the ratio, the simulated seconds per second, and how both compare with the loop of a renderer that is
asked in Python.
"""

import time
from functools import cache

import numpy as np
import pytest

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.integration import control, default_method
from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
from hapticeval.discovery import resolve
from hapticeval.examples.studies.integrators import Integrator, integration_benchmark
from hapticeval.geometry.catalogue import make_model
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment, Hand, Path

DT, SECONDS = 1e-3, 10.0
ALLOWED = 3.0
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
            points -= (
                model.boundary.closest_point(points).distance[:, None] * model.boundary.closest_point(points).normal
            )
        grip = Hand(path=Path(np.linspace(0.0, SECONDS, turns.size), points), stiffness=200.0, damping=5.0)
        velocity[:] = 0.0
    experiment = Experiment(SECONDS, position, velocity, np.zeros(1), np.zeros((1, size)), grip)
    return resolve(controller)(scene), scene, experiment


@cache
def motion_alone(device):
    """The motion of a device drawn round a circle, ready to be integrated, and its ticks."""
    benchmark, method = integration_benchmark(device), default_method()
    return Integrator(benchmark, method, control(method)), len(benchmark.torque)


def best(*runs, rounds=20):
    """The shortest of some rounds of each, s, in turns, of this thread's own time: no other work counts."""
    times = np.empty((rounds, len(runs)))
    for i in range(rounds):
        for j, run in enumerate(runs):
            start = time.thread_time()
            run()
            times[i, j] = time.thread_time() - start
    return times.min(axis=0)


@pytest.mark.parametrize("hand", [False, True], ids=["free", "drawn"])
@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.benchmark(group="ten seconds of a closed loop on the robot, 1 kHz")
def test_closed_loop(benchmark, case, controller, hand):
    renderer, scene, experiment = set_up(case, controller, hand)
    assert renderer.law is not None
    recording = simulate_closed_loop(renderer, experiment, scene, DT)
    ticks = len(recording)
    assert DT * ticks > 0.5 * SECONDS
    motion, counted = motion_alone(scene.robot)
    looped, alone = best(lambda: simulate_closed_loop(renderer, experiment, scene, DT), lambda: motion(afresh=False))
    (slow,) = best(lambda: simulate_closed_loop(InPython(renderer), experiment, scene, DT), rounds=2)
    ratio = (looped / ticks) / (alone / counted)
    benchmark.extra_info["times the motion alone"] = round(ratio, 2)
    benchmark.extra_info["times real time"] = round(DT * ticks / looped)
    benchmark.extra_info["times the loop through Python"] = round(slow / looped, 1)
    benchmark(simulate_closed_loop, renderer, experiment, scene, DT)
    assert benchmark.disabled or ratio < ALLOWED
