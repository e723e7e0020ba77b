"""The tables of a report for papers and programs: CSV and LaTeX."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TypeVar

import msgspec

from hapticeval.errors import NothingSelectedError, UnknownNameError, printable
from hapticeval.files import csv_cell, file_stem, write_text
from hapticeval.quantity import parse_paper_length
from hapticeval.reports.grid import Tile, hard_cases, phenomenon_grid
from hapticeval.reports.table import provenance, summaries
from hapticeval.runner.results import ResultsDocument, RunEntry, Table, VerdictEntry, unknown_renderer

TABLES_FOLDER = "tables"
"""The folder of the tables, beside the results."""

PHENOMENA_CAPTION = (
    "Phenomena by renderers: the gravest outcome, how many of the verdicts have it, and for the worst of them how much "
    "of its bound is left, or how many times its bound it is"
)
"""The caption of the table of phenomena, which explains its cells."""


@dataclass(frozen=True)
class Sheet:
    """A table as plain text; with a `caption` it is written as LaTeX too."""

    name: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""

    @property
    def columns(self) -> list[tuple[str, ...]]:
        """The cells of each column below its heading."""
        return list(zip(self.header, *self.rows, strict=True))


def sheets(results: ResultsDocument) -> Iterator[Sheet]:
    """Yield the tables that the results fill: summary, renderers by phenomena, digits, closed forms, every verdict."""
    for summary in summaries(results):
        cells = [
            [row.title, *(_answer_words(*cell) for cell in row.cells), *(value or "--" for value in row.printed)]
            for row in summary.rows
        ]
        name = "summary" if summary.suite is None else f"summary-{file_stem(summary.suite.name)}"
        header = ["", *summary.renderers, *(f"{name} (in print)" for name in summary.printed)]
        yield Sheet(name, header, cells, "Summary of the renderers' performance")
    grid = phenomenon_grid(results)
    if grid.rows and grid.columns:
        # Phenomena down, renderers across: two renderers fit into a column of a paper.
        cells = [
            [phenomenon, *(_tile_words(tiles[number]) for _, tiles in grid.rows)]
            for number, phenomenon in enumerate(grid.columns)
        ]
        yield Sheet("phenomena", ["phenomenon", *(name for name, _ in grid.rows)], cells, PHENOMENA_CAPTION)
    names, digits = hard_cases(results)
    if digits:
        cells = [[row.case, *("--" if count is None else str(count) for count, _ in row.cells)] for row in digits]
        yield Sheet("hard-cases", ["case", *names], cells, "Decimal digits that are kept in hard cases")
    moments = list(_closed_form_rows(results))
    if moments:
        header = ["case", "renderer", "law", "time (s)", "measured (mm)", "closed form (mm)"]
        yield Sheet("closed-forms", header, moments, "Distances from the surface beside the closed forms")
    fields = ("suite", "case", "renderer", "check", "level", "outcome")
    yield Sheet(
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


def _answer_words(value: str | None, published: str | None) -> str:
    # What is published is named only where it differs.
    return value or "--" if published in (None, value) or value is None else f"{value} (published: {published})"


def _tile_words(tile: Tile | None) -> str:
    """Return a cell in words: its gravest state, how many verdicts have it, and the worst margin."""
    if tile is None:
        return ""
    count = tile.counts[tile.standing]
    words = f"{tile.standing.words}, {count} of {tile.total}"
    return f"{words}, {tile.margin}" if tile.margin else words


def _number_text(value: float | None) -> str:
    return "" if value is None else repr(value)


def write_tables(directory: Path, results: ResultsDocument) -> Path:
    """Write each table as CSV, and those with a caption as LaTeX (booktabs), into `directory`/tables; return that.

    Raises `HapticevalError` where they cannot be written.
    """
    folder = directory / TABLES_FOLDER
    for sheet in sheets(results):
        texts = {"csv": _csv_text(sheet)}
        if sheet.caption:
            texts["tex"] = _latex_text_of(sheet, results)
        for kind, text in texts.items():
            write_text(folder / f"{sheet.name}.{kind}", text)
    return folder


def _csv_text(sheet: Sheet) -> str:
    """Return a table as CSV, in which a cell that a spreadsheet would run as a formula is escaped."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(map(csv_cell, cells) for cells in (sheet.header, *sheet.rows))
    return text.getvalue()


LATEX_ESCAPES = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "×": r"$\times$", "∞": r"$\infty$",  # noqa: RUF001
    **{sign: f"\\{sign}" for sign in "&%$#_{}"}, **{sign: rf"{sign}\allowbreak{{}}" for sign in "+@/"},
}  # fmt: skip
"""Signs that LaTeX would take for commands, or that a long name may be broken after."""

TIED_SPACE = re.compile(r"(?<=\d) (?=%)|(?<=%) (?=left)|(?<=\d) (?=of \d)|(?<=\d of) (?=\d)")
"""A space at which no line is broken: that in 91 % left, or in 1 of 5."""


def latex_table(
    results: ResultsDocument,
    table: str = "phenomena",
    *,
    renderers: Sequence[str] = (),
    rows: Sequence[str] = (),
    width: str | None = None,
) -> str:
    """Return one table as LaTeX (booktabs), small enough for a line of `width` on paper, such as "88mm".

    `table` is one of `sheets`; `renderers` are its columns or rows, in this order, and `rows` globs on the first cell
    of a row: all, if none are named. Without a width the line is that of an article on A4.

    Raises `UnknownNameError` for a table or a renderer that is not there, `NothingSelectedError` for a glob without a
    row, and as `parse_paper_length` does.
    """
    characters = 1.0 if width is None else parse_paper_length(width, option="width") / LINE_WIDTH
    for name in renderers:
        if name not in results.renderers:
            raise unknown_renderer(name, results.renderers)
    chosen = results_of(results, renderers) if renderers else results
    tables = {sheet.name: sheet for sheet in sheets(chosen)}
    # Each suite that has a printed table fills a summary of its own: the one that there is needs no suite's name.
    of_suites = [name for name in tables if name.startswith("summary-")]
    if table == "summary" and len(of_suites) == 1:
        table = of_suites[0]
    if table not in tables:
        raise UnknownNameError("table of these results", table, tables)
    sheet = tables[table]
    for glob in rows:
        if not any(fnmatchcase(row[0], glob) for row in sheet.rows):
            raise NothingSelectedError(
                f"no row of '{table}' matches {glob!r}",
                why="a glob is matched against the first cell",
                todo=f"for instance '{sheet.rows[0][0]}'" if sheet.rows else "",
            )
    kept_rows = [row for row in sheet.rows if not rows or any(fnmatchcase(row[0], glob) for glob in rows)]
    return _latex_text_of(replace(sheet, rows=kept_rows, caption=sheet.caption or "Verdicts"), chosen, characters)


def results_of(results: ResultsDocument, renderers: Sequence[str]) -> ResultsDocument:
    """Return the results of these renderers alone, in this order."""
    order = {name: number for number, name in enumerate(renderers)}

    def chosen(entries: Sequence[Entry]) -> list[Entry]:
        return sorted((entry for entry in entries if entry.renderer in order), key=lambda entry: order[entry.renderer])

    verdicts = chosen(results.verdicts)

    def columns(table: Table) -> Table:
        return {title: {name: row[name] for name in renderers if name in row} for title, row in table.items()}

    suites = [
        msgspec.structs.replace(suite, renderers=[name for name in renderers if name in suite.renderers])
        for suite in results.suites
    ]
    return msgspec.structs.replace(
        results, runs=chosen(results.runs), verdicts=verdicts, table=columns(results.table), suites=suites,
        published_table=columns(results.published_table), ran=len(verdicts),
        commits={name: commit for name, commit in results.commits.items() if name in order},
        planned=len(verdicts) + results.planned - results.ran,
    )  # fmt: skip


Entry = TypeVar("Entry", RunEntry, VerdictEntry)


def _latex_text_of(sheet: Sheet, results: ResultsDocument, line: float = 1.0) -> str:
    """Return a table as LaTeX with the packages that it needs, in several parts where its columns do not fit.

    `line` is the width of a line as a share of `LINE_WIDTH`.
    """
    parts = [_latex_table(part, line) for part in _parts_that_fit(sheet, line)]
    head = f"% {provenance(results)}\n% \\usepackage{{booktabs,array,longtable}}\n{FLOAT_HINT}"
    return head + "\n".join(parts)


def _parts_that_fit(sheet: Sheet, line: float) -> Iterator[Sheet]:
    """Yield the table, or parts of it whose columns fit into a line by their longest words, each with the first one."""
    width = line * LINE_CHARACTERS[SMALLEST_LETTERS]
    words = [_longest_word(column) + COLUMN_GAP for column in sheet.columns]
    groups: list[list[int]] = [[]]
    for column in range(1, len(words)):
        if groups[-1] and words[0] + sum(words[other] for other in groups[-1]) + words[column] > width:
            groups.append([])
        groups[-1].append(column)
    for number, group in enumerate(groups):
        columns = [0, *group]
        count = f" ({number + 1} of {len(groups)})" if len(groups) > 1 else ""
        yield replace(
            sheet,
            name=f"{sheet.name}-{number + 1}" if count else sheet.name,
            header=[sheet.header[column] for column in columns],
            rows=[[row[column] for column in columns] for row in sheet.rows],
            caption=sheet.caption + count,
        )


def _longest_word(column: Sequence[str]) -> int:
    """Return the longest part of a column's cells that is not broken: at spaces, and after signs of LATEX_ESCAPES."""
    cells = (TIED_SPACE.sub("_", cell) for cell in column)
    return max(len(word) for cell in cells for word in re.split(r"\s|(?<=\w)[-+@/]", cell))


def _latex_table(sheet: Sheet, line: float) -> str:
    """Return a table as LaTeX, small enough for a line. What is set before a float does not reach into it."""
    columns, size = _latex_columns(sheet, line)
    head, *rows = (" & ".join(map(_latex_text, cells)) + r" \\" for cells in (sheet.header, *sheet.rows))
    head_lines = [r"\toprule", head, r"\midrule"]
    caption, label = rf"\caption{{{sheet.caption}}}", rf"\label{{tab:{sheet.name}}}"
    # The size has to hold inside the table's own group.
    group_begin, group_end = (f"{{{size}\\setlength{{\\tabcolsep}}{{2pt}}\n", "}") if size else ("", "")
    # A float fits one page at most.
    if len(rows) > LONG_TABLE_ROWS:
        lines = [
            rf"{group_begin}\begin{{longtable}}{{{columns}}}",
            rf"{caption} {label} \\", *head_lines, r"\endfirsthead",
            rf"\caption[]{{{sheet.caption}}} \\", *head_lines, r"\endhead",
            r"\midrule", rf"\multicolumn{{{len(sheet.header)}}}{{r}}{{Continued on next page}} \\",
            r"\midrule", r"\endfoot", r"\bottomrule", r"\endlastfoot",
            *rows, rf"\end{{longtable}}{group_end}",
        ]  # fmt: skip
    else:
        lines = [
            r"\begin{table}[tbp]", r"\centering",
            r"\setlength{\belowcaptionskip}{6pt}",  # classes leave no room between a caption and a table below it
            caption, label, rf"{group_begin}\begin{{tabular}}{{{columns}}}",
            *head_lines, *rows, r"\bottomrule", rf"\end{{tabular}}{group_end}", r"\end{table}",
        ]  # fmt: skip
    return "".join(f"{line_text}\n" for line_text in lines)


FLOAT_HINT = "% [tbp]: at the top or bottom of a column, or on a page of floats; table* is as wide as the page.\n"
"""A comment on where a table comes to stand."""

LONG_TABLE_ROWS = 40
"""Rows from which on a table goes over several pages."""

LINE_WIDTH = 0.1214
"""Metres of a line of an article on A4 with letters of 10 points: 345 points."""

LINE_CHARACTERS = {"": 66, r"\footnotesize": 78, r"\scriptsize": 88}
"""Characters that fit beside each other into such a line, by the size of the letters."""

SMALLEST_LETTERS = r"\scriptsize"
"""The smallest letters that are used: of 7 points where the text has 10."""

COLUMN_GAP = 2
"""Characters that the gap between two columns takes."""


def _latex_columns(sheet: Sheet, line: float) -> tuple[str, str]:
    """Return the columns of a table for LaTeX, and the size of its letters.

    Those of a wide one are as wide as their longest words, and share what is left by how much they hold.
    """
    columns = sheet.columns
    longest = [max(map(len, column)) for column in columns]
    # All cells fit on a line each: as large as they may be.
    for size, line_capacity in LINE_CHARACTERS.items():
        if sum(longest) + COLUMN_GAP * len(columns) <= line * line_capacity:
            return "l" * len(columns), size
    words = [_longest_word(column) + COLUMN_GAP for column in columns]
    small = [size for size in LINE_CHARACTERS if size and sum(words) <= line * LINE_CHARACTERS[size]]
    size = small[0] if small else SMALLEST_LETTERS
    characters = line * LINE_CHARACTERS[size]
    room = [max(cell_width + COLUMN_GAP - word_width, 0) for cell_width, word_width in zip(longest, words, strict=True)]
    # What is left of the line, as a share of what the cells would still take.
    free = max(characters - sum(words), 0) / max(sum(room), 1)
    widths = [word_width + min(free, 1.0) * extra - COLUMN_GAP for word_width, extra in zip(words, room, strict=True)]
    # From characters to shares of the line.
    scale = 1.0 / max(characters, sum(words))
    return "".join(rf">{{\raggedright\arraybackslash}}p{{{scale * width:.3f}\linewidth}}" for width in widths), size


def _latex_text(text: str) -> str:
    # A minus, not a hyphen, before a number.
    sign, text = (r"$-$", text[1:]) if re.match(r"-\d", text) else ("", text)
    parts = (
        "".join(LATEX_ESCAPES.get(character, character) for character in printable(part))
        for part in TIED_SPACE.split(text)
    )
    return sign + "~".join(parts).replace(r"~\%", r"\,\%")
