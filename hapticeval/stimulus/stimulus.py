"""What a renderer is given: a path that the hand is led along, or an experiment in which the hand pushes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.motion import Motion
from hapticeval.recordings.recording import check_finite, check_increasing
from hapticeval.types import Array

MOST_TICKS = 50_000_000
"""Samples of a run, *chosen*: fourteen hours at 1 kHz. Twice as many take twice the memory, 64 bytes each or more."""


def sample_times(duration: float, dt: float) -> Array:
    """Return times (n,), s, from 0 in steps of `dt` up to `duration` (s), which counts as reached within rounding.

    Raises `InputError` for more than `MOST_TICKS`.
    """
    check_duration(duration, dt)
    # the tolerance counts an end that is missed by rounding alone
    return np.arange(int(np.floor(duration / dt * (1.0 + 1e-12))) + 1, dtype=np.float64) * dt


def check_duration(duration: float, dt: float) -> None:
    """Raise `InputError` where a `duration` (s) in steps of `dt` (s) is more than `MOST_TICKS`."""
    if not duration / dt <= MOST_TICKS:
        raise InputError(
            f"{duration:g} s in steps of {dt:g} s are {duration / dt:.3g} samples",
            why=f"a run has {MOST_TICKS:,} at the most",
            todo="choose a shorter duration, or a longer sampling time",
        )


@dataclass(frozen=True)
class Path:
    """HIP positions against time, straight between the given points: `time` (n,), s; `points` (n, N), m.

    The open loop of Figure 6.1 ("playback"). Raises `InputError`, naming the row, for a time base that does not
    increase and for numbers that are not finite.
    """

    time: Array
    points: Array

    def __post_init__(self) -> None:
        time = np.array(self.time, dtype=np.float64)
        points = np.array(self.points, dtype=np.float64)
        if time.ndim != 1 or points.ndim != 2 or points.shape[0] != time.size or time.size < 2:
            raise InputError(
                f"a trajectory has times of shape {time.shape} and positions of shape {points.shape}",
                why="it needs at least two rows, a time and a position each",
            )
        check_finite("trajectory time", time)
        check_finite("trajectory position", points)
        check_increasing("trajectory time", time)
        # a path is a value: others hold it
        time.flags.writeable = False
        points.flags.writeable = False
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "points", points)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.points.shape[1])

    @property
    def duration(self) -> float:
        """Seconds from the first point to the last."""
        return float(self.time[-1] - self.time[0])

    def sampled(self, dt: float) -> tuple[Array, Array]:
        """Return times from 0 in steps of `dt` (n,), s, and the positions there (n, N), m.

        Sampling at dt / 2 keeps every sample of dt, so that refined runs can be compared point by point.
        """
        time = sample_times(self.duration, dt)
        since = self.time - self.time[0]
        points = np.column_stack([np.interp(time, since, column) for column in self.points.T])
        return time, points

    def reversed(self) -> Path:
        """Return the path through the same points in the opposite order, at the same speed."""
        return Path(self.time[-1] - self.time[::-1], self.points[::-1])


@dataclass(frozen=True, kw_only=True)
class Hand:
    """An operator who draws the tool along a desired path: F_o = k (y_d - y) + b (ẏ_d - ẏ).

    `stiffness` k (N/m) and `damping` b (N s/m) of the grip; `path` is y_d(t) from time 0 on, held after its end. With
    the path at rest it is passive: it never gives more energy than it took.
    """

    path: Path
    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("stiffness", "N/m"), ("damping", "N s/m")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise InputError(
                    f"the hand's {name} = {value!r} {unit}",
                    why="it must be finite and not negative: a hand that drives is not passive",
                )

    def desired(self, time: Array) -> Array:
        """Return where the hand would have the tool, y_d (n, N), m, at each of `time` (n,), s, from its start on."""
        since = self.path.time - self.path.time[0]
        return np.ascontiguousarray(np.column_stack([np.interp(time, since, column) for column in self.path.points.T]))

    def at_speed(self, factor: float) -> Hand:
        """Return the same hand along its path at `factor` times the pace."""
        path = Path(self.path.time / factor, self.path.points)
        return Hand(path=path, stiffness=self.stiffness, damping=self.damping)


PHASE_EVENT = "phase"
"""The kind of the event that a phase of an experiment begins with."""


@dataclass(frozen=True)
class Experiment:
    """A closed loop (Figure 6.17): the tool starts somewhere with a velocity, and the operator pushes.

    `position` (N,), m; `velocity` (N,), m/s; `force_time` (k,), s and `force` (k, N), N: the operator's force,
    straight between the given rows and held before the first and after the last; `duration`, s. A `hand` adds its
    force to that. `phases` name what happens from a time (s) on, for who reads the recording.
    """

    duration: float
    position: Array
    velocity: Array
    force_time: Array
    force: Array
    hand: Hand | None = None
    phases: tuple[tuple[float, str], ...] = ()

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "force_time", "force"):
            array = np.array(getattr(self, name), dtype=np.float64)
            check_finite(f"experiment {name}", array)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if not (np.isfinite(self.duration) and self.duration > 0.0):
            raise InputError(f"an experiment lasts {self.duration!r} s", todo="give a positive duration")
        check_increasing("experiment force time", self.force_time)
        # all of one dimension N: a point, a velocity, and the columns of the force
        shapes = (self.position.shape, self.velocity.shape, self.force.shape[1:])
        if self.force.ndim != 2 or len(set(shapes)) != 1 or self.force.shape[0] != self.force_time.size:
            raise InputError(
                f"an experiment has position, velocity and force of shapes {shapes}, "
                f"with {self.force_time.size} force times",
                why="all three need the same dimension, and a force row a time",
            )
        if self.hand is not None and self.hand.path.dimension != self.dimension:
            raise InputError(
                f"the hand's path is in {self.hand.path.dimension}D, the experiment in {self.dimension}D",
                why="hand and tool move in the same space",
            )

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.position.size)

    def operator_force(self, time: Array) -> Array:
        """Return the operator's prescribed force (n, N), N, at each of `time` (n,), s: without the hand's spring."""
        return np.column_stack([np.interp(time, self.force_time, column) for column in self.force.T])

    @property
    def quiet_from(self) -> float:
        """The time (s) from when on the operator's push and the place that the hand draws to stay the same."""
        ends = [_still_from(self.force_time, self.force)]
        if self.hand is not None:
            path = self.hand.path
            ends.append(_still_from(path.time - path.time[0], path.points))
        return max(ends)

    def moved(self, motion: Motion, nudge: Array) -> Experiment:
        """Return the same experiment in the scene moved, with tool and hand off by `nudge` (N,), m.

        `motion` keeps lengths.
        """
        hand = self.hand
        if hand is not None:
            path = Path(hand.path.time, motion(hand.path.points + nudge))
            hand = Hand(path=path, stiffness=hand.stiffness, damping=hand.damping)
        # positions move, velocities and forces only turn
        position = motion(self.position + nudge)
        return replace(
            self, position=position, velocity=motion.turned(self.velocity), force=motion.turned(self.force), hand=hand
        )

    def at_speed(self, factor: float) -> Experiment:
        """Return the same experiment at `factor` times the pace: started faster, pushed and ended sooner."""
        return Experiment(
            self.duration / factor,
            self.position,
            # lengths and forces stay, times shrink
            self.velocity * factor,
            self.force_time / factor,
            self.force,
            None if self.hand is None else self.hand.at_speed(factor),
        )


def _still_from(time: Array, values: Array) -> float:
    """Return the time, s, of the first of the equal rows at the end, from 0 on."""
    moving = np.flatnonzero(np.any(values != values[-1], axis=1))
    # the row after the last that differs from the end
    return max(0.0, float(time[moving[-1] + 1])) if moving.size else 0.0


Stimulus: TypeAlias = Path | Experiment
