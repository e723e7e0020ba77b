"""The commands for authors of renderers: the header of the C ABI, a walk through the contract, one to start from."""

from __future__ import annotations

import keyword
import re
import shlex
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import typer

from hapticeval.commands.arguments import argument
from hapticeval.commands.terminal import Terminal, columns, lines, say, wrote_lines
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.files import write_text

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
    from hapticeval.study.doctor import SPACE_WORDS, examine, exit_code, next_steps

    findings = []
    kind = ""
    with Terminal() as terminal:
        for finding in examine(renderer, patience=timeout, waiting=terminal.waiting):
            terminal.clear()
            findings.append(finding)
            # A heading wherever a new kind of scene begins.
            if finding.kind != kind:
                kind = finding.kind
                say(f"in {SPACE_WORDS[kind]}" if kind else "")
            say(columns([(f"  {finding.state:<8}{finding.what:<12}", finding.text)]))
    if steps := next_steps(renderer, findings):
        say(lines(["", *steps]))
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
    # The files, and the commands to type next.
    written, steps = write_starter(kind, directory)
    say(wrote_lines(written))
    say("\n".join(["", "then:", *(f"  {step}" for step in steps)]))


WORKFLOW = Path(".github", "workflows", "hapticeval.yml")
"""Where the workflow file lies in the new folder."""

WORKFLOW_TEXT = """\
name: hapticeval
on: [push, pull_request]
env:
  # Where pip finds hapticeval: its repository, or the path or address of a wheel.
  HAPTICEVAL: "hapticeval @ git+https://github.com/OWNER/hapticeval@v0.1.0"
jobs:
  judge:
    runs-on: ubuntu-latest
    steps:
      - uses: actions/checkout@v4
      - uses: actions/setup-python@v5
        with: {{ python-version: "3.12" }}
      - run: pip install "$HAPTICEVAL" pytest
{build}      - run: pytest
      - run: hapticeval doctor -r {renderer}
      # Without the selection it is judged by the whole suite: begin with what must hold, and add to it.
      - run: hapticeval run {judged} -r {renderer} --strict
      - if: always()
        run: test ! -f results/table.md || cat results/table.md >> "$GITHUB_STEP_SUMMARY"
      - uses: actions/upload-artifact@v4
        if: always()
        with: {{ name: results, path: results }}
"""
"""The workflow file of GitHub, with what builds and what judges the renderer left open."""


@dataclass(frozen=True)
class Starter:
    """A renderer to start from: the `stem` of its files' names, the files, its name, what builds and what judges it."""

    stem: str
    files: tuple[str, ...]
    renderer: str
    judged: str = "-k plane-press"
    build: str = ""
    header: bool = False


STARTERS: Mapping[str, Starter] = MappingProxyType(
    {
        "python": Starter("mine", ("mine.py", "test_mine.py"), "mine:Nearest"),
        "c": Starter(
            "penalty", ("penalty.c", "Makefile", "test_penalty.py"), "lib:./libpenalty.so", build="make", header=True
        ),
        "cpp": Starter(
            "god_object",
            ("god_object.cpp", "CMakeLists.txt", "Makefile", "blocks.toml", "test_god_object.py"),
            "lib:./libgod_object.so",
            judged="blocks.toml",
            build="make",
            header=True,
        ),
        "process": Starter(
            "mine", ("mine.py", "mine.m", "test_mine.py"), "'cmd:python3 mine.py'", judged="-k star-loops"
        ),
    }
)
"""By kind, which is the folder of its files among the examples."""


def write_starter(kind: str, directory: Path) -> tuple[list[Path], list[str]]:
    """Write a renderer to start from, named after its folder; return the files, and the commands that come next.

    Raises `UnknownNameError` for another kind, and `InputError` for a folder that has something in it.
    """
    if kind not in STARTERS:
        raise UnknownNameError("kind of renderer", kind, STARTERS)
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        why = "what is there is not written over"
        raise InputError(f"'{directory}' is not an empty folder", why=why, todo="name a new or an empty one")
    starter = STARTERS[kind]
    # The stem as a word, also behind lib and test_, as in libpenalty.so.
    named = re.compile(rf"\b(lib|test_|){starter.stem}\b")
    # In C sources only names of files: a variable may be called like the stem.
    files_alone = re.compile(rf"{named.pattern}(?=\.(?:c|cpp|so)\b)")
    name = _module_name(directory.resolve().name)

    def renamed(text: str, pattern: re.Pattern[str] = named) -> str:
        return pattern.sub(rf"\g<1>{name}", text)

    texts = {}
    for file_name in starter.files:
        text = files("hapticeval.examples").joinpath(kind, file_name).read_text("utf-8")
        texts[renamed(file_name)] = renamed(text, files_alone if Path(file_name).suffix in (".c", ".cpp") else named)
    if starter.header:
        texts["hapticeval.h"] = files("hapticeval.adapters").joinpath("hapticeval.h").read_text("utf-8")
    # A step of the workflow file, indented as the others.
    build = f"      - run: {starter.build}\n" if starter.build else ""
    renderer = renamed(starter.renderer)
    texts[str(WORKFLOW)] = WORKFLOW_TEXT.format(build=build, renderer=renderer, judged=starter.judged)
    for path, text in texts.items():
        write_text(directory / path, text)
    steps = [f"cd {shlex.quote(str(directory))}", starter.build, f"hapticeval doctor -r {renderer}"]
    return [directory / path for path in texts], [
        *filter(None, steps),
        f"hapticeval run {starter.judged} -r {renderer}",
        # What no path of a case visits: the smallest that breaks it.
        f"hapticeval search -r {renderer} --seconds 60",
    ]


def _module_name(folder: str) -> str:
    """Return the name of a module and a library for a folder's: not one that another module has."""
    name = re.sub(r"\W", "_", folder, flags=re.ASCII)
    if not name.isidentifier():
        name = f"renderer_{name}"
    # A namespace package, as the new folder itself, has no origin.
    spec = find_spec(name)
    exists = spec is not None and spec.origin is not None
    return f"{name}_renderer" if keyword.iskeyword(name) or name in sys.stdlib_module_names or exists else name
