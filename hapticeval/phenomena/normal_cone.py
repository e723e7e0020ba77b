"""The directions that a contact normal may have on a stretch of surface, corners and coarse renderers included."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import U0
from hapticeval.geometry.surface import Surface
from hapticeval.types import Array

SAMPLES = 16384
RING = 8
"""Directions in which the surroundings of a point in space are looked at."""


def off_normals(boundary: Curve | Surface, points: Array, reach: Array) -> Callable[[Array], Array]:
    """How far (rad, 0 inside) directions (n, N) point outside the true normals around each of `points` (n, N).

    True normals are those of the boundary within `reach` (n,), m, along it: an interval of angles in the plane, a
    circular cone in space.
    """
    if isinstance(boundary, Curve):
        interval = NormalCone(boundary).interval(points, reach)
        return lambda directions: outside(interval, directions)
    frame = boundary.frame(points)
    half = reach * _most_bent(boundary, frame.foot, frame.normal, reach)

    def beyond(directions: Array) -> Array:
        across = np.linalg.norm(np.cross(frame.normal, directions), axis=1)
        angle = np.arctan2(across, np.sum(frame.normal * directions, axis=1))
        return np.asarray(np.maximum(0.0, angle - half))

    return beyond


def _most_bent(surface: Surface, feet: Array, normals: Array, reach: Array) -> Array:
    """The largest principal curvature (n,), 1/m, at each of `feet` and `reach` (n,), m, around it.

    Along a path of length s the normal turns by at most the largest |W| on the way times s.
    """
    basis = np.linalg.svd(normals[:, np.newaxis, :])[2][:, 1:, :]
    curvature = np.zeros(feet.shape[0])
    for angle in [None, *np.linspace(0.0, 2.0 * np.pi, RING, endpoint=False)]:
        step = (
            0.0 if angle is None else reach[:, np.newaxis] * (np.cos(angle) * basis[:, 0] + np.sin(angle) * basis[:, 1])
        )
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
    """The true outward normals within a reach, in metres of arc, on either side of a surface point.

    On a smooth stretch that is a narrow interval around n_c (3.4); across a corner it holds every direction between
    the normals of the two faces, which are the equivalent normals n_e of section 3.2.1. The normals at the point and at
    both ends of the stretch are exact, and so are those of every joint of the curve on it, where the turning may change
    its sense at once; in between the curve is sampled, and the highest normal at an inflection is found to
    kappa' h^2 / 8, h = length / `SAMPLES`: 2e-6 rad where the curvature changes by 10,000 /m^2.
    """

    def __init__(self, curve: Curve) -> None:
        self.curve = curve
        if not curve.closed:
            return
        u = _grid(curve)
        s = curve.arc_length(u)
        raw = _angle(curve.normal(u))
        angle = np.concatenate([[raw[0]], raw[0] + np.cumsum(wrapped(np.diff(raw)))])
        turn = 2.0 * np.pi
        self._s = np.concatenate([s - curve.length, s, s + curve.length])
        angle = np.concatenate([angle - turn, angle, angle + turn])
        # Row k holds the extremes over 2^k samples from each on: two of them cover any window.
        self._low, self._high = [angle], [angle]
        while 2 ** len(self._low) <= angle.size:
            half = 2 ** (len(self._low) - 1)
            self._low.append(np.minimum(self._low[-1][:-half], self._low[-1][half:]))
            self._high.append(np.maximum(self._high[-1][:-half], self._high[-1][half:]))

    def interval(self, points: Array, reach: Array) -> tuple[Array, Array]:
        """The lowest and highest angle (rad, unwrapped) of the cone within `reach` (n,) of each of `points` (n, 2)."""
        if not self.curve.closed:
            angle = np.full(points.shape[0], _angle(self.curve.normal(0.0)[np.newaxis])[0])
            return angle, angle
        reach = np.minimum(reach, 0.5 * self.curve.length)
        u = self.curve.nearest(points)
        s = self.curve.arc_length(u)
        ends = [s, s - reach, s + reach]
        angles = []
        for at, parameter in zip(ends, [u, *map(self.curve.parameter, ends[1:])], strict=True):
            near = np.interp(at, self._s, self._low[0])
            angles.append(near + wrapped(_angle(self.curve.normal(parameter)) - near))
        low, high = np.min(angles, axis=0), np.max(angles, axis=0)
        first = np.searchsorted(self._s, ends[1], side="left")
        count = np.searchsorted(self._s, ends[2], side="right") - first
        power = np.log2(np.maximum(count, 1)).astype(int)
        for k in np.unique(power[count > 0]):
            rows = np.flatnonzero((power == k) & (count > 0))
            one, other = first[rows], first[rows] + count[rows] - 2**k
            low[rows] = np.minimum(low[rows], np.minimum(self._low[k][one], self._low[k][other]))
            high[rows] = np.maximum(high[rows], np.maximum(self._high[k][one], self._high[k][other]))
        return low, high

    def deviation(self, points: Array, directions: Array, reach: Array) -> Array:
        """How far each of `directions` (n, 2) points outside the cone at `points` (n, 2): rad, 0 inside."""
        return outside(self.interval(points, reach), directions)


def _angle(normals: Array) -> Array:
    """The angle (n,) of each of `normals` (n, 2), rad."""
    return np.asarray(np.arctan2(normals[:, 1], normals[:, 0]))


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
    joints = curve.pieces[:, U0]
    tiny = 1e-9 * width
    inner = np.concatenate([np.linspace(low, high, SAMPLES), joints, joints - tiny])
    return np.unique(np.clip(inner, low, high - tiny))
