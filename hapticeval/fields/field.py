"""A projection field and its numbers: share of the inside near a discontinuity, and amplification."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.fields.lattice import Lattice, Project, sampled
from hapticeval.fields.lines import lines_of_constant_projection
from hapticeval.fields.singular import Singular, singular_set
from hapticeval.geometry.curve import Curve
from hapticeval.types import Array, BoolArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

CELLS = 300
LINES = 96
STEP = 1e-5
"""HIP step for amplification, as a share of the model's size."""

RESTS = 1e-6
"""Amplification below which the IHIP rests while the hand moves."""


@dataclass(frozen=True, eq=False)
class Field:
    """A projection on the inside of a surface: nodes, the singular set, lines, and amplification.

    `lines` are arrays (n, 2), m; `amplification` (ny, nx) is the largest |dIHIP| / |dHIP| over directions, NaN out of
    contact and beside the singular set. `start` (2,), m, is where the tool was, for a renderer with memory.
    """

    lattice: Lattice
    singular: Singular
    lines: list[Array]
    amplification: Array
    start: Array | None

    @property
    def surface(self) -> Curve:
        """The surface that HIPs are projected to."""
        return self.lattice.surface

    @property
    def rests(self) -> BoolArray:
        """(ny, nx): where the IHIP stays at a corner while the hand moves."""
        with np.errstate(invalid="ignore"):
            resting: BoolArray = self.amplification < RESTS
        return resting

    @cached_property
    def body(self) -> BaseGeometry:
        """The inside as an area, m^2."""
        import shapely

        count = max(4000, 8 * len(self.surface.corners))
        return shapely.make_valid(shapely.Polygon(self.surface.outline(count)))

    @cached_property
    def discontinuity(self) -> BaseGeometry:
        """The singular set as lines and points, m."""
        return geometry(self.singular)

    def share_near(self, distance: float) -> float:
        """The share of the inside, by area, that lies within `distance` (m) of the singular set."""
        near = self.discontinuity.buffer(distance, quad_segs=32)
        return float(self.body.intersection(near).area / self.body.area)

    def summary(self, *, within: float) -> dict[str, Any]:
        """The numbers as JSON values; `within` (m) is the distance of the share."""
        lattice = self.lattice
        rates = self.amplification[np.isfinite(self.amplification)]
        worst = np.unravel_index(np.nanargmax(self.amplification), self.amplification.shape)
        return {
            "cells": round(lattice.size / lattice.h),
            "start": None if self.start is None else self.start.tolist(),
            "contact_share": float(lattice.held.sum() / lattice.inside.sum()),
            "singular": {
                "length_m": float(self.discontinuity.length),
                "points": self.singular.points.tolist(),
                "largest_jump_m": float(self.singular.jumps.max(initial=0.0)),
                "within_m": within,
                "share_within": self.share_near(within),
            },
            "amplification": {
                "median": float(np.median(rates)),
                "p95": float(np.quantile(rates, 0.95)),
                "max": float(rates.max()),
                "max_at": [float(lattice.x[worst[1]]), float(lattice.y[worst[0]])],
                "rest_share": float(np.mean(rates < RESTS)),
            },
        }


def field_of(
    project: Project, surface: Curve, *, cells: int = CELLS, lines: int = LINES, start: Array | None = None
) -> Field:
    """Sample a projection on a lattice of `cells` steps, and find what there is to see.

    Raises `InputError` as `sampled` does.
    """
    lattice = sampled(project, surface, cells=cells)
    singular = singular_set(project, lattice)
    return Field(
        lattice,
        singular,
        lines_of_constant_projection(lattice, singular, count=lines),
        _amplification(project, lattice, singular),
        start,
    )


def geometry(singular: Singular) -> BaseGeometry:
    """A singular set as one geometry, its lines joined end to end."""
    import shapely

    drawn = [shapely.LineString(segment) for segment in singular.segments]
    lines = shapely.line_merge(shapely.MultiLineString(drawn))
    return shapely.GeometryCollection([*shapely.get_parts(lines), *map(shapely.Point, singular.points)])


def _amplification(project: Project, lattice: Lattice, singular: Singular) -> Array:
    """By a step along x and one along y at each node: the IHIP moves along the surface only, so the two add up."""
    import shapely

    step = STEP * lattice.size
    hips, ihips = lattice.nodes[lattice.held], lattice.ihip[lattice.held]
    moved = [project(hips + step * np.eye(2)[axis]) for axis in (0, 1)]
    left = [np.all(each == hips + step * np.eye(2)[axis], axis=1) for axis, each in enumerate(moved)]
    rates = np.hypot(*(np.linalg.norm(each - ihips, axis=1) / step for each in moved))
    beside = shapely.dwithin(geometry(singular), shapely.points(hips), 3.0 * step)
    rates[beside | left[0] | left[1]] = np.nan
    found = np.full(lattice.held.shape, np.nan)
    found[lattice.held] = rates
    return found
