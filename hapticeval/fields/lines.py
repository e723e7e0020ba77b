"""Lines of constant projection: the HIPs that share an IHIP, for IHIPs in equal steps along the surface."""

from __future__ import annotations

import numpy as np

from hapticeval.fields.lattice import Lattice, apart
from hapticeval.fields.singular import Singular
from hapticeval.types import Array, BoolArray

FAR = 0.25
"""IHIPs further from the one that is asked for than this share of the surface are on its other side."""


def lines_of_constant_projection(lattice: Lattice, singular: Singular, *, count: int) -> list[Array]:
    """`count` IHIPs in equal steps of arc length, each with the lines (n, 2), m, of HIPs that are projected to it.

    A line never crosses the singular set. One that ends within a lattice step of its IHIP is drawn up to it.
    """
    length = lattice.surface.length
    levels = (np.arange(count) + 0.5) * length / count
    ends = lattice.surface.position(lattice.surface.parameter(levels))
    found: list[Array] = []
    for level, end in zip(levels, ends, strict=True):
        for line in _merged(_segments(lattice, singular, apart(lattice.s, float(level), length))):
            found.append(_drawn_out(line, end, 1.5 * lattice.h))
    return found


def _segments(lattice: Lattice, singular: Singular, way: Array) -> Array:
    """Where `way` (ny, nx) changes its sign: a piece (m, 2, 2) a cell, none over a jump or far round the surface."""
    far = FAR * lattice.surface.length
    nodes = lattice.nodes
    crossings = []
    for axis, jumps in ((1, singular.across), (0, singular.up)):
        first = (slice(None), slice(None, -1)) if axis == 1 else (slice(None, -1), slice(None))
        second = (slice(None), slice(1, None)) if axis == 1 else (slice(1, None), slice(None))
        a, b = way[first], way[second]
        with np.errstate(invalid="ignore"):
            met = ((a < 0.0) != (b < 0.0)) & (np.abs(a) < far) & (np.abs(b) < far) & ~jumps[first]
        place = np.full(nodes.shape, np.nan)
        share = (a[met] / (a[met] - b[met]))[:, None]
        view = place[first]
        view[met] = nodes[first][met] + share * (nodes[second][met] - nodes[first][met])
        crossings.append(place)
    across, up = crossings
    sides = np.stack([across[:-1, :-1], across[1:, :-1], up[:-1, :-1], up[:-1, 1:]], axis=2)
    met = ~np.isnan(sides[..., 0])
    count: BoolArray = met.sum(axis=2) == 2
    pieces: Array = sides[count][met[count]].reshape(-1, 2, 2)
    return pieces


def _merged(pieces: Array) -> list[Array]:
    """The pieces joined end to end."""
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
