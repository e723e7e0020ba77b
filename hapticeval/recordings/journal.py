"""The file that a running loop is recorded to, and the recording that is made of it.

A journal is a sequence of blocks that are only ever added, each whole by itself or not data.

    file    MAGIC, block, block, ...
    block   24 bytes (`BLOCK_HEAD`): b"\xa5HEJ", kind, number of the block, rows, bytes of payload, CRC32 of all else;
            then the payload: a JSON text, or rows of sequence (int64), stamp (int64, ns) and the channels (float64)

The first two blocks both hold the header, so that no single damage takes the names of the channels. All numbers are
little-endian. A block that is not whole is found by its CRC and skipped; reading goes on at the next one that is.
"""

from __future__ import annotations

import json
import mmap
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.channels import Signal, declared
from hapticeval.recordings.hdf5 import LOST_EVENT, count_lost, metadata_json
from hapticeval.recordings.memory import first_bytes
from hapticeval.recordings.recording import Clock, Event, Recording

UNCLOSED = "the process of the loop ended without closing"
"""The end that a journal states where its recorder was killed."""

MAGIC = b"\x89hapticeval journal\r\n"
BLOCK_MARK = b"\xa5HEJ"
BLOCK_HEAD = struct.Struct("<4sB3xIIII")
JOURNAL_VERSION = 1
HEADER_COPIES = 2
"""How often the header stands at the front."""


class Kind(IntEnum):
    """What a block holds."""

    HEADER = 1
    ROWS = 2
    EVENT = 3
    END = 4


@dataclass(frozen=True)
class Layout:
    """The header: the columns of every channel (0 for one number without a direction), its signal, and the meta.

    `anchor` is a stamp and the wall clock (ns since 1970 UTC) at the same instant. Raises `InputError` for a channel
    that is neither known nor declared, and for a number of columns that it cannot have.
    """

    channels: Mapping[str, int]
    signals: Mapping[str, Signal] = field(default_factory=dict)
    meta: Mapping[str, Any] = field(default_factory=dict)
    anchor: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        signals = {name: declared(name, self.signals) for name in self.channels}
        for name, columns in self.channels.items():
            if not isinstance(columns, int) or not 0 <= columns <= 4096:
                raise InputError(
                    f"channel '{name}' has {columns!r} columns", todo="give how many numbers it is, 0 for a single one"
                )
            if columns == 0 and signals[name].frame in ("world", "joint"):
                raise InputError(f"channel '{name}' has no columns", todo="give it one per dimension, or one per joint")
        object.__setattr__(self, "signals", signals)

    @property
    def dtype(self) -> np.dtype[Any]:
        """The NumPy type of a row: cycle number, stamp (ns), and the numbers of each channel."""
        # Little-endian and without padding: 8 bytes a number, on any machine.
        fields: list[Any] = [("sequence", "<i8"), ("nanoseconds", "<i8")]
        fields += [(name, "<f8", (columns,)) if columns else (name, "<f8") for name, columns in self.channels.items()]
        return np.dtype(fields)

    def encoded(self) -> bytes:
        """Return the layout as JSON. Raises `InputError`, naming the key, for a meta that JSON cannot hold."""
        channels = [
            {"name": name, "columns": columns, **self.signals[name]._asdict()}
            for name, columns in self.channels.items()
        ]
        header = {"version": JOURNAL_VERSION, "channels": channels, "anchor": self.anchor}
        return json.dumps({**header, "meta": json.loads(metadata_json(self.meta))}).encode()

    @classmethod
    def decoded(cls, payload: bytes) -> Layout:
        """Return the layout that `encoded` gave. Raises `InputError` for that of a later version."""
        header = json.loads(payload)
        if header["version"] != JOURNAL_VERSION:
            raise InputError(
                f"a journal of version {header['version']}; this hapticeval reads version {JOURNAL_VERSION}",
                todo="update hapticeval",
            )
        channels = {channel.pop("name"): channel for channel in header["channels"]}
        columns = {name: channel.pop("columns") for name, channel in channels.items()}
        signals = {name: Signal(**channel) for name, channel in channels.items()}
        return cls(columns, signals, header["meta"], header["anchor"] and tuple(header["anchor"]))


def block_head(kind: Kind, number: int, rows: int, payload: Any) -> bytes:
    """Return the 24 bytes that go before a payload."""
    # Without its last four bytes, the CRC, which is over the head before it and the payload.
    head = BLOCK_HEAD.pack(BLOCK_MARK, kind, number & 0xFFFFFFFF, rows, len(payload), 0)[:-4]
    return head + struct.pack("<I", zlib.crc32(payload, zlib.crc32(head)))


def opening(layout: Layout) -> bytes:
    """Return the bytes that a journal begins with."""
    header = layout.encoded()
    return MAGIC + b"".join(block_head(Kind.HEADER, number, 0, header) + header for number in range(HEADER_COPIES))


class Block(NamedTuple):
    """A whole block: its first byte in the file and the one after its last, its kind, number and payload."""

    at: int
    end: int
    kind: int
    number: int
    payload: memoryview


def blocks(data: mmap.mmap) -> Iterator[Block]:
    """Yield the whole blocks of a journal, those whose checksum (CRC32) is right, and skip what lies between them."""
    view, at = memoryview(data), data.find(BLOCK_MARK)
    while at >= 0:
        # Where this mark heads no whole block, the search goes on one byte later: it may have been a number.
        search_from, begin = at + 1, at + BLOCK_HEAD.size
        if begin <= len(view):
            _, kind, number, _, length, crc = BLOCK_HEAD.unpack_from(view, at)
            payload = view[begin : begin + length]
            # The slice is shorter than stated where the file ends within the block.
            if len(payload) == length and zlib.crc32(payload, zlib.crc32(view[at : begin - 4])) == crc:
                search_from = begin + length
                yield Block(at, search_from, kind, number, payload)
        at = data.find(BLOCK_MARK, search_from)


def recover(path: Path) -> Recording:
    """Return what is whole of a journal, however it ended; its events of kind `lost` report what is missing.

    Rows with a number that is not finite, or a stamp that does not increase, are kept and not valid. Raises
    `InputError` for a file that is not a journal, one whose header is lost, and one without a whole row.
    """
    path = Path(path)
    known = first_bytes(path).startswith(MAGIC)
    with path.open("rb") as opened:
        read = _Read(mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ))
    if read.layout is None:
        raise InputError(
            f"{path} is a journal whose header is lost" if known else f"{path} is not a journal",
            why="nothing else gives the meaning of its numbers" if known else "a recorder's journal begins otherwise",
            todo="copy it again" if known else "give a file that a recorder wrote",
        )
    if not read.rows:
        damaged = bool(read.holes or read.tail)
        raise InputError(
            f"no row of the journal {path} is whole",
            why="" if damaged else "its recorder has just begun, or was stopped before it had any",
            todo="copy it again" if damaged else "look again when the recorder has run for a second",
        )
    return read.recording(read.layout)


class _Read:
    """The whole blocks of a journal by their kind, and the bytes between them.

    A hole is its first byte, the one after its last, and the number of row blocks before it; `tail` the bytes after the
    last whole block.
    """

    def __init__(self, data: mmap.mmap) -> None:
        self.layout: Layout | None = None
        self.rows: list[memoryview] = []
        self.events: list[tuple[int, str, str]] = []
        self.end: dict[str, Any] | None = None
        self.holes: list[tuple[int, int, int]] = []
        place, number = len(MAGIC), 0
        for block in blocks(data):
            # Bytes between whole blocks, or a number that was left out: a block is missing here.
            if block.at > place or block.number > number:
                self.holes.append((place, block.at, len(self.rows)))
            place, number = block.end, block.number + 1
            if block.kind == Kind.HEADER:
                # Both headers say the same; either will do.
                self.layout = self.layout or Layout.decoded(bytes(block.payload))
            elif block.kind == Kind.ROWS:
                self.rows.append(block.payload)
            elif block.kind == Kind.EVENT:
                self.events.append(tuple(json.loads(bytes(block.payload))))
            elif block.kind == Kind.END:
                self.end = json.loads(bytes(block.payload))
        self.tail = (place, len(data)) if place < len(data) else None

    def recording(self, layout: Layout) -> Recording:
        """Return the recording of the rows, with what is lost among its events."""
        parts = [np.frombuffer(payload, dtype=layout.dtype) for payload in self.rows]
        rows = np.concatenate(parts)
        # The counts of rows before each block, which place a hole among the rows.
        losses = self._losses(rows, np.cumsum([0, *map(len, parts)]))
        stamps = np.ascontiguousarray(rows["nanoseconds"])
        clock = Clock(stamps, None, layout.anchor, np.ascontiguousarray(rows["sequence"]))
        channels = {name: np.ascontiguousarray(rows[name]) for name in layout.channels}
        valid = np.ones(stamps.size, dtype=bool)
        # A stamp counts only where it is later than all before it.
        valid[1:] = stamps[1:] > np.maximum.accumulate(stamps)[:-1]
        for values in channels.values():
            valid &= np.isfinite(values).reshape(stamps.size, -1).all(axis=1)
        last, cycle = float(clock.seconds[-1]), int(rows["sequence"][-1])
        events = [Event((stamp - clock.zero) / 1e9, kind, text) for stamp, kind, text in self.events]
        if self.end is not None and self.end["how"] != "closed":
            unknown = f": what came after cycle {cycle} is unknown" if self.end["how"] == UNCLOSED else ""
            events.append(Event(last, "ended", self.end["how"] + unknown))
        if not valid.all():
            events.append(Event(last, "not-valid", f"{np.count_nonzero(~valid)} rows are not finite or out of order"))
        events += [Event(last, LOST_EVENT, loss) for loss in losses]
        return Recording.clocked(clock, channels, layout.meta, valid=valid, signals=layout.signals, events=events)

    def _losses(self, rows: Any, ends: Any) -> list[str]:
        """Return what each hole took, by the sequence numbers on its sides; `ends` are the rows before each block."""
        sequence = rows["sequence"]
        # s: what a lost row would have taken.
        step = float(np.median(np.diff(rows["nanoseconds"]))) / 1e9 if len(rows) > 1 else 0.0
        unwritten = 0 if self.end is None else int(self.end["unwritten"])
        losses = []
        # A hole: its bytes [begin, end), and how many row blocks stand before it.
        for begin, end, before in self.holes:
            where = f"bytes {begin} to {end - 1}" if end > begin else f"before byte {begin}"
            next_row = int(ends[before])
            # The cycle numbers on both sides say how many rows a hole took; at the end, the journal's own count.
            known = 0 if next_row == 0 else int(sequence[next_row - 1]) + 1
            if next_row < len(rows):
                count = int(sequence[next_row]) - known
            else:
                count = 0 if self.end is None else int(self.end["next"]) - unwritten - known
            if count:
                losses.append(f"damaged, {where}, after row {next_row - 1}: {count_lost(count, step)}")
            else:
                losses.append(f"damaged, {where}, no row among them")
        if unwritten:
            losses.append(f"the end, rows that the recorder could not write: {count_lost(unwritten, step)}")
        if self.tail is not None or self.end is None:
            how = "the journal was not closed"
            if self.tail is not None:
                how = f"bytes {self.tail[0]} to {self.tail[1] - 1}: it breaks off inside a block"
            unknown = f"what came from cycle {int(sequence[-1]) + 1} on is unknown"
            losses.append(f"the end, {how}; {unknown}")
        return losses
