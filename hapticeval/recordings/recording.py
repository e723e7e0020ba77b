"""The channels of one run against time: the one type that checks read, with its clock and its events."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.channels import Signal, check_metadata, declared
from hapticeval.types import Array, BoolArray, IntArray

OWN_TOOL = "own_tool"
"""The entry of the metadata of what a renderer's own tool did in forces: its position answers no controller."""

SINGLE = 2.0**-23
"""Spacing of single-precision numbers around 1: what the coarsest honest renderer computes with."""

DOUBLE = 2.0**-52
"""Spacing of double-precision numbers around 1."""

SINGLE_ROUNDINGS = 4.0
"""Roundings of single precision by which what is made of rounded numbers may be off: see `phenomena.decisions`."""


def single_rounding(values: Array) -> float:
    """Return by how much what single precision makes of `values` (n,) or (n, N), m or N, may be off, in their unit."""
    return SINGLE_ROUNDINGS * SINGLE * float(np.max(np.abs(values), initial=0.0))


def locked(values: Any, dtype: Any) -> Any:
    """Return `values` as a read-only array: a copy, unless nobody can write to them any more."""
    if isinstance(values, np.ndarray) and values.dtype == dtype and not values.flags.writeable:
        # A read-only view of an array that is still writable elsewhere could change under us, and is copied.
        base = values.base
        if base is None or (isinstance(base, np.ndarray) and not base.flags.writeable):
            return values
    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def runs_of(mask: BoolArray) -> list[tuple[int, int]]:
    """Return the rows [first, end) over which `mask` (n,) holds, each run as long as it goes.

    Rows are indices, not times in s.
    """
    # +1 where a run begins and -1 where one has ended, with False at both sides.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def backward_difference(values: Array, time: Array) -> Array:
    """Return the causal derivative (n, N) of a channel: (x[k] - x[k-1]) / (t[k] - t[k-1]), zero at the first sample.

    `time` (n,) is in s: of positions in m it is a velocity in m/s.
    """
    # No sample comes before the first: its velocity is zero, as of a hand that starts at rest.
    out = np.zeros_like(values)
    out[1:] = np.diff(values, axis=0) / np.diff(time)[:, None]
    return out


def path_velocities(hips: Array, dt: float) -> Array:
    """Return the velocities (n, N), m/s, that single steps along HIPs (n, N), m, every `dt` (s), are given."""
    return backward_difference(hips, dt * np.arange(len(hips), dtype=np.float64))


def check_finite(name: str, values: Array, valid: BoolArray | None = None) -> None:
    """Raise `InputError` with the first row of a channel (n,) or (n, N) that is not finite.

    Only rows of the mask `valid` (n,) count, where there is one. The unit (s, m, N, ...) does not matter.
    """
    # One pass over all numbers first, since a sound channel needs no more.
    bad = ~np.isfinite(values)
    if not bad.any():
        return
    rows = bad.any(axis=-1) if values.ndim > 1 else np.atleast_1d(bad)
    if valid is not None:
        rows &= valid
    if rows.any():
        row = int(np.argmax(rows))
        raise InputError(
            f"{name} is not finite at row {row}: {np.array2string(np.atleast_1d(values[row]))}",
            why="a missing or infinite number cannot be judged and must not spread",
            todo="mend or cut that row",
        )


def check_increasing(name: str, values: Any, valid: BoolArray | None = None, *, unit: str = "s") -> None:
    """Raise `InputError` with the first row at which `values` (n,) does not increase, written in `unit` (s or ns).

    Only rows of the mask `valid` (n,) count, where there is one.
    """
    valid_values = values if valid is None else values[valid]
    # Strictly: a repeated stamp gives a step of zero, by which differences are divided.
    rises = valid_values[1:] > valid_values[:-1]
    if not rises.all():
        at = int(np.argmin(rises)) + 1
        row = at if valid is None else int(np.flatnonzero(valid)[at])
        pair = valid_values[at - 1 : at + 1].tolist()
        before, after = (f"{x:.9g} {unit}" if isinstance(x, float) else f"{x} {unit}".rstrip() for x in pair)
        raise InputError(
            f"{name} does not increase at row {row}: {before}, then {after}",
            why="samples must be in the order in which they happened, each at a time of its own",
            todo="sort the rows, or drop the repeated ones",
        )


class Event(NamedTuple):
    """Something that happened at `time` (s, on the recording's time base): a kind in one word, and a text."""

    time: float
    kind: str
    text: str = ""


def _event(fields: Any) -> Event:
    """Return an event of a time (s), a kind and a text. Raises `InputError` for anything else."""
    event = Event(*fields)
    when = isinstance(event.time, int | float | np.floating | np.integer) and np.isfinite(event.time)
    texts = isinstance(event.kind, str) and isinstance(event.text, str) and "\0" not in event.kind + event.text
    if not (when and texts and event.kind):
        raise InputError(f"an event {tuple(event)}", why="it is a finite time (s), a kind and a text")
    return Event(float(event.time), event.kind, event.text)


@dataclass(frozen=True, eq=False)
class Clock:
    """Stamps of a monotonic clock, (n,) int64 ns, one per sample; read-only.

    `start` is the stamp at which a recording's `time` is zero: the first row's, unless given. `anchor` is a stamp
    and the wall clock at the same instant, both ns, the latter since 1970 UTC; None where it is not known.
    `sequence` (n,) numbers the cycles of the loop, so that one left out is seen; None where nobody counted.

    Raises `InputError` for stamps that are not whole numbers, and for shapes that do not fit. The recording checks that
    stamps increase, since it knows the rows that are not valid.
    """

    nanoseconds: IntArray
    start: int | None = None
    anchor: tuple[int, int] | None = None
    sequence: IntArray | None = None

    def __post_init__(self) -> None:
        nanoseconds = _whole_numbers("the stamps of a clock", self.nanoseconds)
        if nanoseconds.ndim != 1 or nanoseconds.size == 0:
            raise InputError(f"a clock needs stamps of shape (n,), got {nanoseconds.shape}", todo="give one per row")
        sequence = None if self.sequence is None else _whole_numbers("sequence numbers", self.sequence)
        if sequence is not None and sequence.shape != nanoseconds.shape:
            raise InputError(
                f"there are {sequence.size} sequence numbers for {nanoseconds.size} stamps",
                todo="give one per row, or none at all",
            )
        # Python integers: stamps since 1970 and their differences stay exact.
        start = int(nanoseconds[0]) if self.start is None else int(self.start)
        anchor = None if self.anchor is None else (int(self.anchor[0]), int(self.anchor[1]))
        self.__dict__.update(nanoseconds=nanoseconds, start=start, anchor=anchor, sequence=sequence)

    def __reduce__(self) -> tuple[object, ...]:  # arrays are made read-only again
        return Clock, (self.nanoseconds, self.start, self.anchor, self.sequence)

    @property
    def zero(self) -> int:
        """`start`, which is known once the clock is made."""
        assert self.start is not None
        return self.start

    @cached_property
    def seconds(self) -> Array:
        """Time since `start`, s: (n,), each the double nearest to the stamp; read-only."""
        out = np.empty(self.nanoseconds.shape)
        # Whole nanoseconds first, divided afterwards: each second is the double nearest to its stamp.
        np.subtract(self.nanoseconds, self.zero, out=out, dtype=np.int64, casting="unsafe")
        out /= 1e9
        out.flags.writeable = False
        return out

    @property
    def missed(self) -> int | None:
        """Cycles between the first row and the last that have no row; None where nobody counted."""
        if self.sequence is None:
            return None
        return int(self.sequence.max() - self.sequence.min()) + 1 - int(self.sequence.size)

    def part(self, rows: slice) -> Clock:
        """Return the same clock on some of the rows, its zero where it was."""
        sequence = None if self.sequence is None else self.sequence[rows]
        return replace(self, nanoseconds=self.nanoseconds[rows], sequence=sequence)


def _whole_numbers(name: str, values: Any) -> IntArray:
    """Return whole numbers as read-only int64, (n,). Raises `InputError` for floats, and beyond int64."""
    array = np.asarray(values)
    if array.dtype.kind not in "iu":
        raise InputError(
            f"{name} are of type {array.dtype}",
            why="a float cannot hold nanoseconds since the computer started",
            todo="give whole numbers; from seconds: np.rint(1e9 * seconds).astype(np.int64)",
        )
    # Stamps are int64 from here on, and would wrap to negative ones.
    if array.dtype == np.uint64 and array.size and int(array.max()) > np.iinfo(np.int64).max:
        raise InputError(f"{name} do not fit 64 bits with a sign", todo="count from a later zero")
    out: IntArray = locked(array, np.int64)
    return out


class MissingChannelError(InputError):
    """A recording lacks the `channel` that is asked for."""

    channel: str = ""


@dataclass(frozen=True, eq=False)
class Recording:
    """One run, simulated or real: a time base and channels, SI units; arrays are read-only.

    - `time`: (n,), s.
    - `channels`: those of frame `world` are (n, N) with N = 1, 2 or 3, those of frame `joint` (n, J) with one column
      per joint, those of the other frames (n,) or (n, k). `CHANNELS` gives the meaning of the known names. No channel
      has to be there: hardware may know no IHIP or no force. Checks read those in `REQUIRED`; see `require`.
    - `signals`: what any other channel is; it may also state the sign convention of a known one.
    - `clock`: the stamps of a real run, of which `time` is made: see `Recording.clocked`.
    - `valid`: (n,), False where a row is not a measurement: its numbers are kept as they came, NaN too, and are never
      judged; None where every row is sound.
    - `events`: in no particular order.
    - `meta`: what the channels do not state: see `METADATA`.

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
        """Return a recording whose `time` (s) is that of `clock`.

        `channels` and the mask `valid` (n,) are as `Recording` takes them.
        """
        keywords = {"clock": clock, "valid": valid, "signals": signals or {}, "events": tuple(events)}
        return cls(clock.seconds, channels, meta or {}, **keywords)  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        time = locked(self.time, np.float64)
        if time.ndim != 1 or time.size == 0:
            raise InputError(f"a recording needs a time base of shape (n,), got {time.shape}", todo="give one per row")
        valid = _mask(self.valid, time.size)
        check_finite("time", time, valid)
        self._check_clock(time, valid)
        check_increasing("time", time, valid)
        signals = {name: declared(name, self.signals) for name in self.channels}
        # A declaration without a channel is a misspelt name.
        unused = [name for name in self.signals if name not in self.channels]
        if unused:
            raise InputError(f"a signal '{unused[0]}' is declared, but there is no such channel")
        channels = {name: locked(values, np.float64) for name, values in self.channels.items()}
        # By frame: the first channel, and its columns, which all others of that frame must have.
        widths: dict[str, tuple[str, int]] = {}
        for name, array in channels.items():
            _check_shape(name, array, signals[name].frame, time.size, widths)
            check_finite(name, array, valid)
        self.__dict__.update(
            time=time,
            channels=MappingProxyType(channels),
            meta=MappingProxyType(check_metadata(self.meta)),
            valid=valid,
            signals=MappingProxyType(signals),
            events=tuple(_event(event) for event in self.events),
        )

    def _check_clock(self, time: Array, valid: BoolArray | None) -> None:
        """Raise `InputError` where clock and time differ, or stamps or cycle numbers do not increase."""
        if self.clock is None:
            return
        # The same array as a rule; otherwise equal to the bit.
        if self.clock.seconds is not time and not np.array_equal(self.clock.seconds, time):
            raise InputError(
                "a recording's time and its clock differ",
                why="time is that of the clock, and nothing re-times it",
                todo="make it with Recording.clocked(clock, channels)",
            )
        check_increasing("the clock", self.clock.nanoseconds, valid, unit="ns")
        if self.clock.sequence is not None:
            check_increasing("the sequence number", self.clock.sequence, valid, unit="")

    def __reduce__(self) -> tuple[object, ...]:
        more = {"clock": self.clock, "valid": self.valid, "signals": dict(self.signals), "events": self.events}
        return partial(Recording, **more), (self.time, dict(self.channels), dict(self.meta))  # type: ignore[arg-type]

    def __len__(self) -> int:
        return int(self.time.size)

    def with_channels(self, **channels: Array) -> Recording:
        """Return the same recording with some `channels`, as in `channels`, in place of those of their names."""
        return replace(self, channels={**self.channels, **channels})

    def part(self, rows: slice) -> Recording:
        """Return some of the rows, one after the other, on the same time base, with the events that fall among them.

        Events before the first row of all, and after the last, stay with those rows.
        """
        begin, end, step = rows.indices(len(self))
        if step != 1 or begin >= end:
            raise InputError(f"no rows of a recording of {len(self)}: {rows}", todo="give rows that follow each other")
        # s; events before the first row of all, and after the last, belong to these ends.
        since = -np.inf if begin == 0 else float(self.time[begin])
        until = np.inf if end == len(self) else float(self.time[end])
        rows = slice(begin, end)
        return replace(
            self,
            time=self.time[rows],
            channels={name: values[rows] for name, values in self.channels.items()},
            clock=None if self.clock is None else self.clock.part(rows),
            valid=None if self.valid is None else self.valid[rows],
            events=tuple(event for event in self.events if since <= event.time < until),
        )

    @property
    def measured(self) -> BoolArray:
        """Which rows are valid, (n,): all of them where none is marked."""
        return np.ones(len(self), dtype=bool) if self.valid is None else self.valid

    def sound_rows(self) -> tuple[slice, ...]:
        """Return the stretches of rows that are valid, each as long as it goes."""
        return tuple(slice(first, end) for first, end in runs_of(self.measured))

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
        """Return the channel `name`. Raises `MissingChannelError` where it was not recorded."""
        self.require(name)
        return self.channels[name]

    @property
    def dimension(self) -> int:
        """N, the columns of the channels in the world's frame; 0 where there is none."""
        widths = (values.shape[1] for name, values in self.channels.items() if self.signals[name].frame == "world")
        return int(next(widths, 0))

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
                why="a difference across a gap is not a velocity",
                todo="take its sound stretches: part(rows) of each sound_rows()",
            )
        return backward_difference(self.hip, self.time)

    @property
    def nanoseconds(self) -> IntArray:
        """Stamps, (n,), ns: the clock's, or `time` in whole nanoseconds where no clock was read."""
        return np.rint(1e9 * self.time).astype(np.int64) if self.clock is None else self.clock.nanoseconds

    @cached_property
    def dt(self) -> float:
        """Median sampling time, s."""
        time = self.time if self.valid is None else self.time[self.valid]
        return float(np.median(np.diff(time))) if time.size > 1 else float(self.meta.get("dt", 1e-3))

    @property
    def contact(self) -> BoolArray:
        """Where the tool touches, as far as that can be told without a scene; shape (n,), False where not valid.

        Where contact was reported, the channel `contact` tells. Else a force is felt or the IHIP is not the HIP, and
        where one of the two was not recorded, the other alone decides. The HIP in single precision is still the HIP: a
        renderer may compute and answer so. Raises `MissingChannelError` where none of the three was recorded.
        """
        if "contact" in self.channels:
            return np.asarray(self.channels["contact"] != 0.0) & self.measured
        touches = np.zeros(len(self), dtype=bool)
        if "ihip" in self.channels or "force" not in self.channels:
            # Force and IHIP may each be zero in a contact: either tells.
            touches |= self.apart
        if "force" in self.channels:
            touches |= np.any(self.force != 0.0, axis=1)
        return touches & self.measured

    @cached_property
    def apart(self) -> BoolArray:
        """Where the IHIP is not the HIP, beyond single precision: (n,), read-only."""
        sound = self.hip if self.valid is None else self.hip[self.valid]
        apart: BoolArray = locked(np.linalg.norm(self.ihip - self.hip, axis=1) > single_rounding(sound), np.bool_)
        return apart

    @property
    def own_tool(self) -> bool:
        """Whether the positions are those of the renderer's own tool, which moves in forces: see `OWN_TOOL`."""
        return self.meta.get(OWN_TOOL) is True

    @property
    def resolution(self) -> float:
        """Length of surface over which the renderer's representation is blurred, m."""
        return float(self.meta.get("resolution", 0.0))

    @property
    def standoff(self) -> float:
        """How far the renderer declares that its surface may lie off the model, m."""
        return float(self.meta.get("standoff", 0.0))


class Column(NamedTuple):
    """One column of a recording: the channel it is of, its unit, and its numbers (n,)."""

    channel: str
    unit: str
    values: Array


def columns_of(recording: Recording) -> dict[str, Column]:
    """Return every column by name: `hip.x`, `joint_torque.0`, `grip`."""
    columns = {}
    for name, values in recording.channels.items():
        signal = recording.signals[name]
        if values.ndim == 1:
            columns[name] = Column(name, signal.unit, values)
            continue
        for k, column in enumerate(values.T):
            # Joints and other columns are numbered, as they have no axis of the world.
            part = "xyz"[k] if signal.frame == "world" else f"{k}"
            columns[f"{name}.{part}"] = Column(name, signal.unit, column)
    return columns


def _mask(flags: Any, count: int) -> BoolArray | None:
    """Return which rows are valid, (n,), None where all are. Raises `InputError` for what is not a mask of them."""
    if flags is None:
        return None
    mask = np.asarray(flags)
    if mask.dtype != np.bool_ or mask.shape != (count,):
        raise InputError(
            f"valid is of type {mask.dtype} and shape {mask.shape}",
            why=f"it is True or False for each of {count} rows",
        )
    # A mask of valid rows only says as much as none.
    return None if mask.all() else locked(mask, np.bool_)


def _check_shape(name: str, array: Array, frame: str, count: int, widths: dict[str, tuple[str, int]]) -> None:
    """Raise `InputError` for a channel of another shape than the first of its frame, kept in `widths`."""
    shape, why = f"({count},) or ({count}, columns)", "every channel has one row per sample"
    fits = array.shape[:1] == (count,) and array.ndim <= 2 and 0 not in array.shape
    if fits and frame in ("world", "joint"):
        # The first channel of a frame sets its width: dimensions of the world, or joints.
        first, width = widths.setdefault(frame, (name, array.shape[-1] if array.ndim == 2 else 1))
        if frame == "world" and width > 3:
            raise InputError(f"channel '{name}' has {width} dimensions", why="the world has one, two or three")
        axis = "joint" if frame == "joint" else "dimension"
        shape, why = f"{(count, width)}", f"channels in the {frame} frame have one column per {axis}, as '{first}' has"
        fits = array.shape == (count, width)
    if not fits:
        raise InputError(f"channel '{name}' has shape {array.shape}, not {shape}", why=why)
