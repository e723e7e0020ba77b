"""Numbers that decide a claim of `items.toml`: of a run, and of models, robot and tables. All are in SI units."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from hapticeval.devices.catalogue import device_named
from hapticeval.devices.parallelogram import (
    COLLAPSE_STOP,
    ELBOW_HIGH,
    ELBOW_LOW,
    ENCODER_STEP,
    SHOULDER_LIMIT,
    ParallelogramParameters,
)
from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.representations import sample_level_set
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.study.bench.measure import Track, array_bytes, step_times, without_garbage_collection
from hapticeval.study.limits.loop import passive_stiffness, robot_at
from hapticeval.study.projection_field.study import surface_of
from hapticeval.types import Array, BoolArray, IntArray

TIMED_STEPS = 2000
"""Steps of which the median is a renderer's time."""

LEVEL_SET_NODES = (100, 100)
"""Samples of a level set (4.1.1)."""

SAME_TORQUE = 1e-9
"""Share of the largest torque up to which two torques are the same."""


@dataclass(frozen=True, eq=False)
class Run:
    """What a renderer did on a case; `other` is the run that a claim compares it with."""

    renderer: str
    scene: Scene
    recording: Recording
    other: Run | None = None

    @property
    def touching(self) -> BoolArray:
        """Where there is a force (n,): with encoders HIP and IHIP differ outside of a contact too."""
        return np.asarray(np.any(self.recording.force != 0.0, axis=1))

    @property
    def distance(self) -> Array:
        """The hand's signed distance from the surface (n,), m."""
        return self.scene.model.boundary.closest_point(self.recording.hip).distance

    @property
    def speed(self) -> Array:
        """How fast the hand moves along the surface (n,), m/s."""
        normal, velocity = self.scene.model.boundary.closest_point(self.recording.hip).normal, self.recording.velocity
        across = np.sum(velocity * normal, axis=1, keepdims=True) * normal
        return np.asarray(np.linalg.norm(velocity - across, axis=1))

    @property
    def depth(self) -> Array:
        """The distances from HIP to IHIP (n,), m."""
        return np.asarray(np.linalg.norm(self.recording.ihip - self.recording.hip, axis=1))

    @property
    def steps(self) -> Array:
        """How far the IHIP moves in each tick of a contact (n - 1,), m; zero where none goes on."""
        lengths = np.linalg.norm(np.diff(self.recording.ihip, axis=0), axis=1)
        return np.where(self.touching[1:] & self.touching[:-1], lengths, 0.0)

    @property
    def directions(self) -> Array:
        """The directions of the force in the plane where they touch, rad, without jumps by a turn."""
        return np.unwrap(np.arctan2(*self.recording.force[self.touching].T[::-1]))

    @property
    def polar_angle(self) -> Array:
        """The hand's polar angle (n,), rad, without jumps by a turn."""
        return np.unwrap(np.arctan2(*self.recording.hip.T[::-1]))

    @property
    def switch_rows(self) -> IntArray:
        """The rows from which on another chart is at work."""
        return np.flatnonzero(np.diff(self.recording.channels["chart"])) + 1

    @property
    def torque_difference(self) -> Array:
        """How far apart the torques by two charts are (n,), N m, of the joint where they are farthest."""
        channels = self.recording.channels
        return np.asarray(np.max(np.abs(channels["torque1"] - channels["torque2"]), axis=1))

    def rows(self, after: float = 0.0, before: float = math.inf) -> BoolArray:
        """Return which samples lie between two times (s)."""
        return (self.recording.time >= after) & (self.recording.time <= before)


def _turn(run: Run, over: Array) -> float:
    """Return over how much of a quantity (n,) the force goes from a tenth to nine tenths of its turn."""
    turn = (run.directions - run.directions[0]) / (run.directions[-1] - run.directions[0])
    begin, end = int(np.flatnonzero(turn < 0.1)[-1]), int(np.argmax(turn > 0.9))
    return abs(float(np.diff(over[run.touching][[begin, end]])[0]))


def _backwards(run: Run) -> float:
    """Return how far (m) the hand goes back about the model's centre, at its distance from there."""
    angle = run.polar_angle * np.sign(run.polar_angle[-1] - run.polar_angle[0])
    return float(np.max((np.maximum.accumulate(angle) - angle) * np.linalg.norm(run.recording.hip, axis=1)))


def _speed_rise(run: Run, after: float) -> float:
    """Return by how much (m/s) the speed along the surface comes back after it has fallen."""
    speed = run.speed[run.rows(after)]
    return float(np.max(speed - np.minimum.accumulate(speed)))


def _peak_height(run: Run, after: float) -> float:
    """Return the last coordinate (m) of the hand where it is farthest off the surface."""
    rows = np.flatnonzero(run.rows(after))
    return float(run.recording.hip[rows[np.argmax(np.abs(run.distance[rows]))], -1])


def _step_time(run: Run) -> float:
    """Return the median time (s) of a step along the recorded path."""
    rows = list(zip(run.recording.hip, run.recording.velocity, strict=True))
    track = Track(run.recording.hip, rows, run.recording.dt)
    renderer = make_renderer(resolve(run.renderer), run.scene)
    with without_garbage_collection():
        return 1e-9 * float(np.median(step_times(renderer, track, TIMED_STEPS, first=len(rows) // 3)))


def _other(run: Run) -> Run:
    assert run.other is not None, "a claim that compares names another renderer by `from`"
    return run.other


OF_RUNS: Mapping[str, Callable[..., float]] = MappingProxyType(
    {
        "first_depth": lambda run: run.depth[run.touching][0],
        "last_depth": lambda run: run.depth[-1],
        "typical_depth": lambda run, **times: np.median(run.depth[run.touching & run.rows(**times)]),
        "largest_distance": lambda run, **times: np.abs(run.distance[run.rows(**times)]).max(),
        "last_distance": lambda run: run.distance[-1],
        "growth": lambda run, first, last: (
            np.abs(run.distance[run.rows(*last)]).max() / np.abs(run.distance[run.rows(*first)]).max()
        ),
        "peak_height": _peak_height,
        "last_speed": lambda run: run.speed[-1],
        "speed_spread": lambda run: np.ptp(run.speed),
        "speed_rise": _speed_rise,
        "first_acceleration": lambda run: run.recording.force[0, 0] / run.scene.mass,
        "largest_step": lambda run: run.steps.max(),
        "largest_step_time": lambda run: run.recording.time[1 + np.argmax(run.steps)],
        "resting_share": lambda run: np.mean(run.steps[run.touching[1:]] < 1e-9),
        "largest_turn": lambda run: np.abs(np.diff(run.directions)).max(),
        "largest_turn_time": lambda run: run.recording.time[
            np.flatnonzero(run.touching)[1:][np.argmax(np.abs(np.diff(run.directions)))]
        ],
        "turning_time": lambda run: _turn(run, run.recording.time),
        "turning_angle": lambda run: _turn(run, run.polar_angle),
        "release_time": lambda run: run.recording.time[np.flatnonzero(run.touching)[-1]],
        "backwards": _backwards,
        "ihips_apart": lambda run: np.linalg.norm(run.recording.ihip - _other(run).recording.ihip, axis=1).max(),
        "hands_apart": lambda run: np.linalg.norm(run.recording.hip - _other(run).recording.hip, axis=1).max(),
        "relative": lambda run, of, **options: OF_RUNS[of](run, **options) / OF_RUNS[of](_other(run), **options),
        "switches": lambda run: len(run.switch_rows),
        "first_switch": lambda run: run.recording.time[run.switch_rows[0]],
        "torque_step": lambda run: run.torque_difference[run.switch_rows].max(),
        "diverging_share": lambda run: np.mean(
            run.torque_difference > SAME_TORQUE * np.abs(run.recording.channels["joint_torque"]).max()
        ),
        "step_time": _step_time,
        "step_rate": lambda run: 1.0 / _step_time(run),
    }
)
"""What is measured of a run, by name; further arguments are options of a claim."""


def _least_determinant() -> float:
    """Return the least |det J| over the joint angles of (2.38), on a lattice that holds the corners."""
    robot = device_named("parallelogram-2dof")
    elbows = np.linspace(ELBOW_LOW, ELBOW_HIGH, 34)
    poses = [
        (shoulder, elbow)
        for elbow in elbows
        for shoulder in elbow + np.linspace(-COLLAPSE_STOP, COLLAPSE_STOP, 21)
        if shoulder <= SHOULDER_LIMIT
    ]
    return min(abs(float(np.linalg.det(robot.jacobian(np.array(pose))))) for pose in poses)


def represented(model: str, representation: str) -> Curve:
    """Return a model's surface as minimum distance has it on a `curve`, a `polygon` or a `level-set`."""
    scene = Scene(model=make_model(model))
    return surface_of(make_renderer(resolve(f"minimum-distance@{representation}"), scene), scene.model.curve)


def _representation_error(model: str, representation: str) -> float:
    points = represented(model, representation).points(4000)
    return float(np.abs(make_model(model).boundary.signed_distance(points)).max())


def _tip_angle() -> float:
    corners = make_model("star").curve.corners
    before, tip, after = (corners[k].position for k in (-1, 0, 1))
    one, two = before - tip, after - tip
    return math.acos(float(one @ two / np.linalg.norm(one) / np.linalg.norm(two)))


def _circle_ratio() -> float:
    """Return κ / κ_avg of a circle, with κ_avg = 2π / L of (5.15)."""
    curve = make_model("circle").curve
    return float(curve.curvature(np.zeros(1))[0]) * curve.length / (2.0 * math.pi)


def _stiffness_bound() -> float:
    """Return (2.40) (N/m) of the locked robot at home, upwards."""
    device = device_named("parallelogram-2dof")
    scene = Scene(model=make_model("line"), device=device)
    bound = passive_stiffness(scene, robot_at(device, np.zeros(2)), np.array([0.0, 1.0]))
    assert bound is not None
    return bound


def _scheme_error(scheme: str) -> float:
    """Return how far (N) the force of a scheme under a circle is from its formula in Table 4.1, at one moving point."""
    radius, depth, rate, turning, dt = 0.1, 2e-3, -0.05, 1.5, 1e-7
    scene = Scene(model=make_model("circle"), stiffness=1000.0, damping=20.0, sampling_time=dt)
    position = np.array([radius - depth, 0.0])
    velocity = np.array([rate, (radius - depth) * turning])
    # (4.5): the IHIP goes round with the hand, on the circle.
    error, error_rate = np.array([-depth, 0.0]), np.array([rate, -depth * turning])
    velocity_error = {"pp": 0.0 * velocity, "pp-v": velocity, "pp-d": error_rate, "pp-pd": np.array([rate, 0.0])}
    renderer = make_renderer(resolve(f"minimum-distance+{scheme}"), scene)
    renderer.reset(position - 2.0 * dt * velocity)
    renderer.step(position - dt * velocity, velocity, dt)
    force = renderer.step(position, velocity, dt).force
    return float(np.abs(force + scene.stiffness * error + scene.damping * velocity_error[scheme]).max())


def _built_table_bytes() -> float:
    return array_bytes(make_renderer(resolve("minimum-distance@lut"), Scene(model=make_model("circle"))))


ALONE: Mapping[str, Callable[..., float]] = MappingProxyType(
    {
        "encoder_step": lambda: ENCODER_STEP,
        "least_determinant": _least_determinant,
        "representation_error": _representation_error,
        "tip_angle": _tip_angle,
        "scheme_error": _scheme_error,
        "circle_ratio": _circle_ratio,
        "stiffness_bound": _stiffness_bound,
        # (6.2): a contact point and a normal of N doubles each at every node.
        "table_bytes": lambda dimension: 16 * dimension * (0.2 / 0.5e-3) ** dimension,
        "parameter": lambda name: getattr(ParallelogramParameters(), name),
        "built_table_bytes": _built_table_bytes,
    }
)
"""What is measured without a run, by name."""


def measure(name: str, run: Run | None, options: Mapping[str, Any], other: Run | None = None) -> float:
    """Return the number that a claim asks for, in SI units; `from` among the options has named the `other` run."""
    arguments = {key: value for key, value in options.items() if key != "from"}
    if name in ALONE:
        return float(ALONE[name](**arguments))
    assert run is not None, f"{name} is measured of a run"
    return float(OF_RUNS[name](replace(run, other=other), **arguments))


def outlines(model: str, representation: str, depths: tuple[float, ...]) -> list[Array]:
    """Return the outline of a represented model, closed lines (n, 2), m, and those at `depths` (m) under it.

    For a curve the points are pushed along their normals, which makes swallowtails; for a level set the lines are those
    of its signed distance, which has none (5.2.3).
    """
    import contourpy

    if representation == "level-set":
        level_set = sample_level_set(make_model(model).boundary, LEVEL_SET_NODES)
        contours = contourpy.contour_generator(level_set.x, level_set.y, level_set.values)
        return [np.asarray(line) for depth in (0.0, *depths) for line in contours.lines(-depth)]
    surface = represented(model, representation)
    u = np.linspace(*surface.u_range, 2001)
    return [surface.position(u) - depth * surface.normal(u) for depth in (0.0, *depths)]


def encoder_grid(device: str) -> tuple[Array, Array]:
    """Return the places (n, 2), m, that encoders tell apart, and a circle of 0.1 m among them (k, 2), m."""
    robot = device_named(device)
    angles = math.radians(40.0) + np.linspace(-5e-4, 5e-4, 101)
    circle = 0.1 * np.column_stack([np.cos(angles), np.sin(angles)])
    counts = np.round(robot.joints(circle[50]) / ENCODER_STEP) + np.mgrid[-5:6, -5:6].reshape(2, -1).T
    return np.array([robot.position(ENCODER_STEP * count) for count in counts]), circle
