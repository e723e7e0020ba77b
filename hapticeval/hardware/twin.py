"""The simulated robot as hardware: the plant of closed loops behind encoders and motors, and a hand that moves it."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.criteria import MOTOR_TORQUE
from hapticeval.devices.device import Device
from hapticeval.devices.imperfections import Imperfections
from hapticeval.errors import HapticevalError
from hapticeval.geometry.boundary import Boundary
from hapticeval.hardware.device import Reading
from hapticeval.hardware.wiring import Wiring
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Hand, Path
from hapticeval.types import Array

DEPTH, REACH, PERIOD, LONGEST = 0.005, 0.075, 5.0, 600.0
"""The hand's path: m inside the surface, m to either side along it, s to and fro, and s until it stands still."""

KNOTS = 40
"""Points of the path per second."""

DELAY, FRICTION = 2e-4, 2e-3
"""s between sampling and output; N m of Coulomb friction in each joint."""

GRIP = (250.0, 4.0)
"""N/m and N s/m of the hand."""


class Twin:
    """A `HardwareDevice` that is a simulation: each `read` moves the robot on by one cycle of `dt` seconds.

    It starts at rest at `position` (N,), m, held by `hand`; encoders count by the `wiring`; of the `imperfections`
    torque limit, delay and friction are the robot's own. It has no network and no clock, so that runs can be repeated.
    """

    def __init__(
        self, wiring: Wiring, imperfections: Imperfections, *, position: Array, hand: Hand | None, dt: float
    ) -> None:
        self.wiring = wiring
        self.dt = dt
        self._plant = _Plant(wiring.device, imperfections, position, hand, dt)
        self._count = 0

    def read(self) -> Reading:
        """Return the encoders after one more cycle; the first time where it started."""
        if self._count:
            self._plant.advance((self._count - 1) * self.dt)
        self._count += 1
        raw = self.wiring.raw(self._plant.joints)
        return Reading(round((self._count - 1) * self.dt * 1e9), self._count, raw)

    def write(self, command: Array) -> None:
        """Set what the motors give from now on, once the delay has passed."""
        self._plant.command(self.wiring.torques(command))

    def close(self) -> None:
        """Do nothing: nothing is held."""


class _Plant:
    """Joints, rates and the torques on their way, moved by the integrator of closed loops."""

    def __init__(
        self, device: Device, imperfections: Imperfections, position: Array, hand: Hand | None, dt: float
    ) -> None:
        from hapticeval.compiled import DYNAMICS, KINEMATICS, first_class
        from hapticeval.devices import dynamics_kernels as motion
        from hapticeval.devices.imperfections import actuation
        from hapticeval.devices.integration import control, default_method
        from hapticeval.devices.integration_kernels import advance

        count = device.dimension
        method = default_method()
        self._advance = advance
        self._kernels = (
            first_class(device.kernels.kinematics, KINEMATICS),
            first_class(device.kernels.dynamics, DYNAMICS),
            device.parameters,
        )
        self.device, self.hand, self.dt = device, hand, dt
        self.joints = np.array(device.joints(position), dtype=np.float64)
        self.rates = np.zeros(count)
        friction = imperfections.friction
        self._friction = None if friction is None else np.full(count, friction)
        self._grip = None if hand is None else np.array([hand.stiffness, hand.damping])
        motors = actuation(imperfections, dt)
        self._limit, ticks, self._rest = (np.inf, 0.0, 0.0) if motors is None else (float(each) for each in motors)
        self._line = [np.zeros(count) for _ in range(int(ticks) + 2)]
        self._settings = (method.table, control(method), np.array([dt]))
        self._scratch = (
            np.zeros((motion.ROWS, count)),
            np.empty((motion.SQUARES, count, count)),
            np.empty((method.b.size, count)),
        )
        self._move(self.joints.copy(), self.rates.copy(), 0.0, 0.0, dt, np.zeros(count))  # compiles, before time counts

    def command(self, torques: Array) -> None:
        """Put torques (N,), N m, behind those that the delay still holds back."""
        self._line[0] = np.clip(torques, -self._limit, self._limit)

    def advance(self, start: float) -> None:
        """Move on by one cycle from `start`, s."""
        self._move(self.joints, self.rates, start, 0.0, self._rest, self._line[-1])
        self._move(self.joints, self.rates, start, self._rest, self.dt, self._line[-2])
        if self.device.margin(self.joints) <= 0.0:
            raise HapticevalError(
                f"the simulated robot hit a joint limit: joints {np.round(self.joints, 4).tolist()} rad",
                todo="keep the hand's path inside the workspace: see hapticeval device",
            )
        self._line = [self._line[0].copy(), *self._line[:-1]]

    def _move(self, joints: Array, rates: Array, start: float, begin: float, finish: float, torque: Array) -> None:
        """Move from `begin` to `finish` seconds into the cycle that starts at `start`."""
        if finish <= begin:
            return
        path = None if self.hand is None else self.hand.desired(np.array([start, start + self.dt]))
        taken = self._advance(
            *self._kernels, joints, rates, begin, finish, self.dt, torque, None, path, self._grip, self._friction,
            *self._settings, *self._scratch,
        )  # fmt: skip
        if taken == 0 or not np.isfinite(joints).all():
            raise HapticevalError("the simulated robot ran away", why="its motors feed energy into it without end")


def demonstration(wiring: Wiring, scene: Scene) -> Twin:
    """Return the simulated robot with this wiring, and a hand that slides to and fro on the scene's model.

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
