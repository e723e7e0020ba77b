"""Mappings: TOML files that state which column of a foreign file is which channel, with unit and sign; and proposals.

    title = "rig 7, stroke along the wall"
    trial = "demo_0"                        # of a file that holds several: a name, or a number from "0"

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

    [channels.pose]                         # of a body that moves, in the frame of hip, force and velocity
    rotation = ["phi"]                      # an angle in the plane; a matrix row by row; in space w, x, y, z too
    angle = "deg"
    translation = ["bx", "bz"]
    unit = "mm"

    [gaps]
    column = "pen"
    where = 0                               # rows that are not data

    [meta]
    device = "rig 7"

A channel's value is sign * column * unit * scale / divide + offset, and its dimension has to come out as the
channel's. Where the file's axes are turned against the model's, `axes = [[0.866, 0.5], [-0.5, 0.866]]` has the
model's x and y in the axes of the file, and turns that vector. Channels that hapticeval does not know state what they
are: `becomes` (an SI unit), `meaning`, `frame`. Of `[channels.raw]`, encoders, and `[channels.command]`, motors, of the
robot that a `[device]` describes (`hardware.wiring.Wiring`), HIP, velocity and force follow where no column is mapped.

With a pose hip, velocity and force are taken into the frame of the body, where checks read them.

`proposal.propose` makes a first mapping of a file. What it does not know is `?`, which no conversion accepts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import numpy as np

from hapticeval.documents import convert, read_toml
from hapticeval.errors import InputError, at
from hapticeval.recordings.channels import CHANNELS, Signal
from hapticeval.recordings.importing.units import parse_quantity, parse_unit
from hapticeval.types import Array

if TYPE_CHECKING:
    pass

PROPOSAL_ADVICE = "see the head of a mapping that is proposed: hapticeval inspect FILE --write-mapping NEW.toml"

NOT_STATED = "?"

AXES_ROUNDING = 2e-3
"""How far axes in three digits may be from unit vectors."""

WIRED_CHANNELS = {"raw": "raw joint positions as the hardware gave them", "command": "motor commands"}
"""Channels that are known where there is a `[device]`, which gives the meaning of their numbers."""

POSE = "pose"
"""The table of a mapping that gives both channels of a pose."""

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
    sign: Sign | Annotated[tuple[Sign, ...], msgspec.Meta(min_length=1)] | None = None
    scale: Quantity | None = None
    divide: Quantity | None = None
    offset: Quantity | Annotated[tuple[Quantity, ...], msgspec.Meta(min_length=1)] = 0.0
    axes: Annotated[tuple[tuple[float, ...], ...], msgspec.Meta(min_length=1)] | None = None
    time: str | None = None
    resample: Literal["hold", "linear"] | None = None
    becomes: str | None = None
    meaning: str | None = None
    frame: Literal["world", "joint", "device", "none"] | None = None


class PoseColumns(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The pose of a body that moves: x of its frame is at R x + t in the frame of the hand.

    `rotation` is R: one column of an `angle` (its unit) in the plane; the matrix row by row; or in space a unit
    quaternion w, x, y, z. `translation` is t, in some `unit`.
    """

    rotation: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)]
    translation: Annotated[tuple[str, ...], msgspec.Meta(min_length=2, max_length=3)]
    unit: str
    angle: str | None = None

    def sources(self) -> dict[str, Source]:
        """Return where the two channels of a pose come from. Raises `InputError` for as many columns as no rotation."""
        count, size = len(self.rotation), len(self.translation)
        if count not in ({1, 4} if size == 2 else {4, 9}) or (count == 1) is (self.angle is None):
            raise InputError(
                f"{count} columns of a rotation in {size}D, and angle = {self.angle!r}",
                why="it is an angle in the plane, a matrix row by row, or in space a quaternion",
                todo='write rotation = ["phi"] and angle = "rad", or 4 columns, or 9 in space',
            )
        turned = 1.0 if self.angle is None else _factor(self.angle, "rad")
        rotation = Source(self.rotation, (turned,) * count, (0.0,) * count, None, CHANNELS["body_rotation"], None, None)
        moved = (_factor(self.unit, "m"),) * size
        return {
            "body_rotation": rotation,
            "body_translation": Source(
                self.translation, moved, (0.0,) * size, None, CHANNELS["body_translation"], None, None
            ),
        }


class Gaps(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Rows that are not data: those in which `column` is `where`."""

    column: str
    where: float


class Document(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A mapping as it stands in the file; `channels` are tables of the type `Channel`."""

    time: TimeBase
    channels: Annotated[dict[str, dict[str, Any]], msgspec.Meta(min_length=1)]
    title: str = ""
    format: str | None = None
    trial: str | None = None
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
    sources: dict[str, Source] = {}
    for channel, table in parsed.channels.items():
        place = f"{name}: [channels.{channel}]"
        if channel == POSE:
            with at(place):
                sources |= convert(table, PoseColumns, place, todo=PROPOSAL_ADVICE).sources()
            continue
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
    # What turns the raw numbers of a robot is `directions` of its [device].
    sign = 1 if spec.sign is None and device is not None and channel in WIRED_CHANNELS else spec.sign
    signs = sign if isinstance(sign, tuple) else (sign,) * count
    if NOT_STATED in signs or None in signs:
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
    factors = tuple(int(sign or 1) * factor for sign in signs)
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
            f"axes = {rows.tolist()} are not axes",
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
    sign = "sign as mapped: " + str(list(spec.sign) if isinstance(spec.sign, tuple) else spec.sign or 1)
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
            f"'{channel}' is not a channel that hapticeval knows",
            why=f"it knows: {', '.join(CHANNELS)}",
            todo='use one of these, or describe it: becomes = "N", meaning = "force of the wall on the tool"',
        )
    return Signal(becomes, meaning, frame, sign)
