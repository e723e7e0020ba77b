"""The channels of one run against time: the one type that checks read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.channels import CHANNELS, REQUIRED, Signal, declared
from hapticeval.recordings.clock import Clock
from hapticeval.recordings.events import Event, among, checked
from hapticeval.recordings.metadata import check_metadata
from hapticeval.recordings.rows import backward_difference, check_finite, check_increasing, locked, runs_of
from hapticeval.types import Array, BoolArray, IntArray

__all__ = [
    "CHANNELS",
    "REQUIRED",
    "SINGLE",
    "Clock",
    "Event",
    "MissingChannelError",
    "Recording",
    "Signal",
    "among",
    "backward_difference",
    "check_finite",
    "check_increasing",
]

SINGLE = 2.0**-23
"""Spacing of single-precision numbers around 1: what the coarsest honest renderer computes with."""


class MissingChannelError(InputError):
    """A recording lacks the `channel` that is asked for."""

    channel: str = ""


@dataclass(frozen=True, eq=False)
class Recording:
    """One run, simulated or real: a time base and channels, SI units; arrays are read-only.

    `time` (n,), s, and `channels`: those of frame `world` are (n, N) with N = 1, 2 or 3, those of frame `joint`
    (n, J) with a column a joint, those of the other frames (n,) or (n, k). What the names mean stands in `CHANNELS`;
    any other channel is declared in `signals`, which may also state the sign convention of a known one. No channel
    has to be there: hardware may know no IHIP or no force. What checks read is `REQUIRED`; see `require`.

    `clock` has the stamps of a real run, of which `time` is made: see `Recording.clocked`. `valid` (n,) is False
    where a row is no measurement: its numbers are kept as they came, NaN too, and are never judged; None where every
    row is sound. `events` are in no particular order.

    `meta` says what cannot be read off the channels: see `METADATA`. Tables in it are copied.

    Raises `InputError`, naming channel and row, for a time base that does not increase, a shape that does not
    fit, a channel nobody declared, or a number that is not finite; rows that are not valid are exempt.
    """

    time: Array
    channels: Mapping[str, Array]
    meta: Mapping[str, Any] = field(default_factory=dict)
    clock: Clock | None = field(default=None, kw_only=True)
    valid: BoolArray | None = field(default=None, kw_only=True)
    signals: Mapping[str, Signal] = field(default_factory=dict, kw_only=True)
    events: tuple[Event, ...] = field(default=(), kw_only=True)

    @classmethod
    def clocked(
        cls,
        clock: Clock,
        channels: Mapping[str, Array],
        meta: Mapping[str, Any] | None = None,
        *,
        valid: BoolArray | None = None,
        signals: Mapping[str, Signal] | None = None,
        events: Iterable[Event] = (),
    ) -> Recording:
        """A recording whose `time` is what `clock` says."""
        return cls(
            clock.seconds,
            channels,
            meta or {},
            clock=clock,
            valid=valid,
            signals=signals or {},
            events=tuple(events),
        )

    def __post_init__(self) -> None:
        time = locked(self.time, np.float64)
        if time.ndim != 1 or time.size == 0:
            raise InputError(
                f"a recording needs a time base of shape (n,), got {time.shape}", todo="give one time a row"
            )
        valid = _mask(self.valid, time.size)
        check_finite("time", time, valid)
        self._check_clock(time, valid)
        check_increasing("time", time, valid)
        signals = {name: declared(name, self.signals) for name in self.channels}
        unused = [name for name in self.signals if name not in self.channels]
        if unused:
            raise InputError(f"a signal '{unused[0]}' is declared, but there is no such channel")
        channels = {}
        columns: dict[str, tuple[str, int]] = {}
        for name, values in self.channels.items():
            array = locked(values, np.float64)
            _check_shape(name, array, signals[name].frame, time.size, columns)
            check_finite(name, array, valid)
            channels[name] = array
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "channels", MappingProxyType(channels))
        object.__setattr__(self, "meta", MappingProxyType(check_metadata(self.meta)))
        object.__setattr__(self, "valid", valid)
        object.__setattr__(self, "signals", MappingProxyType(signals))
        object.__setattr__(self, "events", tuple(checked(event) for event in self.events))

    def _check_clock(self, time: Array, valid: BoolArray | None) -> None:
        if self.clock is None:
            return
        if self.clock.seconds is not time and not np.array_equal(self.clock.seconds, time):
            raise InputError(
                "a recording's time and its clock differ",
                why="time is what the clock says, and nothing re-times it",
                todo="make it with Recording.clocked(clock, channels)",
            )
        check_increasing("the clock", self.clock.nanoseconds, valid, unit="ns")
        if self.clock.sequence is not None:
            check_increasing("the sequence number", self.clock.sequence, valid, unit="")

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuilt, (
            self.time,
            dict(self.channels),
            dict(self.meta),
            self.clock,
            self.valid,
            dict(self.signals),
            self.events,
        )

    def __len__(self) -> int:
        return int(self.time.size)

    def part(self, rows: slice) -> Recording:
        """Some of the rows, one after the other, on the same time base, with the events that fall among them.

        Events before the first row of all, and after the last, stay with those rows.
        """
        begin, end, step = rows.indices(len(self))
        if step != 1 or begin >= end:
            raise InputError(f"no rows of a recording of {len(self)}: {rows}", todo="give rows that follow each other")
        since = -np.inf if begin == 0 else float(self.time[begin])
        until = np.inf if end == len(self) else float(self.time[end])
        rows = slice(begin, end)
        return Recording(
            self.time[rows],
            {name: values[rows] for name, values in self.channels.items()},
            self.meta,
            clock=None if self.clock is None else self.clock.part(rows),
            valid=None if self.valid is None else self.valid[rows],
            signals=self.signals,
            events=among(self.events, since, until),
        )

    @property
    def measured(self) -> BoolArray:
        """Which rows are valid, (n,): all of them where none is marked."""
        return np.ones(len(self), dtype=bool) if self.valid is None else self.valid

    def sound_rows(self) -> tuple[slice, ...]:
        """The stretches of rows that are valid, each as long as it goes."""
        if self.valid is None:
            return (slice(0, len(self)),)
        return tuple(slice(first, end) for first, end in runs_of(self.valid))

    def require(self, *names: str) -> None:
        """Raise `MissingChannelError` for the first of these channels that was not recorded."""
        for name in names:
            if name not in self.channels:
                error = MissingChannelError(
                    f"the recording lacks the channel '{name}'",
                    why=f"it has: {', '.join(self.channels) or 'none'}",
                    todo="map a column to it; where the device does not know it, choose checks that do without it",
                )
                error.channel = name
                raise error

    def channel(self, name: str) -> Array:
        """The channel `name`. Raises `MissingChannelError` where it was not recorded."""
        self.require(name)
        return self.channels[name]

    @property
    def dimension(self) -> int:
        """N, the columns of the channels in the world's frame; 0 where there is none."""
        for name, values in self.channels.items():
            if self.signals[name].frame == "world":
                return int(values.shape[1])
        return 0

    @property
    def hip(self) -> Array:
        """Haptic interface point, (n, N), m; as it came, NaN too, where `valid` is False."""
        return self.channel("hip")

    @property
    def ihip(self) -> Array:
        """Ideal haptic interface point, (n, N), m."""
        return self.channel("ihip")

    @property
    def force(self) -> Array:
        """Force on the hand, (n, N), N; `force[k]` acts from time[k] to time[k + 1]."""
        return self.channel("force")

    @property
    def velocity(self) -> Array:
        """Velocity of the HIP, (n, N), m/s; the difference backwards in time where it was not recorded.

        Raises `InputError` where it would be differenced across rows that are not valid.
        """
        if "velocity" in self.channels:
            return self.channels["velocity"]
        if self.valid is not None:
            raise InputError(
                "a recording with gaps has no velocity, since none was recorded",
                why="a difference across a gap is no velocity",
                todo="take its sound stretches: part(rows) of each sound_rows()",
            )
        return backward_difference(self.hip, self.time)

    @property
    def nanoseconds(self) -> IntArray:
        """Stamps, (n,), ns: the clock's, or `time` in whole nanoseconds where no clock was read."""
        if self.clock is not None:
            return self.clock.nanoseconds
        return np.rint(1e9 * self.time).astype(np.int64)

    @property
    def dt(self) -> float:
        """Median sampling time, s."""
        time = self.time if self.valid is None else self.time[self.valid]
        if time.size < 2:
            return float(self.meta.get("dt", 1e-3))
        return float(np.median(np.diff(time)))

    @property
    def contact(self) -> BoolArray:
        """Where the tool touches: a force is felt or the IHIP is not the HIP; shape (n,), False where not valid.

        Where one of the two was not recorded, the other tells alone. The HIP in single precision is still the HIP: a
        renderer may compute and answer so. Raises `MissingChannelError` where neither was recorded.
        """
        touches = np.zeros(len(self), dtype=bool)
        if "ihip" in self.channels or "force" not in self.channels:
            touches |= self.apart
        if "force" in self.channels:
            touches |= np.any(self.force != 0.0, axis=1)
        return touches & self.measured

    @property
    def apart(self) -> BoolArray:
        """Where the IHIP is not the HIP, beyond single precision: (n,)."""
        sound = self.hip if self.valid is None else self.hip[self.valid]
        rounding = 4.0 * SINGLE * float(np.max(np.abs(sound), initial=0.0))
        apart: BoolArray = np.linalg.norm(self.ihip - self.hip, axis=1) > rounding
        return apart

    @property
    def resolution(self) -> float:
        """Length of surface over which the renderer's representation is blurred, m."""
        return float(self.meta.get("resolution", 0.0))

    @property
    def standoff(self) -> float:
        """How far the renderer declares that its surface may lie off the model, m."""
        return float(self.meta.get("standoff", 0.0))


def _rebuilt(
    time: Array,
    channels: Mapping[str, Array],
    meta: Mapping[str, Any],
    clock: Clock | None,
    valid: BoolArray | None,
    signals: Mapping[str, Signal],
    events: tuple[Event, ...],
) -> Recording:
    return Recording(time, channels, meta, clock=clock, valid=valid, signals=signals, events=events)


def _mask(given: Any, count: int) -> BoolArray | None:
    if given is None:
        return None
    mask = np.asarray(given)
    if mask.dtype != np.bool_ or mask.shape != (count,):
        raise InputError(
            f"valid is of type {mask.dtype} and shape {mask.shape}",
            why=f"it says true or false of each of {count} rows",
        )
    return None if mask.all() else locked(mask, np.bool_)


def _check_shape(name: str, array: Array, frame: str, count: int, columns: dict[str, tuple[str, int]]) -> None:
    if array.shape[:1] != (count,) or array.ndim > 2 or 0 in array.shape:
        raise InputError(
            f"channel '{name}' has shape {array.shape}, not ({count},) or ({count}, columns)",
            why="every channel has a row a sample",
        )
    if frame not in ("world", "joint"):
        return
    first, width = columns.setdefault(frame, (name, array.shape[-1] if array.ndim == 2 else 1))
    if array.shape != (count, width):
        raise InputError(
            f"channel '{name}' has shape {array.shape}, not {(count, width)}",
            why=f"channels in the {frame} frame have a column a {'joint' if frame == 'joint' else 'dimension'}, "
            f"as '{first}' has",
        )
    if frame == "world" and width > 3:
        raise InputError(f"channel '{name}' has {width} dimensions", why="the world has one, two or three")
