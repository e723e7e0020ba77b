"""Whether the labels of two groups of curves matter: a permutation test over several columns at once.

If the renderers did not matter, their labels could be dealt anew among the repeats: the energy statistic, twice the
mean distance between the renderers less the mean distances within each, is compared with its values under all (or 9999
random) deals. That test is exact whatever the shape of the curves.

Several columns are looked at, and each look more is one more chance of a false alarm. So one deal serves all columns,
and each is compared with the largest statistic of any of them in that deal, as a share of its mean distance, which no
deal changes. The chance that any column is called different by luck is then the level itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, count

import numpy as np

from hapticeval.types import Array

LEVEL = 0.05  # at which a difference is called one: so often, at the most, where there is none
DEALS = 9999  # deals that are looked at where there are more; so p is never below one in one more of them
MIRROR_ROUNDING = 1e-12  # a deal that mirrors the observed one has its statistic, but for so much

Unit = tuple[int, int]
"""A repeat: of the first or the second renderer (0, 1), and its number."""


@dataclass(frozen=True)
class Distances:
    """Distances (k, k) of the repeats of two renderers in one column, and which repeats these are."""

    values: Array
    units: tuple[Unit, ...]

    @property
    def spread(self) -> float:
        """Root mean square distance between repeats of one renderer."""
        sides = np.array([side for side, _ in self.units])
        within = np.triu(sides[:, None] == sides[None, :], 1)
        return float(np.sqrt(np.mean(self.values[within] ** 2)))

    def energies(self, all_units: Sequence[Unit], deals: Array) -> Array:
        """The energy statistic of each deal of the names, as a share of the mean distance: deals (d, e) to (d,).

        A deal has 1 where that repeat of `all_units` goes to the first renderer, and 0 where it goes to the second. The
        share has no unit, so that columns in N, m and rad can be compared. The statistic is 0 where either renderer is
        dealt none of the repeats that are here.
        """
        mean, out = float(np.mean(self.values)), np.zeros(len(deals))
        first = deals[:, [all_units.index(unit) for unit in self.units]]
        both = (first.max(axis=1) > 0.0) & (first.min(axis=1) < 1.0)
        if mean == 0.0 or not both.any():
            return out
        a, b = first[both], 1.0 - first[both]
        n, m = a.sum(axis=1), b.sum(axis=1)
        # 2 E|a - b| - E|a - a'| - E|b - b'|, where a repeat's distance to itself, 0, counts within.
        near = a @ self.values
        between = np.sum(near * b, axis=1) / (n * m)
        within = np.sum(near * a, axis=1) / n**2 + np.sum((b @ self.values) * b, axis=1) / m**2
        out[both] = (2.0 * between - within) / mean
        return out


def least_p(first: int, second: int) -> float:
    """The least p that so many repeats of two renderers can give: they are dealt in `comb(first + second, first)` ways.

    Complete separation is one of these, and with as many of each the exchange of both names is another: 2 of 70 with
    4 and 4, 1 of 35 with 4 and 3.
    """
    deals = math.comb(first + second, first)
    if deals > DEALS:
        return 1.0 / (DEALS + 1)
    return (2.0 if first == second else 1.0) / deals


def needed(first: int, second: int, *, tests: int, level: float) -> tuple[int, int] | None:
    """The fewest repeats of two renderers with which a difference can be detected, not below `first` and `second`.

    So many `tests` share the `level`. The numbers are two at least and as even as can be; None where no number can,
    since p is never below that of the `DEALS`.
    """
    if tests / (DEALS + 1) >= level:
        return None
    first, second = max(first, 2), max(second, 2)
    for more in count():  # ends: with some fifteen repeats there are more ways than deals, and p is as small as it gets
        splits = [(first + k, second + more - k) for k in range(more + 1)]
        enough = [pair for pair in splits if tests * least_p(*pair) < level]
        if enough:
            return min(enough, key=lambda pair: (abs(pair[0] - pair[1]), pair[1]))
    return None


def permutation_p(columns: Mapping[str, Distances], *, seed: int) -> tuple[Mapping[str, float], float]:
    """p of each column against the largest statistic of any of them in each deal, and the least that p can be.

    Without columns there is nothing to deal, and the least p is 1.
    """
    all_units = sorted({unit for distances in columns.values() for unit in distances.units})
    if not all_units:
        return {}, 1.0
    size, first = len(all_units), sum(side == 0 for side, _ in all_units)
    deal_count = math.comb(size, first)
    exact = deal_count <= DEALS
    deals = np.zeros((deal_count if exact else DEALS, size))
    if exact:
        np.put_along_axis(deals, np.array(list(combinations(range(size), first))), 1.0, axis=1)
    else:
        deals[:, :first] = 1.0
        deals = np.random.default_rng(seed).permuted(deals, axis=1)
    observed = np.array([[float(side == 0) for side, _ in all_units]])
    # One deal serves all columns: their largest statistic guards against a false alarm in any of them.
    largest = np.max([distances.energies(all_units, deals) for distances in columns.values()], axis=0)
    p_values = {}
    for column, distances in columns.items():
        at_least_as_large = int(
            np.count_nonzero(largest >= (1.0 - MIRROR_ROUNDING) * float(distances.energies(all_units, observed)[0]))
        )
        # the observed deal is one of all, and is added to the random ones
        p_values[column] = at_least_as_large / deal_count if exact else (at_least_as_large + 1) / (DEALS + 1)
    return p_values, least_p(first, size - first)
