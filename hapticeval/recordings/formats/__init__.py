"""Other people's files, read as tables of raw columns: which formats there are, and which of them a file is of.

A format of your own is a function that takes a path and gives a `Table`, marked with `importer`:

    from hapticeval.recordings.formats import Table, importer

    @importer("acme", about="log of an ACME stick", suffixes=(".acme",))
    def read_acme(path):
        rows = [line.split("|") for line in path.read_text().splitlines()]
        return Table(
            {"t": [float(row[0]) for row in rows], "x": [float(row[1]) for row in rows]},
            units={"t": "ms"},
        )

- It gives what the file states and no more: a unit that the file does not state is left out, and the mapping gives it.
- Columns have a number in each row, nan where the file has none.
- Of signals on several clocks each has its clock, and `topics` names which columns were taken together.
- On the command line it is named `--format mymodule:read_acme`, which no mapping may do.
- An installed package offers it by an entry point of the group `hapticeval.formats`. One of ours is a line of
  `OWN_FORMATS`.
"""

from __future__ import annotations

import inspect
import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hapticeval.errors import HapticevalError, InputError, UnknownNameError, describe_error, origin, unreadable
from hapticeval.extras import install_command
from hapticeval.recordings.importing.units import parse_unit
from hapticeval.recordings.memory import FOLDER_MARK, HEAD_BYTES, first_bytes, reserve
from hapticeval.registrations import entries_of

FORMAT_GROUP = "hapticeval.formats"
"""Entry points of this group are functions of other packages, marked with `importer`."""

OWN_FORMATS = {
    "matlab5": "matlab",
    "matlab73": "matlab",
    "hdf5": "arrays",
    "npz": "arrays",
    "npy": "arrays",
    "parquet": "arrays",
    "tdms": "arrays",
    "rosbag": "rosbag",
    "csv": "text",
}
"""The formats of this package and the module of each, the most particular first: delimited text fits much."""

MOST_SIGNALS = 64
"""A matrix of more columns than these that has fewer rows than columns holds its signals in rows."""

MOST_COLUMNS = 10_000
"""Columns of a table, *chosen*: with twice as many, a proposal of a mapping takes twice as long."""

SECONDS_NAME = re.compile(r"(?<![a-z])secs?$", re.IGNORECASE)
"""The seconds of a stamp, whose nanoseconds are a column of their own."""

SIGNATURES: tuple[tuple[bytes, str], ...] = (
    (b"\x89PNG\r\n\x1a\n", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"%PDF-", "a PDF document"),
    (b"PK\x03\x04", "a ZIP archive (an .npz, .xlsx or .zip)"),
    (b"\x1f\x8b", "a gzip archive: unpack it first"),
    (b"BZh", "a bzip2 archive: unpack it first"),
    (b"\xfd7zXZ\x00", "an xz archive: unpack it first"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive: unpack it first"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive: unpack it first"),
    (b"ARROW1", "an Arrow file"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
    (b"MATLAB 7.3 MAT-file", "a MATLAB 7.3 file"),
    (b"MATLAB 5.0 MAT-file", "a MATLAB 5 file"),
    (b"SQLite format 3\x00", "an SQLite database: give the folder of the ROS 2 bag, with its metadata.yaml"),
    (b"#ROSBAG V", "a ROS 1 bag"),
    (b"\x80\x04", "a Python pickle, which is never opened: it can run code"),
    (b"\x80\x05", "a Python pickle, which is never opened: it can run code"),
    (b"\xd0\xcf\x11\xe0", "an old Office document"),
)


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers, each (n,), float64 or int64; they may differ in length, as topics of a bag do.

    Integers stay integers: nanoseconds of a wall clock do not fit into a float. Beside them are

    - `units`: only what the file or its format states;
    - `notes`: the file's text about a column, such as a scope's label;
    - `attributes`: single numbers and texts of the file;
    - `warnings`: what is missing or damaged; `remarks`: what is whole but no column of numbers;
    - `cells`: those of the warnings that report cells without a number, which a recording counts itself;
    - `topics`: for columns of a file that holds several streams, the stream of each. Rows of different streams are at
      different times, however many there are.

    Raises `InputError`, naming the column, for one that is not a row of numbers, and where all of them take more memory
    than `memory.limited` allows.
    """

    columns: Mapping[str, ArrayLike]
    units: Mapping[str, str] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)
    warnings: Sequence[str] = ()
    remarks: Sequence[str] = ()
    format: str = ""
    cells: Sequence[str] = ()
    topics: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.columns) > MOST_COLUMNS:
            raise InputError(
                f"there are {len(self.columns)} columns",
                why=f"at most {MOST_COLUMNS} are read: no device has as many signals",
                todo="leave out what is not a signal, or write signals as columns and samples as rows",
            )
        reserve(8 * sum(np.size(values) for values in self.columns.values()), "the columns of the file")
        # The class is frozen: this is its own constructor.
        object.__setattr__(self, "columns", {name: _column(name, values) for name, values in self.columns.items()})
        for name in ("warnings", "remarks", "cells"):
            object.__setattr__(self, name, tuple(getattr(self, name)))

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column, (n,). Raises `UnknownNameError`, which suggests the closest and names all, for no column."""
        if name in self.columns:
            return np.asarray(self.columns[name])
        error = UnknownNameError("column", name, self.columns)
        # The closest name may be of something else: only all of them show what the file calls it.
        if self.columns and "known: " not in error.todo:
            error.todo += f" known: {', '.join(sorted(self.columns))}"
        # A column that the file has and that is not a column of numbers.
        error.why = next((remark for remark in self.remarks if f"'{name}'" in remark), error.why)
        raise error

    def rows(self, name: str) -> int:
        """Return how many numbers a column has."""
        return int(self[name].size)


def _column(name: str, values: ArrayLike) -> NDArray[Any]:
    """Return a column as a read-only array (n,) of float64 or int64. Raises `InputError` for what is none."""
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "fiub":
        raise InputError(
            f"column '{name}' is of shape {array.shape} and type {array.dtype}",
            why="a column is one number per row",
            todo="split an array of several columns into one each: see `spread`",
        )
    # Read-only and nobody's view: no copy is needed.
    if array.dtype in (np.float64, np.int64) and not array.flags.writeable and array.base is None:
        return array  # a column of a table already
    # Integers stay 64-bit integers (a wall clock in ns does not fit a float); booleans count as integers.
    numbers = np.array(array, dtype=np.float64 if array.dtype.kind == "f" else np.int64)
    numbers.flags.writeable = False
    return numbers


def spread(name: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return the columns of an array (n, ...): itself where it is one column, else `name[0]`, `name[1]`, ...

    The array's first axis is the samples: (n,) stays as it is, (n, k) becomes k columns (n,), in the unit of the array
    (m, N or what the file states).
    """
    if values.ndim == 1:
        return {name: values}
    # The first axis is the samples; all others become columns, the last one running fastest.
    flat = values.reshape(len(values), -1)
    return {name if flat.shape[1] == 1 else f"{name}[{k}]": column for k, column in enumerate(flat.T)}


def signals_in_rows(shape: tuple[int, ...]) -> bool:
    """Return whether a matrix of this shape has its signals in rows and its samples in columns."""
    return len(shape) == 2 and shape[1] > max(MOST_SIGNALS, shape[0])


def signals_in_rows_remark(name: str, shape: tuple[int, ...]) -> str:
    """Return the remark on a matrix whose rows and columns are swapped."""
    return f"{name} is {shape[0]} x {shape[1]}: its {shape[0]} rows are taken for the signals, its columns for samples"


PICTURE_NUMBERS = 64
"""Numbers a sample of an array that has more than one axis a sample: beyond, they are pictures or clouds of points."""


def is_picture(shape: tuple[int, ...]) -> bool:
    """Return whether an array of this shape holds a picture or a cloud of points a sample: no channels of a device."""
    return len(shape) > 2 and math.prod(shape[1:]) > PICTURE_NUMBERS


def picture_remark(name: str, shape: tuple[int, ...]) -> str:
    """Return the remark on an array of pictures."""
    return f"'{name}' is {' x '.join(map(str, shape))}: pictures are not channels, and are left out"


def samples_first(name: str, values: NDArray[Any], remarks: list[str]) -> NDArray[Any]:
    """Return an array (n,) or (n, k) with its samples along the first axis, as far as its shape alone shows it.

    A single row is a column that lies down. A matrix of many more columns than any device has signals, and of fewer
    rows than columns, has its signals in rows: a remark names that they were swapped. Numbers and their unit (m, N or
    what the file states) stay as they are.
    """
    if values.ndim != 2 or (values.shape[0] > 1 and not signals_in_rows(values.shape)):
        return values
    if values.shape[0] > 1:
        remarks.append(signals_in_rows_remark(name, values.shape))
    return values.T


def missing_library(path: Path, kind: str, package: str, extra: str, error: ImportError) -> HapticevalError:
    """Return the error of a file that only a library reads which is not installed, with the command that adds it."""
    what = f"{path} is {kind}, which needs the package '{package}'"
    return HapticevalError(what, why=str(error), todo=install_command(extra))


def damaged_error(path: Path, why: str) -> InputError:
    """Return the error of a foreign file that is not whole."""
    return InputError(f"{path} is cut short or damaged", why=why, todo="copy it again from where it was recorded")


def is_text(head: bytes) -> bool:
    """Return whether the first bytes of a file look like text."""
    # Byte order marks of UTF-16 and UTF-8.
    if head.startswith((b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")):
        return True
    # A binary file shows itself by control characters, or by the signature of its kind.
    control = any(byte < 32 and byte not in b"\t\n\f\r" for byte in head)
    return bool(head) and not control and _described_kind(head) is None


def _described_kind(head: bytes) -> str | None:
    """Return what the first bytes show a file to be, in words; None where they show nothing."""
    start = head.lstrip()[:200].lower()
    if start.startswith((b"<!doctype html", b"<html")):
        return "a web page"
    if start.startswith(b"<?xml"):
        return "an XML file"
    if start[:1] in (b"{", b"[") and b'"' in start:
        return "a JSON file"
    return next((words for signature, words in SIGNATURES if head.startswith(signature)), None)


Read = Callable[[Path], Table]
Recognise = Callable[[bytes], bool]


@dataclass(frozen=True)
class Format:
    """A file format: its name, what it is, the function that reads it, and how its files are recognised."""

    name: str
    about: str
    read: Read
    suffixes: tuple[str, ...] = ()
    recognises: Recognise | None = None

    def fits(self, path: Path, head: bytes) -> bool:
        """Return whether a file is of this format, by its first bytes where the format knows them, else by its name."""
        if self.recognises is None:
            return path.suffix.lower() in self.suffixes
        with (
            nullcontext() if self.ours else blame_importer(f"what recognises the format '{self.name}'", self.recognises)
        ):
            return bool(self.recognises(head))

    @property
    def ours(self) -> bool:
        """Whether it is one of this package's."""
        # By the function's module: other people's formats are offered files first, and blamed for their errors.
        return getattr(self.read, "__module__", "").startswith(f"{__name__}.")


REGISTERED: dict[str, Format] = {}
"""The formats that were registered in this process."""


def importer(
    name: str, *, about: str, suffixes: Iterable[str] = (), recognises: Recognise | None = None
) -> Callable[[Read], Read]:
    """Register a function `read(path) -> Table` as the format `name`.

    `recognises(first bytes)`, or where it is absent `suffixes` (".acme"), decide which files are of it; with neither
    the format is chosen by its name only. Raises `InputError` for a name that another function has.
    """

    def register(read: Read) -> Read:
        known = REGISTERED.get(name)
        if known is not None and importer_name(known.read) != importer_name(read):
            why = f"{known.read.__module__} registered it"
            raise InputError(f"the format '{name}' is there already", why=why, todo="choose another name")
        REGISTERED[name] = Format(name, about, read, tuple(suffix.lower() for suffix in suffixes), recognises)
        return read

    return register


def formats() -> Mapping[str, Format]:
    """Return every format by name, in the order in which a file is offered to them: other people's before ours."""
    for module in OWN_FORMATS.values():
        import_module(f"{__name__}.{module}")
    for entry in entries_of(FORMAT_GROUP):
        with blame_importer(f"the format '{entry.name}' of an installed package ({entry.value})"):
            entry.load()
    # Other people's come first: delimited text, the last of ours, would fit many of their files.
    others = [known_format for known_format in REGISTERED.values() if not known_format.ours]
    return MappingProxyType(
        {known_format.name: known_format for known_format in (*others, *(REGISTERED[name] for name in OWN_FORMATS))}
    )


def read_table(path: Path | str, *, format: str | None = None) -> Table:
    """Return the columns of a file, as they stand in it.

    `format` names one of `formats()`, or `package.module:function` of one that is not installed, which runs that code:
    it is for names that a user gives, never for names that a file gives. Without it the file's first bytes and its name
    decide.

    Raises `InputError`

    - where the file is missing, empty, damaged or larger than `memory.limited` allows;
    - where it is something else: the message names what;
    - for somebody else's importer that cannot be loaded, raises anything, or gives no sound table, with the line in its
      own file.
    """
    path = Path(path)
    chosen = _detected_format(path) if format is None else _named_format(format)
    # Ours count what they take, and leave out what is not a channel before.
    if not chosen.ours and path.is_file():
        reserve(path.stat().st_size, str(path))
    with nullcontext() if chosen.ours else blame_importer(f"the importer {importer_name(chosen.read)}", chosen.read):
        try:
            table = chosen.read(path)
        except OSError as error:
            # An importer that cannot open a file of its own is at fault itself, and is blamed as such.
            if not chosen.ours and str(error.filename) != str(path):
                raise
            raise unreadable(str(path), error) from error
    if not chosen.ours:
        _check(table, f"the importer {importer_name(chosen.read)}")
    if not table.columns:
        raise InputError(
            f"{path} holds no column of numbers",
            why="; ".join([*table.warnings, *table.remarks]) or f"it was read as {chosen.about}",
            todo="name another format with --format",
        )
    return replace(_with_joined_stamps(table), format=format or chosen.name)


def _with_joined_stamps(table: Table) -> Table:
    """Return a table in which seconds and their nanoseconds, as ROS has a stamp, are one clock beside them, in ns.

    The column `stamp.secs+nsecs` is made of `stamp.secs` and `stamp.nsecs`, and so of `sec` and `nanosec`.
    """
    stamps = {}
    for name in filter(SECONDS_NAME.search, table.columns):
        for prefix in ("n", "nano"):
            # `stamp.secs` has its nanoseconds in `stamp.nsecs` or `stamp.nanosecs`.
            nanoseconds_name = SECONDS_NAME.sub(rf"{prefix}\g<0>", name)
            if nanoseconds_name in table.columns and _is_stamp(table[name], table[nanoseconds_name]):
                leaf = re.split(r"[./]", nanoseconds_name)[-1]
                stamps[f"{name}+{leaf}"] = table[name] * 1_000_000_000 + table[nanoseconds_name]
    topics = {stamp: table.topics[name] for stamp in stamps if (name := stamp.rpartition("+")[0]) in table.topics}
    return replace(
        table,
        columns={**table.columns, **stamps},
        units={**table.units, **dict.fromkeys(stamps, "ns")},
        topics={**table.topics, **topics},
    )


def _is_stamp(seconds: NDArray[Any], nanoseconds: NDArray[Any]) -> bool:
    """Return whether these are whole seconds that 64 bits hold in ns, and nanoseconds of one second."""
    if seconds.size != nanoseconds.size:
        return False
    stated = np.isfinite(seconds) & np.isfinite(nanoseconds)
    s, ns = seconds[stated], nanoseconds[stated]
    return bool(np.all((s == np.rint(s)) & (np.abs(s) < 9e9) & (ns >= 0) & (ns < 1e9)))


def _detected_format(path: Path) -> Format:
    """Return the format of a file, by its bytes or its name. Raises `InputError` that says what it is instead."""
    head, known = first_bytes(path), formats()
    for candidate in known.values():
        if candidate.fits(path, head):
            return candidate
    if is_text(head) and path.suffix.lower() in known["csv"].suffixes and len(head) == HEAD_BYTES:
        return known["csv"]  # a header longer than what was looked at
    words = _described_kind(head) or ("text without a row of numbers" if is_text(head) else None)
    why = f"its name ends in '{path.suffix}', its first bytes are {head[:16]!r}"
    if head.startswith(FOLDER_MARK):
        words, inside = "a folder", head.decode(errors="replace").splitlines()[1:]
        why = f"it holds: {', '.join(inside[:5]) or 'nothing'}{', ...' if len(inside) > 5 else ''}"
    raise InputError(
        f"{path} is {words}, no recording" if words else f"{path} is in no format that is known",
        why=why,
        todo=f"known formats: {', '.join(known)}; choose one with --format, or write an importer",
    )


def _named_format(name: str) -> Format:
    """Return the format of a name, or of `package.module:function`, which is imported and so run."""
    if ":" not in name:
        known = formats()
        if name not in known:
            raise UnknownNameError("format", name, known)
        return known[name]
    module, _, function = name.partition(":")
    if not module or not function:
        raise InputError(f"'{name}' does not name an importer", todo="name it package.module:function")
    # The user's own module lies as a rule where hapticeval was started.
    if str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    with blame_importer(f"loading the format '{name}'"):
        read = getattr(import_module(module), function)
    if not callable(read):
        raise InputError(f"'{name}' is of type {type(read).__name__}", todo="name a function from a path to a Table")
    # A function marked with `importer` keeps its format's name and words.
    return next((known_format for known_format in REGISTERED.values() if known_format.read is read), None) or Format(
        name, f"the format {name}", read
    )


def importer_name(read: Any) -> str:
    """Return a function's module and name, as `--format` takes it."""
    name = getattr(read, "__qualname__", type(read).__qualname__)
    return f"{getattr(read, '__module__', type(read).__module__)}:{name}"


@contextmanager
def blame_importer(what: str, function: Any = None) -> Iterator[None]:
    """Turn whatever foreign code raises in the block into an `InputError` of `what`, with the line of `function`."""
    try:
        yield
    except (Exception, SystemExit) as error:
        # The file of the foreign code, so that the line in it can be named, and not one of ours.
        code = getattr(inspect.unwrap(function), "__code__", None) if callable(function) else None
        place = origin(error, code and code.co_filename)
        if isinstance(error, HapticevalError):
            why = "; ".join(filter(None, (error.why, place)))
            raise InputError(f"{what}: {error.what}", why=why, todo=error.todo) from error
        raise InputError(f"{what} raised {describe_error(error)}", why=place, todo="mend it there") from error


def _check(table: Any, who: str) -> None:
    """Raise `InputError` for what is not a `Table`, and for columns, units and notes of it that do not fit together."""
    if not isinstance(table, Table):
        raise InputError(
            f"{who} gave {'None' if table is None else f'a {type(table).__name__}'}",
            why="it must give a hapticeval.recordings.formats.Table",
            todo='end it with for instance: return Table({"t": times, "x": positions}, units={"t": "ms"})',
        )
    rows = {name: table.rows(name) for name in table.columns}
    sizes = Counter(rows.values())
    # A column whose number of rows no other column has cannot belong to any clock.
    odd = [name for name, size in reversed(rows.items()) if sizes[size] == 1 < len(rows)]
    strange = [name for name in (*table.units, *table.notes) if name not in rows]
    unnamed = [name for name in rows if not isinstance(name, str)]
    if unnamed or (rows and not any(sizes)):
        raise InputError(f"{who} named a column {unnamed[0]!r}" if unnamed else f"{who} gave no row")
    if odd or strange:
        what = f"{who} gave a unit or a note of the column '{strange[0]}', which is not there" if strange else ""
        raise InputError(
            what or f"{who} gave a column '{odd[0]}' of {rows[odd[0]]} rows that no other column fits",
            why=f"its columns have these rows: {rows}",
            todo="give a number in each row, nan where there is none; of signals on several clocks each its clock",
        )
    for name, unit in table.units.items():
        with blame_importer(f"{who}, unit of the column '{name}'"):
            parse_unit(str(unit))
