"""Where a rigid tool goes that follows the hand outside of the solid: the witness of whether a contact may end.

The tool flies straight to the hand. A surface that bars its way holds it: there it slides downhill in distance to the
hand, until it rests at a local minimum or its way is open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.geometry.curve import Curve
from hapticeval.geometry.surface import Surface
from hapticeval.types import Array

AHEAD = 32
"""Points of a way that are looked at together."""

MARCH = 1024
"""The same, of a slide that is longer than `AHEAD`: such slides go far."""

RING = 8
"""Directions in which the surroundings of a point in space are looked at."""

FLIGHTS = 16
"""Ways within one tick, each from where the slide before has ended; each brings the tool nearer to the hand."""

SLIDES = 100
"""Steps of one slide in space."""

BEND = 0.25
"""Share of the smallest radius of curvature by which a slide in space steps at the most, so as to stay on its sheet."""


@dataclass(frozen=True, eq=False)
class HeldTool:
    """A rigid tool beside `boundary`, placed to `grain` (m): neither a notch nor a plate thinner than that is seen."""

    boundary: Curve | Surface
    grain: float

    def follow(self, tool: Array, hand: Array) -> Array | None:
        """From `tool` (N,), outside or on the surface, to `hand` (N,): where it is held (N,), m, or None if nowhere."""
        rests = False
        for _ in range(FLIGHTS):
            barred = self.barred(tool, hand)
            if barred is None:
                return None
            if rests and _apart(barred, tool) <= self.grain:
                break
            tool, rests = self._downhill(barred, hand), True
        return tool

    def barred(self, start: Array, end: Array) -> Array | None:
        """The surface point (N,) at which the straight way from `start` (N,) to `end` (N,) first goes inside, or None.

        A start on the surface, or inside by its rounding, is left where the next point of the way is outside. Clear
        stretches are passed in steps as long as the distance from the surface.
        """
        length = _apart(start, end)
        if length == 0.0:
            return None
        at = 0.0
        while at < length:
            along = np.minimum(at + self.grain * np.arange(AHEAD + 1), length)
            points = start + along[:, np.newaxis] * ((end - start) / length)
            frame = self.boundary.frame(points)
            inside = np.flatnonzero(frame.distance[1:] < -1e-6 * self.grain)
            if inside.size:
                return np.asarray(frame.foot[inside[0]])
            at = float(along[-1]) + max(float(frame.distance[-1]), 0.0)
        return None

    def beside(self, point: Array, reach: float) -> Array:
        """Surface points (k, N) about `reach` metres along from `point` (N,): to either side, in space all round."""
        if isinstance(self.boundary, Curve):
            curve = self.boundary
            s = curve.arc_length(curve.nearest(point[np.newaxis]))
            return curve.position(curve.parameter(s + reach * np.array([-1.0, 1.0])))
        frame = self.boundary.frame(point[np.newaxis])
        across = np.linalg.svd(frame.normal)[2][1:]
        angle = np.linspace(0.0, 2.0 * np.pi, RING, endpoint=False)
        return self.boundary.frame(frame.foot + reach * np.column_stack([np.cos(angle), np.sin(angle)]) @ across).foot

    def _downhill(self, point: Array, hand: Array) -> Array:
        """The local minimum of the distance to `hand` (N,) that a slide along the surface from `point` (N,) ends at."""
        if isinstance(self.boundary, Curve):
            return self._downhill_on(self.boundary, point, hand)
        return self._downhill_over(self.boundary, point, hand)

    def _downhill_on(self, curve: Curve, point: Array, hand: Array) -> Array:
        """In steps of the grain, on in the direction in which the first of them leads downhill."""
        s = float(curve.arc_length(curve.nearest(point[np.newaxis]))[0])
        found = curve.position(curve.parameter(s + self.grain * np.array([-1.0, 0.0, 1.0])))
        back, here, on = np.linalg.norm(found - hand, axis=1)
        if here <= min(back, on):
            return np.asarray(found[1])
        step = self.grain if on <= back else -self.grain
        gone, count = 0, AHEAD
        while gone * self.grain < curve.length:
            found = curve.position(curve.parameter(s + step * np.arange(gone, gone + count + 1)))
            uphill = np.flatnonzero(np.diff(np.linalg.norm(found - hand, axis=1)) >= 0.0)
            if uphill.size:
                return np.asarray(found[uphill[0]])
            gone, count = gone + count, MARCH
        return np.asarray(found[-1])

    def _downhill_over(self, surface: Surface, point: Array, hand: Array) -> Array:
        """By the part of the error along the surface, halved where that leads uphill."""
        share = 1.0
        frame = surface.frame(point[np.newaxis])
        far = _apart(hand, frame.foot[0])
        for _ in range(SLIDES):
            foot, normal = frame.foot[0], frame.normal[0]
            error = hand - foot
            error = error - (error @ normal) * normal
            size = float(np.linalg.norm(error))
            longest = BEND / float(np.abs(np.linalg.eigvalsh(frame.shape[0])).max())
            step = share * min(size, longest)
            if step <= 1e-3 * self.grain:
                break
            following = surface.frame((foot + step / size * error)[np.newaxis])
            nearer = _apart(hand, following.foot[0])
            if nearer >= far:
                share *= 0.5
                continue
            frame, far = following, nearer
        return np.asarray(frame.foot[0])


def _apart(a: Array, b: Array) -> float:
    return float(np.linalg.norm(a - b))
