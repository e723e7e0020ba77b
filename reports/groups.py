"""The page by suites: its contents, the summary and the matrix of each, with only the renderers that ran there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hapticeval.reports.shown import ShownCase
from hapticeval.reports.table import MatrixRow, SummaryRow, by_suite, matrix, renderers, suite_names
from hapticeval.runner.results import ResultsDocument, SuiteEntry


@dataclass(frozen=True)
class ShownSuite:
    """One suite; `columns` are the numbers and names of its renderers, `judged` and `shown` its rows of the matrix."""

    anchor: str
    name: str
    title: str
    citation: str
    columns: Sequence[tuple[int, str]]
    cases: Sequence[ShownCase]
    contents: Sequence[Entry]
    judged: Sequence[MatrixRow]
    shown: Sequence[MatrixRow]


@dataclass(frozen=True)
class Entry:
    """A case in the contents, and those that are the same with a change, under what the change is called."""

    case: ShownCase
    variants: Sequence[tuple[str, ShownCase]]


@dataclass(frozen=True)
class ShownSummary:
    """The rows of one suite, or those of no suite, which have no title; `columns` are the renderers decided there."""

    title: str
    citation: str
    columns: Sequence[tuple[int, str]]
    rows: Sequence[SummaryRow]


def shown_suites(results: ResultsDocument, cases: Sequence[ShownCase]) -> list[ShownSuite]:
    """Every suite that ran, in that order."""
    names = renderers(results)
    rows = matrix(results)
    told = {suite.name: suite for suite in results.suites}
    return [
        _suite(f"s{index}", name, told.get(name), cases, rows, names) for index, name in enumerate(suite_names(results))
    ]


def _suite(
    anchor: str,
    name: str,
    told: SuiteEntry | None,
    cases: Sequence[ShownCase],
    rows: Sequence[MatrixRow],
    names: Sequence[str],
) -> ShownSuite:
    own = [case for case in cases if case.document.suite == name]
    given = [row for row in rows if row.suite == name]
    columns = [
        (index, each)
        for index, each in enumerate(names)
        if any(row.cells[index] for row in given) or any(run.column == index for case in own for run in case.runs)
    ]
    aside = {case.document.case for case in own if not case.document.judged}
    return ShownSuite(
        anchor,
        name,
        (told and told.title) or name,
        told.citation if told else "",
        columns,
        own,
        _contents(own),
        [row for row in given if row.case not in aside],
        [row for row in given if row.case in aside],
    )


def _contents(cases: Sequence[ShownCase]) -> list[Entry]:
    """A variant's title is that of its case, a comma and what is changed."""
    entries: list[tuple[ShownCase, list[tuple[str, ShownCase]]]] = []
    for case in cases:
        title = case.document.title
        if entries and title.startswith(f"{entries[-1][0].document.title}, "):
            entries[-1][1].append((title.removeprefix(f"{entries[-1][0].document.title}, "), case))
        else:
            entries.append((case, []))
    return [Entry(case, variants) for case, variants in entries]


def shown_summary(results: ResultsDocument) -> list[ShownSummary]:
    """The summary in the groups of `by_suite`, each with the renderers that have an answer in it."""
    names = renderers(results)
    return [
        ShownSummary(
            told.title if told else "",
            told.citation if told else "",
            [(index, name) for index, name in enumerate(names) if any(row.cells[index][0] for row in rows)],
            rows,
        )
        for told, rows in by_suite(results)
    ]
