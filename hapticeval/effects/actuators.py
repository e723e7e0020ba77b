"""What becomes of a torque that is asked for: motors saturate and are late, and joints rub (thesis 2.6, A.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hapticeval.effects.effect import Effect, Part, Stage, number
from hapticeval.quantity import format_quantity
from hapticeval.types import Array


@dataclass(frozen=True)
class Saturation(Effect):
    """Limit the torque of each motor to ± `limit` (N m; N for the point mass)."""

    limit: float = number("force", short="torque_limit")

    kind: ClassVar[str] = "saturation"
    stage: ClassVar[Stage] = Stage.COMMAND
    linear: ClassVar[bool] = False
    words: ClassVar[str] = "motors saturate at {limit}"

    def part(self, ticks: int, size: int, dt: float) -> Part:  # noqa: ARG002 - as every effect
        """Assemble the limit: `params`."""
        return Part(clip_torque, np.array([self.limit]))


def clip_torque(
    params: Array, samples: Array, state: Array, tick: int, dt: float, torque: Array, before: Array  # noqa: ARG001
) -> float:  # fmt: skip
    """Clip each motor's `torque` (N,), N m (N for the point mass), to ± the limit, `params` (1,)."""
    for i in range(torque.shape[0]):
        torque[i] = min(max(torque[i], -params[0]), params[0])
    return 0.0


STEADY = 1e-9
"""A share of a tick below which a delay is a whole number of ticks: what rounding leaves of one."""


@dataclass(frozen=True)
class Delay(Effect):
    """Let the motors give a torque `time` (s) after its sample; until then, nothing."""

    time: float = number("s", zero=True, short="delay")

    kind: ClassVar[str] = "delay"
    stage: ClassVar[Stage] = Stage.COMMAND

    @property
    def off(self) -> bool:
        """Whether the delay is zero: it then changes nothing."""
        return self.time == 0.0

    @property
    def late(self) -> float:
        """The delay, s."""
        return self.time

    def part(self, ticks: int, size: int, dt: float) -> Part:  # noqa: ARG002 - as every effect
        """Assemble the line of torques: `params` are whole ticks and the seconds beyond them."""
        delay_in_ticks = self.time / dt
        whole_ticks = math.floor(delay_in_ticks + STEADY)
        part_of_tick = delay_in_ticks - whole_ticks
        return Part(
            hold_back,
            np.array([whole_ticks, part_of_tick * dt if part_of_tick > STEADY else 0.0]),
            state=np.zeros((whole_ticks + 2, size)),
        )

    def active(self, damping: float) -> str | None:  # noqa: ARG002 - as every effect
        """Return why it gives energy away, which it does with any renderer."""
        return "motors that are late give energy away at any sampling rate"

    def describe(self, *, turning: bool) -> str:  # noqa: ARG002 - as every effect
        """Describe the delay in milliseconds."""
        return f"torques {format_quantity(1e3 * self.time, 'ms')} late"


def hold_back(params: Array, samples: Array, state: Array, tick: int, dt: float, torque: Array, before: Array) -> float:  # noqa: ARG001
    """Delay torques by a line of past samples: what the motors get in this tick, and what they had until the switch.

    `torque` (N,), N m, is replaced by the former and `before` (N,) written with the latter. `params` (2,) are whole
    ticks and the seconds beyond them; `state` (whole ticks + 2, N) is the line. Returns the seconds into the tick at
    which the motors switch.
    """
    line_length, whole_ticks = state.shape[0], int(params[0])
    for i in range(torque.shape[0]):  # a ring: row tick % length was written `length` ticks ago, or is zero
        state[tick % line_length, i] = torque[i]
        before[i] = state[(tick - whole_ticks - 1) % line_length, i]
        torque[i] = state[(tick - whole_ticks) % line_length, i]
    return float(params[1])


@dataclass(frozen=True)
class JointFriction(Effect):
    """Oppose each moving joint with `torque` (N m; N for the point mass), and hold one at rest as long as that can."""

    torque: float = number("force", short="friction")

    kind: ClassVar[str] = "joint-friction"
    stage: ClassVar[Stage] = Stage.JOINTS
    linear: ClassVar[bool] = False
    words: ClassVar[str] = "Coulomb friction of {torque} in each joint"

    def part(self, ticks: int, size: int, dt: float) -> Part:  # noqa: ARG002 - as every effect
        """Assemble the friction of each joint: `params` (N,)."""
        return Part(None, np.full(size, self.torque))
