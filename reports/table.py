"""The summary table as plain data, and the whole report as markdown that fits into a comment on a pull request."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from hapticeval.errors import printable
from hapticeval.quantity import name_first
from hapticeval.reports.grid import Grid, Tile, case_grid, gravest_first, hard_cases, headline, phenomenon_grid
from hapticeval.runner.results import Breakdown, ResultsDocument, SuiteEntry
from hapticeval.runner.standing import Standing, count_standings, counts_in_words

LIMIT = 60_000
"""Bytes of table.md: a comment on GitHub holds 65,536 characters."""

MOST_LISTED_VERDICTS = 50
"""Verdicts that are not as expected, and warnings, that are listed one by one."""

PLACES_NAMED = 5
"""Verdicts that are known for one reason, and cases refused for one, that are named."""


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
    # A row of several suites goes with the first; what no suite names comes last.
    unassigned = dict(results.table)
    groups: list[tuple[SuiteEntry | None, list[str]]] = []
    for suite in results.suites:
        groups.append((suite, [title for title in suite.rows if unassigned.pop(title, None) is not None]))
    groups.append((None, list(unassigned)))
    tables = [_summary(results, suite, titles) for suite, titles in groups if titles]
    return [table for table in tables if table.renderers]


def _summary(results: ResultsDocument, suite: SuiteEntry | None, titles: Sequence[str]) -> Summary:
    """Return one table: renderers that answered, and those of which only published answers exist."""
    answers = {title: results.table[title] for title in titles}
    published = {title: results.published_table.get(title, {}) for title in titles}
    # Only renderers that have an answer in this table.
    names = tuple(name for name in results.renderers if any(name in row for row in answers.values()))
    printed = tuple(dict.fromkeys(name for row in published.values() for name in row if name not in results.renderers))
    return Summary(
        suite,
        names,
        printed,
        tuple(
            SummaryRow(
                title,
                tuple((answers[title].get(name), published[title].get(name)) for name in names),
                tuple(published[title].get(name) for name in printed),
            )
            for title in titles
        ),
    )


def ran_words(results: ResultsDocument) -> str:
    """Describe how much ran, in one sentence: never fewer than planned without the reason."""
    sentence = f"{results.ran:,} of {results.planned:,} planned verdicts ran"
    return sentence if results.complete else f"{sentence}: incomplete, {results.reason}"


def provenance(results: ResultsDocument) -> str:
    """Return version, date, and the commits of the renderers' repositories, in one line."""
    parts = [f"hapticeval {results.environment.versions.get('hapticeval') or '?'}"]
    if results.date:
        parts.append(results.date[:16].replace("T", " ") + " UTC")
    groups = renderers_by_commit(results)
    # One commit for all renderers needs no names.
    is_one_commit = len(groups) == 1 and len(results.commits) == len(results.renderers)
    for commit, names in groups.items():
        several = f"{len(names)} renderers" if len(names) > 2 else " and ".join(names)
        parts.append(
            f"commit {short_commit(commit)}" if is_one_commit else f"{several} at commit {short_commit(commit)}"
        )
    return ", ".join(parts)


def renderers_by_commit(results: ResultsDocument) -> dict[str, list[str]]:
    """Return the renderers of each commit."""
    renderers: dict[str, list[str]] = {}
    for name, commit in results.commits.items():
        renderers.setdefault(commit, []).append(name)
    return renderers


def short_commit(commit: str) -> str:
    """Return a commit with twelve of its digits; whether files differ from it stays."""
    digits, hyphen, suffix = commit.partition("-")
    return digits[:12] + hyphen + suffix


def markdown(results: ResultsDocument) -> str:
    """Return the report as markdown, the summary first, at most `LIMIT` bytes: what is left out is said at the end."""
    # Bytes, with room for the last line and its number.
    parts, size = [], len(SECTIONS_LEFT_OUT.encode()) + 20
    blocks = list(_report_blocks(results))
    for number, block in enumerate(blocks):
        # Two line feeds between blocks.
        size += len(block.encode()) + 2
        if size > LIMIT:
            # Whole blocks are left out: a table cut in two would not be one.
            parts.append(SECTIONS_LEFT_OUT.format(count=len(blocks) - number))
            break
        parts.append(block)
    return "\n\n".join(parts) + "\n"


SECTIONS_LEFT_OUT = "{count} more sections are left out here, which results.json and the report have."
"""The last line of a report that is longer than a comment may be."""


def _report_blocks(results: ResultsDocument) -> Iterator[str]:
    """Yield the report's blocks of markdown, the most important first."""
    yield f"# hapticeval: {_escape(headline(results))}"
    standings = [verdict.standing for verdict in results.verdicts]
    yield f"{ran_words(results)}: {counts_in_words(standings)}."
    yield f"{_escape(provenance(results))}; seed {results.seed}."
    grid = phenomenon_grid(results)
    if grid.rows and grid.columns:
        yield "## Renderers by phenomena"
        yield _grid_table(grid, tile=_tile_words)
        legend = "; ".join(
            f"{standing.symbol} {standing.words}: {standing.meaning}" for standing, _ in count_standings(standings)
        )
        yield f"Of the worst verdict: what is left of its bound, or by how many times it is beyond. {legend}."
    groups = summaries(results)
    if groups:
        yield "## Summary of the renderers' performance"
    for summary in groups:
        if summary.suite is not None and len(groups) > 1:
            yield f"### {_escape(summary.suite.title or summary.suite.name)}"
        heading = ["", *summary.renderers, *(f"{name} (in print)" for name in summary.printed)]
        yield aligned_table(
            heading,
            [
                [row.title, *(_answer_words(*cell) for cell in row.cells), *(cell or "-" for cell in row.printed)]
                for row in summary.rows
            ],
        )
    if results.table_notes:
        yield "\n".join(_escape(f"- {note}") for note in results.table_notes)
    yield from _list_blocks(results)
    names, digits = hard_cases(results)
    if digits:
        yield "## Digits that are kept in hard cases"
        digit_rows = [
            [f"{row.suite}/{row.case}", *("" if n is None else str(n) for n, _ in row.cells)] for row in digits
        ]
        yield aligned_table(["case", *names], digit_rows)
    for suite in dict.fromkeys(entry.suite for entry in results.entries()):
        by_case = case_grid(results, suite)
        if by_case.rows:
            yield f"## Every case of {_escape(suite)}"
            yield _grid_table(by_case, tile=lambda tile: tile.standing.symbol)


def _list_blocks(results: ResultsDocument) -> Iterator[str]:
    """Yield lists of what broke, of verdicts that need a look, and of runs that ended early."""
    broken = results.breakdowns
    if broken:
        yield "## What broke"
        yield "\n".join(_escape(f"- {_breakdown_words(breakdown)}") for breakdown in broken[:MOST_LISTED_VERDICTS])
    # What broken runs took away is listed with what broke.
    grave = [
        breakdown
        for breakdown in gravest_first(results.verdicts)
        if breakdown.standing.unexpected and not results.lost(breakdown)
    ]
    warned = [
        verdict
        for verdict in gravest_first(results.verdicts)
        if verdict.standing in (Standing.WARNING, Standing.OUTDATED)
    ]
    warnings = "Warnings" + ", which stop the gate by --strict" * results.command.strict
    for title, verdicts in (("Not as expected, the worst first", grave), (warnings, warned)):
        if verdicts:
            lines = []
            for verdict in verdicts[:MOST_LISTED_VERDICTS]:
                published = f", published {verdict.published}" if verdict.published else ""
                figures = verdict.measured
                place = f"{verdict.renderer} on {verdict.suite}/{verdict.case}/{verdict.check}"
                lines.append(
                    f"- {verdict.standing.symbol} {place}: {verdict.outcome}{published}; {figures or verdict.message}"
                )
            lines += [f"- and {len(verdicts) - MOST_LISTED_VERDICTS} more"] * (len(verdicts) > MOST_LISTED_VERDICTS)
            yield f"## {title}"
            yield "\n".join(map(_escape, lines))
    reasons: dict[tuple[str, str], list[str]] = {}
    for verdict in results.verdicts:
        if verdict.known and verdict.standing is Standing.KNOWN:
            reasons.setdefault((verdict.renderer, verdict.known), []).append(verdict.place)
    for title, places_by_reason in (("Known", reasons), ("Refused", results.refusals)):
        if places_by_reason:
            yield f"## {title}"
            yield "\n".join(
                _escape(f"- {renderer}: {reason}: {name_first(places, PLACES_NAMED)}")
                for (renderer, reason), places in list(places_by_reason.items())[:MOST_LISTED_VERDICTS]
            )
    ended = [f"{run.renderer} on {run.suite}/{run.case} {run.ended_words}" for run in results.runs if run.ended]
    if ended:
        yield "## Ended early"
        yield "\n".join(_escape(f"- {line}") for line in ended[:MOST_LISTED_VERDICTS])


def _breakdown_words(broken: Breakdown) -> str:
    error, cases = broken.error, broken.cases
    why = f"; {error.why}" * bool(error.why)
    return f"{broken.words}; {error.what}{why}" + f" (first on {', then '.join(cases)})" * bool(cases)


def _tile_words(tile: Tile) -> str:
    """Return a cell in words: its gravest state, how many verdicts have it, and the worst margin."""
    count = tile.counts[tile.standing]
    words = [f"{tile.standing.symbol} {tile.standing.words}"]
    words += [f"{count} of {tile.total}"] * (tile.standing is not Standing.PASS)
    return ", ".join([*words, *([tile.margin] if tile.margin else [])])


def _grid_table(grid: Grid, *, tile: Callable[[Tile], str]) -> str:
    rows = [[name, *("" if cell is None else tile(cell) for cell in tiles)] for name, tiles in grid.rows]
    return aligned_table(["", *grid.columns], rows)


def _answer_words(value: str | None, published: str | None) -> str:
    return value or "-" if published in (None, value) or value is None else f"**{value}** (published: {published})"


def aligned_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a markdown table with its pipes aligned, so that it reads well as text too."""
    lines = [[_escape(text) for text in row] for row in (header, *rows)]
    # Markdown wants three hyphens at least.
    widths = [max(3, *map(len, column)) for column in zip(*lines, strict=True)]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join(
        f"| {' | '.join(text.ljust(width) for text, width in zip(line, widths, strict=True))} |" for line in lines
    )


def _escape(text: str) -> str:
    """Text that cannot end its cell, nor start HTML."""
    # A pipe would end the cell, < begin HTML, a line feed the row.
    return printable(" ".join(text.replace("|", "\\|").replace("<", "&lt;").split()))
