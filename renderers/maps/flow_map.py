"""The transformation of a model to the disk by its flow (thesis 5.3): the checked grid, forward and inverse maps.

Levels and lines of the flow correspond to circles and radii of the disk.

- Forward, a point goes by barycentric coordinates in its cell (5.18)-(5.20).
- Backwards only the surface is needed, and goes by the parameter of the exact curve, linear between the lines' starts.

A cell has the corners a, b on a level and d, e on the next, a and d on one line and b and e on the following one, so
that a, b, e, d run anticlockwise.

Where its diagonals cross it is cut into four triangles at the crossing (Figure 5.13). A cell that is not convex has no
crossing and is cut into two along the diagonal inside it.

Buckets of equal squares list the cells that touch them: a lookup costs the same wherever the point is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.model import Model
from hapticeval.geometry.validate import checked_points
from hapticeval.kernel_cache import digest_of, shared_arrays
from hapticeval.renderers.maps.flow import Flow, FlowSettings, FoldedGridError, run_flow
from hapticeval.types import Array, BoolArray, IntArray

Pair: TypeAlias = tuple[float, float]

MAPS_IN_CACHE = 16
"""Maps kept in a process: the most recently used ones."""

OUTSIDE_CELLS = -1
"""The level of a point that lies in no cell."""

CELL_SLACK = 1e-9
"""Share of its size by which a cell is widened, so that rounding leaves no gaps between cells."""


class Chart(NamedTuple):
    """The checked grid of a flow, laid out for the compiled lookup.

    - `points` and `disk` (m, n, 2): where level and line cross in the model (m) and on the disk, from the outermost
      level inwards; the first is the model's own, and has radius 1.
    - `angles` (n + 1,), rad, of the lines, from 0, and `us` (n + 1,), the curve's parameters there: both one turn
      longer at the end. The curve's own range is from `start` to `end`.
    - `heads` (buckets + 1,) and `cells`: the cells of each bucket, numbered k * n + i. Buckets are `across` by `up`
      squares of side `side` (m) from (`x0`, `y0`).
    - `inner` (n,): the directions (rad, increasing) of the last level's points from the `centre`.
    """

    points: Array
    disk: Array
    angles: Array
    us: Array
    heads: IntArray
    cells: IntArray
    x0: float
    y0: float
    side: float
    across: int
    up: int
    centre: tuple[float, float]
    inner: Array
    start: float
    end: float


@dataclass(frozen=True, eq=False)
class FlowMap:
    """A one-to-one map of a model to the unit disk; its surface goes to the unit circle, its singular point to 0.

    Every point inside the curve is mapped; one in the sliver between the curve and the chords of the grid's first level
    goes where its nearest surface point does.
    """

    curve: Curve
    tables: Chart

    @cached_property
    def spacing(self) -> float:
        """The largest distance of two neighbouring lines on the surface (m): the map is linear over as much."""
        return float(np.max(np.diff(self.curve.arc_length(self.tables.us))))

    def to_angle(self, points: Array) -> Array:
        """Return the angles (n,), rad, on the disk, of points (n, 2), m.

        Raises `InputError`, naming the row, for a point that is not finite or lies off the map.
        """
        array = checked_points(points)
        out = map_to_angles(self.tables, array)
        # in no cell: in the sliver between the curve and the chords of the first level, or off the map
        unmapped = np.flatnonzero(np.isnan(out))
        if unmapped.size:
            u = self.curve.nearest(array[unmapped])
            too_far = np.hypot(*(self.curve.position(u) - array[unmapped]).T) > 0.5 * self.spacing
            if too_far.any():
                row = unmapped[np.argmax(too_far)]
                raise InputError(
                    f"row {row}: the point ({array[row, 0]:g}, {array[row, 1]:g}) m lies off the map",
                    why="the flow covers the inside of the model",
                )
            out[unmapped] = [angle_of(self.tables, parameter) for parameter in u.tolist()]
        return out

    def surface(self, angles: Array) -> Array:
        """Return the curve's parameters (n,) at angles (n,), rad, of any turn: the inverse on the surface."""
        return surface_parameters(self.tables, np.ascontiguousarray(angles, dtype=np.float64))


def flow_map(model: Model, settings: FlowSettings | None = None) -> FlowMap:
    """Return the map of a model, built once for each of its boundary and settings and then kept (the last 16).

    The flow itself, which takes seconds, is kept on disk beside the kernels, for all processes.

    Raises the errors of `run_flow`, and `FoldedGridError` where cells are turned over.
    """
    return _build_map(_MapKey(model.curve.pieces.tobytes(), settings or FlowSettings(), model))


@dataclass(frozen=True)
class _MapKey:
    """What decides a map; the model rides along."""

    boundary: bytes
    settings: FlowSettings
    model: Model = field(compare=False)


@lru_cache(maxsize=MAPS_IN_CACHE)
def _build_map(key: _MapKey) -> FlowMap:
    """Take the flow from where it is kept, or run it, and lay out its grid."""

    def run() -> dict[str, Array]:
        return {name: np.asarray(value) for name, value in vars(run_flow(key.model, key.settings)).items()}

    # The front begins with distances that the curve computes: its code is part of the name.
    code = digest_of(type(key.model.curve).__module__)
    arrays = shared_arrays(run_flow.__module__, key.boundary + f"{key.settings!r} {code}".encode(), run)
    points, us, times, lengths, areas = (arrays[name] for name in ("points", "u", "times", "lengths", "areas"))
    flow = Flow(points, us, times, lengths, areas, float(arrays["cell"]))
    return FlowMap(key.model.curve, build_chart(key.model, flow))


def build_chart(model: Model, recorded: Flow) -> Chart:
    """Return the checked grid of a model's flow for the compiled lookup. Raises `FoldedGridError`."""
    curve = model.curve
    points, times = np.ascontiguousarray(recorded.points), recorded.times
    # a level's circle has its share of the area
    radii = np.sqrt(recorded.areas / recorded.areas[0])
    start, end = curve.u_range
    us = np.append(recorded.u, recorded.u[0] + end - start)
    lengths = curve.arc_length(us)
    # a line's angle goes with the arc length of its start
    angles = 2.0 * math.pi * (lengths - lengths[0]) / curve.length
    disk = radii[:, np.newaxis, np.newaxis] * np.stack([np.cos(angles[:-1]), np.sin(angles[:-1])], axis=1)
    _check_cells(model, points, times)
    centre = points[-1].mean(axis=0)
    inner = _ring_directions(model, points[-1], centre, times[-1])
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    x0, y0 = low.tolist()
    across, up = (math.floor(extent / recorded.cell) + 1 for extent in high - low)
    heads, cells = fill_buckets(points, x0, y0, recorded.cell, across, up)
    middle = (float(centre[0]), float(centre[1]))
    return Chart(points, disk, angles, us, heads, cells, x0, y0, recorded.cell, across, up, middle, inner, start, end)


def folded_cells(points: Array) -> BoolArray:
    """Return which cells (m - 1, n) of a grid (m, n, 2), m, cannot be cut into triangles that all run anticlockwise."""
    a, d = points[:-1], points[1:]
    b, e = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
    # cut along either diagonal: both triangles must have a positive area
    over_ae = np.minimum(_triangle_areas(a, b, e), _triangle_areas(a, e, d))
    over_bd = np.minimum(_triangle_areas(a, b, d), _triangle_areas(b, e, d))
    return np.asarray(np.maximum(over_ae, over_bd) <= 0.0)


def _triangle_areas(p: Array, q: Array, r: Array) -> Array:
    """Return the signed areas (...,), m^2, of triangles with corners (..., 2), m: positive if anticlockwise."""
    first, second = q - p, r - p
    return np.asarray(0.5 * (first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]))


def _check_cells(model: Model, points: Array, times: Array) -> None:
    """Raise `FoldedGridError`, with the first of them, where cells are folded."""
    folded = folded_cells(points)
    if folded.any():
        count = int(folded.sum())
        level, line = np.argwhere(folded)[0]
        x, y = points[level, line]
        raise FoldedGridError(
            f"{count} of {folded.size} cells of the flow grid of model '{model.name}' are folded, the first",
            position=(float(x), float(y)),
            time=float(times[level]),
            why="lines or levels cross there, and a point would have two surface points",
        )


def _ring_directions(model: Model, ring: Array, centre: Array, time: float) -> Array:
    """Return the directions (n,), rad, of a ring's points (n, 2), m, from the centre: increasing, as it is star-shaped.

    Raises `FoldedGridError` where they are not.
    """
    rays = ring - centre
    angles = np.unwrap(np.arctan2(rays[:, 1], rays[:, 0]))
    # all positive, and one turn in sum: each direction meets the ring once
    steps = np.diff(np.append(angles, angles[0] + 2.0 * math.pi))
    if np.any(steps <= 0.0):
        x, y = ring[np.argmin(steps)]
        raise FoldedGridError(
            f"a level of the flow of model '{model.name}' is not star-shaped, {int(np.sum(steps <= 0.0))} times, first",
            position=(float(x), float(y)),
            time=float(time),
            why="directions from the centre do not tell its points apart",
        )
    return np.asarray(angles)


@compiled
def doubled_area(ax: float, ay: float, bx: float, by: float, px: float, py: float) -> float:
    """Return twice the area of the triangle a, b, p: positive where p is left of a to b."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


@compiled
def diagonal_crossing(a: Pair, b: Pair, e: Pair, d: Pair) -> float:
    """Return how far along the diagonal from a to e it meets the one from b to d; NaN where it does not."""
    before, after = doubled_area(b[0], b[1], d[0], d[1], a[0], a[1]), doubled_area(b[0], b[1], d[0], d[1], e[0], e[1])
    t = before / (before - after)
    left, right = doubled_area(a[0], a[1], e[0], e[1], b[0], b[1]), doubled_area(a[0], a[1], e[0], e[1], d[0], d[1])
    # a and e on different sides of the line b d, and b and d of a e
    return t if before > 0.0 > after and left < 0.0 < right else np.nan


@compiled
def _in_triangle(
    p: Pair, q: Pair, c: Pair, v: Pair, w: Pair, z: Pair, x: float, y: float
) -> tuple[float, float, float]:
    """Return the barycentric map (5.20) of (x, y) from the triangle p, q, c to v, w, z; and its least coordinate."""
    area = doubled_area(p[0], p[1], q[0], q[1], c[0], c[1])
    # (5.18), (5.19): barycentric coordinates as shares of the area
    third = doubled_area(p[0], p[1], q[0], q[1], x, y) / area
    first = doubled_area(q[0], q[1], c[0], c[1], x, y) / area
    second = 1.0 - first - third
    # (5.20)
    out_x = first * v[0] + second * w[0] + third * z[0]
    out_y = first * v[1] + second * w[1] + third * z[1]
    return out_x, out_y, min(first, second, third)


@compiled
def _grid_point(grid: Array, k: int, i: int) -> Pair:
    """Return the point of a grid (m, n, 2) on level k and line i."""
    return grid[k, i, 0], grid[k, i, 1]


@compiled
def map_in_cell(points: Array, disk: Array, cell: int, x: float, y: float) -> tuple[float, float, float]:
    """Return where a point (x, y), m, goes on the disk by the nearest triangle of a cell, and its least coordinate.

    `points` and `disk` (m, n, 2), see `Chart`. The coordinate is barycentric, and negative outside the cell.
    """
    n = points.shape[1]
    k, i = cell // n, cell % n
    after = i + 1 if i + 1 < n else 0
    a, b, d, e = (
        _grid_point(points, k, i),
        _grid_point(points, k, after),
        _grid_point(points, k + 1, i),
        _grid_point(points, k + 1, after),
    )
    v, w, z, s = (
        _grid_point(disk, k, i),
        _grid_point(disk, k, after),
        _grid_point(disk, k + 1, i),
        _grid_point(disk, k + 1, after),
    )
    t = diagonal_crossing(a, b, e, d)
    over_ae = doubled_area(a[0], a[1], e[0], e[1], x, y) > 0.0
    # convex: four triangles about the crossing, which goes to that of the image's diagonals
    if not math.isnan(t):
        c = (a[0] + t * (e[0] - a[0]), a[1] + t * (e[1] - a[1]))
        r = diagonal_crossing(v, w, s, z)
        middle = (v[0] + r * (s[0] - v[0]), v[1] + r * (s[1] - v[1]))
        # corner a is left of b d, and corner d left of a e: both sides tell which of the four it is
        if doubled_area(b[0], b[1], d[0], d[1], x, y) >= 0.0:
            if over_ae:
                return _in_triangle(d, a, c, z, v, middle, x, y)
            return _in_triangle(a, b, c, v, w, middle, x, y)
        if over_ae:
            return _in_triangle(e, d, c, s, z, middle, x, y)
        return _in_triangle(b, e, c, w, s, middle, x, y)
    # not convex: two triangles along the diagonal that lies inside
    if (
        doubled_area(a[0], a[1], b[0], b[1], e[0], e[1]) > 0.0
        and doubled_area(a[0], a[1], e[0], e[1], d[0], d[1]) > 0.0
    ):
        if over_ae:
            return _in_triangle(e, d, a, s, z, v, x, y)
        return _in_triangle(a, b, e, v, w, s, x, y)
    if doubled_area(b[0], b[1], d[0], d[1], x, y) > 0.0:
        return _in_triangle(d, a, b, z, v, w, x, y)
    return _in_triangle(b, e, d, w, s, z, x, y)


@compiled
def map_to_disk(chart: Chart, x: float, y: float) -> tuple[int, float, float]:
    """Return the level just outside a point, and the point on the disk by (5.20).

    Within the last level the point on the disk is that of this level in the direction from the centre. (OUTSIDE_CELLS,
    0, 0) for a point that is in no cell.
    """
    n, m = chart.points.shape[1], chart.points.shape[0]
    i, j = math.floor((x - chart.x0) / chart.side), math.floor((y - chart.y0) / chart.side)
    # only the cells that touch the point's bucket
    if 0 <= i < chart.across and 0 <= j < chart.up:
        bucket = j * chart.across + i
        best, best_x, best_y, best_cell = -CELL_SLACK, 0.0, 0.0, -1
        for entry in range(chart.heads[bucket], chart.heads[bucket + 1]):
            cell = chart.cells[entry]
            disk_x, disk_y, least_coordinate = map_in_cell(chart.points, chart.disk, cell, x, y)
            if least_coordinate >= best:
                best, best_x, best_y, best_cell = least_coordinate, disk_x, disk_y, cell
                # inside for certain: cells do not overlap
                if least_coordinate > 0.0:
                    break
        # a cell's number is level * n + line
        if best_cell >= 0:
            return best_cell // n, best_x, best_y
    line, share, within = ring_crossing(chart.points[m - 1], chart.inner, chart.centre, x, y)
    if not within:
        return OUTSIDE_CELLS, 0.0, 0.0
    level = m - 1
    v, w = chart.disk[level, line], chart.disk[level, line + 1 if line + 1 < n else 0]
    return level, v[0] + share * (w[0] - v[0]), v[1] + share * (w[1] - v[1])


@compiled
def ring_crossing(
    ring: Array, polar: Array, centre: tuple[float, float], x: float, y: float
) -> tuple[int, float, bool]:
    """Return where the ray from the centre to a point (x, y), m, meets a ring (n, 2): line, share, and whether inside.

    `polar` (n,) are the directions (rad) of the ring's points from the `centre`; the share is that of the way from the
    line to the next; inside means within the ring.
    """
    n = ring.shape[0]
    cx, cy = centre
    angle = math.atan2(y - cy, x - cx)
    angle -= 2.0 * math.pi * math.floor((angle - polar[0]) / (2.0 * math.pi))
    line = min(max(np.searchsorted(polar, angle, "right") - 1, 0), n - 1)
    p, q = ring[line], ring[line + 1 if line + 1 < n else 0]
    # areas of the triangles that the point cuts off the sector: their ratio is the share
    first, second = doubled_area(x, y, q[0], q[1], cx, cy), doubled_area(p[0], p[1], x, y, cx, cy)
    total = first + second
    share = second / total if total > 0.0 else 0.0
    return line, min(max(share, 0.0), 1.0), total <= doubled_area(p[0], p[1], q[0], q[1], cx, cy)


@compiled
def surface_parameter(chart: Chart, angle: float) -> float:
    """Return the curve's parameter at an angle (rad) on the disk: linear between the lines' starts.

    It is the inverse map of (5.17) on the surface.
    """
    n = chart.points.shape[1]
    turn = 2.0 * math.pi
    angle -= turn * math.floor(angle / turn)
    # a first guess for lines at equal angles, then the neighbour that holds the angle
    line = min(int(angle / turn * n), n - 1)
    while line > 0 and chart.angles[line] > angle:
        line -= 1
    while line < n - 1 and chart.angles[line + 1] <= angle:
        line += 1
    share = (angle - chart.angles[line]) / (chart.angles[line + 1] - chart.angles[line])
    u = chart.us[line] + share * (chart.us[line + 1] - chart.us[line])
    return float(u if u < chart.end else max(u - (chart.end - chart.start), chart.start))


@compiled
def map_to_angles(chart: Chart, points: Array) -> Array:
    """Return the angles (k,), rad, on the disk of rows of points (k, 2), m; NaN for one in no cell."""
    out = np.empty(points.shape[0])
    for row in range(points.shape[0]):
        level, x, y = map_to_disk(chart, points[row, 0], points[row, 1])
        out[row] = math.atan2(y, x) if level != OUTSIDE_CELLS else np.nan
    return out


@compiled
def fill_buckets(points: Array, x0: float, y0: float, side: float, across: int, up: int) -> tuple[IntArray, IntArray]:
    """Return the cells that touch each bucket by their bounding boxes: heads (buckets + 1,) and cells (entries,).

    `points` (m, n, 2), m; buckets are `across` by `up` squares of `side` (m) from (x0, y0).
    """
    m, n = points.shape[0], points.shape[1]
    heads = np.zeros(across * up + 1, np.int64)
    boxes = np.empty((4, (m - 1) * n), np.int64)
    for k in range(m - 1):
        for i in range(n):
            after = i + 1 if i + 1 < n else 0
            low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
            for row, column in ((k, i), (k, after), (k + 1, i), (k + 1, after)):
                x, y = points[row, column, 0], points[row, column, 1]
                low_x, high_x = min(low_x, x), max(high_x, x)
                low_y, high_y = min(low_y, y), max(high_y, y)
            # a cell is also listed where rounding might look for it
            pad = 1e-6 * side
            cell = k * n + i
            boxes[0, cell] = max(math.floor((low_x - pad - x0) / side), 0)
            boxes[1, cell] = min(math.floor((high_x + pad - x0) / side), across - 1)
            boxes[2, cell] = max(math.floor((low_y - pad - y0) / side), 0)
            boxes[3, cell] = min(math.floor((high_y + pad - y0) / side), up - 1)
            for j in range(boxes[2, cell], boxes[3, cell] + 1):
                for h in range(boxes[0, cell], boxes[1, cell] + 1):
                    heads[j * across + h + 1] += 1
    for bucket in range(across * up):
        # counts become where each bucket's cells begin
        heads[bucket + 1] += heads[bucket]
    cells = np.empty(heads[-1], np.int64)
    filled = heads[:-1].copy()
    for cell in range(boxes.shape[1]):
        for j in range(boxes[2, cell], boxes[3, cell] + 1):
            for h in range(boxes[0, cell], boxes[1, cell] + 1):
                cells[filled[j * across + h]] = cell
                filled[j * across + h] += 1
    return heads, cells


@compiled
def project_to_parameter(chart: Chart, x: float, y: float) -> float:
    """Return the parameter of the surface point that (x, y), m, is projected to by (5.17); NaN for one in no cell."""
    level, disk_x, disk_y = map_to_disk(chart, x, y)
    if level == OUTSIDE_CELLS:
        return np.nan
    return surface_parameter(chart, math.atan2(disk_y, disk_x))


@compiled
def angle_of(chart: Chart, u: float) -> float:
    """Return the angle (rad) on the disk of the surface point at a curve's parameter u: linear between the lines."""
    us, angles = chart.us, chart.angles
    if u < us[0]:
        u += us[-1] - us[0]
    line = min(max(np.searchsorted(us, u, "right") - 1, 0), us.shape[0] - 2)
    return float((angles[line + 1] - angles[line]) / (us[line + 1] - us[line]) * (u - us[line]) + angles[line])


@compiled
def surface_parameters(chart: Chart, angles: Array) -> Array:
    """Return `surface_parameter` (n,) of each of the angles (n,), rad."""
    out = np.empty(angles.shape[0])
    for row in range(angles.shape[0]):
        out[row] = surface_parameter(chart, angles[row])
    return out
