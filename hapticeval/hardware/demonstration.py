"""What stands in for a robot where there is none: the twin with all that is imperfect in it, and a hand that slides."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.criteria import MOTOR_TORQUE
from hapticeval.devices.imperfections import Imperfections
from hapticeval.geometry.boundary import Boundary
from hapticeval.hardware.twin import Twin
from hapticeval.hardware.wiring import Wiring
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Hand, Path

DEPTH, REACH, PERIOD, LONGEST = 0.005, 0.075, 5.0, 600.0
"""The hand's path: m inside the surface, m to either side along it, s to and fro, and s until it stands still."""

KNOTS = 40
"""Points of the path a second."""

DELAY, FRICTION = 2e-4, 2e-3
"""s between sampling and output; N m of Coulomb friction in each joint."""

GRIP = (250.0, 4.0)
"""N/m and N s/m of the hand."""


def demonstration(wiring: Wiring, scene: Scene) -> Twin:
    """The simulated robot, wired as `wiring` says, with a hand that slides to and fro on the scene's model.

    It begins where the surface is nearest to a point 100 mm right of home.
    """
    effects = Imperfections(torque_limit=MOTOR_TORQUE, delay=DELAY, friction=FRICTION)
    path = _to_and_fro(scene.model.boundary)
    hand = Hand(path=path, stiffness=GRIP[0], damping=GRIP[1])
    return Twin(wiring, effects, position=path.points[0], hand=hand, dt=scene.sampling_time)


def _to_and_fro(boundary: Boundary) -> Path:
    time = np.linspace(0.0, LONGEST, round(KNOTS * LONGEST) + 1)
    start = np.eye(boundary.dimension)[0] * 0.1
    way = boundary.walk(start, REACH * np.sin(2.0 * np.pi / PERIOD * time))
    return Path(time, way.foot - DEPTH * way.normal)
