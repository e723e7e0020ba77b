"""The texts of errors, in one list: `refusals.csv` holds what each refusal that a test provokes says.

A test asks for the type alone, by the fixture `refused`:

    with refused(InputError):
        circle(size=-1.0)

and the text is held against the list. Where a sentence becomes plainer, `make tables` writes the list anew: read the
difference. The test's folder is FOLDER in it, and an object's place in memory ADDRESS.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

TABLE = Path(__file__).with_name("refusals.csv")
HEAD = ("test", "turn", "text")
ADDRESS = re.compile(r"0x[0-9a-f]{6,}")
"""Of an object in memory, another in each process."""


def read_table() -> dict[tuple[str, int], str]:
    """Return the texts by test and turn."""
    rows = csv.DictReader(TABLE.read_text(encoding="utf-8").splitlines()) if TABLE.exists() else []
    return {(row["test"], int(row["turn"])): row["text"] for row in rows}


def write_texts(test: str, texts: list[str]) -> None:
    """Put the texts of one test into the list, in place of those that it has there."""
    table = {place: text for place, text in read_table().items() if place[0] != test}
    table |= {(test, turn): text for turn, text in enumerate(texts)}
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEAD)
        writer.writerows((*place, text) for place, text in sorted(table.items()))


class Refusals:
    """What one test's refusals say; called with a type of error it is a `pytest.raises` that keeps the text."""

    def __init__(self, test: str, folder: Path) -> None:
        self.test, self.folder = test, folder
        self.texts: list[str] = []

    @contextmanager
    def __call__(self, kind: type[Exception]) -> Iterator[pytest.ExceptionInfo[Exception]]:
        with pytest.raises(kind) as caught:
            yield caught
        # One line for each: what, why and what to do stand in lines of their own.
        text = ADDRESS.sub("ADDRESS", str(caught.value).replace(str(self.folder), "FOLDER"))
        self.texts.append(" / ".join(line.strip() for line in text.splitlines()))

    def compare(self) -> None:
        """Hold the texts against the list; with HAPTICEVAL_PUBLISH=1 write them into it."""
        if os.environ.get("HAPTICEVAL_PUBLISH"):
            write_texts(self.test, self.texts)
        listed = read_table()
        assert self.texts == [text for (test, _), text in sorted(listed.items()) if test == self.test], (
            f"{self.test}: the text is not that of {TABLE.name}; where it is meant to change, make tables"
        )
