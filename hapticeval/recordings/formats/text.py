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
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticeval.errors import InputError
from hapticeval.recordings.formats.registry import importer, is_text
from hapticeval.recordings.formats.table import Table, lies, lying
from hapticeval.recordings.importing.units import UNITS

CLOCKS = ("t", "time", "zeit", "timestamp", "stamp", "seconds")
"""How a column that is a clock is called, in small letters and without its unit."""

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".asc", ".log")
COMMENTS = ("#", "%")
HEAD = 200
"""Lines from which header and dialect are read."""

SEPARATORS = ("\t", ";", ",", " ")
MISSING = {"", "nan", "na", "n/a", "null", "none", "-"}
NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
UNIT = re.compile(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*", re.DOTALL)
SLASH = re.compile(r".*[^\s/]/([^\s/]+)")
"""A unit as in `F_x/N`."""


def decoded(data: bytes) -> str:
    """Text of UTF-8 (with or without mark), UTF-16 with mark, or else Latin-1, which reads anything."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def whole_lines(path: Path) -> tuple[list[str], str]:
    """The lines of a text file that are whole, and what is left of a last one that may not be.

    Raises `InputError` where not one line is whole.
    """
    text = decoded(path.read_bytes())
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    last = lines.pop()  # what follows the last line end: nothing, where that is the end of the file
    if last and is_whole(last, lines[1:]):
        lines, last = [*lines, last], ""
    if not any(line.strip() for line in lines):
        raise InputError(
            f"{path} has no whole line",
            why=f"it ends within its first: {last[:60]!r}" if last.strip() else "it holds blanks only",
            todo="record or copy it again",
        )
    return lines, last


def is_whole(last: str, before: list[str]) -> bool:
    """Whether a last line without its line end is whole: in a column of fixed decimals a cut number has fewer."""
    ends = {_decimals(line) for line in before[-20:]}
    return len(before) > 1 and ends == {_decimals(last)} and ends != {(0, 0)}


def _decimals(line: str) -> tuple[int, int]:
    """Number of cells, and of decimals in the last cell; (0, 0) if that is not a plain decimal number."""
    cells = re.split(r"[,;\s]+", line.strip())
    found = re.fullmatch(r"[+-]?\d+\.(\d+)", cells[-1])
    return (len(cells), len(found[1])) if found else (0, 0)


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


# Delimited tables


@dataclass(frozen=True)
class _Dialect:
    """How the lines of a table are taken apart: what separates cells, and the sign between units and decimals."""

    separator: str
    comma: bool

    def cells(self, line: str) -> list[str]:
        """The cells of a line, without quotes."""
        if self.separator == " ":
            line = line.strip()
        try:
            found = next(csv.reader([line], delimiter=self.separator, skipinitialspace=True), [])
        except csv.Error:  # a null byte, or a cell of more than 131,072 characters
            return []
        return [cell.strip() for cell in found] if self.separator != " " else [cell for cell in found if cell]

    def is_row(self, line: str) -> bool:
        """Whether at least half of the cells that hold something are numbers: there may be a column of text."""
        cells = self.cells(line)
        numbers = sum(NUMBER.fullmatch(cell) is not None for cell in cells)
        return numbers > 0 and 2 * numbers >= sum(cell.lower() not in MISSING for cell in cells)


def _dialect(lines: Sequence[str]) -> _Dialect:
    """The dialect of most lines: the separator that takes most of them apart alike, into rows.

    csv.Sniffer was tried: it takes the decimal commas of `1;2,5` for the separator, and knows neither runs of blanks,
    nor a line of words above the table, nor a table of one column.
    """
    best, score = _Dialect(" ", False), (0, 0)
    for separator in SEPARATORS:
        dialect = _Dialect(separator, False)
        widths = Counter(len(dialect.cells(line)) for line in lines if dialect.is_row(line))
        (width, count), *_ = widths.most_common(1) or [(0, 0)]
        if (count if width > 1 else 0, -SEPARATORS.index(separator)) > score:
            best, score = dialect, (count, -SEPARATORS.index(separator))
    decimals = [cell for line in lines for cell in best.cells(line) if NUMBER.fullmatch(cell)]
    comma = best.separator != "," and any("," in cell for cell in decimals) and not any("." in c for c in decimals)
    return _Dialect(best.separator, comma)


def _recognises(head: bytes) -> bool:
    if not is_text(head):
        return False
    lines = _content(decoded(head).splitlines())
    return any(map(_dialect(lines[:HEAD]).is_row, lines))


def _content(lines: Sequence[str]) -> list[str]:
    return [line for line in lines if line.strip() and not line.startswith(COMMENTS)]


@importer("csv", about="delimited text (.csv, .tsv, .txt)", suffixes=SUFFIXES, recognises=_recognises)
def read_delimited(path: Path) -> Table:
    """Columns by their headers, or `c0`, `c1`, ...; a unit in brackets in a header is the column's unit.

    A last row without its line end is left out. Cells that are no number become NaN, with a warning of the place; a
    column without any number is left out. Raises `InputError`, naming the line, for a row with too many cells.
    """
    lines, cut = whole_lines(path)
    content = _content(lines[: 2 * HEAD])
    dialect = _dialect(content[len(content) // 2 :] or content)
    names, units, first = _header(path, lines, dialect)
    frame = _frame(path, lines, first, names, dialect)
    remarks: list[str] = []
    if names == _plain(len(names)) and lies(frame.shape):
        remarks.append(lying("the table", frame.shape))
        labels, named = frame[names[0]], frame[names[0]].dtype.kind not in "fiub"
        frame = (frame.iloc[:, 1:] if named else frame).T
        names = labels.astype(str).str.strip().tolist() if named else _plain(frame.shape[1])
        frame.columns, units = names, {name: found[2] for name in names if (found := UNIT.fullmatch(name))}
    columns: dict[str, Any] = {}
    lacking: dict[tuple[int, int, str], list[str]] = {}
    for name in frame.columns:
        values, empty = _numbers(frame[name], dialect)
        if empty.size == len(values) and len(values):
            remarks.append(f"the column '{name}' is text, which is left out")
            units.pop(name, None)
            continue
        if empty.size:
            cell = frame[name].iloc[int(empty[0])]
            said = f": {cell!r}" if isinstance(cell, str) else ", which is empty or NaN"
            lacking.setdefault((empty.size, int(empty[0]), said), []).append(name)
        columns[name] = values
    notices = [_lacking(alike, *event) for event, alike in lacking.items()]
    cells = tuple(notices)
    if cut.strip():
        clock = next((name for name in columns if UNIT.sub(r"\1", name).strip().lower() in CLOCKS), None)
        step = None if clock is None else step_of(columns[clock])
        notices.append(cut_row(len(frame), step, units.get(clock or "", "in the unit of its clock")))
    return Table(columns, units=units, warnings=tuple(notices), remarks=tuple(remarks), cells=cells)


def _frame(path: Path, lines: list[str], first: int, names: list[str], dialect: _Dialect) -> Any:
    """The rows from line `first` on as a data frame. Raises `InputError` for a row with too many cells."""
    import pandas as pd

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # of cells that would be dropped
            return pd.read_csv(
                io.StringIO("\n".join(lines)),
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
            f"{path} has a row with more cells than the others", why=str(error), todo="mend or cut that row"
        ) from error


def _numbers(column: Any, dialect: _Dialect) -> tuple[NDArray[Any], NDArray[Any]]:
    """The numbers of a column, integers where all of them are, and the rows of the cells that are none."""
    import pandas as pd

    if column.dtype.kind == "i":
        return column.to_numpy(), np.empty(0, dtype=np.intp)
    if column.dtype.kind in "fub":
        values = column.to_numpy(dtype=np.float64)
        return values, np.flatnonzero(np.isnan(values))
    texts = column.astype(str).str.strip()
    plain = texts.str.replace(",", ".", regex=False) if dialect.comma else texts
    values = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=np.float64)
    says_nan = (texts.str.lower() == "nan").to_numpy() & column.notna().to_numpy()
    return values, np.flatnonzero(np.isnan(values) & ~says_nan)


def _lacking(names: list[str], count: int, first: int, said: str) -> str:
    """One event a warning: the same cells of several columns are one."""
    cells = "1 cell" if count == 1 else f"{count} cells"
    who = (
        f"the column '{names[0]}' has"
        if len(names) == 1
        else "the columns " + ", ".join(f"'{name}'" for name in names) + " each have"
    )
    return f"{who} {cells} without a number, first at row {first}{said}"


def _plain(width: int) -> list[str]:
    return [f"c{k}" for k in range(width)]


def _header(path: Path, lines: list[str], dialect: _Dialect) -> tuple[list[str], dict[str, str], int]:
    """Names, units, and the number of the line with the first row."""
    head = range(min(len(lines), 2 * HEAD))
    rows = [place for place in head if lines[place].strip() and not lines[place].startswith(COMMENTS)]
    first = next((place for place in rows if dialect.is_row(lines[place])), None)
    if first is None:
        raise InputError(
            f"{path} has no row of numbers in its first {len(head)} lines",
            why=f"the first line is {lines[0][:60]!r}",
            todo="see that it is the file you mean",
        )
    width = len(dialect.cells(lines[first]))
    above = [dialect.cells(lines[place]) for place in rows if place < first]
    above = [cells for cells in above if len(cells) == width]
    if not above:  # as numpy.savetxt writes it: the header is a comment
        comments = [dialect.cells(line.lstrip("#% ")) for line in lines[:first] if line.startswith(COMMENTS)]
        above = [cells for cells in comments[-1:] if len(cells) == width]
    if not above:
        return _plain(width), {}, first
    names = [cell or f"c{k}" for k, cell in enumerate(above[0])]
    units = {name: found[2].strip() for name in names if (found := UNIT.fullmatch(name)) and found[2].strip()}
    units |= {name: found[1] for name in names if (found := SLASH.fullmatch(name)) and found[1] in UNITS}
    if len(above) > 1:
        second = [cell.strip(" []()") for cell in above[1]]
        units |= {name: cell for name, cell in zip(names, second, strict=True) if cell}
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            f"{path} has two columns named '{twice[0]}'", why="a mapping could not say which", todo="rename one of them"
        )
    return names, units, first


# Logs of makers

DEVICELOG = {
    "TIME": 1,
    "TIMESTAMP": 1,
    "BUTTONS": 1,
    **{f"{raw}{word}": 3 for raw in ("", "RAW_") for word in ("POSITION", "VELOCITY", "FORCE", "TORQUE")},
    **{f"{raw}ORIENTATION": 4 for raw in ("", "RAW_")},
}
"""The words of HAPI's DeviceLog and how many numbers each is: see HAPI/src/DeviceLog.cpp."""

COMPONENTS = {3: ("x", "y", "z"), 4: ("axis_x", "axis_y", "axis_z", "angle")}


def _rows(path: Path, lines: list[str], names: Sequence[str], *, above: int, why: str) -> NDArray[np.float64]:
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


def _first_words(head: bytes) -> list[str]:
    return decoded(head.split(b"\n")[0]).split() if is_text(head) else []


def _is_devicelog(head: bytes) -> bool:
    words = _first_words(head)
    return bool(words) and all(word in DEVICELOG for word in words)


@importer("devicelog", about="an ASCII log of HAPI's DeviceLog", recognises=_is_devicelog)
def read_devicelog(path: Path) -> Table:
    """A column for each number: `POSITION.x`, `FORCE.z`, `BUTTONS`, ...

    The first line holds words of `DEVICELOG`, numbers have five decimals, and TIME counts seconds from the first row.
    The file states no other unit. RAW values are in the device's own frame.
    """
    lines, cut = whole_lines(path)
    words = lines[0].split()
    unknown = [word for word in words if word not in DEVICELOG]
    if unknown or not words:
        raise InputError(
            f"{path} is no DeviceLog: its first line is {lines[0].strip()[:60]!r}",
            why=f"it holds words of {', '.join(DEVICELOG)}",
            todo="name another format with --format, or leave it out",
        )
    names = [f"{word}.{part}" if part else word for word in words for part in COMPONENTS.get(DEVICELOG[word], ("",))]
    table = _rows(path, lines, names, above=1, why=f"the first line promises {len(names)} numbers: {lines[0].strip()}")
    clock = next((k for k, name in enumerate(names) if name.startswith("TIME")), None)
    step = None if clock is None else step_of(table[:, clock])
    return Table(
        {name: table[:, k] for k, name in enumerate(names)},
        units={name: "s" for name in names if name.startswith("TIME")},
        warnings=(cut_row(len(table), step),) if cut.strip() else (),
    )


SVC = ("x", "y", "time", "pen", "azimuth", "tilt", "pressure")
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
    first, _, rest = head.partition(b"\n")
    second = rest.partition(b"\n")[0].split()
    return bool(re.fullmatch(rb"\s*\d+\s*", first)) and len(second) == len(SVC)


@importer("svc", about="handwriting of a pen tablet (.svc)", suffixes=(".svc",), recognises=_is_svc)
def read_svc(path: Path) -> Table:
    """The number of rows, then seven columns; a warning where there are fewer rows.

    No unit stands in the file, and tablets differ: the mapping has to give them.
    """
    lines, cut = whole_lines(path)
    if not re.fullmatch(r"\s*\d+\s*", lines[0]):
        raise InputError(
            f"{path} is no .svc file: its first line is {lines[0].strip()[:60]!r}",
            why="it is the number of rows",
            todo="name another format with --format, or leave it out",
        )
    promised = int(lines[0])
    table = _rows(path, lines, SVC, above=1, why=f"a row has {len(SVC)} numbers: {', '.join(SVC)}")
    step, unit = step_of(table[:, SVC.index("time")]), "in the unit of its clock"
    found = [cut_row(len(table), step, unit)] if cut.strip() else []
    if len(table) != promised:
        lost = f"{missing(promised - len(table), step, unit)} missing" if promised > len(table) else "it has more"
        found.append(f"the first line promises {promised} rows, {len(table)} are whole: {lost}")
    return Table(
        {name: table[:, k] for k, name in enumerate(SVC)},
        notes=SVC_NOTES,
        attributes={"promised_rows": promised},
        warnings=tuple(found),
    )


VECTOR = r"(-?\d+\.\d+|-?nan|-?inf) " * 2 + r"(-?\d+\.\d+|-?nan|-?inf)"
HDU_ROW = re.compile(rf"(\d+)\t{VECTOR}\t\t{VECTOR}\t\t{VECTOR}\t\t(.*)")
HDU_GROUPS = (("force", "N"), ("position", "mm"), ("velocity", "mm/s"))
HDU = ("tick", *(f"{name}.{axis}" for name, _ in HDU_GROUPS for axis in "xyz"))


def _is_hdurecord(head: bytes) -> bool:
    return HDU_ROW.fullmatch(head.split(b"\n")[0].decode("latin-1").rstrip("\r")) is not None


@importer("hdurecord", about="an ASCII record of OpenHaptics' hduRecord", recognises=_is_hdurecord)
def read_hdurecord(path: Path) -> Table:
    """Ten columns, and `text[0]`, `text[1]`, ... where every row's text holds as many numbers.

    As the toolkit's utilities/src/hduRecord.cpp writes it: a line per tick of the scheduler, with force (N), position
    (mm), velocity (mm/s) and the application's text. There is no clock: the rate is 1000 Hz unless the application set
    another, so the mapping has to give it.
    """
    lines, cut = whole_lines(path)
    rows, texts = [], []
    for number, line in enumerate(lines):
        found = HDU_ROW.fullmatch(line)
        if found is None:
            raise InputError(
                f"{path}: row {number} is {line!r}",
                why="hduRecord writes a tick, three vectors and a text, separated by tabs",
                todo="mend or cut that row",
            )
        rows.append([float(word) for word in found.groups()[:-1]])
        texts.append(found.groups()[-1])
    table = np.array(rows).reshape(-1, len(HDU))
    columns = {name: table[:, k] for k, name in enumerate(HDU)}
    appended, left_out = _appended(texts)
    columns |= {f"text[{k}]": appended[:, k] for k in range(appended.shape[1])}
    if cut.strip():
        left_out.append(cut_row(len(rows), None))
    return Table(
        columns,
        units={f"{name}.{axis}": unit for name, unit in HDU_GROUPS for axis in "xyz"},
        notes={"tick": "ticks of the scheduler: 1000 a second unless the application set another rate"},
        warnings=tuple(left_out),
    )


def _appended(texts: list[str]) -> tuple[NDArray[np.float64], list[str]]:
    nothing = np.empty((len(texts), 0))
    if all(text.strip() in ("", "(null)") for text in texts):
        return nothing, []
    try:
        numbers = np.array([[float(word) for word in re.split(r"[,;\s]+", text.strip())] for text in texts])
    except ValueError:
        return nothing, ["the application's text is left out: it is not as many numbers in every row"]
    return numbers, []
