"""Memory that the running loop fills with rows and a writer in another process empties; neither ever waits.

One process puts rows in and owns `HEAD`, the other takes them out and owns `TAIL`: counters that only grow. A full
ring takes no more rows and counts them. All of it is allocated, and every page touched, before the loop starts.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from enum import IntEnum
from typing import Any

import numpy as np

from hapticeval.errors import HapticevalError

EVENTS = 256
EVENT = np.dtype([("nanoseconds", "<i8"), ("kind", "S32"), ("text", "S216")])


class State(IntEnum):
    """The counters at the front of the memory, an int64 each."""

    HEAD = 0
    TAIL = 1
    OVERRUN = 2
    MISSED = 3
    EVENT_HEAD = 4
    EVENT_TAIL = 5
    EVENT_OVERRUN = 6
    CLOSED = 7
    READY = 8
    BYTES = 9
    BLOCKS = 10
    ERROR = 11


STATE_BYTES = 256


class Ring:
    """`capacity` rows of `size` bytes each, with their counters, and as many events as `EVENTS`.

    Made anew without `descriptor`, and joined with the one of a ring that another process made.
    """

    def __init__(self, size: int, capacity: int, descriptor: int | None = None) -> None:
        self.size, self.capacity = size, capacity
        self.events_at = STATE_BYTES
        self.rows_at = self.events_at + EVENTS * EVENT.itemsize
        length = self.rows_at + capacity * size
        self.descriptor = _shared(length) if descriptor is None else descriptor
        self._map = mmap.mmap(self.descriptor, length)
        self.memory = memoryview(self._map)
        if descriptor is None:
            self.memory[:] = bytes(length)
        self.state: Any = self.memory[:STATE_BYTES].cast("q")
        self.events = np.frombuffer(self.memory, dtype=EVENT, count=EVENTS, offset=self.events_at)

    @property
    def sequence(self) -> int:
        """The number of the next cycle: rows put in, rows that found the ring full, and cycles told missed."""
        return int(self.state[State.HEAD] + self.state[State.OVERRUN] + self.state[State.MISSED])

    def bytes_of(self, first: int, count: int) -> memoryview:
        """The bytes of `count` rows from counter `first` on, which must not reach over the end of the ring."""
        begin = self.rows_at + first % self.capacity * self.size
        return self.memory[begin : begin + count * self.size]


def _shared(length: int) -> int:
    """Memory that another process can be handed as a file descriptor: on no disk, where the system can do that."""
    try:
        if hasattr(os, "memfd_create"):
            descriptor = os.memfd_create("hapticeval-ring")
        else:
            with tempfile.TemporaryFile() as file:
                descriptor = os.dup(file.fileno())
        os.ftruncate(descriptor, length)
    except OSError as error:
        raise HapticevalError(f"no memory of {length} bytes can be shared", why=str(error)) from error
    return descriptor
