"""The ideal point-mass robot of section 2.5.5: a mass, pushed by the renderer and by the operator."""

from __future__ import annotations

from dataclasses import dataclass

from hapticeval.types import Array


@dataclass(frozen=True)
class PointMass:
    """m y'' = F_r + F_o (2.23), (3.1); `mass` in kg."""

    mass: float

    def advance(
        self, position: Array, velocity: Array, force: Array, push: Array, next_push: Array, dt: float
    ) -> tuple[Array, Array]:
        """Position (N,), m, and velocity (N,), m/s, after `dt` seconds.

        `force` (N,) is held (zero-order hold, thesis 2.6) and the operator's force runs straight from `push` to
        `next_push`, so that the motion is a cubic and this is its exact integral.
        """
        gain = dt / self.mass
        new_position = position + dt * velocity + (dt * gain / 6.0) * (3.0 * force + 2.0 * push + next_push)
        return new_position, velocity + gain * (force + 0.5 * (push + next_push))
