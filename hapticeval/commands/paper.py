"""The commands for a paper: figures of renderers on cases and of what studies found, and tables in LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hapticeval.commands.arguments import argument, option, renderers_option
from hapticeval.commands.terminal import Terminal, lines, say, wrote_lines
from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.files import file_stem, write_text
from hapticeval.suite import DEFAULT_SUITE

if TYPE_CHECKING:
    from hapticeval.api import Results
    from hapticeval.suite.suite import Suite

FIGURE_CODES = """\b
Exit codes:
  0  drawn, whatever the verdicts are
  1  interrupted: nothing is drawn
  2  wrong usage, or there is nothing to draw: a renderer refuses the case
  3  a renderer broke: nothing is drawn
"""

FIGURE_ENDINGS = (".pdf", ".svg", ".png")
"""Endings of the files that are written."""


def figure(
    subjects: Annotated[
        list[str],
        argument(
            metavar="CASE...",
            help="SUITE/CASE, FILE.toml/CASE, or a case of thesis; or a document: results.json for the grid of "
            "renderers by phenomena, bench.json, or limits-*.json of `study limits`.",
        ),
    ],
    renderers: Annotated[list[str] | None, renderers_option("those that `run` takes, or that DIR has")] = None,
    check: Annotated[
        str | None, option("--check", metavar="CHECK", help="Mark where this check does not pass.")
    ] = None,
    labels: Annotated[
        list[str] | None,
        option("--label", metavar="NAME=TEXT", help="What the legend calls a renderer; may be repeated."),
    ] = None,
    width: Annotated[
        str | None, option(metavar="LENGTH", help="Width on paper: mm, cm, in or pt; else 88mm, a journal's column.")
    ] = None,
    height: Annotated[str | None, option(metavar="LENGTH", help="Height on paper; by the width if not given.")] = None,
    font_size: Annotated[float | None, option(metavar="POINTS", help="Size of all text; 8 if not given.")] = None,
    source: Annotated[
        Path | None, option("--from", metavar="DIR", help="Take the recordings of an earlier run; run nothing.")
    ] = None,
    output: Annotated[
        Path | None,
        option(
            "-o", "--output", metavar="FILE",
            help="A .pdf, .svg or .png, or a folder, which several figures need; figure-CASE.pdf if not given.",
        ),
    ] = None,
) -> None:  # fmt: skip
    """Draw figures for a paper, at their real size, with text in TrueType fonts (Type 42).

    Of a case: above are the model, the path of the hand (HIP) and that of each renderer's tool (IHIP), over each other;
    below is the size of the force against time. A case in space is drawn in the coordinate plane in which the paths
    spread most: the axes say which. Several cases are run and drawn together, which takes less time.

    \b
    Examples:
      hapticeval figure cassinian-deep-slide -r minimum-distance -r constraint
      hapticeval figure solids/cube-vertex -r minimum-distance -r constraint --width 3.5in -o cube.svg
      hapticeval figure star-convex-corner --check continuous-contact --from results -o corner.pdf
      hapticeval figure star-convex-corner -r mine:Nearest -r constraint --label 'mine:Nearest=nearest point'
      hapticeval figure results/results.json results/bench.json limits-plane-press-point-mass.json -o figures
    """
    from hapticeval import api
    from hapticeval.quantity import parse_paper_length
    from hapticeval.reports.canvas import save_figure

    for name, size in (("--width", width), ("--height", height)):
        if size is not None:  # before anything runs
            parse_paper_length(size, option=name)
    paths = _paths_of(subjects, output)
    looks: dict[str, Any] = {"width": width, "height": height, "font_size": font_size, "labels": _labels(labels)}
    cases = [subject for subject in paths if not subject.endswith(".json")]
    results = _results_of(cases, renderers or (), check, source) if cases else None
    drawings = {
        subject: api.plot_document(subject, renderers=renderers or (), **looks)
        if results is None or subject not in cases
        # Results name a suite by its file's stem.
        else results.plot(_place(subject), renderers=renderers or (), check=check, **looks)
        for subject in paths
    }
    written: list[Path] = []
    # Written when all are drawn: one that cannot be leaves no half of them.
    for subject, drawing in drawings.items():
        path = paths[subject]
        written += save_figure(drawing, path.parent, path.stem, kinds=(path.suffix[1:],), dpi=300)
    refused = [] if source or results is None else [run for run in results.document.runs if run.refusal]
    notes = [f"not drawn: {run.renderer} refuses {run.suite}/{run.case}" for run in refused]
    say(lines([*notes, wrote_lines(written)]))


def _labels(texts: list[str] | None) -> dict[str, str] | None:
    """Return labels by renderer, as NAME=TEXT gives them. Raises `InputError` for a text without both."""
    labels = {}
    for text in texts or ():
        name, _, label = text.rpartition("=")  # a name may hold a sign of its own, as a process's arguments do
        if not name or not label:
            raise InputError(f"--label {text}", why="it is not NAME=TEXT", todo="for instance 'constraint=god-object'")
        labels[name] = label
    return labels or None


def _paths_of(subjects: list[str], output: Path | None) -> dict[str, Path]:
    """Return the file of each figure. Raises `InputError` for an ending that none has, and one file for several."""
    names = {subject: f"figure-{file_stem(Path(subject).name.removesuffix('.json'))}.pdf" for subject in subjects}
    if output is None:
        return {subject: Path(name) for subject, name in names.items()}
    if output.suffix in FIGURE_ENDINGS:
        if len(names) > 1:
            raise InputError(
                f"-o {output}", why=f"{len(names)} figures do not fit into one file", todo="name a folder: -o figures"
            )
        return dict.fromkeys(subjects, output)
    if output.suffix and not output.is_dir():
        raise InputError(
            f"-o {output}", why=f"a figure is {', '.join(FIGURE_ENDINGS)}", todo="name a file with such an ending"
        )
    return {subject: output / name for subject, name in names.items()}


def _place(subject: str) -> str:
    suite, _, case = subject.rpartition("/")
    return f"{Path(suite).stem}/{case}" if suite else case


def _results_of(cases: list[str], renderers: Sequence[str], check: str | None, source: Path | None) -> Results:
    """Return an earlier run, or run the cases, with as few checks as a run takes.

    Raises `UnknownNameError` for a check that a case has not, what stopped a renderer, and `KeyboardInterrupt` where
    the run was.
    """
    from hapticeval import api
    from hapticeval.suite.reading import load_suite

    if source is not None:
        return api.Results.read(source)
    suites: dict[str, Suite] = {}
    selected = []
    for subject in cases:
        suite_name, _, case_name = subject.rpartition("/")
        suite = suites.setdefault(suite_name, load_suite(suite_name or DEFAULT_SUITE))
        checks = tuple(suite.case(case_name).checks)
        if check is not None and check not in checks:
            raise UnknownNameError(f"check of {subject}", check, checks)
        # One check is enough to have the case run.
        selected.append(f"{suite.name}/{case_name}/{check or checks[0]}")
    with Terminal() as terminal:
        results = api.run(
            renderers, suites=tuple({suite.name: suite for suite in suites.values()}.values()),
            select=" or ".join(selected), watch=terminal,
        )  # fmt: skip
    for run in results.document.runs:
        if run.error is not None:
            error = HapticevalError(
                f"{run.renderer} on {run.suite}/{run.case}: {run.error.what}", why=run.error.why, todo=run.error.todo
            )
            error.exit_code = run.error.exit_code
            raise error
    if not results.complete:
        raise KeyboardInterrupt
    return results


TABLE_CODES = """\b
Exit codes:
  0  written
  2  wrong usage, or no such table or renderer
  4  --row: no row matches
"""


def table(
    directory: Annotated[Path, argument(metavar="DIR", help="The folder of a run.")],
    name: Annotated[
        str,
        typer.Argument(metavar="TABLE", help="phenomena, summary, hard-cases, closed-forms, verdicts: see DIR/tables."),
    ] = "phenomena",
    renderers: Annotated[
        list[str] | None,
        option("-r", "--renderer", metavar="NAME", help="Of this renderer; may be repeated, in the order of columns."),
    ] = None,
    rows: Annotated[
        list[str] | None, option("--row", metavar="GLOB", help="Rows whose first cell matches; may be repeated.")
    ] = None,
    width: Annotated[
        str | None,
        option(metavar="LENGTH", help="Width of a line on paper, such as 88mm; else of an article on A4."),
    ] = None,
    output: Annotated[
        Path | None, option("-o", "--output", metavar="FILE.tex", help="The file; TABLE.tex if not given.")
    ] = None,
) -> None:
    """Write a table of a run for a paper, in LaTeX with booktabs.

    What is too wide for a line is broken within its cells, then set in smaller letters, then cut into several tables.

    \b
    Examples:
      hapticeval table results -r minimum-distance -r constraint --width 88mm
      hapticeval table results summary --row 'Resists*' -o resists.tex
    """
    from hapticeval.api import Results

    text = Results.read(directory).latex(name, renderers=renderers or (), rows=rows or (), width=width)
    path = output or Path(f"{name}.tex")
    write_text(path, text)
    say(wrote_lines([path]))
