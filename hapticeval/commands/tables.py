"""The command that writes a table for a paper: LaTeX with booktabs, of the renderers and rows that are chosen."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hapticeval.commands.arguments import argument, option
from hapticeval.commands.terminal import say, wrote_lines
from hapticeval.errors import HapticevalError
from hapticeval.files import replacing

EXIT_CODES = """\b
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
    try:
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise HapticevalError(f"cannot write {path}", why=error.strerror or str(error)) from error
    say(wrote_lines([path]))
