"""The tables of a report for papers and programs: CSV and LaTeX; and figures of its runs as SVG and PDF."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

from hapticeval.errors import HapticevalError, NothingSelectedError, printable
from hapticeval.files import csv_cell, file_stem, replacing
from hapticeval.reports.grid import Tile, hard_cases, phenomenon_grid
from hapticeval.reports.table import provenance, summaries
from hapticeval.runner.results import ResultsDocument, RunEntry, VerdictEntry

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "tables"
"""The folder of the tables, beside the results."""

FIGURES = "figures"
"""The folder of the figures, beside the results."""


@dataclass(frozen=True)
class Sheet:
    """A table as plain text; with a `caption` it is written as LaTeX too."""

    name: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""


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
        cells = [[name, *(_tile_words(tile) for tile in tiles)] for name, tiles in grid.rows]
        yield Sheet("phenomena", ["renderer", *grid.columns], cells, "Renderers by phenomena")
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
    import pandas as pd

    folder = directory / FOLDER
    try:
        for sheet in sheets(results):
            # Numbers as names first: headings may repeat, and pandas then takes them back.
            frame = pd.DataFrame(sheet.rows, columns=range(len(sheet.header)), dtype=str)
            frame.columns = pd.Index(sheet.header)
            # A cell that a spreadsheet would run as a formula is escaped.
            texts = {"csv": frame.map(csv_cell).rename(columns=csv_cell).to_csv(index=False)}
            if sheet.caption:
                texts["tex"] = (
                    f"% {provenance(results)}\n% \\usepackage{{booktabs,array,longtable}}\n{_latex_table(sheet, frame)}"
                )
            for kind, text in texts.items():
                with replacing(folder / f"{sheet.name}.{kind}") as temporary:
                    temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise HapticevalError(f"cannot write into {folder}", why=error.strerror or str(error)) from error
    return folder


LATEX_ESCAPES = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "×": r"$\times$", "∞": r"$\infty$",  # noqa: RUF001
    **{sign: f"\\{sign}" for sign in "&%$#_{}"}, **{sign: rf"{sign}\allowbreak{{}}" for sign in "+@/"},
}  # fmt: skip
"""Signs that LaTeX would take for commands, or that a long name may be broken after."""


def _latex_table(sheet: Sheet, frame: pd.DataFrame) -> str:
    """Return a table as LaTeX, small enough for a page. What is set before a float does not reach into it."""
    columns, size = _latex_columns(sheet)
    # A float fits one page at most.
    environment = "longtable" if len(sheet.rows) > LONG_TABLE_ROWS else "tabular"
    cells = frame.map(_latex_text).rename(columns=_latex_text)
    table = cells.to_latex(
        index=False,
        caption=sheet.caption,
        label=f"tab:{sheet.name}",
        longtable=environment == "longtable",
        column_format=columns,
    )
    # The size has to hold inside the table's own group.
    begin, end = (f"\\{command}{{{environment}}}" for command in ("begin", "end"))
    sized_begin = f"{{{size}\\setlength{{\\tabcolsep}}{{2pt}}\n{begin}"
    return table.replace(begin, sized_begin).replace(end, f"{end}}}") if size else table


LONG_TABLE_ROWS = 40
"""Rows from which on a table goes over several pages."""

LINE_CHARACTERS = {"": 66, r"\scriptsize": 88, r"\tiny": 112}
"""Characters that fit beside each other into the text of an article on A4, by the size of the letters."""

COLUMN_GAP = 2
"""Characters that the gap between two columns takes."""


def _latex_columns(sheet: Sheet) -> tuple[str, str]:
    """Return the columns of a table for LaTeX, and the size of its letters.

    Those of a wide one are as wide as their longest words, and share what is left by how much they hold.
    """
    columns = list(zip(sheet.header, *sheet.rows, strict=True))
    longest = [max(map(len, column)) for column in columns]
    # All cells fit on a line each, at the size of the text.
    if sum(longest) + COLUMN_GAP * len(columns) <= LINE_CHARACTERS[""]:
        return "l" * len(columns), ""
    # A cell may be broken at spaces and after the signs that LATEX_ESCAPES lets break.
    parts = ([word for cell in column for word in re.split(r"\s|(?<=\w)[-+@/]", cell)] for column in columns)
    words = [max(map(len, words_of_column)) + COLUMN_GAP for words_of_column in parts]
    size = r"\scriptsize" if sum(words) <= LINE_CHARACTERS[r"\scriptsize"] else r"\tiny"
    room = [max(cell_width + COLUMN_GAP - word_width, 0) for cell_width, word_width in zip(longest, words, strict=True)]
    # What is left of the line, as a share of what the cells would still take.
    free = max(LINE_CHARACTERS[size] - sum(words), 0) / max(sum(room), 1)
    widths = [word_width + min(free, 1.0) * extra - COLUMN_GAP for word_width, extra in zip(words, room, strict=True)]
    # From characters to shares of the line.
    scale = 1.0 / max(LINE_CHARACTERS[size], sum(words))
    return "".join(rf">{{\raggedright\arraybackslash}}p{{{scale * width:.3f}\linewidth}}" for width in widths), size


def _latex_text(text: str) -> str:
    # A minus, not a hyphen, before a number.
    sign, text = (r"$-$", text[1:]) if re.match(r"-\d", text) else ("", text)
    return sign + "".join(LATEX_ESCAPES.get(character, character) for character in printable(text))


def write_figures(directory: Path, results: ResultsDocument, globs: Sequence[str]) -> list[Path]:
    """Write the figures of the runs whose `suite/case/renderer` a glob matches as SVG and PDF, and return the paths.

    They go into `directory`/figures. Raises `NothingSelectedError` for a glob that matches no run with a recording,
    and `HapticevalError` where a recording cannot be read or a file not be written.
    """
    written: list[Path] = []
    for glob in globs:
        # A run without a recording has nothing to draw.
        chosen = [run for run in results.runs if run.recording and fnmatchcase("/".join(run.key), glob)]
        if not chosen:
            raise NothingSelectedError(
                f"no recorded run matches {glob!r}",
                why="a glob is matched against suite/case/renderer",
                todo=f"for instance '{'/'.join(results.runs[0].key)}'" if results.runs else "",
            )
        for run in chosen:
            written += _write_run_figure(directory, results, run)
    return written


def _write_run_figure(directory: Path, results: ResultsDocument, run: RunEntry) -> list[Path]:
    """Draw a run and write the figure below figures/; return the paths written."""
    from hapticeval.reports.canvas import in_style, save_figure
    from hapticeval.reports.effects_figure import read_run
    from hapticeval.reports.run_figure import marks_of, run_figure

    recording, model = read_run(directory, run)
    marks = tuple(marks_of(results.verdicts_of.get(run.key, [])).values())
    folder = directory / FIGURES / file_stem(run.suite) / file_stem(run.case)
    with in_style():
        fig = run_figure(recording, model, marks=marks, title=f"{run.renderer} on {run.suite}/{run.case}")
        return save_figure(fig, folder, file_stem(run.renderer), kinds=("svg", "pdf"))
