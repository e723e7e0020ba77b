"""Text: delimited tables (.csv, .tsv, .txt, .lvm) of any dialect, and those of makers whose columns are known.

Lines are taken apart by the csv module and numbers read by pandas. A file that is cut keeps its whole lines: a number
without its end reads like another number, so a last row without a line end is left out.
"""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticeval.errors import InputError
from hapticeval.quantity import plural
from hapticeval.recordings.formats import (
    MOST_COLUMNS,
    Table,
    importer,
    is_text,
    signals_in_rows,
    signals_in_rows_remark,
)
from hapticeval.recordings.importing.units import UNITS
from hapticeval.recordings.memory import reserve

COMMENTS = ("#", "%")
HEADER_LINES = 200
"""Lines from which header and dialect are read."""

LOOKED_AT_BYTES = 1 << 20
"""Bytes of a text that are looked at together."""

SEPARATORS = ("\t", ";", ",", " ")
NO_NUMBER = {"", "nan", "na", "n/a", "null", "none", "-"}
NUMBER_PATTERN = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
BRACKETED_UNIT = re.compile(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*", re.DOTALL)
SLASHED_UNIT = re.compile(r".*[^\s/]/([^\s/]+)")
"""A unit as in `F_x/N`."""


def decoded(data: bytes) -> str:
    """Return text of UTF-8 (with or without mark), UTF-16 with mark, or else Latin-1, which reads anything."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def whole_text(path: Path) -> tuple[bytes, tuple[str, ...]]:
    """Return the lines of a text file that are complete, in UTF-8 with line feeds, and a warning where the last is not.

    A number that was cut off reads like another number, so a last line without its end is left out unless `is_whole`
    shows it to be complete. Raises `InputError` where not one line is complete.
    """
    reserve(path.stat().st_size, str(path))
    data = decoded(path.read_bytes()).encode().replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    end = data.rfind(b"\n") + 1  # what follows the last line end is nothing, where that is the end of the file
    last = data[end:].decode()
    # Whole lines before it, without the first, which may be a header: they show how many decimals a line has.
    before = data[max(data.find(b"\n") + 1, end - LOOKED_AT_BYTES) : end].decode(errors="replace").split("\n")[:-1]
    complete = not last or is_whole(last, before)
    data = data if complete else data[:end]
    if not data or data.isspace():
        raise InputError(
            f"{path} has no whole line",
            why=f"it ends within its first: {last[:60]!r}" if last.strip() else "it holds blanks only",
            todo="record or copy it again",
        )
    number = data.count(b"\n") + 1
    cut = f"the file ends within line {number}, which is left out: a cut number reads like another number"
    return data, () if complete or not last.strip() else (cut,)


def is_whole(last: str, before: list[str]) -> bool:
    """Return whether a last line that lacks its line end is complete all the same.

    It is where every line `before` ends in the same fixed number of decimals, and so does the last.
    """

    def decimals(line: str) -> tuple[int, int]:
        cells = re.split(r"[,;\s]+", line.strip())
        fraction = re.fullmatch(r"[+-]?\d+\.(\d+)", cells[-1])
        # How many cells, and how many decimals the last of them has; (0, 0) where it has no fixed number of them.
        return (len(cells), len(fraction[1])) if fraction else (0, 0)

    ends = {decimals(line) for line in before[-20:]}
    # Every line before it ends alike: then a cut one would show by a missing digit or cell.
    return len(before) > 1 and ends == {decimals(last)} and ends != {(0, 0)}


@dataclass(frozen=True)
class _Dialect:
    """How the lines of a table are taken apart: the separator of cells, and whether decimals follow a comma."""

    separator: str
    comma: bool = False

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line, without quotes."""
        if self.separator == " ":
            line = line.strip().replace("\t", " ")
        try:
            cells = next(csv.reader([line], delimiter=self.separator, skipinitialspace=True), [])
        except csv.Error:  # a null byte, or a cell of more than 131,072 characters
            return []
        return [cell.strip() for cell in cells] if self.separator != " " else [cell for cell in cells if cell]

    def is_row(self, line: str) -> bool:
        """Return whether at least half of the cells that hold something are numbers: a column may be text."""
        cells = self.cells(line)
        numbers = sum(NUMBER_PATTERN.fullmatch(cell) is not None for cell in cells)
        return numbers > 0 and 2 * numbers >= sum(cell.lower() not in NO_NUMBER for cell in cells)


def _dialect(lines: Sequence[str]) -> _Dialect:
    """Return the dialect of most lines: the separator that takes most of them apart alike, into rows.

    csv.Sniffer was tried: it takes the decimal commas of `1;2,5` for the separator, and knows neither runs of blanks,
    nor a line of words above the table, nor a table of one column.
    """

    def score(separator: str) -> tuple[int, int]:
        dialect = _Dialect(separator)
        # Count the rows of numbers that have the most common number of cells.
        widths = Counter(len(dialect.cells(line)) for line in lines if dialect.is_row(line))
        width, count = widths.most_common(1)[0] if widths else (0, 0)
        return count if width > 1 else 0, -SEPARATORS.index(separator)

    best = max(SEPARATORS, key=score)
    # A table of one column is taken apart by blanks, which are in none of its cells.
    best = best if score(best)[0] else " "
    numbers = [cell for line in lines for cell in _Dialect(best).cells(line) if NUMBER_PATTERN.fullmatch(cell)]
    # A decimal comma is one only where no number has a point; between commas such a cell stands in quotes.
    comma = any("," in cell for cell in numbers) and not any("." in cell for cell in numbers)
    return _Dialect(best, comma)


def _recognises(head: bytes) -> bool:
    """Return whether the first lines of a text hold a row of numbers."""
    if not is_text(head):
        return False
    lines = decoded(head).splitlines()
    content = [lines[place] for place in _content(lines)]
    return any(map(_dialect(content[:HEADER_LINES]).is_row, content))


def _content(lines: Sequence[str]) -> list[int]:
    """Return the numbers of the lines that hold more than blanks or a comment."""
    return [place for place, line in enumerate(lines) if line.strip() and not line.startswith(COMMENTS)]


DATE_PATTERN = re.compile(r"\d{2,4}[-/.]\d{1,2}[-/.]\d{1,4}[T ,]|\d{1,2}:\d{2}:\d{2}")
THOUSANDS_PATTERN = re.compile(r"[+-]?\d{1,3}([.,'\u2019 ]\d{3})+([.,]\d+)?")
"""A date or a time of the day, and a number whose thousands are parted: no number of a table."""

TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".asc", ".log", ".lvm", ".svc")


@importer("csv", about="delimited text (.csv, .tsv, .txt)", suffixes=TEXT_SUFFIXES, recognises=_recognises)
def read_delimited(path: Path) -> Table:
    """Return columns by their headers, or `c0`, `c1`, ...; a unit in brackets in a header is the column's unit.

    A last row without its line end is left out. Cells that are not a number become NaN, with a warning of the place; a
    column without any number is left out. Raises `InputError`, naming the line, for a row with too many cells.
    """
    data, cut = whole_text(path)
    lines = [line.decode().removesuffix("\n") for line in islice(io.BytesIO(data), 2 * HEADER_LINES)]
    rows = _content(lines)
    # From the second half of the first lines: what stands above a table is not a row of it.
    dialect = _dialect(_together([lines[place] for place in rows[len(rows) // 2 :]]))
    header = _header(path, lines, rows, dialect)
    names, units, remarks = header.names, dict(header.units), list(header.remarks)
    shape = data.count(b"\n") + 1 - header.first, len(names)
    if len(names) > MOST_COLUMNS and not (names == _plain(len(names)) and signals_in_rows(shape)):
        raise InputError(f"{path} has {len(names)} columns", why=f"at most {MOST_COLUMNS} are read")
    reserve(8 * shape[0] * shape[1], f"{path}, {shape[1]} columns of {shape[0]} rows,")
    frame = _frame(path, data, header, dialect)
    del data
    # A table without a header whose signals are rows: each row's first cell may name it.
    if names == _plain(len(names)) and signals_in_rows(frame.shape):
        remarks.append(signals_in_rows_remark("the table", frame.shape))
        labels, named = frame[names[0]], frame[names[0]].dtype.kind not in "fiub"
        frame = (frame.iloc[:, 1:] if named else frame).T
        frame.columns = labels.astype(str).str.strip().tolist() if named else _plain(frame.shape[1])
        units = {name: match[2] for name in frame.columns if (match := BRACKETED_UNIT.fullmatch(name))}
    columns: dict[str, Any] = {}
    lacking: dict[tuple[int, int, str], list[str]] = {}
    for name in frame.columns:
        # `empty` are the rows of the cells without a number.
        values, empty = _numbers(frame[name], dialect)
        if empty.size == len(values) and len(values):
            cell = str(frame[name].iloc[0]).strip()
            why = "is text, which" if frame[name].dtype.kind == "O" else "has no number in any row, and"
            todo = ": a clock is read where it counts, so write it in seconds" if DATE_PATTERN.match(cell) else ""
            remarks.append(f"the column '{name}' {why} is left out{todo}")
            units.pop(name, None)
            continue
        if empty.size:
            cell = frame[name].iloc[int(empty[0])]
            excerpt = f": {cell!r}" if isinstance(cell, str) else ", which is empty or NaN"
            if THOUSANDS_PATTERN.fullmatch(str(cell).strip()):
                excerpt += ", so write numbers without a sign between thousands"
            # Columns that lack the same cells are named together, in one warning.
            lacking.setdefault((empty.size, int(empty[0]), excerpt), []).append(f"'{name}'")
        columns[name] = values
    cells = tuple(
        f"{plural(count, 'cell')} without a number in {', '.join(alike)}, first at row {row}{excerpt}"
        for (count, row, excerpt), alike in lacking.items()
    )
    return Table(columns, units=units, warnings=(*cells, *cut), remarks=tuple(remarks), cells=cells)


def _together(lines: list[str]) -> list[str]:
    """Return the first lines that have `LOOKED_AT_BYTES` characters together, and one at the least."""
    ends = np.cumsum([len(line) for line in lines])
    return lines[: max(1, int(np.searchsorted(ends, LOOKED_AT_BYTES)))]


def _frame(path: Path, data: bytes, header: _Header, dialect: _Dialect) -> Any:
    """Return the rows below a header as a data frame. Raises `InputError` for a row with too many cells."""
    import pandas as pd

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # of cells that would be dropped
            return pd.read_csv(
                io.BytesIO(data),
                # Runs of blanks separate as one does.
                sep=r"\s+" if dialect.separator == " " else dialect.separator,
                header=None,
                skiprows=header.first,
                names=header.names,
                usecols=range(len(header.names)) if header.tail else None,
                index_col=False,
                comment="#",
                decimal="," if dialect.comma else ".",
                skipinitialspace=True,
                skip_blank_lines=True,
                low_memory=False,
            )
    except pd.errors.EmptyDataError:
        return pd.DataFrame({name: [] for name in header.names})
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        raise InputError(
            f"{path} has a row with more cells than the others", why=str(error).strip(), todo="mend or cut that row"
        ) from error


def _numbers(column: Any, dialect: _Dialect) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the numbers of a column, integers where all of them are, and the rows of the cells that are none."""
    import pandas as pd

    if column.dtype.kind in "ifub":
        values = column.to_numpy() if column.dtype.kind == "i" else column.to_numpy(dtype=np.float64)
        return values, np.flatnonzero(np.isnan(values))
    texts = column.astype(str).str.strip()
    plain = texts.str.replace(",", ".", regex=False) if dialect.comma else texts
    values = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=np.float64)
    # A written nan is the file's own statement, an empty cell is none.
    is_nan = (texts.str.lower() == "nan").to_numpy() & column.notna().to_numpy()
    return values, np.flatnonzero(np.isnan(values) & ~is_nan)


def _plain(width: int) -> list[str]:
    return [f"c{k}" for k in range(width)]


@dataclass(frozen=True)
class _Header:
    """The names of the columns, the units of some, the line with the first row, and whether a text ends each row."""

    names: list[str]
    units: Mapping[str, str]
    first: int
    remarks: tuple[str, ...] = ()
    tail: bool = False


DEVICELOG = {
    "TIME": 1,
    "TIMESTAMP": 1,
    "BUTTONS": 1,
    **{f"{raw}{word}": 3 for raw in ("", "RAW_") for word in ("POSITION", "VELOCITY", "FORCE", "TORQUE")},
    **{f"{raw}ORIENTATION": 4 for raw in ("", "RAW_")},
}
"""The words of HAPI's DeviceLog and how many numbers each is (HAPI/src/DeviceLog.cpp). TIME counts seconds."""

COMPONENTS = {1: ("",), 3: (".x", ".y", ".z"), 4: (".axis_x", ".axis_y", ".axis_z", ".angle")}

HDU_ROW = re.compile(r"\d+\t[^\t]+\t\t[^\t]+\t\t[^\t]+\t\t")
HDU_UNITS = {f"{name}.{axis}": unit for name, unit in (("force", "N"), ("position", "mm"), ("velocity", "mm/s"))
             for axis in "xyz"}  # fmt: skip
"""A row of OpenHaptics' hduRecord, and its columns after the scheduler's tick and before the application's text."""

END_OF_HEADER = "***End_of_Header***"
"""The line under which LabVIEW has the names of its columns (.lvm)."""


def _header(path: Path, lines: list[str], rows: list[int], dialect: _Dialect) -> _Header:
    """Return what stands above the first row, which is one of the lines `rows`."""
    rows = rows[max((at + 1 for at, place in enumerate(rows) if lines[place].startswith(END_OF_HEADER)), default=0) :]
    numbers = {place: len(dialect.cells(lines[place])) for place in rows if dialect.is_row(lines[place])}
    if not numbers:
        raise InputError(
            f"{path} has no row of numbers in its first {plural(min(len(lines), 2 * HEADER_LINES), 'line')}",
            why=f"the first line is {lines[0][:60]!r}",
            todo="check that it is the file you mean",
        )
    # As many cells as most rows have: a number of rows, say, may stand above them.
    width = Counter(numbers.values()).most_common(1)[0][0]
    first = next(place for place, count in numbers.items() if count == width)
    if HDU_ROW.match(lines[first]) and width > len(HDU_UNITS):
        return _Header(["tick", *HDU_UNITS], HDU_UNITS, first, ("the application's text is left out",), tail=True)
    remarks = tuple(
        f"the line {lines[place].strip()[:60]!r} above the table is left out" for place in numbers if place < first
    )
    comments = [line.lstrip("#% ") for line in lines[:first] if line.startswith(COMMENTS)]  # as numpy.savetxt has it
    words = [lines[place] for place in rows if place < first and place not in numbers]
    row = dialect.cells(lines[first])
    above, remarked = ([_names(line, row, dialect) for line in candidates] for candidates in (words, comments[-1:]))
    above = [names for names in above if names] or [names for names in remarked if names]
    if not above:
        return _Header(_plain(width), {}, first, remarks + _remarks_on_no_names(path, words, width, dialect))
    names = [cell or f"c{k}" for k, cell in enumerate(above[0])]
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    if twice:
        why = "a mapping could not name one of them"
        raise InputError(f"{path} has two columns named '{twice[0]}'", why=why, todo="rename one of them")
    return _Header(names, _units(names, above[1:]), first, remarks)


def _remarks_on_no_names(path: Path, words: list[str], width: int, dialect: _Dialect) -> tuple[str, ...]:
    """Return what to say of lines of `words` above rows of `width` cells, of which none names the columns."""
    counts = [len(dialect.cells(line)) for line in words]
    if dialect.separator == "," and any(1 < count == width / 2 for count in counts):
        raise InputError(
            f"{path} has {plural(width // 2, 'name')} and {width} numbers in a row",
            why="where numbers have decimal commas, other commas do not separate them",
            todo="write points, or semicolons between the cells",
        )
    if not words or counts[-1] < 2:
        return ()
    return (f"{words[-1].strip()[:200]!r} has {counts[-1]} cells and the rows {width}: it names no column",)


def _units(names: list[str], below: list[list[str]]) -> dict[str, str]:
    """Return the units that stand in names of columns, or under them in the first line `below`, if there is one."""
    units = {name: match[2].strip() for name in names if (match := BRACKETED_UNIT.fullmatch(name)) and match[2].strip()}
    units |= {name: match[1] for name in names if (match := SLASHED_UNIT.fullmatch(name)) and match[1] in UNITS}
    if names[0] == "TIME" and {name.partition(".")[0] for name in names} <= DEVICELOG.keys():
        units["TIME"] = "s"
    for line in below[:1]:
        units |= {name: unit for name, cell in zip(names, line, strict=True) if (unit := cell.strip(" []()"))}
    return units


def _names(line: str, row: list[str], dialect: _Dialect) -> list[str]:
    """Return the names that a line gives to the cells of a row; none where it gives more or fewer."""
    cells = dialect.cells(line)
    candidates = [
        cells,
        # A separator before a blank belongs to a name where the others have none behind them: "Time, elapsed,x,y".
        [cell.strip(' "') for cell in re.split(rf"{re.escape(dialect.separator)}(?! )", line)],
        # Rows or names may end with a separator; LabVIEW names a last column of texts, which rows need not have.
        [*cells, *(row[-1:] if row[-1] == "" else [])],
        cells[:-1] if cells[-1:] in (["Comment"], [""]) else [],
        [f"{cell}{part}" for cell in cells for part in COMPONENTS[DEVICELOG.get(cell, 1)]],
    ]
    return next((candidate for candidate in candidates if len(candidate) == len(row)), [])
