"""The twin in real time, in a process of its own, at the other end of a loopback socket."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from hapticeval.errors import HapticevalError
from hapticeval.hardware.twin import Twin
from hapticeval.hardware.udp import BYE, COMMAND, HELLO, JOINTS, READ, READING, STOPPED, WRITE

SPIN = 200_000
"""Nanoseconds before a cycle at which waiting turns from sleep to looking at the clock."""

LISTEN = 0.9
"""Share of a cycle that the twin waits for an answer; a later one is taken at the next cycle."""

UNHEARD = 2.0
"""Seconds without a command after which the loop is taken to be gone."""

AGAIN = 0.02
"""Seconds between two times that a twin which has stopped says why."""


def serve(twin: Twin, connection: socket.socket) -> None:
    """Run `twin` in real time at `connection`, from a loop's first packet to its last, or until it has gone silent.

    A stamp is the robot's own clock, which says when the encoders stood so: the start, and a cycle each.
    """
    connection.settimeout(None)
    _, loop = connection.recvfrom(COMMAND.size)
    connection.setblocking(False)
    cycle = round(twin.dt * 1e9)
    heard = begun = due = time.monotonic_ns()
    try:
        while time.monotonic_ns() - heard < UNHEARD * 1e9:
            reading = twin.read()
            raw = [*reading.raw.tolist(), *([0.0] * JOINTS)][:JOINTS]
            _wait(due)
            connection.sendto(READING.pack(READ, reading.sequence, begun + reading.nanoseconds, *raw), loop)
            _wait(due + round(LISTEN * cycle))
            due += cycle
            for count, values in _commands(connection):
                heard = time.monotonic_ns()
                if count == BYE:
                    return
                if count != HELLO:
                    twin.write(np.array(values[: twin.wiring.device.dimension]))
    except HapticevalError as error:
        with contextlib.suppress(ConnectionError):
            _last_word(connection, loop, STOPPED + error.what.encode())
    except ConnectionError:
        return


def _last_word(connection: socket.socket, loop: tuple[str, int], packet: bytes) -> None:
    """Say why it stopped until the loop has ended or gone: one that was held up has no room left for a packet."""
    until = time.monotonic() + UNHEARD
    while time.monotonic() < until:
        with contextlib.suppress(BlockingIOError):
            connection.sendto(packet, loop)
        if any(count == BYE for count, _ in _commands(connection)):
            return
        time.sleep(AGAIN)


def _commands(connection: socket.socket) -> Iterator[tuple[int, list[float]]]:
    """The command packets that have come, in their order."""
    try:
        while True:
            packet = connection.recv(COMMAND.size + 1)
            if len(packet) == COMMAND.size and packet.startswith(WRITE):
                _, count, *values = COMMAND.unpack(packet)
                yield count, values
    except BlockingIOError:
        return


def _wait(due: int) -> None:
    """Until the monotonic clock says `due`, ns: asleep for most of it."""
    left = due - time.monotonic_ns()
    if left > SPIN:
        time.sleep((left - SPIN) / 1e9)
    while time.monotonic_ns() < due:
        pass


@contextmanager
def running(twin: Twin) -> Iterator[tuple[str, int]]:
    """`twin` in a process of its own, behind a loopback UDP port: the address to connect to."""
    connection = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    connection.bind(("127.0.0.1", 0))
    process = multiprocessing.get_context("fork").Process(target=_served, args=(twin, connection), daemon=True)
    process.start()
    try:
        yield connection.getsockname()
    finally:
        process.join(timeout=0.5)
        if process.is_alive():
            process.terminate()
        process.join()
        connection.close()


def _served(twin: Twin, connection: socket.socket) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the loop, which then says good-bye
    serve(twin, connection)
