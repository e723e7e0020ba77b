"""The page of what the thesis shows: its items in order, each with pictures, tables, and how it compares."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from hapticeval.files import write_text
from hapticeval.reports.case_page import asset
from hapticeval.reports.templates import environment
from hapticeval.study.thesis.printed import Part, chapter_of, slug_of


def write_thesis_page(directory: Path, parts: Sequence[Part]) -> Path:
    """Write index.html beside the pictures in `directory`; return its path.

    Raises `HapticevalError` where it cannot be written.
    """
    chapters = [(name, list(parts)) for name, parts in groupby(parts, key=lambda part: chapter_of(part.name))]
    comparisons = [comparison for part in parts for comparison in part.comparisons]
    counts = {
        "claims": len(comparisons),
        "agree": sum(one.agrees for one in comparisons),
        "explained": sum(one.explained and not one.agrees for one in comparisons),
    }
    page = directory / "index.html"
    text = environment().get_template("thesis.html.j2").render(
        chapters=chapters, counts=counts, slug_of=slug_of, style=asset("report.css").decode()
    )  # fmt: skip
    write_text(page, text)
    return page
