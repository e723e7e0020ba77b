"""The minimum distance projection (4.2) on a level set, the representation that the thesis runs it on (4.1.1)."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.model import Model
from hapticeval.renderers.bilinear import Contour, contour_of, nearest_on_contour, value_at
from hapticeval.renderers.projection import Projected
from hapticeval.types import Array, BoolArray

LOST = 3.0
"""Cells by which the contour may be off the surface.

Of a wedge with the angle a the part that is narrower than a cell's diagonal may lie between the nodes: sqrt(2) / (2
tan(a / 2)) cells, which is 1.2 at 60 degrees and 2.6 at 30. What is missing beyond that is a part of the model.
"""

REFINE = "refine the grid, or use minimum-distance on the curve or the polygon"


class LevelSetProjection:
    """The nearest point of the zero contour of the bilinear interpolant; in contact while that is negative.

    Islands of the contour, which tips and slits narrower than a cell may leave, are not part of it: how far its surface
    is off the model decides whether that is refused. `surface` is the contour cut into straight edges, eight per cell.
    With `bilateral` the hand is projected from outside too.
    """

    def __init__(self, model: Model, shape: tuple[int, int], *, bilateral: bool) -> None:
        self._bilateral = bilateral
        self._contour, self.surface, self.standoff = _contour_of(model, shape)
        self.resolution = model.level_set(shape).cell

    def reset(self, hip: Array) -> None:
        """Nothing is remembered."""

    def project(self, hip: Array) -> Projected:
        """One tick."""
        x, y = hip.tolist()
        return Projected(*_project(self._contour, self._bilateral, x, y))

    def trace(self, hips: Array) -> tuple[Array, Array, BoolArray]:
        """A tick a row of `hips` (n, 2): IHIPs, normals and contact."""
        return _trace(self._contour, self._bilateral, hips)


def _contour_of(model: Model, shape: tuple[int, int]) -> tuple[Contour, Curve, float]:
    """The contour of a model's level set, its outline as a curve, and that outline's distance from the model."""
    kept = _KEPT.setdefault(model, {})
    if shape not in kept:
        level_set = model.level_set(shape)
        try:
            contour, outline = contour_of(level_set)
        except InputError as error:
            raise RefusalError(
                f"model '{model.name}' cannot be held as a level set of {shape[0]} by {shape[1]} nodes",
                why=f"of its zero contour: {error.what}; {error.why}",
                todo=REFINE,
            ) from error
        curve, standoff = outline.as_curve(), outline.standoff_from(model.curve)
        if standoff > LOST * level_set.cell:
            raise RefusalError(
                f"model '{model.name}' loses a part on a level set of {shape[0]} by {shape[1]} nodes: the contour is "
                f"up to {standoff * 1e3:.3g} mm off the surface, with cells of {level_set.cell * 1e3:.3g} mm",
                why="a tip, slit or neck that is narrower than a cell has no node inside, or none that is joined to "
                "the rest",
                todo=REFINE,
            )
        kept[shape] = contour, curve, standoff
    return kept[shape]


_KEPT: WeakKeyDictionary[Model, dict[tuple[int, int], tuple[Contour, Curve, float]]] = WeakKeyDictionary()


@compiled
def _project(c: Contour, bilateral: bool, x: float, y: float) -> tuple[tuple[float, float], tuple[float, float], bool]:
    if not (bilateral or value_at(c, x, y) < 0.0):
        return (x, y), (0.0, 0.0), False
    px, py, nx, ny = nearest_on_contour(c, x, y)
    return (px, py), (nx, ny), True


@compiled
def _trace(c: Contour, bilateral: bool, hips: Array) -> tuple[Array, Array, BoolArray]:
    ihips, normals = np.empty_like(hips), np.empty_like(hips)
    contact = np.empty(hips.shape[0], np.bool_)
    for i in range(hips.shape[0]):
        ihip, normal, contact[i] = _project(c, bilateral, hips[i, 0], hips[i, 1])
        ihips[i, 0], ihips[i, 1] = ihip
        normals[i, 0], normals[i, 1] = normal
    return ihips, normals, contact
