"""What is looked at before a file is read: its first bytes, and how much memory its numbers may take.

A file of a few kilobytes can declare gigabytes: by compression, by a data set that was never written, or by naming one
part many times. Every reader calls `reserve` first.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from hapticeval.errors import InputError, unreadable

HEAD_BYTES = 1 << 16
"""Bytes by which a format is recognised: a header of a thousand columns is shorter."""

FOLDER_MARK = b"folder\n"
GIGABYTE = 10**9

DEFAULT_LIMIT = 2.0
"""Gigabytes for one file unless asked for otherwise: 30 channels at 1 kHz for more than two hours."""

_limit: ContextVar[float] = ContextVar("memory limit", default=DEFAULT_LIMIT)


@contextmanager
def limited(gigabytes: float) -> Iterator[None]:
    """Refuse, within the block, files whose numbers take more than so many gigabytes."""
    # Of this context alone: several files may be read side by side with different limits.
    token = _limit.set(gigabytes)
    try:
        yield
    finally:
        _limit.reset(token)


def reserve(size: int, what: str) -> None:
    """Raise `InputError` where `size` bytes, which `what` would take, are beyond the limit."""
    if size > int(_limit.get() * GIGABYTE):
        # The needed gigabytes, rounded up to a tenth.
        enough = -(-size // (GIGABYTE // 10)) / 10
        raise InputError(
            f"{what} would take {size / GIGABYTE:.3g} GB of memory",
            why=f"the limit for one file is {_limit.get():g} GB; a small file can declare any amount",
            todo=f"if the file is trusted, and the memory is there, give --memory-limit {enough:g}",
        )


def first_bytes(path: Path) -> bytes:
    """Return the first `HEAD_BYTES` bytes of a file; of a folder `FOLDER_MARK` and the names in it, one per line.

    Raises `InputError` for a file that is missing or empty, and for a pipe or a device.
    """
    if path.is_dir():
        return FOLDER_MARK + "\n".join(sorted(file.name for file in path.iterdir())).encode()
    # Opening a pipe would wait for a writer that may never come.
    if path.exists() and not path.is_file():
        raise InputError(
            f"{path} is not a file",
            why="a pipe or a device has no first bytes to look at, and no end",
            todo="copy it to a file",
        )
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise unreadable(str(path), error) from error
    if not head:
        raise InputError(f"{path} is empty", why="a recording has at least one row", todo="record or copy it again")
    return head
