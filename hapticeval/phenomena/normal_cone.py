"""The directions that a contact normal may have on a stretch of surface, corners and coarse renderers included."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from hapticeval.geometry.curve import Curve
from hapticeval.types import Array

SAMPLES = 16384


def wrapped(angle: Array) -> Array:
    """Angle brought into [-pi, pi), rad."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def angle_between(vectors: Array, direction: Array) -> Array:
    """Unsigned angle of each of `vectors` (n, 2) to `direction` (2,), rad; zero vectors give zero."""
    cross = vectors[:, 0] * direction[1] - vectors[:, 1] * direction[0]
    return np.abs(np.arctan2(cross, vectors @ direction))


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

    def deviation(self, points: Array, directions: Array) -> Array:
        """How far each of `directions` (n, 2) points outside the cone at `points` (n, 2): rad, 0 inside."""
        if self._straight is not None:
            return angle_between(directions, self._straight)
        s = self.curve.arc_length(self.curve.nearest(points))
        index = np.clip(np.searchsorted(self._s, s), 0, self._s.size - 1)
        low, high = self._low[index], self._high[index]
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
