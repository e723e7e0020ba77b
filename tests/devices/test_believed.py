"""What an inner loop believes of the device, apart from what the device is."""

from __future__ import annotations

import numpy as np
import pytest

from hapticeval.devices.catalogue import make_device
from hapticeval.discovery import resolve
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.suite.case import build_scene
from hapticeval.suite.reading import load_suite

LINE = make_model("line")
TABLE = {
    "stiffness": 50.0,
    "damping": 4.47,
    "mass": 0.1,
    "bilateral": True,
    "device": "parallelogram-2dof",
    "inner_loop": "linearised",
}
DAMPINGS = {"b1": 0.461, "b2": 0.105, "b3": 0.0336}


def run(case):
    (found,) = [each for each in load_suite("experiments").cases if each.name == case]
    scene = found.build_scene()
    renderer = resolve("set-stabilisation")(scene)
    return simulate_closed_loop(renderer, found.build_stimulus(scene, renderer), scene, scene.sampling_time)


@pytest.mark.parametrize(("case", "share"), [("", 1.0), ("-believes-less", 0.8), ("-believes-more", 1.2)])
def test_dampings_that_are_wrong_brake_or_drive_the_tool(case, share):
    """v' = -(1 - share) b v of the robot's own damping over its own inertia at home: the robot moves by little."""
    recording = run(f"model-mismatch{case}")
    robot = make_device("parallelogram-2dof")
    joints = robot.joints(np.zeros(2))
    jacobian, rates = robot.jacobian(joints), np.linalg.solve(robot.jacobian(joints), [1.0, 0.0])
    slowing = -(jacobian @ np.linalg.solve(robot.inertia(joints), robot.bias(joints, rates)))[0]
    expected = 0.05 * np.exp((1.0 - share) * slowing * 2.0)
    assert recording.velocity[-1, 0] == pytest.approx(expected, rel=0.02)
    assert np.max(np.abs(recording.hip[:, 1])) < 2e-5


def test_a_robot_that_is_believed_as_it_is_changes_nothing():
    scenes = [build_scene(LINE, TABLE), build_scene(LINE, {**TABLE, "believed": DAMPINGS})]
    assert scenes[0].believed_robot == scenes[1].believed_robot
    assert scenes[0].believed_robot is scenes[0].robot


@pytest.mark.parametrize(
    "change",
    [
        {"believed": {"l1": 0.31}},
        {"believed": {"b9": 1.0}},
        {"believed": {"b1": -1.0}},
        {"believed": DAMPINGS, "device": None},
    ],
)
def test_what_cannot_be_believed_is_refused(refused, change):
    table = {name: value for name, value in {**TABLE, **change}.items() if value is not None}
    with refused(InputError):
        build_scene(LINE, table)


def test_another_robot_cannot_be_believed_in(refused):
    with refused(InputError):
        Scene(model=LINE, device=make_device("parallelogram-2dof"), believed=make_device("point-mass", mass=0.1))
