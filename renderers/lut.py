"""Any projection without memory as a look-up table (thesis 6.2): the representation `@lut`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace as with_
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from hapticeval.geometry.curve import Curve
from hapticeval.geometry.model import Model
from hapticeval.renderers.lut_build import curve_of, tabulate
from hapticeval.renderers.projection import Projected, Projection
from hapticeval.renderers.table import ASK, CELL, TOUCHES, Table
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray


class LutProjection:
    """Interpolates in a table; where the table does not interpolate, the `exact` projection answers.

    `surface` is the curve that was tabulated, `resolution` (m) what is blurred: the side of a cell. `standoff` (m) is
    the table's, or the exact projection's where that is larger. Without memory.

    An IHIP that is off by e turns the position error (4.5) by e / d at depth d, so that a spring along it, `pp`, is off
    the normal when shallow. The `transversal` scheme (5.21) pushes along the interpolated normal, which is not.
    """

    def __init__(self, table: Table, surface: Curve, *, resolution: float, exact: Projection) -> None:
        self.table = table
        self.surface = surface
        self.resolution = resolution
        self.standoff = max(table.standoff, exact.standoff)
        self._exact = exact

    def reset(self, hip: Array) -> None:
        """Nothing is remembered."""

    def project(self, hip: Array) -> Projected:
        """One tick."""
        x, y = hip.tolist()
        status, px, py, nx, ny = self.table.look(x, y, ask=True)
        if status == ASK:
            return self._exact.project(hip)
        return Projected((px, py), (nx, ny), status == TOUCHES)

    def trace(self, hips: Array) -> tuple[Array, Array, BoolArray]:
        """A tick a row of `hips` (n, 2): IHIPs, normals and contact."""
        ihips, normals, status = self.table.look_many(hips, ask=True)
        contact = status == TOUCHES
        asked = np.flatnonzero(status == ASK)
        if asked.size:
            ihips[asked], normals[asked], contact[asked] = self._exact.trace(np.ascontiguousarray(hips[asked]))
        return ihips, normals, contact


def tabulated(
    project: Callable[..., Projection], scene: Scene, representation: str, *, cell: float = CELL, **settings: Any
) -> Projection:
    """The projection `project(scene, representation, **settings)` through a table with cells of side `cell` (m).

    The table is made once for a model, and shared. The unbounded line has no finite table, and is answered exactly.
    Raises `InputError` for a cell that is not positive, or so small that the table would not fit in memory.
    """
    if not scene.model.curve.closed:
        return project(scene, representation, **settings)
    exact = project(scene, representation, **settings)
    kept = _KEPT.setdefault(scene.model, {})
    key = (project, representation, cell, scene.bilateral, *sorted(settings.items()))
    if key not in kept:
        both_sides = project(with_(scene, bilateral=True), representation, **settings)
        kept[key] = tabulate(both_sides, cell=cell, everywhere=scene.bilateral)
    return LutProjection(kept[key], curve_of(exact), resolution=max(cell, exact.resolution), exact=exact)


_KEPT: WeakKeyDictionary[Model, dict[object, Table]] = WeakKeyDictionary()
