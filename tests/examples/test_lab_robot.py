"""The robot of the page on a day in a lab: written apart from the package, and the same robot."""

from __future__ import annotations

import numpy as np
import pytest

from hapticeval.devices.catalogue import make_device
from hapticeval.effects.actuators import Delay, JointFriction
from hapticeval.examples import lab_robot
from hapticeval.hardware.twin import Twin
from hapticeval.hardware.wiring import Wiring

WIRED = Wiring(
    device=make_device("parallelogram-2dof"),
    counts_per_turn=lab_robot.COUNTS,
    offsets=lab_robot.OFFSETS,
    directions=lab_robot.DIRECTIONS,
    torque_per_command=lab_robot.TORQUE_PER_VOLT,
)


@pytest.mark.parametrize("hand", lab_robot.HANDS)
def test_it_stands_where_its_hand_begins_and_counts_as_its_wiring_says(hand):
    push, place = lab_robot.HANDS[hand]
    robot = lab_robot.Robot(push, place)
    np.testing.assert_allclose(robot.joints, WIRED.device.joints(np.array(place)), rtol=0.0, atol=1e-14)
    np.testing.assert_array_equal(robot.counts(), WIRED.raw(np.array(robot.joints)))


def test_it_moves_as_the_twin_does():
    """Under swinging voltages and a push: a first-order step h of 0.5 ms is off by some h v, at v of 0.4 rad/s."""
    push, place = lab_robot.HANDS["push"]
    robot = lab_robot.Robot(push, place)
    effects = (Delay(lab_robot.DELAY), JointFriction(lab_robot.FRICTION))
    force = lambda times: np.array([push(float(time), None, None) for time in times])  # noqa: E731
    twin = Twin(WIRED, effects, position=np.array(place), hand=None, dt=lab_robot.CYCLE, push=force)
    twin.read()
    start, furthest = np.array(robot.joints), 0.0
    for cycle in range(200):
        volts = np.array([0.6, -0.1]) * np.sin(0.05 * cycle)
        twin.write(volts)
        robot.cycle(volts.tolist())
        twin.read()
        furthest = max(furthest, float(np.max(np.abs(twin.joints - start))))
        np.testing.assert_allclose(robot.joints, twin.joints, rtol=0.0, atol=2e-4)
    # It has moved: a hundred times as far as the two may differ.
    assert furthest > 0.02
