"""The tables of a report for papers and programs: CSV and LaTeX; and figures of its runs as SVG and PDF."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from hapticeval.errors import HapticevalError, NothingSelectedError
from hapticeval.files import file_stem, replacing
from hapticeval.reports.grid import Tile, hard_cases, phenomena, state
from hapticeval.reports.table import provenance, summaries
from hapticeval.runner.results import ResultsDocument, RunEntry

FOLDER = "tables"
FIGURES = "figures"


@dataclass(frozen=True)
class Sheet:
    """A table as plain text; with a `caption` it is written as LaTeX too."""

    name: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""


def sheets(results: ResultsDocument) -> Iterator[Sheet]:
    """Yield the tables that the results fill: summary, renderers by phenomena, digits, closed forms, every verdict."""
    for each in summaries(results):
        cells = [
            [row.title, *(_answer(*cell) for cell in row.cells), *(value or "--" for value in row.printed)]
            for row in each.rows
        ]
        name = "summary" if each.suite is None else f"summary-{file_stem(each.suite.name)}"
        header = ["", *each.renderers, *(f"{name} (in print)" for name in each.printed)]
        yield Sheet(name, header, cells, "Summary of the renderers' performance")
    grid = phenomena(results)
    if grid.rows and grid.columns:
        cells = [[name, *(_tile(tile) for tile in tiles)] for name, tiles in grid.rows]
        yield Sheet("phenomena", ["renderer", *grid.columns], cells, "Renderers by phenomena")
    names, digits = hard_cases(results)
    if digits:
        cells = [[row.case, *("--" if count is None else str(count) for count, _ in row.cells)] for row in digits]
        yield Sheet("hard-cases", ["case", *names], cells, "Decimal digits that are kept in hard cases")
    moments = list(_moments(results))
    if moments:
        header = ["case", "renderer", "law", "time (s)", "measured (mm)", "closed form (mm)"]
        yield Sheet("closed-forms", header, moments, "Distances from the surface beside the closed forms")
    fields = ("suite", "case", "renderer", "check", "level", "outcome")
    yield Sheet(
        "verdicts",
        [*fields, "state", "published", "metric", "value", "unit", "bound", "margin", "message"],
        [
            [
                *(str(getattr(each, name)) for name in fields), state(each), str(each.published or ""),
                *((each.metric.name, _number(each.metric.value), each.metric.unit) if each.metric else ("", "", "")),
                _number(each.bound), _number(each.margin), each.message,
            ]
            for each in results.verdicts
        ],
    )  # fmt: skip


def _moments(results: ResultsDocument) -> Iterator[list[str]]:
    for verdict in results.verdicts:
        for each in verdict.evidence.get("moments", ()):
            values = (each.get("measured_distance"), each.get("closed_form_distance"))
            law = str(verdict.evidence.get("law", ""))
            shown = ["" if value is None else f"{1e3 * value:.6f}" for value in values]
            yield [f"{verdict.suite}/{verdict.case}", verdict.renderer, law, f"{each['time']:g}", *shown]


def _answer(value: str | None, published: str | None) -> str:
    return value or "--" if published in (None, value) or value is None else f"{value} (published: {published})"


def _tile(tile: Tile | None) -> str:
    if tile is None:
        return ""
    count = tile.counts[tile.state]
    words = f"{tile.state.words}, {count} of {tile.total}"
    return f"{words}, {tile.margin}" if tile.margin else words


def _number(value: float | None) -> str:
    return "" if value is None else repr(value)


def write_tables(directory: Path, results: ResultsDocument) -> Path:
    """Write each table as CSV, and those with a caption as LaTeX (booktabs), into `directory`/tables; return that.

    Raises `HapticevalError` where they cannot be written.
    """
    import pandas as pd

    folder = directory / FOLDER
    try:
        for sheet in sheets(results):
            frame = pd.DataFrame(sheet.rows, columns=range(len(sheet.header)), dtype=str)
            frame.columns = pd.Index(sheet.header)
            texts = {"csv": frame.to_csv(index=False)}
            if sheet.caption:
                made = f"% {provenance(results)}\n"
                texts["tex"] = made + frame.map(_latex).rename(columns=_latex).to_latex(
                    index=False, caption=sheet.caption, label=f"tab:{sheet.name}", longtable=len(sheet.rows) > 40
                )
            for kind, text in texts.items():
                with replacing(folder / f"{sheet.name}.{kind}") as temporary:
                    temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise HapticevalError(f"cannot write into {folder}", why=error.strerror or str(error)) from error
    return folder


SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "×": r"$\times$", "∞": r"$\infty$",  # noqa: RUF001
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
}  # fmt: skip


def _latex(text: str) -> str:
    return "".join(SPECIAL.get(sign, sign) for sign in text)


def write_figures(directory: Path, results: ResultsDocument, globs: Sequence[str]) -> list[Path]:
    """Write the figures of the runs whose `suite/case/renderer` a glob matches as SVG and PDF, and return the paths.

    They go into `directory`/figures. Raises `NothingSelectedError` for a glob that matches no run with a recording,
    and `HapticevalError` where a recording cannot be read or a file not be written.
    """
    written: list[Path] = []
    for glob in globs:
        chosen = [run for run in results.runs if run.recording and fnmatchcase("/".join(run.key), glob)]
        if not chosen:
            raise NothingSelectedError(
                f"no recorded run matches {glob!r}",
                why="a glob is matched against suite/case/renderer",
                todo=f"for instance '{'/'.join(results.runs[0].key)}'" if results.runs else "",
            )
        for run in chosen:
            written += _figure(directory, results, run)
    return written


def _figure(directory: Path, results: ResultsDocument, run: RunEntry) -> list[Path]:
    from hapticeval.reports.canvas import save_figure
    from hapticeval.reports.effects_figure import recorded
    from hapticeval.reports.run_figure import marks_of, run_figure

    recording, model = recorded(directory, run)
    marks = tuple(marks_of(results.verdicts_of.get(run.key, [])).values())
    made = run_figure(recording, model, marks=marks, title=f"{run.renderer} on {run.suite}/{run.case}")
    folder = directory / FIGURES / file_stem(run.suite) / file_stem(run.case)
    return save_figure(made, folder, file_stem(run.renderer), kinds=("svg", "pdf"))
