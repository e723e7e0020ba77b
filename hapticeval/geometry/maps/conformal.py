"""The conformal map of the inside of a curve to the unit disk: a global transformation for any genus-0 model (8.2.1).

Curve shortening flow sees a curve locally, and splits at necks. The map here comes from an integral equation that sees
the whole shape at once (`conformal_solver`): it exists for every shape without holes, is one-to-one, meets smooth
boundaries at right angles, and has one singular point for the projection, its centre. What it cannot escape is
crowding: long necks and sharp tips shrink on the circle like powers or exponentials, until no digits are left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import for_kernels
from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.maps import conformal_kernels as kernels
from hapticeval.geometry.maps.conformal_nodes import smooth
from hapticeval.geometry.maps.conformal_solver import (
    ARCS,
    FINE,
    ROUNDING,
    Correspondence,
    balanced,
    change,
    correspondence,
    system_of,
)
from hapticeval.geometry.validate import checked_points
from hapticeval.types import Array

SMOOTH, PIECE, MOST = 256, 16, 2560
"""Nodes of a smooth curve, or of one piece of several, to start from; and of a whole curve to stop at."""

TOLERANCE = 0.05
"""Change of any density by the last doubling at which doubling stops: what is left is far less, about its square."""

BLUR_SHARE = 0.01
"""Blur, as a share of the curve's extent, beyond which the map is refused."""

OUTLINE = 513
"""Points of the outline inside which the search for the centre starts."""

DEEP_ENOUGH = 0.01
"""Depth of the outline's centroid, as a share of the greatest depth, from which on the search starts there."""


class CrowdingError(RefusalError):
    """Distant parts of the boundary crowd on the circle, so close that double precision cannot tell them apart.

    `crowding` is the ratio of the largest to the smallest density, or the largest that can be told; `blur` (m) the
    length of boundary that falls together at `place` (2,), m.
    """

    def __init__(self, name: str, crowding: float, blur: float, place: Array) -> None:
        self.crowding, self.blur, self.place = crowding, blur, place
        self.position: tuple[float, ...] | None = (float(place[0]), float(place[1]))
        super().__init__(
            f"the conformal map of '{name}' crowds by {crowding:.2g}: {blur * 1e3:.3g} mm of the boundary at "
            f"({place[0]:.4g}, {place[1]:.4g}) m fall together on the circle",
            why=f"angles are known to {ROUNDING:g} rad in double precision; behind a long neck, in the ends of a long "
            "body and in sharp tips the boundary takes less",
            todo="use minimum-distance or constraint; or shorten the body, widen the neck or blunt the tip",
        )


@dataclass(frozen=True, eq=False)
class ConformalMap:
    """The conformal map f of a curve's inside to the unit disk with f(centre) = 0 and f'(centre) > 0.

    It has `nodes` on the boundary. `error` is the share by which boundary densities changed from half as many: a bound
    on what is left. `crowding` is the ratio of the largest to the smallest boundary density |f'|, each averaged over
    1/1024 of the length, and `crowded_at` (2,), m, where the smallest is. `blur` (m) is the greatest length of boundary
    that rounding makes one, and `blurred_at` (2,), m, where. Made by `conformal_map`.
    """

    curve: Curve
    centre: Array
    nodes: int
    error: float
    crowding: float
    crowded_at: Array
    blur: float
    blurred_at: Array
    _disk: kernels.Disk = field(repr=False)

    def to_disk(self, points: ArrayLike) -> Array:
        """The images f (n, 2) in the unit disk of points (n, 2), m, inside the curve; outside f has no meaning.

        Raises `InputError`, naming the row, for a point that is not finite.
        """
        return kernels.to_disk(self._disk, checked_points(points))

    def to_angle(self, points: Array) -> Array:
        """The arguments of f (n,), rad, of points (n, 2), m, inside the curve."""
        return kernels.to_angle(self._disk, for_kernels(points))

    def surface(self, angles: Array) -> Array:
        """The curve's parameters u (n,) at boundary angles (n,), rad: the boundary correspondence, inverted."""
        return kernels.surface(self._disk, angles)

    def parameter(self, x: float, y: float) -> float:
        """The u at the argument of f at one point (m) inside, in one compiled call: `surface` of `to_angle`."""
        return kernels.parameter(self._disk, x, y)


def conformal_map(curve: Curve, *, nodes: int | None = None, centre: Sequence[float] | None = None) -> ConformalMap:
    """The conformal map of a closed curve's inside.

    The `nodes` on the boundary are doubled until densities change by less than a twentieth of themselves, or are as
    many as given (rounded down to a multiple of four on each piece). The `centre` (m) is the one singular point of the
    projection; without it, it is the conformal barycentre of the boundary's arc length, which moves with the shape
    wherever it is and however it is turned (see `conformal_solver`). Given numbers of nodes are used even where they
    resolve little; `error` and `blur` then show it.

    Raises `CrowdingError` where double precision is exhausted, `RefusalError` for outlines of more detail than 2560
    nodes resolve, and `InputError` for an unbounded curve, for a centre that is not inside, and for numbers of nodes
    that are no use.
    """
    if not curve.closed:
        raise InputError(f"curve '{curve.name}' is unbounded", why="its inside is a half-plane and not a disk")
    counts = _counts(curve, nodes)
    given = None if centre is None else _inside(curve, centre)
    start = _start(curve) if given is None else given
    coarse = system_of(curve, counts[0] // 2)
    for n in counts:
        fine = system_of(curve, n)
        found = balanced(fine, start) if given is None else correspondence(fine, given)
        best = _measured(curve, correspondence(coarse, found.centre), found)
        if best.error <= TOLERANCE:
            break
        coarse = fine
    resolved = best.error <= TOLERANCE
    xmin, ymin, xmax, ymax = curve.bounds
    if best.blur > BLUR_SHARE * max(xmax - xmin, ymax - ymin) and (resolved or nodes is None):
        raise CrowdingError(curve.name, best.crowding, best.blur, best.blurred_at)
    if not resolved and nodes is None:
        raise RefusalError(
            f"the conformal map of '{curve.name}' is not resolved by {best.nodes} boundary nodes",
            why=f"the last doubling changed boundary densities by {best.error:.2g} of themselves",
            todo="simplify the outline, or use the minimum-distance or constraint renderer",
        )
    return best


def _measured(curve: Curve, coarse: Correspondence, found: Correspondence) -> ConformalMap:
    """The map, with what there is to say of it; `coarse` is on half as many nodes."""
    angles, lengths = found.angles, found.lengths
    scale = float(np.max(np.abs(found.z)))
    parts = (found.z / scale, found.nodes.steps / scale, np.exp(1j * angles[:-1:FINE]))
    disk = kernels.Disk(
        np.ascontiguousarray(np.column_stack([part for values in parts for part in (values.real, values.imag)])),
        angles,
        found.slopes,
        for_kernels(curve.pieces),
        found.nodes.per_piece,
        FINE,
        float(found.centre[0]),
        float(found.centre[1]),
        scale,
    )
    turns = np.concatenate([angles[:-1] - 2.0 * np.pi, angles, angles[1:] + 2.0 * np.pi])
    along = np.concatenate([lengths[:-1] - curve.length, lengths, lengths[1:] + curve.length])
    cuts = curve.length * np.arange(ARCS + 1) / ARCS
    masses = np.diff(np.interp(cuts, along, turns))
    blurs = np.interp(angles + ROUNDING, turns, along) - np.interp(angles - ROUNDING, turns, along)
    thinnest, widest = int(np.argmin(masses)), int(np.argmax(blurs))
    middle, blurred = 0.5 * (cuts[thinnest] + cuts[thinnest + 1]), lengths[widest]
    return ConformalMap(
        curve=curve,
        centre=found.centre,
        nodes=found.z.size,
        error=change(coarse, found),
        crowding=float(np.max(masses) / max(masses[thinnest], ROUNDING)),
        crowded_at=curve.position(curve.parameter(middle)),
        blur=float(blurs[widest]),
        blurred_at=curve.position(curve.parameter(blurred)),
        _disk=disk,
    )


def _inside(curve: Curve, centre: Sequence[float]) -> Array:
    """The given centre (2,), m, which must be inside."""
    point = checked_points([centre], "centre")[0]
    if not curve.contains([point])[0]:
        raise InputError(f"centre ({point[0]:g}, {point[1]:g}) m is not inside curve '{curve.name}'")
    return np.asarray(point)


def _start(curve: Curve) -> Array:
    """A point (2,), m, well inside, to look for the centre from: the outline's centroid, or the deepest point."""
    from shapely import Polygon
    from shapely.ops import polylabel

    # about a point of the outline: far from the origin the search would stop at the rounding of coordinates
    outline = curve.outline(OUTLINE)
    polygon = Polygon(outline - outline[0])
    xmin, ymin, xmax, ymax = curve.bounds
    deepest = polylabel(polygon, 0.05 * min(xmax - xmin, ymax - ymin))
    found = outline[0] + np.array([[point.x, point.y] for point in (polygon.exterior.centroid, deepest)])
    depths = -curve.signed_distance(found)
    if depths[1] <= 0.0:
        raise RefusalError(
            f"the conformal map of '{curve.name}' has no centre to start from",
            why=f"the body is too thin for an outline of {OUTLINE} points",
            todo="simplify the outline, or use the minimum-distance or constraint renderer",
        )
    return np.asarray(found[0] if depths[0] > DEEP_ENOUGH * depths[1] else found[1])


def _counts(curve: Curve, nodes: int | None) -> list[int]:
    """Numbers of nodes to try, each twice the one before."""
    pieces, fewest = (1, SMOOTH) if smooth(curve) else (curve.pieces.shape[0], PIECE * curve.pieces.shape[0])
    if nodes is not None:
        count = int(nodes) // (4 * pieces) * (4 * pieces)
        if not 8 * pieces <= count <= 2 * MOST:
            raise InputError(
                f"nodes = {nodes!r} on the boundary of '{curve.name}'",
                why=f"there must be from {8 * pieces} to {2 * MOST}, the same on each of its {pieces} pieces",
            )
        return [count]
    if fewest > MOST:
        raise RefusalError(
            f"curve '{curve.name}' has {pieces} pieces",
            why=f"the conformal map takes at least {PIECE} boundary nodes on each, and at most {MOST} in all",
            todo="simplify the outline, or use the minimum-distance or constraint renderer",
        )
    return [fewest * 2**k for k in range(int(np.log2(MOST / fewest)) + 1)]
