"""Where a projection jumps: lines across which neighbouring HIPs have IHIPs that stay apart, and single points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.fields.lattice import Lattice, Project, apart, arc_lengths
from hapticeval.types import Array, BoolArray

SHORT = 5e-4
"""The shortest jump that counts, as a share of the model's size: 0.1 mm of 200 mm."""

STRETCH = 1.2
"""Neighbours whose IHIPs are further apart than this many lattice steps are looked at closer."""

HALVINGS = 10
STAYS = 0.15
"""As in `continuous-contact`: a jump's logarithm falls by less than this a halving, a continuous map's by more."""


@dataclass(frozen=True, eq=False)
class Singular:
    """The set where a projection is not continuous.

    `segments` (m, 2, 2), m, are the lines, a piece a lattice cell; `points` (k, 2), m, single points round which the
    IHIP goes once round the surface; `jumps` (n,), m, the jump at each place where a lattice line meets the set.
    `across` and `up` (ny, nx) tell the lattice edges to the right of and above each node that meet it.
    """

    segments: Array
    points: Array
    jumps: Array
    across: BoolArray
    up: BoolArray


def singular_set(project: Project, lattice: Lattice) -> Singular:
    """Find the lines by bisecting lattice edges, and the points by going round lattice cells.

    Jumps shorter than a lattice step may be missed where the projection is not steep beside them.
    """
    places = []
    jumps = []
    for axis in (1, 0):
        place, jump = _on_edges(project, lattice, axis)
        places.append(place)
        jumps.append(jump)
    across, up = (~np.isnan(place[..., 0]) for place in places)
    return Singular(
        segments=_segments(*places),
        points=_points(project, lattice, across, up),
        jumps=np.concatenate(jumps),
        across=across,
        up=up,
    )


def _on_edges(project: Project, lattice: Lattice, axis: int) -> tuple[Array, Array]:
    """Where each edge along an axis meets the set, NaN where it does not: (ny, nx, 2), m; and the jumps there."""
    place = np.full((*lattice.held.shape, 2), np.nan)
    first = (slice(None), slice(None, -1)) if axis == 1 else (slice(None, -1), slice(None))
    second = (slice(None), slice(1, None)) if axis == 1 else (slice(1, None), slice(None))
    both = lattice.held[first] & lattice.held[second]
    leap = np.linalg.norm(lattice.ihip[second] - lattice.ihip[first], axis=-1)
    suspect = both & (leap > max(SHORT * lattice.size, STRETCH * lattice.h))
    nodes = lattice.nodes
    a, b = nodes[first][suspect], nodes[second][suspect]
    found, jump = jumps_between(project, a, b, lattice.ihip[first][suspect], lattice.ihip[second][suspect])
    real = jump > SHORT * lattice.size
    rows, columns = np.nonzero(suspect)
    place[rows[real], columns[real]] = found[real]
    return place, jump[real]


def jumps_between(project: Project, a: Array, b: Array, at_a: Array, at_b: Array) -> tuple[Array, Array]:
    """Halve segments from a to b (n, 2) twenty times, each time keeping the half with the larger IHIP step.

    Returns where they end, (n, 2), and the jump that stays there, (n,), m: zero where it shrinks as the step does.
    """
    if a.shape[0] == 0:
        return a, np.zeros(0)
    free = np.zeros(a.shape[0], dtype=bool)
    sizes = []
    for halving in range(2 * HALVINGS):
        middle = 0.5 * (a + b)
        at_middle = project(middle)
        free |= np.all(at_middle == middle, axis=1)
        left = np.linalg.norm(at_middle - at_a, axis=1)
        right = np.linalg.norm(at_b - at_middle, axis=1)
        in_left = left >= right
        a, at_a = np.where(in_left[:, None], a, middle), np.where(in_left[:, None], at_a, at_middle)
        b, at_b = np.where(in_left[:, None], middle, b), np.where(in_left[:, None], at_middle, at_b)
        if halving + 1 in (HALVINGS, 2 * HALVINGS):
            sizes.append(np.maximum(np.maximum(left, right), 1e-300))
    slope = np.log2(sizes[0] / sizes[1]) / HALVINGS
    return 0.5 * (a + b), np.where((slope < STAYS) & ~free, sizes[1], 0.0)


def _segments(across: Array, up: Array) -> Array:
    """The pieces of line in each cell: between its two crossings, or from each of more to their middle."""
    sides = np.stack([across[:-1, :-1], across[1:, :-1], up[:-1, :-1], up[:-1, 1:]], axis=2)
    met = ~np.isnan(sides[..., 0])
    count = met.sum(axis=2)
    two = count == 2
    pairs = sides[two][met[two]].reshape(-1, 2, 2)
    stars = []
    for cell, which in zip(sides[count > 2], met[count > 2], strict=True):
        ends = cell[which]
        stars += [np.stack([end, ends.mean(axis=0)]) for end in ends]
    return np.concatenate([pairs, np.reshape(stars, (-1, 2, 2))])


def _points(project: Project, lattice: Lattice, across: BoolArray, up: BoolArray) -> Array:
    """Cells without a line round which the IHIP goes once round the surface, each narrowed down to a point."""
    s, length = lattice.s, lattice.surface.length
    corners = [s[:-1, :-1], s[:-1, 1:], s[1:, 1:], s[1:, :-1]]
    whole = ~np.isnan(sum(corners)) & ~(across[:-1, :-1] | across[1:, :-1] | up[:-1, :-1] | up[:-1, 1:])
    turns = np.where(whole, _turns(corners, length), 0)
    found = [
        _narrowed(project, lattice, np.array([lattice.x[i], lattice.y[j]]))
        for j, i in zip(*np.nonzero(turns), strict=True)
    ]
    return np.reshape(found, (-1, 2))


def _turns(corners: list[Array], length: float) -> Array:
    """How often arc lengths at a cell's corners go round the surface on the way round the cell."""
    ways = [apart(corners[(k + 1) % 4], corners[k], length) for k in range(4)]
    return np.rint(np.nan_to_num(sum(ways)) / length)


def _narrowed(project: Project, lattice: Lattice, low: Array) -> Array:
    """Quarter a cell with lower left corner `low` (2,) again and again, keeping the quarter with the point in it."""
    size = lattice.h
    for _ in range(30):
        shares = np.array([[i, j] for j in range(3) for i in range(3)]) / 2.0
        s = arc_lengths(lattice.surface, project(low + size * shares)).reshape(3, 3)
        corners = [s[:-1, :-1], s[:-1, 1:], s[1:, 1:], s[1:, :-1]]
        rows, columns = np.nonzero(_turns(corners, lattice.surface.length))
        if rows.size == 0:
            break
        low = low + 0.5 * size * np.array([columns[0], rows[0]])
        size *= 0.5
    middle: Array = low + 0.5 * size
    return middle
