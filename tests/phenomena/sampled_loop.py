"""A point mass about a line or a circle under a law that is sampled and held: recordings for the dynamic checks."""

from __future__ import annotations

from functools import cache

import numpy as np

from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.viscosity import viscosity_of
from hapticeval.geometry.catalogue import circle, line
from hapticeval.phenomena.check import Runs
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene

MASS = 0.1
CIRCLE = Scene(model=circle(size=2.0), stiffness=50.0, damping=4.47, mass=MASS, bilateral=True)
LINE = Scene(model=line(), stiffness=50.0, damping=4.47, mass=MASS, bilateral=True)


def frame(scene, hip):
    """Normal, distance and curvature, by hand: the models are a line along x and a circle about the origin."""
    if scene.model.name == "line":
        return np.array([0.0, 1.0]), hip[1], 0.0
    radius = scene.model.size / 2.0
    distance = np.hypot(*hip)
    return hip / distance, distance - radius, 1.0 / radius


def force(scheme, scene, hip, velocity):
    """The laws of section 4.2 with their damping exact, and set stabilisation with the scene's viscosity."""
    normal, n, kappa = frame(scene, hip)
    k, d = scene.stiffness, scene.damping
    n_rate = normal @ velocity
    along = velocity - n_rate * normal
    spring = -k * n * normal
    if scheme == "pp":
        return spring
    if scheme == "pp-v":
        return spring - d * velocity
    if scheme == "pp-pd":
        return spring - d * n_rate * normal
    if scheme == "pp-d":
        return spring - d * (velocity - along / (1.0 + n * kappa))
    stretch = 1.0 + n * kappa
    foot = along / stretch
    bend = -kappa * (along @ along) / stretch * normal
    turn = 2.0 * kappa * n_rate * foot
    return spring - d * n_rate * normal + scene.mass * (bend + turn) - viscosity_of(scene) * stretch * foot


def run(scheme, scene, position, velocity, duration, dt, *, law=force, push=None):
    """One recording; `push` is a constant force of the operator's that lasts for the first tenth."""
    device = PointMass(scene.mass)
    count = round(duration / dt) + 1
    hip, speed = np.array(position, dtype=float), np.array(velocity, dtype=float)
    rows = np.empty((count, 4, 2))
    for tick in range(count):
        given = law(scheme, scene, hip, speed)
        operator = np.zeros(2) if push is None or tick * dt > 0.1 * duration else np.array(push)
        rows[tick] = hip, speed, given, operator
        hip, speed = device.advance(hip, speed, given, operator, operator, dt)
    hips, speeds, forces, operators = np.moveaxis(rows, 1, 0)
    channels = {"hip": hips, "ihip": hips, "force": forces, "velocity": speeds, "operator_force": operators}
    return Recording(np.arange(count) * dt, channels, {"source": "experiment", "dt": dt})


def runs(scheme, scene, position, velocity, duration, *, dt=1e-3, law=force, name=None, push=None):
    """The run with its siblings, made when asked for."""

    @cache
    def at(factor):
        return run(scheme, scene, position, velocity, duration, dt / factor, law=law, push=push)

    def at_speed(factor):
        return run(scheme, scene, position, np.multiply(factor, velocity), duration / factor, dt, law=law, push=push)

    return Runs(at(1), refine=at, at_speed=at_speed, law=name)
