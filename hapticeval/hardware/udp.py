"""A robot at the other end of a socket, as a Simulink rig is: encoder packets come in, command packets go out.

One datagram a cycle each way, little-endian: the robot sends `HCRD`, its cycle count (u64), its clock (i64, ns) and
three raw positions (f64); the loop sends `HCWR`, the count that it answers (u64) and three commands (f64). A loop
begins with a command packet of count zero and ends with one of count 2^64 - 1.
"""

from __future__ import annotations

import contextlib
import socket
import struct

import numpy as np

from hapticeval.errors import HapticevalError
from hapticeval.hardware.device import Reading
from hapticeval.types import Array

JOINTS = 3
READ, WRITE = b"HCRD", b"HCWR"
READING, COMMAND = struct.Struct(f"<4sQq{JOINTS}d"), struct.Struct(f"<4sQ{JOINTS}d")
HELLO, BYE = 0, 2**64 - 1
SILENCE = 2.0
"""Seconds without a packet after which the other side is taken to be gone."""


class UdpDevice:
    """A `HardwareDevice` of `dimension` joints whose other end listens at `address`.

    The robot sets the pace. When the loop was late, packets wait: the newest is read, and the gap in its count says how
    many cycles were missed. Raises `HapticevalError` when the robot is silent for two seconds.
    """

    def __init__(self, address: tuple[str, int], dimension: int) -> None:
        self.dimension = dimension
        self.address = address
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(address)
        self._socket.settimeout(SILENCE)
        self._answered = HELLO
        self._zeros = [0.0] * JOINTS
        self._send(HELLO, self._zeros)

    def read(self) -> Reading:
        """The newest packet, waited for if none is there."""
        packet = self._receive()
        self._socket.setblocking(False)
        try:
            while True:
                packet = self._socket.recv(READING.size)
        except BlockingIOError:
            pass
        finally:
            self._socket.settimeout(SILENCE)
        mark, count, nanoseconds, *raw = READING.unpack(packet)
        if mark != READ:
            raise HapticevalError(
                f"{self.address} sent a packet that is no encoder reading", why=f"it begins with {mark!r}"
            )
        self._answered = count
        return Reading(nanoseconds, count, np.array(raw[: self.dimension]))

    def write(self, command: Array) -> None:
        """Send commands (N,) as the answer to the last reading."""
        self._send(self._answered, [*command.tolist(), *self._zeros[self.dimension :]])

    def close(self) -> None:
        """Send zeros and the end."""
        if self._socket.fileno() >= 0:
            with contextlib.suppress(OSError):
                self._send(BYE, self._zeros)
            self._socket.close()

    def _receive(self) -> bytes:
        try:
            return self._socket.recv(READING.size)
        except (TimeoutError, ConnectionError) as error:
            raise HapticevalError(
                f"the robot at {self.address[0]}:{self.address[1]} has gone silent",
                why=f"no packet for {SILENCE:g} s" if isinstance(error, TimeoutError) else str(error),
                todo="see that it runs, and that its port is right",
            ) from error

    def _send(self, count: int, values: list[float]) -> None:
        with contextlib.suppress(ConnectionError):  # the next read says that the other side is gone
            self._socket.send(COMMAND.pack(WRITE, count, *values))
