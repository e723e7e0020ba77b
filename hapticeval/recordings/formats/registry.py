"""Which formats there are, and which of them a file is of: by its first bytes, then by its name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from types import MappingProxyType

from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.recordings.formats import foreign
from hapticeval.recordings.formats.magic import is_text, kind
from hapticeval.recordings.formats.table import Table
from hapticeval.recordings.memory import reserve

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
        with foreign.telling(f"what recognises the format '{self.name}'", self.recognises):
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
        with foreign.telling(f"the format '{entry.name}' of an installed package ({entry.value})", None):
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
    something else, and then names what it is; and as `foreign.load` and `foreign.run` do for a foreign importer.
    """
    path = Path(path)
    chosen = _detect(path) if format is None else _named(format)
    reserve(_size(path), str(path))
    try:
        table = chosen.read(path) if chosen.ours else foreign.run(chosen.read, path)
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
    read = foreign.load(name)
    registered = next((each for each in _KNOWN.values() if each.read is read), None)
    return registered or Format(name, f"the format {name}", read)
