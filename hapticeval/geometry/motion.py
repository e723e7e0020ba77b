"""Similarities, x -> scale R x + shift: a rigid contact does not depend on where its scene lies, or on its size."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.errors import InputError
from hapticeval.types import Array


@dataclass(frozen=True, eq=False)
class Motion:
    """A similarity: `matrix` R (N, N), a turn or a mirror, a `scale`, then a `shift` (N,), m.

    Raises `InputError` for a matrix that is neither, and a scale that is not positive and finite.
    """

    matrix: Array
    scale: float
    shift: Array

    def __post_init__(self) -> None:
        matrix, shift = np.array(self.matrix, dtype=np.float64), np.array(self.shift, dtype=np.float64)
        # R R^T = I holds for turns and mirrors, and for nothing else
        if matrix.shape != (shift.size, shift.size) or not np.allclose(matrix @ matrix.T, np.eye(shift.size)):
            raise InputError(f"a motion with the matrix {matrix.tolist()} and the shift {shift.tolist()}")
        if not (math.isfinite(self.scale) and self.scale > 0.0):
            raise InputError(f"a motion of scale {self.scale!r}", why="it makes nothing of a model")
        # the class is frozen: this is its own constructor
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "shift", shift)

    def __call__(self, points: Array) -> Array:
        """Return points (n, N), m, moved: scale R x + shift."""
        return np.asarray(self.scale * (points @ self.matrix.T) + self.shift)

    def back(self, points: Array) -> Array:
        """Return moved points (n, N), m, where they were: R^T (y - shift) / scale."""
        return np.asarray(((points - self.shift) / self.scale) @ self.matrix)

    def turned(self, vectors: Array) -> Array:
        """Return vectors (n, N) or (N,) in the axes of the moved scene."""
        return np.asarray(vectors @ self.matrix.T)

    def turned_back(self, vectors: Array) -> Array:
        """Return vectors (n, N) of the moved scene in the axes of the scene before."""
        return np.asarray(vectors @ self.matrix)

    @property
    def scales_only(self) -> bool:
        """Whether it neither turns nor shifts."""
        return bool(np.array_equal(self.matrix, np.eye(self.shift.size)) and not self.shift.any())

    @property
    def mirrors(self) -> bool:
        """Whether it makes a left hand of a right one: a mirror, perhaps turned."""
        # det R is 1 for a turn and -1 for a mirror
        return bool(np.linalg.det(self.matrix) < 0.0)

    @property
    def keeps_axes(self) -> bool:
        """Whether it changes no more than the scale and the sign of y."""
        mirror_or_identity = np.eye(self.shift.size)
        mirror_or_identity[1, 1] = self.matrix[1, 1]
        return bool(np.array_equal(self.matrix, mirror_or_identity) and not self.shift.any())

    @property
    def is_identity(self) -> bool:
        """Whether it moves nothing."""
        return self.scales_only and self.scale == 1.0


def scaling(factor: float, dimension: int) -> Motion:
    """Return the motion that scales by `factor` about the origin."""
    return Motion(np.eye(dimension), factor, np.zeros(dimension))


def mirroring(dimension: int) -> Motion:
    """Return the mirror in the x axis, in space in the plane of x and z: it changes no digit of a coordinate."""
    matrix = np.eye(dimension)
    matrix[1, 1] = -1.0
    return Motion(matrix, 1.0, np.zeros(dimension))


def rigid_motion(angle: float, shift: ArrayLike) -> Motion:
    """Return a turn by `angle` (rad), and then a shift (N,), m.

    In the plane it turns anticlockwise; in space about the axis (1, 2, 3), clockwise seen from its tip.
    """
    shift = np.asarray(shift, dtype=np.float64)
    c, s = math.cos(angle), math.sin(angle)
    if shift.size == 2:
        return Motion(np.array([[c, -s], [s, c]]), 1.0, shift)
    # |(1, 2, 3)| = sqrt 14: a direction that no symmetry of a model shares
    axis = np.array([1.0, 2.0, 3.0]) / math.sqrt(14.0)
    # Rodrigues: R = cos I - sin [axis]x + (1 - cos) axis axis^T; the rows of `cross` are axis x e_i: -[axis]x
    cross = np.cross(np.eye(3), -axis)
    return Motion(c * np.eye(3) + s * cross + (1.0 - c) * np.outer(axis, axis), 1.0, shift)
