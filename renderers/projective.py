"""A renderer made of a projection and a regulation scheme: the kind that thesis chapter 4 describes."""

from __future__ import annotations

from operator import sub

import numpy as np

from hapticeval.geometry.curve import Curve
from hapticeval.geometry.surface import Surface
from hapticeval.renderer import Response
from hapticeval.renderers.projection import Projection
from hapticeval.renderers.regulation import Components, Regulation
from hapticeval.types import Array


class ProjectiveRenderer:
    """Projects the HIP (4.4), and regulates the position error (4.5) with the scene's gains (4.6).

    In free space the IHIP is the HIP and the force zero. `step` and `run` agree to the last bit.
    """

    def __init__(self, projection: Projection, regulation: Regulation, *, stiffness: float, damping: float):
        self.projection = projection
        self.regulation = regulation
        self.stiffness = stiffness
        self.damping = damping
        self._error: list[float] | None = None

    @property
    def surface(self) -> Curve | Surface:
        """The curve, or surface in space, that is really rendered."""
        return self.projection.surface

    @property
    def resolution(self) -> float:
        """Longest edge or cell of the representation (m); zero where it is exact."""
        return self.projection.resolution

    @property
    def standoff(self) -> float:
        """Largest distance (m) of the rendered surface from the model's."""
        return self.projection.standoff

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: inside the model it starts in contact."""
        self.projection.reset(hip)
        self._error = None

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m; `velocity` (N,), m/s; `dt`, s."""
        ihip, normal, contact = self.projection.project(hip)
        if not contact:
            self._error = None
            return Response(np.array(hip, dtype=np.float64), np.zeros(len(ihip)))
        error = list(map(sub, hip.tolist(), ihip))
        rate = [0.0] * len(error)
        if self.regulation.needs_rate:
            if self._error is not None:
                rate = [(e - before) / dt for e, before in zip(error, self._error, strict=True)]
            self._error = error
        force = self._force(error, normal, velocity.tolist(), rate)
        return Response(np.array(ihip), np.array(force))

    def run(self, hips: Array, dt: float) -> tuple[Array, Array]:
        """A whole trajectory: `reset` at the first row of `hips` (n, N), and a `step` a row.

        The velocity is the difference backwards in time, zero at the first row. Returns IHIPs and forces, (n, N).
        """
        hips = np.ascontiguousarray(hips, dtype=np.float64)
        self.reset(hips[0])
        ihips, normals, contact = self.projection.trace(hips)
        velocities = np.zeros_like(hips)
        velocities[1:] = np.diff(hips, axis=0) / dt
        errors = hips - ihips
        rates = np.zeros_like(hips)
        if self.regulation.needs_rate:
            rates[1:] = np.diff(errors, axis=0) / dt
            held = np.zeros(contact.size, dtype=bool)
            held[1:] = contact[1:] & contact[:-1]
            rates[~held] = 0.0
            self._error = errors[-1].tolist() if contact[-1] else None
        force = self._force(errors.T, normals.T, velocities.T, rates.T)
        forces = np.stack(np.broadcast_arrays(*force), axis=1)
        forces[~contact] = 0.0
        return ihips, forces

    def _force(
        self,
        error: Components | Array | list[float],
        normal: Components | Array | list[float],
        velocity: Components | Array | list[float],
        rate: Components | Array | list[float],
    ) -> Components:
        return self.regulation.law(
            self.stiffness, self.damping, tuple(error), tuple(normal), tuple(velocity), tuple(rate)
        )
