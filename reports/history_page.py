"""The page of a renderer's history: its checks over the runs of its commits or versions."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from hapticeval.errors import HapticevalError
from hapticeval.files import replacing
from hapticeval.reports.case_page import asset
from hapticeval.reports.places import FOLDER, INDEX
from hapticeval.reports.templates import environment
from hapticeval.runner.history import Edition, History
from hapticeval.runner.standing import Standing


def write_history(path: Path, histories: Sequence[History]) -> Path:
    """Write the page, which needs no other file, and return its path. Raises `HapticevalError` where that fails."""
    editions = {id(edition): edition for history in histories for edition in history.editions}.values()
    standings = {
        stand.gravest.standing for history in histories for check in history.checks for stand in check.stands if stand
    }
    text = environment().get_template("history.html.j2").render(
        histories=histories,
        style=asset("report.css").decode(),
        links={edition.folder: link for edition in editions if (link := _report_of(edition, path))},
        standings=[standing for standing in Standing if standing in standings],
    )  # fmt: skip
    try:
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise HapticevalError(f"cannot write {path}", why=error.strerror or str(error)) from error
    return path


def _report_of(edition: Edition, page: Path) -> str:
    """Return the link from the page to the report of a run; "" where it has none."""
    report = edition.folder / FOLDER / INDEX
    return Path(os.path.relpath(report, page.parent)).as_posix() if report.exists() else ""
