"""The smooth closed surfaces in space that have compiled kernels (thesis 7.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import Closest
from hapticeval.geometry import surface_kernels as kernels
from hapticeval.geometry.boundary import ClosestPoint, SurfaceInSpace, spread_over_sphere
from hapticeval.geometry.motion import Motion
from hapticeval.geometry.validate import answer_by_kernel
from hapticeval.types import Array

KINDS = {"sphere": kernels.SPHERE, "ellipsoid": kernels.ELLIPSOID, "torus": kernels.TORUS}
"""For each kind its number in the kernels."""


@dataclass(frozen=True, eq=False)
class Surface(SurfaceInSpace):
    """A sphere, an ellipsoid or a torus about the origin; `reals` are its lengths (m). It is a `Boundary`.

    A sphere has its radius, an ellipsoid its semi-axes along x, y and z, and a torus, about the z axis, the radius of
    its core circle and that of its tube.

    The catalogue makes them, and refuses lengths that do not fit.
    """

    name: str
    kind: str
    reals: Sequence[float]

    @cached_property
    def row(self) -> Array:
        """What the kernels take, see `surface_kernels`."""
        row = np.zeros(kernels.ROW_LENGTH)
        row[0] = KINDS[self.kind]
        row[1 : 1 + len(self.reals)] = self.reals
        return row

    @cached_property
    def compiled_closest(self) -> Closest:
        """The closest point as compiled code, for what is composed into a step: see `closest_of`."""
        from hapticeval.geometry.closest_kernels import closest_of_surface

        return closest_of_surface(self.row)

    def moved(self, motion: Motion) -> Surface | None:
        """Return the surface scaled, its own mirror image; None where it is turned or shifted: it is bound to axes."""
        # the kernels know surfaces about the origin and along the axes only
        if not motion.keeps_axes:
            return None
        return Surface(self.name, self.kind, tuple(motion.scale * length for length in self.reals))

    @property
    def bounds(self) -> tuple[float, ...]:
        """(xmin, ymin, zmin, xmax, ymax, zmax), m."""
        extents = tuple(self.reals)  # three semi-axes, or a sphere's one radius
        # the tube's outer equator in x and y, the tube alone in z
        if self.kind == "torus":
            extents = (extents[0] + extents[1], extents[0] + extents[1], extents[1])
        # a sphere's one radius counts for all three axes
        extents = extents * (3 // len(extents))
        return (*(-extent for extent in extents), *extents)

    def closest_point(self, points: ArrayLike) -> ClosestPoint:
        """Return the closest points, normals, distances and shapes of points (n, 3), m: one compiled call.

        See `Boundary.closest_point`.
        """
        return answer_by_kernel(kernels.closest_points, (self.row,), points, 3)

    def signed_distance(self, points: ArrayLike) -> Array:
        """Return the signed distances (n,), m, of points (n, 3), m, in one call: see `Boundary.signed_distance`."""
        return answer_by_kernel(kernels.signed_distances, (self.row,), points, 3)

    def medial_distance(self, points: ArrayLike) -> Array:
        """Return (n, 2), m: from the foot of each of points (n, 3), m, how far the medial set lies in- and outwards.

        Along the normal, infinite where there is none: between them each point of the normal has this foot, and I + nW
        is positive.
        """
        frame = self.closest_point(points)
        return kernels.medial_reaches(self.row, frame.foot, frame.normal)

    def points(self, n: int) -> Array:
        """See `Boundary.points`: evenly on the sphere and the torus; an ellipsoid's are the sphere's, stretched."""
        if self.kind != "torus":
            return np.asarray(spread_over_sphere(n) * np.array(self.reals))
        major, minor = self.reals
        # equal shares of area: a ring of the tube has an area that goes with its distance from the axis
        angle = _tube_angle((np.arange(n) + 0.5) / n, minor / major)
        # golden angles about the axis keep the points apart, as in `spread_over_sphere`
        axis_distance, azimuth = major + minor * np.cos(angle), np.arange(n) * (math.pi * (3.0 - math.sqrt(5.0)))
        return np.column_stack(
            [axis_distance * np.cos(azimuth), axis_distance * np.sin(azimuth), minor * np.sin(angle)]
        )


def _tube_angle(share: Array, ratio: float) -> Array:
    """Round the tube, the angle below which that share of the area lies: angle + ratio sin(angle) = 2 pi share."""
    target = 2.0 * math.pi * share
    low, high = np.zeros_like(target), np.full_like(target, 2.0 * math.pi)
    # bisection: the left side rises with the angle, as ratio < 1
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = middle + ratio * np.sin(middle) < target
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))
