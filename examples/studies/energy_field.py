"""Find where a renderer's force creates energy: its curl inside a plane model, and the loop that gains most.

For renderers without memory. The curl of a cell of a grid is the work of the force once round it, anticlockwise, over
its area. So it is defined where the force jumps too, and summed over cells it is the work round all of them.

What a hand gets round a loop is the integral of the curl over what the loop encloses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.renderer import Renderer
from hapticeval.simulation.playback import answers_along
from hapticeval.types import Array

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
"""Of the rule for the work along one side of a cell."""

LOOP_POINTS = 20_000
"""Points of a loop whose work is measured."""

MEASURED_LOOPS = 12
"""Loops of a scan that are measured."""


@dataclass(frozen=True, eq=False)
class EnergyField:
    """Where a force creates energy: its `curl` (rows, columns), N/m, over the cells of a grid.

    The cells have the side `cell` (m) and lie about `centres` (rows, columns, 2), m. The curl is NaN in cells that are
    not wholly inside; `depth` (rows, columns), m, is that of the cells' centres.
    """

    centres: Array
    cell: float
    curl: Array
    depth: Array


@dataclass(frozen=True)
class Loop:
    """A circle, led round anticlockwise, and the `work` (J) that the hand gets by it; negative, clockwise."""

    centre: tuple[float, float]
    radius: float
    work: float


def energy_field(renderer: Renderer, curve: Curve, *, cell: float = 1e-3) -> EnergyField:
    """Measure the curl of a renderer's force inside a closed curve, in square cells of the side `cell` (m)."""
    xmin, ymin, xmax, ymax = curve.bounds
    counts = [max(1, int(np.ceil((high - low) / cell))) for low, high in ((xmin, xmax), (ymin, ymax))]
    xs, ys = xmin + cell * np.arange(counts[0] + 1), ymin + cell * np.arange(counts[1] + 1)
    centres = np.stack(np.meshgrid(xs[:-1] + 0.5 * cell, ys[:-1] + 0.5 * cell), axis=-1)
    # Depth is positive inside, a signed distance negative.
    depth = -curve.signed_distance(centres.reshape(-1, 2)).reshape(centres.shape[:2])
    # Gauss and Legendre on [-1, 1], moved to a side of length h: x = h/2 (1 + node), weight h/2.
    shares, weights = 0.5 * cell * (1.0 + NODES), 0.5 * cell * WEIGHTS
    # Points on all horizontal sides (rows + 1, columns, 8, 2), then on all vertical ones (rows, columns + 1, 8, 2).
    along_x = np.stack(np.broadcast_arrays(xs[:-1, np.newaxis] + shares, ys[:, np.newaxis, np.newaxis]), axis=-1)
    along_y = np.stack(np.broadcast_arrays(xs[:, np.newaxis], (ys[:-1, np.newaxis] + shares)[:, np.newaxis]), axis=-1)
    # The work along each side: the integral of F_x to the right, and of F_y up.
    right = _forces_at(renderer, along_x)[..., 0] @ weights
    up = _forces_at(renderer, along_y)[..., 1] @ weights
    # Anticlockwise: right along the lower side, up the right one, back along the upper, down the left one.
    round_about = right[:-1] + up[:, 1:] - right[1:] - up[:, :-1]
    # Green: work round a cell = curl x area. The forces act on the hand, so the work is what it gets.
    return EnergyField(centres, cell, np.where(depth > cell, round_about / cell**2, np.nan), depth)


def _forces_at(renderer: Renderer, points: Array) -> Array:
    rows = np.ascontiguousarray(points.reshape(-1, 2))
    return answers_along(renderer, rows, 1.0).force.reshape(points.shape)


def work_round(renderer: Renderer, centre: tuple[float, float], radius: float) -> Loop:
    """Measure the work (J) that a renderer's force does once round a circle, by the trapezoidal rule.

    `centre` and `radius` are in m; `LOOP_POINTS` points make the circle.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, LOOP_POINTS + 1)
    # The last point is the first one again: the loop is closed.
    hips = np.asarray(centre) + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    forces = answers_along(renderer, hips, 1.0).force
    # W = sum of (F_k + F_k+1)/2 . (x_k+1 - x_k), J.
    work = float(np.sum(0.5 * (forces[1:] + forces[:-1]) * np.diff(hips, axis=0)))
    return Loop((float(centre[0]), float(centre[1])), radius, work)


def works_at(field: EnergyField, radius: float) -> Array:
    """Return the work (J) round a circle of a `radius` (m) about each cell's centre: (rows, columns).

    It is the integral of the curl over the disc.

    NaN for discs that are not wholly inside.
    """
    from scipy.signal import fftconvolve

    reach = int(np.ceil(radius / field.cell))
    steps = field.cell * np.arange(-reach, reach + 1)
    disc = (np.hypot(steps[:, np.newaxis], steps) <= radius).astype(np.float64)
    # The sum of the curl over a disc about every centre at once is a convolution with the disc.
    total = fftconvolve(np.nan_to_num(field.curl), disc, mode="same") * field.cell**2
    # the disc as cells has another area
    share = np.pi * radius**2 / (disc.sum() * field.cell**2)
    # Only discs all of whose cells are inside: elsewhere NaN was counted as zero.
    return np.where(field.depth > radius + field.cell, share * total, np.nan)


def worst_loop(
    renderer: Renderer, field: EnergyField, radius: float, *, depths: tuple[float, float] = (0.0, np.inf)
) -> Loop:
    """Find the circle of a radius (m) wholly inside by which the hand gains most, in either sense: scanned, measured.

    Its centre is between two `depths`, m. Where a force jumps the scan is off by the rule's error at the jump, and so
    the `MEASURED_LOOPS` best are measured. Raises `InputError` where no such circle is inside.
    """
    works = np.abs(works_at(field, radius))
    works[(field.depth < depths[0]) | (field.depth > depths[1])] = np.nan
    # From the largest magnitude down; NaN last.
    order = np.argsort(np.where(np.isnan(works), -1.0, works), axis=None)[::-1][:MEASURED_LOOPS]
    chosen = [tuple(field.centres.reshape(-1, 2)[index].tolist()) for index in order if works.flat[index] >= 0.0]
    if not chosen:
        raise InputError(
            f"no circle of {1e3 * radius:g} mm is inside at these depths",
            todo="choose a smaller radius, or finer cells",
        )
    return max((work_round(renderer, centre, radius) for centre in chosen), key=lambda loop: abs(loop.work))
