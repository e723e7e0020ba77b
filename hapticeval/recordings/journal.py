"""The file that a running loop is recorded to: blocks that are only ever added, each whole by itself or not data.

    file    MAGIC, block, block, ...
    block   24 bytes (`BLOCK`): b"\\xa5HEJ", kind, number of the block, rows, bytes of payload, CRC32 of all else;
            then the payload: a JSON text, or rows of sequence (int64), stamp (int64, ns) and the channels (float64)

The first two blocks both hold the header, so that no single damage takes the names of the channels. All numbers are
little-endian. What is not whole is found by its CRC and skipped; reading goes on at the next block that is.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.files import plain
from hapticeval.recordings.channels import Signal, declared

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
