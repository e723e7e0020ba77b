"""The minimum distance projection (4.2) on curves and polygons, and on surfaces in space: the hand goes to the
closest surface point.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import evaluate
from hapticeval.geometry.surface import Surface
from hapticeval.geometry.surface_kernels import Triple, bend, dot, place, times
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


class NearestOnSurface:
    """The globally nearest point of a surface, without memory; in contact while the hand is inside.

    With `bilateral` the hand is projected from outside too. Exact: `resolution` and `standoff` are zero.
    """

    resolution = 0.0
    standoff = 0.0

    def __init__(self, surface: Surface, *, bilateral: bool) -> None:
        self.surface = surface
        self._row = surface.row
        self.bilateral = bilateral

    def reset(self, hip: Array) -> None:
        """Nothing is remembered."""

    def project(self, hip: Array) -> Projected:
        """One tick."""
        ihips, normals, contact = self.trace(hip[np.newaxis])
        return Projected(tuple(ihips[0].tolist()), tuple(normals[0].tolist()), bool(contact[0]))

    def trace(self, hips: Array) -> tuple[Array, Array, BoolArray]:
        """A tick a row of `hips` (n, 3): IHIPs, normals and contact."""
        return _trace_in_space(self._row, self.bilateral, np.ascontiguousarray(hips, dtype=np.float64))

    def centripetal(self, hips: Array, velocities: Array) -> Array:
        """<W ẏ, ẏ> a row of `hips` (n, 3) and `velocities` (n, 3), at the nearest point: (n,), m/s^2."""
        return _centripetal_in_space(self._row, hips, velocities)


@compiled
def falling_in_space(surface: Array, foot: Triple, normal: Triple, velocity: Triple) -> float:
    """How fast a surface bends away from under a hand that passes its point `foot`: <W ẏ, ẏ>, m/s^2."""
    return dot(velocity, times(bend(surface, foot, normal), velocity))


@compiled
def _centripetal_in_space(surface: Array, hips: Array, velocities: Array) -> Array:
    out = np.empty(hips.shape[0])
    for i in range(hips.shape[0]):
        foot, normal, _ = place(surface, (hips[i, 0], hips[i, 1], hips[i, 2]))
        out[i] = falling_in_space(surface, foot, normal, (velocities[i, 0], velocities[i, 1], velocities[i, 2]))
    return out


@compiled
def _trace_in_space(surface: Array, bilateral: bool, hips: Array) -> tuple[Array, Array, BoolArray]:
    ihips, normals = hips.copy(), np.zeros_like(hips)
    contact = np.empty(hips.shape[0], np.bool_)
    for i in range(hips.shape[0]):
        foot, normal, distance = place(surface, (hips[i, 0], hips[i, 1], hips[i, 2]))
        contact[i] = bilateral or distance < 0.0
        if contact[i]:
            for k in range(3):
                ihips[i, k], normals[i, k] = foot[k], normal[k]
    return ihips, normals, contact
