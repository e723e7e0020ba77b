"""What may be sent to a motor: limits that keep the direction, a soft start, and a watchdog that doubts readings.

The renderer's force is scaled to the wiring's `force_limit`. The torques that the inner loop makes of it are scaled
together until each is within its motor's `torque_limit`. So the direction stays, and the size does not. What is
doubtful is not scaled: `WatchdogError` ends the run, with zeros.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hapticeval.errors import DomainError, HapticevalError, in_mm
from hapticeval.hardware.wiring import Kinematics, Wiring
from hapticeval.types import Array

RESUMED_AFTER = 10
"""Missed cycles after which a force is one that resumes, *chosen*: a hand of 0.2 m/s moves 2 mm in 10 ms."""

FELT_FORCE = 0.1
"""N from which on a force that is there at once has to grow, *chosen*: what a hand just feels. On a surface that holds
from both sides a count of the encoders is a force, and no contact."""


class WatchdogError(HapticevalError):
    """A reading or a command is doubtful: the motors are commanded to zero, and the run ends with what it has."""

    exit_code = 3


class Sent(NamedTuple):
    """What limits make of a command: torques (N,), N m, as `commanded` and as they go to the motors, and the `force`
    (N,), N, at the hand that the latter stand for."""

    commanded: Array
    torque: Array
    force: Array


class Limiter:
    """Makes of a renderer's force the torques that are sent, cycle by cycle, and counts what it took away.

    Where `refusing`, what is above a limit ends the run instead. `scaled` and `started` are the cycles in which a limit
    and the soft start took something away; `largest_force` (N) and `largest_torque` (N m) are the largest that were
    asked for, whatever was sent.
    """

    def __init__(self, wiring: Wiring, dt: float, *, refusing: bool = False) -> None:
        self.scaled = self.started = 0
        self.largest_force = self.largest_torque = 0.0
        self._wiring, self._refusing = wiring, refusing
        self._limits = np.array(wiring.torque_limit)
        # Cycles over which the force grows, and those that have passed since it began to: all of them, until it does.
        self._growth = self._grown = round(wiring.soft_start / dt)

    def limit(self, force: Array, torque_of: Callable[[Array], Array], *, resumed: bool) -> Sent:
        """Return what is sent of a `force` (N,), N, whose torques (N,), N m, are `torque_of` it.

        `resumed` says that the cycle before this one was not answered, as the first of a run: a force that is there
        grows from zero then. Raises `WatchdogError` for torques that are not finite, and for what is refused.
        """
        commanded, size = torque_of(force), float(np.linalg.norm(force))
        if not np.isfinite(commanded).all():
            raise WatchdogError(f"the inner loop commands {commanded.tolist()} {self._unit}")
        # By what factor each limit is passed; 1 is at the limit.
        excess_force = size / self._wiring.force_limit
        excess_torque = float(np.max(np.abs(commanded) / self._limits))
        self.largest_force = max(self.largest_force, size)
        self.largest_torque = max(self.largest_torque, float(np.max(np.abs(commanded))))
        if max(excess_force, excess_torque) > 1.0:
            self._refuse(size, commanded)
        share = 1.0 / max(1.0, excess_force)
        if resumed and size > FELT_FORCE:
            self._grown = 0
        if self._grown < self._growth:
            share *= self._grown / self._growth
            self._grown += 1
            self.started += 1
        torque = commanded if share == 1.0 else torque_of(share * force)
        # The motors' limits are asked of what the limited force needs: of (2.11) a part of it does not scale with that.
        excess = max(1.0, float(np.max(np.abs(torque) / self._limits)))
        self.scaled += excess_force > 1.0 or excess > 1.0
        # Clipped besides: of the division's rounding nothing goes to the motors.
        return Sent(commanded, np.clip(torque / excess, -self._limits, self._limits), force * (share / excess))

    def describe(self) -> str:
        """Describe what was taken away, a line each for limits and soft start; empty where nothing was."""
        lines = []
        if self.scaled:
            lines.append(
                f"limits scaled the force in {self.scaled} cycles: {self.largest_force:.3g} N and "
                f"{self.largest_torque:.3g} {self._unit} were asked for at the most, {self._allowed} are allowed"
            )
        if self.started:
            lines.append(f"the soft start scaled the force in {self.started} cycles: it was there at once")
        return "\n".join(lines)

    @property
    def _unit(self) -> str:
        return "N m" if self._wiring.device.turning else "N"

    @property
    def _allowed(self) -> str:
        motors = " and ".join(f"{limit:g}" for limit in dict.fromkeys(self._wiring.torque_limit))
        return f"{self._wiring.force_limit:g} N at the hand and {motors} {self._unit} of a motor"

    def _refuse(self, size: float, commanded: Array) -> None:
        if self._refusing:
            torques = ", ".join(f"{torque:.3g}" for torque in commanded)
            raise WatchdogError(
                f"the renderer asks for {size:.3g} N and torques of ({torques}) {self._unit}",
                why=f"{self._allowed} are allowed",
                todo="a start outside of the model, a lower stiffness, the motors' own torque_limit in the wiring, or "
                "no --refuse-above: what is above a limit is scaled then",
            )


class Watchdog:
    """Doubts readings, one after the other, of a robot that is wired so and moves by `kinematics`."""

    def __init__(self, wiring: Wiring, kinematics: Kinematics) -> None:
        self._wiring, self._kinematics = wiring, kinematics
        self._before: Array | None = None

    def check_joints(self, joints: Array) -> None:
        """Raise `WatchdogError`, naming the limit, for joints (N,), rad, outside of the workspace."""
        try:
            self._kinematics.check(joints)
        except DomainError as error:
            raise WatchdogError(f"a reading is off the workspace: {error.what}", why=error.why) from error

    def check_hand(self, hip: Array, elapsed: float) -> None:
        """Raise `WatchdogError` for a hand that jumped to `hip` (N,), m, in the `elapsed` s since the reading before.

        A count of each encoder is granted besides: a coarse one steps faster than the robot.
        """
        if self._before is not None:
            moved = float(np.linalg.norm(hip - self._before))
            counts = 0.0 if self._wiring.counts_per_turn is None else self._wiring.step * self._kinematics.reach()
            if not moved <= self._wiring.speed_limit * elapsed + counts:
                raise WatchdogError(
                    f"the hand jumped by {1e3 * moved:.3g} mm in {1e3 * elapsed:.3g} ms, to {in_mm(hip)}",
                    why=f"{moved / elapsed:.3g} m/s are more than its speed_limit of {self._wiring.speed_limit:g} m/s",
                    todo="see the encoders and their cables, and the way from the robot",
                )
        self._before = hip
