"""The directions that a contact normal may have on a stretch of a plane curve, corners included."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.geometry.kernels import U0
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.geometry.curve import Curve

NORMAL_SAMPLES = 16384
JOINT_OFFSET = 1e-9
"""Before each joint, in parts of the curve, where the normal of the face that ends there is sampled."""

SPLINE_TOLERANCE = 1e-10
"""How closely (rad) a spline of the normals has to keep to them half way between its knots, to be used for them."""


class NormalCone:
    """The true outward normals within a reach, in metres of arc, on either side of a surface point.

    On a smooth stretch that is a narrow interval around n_c (3.4); across a corner it holds every direction between the
    normals of the two faces, which are the equivalent normals n_e of section 3.2.1.

    The normals at the point and at both ends of the stretch are exact, on a curve of one piece to `SPLINE_TOLERANCE` at
    the ends.

    So are those where the turning changes its sense: at joints of the curve and at inflections. Two inflections between
    the same two of `NORMAL_SAMPLES` points are missed.
    """

    def __init__(self, curve: Curve) -> None:
        self.curve = curve
        # an unbounded line has one normal
        if not curve.closed:
            return
        low, high = curve.u_range
        tiny, joints = JOINT_OFFSET * (high - low), curve.pieces[:, U0]
        # samples just before and at each joint: both normals of a corner
        inner = np.concatenate([np.linspace(low, high, NORMAL_SAMPLES), joints, joints - tiny])
        u = np.unique(np.clip(inner, low, high - tiny))
        u = np.union1d(u, _inflections(curve, u, tiny))
        s = curve.arc_length(u)
        wrapped = _angles_of(curve.normal(u))
        # unwrapped: each angle continues the one before
        angle = np.concatenate([[wrapped[0]], wrapped[0] + np.cumsum(wrap_angle(np.diff(wrapped)))])
        turn = 2.0 * np.pi
        # three turns in a row: no stretch of half a turn to either side meets a seam
        self._s = np.concatenate([s - curve.length, s, s + curve.length])
        self._angle = np.concatenate([angle - turn, angle, angle + turn])
        self._spline = None
        if len(curve.pieces) == 1:
            from scipy.interpolate import CubicHermiteSpline

            spline = CubicHermiteSpline(self._s, self._angle, np.tile(curve.curvature(u), 3))
            middle = 0.5 * (u[:-1] + u[1:])
            # the spline is used if it keeps to the exact normals half way between its knots
            spline_error = wrap_angle(_angles_of(curve.normal(middle)) - spline(curve.arc_length(middle)))
            self._spline = spline if float(np.abs(spline_error).max()) <= SPLINE_TOLERANCE else None

    def interval(self, points: Array, reach: Array) -> tuple[Array, Array]:
        """Return the lowest and highest angle (n,), rad, unwrapped, of the normals near points (n, 2), m.

        Near is within `reach` (n,), m, along the curve. At a corner these are the angles of both faces' normals,
        however small the reach.
        """
        if not self.curve.closed:
            angle = np.full(points.shape[0], _angles_of(self.curve.normal(0.0)[np.newaxis])[0])
            return angle, angle
        # half a turn to either side is all of the curve
        reach = np.minimum(reach, 0.5 * self.curve.length)
        u = self.curve.nearest(points)
        s = self.curve.arc_length(u)
        ends = [s, s - reach, s + reach]
        # at the point and at both ends of the stretch, exactly
        angles = [self._angle_at(s, u), *(self._angle_at(end) for end in ends[1:])]
        low, high = np.min(angles, axis=0), np.max(angles, axis=0)
        # rounding may put a foot beside its corner: look across it
        seam = 2.0 * JOINT_OFFSET * self.curve.length if self.curve.corners else 0.0
        first = np.searchsorted(self._s, np.minimum(ends[1], s - seam), side="left")
        last = np.searchsorted(self._s, np.maximum(ends[2], s + seam), side="right")
        has_samples = last > first
        # reduceat: the extreme of the samples of each stretch that has any
        windows = np.column_stack([first, last])[has_samples].ravel()
        if windows.size:
            low[has_samples] = np.minimum(low[has_samples], np.minimum.reduceat(self._angle, windows)[::2])
            high[has_samples] = np.maximum(high[has_samples], np.maximum.reduceat(self._angle, windows)[::2])
        return low, high

    def _angle_at(self, s: Array, u: Array | None = None) -> Array:
        """Return the normals' angle (n,), rad, unwrapped, at arc lengths (n,) and the parameters u there, if known."""
        if u is None and self._spline is not None:
            return np.asarray(self._spline(s))
        # the exact angle, brought to the turn that the samples tell
        near = np.interp(s, self._s, self._angle)
        normals = self.curve.normal(self.curve.parameter(s) if u is None else u)
        return np.asarray(near + wrap_angle(_angles_of(normals) - near))

    def angle_outside(self, points: Array, reach: Array) -> Callable[[Array], Array]:
        """Answer `Boundary.normal_cone` for points (n, 2), m, and `reach` (n,), m: the function gives angles in rad."""
        low, high = self.interval(points, reach)
        middle = 0.5 * (low + high)

        def angle_outside_of(directions: Array) -> Array:
            # the turn of each angle that is closest to the interval
            """Return the angles (n,), rad, by which directions (n, 2) leave the intervals."""
            angle = middle + wrap_angle(_angles_of(directions) - middle)
            return np.maximum(0.0, np.maximum(low - angle, angle - high))

        return angle_outside_of


def _inflections(curve: Curve, u: Array, tiny: float) -> list[float]:
    """Return the parameters at which the curvature changes its sign between neighbours of u (n,).

    Each lies at least `tiny` from both.
    """
    from scipy.optimize import brentq

    sign = np.sign(curve.curvature(u))
    # the angle's extremes lie where the curvature changes its sign
    changes = np.flatnonzero(sign[:-1] * sign[1:] < 0.0)
    roots = [(brentq(lambda at: float(curve.curvature(at)), u[k], u[k + 1], xtol=tiny), k) for k in changes]
    return [root for root, k in roots if u[k] + tiny < root < u[k + 1] - tiny]


def wrap_angle(angle: Array) -> Array:
    """Return each angle (n,) brought into [-pi, pi), rad."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def _angles_of(vectors: Array) -> Array:
    """Return the angle (n,), rad, of each of vectors (n, 2)."""
    return np.asarray(np.arctan2(vectors[:, 1], vectors[:, 0]))
