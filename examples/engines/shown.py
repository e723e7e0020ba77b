"""What adapters of engines share: which models are convex, and a coupled tool that shows its contact alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from scipy.spatial import ConvexHull


def is_convex(vertices: np.ndarray, cells: np.ndarray) -> bool:
    """Return whether triangles, corners (n, 3), m, and rows (k, 3) of them, fill their convex hull."""
    # By volume: a test edge by edge allows so much at each that a fine mesh of a waist passes for convex.
    return bool(ConvexHull(vertices).volume <= (1.0 + 1e-9) * trimesh.Trimesh(vertices, cells, process=False).volume)


class ContactOnly:
    """Before a coupled tool in a class's bases: no force while it is free, and the spring without damper in contact.

    The tool is as before. A free one is at the hand then, and its inertia is not felt.
    """

    def step(self: Any, hip: np.ndarray, velocity: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return where the tool is (3,), m, and the spring's force (3,), N; the HIP and none where it is free."""
        tool, _ = super().step(hip, velocity, dt)  # type: ignore[misc]
        return (tool, self.stiffness * (tool - hip)) if self.contact else (hip.copy(), np.zeros(3))
