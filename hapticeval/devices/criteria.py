"""What the hand feels of a device: the criteria of thesis Table 3.1 that its model can tell."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.devices.device import Device
from hapticeval.devices.imperfections import ENCODER_STEP
from hapticeval.devices.workspace import checked_joints, lattice
from hapticeval.errors import InputError
from hapticeval.types import Array

CLEARANCE = 0.1
"""rad: how far from limits and singularities the poses are that stand for the workspace."""

MOTOR_TORQUE = 0.368
"""N m: the peak of the robot's motors as thesis A.1 prints it, 36.8 N cm; its continuous torque is 0.033 N m."""


class Peak(NamedTuple):
    """What motors limited to |τᵢ| ≤ limit can do at the hand: a polytope about 0 of forces (N) or accelerations (m/s²).

    `worst` can be had in every direction, and in `worst_direction` (N,) no more; `best` is the largest of all, along
    `best_direction`; `corners` (2^N, N) span the polytope.
    """

    worst: float
    worst_direction: Array
    best: float
    best_direction: Array
    corners: Array


class Spread(NamedTuple):
    """A criterion over the workspace."""

    least: float
    median: float
    greatest: float


@dataclass(frozen=True, eq=False)
class Criteria:
    """A device at one pose, at rest.

    `inertia` M̂ (kg) with its eigenvalues `masses` in ascending order and their `directions` (columns); `damping` B̂
    (N s/m) with `resistances` and `resistance_directions` alike; `resolution` (m) the steps of the measured position a
    coordinate; `manipulability` |det J|; `stiffest` (N/m) the K_max of (2.40) along each resistance direction, at
    `sampling_time` (s); `force` and `acceleration` are None where no torque limit was given.
    """

    joints: Array
    position: Array
    margin: float
    inertia: Array
    masses: Array
    directions: Array
    damping: Array
    resistances: Array
    resistance_directions: Array
    resolution: Array | None
    manipulability: float
    stiffest: Array
    sampling_time: float
    force: Peak | None
    acceleration: Peak | None

    @property
    def anisotropy(self) -> float:
        """The heaviest direction's mass over the lightest's: 1 feels alike everywhere."""
        return float(self.masses[-1] / self.masses[0])


def criteria(
    device: Device,
    joints: ArrayLike,
    *,
    sampling_time: float = 1e-3,
    encoder_step: float | None = ENCODER_STEP,
    torque_limit: float | None = None,
) -> Criteria:
    """All criteria at a pose of the functional configuration space.

    `encoder_step` (rad; m for the point mass) is None for none; `torque_limit` (N m; N for the point mass) holds for
    each motor. Raises `DomainError` for a pose outside, `InputError` for numbers that are no such quantities.
    """
    pose = checked_joints(device, joints)
    _positive("sampling_time", sampling_time, "s")
    inertia = cartesian_inertia(device, pose)
    damping = cartesian_damping(device, pose)
    masses, directions = np.linalg.eigh(inertia)
    resistances, resistance_directions = np.linalg.eigh(0.5 * (damping + damping.T))
    return Criteria(
        joints=pose,
        position=device.position(pose),
        margin=device.margin(pose),
        inertia=inertia,
        masses=masses,
        directions=directions,
        damping=damping,
        resistances=resistances,
        resistance_directions=resistance_directions,
        resolution=None if encoder_step is None else position_resolution(device, pose, encoder_step),
        manipulability=abs(float(np.linalg.det(device.jacobian(pose)))),
        stiffest=2.0 * resistances / sampling_time,
        sampling_time=sampling_time,
        force=None if torque_limit is None else peak_force(device, pose, torque_limit),
        acceleration=None if torque_limit is None else peak_acceleration(device, pose, torque_limit),
    )


def cartesian_inertia(device: Device, joints: ArrayLike) -> Array:
    """M̂ = J⁻ᵀ M J⁻¹ of (2.9), (N, N), kg. Raises `DomainError` outside of the functional configuration space."""
    pose = checked_joints(device, joints)
    inverse = np.linalg.inv(device.jacobian(pose))
    product: Array = inverse.T @ device.inertia(pose) @ inverse
    return 0.5 * (product + product.T)


def cartesian_damping(device: Device, joints: ArrayLike, rates: ArrayLike | None = None) -> Array:
    """B̂ = J⁻ᵀ (C + b) J⁻¹ - M̂ J̇ J⁻¹ of (2.9) with its lost dot restored, (N, N), N s/m.

    At rest where no rates are given. C(q, q̇) is Christoffel's, and b q̇ the part of the bias that is linear in the
    rates. Raises `DomainError` outside of the functional configuration space.
    """
    pose = checked_joints(device, joints)
    n = device.dimension
    speeds = np.zeros(n) if rates is None else np.array(rates, dtype=np.float64)
    inverse = np.linalg.inv(device.jacobian(pose))
    resisting = np.column_stack([_linear(device, pose, unit) for unit in np.eye(n)])
    if not speeds.any():
        return np.array(inverse.T @ resisting @ inverse)
    at_speed = _quadratic(device, pose, speeds)
    for j, unit in enumerate(np.eye(n)):
        # the bilinear form of a quadratic one: what C(q, q̇) does to the j-th rate
        both = _quadratic(device, pose, speeds + unit)
        resisting[:, j] += 0.5 * (both - at_speed - _quadratic(device, pose, unit))
    turning = cartesian_inertia(device, pose) @ device.jacobian_rate(pose, speeds)
    return np.array((inverse.T @ resisting - turning) @ inverse)


def _linear(device: Device, joints: Array, rates: Array) -> Array:
    return 0.5 * (device.bias(joints, rates) - device.bias(joints, -rates))


def _quadratic(device: Device, joints: Array, rates: Array) -> Array:
    still = device.bias(joints, np.zeros_like(rates))
    return 0.5 * (device.bias(joints, rates) + device.bias(joints, -rates)) - still


def position_resolution(device: Device, joints: ArrayLike, encoder_step: float = ENCODER_STEP) -> Array:
    """|J| δq, (N,), m: how far a count of every encoder at once moves each measured coordinate at the most."""
    pose = checked_joints(device, joints)
    _positive("encoder_step", encoder_step, "rad")
    return np.array(np.abs(device.jacobian(pose)).sum(axis=1) * encoder_step)


def peak_force(device: Device, joints: ArrayLike, torque_limit: float) -> Peak:
    """The forces F = J⁻ᵀ τ (2.6) that can be held with |τᵢ| ≤ `torque_limit` (N m; N for the point mass).

    Raises `DomainError` outside of the functional configuration space.
    """
    pose = checked_joints(device, joints)
    return _peak(device.jacobian(pose).T, torque_limit)


def peak_acceleration(device: Device, joints: ArrayLike, torque_limit: float) -> Peak:
    """The accelerations ÿ = J M⁻¹ τ from rest with |τᵢ| ≤ `torque_limit` (N m; N for the point mass), m/s².

    Raises `DomainError` outside of the functional configuration space.
    """
    pose = checked_joints(device, joints)
    return _peak(device.inertia(pose) @ np.linalg.inv(device.jacobian(pose)), torque_limit)


def _peak(torques_of: Array, limit: float) -> Peak:
    """All a with |`torques_of` a| ≤ limit, row by row: the nearest facet, limit / ‖row‖ away, bounds them all."""
    _positive("torque_limit", limit, "N m")
    lengths = np.linalg.norm(torques_of, axis=1)
    weakest = int(np.argmax(lengths))
    torques = np.array(list(itertools.product((-limit, limit), repeat=len(lengths))))
    corners = np.linalg.solve(torques_of, torques.T).T
    sizes = np.linalg.norm(corners, axis=1)
    strongest = int(np.argmax(sizes))
    return Peak(
        float(limit / lengths[weakest]),
        torques_of[weakest] / lengths[weakest],
        float(sizes[strongest]),
        corners[strongest] / sizes[strongest],
        corners,
    )


def over_workspace(
    device: Device,
    *,
    sampling_time: float = 1e-3,
    encoder_step: float | None = ENCODER_STEP,
    torque_limit: float | None = None,
) -> dict[str, Spread]:
    """How the criteria vary over a lattice of poses at least `CLEARANCE` rad inside the functional configuration space.

    Keys, as far as they can be told: `lightest` and `heaviest` (kg, eigenvalues of M̂), `anisotropy`, `damping` (N s/m,
    the least eigenvalue of B̂), `stiffest` (N/m, the least K_max), `resolution` (m, the coarsest coordinate), `force`
    (N) and `acceleration` (m/s²) in every direction, `manipulability`. Nearer to a singularity M̂ grows without bound.
    """
    given = {"sampling_time": sampling_time, "encoder_step": encoder_step, "torque_limit": torque_limit}
    found: dict[str, list[float]] = {}
    for joints in lattice(device, clearance=CLEARANCE):
        at = criteria(device, joints, **given)  # type: ignore[arg-type]
        values = {
            "lightest": at.masses[0],
            "heaviest": at.masses[-1],
            "anisotropy": at.anisotropy,
            "damping": at.resistances[0],
            "stiffest": at.stiffest[0],
            "manipulability": at.manipulability,
        }
        if at.resolution is not None:
            values["resolution"] = at.resolution.max()
        if at.force is not None and at.acceleration is not None:
            values |= {"force": at.force.worst, "acceleration": at.acceleration.worst}
        for name, value in values.items():
            found.setdefault(name, []).append(float(value))
    return {name: Spread(min(each), float(np.median(each)), max(each)) for name, each in found.items()}


def _positive(name: str, value: float, unit: str) -> None:
    if not math.isfinite(value) or value <= 0.0:
        raise InputError(f"{name} = {value!r} {unit}", why="it must be finite and positive")
