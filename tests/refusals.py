"""The texts of errors, in one list: `refusals.csv` holds what each refusal that a test provokes says.

A test asks for the type alone, by the fixture `refused`:

    with refused(InputError):
        circle(size=-1.0)

and the text is held against the list. Where a sentence becomes plainer, `make tables` writes the list anew: read the
difference. The test's folder is FOLDER in it, any other of this run TEMPORARY, the repository REPOSITORY, the
interpreter PYTHON, an object's place in memory ADDRESS, a port PORT, the line of code that raised LINE. What the system
or an ill-conditioned computation says differs from machine to machine: such a test asks for the type by
`pytest.raises`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest
from publishing import publishing

from hapticeval.files import replacing

TABLE = Path(__file__).with_name("refusals.csv")
HEAD = ("test", "turn", "text")
ADDRESS = re.compile(r"0x[0-9a-f]{6,}")
"""Of an object in memory, another in each process."""

LOCAL_PORT = re.compile(r"(?<=127\.0\.0\.1:)\d+")
"""A port of this machine, which the system chooses."""

RAISING_LINE = re.compile(r"(?<=\.py, line )\d+(?=, in )")
"""The line of code that raised: it moves with each line that is written above it. `test_errors.py` asks for it."""

NUMBERED_FOLDER = re.compile(r"(?<=TEMPORARY/)(\w*?)\d+\b")
"""A folder of a fixture that several tests share: pytest counts those of one name."""


@cache
def read_table(file: Path) -> Mapping[tuple[str, int], str]:
    """Return the texts by test and turn; read once."""
    rows = csv.DictReader(file.read_text(encoding="utf-8").splitlines()) if file.exists() else []
    return {(row["test"], int(row["turn"])): row["text"] for row in rows}


def write_texts(test: str, texts: list[str]) -> None:
    """Put the texts of one test into the list, in place of those that it has there."""
    table = {place: text for place, text in read_table(TABLE).items() if place[0] != test}
    table |= {(test, turn): text for turn, text in enumerate(texts)}
    with replacing(TABLE) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEAD)
        writer.writerows((*place, text) for place, text in sorted(table.items()))
    read_table.cache_clear()


class Refusals:
    """What one test's refusals say; called with a type of error it is a `pytest.raises` that keeps the text.

    `folders` are the paths that differ from run to run, by the word that stands in the list for each; the first that a
    path begins with counts.
    """

    def __init__(self, test: str, folders: Mapping[str, Path]) -> None:
        self.test, self.folders = test, folders
        self.texts: list[str] = []

    @contextmanager
    def __call__(self, kind: type[Exception]) -> Iterator[pytest.ExceptionInfo[Exception]]:
        with pytest.raises(kind) as caught:
            yield caught
        text = str(caught.value)
        for pattern, word in ((ADDRESS, "ADDRESS"), (LOCAL_PORT, "PORT"), (RAISING_LINE, "LINE")):
            text = pattern.sub(word, text)
        for word, folder in self.folders.items():
            text = text.replace(str(folder), word)
        # One line for each: what, why and what to do stand in lines of their own.
        self.texts.append(" / ".join(line.strip() for line in NUMBERED_FOLDER.sub(r"\1", text).splitlines()))

    def compare(self) -> None:
        """Hold the texts against the list; with HAPTICEVAL_PUBLISH=1 write them into it."""
        if publishing():
            write_texts(self.test, self.texts)
        listed = read_table(TABLE)
        assert self.texts == [text for (test, _), text in sorted(listed.items()) if test == self.test], (
            f"{self.test}: the text is not that of {TABLE.name}; where it is meant to change, make tables"
        )
