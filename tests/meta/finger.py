"""A finger proxy as haptic libraries have it: a point that moves to the hand until it is a margin off the surface.

In each tick it goes straight towards the hand. What it meets stops it `MARGIN` in front; then it goes towards the foot
of the hand on the plane that stopped it, and, stopped again, along the line that both planes leave. Ways shorter than
the margin it does not go: it has a dead band. It knows the surface by crossings and normals only, as a ray caster does.
"""

from __future__ import annotations

import numpy as np

from hapticeval.geometry.boundary import Boundary
from hapticeval.renderer import Response
from hapticeval.scene import Scene

MARGIN = 1e-4
"""m"""


class FingerProxy:
    """Declares its margin as its standoff; on a bilateral constraint it is of no use."""

    supports = frozenset()
    standoff = MARGIN

    def __init__(self, scene: Scene) -> None:
        self.boundary: Boundary = scene.model.boundary
        self.stiffness = scene.stiffness
        self.grain = 1e-5 * scene.model.size

    def reset(self, hip: np.ndarray) -> None:
        at = self.boundary.closest_point(hip[np.newaxis])
        self.proxy = np.array(hip if at.distance[0] > 0.0 else at.foot[0] + MARGIN * at.normal[0])

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        planes: list[np.ndarray] = []
        goal = hip
        for _ in range(hip.size):
            way = goal - self.proxy
            length = float(np.linalg.norm(way))
            if planes and length < MARGIN:
                break
            normal = self._towards(goal, way, length)
            if normal is None:
                break
            planes.append(normal)
            # What the planes leave of the way to the hand: all of it less its part in their span.
            span = np.linalg.qr(np.array(planes).T)[0]
            rest = hip - self.proxy
            goal = self.proxy + rest - span @ (span.T @ rest)
        if not planes:
            self.proxy = np.array(hip)
        return Response(self.proxy.copy(), self.stiffness * (self.proxy - hip))

    def _towards(self, goal: np.ndarray, way: np.ndarray, length: float) -> np.ndarray | None:
        """Go to the goal, or up to the margin in front of what is in the way: of that the normal."""
        if length == 0.0:
            return None
        ahead = way / length
        met = self.boundary.first_crossing(self.proxy, goal + MARGIN * ahead, grain=self.grain)
        if met is None:
            self.proxy = np.array(goal)
            return None
        at = self.boundary.closest_point(met[np.newaxis])
        normal = at.normal[0]
        # Back along the way, until it is the margin off the plane that it met.
        high = float((self.proxy - met) @ normal)
        into = -float(ahead @ normal)
        if high > MARGIN and into > 0.0:
            self.proxy = self.proxy + min((high - MARGIN) / into, length) * ahead
        return normal


class Undeclared(FingerProxy):
    """The same, and says nothing of its margin."""

    standoff = 0.0


class Coarse(FingerProxy):
    """The same, and declares the facets of the mesh that it is given as its resolution."""

    resolution = 0.014


class Unswept(FingerProxy):
    """Looks for the surface only where the hand is inside: what it has passed in a tick it does not meet."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        if self.boundary.signed_distance(hip[np.newaxis])[0] > MARGIN and not self.touches:
            self.proxy = np.array(hip)
            return Response(hip, np.zeros_like(hip))
        answer = super().step(hip, velocity, dt)
        self.touches = bool(np.any(answer.force))
        return answer

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.touches = False
