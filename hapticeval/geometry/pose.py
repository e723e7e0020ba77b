"""Where a moving body is: a rotation and a translation that take points of the body's frame into the world."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.errors import InputError
from hapticeval.types import Array

POSE_ROUNDING = 1e-9
"""How far R Rᵀ may be from the identity, and det R from 1. *Chosen*: coordinates have nine digits or so."""


class Pose(NamedTuple):
    """One pose: `rotation` R (N, N) and `translation` t (N,), m; or one a row: (n, N, N) and (n, N).

    A point x of the body's frame is at R x + t in the world.
    """

    rotation: Array
    translation: Array

    def to_world(self, points: Array) -> Array:
        """Return points (N,) or (n, N), m, of the body's frame in the world: R x + t."""
        return self.turned(points) + self.translation

    def to_body(self, points: Array) -> Array:
        """Return points (N,) or (n, N), m, of the world in the body's frame: Rᵀ (y - t)."""
        return self.turned_back(points - self.translation)

    def turned(self, vectors: Array) -> Array:
        """Return vectors (N,) or (n, N) of the body's axes in the world's: R v."""
        return np.asarray((self.rotation @ vectors[..., np.newaxis])[..., 0])

    def turned_back(self, vectors: Array) -> Array:
        """Return vectors (N,) or (n, N) of the world's axes in the body's: Rᵀ v."""
        return np.asarray((vectors[..., np.newaxis, :] @ self.rotation)[..., 0, :])

    def velocity_in_world(self, before: Pose, point: Array, velocity: Array, dt: float | Array) -> Array:
        """Return the world's velocity, m/s, of a hand at `point` (N,), m, with the body's `velocity` (N,), m/s.

        All by differences backwards over `dt` (s), from the pose `before` on: of the hand's places in the body's frame
        it makes those of its places in the world, to the rounding.
        """
        # x' = R' x'_b + t':  x - x' = R' (x_b - x'_b) + (R x_b + t) - (R' x_b + t')
        carried = self.to_world(point) - before.to_world(point)
        return before.turned(velocity) + carried / dt

    def velocity_in_body(self, before: Pose, point: Array, velocity: Array, dt: float | Array) -> Array:
        """Return the velocity (N,), m/s, relative to the body: the inverse of `velocity_in_world`, `point` alike."""
        carried = self.to_world(point) - before.to_world(point)
        return before.turned_back(velocity - carried / dt)


def resting_pose(dimension: int) -> Pose:
    """Return the pose of a body whose frame is the world's."""
    return Pose(np.eye(dimension), np.zeros(dimension))


def turn_in_plane(angle: ArrayLike) -> Array:
    """Return the rotations (..., 2, 2) by angles (...,), rad, anticlockwise."""
    angle = np.asarray(angle, dtype=np.float64)
    rotation = np.empty((*angle.shape, 2, 2))
    rotation[..., 0, 0] = rotation[..., 1, 1] = np.cos(angle)
    rotation[..., 1, 0] = np.sin(angle)
    rotation[..., 0, 1] = -rotation[..., 1, 0]
    return rotation


def turn_about(axis: Array, angle: ArrayLike) -> Array:
    """Return the rotations (..., 3, 3) by angles (...,), rad, about a unit `axis` (3,), anticlockwise from its tip."""
    angle = np.asarray(angle, dtype=np.float64)[..., np.newaxis, np.newaxis]
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # Rodrigues: R = I + sin [a]x + (1 - cos) [a]x^2
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross))


def check_pose(rotation: ArrayLike, translation: ArrayLike, dimension: int) -> Pose:
    """Return the pose of a rotation (N, N) and a translation (N,), m, as arrays.

    Raises `InputError` for another dimension, numbers that are not finite, and a matrix that is not a rotation.
    """
    try:
        pose = Pose(np.array(rotation, dtype=np.float64), np.array(translation, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise InputError("a pose that is not a matrix and a vector of numbers", why=str(error)) from error
    if pose.rotation.shape != (dimension, dimension) or pose.translation.shape != (dimension,):
        raise InputError(
            f"a pose has a rotation of shape {pose.rotation.shape} and a translation of {pose.translation.shape}",
            why=f"the model is in {dimension}D",
            todo=f"give a matrix of {dimension} x {dimension} numbers and a vector of {dimension}",
        )
    if not (np.isfinite(pose.rotation).all() and np.isfinite(pose.translation).all()):
        raise InputError(
            f"a pose is not finite: rotation {pose.rotation.tolist()}, translation {pose.translation.tolist()} m",
            why="nothing can be touched at a place that is not known",
        )
    skew = float(np.abs(pose.rotation @ pose.rotation.T - np.eye(dimension)).max())
    determinant = float(np.linalg.det(pose.rotation))
    if skew > POSE_ROUNDING or abs(determinant - 1.0) > POSE_ROUNDING:
        raise InputError(
            f"a pose has the matrix {pose.rotation.tolist()}, which is not a rotation",
            why=f"R Rᵀ is {skew:.2g} off the identity, and the determinant is {determinant:.9g}",
            todo="a rotation's columns are unit vectors, square to each other, and its determinant is 1, not -1",
        )
    return pose
