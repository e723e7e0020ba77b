"""Text: delimited tables (.csv, .tsv, .txt) of any dialect, and the logs of some makers.

Lines are taken apart by the csv module and numbers read by pandas. A file that is cut keeps its whole lines: a number
without its end reads like another number, so a last row without a line end is left out.
"""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections import Counter
from collections.abc import Sequence
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

MEMORY_A_BYTE = 7
"""Bytes of memory for each of a text whose rows become lists of numbers: a number of eight characters is one of 32
bytes in a list of 8 an entry, beside its line twice."""

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


def whole_lines(path: Path) -> tuple[list[str], tuple[str, ...]]:
    """Return the lines of `whole_text`, one by one. Raises `InputError` as it does."""
    reserve(MEMORY_A_BYTE * path.stat().st_size, str(path))
    data, cut = whole_text(path)
    return data.decode().removesuffix("\n").split("\n"), cut


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
            line = line.strip()
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
        # Of the lines that are rows of numbers, as many as have the most common number of cells count.
        widths = Counter(len(dialect.cells(line)) for line in lines if dialect.is_row(line))
        width, count = widths.most_common(1)[0] if widths else (0, 0)
        return count if width > 1 else 0, -SEPARATORS.index(separator)

    best = max(SEPARATORS, key=score)
    # A table of one column is taken apart by blanks, which are in none of its cells.
    best = best if score(best)[0] else " "
    numbers = [cell for line in lines for cell in _Dialect(best).cells(line) if NUMBER_PATTERN.fullmatch(cell)]
    # A decimal comma is one only where commas do not separate cells, and no number has a point.
    comma = best != "," and any("," in cell for cell in numbers) and not any("." in cell for cell in numbers)
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

TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".asc", ".log")


@importer("csv", about="delimited text (.csv, .tsv, .txt)", suffixes=TEXT_SUFFIXES, recognises=_recognises)
def read_delimited(path: Path) -> Table:
    """Return columns by their headers, or `c0`, `c1`, ...; a unit in brackets in a header is the column's unit.

    A last row without its line end is left out. Cells that are no number become NaN, with a warning of the place; a
    column without any number is left out. Raises `InputError`, naming the line, for a row with too many cells.
    """
    data, cut = whole_text(path)
    lines = [line.decode().removesuffix("\n") for line in islice(io.BytesIO(data), 2 * HEADER_LINES)]
    rows = _content(lines)
    # From the second half of the first lines: what stands above a table is no row of it.
    dialect = _dialect(_together([lines[place] for place in rows[len(rows) // 2 :]]))
    names, units, first = _header(path, lines, rows, dialect)
    shape = data.count(b"\n") + 1 - first, len(names)
    if len(names) > MOST_COLUMNS and not (names == _plain(len(names)) and signals_in_rows(shape)):
        raise InputError(f"{path} has {len(names)} columns", why=f"at most {MOST_COLUMNS} are read")
    reserve(8 * shape[0] * shape[1], f"{path}, {shape[1]} columns of {shape[0]} rows,")
    frame = _frame(path, data, first, names, dialect)
    del data
    remarks: list[str] = []
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


def _frame(path: Path, data: bytes, first: int, names: list[str], dialect: _Dialect) -> Any:
    """Return the rows from line `first` on as a data frame. Raises `InputError` for a row with too many cells."""
    import pandas as pd

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # of cells that would be dropped
            return pd.read_csv(
                io.BytesIO(data),
                # Runs of blanks separate as one does.
                sep=r"\s+" if dialect.separator == " " else dialect.separator,
                header=None,
                skiprows=first,
                names=names,
                index_col=False,
                comment="#",
                decimal="," if dialect.comma else ".",
                skipinitialspace=True,
                skip_blank_lines=True,
                low_memory=False,
            )
    except pd.errors.EmptyDataError:
        return pd.DataFrame({name: [] for name in names})
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


def _header(path: Path, lines: list[str], rows: list[int], dialect: _Dialect) -> tuple[list[str], dict[str, str], int]:
    """Return names, units, and the number of the line with the first row, one of `rows`."""
    first = next((place for place in rows if dialect.is_row(lines[place])), None)
    if first is None:
        raise InputError(
            f"{path} has no row of numbers in its first {plural(min(len(lines), 2 * HEADER_LINES), 'line')}",
            why=f"the first line is {lines[0][:60]!r}",
            todo="check that it is the file you mean",
        )
    width = len(dialect.cells(lines[first]))
    comments = [line.lstrip("#% ") for line in lines[:first] if line.startswith(COMMENTS)]  # as numpy.savetxt has it
    words = [lines[place] for place in rows if place < first]
    above, remarked = (
        [c for c in map(dialect.cells, candidates) if len(c) == width] for candidates in (words, comments[-1:])
    )
    above = above or remarked
    if not above:
        if dialect.separator == "," and any(1 < len(dialect.cells(line)) == width / 2 for line in words):
            raise InputError(
                f"{path} has {plural(width // 2, 'name')} and {width} numbers in a row",
                why="where numbers have decimal commas, other commas do not separate them",
                todo="write points, or semicolons between the cells",
            )
        return _plain(width), {}, first
    names = [cell or f"c{k}" for k, cell in enumerate(above[0])]
    units = {name: match[2].strip() for name in names if (match := BRACKETED_UNIT.fullmatch(name)) and match[2].strip()}
    units |= {name: match[1] for name in names if (match := SLASHED_UNIT.fullmatch(name)) and match[1] in UNITS}
    # A second line of words under the names holds the units.
    if len(above) > 1:
        second = [cell.strip(" []()") for cell in above[1]]
        units |= {name: cell for name, cell in zip(names, second, strict=True) if cell}
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    if twice:
        why = "a mapping could not name one of them"
        raise InputError(f"{path} has two columns named '{twice[0]}'", why=why, todo="rename one of them")
    return names, units, first


def _rows(path: Path, lines: list[str], names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """Return the columns of the lines below the first; raises `InputError` for one that is no row."""
    rows = []
    for number, line in enumerate(lines[1:]):
        try:
            row = [float(word) for word in line.split()]
        except ValueError:
            row = []
        if len(row) != len(names):
            raise InputError(
                f"{path}: row {number} (line {number + 2}) is {line.strip()!r}",
                why=f"a row has {len(names)} numbers: {', '.join(names)}",
                todo="mend or cut that row",
            )
        rows.append(row)
    return dict(zip(names, np.array(rows).reshape(-1, len(names)).T, strict=True))


def _other(path: Path, line: str, kind: str, why: str) -> InputError:
    what = f"{path} is no {kind}: its first line is {line.strip()[:60]!r}"
    return InputError(what, why=why, todo="name another format with --format, or leave it out")


DEVICELOG = {
    "TIME": 1,
    "TIMESTAMP": 1,
    "BUTTONS": 1,
    **{f"{raw}{word}": 3 for raw in ("", "RAW_") for word in ("POSITION", "VELOCITY", "FORCE", "TORQUE")},
    **{f"{raw}ORIENTATION": 4 for raw in ("", "RAW_")},
}
"""The words of HAPI's DeviceLog and how many numbers each is: see HAPI/src/DeviceLog.cpp."""

COMPONENTS = {1: ("",), 3: (".x", ".y", ".z"), 4: (".axis_x", ".axis_y", ".axis_z", ".angle")}


def _is_devicelog(head: bytes) -> bool:
    words = decoded(head.split(b"\n")[0]).split() if is_text(head) else []
    return bool(words) and all(word in DEVICELOG for word in words)


@importer("devicelog", about="an ASCII log of HAPI's DeviceLog", recognises=_is_devicelog)
def read_devicelog(path: Path) -> Table:
    """Return one column per number: `POSITION.x`, `FORCE.z`, `BUTTONS`, ...

    The first line holds words of `DEVICELOG`, numbers have five decimals, and TIME counts seconds from the first row.
    The file states no other unit. RAW values are in the device's own frame.
    """
    lines, cut = whole_lines(path)
    words = lines[0].split()
    if not words or not DEVICELOG.keys() >= set(words):
        raise _other(path, lines[0], "DeviceLog", f"it holds words of {', '.join(DEVICELOG)}")
    names = [f"{word}{part}" for word in words for part in COMPONENTS[DEVICELOG[word]]]
    units = {name: "s" for name in names if name.startswith("TIME")}
    return Table(_rows(path, lines, names), units=units, warnings=cut)


SVC_NOTES = {
    "x": "mm in the BDALab's sample, counts of the tablet in most others",
    "y": "as x",
    "time": "s in the BDALab's sample, ms in most others",
    "pen": "1 on the tablet, 0 above it",
    "azimuth": "tenths of a degree in the BDALab's sample",
    "tilt": "as azimuth",
    "pressure": "of the range of the tablet, no newtons",
}


def _is_svc(head: bytes) -> bool:
    first, _, remainder = head.partition(b"\n")
    second = remainder.partition(b"\n")[0].split()
    return bool(re.fullmatch(rb"\s*\d+\s*", first)) and len(second) == len(SVC_NOTES)


@importer("svc", about="handwriting of a pen tablet (.svc)", recognises=_is_svc)
def read_svc(path: Path) -> Table:
    """Return the seven columns that follow the number of rows; a warning where there are fewer rows.

    No unit stands in the file, and tablets differ: the mapping has to give them.
    """
    lines, cut = whole_lines(path)
    if not re.fullmatch(r"\s*\d+\s*", lines[0]):
        raise _other(path, lines[0], ".svc file", "it is the number of rows")
    # The file's own count of rows shows whether some are missing.
    promised, count = int(lines[0]), len(lines) - 1
    columns = _rows(path, lines, tuple(SVC_NOTES))
    few = (f"the first line promises {promised} rows, {count} are whole",) if count != promised else ()
    return Table(columns, notes=SVC_NOTES, attributes={"promised_rows": promised}, warnings=cut + few)


VECTOR_PATTERN = r"(-?\d+\.\d+|-?nan|-?inf) " * 2 + r"(-?\d+\.\d+|-?nan|-?inf)"
HDU_ROW = re.compile(rf"(\d+)\t{VECTOR_PATTERN}\t\t{VECTOR_PATTERN}\t\t{VECTOR_PATTERN}\t\t(.*)")
HDU_UNITS = {f"{name}.{axis}": unit for name, unit in (("force", "N"), ("position", "mm"), ("velocity", "mm/s"))
             for axis in "xyz"}  # fmt: skip


def _is_hdurecord(head: bytes) -> bool:
    return HDU_ROW.fullmatch(head.split(b"\n")[0].decode("latin-1").rstrip("\r")) is not None


@importer("hdurecord", about="an ASCII record of OpenHaptics' hduRecord", recognises=_is_hdurecord)
def read_hdurecord(path: Path) -> Table:
    """Return ten columns, and `text[0]`, `text[1]`, ... where every row's text holds as many numbers.

    As the toolkit's utilities/src/hduRecord.cpp writes it: a line per tick of the scheduler, with force (N), position
    (mm), velocity (mm/s) and the application's text. There is no clock: the rate is 1000 Hz unless the application set
    another, so the mapping has to give it.
    """
    lines, cut = whole_lines(path)
    matches = [HDU_ROW.fullmatch(line) for line in lines]
    if None in matches:
        row = matches.index(None)
        raise InputError(
            f"{path}: row {row} is {lines[row]!r}",
            why="hduRecord writes a tick, three vectors and a text, separated by tabs",
            todo="mend or cut that row",
        )
    rows = [match.groups() for match in matches if match is not None]
    columns = dict(zip(("tick", *HDU_UNITS), np.array([row[:-1] for row in rows], dtype=np.float64).T, strict=True))
    texts = [re.split(r"[,;\s]+", row[-1].strip()) for row in rows]
    if any(words not in ([""], ["(null)"]) for words in texts):
        try:
            columns |= {f"text[{k}]": column for k, column in enumerate(np.array(texts, dtype=np.float64).T)}
        except ValueError:
            cut += ("the application's text is left out: it is not as many numbers in every row",)
    notes = {"tick": "ticks of the scheduler: 1000 a second unless the application set another rate"}
    return Table(columns, units=HDU_UNITS, notes=notes, warnings=cut)
