"""What accurate motion between samples costs: every integration method's error against its time.

Run it as `python -m hapticeval.examples.studies.integrators -o pictures`.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.cli import run_program
from hapticeval.commands.arguments import (
    Folder,
)
from hapticeval.commands.draw import DRAW_CODES
from hapticeval.commands.terminal import say, wrote_lines
from hapticeval.compiled import compiled
from hapticeval.devices.device import Device
from hapticeval.devices.integration import STEP_TOLERANCE, Method, cash_karp, control, default_method, runge_kutta
from hapticeval.devices.motion_kernels import Grip, Load, Motion, advance, motion_of
from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
from hapticeval.reports.canvas import INK, figure, save_figure
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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


def euler() -> Method:
    """Explicit Euler: order 1."""
    return runge_kutta("euler", 1, [], [1.0])


def semi_implicit_euler() -> Method:
    """Semi-implicit Euler, order 1: the new position is had from the new velocity."""
    zero = np.zeros(1)  # b̄ = b = 1: q⁺ = q + h q̇ + h² a = q + h q̇⁺
    return Method("semi-implicit-euler", 1, np.zeros((1, 1)), np.ones(1), np.zeros((1, 1)), np.ones(1), zero, zero)


def rk4() -> Method:
    """The classical method of Runge and Kutta: order 4."""
    return runge_kutta("rk4", 4, [[0.5], [0.0, 0.5], [0.0, 0.0, 1.0]], [1 / 6, 1 / 3, 1 / 3, 1 / 6])


def dormand_prince() -> Method:
    """Dormand and Prince's pair 5(4): seven stages, the last one for the error."""
    b = [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]
    return runge_kutta(
        "dormand-prince",
        5,
        [
            [1 / 5],
            [3 / 40, 9 / 40],
            [44 / 45, -56 / 15, 32 / 9],
            [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
            [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
            b,
        ],
        [*b, 0.0],
        [5179 / 57600, 0.0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40],
        error_order=4,
    )


def verner() -> Method:
    """Verner's pair 6(5): eight stages."""
    return runge_kutta(
        "verner",
        6,
        [
            [1 / 6],
            [4 / 75, 16 / 75],
            [5 / 6, -8 / 3, 5 / 2],
            [-165 / 64, 55 / 6, -425 / 64, 85 / 96],
            [12 / 5, -8.0, 4015 / 612, -11 / 36, 88 / 255],
            [-8263 / 15000, 124 / 75, -643 / 680, -81 / 250, 2484 / 10625],
            [3501 / 1720, -300 / 43, 297275 / 52632, -319 / 2322, 24068 / 84065, 0.0, 3850 / 26703],
        ],
        [3 / 40, 0.0, 875 / 2244, 23 / 72, 264 / 1955, 0.0, 125 / 11592, 43 / 616],
        [13 / 160, 0.0, 2375 / 5984, 5 / 16, 12 / 85, 3 / 44, 0.0, 0.0],
        error_order=5,
    )


def dop853() -> Method:
    """Hairer's method of order 8, with its error estimate of order 5: twelve stages. The coefficients are scipy's."""
    from scipy.integrate import DOP853

    a, b = np.array(DOP853.A)[:12, :12], np.array(DOP853.B)
    e = np.array(DOP853.E5)[:12]
    return Method("dop853", 8, a, b, a @ a, b @ a, e, e @ a, error_order=5)


METHODS = {
    "euler": euler,
    "semi-implicit-euler": semi_implicit_euler,
    "rk4": rk4,
    "cash-karp": cash_karp,
    "dormand-prince": dormand_prince,
    "verner": verner,
    "dop853": dop853,
}
"""Name -> how to make it."""

DEFAULT = default_method().name


@compiled
def advance_many(motion: Motion, states: Array, afresh: bool, torque: Array) -> int:
    """Move a device by a tick for each row of `torque` (n, N), N m or N; return all steps.

    Joints (rad or m) and rates after each tick go to `states` (k, m), a row of 2 N each, from row 1 on. `afresh`: each
    tick starts from the state that is there already. Otherwise it starts where the last one ended.
    """
    ticks, size = torque.shape
    step_count = 0
    joints, rates = np.empty(size), np.empty(size)
    start = states.copy()
    for tick in range(ticks):
        if afresh or tick == 0:
            for i in range(size):
                joints[i], rates[i] = start[tick, i], start[tick, size + i]
        step_count += advance(motion, tick, 0.0, motion.load.dt, joints, rates, torque[tick])
        for i in range(size):
            states[tick + 1, i], states[tick + 1, size + i] = joints[i], rates[i]
    return step_count


class Integrator:
    """Integrates a benchmark by one method, with the kernel of the closed loop; `knobs` are from `control`."""

    def __init__(self, benchmark: IntegrationBenchmark, method: Method, knobs: Array) -> None:
        self.benchmark = benchmark
        load = Load(benchmark.dt, np.zeros_like(benchmark.path), Grip(benchmark.path, benchmark.grip), None)
        self.motion = motion_of(benchmark.device, load, method, knobs)

    def __call__(self, *, afresh: bool) -> tuple[Array, int]:
        """Return states (n + 1, 2 N) and the number of steps; `afresh`: each tick starts from the reference state."""
        states = self.benchmark.states.copy()
        steps = advance_many(self.motion, states, afresh, self.benchmark.torque)
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
        "default": {"method": DEFAULT, "tolerance": STEP_TOLERANCE},
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


STEM = "integrators"
"""The files' name."""

LOOKS = {
    "euler": ("#999999", "o"),
    "semi-implicit-euler": ("#555555", "s"),
    "rk4": ("#56b4e9", "^"),
    "cash-karp": ("#d55e00", "D"),
    "dormand-prince": ("#0072b2", "v"),
    "verner": ("#cc79a7", "<"),
    "dop853": ("#009e73", "P"),
}
"""Colour and marker by integration method."""

TARGET_COLOUR = "#e69f00"
"""Of the line of the error that closed loops promise."""

MILLISECONDS = 1e3
"""Milliseconds in a second."""


def write_precision(directory: Path, document: Mapping[str, Any]) -> list[Path]:
    """Draw a study of the integrators into `directory` as SVG and PNG, with its numbers as JSON.

    `document` is that of `study_integrators`. Return the paths written. Raises `HapticevalError` where a file cannot
    be written.
    """
    devices = document["devices"]
    width = 0.6 + 4.2 * len(devices)
    with figure(width, 4.6, settings={"grid.linewidth": 0.4}) as fig:
        panels = fig.subplots(1, len(devices), squeeze=False, sharey=True)[0]
        fig.subplots_adjust(left=0.7 / width, right=0.985, top=0.92, bottom=0.235, wspace=0.05)
        for axes, device in zip(panels, devices, strict=True):
            _draw_panel(axes, device, document)
        panels[0].set_ylabel("relative error after a tick, largest")
        handles, labels = panels[0].get_legend_handles_labels()
        fig.legend(handles, labels, loc="lower center", ncols=4, handlelength=1.6)
        return save_figure(fig, directory, STEM, document=document)


def _draw_panel(axes: Axes, device: Mapping[str, Any], document: Mapping[str, Any]) -> None:
    """Draw one device: each method's error against its computing time, and what closed loops use."""
    default = document["default"]
    axes.set(xscale="log", yscale="log", xlabel="computing time a simulated second (ms)")
    axes.grid(True, which="major")
    for method in device["methods"]:
        name, (colour, marker) = method["name"], LOOKS[method["name"]]
        # ms of computing for each simulated second, and the relative error.
        places = [(MILLISECONDS * point["seconds_per_second"], point["error"]) for point in method["points"]]
        style: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 4, "linewidth": 0.9}
        axes.plot(*zip(*places, strict=True), label=f"{name} (order {method['order']})", **style)
        if name == default["method"]:
            # The place of the tolerance that closed loops use among those that were measured.
            used = [point["tolerance"] for point in method["points"]].index(default["tolerance"])
            axes.plot(
                *places[used], "o", markersize=13, markerfacecolor="none", markeredgecolor=INK,
                markeredgewidth=1.4, label=f"what closed loops use: {name}, tolerance {default['tolerance']:.0e}",
            )  # fmt: skip
    target = document["target"]
    # The relative error that closed loops promise.
    axes.axhline(target, color=TARGET_COLOUR, linewidth=1.0, zorder=1.5)
    axes.annotate(
        f"{target:g}: what closed loops promise", (0.99, target), xycoords=("axes fraction", "data"), ha="right",
        va="bottom", fontsize=7,
    )  # fmt: skip
    axes.set_title(f"{device['device']}, ticks of {MILLISECONDS * document['dt']:g} ms", fontsize=9)


def integrators(
    directory: Folder = Path(),
) -> None:
    """Draw how exactly each method moves the robot between samples, and in what time.

    A hand draws the robot along a circle against motors that jump at each tick. Errors are against scipy's DOP853 at
    its tightest.

    \b
    Example:
      python -m hapticeval.examples.studies.integrators -o pictures
    """
    document = study_integrators([Parallelogram2(), Parallelogram3()])
    chosen = document["default"]
    for device in document["devices"]:
        methods = {method["name"]: method for method in device["methods"]}
        # The measured point of the method and tolerance that closed loops use.
        point = next(p for p in methods[chosen["method"]]["points"] if p["tolerance"] == chosen["tolerance"])
        say(
            f"{device['device']}: closed loops use {chosen['method']} with a tolerance of {chosen['tolerance']:.0e}: "
            f"error {point['error']:.1e} after a tick at the most, {1.0 / point['seconds_per_second']:.0f} times real "
            "time"
        )
    say(wrote_lines(write_precision(directory, document)))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code."""
    return run_program(integrators, DRAW_CODES, arguments)


if __name__ == "__main__":
    sys.exit(main())
