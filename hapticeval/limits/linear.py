"""The sampled closed loop around rest, made linear: renderer, inner loop, hold, delay and device."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hapticeval.devices.device import Device
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.renderer import Renderer
from hapticeval.scene import Scene
from hapticeval.types import Array

PROBE = 1e-6
"""Metres by which the hand is moved to learn a renderer's gains: less than any encoder tells apart."""

ROUNDING = 1e-5
"""A mode this close to 1 that makes no force is the tool's free motion along the surface, not an instability."""


@dataclass(frozen=True)
class Gains:
    """What a renderer does around one place, F_k = -now y_k - before y_(k-1) - rate ẏ_k; each (N, N).

    `now` and `before` in N/m, `rate` in N s/m.
    """

    now: Array
    before: Array
    rate: Array

    @property
    def parts(self) -> tuple[Array, Array, Array]:
        """All three."""
        return self.now, self.before, self.rate


@dataclass(frozen=True)
class Place:
    """A point of the surface (N,), m, where the tool rests, and the outward unit normal there."""

    point: Array
    normal: Array


def gains_of(renderer: Renderer, place: Place, dt: float) -> Gains:
    """A renderer's gains at `place`, by central differences of its own answers.

    From inside, so that a unilateral contact is not lost. There a force stands that is there no more on the surface,
    and that turns as the hand moves along a bent one: the parabola through what is found at three depths is taken at
    the surface, where such a force is gone.
    """
    found = [_gains_inside(renderer, place, depth * PROBE, dt) for depth in (2.0, 4.0, 6.0)]
    return Gains(*(3.0 * a - 3.0 * b + c for a, b, c in zip(*(each.parts for each in found), strict=True)))


def _gains_inside(renderer: Renderer, place: Place, depth: float, dt: float) -> Gains:
    rest = place.point - depth * place.normal
    still = np.zeros_like(rest)

    def force(before: Array, now: Array, velocity: Array) -> Array:
        renderer.reset(before)
        renderer.step(before, still, dt)
        return np.asarray(renderer.step(now, velocity, dt)[1], dtype=np.float64)

    return Gains(
        now=-slope_of(lambda move: force(rest, rest + move, still), rest.size, PROBE),
        before=-slope_of(lambda move: force(rest + move, rest, still), rest.size, PROBE),
        rate=-slope_of(lambda move: force(rest, rest, move), rest.size, PROBE / dt),
    )


@dataclass(frozen=True)
class Robot:
    """The device around rest at one pose: Jacobian, inertia M and losses D of M q̈ + D q̇ = τ, each (N, N)."""

    jacobian: Array
    inertia: Array
    losses: Array


def robot_at(device: Device, point: Array) -> Robot:
    """The device with its end-effector resting at `point` (N,), m. Raises `DomainError` outside its workspace."""
    joints = device.joints(point)
    losses = slope_of(lambda rates: device.bias(joints, rates), device.dimension)
    return Robot(device.jacobian(joints), device.inertia(joints), losses)


class SampledLoop:
    """One tick of the loop around rest: linear in the state, the device discretised exactly for torques that are held.

    The state is joint positions and velocities, the last positions and filtered velocities, and the torques that the
    delay still holds back.
    """

    def __init__(self, scene: Scene, robot: Robot) -> None:
        effects, dt = scene.imperfections, scene.sampling_time
        self.scene = scene
        self.robot = robot
        whole, rest = divmod(effects.delay / dt, 1.0)
        self.held = int(whole) + 1
        self.early = _transition(robot, rest * dt)
        self.late = _transition(robot, (1.0 - rest) * dt)
        cutoff = effects.velocity_cutoff
        self.kept = None if cutoff is None else float(np.exp(-2.0 * np.pi * cutoff * dt))

    def matrix(self, gains: Gains) -> tuple[Array, Array]:
        """State to next state (n, n), and state to force (N, n), N."""
        scene, dt, held = self.scene, self.scene.sampling_time, self.held
        jacobian, inertia, losses = self.robot.jacobian, self.robot.inertia, self.robot.losses
        count = len(inertia)
        state = np.eye((4 + held) * count)
        q, rates, q_before, slow = (state[i * count : (i + 1) * count] for i in range(4))
        torques = [state[(4 + i) * count : (5 + i) * count] for i in range(held)]
        seen = rates
        if self.kept is not None:
            seen = slow = self.kept * slow + (1.0 - self.kept) * (q - q_before) / dt
        force = -gains.now @ jacobian @ q - gains.before @ jacobian @ q_before - gains.rate @ jacobian @ seen
        torque = jacobian.T @ force
        if scene.inner_loop is InnerLoop.LINEARISED:
            torque = inertia @ np.linalg.solve(jacobian, force / scene.mass)
        if scene.inner_loop is not InnerLoop.STATIC:
            torque = torque + losses @ seen
        line = [torque, *torques]
        moved = self.early[0] @ np.vstack([q, rates]) + self.early[1] @ line[held]
        moved = self.late[0] @ moved + self.late[1] @ line[held - 1]
        return np.vstack([moved, q, slow, *line[:held]]), force

    def growth(self, gains: Gains) -> float:
        """The largest modulus of a mode, a tick: below 1 is stable. Free motion along the surface is left out."""
        matrix, force = self.matrix(gains)
        values, vectors = np.linalg.eig(matrix)
        felt = np.linalg.norm(force @ vectors, axis=0)
        free = (np.abs(values - 1.0) < ROUNDING) & (felt < ROUNDING * np.linalg.norm(force))
        return float(np.max(np.abs(values[~free]), initial=0.0))


def slope_of(answer: Callable[[Array], Array], count: int, step: float = 1e-6) -> Array:
    """The Jacobian of `answer` at zero by central differences of `step`: (N, count)."""
    return np.column_stack([(answer(step * axis) - answer(-step * axis)) / (2.0 * step) for axis in np.eye(count)])


def _transition(robot: Robot, duration: float) -> tuple[Array, Array]:
    """Exact motion of (q, q̇) over `duration`, and what a torque held meanwhile adds."""
    from scipy.linalg import expm

    count = len(robot.inertia)
    flow = np.zeros((3 * count, 3 * count))
    flow[:count, count : 2 * count] = np.eye(count)
    flow[count : 2 * count, count : 2 * count] = -np.linalg.solve(robot.inertia, robot.losses)
    flow[count : 2 * count, 2 * count :] = np.linalg.inv(robot.inertia)
    moved = np.asarray(expm(flow * duration))
    return moved[: 2 * count, : 2 * count], moved[: 2 * count, 2 * count :]
