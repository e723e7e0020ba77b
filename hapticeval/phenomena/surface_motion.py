"""How the tool moves across and along a surface, in the plane and in space: what Problem 7.1 speaks of."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hapticeval.geometry.boundary import ClosestPoint
from hapticeval.phenomena.decisions import FOCAL_EIGENVALUE, HOLD_TICKS, PLACE_ROUNDING, SLIDE_SHARE, SPEED_ROUNDING
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray


@dataclass(frozen=True, eq=False)
class SurfaceMotion:
    """A recording seen from the surface of its scene's model: y = p + n nu, and p' = (I + n W)^-1 P_T y'."""

    recording: Recording
    scene: Scene

    @cached_property
    def frame(self) -> ClosestPoint:
        """Feet, normals, distances and shape operators."""
        return self.scene.model.boundary.closest_point(self.recording.hip)

    @property
    def distance(self) -> Array:
        """n (k,), m: how far off the surface the tool is, negative inside."""
        return self.frame.distance

    @cached_property
    def across(self) -> Array:
        """n' (k,), m/s."""
        return np.asarray(np.sum(self.recording.velocity * self.frame.normal, axis=1))

    @cached_property
    def along(self) -> Array:
        """P_T y' (k, N), m/s: the tool's own velocity along the surface."""
        return np.asarray(self.recording.velocity - self.across[:, np.newaxis] * self.frame.normal)

    @cached_property
    def foot_velocity(self) -> Array:
        """p' (k, N), m/s: that of the foot, the tool's image on the surface."""
        return self.pulled_back(self.along)

    @cached_property
    def foot_speed(self) -> Array:
        """|p'| (k,), m/s: the rate of arc length."""
        return np.asarray(np.linalg.norm(self.foot_velocity, axis=1))

    @cached_property
    def centripetal(self) -> Array:
        """(k,), N, along the inward normal: m <W p', P_T y'>, what keeps the tool on the surface (3.8)."""
        turning = np.einsum("kij,kj->ki", self.frame.shape, self.foot_velocity)
        return np.asarray(self.scene.mass * np.sum(turning * self.along, axis=1))

    @cached_property
    def stretch(self) -> Array:
        """I + n W, (k, N, N): how much faster the tool is than its foot, singular where it has none."""
        return np.eye(self.recording.hip.shape[1]) + self.distance[:, np.newaxis, np.newaxis] * self.frame.shape

    @property
    def footless(self) -> str | None:
        """Where the tool is at a centre of curvature of the surface, in words; None where it always has one foot."""
        nearest = np.linalg.eigvalsh(self.stretch)[:, 0]
        tick = int(np.argmin(nearest))
        if nearest[tick] > FOCAL_EIGENVALUE:
            return None
        return (
            f"at t = {self.recording.time[tick]:.4g} s the tool is at a centre of curvature of the surface, where it "
            "has no foot to speak of"
        )

    def pulled_back(self, tangential: Array) -> Array:
        """(I + n W)^-1 of tangential vectors (k, N)."""
        return np.asarray(np.linalg.solve(self.stretch, tangential[:, :, np.newaxis])[:, :, 0])

    @cached_property
    def transported(self) -> Array:
        """Tangent bases (k, N, N - 1), each the one before carried along without turning in the surface.

        Components in them change at the covariant acceleration's rate. In the plane that is the tangent itself; in
        space the smallest rotation that takes each normal to the next.
        """
        normal = self.frame.normal
        if normal.shape[1] == 2:
            return np.stack([-normal[:, 1], normal[:, 0]], axis=1)[:, :, np.newaxis]
        bases = np.empty((normal.shape[0], 3, 2))
        bases[0] = np.linalg.svd(normal[:1])[2][1:].T
        for k in range(1, normal.shape[0]):
            before, after = normal[k - 1], normal[k]
            middle = before + after
            carried = bases[k - 1] - np.outer(middle, after @ bases[k - 1]) / (1.0 + before @ after)
            bases[k] = carried
        return bases

    def components(self, tangential: Array) -> Array:
        """Tangential vectors (k, N) in the transported bases: (k, N - 1)."""
        return np.asarray(np.einsum("kij,ki->kj", self.transported, tangential))

    @property
    def slides(self) -> bool:
        """Whether the foot, at its top speed, goes far enough in the run for its motion to show anything."""
        lasts = float(self.recording.time[-1] - self.recording.time[0])
        return float(self.foot_speed.max()) * lasts > SLIDE_SHARE * self.scene.model.size

    @property
    def pushed(self) -> BoolArray:
        """Where the operator's force is felt (k,)."""
        force = self.recording.channels.get("operator_force")
        if force is None:
            return np.zeros(len(self.recording), dtype=bool)
        return np.asarray(np.any(force != 0.0, axis=1))

    @property
    def starts_on_surface(self) -> bool:
        """Whether the tool starts on the surface and moves along it, to rounding."""
        near = abs(self.distance[0]) <= PLACE_ROUNDING * self.scene.model.size
        return bool(near and abs(self.across[0]) <= SPEED_ROUNDING * np.linalg.norm(self.recording.velocity[0]))

    def held_distance(self, since: int = 0) -> float:
        """How far (m) a held force lets a perfect law drift off the surface, from the tick `since` on.

        The centripetal force turns and changes by dF_c from tick to tick, and is late by `HOLD_TICKS`; a force error
        moves the assigned transversal dynamics by 1 / K_p, and by its overshoot more where it sets in at once.
        """
        force = -self.centripetal[:, np.newaxis] * self.frame.normal
        change = np.linalg.norm(np.diff(force[since:], axis=0), axis=1)
        if change.size == 0:
            return 0.0
        return HOLD_TICKS * float(change.max()) * _overshoot(self.scene) / self.scene.stiffness

    @cached_property
    def held_speed(self) -> Array:
        """How much speed (k,), m/s, a held force may have given along the surface or taken from it, up to each sample.

        The force's change from tick to tick along the surface, late by `HOLD_TICKS`, as an impulse.
        """
        change = np.diff(self.recording.force, axis=0)
        normal = self.frame.normal[:-1]
        change = change - np.sum(change * normal, axis=1)[:, np.newaxis] * normal
        impulse = np.linalg.norm(change, axis=1) * np.diff(self.recording.time)
        return HOLD_TICKS / self.scene.mass * np.concatenate([[0.0], np.cumsum(impulse)])

    @property
    def sensor_error(self) -> float:
        """How far (m) the sensed HIP was from the true one at the most: nothing finer can be held."""
        measured = self.recording.channels.get("measured_hip")
        if measured is None:
            return 0.0
        return float(np.max(np.linalg.norm(measured - self.recording.hip, axis=1)))


def _overshoot(scene: Scene) -> float:
    """The peak of the assigned transversal dynamics' step response, in units of its end value: 1 to 2."""
    ratio = scene.damping / (2.0 * math.sqrt(scene.stiffness * scene.mass))
    if ratio >= 1.0:
        return 1.0
    return 1.0 + math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio * ratio))


def decay_rate(scene: Scene) -> float:
    """The rate (1/s) at which the assigned transversal dynamics die out: n'' = -(K_p / m) n - (K_d / m) n'."""
    half = 0.5 * scene.damping / scene.mass
    return half - math.sqrt(max(half * half - scene.stiffness / scene.mass, 0.0))
