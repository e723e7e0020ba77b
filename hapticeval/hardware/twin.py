"""The simulated robot as hardware: the plant of closed loops behind encoders and motors, and a hand that moves it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hapticeval.devices.integration import default_method
from hapticeval.effects.actuators import Delay, JointFriction, Saturation
from hapticeval.effects.effect import Effect, Stage
from hapticeval.errors import HapticevalError
from hapticeval.geometry.boundary import Boundary
from hapticeval.hardware.device import Reading
from hapticeval.hardware.wiring import Wiring
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Hand, Path
from hapticeval.types import Array

HAND_DEPTH, HAND_REACH, HAND_PERIOD, HAND_SECONDS = 0.005, 0.075, 5.0, 600.0
"""The hand's path: m inside the surface, m to either side along it, s to and fro, and s until it stands still."""

KNOTS_A_SECOND = 40
"""Points of the path per second."""

MOTOR_DELAY, COULOMB_FRICTION = 2e-4, 2e-3
"""s between sampling and output; N m of Coulomb friction in each joint."""

HAND_GRIP = (250.0, 4.0)
"""N/m and N s/m of the hand."""


class Twin:
    """A `HardwareDevice` that is a simulation: each `read` moves the robot on by one cycle of `dt` seconds.

    It starts at rest at `position` (N,), m, held by `hand` and pushed by the forces (n, N), N, that `push` gives at
    times (n,), s, and is moved by the kernels of closed loops; encoders count
    by the `wiring`; of the `effects` those of motors and joints are the robot's own. It has no network and no clock, so
    that runs can be repeated.
    """

    def __init__(
        self,
        wiring: Wiring,
        effects: Sequence[Effect],
        *,
        position: Array,
        hand: Hand | None,
        dt: float,
        push: Callable[[Array], Array] | None = None,
    ) -> None:
        from hapticeval.compiled import specialised
        from hapticeval.devices.motion_kernels import Grip, Load, advance, motion_of
        from hapticeval.simulation.kernels import apply_effects, hook_of

        device, size = wiring.device, wiring.device.dimension
        parts = [(effect.stage, effect.part(0, size, dt)) for effect in effects]
        friction = [part.params for stage, part in parts if stage is Stage.JOINTS]
        self.wiring, self.hand, self.dt = wiring, hand, dt
        self.joints = np.array(device.joints(position), dtype=np.float64)
        self.rates = np.zeros(size)
        self._grip = None if hand is None else Grip(np.empty((2, size)), np.array([hand.stiffness, hand.damping]))
        self._push_at, self._push = push, np.zeros((2, size))
        load = Load(dt, self._push, self._grip, np.sum(friction, axis=0) if friction else None)
        self._motion = motion_of(device, load, default_method())
        self._motors = hook_of(part for stage, part in parts if stage is Stage.COMMAND)
        # Torques, N m: as commanded; as the motors take them up in this cycle; and those before they do.
        self._command, self._held, self._before = np.zeros(size), np.zeros(size), np.zeros(size)
        self._count = 0
        # Compiled before time counts, for these types alone: to look them up takes longer than to move.
        self._apply_effects = specialised(apply_effects, self._motors, 0, dt, self._held, self._before)
        self._advance = specialised(advance, self._motion, 0, 0.0, dt, self.joints, self.rates, self._held)

    def read(self) -> Reading:
        """Return the encoders after one more cycle; the first time where it started."""
        # The first reading is of the start: a cycle passes between two readings.
        if self._count:
            self._cycle(self._count - 1)
        self._count += 1
        return Reading(round((self._count - 1) * self.dt * 1e9), self._count, self.wiring.raw(self.joints))

    def write(self, command: Array) -> None:
        """Set the motor commands (N,) that act from now on, once the delay (s) has passed, in the wiring's unit."""
        self._command[:] = self.wiring.torques(command)

    def close(self) -> None:
        """Do nothing: nothing is held."""

    def _cycle(self, cycle: int) -> None:
        """Move by one cycle, counted from 0."""
        start, dt = cycle * self.dt, self.dt
        # Commands act through the motors' effects: saturation, and a delay after which they switch.
        self._held[:] = self._command
        switch = self._apply_effects(self._motors, cycle, dt, self._held, self._before)
        # Until `switch` seconds into the cycle the old torque acts, from there on the new one.
        self._move(self.joints, self.rates, start, 0.0, switch, self._before)
        self._move(self.joints, self.rates, start, switch, dt, self._held)
        # rad: how far the joints are inside their functional configuration space.
        if self.wiring.device.margin(self.joints) <= 0.0:
            raise HapticevalError(
                f"the simulated robot hit a joint limit: joints {np.round(self.joints, 4).tolist()} rad",
                todo="keep the hand's path inside the workspace: see python -m hapticeval.examples.studies.device",
            )

    def _move(self, joints: Array, rates: Array, start: float, begin: float, finish: float, torque: Array) -> None:
        """Move from `begin` to `finish` seconds into the cycle that starts at `start`."""
        if finish <= begin:
            return
        if self.hand is not None and self._grip is not None:
            # Where the hand wants to be, m, at the begin and the end of the cycle.
            self._grip.path[:] = self.hand.desired(np.array([start, start + self.dt]))
        if self._push_at is not None:
            self._push[:] = self._push_at(np.array([start, start + self.dt]))
        steps_done = self._advance(self._motion, 0, begin, finish, joints, rates, torque)
        if steps_done == 0 or not np.isfinite(joints).all():
            raise HapticevalError("the simulated robot ran away", why="its motors feed energy into it without end")


def demonstration(wiring: Wiring, scene: Scene) -> Twin:
    """Return the simulated robot with this wiring, and a hand that slides to and fro on the scene's model.

    Its motors give what the wiring's `torque_limit` says. It begins where the surface is nearest to a point 100 mm
    right of home.
    """
    effects = (Saturation(max(wiring.torque_limit)), Delay(MOTOR_DELAY), JointFriction(COULOMB_FRICTION))
    path = _to_and_fro(scene.model.boundary)
    hand = Hand(path=path, stiffness=HAND_GRIP[0], damping=HAND_GRIP[1])
    return Twin(wiring, effects, position=path.points[0], hand=hand, dt=scene.sampling_time)


def _to_and_fro(boundary: Boundary) -> Path:
    """Return the path of a hand that slides `HAND_DEPTH` inside the surface, to and fro by `HAND_REACH`."""
    time = np.linspace(0.0, HAND_SECONDS, round(KNOTS_A_SECOND * HAND_SECONDS) + 1)
    start = np.eye(boundary.dimension)[0] * 0.1
    surface = boundary.walk(start, HAND_REACH * np.sin(2.0 * np.pi / HAND_PERIOD * time))
    # The foot on the surface, moved inwards along the outward normal.
    return Path(time, surface.foot - HAND_DEPTH * surface.normal)
