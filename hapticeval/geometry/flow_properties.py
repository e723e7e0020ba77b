"""How far a flow map has the four properties that thesis 5.1 asks of a projection, as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hapticeval.geometry.flow_map import FlowMap
from hapticeval.types import Array

SAMPLES = 2000
"""Surface points from which depths are gone down."""


@dataclass(frozen=True, kw_only=True)
class ShallowAngle:
    """Angles (degrees) between the error vector and the surface normal at HIPs `depth` (m) under the surface."""

    depth: float
    median: float
    most: float
    worst: float


@dataclass(frozen=True, kw_only=True)
class FlowProperties:
    """The properties of thesis 5.1, measured.

    - Continuous: `singular` is the one point (m) where it is not, and around which the IHIP must move ever faster.
      Outside of half the surface's radius it moves at most `steepest` times as far as the HIP, and in 99 of 100 cells
      at most `steep` times. `held` is the share of the grid's gaps that were
      held open: there the lines are not orthogonal to the levels.
    - Smooth: the map is linear in each triangle. `kink` is the change of its slope from a cell to the next along the
      level, as a share of the slope: the median. It falls with the spacing of the lines where the map is smooth.
    - Memoryless: `forgets` is the largest distance (m) between IHIPs of the same HIPs asked in two orders.
    - Normal: `angles` at the depths asked for; `most` is the 95th percentile.
    """

    singular: tuple[float, float]
    steepest: float
    steep: float
    held: float
    kink: float
    forgets: float
    angles: tuple[ShallowAngle, ...]


def properties(made: FlowMap, *, depths: Sequence[float], seed: int = 0) -> FlowProperties:
    """Measure a map, at `depths` (m) along the inward normals of equally spaced surface points."""
    slopes = _slopes(made)
    outer = slopes[np.sqrt(made.inside.areas[1:] / made.inside.areas[0]) >= 0.5]
    mean = 0.5 * (slopes + np.roll(slopes, -1, axis=1))
    kinks = np.abs(np.roll(slopes, -1, axis=1) - slopes) / mean
    return FlowProperties(
        singular=made.chart.centre,
        steepest=float(outer.max()),
        steep=float(np.percentile(outer, 99.0)),
        held=float(made.inside.held.sum() / made.inside.points[1:, :, 0].size),
        kink=float(np.median(kinks)),
        forgets=_forgets(made, seed),
        angles=tuple(_shallow(made, depth) for depth in depths),
    )


def _slopes(made: FlowMap) -> Array:
    """The larger singular value of HIP to IHIP in each cell (m - 1, n) inside, from its two halves (rank one each)."""
    chart = made.chart
    points = chart.points[chart.surface :]
    a, d = points[:-1], points[1:]
    b, e = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
    step = np.diff(made.curve.arc_length(chart.us))
    largest = np.zeros(a.shape[:2])
    # along one line the surface point is the same: the slope is the step over the height of the triangle on that line
    for foot, head, other in ((a, d, b), (b, e, d)):
        along = head - foot
        away = other - foot
        height = np.abs(along[..., 0] * away[..., 1] - along[..., 1] * away[..., 0]) / np.hypot(
            *np.moveaxis(along, -1, 0)
        )
        largest = np.maximum(largest, step / height)
    return largest


def _forgets(made: FlowMap, seed: int) -> float:
    xmin, ymin, xmax, ymax = made.curve.bounds
    points = np.random.default_rng(seed).uniform((xmin, ymin), (xmax, ymax), (SAMPLES, 2))
    points = points[made.curve.contains(points)]
    order = np.random.default_rng(seed + 1).permutation(points.shape[0])
    there = made.curve.position(made.surface(made.to_angle(points)))
    back = made.curve.position(np.array([made.parameter(x, y) for x, y in points[order].tolist()]))
    return float(np.max(np.hypot(*(there[order] - back).T)))


def _shallow(made: FlowMap, depth: float) -> ShallowAngle:
    curve = made.curve
    u = curve.parameter((np.arange(SAMPLES) + 0.5) * (curve.length / SAMPLES))
    hips = curve.position(u) - depth * curve.normal(u)
    hips = hips[curve.contains(hips)]
    at = made.surface(made.to_angle(hips))
    errors, normals = curve.position(at) - hips, curve.normal(at)
    cosines = np.sum(errors * normals, axis=1) / np.hypot(errors[:, 0], errors[:, 1])
    angles = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    median, most, worst = (float(x) for x in np.percentile(angles, (50.0, 95.0, 100.0)))
    return ShallowAngle(depth=depth, median=median, most=most, worst=worst)
