"""What a coupled tool may show of itself: its contact alone."""

from __future__ import annotations

from typing import Any

import numpy as np


class ContactOnly:
    """Before a coupled tool in a class's bases: no force while it is free, and the spring without damper in contact.

    The tool is as before. A free one is at the hand then, and its inertia is not felt.
    """

    def step(self: Any, hip: np.ndarray, velocity: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return where the tool is (3,), m, and the spring's force (3,), N; the HIP and none where it is free."""
        tool, _ = super().step(hip, velocity, dt)  # type: ignore[misc]
        return (tool, self.stiffness * (tool - hip)) if self.contact else (hip.copy(), np.zeros(3))
