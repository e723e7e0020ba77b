"""What the hand feels of a device: the criteria of thesis Table 3.1 that follow from its model."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.devices.device import Device, checked_joints
from hapticeval.devices.parallelogram import ENCODER_STEP
from hapticeval.errors import InputError
from hapticeval.examples.studies.reach import lattice
from hapticeval.types import Array

SAMPLING_TIME = 1e-3
"""Seconds of a tick."""

CLEARANCE = 0.1
"""rad: how far from limits and singularities the poses are that stand for the workspace."""


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
    """How a criterion varies over the workspace: its extremes and its median, in the criterion's unit."""

    smallest: float
    median: float
    largest: float


@dataclass(frozen=True, eq=False)
class Criteria:
    """A device at one pose, at rest.

    - `inertia`: M̂ (kg), with its eigenvalues `masses` in ascending order and their `directions` (columns).
    - `damping`: B̂ (N s/m), with `resistances` and `resistance_directions` alike.
    - `resolution` (N,), m: what a count of every encoder moves each coordinate by; `manipulability`: |det J|.
    - `stiffest` (N/m): the K_max of (2.40) along each resistance direction, at `SAMPLING_TIME`.
    - `force` and `acceleration`: None where no torque limit was given.
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
    resolution: Array
    manipulability: float
    stiffest: Array
    force: Peak | None
    acceleration: Peak | None

    @property
    def anisotropy(self) -> float:
        """The heaviest direction's mass over the lightest's: 1 feels alike everywhere."""
        return float(self.masses[-1] / self.masses[0])


def criteria(device: Device, joints: ArrayLike, *, torque_limit: float | None = None) -> Criteria:
    """Compute all criteria at a pose of the functional configuration space, `joints` (N,), rad or m.

    `torque_limit` (N m; N for the point mass) holds for each motor. Raises `DomainError` for a pose outside,
    `InputError` for numbers that are no such quantities.
    """
    pose = checked_joints(device, joints)
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
        resolution=position_resolution(device, pose),
        manipulability=abs(float(np.linalg.det(device.jacobian(pose)))),
        stiffest=2.0 * resistances / SAMPLING_TIME,
        force=None if torque_limit is None else peak_force(device, pose, torque_limit),
        acceleration=None if torque_limit is None else peak_acceleration(device, pose, torque_limit),
    )


def cartesian_inertia(device: Device, joints: ArrayLike) -> Array:
    """Return the mass that the hand feels in each direction at `joints` (N,): M̂ = J⁻ᵀ M J⁻¹ of (2.9), (N, N), kg.

    Raises `DomainError` outside of the functional configuration space.
    """
    pose = checked_joints(device, joints)
    inverse = np.linalg.inv(device.jacobian(pose))
    product: Array = inverse.T @ device.inertia(pose) @ inverse
    return 0.5 * (product + product.T)  # symmetric to the last bit, as `eigh` reads one half of it only


def cartesian_damping(device: Device, joints: ArrayLike) -> Array:
    """Return the damping that the hand feels at rest at `joints` (N,): B̂ = J⁻ᵀ b J⁻¹ of (2.9), (N, N), N s/m.

    b q̇ is the part of the bias that is linear in the rates. Raises `DomainError` outside of the functional
    configuration space.
    """
    pose = checked_joints(device, joints)
    inverse = np.linalg.inv(device.jacobian(pose))
    units = np.eye(device.dimension)
    # the odd part of the bias: its velocity terms are quadratic, and even
    damping_torques = np.column_stack([0.5 * (device.bias(pose, unit) - device.bias(pose, -unit)) for unit in units])
    return np.array(inverse.T @ damping_torques @ inverse)


def position_resolution(device: Device, joints: ArrayLike) -> Array:
    """Return how far one count of all encoders moves each measured coordinate at most: |J| δq, (N,), m.

    `joints` (N,) are in rad, or m for the point mass.
    """
    return np.array(np.abs(device.jacobian(checked_joints(device, joints))).sum(axis=1) * ENCODER_STEP)


def peak_force(device: Device, joints: ArrayLike, torque_limit: float) -> Peak:
    """Return the forces, N, that motors can hold at `joints` (N,): F = J⁻ᵀ τ (2.6) with |τᵢ| ≤ `torque_limit`.

    That is in N m, in N for the point mass. Raises `DomainError` outside of the functional configuration space.
    """
    pose = checked_joints(device, joints)
    return _peak(device.jacobian(pose).T, torque_limit)


def peak_acceleration(device: Device, joints: ArrayLike, torque_limit: float) -> Peak:
    """Return the accelerations from rest, m/s², that motors give at `joints` (N,): ÿ = J M⁻¹ τ, |τᵢ| ≤ `torque_limit`.

    That is in N m, in N for the point mass. Raises `DomainError` outside of the functional configuration space.
    """
    pose = checked_joints(device, joints)
    return _peak(device.inertia(pose) @ np.linalg.inv(device.jacobian(pose)), torque_limit)


def _peak(torques_of: Array, limit: float) -> Peak:
    """Return the polytope of all a with |`torques_of` a| ≤ limit: the nearest facet is limit / ‖row‖ away."""
    if not math.isfinite(limit) or limit <= 0.0:
        raise InputError(f"torque_limit = {limit!r} N m", why="it must be finite and positive")
    lengths = np.linalg.norm(torques_of, axis=1)
    weakest_row = int(np.argmax(lengths))
    torques = np.array(list(itertools.product((-limit, limit), repeat=len(lengths))))
    # the polytope's corners are those of the cube of torques
    corners = np.linalg.solve(torques_of, torques.T).T
    sizes = np.linalg.norm(corners, axis=1)
    strongest_corner = int(np.argmax(sizes))
    return Peak(
        float(limit / lengths[weakest_row]),
        torques_of[weakest_row] / lengths[weakest_row],
        float(sizes[strongest_corner]),
        corners[strongest_corner] / sizes[strongest_corner],
        corners,
    )


def over_workspace(device: Device, *, torque_limit: float | None = None) -> dict[str, Spread]:
    """Compute how criteria vary over a lattice of poses at least `CLEARANCE` rad inside the configuration space.

    Keys: `lightest` and `heaviest` (kg, eigenvalues of M̂), `anisotropy`, `damping` (N s/m, the least eigenvalue of B̂),
    `stiffest` (N/m, the least K_max), `resolution` (m, the coarsest coordinate), `manipulability`, and with a torque
    limit `force` (N) and `acceleration` (m/s²) in every direction. Nearer to a singularity M̂ grows without bound.
    """
    values_of: dict[str, list[float]] = {}
    for joints in lattice(device, clearance=CLEARANCE):
        at_pose = criteria(device, joints, torque_limit=torque_limit)
        values = {
            "lightest": at_pose.masses[0],
            "heaviest": at_pose.masses[-1],
            "anisotropy": at_pose.anisotropy,
            "damping": at_pose.resistances[0],
            "stiffest": at_pose.stiffest[0],
            "resolution": at_pose.resolution.max(),
            "manipulability": at_pose.manipulability,
        }
        if at_pose.force is not None and at_pose.acceleration is not None:
            values |= {"force": at_pose.force.worst, "acceleration": at_pose.acceleration.worst}
        for name, value in values.items():
            values_of.setdefault(name, []).append(float(value))
    return {name: Spread(min(values), float(np.median(values)), max(values)) for name, values in values_of.items()}
