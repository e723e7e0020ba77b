"""The commands for authors of renderers: the header of the C ABI, a walk through the contract, one to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hapticeval.commands.arguments import argument
from hapticeval.commands.terminal import Terminal, columns, say, wrote_lines

ANSWER_SECONDS = 60.0
"""Seconds for an answer, unless given: a renderer's own kernels to compile and a large program to start included."""

DOCTOR_CODES = """\b
Exit codes:
  0  the contract is kept
  1  something is missing
  2  wrong usage, or no such renderer
  3  the renderer broke: it raised, crashed or hung
"""

NEW_CODES = """\b
Exit codes:
  0  the files are written
  2  wrong usage, or the folder is not empty
"""

HEADER_CODES = """\b
Exit codes:
  0  printed
"""


def header() -> None:
    """Print hapticeval.h, the C header that a library for `-r lib:PATH` is built with.

    \b
    Example:
      hapticeval header > hapticeval.h
    """
    import importlib.resources

    say(importlib.resources.files("hapticeval.adapters").joinpath("hapticeval.h").read_text(encoding="utf-8").rstrip())


def doctor(
    renderer: Annotated[str, typer.Option("-r", "--renderer", metavar="NAME", help="As for `hapticeval run`.")],
    timeout: Annotated[
        float, typer.Option("--timeout", metavar="SECONDS", help="How long it has for an answer.", min=0.1)
    ] = ANSWER_SECONDS,
) -> None:
    """Walk a renderer through the contract, and print what holds and what is missing.

    A renderer that hangs is ended, with the line that it was in.

    \b
    Examples:
      hapticeval doctor -r mymodule:factory
      hapticeval doctor -r lib:./libmine.so
      hapticeval doctor -r mymodule:factory --timeout 5
    """
    from hapticeval.study.doctor import examine, exit_code

    findings = []
    kind = ""
    with Terminal() as terminal:
        for finding in examine(renderer, patience=timeout, waiting=terminal.waiting):
            terminal.clear()
            findings.append(finding)
            # A heading wherever a new kind of scene begins.
            if finding.kind != kind:
                kind = finding.kind
                say(f"in {'the ' * (kind == 'plane')}{kind}" if kind else "")
            say(columns([(f"  {finding.state:<8}{finding.what:<12}", finding.text)]))
    raise typer.Exit(exit_code(findings))


def new(
    kind: Annotated[str, argument(metavar="KIND", help="python, c, cpp or process.")],
    directory: Annotated[Path, argument(metavar="DIR", help="A new or empty folder; the files are named after it.")],
) -> None:
    """Write a renderer to start from, with its test and a file for continuous integration.

    \b
    Examples:
      hapticeval new python myrenderer
      hapticeval new cpp myrenderer
    """
    from hapticeval.commands.starters import write_starter

    # The files, and the commands to type next.
    written, steps = write_starter(kind, directory)
    say(wrote_lines(written))
    say("\n".join(["", "then:", *(f"  {step}" for step in steps)]))
