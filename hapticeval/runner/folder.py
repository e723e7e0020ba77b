"""The folder of a run or a bench: made, or recognised as one of ours; nothing else is ever written over."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from hapticeval.errors import InputError

DOCUMENTS = {
    "results.json": {"planned", "verdicts"},
    "bench.json": {"settings", "references"},
    "effects.json": {"scenes", "ladder"},
}
"""What hapticeval leaves in a folder, and entries by which it is recognised, of whatever version."""

REPORTS = ("table.md", "junit.xml", "report.html", "report", "tables", "figures")


def prepare(directory: Path, *, keep_reports: bool = False) -> None:
    """See that results may be written: into a folder that is new, empty, or holds an earlier run or bench of ours.

    Removes the reports of an earlier run, which must not stand beside the results of this one, unless they are to be
    kept. Raises `InputError` for any other folder, and where nothing can be written there.
    """
    if directory.exists() and not directory.is_dir():
        raise InputError(f"'{directory}' is a file", why="results go into a folder", todo="name another with -o")
    if directory.is_dir() and any(directory.iterdir()) and not any(_ours(directory / name) for name in DOCUMENTS):
        raise InputError(
            f"'{directory}' is not empty and holds no results.json of an earlier run",
            why="files that hapticeval did not write are never overwritten",
            todo="name a new or an empty folder with -o",
        )
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for report in () if keep_reports else (directory / name for name in REPORTS):
            if report.is_dir() and not report.is_symlink():
                shutil.rmtree(report)
            else:
                report.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot write into the folder '{directory}'", why=str(error), todo="name another with -o"
        ) from error


def _ours(file: Path) -> bool:
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(document, dict) and document.keys() >= DOCUMENTS[file.name] | {"format_version"}
