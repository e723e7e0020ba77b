"""The direct-drive parallelogram robot of section 2.5.5, with its base turning (3-DOF) or locked (2-DOF).

Its equations (2.26) to (2.39) stand once, in the plain functions at the end of this file, which are compiled at their
first use: closed loops and the methods of the classes call the same code.
"""

# ruff: noqa: ARG001 - the kernels of every device have the same arguments

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.devices.device import CompiledDevice, Limit, checked_joints, checked_vector
from hapticeval.errors import DomainError, InputError, in_m
from hapticeval.geometry.validate import checked_number, checked_size
from hapticeval.types import Array

L1, L4, B1, B2, B3, D1, D2, D3, COUPLED, COSINE = range(10)
"""Where Table A.1's numbers are in `parameters`, and whether the velocity terms count and d₀ has cos² x₃."""

BASE_LIMIT = SHOULDER_LIMIT = 2.4
"""rad: |x₁| and |x₂| of (2.30)."""
ELBOW_LOW, ELBOW_HIGH = -1.0, 2.3
"""rad: the bounds of x₃."""
COLLAPSE_STOP = 1.0
"""rad: |x₂ - x₃| at the mechanical stop that keeps the parallelogram from collapsing."""
DIAGONAL = math.sqrt(0.5)
"""Euclidean distance in joint space to a plane x₂ - x₃ = constant, a unit of x₂ - x₃ away."""

ENCODER_COUNTS = 262_144
"""Counts per turn of the robot's encoders, four for each of 65,536 lines (thesis A.1)."""

MOTOR_TORQUE = 0.368
"""N m: the peak of the robot's motors as thesis A.1 prints it, 36.8 N cm; its continuous torque is 0.033 N m.

The printed runs need more: set stabilisation at 0.5 m/s on the circle of 7.3.2 takes up to 2.0 N m. So the print most
likely has N cm for N m: see `LIKELY_MOTOR_TORQUE`.
"""

LIKELY_MOTOR_TORQUE = 36.8
"""N m: that peak, if A.1 means N m. For simulations; a real robot's limit is what its motors' maker states."""

ENCODER_STEP = 2.0 * math.pi / ENCODER_COUNTS
"""2.4e-5 rad per count."""


class Dynamics(StrEnum):
    """Which velocity terms the base's changing inertia d₀(x₂, x₃) makes.

    `lagrangian`: those of a rigid linkage, d₀ẍ₁ + ḋ₀ẋ₁ + b₁ẋ₁ = τ₁ and dᵢẍᵢ - ½ ∂ᵢd₀ ẋ₁² + bᵢẋᵢ = τᵢ, which conserve
    energy where there is no damping. `printed`: none, as in (2.26), which creates energy.
    """

    LAGRANGIAN = "lagrangian"
    PRINTED = "printed"


class BaseInertia(StrEnum):
    """How d₀ depends on x₃.

    `sin`: d₁ + d₂ sin² x₂ + d₃ sin² x₃ as in (2.27), the form that Table A.1's d₁ to d₃ were identified with, and
    therefore the default.

    `cos`: d₃ cos² x₃ instead, as the geometry of thin links has it; with the same d₁ that makes 2.3 % more at home, so
    identify d₁ anew.
    """

    SIN = "sin"
    COS = "cos"


@dataclass(frozen=True, kw_only=True)
class ParallelogramParameters:
    """Table A.1: link lengths `l1`, `l4` (m), joint dampings `b1` to `b3` (N m s/rad), inertias `d1` to `d3` (kg m²).

    Raises `InputError` for a length or an inertia that is not positive, a damping that is negative, and for any of them
    that is not a finite number.
    """

    l1: float = 0.300
    l4: float = 0.346
    b1: float = 0.461
    b2: float = 0.105
    b3: float = 0.0336
    d1: float = 0.799
    d2: float = 0.204
    d3: float = 0.01825

    def __post_init__(self) -> None:
        for constant in fields(self):
            value = getattr(self, constant.name)
            if constant.name.startswith("l"):
                value = checked_size(value, constant.name)
            else:
                value = checked_number(constant.name, value)
                zero_allowed = constant.name.startswith("b")
                if value < 0.0 or (value == 0.0 and not zero_allowed):
                    raise InputError(
                        f"{constant.name} = {value!r} {constant_unit(constant.name)}",
                        why="a joint cannot drive itself" if zero_allowed else "an inertia must be positive",
                    )
            object.__setattr__(self, constant.name, value)

    def changed(self) -> dict[str, float]:
        """Return the constants by name that are not those of Table A.1."""
        return {
            constant.name: value
            for constant in fields(self)
            if (value := getattr(self, constant.name)) != constant.default
        }


def constant_unit(name: str) -> str:
    """Return the unit of a constant of Table A.1, by its name."""
    return {"l": "m", "b": "N m s/rad", "d": "kg m²"}[name[0]]


@dataclass(frozen=True)
class Parallelogram(ABC):
    """The robot with its base locked or turning, see `Parallelogram2` and `Parallelogram3`."""

    constants: ParallelogramParameters = field(default_factory=ParallelogramParameters)
    dynamics: Dynamics = Dynamics.LAGRANGIAN
    base_inertia: BaseInertia = BaseInertia.SIN

    name = ""
    dimension = 0
    turning = True

    def __post_init__(self) -> None:
        for name, choices in (("dynamics", Dynamics), ("base_inertia", BaseInertia)):
            value = getattr(self, name)
            try:
                object.__setattr__(self, name, choices(value))
            except ValueError as error:
                known = " or ".join(choices)
                raise InputError(
                    f"{name} = {value!r}", why="there is none of that name", todo=f"choose {known}"
                ) from error

    @property
    def parameters(self) -> Array:
        """What the kernels are given, by the indices `L1` to `COSINE`."""
        return self._numbers.copy()

    @cached_property
    def _numbers(self) -> Array:
        constants = [float(getattr(self.constants, constant.name)) for constant in fields(self.constants)]
        choices = [self.dynamics is Dynamics.LAGRANGIAN, self.base_inertia is BaseInertia.COS]
        return np.array([*constants, *map(float, choices)])

    @property
    def kernels(self) -> CompiledDevice:
        """For compiled loops; the methods call them too."""
        from hapticeval.compiled import compiled_on_demand

        return CompiledDevice(*map(compiled_on_demand, (*self._equations, margin)))

    def position(self, joints: ArrayLike) -> Array:
        """Return where the hand is at `joints` (N,), rad: y = h(x) of (2.28) or (2.36), (N,), m, zero at home."""
        return self._kinematics(joints)[0]

    def jacobian(self, joints: ArrayLike) -> Array:
        """Return how the hand moves with the `joints` (N,), rad: J of (2.29) or (2.37), (N, N), m per rad."""
        return self._kinematics(joints)[1]

    def inertia(self, joints: ArrayLike) -> Array:
        """Return the joint inertia M at `joints` (N,), rad: diag(d₀, d₂, d₃), or diag(d₂, d₃), (N, N), kg m²."""
        return self._dynamics(joints, np.zeros(self.dimension))[0]

    def bias(self, joints: ArrayLike, rates: ArrayLike) -> Array:
        """Return the torques (N,), N m, that the joints need to keep their `rates` (N,), rad/s, at `joints` (N,), rad.

        They are the velocity terms of `dynamics`, and b q̇; the linkage is balanced against gravity.
        """
        return self._dynamics(joints, rates)[1]

    def margin(self, joints: ArrayLike) -> float:
        """Return how far inside its limits the device is at `joints` (N,), rad: the smallest distance of `limits`, rad.

        Minus infinity where a joint is not finite. From inside, no move of the joints (Euclidean norm) shorter than
        this leaves the functional configuration space (2.33), (2.39).
        """
        return float(self.kernels.margin(self._numbers, checked_vector(self, joints, finite=False)))

    def limits(self, joints: ArrayLike) -> tuple[Limit, ...]:
        """Return the limits as seen from `joints` (N,), rad: those of (2.30) and (2.38), and the singularities.

        They are open, as Definition 2.4 wants. Beyond the stop det J is zero, and with the base turning where the hand
        comes to the base's axis.
        """
        pose = checked_vector(self, joints, finite=False).tolist()
        *base, shoulder, elbow = pose
        *_, first, second = (f"x{i + 1}" for i in range(len(pose)))
        linkage = (
            Limit.between(first, shoulder, -SHOULDER_LIMIT, SHOULDER_LIMIT),
            Limit.between(second, elbow, ELBOW_LOW, ELBOW_HIGH),
            # a plane x₂ - x₃ = constant: nearer in joint space than the difference of the angles
            Limit.between(f"{first} - {second}", shoulder - elbow, -COLLAPSE_STOP, COLLAPSE_STOP, scale=DIAGONAL),
            Limit(
                "the linkage stretched or folded",
                (0.5 * math.pi - abs(shoulder - elbow)) * DIAGONAL,
                f"|{first} - {second}| is {abs(shoulder - elbow):.6g} rad, and the linkage singular at 90 degrees",
                True,
            ),
        )
        if not base:
            return linkage
        l1, l4 = self.constants.l1, self.constants.l4
        reach = l4 * math.cos(elbow) - l1 * math.sin(shoulder)
        axis = Limit.singularity("the base's axis, l1 sin x2 = l4 cos x3", reach, reach / math.sqrt(l1 * l1 + l4 * l4))
        return (Limit.between("x1", base[0], -BASE_LIMIT, BASE_LIMIT), *linkage, axis)

    def joints(self, position: ArrayLike) -> Array:
        """Return the joints (N,), rad, with which the hand is at `position` (N,), m: the one pose within the limits.

        Raises `InputError` where `position` is not N finite numbers, and `DomainError` for one that is out of reach or
        only reached beyond a limit, which it names with the excess.
        """
        point = checked_vector(self, position, "position")
        pose = self._inverse(point)
        try:
            checked_joints(self, pose)
        except DomainError as error:
            raise self._unreachable(point, error.why) from error
        return pose

    @property
    @abstractmethod
    def _equations(self) -> tuple[Callable[..., None], Callable[..., None]]: ...

    @abstractmethod
    def _inverse(self, point: Array) -> Array: ...

    def _reached(self, point: Array) -> Array:
        joints = np.empty(self.dimension)
        sine = inverse(self._numbers, point, joints)
        if not -1.0 <= sine <= 1.0:
            l1, l4 = self.constants.l1, self.constants.l4
            distance = math.sqrt(l1 * l1 + l4 * l4 + 2.0 * l1 * l4 * sine)
            raise self._unreachable(
                point,
                f"it is {distance:.6g} m from the shoulder, and the links reach from {abs(l4 - l1):.6g} m to "
                f"{l1 + l4:.6g} m",
            )
        return joints

    def _unreachable(self, point: Array, why: str) -> DomainError:
        return DomainError(
            f"{self.name}: position {in_m(point)} is outside of the functional workspace",
            why=why,
            todo="move or shrink the model, or start elsewhere",
        )

    def _kinematics(self, joints: ArrayLike) -> tuple[Array, Array]:
        n = self.dimension
        position, velocity, drift, jacobian = np.empty(n), np.empty(n), np.empty(n), np.empty((n, n))
        self.kernels.kinematics(
            self._numbers, checked_vector(self, joints, finite=False), np.zeros(n), position, velocity, jacobian, drift
        )
        return position, jacobian

    def _dynamics(self, joints: ArrayLike, rates: ArrayLike) -> tuple[Array, Array]:
        inertia, bias = np.empty((self.dimension, self.dimension)), np.empty(self.dimension)
        self.kernels.dynamics(
            self._numbers,
            checked_vector(self, joints, finite=False),
            checked_vector(self, rates, "rates", finite=False),
            inertia,
            bias,
        )
        return inertia, bias


@dataclass(frozen=True)
class Parallelogram2(Parallelogram):
    """The robot with its base locked (2.34) to (2.39): joints (x₁, x₂), hand (y₁, y₂) in the vertical plane.

    It has the constants of the robot with three joints, of which b₁, d₁, `base_inertia` and `dynamics` have no effect:
    M is constant, so that no velocity terms are missing from (2.35), and printed and Lagrangian dynamics are the same.
    It has no singularity within its limits.
    """

    name = "parallelogram-2dof"
    dimension = 2

    @property
    def _equations(self) -> tuple[Callable[..., None], Callable[..., None]]:
        return kinematics2, dynamics2

    def _inverse(self, point: Array) -> Array:
        return self._reached(point)


@dataclass(frozen=True)
class Parallelogram3(Parallelogram):
    """The robot with its base turning (2.26) to (2.33): joints (x₁, x₂, x₃), hand (y₁, y₂, y₃), y₃ upwards.

    Its functional configuration space ends where the hand comes to the base's axis, r = ℓ₄ cos x₃ - ℓ₁ sin x₂ = 0.

    The distance to that singularity is taken as r / √(ℓ₁² + ℓ₄²), rad: the slope of r by the joints is never steeper
    than √(ℓ₁² + ℓ₄²), so that no shorter move of the joints reaches it.
    """

    name = "parallelogram-3dof"
    dimension = 3

    @property
    def _equations(self) -> tuple[Callable[..., None], Callable[..., None]]:
        return kinematics3, dynamics3

    def _inverse(self, point: Array) -> Array:
        # on the axis every base angle gives the same point
        if math.hypot(point[0] + self.constants.l4, point[1]) == 0.0:
            raise self._unreachable(point, "it lies on the base's axis, where x1 is not defined (a singularity)")
        return self._reached(point)


def kinematics2(
    parameters: Array, joints: Array, rates: Array, position: Array, velocity: Array, jacobian: Array, drift: Array
) -> None:
    """Write where the hand is and how it moves, with the base locked: (2.36), (2.37).

    Of `joints` (2,), rad, and `rates` (2,), rad/s, these are `position` (2,), m, `velocity` J q̇ (2,), m/s, the
    `jacobian` J (2, 2), m per rad, and the `drift` J̇ q̇ (2,), m/s². `parameters` (10,) are by the indices L1 to COSINE.
    """
    l1, l4 = parameters[L1], parameters[L4]
    sin1, cos1 = l1 * math.sin(joints[0]), l1 * math.cos(joints[0])
    sin2, cos2 = l4 * math.sin(joints[1]), l4 * math.cos(joints[1])
    first, second = rates[0], rates[1]
    position[0] = cos2 - sin1 - l4  # (2.36)
    position[1] = sin2 + cos1 - l1
    # (2.37)
    jacobian[0, 0], jacobian[0, 1] = -cos1, -sin2
    jacobian[1, 0], jacobian[1, 1] = -sin1, cos2
    velocity[0] = -cos1 * first - sin2 * second
    velocity[1] = -sin1 * first + cos2 * second
    # J̇ q̇: what ÿ is without joint accelerations
    drift[0] = sin1 * first * first - cos2 * second * second
    drift[1] = -cos1 * first * first - sin2 * second * second


def inverse(parameters: Array, position: Array, joints: Array) -> float:
    """Write the joints (N,) with which the hand is at `position` (N,), m; N = 2 or 3.

    In the linkage's plane, seen from the shoulder, across + i up = e^{i x₂} (ℓ₄ e^{iδ} + i ℓ₁) with δ = x₃ - x₂: its
    modulus gives δ, which the stops keep within one radian, and its argument x₂. Return the sine of δ: beyond ±1 the
    links do not reach there, and the joints are not written.
    """
    l1, l4 = parameters[L1], parameters[L4]
    last = joints.shape[0] - 1
    across, up = position[0] + l4, position[last] + l1
    if last == 2:
        joints[0] = math.atan2(position[1], across)
        across = math.hypot(across, position[1])
    # |across + i up|² = ℓ₁² + ℓ₄² + 2 ℓ₁ ℓ₄ sin δ, with the difference of squares as a product: fewer digits are lost
    distance = math.hypot(across, up)
    sine = ((distance - l1) * (distance + l1) - l4 * l4) / (2.0 * l1 * l4)
    if not -1.0 <= sine <= 1.0:
        return float(sine)
    fold = math.asin(sine)  # δ
    shoulder = math.atan2(up, across) - math.atan2(l4 * math.sin(fold) + l1, l4 * math.cos(fold))
    # the turn that is within ±π, as joints are
    joints[last - 1] = shoulder - 2.0 * math.pi * np.rint(shoulder / (2.0 * math.pi))
    joints[last] = joints[last - 1] + fold
    return float(sine)


def dynamics2(parameters: Array, joints: Array, rates: Array, inertia: Array, bias: Array) -> None:
    """Write the inertia (2, 2), kg m², and the bias (2,), N m, with the base locked: (2.35).

    `joints` (2,), rad, `rates` (2,), rad/s. Both inertias are constant, so that no velocity terms are missing.
    """
    inertia[0, 0], inertia[0, 1] = parameters[D2], 0.0
    inertia[1, 0], inertia[1, 1] = 0.0, parameters[D3]
    bias[0] = parameters[B2] * rates[0]
    bias[1] = parameters[B3] * rates[1]


def kinematics3(
    parameters: Array, joints: Array, rates: Array, position: Array, velocity: Array, jacobian: Array, drift: Array
) -> None:
    """Write where the hand is and how it moves, with the base turning: (2.28), (2.29), by r = ℓ₄ cos x₃ - ℓ₁ sin x₂.

    r (m) is the hand's distance from the base's axis. Of `joints` (3,), rad, and `rates` (3,), rad/s, these are
    `position` (3,), m, `velocity` J q̇ (3,), m/s, the `jacobian` J (3, 3), m per rad, and the `drift` J̇ q̇ (3,), m/s².
    `parameters` (10,) are by the indices L1 to COSINE.
    """
    l1, l4 = parameters[L1], parameters[L4]
    sin1, cos1 = math.sin(joints[0]), math.cos(joints[0])
    sin2, cos2 = l1 * math.sin(joints[1]), l1 * math.cos(joints[1])
    sin3, cos3 = l4 * math.sin(joints[2]), l4 * math.cos(joints[2])
    first, second, third = rates[0], rates[1], rates[2]
    reach = cos3 - sin2
    reach_rate = -sin3 * third - cos2 * second
    reach_acceleration = -cos3 * third * third + sin2 * second * second
    # (2.28)
    position[0] = cos1 * reach - l4
    position[1] = sin1 * reach
    position[2] = sin3 + cos2 - l1
    # (2.29)
    jacobian[0, 0], jacobian[0, 1], jacobian[0, 2] = -sin1 * reach, -cos1 * cos2, -cos1 * sin3
    jacobian[1, 0], jacobian[1, 1], jacobian[1, 2] = cos1 * reach, -sin1 * cos2, -sin1 * sin3
    jacobian[2, 0], jacobian[2, 1], jacobian[2, 2] = 0.0, -sin2, cos3
    velocity[0] = cos1 * reach_rate - sin1 * reach * first
    velocity[1] = sin1 * reach_rate + cos1 * reach * first
    velocity[2] = -sin2 * second + cos3 * third
    # J̇ q̇ in polar coordinates: r̈ - r ẋ₁² outwards and 2 ṙ ẋ₁ round the axis, without joint accelerations
    radial_drift = reach_acceleration - reach * first * first
    circumferential_drift = 2.0 * reach_rate * first
    drift[0] = cos1 * radial_drift - sin1 * circumferential_drift
    drift[1] = sin1 * radial_drift + cos1 * circumferential_drift
    drift[2] = -cos2 * second * second - sin3 * third * third


def dynamics3(parameters: Array, joints: Array, rates: Array, inertia: Array, bias: Array) -> None:
    """Write the inertia (3, 3), kg m², and the bias (3,), N m, with the base turning: (2.26) with d₀ of (2.27).

    `joints` (3,), rad, `rates` (3,), rad/s. Where `parameters` (10,) say so the bias has the velocity terms that (2.26)
    lacks: without them the robot creates energy.
    """
    d2, d3 = parameters[D2], parameters[D3]
    sin2, sin3, cos3 = math.sin(joints[1]), math.sin(joints[2]), math.cos(joints[2])
    # ∂₂d₀ = d₂ sin 2x₂ and ∂₃d₀ = ±d₃ sin 2x₃
    slope2 = 2.0 * d2 * sin2 * math.cos(joints[1])
    slope3 = 2.0 * d3 * sin3 * cos3
    base_inertia = parameters[D1] + d2 * sin2 * sin2
    if parameters[COSINE] != 0.0:  # thin links, against the print of (2.27)
        base_inertia += d3 * cos3 * cos3
        slope3 = -slope3
    else:
        base_inertia += d3 * sin3 * sin3
    for i in range(3):
        for j in range(3):
            inertia[i, j] = 0.0
    inertia[0, 0], inertia[1, 1], inertia[2, 2] = base_inertia, d2, d3
    first, second, third = rates[0], rates[1], rates[2]
    bias[0] = parameters[B1] * first
    bias[1] = parameters[B2] * second
    bias[2] = parameters[B3] * third
    # Lagrange's terms: ḋ₀ ẋ₁ on the base, -½ ∂ᵢd₀ ẋ₁² on the links
    if parameters[COUPLED] != 0.0:
        bias[0] += (slope2 * second + slope3 * third) * first
        bias[1] -= 0.5 * slope2 * first * first
        bias[2] -= 0.5 * slope3 * first * first


def margin(parameters: Array, joints: Array) -> float:
    """Return how far inside its limits the device is at `joints` (N,), rad: the smallest distance of `limits`, rad.

    Minus infinity for joints that are not finite. `parameters` (10,) are by the indices L1 to COSINE.
    """
    last = joints.shape[0] - 1
    for i in range(last + 1):
        if not math.isfinite(joints[i]):
            return -math.inf
    shoulder, elbow = joints[last - 1], joints[last]
    nearest: float = min(
        SHOULDER_LIMIT - abs(shoulder),
        elbow - ELBOW_LOW,
        ELBOW_HIGH - elbow,
        (COLLAPSE_STOP - abs(shoulder - elbow)) * DIAGONAL,
    )
    if last == 2:  # the base: its own limit, and the singularity on its axis
        l1, l4 = parameters[L1], parameters[L4]
        reach = l4 * math.cos(elbow) - l1 * math.sin(shoulder)
        nearest = min(nearest, BASE_LIMIT - abs(joints[0]), reach / math.sqrt(l1 * l1 + l4 * l4))
    return nearest
