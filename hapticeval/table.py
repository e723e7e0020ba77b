"""A table as plain data, which the terminal, Markdown, CSV and LaTeX are written from."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from hapticeval.errors import printable
from hapticeval.files import csv_cell


class Cell(NamedTuple):
    """A cell of a table: its `text`; how good that is, `good`, `noted` or `bad`; and the sign of a standing."""

    text: str
    tone: str = ""
    mark: str = ""


@dataclass(frozen=True)
class Table:
    """A table as the terminal, Markdown, CSV and LaTeX have it; with a `caption` it is written as LaTeX too."""

    name: str
    header: Sequence[str]
    rows: Sequence[Sequence[str | Cell]]
    caption: str = ""

    @property
    def texts(self) -> list[list[str]]:
        """The texts of the cells, row by row."""
        return [[cell if isinstance(cell, str) else cell.text for cell in row] for row in self.rows]

    @property
    def columns(self) -> list[tuple[str, ...]]:
        """The texts of each column below its heading."""
        return list(zip(self.header, *self.texts, strict=True))

    @property
    def turned(self) -> Table:
        """The same with rows for columns."""
        rows = zip(self.header, *self.rows, strict=True)
        head, *others = [list(row) for row in rows]
        return replace(self, header=[cell if isinstance(cell, str) else cell.text for cell in head], rows=others)

    @property
    def markdown(self) -> str:
        """The table in Markdown with its pipes aligned, so that it reads well as text too; what is bad is bold."""
        lines = [
            [markdown_text(text) for text in self.header],
            *([_marked_text(cell) for cell in row] for row in self.rows),
        ]
        # Markdown wants three hyphens at least.
        widths = [max(3, *map(len, column)) for column in zip(*lines, strict=True)]
        lines.insert(1, ["-" * width for width in widths])
        return "\n".join(
            f"| {' | '.join(text.ljust(width) for text, width in zip(line, widths, strict=True))} |" for line in lines
        )

    @property
    def csv(self) -> str:
        """The table as CSV, in which a cell that a spreadsheet would run as a formula is escaped."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(map(csv_cell, row) for row in (self.header, *self.texts))
        return text.getvalue()


def _marked_text(cell: str | Cell) -> str:
    if isinstance(cell, str):
        return markdown_text(cell)
    text = markdown_text(" ".join(filter(None, (cell.mark, cell.text))))
    return f"**{text}**" if cell.tone == "bad" else text


def markdown_text(text: str) -> str:
    """Return a text for Markdown that cannot end its cell, nor start HTML."""
    # A pipe would end the cell, < begin HTML, a line feed the row.
    return printable(" ".join(text.replace("|", "\\|").replace("<", "&lt;").split()))
