"""Curve shortening flow of a model by the level set method (thesis 5.2): tangential levels and transversal lines.

The model's signed distance is carried by (5.4) until its zero level has shrunk to a small circle.

Points that start on the surface are carried along by (5.16), each pulled back onto the zero level after every step.
They are recorded on levels of equal steps in the square root of the enclosed area.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from hapticeval.errors import InputError, RefusalError, UnknownNameError
from hapticeval.geometry.model import Model, equal_steps_between
from hapticeval.renderers.maps import flow_kernels as kernels
from hapticeval.types import Array

USE_CONFORMAL = "use the renderer 'conformal', which maps every model without holes"


class FlowError(RefusalError):
    """The flow gives no map; `position` (m) is where that was seen."""

    def __init__(self, what: str, *, position: tuple[float, float], time: float, why: str) -> None:
        self.position: tuple[float, ...] | None = position
        x, y = (round(c, 9) + 0.0 for c in position)  # to a nanometre: a centre is at zero
        super().__init__(f"{what} at ({x:.4g}, {y:.4g}) m, flow time {time:.4g}", why=why, todo=USE_CONFORMAL)


class FlowSplitError(FlowError):
    """The front fell apart into several (Figure 5.9)."""


class FlowCollapseError(FlowError):
    """The front shrinks to a segment instead of a point, or vanished before it was round."""


class FoldedGridError(FlowError):
    """Cells of the grid are turned over: lines crossed, and the map is not one-to-one."""


VELOCITIES = MappingProxyType(
    {
        "curvature": kernels.CURVATURE_VELOCITY,
        "unit": kernels.UNIT_VELOCITY,
        "cap": kernels.CAPPED_VELOCITY,
        "arc": kernels.ARCTAN_VELOCITY,
    }
)
"""Velocity functions by name: kappa; 1; (5.13); (5.14)."""

FLOW_MARGIN_CELLS = 4
"""Cells between the model and the edge of the grid."""

SHARE_OF_BOUND = 0.9
"""Time step as a share of the stability bound, (5.12) corrected."""

NOTCH_LEAD = 0.5
"""Cells by which the front of a model with corners that are hollow to the flow starts ahead of the surface. Between
nodes the interpolant rounds such corners off outwards, and where the front hardly moves, levels would lie outside."""

CELLS_PER_UPDATE = 0.1
"""Cells that the front may move between two updates of the particles and of the average curvature."""

LAST_RADIUS_CELLS = 4.0
"""The flow stops at a length of 2 pi times this many cells: smaller fronts have no curvature on the grid."""

ROUNDNESS_LOST = 0.8
"""A front whose 4 pi A / L^2 falls below this share of its least so far above it is on its way to a segment."""

LAST_ASPECT = 1.5
"""Largest ratio of the extents of the last front: beyond it the front was not about to become a point."""


@dataclass(frozen=True, kw_only=True)
class FlowSettings:
    """The knobs of a flow, with the values that the renderer `mapping` takes.

    - `velocity`: one of `VELOCITIES`. K_cap of (5.13) is the average curvature of the model.
    - `cells`: along the model's longer side and a margin.
    - `lines`: transversal lines; twice as many as cells if None.
    - `levels`: steps in the root of the area from the whole model to nothing; two for five cells if None.
    - `gap`: the least distance of neighbouring lines as a share of their mean distance on the same level.

    Where a flow drives lines closer together, on the bisectors of sharp tips, they are held `gap` apart, or they would
    cross. The IHIP then moves about 1 / gap times as far as the HIP.

    A tiny gap keeps the order of the lines and no more, and the flow's own jumps; 0.05 makes a continuous map of them.

    Raises `UnknownNameError` for another velocity and `InputError` for numbers out of range.
    """

    velocity: str = "arc"
    cells: int = 200
    lines: int | None = None
    levels: int | None = None
    gap: float = 1e-6

    def __post_init__(self) -> None:
        if self.velocity not in VELOCITIES:
            raise UnknownNameError("velocity function", self.velocity, VELOCITIES)
        for name, low, high in (
            ("cells", 24, 2000),
            ("line_count", 16, 20_000),
            ("level_count", 4, 2000),
            ("gap", 0.0, 0.5),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(
                    f"{name.removesuffix('_count')} = {value!r}", why=f"it must lie between {low} and {high}"
                )
        if 2 * self.level_count > self.cells:
            raise InputError(
                f"{self.level_count} levels on {self.cells} cells",
                why="levels closer than a cell apart cannot be told apart",
                todo="take at most half as many levels as cells",
            )

    @property
    def line_count(self) -> int:
        """The transversal lines that are asked for; corners may add to them."""
        return 2 * self.cells if self.lines is None else self.lines

    @property
    def level_count(self) -> int:
        """The steps from the whole model to nothing."""
        return 2 * self.cells // 5 if self.levels is None else self.levels


@dataclass(frozen=True, eq=False)
class Flow:
    """What a flow recorded: m levels, the first the surface itself, and n lines, anticlockwise.

    - `points` (m, n, 2), m;
    - `u` (n,): the curve's parameters of the lines' starts;
    - `times` (m,): in m for velocities without unit, in m^2 for curvature;
    - `lengths` (m,), m, and `areas` (m,), m^2, of the levels on the grid; `cell` (m) is its spacing.
    """

    points: Array
    u: Array
    times: Array
    lengths: Array
    areas: Array
    cell: float


def run_flow(model: Model, settings: FlowSettings) -> Flow:
    """Return the flow of a model inwards.

    Raises `RefusalError` for an unbounded model, `FlowSplitError` where the front falls apart, and `FlowCollapseError`
    where it shrinks to a segment.
    """
    if not model.curve.closed:
        raise RefusalError(f"model '{model.name}' is unbounded", why="its surface does not shrink to a point")
    front = Front(model, settings)
    times, lengths, areas, points = map(np.array, zip(*_recorded_levels(front, settings), strict=True))
    return Flow(points, front.u, times, lengths, areas, front.h)


class Front:
    """The state of a flow: a level set that moves inwards, with the particles on its zero level."""

    def __init__(self, model: Model, settings: FlowSettings) -> None:
        xmin, ymin, xmax, ymax = model.curve.bounds
        self.model = model
        self.h = h = model.size / (settings.cells - 2 * FLOW_MARGIN_CELLS)
        nx, ny = (2 * FLOW_MARGIN_CELLS + 1 + math.ceil(side / h) for side in (xmax - xmin, ymax - ymin))
        self.x0, self.y0 = 0.5 * (xmin + xmax - (nx - 1) * h), 0.5 * (ymin + ymax - (ny - 1) * h)
        x, y = self.x0 + h * np.arange(nx), self.y0 + h * np.arange(ny)
        nodes = np.column_stack([array.ravel() for array in np.meshgrid(x, y)])
        distance = model.curve.signed_distance(nodes).reshape(ny, nx)
        # concave corners: see NOTCH_LEAD
        hollow = any(not corner.convex for corner in model.curve.corners)
        self.values = np.ascontiguousarray(distance) + (NOTCH_LEAD * h if hollow else 0.0)
        self._spare = self.values.copy()
        self.kind = VELOCITIES[settings.velocity]
        self.gap = settings.gap
        self.u = line_starts(model, settings.line_count)
        self.points = model.curve.position(self.u)
        self.time = 0.0
        self._cap = 2.0 * math.pi / model.curve.length
        # a first guess of the largest speed: curvature is at most 1 / h
        self._speed = 1.0 / h if self.kind in (kernels.CURVATURE_VELOCITY, kernels.CAPPED_VELOCITY) else 1.0
        self._measure()

    @property
    def scale(self) -> float:
        """K_cap, or the average curvature 2 pi / L by (5.15)."""
        return self._cap if self.kind == kernels.CAPPED_VELOCITY else 2.0 * math.pi / self.length

    def update(self) -> None:
        """Carry the level set by some steps, while the front moves a tenth of a cell, and the points with it."""
        scale = self.scale
        dt = SHARE_OF_BOUND * kernels.largest_step(self.kind, scale, self.h)
        # an even number, as `advance_steps` asks, that takes the front about CELLS_PER_UPDATE
        steps = 2 * max(1, round(0.5 * CELLS_PER_UPDATE * self.h / (self._speed * dt)))
        # at speed 1 lengths (m) are times
        if self.kind == kernels.UNIT_VELOCITY:
            dt, steps = 0.5 * CELLS_PER_UPDATE * self.h, 2
        self._speed = max(
            kernels.carry_points(self.values, self.h, self.x0, self.y0, self.kind, scale, steps * dt, self.points), 1e-3
        )
        kernels.advance_steps(self.values, self._spare, self.h, self.kind, scale, dt, steps)
        kernels.pull_back(self.values, self.h, self.x0, self.y0, self.points)
        self.time += steps * dt
        self._measure()
        if self.gap > 0.0 and kernels.keep_apart(self.points, self.gap * self.length / self.points.shape[0]):
            kernels.pull_back(self.values, self.h, self.x0, self.y0, self.points)

    def _measure(self) -> None:
        """Measure the front's length (m) and the area (m^2) inside."""
        self.length, self.area = kernels.measure_front(self.values, self.h)

    @property
    def roundness(self) -> float:
        """4 pi A / L^2: 1 for a circle."""
        return 4.0 * math.pi * self.area / self.length**2 if self.length > 0.0 else 0.0

    @property
    def aspect(self) -> float:
        """The ratio of the extents of the points along their principal axes."""
        centred = self.points - self.points.mean(axis=0)
        # principal axes by the singular vectors of the centred points
        long, short = np.ptp(centred @ np.linalg.svd(centred, full_matrices=False)[2].T, axis=0)
        return float(max(long, short) / max(min(long, short), 1e-300))

    def parts(self) -> tuple[int, tuple[float, float]]:
        """Return how many parts the inside has, and the middle (m) between the two nearest nodes of the first two."""
        from scipy.ndimage import label
        from scipy.spatial import cKDTree

        # eight neighbours: parts that touch at a corner are one
        labels, count = label(self.values < 0.0, np.ones((3, 3)))
        if count < 2:
            return count, (math.nan, math.nan)

        first, second = (np.argwhere(labels == k)[:, ::-1] * self.h + (self.x0, self.y0) for k in (1, 2))
        distances, matches = cKDTree(first).query(second)
        k = int(np.argmin(distances))
        x, y = 0.5 * (second[k] + first[np.asarray(matches)[k]])
        return count, (float(x), float(y))


def line_starts(model: Model, lines: int) -> Array:
    """Return the parameters (n,) at which lines start: at every corner, and at equal arc lengths between."""
    curve = model.curve
    # a smooth model is cut at its start
    cuts = [corner.s for corner in curve.corners] or [0.0]
    return np.unique(curve.parameter(equal_steps_between(cuts, curve.length, lines)))


def _recorded_levels(front: Front, settings: FlowSettings) -> Iterator[tuple[float, float, float, Array]]:
    """Run a flow to its end, and yield its levels: time, length (m), area (m^2) and points (n, 2), m."""
    area_at_start = front.area
    if not area_at_start > 0.0:
        x, y = front.model.curve.position(np.zeros(1))[0]
        raise FlowCollapseError(
            f"the flow of model '{front.model.name}' begins with no inside",
            position=(float(x), float(y)),
            time=front.time,
            why=f"it is thinner than a cell of the grid that holds its front, {1e3 * front.h:.3g} mm",
        )
    yield front.time, front.length, front.area, front.points.copy()
    roundest, level = front.roundness, 1
    while front.length >= 2.0 * math.pi * LAST_RADIUS_CELLS * front.h:
        front.update()
        # the best so far: what a front on its way to a segment falls short of
        roundest = max(roundest, front.roundness)
        elongated = front.roundness < ROUNDNESS_LOST * roundest
        # equal steps in the root of the area
        level_reached = 1.0 - math.sqrt(max(front.area, 0.0) / area_at_start) >= level / settings.level_count
        if level_reached or elongated:
            _check_in_one_part(front)
        if elongated:
            raise _collapse_error(front)
        if level_reached:
            yield front.time, front.length, front.area, front.points.copy()
            level += 1
    _check_in_one_part(front)
    if front.aspect > LAST_ASPECT:
        raise _collapse_error(front)
    if math.sqrt(front.area / area_at_start) < 1.0 - (level - 0.5) / settings.level_count:
        yield front.time, front.length, front.area, front.points.copy()


def _check_in_one_part(front: Front) -> None:
    """Raise `FlowSplitError` where the front has fallen apart."""
    count, place = front.parts()
    if count > 1:
        raise FlowSplitError(
            f"the flow of model '{front.model.name}' splits into {count} parts",
            position=place,
            time=front.time,
            why="the velocity knows the curvature alone, and a neck closes before the lobes have shrunk (Figure 5.9)",
        )


def _collapse_error(front: Front) -> FlowCollapseError:
    """Return the error that says where the front shrinks to a segment, and how flat it is."""
    x, y = front.points.mean(axis=0)
    return FlowCollapseError(
        f"the flow of model '{front.model.name}' shrinks to a segment instead of a point",
        position=(float(x), float(y)),
        time=front.time,
        why=f"the last level is {front.aspect:.2g} times as long as wide, and 4 pi A / L^2 is {front.roundness:.2g}",
    )
