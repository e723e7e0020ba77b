"""The channels of one run against time: the one type that checks read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.types import Array, BoolArray

CHANNELS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "hip": ("m", "haptic interface point: where the hand is"),
        "ihip": ("m", "ideal haptic interface point: the virtual tool; equals hip in free space"),
        "force": ("N", "force on the hand, held (or its mean) from this sample to the next"),
        "velocity": ("m/s", "velocity of the HIP"),
        "operator_force": ("N", "force of the hand on the tool"),
        "measured_hip": ("m", "HIP as the sensors gave it to the renderer; absent where they are exact"),
        "measured_velocity": ("m/s", "velocity of the HIP as the renderer was given it; absent where it is exact"),
        "measured_force": ("N", "force of the hand as the force sensor gave it"),
        "joint_position": ("rad", "joint angles of the device"),
        "joint_velocity": ("rad/s", "joint velocities of the device"),
        "joint_torque": ("N m", "torque that the motors really give, held from this sample to the next"),
    }
)
"""Every channel that a recording may have, with its unit and meaning. The first three are always there."""

REQUIRED = ("hip", "ihip", "force")

SINGLE = 2.0**-23
"""Spacing of single-precision numbers around 1: what the coarsest honest renderer computes with."""


@dataclass(frozen=True)
class Recording:
    """One run: a time base and channels of shape (n, N), SI units, N = 2 or 3; arrays are read-only.

    `meta` says what cannot be read off the channels: renderer, case, `source` ("playback", "experiment" or
    "file"), `dt`, and what the renderer declares of itself: `resolution` (m, the length of surface over which
    its representation is blurred: edge or cell; 0 where it is exact) and `standoff` (m, how far its surface may
    lie off the model).

    Raises `InputError`, naming channel and row, for a time base that does not increase, a shape that does not
    fit, a missing channel, or a number that is not finite.
    """

    time: Array
    channels: Mapping[str, Array]
    meta: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        time = np.array(self.time, dtype=np.float64)
        if time.ndim != 1 or time.size == 0:
            raise InputError(
                f"a recording needs a time base of shape (n,), got {time.shape}", todo="give one time a row"
            )
        check_finite("time", time)
        check_increasing("time", time)
        missing = [name for name in REQUIRED if name not in self.channels]
        if missing:
            raise InputError(
                f"a recording lacks the channel '{missing[0]}'",
                why=f"hip, ihip and force are what every check reads; given: {', '.join(self.channels)}",
                todo="map a column to it, or say that the renderer has none",
            )
        unknown = [name for name in self.channels if name not in CHANNELS]
        if unknown:
            raise InputError(
                f"a recording does not know the channel '{unknown[0]}'",
                todo=f"use one of: {', '.join(CHANNELS)}",
            )
        dimension = np.shape(self.channels["hip"])[-1]
        channels = {}
        for name, values in self.channels.items():
            array = np.array(values, dtype=np.float64)
            if array.shape != (time.size, dimension):
                raise InputError(
                    f"channel '{name}' has shape {array.shape}, not {(time.size, dimension)}",
                    why="every channel has a row a sample and a column a dimension",
                )
            check_finite(name, array)
            array.flags.writeable = False
            channels[name] = array
        time.flags.writeable = False
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "channels", MappingProxyType(channels))
        object.__setattr__(self, "meta", MappingProxyType(dict(self.meta)))

    def __reduce__(self) -> tuple[object, ...]:
        return Recording, (self.time, dict(self.channels), dict(self.meta))

    def __len__(self) -> int:
        return int(self.time.size)

    @property
    def hip(self) -> Array:
        """Haptic interface point, (n, N), m."""
        return self.channels["hip"]

    @property
    def ihip(self) -> Array:
        """Ideal haptic interface point, (n, N), m."""
        return self.channels["ihip"]

    @property
    def force(self) -> Array:
        """Force on the hand, (n, N), N; `force[k]` acts from time[k] to time[k + 1]."""
        return self.channels["force"]

    @property
    def velocity(self) -> Array:
        """Velocity of the HIP, (n, N), m/s; the difference backwards in time where it was not recorded."""
        if "velocity" in self.channels:
            return self.channels["velocity"]
        return backward_difference(self.hip, self.time)

    @property
    def dt(self) -> float:
        """Median sampling time, s."""
        if self.time.size < 2:
            return float(self.meta.get("dt", 1e-3))
        return float(np.median(np.diff(self.time)))

    @property
    def contact(self) -> BoolArray:
        """Where the tool touches: a force is felt or the IHIP is not the HIP; shape (n,).

        The HIP in single precision is still the HIP: a renderer may compute and answer so.
        """
        rounding = 4.0 * SINGLE * float(np.max(np.abs(self.hip)))
        apart = np.linalg.norm(self.ihip - self.hip, axis=1) > rounding
        touches: BoolArray = apart | np.any(self.force != 0.0, axis=1)
        return touches

    @property
    def resolution(self) -> float:
        """Length of surface over which the renderer's representation is blurred, m."""
        return float(self.meta.get("resolution", 0.0))

    @property
    def standoff(self) -> float:
        """How far the renderer declares that its surface may lie off the model, m."""
        return float(self.meta.get("standoff", 0.0))


def backward_difference(values: Array, time: Array) -> Array:
    """The causal derivative: (x[k] - x[k-1]) / (t[k] - t[k-1]), and zero at the first sample."""
    out = np.zeros_like(values)
    out[1:] = np.diff(values, axis=0) / np.diff(time)[:, None]
    return out


def check_finite(name: str, values: Array) -> None:
    """Raise `InputError` with the first row of `values` that is not finite."""
    bad = ~np.isfinite(values)
    if bad.any():
        row = int(np.argmax(bad.any(axis=-1) if values.ndim > 1 else bad))
        raise InputError(
            f"{name} is not finite at row {row}: {np.array2string(np.atleast_1d(values[row]))}",
            why="a missing or infinite number cannot be judged and must not spread",
            todo="mend or cut that row",
        )


def check_increasing(name: str, values: Array) -> None:
    """Raise `InputError` with the first row at which `values` does not increase."""
    steps = np.diff(values)
    if steps.size and not np.all(steps > 0.0):
        row = int(np.argmax(steps <= 0.0)) + 1
        raise InputError(
            f"{name} does not increase at row {row}: {values[row - 1]:.9g} s, then {values[row]:.9g} s",
            why="samples must be in the order in which they happened, each at a time of its own",
            todo="sort the rows, or drop the repeated ones",
        )
