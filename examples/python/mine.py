"""A renderer: the hand inside the model is pushed to the nearest point of its surface, in the plane and in space."""

import numpy as np

from hapticeval import Declaration, Scene, Spring


class Nearest:
    """Made from a scene; asked once a tick."""

    declares = Declaration(spring=Spring.ERROR)

    def __init__(self, scene: Scene) -> None:
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness

    def reset(self, hip: np.ndarray) -> None:
        """Start a run with the hand at `hip` (N,), m: forget what was before."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the IHIP (N,), m, and the force on the hand (N,), N."""
        found = self.boundary.closest_point([hip])
        ihip = found.foot[0] if found.distance[0] < 0.0 else hip
        return ihip, self.stiffness * (ihip - hip)
