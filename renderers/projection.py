"""What a projection is: the first half of a projective renderer, from the hand to the virtual tool (thesis 4.1)."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from hapticeval.geometry.boundary import Boundary
from hapticeval.types import Array, BoolArray


class Projected(NamedTuple):
    """Where one HIP is projected to: IHIP (m) and outward unit normal there, by components, and whether it touches.

    Out of contact the IHIP is the HIP and the normal is zero.
    """

    ihip: tuple[float, ...]
    normal: tuple[float, ...]
    contact: bool


class Projection(Protocol):
    """HIP to IHIP (4.4), with whatever it remembers between ticks.

    `resolution` (m) is the length of surface over which it is blurred, and `standoff` (m) how far it may lie off the
    model: both zero where the representation is exact.
    """

    resolution: float
    standoff: float

    @property
    def surface(self) -> Boundary:
        """The curve, or surface in space, that is really rendered."""

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m."""

    def project(self, hip: Array) -> Projected:
        """One tick."""

    def trace(self, hips: Array) -> tuple[Array, Array, BoolArray]:
        """A tick a row of `hips` (n, N): IHIPs (n, N), normals (n, N) and contact (n,), as `project` gives them."""


@runtime_checkable
class Bending(Protocol):
    """A projection that knows how the surface bends where it projects to."""

    def centripetal(self, hips: Array, velocities: Array) -> Array:
        """κ v_t^2 (n,), m/s^2, positive where the model is convex: what a tool that passes there is to fall by.

        v_t is the part of each of `velocities` (n, N) along the surface at the IHIP of each of `hips` (n, N).
        """
