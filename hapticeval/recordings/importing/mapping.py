"""Mappings: TOML files that state which column of a foreign file is which channel, with unit and sign; and proposals.

    title = "rig 7, stroke along the wall"

    [time]
    column = "t"                            # or rate = 1000, where the file has no clock
    unit = "ms"
    start = "zero"                          # "file": as the file counts

    [channels.hip]
    columns = ["px", "pz"]
    unit = "mm"
    sign = [1, -1]                          # for each component, into the frame of the model

    [channels.force]                        # on the hand
    columns = ["tau"]
    unit = "N m"
    divide = "0.075 m"                      # the lever: N m / m is N, and so it is checked
    sign = -1

    [channels.raw]                          # encoders, and motors, of the robot of [device]
    columns = ["enc1", "enc2"]
    unit = "counts"                         # an angle where [device] has no counts_per_turn
    sign = 1                                # turned by directions, below
    [channels.command]
    columns = ["u1", "u2"]
    unit = "V"                              # what torque_per_command is for
    sign = 1

    [device]
    kind = "parallelogram-2dof"
    counts_per_turn = 262144
    offsets = [1210, -340]                  # raw readings at joint angle zero
    directions = [1, -1]                    # of encoder and motor of each joint
    torque_per_command = 0.35               # N m
    l1 = 0.3                                # of Table A.1, where it is not so

    [gaps]
    column = "pen"
    where = 0                               # rows that are no data

    [meta]
    device = "rig 7"

A channel's value is sign * column * unit * scale / divide + offset, and its dimension has to come out as the
channel's. Where the file's axes are turned against the model's, `axes = [[0.866, 0.5], [-0.5, 0.866]]` has the
model's x and y in the axes of the file, and turns that vector. Channels that hapticeval does not know state what they
are: `becomes` (an SI unit), `meaning`, `frame`. Of a log with a `[device]`, HIP, velocity and force follow from its
joints and motors, where no column is mapped to them.

`propose` makes a first mapping from the names of columns. What it does not know is `?`, which no conversion accepts.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import numpy as np

from hapticeval.documents import convert, read_toml, toml_text
from hapticeval.errors import HapticevalError, InputError, at
from hapticeval.recordings.channels import CHANNELS, Signal
from hapticeval.recordings.importing.units import parse_quantity, parse_unit
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.recordings.formats import Table

PROPOSAL_ADVICE = "see the head of a mapping that is proposed: hapticeval inspect FILE --write-mapping NEW.toml"

NOT_STATED = "?"

AXES_ROUNDING = 2e-3
"""How far axes in three digits may be from unit vectors."""

WIRED_CHANNELS = {"raw": "raw joint positions as the hardware gave them", "command": "motor commands"}
"""Channels that are known where there is a `[device]`, which gives the meaning of their numbers."""

Sign = Literal[1, -1, "?"]
Quantity = float | str
Positive = Annotated[float, msgspec.Meta(gt=0.0)]


class TimeBase(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The time: a `column` in some `unit`, or else `rate` (Hz) and the number of the row."""

    column: str | None = None
    unit: str | None = None
    scale: Quantity | None = None
    rate: Positive | None = None
    start: Literal["file", "zero"] = "zero"
    disorder: Literal["refuse", "mask"] = "refuse"

    def factor(self) -> float:
        """Return the seconds of one unit of the column. Raises `InputError` where neither column nor rate is whole."""
        if self.rate is not None and self.column is None:
            return 0.0
        if self.rate is not None or self.column is None or self.unit is None:
            raise InputError("it needs either a column and its unit, or a rate", todo='as in column = "t", unit = "ms"')
        return _factor(self.unit, "s", scale=self.scale)


class Channel(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A channel as it stands in the file: a value is axes times sign * column * unit * scale / divide + offset."""

    columns: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)]
    unit: str
    sign: Sign | Annotated[tuple[Sign, ...], msgspec.Meta(min_length=1)]
    scale: Quantity | None = None
    divide: Quantity | None = None
    offset: Quantity | Annotated[tuple[Quantity, ...], msgspec.Meta(min_length=1)] = 0.0
    axes: Annotated[tuple[tuple[float, ...], ...], msgspec.Meta(min_length=1)] | None = None
    time: str | None = None
    resample: Literal["hold", "linear"] | None = None
    becomes: str | None = None
    meaning: str | None = None
    frame: Literal["world", "joint", "device", "none"] | None = None


class Gaps(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Rows that are no data: those in which `column` is `where`."""

    column: str
    where: float


class Document(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A mapping as it stands in the file; `channels` are tables of the type `Channel`."""

    time: TimeBase
    channels: Annotated[dict[str, dict[str, Any]], msgspec.Meta(min_length=1)]
    title: str = ""
    format: str | None = None
    gaps: Gaps | None = None
    device: dict[str, Any] | None = None
    meta: dict[str, Any] = {}


@dataclass(frozen=True)
class Source:
    """Where a channel comes from: `factor` and `offset` turn its columns into SI, component by component.

    The rows of `axes` (m, n) are the m axes of the model, unit vectors, in the axes of the n columns; None where these
    are the model's.
    """

    columns: tuple[str, ...]
    factor: tuple[float, ...]
    offset: tuple[float, ...]
    axes: Array | None
    signal: Signal
    time: str | None
    resample: str | None


@dataclass(frozen=True)
class FileMapping:
    """A mapping that is complete: every unit and sign is known, and every dimension fits."""

    document: Document
    factor: float
    """Seconds of one unit of the time column."""
    channels: Mapping[str, Source]


def read_mapping(path: Path | str) -> FileMapping:
    """Return the mapping in a TOML file. Raises `InputError`, naming file and place, for one that is not complete."""
    return parse_mapping(read_toml(Path(path)), name=Path(path).name)


def parse_mapping(document: Mapping[str, Any], *, name: str = "the mapping") -> FileMapping:
    """Return the mapping of a document as TOML gives it. Raises `InputError`, naming the place, if not complete."""
    parsed: Document = convert(document, Document, name, todo=PROPOSAL_ADVICE)
    # package.module:function would be run: only a person on the command line may ask for that.
    if parsed.format is not None and ":" in parsed.format:
        raise InputError(
            f"{name}: format = '{parsed.format}' names code",
            why="a mapping is data: it may name an installed format, and never a function to run",
            todo=f"take it out of the mapping; if you trust that function, give --format {parsed.format} yourself",
        )
    with at(f"{name}: [time]"):
        factor = parsed.time.factor()
    sources = {}
    for channel, table in parsed.channels.items():
        place = f"{name}: [channels.{channel}]"
        # Converted one by one, so that an error names its channel.
        spec: Channel = convert(table, Channel, place, todo=PROPOSAL_ADVICE)
        with at(place):
            sources[channel] = _source(spec, channel, parsed.device)
    if parsed.device is not None and not isinstance(parsed.device.get("kind"), str):
        raise InputError(f"{name}: [device] lacks its kind", todo='write for instance kind = "parallelogram-2dof"')
    return FileMapping(parsed, factor, sources)


def _source(spec: Channel, channel: str, device: Mapping[str, Any] | None) -> Source:
    """Return where a channel comes from, its factors and offsets in SI. Raises `InputError` where one is not known."""
    count = len(spec.columns)
    signs = spec.sign if isinstance(spec.sign, tuple) else (spec.sign,) * count
    if NOT_STATED in signs:
        raise InputError(
            "the sign is not known",
            why="a sign is never guessed: a force on the hand and a force of the hand differ by it alone",
            todo=f"write 1 or -1; the channel is: {CHANNELS[channel].meaning if channel in CHANNELS else channel}",
        )
    signal = _signal(spec, channel, device)
    # SI units per unit of the column; the sign of each component comes on top.
    factor = _factor(spec.unit, signal.unit, scale=spec.scale, divide=spec.divide)
    offsets = spec.offset if isinstance(spec.offset, tuple) else (spec.offset,) * count
    if not len(signs) == len(offsets) == count:
        raise InputError(
            f"there are {count} columns, {len(signs)} signs and {len(offsets)} offsets",
            todo="give one for all, or one per column",
        )
    # A zero needs no unit; any other offset states its own.
    offset = tuple(0.0 if value == 0.0 else parse_quantity(value).to(signal.unit) for value in offsets)
    factors = tuple(int(sign) * factor for sign in signs)
    return Source(spec.columns, factors, offset, _axes(spec, signal), signal, spec.time, spec.resample)


def _axes(spec: Channel, signal: Signal) -> Array | None:
    """Return the axes of the model in those of the columns, (m, n), at right angles and of length 1; None for the same.

    Raises `InputError` where they are farther from that than three digits explain.
    """
    if spec.axes is None:
        return None
    count = len(spec.columns)
    if signal.frame != "world" or {len(row) for row in spec.axes} != {count} or len(spec.axes) > count:
        raise InputError(
            f"axes = {[list(row) for row in spec.axes]} for {count} columns in the frame '{signal.frame}'",
            why="a vector of the world is turned, by a row for each axis of the model, of a number for each column",
            todo="write for instance axes = [[0.866, 0.5], [-0.5, 0.866]]: the model is turned by 30 degrees",
        )
    rows = np.array(spec.axes)
    # The nearest rows at right angles, of length 1: the polar factor.
    left, lengths, right = np.linalg.svd(rows, full_matrices=False)
    if not np.allclose(lengths, 1.0, rtol=0.0, atol=AXES_ROUNDING):
        raise InputError(
            f"axes = {rows.tolist()} are no axes",
            why="they are unit vectors at right angles to each other",
            todo="give cosines and sines to three digits or more; a factor is for scale",
        )
    return np.asarray(left @ right)


def _factor(unit: str, target: str, *, scale: Quantity | None = None, divide: Quantity | None = None) -> float:
    """Return the factor from a unit, scaled and divided, to another. Raises `InputError` if the dimensions differ."""
    combined = parse_unit(unit)
    for quantity, power in ((scale, 1), (divide, -1)):
        # value * unit * scale / divide: the dimension of the product is what has to come out.
        combined = combined if quantity is None else combined.times(parse_quantity(quantity), power)
    return combined.to(target)


def _signal(spec: Channel, channel: str, device: Mapping[str, Any] | None) -> Signal:
    """Return what a mapped channel is: unit, meaning, frame, and its sign as mapped."""
    known = CHANNELS.get(channel)
    sign = "sign as mapped: " + str(list(spec.sign) if isinstance(spec.sign, tuple) else spec.sign)
    if known is not None:
        if (spec.becomes or known.unit, spec.frame or known.frame) != (known.unit, known.frame):
            raise InputError(
                f"'{channel}' is in {known.unit}, frame {known.frame}, for every reader",
                todo="leave out becomes and frame, or give the channel another name",
            )
        return known._replace(sign=sign)
    becomes, meaning, frame = spec.becomes, spec.meaning, spec.frame or "none"
    if device is not None and channel in WIRED_CHANNELS:  # counts or an angle of encoders, and of motors what they take
        encoders = "counts" if "counts_per_turn" in device else "rad"
        becomes = becomes or (encoders if channel == "raw" else spec.unit)
        meaning, frame = meaning or WIRED_CHANNELS[channel], spec.frame or "joint"
    if becomes is None or meaning is None:
        raise InputError(
            f"'{channel}' is no channel that hapticeval knows",
            why=f"it knows: {', '.join(CHANNELS)}",
            todo='use one of these, or describe it: becomes = "N", meaning = "force of the wall on the tool"',
        )
    return Signal(becomes, meaning, frame, sign)


CLOCK_NAME = re.compile(
    r"t|zeit|sec|seconds|received|tick|tout|(\w*_)?(time|timestamp|stamp|clock|secs?\+\w+)", re.IGNORECASE
)
COMPONENT_NAME = re.compile(r"(?P<stem>.*?)[._/ \[]?(?P<part>[xyz]|\d+)\]?$", re.IGNORECASE)
HEADER_UNIT = re.compile(r"\s*[\[(][^\])]*[A-Za-z°][^\])]*[\])]\s*$")
"""A unit that a header states after the name."""

SUFFIX_UNIT = re.compile(r"_(mm|cm|um|µm|ms|us|µs|ns|rad|mrad|deg|N|mN|Nm|mNm|Nmm)$")
"""A unit that a name ends with, as in `x_mm`. Not m, s and g, which mean master, slave and gripper just as well."""

SUFFIX_SECONDS = re.compile(r"_(s)$")
"""The unit that the name of a clock may end with beside those."""

LABEL_UNIT = re.compile(r"[\[(]([^\])]+)[\])]\s*$")
"""A unit that a label ends with."""

CHANNEL_WORDS: tuple[tuple[str, str], ...] = (
    ("ihip", r"ihip|proxy|god.?object|virtual.?tool"),
    ("operator_force", r"operator.?force|hand.?force|f_?h\b"),
    ("joint_torque", r"torque|tau|effort|drehmoment"),
    ("joint_velocity", r"joint.*vel|qd|omega"),
    ("joint_position", r"joint.*pos|theta|angle|encoder|winkel|\bq\b"),
    ("velocity", r"vel|speed|geschwindigkeit|\bv\b"),
    ("force", r"force|wrench|kraft|\bf\b"),
    ("hip", r"hip|pos|\bpoint\b|weg\b|\bp\b|^$|\bx\b|endeff|tool|stylus"),
)
"""Words in names and labels, and the channel that they may mean; the first that fits."""

DIRECTED_CHANNELS = {"force", "operator_force", "measured_force", "joint_torque"}
"""Channels whose sign depends on who pushes whom, which no name states."""


def propose(table: Table, *, file: str = "FILE") -> str:
    """Return a mapping as TOML text, with a remark on all that the file does not state.

    Units stand in it where the file or the name of a column states them. A position's sign is 1, which makes the
    file's axes the frame; the sign of a force is `?`. A file that hapticeval wrote states everything, and its proposal
    can be used as it is.
    """
    ours = bool(table.attributes.get("hapticeval"))
    clock_names = clocks(table)
    clock = clock_names[0] if clock_names else None
    lines = [
        f'# Proposed for {file} ({table.format}). Replace each "?"; lines after # are remarks.',
        f"# Channels: {', '.join(CHANNELS)}.",
        '# Any other name is described: becomes = "N", meaning = "force of the wall", frame = "world" or "none".',
        f"title = {toml_text(file)}",
        f"# Its format is code of yours, which no mapping names: give --format {table.format} beside the mapping."
        if ":" in table.format
        else f"format = {toml_text(table.format)}",
        "",
        "[time]",
        *_time(table, clock_names),
    ]
    rows = table.rows(clock) if clock else max(table.rows(name) for name in table.columns)
    # What no proposal uses is listed at the end, so that nothing of the file goes unseen.
    used = {clock}
    channels = _channels(table, rows, clock_names)
    for channel, (columns, own) in channels.items():
        used |= {*columns, own}
        lines += ["", *_channel(table, channel, columns, ours=ours)]
        if own is not None:
            lines += [f"time = {toml_text(own)}", 'resample = "?"  # "hold" (the latest value) or "linear"']
    if not channels.keys() & {"hip", "joint_position"}:
        lines += ["", "# No column is named like the hand's position. Take the # off, and name its columns, x first:"]
        lines += [
            f"# [channels.hip]  # {CHANNELS['hip'].meaning} (m)",
            '# columns = ["?", "?"]',
            '# unit = "?"',
            "# sign = 1",
        ]
    valid = next((name for name in table.columns if ours and name.rpartition(".")[2] == "valid"), None)
    if valid is not None:
        used.add(valid)
        lines += ["", "[gaps]", f"column = {toml_text(valid)}", "where = 0"]
    left = [name for name in table.columns if name not in used]
    if left:
        lines += ["", "# Columns that no channel is proposed for:"]
        lines += [f"#   {toml_text(name)}: {_remark(table, name)}" for name in left]
    lines += ["", "[meta]", '# device = "", who = "", when = "2025-01-31T14:05:00+01:00"', ""]
    return "\n".join(lines)


def clocks(table: Table) -> list[str]:
    """Return the columns that may be a clock, by name and because they increase; the one with most companions first."""
    clock_names = []
    for name, values in table.columns.items():
        # The last part of a path as `scope.time` or `/wrench.header.stamp`, without the unit in brackets.
        leaf = SUFFIX_SECONDS.sub("", _without_unit(re.split(r"[./]", HEADER_UNIT.sub("", name))[-1].strip()))
        steps = np.diff(np.asarray(values))
        # Nine in ten steps go forward: a clock that stands still or jumps now and then is still the clock.
        if CLOCK_NAME.fullmatch(leaf) and steps.size and float(np.mean(steps > 0)) > 0.9:
            clock_names.append(name)
    # The more columns have as many rows, the more signals were taken by that clock.
    sizes = [np.size(values) for values in table.columns.values()]
    return sorted(clock_names, key=lambda name: -sizes.count(table.rows(name)))


def _time(table: Table, clock_names: list[str]) -> list[str]:
    """Return the lines of `[time]`: the clock that most columns share, and what a person has to add."""
    if not clock_names:
        return ["rate = 0  # Hz: the file has no column that looks like a clock; or give column and unit"]
    clock, *others = clock_names
    lines = [f"column = {toml_text(clock)}  # {_remark(table, clock)}"]
    others = [name for name in others if table.rows(name) == table.rows(clock)]
    if others:
        lines.append(f"# also increasing: {', '.join(others[:6])}")
    seconds = SUFFIX_SECONDS.search(clock)
    unit = table.units.get(clock) or (seconds[1] if seconds else _unit(table, clock))
    # OpenHaptics counts the scheduler's ticks, whose rate is not in the file.
    if clock == "tick" and unit == NOT_STATED:
        lines += ['unit = "ticks"', 'scale = "?"  # "0.001 s/tick" at 1000 Hz, if that was the scheduler\'s rate']
    else:
        lines.append(f"unit = {toml_text(unit)}")
    return [*lines, 'start = "zero"']


def _channels(table: Table, rows: int, clock_names: list[str]) -> dict[str, tuple[list[str], str | None]]:
    """Return channels with the first group of at most three columns that their words fit, and their own clock.

    That is None for columns on the clock of the time; columns of other topics come after those.
    """
    topic = table.topics.get(clock_names[0]) if clock_names else None
    # The first clock of each topic: going backwards, it is the last to be put in.
    clock_of = {table.topics[name]: name for name in reversed(clock_names) if name in table.topics}
    groups: dict[tuple[str, str | None], list[str]] = {}
    for name in table.columns:
        on_time_clock = table.rows(name) == rows and table.topics.get(name) == topic
        own = None if on_time_clock else clock_of.get(table.topics.get(name, ""))
        if name not in clock_names and (on_time_clock or own is not None):
            plain = _without_unit(name).removesuffix(f"/{table.units.get(name)}")
            part = COMPONENT_NAME.fullmatch(plain)
            # `pos.x`, `pos.y` and `pos.z` share the stem `pos`, and become one channel.
            groups.setdefault((part["stem"] if part else plain, own), []).append(name)
    channels: dict[str, tuple[list[str], str | None]] = {}
    for (stem, own), columns in sorted(groups.items(), key=lambda group: group[0][1] is not None):
        # A file of ours has the channels' own names; any other is looked up by its words in `CHANNEL_WORDS`.
        channel = stem.rpartition(".")[2]
        if channel not in CHANNELS:
            last = f"{re.split(r'[./]', stem)[-1]} {' '.join(table.notes.get(name, '') for name in columns)}"
            last = last.strip().lower() if stem else ""
            in_topic = f"{table.topics.get(columns[0], '')} {last}".strip().lower()
            # A topic of joints has joint positions.
            descriptions = (in_topic, last) if "joint" in in_topic else (last, in_topic)
            channel = next(
                (name for words in descriptions for name, rule in CHANNEL_WORDS if re.search(rule, words)), ""
            )
        # A wrench acts at the hand: its torque is that of no motor.
        if channel == "joint_torque" and "wrench" in re.split(r"[./]", stem):
            channel = ""
        # More than three columns are no vector of the world, nor joints of a device that is known here.
        if channel and len(columns) <= 3:
            channels.setdefault(channel, (columns, own))
    return channels


def _channel(table: Table, channel: str, columns: list[str], *, ours: bool) -> list[str]:
    """Return the lines of one `[channels.NAME]`, with a remark on each of its columns."""
    units = {_unit(table, name) for name in columns}
    sign = 'sign = "?"  # 1 or -1'
    if ours or channel not in DIRECTED_CHANNELS:
        sign = (
            "sign = 1"
            if ours
            else "sign = 1  # the axes of the file are taken for those of the model; turned ones: axes = [[...], ...]"
        )
    return [
        f"[channels.{channel}]  # {CHANNELS[channel].meaning} ({CHANNELS[channel].unit})",
        *(f"#   {toml_text(name)}: {_remark(table, name)}" for name in columns),
        f"columns = {toml_text(columns)}",
        f"unit = {toml_text(units.pop() if len(units) == 1 else NOT_STATED)}",
        sign,
    ]


def _without_unit(name: str) -> str:
    """Return the name of a column without the unit that it ends with."""
    return SUFFIX_UNIT.sub("", HEADER_UNIT.sub("", name))


def _unit(table: Table, name: str) -> str:
    """Return the unit that the file states, that the label of a column ends with in brackets, or its name."""
    stated = LABEL_UNIT.search(table.notes.get(name, "")) or SUFFIX_UNIT.search(name)
    unit = table.units.get(name) or (stated[1].strip() if stated else NOT_STATED)
    try:
        parse_unit(unit)
    except HapticevalError:
        return table.units.get(name, NOT_STATED)
    return unit


def _remark(table: Table, name: str) -> str:
    """Return the rows, the range and the file's own words about a column."""
    values = table[name]
    finite = values[np.isfinite(values)]
    ends = (finite.min(), finite.max()) if finite.size else ()
    # A clock that counts from 1970 differs from its tenth digit on.
    digits = 6 if len({f"{end:.6g}" for end in ends}) == len(set(ends)) else 13
    span = " to ".join(f"{end:.{digits}g}" for end in ends) or "no number"
    note = f"; {table.notes[name]}" if name in table.notes else ""
    return " ".join(f"{values.size} rows, {span}{note}".split())
