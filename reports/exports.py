"""The tables of a report for papers and programs: CSV and LaTeX."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from hapticeval.errors import NothingSelectedError, UnknownNameError, printable
from hapticeval.files import write_text
from hapticeval.quantity import parse_paper_length
from hapticeval.reports.table import provenance, tables
from hapticeval.runner.results import ResultsDocument, RunEntry, VerdictEntry, unknown_renderer
from hapticeval.runner.results import Table as Answers
from hapticeval.table import Table

TABLES_FOLDER = "tables"
"""The folder of the tables, beside the results."""


def write_tables(directory: Path, results: ResultsDocument) -> Path:
    """Write each table as CSV, and those with a caption as LaTeX (booktabs), into `directory`/tables; return that.

    Raises `HapticevalError` where they cannot be written.
    """
    folder = directory / TABLES_FOLDER
    for table in map(as_printed, tables(results)):
        texts = {"csv": table.csv}
        if table.caption:
            texts["tex"] = _latex_text_of(table, results)
        for kind, text in texts.items():
            write_text(folder / f"{table.name}.{kind}", text)
    return folder


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

    `table` is one of `tables`; `renderers` are its columns or rows, in this order, and `rows` globs on the first cell
    of a row: all, if none are named. Without a width the line is that of an article on A4.

    Raises `UnknownNameError` for a table or a renderer that is not there, `NothingSelectedError` for a glob without a
    row, and as `parse_paper_length` does.
    """
    characters = 1.0 if width is None else parse_paper_length(width, option="width") / LINE_WIDTH
    for name in renderers:
        if name not in results.renderers:
            raise unknown_renderer(name, results.renderers)
    chosen = results_of(results, renderers) if renderers else results
    table_by_name = {entry.name: entry for entry in tables(chosen)}
    # Each suite that has a printed table fills a summary of its own: the one that there is needs no suite's name.
    of_suites = [name for name in table_by_name if name.startswith("summary-")]
    if table == "summary" and len(of_suites) == 1:
        table = of_suites[0]
    if table not in table_by_name:
        raise UnknownNameError("table of these results", table, table_by_name)
    sheet = as_printed(table_by_name[table])
    first_cells = [row[0] for row in sheet.texts]
    for glob in rows:
        if not any(fnmatchcase(cell, glob) for cell in first_cells):
            raise NothingSelectedError(
                f"no row of '{table}' matches {glob!r}",
                why="a glob is matched against the first cell",
                todo=f"for instance '{first_cells[0]}'" if first_cells else "",
            )
    chosen_rows = [row for row in sheet.texts if not rows or any(fnmatchcase(row[0], glob) for glob in rows)]
    return _latex_text_of(replace(sheet, rows=chosen_rows, caption=sheet.caption or "Verdicts"), chosen, characters)


def as_printed(table: Table) -> Table:
    """Return a table as papers have it: phenomena down, renderers across, so that two fit into a column."""
    if table.name != "phenomena":
        return table
    turned = table.turned
    return replace(turned, header=["phenomenon", *turned.header[1:]])


def results_of(results: ResultsDocument, renderers: Sequence[str]) -> ResultsDocument:
    """Return the results of these renderers alone, in this order."""
    order = {name: number for number, name in enumerate(renderers)}

    def chosen(entries: Sequence[Entry]) -> list[Entry]:
        return sorted((entry for entry in entries if entry.renderer in order), key=lambda entry: order[entry.renderer])

    verdicts = chosen(results.verdicts)

    def columns(table: Answers) -> Answers:
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


def _latex_text_of(table: Table, results: ResultsDocument, line: float = 1.0) -> str:
    """Return a table as LaTeX with the packages that it needs, in several parts where its columns do not fit.

    `line` is the width of a line as a share of `LINE_WIDTH`.
    """
    parts = [latex_of_table(part, line) for part in parts_that_fit(table, line)]
    head = f"% {provenance(results)}\n% \\usepackage{{booktabs,array,longtable}}\n{FLOAT_HINT}"
    return head + "\n".join(parts)


def parts_that_fit(table: Table, line: float) -> Iterator[Table]:
    """Yield the table, or parts of it whose columns fit into a line by their longest words, each with the first one."""
    width = line * LINE_CHARACTERS[SMALLEST_LETTERS]
    words = [_longest_word(column) + COLUMN_GAP for column in table.columns]
    groups: list[list[int]] = [[]]
    for column in range(1, len(words)):
        if groups[-1] and words[0] + sum(words[other] for other in groups[-1]) + words[column] > width:
            groups.append([])
        groups[-1].append(column)
    for number, group in enumerate(groups):
        columns = [0, *group]
        count = f" ({number + 1} of {len(groups)})" if len(groups) > 1 else ""
        yield replace(
            table,
            name=f"{table.name}-{number + 1}" if count else table.name,
            header=[table.header[column] for column in columns],
            rows=[[row[column] for column in columns] for row in table.texts],
            caption=table.caption + count,
        )


def _longest_word(column: Sequence[str]) -> int:
    """Return the longest part of a column's cells that is not broken: at spaces, and after signs of LATEX_ESCAPES."""
    cells = (TIED_SPACE.sub("_", cell) for cell in column)
    return max(len(word) for cell in cells for word in re.split(r"\s|(?<=\w)[-+@/]", cell))


def latex_of_table(table: Table, line: float) -> str:
    """Return a table as LaTeX, small enough for a line: a float, or over several pages where it has many rows."""
    import pandas as pd

    columns, size = _latex_columns(table, line)
    rows = [[_latex_text(text) for text in row] for row in table.texts]
    styler = pd.DataFrame(rows, columns=[_latex_text(text) for text in table.header]).style.hide(axis="index")
    options: dict[str, Any] = {"column_format": columns, "hrules": True, "label": f"tab:{table.name}"}
    # A float fits one page at most.
    if len(rows) > LONG_TABLE_ROWS:
        long: str = styler.to_latex(environment="longtable", caption=table.caption, **options)
        return f"{{{size}{NARROW_GAPS}\n{long.rstrip()}}}\n" if size else long
    text: str = styler.to_latex(position="tbp", position_float="centering", caption=table.caption, **options)
    # Classes leave no room between a caption and a table below it.
    text = text.replace("\\centering\n", "\\centering\n\\setlength{\\belowcaptionskip}{6pt}\n", 1)
    if size:
        # What is set before a float does not reach into it.
        begin, end = r"\begin{tabular}", r"\end{tabular}"
        text = text.replace(begin, f"{{{size}{NARROW_GAPS}\n{begin}", 1).replace(end, f"{end}}}", 1)
    return text


NARROW_GAPS = r"\setlength{\tabcolsep}{2pt}"
"""Makes the gaps between columns of small letters as small."""

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


def _latex_columns(table: Table, line: float) -> tuple[str, str]:
    """Return the columns of a table for LaTeX, and the size of its letters.

    Those of a wide one are as wide as their longest words, and share what is left by how much they hold.
    """
    columns = table.columns
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
