"""Joint friction: Coulomb friction, which no controller knows of (thesis 2.6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hapticeval.effects.effect import Effect, Part, Stage, number


@dataclass(frozen=True)
class JointFriction(Effect):
    """Oppose each moving joint with `torque` (N m; N for the point mass), and hold one at rest as long as that can."""

    torque: float = number("force")

    kind: ClassVar[str] = "joint-friction"
    stage: ClassVar[Stage] = Stage.JOINTS
    linear: ClassVar[bool] = False
    words: ClassVar[str] = "Coulomb friction of {torque} in each joint"

    def part(self, ticks: int, size: int, dt: float) -> Part:  # noqa: ARG002 - as every effect
        """Assemble the friction of each joint: `params` (N,)."""
        return Part(None, np.full(size, self.torque))
