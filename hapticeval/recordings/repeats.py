"""The repeats of a renderer: whole curves over the abscissa, angles on one branch."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hapticeval.recordings.alignment import COLUMNS, Aligned, Pass
from hapticeval.types import Array, BoolArray, IntArray

HALF = 0.5
"""A repeat covers at least this share of what the fullest one does: the end of a last lap is none."""
RUNS, LAPS = "runs", "laps of one run"
COMPARED = ("direction", "leaning", "magnitude", "depth")
TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Repeats:
    """The repeats of one renderer in one column and direction: `values` and `masks` (k, m), and what they are.

    `grains` (k, m) are what the numbers resolve there, see `resolution`. `units` (k,) number the repeats: the same run,
    or lap of a single run, has the same number in every column.
    """

    values: Array
    masks: BoolArray
    grains: Array
    units: IntArray
    basis: str


def groups(aligned: Aligned) -> Iterator[tuple[str, int, Mapping[str, Repeats]]]:
    """Column, direction, and the repeats of each renderer that has it.

    The angles of a column are on one branch: over all renderers at each place, and between the two directions by the
    median of their difference over the places that both have.
    """
    branches: dict[str, tuple[Array, BoolArray]] = {}
    for direction in (1, -1):
        for column in COMPARED:
            found = {}
            for renderer in dict.fromkeys(run.renderer for run in aligned.runs):
                passes = tuple(each for each in aligned.of(renderer, direction) if column in each.columns)
                if passes:
                    found[renderer] = passes
            if not found:
                continue
            reference, seen = _reference(column, [one for each in found.values() for one in each])
            if column in branches and COLUMNS[column][0] == "rad":
                reference = reference + _turns(*branches[column], reference, seen)
            branches.setdefault(column, (reference, seen))
            yield column, direction, {name: _repeats(each, column, reference) for name, each in found.items()}


def _turns(one: Array, one_seen: BoolArray, other: Array, other_seen: BoolArray) -> float:
    """What whole turns, rad, bring `other` onto the branch of `one`."""
    both = one_seen & other_seen
    apart = np.median((one - other)[both]) if both.any() else np.median(one[one_seen]) - np.median(other[other_seen])
    return TURN * round(float(apart) / TURN)


def _reference(column: str, passes: Sequence[Pass]) -> tuple[Array, BoolArray]:
    """The branch of an angle at each place, (m,): that of the mean direction over all passes, unwrapped along the way;
    and where any of them is, (m,)."""
    size = passes[0].mask.size
    seen = np.any([each.mask for each in passes], axis=0)
    out = np.zeros(size)
    if COLUMNS[column][0] != "rad":
        return out, seen
    turning = np.zeros(size, dtype=np.complex128)
    for each in passes:
        turning += np.where(each.mask, np.exp(1j * each.columns[column]), 0.0)
    out[seen] = np.unwrap(np.angle(turning[seen]))
    return out, seen


def _repeats(passes: Sequence[Pass], column: str, reference: Array) -> Repeats:
    """What counts as repeats: the runs, at each place with the mean of their laps; of a single run, its laps.

    Laps of one run are by one hand in one mood, and no repeats of their own where there are several runs. `reference`
    (m,) is the branch that angles are taken on.
    """
    values = np.array([_branch(each.columns[column], reference, column) for each in passes])
    masks = np.array([each.mask for each in passes])
    grains = np.array([each.grains[column] for each in passes])
    runs = np.array([each.run for each in passes])
    several = np.unique(runs)
    if several.size == 1:
        return _full(values, masks, grains, np.array([each.lap for each in passes]), LAPS)
    counts = np.array([masks[runs == run].sum(axis=0) for run in several])
    sums = np.array([np.where(masks[runs == run], values[runs == run], 0.0).sum(axis=0) for run in several])
    coarsest = np.array([grains[runs == run].max(axis=0) for run in several])
    return _full(sums / np.maximum(counts, 1), counts > 0, coarsest, several, RUNS)


def _full(values: Array, masks: BoolArray, grains: Array, units: IntArray, basis: str) -> Repeats:
    coverage = masks.mean(axis=1)
    kept = coverage >= HALF * coverage.max()
    return Repeats(values[kept], masks[kept], grains[kept], units[kept], basis)


def _branch(values: Array, reference: Array, column: str) -> Array:
    if COLUMNS[column][0] != "rad":
        return values
    return np.asarray(values - TURN * np.round((values - reference) / TURN))
