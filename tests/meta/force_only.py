"""Renderers that have a force and no contact point, as potential fields and force sensors have."""

from __future__ import annotations

import numpy as np

from hapticeval.renderer import Declaration, Response
from hapticeval.scene import Scene


class Field:
    """A potential field, K d^2 / 2 of the depth d: its force is K d along the nearest point's normal. Honest."""

    declares = Declaration(force_only=True)
    gain = 1.0

    def __init__(self, scene: Scene) -> None:
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness

    def reset(self, hip: np.ndarray) -> None:
        """It remembers nothing."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        at = self.boundary.closest_point(hip[np.newaxis])
        depth = max(0.0, -float(at.distance[0]))
        return Response(hip, self.force(depth, at.normal[0]))

    def force(self, depth: float, normal: np.ndarray) -> np.ndarray:
        return self.gain * self.stiffness * depth * normal


class Silent(Field):
    """The same, and does not say so."""

    declares = Declaration()


class Stiff(Field):
    """Three times as stiff as the scene is. Wrong."""

    gain = 3.0


class Mute(Field):
    """Never gives a force. Wrong."""

    gain = 0.0


class Pulling(Field):
    """Pulls the hand in. Wrong."""

    gain = -1.0


class Aside(Field):
    """Pushes 30 degrees beside the normal. Wrong."""

    def force(self, depth: float, normal: np.ndarray) -> np.ndarray:
        aside = np.zeros_like(normal)
        aside[:2] = -normal[1], normal[0]
        return super().force(depth, np.cos(0.5) * normal + np.sin(0.5) * aside)


class Dodging(Field):
    """Has a contact point that is 5 mm off the surface, and declares that it has none. Wrong."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        at = self.boundary.closest_point(hip[np.newaxis])
        depth = max(0.0, -float(at.distance[0]))
        ihip = at.foot[0] + 5e-3 * at.normal[0] if depth else hip
        return Response(ihip, self.stiffness * (ihip - hip))


class Afar(Field):
    """Pushes from 20 mm off the surface on. Wrong."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        at = self.boundary.closest_point(hip[np.newaxis])
        depth = max(0.0, 0.02 - float(at.distance[0]))
        return Response(hip, self.force(depth, at.normal[0]))


class DeadBand(Field):
    """Gives no force below 0.05 N, and says so. Honest."""

    declares = Declaration(force_only=True, force_resolution=0.05)

    def force(self, depth: float, normal: np.ndarray) -> np.ndarray:
        force = super().force(depth, normal)
        return force if np.linalg.norm(force) > 0.05 else np.zeros_like(force)


class Late(Field):
    """Gives its force three ticks late. Honest."""

    def reset(self, hip: np.ndarray) -> None:
        self.queue = [np.zeros_like(hip)] * 3

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.queue.append(super().step(hip, velocity, dt).force)
        return Response(hip, self.queue.pop(0))


class Interrupted(Field):
    """Is silent for every second stretch of 300 ticks, however deep the hand is. Wrong."""

    def reset(self, hip: np.ndarray) -> None:
        self.ticks = 0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.ticks += 1
        response = super().step(hip, velocity, dt)
        return Response(hip, np.zeros_like(hip)) if self.ticks // 300 % 2 else response


class Kicking(Field):
    """Pushes 30 N more in the first three ticks of a contact. Wrong."""

    def reset(self, hip: np.ndarray) -> None:
        self.ticks = 0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        response = super().step(hip, velocity, dt)
        size = float(np.linalg.norm(response.force))
        self.ticks = self.ticks + 1 if size else 0
        return Response(hip, response.force * (1.0 + 30.0 / size)) if 0 < self.ticks <= 3 else response
