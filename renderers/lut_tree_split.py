"""Where a hierarchical look-up table is split: the error of the bilinear interpolant, probed, and 2:1 grading.

A square is split while the interpolant of its corners is further than `SHARE` of the stated error from the projection
at any of 5 x 5 points of it, or two of its normals are more than a right angle apart. Between the points the error of
a smooth projection is hardly larger. A discontinuity could hide between them, but not far from others of its kind: the
squares that it crosses visibly are split down to the smallest, and no square is more than twice as large as its
neighbours. An end of it that reaches unseen into the next square is then shorter than half of the smallest one's side.
One that is connected to none that is seen is not found.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from hapticeval.renderers.lut_build import Source
from hapticeval.renderers.lut_kernels import EDGE, FREE, HELD, MARKED
from hapticeval.types import Array, BoolArray, ByteArray, IntArray

SHARE = 0.95
PROBES = np.array(list(itertools.product(np.linspace(0.0, 1.0, 5), repeat=2)))[:, ::-1]
WEIGHTS = np.stack([(1.0 - PROBES).prod(axis=1), PROBES[:, 0] * (1.0 - PROBES[:, 1]),
                    (1.0 - PROBES[:, 0]) * PROBES[:, 1], PROBES.prod(axis=1)], axis=1)  # fmt: skip
CORNERS = (0, 4, 20, 24)
"""Rows of `PROBES` that are the corners, in the order of `WEIGHTS`."""

BATCH = 20_000
"""Squares that are probed at a time."""


@dataclass(frozen=True, eq=False)
class Level:
    """The squares of one size, (2^level, 2^level) by row and column: what is split, how it is read, what is known."""

    split: BoolArray
    kinds: ByteArray
    known: BoolArray


def split_levels(
    source: Source, origin: Array, smallest: float, levels: int, error: float, everywhere: bool
) -> list[Level]:
    """The levels from the one square of side `smallest` * 2^levels (m) down to the smallest."""
    made = []
    for depth in range(levels + 1):
        shape = (2**depth, 2**depth)
        made.append(Level(np.zeros(shape, bool), np.zeros(shape, np.uint8), np.zeros(shape, bool)))
    grown = True
    while grown:
        grown = False
        there = np.ones((1, 1), bool)
        for depth, level in enumerate(made):
            up, across = np.nonzero(there & ~level.known)
            grown |= up.size > 0
            side = smallest * 2.0 ** (levels - depth)
            for start in range(0, up.size, BATCH):
                rows, columns = up[start : start + BATCH], across[start : start + BATCH]
                kinds, amiss = _probed(source, origin, side, columns, rows, SHARE * error, everywhere)
                if depth == levels:
                    kinds = kinds + np.uint8(MARKED) * amiss
                else:
                    level.split[rows, columns] |= amiss
                level.kinds[rows, columns], level.known[rows, columns] = kinds, True
            there = np.repeat(np.repeat(there & level.split, 2, axis=0), 2, axis=1)
        _grade(made)
    return made


def _probed(
    source: Source, origin: Array, side: float, across: IntArray, up: IntArray, limit: float, everywhere: bool
) -> tuple[ByteArray, BoolArray]:
    """Of squares by column and row: how they are read, and whether the interpolant errs by more than the limit."""
    corner = origin + side * np.column_stack([across, up])
    kinds, amiss = np.full(up.size, HELD, np.uint8), np.zeros(up.size, bool)
    if not everywhere:
        distance = source.distance(corner + 0.5 * side)
        kinds[distance > 0.0] = FREE
        kinds[np.abs(distance) <= 0.5 * side * 2.0**0.5 + source.stray] = EDGE
    held = kinds != FREE
    # The corners are to the last bit the nodes that will be kept: on a medial axis one bit decides for a side.
    points = origin + side * (np.column_stack([across, up])[held][:, np.newaxis] + PROBES)
    ihips, normals = (part.reshape(-1, PROBES.shape[0], 2) for part in source.project(points.reshape(-1, 2)))
    means = np.einsum("pc,kcd->kpd", WEIGHTS, ihips[:, CORNERS, :])
    apart = np.einsum("kcd,ked->kce", normals[:, CORNERS], normals[:, CORNERS]).min(axis=(1, 2), initial=1.0) < 0.0
    amiss[held] = apart | (np.hypot(*(means - ihips).transpose(2, 0, 1)).max(axis=1, initial=0.0) > limit)
    return kinds, amiss


def _grade(made: list[Level]) -> None:
    """Split what is more than twice as large as a neighbour; free space has nothing to split."""
    for finer, coarser in zip(made[-2:0:-1], made[-3::-1], strict=True):
        padded = np.pad(finer.split, 1)
        count = finer.split.shape[0]
        near = np.zeros_like(finer.split)
        for i, j in itertools.product(range(3), repeat=2):
            near |= padded[i : i + count, j : j + count]
        parents = near.reshape(count // 2, 2, count // 2, 2).any(axis=(1, 3))
        coarser.split[parents & ~(coarser.known & (coarser.kinds == FREE))] = True
