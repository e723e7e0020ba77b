"""Names, units and frames of the channels that a recording may hold, and the known keys of its metadata."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from datetime import datetime
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import InputError

FRAMES = ("world", "joint", "device", "none")
"""`world` is the model's frame; `joint` has a column a joint; `device` is the maker's own; `none` has no direction."""

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]{0,79}")
"""Channel names: what every file format can hold."""


class Signal(NamedTuple):
    """Describes the numbers of a channel: unit (SI, "1" for a pure number), meaning, frame and sign convention."""

    unit: str
    meaning: str
    frame: str = "none"
    sign: str = ""


CHANNELS: Mapping[str, Signal] = MappingProxyType(
    {
        "hip": Signal("m", "haptic interface point: where the hand is", "world"),
        "ihip": Signal("m", "ideal haptic interface point: the virtual tool; equals hip in free space", "world"),
        "force": Signal("N", "force on the hand, held (or its mean) from this sample to the next", "world"),
        "velocity": Signal("m/s", "velocity of the HIP", "world"),
        "contact": Signal("1", "1 where the renderer reports contact, 0 where not; absent where it reports none"),
        # As opposed to `force`, which acts on the hand: in quasi-static contact the two cancel.
        "operator_force": Signal("N", "force of the hand on the tool", "world"),
        # Of a body that moves: x of its frame, in which all of frame `world` is, lies at R x + t.
        "body_rotation": Signal("1", "rotation of the body, its matrix R row by row; absent where it rests"),
        "body_translation": Signal("m", "translation t of the body's frame; absent where it rests"),
        "measured_hip": Signal("m", "HIP as the sensors gave it to the renderer; absent where they are exact", "world"),
        "measured_velocity": Signal(
            "m/s", "velocity of the HIP as the renderer was given it; absent where it is exact", "world"
        ),
        "measured_force": Signal("N", "force of the hand as the force sensor gave it", "world"),
        "joint_position": Signal("rad", "joint angles of the device", "joint"),
        "joint_velocity": Signal("rad/s", "joint velocities of the device", "joint"),
        "joint_torque": Signal("N m", "torque that the motors really give, held from this sample to the next", "joint"),
        # What limits keep from motors and hand: `force` is the renderer's, and as large as it asked for.
        "commanded_torque": Signal("N m", "torque that the inner loop makes of `force`, before limits", "joint"),
        "sent_force": Signal("N", "force on the hand that `joint_torque` stands for, after limits", "world"),
    }
)
"""The channels that checks, adapters and plots know, with unit, meaning and frame, which no file may change."""

REQUIRED = ("hip", "ihip", "force")
"""What every check reads."""

ANSWERED = (*REQUIRED, "contact")
"""A hand and what a renderer answers to it; `contact` only where it reports it."""


def declared(name: str, signals: Mapping[str, Signal]) -> Signal:
    """Return what channel `name` is: known, with the sign convention that `signals` may add, or as declared there.

    Raises `InputError` for

    - a name that is neither known nor declared, or that files cannot hold;
    - a declaration that changes a known channel's unit or frame;
    - a frame that is none of `FRAMES`.
    """
    known, declaration = CHANNELS.get(name), signals.get(name)
    if declaration is None:
        if known is None:
            raise InputError(
                f"a recording does not know the channel '{name}'",
                todo=f"use one of: {', '.join(CHANNELS)}; or declare it: signals={{'{name}': Signal(unit, meaning)}}",
            )
        return known
    declaration = Signal(*declaration)
    # A declaration from a file or a user may hold anything.
    if not all(isinstance(part, str) for part in declaration) or not declaration.unit:
        raise InputError(f"channel '{name}' is declared as {tuple(declaration)}", todo="give it a unit and a meaning")
    # In a known channel only the sign convention is open: unit and frame are what every reader assumes.
    if known is not None and (declaration.unit, declaration.frame) != (known.unit, known.frame):
        raise InputError(
            f"channel '{name}' is declared in {declaration.unit}, frame {declaration.frame}",
            why=f"every reader takes it in {known.unit}, frame {known.frame}",
            todo="convert it, or give it another name",
        )
    if NAME.fullmatch(name) is None:
        raise InputError(
            f"{name!r} cannot name a channel", todo="use letters, digits, '_', '-', '.'; begin with a letter"
        )
    if declaration.frame not in FRAMES:
        raise InputError(
            f"channel '{name}' is in the frame '{declaration.frame}'", todo=f"use one of: {', '.join(FRAMES)}"
        )
    return declaration


METADATA: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "source": ("text", "where the run comes from: playback or experiment (simulated), replay, hardware or file"),
        "renderer": ("text", "name of the renderer, as in reports"),
        "case": ("text", "name of the case"),
        "scene": ("table", "model and contact, as a case of a suite gives them"),
        "gains": ("table", "stiffness (N/m), damping (N s/m) and what else the controller was set to"),
        "device": ("text", "name of the robot"),
        "device_parameters": ("table", "its lengths, masses, zero offsets and directions, SI"),
        "inner_loop": ("text", "static, compensated or linearised: what makes torques of the force"),
        "dt": ("positive", "sampling time that the loop was meant to have, s"),
        "resolution": ("length", "length of surface over which the representation is blurred, m"),
        "standoff": ("length", "how far the rendered surface may lie off the model, m"),
        "rendered_as": ("text", "projection that answers in place of the renderer's own, where the model has none"),
        "spring": ("text", "what the renderer declares its force to be K_p times of: error or normal"),
        "stiffness_least": ("positive", "least stiffness that the renderer declares, as a share of the scene's"),
        "stiffness_largest": ("positive", "its largest; without one 32 times the scene's"),
        "force_resolution": ("force", "how coarse the renderer declares its force to be, N"),
        "contact_point": (
            "text",
            "none, of a force without a contact point; nearest, of one at the model's nearest point",
        ),
        "closed_form": ("text", "regulation scheme whose law the renderer declares to be"),
        "memory": ("text", "none, of a renderer that declares its IHIP to depend on the HIP alone"),
        "surfaces": ("text", "smooth, of a renderer that declares to be made for surfaces without corners"),
        "ihip_scatter": ("length", "how far the IHIP may differ after a reset, m"),
        "force_scatter": ("force", "how far the force may differ after a reset, N"),
        "signs": ("table", "sign conventions: channel to words"),
        "clock": ("text", "which clock gave the stamps"),
        "who": ("text", "operator"),
        "when": ("date", "start of the run, ISO 8601 with its offset from UTC"),
        "software": ("table", "program to version"),
        "ended": ("table", "what ended the run early: tick, time, what, why, and whether the loop ran_away"),
        "wall": ("table", "of a run in one dimension: at, the wall's place, m, and outward, 1 or -1"),
        "file": ("text", "the file that it was read from"),
    }
)
"""Known keys, with the kind of their value and their meaning. Any other key is free."""

SIMULATED = ("playback", "experiment", "replay")
"""Sources whose every number is an answer: force and IHIP are as the renderer gave them, and the clock is made."""


def check_metadata(meta: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of `meta`, its tables and lists too. Raises `InputError` for a known key of the wrong kind."""
    for key in METADATA.keys() & meta.keys():
        kind, meaning = METADATA[key]
        # Any other key is free: only known ones have a kind to check.
        fits, expected = VALUE_KINDS[kind]
        if not fits(meta[key]):
            raise InputError(f"meta: {key} = {meta[key]!r} is not {expected}", why=f"it is the {meaning}")
    return {str(key): _copied(value) for key, value in meta.items()}


def _copied(value: Any) -> Any:
    """Copy tables and lists all the way down: a later change of the caller's must not reach the recording."""
    if isinstance(value, Mapping):
        return {key: _copied(entry) for key, entry in value.items()}
    return [_copied(entry) for entry in value] if isinstance(value, list) else value


def _number(value: Any) -> bool:
    # True and False are integers to Python, and no numbers here.
    real = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
    return real and math.isfinite(value)


def _date(value: Any) -> bool:
    try:
        return bool(datetime.fromisoformat(value))
    except (TypeError, ValueError):
        return False


VALUE_KINDS: Mapping[str, tuple[Callable[[Any], bool], str]] = {
    "text": (lambda value: isinstance(value, str), "a text"),
    "table": (lambda value: isinstance(value, Mapping), "a table"),
    "positive": (lambda value: _number(value) and value > 0.0, "a positive number"),
    "length": (lambda value: _number(value) and value >= 0.0, "a length in metres, not negative"),
    "force": (lambda value: _number(value) and value >= 0.0, "a force in newtons, not negative"),
    "date": (_date, "a date as 2025-01-31T14:05:00+01:00"),
}
