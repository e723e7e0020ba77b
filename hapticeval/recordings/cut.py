"""HDF5 files that are cut short: how long they should be, and how to open what there is of them."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

SIGNATURE = b"\x89HDF\r\n\x1a\n"
END_OF_FILE = {0: 40, 1: 44, 2: 28, 3: 28}
"""Where in a superblock of each version the end of the file stands, with offsets of eight bytes."""

WIDTH = {0: 13, 1: 13, 2: 9, 3: 9}
"""Where the version says how wide an offset is."""


def told_size(path: Path) -> int:
    """How long an HDF5 file says that it is; zero where it does not say so."""
    with path.open("rb") as opened:
        head = opened.read(4096 + 64)
    at = 0
    while head[at : at + 8] != SIGNATURE:  # what comes before is the user's: nothing, 512 bytes, or twice as many ...
        at = max(512, 2 * at)
        if at >= len(head):
            return 0
    version = head[at + 8] if at + 8 < len(head) else None
    if version not in END_OF_FILE or head[at + WIDTH[version] : at + WIDTH[version] + 1] != b"\x08":
        return 0
    told = head[at + END_OF_FILE[version] :][:8]
    return int(struct.unpack("<Q", told)[0]) if len(told) == 8 else 0


def ending(path: Path) -> str:
    """In words, where a file ends before it should; empty where it does not."""
    size, told = path.stat().st_size, told_size(path)
    return f"the file ends at byte {size} of {told}" if size < told else ""


def open_padded(raw: Any, path: Path) -> Any:
    """The `h5py.File` of a file that is cut short, as if it went on with bytes that no checksum takes for data.

    Only for files that are checksummed throughout.
    """
    import h5py

    return h5py.File(_Padded(raw, path), "r")


def open_ended(raw: Any, path: Path) -> Any:
    """The `h5py.File` of what there is of any file that is cut short: `OSError` for all that reaches beyond its end."""
    import h5py

    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    access.set_sieve_buf_size(0)  # reads nothing ahead, which might lie beyond the end
    made = _Ended(raw, path)
    access.set_fileobj_driver(h5py.h5fd.fileobj_driver, made)
    return h5py.File(h5py.h5f.open(repr(made).encode(), h5py.h5f.ACC_RDONLY, access))


class _Padded(io.RawIOBase):
    """A file that is as long as it should be: where it is cut short, made-up bytes follow."""

    def __init__(self, raw: Any, path: Path) -> None:
        self.raw, self.size, self.at = raw, told_size(path), 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self.at

    def seek(self, offset: int, whence: int = 0) -> int:
        self.at = offset + (0, self.at, self.size)[whence]
        return self.at

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        self.raw.seek(self.at)
        got = self.raw.read(len(view))
        view[: len(got)] = got
        if len(got) < len(view):
            self.pad(view[len(got) :])
        self.at += len(view)
        return len(view)

    def pad(self, view: memoryview) -> None:
        """Fill the bytes that the file has not got."""
        view[:] = b"\xff" * len(view)


class _Ended(_Padded):
    """The same without a made-up byte, which nothing tells from data in a file that has no checksums."""

    def pad(self, view: memoryview) -> None:
        raise OSError(f"{len(view)} bytes are missing that stood behind the end of the file")
