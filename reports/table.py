"""The tables of results, as plain data that all formats are written from; and the report in Markdown for a comment."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hapticeval.files import file_stem
from hapticeval.quantity import name_first
from hapticeval.reports.grid import Grid, Tile, case_grid, gravest_first, hard_cases, headline, phenomenon_grid
from hapticeval.runner.results import Breakdown, ResultsDocument, SuiteEntry, VerdictEntry
from hapticeval.runner.standing import Standing, count_standings, counts_in_words
from hapticeval.table import Cell, Table, markdown_text

LIMIT = 60_000
"""Bytes of table.md: a comment on GitHub holds 65,536 characters."""

MOST_LISTED_VERDICTS = 50
"""Verdicts that are not as expected, and warnings, that are listed one by one."""

PLACES_NAMED = 5
"""Verdicts that are known for one reason, and cases refused for one, that are named."""


CITED_TABLE = re.compile(r"Table \d+\.\d+")

NOTHING = "--"
"""Stands where nothing was decided, counted or published."""


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

    @property
    def number(self) -> str:
        """The table in print that it is, as "Table 6.3"; "" where its suite cites none."""
        cited = CITED_TABLE.search(self.suite.citation) if self.suite else None
        return cited[0] if cited else ""


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
    # Only renderers that have an answer in this table; those in print first, in its order.
    in_print = dict.fromkeys(name for row in published.values() for name in row)
    answered = [name for name in results.renderers if any(name in row for row in answers.values())]
    names = (*(name for name in in_print if name in answered), *(name for name in answered if name not in in_print))
    printed = tuple(name for name in in_print if name not in results.renderers)
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


def summary_table(summary: Summary) -> Table:
    """Return a summary as a table, with what is published where it differs."""
    name = "summary" if summary.suite is None else f"summary-{file_stem(summary.suite.name)}"
    header = ["", *summary.renderers, *(f"{printed} (in print)" for printed in summary.printed)]
    rows: list[list[str | Cell]] = [
        [row.title, *(_answer_cell(*cell) for cell in row.cells), *(value or NOTHING for value in row.printed)]
        for row in summary.rows
    ]
    return Table(name, header, rows, "Summary of the renderers' performance")


def _answer_cell(answer: str | None, published: str | None) -> Cell:
    """Return an answer with the published one where it differs; no answer contradicts nothing."""
    if answer is None:
        return Cell(NOTHING)
    if published in (None, answer):
        return Cell(answer, {"Yes": "good", "No": "noted"}.get(answer, ""))
    return Cell(f"{answer} (published: {published})", "bad")


def grid_table(name: str, grid: Grid, *, signs: bool = False, caption: str = "") -> Table:
    """Return a grid of tiles as a table, each in words, or by its sign alone."""
    rows = [
        [title, *(_tile_cell(tile, signs=signs) if tile is not None else "" for tile in tiles)]
        for title, tiles in grid.rows
    ]
    return Table(name, ["", *grid.columns], rows, caption)


def _tile_cell(tile: Tile, *, signs: bool) -> Cell:
    """Return a tile's gravest state, how many verdicts have it, and the worst margin; or its sign alone."""
    if signs:
        return Cell("", mark=tile.standing.symbol)
    count = f"{tile.counts[tile.standing]} of {tile.total}"
    return Cell(", ".join(filter(None, (tile.standing.words, count, tile.margin))), mark=tile.standing.symbol)


PHENOMENA_CAPTION = (
    "Phenomena by renderers: the gravest outcome, how many of the verdicts have it, and for the worst of them how much "
    "of its bound is left, or how many times its bound it is"
)
"""The caption of the table of phenomena, which explains its cells."""


def tables(results: ResultsDocument) -> Iterator[Table]:
    """Yield the tables that the results fill: summary, renderers by phenomena, digits, closed forms, every verdict."""
    yield from map(summary_table, summaries(results))
    grid = phenomenon_grid(results)
    if grid.rows and grid.columns:
        yield grid_table("phenomena", grid, caption=PHENOMENA_CAPTION)
    names, digits = hard_cases(results)
    if digits:
        rows = [
            [f"{row.suite}/{row.case}", *(NOTHING if count is None else str(count) for count, _ in row.cells)]
            for row in digits
        ]
        yield Table("hard-cases", ["case", *names], rows, "Decimal digits that are kept in hard cases")
    moments = list(_closed_form_rows(results))
    if moments:
        header = ["case", "renderer", "law", "time (s)", "measured (mm)", "closed form (mm)"]
        yield Table("closed-forms", header, moments, "Distances from the surface beside the closed forms")
    fields = ("suite", "case", "renderer", "check", "level", "outcome")
    yield Table(
        "verdicts",
        [*fields, "state", "published", "metric", "value", "unit", "bound", "margin", "message"],
        [
            [
                *(str(getattr(verdict, name)) for name in fields), verdict.standing, str(verdict.published or ""),
                *_metric_cells(verdict), _number_text(verdict.bound), _number_text(verdict.margin), verdict.message,
            ]
            for verdict in results.verdicts
        ],
    )  # fmt: skip


def _number_text(value: float | None) -> str:
    return "" if value is None else repr(value)


def _metric_cells(verdict: VerdictEntry) -> tuple[str, str, str]:
    """Return a metric's name, value and unit; three empty cells where nothing was measured."""
    metric = verdict.metric
    return (metric.name, _number_text(metric.value), metric.unit) if metric else ("", "", "")


def _closed_form_rows(results: ResultsDocument) -> Iterator[list[str]]:
    """Yield a row for each moment at which a run is compared with a closed form, distances in mm."""
    for verdict in results.verdicts:
        for moment in verdict.evidence.get("moments", ()):
            values = (moment.get("measured_distance"), moment.get("closed_form_distance"))
            law = str(verdict.evidence.get("law", ""))
            distances = ["" if value is None else f"{1e3 * value:.6f}" for value in values]
            yield [f"{verdict.suite}/{verdict.case}", verdict.renderer, law, f"{moment['time']:g}", *distances]


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
    yield f"# hapticeval: {markdown_text(headline(results))}"
    standings = [verdict.standing for verdict in results.verdicts]
    yield f"{ran_words(results)}: {counts_in_words(standings)}."
    yield f"{markdown_text(provenance(results))}; seed {results.seed}."
    grid = phenomenon_grid(results)
    if grid.rows and grid.columns:
        yield "## Renderers by phenomena"
        yield grid_table("phenomena", grid).markdown
        legend = "; ".join(
            f"{standing.symbol} {standing.words}: {standing.meaning}" for standing, _ in count_standings(standings)
        )
        yield f"Of the worst verdict: what is left of its bound, or by how many times it is beyond. {legend}."
    groups = summaries(results)
    if groups:
        yield "## Summary of the renderers' performance"
    for summary in groups:
        if summary.suite is not None and len(groups) > 1:
            yield f"### {markdown_text(summary.suite.title or summary.suite.name)}"
        yield summary_table(summary).markdown
    if results.table_notes:
        yield "\n".join(markdown_text(f"- {note}") for note in results.table_notes)
    yield from _list_blocks(results)
    for table in tables(results):
        if table.name == "hard-cases":
            yield "## Digits that are kept in hard cases"
            yield table.markdown
    for suite in dict.fromkeys(entry.suite for entry in results.entries()):
        by_case = case_grid(results, suite)
        if by_case.rows:
            yield f"## Every case of {markdown_text(suite)}"
            yield grid_table("cases", by_case, signs=True).markdown


def _list_blocks(results: ResultsDocument) -> Iterator[str]:
    """Yield lists of what broke, of verdicts that need a look, and of runs that ended early."""
    broken = results.breakdowns
    if broken:
        yield "## What broke"
        yield "\n".join(
            markdown_text(f"- {_breakdown_words(breakdown)}") for breakdown in broken[:MOST_LISTED_VERDICTS]
        )
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
            yield "\n".join(map(markdown_text, lines))
    reasons: dict[tuple[str, str], list[str]] = {}
    for verdict in results.verdicts:
        if verdict.known and verdict.standing is Standing.KNOWN:
            reasons.setdefault((verdict.renderer, verdict.known), []).append(verdict.place)
    for title, places_by_reason in (("Known", reasons), ("Refused", results.refusals)):
        if places_by_reason:
            yield f"## {title}"
            yield "\n".join(
                markdown_text(f"- {renderer}: {reason}: {name_first(places, PLACES_NAMED)}")
                for (renderer, reason), places in list(places_by_reason.items())[:MOST_LISTED_VERDICTS]
            )
    ended = [f"{run.renderer} on {run.suite}/{run.case} {run.ended_words}" for run in results.runs if run.ended]
    if ended:
        yield "## Ended early"
        yield "\n".join(markdown_text(f"- {line}") for line in ended[:MOST_LISTED_VERDICTS])


def _breakdown_words(broken: Breakdown) -> str:
    error, cases = broken.error, broken.cases
    words = "; ".join(filter(None, (broken.words, error.what, error.why)))
    return f"{words} (first on {', then '.join(cases)})" if cases else words
