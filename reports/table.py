"""The two tables of a report, as plain data and as markdown: the summary, and every check by every renderer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from hapticeval.phenomena.verdict import Level
from hapticeval.reports.scene_words import ended_words
from hapticeval.runner.results import ResultsDocument, SuiteEntry, VerdictEntry

SYMBOLS: Mapping[str, str] = MappingProxyType(
    {"pass": "✓", "fail": "✗", "inconclusive": "?", "not-applicable": "-", "error": "!"}
)


@dataclass(frozen=True)
class MatrixRow:
    """One check of one case; `cells` has one entry per renderer, None where it has no verdict."""

    suite: str
    case: str
    check: str
    level: Level
    cells: tuple[VerdictEntry | None, ...]


@dataclass(frozen=True)
class SummaryRow:
    """A row of the summary table; `cells` pairs what was found with what is in print, None where unknown."""

    title: str
    cells: tuple[tuple[str | None, str | None], ...]


def matrix(results: ResultsDocument) -> list[MatrixRow]:
    """Return one row per (suite, case, check) that has a verdict, in the order in which they ran.

    A row has the heaviest level that any of its verdicts has.
    """
    found: dict[tuple[str, str, str], dict[str, VerdictEntry]] = {}
    for verdict in results.verdicts:
        found.setdefault((verdict.suite, verdict.case, verdict.check), {})[verdict.renderer] = verdict
    heaviest = list(Level).index
    return [
        MatrixRow(
            *key, min((each.level for each in row.values()), key=heaviest), tuple(map(row.get, results.renderers))
        )
        for key, row in found.items()
    ]


def summary(results: ResultsDocument) -> list[SummaryRow]:
    """Return the rows that the suites define (Table 6.3), with the printed values where the suites carry them."""
    return [
        SummaryRow(
            title,
            tuple((row.get(name), results.published_table.get(title, {}).get(name)) for name in results.renderers),
        )
        for title, row in results.table.items()
    ]


def by_suite(results: ResultsDocument) -> list[tuple[SuiteEntry | None, list[SummaryRow]]]:
    """Return the summary's rows in groups, each with its suite; None for rows of no suite."""
    left = {row.title: row for row in summary(results)}
    groups: list[tuple[SuiteEntry | None, list[SummaryRow]]] = [
        (suite, [left.pop(title) for title in suite.rows if title in left]) for suite in results.suites
    ]
    return [(suite, rows) for suite, rows in [*groups, (None, list(left.values()))] if rows]


def ran(results: ResultsDocument) -> str:
    """Describe how much ran, in one sentence: never fewer than planned without the reason."""
    sentence = f"{results.ran} of {results.planned} planned verdicts ran"
    return sentence if results.complete else f"{sentence}: incomplete, {results.reason}"


def markdown(results: ResultsDocument) -> str:
    """Return both tables as markdown, for a pull request or a wiki."""
    names = results.renderers
    parts = ["# hapticeval", f"{ran(results)}; seed {results.seed}."]
    groups = by_suite(results)
    if groups:
        parts.append("## Summary of the renderers' performance")
    for suite, group in groups:
        if suite is not None:
            parts.append(f"### {_escape(suite.title or suite.name)}")
            parts += [f"{_escape(suite.citation)}."] if suite.citation else []
        parts.append(aligned(["", *names], [[row.title, *(_answer(*cell) for cell in row.cells)] for row in group]))
    cells = [[f"{row.suite}/{row.case}", row.check, *map(_cell, row.cells)] for row in matrix(results)]
    if cells:
        parts += ["## Every check", aligned(["case", "check", *names], cells)]
    for title, lines in (
        ("Errors", [(run, f": {run.error.what}") for run in results.runs if run.error]),
        ("Ended early", [(run, f" {ended_words(run)}") for run in results.runs if run.ended]),
    ):
        told = [_escape(f"- {run.renderer} on {run.suite}/{run.case}{words}") for run, words in lines]
        parts += [f"## {title}", "\n".join(told)] if told else []
    return "\n\n".join(parts) + "\n"


def _answer(value: str | None, published: str | None) -> str:
    return value or "-" if published in (None, value) or value is None else f"**{value}** (published: {published})"


def _cell(verdict: VerdictEntry | None) -> str:
    if verdict is None:
        return ""
    text, standing = f"{SYMBOLS[verdict.outcome]} {verdict.outcome}", verdict.standing
    if standing in ("differs", "unexpected"):
        return f"**{text}**" + (f" (published: {verdict.published})" if standing == "differs" else "")
    return f"{text} ({standing})" if standing else text


def aligned(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a markdown table with its pipes aligned, so that it reads well as text too."""
    lines = [[_escape(text) for text in row] for row in (header, *rows)]
    widths = [max(3, *map(len, column)) for column in zip(*lines, strict=True)]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join(
        f"| {' | '.join(text.ljust(width) for text, width in zip(line, widths, strict=True))} |" for line in lines
    )


def _escape(text: str) -> str:
    """Text that cannot end its cell, nor start HTML."""
    return " ".join(text.replace("|", "\\|").replace("<", "&lt;").split())
