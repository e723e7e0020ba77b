"""The transformation of a model to the disk by its flow (thesis 5.3): the checked grid, forward and inverse maps.

Levels and lines of the flow correspond to circles and radii of the disk. Forward, a point goes by barycentric
coordinates in its cell (5.18)-(5.20); backwards only the surface is needed, and goes by the parameter of the exact
curve, linear between the lines' starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.maps import flow_locator as locator
from hapticeval.geometry.maps.flow import Flow, FlowSettings, FoldedGridError, flow
from hapticeval.geometry.maps.flow_locator import Chart
from hapticeval.geometry.model import Model
from hapticeval.geometry.validate import checked_points
from hapticeval.types import Array, BoolArray, IntArray

KEPT = 16
"""Maps kept in a process: the most recently used ones."""


@dataclass(frozen=True, eq=False)
class FlowMap:
    """A one-to-one map of a model to the unit disk; its surface goes to the unit circle, its singular point to 0.

    `flow` is what it was built of. Every point inside the curve is mapped; one in the sliver between the curve and the
    chords of the grid's first level goes where its nearest surface point does.
    """

    curve: Curve
    flow: Flow
    chart: Chart

    @property
    def centre(self) -> Array:
        """The singular point (2,), m: where the front vanished."""
        return np.array(self.chart.centre)

    @cached_property
    def spacing(self) -> float:
        """The largest distance of two neighbouring lines on the surface (m): the map is linear over as much."""
        return float(np.max(np.diff(self.curve.arc_length(self.chart.us))))

    def to_disk(self, points: ArrayLike) -> Array:
        """Points (n, 2), m, to the disk (n, 2), by (5.20). Raises `InputError`, naming the row, for one off the map."""
        array = checked_points(points)
        levels, out = locator.to_disk_many(self.chart, array)
        off = np.flatnonzero(levels == locator.OFF)
        angles = self._beside(array[off], off)
        out[off] = np.column_stack([np.cos(angles), np.sin(angles)])
        return out

    def to_angle(self, points: Array) -> Array:
        """Angles (n,), rad, on the disk, of points (n, 2), m; raises as `to_disk` does."""
        array = checked_points(points)
        out = locator.angles_many(self.chart, array)
        off = np.flatnonzero(np.isnan(out))
        if off.size:
            out[off] = self._beside(array[off], off)
        return out

    def surface(self, angles: Array) -> Array:
        """The curve's parameters (n,) at angles (n,), rad, of any turn: the inverse on the surface."""
        return locator.surface_parameters(self.chart, np.ascontiguousarray(angles, dtype=np.float64))

    def parameter(self, x: float, y: float) -> float:
        """The parameter of the surface point that (x, y), m, is projected to (5.17)."""
        u = locator.projected(self.chart, x, y)
        return u if not math.isnan(u) else float(self.surface(self.to_angle(np.array([[x, y]])))[0])

    def _beside(self, points: Array, rows: IntArray) -> Array:
        """Angles of points between the curve and the chords of the grid: those of their nearest surface points."""
        u = self.curve.nearest(points)
        far = np.hypot(*(self.curve.position(u) - points).T) > 0.5 * self.spacing
        if far.any():
            x, y = points[np.argmax(far)]
            raise InputError(
                f"row {rows[np.argmax(far)]}: the point ({x:g}, {y:g}) m lies off the map",
                why="the flow covers the inside of the model",
            )
        us = self.chart.us
        return np.interp(np.where(u < us[0], u + us[-1] - us[0], u), us, self.chart.angles)


def flow_map(model: Model, settings: FlowSettings | None = None) -> FlowMap:
    """The map of a model, built once for each of its boundary and settings and then kept (the last 16).

    Raises the errors of `flow`, and `FoldedGridError` where cells are turned over.
    """
    return _built(_Key(model.curve.pieces.tobytes(), settings or FlowSettings(), model))


@dataclass(frozen=True)
class _Key:
    """What decides a map; the model rides along."""

    boundary: bytes
    settings: FlowSettings
    model: Model = field(compare=False)


@lru_cache(maxsize=KEPT)
def _built(key: _Key) -> FlowMap:
    made = flow(key.model, key.settings)
    return FlowMap(key.model.curve, made, chart_of(key.model, made))


def chart_of(model: Model, made: Flow) -> Chart:
    """The checked grid of a model's flow for the compiled lookup. Raises `FoldedGridError`."""
    curve = model.curve
    points, radii, times = np.ascontiguousarray(made.points), np.sqrt(made.areas / made.areas[0]), made.times
    start, end = curve.u_range
    us = np.append(made.u, made.u[0] + end - start)
    lengths = curve.arc_length(us)
    angles = 2.0 * math.pi * (lengths - lengths[0]) / curve.length
    disk = radii[:, np.newaxis, np.newaxis] * np.stack([np.cos(angles[:-1]), np.sin(angles[:-1])], axis=1)
    _check_cells(model, points, times)
    centre = points[-1].mean(axis=0)
    inner = _directions(model, points[-1], centre, times[-1])
    (x0, y0), (x1, y1) = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    side = made.cell
    across, up = math.floor((x1 - x0) / side) + 1, math.floor((y1 - y0) / side) + 1
    heads, cells = locator.fill_buckets(points, x0, y0, side, across, up)
    return Chart(
        points,
        disk,
        angles,
        us,
        heads,
        cells,
        float(x0),
        float(y0),
        side,
        across,
        up,
        (float(centre[0]), float(centre[1])),
        inner,
        start,
        end,
    )


def folded_cells(points: Array) -> BoolArray:
    """Which cells (m - 1, n) of a grid (m, n, 2) cannot be cut into triangles that all run anticlockwise."""
    a, d = points[:-1], points[1:]
    b, e = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
    over_ae = np.minimum(_area(a, b, e), _area(a, e, d))
    over_bd = np.minimum(_area(a, b, d), _area(b, e, d))
    return np.asarray(np.maximum(over_ae, over_bd) <= 0.0)


def _area(p: Array, q: Array, r: Array) -> Array:
    first, second = q - p, r - p
    return np.asarray(0.5 * (first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]))


def _check_cells(model: Model, points: Array, times: Array) -> None:
    folded = folded_cells(points)
    if folded.any():
        count = int(folded.sum())
        level, line = np.argwhere(folded)[0]
        x, y = points[level, line]
        raise FoldedGridError(
            f"{count} of {folded.size} cells of the flow grid of model '{model.name}' are folded, the first",
            position=(float(x), float(y)),
            time=float(times[level]),
            count=count,
            why="lines or levels cross there, and a point would have two surface points",
        )


def _directions(model: Model, ring: Array, centre: Array, time: float) -> Array:
    """Directions (rad) of a ring's points from the centre, checked to increase: the ring is star-shaped."""
    rays = ring - centre
    angles = np.unwrap(np.arctan2(rays[:, 1], rays[:, 0]))
    steps = np.diff(np.append(angles, angles[0] + 2.0 * math.pi))
    if np.any(steps <= 0.0):
        x, y = ring[np.argmin(steps)]
        raise FoldedGridError(
            f"a level of the flow of model '{model.name}' is not star-shaped, {int(np.sum(steps <= 0.0))} times, first",
            position=(float(x), float(y)),
            time=float(time),
            count=int(np.sum(steps <= 0.0)),
            why="directions from the centre do not tell its points apart",
        )
    return np.asarray(angles)
