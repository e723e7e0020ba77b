"""A hierarchical look-up table (thesis 6.2): a quadtree that is only as fine as a stated error needs it to be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hapticeval.errors import InputError
from hapticeval.renderers.lut_build import Source, curve_of, source_of
from hapticeval.renderers.lut_kernels import FREE
from hapticeval.renderers.lut_tree_kernels import descend, descend_many
from hapticeval.renderers.lut_tree_split import Level, split_levels
from hapticeval.renderers.projection import Projection
from hapticeval.types import Array, ByteArray, IntArray

DEEPEST = 12
"""Levels at the most: 4096 of the smallest leaves along a side."""


@dataclass(frozen=True, eq=False)
class Tree:
    """Leaves of side `smallest` (m) times a power of two over a square from `origin` (m), `levels` deep.

    `links` (k,): what is below each node of the tree, from the root on: the first of its four children, or -1 for free
    space, or -2 - n for leaf n. `corners` (n, 4) are the leaves' rows in `nodes` (m, 4), IHIP and normal, shared
    between leaves; `kinds` (n,) as in `lut_kernels`. `error` (m) bounds the distance between interpolated and exact
    IHIP in leaves that are not marked, and so the distance off the surface too. Between leaves of two sizes the IHIP
    may jump by twice that.
    """

    origin: Array
    smallest: float
    levels: int
    links: IntArray
    corners: IntArray
    kinds: ByteArray
    nodes: Array
    error: float
    everywhere: bool

    @property
    def standoff(self) -> float:
        """The largest distance (m) off the surface of an interpolated IHIP: at most the error."""
        return self.error

    @property
    def nbytes(self) -> int:
        """The memory that all its arrays take."""
        return sum(array.nbytes for array in (self.links, self.corners, self.kinds, self.nodes))

    def look(self, x: float, y: float, *, ask: bool) -> tuple[int, float, float, float, float]:
        """One HIP (m): (status, IHIP x, y, normal x, y), as a dense table answers."""
        return descend(*self._arrays, self.levels, self.everywhere, ask, x, y)

    def look_many(self, hips: Array, *, ask: bool) -> tuple[Array, Array, ByteArray]:
        """`look` for each row of hips (n, 2): IHIPs, normals, status."""
        return descend_many(*self._arrays, self.levels, self.everywhere, ask, hips)

    @cached_property
    def _arrays(self) -> tuple[IntArray, IntArray, ByteArray, Array, Array]:
        frame = np.array([*self.origin, 1.0 / self.smallest])
        for array in (self.links, self.corners, self.kinds, self.nodes, frame):
            array.flags.writeable = False
        return self.links, self.corners, self.kinds, self.nodes, frame


def grow(projection: Projection, *, error: float, smallest: float, everywhere: bool = False) -> Tree:
    """The tree of a bilateral projection over its surface: leaves split while the IHIP errs by more than `error` (m).

    A leaf of side `smallest` (m) that still does is marked. With `everywhere` it answers in contact throughout, else
    where the HIP is inside. Raises `InputError` for an error or a side that is not positive, or a side so small that
    the tree would be more than `DEEPEST` levels deep.
    """
    xmin, ymin, xmax, ymax = curve_of(projection).bounds
    extent = max(xmax - xmin, ymax - ymin)
    if not (0.0 < error < extent and 2.0 * extent / 2.0**DEEPEST < smallest < extent):
        raise InputError(
            f"a hierarchical table with an error of {error!r} m and leaves down to {smallest!r} m",
            why=f"both must be positive, and the leaves between {2.0 * extent / 2.0**DEEPEST:.3g} and {extent:.3g} m",
        )
    levels = int(np.ceil(np.log2(extent / smallest + 2.0)))
    middle = np.array([0.5 * (xmin + xmax), 0.5 * (ymin + ymax)])
    origin = middle - 0.5 * smallest * 2.0**levels
    source = source_of(projection)
    made = split_levels(source, origin, smallest, levels, error, everywhere)
    return _joined(made, source, origin, smallest, error, everywhere)


def _joined(made: list[Level], source: Source, origin: Array, smallest: float, error: float, everywhere: bool) -> Tree:
    """Number the nodes level by level, four children in a row, and share the leaves' corners."""
    deepest = len(made) - 1
    across, up = np.zeros(1, np.int64), np.zeros(1, np.int64)
    links, kinds, corners = [], [], []
    leaves, below = 0, 1
    for depth, level in enumerate(made):
        split, kind = level.split[up, across], level.kinds[up, across]
        held = ~split & (kind != FREE)
        link = np.full(across.size, -1, np.int32)
        link[split] = below + 4 * np.arange(np.count_nonzero(split))
        link[held] = -2 - leaves - np.arange(np.count_nonzero(held))
        links.append(link)
        kinds.append(kind[held])
        side = 1 << (deepest - depth)
        x, y = across[held] * side, up[held] * side
        corners.append(np.stack([[x, y], [x + side, y], [x, y + side], [x + side, y + side]]).transpose(2, 0, 1))
        leaves += int(np.count_nonzero(held))
        across = (2 * across[split][:, np.newaxis] + (0, 1, 0, 1)).ravel()
        up = (2 * up[split][:, np.newaxis] + (0, 0, 1, 1)).ravel()
        below += across.size
    lattice, rows = np.unique(np.concatenate(corners).reshape(-1, 2), axis=0, return_inverse=True)
    nodes = np.hstack(source.project(origin + smallest * lattice))
    return Tree(
        origin,
        smallest,
        deepest,
        np.concatenate(links),
        rows.reshape(-1, 4).astype(np.int32),
        np.concatenate(kinds),
        nodes,
        error,
        everywhere,
    )
