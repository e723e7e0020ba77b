"""The entries of a ZIP archive as they follow each other, for one whose index, which stands at its end, is lost."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

LOCAL = struct.Struct("<4sHHHHHIIIHH")
"""Signature, version, flags, method, time, date, CRC-32, sizes (stored, real), lengths of name and rest."""

ENTRY, INDEX = b"PK\x03\x04", b"PK\x01"
ENCRYPTED, SIZE_BEHIND, UTF8 = 1, 8, 0x800
STORED, DEFLATED = 0, 8
IN_REST = 0xFFFFFFFF


@dataclass(frozen=True)
class Entry:
    """An entry and its `data`: None where they are not whole, `why`. `begun` is what there is of one that the file ends
    within: no checksum covers it, nor does one cover a text file."""

    name: str
    data: bytes | None
    begun: bytes = b""
    why: str = ""


@dataclass(frozen=True)
class End:
    """Where the entries end, and whether the index begins there: then there were no more of them."""

    at: int
    complete: bool


def entries(archive: bytes) -> Iterator[Entry | End]:
    """Each entry, and last of all the end. What a whole one holds is what its CRC-32 says."""
    at = 0
    while True:
        head = archive[at : at + LOCAL.size]
        if len(head) < LOCAL.size or not head.startswith(ENTRY):
            yield End(at, head.startswith(INDEX))
            return
        _, _, flags, method, _, _, crc, stored, real, name_size, rest_size = LOCAL.unpack(head)
        begin = at + LOCAL.size + name_size + rest_size
        name = archive[at + LOCAL.size :][:name_size].decode("utf-8" if flags & UTF8 else "cp437", errors="replace")
        if begin > len(archive):
            yield Entry(name if begin - rest_size <= len(archive) else "", None, why="it breaks off at its very start")
            yield End(len(archive), complete=False)
            return
        stored, real = _sizes(archive[begin - rest_size : begin], stored, real)
        if flags & SIZE_BEHIND or flags & ENCRYPTED or method not in (STORED, DEFLATED):
            yield Entry(name, None, why="it is of a kind whose size is not told before its data")
            yield End(begin, complete=False)
            return
        at = begin + stored
        if at > len(archive):
            begun = _begun(archive[begin:], method)
            yield Entry(name, None, begun, f"{len(archive) - begin} of its {stored} bytes are there")
            yield End(len(archive), complete=False)
            return
        data = _unpacked(archive[begin:at], method, real)
        whole = data is not None and len(data) == real and zlib.crc32(data) == crc
        yield Entry(name, data) if whole else Entry(name, None, why="its checksum is wrong")


def _sizes(rest: bytes, stored: int, real: int) -> tuple[int, int]:
    """The sizes of an entry, which for one larger than 4 GB stand in what follows its name."""
    while len(rest) >= 4:
        kind, size = struct.unpack("<HH", rest[:4])
        numbers = [number for (number,) in struct.iter_unpack("<Q", rest[4 : 4 + min(size, len(rest) - 4) // 8 * 8])]
        if kind == 1:
            real = numbers.pop(0) if real == IN_REST and numbers else real
            stored = numbers.pop(0) if stored == IN_REST and numbers else stored
        rest = rest[4 + size :]
    return stored, real


def _begun(data: bytes, method: int) -> bytes:
    try:
        return data if method == STORED else zlib.decompressobj(-zlib.MAX_WBITS).decompress(data)
    except zlib.error:
        return b""


def _unpacked(data: bytes, method: int, size: int) -> bytes | None:
    try:
        return data if method == STORED else zlib.decompress(data, -zlib.MAX_WBITS, bufsize=max(size, 1))
    except (zlib.error, MemoryError, OverflowError):
        return None
