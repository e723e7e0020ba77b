"""A model as the script of a case page draws it: rings in the plane, triangles in space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.reports.canvas import MM
from hapticeval.reports.case_data import Packer, Track
from hapticeval.reports.plane import Box, solid

AROUND = 3.0
"""An open model, or one far larger than the paths, is drawn this many times as far as they go."""


def packed_model(model: Model | None, found: Sequence[Track], packer: Packer) -> dict[str, Any] | None:
    """Pack the outline of a model in the plane, m, as `rings`, and return their numbers; None for no model."""
    if model is None or model.dimension != 2:
        return None
    import shapely

    parts = shapely.get_parts(solid(model, _round(model, found)))
    rings = [ring for part in parts if part.geom_type == "Polygon" for ring in (part.exterior, *part.interiors)]
    return {"rings": [packer.add(shapely.get_coordinates(ring) / MM) for ring in rings]}


def _round(model: Model, found: Sequence[Track]) -> Box:
    points = MM * np.vstack([np.vstack([each.hip, each.ihip]) for each in found])
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.5 * AROUND * max(float(np.ptp(points, axis=0).max()), 1.0)
    middle = 0.5 * (low + high)
    low, high = middle - half, middle + half
    if model.boundary.closed:
        bounds = MM * np.array(model.boundary.bounds)
        if np.all(np.abs(bounds - np.tile(middle, 2)) < 3.0 * half):
            low, high = np.minimum(low, bounds[:2]), np.maximum(high, bounds[2:])
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])
