"""Smooth closed surfaces in space, as models for renderers in 3D (thesis 7.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from hapticeval.geometry.frame import Frame
from hapticeval.types import Array


@dataclass(frozen=True, eq=False)
class Surface:
    """A sphere, an ellipsoid or a torus about the origin; `reals` are its lengths (m)."""

    name: str
    kind: str
    reals: Sequence[float]

    @property
    def dimension(self) -> int:
        """Of space: 3."""
        return 3

    @property
    def bounds(self) -> tuple[float, ...]:
        """(xmin, ymin, zmin, xmax, ymax, zmax), m."""
        raise NotImplementedError

    def frame(self, points: ArrayLike) -> Frame:
        """Feet, normals, signed distances and shape operators for points (n, 3): see `Frame`."""
        raise NotImplementedError

    def signed_distance(self, points: ArrayLike) -> Array:
        """Distances (n,), m, negative inside."""
        return self.frame(points).distance
