"""Whether renderers differ by more than repeats of one renderer do (Figures 6.5 and 6.9).

What a hand does differs from run to run, so a difference between two renderers says nothing unless it is held against
the differences between repeats of one. The repeats are whole curves over the abscissa; the distance of two is the root
mean square of their difference where both have an answer. What is independent are repeats, not samples: see
`permutation` for the test. Over pairs of renderers and over the two directions, whose repeats may be different runs,
its p is multiplied by their number.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.alignment import COLUMNS, Aligned, Pass, Run
from hapticeval.recordings.permutation import Distances, permuted
from hapticeval.types import Array, BoolArray, IntArray

LEVEL = 0.05
COMMON = 0.05
"""Two curves must share this much of the grid for a distance, and two medians for a difference."""
HALF = 0.5
"""A repeat covers at least this share of what the fullest one does: the end of a last lap is none."""
RUNS, LAPS = "runs", "laps of one run"
COMPARED = ("direction", "leaning", "magnitude", "depth")


@dataclass(frozen=True)
class Band:
    """Repeats of one renderer: median, lowest and highest (m,) where `count` (m,) of them is not zero, else 0."""

    renderer: str
    direction: int
    column: str
    median: Array
    low: Array
    high: Array
    count: IntArray


@dataclass(frozen=True)
class Comparison:
    """Two renderers over what at least two `repeats` of each cover; `basis` says what these are.

    `difference` is the root mean square of the difference of their medians, `spread` that between repeats of one
    renderer, both in the column's unit; `p` of the permutation test over all columns, times the number of pairs and
    directions compared, and `least` the smallest that so many repeats can give. `worst` is the place (in the
    abscissa's unit) of the largest difference of the medians, `largest`.
    """

    first: str
    second: str
    direction: int
    column: str
    repeats: tuple[int, int]
    basis: str
    difference: float
    spread: float
    p: float
    least: float
    largest: float
    worst: float
    common: float

    @property
    def times(self) -> float:
        """The difference in spreads."""
        return self.difference / self.spread if self.spread > 0.0 else math.inf

    @property
    def outcome(self) -> str:
        """ "differs", "the runs differ", "within the spread", "too few repeats to tell", or "too little in common".

        Laps of one run say how far the hand varies within it, and not whether another run of the same renderer would
        be as far off: all they can tell is that the runs differ.
        """
        if math.isnan(self.difference):
            return "too little in common"
        if self.p < LEVEL:
            return "differs" if self.basis == RUNS else "the runs differ"
        return "within the spread" if self.least < LEVEL else "too few repeats to tell"


@dataclass(frozen=True)
class Repeats:
    """The repeats of one renderer in one column and direction: `values` and `masks` (k, m), and what they are.

    `units` (k,) number them: the same run, or lap of a single run, has the same number in every column.
    """

    values: Array
    masks: BoolArray
    units: IntArray
    basis: str


def repeats(passes: Sequence[Pass], column: str, reference: Array) -> Repeats:
    """What counts as repeats: the runs, at each place with the mean of their laps; of a single run, its laps.

    Laps of one run are by one hand in one mood, and no repeats of their own where there are several runs. `reference`
    (m,) is the branch that angles are taken on.
    """
    values = np.array([_branch(each.columns[column], reference, column) for each in passes])
    masks = np.array([each.mask for each in passes])
    runs = np.array([each.run for each in passes])
    several = np.unique(runs)
    if several.size == 1:
        return _full(values, masks, np.array([each.lap for each in passes]), LAPS)
    counts = np.array([masks[runs == run].sum(axis=0) for run in several])
    sums = np.array([np.where(masks[runs == run], values[runs == run], 0.0).sum(axis=0) for run in several])
    return _full(sums / np.maximum(counts, 1), counts > 0, several, RUNS)


def _full(values: Array, masks: BoolArray, units: IntArray, basis: str) -> Repeats:
    coverage = masks.mean(axis=1)
    kept = coverage >= HALF * coverage.max()
    return Repeats(values[kept], masks[kept], units[kept], basis)


def bands(aligned: Aligned) -> tuple[Band, ...]:
    """Median, lowest and highest of the repeats of each renderer, direction and column."""
    found = []
    for column, direction, groups in _groups(aligned):
        reference = _reference(column, [one for each in groups.values() for one in each])
        for renderer, passes in groups.items():
            made = repeats(passes, column, reference)
            filled = np.where(made.masks, made.values, np.nan)
            count = made.masks.sum(axis=0)
            seen = count > 0
            median, low, high = (np.zeros(count.size) for _ in range(3))
            median[seen] = np.nanmedian(filled[:, seen], axis=0)
            low[seen] = np.nanmin(filled[:, seen], axis=0)
            high[seen] = np.nanmax(filled[:, seen], axis=0)
            found.append(Band(renderer, direction, column, median, low, high, count))
    return tuple(found)


def compare(aligned: Aligned, *, seed: int = 0) -> tuple[Comparison, ...]:
    """Every two renderers, in each direction and column, against the spread between repeats.

    A direction in which a renderer has a single repeat is left out for it. Raises `InputError`, naming it, for a
    renderer that has no more in any: nothing says what of it is the hand's; and for a run that is given twice.
    """
    renderers = list(dict.fromkeys(run.renderer for run in aligned.runs))
    if len(renderers) < 2:
        raise InputError(
            f"all runs are of '{renderers[0]}'", why="a comparison takes two renderers", todo="name runs of another one"
        )
    for renderer in renderers:
        _refuse_copies([run for run in aligned.runs if run.renderer == renderer])
    families: dict[tuple[int, str, str], dict[str, tuple[Repeats, Repeats]]] = {}
    repeated: set[str] = set()
    for column, direction, groups in _groups(aligned):
        reference = _reference(column, [one for each in groups.values() for one in each])
        made = {renderer: repeats(passes, column, reference) for renderer, passes in groups.items()}
        kept = {renderer: each for renderer, each in made.items() if len(each.values) > 1}
        repeated |= set(kept)
        for first, second in combinations(kept, 2):
            families.setdefault((direction, first, second), {})[column] = kept[first], kept[second]
    found = [
        one
        for (direction, first, second), columns in families.items()
        for one in _compared(aligned, direction, first, second, columns, len(families), seed)
    ]
    for renderer in renderers:
        if renderer not in repeated:
            raise InputError(
                f"'{renderer}' has a single repeat",
                why="without repeats the hand's own variation is not known, and any difference could be the hand's",
                todo="record it again, as often as you can: with fewer than four repeats each no test can decide",
            )
    if all(math.isnan(each.difference) for each in found):
        raise InputError(
            "no two renderers were led over the same places in the same direction", why="nothing is common to compare"
        )
    return tuple(found)


def _refuse_copies(runs: Sequence[Run]) -> None:
    """A run that is given twice would be a repeat without any spread."""
    seen: dict[bytes, Run] = {}
    for run in runs:
        same = seen.setdefault(run.recording.hip.tobytes() + run.recording.force.tobytes(), run)
        if same is not run:
            raise InputError(
                f"{same.label} and {run.label} are the same run",
                why="a hand never moves the same way twice, and a copy says nothing of how it varies",
                todo="name each run once",
            )


def _groups(aligned: Aligned) -> Iterator[tuple[str, int, dict[str, tuple[Pass, ...]]]]:
    """Column, direction, and the passes of each renderer that has it."""
    for direction in (1, -1):
        for column in COMPARED:
            groups = {}
            for renderer in dict.fromkeys(run.renderer for run in aligned.runs):
                passes = tuple(each for each in aligned.of(renderer, direction) if column in each.columns)
                if passes:
                    groups[renderer] = passes
            if groups:
                yield column, direction, groups


def _compared(
    aligned: Aligned,
    direction: int,
    first: str,
    second: str,
    columns: Mapping[str, tuple[Repeats, Repeats]],
    families: int,
    seed: int,
) -> Iterator[Comparison]:
    """Two renderers in one direction, in every column that both have."""
    distances = {column: _apart(*groups) for column, groups in columns.items()}
    testable = {column: each for column, each in distances.items() if np.isfinite(each.values).all()}
    p, least = permuted(testable, seed=seed)
    for column, groups in columns.items():
        medians = [_median(each.values, each.masks) for each in groups]
        common = medians[0][1] & medians[1][1]
        share, basis = float(np.mean(common)), " and ".join(sorted({each.basis for each in groups}))
        sizes = len(groups[0].values), len(groups[1].values)
        if share < COMMON or column not in testable:
            nothing = (math.nan, math.nan, 1.0, 1.0, math.nan, math.nan)
            yield Comparison(first, second, direction, column, sizes, basis, *nothing, share)
            continue
        apart = np.where(common, medians[0][0] - medians[1][0], 0.0)
        worst = int(np.argmax(np.abs(apart)))
        yield Comparison(
            first,
            second,
            direction,
            column,
            sizes,
            basis,
            float(np.sqrt(np.mean(apart[common] ** 2))),
            distances[column].spread,
            min(1.0, families * p[column]),
            min(1.0, families * least),
            float(abs(apart[worst])),
            float(aligned.grid[worst]),
            share,
        )


def _apart(one: Repeats, other: Repeats) -> Distances:
    """The distances of the repeats of two renderers, each of theirs from every other."""
    values = _distances(np.vstack([one.values, other.values]), np.vstack([one.masks, other.masks]))
    units = tuple((side, int(unit)) for side, each in enumerate((one, other)) for unit in each.units)
    return Distances(values, units)


def _distances(values: Array, masks: BoolArray) -> Array:
    """Root mean square difference of every two curves where both have an answer; NaN where that is too little."""
    count = values.shape[0]
    out = np.zeros((count, count))
    for i, j in combinations(range(count), 2):
        both = masks[i] & masks[j]
        enough = np.mean(both) >= COMMON
        apart = np.sqrt(np.mean((values[i, both] - values[j, both]) ** 2)) if enough else np.nan
        out[i, j] = out[j, i] = apart
    return out


def _median(values: Array, masks: BoolArray) -> tuple[Array, BoolArray]:
    """The median where at least two curves have an answer, and where that is."""
    seen = masks.sum(axis=0) >= 2
    out = np.zeros(seen.size)
    out[seen] = np.nanmedian(np.where(masks, values, np.nan)[:, seen], axis=0)
    return out, seen


def _reference(column: str, passes: Sequence[Pass]) -> Array:
    """The branch of an angle at each place: that of the mean direction over all passes, unwrapped along the way."""
    size = passes[0].mask.size
    if COLUMNS[column][0] != "rad":
        return np.zeros(size)
    turning = np.zeros(size, dtype=np.complex128)
    for each in passes:
        turning += np.where(each.mask, np.exp(1j * each.columns[column]), 0.0)
    seen = np.abs(turning) > 0.0
    out = np.zeros(size)
    out[seen] = np.unwrap(np.angle(turning[seen]))
    return out


def _branch(values: Array, reference: Array, column: str) -> Array:
    if COLUMNS[column][0] != "rad":
        return values
    return np.asarray(values - 2.0 * math.pi * np.round((values - reference) / (2.0 * math.pi)))
