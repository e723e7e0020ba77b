"""A projection field and its numbers: lines of constant projection, amplification, the share of the inside near a
discontinuity, and the error vector at shallow depth, the last of the properties that section 5.1 asks of a projection.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.geometry.curve import Curve
from hapticeval.study.projection_field.singular import (
    Lattice,
    Project,
    Singular,
    apart,
    cell_sides,
    edge_ends,
    extent,
    sampled,
    singular_geometry,
    singular_set,
)
from hapticeval.types import Array, BoolArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

CELLS = 300
LINES = 96
STEP = 1e-5  # HIP step for amplification, as a share of the model's size
RESTS = 1e-6  # amplification below which the IHIP rests while the hand moves
FAR = 0.25  # IHIPs further from the one that is asked for than this share of the surface are on its other side
DEPTHS = (0.0025, 0.025)  # as shares of the model's extent: 0.5 mm and 5 mm in a model of 200 mm
PLACES = 400
FROM_CORNERS = 3.0  # depths that a place keeps away from every corner, where there is no one normal


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
        return singular_geometry(self.singular)

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


def field_of(project: Project, surface: Curve, *, cells: int = CELLS, start: Array | None = None) -> Field:
    """Sample a projection on a lattice of `cells` steps, and find lines, jumps and amplification.

    Raises `InputError` as `sampled` does.
    """
    lattice = sampled(project, surface, cells=cells)
    singular = singular_set(project, lattice)
    return Field(
        lattice,
        singular,
        lines_of_constant_projection(lattice, singular, count=LINES),
        _amplification(project, lattice, singular),
        start,
    )


def _amplification(project: Project, lattice: Lattice, singular: Singular) -> Array:
    """Return |dIHIP| / |dHIP| (ny, nx), from a step along x and one along y.

    The IHIP moves along the surface only, so that the two add up.
    """
    import shapely

    step = STEP * lattice.size
    hips, ihips = lattice.nodes[lattice.held], lattice.ihip[lattice.held]
    moves = [hips + step * axis for axis in np.eye(2)]
    moved = [project(each) for each in moves]
    rates = np.hypot(*(np.linalg.norm(each - ihips, axis=1) / step for each in moved))
    unclear = shapely.dwithin(singular_geometry(singular), shapely.points(hips), 3.0 * step)
    for at, before in zip(moved, moves, strict=True):
        unclear |= np.all(at == before, axis=1)
    rates[unclear] = np.nan
    found = np.full(lattice.held.shape, np.nan)
    found[lattice.held] = rates
    return found


def lines_of_constant_projection(lattice: Lattice, singular: Singular, *, count: int) -> list[Array]:
    """Return the lines (n, 2), m, of HIPs that share an IHIP, for `count` IHIPs in equal steps of arc length.

    A line never crosses the singular set. One that ends within a lattice step of its IHIP is drawn up to it.
    """
    length = lattice.surface.length
    levels = (np.arange(count) + 0.5) * length / count
    ends = lattice.surface.position(lattice.surface.parameter(levels))
    found: list[Array] = []
    for level, end in zip(levels, ends, strict=True):
        for line in _merged(_level_segments(lattice, singular, apart(lattice.s, float(level), length))):
            found.append(_drawn_out(line, end, 1.5 * lattice.h))
    return found


def _level_segments(lattice: Lattice, singular: Singular, way: Array) -> Array:
    """Return where `way` (ny, nx) changes sign, one piece (m, 2, 2) per cell, none over a jump or far round."""
    far = FAR * lattice.surface.length
    nodes = lattice.nodes
    crossings = []
    for axis, jumps in ((1, singular.across), (0, singular.up)):
        first, second = edge_ends(axis)
        a, b = way[first], way[second]
        with np.errstate(invalid="ignore"):
            met = ((a < 0.0) != (b < 0.0)) & (np.abs(a) < far) & (np.abs(b) < far) & ~jumps[first]
        place = np.full(nodes.shape, np.nan)
        share = (a[met] / (a[met] - b[met]))[:, None]
        view = place[first]
        view[met] = nodes[first][met] + share * (nodes[second][met] - nodes[first][met])
        crossings.append(place)
    sides = cell_sides(*crossings)
    met = ~np.isnan(sides[..., 0])
    count: BoolArray = met.sum(axis=2) == 2
    pieces: Array = sides[count][met[count]].reshape(-1, 2, 2)
    return pieces


def _merged(pieces: Array) -> list[Array]:
    """Join the pieces end to end."""
    import shapely

    if len(pieces) == 0:
        return []
    joined = shapely.line_merge(shapely.MultiLineString(list(pieces)))
    return [shapely.get_coordinates(part) for part in shapely.get_parts(joined)]


def _drawn_out(line: Array, end: Array, near: float) -> Array:
    gaps = np.linalg.norm(line[[0, -1]] - end, axis=1)
    if gaps.min() > near:
        return line
    return np.vstack([end, line]) if gaps[0] <= gaps[1] else np.vstack([line, end])


@dataclass(frozen=True)
class Shallow:
    """Angle (degrees) between error vector and surface normal at `depth` (m): median and 95 per cent of the places."""

    depth: float
    median: float
    p95: float


def shallow_angles(project: Project, surface: Curve) -> tuple[Shallow, ...]:
    """Measure how far from normal a projection of HIPs (n, 2) is just under a closed `surface`, at each of `DEPTHS`.

    Places are evenly spaced along the surface, away from its corners; HIPs that come out in free space do not count.
    """
    found = []
    for share in DEPTHS:
        depth = share * extent(surface)
        u = surface.parameter(np.linspace(0.0, surface.length, PLACES, endpoint=False))
        position = surface.position(u)
        clear = np.ones(PLACES, dtype=bool)
        for corner in surface.corners:
            clear &= np.linalg.norm(position - corner.position, axis=1) > FROM_CORNERS * depth
        hips = position[clear] - depth * surface.normal(u[clear])
        ihips = project(hips)
        error = ihips - hips
        length = np.linalg.norm(error, axis=1)
        pressed = length > 0.0
        if not pressed.any():
            continue
        normal = surface.normal(surface.nearest(ihips[pressed]))
        cosine = np.sum(error[pressed] * normal, axis=1) / length[pressed]
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        found.append(Shallow(depth, float(np.median(angle)), float(np.percentile(angle, 95))))
    return tuple(found)
