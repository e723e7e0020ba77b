"""A smooth surface in space under the ideal contact: where the tool starts on it, and how it is carried along."""

from __future__ import annotations

import numpy as np

from hapticeval.compiled import as_record
from hapticeval.geometry.surface import ELLIPSOID, FIRST, KIND, SECOND, THIRD, TORUS, Surface
from hapticeval.rigid_contact.force import SLIDE, Stretches
from hapticeval.rigid_contact.space import SPACE_TOOL, state_in_flight
from hapticeval.rigid_contact.surface_advance import carry_on_surface
from hapticeval.types import Array


class SurfaceGround:
    """A smooth closed surface as the `Ground` of an ideal contact, unilateral or bilateral."""

    def __init__(self, surface: Surface) -> None:
        self.surface = surface
        self._sharpest = _largest_curvature(surface.row)

    def in_flight(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.in_flight` for a point (3,), m, and a velocity (3,), m/s."""
        return state_in_flight(point, velocity)

    def on_boundary(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.on_boundary` for a point (3,), m, and a velocity (3,), m/s."""
        state = self.in_flight(self.surface.closest_point(point[np.newaxis]).foot[0], velocity)
        as_record(state, SPACE_TOOL).mode = SLIDE
        return state

    def carry(
        self, start: Array, stretches: Stretches, gains: Array, rows: int, limit: int
    ) -> tuple[Array, Array, int, Array]:
        """Answer `Ground.carry`: samples (rows, 12) and events (k, 8), in m, m/s, s and N s."""
        return carry_on_surface(start, self.surface.row, self._sharpest, stretches, gains, rows, limit)


def _largest_curvature(row: Array) -> float:
    """Return the largest |principal curvature| (1/m) of the surface in a row (ROW_LENGTH,) of `geometry.surface`."""
    # round the tube, or round the hole
    if row[KIND] == TORUS:
        return float(max(1.0 / row[SECOND], 1.0 / (row[FIRST] - row[SECOND])))
    # at the tip of the longest semi-axis, across the shortest
    if row[KIND] == ELLIPSOID:
        axes = row[FIRST : THIRD + 1]
        return float(axes.max() / axes.min() ** 2)
    return float(1.0 / row[FIRST])
