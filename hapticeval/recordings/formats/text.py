"""What text formats share: lines that are whole, and words for those that are not."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticeval.errors import InputError

CLOCKS = ("t", "time", "zeit", "timestamp", "stamp", "seconds")
"""How a column that is a clock is called, in small letters and without its unit."""


def decoded(data: bytes) -> str:
    """Text of UTF-8 (with or without mark), UTF-16 with mark, or else Latin-1, which reads anything."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def whole_lines(path: Path) -> tuple[list[str], str]:
    """The lines of a text file that are whole, and what is left of a last one that may not be."""
    text = decoded(path.read_bytes())
    lines = text.splitlines()
    ended = not lines or text.endswith(("\n", "\r")) or is_whole(lines[-1], lines[1:-1])
    cut = "" if ended else lines.pop()
    return lines, cut


def is_whole(last: str, before: list[str]) -> bool:
    """Whether a last line without its line end is whole: in a column of fixed decimals a cut number has fewer.

    Any other cut number reads like another number, so such a line is not data.
    """
    ends = {_decimals(line) for line in before[-20:]}
    return len(before) > 1 and ends == {_decimals(last)} and ends != {(0, 0)}


def _decimals(line: str) -> tuple[int, int]:
    """How many cells a line has, and how many decimals the last of them, zero for any that is no plain number."""
    cells = re.split(r"[,;\s]+", line.strip())
    found = re.fullmatch(r"[+-]?\d+\.(\d+)", cells[-1])
    return (len(cells), len(found[1])) if found else (0, 0)


def rows_of(path: Path, lines: list[str], names: Sequence[str], *, above: int, why: str) -> NDArray[np.float64]:
    """The numbers of lines that follow `above` others, a row each; raises `InputError` for the first that is none."""
    rows = []
    for number, line in enumerate(lines[above:]):
        try:
            row = [float(word) for word in line.split()]
        except ValueError:
            row = []
        if len(row) != len(names):
            raise InputError(
                f"{path}: row {number} (line {number + above + 1}) is {line.strip()!r}",
                why=why,
                todo="mend or cut that row",
            )
        rows.append(row)
    return np.array(rows).reshape(-1, len(names))


def missing(rows: int, step: float | None, unit: str = "s") -> str:
    """For instance `1 row (0.001 s)`: how much is lost, in rows and in time where the clock is known."""
    words = f"{rows} row" if rows == 1 else f"{rows} rows"
    return words if step is None else f"{words} ({rows * step:.4g} {unit})"


def cut_row(row: int, step: float | None, unit: str = "s") -> str:
    """The warning of a last row without its line end."""
    lost = missing(1, step, unit)
    return f"the file ends within row {row}: {lost} left out, because a cut number reads like another number"


def step_of(time: NDArray[Any]) -> float | None:
    """The median step of a clock, None where there is none."""
    if len(time) < 2:
        return None
    step = float(np.median(np.diff(time)))
    return step if np.isfinite(step) and step > 0.0 else None
