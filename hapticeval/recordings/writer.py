"""The process beside the loop: takes rows out of the ring and adds them to the journal as blocks.

It looks ten times a second, and outlives the loop: when that ends without a word, what is in the ring is still
written. A disk that is full leaves the rows in the ring, to be tried again.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import sys
import time

from hapticeval.recordings.journal import UNCLOSED, Kind, block_head
from hapticeval.recordings.ring import EVENTS, Ring, State

LOOK = 0.1
"""Seconds between two looks: blocks of about 100 rows at 1 kHz."""

SYNC = 1.0
"""Seconds between two requests that the disk really has it: what a loss of power costs."""

SETTLE = 0.01
"""Seconds after which what one process put into memory is there for the other."""

ROWS_A_BLOCK = 256


class Writer:
    """Empties `ring` into the journal that is open as `descriptor`, from byte `State.BYTES` on."""

    def __init__(self, ring: Ring, descriptor: int) -> None:
        self.ring, self.state, self.descriptor = ring, ring.state, descriptor
        self.told = (0, 0)
        self.synced = time.monotonic()

    def run(self, parent: int) -> None:
        """Write until the loop closes the recorder or is gone."""
        self.state[State.READY] = 1
        seen = 0
        while True:
            gone = bool(select.select([sys.stdin], [], [], LOOK)[0]) or os.getppid() != parent
            if gone:
                break
            # Only rows that were there at the last look: their bytes have long arrived in this process too.
            self.drain(seen)
            seen = self.state[State.HEAD]
        time.sleep(SETTLE)
        self.finish("closed" if self.state[State.CLOSED] else UNCLOSED)

    def finish(self, how: str) -> None:
        """Write what is left, and the end."""
        self.drain(self.state[State.HEAD])
        self._tell_overrun()
        end = {
            "how": how,
            "next": self.ring.sequence,
            "unwritten": self.state[State.HEAD] - self.state[State.TAIL],
            "overrun": self.state[State.OVERRUN],
            "events_lost": self.state[State.EVENT_OVERRUN],
        }
        self._put(Kind.END, 0, json.dumps(end).encode())
        self._sync(0.0)

    def drain(self, until: int) -> None:
        """Write the rows before counter `until`, as far as the disk takes them, the events, and what was lost."""
        while (tail := self.state[State.TAIL]) < until:
            count = min(until - tail, ROWS_A_BLOCK, self.ring.capacity - tail % self.ring.capacity)
            if not self._put(Kind.ROWS, count, self.ring.bytes_of(tail, count)):
                return
            self.state[State.TAIL] = tail + count
        while (at := self.state[State.EVENT_TAIL]) < self.state[State.EVENT_HEAD]:
            event = self.ring.events[at % EVENTS]
            text = [int(event["nanoseconds"]), event["kind"].decode(), event["text"].decode()]
            if not self._put(Kind.EVENT, 0, json.dumps(text).encode()):
                return
            self.state[State.EVENT_TAIL] = at + 1
        self._tell_overrun()
        self._sync(SYNC)

    def _tell_overrun(self) -> None:
        lost = (self.state[State.OVERRUN], self.state[State.EVENT_OVERRUN])
        for count, before, what in zip(lost, self.told, ("rows", "events"), strict=True):
            if count > before:
                error = self.state[State.ERROR]
                why = f"the journal could not be written: {os.strerror(error)}" if error else "the writer was too late"
                text = [time.monotonic_ns(), "overrun", f"{count - before} {what} were lost: {why}"]
                if not self._put(Kind.EVENT, 0, json.dumps(text).encode()):
                    return
        self.told = lost

    def _put(self, kind: Kind, rows: int, payload: memoryview | bytes) -> bool:
        """Add a block; where that fails, the journal ends with the last whole one as before."""
        end = self.state[State.BYTES]
        parts = [memoryview(block_head(kind, self.state[State.BLOCKS], rows, payload)), memoryview(payload)]
        try:
            at = end
            for part in parts:
                while part:
                    done = os.pwrite(self.descriptor, part, at)
                    part, at = part[done:], at + done
        except OSError as error:
            self.state[State.ERROR] = error.errno or -1
            with contextlib.suppress(OSError):
                os.ftruncate(self.descriptor, end)
            return False
        self.state[State.BYTES] = at
        self.state[State.BLOCKS] += 1
        return True

    def _sync(self, after: float) -> None:
        if time.monotonic() - self.synced >= after:
            try:
                os.fsync(self.descriptor)
            except OSError as error:
                self.state[State.ERROR] = error.errno or -1
            self.synced = time.monotonic()


def main() -> None:
    """Started by the recorder: the ring's and the journal's descriptors, bytes a row, rows, and the loop's process."""
    ring, journal, size, capacity, parent = (int(argument) for argument in sys.argv[1:6])
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Writer(Ring(size, capacity, ring), journal).run(parent)
