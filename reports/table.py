"""The summary table as plain data, and the whole report as markdown that fits into a comment on a pull request."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from hapticeval.errors import printable
from hapticeval.reports.grid import (
    MEANING,
    Grid,
    State,
    Tile,
    cases,
    counted,
    hard_cases,
    headline,
    ordered,
    phenomena,
    state,
)
from hapticeval.reports.grid import SYMBOLS as SIGNS
from hapticeval.reports.scene_words import ended_words
from hapticeval.runner.results import Breakdown, ResultsDocument, SuiteEntry

SYMBOLS = {"pass": "✓", "fail": "✗", "inconclusive": "?", "not-applicable": "-", "error": "!"}

LIMIT = 60_000
"""Bytes of table.md: a comment on GitHub holds 65,536 characters."""

FEW = 50
"""Verdicts that are not as expected, and warnings, that are listed one by one."""


@dataclass(frozen=True)
class SummaryRow:
    """A row of a summary table: `cells` pairs found and published by renderer, `printed` holds what is only in print.

    None where nothing was decided or published.
    """

    title: str
    cells: tuple[tuple[str | None, str | None], ...]
    printed: tuple[str | None, ...]


@dataclass(frozen=True)
class Summary:
    """The table of a suite (Table 6.3); of no suite where `suite` is None.

    `renderers` ran and have an answer in it; those of `printed` did not run, and their answers are published.
    """

    suite: SuiteEntry | None
    renderers: tuple[str, ...]
    printed: tuple[str, ...]
    rows: tuple[SummaryRow, ...]


def summaries(results: ResultsDocument) -> list[Summary]:
    """Return the tables that the suites define, with the published answers beside and of other renderers."""
    left = dict(results.table)
    groups: list[tuple[SuiteEntry | None, list[str]]] = []
    for suite in results.suites:
        groups.append((suite, [title for title in suite.rows if left.pop(title, None) is not None]))
    groups.append((None, list(left)))
    made = [_summary(results, suite, titles) for suite, titles in groups if titles]
    return [each for each in made if each.renderers]


def _summary(results: ResultsDocument, suite: SuiteEntry | None, titles: Sequence[str]) -> Summary:
    found = {title: results.table[title] for title in titles}
    published = {title: results.published_table.get(title, {}) for title in titles}
    names = tuple(name for name in results.renderers if any(name in row for row in found.values()))
    printed = tuple(dict.fromkeys(name for row in published.values() for name in row if name not in results.renderers))
    return Summary(
        suite,
        names,
        printed,
        tuple(
            SummaryRow(
                title,
                tuple((found[title].get(name), published[title].get(name)) for name in names),
                tuple(published[title].get(name) for name in printed),
            )
            for title in titles
        ),
    )


def ran(results: ResultsDocument) -> str:
    """Describe how much ran, in one sentence: never fewer than planned without the reason."""
    sentence = f"{results.ran:,} of {results.planned:,} planned verdicts ran"
    return sentence if results.complete else f"{sentence}: incomplete, {results.reason}"


def provenance(results: ResultsDocument) -> str:
    """Return version, date, and the commits of the renderers' repositories, in one line."""
    parts = [f"hapticeval {results.environment.versions.get('hapticeval') or '?'}"]
    if results.date:
        parts.append(results.date[:16].replace("T", " ") + " UTC")
    found = by_commit(results)
    alone = len(found) == 1 and len(results.commits) == len(results.renderers)
    for commit, names in found.items():
        several = f"{len(names)} renderers" if len(names) > 2 else " and ".join(names)
        parts.append(f"commit {short(commit)}" if alone else f"{several} at commit {short(commit)}")
    return ", ".join(parts)


def by_commit(results: ResultsDocument) -> dict[str, list[str]]:
    """Return the renderers of each commit."""
    found: dict[str, list[str]] = {}
    for name, commit in results.commits.items():
        found.setdefault(commit, []).append(name)
    return found


def short(commit: str) -> str:
    """Return a commit with twelve of its digits; whether files differ from it stays."""
    digits, hyphen, rest = commit.partition("-")
    return digits[:12] + hyphen + rest


def counts_words(results: ResultsDocument) -> str:
    """Return how many verdicts have each state, in words."""
    return ", ".join(f"{count:,} {each.many}" for each, count in counted(results))


def markdown(results: ResultsDocument) -> str:
    """Return the report as markdown, the summary first, at most `LIMIT` bytes: what is left out is said at the end."""
    parts, size = [], len(LEFT_OUT.encode()) + 20
    blocks = list(_blocks(results))
    for number, block in enumerate(blocks):
        size += len(block.encode()) + 2
        if size > LIMIT:
            parts.append(LEFT_OUT.format(count=len(blocks) - number))
            break
        parts.append(block)
    return "\n\n".join(parts) + "\n"


LEFT_OUT = "{count} more sections are left out here, which results.json and the report have."


def _blocks(results: ResultsDocument) -> Iterator[str]:
    yield f"# hapticeval: {_escape(headline(results))}"
    yield f"{ran(results)}: {counts_words(results) or 'none'}."
    yield f"{_escape(provenance(results))}; seed {results.seed}."
    grid = phenomena(results)
    if grid.rows and grid.columns:
        yield "## Renderers by phenomena"
        yield _grid(grid, tile=_tile)
        yield f"Of the worst verdict: what is left of its bound, or by how many times it is beyond. {_legend(results)}"
    groups = summaries(results)
    if groups:
        yield "## Summary of the renderers' performance"
    for each in groups:
        if each.suite is not None and len(groups) > 1:
            yield f"### {_escape(each.suite.title or each.suite.name)}"
        heading = ["", *each.renderers, *(f"{name} (in print)" for name in each.printed)]
        yield aligned(
            heading,
            [
                [row.title, *(_answer(*cell) for cell in row.cells), *(cell or "-" for cell in row.printed)]
                for row in each.rows
            ],
        )
    yield from _lists(results)
    names, digits = hard_cases(results)
    if digits:
        yield "## Digits that are kept in hard cases"
        shown = [[f"{row.suite}/{row.case}", *("" if n is None else str(n) for n, _ in row.cells)] for row in digits]
        yield aligned(["case", *names], shown)
    for suite in dict.fromkeys(each.suite for each in results.entries()):
        by_case = cases(results, suite)
        if by_case.rows:
            yield f"## Every case of {_escape(suite)}"
            yield _grid(by_case, tile=lambda tile: SIGNS[tile.state])


def _lists(results: ResultsDocument) -> Iterator[str]:
    broken = results.breakdowns
    if broken:
        yield "## What broke"
        yield "\n".join(_escape(f"- {_broke(each)}") for each in broken[:FEW])
    grave = [each for each in ordered(results.verdicts) if state(each).grave and not results.lost(each)]
    warned = [each for each in ordered(results.verdicts) if state(each) is State.WARNING]
    for title, given in (("Not as expected, the worst first", grave), ("Warnings", warned)):
        if given:
            lines = []
            for each in given[:FEW]:
                published = f", published {each.published}" if each.published else ""
                figures = each.measured
                place = f"{each.renderer} on {each.suite}/{each.case}/{each.check}"
                lines.append(f"- {SIGNS[state(each)]} {place}: {each.outcome}{published}; {figures or each.message}")
            lines += [f"- and {len(given) - FEW} more"] * (len(given) > FEW)
            yield f"## {title}"
            yield "\n".join(map(_escape, lines))
    ended = [f"{run.renderer} on {run.suite}/{run.case} {ended_words(run)}" for run in results.runs if run.ended]
    if ended:
        yield "## Ended early"
        yield "\n".join(_escape(f"- {each}") for each in ended[:FEW])


def _broke(broken: Breakdown) -> str:
    error, cases = broken.error, broken.cases
    why = f"; {error.why}" * bool(error.why)
    return f"{broken.words}; {error.what}{why}" + f" (first on {', then '.join(cases)})" * bool(cases)


def _legend(results: ResultsDocument) -> str:
    return "; ".join(f"{SIGNS[each]} {each.words}: {MEANING[each]}" for each, _ in counted(results)) + "."


def _tile(tile: Tile) -> str:
    count = tile.counts[tile.state]
    words = [f"{SIGNS[tile.state]} {tile.state.words}"]
    words += [f"{count} of {tile.total}"] * (tile.state is not State.PASS)
    return ", ".join([*words, *([tile.margin] if tile.margin else [])])


def _grid(grid: Grid, *, tile: Callable[[Tile], str]) -> str:
    rows = [[name, *("" if each is None else tile(each) for each in tiles)] for name, tiles in grid.rows]
    return aligned(["", *grid.columns], rows)


def _answer(value: str | None, published: str | None) -> str:
    return value or "-" if published in (None, value) or value is None else f"**{value}** (published: {published})"


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
    return printable(" ".join(text.replace("|", "\\|").replace("<", "&lt;").split()))
