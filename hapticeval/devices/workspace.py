"""Where a device can be: its functional configuration space (2.33), (2.39), and whether models lie in its image."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.devices.device import Device
from hapticeval.errors import DomainError, InputError, in_m

if TYPE_CHECKING:
    from hapticeval.geometry.model import Model

BOUNDARY_POINTS = 2000
"""Points of a model's boundary that are tried: 0.3 mm apart on an outline of 600 mm."""


class Fit(NamedTuple):
    """Whether points lie in the functional workspace.

    `margin` (rad) is the smallest of the configurations' margins where they all do, minus infinity where one does not;
    `row` and `point` (m) name the point with that margin, or else the first that does not, and `why` describes what
    keeps the device from it.
    """

    holds: bool
    margin: float
    row: int
    point: tuple[float, ...]
    why: str = ""


def fit_in_workspace(device: Device, model: Model | ArrayLike) -> Fit:
    """Return whether a model's boundary, or points (n, N), m, lie in the functional workspace (Assumption 7.1).

    A boundary is sampled at `BOUNDARY_POINTS` points. Of an unbounded line only one point must lie in it. Raises
    `InputError` for a model or points of another dimension than the device's.
    """
    from hapticeval.geometry.model import Model

    if not isinstance(model, Model):
        return _points_hold(device, model)
    if model.dimension != device.dimension:
        raise InputError(
            f"model '{model.name}' has {model.dimension} dimensions, and {device.name} {device.dimension}",
            why="a device feels models of its own space only",
        )
    points = model.boundary.points(BOUNDARY_POINTS)
    if model.boundary.closed:
        return _points_hold(device, points)
    # of an unbounded line: the point with the largest margin
    fits = [_points_hold(device, point[None]) for point in points]
    index = max(range(len(fits)), key=lambda i: fits[i].margin)
    return fits[index]._replace(row=index)


def require_in_workspace(device: Device, model: Model | ArrayLike) -> None:
    """Raise `DomainError`, naming model and point, where a model or points (n, N), m, do not lie in the workspace."""
    fit = fit_in_workspace(device, model)
    if not fit.holds:
        name = getattr(model, "name", "")
        what = f"model '{name}'" if name else "the set of points"
        raise DomainError(
            f"{what} does not lie in the functional workspace of {device.name} (Assumption 7.1)",
            why=f"point {fit.row}, {in_m(fit.point)}: {fit.why}",
            todo="make the model smaller, or choose another device",
        )


def _points_hold(device: Device, points: ArrayLike) -> Fit:
    array = np.array(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != device.dimension or not len(array):
        raise InputError(
            f"points of the shape {array.shape}", why=f"{device.name} moves in {device.dimension} dimensions"
        )
    smallest_margin, index = math.inf, 0
    for i, point in enumerate(array):
        try:  # out of reach, or within it but beyond a limit
            margin = device.margin(device.joints(point))
        except DomainError as error:
            return Fit(False, -math.inf, i, tuple(point.tolist()), error.why or error.what)
        if margin < smallest_margin:
            smallest_margin, index = margin, i
    return Fit(True, smallest_margin, index, tuple(array[index].tolist()))
