"""Verdicts side by side: tiles of several, and the grids of renderers by phenomena, cases and digits."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from hapticeval.phenomena.verdict import Outcome
from hapticeval.quantity import format_number, name_first, plural
from hapticeval.runner.results import ResultsDocument, RunEntry, VerdictEntry
from hapticeval.runner.standing import Standing

OTHER_PROPERTIES, HELD_CONSTRAINT, SURFACE_EFFECTS = "Other properties", "Held constraint", "Effects of the surface"
"""Columns of checks that are about none of the six phenomena."""


def bound_share(verdict: VerdictEntry) -> float | None:
    """Return a metric as a share of its bound, infinity where it was not finite; None where that says nothing."""
    if verdict.metric is None or verdict.bound is None or verdict.bound < 0.0:
        return None
    if step_ratio(verdict) is not None:
        return None
    value = verdict.metric.value
    # A metric that was not finite is stored as none: it is beyond any bound.
    if value is None:
        return math.inf
    # A bound of zero has no shares: it is kept or broken.
    if verdict.bound == 0.0:
        return math.inf if value > 0.0 else 0.0
    # 1 is at the bound; a metric below zero has all of its bound left.
    return max(value, 0.0) / verdict.bound


def step_ratio(verdict: VerdictEntry) -> float | None:
    """Return how many times the HIP's longest step the IHIP's is, where a pass has no margin but says "continuous".

    Refinement goes on until a jump is below its bound, so that the metric of such a pass is the bound, or less.
    """
    amplification = verdict.evidence.get("amplification")
    if verdict.outcome is Outcome.PASS and isinstance(amplification, int | float):
        return float(amplification)
    return None


@dataclass(frozen=True)
class Tile:
    """Several verdicts as one cell: at least one, and the runs that broke before any check."""

    verdicts: Sequence[VerdictEntry]
    broken: Sequence[RunEntry] = ()

    @cached_property
    def counts(self) -> Counter[Standing]:
        """How many verdicts have each standing; a run that broke counts as an error."""
        return Counter([*(verdict.standing for verdict in self.verdicts), *(Standing.ERROR for _ in self.broken)])

    @property
    def total(self) -> int:
        """How many verdicts there are."""
        return sum(self.counts.values())

    @cached_property
    def standing(self) -> Standing:
        """The gravest standing."""
        return min(self.counts, key=list(Standing).index)

    @cached_property
    def worst(self) -> VerdictEntry | RunEntry:
        """The verdict of the gravest standing that is farthest beyond its bound, or closest to it."""
        gravest = sorted(
            (verdict for verdict in self.verdicts if verdict.standing is self.standing), key=_bound_load, reverse=True
        )
        return gravest[0] if gravest else self.broken[0]

    @property
    def heat(self) -> int:
        """From 1 to 3: how close to its bound the worst passes (half, nine tenths), or how far beyond it is (2, 10)."""
        load = _bound_load(self.worst) if isinstance(self.worst, VerdictEntry) else 0.0
        # Shares of the bound: how much a pass uses, how many times a failure is beyond.
        limits = (0.5, 0.9) if self.standing is Standing.PASS else (2.0, 10.0)
        return 1 + sum(load >= limit for limit in limits)

    @property
    def margin(self) -> str:
        """The worst margin in per cent of its bound, or how many times its bound the metric is; "" without a bound.

        For a pass that says "continuous", by how many times the IHIP's longest step is the HIP's.
        """
        if not isinstance(self.worst, VerdictEntry) or self.standing is Standing.NOT_APPLICABLE:
            return ""
        ratio = step_ratio(self.worst)
        if ratio is not None:
            return f"step {ratio_words(ratio)}×"  # noqa: RUF001
        share = bound_share(self.worst)
        if share is None:
            return ""
        if share <= 1.0:
            return f"{100.0 * (1.0 - share):.0f} % left"
        return f"{ratio_words(share)}×"  # noqa: RUF001

    @property
    def standing_by_check(self) -> str:
        """Each check and the standing of its verdict, as `check=standing` with blanks between."""
        return " ".join(f"{verdict.check}={verdict.standing}" for verdict in self.verdicts)

    @property
    def where(self) -> str:
        """The worst verdict in words, for a tooltip."""
        worst = self.worst
        place = f"{worst.suite}/{worst.case}"
        if isinstance(worst, RunEntry):
            return f"broke in {place}: {worst.error.what if worst.error else ''}"
        figures = worst.measured
        return f"worst of {self.total}: {worst.check} in {place}" + (f": {figures}" if figures else "")


def ratio_words(share: float) -> str:
    """Return a ratio in few signs: 1.3, 48, 840, 4200, 9.1e6."""
    return "∞" if math.isinf(share) else format_number(share, 2)


def _bound_load(entry: VerdictEntry | RunEntry) -> float:
    """How much of its bound a verdict uses; what has no bound lies below."""
    share = bound_share(entry) if isinstance(entry, VerdictEntry) else None
    return -1.0 if share is None else share


@dataclass(frozen=True)
class Grid:
    """Named rows of tiles, one for each column, None where nothing ran."""

    columns: Sequence[str]
    rows: Sequence[tuple[str, Sequence[Tile | None]]]


def phenomenon_grid(results: ResultsDocument) -> Grid:
    """Return the grid of renderers by phenomena: the six of thesis section 3.2 that were asked for, then the others."""
    from hapticeval.phenomena.registry import CHECKS, PHENOMENA

    groups = {
        name: _column_of(CHECKS[name]) if name in CHECKS else OTHER_PROPERTIES
        for name in {v.check for v in results.verdicts}
    }
    # In the thesis's order; a phenomenon that no check was asked of has no column.
    columns = [
        name for name in (*PHENOMENA, HELD_CONSTRAINT, SURFACE_EFFECTS, OTHER_PROPERTIES) if name in groups.values()
    ]
    verdicts_by_cell: dict[tuple[str, str], list[VerdictEntry]] = {}
    for verdict in results.verdicts:
        verdicts_by_cell.setdefault((verdict.renderer, groups[verdict.check]), []).append(verdict)
    # A dict as a set that keeps the order.
    names = {entry.renderer: None for entry in results.entries()}
    return Grid(
        columns,
        [
            (
                name,
                [
                    Tile(verdicts_by_cell[name, column]) if (name, column) in verdicts_by_cell else None
                    for column in columns
                ],
            )
            for name in names
        ],
    )


def _column_of(check: object) -> str:
    """Return the column of a check; those of other packages may name one of the six as well."""
    from hapticeval.phenomena.check import Check
    from hapticeval.phenomena.registry import PHENOMENA

    assert isinstance(check, Check)
    # The six first: a check of an effect may be about one of them.
    if check.phenomenon in PHENOMENA:
        return check.phenomenon
    if check.effects:
        return SURFACE_EFFECTS
    return HELD_CONSTRAINT if check.holds or check.needs_closed_form else OTHER_PROPERTIES


def case_grid(results: ResultsDocument, suite: str) -> Grid:
    """Return the grid of a suite's cases by the renderers that ran there."""
    runs = [run for run in results.runs if run.suite == suite]
    renderers = list(dict.fromkeys(run.renderer for run in runs))
    by_key = {run.key: run for run in runs}
    rows: list[tuple[str, list[Tile | None]]] = []
    for case in dict.fromkeys(run.case for run in runs):
        tiles: list[Tile | None] = []
        for name in renderers:
            run = by_key.get((suite, case, name))
            verdicts = results.verdicts_of.get((suite, case, name), [])
            # A run that broke before any check has no verdict to stand for it.
            broken = [run] if run is not None and run.error and not verdicts else []
            tiles.append(Tile(verdicts, broken) if verdicts or broken else None)
        rows.append((case, tiles))
    return Grid(renderers, rows)


def headline(results: ResultsDocument) -> str:
    """Return the verdict of the run, in one sentence."""
    if not results.complete:
        return f"Incomplete: {results.reason}"
    if results.all_refused:
        return "Every renderer refused every case"
    # A renderer that breaks in one line counts once, with its runs; what these lost is told there.
    broken = results.breakdowns
    # Incomplete runs have been dealt with: what is counted here did run.
    unexpected = len(results.stopping_by_itself)
    lost_verdicts = len(results.stopping) - unexpected
    standings = Counter(verdict.standing for verdict in results.verdicts)
    are = "is" if unexpected == 1 else "are"
    parts = []
    if unexpected:
        parts.append(f"{unexpected:,} of {plural(results.ran, 'verdict')} {are} not as expected{results.strict_words}")
    if broken:
        names = name_first(list(dict.fromkeys(breakdown.runs[0].renderer for breakdown in broken)), 2, " and ")
        runs = plural(sum(len(breakdown.runs) for breakdown in broken), "run")
        lost = f", which lost {plural(lost_verdicts, 'verdict')}" if lost_verdicts else ""
        parts.append(f"{names} broke in {runs}{lost}")
    if not results.verdicts and not parts:
        return "No verdict was given"
    parts = parts or ["Every verdict is as expected"]
    # What fails and is accepted stands in the same line, so that nobody takes it for passed.
    parts += [f"{standings[name]:,} {name}" for name in (Standing.KNOWN, Standing.INHERENT) if standings[name]]
    return ", ".join(parts)


def is_sound(results: ResultsDocument) -> bool:
    """Return whether nothing of a run calls for attention, as its exit code has it."""
    return (
        results.complete
        and not results.all_refused
        and not any(run.error for run in results.runs)
        and not results.stopping
    )


def worst_verdicts(results: ResultsDocument, count: int) -> list[VerdictEntry]:
    """Return what is not as expected, or warns, the gravest first; where there is none, the failures that are known.

    A check on a renderer has its worst verdict only, and a known one only the worst of its check. Verdicts that broken
    runs took away are left out.
    """
    unexpected = [verdict for verdict in results.verdicts if verdict.standing.stops_strict]
    grave = [verdict for verdict in unexpected if not results.lost(verdict)]
    candidates = grave or [verdict for verdict in results.verdicts if verdict.standing.excused]
    worst_by_check: dict[tuple[str, ...], VerdictEntry] = {}
    # The first of each key is the worst, as the gravest come first.
    for verdict in gravest_first(candidates):
        worst_by_check.setdefault((verdict.check, verdict.renderer) if grave else (verdict.check,), verdict)
    return list(worst_by_check.values())[:count]


@dataclass(frozen=True)
class HardCase:
    """The digits that renderers keep in a hard case; None where none were counted."""

    suite: str
    case: str
    title: str
    cells: Sequence[tuple[int | None, VerdictEntry | None]]


def hard_cases(results: ResultsDocument) -> tuple[Sequence[str], Sequence[HardCase]]:
    """Return the renderers, and by case the decimal digits that their answers keep when the scene is moved.

    Read off the evidence `digits`; a case that no renderer has it for is left out. The fewest digits come first, of
    renderers that declare no coarse model of their own.
    """
    verdicts_by_case: dict[tuple[str, str], dict[str, VerdictEntry]] = {}
    for verdict in results.verdicts:
        # Decimal digits, where a check counted them.
        if isinstance(verdict.evidence.get("digits"), int | float):
            verdicts_by_case.setdefault((verdict.suite, verdict.case), {})[verdict.renderer] = verdict
    verdicts_by_case = dict(sorted(verdicts_by_case.items(), key=lambda pair: _digits_of(_fewest(pair[1].values())[0])))
    names = [name for name in results.renderers if any(name in row for row in verdicts_by_case.values())]
    titles = {(run.suite, run.case): run.title for run in results.runs}
    return names, [
        HardCase(*key, titles.get(key, key[1]), [(_whole_digits(row.get(name)), row.get(name)) for name in names])
        for key, row in verdicts_by_case.items()
    ]


class DigitFamily(NamedTuple):
    """A row of a table about digits: the fewest that its cases keep, and in which `case`.

    `coarse_digits` are those of renderers that declare a coarse model of their own; None where none does.
    """

    title: str
    case: str
    digits: float
    coarse_digits: float | None


def digit_families(results: ResultsDocument) -> list[DigitFamily]:
    """Return the rows of the suites' tables that are about digits, the one with the fewest first."""
    titles = {(run.suite, run.case): run.title for run in results.runs}
    families = []
    for suite in results.suites:
        for title, cells in suite.cells.items():
            counted = [
                verdict
                for verdict in results.verdicts
                if verdict.suite == suite.name
                and f"{verdict.case}/{verdict.check}" in cells
                and isinstance(verdict.evidence.get("digits"), int | float)
            ]
            if counted:
                worst, coarsest = _fewest(counted)
                fewest_digits = None if coarsest is None else math.floor(max(0.0, _digits_of(coarsest)))
                families.append(
                    DigitFamily(
                        title.removeprefix("Keeps its digits "), titles[worst.key[:2]],
                        math.floor(max(0.0, _digits_of(worst))), fewest_digits,
                    )
                )  # fmt: skip
    return sorted(families, key=lambda family: family.digits)


def _fewest(counted: Iterable[VerdictEntry]) -> tuple[VerdictEntry, VerdictEntry | None]:
    """Return the verdict with the fewest digits, one at least, and that of renderers that declare a coarse model."""
    exact: list[VerdictEntry] = []
    coarse: list[VerdictEntry] = []
    for verdict in counted:
        # A coarse model of the renderer's own leaves fewer digits, as it declares.
        (coarse if verdict.evidence.get("declared_m", 0.0) > 0.0 else exact).append(verdict)
    return min(exact or coarse, key=_digits_of), min(coarse, key=_digits_of, default=None)


def _digits_of(verdict: VerdictEntry) -> float:
    return float(verdict.evidence["digits"])


def _whole_digits(verdict: VerdictEntry | None) -> int | None:
    return None if verdict is None else max(0, math.floor(verdict.evidence["digits"]))


def gravest_first(verdicts: Iterable[VerdictEntry]) -> list[VerdictEntry]:
    """Return verdicts, the gravest first."""
    order = list(Standing).index
    # By standing, then by what a hand feels of a failure, then by how much of its bound is used, the most first.
    return sorted(
        verdicts,
        key=lambda verdict: (
            order(verdict.standing), -verdict.felt if verdict.outcome is Outcome.FAIL else 0.0, -_bound_load(verdict)
        ),
    )  # fmt: skip
