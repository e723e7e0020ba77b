"""Energy in closed loop: what the motors, the hand and friction do is what the kinetic energy changes by.

No device stores any other energy. What a renderer's spring stores is kept in the loop's own books, see the last test.

Every tick is integrated anew from the recording: quintic Hermite motion between the recorded joints and rates, with the
accelerations that the device's own equations give at both ends, and Gauss's five points for the powers. Both are of
order 10 or exact in the tick, and the motion is promised to 1e-9 of the rates, which is 2e-9 of the kinetic energy.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hapticeval.compiled import compiled
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.parallelogram import ENCODER_STEP, Dynamics, Parallelogram2, Parallelogram3
from hapticeval.devices.point_mass import PointMass
from hapticeval.discovery import load, own_renderers, resolve
from hapticeval.effects.actuators import Delay, JointFriction, Saturation
from hapticeval.effects.sensors import Encoder, ForceSensor, VelocityFilter
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.geometry.catalogue import ellipse, ellipsoid, line, sphere, torus
from hapticeval.laws import law_data
from hapticeval.renderer import CompiledStep, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment, Hand, Path

DT = 1e-3
FRICTION, LIMIT = 0.02, 0.4
EFFECTS = {
    "ideal": (),
    "real": (
        Encoder(ENCODER_STEP),
        VelocityFilter(80.0),
        ForceSensor(step=0.01, noise=0.01, cutoff=200.0),
        Saturation(LIMIT),
        Delay(DT),
        JointFriction(FRICTION),
    ),
}
NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)


@compiled
def draw_home(data, hip, velocity, push, dt, ihip, force):
    """A spring and a damper to the origin."""
    for i in range(hip.shape[0]):
        ihip[i] = 0.0
        force[i] = -data.params[0] * hip[i] - data.params[1] * velocity[i]
    return 0


class Spring:
    def __init__(self, stiffness, damping):
        self.law = CompiledStep(draw_home, law_data((stiffness, damping)), {})

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        ihip, force, none = np.empty_like(hip), np.empty_like(hip), np.zeros_like(hip)
        draw_home(self.law.data, hip, velocity, none, dt, ihip, force)
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
    torque, ideal = recording.force, not any(each.stage for each in scene.effects)
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
    friction = FRICTION if scene.effect(JointFriction) else 0.0
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


MADE = (PointMass(0.3), PointMass(0.3, 3), Parallelogram2(), Parallelogram3())
DEVICES = {f"{each.name}{each.dimension}": each for each in MADE}
LOOPS = [
    (name, loop, effects, "drawn" if (i + j + k) % 2 else "pushed")
    for i, name in enumerate(DEVICES)
    for j, loop in enumerate(InnerLoop)
    for k, effects in enumerate(EFFECTS)
]
"""Every device, inner loop and set of effects, and every pair of these with a hand that draws and one that pushes."""


@pytest.mark.parametrize(("name", "loop", "effects", "hand"), LOOPS)
def test_energy_is_accounted_for(name, loop, effects, hand):
    device = DEVICES[name]
    scene = Scene(model=line(), mass=1.0, device=device, inner_loop=loop, effects=EFFECTS[effects])
    trial = experiment(device.dimension, hand == "drawn")
    recording = simulate_closed_loop(Spring(300.0, 3.0), trial, scene, DT)
    assert "ended" not in recording.meta
    changed, work, kinetic = balance(recording, trial, scene).T
    assert changed.size > 0.8 * len(recording)
    assert np.abs(changed).max() > 1e-4 * kinetic.max()
    assert np.all(np.abs(changed - work) <= 4e-9 * kinetic + 1e-15)


def names():
    """Every reference renderer with every scheme and on every representation, with a model each.

    Not the ideal contact, which is no controller of a device: its tool moves as its own forces say.
    """
    for base in own_renderers():
        factory = load(base)
        if base == "ideal":
            continue
        for scheme in getattr(factory, "regulations", ()):
            yield f"{base}+{scheme}", ellipse()
            if base == "minimum-distance":
                yield f"{base}+{scheme}", ellipsoid()
        for number, representation in enumerate(factory.representations):
            scheme = f"+{factory.regulations[-3 + number % 3]}" if base != "set-stabilisation" else ""
            if representation == "atlas":
                yield f"{base}@{representation}", sphere()
            elif representation != "curve" or not scheme:
                scheme = "+pp-pd" if "pp-pd-c" in scheme else scheme
                yield f"{base}{scheme}@{representation}", ellipse()
    for model in (sphere(), ellipsoid(), torus()):
        yield "set-stabilisation", model


def loops():
    """Each of them on a device, with an inner loop, effects and a hand that go round as the list goes on.

    What brings no renderer, device, inner loop, effect or hand that was not there before is left to `make system`.
    """
    devices = {2: (PointMass(0.3), Parallelogram2()), 3: (PointMass(0.3, 3), Parallelogram3())}
    seen = {2: 0, 3: 0}
    known = set()
    for name, model in names():
        turn = seen[model.dimension]
        seen[model.dimension] += 1
        device = devices[model.dimension][turn % 2]
        loop, effects = list(InnerLoop)[turn % 3], list(EFFECTS)[turn // 2 % 2]
        hand, bilateral = turn // 4 % 2 == 1, turn % 5 > 2
        label = f"{name}-{model.name}-{device.name}-{loop.name.lower()}-{effects}"
        brings = {re.split("[+@]", name)[0], (device.name, device.dimension, loop), (effects, hand, bilateral)} - known
        known |= brings
        marks = () if brings else pytest.mark.system
        yield pytest.param(name, model, device, loop, effects, hand, bilateral, id=label, marks=marks)


def pressing(model, hand):
    """From 2 mm outside, pressed onto a model and along it, and drawn off."""
    toward = np.zeros((1, model.dimension))
    toward[0, 0], toward[0, -1] = 0.03, 0.2
    foot, normal, _, _ = (each[0] for each in model.boundary.closest_point(toward))
    along = np.zeros_like(normal)
    along[0], along[-1] = normal[-1], -normal[0]
    along /= np.linalg.norm(along)
    times = np.array([0.0, 0.05, 0.1, 0.15])
    way = np.array([0.002, -0.01, -0.005, 0.02])[:, None] * normal + foot
    way += np.array([0.0, 0.005, 0.01, 0.01])[:, None] * along
    grip = Hand(path=Path(times, way), stiffness=100.0, damping=1.0) if hand else None
    force = np.array([-1.0, -2.0, -1.0, 1.0])[:, None] * normal + 0.5 * along
    return Experiment(0.15, foot + 2e-3 * normal, 0.1 * along - 0.1 * normal, times, force, grip)


@pytest.mark.parametrize(("name", "model", "device", "loop", "effects", "hand", "bilateral"), list(loops()))
def test_energy_is_accounted_for_with_every_renderer(name, model, device, loop, effects, hand, bilateral):
    scene = Scene(
        model=model, stiffness=300.0, damping=8.0, mass=0.3, bilateral=bilateral, device=device,
        inner_loop=loop, effects=(Viscosity(0.2), *EFFECTS[effects]),
    )  # fmt: skip
    trial, renderer = pressing(model, hand), wrapped(resolve(name)(scene))
    recording = simulate_closed_loop(renderer, trial, scene, DT)
    assert "ended" not in recording.meta
    assert renderer.law is not None
    # Without it the loop asks the renderer tick by tick.
    asked = simulate_closed_loop(replace(renderer, law=None), trial, scene, DT)
    for channel in asked.channels:
        np.testing.assert_array_equal(recording.channels[channel], asked.channels[channel])
    felt = np.any(recording.force != 0.0, axis=1)
    assert np.mean(felt) > 0.1
    assert bilateral or not felt[0]
    changed, work, kinetic = balance(recording, trial, scene).T
    assert changed.size > 0.8 * len(recording)
    by_force = np.abs(np.sum(recording.force[:-1] * np.diff(recording.hip, axis=0), axis=1))
    assert by_force.sum() > 1e-2 * kinetic.max()
    assert np.all(np.abs(changed - work) <= 4e-9 * kinetic + 1e-15)


def test_the_list_has_every_device_inner_loop_and_effect():
    seen = [case.values for case in loops()]
    assert {(case[2].name, case[2].dimension, case[3]) for case in seen} == {
        (device.name, device.dimension, loop) for device in DEVICES.values() for loop in InnerLoop
    }
    assert {(case[4], case[5], case[6]) for case in seen} == {
        (effects, hand, bilateral) for effects in EFFECTS for hand in (False, True) for bilateral in (False, True)
    }


def test_the_printed_robot_creates_energy_that_no_one_gave():
    """(2.26) as printed lacks the terms that its turning base's changing inertia makes."""
    device = Parallelogram3(dynamics=Dynamics.PRINTED)
    scene = Scene(model=line(), mass=1.0, device=device)
    trial = Experiment(0.1, np.zeros(3), np.array([0.3, 0.5, 0.5]), np.zeros(1), np.zeros((1, 3)))
    changed, work, kinetic = balance(simulate_closed_loop(Spring(1e-3, 0.0), trial, scene, DT), trial, scene).T
    assert np.abs(changed - work).max() > 1e-6 * kinetic.max()


@pytest.mark.parametrize("device", [PointMass(0.3, 3), Parallelogram3()], ids=lambda d: d.name)
def test_a_spring_to_the_surface_keeps_what_it_takes(device):
    """PP's force is that of the potential K n^2 / 2; held, it is late by the change of the force over the tick."""
    scene = Scene(model=ellipsoid(), stiffness=300.0, mass=0.3, device=device)
    trial = pressing(scene.model, hand=True)
    recording = simulate_closed_loop(resolve("minimum-distance+pp")(scene), trial, scene, DT)
    n = np.minimum(scene.model.surface.closest_point(recording.hip).distance, 0.0)
    taken = -np.sum(recording.force[:-1] * np.diff(recording.hip, axis=0), axis=1)
    stored = 0.5 * scene.stiffness * np.diff(n**2)
    step = np.linalg.norm(np.diff(recording.hip, axis=0), axis=1)
    late = np.linalg.norm(np.diff(recording.force, axis=0), axis=1) * step
    assert np.all(np.abs(taken - stored) <= late + 1e-12)
    assert 0.5 * scene.stiffness * n.min() ** 2 > 20.0 * late.max()
