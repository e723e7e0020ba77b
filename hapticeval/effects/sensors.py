"""What sensors show of the hand: encoders' counts, velocities from differences, force sensors (thesis 2.6, A.1, (8.6)).

A controller sees joint positions in whole counts; where nothing measures velocity it takes differences; and a sensor at
the handle measures the hand's force, which inner loops and renderers then use.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hapticeval.effects.effect import Effect, Part, Stage, number
from hapticeval.errors import InputError
from hapticeval.quantity import format_quantity
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.devices.device import Device


@dataclass(frozen=True)
class Encoder(Effect):
    """Round each joint position to the nearest multiple of `step` (rad, or m for the point mass).

    `counts` per turn may be given instead, for joints that turn. Raises `InputError` where both are given, or neither.
    """

    step: float | None = number("position", default=None, short="encoder_step")
    counts: float | None = number("", default=None, compare=False, short="encoder_counts")

    kind: ClassVar[str] = "encoder"
    stage: ClassVar[Stage] = Stage.SENSE
    channels: ClassVar[tuple[str, ...]] = ("measured_hip", "measured_velocity")
    linear: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.step is None) == (self.counts is None):
            how = "neither" if self.step is None else "both"
            raise InputError(f"{how} encoder_counts and encoder_step are given", todo="give one of them")
        if self.counts is not None:
            object.__setattr__(self, "step", 2.0 * math.pi / self.counts)

    def check(self, device: Device) -> None:
        """Refuse counts per turn for a device that does not turn."""
        if self.counts is not None and not device.turning:
            raise InputError(
                f"encoder_counts = {self.counts!r} for a point mass",
                why="counts are of a turn, and its joints are its position in metres",
                todo="give encoder_step (m), or a device with joints that turn",
            )

    def part(self, ticks: int, size: int, dt: float) -> Part:  # noqa: ARG002 - as every effect
        """Assemble the rounding: `params` is the step."""
        return Part(round_to_counts, np.array([self.step]))

    def describe(self, *, turning: bool) -> str:
        """Describe the step, and the counts per turn it is."""
        assert self.step is not None
        counts = f" ({2.0 * math.pi / self.step:,.0f} counts a turn)" if turning else ""
        return f"encoders of {format_quantity(self.step, 'rad' if turning else 'm')} a count{counts}"


def round_to_counts(
    params: Array, samples: Array, state: Array, tick: int, dt: float, joints: Array, rates: Array  # noqa: ARG001
) -> float:  # fmt: skip
    """Round `joints` (N,), rad or m, to whole counts of the encoder: multiples of its step, `params` (1,)."""
    for i in range(joints.shape[0]):
        joints[i] = params[0] * float(np.rint(joints[i] / params[0]))
    return 0.0


def low_pass_share(cutoff: float, dt: float) -> float:
    """Return the share of the new value that a low-pass of `cutoff` (Hz) takes in a tick of `dt` s; 1 for inf."""
    return -math.expm1(-2.0 * math.pi * cutoff * dt)


@dataclass(frozen=True)
class VelocityFilter(Effect):
    """Take joint rates from differences of the sampled positions, through a first-order low-pass of `cutoff` (Hz).

    v⁺ = v + (1 - e^{-2π f dt}) (Δq/dt - v), from the true velocity on, as if the device had moved so before.
    """

    cutoff: float = number("Hz", short="velocity_cutoff")

    kind: ClassVar[str] = "velocity-filter"
    stage: ClassVar[Stage] = Stage.SENSE
    channels: ClassVar[tuple[str, ...]] = ("measured_velocity",)
    words: ClassVar[str] = "velocity from differences, low-passed at {cutoff}"

    def part(self, ticks: int, size: int, dt: float) -> Part:  # noqa: ARG002 - as every effect
        """Assemble the filter: `params` is its blend, `state` (2, N) the last positions and rates."""
        return Part(filtered_difference, np.array([low_pass_share(self.cutoff, dt)]), state=np.zeros((2, size)))

    def active(self, damping: float) -> str | None:
        """Return why it gives energy away where a damper acts on the filtered velocity; None without damping."""
        return "a damper on a filtered velocity is late, and so gives energy away" if damping > 0.0 else None


def filtered_difference(
    params: Array, samples: Array, state: Array, tick: int, dt: float, joints: Array, rates: Array  # noqa: ARG001
) -> float:  # fmt: skip
    """Replace joint `rates` (N,), rad/s or m/s, by the low-passed difference of joint positions (N,), rad or m.

    `params` (1,) is the low-pass's share of a new value; `state` (2, N) the positions and rates of the last sample.
    """
    for i in range(joints.shape[0]):
        if tick > 0:  # there is no difference at the first sample: it keeps the true rate
            rates[i] = state[1, i] + params[0] * ((joints[i] - state[0, i]) / dt - state[1, i])
        state[0, i], state[1, i] = joints[i], rates[i]
    return 0.0


@dataclass(frozen=True)
class ForceSensor(Effect):
    """Filter the hand's force with a first-order low-pass, add noise to each sample, and round.

    `step` (N, 0 = none) is its quantum, `noise` (N) the standard deviation of each sample, `cutoff` (Hz, inf = none)
    that of the low-pass; `seed` of the noise.
    """

    step: float = number("N", zero=True, default=0.0)
    noise: float = number("N", zero=True, default=0.0)
    cutoff: float = number("Hz", finite=False, default=math.inf)
    seed: int = number("", zero=True, default=0)

    kind: ClassVar[str] = "force-sensor"
    stage: ClassVar[Stage] = Stage.FEEL
    channels: ClassVar[tuple[str, ...]] = ("measured_force",)

    def part(self, ticks: int, size: int, dt: float) -> Part:
        """Assemble the sensor: `params` are step and blend, `samples` the noise, `state` (1, N) the filtered force."""
        noise = self.noise * np.random.default_rng(self.seed).standard_normal((ticks, size))
        return Part(measure_force, np.array([self.step, low_pass_share(self.cutoff, dt)]), noise, np.zeros((1, size)))

    def describe(self, *, turning: bool) -> str:  # noqa: ARG002 - as every effect
        """Describe what of it is not ideal."""
        imperfections = [
            f"{word} {format_quantity(size, 'N')}"
            for word, size in (("quantum", self.step), ("noise", self.noise))
            if size
        ]
        if math.isfinite(self.cutoff):
            imperfections.append(f"low-passed at {format_quantity(self.cutoff, 'Hz')}")
        return "force sensor" + (f" ({', '.join(imperfections)})" if imperfections else ", ideal")


def measure_force(
    params: Array, samples: Array, state: Array, tick: int, dt: float, force: Array, unused: Array  # noqa: ARG001
) -> float:  # fmt: skip
    """Replace the hand's `force` (N,), N, by what a sensor gives of it: low-passed, with noise, and rounded.

    `params` (2,) are the quantum (N) and the low-pass's share of a new value; `samples` (ticks, N) the noise, N;
    `state` (1, N) the filtered force, N.
    """
    for i in range(force.shape[0]):
        # the filter starts at the first force, as if it had always been that
        state[0, i] = force[i] if tick == 0 else state[0, i] + params[1] * (force[i] - state[0, i])
        force[i] = state[0, i] + samples[tick, i]
        if params[0] > 0.0:
            force[i] = params[0] * float(np.rint(force[i] / params[0]))
    return 0.0
