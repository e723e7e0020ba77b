"""Linearise the sampled closed loop around rest: renderer, inner loop, hold, delay and device.

Beside it the bound of Colgate and Schenkel (2.40), for a device that moves in more than one direction.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hapticeval.devices.device import Device
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.effects.sensors import VelocityFilter
from hapticeval.renderer import Renderer
from hapticeval.scene import Scene
from hapticeval.simulation.checked_calls import reset_checked, step_checked
from hapticeval.types import Array

PROBE_STEP = 1e-6  # m by which the hand is moved to measure a renderer's gains: less than any encoder resolves
FREQUENCIES = 400  # so many frequencies, up to Nyquist's, at which the device's impedance is looked at
FREE_MODE_DISTANCE = 1e-5  # a mode this close to 1 that makes no force is the tool's free motion along the surface


class Gains(NamedTuple):
    """A renderer made linear around one place: F_k = -now y_k - before y_(k-1) - rate ẏ_k; each (N, N).

    `now` and `before` in N/m, `rate` in N s/m.
    """

    now: Array
    before: Array
    rate: Array


class Place(NamedTuple):
    """A point of the surface (N,), m, where the tool rests, and the outward unit normal there."""

    point: Array
    normal: Array


def gains_of(renderer: Renderer, place: Place, dt: float) -> Gains:
    """Measure a renderer's gains at `place`, by central differences of its own answers.

    They are measured inside, so that a unilateral contact is not lost, and extrapolated to the surface: inside a force
    stands, which turns as the hand moves along a curved one. The parabola through three depths removes it.
    """
    still, size = np.zeros_like(place.point), place.point.size

    def force_after(before: Array, now: Array, velocity: Array) -> Array:
        """Return the force (N,), N, at `now` after `before` (N,), m, with `velocity` (N,), m/s."""
        # Two ticks: the first makes `before` the last HIP for a renderer that remembers it.
        reset_checked(renderer, before)
        step_checked(renderer, 0, before, still, dt)
        return step_checked(renderer, 1, now, velocity, dt)[1]

    def gains_at_depth(depth: float) -> Array:
        """Return the three gains (3, N, N) at a depth, m."""
        rest_point = place.point - depth * place.normal
        # F = -now y_k - before y_(k-1) - rate ẏ_k: one of the three is moved at a time.
        now = jacobian_of(lambda move: force_after(rest_point, rest_point + move, still), size, PROBE_STEP)
        before = jacobian_of(lambda move: force_after(rest_point + move, rest_point, still), size, PROBE_STEP)
        return -np.array(
            [now, before, jacobian_of(lambda move: force_after(rest_point, rest_point, move), size, PROBE_STEP / dt)]
        )

    a, b, c = (gains_at_depth(depth * PROBE_STEP) for depth in (2.0, 4.0, 6.0))
    # The parabola through the depths h, 2 h and 3 h, at zero: 3 f(h) - 3 f(2 h) + f(3 h).
    return Gains(*(3.0 * a - 3.0 * b + c))


class Robot(NamedTuple):
    """The device around rest at one pose: Jacobian, inertia M and losses D of M q̈ + D q̇ = τ, each (N, N)."""

    jacobian: Array
    inertia: Array
    losses: Array


def robot_at(device: Device, point: Array) -> Robot:
    """Describe the device with its hand at rest at `point` (N,), m. Raises `DomainError` outside its workspace."""
    joints = device.joints(point)
    # The bias's slope in the rates, at rest, is D: Coriolis forces are quadratic in them.
    losses = jacobian_of(lambda rates: device.bias(joints, rates), device.dimension)
    return Robot(device.jacobian(joints), device.inertia(joints), losses)


class SampledLoop:
    """One tick of the loop around rest: linear in the state, the device discretised exactly for torques that are held.

    The state is joint positions and velocities, the last positions and filtered velocities, and the torques that the
    delay still holds back.
    """

    def __init__(self, scene: Scene, robot: Robot) -> None:
        dt = scene.sampling_time
        self.scene = scene
        self.robot = robot
        # A delay of (whole + fraction) ticks: the motors change within a tick, after its fraction.
        whole_ticks, fraction = divmod(loop_delay(scene) / dt, 1.0)
        self.held_count = int(whole_ticks) + 1
        self.first_part = _transition(robot, fraction * dt)
        self.second_part = _transition(robot, (1.0 - fraction) * dt)
        velocity = scene.effect(VelocityFilter)
        # A first-order low-pass at the cutoff f, sampled: what stays of the last value is exp(-2 π f T).
        self.filter_share = None if velocity is None else float(np.exp(-2.0 * np.pi * velocity.cutoff * dt))

    def matrix(self, gains: Gains) -> tuple[Array, Array]:
        """Return the matrices from state to next state (n, n), and from state to force (N, n), N."""
        scene, dt, held_count = self.scene, self.scene.sampling_time, self.held_count
        jacobian, inertia, losses = self.robot.jacobian, self.robot.inertia, self.robot.losses
        size = len(inertia)
        # Rows of the identity stand for the parts of the state, so that the equations below make matrices.
        state = np.eye((4 + held_count) * size)
        joints, rates, joints_before, filtered_rates = (state[i * size : (i + 1) * size] for i in range(4))
        torques = [state[(4 + i) * size : (5 + i) * size] for i in range(held_count)]
        sensed_rates = rates
        if self.filter_share is not None:
            sensed_rates = filtered_rates = (
                self.filter_share * filtered_rates + (1.0 - self.filter_share) * (joints - joints_before) / dt
            )
        force = (
            -gains.now @ jacobian @ joints
            - gains.before @ jacobian @ joints_before
            - gains.rate @ jacobian @ sensed_rates
        )
        # Static: τ = Jᵀ F.
        torque = jacobian.T @ force
        if scene.inner_loop is InnerLoop.LINEARISED:
            # Feedback linearisation at rest: the hand accelerates by F / m, so τ = M J⁻¹ F / m.
            torque = inertia @ np.linalg.solve(jacobian, force / scene.mass)
        if scene.inner_loop is not InnerLoop.STATIC:
            # Both other inner loops cancel the losses that they sense: τ + D q̇.
            torque = torque + losses @ sensed_rates
        # From the newest: in the first part of the tick the oldest acts, in the second the one after it.
        torque_queue = [torque, *torques]
        next_state = self.first_part[0] @ np.vstack([joints, rates]) + self.first_part[1] @ torque_queue[held_count]
        next_state = self.second_part[0] @ next_state + self.second_part[1] @ torque_queue[held_count - 1]
        # The next state in the order of this one: q and q̇, the last q, the filtered rates, and the queue.
        return np.vstack([next_state, joints, filtered_rates, *torque_queue[:held_count]]), force

    def growth(self, gains: Gains) -> float:
        """Return the growth per tick of the fastest mode, below 1 if stable; motion along the surface is left out."""
        matrix, force = self.matrix(gains)
        values, vectors = np.linalg.eig(matrix)
        felt = np.linalg.norm(force @ vectors, axis=0)
        # A frictionless tool moves freely along the surface: eigenvalue 1, and no force.
        free = (np.abs(values - 1.0) < FREE_MODE_DISTANCE) & (felt < FREE_MODE_DISTANCE * np.linalg.norm(force))
        return float(np.max(np.abs(values[~free]), initial=0.0))


def jacobian_of(answer: Callable[[Array], Array], count: int, step: float = 1e-6) -> Array:
    """Return the Jacobian (N, count) of a function at zero, by central differences of `step` in its unit."""
    return np.column_stack([(answer(step * axis) - answer(-step * axis)) / (2.0 * step) for axis in np.eye(count)])


def _transition(robot: Robot, duration: float) -> tuple[Array, Array]:
    """Return how (q, q̇) moves over `duration` (s): its matrix (2 N, 2 N), and (2 N, N) of a torque that is held."""
    from scipy.linalg import expm

    count = len(robot.inertia)
    flow = np.zeros((3 * count, 3 * count))
    flow[:count, count : 2 * count] = np.eye(count)
    flow[count : 2 * count, count : 2 * count] = -np.linalg.solve(robot.inertia, robot.losses)
    flow[count : 2 * count, 2 * count :] = np.linalg.inv(robot.inertia)
    moved = np.asarray(expm(flow * duration))
    return moved[: 2 * count, : 2 * count], moved[: 2 * count, 2 * count :]


def port_damping(robot: Robot, normal: Array, dt: float) -> float:
    """Return the damping (N s/m) that the hand feels of the device: b of (2.40).

    It is the least real part of the device's impedance along `normal` (N,), up to Nyquist, with the sampling time `dt`
    (s).

    - The theorem behind (2.40) asks Re Z(jω) > T / (2 (1 - cos ωT)) Re[(1 - exp(-jωT)) H] at every ω.
    - For a spring K and a damper B that is Re Z > K T / 2 + |B| at the worst of them.
    - Z is what is felt along the normal n while the tool is free across it: 1 / Z = nᵀ (jω M̂ + B̂)⁻¹ n.
    - Where inertia and damping share their axes, Z is b + jω m.
    """
    if not robot.losses.any():
        return 0.0
    # Inertia and losses at the hand: M̂ = J⁻ᵀ M J⁻¹, and B̂ from D alike.
    inverse = np.linalg.inv(robot.jacobian)
    inertia, losses = (inverse.T @ part @ inverse for part in (robot.inertia, robot.losses))
    frequencies = np.geomspace(1e-3, np.pi / dt, FREQUENCIES)
    impedance = 1j * frequencies[:, None, None] * inertia + losses
    # (jω M̂ + B̂)⁻¹ n at every frequency, (400, N).
    admittance = np.linalg.solve(impedance, np.broadcast_to(normal[:, None], (FREQUENCIES, normal.size, 1)))[..., 0]
    return float(np.min((1.0 / (admittance @ normal)).real))


def loop_delay(scene: Scene) -> float:
    """Return the delay (s) of the loop, from a sample to the motors' answer: that of all effects together."""
    return sum((effect.late for effect in scene.effects), 0.0)


def passive_stiffness(scene: Scene, robot: Robot, normal: Array) -> float | None:
    """Return the largest stiffness (N/m) that is passive with any hand, by (2.40); zero where none is.

    It is 2 (b - |B|) / (T + 2 d), with b along `normal` (N,), in N s/m, the sampling time T (s) and the delay d (s).
    None for all but the static inner loop: one that compensates the device's damping leaves no b to count on.

    - A delay d turns the spring's part of the theorem into K T / 2 (cos ωd - cos ω(T + d)) / (1 - cos ωT).
    - That is largest at ω = 0, K (T / 2 + d); the damper's part stays within |B|.
    - Without delay it is (2.40).
    """
    if scene.inner_loop is not InnerLoop.STATIC:
        return None
    damping = port_damping(robot, normal, scene.sampling_time)
    return max(0.0, 2.0 * (damping - scene.damping) / (scene.sampling_time + 2.0 * loop_delay(scene)))
