"""Delimited text (.csv, .tsv, .txt): with a header or without, a row of units or not, decimal point or comma."""

from __future__ import annotations

import io
import re
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.formats.magic import TEXT_BOMS, is_text
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table
from hapticeval.recordings.formats.text import CLOCKS, cut_row, decoded, is_whole, step_of
from hapticeval.recordings.units import UNITS

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".asc", ".log")
COMMENTS = ("#", "%")
LOOK = 1 << 16
"""Bytes from which header and dialect are told."""
MISSING = {"", "nan", "na", "n/a", "null", "none", "-"}
NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
UNIT = re.compile(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*")
SLASH = re.compile(r".*[^\s/]/([^\s/]+)")
"""A unit as in `F_x/N`."""


def _recognises(head: bytes) -> bool:
    if not is_text(head):
        return False
    lines = [line for line in decoded(head).splitlines() if line.strip() and not line.startswith(COMMENTS)]
    return any(_is_row(line, _separator([line])) for line in lines)


@importer("csv", about="delimited text (.csv, .tsv, .txt)", suffixes=SUFFIXES, recognises=_recognises)
def read_delimited(path: Path) -> Table:
    """Columns by their headers, or `c0`, `c1`, ...; a unit in brackets in a header is the column's unit.

    A last row without its line end is left out. Cells that are no number become NaN, with a warning that says where;
    a column without any number is left out. Raises `InputError`, naming the line, for a row with too many cells.
    """
    import pandas as pd

    data = path.read_bytes()
    if data.startswith(TEXT_BOMS):
        data = decoded(data).encode()
    end = data.rfind(b"\n") + 1
    cut = bool(data[end:].strip()) and not is_whole(
        decoded(data[end:]), decoded(data[max(0, end - (1 << 14)) : end]).splitlines()[1:]
    )
    end = end if cut else len(data)
    start = data[: min(end, LOOK)]
    start = start[: start.rfind(b"\n") + 1] or start
    head = [line.rstrip("\r\n") for line in islice(io.StringIO(decoded(start)), 200)]
    names, units, skipped, separator = _header(path, head)
    comma = separator != "," and any("," in line and "." not in line for line in head[skipped:])
    try:
        frame = pd.read_csv(
            io.BytesIO(data[:end]),
            sep=r"\s+" if separator == " " else separator,
            header=None,
            skiprows=skipped,
            names=names,
            index_col=False,
            comment="#",
            decimal="," if comma else ".",
            skipinitialspace=True,
            skip_blank_lines=True,
            encoding_errors="replace",
            low_memory=False,
        )
    except pd.errors.EmptyDataError:
        frame = pd.DataFrame({name: [] for name in names})
    except pd.errors.ParserError as error:
        raise InputError(
            f"{path} has a row with more cells than the others", why=str(error), todo="mend or cut that row"
        ) from error
    columns: dict[str, Any] = {}
    warnings: list[str] = []
    remarks: list[str] = []
    lacking: dict[tuple[int, int, str], list[str]] = {}
    for name in names:
        values = pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=np.float64)
        empty = np.flatnonzero(np.isnan(values) & ~_says_nan(frame[name]))
        if empty.size == len(values) and len(values):
            remarks.append(f"the column '{name}' is text, which is left out")
            units.pop(name, None)
            continue
        if empty.size:
            cell = frame[name].iloc[int(empty[0])]
            said = f": {cell!r}" if isinstance(cell, str) else ", which is empty or NaN"
            lacking.setdefault((empty.size, int(empty[0]), said), []).append(name)
        whole = frame[name].dtype.kind == "i"
        columns[name] = frame[name].to_numpy() if whole else values
    cells = [_lacking(alike, *event) for event, alike in lacking.items()]
    warnings += cells
    if cut:
        clock = next((name for name in columns if UNIT.sub(r"\1", name).strip().lower() in CLOCKS), None)
        step = None if clock is None else step_of(np.asarray(columns[clock]))
        warnings.append(cut_row(len(frame), step, units.get(clock or "", "in the unit of its clock")))
    return Table(columns, units=units, warnings=tuple(warnings), remarks=tuple(remarks), cells=tuple(cells))


def _lacking(names: list[str], count: int, first: int, said: str) -> str:
    """One event a warning: the same cells of several columns are one."""
    cells = "1 cell" if count == 1 else f"{count} cells"
    who = (
        f"the column '{names[0]}' has"
        if len(names) == 1
        else "the columns " + ", ".join(f"'{name}'" for name in names) + " each have"
    )
    return f"{who} {cells} without a number, first at row {first}{said}"


def _header(path: Path, head: list[str]) -> tuple[list[str], dict[str, str], int, str]:
    """Names, units, how many lines come before the first row, and what separates cells."""
    rows = [place for place, line in enumerate(head) if line.strip() and not line.startswith(COMMENTS)]
    separator = _separator([head[place] for place in rows[len(rows) // 2 :]])
    first = next((place for place in rows if _is_row(head[place], separator)), None)
    if first is None:
        raise InputError(
            f"{path} has no row of numbers in its first {len(head)} lines",
            why=f"the first line is {head[0][:60]!r}",
            todo="see that it is the file you mean",
        )
    width = len(_split(head[first], separator))
    above = [_split(head[place], separator) for place in rows if place < first]
    above = [cells for cells in above if len(cells) == width]
    if not above:  # as numpy.savetxt writes it: the header is a comment
        comments = [_split(line.lstrip("#% "), separator) for line in head[:first] if line.startswith(COMMENTS)]
        above = [cells for cells in comments[-1:] if len(cells) == width]
    if not above:
        return [f"c{k}" for k in range(width)], {}, first, separator
    names = [cell.strip().strip('"') or f"c{k}" for k, cell in enumerate(above[0])]
    units = {name: found[2].strip() for name in names if (found := UNIT.fullmatch(name)) and found[2].strip()}
    units |= {name: found[1] for name in names if (found := SLASH.fullmatch(name)) and found[1] in UNITS}
    if len(above) > 1:
        units |= {
            name: cell.strip(' "[]()') for name, cell in zip(names, above[1], strict=True) if cell.strip(' "[]()')
        }
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            f"{path} has two columns named '{twice[0]}'", why="a mapping could not say which", todo="rename one of them"
        )
    return names, units, first, separator


def _separator(lines: list[str]) -> str:
    """What cells are separated by: that of tab, semicolon and comma which stands in every line, else space."""
    for separator in ("\t", ";", ","):
        if lines and all(separator in line for line in lines):
            return separator
    return " "


def _split(line: str, separator: str) -> list[str]:
    return line.split() if separator == " " else line.rstrip("\r\n").split(separator)


def _is_number(cell: str) -> bool:
    return NUMBER.fullmatch(cell.strip().strip('"')) is not None


def _is_row(line: str, separator: str) -> bool:
    """A row has a number, and nothing that is neither number nor a word for none... but for a text column."""
    cells = _split(line, separator)
    numbers = sum(map(_is_number, cells))
    return numbers > 0 and 2 * numbers >= sum(cell.strip().lower() not in MISSING for cell in cells)


def _says_nan(column: Any) -> Any:
    """Which cells of a column of text say NaN themselves; pandas has already read those of a column of numbers."""
    if column.dtype.kind in "fiub":
        return np.zeros(len(column), dtype=bool)
    return column.astype(str).str.strip().str.lower().isin(["nan"]).to_numpy() & column.notna().to_numpy()
