"""Energy in closed loop: what the motors, the hand and friction do is what the kinetic energy changes by.

Every tick is integrated anew from the recording: quintic Hermite motion between the recorded joints and rates, with the
accelerations that the device's own equations give at both ends, and Gauss's five points for the powers. Both are of
order 10 or exact in the tick, and the motion is promised to 1e-9 of the rates, which is 2e-9 of the kinetic energy.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hapticeval.closed_loop import drive
from hapticeval.compiled import compiled
from hapticeval.devices.imperfections import ENCODER_STEP, ForceSensor, Imperfections
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
from hapticeval.devices.parallelogram_parameters import Dynamics
from hapticeval.devices.point_mass import PointMass
from hapticeval.geometry.catalogue import line
from hapticeval.renderer import CompiledLaw
from hapticeval.scene import Scene
from hapticeval.stimulus import Experiment, Hand, Path

DT = 1e-3
FRICTION, LIMIT = 0.02, 0.4
EFFECTS = {
    "ideal": Imperfections(),
    "real": Imperfections(
        encoder_step=ENCODER_STEP,
        velocity_cutoff=80.0,
        torque_limit=LIMIT,
        delay=DT,
        friction=FRICTION,
        force_sensor=ForceSensor(step=0.01, noise=0.01, cutoff=200.0),
    ),
}
NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)


@compiled
def draw_home(reals, pieces, samples, memory, hip, velocity, push, dt, ihip, force):
    """A spring and a damper to the origin."""
    for i in range(hip.shape[0]):
        ihip[i] = 0.0
        force[i] = -reals[0] * hip[i] - reals[1] * velocity[i]
    return 0


class Spring:
    def __init__(self, stiffness, damping):
        self.law = CompiledLaw(draw_home, np.array([stiffness, damping]), np.zeros((1, 1)), np.zeros((1, 1)), 0, {})

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        ihip, force, none = np.empty_like(hip), np.empty_like(hip), np.zeros_like(hip)
        draw_home(*self.law[1:4], np.zeros(0), hip, velocity, none, dt, ihip, force)
        return ihip, force


def experiment(size, hand):
    """From beside home, drawn along a triangle by the hand, and pushed by a force that grows and goes."""
    position, velocity, way = np.zeros(size), np.zeros(size), np.zeros((4, size))
    position[0], velocity[1] = 0.02, 0.3
    way[:, :2] = (0.02, 0.0), (0.05, 0.02), (0.0, 0.03), (0.02, 0.0)
    times = np.array([0.0, 0.05, 0.1, 0.15])
    grip = Hand(path=Path(times, way), stiffness=300.0, damping=3.0) if hand else None
    force = np.zeros((4, size))
    force[1, 0], force[2, -1] = 2.0, -1.0
    return Experiment(0.15, position, velocity, times, force, grip)


def dampings(device):
    """What each joint loses by b q̇², N m s/rad: Table A.1."""
    if isinstance(device, PointMass):
        return np.zeros(device.dimension)
    each = device.constants
    return np.array([each.b1, each.b2, each.b3][3 - device.dimension :])


def motors(recording, scene):
    """The motors' torque in each tick; of a point mass it is made of the renderer's force here."""
    if "joint_torque" in recording.channels:
        return recording.channels["joint_torque"]
    torque, ideal = recording.force, scene.imperfections == Imperfections()
    if scene.inner_loop is InnerLoop.LINEARISED:
        felt = np.zeros_like(torque) if ideal else recording.channels["measured_force"]
        torque = scene.robot.mass * (torque + felt) / scene.mass - felt
    if ideal:
        return torque
    return np.vstack([np.zeros((1, torque.shape[1])), np.clip(torque, -LIMIT, LIMIT)[:-1]])


def pushes(trial, time, joints, rates, device, tick):
    """F_o at a time within a tick."""
    ends = DT * np.array([tick, tick + 1])
    share = (time - ends[0]) / DT
    force = (1.0 - share) * trial.operator_force(ends)[0] + share * trial.operator_force(ends)[1]
    if trial.hand is not None:
        path = trial.hand.desired(ends)
        force = force + trial.hand.stiffness * (path[0] + share * (path[1] - path[0]) - device.position(joints))
        force = force + trial.hand.damping * ((path[1] - path[0]) / DT - device.jacobian(joints) @ rates)
    return force


@cache
def hermite():
    """Coefficients of the quintic on [0, 1] from values, slopes and curvatures at both ends."""
    rows = []
    for s in (0.0, 1.0):
        powers = np.arange(6)
        rows.append(s**powers)
        rows.append(np.array([k * s ** max(k - 1, 0) for k in powers]))
        rows.append(np.array([k * (k - 1) * s ** max(k - 2, 0) for k in powers]))
    return np.linalg.inv(np.array(rows))


def balance(recording, trial, scene):
    """Change of kinetic energy, and work less losses, in each tick in which no joint stops or breaks loose: (n, 2)."""
    device = scene.robot
    joints = recording.channels.get("joint_position", recording.hip)
    rates = recording.channels.get("joint_velocity", recording.velocity)
    torque = motors(recording, scene)
    friction = scene.imperfections.friction or 0.0
    kinetic = np.array([0.5 * v @ device.inertia(q) @ v for q, v in zip(joints, rates, strict=True)])
    rows = []
    for k in range(len(recording) - 1):
        held = friction * np.all(rates[k : k + 2] == 0.0, axis=0) > 0.0
        if friction and np.any((rates[k] * rates[k + 1] <= 0.0) & ~held):
            continue
        against = friction * np.sign(rates[k])
        ends = []
        for at in (k, k + 1):
            jacobian = device.jacobian(joints[at])
            net = torque[k] + jacobian.T @ pushes(trial, DT * at, joints[at], rates[at], device, k) - against
            bend = np.linalg.solve(device.inertia(joints[at]), net - device.bias(joints[at], rates[at]))
            bend[held] = 0.0  # all devices' inertias are diagonal
            ends += [joints[at], DT * rates[at], DT * DT * bend]
        powers = hermite() @ np.array(ends)
        work = 0.0
        for s, weight in zip(0.5 * (NODES + 1.0), 0.5 * DT * WEIGHTS, strict=True):
            q = s ** np.arange(6) @ powers
            v = np.array([n * s ** max(n - 1, 0) for n in range(6)]) @ powers / DT
            push = pushes(trial, DT * (k + s), q, v, device, k)
            work += weight * (torque[k] @ v + push @ (device.jacobian(q) @ v))
            work -= weight * (dampings(device) @ v**2 + np.abs(v) @ np.full(v.size, friction))
        rows.append((kinetic[k + 1] - kinetic[k], work, max(kinetic[k], kinetic[k + 1])))
    return np.array(rows)


@pytest.mark.parametrize("hand", [False, True], ids=["pushed", "drawn"])
@pytest.mark.parametrize("effects", EFFECTS)
@pytest.mark.parametrize("loop", list(InnerLoop))
@pytest.mark.parametrize(
    "device",
    [PointMass(0.3), PointMass(0.3, 3), Parallelogram2(), Parallelogram3()],
    ids=lambda d: f"{d.name}{d.dimension}",
)
def test_energy_is_accounted_for(device, loop, effects, hand):
    scene = Scene(model=line(), mass=1.0, device=device, inner_loop=loop, imperfections=EFFECTS[effects])
    trial = experiment(device.dimension, hand)
    recording = drive(Spring(300.0, 3.0), trial, scene, DT)
    assert "ended" not in recording.meta
    changed, work, kinetic = balance(recording, trial, scene).T
    assert changed.size > 0.8 * len(recording)
    assert np.abs(changed).max() > 1e-4 * kinetic.max()
    assert np.all(np.abs(changed - work) <= 4e-9 * kinetic + 1e-15)


def test_the_printed_robot_creates_energy_that_no_one_gave():
    """(2.26) as printed lacks the terms that its turning base's changing inertia makes."""
    device = Parallelogram3(dynamics=Dynamics.PRINTED)
    scene = Scene(model=line(), mass=1.0, device=device)
    trial = Experiment(0.1, np.zeros(3), np.array([0.3, 0.5, 0.5]), np.zeros(1), np.zeros((1, 3)))
    changed, work, kinetic = balance(drive(Spring(1e-3, 0.0), trial, scene, DT), trial, scene).T
    assert np.abs(changed - work).max() > 1e-6 * kinetic.max()
