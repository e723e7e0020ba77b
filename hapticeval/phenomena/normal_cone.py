"""The directions that a contact normal may have on a stretch of surface, corners and coarse renderers included."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from hapticeval.geometry.curve import Curve
from hapticeval.geometry.surface import Surface
from hapticeval.types import Array

SAMPLES = 16384
RING = 8
"""Directions in which the surroundings of a point in space are looked at."""


def off_normals(boundary: Curve | Surface, points: Array, reach: float) -> Callable[[Array], Array]:
    """How far (rad, 0 inside) directions (n, N) point outside the true normals around each of `points` (n, N).

    True normals are those of the boundary within `reach` metres along it: an interval of angles in the plane, a
    circular cone in space.
    """
    if isinstance(boundary, Curve):
        interval = NormalCone(boundary, reach).interval(points)
        return lambda directions: outside(interval, directions)
    frame = boundary.frame(points)
    half = reach * _most_bent(boundary, frame.foot, frame.normal, reach)

    def beyond(directions: Array) -> Array:
        across = np.linalg.norm(np.cross(frame.normal, directions), axis=1)
        angle = np.arctan2(across, np.sum(frame.normal * directions, axis=1))
        return np.asarray(np.maximum(0.0, angle - half))

    return beyond


def _most_bent(surface: Surface, feet: Array, normals: Array, reach: float) -> Array:
    """The largest principal curvature (n,), 1/m, at each of `feet` and `reach` around it.

    Along a path of length s the normal turns by at most the largest |W| on the way times s.
    """
    basis = np.linalg.svd(normals[:, np.newaxis, :])[2][:, 1:, :]
    curvature = np.zeros(feet.shape[0])
    for angle in [None, *np.linspace(0.0, 2.0 * np.pi, RING, endpoint=False)]:
        step = 0.0 if angle is None else reach * (np.cos(angle) * basis[:, 0] + np.sin(angle) * basis[:, 1])
        shape = surface.frame(feet + step).shape
        curvature = np.maximum(curvature, np.abs(np.linalg.eigvalsh(shape)).max(axis=1))
    return curvature


def wrapped(angle: Array) -> Array:
    """Angle brought into [-pi, pi), rad."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def angle_between(vectors: Array, direction: Array) -> Array:
    """Unsigned angle of each of `vectors` (n, 2) to `direction` (2,), rad; zero vectors give zero."""
    cross = vectors[:, 0] * direction[1] - vectors[:, 1] * direction[0]
    return np.asarray(np.abs(np.arctan2(cross, vectors @ direction)))


class NormalCone:
    """The true outward normals within `reach` metres of arc on either side of a surface point.

    On a smooth stretch that is a narrow interval around n_c (3.4); across a corner it holds every direction
    between the normals of the two faces, which are the equivalent normals n_e of section 3.2.1.
    """

    def __init__(self, curve: Curve, reach: float) -> None:
        self.curve = curve
        self._straight: Array | None = None
        if not curve.closed:
            self._straight = curve.normal(0.0)
            return
        self._u = _grid(curve)
        s = curve.arc_length(self._u)
        normals = curve.normal(self._u)
        raw = np.arctan2(normals[:, 1], normals[:, 0])
        angle = np.concatenate([[raw[0]], raw[0] + np.cumsum(wrapped(np.diff(raw)))])
        turn = 2.0 * np.pi
        s = np.concatenate([s - curve.length, s, s + curve.length])
        angle = np.concatenate([angle - turn, angle, angle + turn])
        # The filter works by count, so the window is as many samples as reach can hold where they are densest.
        even = np.arange(s[0], s[-1], min(curve.length / SAMPLES, max(reach / 2.0, 1e-7 * curve.length)))
        if even.size > 400_000:
            even = np.linspace(s[0], s[-1], 400_000)
        step = even[1] - even[0]
        size = 2 * int(np.ceil(reach / step) + 1) + 1
        at = np.interp(even, s, angle)
        self._s = even
        self._low = minimum_filter1d(at, size, mode="nearest")
        self._high = maximum_filter1d(at, size, mode="nearest")

    def interval(self, points: Array) -> tuple[Array, Array]:
        """The lowest and the highest angle (rad, unwrapped) of the cone at each of `points` (n, 2)."""
        if self._straight is not None:
            angle = np.full(points.shape[0], np.arctan2(self._straight[1], self._straight[0]))
            return angle, angle
        s = self.curve.arc_length(self.curve.nearest(points))
        index = np.clip(np.searchsorted(self._s, s), 0, self._s.size - 1)
        return self._low[index], self._high[index]

    def deviation(self, points: Array, directions: Array) -> Array:
        """How far each of `directions` (n, 2) points outside the cone at `points` (n, 2): rad, 0 inside."""
        return outside(self.interval(points), directions)


def outside(interval: tuple[Array, Array], directions: Array) -> Array:
    """How far each of `directions` (n, 2) points outside its angular interval: rad, 0 inside."""
    low, high = interval
    middle = 0.5 * (low + high)
    angle = middle + wrapped(np.arctan2(directions[:, 1], directions[:, 0]) - middle)
    return np.maximum(0.0, np.maximum(low - angle, angle - high))


def _grid(curve: Curve) -> Array:
    """Parameters dense along the curve, with every joint approached from both sides."""
    low, high = curve.u_range
    width = high - low
    joints = np.array([corner.u for corner in curve.corners])
    tiny = 1e-9 * width
    inner = np.concatenate([np.linspace(low, high, SAMPLES), joints, joints - tiny])
    return np.unique(np.clip(inner, low, high - tiny))
