"""Where the parallelogram robot reaches: its edges, its section and size, and poses that stand for the workspace."""

from __future__ import annotations

import itertools
import math

import numpy as np

from hapticeval.devices.device import Device, Limit
from hapticeval.devices.parallelogram import (
    BASE_LIMIT,
    COLLAPSE_STOP,
    ELBOW_HIGH,
    ELBOW_LOW,
    SHOULDER_LIMIT,
    Dynamics,
    Parallelogram,
    Parallelogram2,
)
from hapticeval.types import Array

EDGES = ("elbow", "stop", "shoulder", "elbow", "stop")
"""The limit that each edge of (2.38) is, from the corner with the least angles on, anticlockwise."""


def corner_angles() -> Array:
    """Return the corners of (2.38) in the plane of the linkage's joints, (5, 2), rad: the bound x₁ > -2.4 is never met.

    In the order of `EDGES`.
    """
    low, high, stop, end = ELBOW_LOW, ELBOW_HIGH, COLLAPSE_STOP, SHOULDER_LIMIT
    return np.array([(low - stop, low), (low + stop, low), (end, end - stop), (end, high), (high - stop, high)])


def trace_edges(robot: Parallelogram, n: int = 400) -> tuple[tuple[str, Array], ...]:
    """Trace the five edges of what the linkage reaches, in its plane: each limit's name, and n / 5 points (m).

    A limit's name is `shoulder`, `elbow` or `stop`. With the base turning, a part lies beyond its axis.
    """
    corner_joints = corner_angles()
    locked_base = Parallelogram2(robot.constants)
    traced = []
    # an edge is straight in joint space, and a curve in the plane
    for name, start, end in zip(EDGES, corner_joints, np.roll(corner_joints, -1, axis=0), strict=True):
        joints = np.linspace(start, end, max(2, n // len(corner_joints)) + 1)
        traced.append((name, np.array([locked_base.position(pose) for pose in joints])))
    return tuple(traced)


def trace_section(robot: Parallelogram, n: int = 400) -> Array:
    """Trace the outline of the functional workspace in the linkage's plane, closed, about `n` points (k, 2), m.

    The plane is (y₁, y₂) with the base locked. With the base turning it is (y₁, y₃) at x₁ = 0, and ends at the base's
    axis: the workspace is what the section sweeps as the base turns within its limits.
    """
    outline = np.concatenate([points[:-1] for _, points in trace_edges(robot, n)])
    return outline if robot.dimension == 2 else _part_right_of(outline, -robot.constants.l4)


def workspace_size(robot: Parallelogram, n: int = 20_000) -> float:
    """Return the area (m²) or volume (m³) of the functional workspace, from an outline of about `n` points."""
    x, up = trace_section(robot, n).T
    if robot.dimension == 2:
        # the shoelace formula
        return abs(float((x * np.roll(up, -1) - np.roll(x, -1) * up).sum())) / 2.0
    x = x + robot.constants.l4
    across, above = np.roll(x, -1), np.roll(up, -1)
    # Pappus: the base's angle times the first moment of the section about the axis, triangle by triangle
    moment = float(((x + across) * (x * above - across * up)).sum()) / 6.0
    return 2.0 * BASE_LIMIT * abs(moment)


def describe_dynamics(robot: Parallelogram) -> str:
    """Return which equations of motion the robot follows, in words."""
    if robot.dimension == 2:
        return "of constant inertia: printed (2.35) and lagrangian are the same"
    lagrangian = robot.dynamics is Dynamics.LAGRANGIAN
    how = "they conserve energy without friction" if lagrangian else "(2.26): they create energy"
    return f"{robot.dynamics}, {how}; base inertia d₀ with {robot.base_inertia}² x₃"


def _part_right_of(outline: Array, axis: float) -> Array:
    """Return the part of a closed outline (n, 2), m, with first coordinates above `axis`, closed along it."""
    vertices: list[Array] = []
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if start[0] > axis:
            vertices.append(start)
        if (start[0] > axis) != (end[0] > axis):  # where the edge crosses the axis
            vertices.append(start + (axis - start[0]) / (end[0] - start[0]) * (end - start))
    return np.array(vertices)


def nearest_limit(device: Device, joints: Array) -> Limit | None:
    """Return the joint limit that is nearest to `joints` (N,), rad or m; None for a device without."""
    return min((limit for limit in device.limits(joints) if not limit.singular), key=_distance, default=None)


def nearest_singularity(device: Device, joints: Array) -> float:
    """Return a distance (rad, Euclidean) from `joints` (N,), rad or m, within which no singularity lies.

    Infinite for a device without.
    """
    return min((abs(limit.distance) for limit in device.limits(joints) if limit.singular), default=math.inf)


def _distance(limit: Limit) -> float:
    return limit.distance


def lattice(device: Device, *, step: float = 0.2, clearance: float = 0.0) -> Array:
    """Return configurations (n, N) in steps of `step` rad from home on, with a margin of more than `clearance` rad.

    They are those that home can be stepped to along the lattice; of a device without limits, home alone.
    """
    home = (0,) * device.dimension
    if not device.limits(np.zeros(device.dimension)):
        return np.zeros((1, device.dimension))
    moves = [move for move in itertools.product((-1, 0, 1), repeat=device.dimension) if any(move)]
    # flood fill from home over neighbours along edges and diagonals
    nodes, reached_nodes, waiting = [], {home}, [home]
    while waiting:
        node = waiting.pop()
        if device.margin(step * np.array(node)) > clearance:
            nodes.append(node)
            new_nodes = {tuple(np.add(node, move).tolist()) for move in moves} - reached_nodes
            reached_nodes |= new_nodes
            waiting += new_nodes
    return step * np.array(sorted(nodes)).reshape(-1, device.dimension)
