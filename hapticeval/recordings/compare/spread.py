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
from typing import NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.compare.align import COLUMNS, TURN, Aligned, Pass, Run
from hapticeval.recordings.compare.permutation import LEVEL, Distances, needed, permuted
from hapticeval.types import Array, BoolArray, IntArray

HALF = 0.5  # a repeat covers at least this share of what the fullest one does: the end of a last lap is none
COMMON = 0.05  # two curves must share this much of the grid for a distance, and two medians for a difference
RUNS, LAPS = "runs", "laps of one run"
COMPARED = ("direction", "leaning", "magnitude", "depth")


class Repeats(NamedTuple):
    """The repeats of one renderer in one column and direction: `values` and `masks` (k, m), and what they are.

    `grains` (k, m) are what the numbers resolve there, see `resolution`. `units` (k,) number the repeats: the same run,
    or lap of a single run, has the same number in every column.
    """

    values: Array
    masks: BoolArray
    grains: Array
    units: IntArray
    basis: str

    def median(self, at_least: int = 1) -> tuple[Array, BoolArray]:
        """Return the median where so many repeats have an answer, else 0, and where that is, (m,) each."""
        seen = self.masks.sum(axis=0) >= at_least
        out = np.zeros(seen.size)
        out[seen] = np.nanmedian(np.where(self.masks, self.values, np.nan)[:, seen], axis=0)
        return out, seen


def groups(aligned: Aligned) -> Iterator[tuple[str, int, Mapping[str, Repeats]]]:
    """Yield column, direction, and the repeats of each renderer that has it.

    The angles of a column are on one branch: over all renderers at each place, and between the two directions by the
    median of their difference over the places that both have.
    """
    branches: dict[str, tuple[Array, BoolArray]] = {}
    for direction in (1, -1):
        for column in COMPARED:
            found = {}
            for renderer in dict.fromkeys(run.renderer for run in aligned.runs):
                passes = [each for each in aligned.of(renderer, direction) if column in each.columns]
                if passes:
                    found[renderer] = passes
            if not found:
                continue
            branch = None
            if COLUMNS[column][0] == "rad":
                branch, seen = _branch(column, [one for each in found.values() for one in each])
                if column in branches:
                    branch = branch + _whole_turns(*branches[column], branch, seen)
                branches.setdefault(column, (branch, seen))
            yield column, direction, {name: _repeats(each, column, branch) for name, each in found.items()}


def _branch(column: str, passes: Sequence[Pass]) -> tuple[Array, BoolArray]:
    """Return the branch of an angle at each place, and where any pass is, (m,) each.

    That is the mean direction over all passes, unwrapped along the way.
    """
    masks = np.array([each.mask for each in passes])
    turning = np.zeros(masks.shape[1], dtype=np.complex128)
    for each in passes:
        turning += np.where(each.mask, np.exp(1j * each.columns[column]), 0.0)
    seen: BoolArray = np.any(masks, axis=0)
    out = np.zeros(masks.shape[1])
    out[seen] = np.unwrap(np.angle(turning[seen]))
    return out, seen


def _whole_turns(one: Array, one_seen: BoolArray, other: Array, other_seen: BoolArray) -> float:
    """Return what whole turns, rad, bring `other` onto the branch of `one`."""
    both = one_seen & other_seen
    apart = np.median((one - other)[both]) if both.any() else np.median(one[one_seen]) - np.median(other[other_seen])
    return TURN * round(float(apart) / TURN)


def _repeats(passes: Sequence[Pass], column: str, branch: Array | None) -> Repeats:
    """Return what counts as repeats: the runs, at each place with the mean of their laps; of a single run, its laps.

    Laps of one run are by one hand in one mood, and no repeats of their own where there are several runs. `branch`
    (m,) is the one that angles are taken on.
    """
    values = np.array([each.columns[column] for each in passes])
    if branch is not None:
        values = values - TURN * np.round((values - branch) / TURN)
    masks = np.array([each.mask for each in passes])
    grains = np.array([each.grains[column] for each in passes])
    runs = np.array([each.run for each in passes])
    units, basis = np.unique(runs), RUNS
    if units.size == 1:
        units, basis = np.array([each.lap for each in passes]), LAPS
    else:
        counts = np.array([masks[runs == run].sum(axis=0) for run in units])
        sums = np.array([np.where(masks[runs == run], values[runs == run], 0.0).sum(axis=0) for run in units])
        grains = np.array([grains[runs == run].max(axis=0) for run in units])
        values, masks = sums / np.maximum(counts, 1), counts > 0
    coverage = masks.mean(axis=1)
    kept = coverage >= HALF * coverage.max()
    return Repeats(values[kept], masks[kept], grains[kept], units[kept], basis)


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


def bands(aligned: Aligned) -> tuple[Band, ...]:
    """Return median, lowest and highest of the repeats of each renderer, direction and column."""
    found = []
    for column, direction, repeats in groups(aligned):
        for renderer, made in repeats.items():
            median, seen = made.median()
            low = np.where(seen, np.where(made.masks, made.values, np.inf).min(axis=0), 0.0)
            high = np.where(seen, np.where(made.masks, made.values, -np.inf).max(axis=0), 0.0)
            found.append(Band(renderer, direction, column, median, low, high, made.masks.sum(axis=0)))
    return tuple(found)


@dataclass(frozen=True)
class Comparison:
    """Two renderers over what at least two `repeats` of each cover; `basis` says what these are, and `needed` how many
    of each it takes at the least to detect a difference among all that are compared (None: no number can).

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
        """ "differs", "the runs differ", "within the spread", "the same to rounding", "too few repeats", or
        "too little in common".

        Laps of one run show how far the hand varies within it, and not whether another run of the same renderer would
        be as far off: all they show is that the runs differ.
        """
        if math.isnan(self.difference):
            return "too little in common"
        if self.rounding <= 1.0:
            return "the same to rounding"
        if self.p < LEVEL:
            return "differs" if self.basis == RUNS else "the runs differ"
        return "within the spread" if self.least < LEVEL else "too few repeats"


def compare(aligned: Aligned, *, seed: int = 0) -> tuple[Comparison, ...]:
    """Compare every two renderers, in each direction and column, with the spread between repeats.

    A direction in which a renderer has a single repeat is left out for it. Raises `InputError`, naming it, for a
    renderer that has no more in any: nothing says what of it is the hand's; and for a run that is given twice.
    """
    renderers = list(dict.fromkeys(run.renderer for run in aligned.runs))
    if len(renderers) < 2:
        raise InputError(
            f"all runs are of '{renderers[0]}'", why="a comparison takes two renderers", todo="name runs of another one"
        )
    _refuse_copies(aligned.runs)
    families: dict[tuple[int, str, str], dict[str, tuple[Repeats, Repeats]]] = {}
    most = dict.fromkeys(renderers, 1)
    met: set[tuple[int, str, str]] = set()
    for column, direction, made in groups(aligned):
        for (first, one), (second, other) in combinations(made.items(), 2):
            met.add((direction, first, second))
            if min(len(one.values), len(other.values)) > 1:
                families.setdefault((direction, first, second), {})[column] = one, other
        most |= {renderer: max(most[renderer], len(each.values)) for renderer, each in made.items()}
    found = [
        one
        for (direction, first, second), columns in families.items()
        for one in _compared(aligned.grid, direction, first, second, columns, len(families), seed)
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
    """Describe what is wrong with a renderer of a single repeat, and how many it takes beside the others'."""
    other = max((each for each in most if each != renderer), key=lambda each: most[each])
    enough = needed(1, most[other], tests=tests, level=LEVEL)
    what = f"'{renderer}' has a single repeat, '{other}' {most[other]}"
    if most[other] == 1:
        what = f"one repeat of '{renderer}' and one of '{other}' are too few to compare"
    todo = "compare fewer renderers at once"
    if enough is not None:
        takes = f"{enough[0]} of '{renderer}' and {enough[1]} of '{other}'"
        todo = f"record more: to detect a difference takes {takes} at the least"
    why = "without repeats the hand's own variation is not known, and any difference could be the hand's"
    return InputError(what, why=why, todo=todo)


def _refuse_copies(runs: Sequence[Run]) -> None:
    """Refuse a run that is given twice: it would be a repeat without any spread."""
    seen: dict[tuple[str, bytes], Run] = {}
    for run in runs:
        same = seen.setdefault((run.renderer, run.recording.hip.tobytes() + run.recording.force.tobytes()), run)
        if same is not run:
            raise InputError(
                f"{same.label} and {run.label} are the same run",
                why="a hand never moves the same way twice, and a copy says nothing of how it varies",
                todo="name each run once",
            )


def _compared(
    grid: Array,
    direction: int,
    first: str,
    second: str,
    columns: Mapping[str, tuple[Repeats, Repeats]],
    families: int,
    seed: int,
) -> Iterator[Comparison]:
    """Compare two renderers in one direction, in every column that both have."""
    measured = {column: _distances(*both) for column, both in columns.items()}
    known = {column: np.isfinite(apart.values).all() for column, (apart, _) in measured.items()}
    tested = {name: apart for name, (apart, rounding) in measured.items() if known[name] and rounding > 1.0}
    p, least = permuted(tested, seed=seed)
    for column, both in columns.items():
        (one, one_seen), (other, other_seen) = (each.median(at_least=2) for each in both)
        common = one_seen & other_seen
        share, basis = float(np.mean(common)), " and ".join(sorted({each.basis for each in both}))
        sizes = len(both[0].values), len(both[1].values)
        enough = needed(*sizes, tests=families, level=LEVEL)
        numbers = (math.nan, math.nan, 1.0, 1.0, math.nan, math.nan, math.nan)
        if share >= COMMON and known[column]:
            apart = np.where(common, one - other, 0.0)
            worst = int(np.argmax(np.abs(apart)))
            numbers = (
                float(np.sqrt(np.mean(apart[common] ** 2))),
                measured[column][0].spread,
                min(1.0, families * p.get(column, 1.0)),
                min(1.0, families * least),
                float(abs(apart[worst])),
                float(grid[worst]),
                measured[column][1],
            )
        yield Comparison(first, second, direction, column, sizes, enough, basis, *numbers, share)


def _distances(one: Repeats, other: Repeats) -> tuple[Distances, float]:
    """Return the distances of every two repeats, of either renderer, where both have an answer.

    They are root mean square differences, NaN where too little is common. And the largest difference of any two at a
    place, in what their numbers resolve there.
    """
    values, masks, grains = (np.vstack(each) for each in zip(one[:3], other[:3], strict=True))
    units = tuple((side, int(unit)) for side, each in enumerate((one, other)) for unit in each.units)
    out = np.zeros((len(values), len(values)))
    largest = 0.0
    for i, j in combinations(range(len(values)), 2):
        both = masks[i] & masks[j]
        apart = values[i, both] - values[j, both]
        out[i, j] = out[j, i] = np.sqrt(np.mean(apart**2)) if np.mean(both) >= COMMON else np.nan
        with np.errstate(divide="ignore"):
            moved = apart != 0.0
            shares = np.abs(apart[moved]) / (grains[i, both] + grains[j, both])[moved]
        largest = max(largest, float(shares.max(initial=0.0)))
    return Distances(out, units), largest
