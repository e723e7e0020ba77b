"""How the tool moves across and along a surface, in the plane and in space: what Problem 7.1 speaks of."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hapticeval.geometry.boundary import ClosestPoint
from hapticeval.phenomena.decisions import FOCAL_EIGENVALUE, HOLD_TICKS, PLACE_ROUNDING, SHARE_ROUNDING, SLIDE_SHARE
from hapticeval.phenomena.measures.closed_paths import running_sums
from hapticeval.phenomena.measures.surface_force import along_surface
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import worst_row
from hapticeval.phenomena.verdict import Finding, Outcome, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray

SPEED_GIVEN = "a hand led along a given path has the speed that it is given"
TOO_MUCH = "what the sampling may do to the speed is too much to decide"
DOES_NOT_SLIDE = "the tool does not slide"
FINER = {"refine": "the same experiment at 2 and 4 times the sampling rate"}
"""What the checks of Problem 7.1 use beside the recording."""


def never_across(base: Observed, message: str, evidence: dict[str, object] | None = None) -> Finding:
    """Return the finding for a tool that is never off the surface, of which a check asks how it comes back.

    A controller that is not drawn off it leaves that open. A renderer whose own tool it is, a rigid one, has no such
    motion on any stimulus.
    """
    if base.own_tool:
        message = (
            "the renderer's own tool is rigid on the surface: it is never off it, and has nothing to come back from"
        )
        return Finding(Outcome.NOT_APPLICABLE, message, evidence=evidence or {})
    return undecided(message, evidence=evidence or {})


@dataclass(frozen=True, eq=False)
class SurfaceMotion:
    """A recording seen from the surface of its scene's model: the foot p of the tool y, and its distance n.

    y = p + n nu with the outward unit normal nu, and p' = (I + n W)^-1 P_T y' with the shape operator W and the
    projection P_T onto the tangent plane. k counts the samples, N is the dimension.
    """

    base: Observed

    @property
    def frame(self) -> ClosestPoint:
        """Return feet (k, N), m, outward normals (k, N), distances (k,), m, and shape operators (k, N, N), 1/m."""
        return self.base.nearest

    @property
    def distance(self) -> Array:
        """Return how far off the surface the tool is, n (k,), m, negative inside."""
        return self.frame.distance

    @cached_property
    def across(self) -> Array:
        """Return how fast the tool leaves the surface, n' (k,), m/s, outwards."""
        return np.asarray(np.sum(self.base.velocity * self.frame.normal, axis=1))

    @cached_property
    def along(self) -> Array:
        """Return the tool's own velocity along the surface, P_T y' (k, N), m/s."""
        return np.asarray(self.base.velocity - self.across[:, np.newaxis] * self.frame.normal)

    @cached_property
    def foot_velocity(self) -> Array:
        """Return the velocity p' (k, N), m/s, of the foot: the tool's image on the surface."""
        return self.pulled_back(self.along)

    @cached_property
    def foot_speed(self) -> Array:
        """Return the speed of the foot, |p'| (k,), m/s: the rate of arc length."""
        return np.asarray(np.linalg.norm(self.foot_velocity, axis=1))

    @cached_property
    def centripetal(self) -> Array:
        """Return the inward force (k,), N, that keeps the tool on the surface (3.8): m <W p', P_T y'>."""
        # W p' is how fast the normal turns; its part along y' is what bends the path.
        turning = np.einsum("kij,kj->ki", self.frame.shape, self.foot_velocity)
        return np.asarray(self.base.scene.mass * np.sum(turning * self.along, axis=1))

    @cached_property
    def stretch(self) -> Array:
        """Return how much faster the tool is than its foot: I + n W, (k, N, N), singular where it has no foot."""
        return np.eye(self.base.hip.shape[1]) + self.distance[:, np.newaxis, np.newaxis] * self.frame.shape

    @property
    def footless(self) -> str | None:
        """Say where the tool is at a centre of curvature of the surface; None where it always has one foot."""
        nearest = np.asarray(np.linalg.eigvalsh(self.stretch)[:, 0], dtype=np.float64)
        tick = worst_row(-nearest)
        # The least eigenvalue of I + n W is zero at a centre of curvature, on the inner side of a bend.
        if nearest[tick] > FOCAL_EIGENVALUE:
            return None
        return (
            f"at t = {self.base.time[tick]:.4g} s the tool is at a centre of curvature of the surface, where it "
            "has no foot to speak of"
        )

    def pulled_back(self, tangential: Array) -> Array:
        """Return (I + n W)^-1 of tangential vectors (k, N), as m/s: what the foot does when the tool does that."""
        return np.asarray(np.linalg.solve(self.stretch, tangential[:, :, np.newaxis])[:, :, 0])

    @cached_property
    def transported(self) -> Array:
        """Return tangent bases (k, N, N - 1), each the one before, carried along without turning in the surface.

        Components in them change at the rate of the covariant acceleration. In the plane the basis is the tangent
        itself; in space it is turned by the smallest rotation that takes each normal to the next.
        """
        normal = self.frame.normal
        if normal.shape[1] == 2:
            return np.stack([-normal[:, 1], normal[:, 0]], axis=1)[:, :, np.newaxis]
        bases = np.empty((normal.shape[0], 3, 2))
        # The first basis is arbitrary: the rows of V' that the normal is not.
        bases[0] = np.linalg.svd(normal[:1])[2][1:].T
        for k in range(1, normal.shape[0]):
            before, after = normal[k - 1], normal[k]
            middle = before + after
            # Rotation from a to b, of a vector t with t.a = 0: t - (t.b)(a + b) / (1 + a.b)
            carried = bases[k - 1] - np.outer(middle, after @ bases[k - 1]) / (1.0 + before @ after)
            bases[k] = carried
        return bases

    def components(self, tangential: Array) -> Array:
        """Return the components of tangential vectors (k, N), as m/s, in the transported bases: (k, N - 1)."""
        return np.asarray(np.einsum("kij,ki->kj", self.transported, tangential))

    @property
    def slides(self) -> bool:
        """Return whether the foot, at its top speed, goes far enough in the run for its motion to show anything."""
        lasts = float(self.base.time[-1] - self.base.time[0])
        return float(self.foot_speed.max()) * lasts > SLIDE_SHARE * self.base.scene.model.size

    @property
    def pushed(self) -> BoolArray:
        """Return where the operator's force is felt, (k,); nowhere where it was not recorded.

        Not where all that it adds up to is the rounding of the tool's momentum, as in a force told from its change.
        """
        force = self.base.channels.get("operator_force")
        if force is None:
            return np.zeros(len(self.base), dtype=bool)
        impulses = np.linalg.norm(force, axis=1) * self.base.dt
        momentum = self.base.scene.mass * float(np.linalg.norm(self.base.velocity, axis=1).max())
        return np.asarray((impulses > 0.0) & (impulses.sum() > SHARE_ROUNDING * momentum))

    @property
    def starts_on_surface(self) -> bool:
        """Return whether the tool starts on the surface and moves along it, to rounding."""
        near = abs(self.distance[0]) <= PLACE_ROUNDING * self.base.scene.model.size
        return bool(near and abs(self.across[0]) <= SHARE_ROUNDING * np.linalg.norm(self.base.velocity[0]))

    def held_distance(self, since: int = 0) -> float:
        """Return how far (m) a held force lets a perfect law drift off the surface, from the tick `since` on.

        The centripetal force turns and changes by dF_c from tick to tick, and is late by `HOLD_TICKS`; a force error
        moves the assigned transversal dynamics by 1 / K_p, and by its overshoot more where it sets in at once.
        """
        # Outwards or inwards, it turns and changes by as much.
        force = self.centripetal[:, np.newaxis] * self.frame.normal
        change = np.linalg.norm(np.diff(force[since:], axis=0), axis=1)
        if change.size == 0:
            return 0.0
        # n = F / K_p at rest; a force that sets in at once overshoots.
        return HOLD_TICKS * float(change.max()) * _overshoot(self.base.scene) / self.base.scene.stiffness

    @cached_property
    def held_speed(self) -> Array:
        """Return the speed (k,), m/s, that a held force may have given or taken along the surface up to each sample.

        The force's change from tick to tick along the surface, late by `HOLD_TICKS`, as an impulse.
        """
        # dF_t: what across the surface comes late is the distance's to show.
        change = along_surface(np.diff(self.base.force, axis=0), self.frame.normal[:-1])
        impulse = np.linalg.norm(change, axis=1) * np.diff(self.base.time)
        return HOLD_TICKS / self.base.scene.mass * running_sums(impulse)

    @property
    def sensor_error(self) -> float:
        """Return how far (m) the sensed HIP was from the true one at the most: nothing finer can be held."""
        measured = self.base.channels.get("measured_hip")
        if measured is None:
            return 0.0
        return float(np.max(np.linalg.norm(measured - self.base.hip, axis=1)))


def _overshoot(scene: Scene) -> float:
    """Return the peak of the assigned transversal dynamics' step response, in units of its end value: 1 to 2."""
    # Damping ratio zeta = K_d / (2 sqrt(K_p m)); critical from 1 on.
    ratio = scene.damping / (2.0 * math.sqrt(scene.stiffness * scene.mass))
    if ratio >= 1.0:
        return 1.0
    # Peak of an underdamped step: 1 + exp(-pi zeta / sqrt(1 - zeta^2))
    return 1.0 + math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio * ratio))


def decay_rate(scene: Scene) -> float:
    """Return the rate (1/s) at which the assigned dynamics n'' = -(K_p / m) n - (K_d / m) n' die out across."""
    # The slower root of s^2 + (K_d / m) s + K_p / m, real part; 0 without a damper.
    half = 0.5 * scene.damping / scene.mass
    return half - math.sqrt(max(half * half - scene.stiffness / scene.mass, 0.0))
