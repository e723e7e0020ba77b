"""The live recorder: rows of a running loop into a journal, without the loop ever waiting for a disk.

The loop puts rows into a ring in shared memory, which a process beside it empties into the journal; neither ever waits.
Counters that only grow say how far each is: the loop owns `head`, the writer `tail`. A full ring takes no more rows and
counts them. All of it is allocated, and every page touched, before the loop starts.

The writer looks ten times a second, and outlives the loop: when that ends without a word, what is in the ring is still
written. A disk that is full leaves the rows in the ring, to be tried again.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import json
import mmap
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import monotonic_ns
from typing import Any

import numpy as np
from numpy import ndarray

from hapticeval.errors import HapticevalError, InputError, describe_error, unwritable
from hapticeval.files import refuse_existing
from hapticeval.recordings.channels import Signal, check_metadata
from hapticeval.recordings.journal import HEADER_COPIES, UNCLOSED, Kind, Layout, block_head, opening

RING_EVENTS = 256
"""Events that the ring holds; the loop writes few: what it says with `event`."""

EVENT_TYPE = np.dtype([("nanoseconds", "<i8"), ("kind", "S32"), ("text", "S216")])

RING_ROWS = 16_384
"""Rows that the ring holds: 16 s at 1 kHz, for a disk that is busy or full for a while."""

ROWS_A_BLOCK = 256
"""Most rows of a block of the journal."""

WRITER_LOOK_SECONDS = 0.1
"""Seconds between two looks of the writer: blocks of about 100 rows at 1 kHz."""

SYNC_SECONDS = 1.0
"""Seconds between two requests that the disk really has it: what a loss of power costs."""

SETTLE_SECONDS = 0.01
"""Seconds after which what one process put into memory is there for the other."""

START_SECONDS = STOP_SECONDS = 60.0
"""Seconds within which the writer must have started, and ended."""

LOOK_ROWS = 256
"""Rows between two looks at whether the writer still lives: a quarter of a second at 1 kHz, for 2 us."""


MOST_MISSED = 2**62
"""Cycles that a recorder can number: 146 million years at 1 kHz."""


class Counters(ctypes.Structure):
    """What stands at the front of the memory: each is written by one of the two processes only, so no lock is needed.

    The loop counts rows up to `head`, of which the writer has written those before `tail`; events alike.
    """

    _fields_ = [
        (name, ctypes.c_int64)
        for name in (
            "head", "tail", "overrun", "missed", "event_head", "event_tail", "event_overrun", "closed", "ready",
            "bytes", "blocks", "error",
        )
    ]  # fmt: skip


COUNTERS_BYTES = 256
"""Bytes kept for `Counters`, of which they take 96: events and rows begin at whole lines of the cache."""

ROWS_AT = COUNTERS_BYTES + RING_EVENTS * EVENT_TYPE.itemsize


class Ring:
    """`capacity` rows of `size` bytes each, with their counters, and as many events as `RING_EVENTS`.

    Made anew without `descriptor`, and joined with the one of a ring that another process made.
    """

    def __init__(self, size: int, capacity: int, descriptor: int | None = None) -> None:
        self.size, self.capacity = size, capacity
        # Counters, then events, then rows.
        length = ROWS_AT + capacity * size
        self.descriptor = _shared(length) if descriptor is None else descriptor
        self.memory = memoryview(mmap.mmap(self.descriptor, length))
        if descriptor is None:
            # Touches every page now, so that no page fault comes while the loop runs.
            self.memory[:] = bytes(length)
        self.counters = Counters.from_buffer(self.memory)
        self.events = np.frombuffer(self.memory, dtype=EVENT_TYPE, count=RING_EVENTS, offset=COUNTERS_BYTES)

    def bytes_of(self, first: int, count: int) -> memoryview:
        """Return the bytes of `count` rows from counter `first` on, which must not reach over the end of the ring."""
        # Counters only grow: the row's place is its remainder.
        begin = ROWS_AT + first % self.capacity * self.size
        return self.memory[begin : begin + count * self.size]


def _shared(length: int) -> int:
    """Return a descriptor of memory that another process can be handed: on no disk, where the system can do that."""
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


class Writer:
    """Empties `ring` into the journal that is open as `descriptor`, from the byte that the counters say on."""

    def __init__(self, ring: Ring, descriptor: int) -> None:
        self.ring, self.counters, self.descriptor = ring, ring.counters, descriptor
        self.reported = (0, 0)
        self.synced = time.monotonic()

    def run(self, parent: int) -> None:
        """Write until the loop closes the recorder or is gone."""
        self.counters.ready = 1
        known_head = 0
        while not (select.select([sys.stdin], [], [], WRITER_LOOK_SECONDS)[0] or os.getppid() != parent):
            # Only rows that were there at the last look: their bytes have long arrived in this process too.
            self.drain(known_head)
            known_head = self.counters.head
        # The loop is closed or gone: what it wrote last has arrived after this.
        time.sleep(SETTLE_SECONDS)
        self.finish("closed" if self.counters.closed else UNCLOSED)

    def finish(self, how: str) -> None:
        """Write what is left, and the end."""
        counters = self.counters
        self.drain(counters.head)
        self._report_overrun()  # also where rows found no room
        end = {
            "how": how,
            "next": int(counters.head + counters.overrun + counters.missed),
            "unwritten": counters.head - counters.tail,
            "overrun": counters.overrun,
            "events_lost": counters.event_overrun,
        }
        self._put(Kind.END, 0, json.dumps(end).encode())
        self._sync(0.0)

    def drain(self, until: int) -> None:
        """Write the rows before counter `until`, as far as the disk takes them, the events, and what was lost."""
        while (tail := self.counters.tail) < until:
            # A block ends at the ring's end at the latest: its rows lie side by side.
            count = min(until - tail, ROWS_A_BLOCK, self.ring.capacity - tail % self.ring.capacity)
            if not self._put(Kind.ROWS, count, self.ring.bytes_of(tail, count)):
                return
            # Only after they are written: until then their places in the ring are not free.
            self.counters.tail = tail + count
        while (at := self.counters.event_tail) < self.counters.event_head:
            event = self.ring.events[at % RING_EVENTS]
            if not self._event(int(event["nanoseconds"]), event["kind"].decode(), event["text"].decode()):
                return
            self.counters.event_tail = at + 1
        self._report_overrun()
        self._sync(SYNC_SECONDS)

    def _report_overrun(self) -> None:
        """Record as events how many rows and events found no room since the last report, and why."""
        losses = (self.counters.overrun, self.counters.event_overrun)
        error = self.counters.error
        why = f"the journal could not be written: {os.strerror(error)}" if error else "the writer was too late"
        for count, before, what in zip(losses, self.reported, ("rows", "events"), strict=True):
            text = f"{count - before} {what} were lost: {why}"
            # Not reported where even the event found no room on the disk: tried again at the next look.
            if count > before and not self._event(time.monotonic_ns(), "overrun", text):
                return
        self.reported = losses

    def _event(self, stamp: int, kind: str, text: str) -> bool:
        return self._put(Kind.EVENT, 0, json.dumps([stamp, kind, text]).encode())

    def _put(self, kind: Kind, rows: int, payload: memoryview | bytes) -> bool:
        """Add a block; where that fails, the journal ends with the last whole one as before."""
        # Both counters move only after the whole block is written.
        end = at = self.counters.bytes
        try:
            for part in (memoryview(block_head(kind, self.counters.blocks, rows, payload)), memoryview(payload)):
                while part:
                    # The system may take less than it is given.
                    done = os.pwrite(self.descriptor, part, at)
                    part, at = part[done:], at + done
        except OSError as error:
            self.counters.error = error.errno or -1
            with contextlib.suppress(OSError):
                os.ftruncate(self.descriptor, end)
            return False
        self.counters.bytes = at
        self.counters.blocks += 1
        return True

    def _sync(self, after: float) -> None:
        if time.monotonic() - self.synced >= after:
            try:
                os.fsync(self.descriptor)
            except OSError as error:
                self.counters.error = error.errno or -1
            self.synced = time.monotonic()


def write_rows() -> None:
    """Run the writer in a process of its own, whose arguments the recorder gives.

    They are the descriptors of the ring and the journal, bytes per row, rows, and the loop's process.
    """
    ring, journal, size, capacity, parent = (int(argument) for argument in sys.argv[1:6])
    # Ctrl-C is meant for the loop, which then closes the recorder.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Writer(Ring(size, capacity, ring), journal).run(parent)


class LossWarning(UserWarning):
    """A recorder lost rows: its message says how many and why."""


@dataclass(frozen=True)
class Summary:
    """How a recorder stands, or ended: `rows` in the journal, and what is not there.

    `waiting` rows are in memory and not in the file: lost, once the recorder is closed. `overrun` rows found the memory
    full; `missed` cycles were reported by the loop; `events_lost` found no room. `failure` is what went wrong, if
    anything did.
    """

    rows: int
    waiting: int
    overrun: int
    missed: int
    events_lost: int
    failure: str

    @property
    def lost(self) -> int:
        """Rows that were handed over and are in no file."""
        return self.waiting + self.overrun

    def __str__(self) -> str:
        parts = [f"{self.rows} rows recorded", f"{self.lost} lost"]
        parts += [f"{self.events_lost} events lost"] if self.events_lost else []
        parts += [f"{self.missed} cycles missed by the loop"] if self.missed else []
        return ", ".join(parts) + (f" ({self.failure})" if self.failure else "")


class Recorder:
    """Records the rows of one loop to a journal, of which `recover` makes a recording.

        with Recorder(Path("run.journal"), {"hip": 2, "force": 2}) as recorder:
            while running:
                recorder.append(hip, force)

    `channels` gives each channel's columns, in the order in which `append` takes them; 0 is a single number. `signals`
    declares those that are not in `CHANNELS`; `meta` is the recording's. A process beside the loop does the writing.

    `append` never waits: a row that finds the memory full is counted, and its place shows in the sequence numbers.
    Where the writer dies, the next `LOOK_ROWS` rows bring a `LossWarning`, and `failed` has the reason: rows then stay
    in memory as long as there is room, and `close` writes them.

    Raises `InputError` where the journal is there already and for channels nobody declared, `HapticevalError` where
    the file or the writer cannot be made. Needs a POSIX system.
    """

    def __init__(
        self,
        path: Path,
        channels: Mapping[str, int],
        *,
        signals: Mapping[str, Signal] | None = None,
        meta: Mapping[str, Any] | None = None,
        rows: int = RING_ROWS,
    ) -> None:
        # The stamp and the wall clock at this instant anchor the monotonic stamps in time.
        layout = Layout(channels, signals or {}, check_metadata(meta or {}), (monotonic_ns(), time.time_ns()))
        begin = opening(layout)
        self.path = Path(path)
        self._names, self._columns = tuple(channels), tuple(channels.values())
        self._ring = Ring(layout.dtype.itemsize, rows)
        self._capacity = rows
        self._counters = self._ring.counters
        self._numbers = layout.dtype.itemsize // 8
        # Two views of the same rows: int64 for sequence and stamp, float64 for the channels.
        self._integers: Any = self._ring.memory[ROWS_AT:].cast("q")
        self._reals: Any = self._ring.memory[ROWS_AT:].cast("d")
        self._head = self._sequence = 0
        self._summary: Summary | None = None
        self.failed = ""
        """Why nothing is written any more; empty while all is well."""
        self._journal = _created(self.path)
        try:
            if os.write(self._journal, begin) != len(begin):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self._counters.bytes, self._counters.blocks = len(begin), HEADER_COPIES
            self._process = self._started()
        except BaseException as error:
            os.close(self._journal)
            os.close(self._ring.descriptor)
            # Nothing was recorded: no file is left that would stop the next attempt.
            self.path.unlink(missing_ok=True)
            if isinstance(error, OSError):
                raise unwritable(str(path), error) from error
            raise

    def _started(self) -> subprocess.Popen[bytes]:
        """Start the process that writes, and wait until it is ready. Raises `HapticevalError` where it is not."""
        ring = self._ring
        arguments = (ring.descriptor, self._journal, ring.size, ring.capacity, os.getpid())
        # The interpreter looks for modules where this one does, and not in the folder that it happens to run in.
        start = f"import sys; sys.path[:] = {json.dumps(sys.path)}; "
        start += "from hapticeval.recordings.recorder import write_rows; write_rows()"
        process = subprocess.Popen(
            [sys.executable, "-c", start, *(str(argument) for argument in arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            pass_fds=(ring.descriptor, self._journal),
            start_new_session=True,
        )
        assert process.stdin is not None
        late = time.monotonic() + START_SECONDS
        while not self._counters.ready:
            if process.poll() is not None or time.monotonic() > late:
                process.kill()
                process.stdin.close()
                raise HapticevalError(
                    "the writer of the recorder did not start",
                    why=f"its process ended with code {process.wait()}",
                    todo="see what it wrote to the standard error",
                )
            time.sleep(0.001)
        return process

    def append(self, *values: Any, at: int | None = None) -> None:
        """Record one row: the channels in their order, and its stamp (ns of a monotonic clock; now, where not given).

        Raises `InputError`, naming the channel, for values of another shape; the row is not recorded then.
        """
        head = self._head
        # The ring is full: the row is counted and numbered, but not kept.
        if head - self._counters.tail >= self._capacity:
            self._sequence += 1
            self._counters.overrun += 1
            return
        place = head % self._capacity * self._numbers
        try:
            self._integers[place] = self._sequence
            self._integers[place + 1] = monotonic_ns() if at is None else at
            reals = self._reals
            place += 2
            # number by number: in a loop that sleeps between rows, the code of array assignments is cold each time
            for count, value in zip(self._columns, values, strict=True):
                if count:
                    if len(value) != count:
                        raise ValueError
                    for number in value.tolist() if value.__class__ is ndarray else value:
                        reals[place] = number
                        place += 1
                else:
                    reals[place] = value
                    place += 1
        except (TypeError, ValueError, IndexError):
            raise self._misfit(values, at) from None
        self._sequence += 1
        self._head = head + 1
        # Last of all: from now on the writer may read the row.
        self._counters.head = head + 1
        if head % LOOK_ROWS == 0 and not self.failed:
            self._look()

    def _look(self) -> None:
        """Warn of a writer that has died as soon as it has."""
        code = self._process.poll()
        if code is None:
            return
        self.failed = f"the writer's process ended with code {code}"
        room = self._capacity - (self._head - self._counters.tail)
        warnings.warn(
            f"{self.path.name}: {self.failed}; {room} more rows fit into memory, and close() writes them",
            LossWarning,
            stacklevel=3,
        )

    def wait_for_room(self) -> None:
        """Wait until a row finds room, or the writer has died: for a loop that no clock holds back."""
        while self._head - self._counters.tail >= self._capacity and not self.failed:
            self._look()
            time.sleep(WRITER_LOOK_SECONDS)

    def missed(self, cycles: int) -> None:
        """Count cycles that the loop left out since the last row."""
        # The counters are of 64 bits: beyond them a count turns negative without a word.
        if not 0 <= cycles <= MOST_MISSED - self._sequence:
            raise InputError(f"{cycles} cycles cannot have been missed")
        self._counters.missed += int(cycles)
        self._sequence += cycles

    def event(self, kind: str, text: str = "", *, at: int | None = None) -> None:
        """Record that something happened. Texts are cut after 216 bytes, kinds after 32."""
        head = self._counters.event_head
        if head - self._counters.event_tail >= RING_EVENTS:
            self._counters.event_overrun += 1
            return
        event = self._ring.events[head % RING_EVENTS]
        for name, content in (("kind", kind), ("text", text)):
            if not isinstance(content, str) or "\0" in content or (name == "kind" and not content):
                raise InputError(f"an event has the {name} {content!r}", todo="give it as text")
            # Cut by bytes, and not within a character: decoding drops the half that may be left.
            event[name] = content.encode()[: EVENT_TYPE[name].itemsize].decode(errors="ignore").encode()
        event["nanoseconds"] = monotonic_ns() if at is None else at
        self._counters.event_head = head + 1

    @property
    def writer(self) -> int:
        """The id of the process that writes."""
        return self._process.pid

    @property
    def summary(self) -> Summary:
        """How the recorder stands, and, once closed, how it ended."""
        if self._summary is not None:
            return self._summary
        counters, code = self._counters, self._process.poll()
        failure = ""
        # An error of the disk that was overcome later lost nothing, and is not a failure.
        rows_missing = counters.head > counters.tail or counters.overrun or counters.event_overrun
        if counters.error and rows_missing:
            failure = f"the journal could not be written: {os.strerror(counters.error)}"
        elif code is not None and (code or not counters.closed):
            failure = f"the writer's process ended with code {code}"
        counts = counters.overrun, counters.missed, counters.event_overrun
        return Summary(counters.tail, counters.head - counters.tail, *counts, failure)

    def close(self) -> Summary:
        """Have everything written; return what was recorded and what was lost, which is a `LossWarning` as well.

        Where the writer has died, this process writes what is still in memory.
        """
        if self._summary is not None:
            return self._summary
        self._counters.closed = 1
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(STOP_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        # The writer died: its last block may be half written, and the rest of the ring is still here.
        if self._process.returncode:
            with contextlib.suppress(OSError):
                os.ftruncate(self._journal, self._counters.bytes)
            Writer(self._ring, self._journal).finish(self.summary.failure)
        self._summary = summary = self.summary
        # From now on `append` finds no columns for its values, and raises.
        self._columns = ()
        os.close(self._journal)
        os.close(self._ring.descriptor)
        if summary.lost or summary.events_lost or summary.failure:
            warnings.warn(f"{self.path.name}: {summary}", LossWarning, stacklevel=2)
        return summary

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is not None:
            self.event("ended", describe_error(error).replace("\0", " "))
        self.close()

    def _misfit(self, values: tuple[Any, ...], at: Any) -> InputError:
        """Return the error of a row that `append` could not take."""
        if self._summary is not None:
            return InputError("the recorder is closed")
        what, why = f"append() was given {values!r}", "not all of it is numbers"
        if at is not None and not isinstance(at, int | np.integer):
            what, why = f"append() was given the stamp {at!r}", "stamps are whole nanoseconds"
        elif len(values) != len(self._names):
            what, why = f"append() was given {len(values)} channels", f"this recorder has: {', '.join(self._names)}"
        else:
            for name, count, value in zip(self._names, self._columns, values, strict=True):
                shape, expected_shape = np.shape(np.asarray(value, dtype=object)), (count,) if count else ()
                if shape != expected_shape:
                    what = f"append() was given values of shape {shape} for '{name}'"
                    return InputError(what, why=f"the recorder was made for shape {expected_shape}")
        return InputError(what, why=why)


def _created(path: Path) -> int:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
    except OSError as error:
        refuse_existing(path)
        why = f"it cannot be made: {error.strerror or error}"
        raise HapticevalError(f"cannot record to {path}", why=why, todo="choose another folder") from error
