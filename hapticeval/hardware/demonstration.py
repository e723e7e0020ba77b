"""What stands in for a robot where there is none: the twin with all that is imperfect in it, and a hand that slides."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.criteria import MOTOR_TORQUE
from hapticeval.effects.delay import Delay
from hapticeval.effects.joint_friction import JointFriction
from hapticeval.effects.saturation import Saturation
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.surface import Surface
from hapticeval.hardware.twin import Twin
from hapticeval.hardware.wiring import Wiring
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Hand, Path
from hapticeval.types import Array

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
    effects = (Saturation(MOTOR_TORQUE), Delay(DELAY), JointFriction(FRICTION))
    path = _to_and_fro(scene.model.boundary)
    hand = Hand(path=path, stiffness=GRIP[0], damping=GRIP[1])
    return Twin(wiring, effects, position=path.points[0], hand=hand, dt=scene.sampling_time)


def _to_and_fro(boundary: Curve | Surface) -> Path:
    time = np.linspace(0.0, LONGEST, round(KNOTS * LONGEST) + 1)
    shift = REACH * np.sin(2.0 * np.pi / PERIOD * time)
    seed = np.zeros((1, 2 if isinstance(boundary, Curve) else 3))
    seed[0, 0] = 0.1
    if isinstance(boundary, Curve):
        way = boundary.parameter(boundary.arc_length(boundary.nearest(seed))[0] + shift)
        return Path(time, boundary.position(way) - DEPTH * boundary.normal(way))
    begin = boundary.frame(seed)
    along = np.zeros(3)
    along[int(np.argmin(np.abs(begin.normal[0])))] = 1.0
    along -= (along @ begin.normal[0]) * begin.normal[0]
    points: Array = begin.foot + shift[:, None] * along / np.linalg.norm(along)
    frame = boundary.frame(points)
    return Path(time, frame.foot - DEPTH * frame.normal)
