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
from hapticeval.hardware.twin import Twin
from hapticeval.hardware.udp import BYE, COMMAND, HELLO, READ, READING, STOPPED, WRITE, UdpDevice, running


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
    monkeypatch.setattr(udp, "SILENCE", 60.0)
    monkeypatch.setattr(udp, "UNHEARD", 60.0)


def greeted(robot):
    device = UdpDevice(robot.getsockname(), 2)
    packet, loop = robot.recvfrom(COMMAND.size)
    assert COMMAND.unpack(packet)[:2] == (WRITE, HELLO)
    return device, loop


def test_a_loop_greets_answers_and_ends(robot):
    device, loop = greeted(robot)
    robot.sendto(READING.pack(READ, 7, 123, 1.0, 2.0, 3.0), loop)
    reading = device.read()
    assert reading[:2] == (123, 7)
    np.testing.assert_array_equal(reading.raw, [1.0, 2.0])
    device.write(np.array([0.5, -0.25]))
    assert COMMAND.unpack(robot.recv(COMMAND.size)) == (WRITE, 7, 0.5, -0.25, 0.0)
    device.close()
    device.close()
    assert COMMAND.unpack(robot.recv(COMMAND.size)) == (WRITE, BYE, 0.0, 0.0, 0.0)


def test_the_newest_reading_counts(robot):
    device, loop = greeted(robot)
    for count in range(1, 6):
        robot.sendto(READING.pack(READ, count, count, count, 0.0, 0.0), loop)
    assert device.read().sequence == 5
    device.close()


@pytest.mark.parametrize("packet", [b"", b"HCRD", b"hello", READING.pack(READ, 1, 1, 0.0, 0.0, 0.0) + b"."])
def test_a_packet_of_something_else_is_told(robot, packet):
    device, loop = greeted(robot)
    robot.sendto(packet, loop)
    with pytest.raises(HapticevalError, match="no encoder reading"):
        device.read()
    device.close()


def test_the_robots_last_word_is_told(robot):
    device, loop = greeted(robot)
    robot.sendto(STOPPED + b"emergency stop", loop)
    with pytest.raises(HapticevalError, match="the robot stopped: emergency stop"):
        device.read()
    device.close()


def test_a_robot_that_says_nothing_is_silent(robot, monkeypatch):
    monkeypatch.setattr(udp, "SILENCE", 0.05)
    device, _ = greeted(robot)
    with pytest.raises(HapticevalError, match="is silent") as caught:
        device.read()
    assert "no packet for 0.05 s" in str(caught.value)
    device.close()


def test_a_port_where_nobody_listens_is_told(robot):
    address = robot.getsockname()
    robot.close()
    device = UdpDevice(address, 2)
    with pytest.raises(HapticevalError, match="is silent"):
        device.read()
    device.close()


@pytest.mark.parametrize("address", [("no.such.host.invalid", 5005), ("127.0.0.1", 99_999)])
def test_an_address_that_is_none_is_told(address):
    with pytest.raises(HapticevalError, match="no way to the robot"):
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
def test_a_loop_that_was_held_up_still_hears_why_the_robot_stopped(robot):
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

    with pytest.raises(HapticevalError, match="a joint limit was hit"):
        caught_up()
    device.close()
    thread.join(60.0)
    assert not thread.is_alive(), "it goes on saying so after the loop has ended"


@pytest.mark.usefixtures("patient")
def test_the_twin_says_why_it_stopped():
    wiring = wired()
    twin = Twin(wiring, (), position=np.array([0.1, 0.0]), hand=None, dt=DT)
    with running(twin) as address:
        device = UdpDevice(address, 2)

        def pushed():
            for _ in range(5000):
                device.read()
                device.write(np.array([1.0, -1.0]))

        with pytest.raises(HapticevalError, match="joint limit"):
            pushed()
        device.close()
