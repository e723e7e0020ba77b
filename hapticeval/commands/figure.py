"""The command that draws a figure for a paper: several renderers on one case, over each other."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hapticeval.commands.arguments import argument, option, renderers_option
from hapticeval.commands.terminal import Terminal, lines, say, wrote_lines
from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.files import file_stem

EXIT_CODES = """\b
Exit codes:
  0  drawn, whatever the verdicts are
  1  interrupted: nothing is drawn
  2  wrong usage, or there is nothing to draw: a renderer refuses the case
  3  a renderer broke: nothing is drawn
"""

KINDS = (".pdf", ".svg", ".png")
"""Endings of the files that are written."""


def figure(
    case: Annotated[str, argument(metavar="CASE", help="SUITE/CASE, FILE.toml/CASE, or a case of thesis.")],
    renderers: Annotated[list[str] | None, renderers_option("those that `run` takes, or that DIR has")] = None,
    check: Annotated[
        str | None, option("--check", metavar="CHECK", help="Mark where the verdicts of this check point.")
    ] = None,
    width: Annotated[str, typer.Option(metavar="LENGTH", help="Width on paper: mm, cm, in or pt.")] = "88mm",
    height: Annotated[str | None, option(metavar="LENGTH", help="Height on paper; by the width if not given.")] = None,
    font_size: Annotated[float, typer.Option(metavar="POINTS", help="Size of all text.")] = 8.0,
    source: Annotated[
        Path | None, option("--from", metavar="DIR", help="Take the recordings of an earlier run; run nothing.")
    ] = None,
    output: Annotated[
        Path | None,
        option("-o", "--output", metavar="FILE", help="A .pdf, .svg or .png; figure-CASE.pdf if not given."),
    ] = None,
) -> None:
    """Draw a figure for a paper: renderers on one case, over each other, at its real size.

    Above are the model, the path of the hand (HIP) and that of each renderer's tool (IHIP); below is the size of the
    force against time. A case in space is drawn in the coordinate plane in which the paths spread most: the axes say
    which. Text in a PDF is in TrueType fonts (Type 42).

    \b
    Examples:
      hapticeval figure cassinian-deep-slide -r minimum-distance -r constraint
      hapticeval figure solids/cube-vertex -r minimum-distance -r constraint --width 3.5in -o cube.svg
      hapticeval figure star-convex-corner --check continuous-contact --from results -o corner.pdf
    """
    from hapticeval import api
    from hapticeval.quantity import parse_paper_length
    from hapticeval.reports.canvas import save_figure
    from hapticeval.suite.reading import load_suite

    for name, size in (("--width", width), ("--height", height)):
        if size is not None:  # before anything runs
            parse_paper_length(size, option=name)
    suite_name, _, case_name = case.rpartition("/")
    output = output or Path(f"figure-{file_stem(case_name)}.pdf")
    if output.suffix not in KINDS:
        raise InputError(f"-o {output}", why=f"a figure is {', '.join(KINDS)}", todo="name a file with such an ending")
    if source is not None:
        results = api.Results.read(source)
    else:
        suite = load_suite(suite_name or api.DEFAULT_SUITE)
        checks = tuple(suite.case(case_name).checks)
        if check is not None and check not in checks:
            raise UnknownNameError(f"check of {case}", check, checks)
        # One check is enough to have the case run.
        select = f"{suite.name}/{case_name}/{check or checks[0]}"
        with Terminal() as terminal:
            results = api.run(renderers or (), suites=suite, select=select, watch=terminal)
    # Results name a suite by its file's stem.
    case = f"{Path(suite_name).stem}/{case_name}" if suite_name else case_name
    for run in results.document.runs:
        if source is None and run.error is not None:
            error = HapticevalError(
                f"{run.renderer} on {case}: {run.error.what}", why=run.error.why, todo=run.error.todo
            )
            error.exit_code = run.error.exit_code
            raise error
    if source is None and not results.complete:
        raise KeyboardInterrupt
    drawn = results.plot(case, renderers=renderers or (), check=check, width=width, height=height, font_size=font_size)
    written = save_figure(drawn, output.parent, output.stem, kinds=(output.suffix[1:],), dpi=300)
    refused = [run.renderer for run in results.document.runs if source is None and run.refusal]
    say(lines([*(f"not drawn: {name} refuses the case" for name in refused), wrote_lines(written)]))
