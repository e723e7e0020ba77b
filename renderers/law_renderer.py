"""A renderer whose step is compiled code, asked from Python: projective, set stabilisation, and some of the field."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import for_kernels
from hapticeval.errors import DomainError, InputError, in_m
from hapticeval.geometry.boundary import Boundary
from hapticeval.renderer import CompiledStep, Response
from hapticeval.types import Array


class LawRenderer:
    """Answers by `law`, with the same bits in `step` and in a compiled loop.

    `surface` is the curve, or surface in space, that is really rendered, `resolution` (m) the length of it over which
    the representation is blurred, and `standoff` (m) how far it may lie off the model.
    """

    def __init__(
        self,
        law: CompiledStep,
        surface: Boundary,
        *,
        resolution: float = 0.0,
        standoff: float = 0.0,
    ) -> None:
        self.law = law
        self.surface = surface
        self.resolution = resolution
        self.standoff = standoff
        self._push = np.zeros(surface.dimension)

    def reset(self, hip: Array) -> None:  # noqa: ARG002 - the protocol's
        """Start a run with the hand at `hip` (N,), m: nothing is touched yet, and nothing felt."""
        self.law.data.state[:] = 0.0
        self._push[:] = 0.0

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s. Raises `DomainError` where the law is not defined."""
        hip, velocity = checked_hand(hip), as_rows(velocity)
        ihip, force = np.empty_like(self._push), np.empty_like(self._push)
        exit_number = self.law.function(self.law.data, hip, velocity, self._push, dt, ihip, force)
        if exit_number:
            raise self.led_out(hip, self.law.domain_exits[exit_number])
        return Response(ihip, force)

    def led_out(self, hip: Array, what: str) -> DomainError:
        """Return the error for a hand at `hip` (N,), m, where the law is not defined, as `what` says."""
        return DomainError(f"{what}: {in_m(hip)}")


def checked_hand(hip: Array) -> Array:
    """Return a hand's position (N,), m, as kernels take it. Raises `InputError` for one that is not finite."""
    hip = as_rows(hip)
    if not math.isfinite(math.hypot(*hip.tolist())):  # a search would have no end
        raise InputError(
            f"the HIP is {tuple(hip.tolist())}", why="no point is near to it", todo="see what gives the positions"
        )
    return hip


def as_rows(values: Array) -> Array:
    """Return rows (n, N), or one (N,), of any unit (m, N, s) as kernels take them: float64, writable and contiguous."""
    return for_kernels(np.asarray(values, dtype=np.float64))
