"""The robot behind a socket, and what is said when there is none."""

from __future__ import annotations

import socket
import threading
import time

import numpy as np
import pytest
from robots import DT, twin_of, wired

from hapticeval.errors import HapticevalError
from hapticeval.hardware import udp
from hapticeval.hardware.device import Reading
from hapticeval.hardware.udp import (
    BYE,
    COMMAND,
    HELLO,
    READ_PACKET,
    READING,
    STOPPED_PACKET,
    WRITE_PACKET,
    UdpDevice,
    running,
)


@pytest.fixture
def robot():
    """The robot's end, without a robot."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.bind(("127.0.0.1", 0))
        end.settimeout(5.0)
        yield end


@pytest.fixture
def patient(monkeypatch):
    """Neither side takes the other to be gone because the machine is busy."""
    monkeypatch.setattr(udp, "SILENCE_SECONDS", 60.0)
    monkeypatch.setattr(udp, "UNHEARD_SECONDS", 60.0)


def greeted(robot):
    device = UdpDevice(robot.getsockname(), 2)
    packet, loop = robot.recvfrom(COMMAND.size)
    assert COMMAND.unpack(packet)[:2] == (WRITE_PACKET, HELLO)
    return device, loop


def test_a_loop_greets_answers_and_ends(robot):
    device, loop = greeted(robot)
    robot.sendto(READING.pack(READ_PACKET, 7, 123, 1.0, 2.0, 3.0), loop)
    reading = device.read()
    assert reading[:2] == (123, 7)
    np.testing.assert_array_equal(reading.raw, [1.0, 2.0])
    device.write(np.array([0.5, -0.25]))
    assert COMMAND.unpack(robot.recv(COMMAND.size)) == (WRITE_PACKET, 7, 0.5, -0.25, 0.0)
    device.close()
    device.close()
    assert COMMAND.unpack(robot.recv(COMMAND.size)) == (WRITE_PACKET, BYE, 0.0, 0.0, 0.0)


def test_the_newest_reading_counts(robot):
    device, loop = greeted(robot)
    for count in range(1, 6):
        robot.sendto(READING.pack(READ_PACKET, count, count, count, 0.0, 0.0), loop)
    assert device.read().sequence == 5
    device.close()


def test_of_readings_out_of_order_the_highest_counts(robot):
    device, loop = greeted(robot)
    for count in (3, 4, 4, 2):
        robot.sendto(READING.pack(READ_PACKET, count, count, count, 0.0, 0.0), loop)
    assert device.read().sequence == 4
    assert device.dropped == {"late or repeated": 2}
    device.close()


@pytest.mark.parametrize(
    "packet",
    [
        b"",
        b"HCRD",
        b"hello",
        READING.pack(READ_PACKET, 2, 2, 0.0, 0.0, 0.0) + b".",
        READING.pack(b"HCR2", 2, 2, 0.0, 0.0, 0.0),
        READING.pack(READ_PACKET, BYE, 2, 0.0, 0.0, 0.0),
        READING.pack(READ_PACKET, HELLO, 2, 0.0, 0.0, 0.0),
    ],
    ids=["empty", "short", "text", "long", "version", "counts as good-bye", "counts as greeting"],
)
def test_what_is_no_reading_is_dropped_and_named(refused, robot, monkeypatch, packet):
    device, loop = greeted(robot)
    robot.sendto(packet, loop)
    robot.sendto(READING.pack(READ_PACKET, 1, 1, 0.0, 0.0, 0.0), loop)
    assert device.read().sequence == 1
    robot.sendto(packet, loop)
    monkeypatch.setattr(udp, "SILENCE_SECONDS", 0.05)
    monkeypatch.setattr(device, "address", ("127.0.0.1", 5005))
    with refused(HapticevalError):
        device.read()
    device.close()


def test_what_others_send_is_dropped_and_named(robot):
    device, loop = greeted(robot)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for port in range(2 * udp.MOST_REASONS):
            other.sendto(READING.pack(READ_PACKET, 9, 9, 9.0, 9.0, 9.0), loop)
            other.sendto(STOPPED_PACKET + bytes([port]), loop)
        robot.sendto(READING.pack(READ_PACKET, 1, 1, 0.0, 0.0, 0.0), loop)
        assert device.read().sequence == 1
        _, port = other.getsockname()
        assert device.dropped == {f"from another sender, 127.0.0.1:{port}": 4 * udp.MOST_REASONS}
    device.close()


def test_of_many_reasons_few_are_kept(robot):
    device, loop = greeted(robot)
    for size in range(2 * udp.MOST_REASONS):
        robot.sendto(bytes(size), loop)
    robot.sendto(READING.pack(READ_PACKET, 1, 1, 0.0, 0.0, 0.0), loop)
    assert device.read().sequence == 1
    assert len(device.dropped) == udp.MOST_REASONS + 1
    assert sum(device.dropped.values()) == 2 * udp.MOST_REASONS
    device.close()


def test_a_robot_that_stopped_says_why(refused, robot):
    device, loop = greeted(robot)
    robot.sendto(STOPPED_PACKET + b"emergency stop", loop)
    with refused(HapticevalError):
        device.read()
    device.close()


def test_an_address_that_is_none_is_refused():
    for address in (("no.such.host.invalid", 5005), ("127.0.0.1", 99_999)):
        with pytest.raises(HapticevalError):  # in the words of the system
            UdpDevice(address, 2)


@pytest.mark.usefixtures("patient")
def test_the_twin_in_real_time_counts_its_cycles():
    wiring = wired()
    with running(twin_of(wiring)) as address:
        device = UdpDevice(address, 2)
        readings = []
        for _ in range(50):
            readings.append(device.read())
            device.write(np.zeros(2))
        device.close()
    stamps = np.array([reading.nanoseconds for reading in readings])
    counts = np.array([reading.sequence for reading in readings])
    assert np.all(np.diff(counts) >= 1)
    # The robot's own clock: a cycle each, however late the loop was.
    np.testing.assert_array_equal(np.diff(stamps), np.diff(counts) * round(DT * 1e9))


class Stopping:
    """A twin that stops by itself in its 50th cycle."""

    def __init__(self):
        self.wiring, self.dt, self.count, self.stopped = wired(), DT, 0, threading.Event()

    def read(self):
        self.count += 1
        if self.count == 50:
            self.stopped.set()
            raise HapticevalError("a joint limit was hit")
        return Reading(self.count, self.count, np.zeros(2))


@pytest.mark.usefixtures("patient")
def test_a_loop_that_was_held_up_still_hears_why_the_robot_stopped(refused, robot):
    """Its buffer holds a few packets, and the first last word finds it full."""
    device, twin = UdpDevice(robot.getsockname(), 2), Stopping()
    device._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    thread = threading.Thread(target=udp.serve, args=(twin, robot))
    thread.start()
    assert twin.stopped.wait(60.0)
    time.sleep(0.1)

    def caught_up():
        while True:
            device.read()

    with refused(HapticevalError):
        caught_up()
    device.close()
    thread.join(60.0)
    assert not thread.is_alive(), "it goes on saying so after the loop has ended"
