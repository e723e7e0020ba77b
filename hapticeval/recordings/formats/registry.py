"""Which formats there are, which of them a file is of, and importers of other people, run and checked."""

from __future__ import annotations

import inspect
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path, PurePath
from types import MappingProxyType
from typing import Any

from hapticeval.errors import HapticevalError, InputError, UnknownNameError, described
from hapticeval.recordings.formats.table import Table
from hapticeval.recordings.importing.units import parse_unit
from hapticeval.recordings.memory import reserve

SIGNATURES: tuple[tuple[bytes, str], ...] = (
    (b"\x89PNG\r\n\x1a\n", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"%PDF-", "a PDF document"),
    (b"PK\x03\x04", "a ZIP archive (an .npz, .xlsx or .zip)"),
    (b"PK\x05\x06", "an empty ZIP archive"),
    (b"\x1f\x8b", "a gzip archive: unpack it first"),
    (b"BZh", "a bzip2 archive: unpack it first"),
    (b"\xfd7zXZ\x00", "an xz archive: unpack it first"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive: unpack it first"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive: unpack it first"),
    (b"PAR1", "a Parquet file"),
    (b"ARROW1", "an Arrow file"),
    (b"\x93NUMPY", "a single NumPy array (.npy): save with numpy.savez and names"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
    (b"MATLAB 7.3 MAT-file", "a MATLAB 7.3 file"),
    (b"MATLAB 5.0 MAT-file", "a MATLAB 5 file"),
    (b"\x89MCAP0\r\n", "an MCAP file: give the folder of the ROS 2 bag, with its metadata.yaml"),
    (b"SQLite format 3\x00", "an SQLite database: give the folder of the ROS 2 bag, with its metadata.yaml"),
    (b"#ROSBAG V", "a ROS 1 bag"),
    (b"RIFF", "a RIFF file (sound or film)"),
    (b"\x7fELF", "a program"),
    (b"MZ", "a Windows program"),
    (b"\x80\x04", "a Python pickle, which is never opened: it can run code"),
    (b"\x80\x05", "a Python pickle, which is never opened: it can run code"),
    (b"\xd0\xcf\x11\xe0", "an old Office document"),
    (b"{\\rtf", "an RTF document"),
)

TEXT_BOMS = (b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")


def is_text(head: bytes) -> bool:
    """Whether the first bytes of a file look like text."""
    if head.startswith(TEXT_BOMS):
        return True
    control = sum(byte < 32 and byte not in (9, 10, 12, 13) for byte in head)
    return bool(head) and control == 0 and kind(head) is None


def kind(head: bytes) -> str | None:
    """What the first bytes say that a file is, in words; None where they say nothing."""
    for signature, words in SIGNATURES:
        if head.startswith(signature):
            return words
    start = head.lstrip()[:200].lower()
    if start.startswith((b"<!doctype html", b"<html")):
        return "a web page"
    if start.startswith(b"<?xml"):
        return "an XML file"
    if start[:1] in (b"{", b"[") and b'"' in start:
        return "a JSON file"
    return None


def load_importer(name: str) -> Callable[[Path], Table]:
    """The function that `package.module:function` names; the current directory is looked in too.

    Raises `InputError` where it cannot be imported, for whatever reason, and where it cannot be called.
    """
    module, _, function = name.partition(":")
    if not module or not function:
        raise InputError(f"'{name}' does not name an importer", todo="name it package.module:function")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        read = getattr(import_module(module), function)
    except (Exception, SystemExit) as error:
        place = _place(error)
        raise InputError(
            f"cannot load the format '{name}'",
            why=described(error) + (f" ({place})" if place else ""),
            todo=f"see that `python -c 'from {module} import {function}'` works",
        ) from error
    if not callable(read):
        raise InputError(
            f"cannot load the format '{name}'",
            why=f"it is of type {type(read).__name__}",
            todo="name a function that takes a path and gives a Table",
        )
    return read  # type: ignore[no-any-return]


def run_importer(read: Callable[[Path], Table], path: Path) -> Table:
    """What an importer gives of a file, whole and sound.

    Raises `InputError`, naming the importer and the line in its own file, for whatever it raises; and for what is no
    `Table`, a column that no other fits, and units and notes of columns that are not there or are no units.
    """
    name = called(read)
    with telling(f"the importer {name}", read):
        try:
            table = read(path)
        except OSError as error:
            if str(error.filename) != str(path):
                raise
            raise InputError(f"cannot read {path}", why=error.strerror or str(error), todo="check the path") from error
    if not isinstance(table, Table):
        given = "None" if table is None else f"a {type(table).__name__}"
        raise InputError(
            f"the importer {name} gave {given}",
            why="it must give a hapticeval.recordings.formats.Table",
            todo='end it with for instance: return Table({"t": times, "x": positions}, units={"t": "ms"})',
        )
    _check(table, name)
    return table


def called(read: Any) -> str:
    """A function by its module and name, as `--format` takes it."""
    name = getattr(read, "__qualname__", type(read).__qualname__)
    return f"{getattr(read, '__module__', type(read).__module__)}:{name}"


@contextmanager
def telling(what: str, function: Any) -> Iterator[None]:
    """Have all that is raised in the block become an `InputError` that says so of `what`, and where in `function`."""
    try:
        yield
    except HapticevalError as error:
        why = "; ".join(filter(None, (error.why, _place(error, function))))
        raise InputError(f"{what}: {error.what}", why=why, todo=error.todo) from error
    except (Exception, SystemExit) as error:
        raise InputError(
            f"{what} raised {described(error)}", why=_place(error, function), todo="mend it there"
        ) from error


def _place(error: BaseException, function: Any = None) -> str:
    """Where an error came from: the innermost line in the file of `function`, else the innermost of all."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename != __file__ and "importlib" not in frame.filename
    ]
    code = getattr(inspect.unwrap(function), "__code__", None) if callable(function) else None
    own = [frame for frame in frames if code is not None and frame.filename == code.co_filename]
    if not frames:
        return ""
    last = (own or frames)[-1]
    return f"in {PurePath(last.filename).name}, line {last.lineno}, in {last.name}: {last.line}"


def _check(table: Table, name: str) -> None:
    """Raise `InputError` for what is no name, no unit or no row, and for columns that fit no other."""
    for column in table.columns:
        if not isinstance(column, str):
            raise InputError(f"the importer {name} named a column {column!r}", why="a name is a text")
    if table.columns and not any(map(table.rows, table.columns)):
        raise InputError(f"the importer {name} gave no row", why="a recording has at least one")
    _check_lengths(table, name)
    for kind, told in (("a unit", table.units), ("a note", table.notes)):
        for column in told:
            if column not in table.columns:
                raise InputError(
                    f"the importer {name} gave {kind} of the column '{column}', which is not there",
                    why=f"its columns are: {', '.join(table.columns)}",
                    todo="see the name",
                )
    for column, unit in table.units.items():
        try:
            parse_unit(unit if isinstance(unit, str) else str(unit))
        except InputError as error:
            raise InputError(
                f"the importer {name} gave the column '{column}' an {error.what}"
                if error.what.startswith("unknown")
                else f"the importer {name}: of the column '{column}' {error.what}",
                why=error.why,
                todo='write it in SI units and their parts, as in mm, deg/s, N m or "25.4 mm"; '
                "or leave it out, and the mapping says what it is",
            ) from error


def _check_lengths(table: Table, name: str) -> None:
    """Every column must have another of its length: a signal its clock, and a clock its signal."""
    rows = {column: table.rows(column) for column in table.columns}
    counts = Counter(rows.values())
    most = max(counts, key=lambda size: counts[size], default=0)
    alone = [column for column, size in rows.items() if counts[size] == 1]
    if len(rows) > 1 and alone:
        column = next((each for each in alone if rows[each] != most), alone[-1])
        others = sorted(size for size in counts if size != rows[column])
        raise InputError(
            f"the importer {name} gave a column '{column}' of {rows[column]} rows that no other column fits",
            why=f"the others have {', '.join(map(str, others))} rows, and nothing tells which of them are its",
            todo="give a number in each row, nan where there is none; of signals on several clocks give each its clock",
        )


PACKAGE = "hapticeval.recordings.formats"
GROUP = "hapticeval.formats"
"""Entry points of this group are functions, told to `importer`, of other packages."""

MODULES = ("matlab", "arrays", "rosbag", "text")
"""The modules of this package that hold formats."""

OWN = ("matlab5", "matlab73", "hdf5", "npz", "rosbag", "svc", "devicelog", "hdurecord", "csv")
"""The formats of this package, the most particular first: delimited text fits much."""

HEAD = 1 << 16
"""Bytes by which a format is recognised: a header of a thousand columns is shorter."""

FOLDER = b"folder\n"

Read = Callable[[Path], Table]
Recognise = Callable[[bytes], bool]


@dataclass(frozen=True)
class Format:
    """A file format: how it is called, what it is, how it is told and how it is read."""

    name: str
    about: str
    read: Read
    suffixes: tuple[str, ...] = ()
    recognises: Recognise | None = None

    def fits(self, path: Path, head: bytes) -> bool:
        """Whether a file is of this format, by its first bytes where the format knows them, else by its name."""
        if self.recognises is None:
            return path.suffix.lower() in self.suffixes
        if self.ours:
            return self.recognises(head)
        with telling(f"what recognises the format '{self.name}'", self.recognises):
            return bool(self.recognises(head))

    @property
    def ours(self) -> bool:
        """Whether it is one of this package's."""
        return getattr(self.read, "__module__", "").startswith(f"{PACKAGE}.")


_KNOWN: dict[str, Format] = {}


def importer(
    name: str, *, about: str, suffixes: Iterable[str] = (), recognises: Recognise | None = None
) -> Callable[[Read], Read]:
    """Make a function `read(path) -> Table` known as the format `name`.

    `recognises(first bytes)`, or where it is absent `suffixes` (".acme"), say which files are of it; with neither the
    format is chosen by its name only. Raises `InputError` for a name that another function has.
    """

    def register(read: Read) -> Read:
        known = _KNOWN.get(name)
        if known is not None and (known.read.__module__, known.read.__qualname__) != (
            read.__module__,
            read.__qualname__,
        ):
            raise InputError(
                f"the format '{name}' is there already",
                why=f"{known.read.__module__} registered it",
                todo="choose another name",
            )
        _KNOWN[name] = Format(name, about, read, tuple(suffix.lower() for suffix in suffixes), recognises)
        return read

    return register


def formats() -> Mapping[str, Format]:
    """Every format by name, in the order in which a file is offered to them: other people's before ours."""
    for module in MODULES:
        import_module(f"{PACKAGE}.{module}")
    for entry in entry_points(group=GROUP):
        with telling(f"the format '{entry.name}' of an installed package ({entry.value})", None):
            entry.load()
    own = [each for each in _KNOWN.values() if each.ours]
    own.sort(key=lambda each: OWN.index(each.name))
    others = [each for each in _KNOWN.values() if each not in own]
    return MappingProxyType({each.name: each for each in (*others, *own)})


def read_table(path: Path | str, *, format: str | None = None) -> Table:
    """The columns of a file, as they stand in it.

    `format` names one of `formats()`, or `package.module:function` of one that is not installed, which runs that code:
    it is for names that a user gives, never for names that a file gives. Without it the file's first bytes and its name
    decide. Raises `InputError` where the file is missing, empty, damaged, larger than `memory.limited` allows, or
    something else, and then names what it is; and as `load_importer` and `run_importer` do for a foreign importer.
    """
    path = Path(path)
    chosen = _detect(path) if format is None else _named(format)
    reserve(_size(path), str(path))
    try:
        table = chosen.read(path) if chosen.ours else run_importer(chosen.read, path)
    except HapticevalError:
        raise
    except OSError as error:
        raise InputError(f"cannot read {path}", why=error.strerror or str(error), todo="check the path") from error
    if not table.columns:
        raise InputError(
            f"{path} holds no column of numbers",
            why="; ".join(table.warnings) or f"it was read as {chosen.about}",
            todo="name another format with --format" if len(_KNOWN) > 1 else "",
        )
    return replace(table, format=format or chosen.name)


def _size(path: Path) -> int:
    files = (each for each in path.rglob("*") if each.is_file()) if path.is_dir() else (path,)
    return sum(file.stat().st_size for file in files if file.exists())


def _detect(path: Path) -> Format:
    head = first_bytes(path)
    known = formats()
    for found in known.values():
        if found.fits(path, head):
            return found
    if is_text(head) and path.suffix.lower() in known["csv"].suffixes and len(head) == HEAD:
        return known["csv"]  # a header longer than what was looked at
    if head.startswith(FOLDER):
        inside = head.decode(errors="replace").splitlines()[1:]
        words: str | None = "a folder"
        why = f"it holds: {', '.join(inside[:5]) or 'nothing'}{', ...' if len(inside) > 5 else ''}"
    else:
        words = kind(head) or ("text without a row of numbers" if is_text(head) else None)
        why = f"its name ends in '{path.suffix}', its first bytes are {head[:16]!r}"
    raise InputError(
        f"{path} is {words}, no recording" if words else f"{path} is in no format that is known",
        why=why,
        todo=f"known formats: {', '.join(known)}; choose one with --format, or write an importer",
    )


def first_bytes(path: Path) -> bytes:
    """The start of a file; of a folder `FOLDER` and the names in it, a line each.

    Raises `InputError` for a file that is missing or empty.
    """
    if path.is_dir():
        return FOLDER + "\n".join(sorted(file.name for file in path.iterdir())).encode()
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise InputError(f"cannot read {path}", why=error.strerror or str(error), todo="check the path") from error
    if not head:
        raise InputError(f"{path} is empty", why="a recording has at least one row", todo="record or copy it again")
    return head


def _named(name: str) -> Format:
    if ":" not in name:
        known = formats()
        if name not in known:
            raise UnknownNameError("format", name, known)
        return known[name]
    read = load_importer(name)
    registered = next((each for each in _KNOWN.values() if each.read is read), None)
    return registered or Format(name, f"the format {name}", read)
