"""When the rows of a real run were taken: the stamps as the clock gave them, which nothing re-times."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.rows import locked
from hapticeval.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class Clock:
    """Stamps of a monotonic clock, int64 nanoseconds, a row a sample; read-only.

    `start` is the stamp at which a recording's `time` is zero: the first row's, unless given. `anchor` is a stamp
    and the wall clock at the same instant, both ns, the latter since 1970 UTC; None where it is not known.
    `sequence` (n,) numbers the cycles of the loop, so that one left out is seen; None where nobody counted.

    Raises `InputError` for stamps that are not whole numbers, and for shapes that do not fit. Whether they
    increase is the recording's to say, which knows the rows that are not valid.
    """

    nanoseconds: IntArray
    start: int | None = None
    anchor: tuple[int, int] | None = None
    sequence: IntArray | None = None

    def __post_init__(self) -> None:
        nanoseconds = _whole("the stamps of a clock", self.nanoseconds)
        if nanoseconds.ndim != 1 or nanoseconds.size == 0:
            raise InputError(
                f"a clock needs stamps of shape (n,), got {nanoseconds.shape}", todo="give one stamp a row"
            )
        start = int(nanoseconds[0]) if self.start is None else int(self.start)
        object.__setattr__(self, "nanoseconds", nanoseconds)
        object.__setattr__(self, "start", start)
        if self.anchor is not None:
            stamp, wall = self.anchor
            object.__setattr__(self, "anchor", (int(stamp), int(wall)))
        if self.sequence is not None:
            sequence = _whole("sequence numbers", self.sequence)
            if sequence.shape != nanoseconds.shape:
                raise InputError(
                    f"there are {sequence.size} sequence numbers for {nanoseconds.size} stamps",
                    todo="give one a row, or none at all",
                )
            object.__setattr__(self, "sequence", sequence)

    def __reduce__(self) -> tuple[object, ...]:
        return Clock, (self.nanoseconds, self.start, self.anchor, self.sequence)

    @property
    def zero(self) -> int:
        """`start`, which is there once the clock is made."""
        assert self.start is not None
        return self.start

    @cached_property
    def seconds(self) -> Array:
        """Time since `start`, s: (n,), each the double nearest to the stamp; read-only."""
        out = np.empty(self.nanoseconds.shape)
        np.subtract(self.nanoseconds, self.zero, out=out, dtype=np.int64, casting="unsafe")
        out /= 1e9
        out.flags.writeable = False
        return out

    @property
    def missed(self) -> int | None:
        """Cycles between the first row and the last that have no row; None where nobody counted."""
        if self.sequence is None:
            return None
        return int(self.sequence.max() - self.sequence.min()) + 1 - int(self.sequence.size)

    def part(self, rows: slice) -> Clock:
        """The same clock on some of the rows, its zero where it was."""
        sequence = None if self.sequence is None else self.sequence[rows]
        return Clock(self.nanoseconds[rows], self.start, self.anchor, sequence)


def _whole(name: str, values: Any) -> IntArray:
    array = np.asarray(values)
    if array.dtype.kind not in "iu":
        raise InputError(
            f"{name} are of type {array.dtype}",
            why="a float cannot hold nanoseconds since the computer started",
            todo="give whole numbers; from seconds: np.rint(1e9 * seconds).astype(np.int64)",
        )
    if array.dtype == np.uint64 and array.size and int(array.max()) > np.iinfo(np.int64).max:
        raise InputError(f"{name} do not fit 64 bits with a sign", todo="count from a later zero")
    out: IntArray = locked(array, np.int64)
    return out
