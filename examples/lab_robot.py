"""A robot of a lab, in a process of its own: the simulated parallelogram behind a UDP port, with a hand that moves it.

    python examples/lab_robot.py push 5005 log.csv

It is written from the description of the datagrams and of the robot alone, and imports nothing of hapticeval. `push`
stands on a circle and is pushed along it; `stroke` presses on the circle and slides to and fro. It logs what a lab has:
a clock in ms, encoder counts and motor voltages. It waits for each answer before it moves on, so that a busy computer
gives the same run as an idle one; a real robot waits for nobody.
"""

import csv
import math
import socket
import struct
import sys
from pathlib import Path

CYCLE = 1e-3
L1, L4 = 0.300, 0.346  # m, thesis Table A.1
INERTIA, DAMPING = (0.204, 0.01825), (0.105, 0.0336)  # kg m^2, N m s/rad
FRICTION, DELAY = 0.005, 0.0005  # N m in each joint; s from a reading to its torque
COUNTS, OFFSETS, DIRECTIONS, TORQUE_PER_VOLT = 262144, (1210, -340), (1, -1), 0.35
READING, COMMAND = struct.Struct("<4sQq3d"), struct.Struct("<4sQ3d")
GOOD_BYE = 2**64 - 1
SILENCE = 10.0  # s without an answer after which the motors are off


def pushed(t, place, velocity):
    """N: a push along the circle within the first 0.1 s, 0.7625 N at its peak; then nobody touches the robot."""
    return 0.0, max(0.0, 0.7625 * (1.0 - abs(t - 0.05) / 0.05))


def stroking(t, place, velocity):
    """N: a grip of 250 N/m and 4 N s/m, whose path comes in to 5 mm below the circle and slides to and fro there."""
    radius, angle = 0.104 - 0.009 * min(1.0, t / 0.2), 0.7 * math.sin(2.0 * t)
    path = radius * math.cos(angle), radius * math.sin(angle)
    return tuple(250.0 * (p - x) - 4.0 * v for p, x, v in zip(path, place, velocity, strict=True))


HANDS = {"push": (pushed, (0.1, 0.0)), "stroke": (stroking, (0.104, 0.0))}  # and where the robot stands


class Robot:
    def __init__(self, hand, place):
        # Inverse kinematics, from the two links' triangle: thesis (2.36) solved for the joints, rad.
        across, up = place[0] + L4, place[1] + L1
        fold = math.asin((across**2 + up**2 - L1**2 - L4**2) / (2.0 * L1 * L4))
        first = math.atan2(up, across) - math.atan2(L4 * math.sin(fold) + L1, L4 * math.cos(fold))
        self.hand, self.joints, self.rates, self.torque, self.time = (
            hand,
            [first, first + fold],
            [0.0, 0.0],
            [0.0] * 2,
            0.0,
        )

    def counts(self):
        return [
            round(way * angle * COUNTS / (2.0 * math.pi)) + offset
            for way, angle, offset in zip(DIRECTIONS, self.joints, OFFSETS, strict=True)
        ]

    def cycle(self, volts):
        """The old torques until DELAY has passed, then those of the new voltages, for what is left of the cycle."""
        self.move(DELAY)
        self.torque = [way * volt * TORQUE_PER_VOLT for way, volt in zip(DIRECTIONS, volts, strict=True)]
        self.move(CYCLE - DELAY)

    def move(self, seconds):
        (sin1, sin2), (cos1, cos2) = (map(f, self.joints) for f in (math.sin, math.cos))
        place = L4 * cos2 - L1 * sin1 - L4, L4 * sin2 + L1 * cos1 - L1  # (2.36)
        jacobian = (-L1 * cos1, -L4 * sin2), (-L1 * sin1, L4 * cos2)  # (2.37)
        velocity = [sum(j * r for j, r in zip(row, self.rates, strict=True)) for row in jacobian]
        force = self.hand(self.time, place, velocity)
        for k in range(2):
            torque = self.torque[k] + sum(row[k] * f for row, f in zip(jacobian, force, strict=True))
            rate = self.rates[k] + seconds * (torque - DAMPING[k] * self.rates[k]) / INERTIA[k]  # (2.35)
            # Coulomb friction brakes, and turns nothing round.
            self.rates[k] = math.copysign(max(0.0, abs(rate) - seconds * FRICTION / INERTIA[k]), rate)
            self.joints[k] += seconds * self.rates[k]
        self.time += seconds


def main(hand, port, log):
    robot, line = Robot(*HANDS[hand]), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.bind(("127.0.0.1", int(port)))
    greeting, loop = line.recvfrom(64)
    assert COMMAND.unpack(greeting)[:2] == (b"HCWR", 0), "this is no loop of hapticeval"
    line.settimeout(SILENCE)
    with Path(log).open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["t_ms", "enc1", "enc2", "u1", "u2"])
        count = answered = 0
        while answered != GOOD_BYE:
            count += 1
            counts = robot.counts()
            line.sendto(READING.pack(b"HCRD", count, round(robot.time * 1e9), *counts, 0.0), loop)
            while answered < count:
                _, answered, *volts, _ = COMMAND.unpack(line.recv(64))
            if answered == count:
                rows.writerow([count - 1, *counts, *volts])
                robot.cycle(volts)


if __name__ == "__main__":
    main(*sys.argv[1:])
