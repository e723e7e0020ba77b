"""The error vector at shallow depth: the last of the four properties that section 5.1 asks of a projection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hapticeval.geometry.curve import Curve
from hapticeval.types import Array

DEPTHS = (0.0025, 0.025)
"""Depths as shares of the model's extent: 0.5 mm and 5 mm in a model of 200 mm."""
PLACES = 400
FROM_CORNERS = 3.0
"""Depths that a place keeps away from every corner, where there is no one normal."""


@dataclass(frozen=True)
class Shallow:
    """Angle (degrees) between error vector and surface normal at `depth` (m): median and 95 per cent of the places."""

    depth: float
    median: float
    p95: float


def shallow_angles(project: Callable[[Array], Array], surface: Curve) -> tuple[Shallow, ...]:
    """How far from normal a projection of HIPs (n, 2) is just under a closed `surface`, at each of `DEPTHS`.

    Places are evenly spaced along the surface, away from its corners; HIPs that come out in free space do not count.
    """
    xmin, ymin, xmax, ymax = surface.bounds
    found = []
    for share in DEPTHS:
        depth = share * max(xmax - xmin, ymax - ymin)
        u = surface.parameter(np.linspace(0.0, surface.length, PLACES, endpoint=False))
        position = surface.position(u)
        clear = np.ones(PLACES, dtype=bool)
        for corner in surface.corners:
            clear &= np.linalg.norm(position - corner.position, axis=1) > FROM_CORNERS * depth
        hips = position[clear] - depth * surface.normal(u[clear])
        ihips = project(hips)
        error = ihips - hips
        length = np.linalg.norm(error, axis=1)
        pressed = length > 0.0
        if not pressed.any():
            continue
        normal = surface.normal(surface.nearest(ihips[pressed]))
        cosine = np.sum(error[pressed] * normal, axis=1) / length[pressed]
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        found.append(Shallow(depth, float(np.median(angle)), float(np.percentile(angle, 95))))
    return tuple(found)
