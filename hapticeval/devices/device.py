"""What a device is: joints that a controller drives, and an end-effector that the hand holds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, runtime_checkable

from hapticeval.types import Array


class CompiledDevice(NamedTuple):
    """A device's kernels, made by `compiled`, of the signatures of the same names in `hapticeval.compiled`."""

    kinematics: Callable[..., Any]
    dynamics: Callable[..., Any]
    margin: Callable[..., Any]


@runtime_checkable
class Device(Protocol):
    """A robot with as many joints as outputs (thesis 2.5.2, Assumption 2.2): N = 2 or 3.

    Joint coordinates are rad, and m for the point mass, whose joints are its position.
    """

    @property
    def name(self) -> str:
        """As in suites: `point-mass`, `parallelogram-2dof`, `parallelogram-3dof`."""

    @property
    def dimension(self) -> int:
        """N."""

    @property
    def parameters(self) -> Array:
        """What the kernels are given: (k,), writable."""

    @property
    def kernels(self) -> CompiledDevice:
        """The same device for compiled loops."""

    def position(self, joints: Array) -> Array:
        """Forward kinematics w (2.3): (N,), m."""

    def joints(self, position: Array) -> Array:
        """Inverse kinematics: (N,). Raises `DomainError` for a position outside the functional workspace."""

    def jacobian(self, joints: Array) -> Array:
        """J = dw/dq (2.4): (N, N)."""

    def jacobian_rate(self, joints: Array, rates: Array) -> Array:
        """J̇: (N, N)."""

    def inertia(self, joints: Array) -> Array:
        """M(q): (N, N)."""

    def bias(self, joints: Array, rates: Array) -> Array:
        """C(q, q̇) q̇ + b q̇ + g: (N,), so that M q̈ + bias = τ."""

    def margin(self, joints: Array) -> float:
        """How far inside the functional configuration space (Definition 2.4): positive inside, zero on its edge.

        The smallest of the distances to the joint limits (rad) and to the nearest singularity, as the device says;
        infinite for the point mass.
        """
