"""A renderer made of a projection and a regulation scheme: the kind that thesis chapter 4 describes."""

from __future__ import annotations

from functools import cached_property
from operator import sub

import numpy as np

from hapticeval.errors import RefusalError
from hapticeval.geometry.boundary import Boundary
from hapticeval.renderer import CompiledLaw, Declaration, Response
from hapticeval.renderers.projection import Bending, Projection
from hapticeval.renderers.regulation import Components, Regulation
from hapticeval.types import Array


class ProjectiveRenderer:
    """Projects the HIP (4.4), and regulates the position error (4.5) with the scene's gains (4.6).

    In free space the IHIP is the HIP and the force zero. `step`, `run` and `law` agree to the last bit. `mass` (kg) is
    the virtual tool's, for schemes that bend its way. Raises `RefusalError` for such a scheme on a projection that does
    not know how the surface bends.
    """

    def __init__(
        self, projection: Projection, regulation: Regulation, *, stiffness: float, damping: float, mass: float
    ) -> None:
        if regulation.bends and not isinstance(projection, Bending):
            raise RefusalError(
                f"the scheme '{regulation.name}' has no curvature to follow on '{projection.surface.name}'",
                why="this projection does not know how the surface bends",
                todo="use it with minimum-distance, or use set-stabilisation",
            )
        self.projection = projection
        self.regulation = regulation
        self.stiffness = stiffness
        self.damping = damping
        self.mass = mass
        self._error: list[float] | None = None

    @property
    def surface(self) -> Boundary:
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

    @property
    def declares(self) -> Declaration:
        """That the force is a spring, where the scheme has one that is linear."""
        return Declaration(spring=self.regulation.spring)

    @cached_property
    def law(self) -> CompiledLaw | None:
        """The same step for compiled loops: for minimum distance on the exact curve or surface and on polygons."""
        from hapticeval.renderers.projective_law import law_of

        gains = {"stiffness": self.stiffness, "damping": self.damping, "mass": self.mass}
        return law_of(self.projection, self.regulation, **gains)

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: inside the model it starts in contact."""
        self.projection.reset(hip)
        self._error = None
        if self.law is not None:
            self.law.data.state[:] = 0.0

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
        if isinstance(self.projection, Bending) and self.regulation.bends:
            fall = self.projection.centripetal(hip[np.newaxis], velocity[np.newaxis]).item()
            force = tuple([f - self.mass * fall * n for f, n in zip(force, normal, strict=True)])
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
        if isinstance(self.projection, Bending) and self.regulation.bends:
            forces -= (self.mass * self.projection.centripetal(hips, velocities))[:, np.newaxis] * normals
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
