"""What accurate motion between samples costs: every integration method's error against its time."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hapticeval.devices.device import Device
from hapticeval.devices.integration import DEFAULT, METHODS, TOLERANCE, Method, control
from hapticeval.types import Array

TARGET = 1e-9
"""Relative error between samples that closed loops promise."""

TICK = 1e-3
"""Seconds of a tick."""

SUBSTEPS = (1, 2, 4, 8, 16, 32, 64)
TOLERANCES = tuple(10.0**-k for k in range(4, 14))


@dataclass(frozen=True, eq=False)
class IntegrationBenchmark:
    """A motion of a device to integrate, with the states that a very exact method finds.

    - `torque` (n, N), N m: held in each tick of `dt` s;
    - `path` (n + 1, N), m, and `grip` (2,), N/m and N s/m: where the hand goes, and its spring and damper;
    - `states` (n + 1, 2 N): the reference joints and rates at the ticks.
    """

    device: Device
    dt: float
    torque: Array
    path: Array
    grip: Array
    states: Array


def integration_benchmark(device: Device, *, ticks: int = 300, dt: float = TICK) -> IntegrationBenchmark:
    """Make the benchmark of a device: a hand draws a circle from home, against motors that jump at each tick.

    The hand has 500 N/m and 5 N s/m, the circle 3 cm and 2 Hz. The states come from scipy's DOP853 at its
    tightest, tick by tick, on the device's Python methods.
    """
    size = device.dimension
    grip = np.array([500.0, 5.0])
    angle = 2.0 * math.pi * 2.0 * dt * np.arange(ticks + 1)
    path = np.zeros((ticks + 1, size))
    path[:, 0], path[:, 1] = 0.03 * np.sin(angle), 0.03 * (1.0 - np.cos(angle))
    # N m, constant in each tick and jumping at its ends: no method may step across one.
    torque = 0.2 * np.random.default_rng(0).standard_normal((ticks, size))
    states = np.zeros((ticks + 1, 2 * size))
    for k in range(ticks):
        # From tick to tick, for the right-hand side is smooth within one only.
        states[k + 1] = advance_reference(device, states[k], torque[k], path[k : k + 2], grip, dt)
    return IntegrationBenchmark(device, dt, torque, path, grip, states)


def advance_reference(device: Device, state: Array, torque: Array, path: Array, grip: Array, dt: float) -> Array:
    """Return a device's state (2 N,), joints and rates, after a tick of `dt` (s), by scipy's DOP853: the reference.

    It starts from `state` (2 N,) with the `torque` (N,), N m, held; the hand moves along `path` (2, N), m, with the
    spring and the damper of `grip` (2,), N/m and N s/m.
    """
    from scipy.integrate import solve_ivp

    slope = partial(_slope, device=device, torque=torque, path=path, grip=grip, dt=dt)
    solution = solve_ivp(slope, (0.0, dt), state, method="DOP853", rtol=3e-14, atol=1e-16)
    return np.asarray(solution.y[:, -1])


def _slope(t: float, state: Array, *, device: Device, torque: Array, path: Array, grip: Array, dt: float) -> Array:
    joints, rates = np.split(state, 2)
    jacobian = device.jacobian(joints)
    displacement = path[1] - path[0]
    # The hand: a spring K (y_h - y) and a damper B (ẏ_h - ẏ), its path straight within the tick.
    push = grip[0] * (path[0] + t / dt * displacement - device.position(joints)) + grip[1] * (
        displacement / dt - jacobian @ rates
    )
    # M q̈ = τ + Jᵀ F_hand - bias(q, q̇).
    net = torque + jacobian.T @ push - device.bias(joints, rates)
    return np.concatenate([rates, np.linalg.solve(device.inertia(joints), net)])


class Integrator:
    """Integrates a benchmark by one method, with the kernel of the closed loop; `knobs` are from `control`."""

    def __init__(self, benchmark: IntegrationBenchmark, method: Method, knobs: Array) -> None:
        from hapticeval.devices.motion_kernels import Grip, Load, advance_many, motion_of

        self.benchmark = benchmark
        self.advance = advance_many
        load = Load(benchmark.dt, np.zeros_like(benchmark.path), Grip(benchmark.path, benchmark.grip), None)
        self.motion = motion_of(benchmark.device, load, method, knobs)

    def __call__(self, *, afresh: bool) -> tuple[Array, int]:
        """Return states (n + 1, 2 N) and the number of steps; `afresh`: each tick starts from the reference state."""
        states = self.benchmark.states.copy()
        steps = self.advance(self.motion, states, afresh, self.benchmark.torque)
        return states, int(steps)


def relative_errors(states: Array, reference: Array) -> Array:
    """Return the error after each tick, relative to the largest joint and the largest rate of the tick: (n,).

    `states` and `reference` are (n + 1, 2 N), joints (rad, or m) and then rates (rad/s, or m/s); the first row is the
    start, which has no error.
    """
    # The first half of a state are joints, the second half rates: of different units, so each is relative by itself.
    size = states.shape[1] // 2
    astray = np.abs(states - reference)[1:]
    parts = [
        astray[:, part].max(axis=1) / np.abs(reference[1:, part]).max(axis=1)
        for part in (slice(0, size), slice(size, None))
    ]
    return np.asarray(np.maximum(*parts))


def study_integrators(devices: Sequence[Device], *, ticks: int = 300, rounds: int = 7) -> dict[str, Any]:
    """Measure every method at every setting on every device, as JSON values.

    The error after a tick is relative, the time is per simulated second.
    """
    return {
        "target": TARGET,
        "dt": TICK,
        "default": {"method": DEFAULT, "tolerance": TOLERANCE},
        "devices": [
            {"device": device.name, "methods": _measure_methods(integration_benchmark(device, ticks=ticks), rounds)}
            for device in devices
        ],
    }


def _measure_methods(task: IntegrationBenchmark, rounds: int) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "order": method.order,
            "adaptive": method.adaptive,
            "points": _measure_settings(task, method, rounds),
        }
        for name, method in ((name, make()) for name, make in METHODS.items())
    ]


def _measure_settings(task: IntegrationBenchmark, method: Method, rounds: int) -> list[dict[str, Any]]:
    points = []
    ticks = task.torque.shape[0]
    for value in TOLERANCES if method.adaptive else SUBSTEPS:
        knob = "tolerance" if method.adaptive else "substeps"
        knobs = control(method, tolerance=value) if method.adaptive else control(method, substeps=int(value))
        run = Integrator(task, method, knobs)
        # The error of one tick: each starts from the reference, so that errors do not add up.
        states, _ = run(afresh=True)
        tick_errors = relative_errors(states, task.states)
        _, steps = run(afresh=False)
        # The shortest of the rounds: what disturbs a round only adds to its time.
        best = math.inf
        for _ in range(rounds):
            started = time.perf_counter()
            run(afresh=False)
            best = min(best, time.perf_counter() - started)
        points.append(
            {
                knob: value,
                "error": float(tick_errors.max()),
                "median_error": float(np.median(tick_errors)),
                "steps_per_tick": steps / ticks,
                "seconds_per_second": best / (ticks * task.dt),
            }
        )
    return points
