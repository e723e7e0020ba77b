"""The two tables of a report, as plain data and as markdown: the summary, and every check by every renderer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from hapticeval.reports.scene_words import ended_words
from hapticeval.runner.results import ResultsDocument, SuiteEntry, VerdictEntry

SYMBOLS: Mapping[str, str] = MappingProxyType(
    {"pass": "✓", "fail": "✗", "inconclusive": "?", "not-applicable": "-", "error": "!"}
)

LEVELS = ("must", "should", "info")
"""From the heaviest down: a row has the heaviest level that any of its verdicts has."""


@dataclass(frozen=True)
class Cell:
    """One verdict in the matrix.

    `standing` says how it compares: "as known", "differs" (from what is published), "unexpected" (an error, or
    a check of level must that failed or could not decide, with nothing published), "warning" (one of level should that
    did), or "" for nothing to say.
    """

    outcome: str
    published: str | None
    as_expected: bool
    verdict: VerdictEntry

    @property
    def symbol(self) -> str:
        """The outcome as one character."""
        return SYMBOLS[self.outcome]

    @property
    def standing(self) -> str:
        """How the outcome compares with what was to be expected."""
        if self.published is not None:
            return "as known" if self.outcome == self.published else "differs"
        if self.verdict.warns:
            return "warning"
        return "" if self.as_expected else "unexpected"


@dataclass(frozen=True)
class MatrixRow:
    """A check of a case; `cells` has a cell a renderer, None where it has no verdict."""

    suite: str
    case: str
    check: str
    level: str
    cells: tuple[Cell | None, ...]


@dataclass(frozen=True)
class SummaryRow:
    """A row of the summary table; `cells` pairs what was found with what is in print, None where unknown."""

    title: str
    cells: tuple[tuple[str | None, str | None], ...]


def renderers(results: ResultsDocument) -> list[str]:
    """Every renderer of the results, in the order in which they ran."""
    tables = (name for row in results.table.values() for name in row)
    return list(dict.fromkeys([*(run.renderer for run in results.runs), *_named(results.verdicts), *tables]))


def _named(verdicts: Iterable[VerdictEntry]) -> Iterable[str]:
    return (verdict.renderer for verdict in verdicts)


def cell_of(verdict: VerdictEntry) -> Cell:
    """A verdict document as a cell."""
    return Cell(verdict.outcome, verdict.published, verdict.as_expected, verdict)


def matrix(results: ResultsDocument) -> list[MatrixRow]:
    """Every (suite, case, check) that has a verdict, in the order in which they ran."""
    names = renderers(results)
    found: dict[tuple[str, str, str], dict[str, VerdictEntry]] = {}
    for verdict in results.verdicts:
        found.setdefault((verdict.suite, verdict.case, verdict.check), {})[verdict.renderer] = verdict
    return [
        MatrixRow(
            *key,
            min((each.level for each in given.values()), key=LEVELS.index),
            tuple(cell_of(given[name]) if name in given else None for name in names),
        )
        for key, given in found.items()
    ]


def summary(results: ResultsDocument) -> list[SummaryRow]:
    """The rows that the suites define (Table 6.3), with the printed values where the suites carry them."""
    names = renderers(results)
    return [
        SummaryRow(title, tuple((row.get(name), results.published_table.get(title, {}).get(name)) for name in names))
        for title, row in results.table.items()
    ]


def suite_names(results: ResultsDocument) -> list[str]:
    """Every suite of the results, in the order in which they ran."""
    return list(dict.fromkeys(each.suite for each in (*results.runs, *results.verdicts)))


def by_suite(results: ResultsDocument) -> list[tuple[SuiteEntry | None, list[SummaryRow]]]:
    """The summary's rows in groups, each with the document of its suite; None for rows of no suite."""
    left = {row.title: row for row in summary(results)}
    groups: list[tuple[SuiteEntry | None, list[SummaryRow]]] = []
    for suite in results.suites:
        rows = [left.pop(title) for title in suite.rows if title in left]
        if rows:
            groups.append((suite, rows))
    return [*groups, (None, list(left.values()))] if left else groups


def ran(results: ResultsDocument) -> str:
    """How much ran, in one sentence: never fewer than planned without the reason."""
    sentence = f"{results.ran} of {results.planned} planned verdicts ran"
    return sentence if results.complete else f"{sentence}: incomplete, {results.reason}"


def markdown(results: ResultsDocument) -> str:
    """Both tables, for a pull request or a wiki."""
    names = renderers(results)
    parts = ["# hapticeval", f"{ran(results)}; seed {results.seed}."]
    groups = by_suite(results)
    if groups:
        parts.append("## Summary of the renderers' performance")
    for suite, group in groups:
        rows = [[row.title, *(_summary_text(*cell) for cell in row.cells)] for row in group]
        if suite:
            parts.append(f"### {_escape(suite.title or suite.name)}")
            parts += [f"{_escape(suite.citation)}."] if suite.citation else []
        parts.append(_table(["", *names], rows))
    cells = [
        [f"{row.suite}/{row.case}", row.check, *(_cell_text(cell) for cell in row.cells)] for row in matrix(results)
    ]
    if cells:
        parts += ["## Every check", _table(["case", "check", *names], cells)]
    broken = [
        _escape(f"- {run.renderer} on {run.suite}/{run.case}: {run.error.what}") for run in results.runs if run.error
    ]
    if broken:
        parts += ["## Errors", "\n".join(broken)]
    ended = [
        _escape(f"- {run.renderer} on {run.suite}/{run.case} {ended_words(run)}") for run in results.runs if run.ended
    ]
    if ended:
        parts += ["## Ended early", "\n".join(ended)]
    return "\n\n".join(parts) + "\n"


def _summary_text(value: str | None, published: str | None) -> str:
    text = value or "-"
    if published is None or value is None:
        return text
    return text if value == published else f"**{text}** (published: {published})"


def _cell_text(cell: Cell | None) -> str:
    if cell is None:
        return ""
    text = f"{cell.symbol} {cell.outcome}"
    if cell.standing == "differs":
        return f"**{text}** (published: {cell.published})"
    if cell.standing == "unexpected":
        return f"**{text}**"
    return f"{text} ({cell.standing})" if cell.standing else text


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Pipes aligned, so that the file reads well as text too."""
    lines = [[_escape(text) for text in header], *([_escape(text) for text in row] for row in rows)]
    widths = [max(3, *(len(line[column]) for line in lines)) for column in range(len(header))]
    padded = [" | ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)) for line in lines]
    rule = " | ".join("-" * width for width in widths)
    return "\n".join(f"| {line} |" for line in [padded[0], rule, *padded[1:]])


def _escape(text: str) -> str:
    """Text that cannot end its cell, nor start HTML."""
    return " ".join(text.replace("|", "\\|").replace("<", "&lt;").split())
