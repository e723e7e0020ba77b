"""What a recording may hold: the channels that are known by name, and how any other declares itself."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from hapticeval.errors import InputError

FRAMES = ("world", "joint", "device", "none")
"""`world` is the model's frame; `joint` has a column a joint; `device` is the maker's own; `none` has no direction."""

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]{0,79}")
"""Channel names: what every file format can hold."""


class Signal(NamedTuple):
    """What the numbers of a channel are: unit (SI, "1" for a pure number), meaning, frame and sign convention."""

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
        "operator_force": Signal("N", "force of the hand on the tool", "world"),
        "measured_hip": Signal("m", "HIP as the sensors gave it to the renderer; absent where they are exact", "world"),
        "measured_velocity": Signal(
            "m/s", "velocity of the HIP as the renderer was given it; absent where it is exact", "world"
        ),
        "measured_force": Signal("N", "force of the hand as the force sensor gave it", "world"),
        "joint_position": Signal("rad", "joint angles of the device", "joint"),
        "joint_velocity": Signal("rad/s", "joint velocities of the device", "joint"),
        "joint_torque": Signal("N m", "torque that the motors really give, held from this sample to the next", "joint"),
    }
)
"""The channels that checks, adapters and plots know, with unit, meaning and frame, which no file may change."""

REQUIRED = ("hip", "ihip", "force")
"""What every check reads."""


def declared(name: str, signals: Mapping[str, Signal]) -> Signal:
    """What channel `name` is: known, with the sign convention that `signals` may add, or as declared there.

    Raises `InputError` for a name that is neither known nor declared, a declaration that changes a known
    channel's unit or frame, a frame that is none of `FRAMES`, and a name that files cannot hold.
    """
    known, given = CHANNELS.get(name), signals.get(name)
    if known is None and given is None:
        raise InputError(
            f"a recording does not know the channel '{name}'",
            todo=f"use one of: {', '.join(CHANNELS)}; or declare it: signals={{'{name}': Signal(unit, meaning)}}",
        )
    if given is None:
        assert known is not None
        return known
    given = Signal(*given)
    if not all(isinstance(part, str) for part in given) or not given.unit:
        raise InputError(f"channel '{name}' is declared as {tuple(given)}", todo="give it a unit and a meaning")
    if known is not None:
        if (given.unit, given.frame) != (known.unit, known.frame):
            raise InputError(
                f"channel '{name}' is declared in {given.unit}, frame {given.frame}",
                why=f"every reader takes it in {known.unit}, frame {known.frame}",
                todo="convert it, or give it another name",
            )
        return given
    if NAME.fullmatch(name) is None:
        raise InputError(
            f"{name!r} cannot name a channel", todo="use letters, digits, '_', '-' and '.', beginning with a letter"
        )
    if given.frame not in FRAMES:
        raise InputError(f"channel '{name}' is in the frame '{given.frame}'", todo=f"use one of: {', '.join(FRAMES)}")
    return given
