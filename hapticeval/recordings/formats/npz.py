"""NumPy's .npz: every numeric array is a column, or several. Pickled objects are never opened: they can run code."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.shortfall import shortfall
from hapticeval.recordings.formats.table import Table, lost_columns, spread
from hapticeval.recordings.formats.zip_entries import End, Entry, entries

DAMAGE = (ValueError, RuntimeError, zipfile.BadZipFile, zlib.error, EOFError, TokenError)
"""NumPy speaks of one and the same damage in all of these, by where it strikes."""


def _recognises(head: bytes) -> bool:
    return head.startswith(b"PK\x03\x04") and b".npy" in head[:300]


@importer("npz", about="NumPy arrays (.npz)", suffixes=(".npz",), recognises=_recognises)
def read_npz(path: Path) -> Table:
    """Columns by the arrays' names; single numbers and texts as attributes.

    The index of an .npz stands at its end. One that is cut short gives the arrays that are whole by their checksums,
    and the rows before the cut of the one that it ends within, whose checksum is not whole: they are as good as those
    of a text that is cut.
    """
    found = _Found()
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            if min((entry.header_offset for entry in file.zip.infolist()), default=0):
                raise zipfile.BadZipFile("its index is that of another archive inside of it")
            for name in file.files:
                try:
                    found.add(name, file[name])
                except DAMAGE as error:
                    found.warnings.append(f"the array '{name}' is left out: {error}")
                    found.open_ended = True
    except DAMAGE:
        found = _Found()
        _salvage(path.read_bytes(), found)
        if not found.columns:
            raise InputError(
                f"{path} is cut short or damaged",
                why="; ".join(found.warnings),
                todo="copy it again from where it was recorded",
            ) from None
    return found.table()


class _Found:
    """What was found in a file, array by array."""

    def __init__(self) -> None:
        self.columns: dict[str, Any] = {}
        self.attributes: dict[str, Any] = {}
        self.promised: dict[str, int] = {}
        self.warnings: list[str] = []
        self.remarks: list[str] = []
        self.open_ended = False

    def add(self, name: str, array: Any) -> None:
        if not isinstance(array, np.ndarray):
            self.remarks.append(f"'{name}' is no array, and is left out")
            return
        for part, values in _parts(name, array).items():
            if values.dtype.kind in "US" and values.size == 1:
                self.attributes[part] = str(values.ravel()[0])
            elif values.dtype.kind not in "fiub":
                self.remarks.append(f"the array '{part}' is of type {values.dtype}, which is left out")
            elif values.size == 1:
                self.attributes[part] = values.ravel()[0].item()
            elif values.size:
                self.columns |= spread(part, values)

    def lose(self, name: str, entry: Entry) -> None:
        """Note an array that breaks off, with its first rows, and how many it lacks, where it still says its shape."""
        header = _header(entry.begun)
        if header is None:
            self.warnings.append(f"the array '{name or '?'}' is left out: {entry.why}")
            self.open_ended = True
            return
        rows = self._first_rows(name, entry.begun, header)
        told = f"{rows} whole rows are given, which no checksum covers any more" if rows else "it is left out"
        self.warnings.append(f"the array '{name}' breaks off, {entry.why}: {told}")
        for part, values in _parts(name, np.broadcast_to(np.zeros((), header.dtype), header.shape)).items():
            if values.dtype.kind in "fiub" and values.size > 1:
                self.promised |= lost_columns(part, values.shape, values.dtype)

    def _first_rows(self, name: str, begun: bytes, header: _Header) -> int:
        """Take the rows of an array that came before the cut; how many. An array stored by columns has none."""
        size = int(np.prod(header.shape[1:], dtype=np.int64)) * header.dtype.itemsize
        columnwise = header.by_columns and len(header.shape) > 1
        if not header.shape or size == 0 or header.dtype.hasobject or columnwise:
            return 0
        rows = int(min((len(begun) - header.size) // size, header.shape[0]))
        if rows < 1:
            return 0
        data = begun[header.size : header.size + rows * size]
        array = np.frombuffer(data, dtype=header.dtype).reshape(rows, *header.shape[1:])
        for part, values in _parts(name, array).items():
            if values.dtype.kind in "fiub":
                self.columns |= spread(part, values)
        return rows

    def table(self) -> Table:
        return Table(
            self.columns,
            units=_units(self.attributes),
            attributes=self.attributes,
            warnings=tuple(self.warnings),
            remarks=tuple(self.remarks),
            promised=self.promised,
            open_ended=self.open_ended,
        )


def _salvage(data: bytes, found: _Found) -> None:
    """The arrays that are whole of an archive whose index is lost, and in warnings what is not."""
    told = ""
    for entry in entries(data):
        if isinstance(entry, End):
            found.open_ended |= not entry.complete
            if entry.complete:
                told = f"the file ends at byte {len(data)}, within its index: what it lacks is named here"
            else:
                told = (
                    f"the file ends at byte {len(data)}, without its index: what followed byte {entry.at} is not known"
                )
            continue
        name = entry.name.removesuffix(".npy")
        try:
            if entry.data is None:
                found.lose(name, entry)
            else:
                found.add(name, np.load(io.BytesIO(entry.data), allow_pickle=False))
        except DAMAGE as error:
            found.warnings.append(f"the array '{name}' is left out: {error}")
    missing = shortfall(found.columns, found.promised, _units(found.attributes))
    found.warnings.insert(0, "; ".join(filter(None, (told, missing))))


class _Header(NamedTuple):
    """What an array says before its numbers: shape, order and type, and the bytes that this takes."""

    shape: tuple[int, ...]
    by_columns: bool
    dtype: Any
    size: int


def _header(begun: bytes) -> _Header | None:
    """The header of an array of which there is the start; None where there is not so much of it."""
    stream = io.BytesIO(begun)
    try:
        version = np.lib.format.read_magic(stream)
        read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
        shape, by_columns, dtype = read(stream)
    except (ValueError, KeyError):
        return None
    return _Header(shape, by_columns, dtype, stream.tell())


def _parts(name: str, array: Any) -> dict[str, Any]:
    return {name: array} if not array.dtype.names else {f"{name}.{part}": array[part] for part in array.dtype.names}


def _units(attributes: dict[str, Any]) -> dict[str, str]:
    """Units as `hapticeval convert` writes them beside the arrays: `unit:force[0]`, a text."""
    return {name.removeprefix("unit:"): str(text) for name, text in attributes.items() if name.startswith("unit:")}
