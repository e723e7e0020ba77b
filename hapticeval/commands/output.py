"""Where the command line writes to: folders that may hold results, and standard output."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from hapticeval.errors import InputError

DEFAULT_DIRECTORY = Path("results")
REPORTS = ("table.md", "junit.xml", "report.html")


def prepare(directory: Path) -> None:
    """See that results may be written: into a folder that is new, empty, or holds an earlier run or bench of ours."""
    from hapticeval.runner.results import FILE
    from hapticeval.study.bench import document as bench

    if directory.exists() and not directory.is_dir():
        raise InputError(f"'{directory}' is a file", why="results go into a folder", todo="name another with -o")
    if (
        directory.is_dir()
        and any(directory.iterdir())
        and not any(map(_ours, (directory / FILE, directory / bench.FILE)))
    ):
        raise InputError(
            f"'{directory}' is not empty and holds no {FILE} of an earlier run",
            why="files that hapticeval did not write are never overwritten",
            todo="name a new or an empty folder with -o",
        )
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for report in REPORTS:  # an earlier run's must not stand beside this one's results
            (directory / report).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot write into the folder '{directory}'", why=str(error), todo="name another with -o"
        ) from error


def _ours(file: Path) -> bool:
    """Whether a file is a document of a run or a bench, of whatever version."""
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    kinds = ({"format_version", "planned", "verdicts"}, {"format_version", "settings", "references"})
    return isinstance(document, dict) and any(kind <= document.keys() for kind in kinds)


def say(text: str) -> None:
    """Print on stdout. A reader that has gone away (`| head`) changes no exit code."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
