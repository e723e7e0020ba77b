"""Places on a model's surface, and how deep under each the medial axis and the centre of curvature lie."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.model import Model
from hapticeval.types import Array, BoolArray

PLACE_COUNT = 100
"""How many places of a surface are known; parts of a path start at these, and between them."""


class Place(NamedTuple):
    """A point of the surface: `foot` (N,), m, its outward unit `normal` (N,), and two depths (m) under it.

    At `medial` another point of the surface is as near: the medial axis. At `focal` is the centre of the surface's
    largest curvature. Each is infinite where there is none.
    """

    foot: Array
    normal: Array
    medial: float
    focal: float


def places(model: Model) -> list[Place]:
    """Return `PLACE_COUNT` places of the model's surface, in order along a plane one."""
    boundary: Any = model.boundary
    return _places_of(boundary, model.size)


@lru_cache(maxsize=16)
def _places_of(boundary: Boundary, size: float) -> list[Place]:
    """Return the places of a boundary, found once; `size` is its model's, m."""
    frame = boundary.closest_point(boundary.points(PLACE_COUNT))
    foot, normal = frame.foot, frame.normal
    # The largest principal curvature, 1/m, positive where convex.
    largest_curvature = np.linalg.eigvalsh(frame.shape).max(axis=1)

    def is_nearest(depth: Array) -> BoolArray:
        """Whether each place is the nearest point of the surface from `depth` (n,), m, under it; (n,)."""
        distance = boundary.signed_distance(foot - depth[:, np.newaxis] * normal)
        # At depth d the distance is -d while no other point of the surface is nearer, and more than that beyond.
        nearest: BoolArray = distance < -depth + 1e-6 * size
        return nearest

    low, high = np.zeros(PLACE_COUNT), np.full(PLACE_COUNT, np.inf)
    # Bracket the depth at which the place is the nearest no more, from 1e-4 to 1 of the size.
    for depth in size * np.geomspace(1e-4, 1.0, 32):
        still_nearest = is_nearest(np.full(PLACE_COUNT, depth))
        low = np.where(still_nearest & np.isinf(high), depth, low)
        high = np.where(~still_nearest & np.isinf(high), depth, high)
    bracketed = np.isfinite(high)
    # Bisect: a bracket is a third of its depth wide, so that 1e-4 of it is left.
    for _ in range(12):
        middle = np.where(bracketed, 0.5 * (low + np.where(bracketed, high, 0.0)), low)
        still_nearest = is_nearest(middle)
        low, high = np.where(bracketed & still_nearest, middle, low), np.where(bracketed & ~still_nearest, middle, high)
    # r = 1 / kappa; a flat or concave place has no centre under it.
    focal = np.where(largest_curvature * size > 1e-6, 1.0 / np.maximum(largest_curvature, 1e-300), np.inf)
    return [
        Place(*row) for row in zip(foot, normal, np.where(bracketed, low, np.inf).tolist(), focal.tolist(), strict=True)
    ]


def check_model(model: object) -> None:
    """Raise `InputError` for what is no model."""
    if not isinstance(model, Model):
        raise InputError(f"{model!r} is no model", todo='make one: hapticeval.make_model("star")')
