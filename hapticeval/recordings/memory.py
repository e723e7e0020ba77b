"""How much memory the numbers of one file may take: checked before it is taken, whatever the file promises.

A file of a few kilobytes can declare gigabytes: by compression, by a data set that was never written, or by naming one
part many times. Every reader calls `reserve` first.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from hapticeval.errors import InputError

GIGABYTE = 10**9

LIMIT = 2.0
"""Gigabytes for one file unless asked for otherwise: 30 channels at 1 kHz for more than two hours."""

_limit: ContextVar[float] = ContextVar("memory limit", default=LIMIT)


@contextmanager
def limited(gigabytes: float) -> Iterator[None]:
    """Refuse, within the block, files whose numbers take more than so many gigabytes."""
    token = _limit.set(gigabytes)
    try:
        yield
    finally:
        _limit.reset(token)


def allowed() -> int:
    """Return the bytes that the numbers of one file may take."""
    return int(_limit.get() * GIGABYTE)


def reserve(size: int, what: str) -> None:
    """Raise `InputError` where `size` bytes, which `what` would take, are beyond the limit."""
    if size > allowed():
        enough = -(-size // (GIGABYTE // 10)) / 10
        raise InputError(
            f"{what} would take {size / GIGABYTE:.3g} GB of memory",
            why=f"the limit for one file is {_limit.get():g} GB; a small file can declare any amount",
            todo=f"if the file is trusted, and the memory is there, give --memory-limit {enough:g}",
        )
