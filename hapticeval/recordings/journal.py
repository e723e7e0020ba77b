"""The file that a running loop is recorded to, and the recording that is made of it.

A journal is blocks that are only ever added, each whole by itself or not data.

    file    MAGIC, block, block, ...
    block   24 bytes (`BLOCK`): b"\xa5HEJ", kind, number of the block, rows, bytes of payload, CRC32 of all else;
            then the payload: a JSON text, or rows of sequence (int64), stamp (int64, ns) and the channels (float64)

The first two blocks both hold the header, so that no single damage takes the names of the channels. All numbers are
little-endian. What is not whole is found by its CRC and skipped; reading goes on at the next block that is.
"""

from __future__ import annotations

import json
import mmap
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.files import plain
from hapticeval.recordings.channels import Signal, declared
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Clock, Event, Recording
from hapticeval.recordings.salvage import LOST, Loss, Salvaged
from hapticeval.types import BoolArray, IntArray

UNCLOSED = "the process of the loop ended without closing"
"""How a journal says that its recorder was killed."""

MAGIC = b"\x89hapticeval journal\r\n"
MARK = b"\xa5HEJ"
BLOCK = struct.Struct("<4sB3xIIII")
VERSION = 1
HEADERS = 2
"""How often the header stands at the front."""


class Kind(IntEnum):
    """What a block holds."""

    HEADER = 1
    ROWS = 2
    EVENT = 3
    END = 4


@dataclass(frozen=True)
class Layout:
    """The header: the columns of every channel (0 for one number without a direction), what each is, and the meta.

    `anchor` is a stamp and the wall clock (ns since 1970 UTC) at the same instant, `start` the stamp that is time 0
    (the first row's where None). Raises `InputError` for a channel that is neither known nor declared.
    """

    channels: Mapping[str, int]
    signals: Mapping[str, Signal] = field(default_factory=dict)
    meta: Mapping[str, Any] = field(default_factory=dict)
    anchor: tuple[int, int] | None = None
    start: int | None = None

    def __post_init__(self) -> None:
        signals = {name: declared(name, self.signals) for name in self.channels}
        for name, columns in self.channels.items():
            if not isinstance(columns, int) or not 0 <= columns <= 4096:
                raise InputError(
                    f"channel '{name}' has {columns!r} columns", todo="give how many numbers it is, 0 for a single one"
                )
            if columns == 0 and signals[name].frame in ("world", "joint"):
                raise InputError(f"channel '{name}' has no columns", todo="give it one a dimension, or one a joint")
        object.__setattr__(self, "signals", signals)

    @property
    def dtype(self) -> np.dtype[Any]:
        """A row."""
        fields: list[Any] = [("sequence", "<i8"), ("nanoseconds", "<i8")]
        fields += [(name, "<f8", (columns,)) if columns else (name, "<f8") for name, columns in self.channels.items()]
        return np.dtype(fields)

    def encoded(self) -> bytes:
        """As JSON. Raises `InputError`, naming the key, for a meta that JSON cannot hold."""
        channels = [
            {"name": name, "columns": columns, **self.signals[name]._asdict()}
            for name, columns in self.channels.items()
        ]
        header = {
            "version": VERSION,
            "channels": channels,
            "anchor": self.anchor,
            "start": self.start,
            "meta": plain(self.meta, "meta"),
        }
        try:
            return json.dumps(header, allow_nan=False).encode()
        except ValueError as error:
            raise InputError(f"the meta of a recording holds a number that is not finite: {error}") from error

    @classmethod
    def decoded(cls, payload: bytes) -> Layout:
        """What `encoded` gave. Raises `InputError` for that of a later version."""
        header = json.loads(payload)
        if header["version"] != VERSION:
            raise InputError(
                f"a journal of version {header['version']}; this hapticeval reads version {VERSION}",
                todo="update hapticeval",
            )
        channels = {each["name"]: each["columns"] for each in header["channels"]}
        signals = {each.pop("name"): Signal(each["unit"], each["meaning"], each["frame"], each["sign"])
                   for each in header["channels"]}  # fmt: skip
        anchor = None if header["anchor"] is None else (header["anchor"][0], header["anchor"][1])
        return cls(channels, signals, header["meta"], anchor, header["start"])


def block_head(kind: Kind, number: int, rows: int, payload: Any) -> bytes:
    """The 24 bytes that go before a payload."""
    head = BLOCK.pack(MARK, kind, number & 0xFFFFFFFF, rows, len(payload), 0)[:-4]
    return head + struct.pack("<I", zlib.crc32(payload, zlib.crc32(head)))


def opening(layout: Layout) -> bytes:
    """What a journal begins with."""
    header = layout.encoded()
    return MAGIC + b"".join(block_head(Kind.HEADER, number, 0, header) + header for number in range(HEADERS))


class Block(NamedTuple):
    """A whole block: where it begins in the file, what it holds, its number, and its payload."""

    at: int
    kind: int
    number: int
    rows: int
    payload: memoryview

    @property
    def end(self) -> int:
        """Where the next one begins."""
        return self.at + BLOCK.size + len(self.payload)


class Hole(NamedTuple):
    """Bytes between whole blocks, from `at` to `end`; `rows` is what a block that breaks off there says it had."""

    at: int
    end: int
    rows: int | None


def blocks(data: Any) -> Iterator[Block | Hole]:
    """The whole blocks of a journal, and what lies between them."""
    view = memoryview(data)
    at = len(MAGIC) if view[: len(MAGIC)] == MAGIC else 0
    while at < len(view):
        block = _whole(view, at)
        if block is None:
            begin, found = at, None
            while found is None and (at := data.find(MARK, at + 1)) >= 0:
                found = _whole(view, at)
            if found is None:
                yield Hole(begin, len(view), _said(view, begin))
                return
            yield Hole(begin, found.at, _said(view, begin))
            block = found
        yield block
        at = block.end


def _whole(view: memoryview, at: int) -> Block | None:
    if at + BLOCK.size > len(view):
        return None
    mark, kind, number, rows, length, crc = BLOCK.unpack_from(view, at)
    begin = at + BLOCK.size
    if mark != MARK or begin + length > len(view):
        return None
    payload = view[begin : begin + length]
    if zlib.crc32(payload, zlib.crc32(view[at : begin - 4])) != crc:
        return None
    return Block(at, kind, number, rows, payload)


def _said(view: memoryview, at: int) -> int | None:
    """Rows that the head of a broken block gives, where it can be read and they fit its length."""
    if at + BLOCK.size > len(view):
        return None
    mark, kind, _, rows, length, _ = BLOCK.unpack_from(view, at)
    return rows if mark == MARK and kind == Kind.ROWS and rows and length % rows == 0 else None


def finish(journal: Path, path: Path) -> Salvaged:
    """Write what `recover` gives as an HDF5 recording, and leave the journal as it is.

    Raises `InputError` where `path` is there already, and what `recover` and `write_recording` raise.
    """
    salvaged = recover(journal)
    write_recording(path, salvaged.recording)
    return salvaged


def recover(path: Path) -> Salvaged:
    """What is whole of a journal, however it ended, and what is lost, which its events say as well (kind `lost`).

    Rows with a number that is not finite, or a stamp that does not increase, are kept and not valid. Raises
    `InputError` for a file that is no journal, one whose header is lost, and one without a whole row.
    """
    path = Path(path)
    try:
        with path.open("rb") as opened:
            return _recovered(path, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ))
    except ValueError as error:  # what mmap says of an empty file
        if path.stat().st_size:
            raise
        raise InputError(f"{path} is empty", todo="give a journal that a recorder wrote") from error
    except OSError as error:
        raise InputError(f"cannot read the journal {path}", why=error.strerror or str(error)) from error


@dataclass
class _Read:
    """What was found, block by block; `holes` each with the number of whole row blocks before it."""

    layout: Layout | None = None
    rows: list[Any] = field(default_factory=list)
    row_blocks: list[Block] = field(default_factory=list)
    events: list[tuple[int, str, str]] = field(default_factory=list)
    holes: list[tuple[Hole, int]] = field(default_factory=list)
    end: dict[str, Any] | None = None


def _recovered(path: Path, data: mmap.mmap) -> Salvaged:
    read = _Read()
    number = 0
    for block in blocks(data):
        if isinstance(block, Hole):
            read.holes.append((block, len(read.row_blocks)))
            continue
        if block.number > number and not (read.holes and read.holes[-1][0].end == block.at):
            read.holes.append((Hole(block.at, block.at, None), len(read.row_blocks)))
        number = block.number + 1
        _take(read, block)
    if read.layout is None:
        known = data[: len(MAGIC)] == MAGIC
        raise InputError(
            f"{path} is a journal whose header is lost" if known else f"{path} is not a journal",
            why="without it nobody knows what the numbers are" if known else "a recorder's journal begins otherwise",
            todo="copy it again" if known else "give a file that a recorder wrote",
        )
    if not read.row_blocks:
        raise InputError(
            f"no row of the journal {path} is whole",
            why=""
            if read.holes
            else "its header is whole, and no rows follow: its recorder has just begun, or "
            "was stopped before it had any",
            todo="copy it again" if read.holes else "look again when the recorder has run for a second",
        )
    rows = np.concatenate([np.frombuffer(block.payload, dtype=read.layout.dtype) for block in read.row_blocks])
    ends = np.cumsum([block.rows for block in read.row_blocks])
    return _made(read, read.layout, rows, _journal_losses(read, rows, ends, len(data)))


def _take(read: _Read, block: Block) -> None:
    if block.kind == Kind.HEADER:
        read.layout = read.layout or Layout.decoded(bytes(block.payload))
    elif block.kind == Kind.ROWS:
        read.row_blocks.append(block)
    elif block.kind == Kind.EVENT:
        stamp, kind, text = json.loads(bytes(block.payload))
        read.events.append((stamp, kind, text))
    elif block.kind == Kind.END:
        read.end = json.loads(bytes(block.payload))


def _journal_losses(read: _Read, rows: Any, ends: IntArray, size: int) -> list[Loss]:
    """What each hole took, read off the sequence numbers and stamps on its sides."""
    sequence, stamps = rows["sequence"], rows["nanoseconds"]
    step = float(np.median(np.diff(stamps))) / 1e9 if len(rows) > 1 else 0.0
    losses = []
    for hole, before in read.holes:
        where = f"bytes {hole.at} to {hole.end - 1}" if hole.end > hole.at else f"before byte {hole.at}"
        last = int(ends[before - 1]) - 1 if before else -1
        if hole.end == size and before == len(ends):
            losses.append(_tail(hole, where, int(sequence[-1]) + 1))
            continue
        if last + 1 == len(rows):
            count = None if read.end is None else int(read.end["next"] - read.end["unwritten"] - sequence[-1]) - 1
        else:
            count = int(sequence[last + 1]) - (int(sequence[last]) + 1 if before else 0)
        if count:
            losses.append(Loss("damaged", f"{where}, after row {last}", count, count * step))
        elif hole.at >= len(MAGIC):
            losses.append(Loss("damaged", f"{where}, no row among them", None, None))
    if read.end is not None and read.end["unwritten"]:
        count = int(read.end["unwritten"])
        losses.append(Loss("the end", "rows that the recorder could not write", count, count * step))
    if read.end is None and not (losses and losses[-1].rows is None):
        where = f"the journal was not closed: what came from cycle {sequence[-1] + 1} on is unknown"
        losses.append(Loss("the end", where, None, None))
    return losses


def _tail(hole: Hole, where: str, following: int) -> Loss:
    block = f"a block of {hole.rows} rows" if hole.rows else "a block"
    told = f"{where}: it breaks off inside {block}; what came from cycle {following} on is unknown"
    return Loss("the end", told, None, None)


def _made(read: _Read, layout: Layout, rows: Any, losses: Sequence[Loss]) -> Salvaged:
    stamps = np.ascontiguousarray(rows["nanoseconds"])
    clock = Clock(stamps, layout.start, layout.anchor, np.ascontiguousarray(rows["sequence"]))
    channels = {name: np.ascontiguousarray(rows[name]) for name in layout.channels}
    valid = _increasing(stamps)
    for values in channels.values():
        finite = np.isfinite(values)
        valid &= finite if finite.ndim == 1 else finite.all(axis=1)
    events = [Event((stamp - clock.zero) / 1e9, kind, text) for stamp, kind, text in read.events]
    last = float(clock.seconds[-1])
    if read.end is not None and read.end["how"] != "closed":
        unknown = f": what came after cycle {int(rows['sequence'][-1])} is unknown"
        events.append(Event(last, "ended", read.end["how"] + unknown * (read.end["how"] == UNCLOSED)))
    if not valid.all():
        events.append(Event(last, "not-valid", f"{np.count_nonzero(~valid)} rows are not finite or out of order"))
    events += [Event(last, LOST, str(loss)) for loss in losses]
    recording = Recording.clocked(clock, channels, layout.meta, valid=valid, signals=layout.signals, events=events)
    return Salvaged(recording, tuple(losses))


def _increasing(stamps: IntArray) -> BoolArray:
    """The rows whose stamp lies after all before it."""
    out = np.ones(stamps.size, dtype=bool)
    out[1:] = stamps[1:] > np.maximum.accumulate(stamps)[:-1]
    return out
