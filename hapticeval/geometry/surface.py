"""The smooth closed surfaces in space that have compiled kernels (thesis 7.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.errors import InputError
from hapticeval.geometry import surface_kernels as kernels
from hapticeval.geometry.boundary import Frame, InSpace, spiral
from hapticeval.geometry.validate import checked_number, checked_size, points_for, refuse_not_finite
from hapticeval.types import Array

KINDS = {"sphere": (kernels.SPHERE, 1), "ellipsoid": (kernels.ELLIPSOID, 3), "torus": (kernels.TORUS, 2)}
"""For each kind its number in the kernels, and how many lengths it has."""

FLATTEST = 1e6
"""Largest ratio of two semi-axes: that of the plane ellipse too."""


@dataclass(frozen=True, eq=False)
class Surface(InSpace):
    """A sphere, an ellipsoid or a torus about the origin; `reals` are its lengths (m). It is a `Boundary`.

    A sphere has its radius, an ellipsoid its semi-axes along x, y and z, and a torus, about the z axis, the radius of
    its core circle and that of its tube. Raises `InputError` for lengths that are not positive and finite, for
    semi-axes whose ratio is above 1e6, and for a torus whose tube closes its hole.
    """

    name: str
    kind: str
    reals: Sequence[float]

    def __post_init__(self) -> None:
        if self.kind not in KINDS or len(self.reals) != KINDS[self.kind][1]:
            raise InputError(
                f"surface '{self.name}' is a {self.kind} of {len(self.reals)} lengths",
                todo="give a sphere 1 length, a torus 2, an ellipsoid 3",
            )
        lengths = tuple(checked_size(each, f"length {i} of {self.kind}") for i, each in enumerate(self.reals))
        if self.kind == "torus" and not lengths[1] < lengths[0] * (1.0 - 1e-9):
            raise InputError(
                f"a torus with a tube of radius {lengths[1]:g} m about a circle of radius {lengths[0]:g} m",
                why="it crosses itself on its axis unless the tube's radius is the smaller one",
                todo="choose minor below major",
            )
        if max(lengths) > FLATTEST * min(lengths):
            raise InputError(
                f"a {self.kind} with lengths of {min(lengths):g} m and {max(lengths):g} m",
                why=f"the ratio of two of them is at most {FLATTEST:g}",
            )
        object.__setattr__(self, "reals", lengths)

    @cached_property
    def row(self) -> Array:
        """What the kernels take, see `surface_kernels`."""
        row = np.zeros(kernels.REALS)
        row[0] = KINDS[self.kind][0]
        row[1 : 1 + len(self.reals)] = self.reals
        return row

    @property
    def bounds(self) -> tuple[float, ...]:
        """(xmin, ymin, zmin, xmax, ymax, zmax), m."""
        extents = tuple(self.reals)  # three semi-axes, or a sphere's one radius
        if self.kind == "torus":
            extents = (extents[0] + extents[1], extents[0] + extents[1], extents[1])
        extents = extents * (3 // len(extents))
        return (*(-each for each in extents), *extents)

    def frame(self, points: ArrayLike) -> Frame:
        """See `Boundary.frame`: one compiled call."""
        array = points_for(points, 3)
        try:
            return kernels.frames(self.row, array)
        except ValueError:
            raise refuse_not_finite(array) from None

    def signed_distance(self, points: ArrayLike) -> Array:
        """See `Boundary.signed_distance`."""
        array = points_for(points, 3)
        try:
            return kernels.distances(self.row, array)
        except ValueError:
            raise refuse_not_finite(array) from None

    def medial_distance(self, points: ArrayLike) -> Array:
        """Return (n, 2), m: from the foot of each of points (n, 3), how far the medial set lies in- and outwards.

        Along the normal, infinite where there is none: between them each point of the normal has this foot, and I + nW
        is positive.
        """
        frame = self.frame(points)
        return kernels.reach_many(self.row, frame.foot, frame.normal)

    def points(self, n: int) -> Array:
        """See `Boundary.points`: evenly on the sphere and the torus; an ellipsoid's are the sphere's, stretched."""
        if checked_number("n", n) != int(n) or n < 1:
            raise InputError(f"{n!r} points", why="it must be a whole number, at least 1")
        if self.kind != "torus":
            return np.asarray(spiral(n) * np.array(self.reals))
        major, minor = self.reals
        angle = _tube_angle((np.arange(n) + 0.5) / n, minor / major)
        out, turn = major + minor * np.cos(angle), np.arange(n) * (math.pi * (3.0 - math.sqrt(5.0)))
        return np.column_stack([out * np.cos(turn), out * np.sin(turn), minor * np.sin(angle)])


def _tube_angle(share: Array, ratio: float) -> Array:
    """Round the tube, the angle below which that share of the area lies: angle + ratio sin(angle) = 2 pi share."""
    target = 2.0 * math.pi * share
    low, high = np.zeros_like(target), np.full_like(target, 2.0 * math.pi)
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = middle + ratio * np.sin(middle) < target
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))
