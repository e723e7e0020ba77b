"""Mappings: TOML files that say which column of a foreign file is which channel, in what unit and with what sign.

    title = "rig 7, stroke along the wall"

    [time]
    column = "t"                            # or rate = 1000, where the file has no clock
    unit = "ms"
    start = "zero"                          # "file": as the file counts

    [channels.hip]
    columns = ["px", "pz"]
    unit = "mm"
    sign = [1, -1]                          # of each component, into the frame of the model

    [channels.force]                        # on the hand
    columns = ["tau"]
    unit = "N m"
    divide = "0.075 m"                      # the lever: N m / m is N, and so it is checked
    sign = -1

    [channels.raw]                          # encoders, and motors, of the robot that [device] says
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
channel's. Channels that hapticeval does not know say what they are: `becomes` (an SI unit), `meaning`, `frame`. Of a
log with a `[device]`, HIP, velocity and force follow from its joints and motors, where no column is mapped to them.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import resources
from pathlib import Path
from typing import Any

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.channels import CHANNELS, Signal
from hapticeval.recordings.importing.units import Unit, parse_quantity, parse_unit

UNKNOWN = "?"

WIRED = {"raw": "raw joint positions as the hardware gave them", "command": "motor commands"}
"""Channels that are known where there is a `[device]`: what the numbers mean is for that to say."""


@dataclass(frozen=True)
class Source:
    """Where a channel comes from: `factor` turns its columns into SI, component by component."""

    columns: tuple[str, ...]
    factor: tuple[float, ...]
    offset: tuple[float, ...]
    signal: Signal
    time: str | None = None
    resample: str | None = None


@dataclass(frozen=True)
class TimeBase:
    """Where the time comes from: a column of `factor` seconds a unit, or else `rate` (Hz) and the number of the row."""

    column: str | None
    factor: float
    rate: float | None
    from_zero: bool
    mask_disorder: bool


@dataclass(frozen=True)
class FileMapping:
    """A mapping that is complete: every unit and sign is known, and every dimension fits."""

    title: str
    format: str | None
    time: TimeBase
    channels: Mapping[str, Source]
    gaps: tuple[str, float] | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)
    device: Mapping[str, Any] | None = None


def read_mapping(path: Path | str) -> FileMapping:
    """The mapping in a TOML file. Raises `InputError`, naming file and place, for one that is not complete."""
    path = Path(path)
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read the mapping {path}", why=error.strerror or str(error)) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path.name} is not TOML", why=str(error)) from error
    return parse_mapping(document, name=path.name)


def parse_mapping(document: Mapping[str, Any], *, name: str = "the mapping") -> FileMapping:
    """The mapping of a document as TOML gives it. Raises `InputError`, naming the place, for one not complete."""
    _validate(document, name)
    _check_format(document.get("format"), name)
    gaps, device = document.get("gaps"), document.get("device")
    return FileMapping(
        title=document.get("title", ""),
        format=document.get("format"),
        time=_placed(f"{name}: [time]", _time, document["time"]),
        channels={
            channel: _placed(f"{name}: [channels.{channel}]", _source, _wired(spec, channel, device), channel)
            for channel, spec in document["channels"].items()
        },
        gaps=None if gaps is None else (gaps["column"], float(gaps["where"])),
        meta=document.get("meta", {}),
        device=device,
    )


def _check_format(wanted: str | None, name: str) -> None:
    """Raise `InputError` for a format that is not installed: a file that is read never names code to run."""
    if wanted is not None and ":" in wanted:
        raise InputError(
            f"{name}: format = '{wanted}' names code",
            why="a mapping is data: it may name an installed format, and never a function to run",
            todo=f"take it out of the mapping; if you trust that function, give --format {wanted} yourself",
        )


def _validate(document: Mapping[str, Any], name: str) -> None:
    import jsonschema

    schema = json.loads(
        resources.files("hapticeval.recordings.importing").joinpath("mapping.schema.json").read_text(encoding="utf-8")
    )
    errors = list(jsonschema.Draft202012Validator(schema).iter_errors(document))
    # a misspelt key is both unknown and missing: the unknown one is what was written
    unknown = next((error for error in errors if error.validator == "additionalProperties"), None)
    if unknown is not None:
        place = ".".join(str(part) for part in unknown.absolute_path) or "the file"
        known = [key for key in unknown.schema["properties"] if key not in unknown.instance]
        wrong = next(key for key in unknown.instance if key not in unknown.schema["properties"])
        close = get_close_matches(wrong, known, n=1)
        raise InputError(
            f"{name}: {place} has the unknown key '{wrong}'",
            todo=f"did you mean {close[0]}?" if close else f"known here: {', '.join(unknown.schema['properties'])}",
        )
    error = jsonschema.exceptions.best_match(errors)
    if error is not None:
        place = ".".join(str(part) for part in error.absolute_path) or "the file"
        raise InputError(f"{name}: {place} does not fit: {error.message}", todo="see the head of a proposed mapping")


def _placed(place: str, make: Any, *arguments: Any) -> Any:
    """What `make` gives; its error names the place."""
    try:
        return make(*arguments)
    except HapticevalError as error:
        raise InputError(f"{place}: {error.what}", why=error.why, todo=error.todo) from error


def _time(spec: Mapping[str, Any]) -> TimeBase:
    factor = 0.0
    if "column" in spec:
        unit = parse_unit(spec["unit"])
        if "scale" in spec:
            unit = unit * parse_quantity(spec["scale"])
        factor = _to(unit, "s")
    return TimeBase(
        column=spec.get("column"),
        factor=factor,
        rate=spec.get("rate"),
        from_zero=spec.get("start", "zero") == "zero",
        mask_disorder=spec.get("disorder") == "mask",
    )


def _wired(spec: Mapping[str, Any], channel: str, device: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """A channel of `WIRED` with what its unit becomes: counts or an angle of encoders, and of motors what it is."""
    if device is None or channel not in WIRED:
        return spec
    encoders = "counts" if "counts_per_turn" in device else "rad"
    becomes = encoders if channel == "raw" else spec["unit"]
    return {"becomes": becomes, "meaning": WIRED[channel], "frame": "joint", **spec}


def _source(spec: Mapping[str, Any], channel: str) -> Source:
    signs = spec["sign"] if isinstance(spec["sign"], list) else [spec["sign"]] * len(spec["columns"])
    if UNKNOWN in signs:
        raise InputError(
            "the sign is not known",
            why="a sign is never guessed: a force on the hand and a force of the hand differ by it alone",
            todo=f"write 1 or -1; the channel is: {CHANNELS[channel].meaning if channel in CHANNELS else channel}",
        )
    signal = _signal(spec, channel)
    unit = parse_unit(spec["unit"])
    if "scale" in spec:
        unit = unit * parse_quantity(spec["scale"])
    if "divide" in spec:
        unit = unit / parse_quantity(spec["divide"])
    factor = _to(unit, signal.unit)
    offsets = spec.get("offset", 0.0)
    offsets = offsets if isinstance(offsets, list) else [offsets] * len(spec["columns"])
    if not len(signs) == len(offsets) == len(spec["columns"]):
        raise InputError(
            f"there are {len(spec['columns'])} columns, {len(signs)} signs and {len(offsets)} offsets",
            todo="give one for all, or one a column",
        )
    return Source(
        columns=tuple(spec["columns"]),
        factor=tuple(sign * factor for sign in signs),
        offset=tuple(0.0 if value == 0.0 else _to(parse_quantity(value), signal.unit) for value in offsets),
        signal=signal,
        time=spec.get("time"),
        resample=spec.get("resample"),
    )


def _signal(spec: Mapping[str, Any], channel: str) -> Signal:
    known = CHANNELS.get(channel)
    words = "sign as mapped: " + str(spec["sign"])
    if known is not None:
        if spec.get("becomes", known.unit) != known.unit or spec.get("frame", known.frame) != known.frame:
            raise InputError(
                f"'{channel}' is in {known.unit}, frame {known.frame}, for every reader",
                todo="leave out becomes and frame, or give the channel another name",
            )
        return known._replace(sign=words)
    if "becomes" not in spec or "meaning" not in spec:
        raise InputError(
            f"'{channel}' is no channel that hapticeval knows",
            why=f"it knows: {', '.join(CHANNELS)}",
            todo='use one of these, or say what it is: becomes = "N", meaning = "force of the wall on the tool"',
        )
    parse_unit(spec["becomes"])
    return Signal(spec["becomes"], spec["meaning"], spec.get("frame", "none"), words)


def _to(unit: Unit, wanted: str) -> float:
    """The factor from `unit` to the SI unit `wanted`. Raises `InputError` where their dimensions differ."""
    target = parse_unit(wanted)
    if unit.dimension != target.dimension:
        raise InputError(
            f"'{unit.text}' is no {wanted}",
            why="the dimensions differ, an angle being one of its own",
            todo='give the factor between them with its unit, as in scale = "0.075 m/rad" or divide = "0.075 m"',
        )
    return unit.factor / target.factor
