"""Whether renderers differ by more than repeats of one renderer do (Figures 6.5 and 6.9).

What a hand does differs from run to run, so a difference between two renderers says nothing unless it is held against
the differences between repeats of one.

- Repeats are whole curves over the abscissa. They are what is independent, and not samples: `permutation` has the test.
- The distance of two repeats is the root mean square of their difference where both have an answer.
- Over pairs of renderers, and over the two directions, whose repeats may be different runs, p is multiplied by their
  number.
- A column in which no two repeats, of either renderer, differ by more than rounding is the same, and not tested: see
  `COLUMN_ROUNDING`.
- Where those of each renderer agree to rounding but not with the other's, the test needs nothing more: any other deal
  of the names mixes them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.compare.align import FULL_TURN, PASS_COLUMNS, Aligned, Pass, Run
from hapticeval.recordings.compare.permutation import LEVEL, Distances, needed, permutation_p
from hapticeval.recordings.recording import SINGLE
from hapticeval.types import Array, BoolArray, IntArray

LEAST_COVERAGE = 0.5  # a repeat covers at least this share of what the fullest one does: the end of a last lap is none
COLUMN_ROUNDING = 16.0 * SINGLE  # of a column's size: what a few operations in single precision may cost
LEAST_COMMON = 0.05  # two curves must share this much of the grid for a distance, and two medians for a difference


class Repeats(NamedTuple):
    """The repeats of one renderer in one column and direction: `values` and `masks` (k, m).

    `runs` (k,) number the repeats: the same run has the same number in every column.
    """

    values: Array
    masks: BoolArray
    runs: IntArray

    def median(self, at_least: int = 1) -> tuple[Array, BoolArray]:
        """Return the median curve, where `at_least` so many repeats have an answer, else 0, and where that is: (m,)."""
        answered = self.masks.sum(axis=0) >= at_least
        out = np.zeros(answered.size)
        out[answered] = np.nanmedian(np.where(self.masks, self.values, np.nan)[:, answered], axis=0)
        return out, answered


def groups(aligned: Aligned) -> Iterator[tuple[str, int, Mapping[str, Repeats]]]:
    """Yield column, direction, and the repeats of each renderer that has it.

    The angles of a column are on one branch: over all renderers at each place, and between the two directions by the
    median of their difference over the places that both have.
    """
    branches: dict[str, tuple[Array, BoolArray]] = {}
    for direction in (1, -1):
        for column in PASS_COLUMNS:
            passes_of = {}
            for renderer in dict.fromkeys(run.renderer for run in aligned.runs):
                passes = [pass_ for pass_ in aligned.passes_of(renderer, direction) if column in pass_.columns]
                if passes:
                    passes_of[renderer] = passes
            if not passes_of:
                continue
            branch = None
            if PASS_COLUMNS[column][0] == "rad":
                branch, answered = _branch(
                    column, [one for renderer_passes in passes_of.values() for one in renderer_passes]
                )
                if column in branches:
                    # The second direction is put onto the branch of the first, so that both can stand in one diagram.
                    branch = branch + _offset_in_turns(*branches[column], branch, answered)
                branches.setdefault(column, (branch, answered))
            yield (
                column,
                direction,
                {name: _repeats_of(renderer_passes, column, branch) for name, renderer_passes in passes_of.items()},
            )


def _branch(column: str, passes: Sequence[Pass]) -> tuple[Array, BoolArray]:
    """Return the mean angle of all passes at each place, unwrapped along the way, and where any pass is: (m,) each.

    Angles are known but for full turns: each pass's is then taken on the turn nearest to this one.
    """
    masks = np.array([pass_.mask for pass_ in passes])
    # Sum of unit vectors exp(i angle): its argument is the mean direction, whatever branch each pass is on.
    turning = np.zeros(masks.shape[1], dtype=np.complex128)
    for pass_ in passes:
        turning += np.where(pass_.mask, np.exp(1j * pass_.columns[column]), 0.0)
    answered: BoolArray = np.any(masks, axis=0)
    out = np.zeros(masks.shape[1])
    out[answered] = np.unwrap(np.angle(turning[answered]))
    return out, answered


def _offset_in_turns(one: Array, one_answered: BoolArray, other: Array, other_answered: BoolArray) -> float:
    """Return what whole turns, rad, bring `other` onto the branch of `one`."""
    common = one_answered & other_answered
    # Without a common place the two curves' own medians have to do.
    offset = (
        np.median((one - other)[common])
        if common.any()
        else np.median(one[one_answered]) - np.median(other[other_answered])
    )
    return FULL_TURN * round(float(offset) / FULL_TURN)


def _repeats_of(passes: Sequence[Pass], column: str, branch: Array | None) -> Repeats:
    """Return the runs as repeats, at each place with the mean of their laps.

    Laps of one run are by one hand in one mood, and no repeats of their own. `branch` (m,) is the one that angles are
    taken on.
    """
    values = np.array([pass_.columns[column] for pass_ in passes])
    if branch is not None:
        # Each angle goes to the turn nearest to the common branch.
        values = values - FULL_TURN * np.round((values - branch) / FULL_TURN)
    masks = np.array([pass_.mask for pass_ in passes])
    run_of_pass = np.array([pass_.run for pass_ in passes])
    runs = np.unique(run_of_pass)
    of_runs = [run_of_pass == run for run in runs]
    # Mean over the laps of each run.
    counts = np.array([masks[laps].sum(axis=0) for laps in of_runs])
    sums = np.array([np.where(masks[laps], values[laps], 0.0).sum(axis=0) for laps in of_runs])
    values, masks = sums / np.maximum(counts, 1), counts > 0
    coverage = masks.mean(axis=1)
    long_enough = coverage >= LEAST_COVERAGE * coverage.max()
    return Repeats(values[long_enough], masks[long_enough], runs[long_enough])


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
    repeat_bands = []
    for column, direction, repeats in groups(aligned):
        for renderer, renderer_repeats in repeats.items():
            median, answered = renderer_repeats.median()
            # Places without an answer stand at +-infinity for the extremes, and at 0 in what is returned.
            low = np.where(answered, np.where(renderer_repeats.masks, renderer_repeats.values, np.inf).min(axis=0), 0.0)
            high = np.where(
                answered, np.where(renderer_repeats.masks, renderer_repeats.values, -np.inf).max(axis=0), 0.0
            )
            repeat_bands.append(
                Band(renderer, direction, column, median, low, high, renderer_repeats.masks.sum(axis=0))
            )
    return tuple(repeat_bands)


@dataclass(frozen=True)
class Comparison:
    """Two renderers in one direction and column: how far apart they are, and whether repeats of one are as far.

    - `repeats`: how many runs of each there are; `needed`: how many of each it takes at the least to detect a
      difference among all that are compared (None: no number can).
    - `difference`: root mean square of the difference of their medians, over what at least two repeats of each cover;
      `spread`: that between repeats of one renderer; both in the column's unit.
    - `p`: of the permutation test over all columns, times the number of pairs and directions compared;
      `smallest_p`: the smallest that so many repeats can give.
    - `worst`: the place (in the abscissa's unit) of the largest difference of the medians, `largest`.
    - `rounding`: the largest difference of any two repeats, of either renderer, in what counts as rounding.
    - `common`: the share of the grid that both medians cover; where it is too small, nothing else is known.
    """

    first: str
    second: str
    direction: int
    column: str
    repeats: tuple[int, int]
    needed: tuple[int, int] | None
    common: float
    difference: float = math.nan
    spread: float = math.nan
    p: float = 1.0
    smallest_p: float = 1.0
    largest: float = math.nan
    worst: float = math.nan
    rounding: float = math.nan

    @property
    def times(self) -> float:
        """How many times the spread the difference is."""
        return self.difference / self.spread if self.spread > 0.0 else math.inf

    @property
    def outcome(self) -> str:
        """ "differs", "within the spread", "the same to rounding", "too few repeats", or "too little in common"."""
        if math.isnan(self.difference):
            return "too little in common"
        if self.rounding <= 1.0:
            return "the same to rounding"
        if self.p < LEVEL:
            return "differs"
        return "within the spread" if self.smallest_p < LEVEL else "too few repeats"


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
    repeat_counts = dict.fromkeys(renderers, 1)
    met: set[tuple[int, str, str]] = set()
    for column, direction, repeats in groups(aligned):
        for (first, one), (second, other) in combinations(repeats.items(), 2):
            # Also a pair with a single repeat counts: with more repeats it would be one test more.
            met.add((direction, first, second))
            if min(len(one.values), len(other.values)) > 1:
                families.setdefault((direction, first, second), {})[column] = one, other
        repeat_counts |= {
            renderer: max(repeat_counts[renderer], len(renderer_repeats.values))
            for renderer, renderer_repeats in repeats.items()
        }
    comparisons = [
        one
        for (direction, first, second), columns in families.items()
        for one in _compare_pair(aligned.grid, direction, first, second, columns, len(families), seed)
    ]
    for renderer in renderers:
        if repeat_counts[renderer] == 1:
            raise _single_repeat_error(renderer, repeat_counts, tests=max(len(met), 1))
    if all(math.isnan(comparison.difference) for comparison in comparisons):
        raise InputError(
            "no two renderers were led over the same places in the same direction", why="nothing is common to compare"
        )
    return tuple(comparisons)


def _single_repeat_error(renderer: str, repeat_counts: Mapping[str, int], *, tests: int) -> InputError:
    """Describe what is wrong with a renderer of a single repeat, and how many it takes beside the others'."""
    other = max(
        (candidate for candidate in repeat_counts if candidate != renderer),
        key=lambda candidate: repeat_counts[candidate],
    )
    enough = needed(1, repeat_counts[other], tests=tests, level=LEVEL)
    what = f"'{renderer}' has a single repeat, '{other}' {repeat_counts[other]}"
    if repeat_counts[other] == 1:
        what = f"one repeat of '{renderer}' and one of '{other}' are too few to compare"
    todo = "compare fewer renderers at once"
    if enough is not None:
        takes = f"{enough[0]} of '{renderer}' and {enough[1]} of '{other}'"
        todo = f"record more: to detect a difference takes {takes} at the least"
    why = "without repeats the hand's own variation is not known, and any difference could be the hand's"
    return InputError(what, why=why, todo=todo)


def _refuse_copies(runs: Sequence[Run]) -> None:
    """Refuse a run that is given twice: it would be a repeat without any spread."""
    run_of_contents: dict[tuple[str, bytes], Run] = {}
    for run in runs:
        # Contents compared bit for bit: HIP and force.
        same = run_of_contents.setdefault(
            (run.renderer, run.recording.hip.tobytes() + run.recording.force.tobytes()), run
        )
        if same is not run:
            raise InputError(
                f"{same.label} and {run.label} are the same run",
                why="a hand never moves the same way twice, and a copy says nothing of how it varies",
                todo="name each run once",
            )


def _compare_pair(
    grid: Array,
    direction: int,
    first: str,
    second: str,
    columns: Mapping[str, tuple[Repeats, Repeats]],
    families: int,
    seed: int,
) -> Iterator[Comparison]:
    """Compare two renderers in one direction, in every column that both have."""
    measured = {column: _pairwise_distances(column, *both) for column, both in columns.items()}
    known = {column: np.isfinite(apart.values).all() for column, (apart, _) in measured.items()}
    # Columns that agree to rounding, or have a pair without enough in common, take no part in the test.
    tested = {name: apart for name, (apart, rounding) in measured.items() if known[name] and rounding > 1.0}
    p, smallest_p = permutation_p(tested, seed=seed)
    for column, pair in columns.items():
        (one, one_answered), (other, other_answered) = (repeats.median(at_least=2) for repeats in pair)
        common = one_answered & other_answered
        share = float(np.mean(common))
        sizes = len(pair[0].values), len(pair[1].values)
        enough = needed(*sizes, tests=families, level=LEVEL)
        comparison = Comparison(first, second, direction, column, sizes, enough, common=share)
        if share >= LEAST_COMMON and known[column]:
            difference = np.where(common, one - other, 0.0)
            worst = int(np.argmax(np.abs(difference)))
            distances, rounding = measured[column]
            comparison = replace(
                comparison,
                difference=float(np.sqrt(np.mean(difference[common] ** 2))),
                spread=distances.spread,
                # Bonferroni over pairs of renderers and directions; the columns are one test already.
                p=min(1.0, families * p.get(column, 1.0)),
                smallest_p=min(1.0, families * smallest_p),
                largest=float(abs(difference[worst])),
                worst=float(grid[worst]),
                rounding=rounding,
            )
        yield comparison


def _pairwise_distances(column: str, one: Repeats, other: Repeats) -> tuple[Distances, float]:
    """Return the distances of every two repeats, of either renderer, where both have an answer.

    They are root mean square differences, NaN where too little is common. And the largest difference of any two at a
    place, in what counts as rounding.
    """
    values, masks = np.vstack([one.values, other.values]), np.vstack([one.masks, other.masks])
    units = tuple((side, int(run)) for side, repeats in enumerate((one, other)) for run in repeats.runs)
    out = np.zeros((len(values), len(values)))
    largest = 0.0
    for i, j in combinations(range(len(values)), 2):
        common = masks[i] & masks[j]
        difference = values[i, common] - values[j, common]
        out[i, j] = out[j, i] = np.sqrt(np.mean(difference**2)) if np.mean(common) >= LEAST_COMMON else np.nan
        largest = max(largest, float(np.max(np.abs(difference), initial=0.0)))
    # A direction is known to a share of a turn, all else to a share of its size.
    size = FULL_TURN if PASS_COLUMNS[column][0] == "rad" else float(np.max(np.abs(values[masks]), initial=0.0))
    return Distances(out, units), largest / (COLUMN_ROUNDING * size) if largest else 0.0
