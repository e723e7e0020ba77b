"""The direct-drive parallelogram robot of section 2.5.5, with its base turning (3-DOF) or locked (2-DOF)."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.devices.limit import Limit
from hapticeval.devices.parallelogram_parameters import BaseInertia, Dynamics, ParallelogramParameters
from hapticeval.errors import DomainError, InputError
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.devices.device import CompiledDevice


@dataclass(frozen=True)
class _Parallelogram(ABC):
    """What both have in common; see `Parallelogram2` and `Parallelogram3`."""

    constants: ParallelogramParameters = field(default_factory=ParallelogramParameters)
    dynamics: Dynamics = Dynamics.LAGRANGIAN
    base_inertia: BaseInertia = BaseInertia.SIN

    name = ""
    dimension = 0

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
        """What the kernels are given: see `parallelogram_kernels`."""
        return self._numbers.copy()

    @cached_property
    def _numbers(self) -> Array:
        constants = [float(getattr(self.constants, each.name)) for each in fields(self.constants)]
        choices = [self.dynamics is Dynamics.LAGRANGIAN, self.base_inertia is BaseInertia.COS]
        return np.array([*constants, *map(float, choices)])

    @property
    @abstractmethod
    def kernels(self) -> CompiledDevice:
        """For compiled loops; the methods call them too."""

    def position(self, joints: ArrayLike) -> Array:
        """y = h(x) (2.28), (2.36), (N,), m, zero at home."""
        return self._kinematics(joints)[0]

    def jacobian(self, joints: ArrayLike) -> Array:
        """J (2.29), (2.37), (N, N), m/rad."""
        return self._kinematics(joints)[1]

    def jacobian_rate(self, joints: ArrayLike, rates: ArrayLike) -> Array:
        """J̇, (N, N), m/(rad s)."""
        out = np.empty((self.dimension, self.dimension))
        self._jacobian_rate_kernel(self._numbers, self._vector(joints), self._vector(rates, "rates"), out)
        return out

    def inertia(self, joints: ArrayLike) -> Array:
        """M: diag(d₀, d₂, d₃), or diag(d₂, d₃) with the base locked, (N, N), kg m²."""
        return self._dynamics(joints, np.zeros(self.dimension))[0]

    def bias(self, joints: ArrayLike, rates: ArrayLike) -> Array:
        """Velocity terms as `dynamics` says, and b q̇; the linkage is balanced against gravity, (N,), N m."""
        return self._dynamics(joints, rates)[1]

    def margin(self, joints: ArrayLike) -> float:
        """The smallest of the distances of `limits`, rad; minus infinity where a joint is not finite.

        From inside, no move of the joints (Euclidean norm) shorter than this leaves the functional configuration
        space (2.33), (2.39).
        """
        return float(self.kernels.margin(self._numbers, self._vector(joints)))

    @abstractmethod
    def limits(self, joints: ArrayLike) -> tuple[Limit, ...]:
        """What bounds the functional configuration space, joint limits and singularities, as seen from `joints`."""

    def check(self, joints: ArrayLike) -> None:
        """See that `joints` lie in the functional configuration space.

        Raises `InputError` where they are not N finite numbers, and `DomainError` outside or on the edge, which is open
        (Definition 2.4): it names the limit, and tells by how much it is passed, in rad and degrees.
        """
        vector = self._finite(joints, "joints")
        worst = min(self.limits(vector), key=lambda limit: limit.distance)
        if worst.distance <= 0.0:
            raise DomainError(
                f"{self.name}: joints ({', '.join(f'{x:.6g}' for x in vector)}) rad are outside of the functional "
                "configuration space",
                why=worst.text,
                todo="start elsewhere, or keep the hand further from there",
            )

    def joints(self, position: ArrayLike) -> Array:
        """Inverse kinematics in closed form: (N,), rad, the one pose inside the functional configuration space.

        Raises `InputError` where `position` is not N finite numbers, and `DomainError` for one that is out of reach or
        only reached beyond a limit: it says which and by how much.
        """
        point = self._finite(position, "position")
        found = self._inverse(point)
        try:
            self.check(found)
        except DomainError as error:
            raise self._unreachable(point, error.why) from error
        return found

    @abstractmethod
    def _inverse(self, point: Array) -> Array: ...

    def _linkage(self, point: Array, across: float, up: float) -> tuple[float, float]:
        """The linkage's two joints from the hand's place (m) in its plane, seen from the shoulder.

        across + i up = e^{i x₂} (ℓ₄ e^{iδ} + i ℓ₁) with δ = x₃ - x₂: its modulus gives δ, which the stops keep within
        one radian, and its argument x₂.
        """
        l1, l4 = self.constants.l1, self.constants.l4
        distance = math.hypot(across, up)
        sine = ((distance - l1) * (distance + l1) - l4 * l4) / (2.0 * l1 * l4)
        if not -1.0 <= sine <= 1.0:
            raise self._unreachable(
                point,
                f"it is {distance:.6g} m from the shoulder, and the links reach from {abs(l4 - l1):.6g} m to "
                f"{l1 + l4:.6g} m",
            )
        fold = math.asin(sine)
        turn = math.atan2(up, across) - math.atan2(l4 * math.sin(fold) + l1, l4 * math.cos(fold))
        shoulder = math.remainder(turn, 2.0 * math.pi)
        return shoulder, shoulder + fold

    def _unreachable(self, point: Array, why: str) -> DomainError:
        return DomainError(
            f"{self.name}: position ({', '.join(f'{y:.6g}' for y in point)}) m is outside of the functional workspace",
            why=why,
            todo="move or shrink the model, or start elsewhere",
        )

    def _kinematics(self, joints: ArrayLike) -> tuple[Array, Array]:
        n = self.dimension
        position, velocity, drift, jacobian = np.empty(n), np.empty(n), np.empty(n), np.empty((n, n))
        self.kernels.kinematics(self._numbers, self._vector(joints), np.zeros(n), position, velocity, jacobian, drift)
        return position, jacobian

    def _dynamics(self, joints: ArrayLike, rates: ArrayLike) -> tuple[Array, Array]:
        inertia, bias = np.empty((self.dimension, self.dimension)), np.empty(self.dimension)
        self.kernels.dynamics(self._numbers, self._vector(joints), self._vector(rates, "rates"), inertia, bias)
        return inertia, bias

    @property
    @abstractmethod
    def _jacobian_rate_kernel(self) -> Any: ...

    def _vector(self, values: ArrayLike, what: str = "joints") -> Array:
        """`values` as the kernels take them: compiled code reads as many as the robot has joints."""
        try:
            vector = np.array(values, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"{what} = {values!r}", why="they must be numbers") from error
        if vector.shape != (self.dimension,):
            raise InputError(
                f"{what} of the shape {vector.shape}", why=f"{self.name} has {self.dimension}: ({self.dimension},)"
            )
        return vector

    def _finite(self, values: ArrayLike, what: str) -> Array:
        vector = self._vector(values, what)
        if not np.isfinite(vector).all():
            raise InputError(f"{what} = ({', '.join(f'{x:g}' for x in vector)})", why="they must be finite")
        return vector


def _linkage_limits(names: Sequence[str], shoulder: float, elbow: float) -> tuple[Limit, ...]:
    from hapticeval.devices import parallelogram_kernels as kernels

    first, second = names
    return (
        Limit.between(first, shoulder, -kernels.SHOULDER_LIMIT, kernels.SHOULDER_LIMIT),
        Limit.between(second, elbow, kernels.ELBOW_LOW, kernels.ELBOW_HIGH),
        Limit.between(f"{first} - {second}", shoulder - elbow, -kernels.STOP, kernels.STOP, scale=kernels.DIAGONAL),
    )


@dataclass(frozen=True)
class Parallelogram2(_Parallelogram):
    """The robot with its base locked (2.34) to (2.39): joints (x₁, x₂), hand (y₁, y₂) in the vertical plane.

    It is described as the robot with three joints is, of which b₁, d₁, `base_inertia` and `dynamics` have no effect:
    M is constant, so that no velocity terms are missing from (2.35), and printed and Lagrangian dynamics are the same.
    It has no singularity within its limits.
    """

    name = "parallelogram-2dof"
    dimension = 2

    @property
    def kernels(self) -> CompiledDevice:
        """For compiled loops; the methods call them too."""
        from hapticeval.devices import parallelogram_kernels as kernels
        from hapticeval.devices.device import CompiledDevice

        return CompiledDevice(kernels.kinematics2, kernels.dynamics2, kernels.margin2)

    @property
    def _jacobian_rate_kernel(self) -> Any:
        from hapticeval.devices.parallelogram_kernels import jacobian_rate2

        return jacobian_rate2

    def limits(self, joints: ArrayLike) -> tuple[Limit, ...]:
        """The joint limits of (2.38), the stop's open as Definition 2.4 wants."""
        shoulder, elbow = self._vector(joints).tolist()
        return _linkage_limits(("x1", "x2"), shoulder, elbow)

    def _inverse(self, point: Array) -> Array:
        return np.array(self._linkage(point, point[0] + self.constants.l4, point[1] + self.constants.l1))


@dataclass(frozen=True)
class Parallelogram3(_Parallelogram):
    """The robot with its base turning (2.26) to (2.33): joints (x₁, x₂, x₃), hand (y₁, y₂, y₃), y₃ upwards.

    Its functional configuration space ends where the hand comes to the base's axis, r = ℓ₄ cos x₃ - ℓ₁ sin x₂ = 0. The
    distance to that singularity is taken as r / √(ℓ₁² + ℓ₄²), rad: the slope of r by the joints is never steeper than
    √(ℓ₁² + ℓ₄²), so that no shorter move of the joints reaches it.
    """

    name = "parallelogram-3dof"
    dimension = 3

    @property
    def kernels(self) -> CompiledDevice:
        """For compiled loops; the methods call them too."""
        from hapticeval.devices import parallelogram_kernels as kernels
        from hapticeval.devices.device import CompiledDevice

        return CompiledDevice(kernels.kinematics3, kernels.dynamics3, kernels.margin3)

    @property
    def _jacobian_rate_kernel(self) -> Any:
        from hapticeval.devices.parallelogram_kernels import jacobian_rate3

        return jacobian_rate3

    def limits(self, joints: ArrayLike) -> tuple[Limit, ...]:
        """The joint limits of (2.30), open, and the singularity of (2.33)."""
        from hapticeval.devices.parallelogram_kernels import BASE_LIMIT

        base, shoulder, elbow = self._vector(joints).tolist()
        l1, l4 = self.constants.l1, self.constants.l4
        reach = l4 * math.cos(elbow) - l1 * math.sin(shoulder)
        return (
            Limit.between("x1", base, -BASE_LIMIT, BASE_LIMIT),
            *_linkage_limits(("x2", "x3"), shoulder, elbow),
            Limit.singularity("the base's axis, l1 sin x2 = l4 cos x3", reach, reach / math.sqrt(l1 * l1 + l4 * l4)),
        )

    def _inverse(self, point: Array) -> Array:
        across = float(point[0] + self.constants.l4)
        reach = math.hypot(across, point[1])
        if reach == 0.0:
            raise self._unreachable(point, "it lies on the base's axis, where x1 is not defined (a singularity)")
        linkage = self._linkage(point, reach, point[2] + self.constants.l1)
        return np.array([math.atan2(point[1], across), *linkage])
