"""Whether renderers differ by more than repeats of one renderer do (Figures 6.5 and 6.9).

What a hand does differs from run to run, so a difference between two renderers says nothing unless it is held against
the differences between repeats of one. The repeats are whole curves over the abscissa; the distance of two is the root
mean square of their difference where both have an answer. What is independent are repeats, not samples: see
`permutation` for the test. Over pairs of renderers and over the two directions, whose repeats may be different runs,
its p is multiplied by their number. A column in which no two repeats, of either renderer, differ by more than their
numbers resolve is the same to rounding, and not tested: see `resolution`. Where those of each renderer agree to
rounding but not with the other's, the test needs nothing more: any other deal of the names mixes them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.compare.align import COLUMNS, Aligned, Pass, Run
from hapticeval.recordings.compare.permutation import LEVEL, Distances, needed, permuted
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


COMMON = 0.05
"""Two curves must share this much of the grid for a distance, and two medians for a difference."""


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
    """Two renderers over what at least two `repeats` of each cover; `basis` says what these are, and `needed` how many
    of each it takes at the least to tell a difference among all that are compared (None: no number can).

    `difference` is the root mean square of the difference of their medians, `spread` that between repeats of one
    renderer, both in the column's unit; `p` of the permutation test over all columns, times the number of pairs and
    directions compared, and `least` the smallest that so many repeats can give. `worst` is the place (in the
    abscissa's unit) of the largest difference of the medians, `largest`. `rounding` is the largest difference of any
    two repeats, of either renderer, in what the numbers of both resolve at its place.
    """

    first: str
    second: str
    direction: int
    column: str
    repeats: tuple[int, int]
    needed: tuple[int, int] | None
    basis: str
    difference: float
    spread: float
    p: float
    least: float
    largest: float
    worst: float
    rounding: float
    common: float

    @property
    def times(self) -> float:
        """The difference in spreads."""
        return self.difference / self.spread if self.spread > 0.0 else math.inf

    @property
    def outcome(self) -> str:
        """ "differs", "the runs differ", "within the spread", "the same to rounding", "too few repeats to tell", or
        "too little in common".

        Laps of one run say how far the hand varies within it, and not whether another run of the same renderer would
        be as far off: all they can tell is that the runs differ.
        """
        if math.isnan(self.difference):
            return "too little in common"
        if self.rounding <= 1.0:
            return "the same to rounding"
        if self.p < LEVEL:
            return "differs" if self.basis == RUNS else "the runs differ"
        return "within the spread" if self.least < LEVEL else "too few repeats to tell"


def bands(aligned: Aligned) -> tuple[Band, ...]:
    """Median, lowest and highest of the repeats of each renderer, direction and column."""
    found = []
    for column, direction, repeats in groups(aligned):
        for renderer, made in repeats.items():
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
    most = dict.fromkeys(renderers, 1)
    met: set[tuple[int, str, str]] = set()
    for column, direction, made in groups(aligned):
        met |= {(direction, first, second) for first, second in combinations(made, 2)}
        kept = {renderer: each for renderer, each in made.items() if len(each.values) > 1}
        most |= {renderer: max(most[renderer], len(each.values)) for renderer, each in kept.items()}
        for first, second in combinations(kept, 2):
            families.setdefault((direction, first, second), {})[column] = kept[first], kept[second]
    found = [
        one
        for (direction, first, second), columns in families.items()
        for one in _compared(aligned, direction, first, second, columns, len(families), seed)
    ]
    for renderer in renderers:
        if most[renderer] == 1:
            raise _single(renderer, most, tests=max(len(met), 1))
    if all(math.isnan(each.difference) for each in found):
        raise InputError(
            "no two renderers were led over the same places in the same direction", why="nothing is common to compare"
        )
    return tuple(found)


def _single(renderer: str, most: Mapping[str, int], *, tests: int) -> InputError:
    """What is wrong with a renderer of a single repeat, and how many it takes beside the others'."""
    other = max((each for each in most if each != renderer), key=lambda each: most[each])
    enough = needed(1, most[other], tests=tests, level=LEVEL)
    what = f"'{renderer}' has a single repeat, '{other}' {most[other]}"
    if most[other] == 1:
        what = f"one repeat of '{renderer}' and one of '{other}' are too few to compare"
    return InputError(
        what,
        why="without repeats the hand's own variation is not known, and any difference could be the hand's",
        todo="compare fewer renderers at once"
        if enough is None
        else f"record more: to tell a difference takes {enough[0]} of '{renderer}' and {enough[1]} of '{other}' at the "
        "least",
    )


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
    distances = {column: _apart(*both) for column, both in columns.items()}
    roundings = {column: _rounding(*both) for column, both in columns.items()}
    known = {column for column, each in distances.items() if np.isfinite(each.values).all()}
    p, least = permuted(
        {each: distances[each] for each in columns if each in known and roundings[each] > 1.0}, seed=seed
    )
    for column, both in columns.items():
        medians = [_median(each.values, each.masks) for each in both]
        common = medians[0][1] & medians[1][1]
        share, basis = float(np.mean(common)), " and ".join(sorted({each.basis for each in both}))
        sizes = len(both[0].values), len(both[1].values)
        enough = needed(*sizes, tests=families, level=LEVEL)
        if share < COMMON or column not in known:
            nothing = (math.nan, math.nan, 1.0, 1.0, math.nan, math.nan, math.nan)
            yield Comparison(first, second, direction, column, sizes, enough, basis, *nothing, share)
            continue
        apart = np.where(common, medians[0][0] - medians[1][0], 0.0)
        worst = int(np.argmax(np.abs(apart)))
        yield Comparison(
            first,
            second,
            direction,
            column,
            sizes,
            enough,
            basis,
            float(np.sqrt(np.mean(apart[common] ** 2))),
            distances[column].spread,
            min(1.0, families * p.get(column, 1.0)),
            min(1.0, families * least),
            float(abs(apart[worst])),
            float(aligned.grid[worst]),
            roundings[column],
            share,
        )


def _apart(one: Repeats, other: Repeats) -> Distances:
    """The distances of the repeats of two renderers, each of theirs from every other."""
    values = _distances(np.vstack([one.values, other.values]), np.vstack([one.masks, other.masks]))
    units = tuple((side, int(unit)) for side, each in enumerate((one, other)) for unit in each.units)
    return Distances(values, units)


def _rounding(one: Repeats, other: Repeats) -> float:
    """The largest difference of any two repeats where both have an answer, in what their numbers resolve there."""
    values, masks = np.vstack([one.values, other.values]), np.vstack([one.masks, other.masks])
    grains = np.vstack([one.grains, other.grains])
    largest = 0.0
    for i, j in combinations(range(len(values)), 2):
        both = masks[i] & masks[j] & (values[i] != values[j])
        if both.any():
            with np.errstate(divide="ignore"):
                shares = np.abs(values[i, both] - values[j, both]) / (grains[i, both] + grains[j, both])
            largest = max(largest, float(shares.max()))
    return largest


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
