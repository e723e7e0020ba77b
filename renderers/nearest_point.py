"""The minimum distance projection (4.2) on curves and polygons: the hand goes to the closest surface point."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import evaluate
from hapticeval.renderers.outline import Boundary, Outline, clear_of, frame, nearest_on
from hapticeval.renderers.projection import Projected
from hapticeval.types import Array, BoolArray


class MinimumDistanceProjection:
    """The globally nearest surface point, without memory; in contact while the hand is inside.

    With `bilateral` the hand is projected from outside too.
    """

    def __init__(self, outline: Outline, *, bilateral: bool) -> None:
        self.surface = outline.surface
        self.resolution = outline.resolution
        self.standoff = outline.standoff
        self.boundary = outline.boundary
        self.bilateral = bilateral

    def reset(self, hip: Array) -> None:
        """Nothing is remembered."""

    def project(self, hip: Array) -> Projected:
        """One tick."""
        x, y = hip.tolist()
        return Projected(*_project(self.boundary, self.bilateral, x, y))

    def trace(self, hips: Array) -> tuple[Array, Array, BoolArray]:
        """A tick a row of `hips` (n, 2): IHIPs, normals and contact."""
        return _trace(self.boundary, self.bilateral, hips)

    def centripetal(self, hips: Array, velocities: Array) -> Array:
        """κ (t·ẏ)^2 a row of `hips` (n, 2) and `velocities` (n, 2), at the nearest point: (n,), m/s^2."""
        return _centripetal(self.boundary, hips, velocities)


@compiled
def falling(pieces: Array, piece: int, u: float, vx: float, vy: float) -> float:
    """How fast a curve bends away from under a hand that passes its point at (piece, u): κ (t·ẏ)^2, m/s^2."""
    _, _, dx, dy, ddx, ddy = evaluate(pieces[piece], u)
    speed = math.hypot(dx, dy)
    along = (dx * vx + dy * vy) / speed
    return (dx * ddy - dy * ddx) / (speed * speed * speed) * (along * along)


@compiled
def _centripetal(b: Boundary, hips: Array, velocities: Array) -> Array:
    out = np.empty(hips.shape[0])
    for i in range(hips.shape[0]):
        piece, u, _, _ = nearest_on(b, hips[i, 0], hips[i, 1])
        out[i] = falling(b.pieces, piece, u, velocities[i, 0], velocities[i, 1])
    return out


@compiled
def _project(b: Boundary, bilateral: bool, x: float, y: float) -> tuple[tuple[float, float], tuple[float, float], bool]:
    if not bilateral and b.stray > 0.0 and clear_of(b, x, y):
        return (x, y), (0.0, 0.0), False
    piece, u, _, side = nearest_on(b, x, y)
    if not (bilateral or side < 0.0):
        return (x, y), (0.0, 0.0), False
    px, py, nx, ny = frame(b.pieces, b.joints, b.closed, piece, u, x, y)
    return (px, py), (nx, ny), True


@compiled
def _trace(b: Boundary, bilateral: bool, hips: Array) -> tuple[Array, Array, BoolArray]:
    ihips, normals = np.empty_like(hips), np.empty_like(hips)
    contact = np.empty(hips.shape[0], np.bool_)
    for i in range(hips.shape[0]):
        ihip, normal, contact[i] = _project(b, bilateral, hips[i, 0], hips[i, 1])
        ihips[i, 0], ihips[i, 1] = ihip
        normals[i, 0], normals[i, 1] = normal
    return ihips, normals, contact
