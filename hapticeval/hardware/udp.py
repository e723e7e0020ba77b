"""A robot at the other end of a socket, as a Simulink rig is, and the simulated twin in real time at such a socket.

One datagram per cycle each way, little-endian:

- the robot sends `HCRD`, its cycle count (u64), its clock (i64, ns) and three raw positions (f64);
- the loop sends `HCWR`, the count that it answers (u64) and three commands (f64);
- a loop begins with a command packet of count zero and ends with one of count 2^64 - 1;
- counts go from 1 to 2^64 - 2, one more each cycle; of several readings that wait the highest count is taken;
- a robot that stops by itself may say why: `HCST` and a text in UTF-8, again and again until the loop has ended, as a
  loop that was held up has no room for packets.

Datagrams are lost, repeated, reordered, and sent by programs that mean somebody else. What comes from another address,
has another length or begins otherwise is dropped and counted; so is a count that is no later than the last.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import select
import signal
import socket
import struct
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from hapticeval.errors import HapticevalError
from hapticeval.hardware.device import LATE_READING, Reading, dropped_lines
from hapticeval.hardware.safety import WatchdogError
from hapticeval.hardware.twin import Twin
from hapticeval.types import Array

PACKET_JOINTS = 3
READ_PACKET, WRITE_PACKET, STOPPED_PACKET = b"HCRD", b"HCWR", b"HCST"
READING, COMMAND = struct.Struct(f"<4sQq{PACKET_JOINTS}d"), struct.Struct(f"<4sQ{PACKET_JOINTS}d")
HELLO, BYE = 0, 2**64 - 1
LONGEST_PACKET = 1024
"""Bytes of the longest packet that is read whole."""

SILENCE_SECONDS = 1.8
"""Seconds without a packet after which the other side is taken to be gone: before the loop's own patience ends."""

MOST_REASONS = 10
"""Reasons why packets were dropped that are counted each by itself."""

SPIN_NANOSECONDS = 200_000
"""Nanoseconds before a cycle at which waiting turns from sleep to looking at the clock."""

ANSWER_SHARE = 0.9
"""Share of a cycle that the twin waits for an answer; a later one is taken at the next cycle."""

UNHEARD_SECONDS = 2.0
"""Seconds without a command after which the loop is taken to be gone."""

REPEAT_SECONDS = 0.02
"""Seconds between two times that a twin which has stopped says why."""


class UdpDevice:
    """A `HardwareDevice` of `dimension` joints whose other end listens at `address`.

    The robot sets the pace. When the loop was late, packets wait: the highest count is read, and the gap in the counts
    says how many cycles were missed. `dropped` counts, by reason, packets that are none of the robot's. Raises
    `HapticevalError` when there is no such address, when no robot answers for `SILENCE_SECONDS`, and when it says that
    it stopped; `WatchdogError` when it falls silent for as long.
    """

    def __init__(self, address: tuple[str, int], dimension: int) -> None:
        self.dimension = dimension
        self.address = address
        self.dropped: Counter[str] = Counter()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        # A command names the reading that it answers; before the first there is none.
        self._answered = HELLO
        self._zeros = [0.0] * PACKET_JOINTS
        # poll() and no timeout of the socket: the newest of several packets has to be taken without waiting.
        self._arrival = select.poll()
        self._arrival.register(self._socket, select.POLLIN)
        try:
            # Not connected: the system would drop what others send without a word.
            self._robot = (socket.gethostbyname(address[0]), address[1])
            self._socket.setblocking(False)
            self._send(HELLO, self._zeros)
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise HapticevalError(
                f"there is no way to the robot at {address[0]}:{address[1]}", why=str(error), todo="see its address"
            ) from error

    def read(self) -> Reading:
        """Return the newest packet's reading, waiting for one if none is there."""
        until = time.monotonic() + SILENCE_SECONDS
        newest: tuple[int, int, Array] | None = None
        # Waits for a reading; once there is one, only what lies in the socket is looked at.
        while (left := until - time.monotonic()) > 0.0 and self._arrival.poll(1e3 * left if newest is None else 0.0):
            reading = self._received()
            if reading is not None and (newest is None or reading[0] > newest[0]):
                newest = reading
            elif reading is not None:
                self._drop(LATE_READING)
        if newest is None:
            # Before its first reading it is a robot that is not there.
            kind = HapticevalError if self._answered == HELLO else WatchdogError
            raise kind(
                f"the robot at {self.address[0]}:{self.address[1]} is silent",
                why="; ".join([f"no reading for {SILENCE_SECONDS:g} s", *dropped_lines(self.dropped)]),
                todo="see that it runs, and that its port is right",
            )
        count, nanoseconds, raw = newest
        self._answered = count
        return Reading(nanoseconds, count, raw)

    def write(self, command: Array) -> None:
        """Send commands (N,) as the answer to the last reading."""
        self._send(self._answered, [*command.tolist(), *self._zeros[self.dimension :]])

    def close(self) -> None:
        """Send zeros and the end."""
        if self._socket.fileno() >= 0:
            with contextlib.suppress(OSError):
                self._send(BYE, self._zeros)
            self._socket.close()

    def _received(self) -> tuple[int, int, Array] | None:
        """Return count, stamp (ns) and raw positions (N,) of the next packet; None of one that is not a reading.

        Raises `HapticevalError` for the robot's last word.
        """
        try:
            packet, sender = self._socket.recvfrom(LONGEST_PACKET)
        except BlockingIOError:  # its checksum was wrong, and the system threw it away
            return None
        wrong = self._fault(packet, sender)
        if wrong:
            self._drop(wrong)
            return None
        if packet.startswith(STOPPED_PACKET):
            raise HapticevalError(f"the robot stopped: {packet[len(STOPPED_PACKET) :].decode(errors='replace')}")
        # Packets always hold `PACKET_JOINTS` numbers: a robot of fewer joints leaves the last ones at zero.
        _, count, nanoseconds, *raw = READING.unpack(packet)
        return count, nanoseconds, np.array(raw[: self.dimension])

    def _fault(self, packet: bytes, sender: tuple[str, int]) -> str:
        """Return why a packet is none of the robot's; empty for one that is."""
        if sender != self._robot:
            return f"from another sender, {sender[0]}:{sender[1]}"
        if packet.startswith(STOPPED_PACKET):
            return ""
        if len(packet) != READING.size:
            return f"of another length, {len(packet)} bytes where a reading has {READING.size}"
        mark, count, *_ = READING.unpack(packet)
        if mark != READ_PACKET:
            return f"of another version, {mark!r} where a reading begins with {READ_PACKET!r}"
        return f"counted {count}, which no answer can name" if count in (HELLO, BYE) else ""

    def _drop(self, why: str) -> None:
        # Others may send anything without end: of reasons a few are kept.
        self.dropped[why if why in self.dropped or len(self.dropped) < MOST_REASONS else "of other kinds"] += 1

    def _send(self, count: int, values: list[float]) -> None:
        with contextlib.suppress(BlockingIOError):  # the next read says that the other side is gone
            self._socket.sendto(COMMAND.pack(WRITE_PACKET, count, *values), self._robot)


def serve(twin: Twin, connection: socket.socket) -> None:
    """Run `twin` in real time at `connection`, from a loop's first packet to its last, or until it has gone silent.

    A stamp is the robot's own clock at the moment of the reading: the start, and one cycle more each time.
    """
    connection.settimeout(None)
    greeting, loop = b"", ("", 0)
    while len(greeting) != COMMAND.size or COMMAND.unpack(greeting)[:2] != (WRITE_PACKET, HELLO):
        greeting, loop = connection.recvfrom(COMMAND.size + 1)
    connection.setblocking(False)
    cycle = round(twin.dt * 1e9)
    # ns of this process's monotonic clock.
    heard = begun = due = time.monotonic_ns()
    try:
        while time.monotonic_ns() - heard < UNHEARD_SECONDS * 1e9:
            reading = twin.read()
            raw = [*reading.raw.tolist(), *([0.0] * PACKET_JOINTS)][:PACKET_JOINTS]
            _wait(due)
            connection.sendto(READING.pack(READ_PACKET, reading.sequence, begun + reading.nanoseconds, *raw), loop)
            # An answer within this time acts in this cycle, a later one in the next.
            _wait(due + round(ANSWER_SHARE * cycle))
            due += cycle
            for count, values in _commands(connection, loop):
                heard = time.monotonic_ns()
                if count == BYE:
                    return
                if count != HELLO:
                    twin.write(np.array(values[: twin.wiring.device.dimension]))
    except HapticevalError as error:
        with contextlib.suppress(ConnectionError):
            _last_word(connection, loop, STOPPED_PACKET + error.what.encode())
    except ConnectionError:
        return


def _last_word(connection: socket.socket, loop: tuple[str, int], packet: bytes) -> None:
    """Send the reason why the twin stopped until the loop has ended or gone.

    A loop that was held up has no room left for a packet, so it is sent again and again.
    """
    until = time.monotonic() + UNHEARD_SECONDS
    while time.monotonic() < until:
        with contextlib.suppress(BlockingIOError):
            connection.sendto(packet, loop)
        if any(count == BYE for count, _ in _commands(connection, loop)):
            return
        time.sleep(REPEAT_SECONDS)


def _commands(connection: socket.socket, loop: tuple[str, int]) -> Iterator[tuple[int, list[float]]]:
    """Yield the command packets that have come from `loop`, in their order."""
    try:
        while True:
            packet, sender = connection.recvfrom(COMMAND.size + 1)
            if sender == loop and len(packet) == COMMAND.size and packet.startswith(WRITE_PACKET):
                _, count, *values = COMMAND.unpack(packet)
                yield count, values
    except BlockingIOError:
        return


def _wait(due: int) -> None:
    """Wait until `due`, ns of the monotonic clock, asleep for most of it."""
    left = due - time.monotonic_ns()
    if left > SPIN_NANOSECONDS:
        time.sleep((left - SPIN_NANOSECONDS) / 1e9)
    while time.monotonic_ns() < due:
        pass


@contextmanager
def running(twin: Twin) -> Iterator[tuple[str, int]]:
    """Run `twin` in a process of its own, behind a loopback UDP port; give the address to connect to."""
    connection = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    connection.bind(("127.0.0.1", 0))
    process = multiprocessing.get_context("fork").Process(
        target=_served, args=(twin, connection, os.getpid()), daemon=True
    )
    process.start()
    try:
        yield connection.getsockname()
    finally:
        # A twin whose loop said good-bye ends by itself.
        process.join(timeout=0.5)
        if process.is_alive():
            process.terminate()
        process.join()
        connection.close()


def _served(twin: Twin, connection: socket.socket, parent: int) -> None:
    """Wait for the first packet and serve the twin, in a process of its own, which ends when `parent` does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the loop, which then says good-bye
    while not select.select([connection], [], [], REPEAT_SECONDS)[0]:
        if os.getppid() != parent:  # it was killed before its loop began
            return
    serve(twin, connection)
