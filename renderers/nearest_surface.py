"""The minimum distance projection (4.2) on surfaces in space: the hand goes to the closest surface point."""

from __future__ import annotations

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.surface import Surface
from hapticeval.geometry.surface_kernels import Triple, bend, dot, place, times
from hapticeval.renderers.projection import Projected
from hapticeval.types import Array, BoolArray


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
        return _trace(self._row, self.bilateral, np.ascontiguousarray(hips, dtype=np.float64))

    def centripetal(self, hips: Array, velocities: Array) -> Array:
        """<W ẏ, ẏ> a row of `hips` (n, 3) and `velocities` (n, 3), at the nearest point: (n,), m/s^2."""
        return _centripetal(self._row, hips, velocities)


@compiled
def falling(surface: Array, foot: Triple, normal: Triple, velocity: Triple) -> float:
    """How fast a surface bends away from under a hand that passes its point `foot`: <W ẏ, ẏ>, m/s^2."""
    return dot(velocity, times(bend(surface, foot, normal), velocity))


@compiled
def _centripetal(surface: Array, hips: Array, velocities: Array) -> Array:
    out = np.empty(hips.shape[0])
    for i in range(hips.shape[0]):
        foot, normal, _ = place(surface, (hips[i, 0], hips[i, 1], hips[i, 2]))
        out[i] = falling(surface, foot, normal, (velocities[i, 0], velocities[i, 1], velocities[i, 2]))
    return out


@compiled
def _trace(surface: Array, bilateral: bool, hips: Array) -> tuple[Array, Array, BoolArray]:
    ihips, normals = hips.copy(), np.zeros_like(hips)
    contact = np.empty(hips.shape[0], np.bool_)
    for i in range(hips.shape[0]):
        foot, normal, distance = place(surface, (hips[i, 0], hips[i, 1], hips[i, 2]))
        contact[i] = bilateral or distance < 0.0
        if contact[i]:
            for k in range(3):
                ihips[i, k], normals[i, k] = foot[k], normal[k]
    return ihips, normals, contact
