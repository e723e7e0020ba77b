"""A robot at the other end of a socket, as a Simulink rig is: encoder packets come in, command packets go out.

One datagram a cycle each way, little-endian: the robot sends `HCRD`, its cycle count (u64), its clock (i64, ns) and
three raw positions (f64); the loop sends `HCWR`, the count that it answers (u64) and three commands (f64). A loop
begins with a command packet of count zero and ends with one of count 2^64 - 1. A robot that stops by itself may say
why: `HCST` and a text in UTF-8, again and again until the loop has ended, as a loop that was held up has no room for
packets.
"""

from __future__ import annotations

import contextlib
import select
import socket
import struct

import numpy as np

from hapticeval.errors import HapticevalError
from hapticeval.hardware.device import Reading
from hapticeval.types import Array

JOINTS = 3
READ, WRITE, STOPPED = b"HCRD", b"HCWR", b"HCST"
READING, COMMAND = struct.Struct(f"<4sQq{JOINTS}d"), struct.Struct(f"<4sQ{JOINTS}d")
HELLO, BYE = 0, 2**64 - 1
LONGEST = 1024
"""Bytes of the longest packet that is read whole."""

SILENCE = 1.8
"""Seconds without a packet after which the other side is taken to be gone: before the loop's own patience ends."""


class UdpDevice:
    """A `HardwareDevice` of `dimension` joints whose other end listens at `address`.

    The robot sets the pace. When the loop was late, packets wait: the newest is read, and the gap in its count says how
    many cycles were missed. Raises `HapticevalError` when there is no such address, when the robot is silent for
    `SILENCE` or says that it stopped, and for a packet that is none of its.
    """

    def __init__(self, address: tuple[str, int], dimension: int) -> None:
        self.dimension = dimension
        self.address = address
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._answered = HELLO
        self._zeros = [0.0] * JOINTS
        self._arrival = select.poll()
        self._arrival.register(self._socket, select.POLLIN)
        try:
            self._socket.connect(address)
            self._socket.setblocking(False)
            self._send(HELLO, self._zeros)
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise HapticevalError(
                f"there is no way to the robot at {address[0]}:{address[1]}", why=str(error), todo="see its address"
            ) from error

    def read(self) -> Reading:
        """The newest packet, waited for if none is there."""
        packet = self._newest()
        if packet.startswith(STOPPED):
            raise HapticevalError(f"the robot stopped: {packet[len(STOPPED) :].decode(errors='replace')}")
        if len(packet) != READING.size or not packet.startswith(READ):
            raise HapticevalError(
                f"{self.address[0]}:{self.address[1]} sent a packet that is no encoder reading",
                why=f"it has {len(packet)} bytes and begins with {packet[:4]!r}, "
                f"where a reading has {READING.size} and begins with {READ!r}",
            )
        _, count, nanoseconds, *raw = READING.unpack(packet)
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

    def _newest(self) -> bytes:
        """The last of the packets that have come, or the robot's last word, whichever is first."""
        packet = b""
        try:
            if not self._arrival.poll(1e3 * SILENCE):
                raise self._silent(f"no packet for {SILENCE:g} s")
            with contextlib.suppress(BlockingIOError):
                while not packet or packet.startswith(READ):
                    packet = self._socket.recv(LONGEST)
        except ConnectionError as error:
            raise self._silent(str(error)) from error
        return packet

    def _silent(self, why: str) -> HapticevalError:
        return HapticevalError(
            f"the robot at {self.address[0]}:{self.address[1]} is silent",
            why=why,
            todo="see that it runs, and that its port is right",
        )

    def _send(self, count: int, values: list[float]) -> None:
        with contextlib.suppress(ConnectionError, BlockingIOError):  # the next read says that the other side is gone
            self._socket.send(COMMAND.pack(WRITE, count, *values))
