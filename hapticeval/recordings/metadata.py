"""What a recording says of itself beside its numbers: the keys that have a meaning, and their types."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import datetime
from types import MappingProxyType
from typing import Any

import numpy as np

from hapticeval.errors import InputError

METADATA: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "source": ("text", "where the run comes from: playback or experiment (simulated), replay, hardware or file"),
        "renderer": ("text", "name of the renderer, as in reports"),
        "case": ("text", "name of the case"),
        "scene": ("table", "model and contact, as a case of a suite gives them"),
        "gains": ("table", "stiffness (N/m), damping (N s/m) and what else the controller was set to"),
        "device": ("text", "name of the robot"),
        "device_parameters": ("table", "its lengths, masses, zero offsets and directions, SI"),
        "dt": ("positive", "sampling time that the loop was meant to have, s"),
        "resolution": ("length", "length of surface over which the representation is blurred, m"),
        "standoff": ("length", "how far the rendered surface may lie off the model, m"),
        "spring": ("text", "what the renderer declares its force to be K_p times of: error or normal"),
        "ihip_scatter": ("length", "how far the IHIP may differ after a reset, m"),
        "signs": ("table", "sign conventions: channel to words"),
        "clock": ("text", "which clock gave the stamps"),
        "who": ("text", "operator"),
        "when": ("date", "start of the run, ISO 8601 with its offset from UTC"),
        "software": ("table", "program to version"),
        "ended": ("table", "what ended the run early: tick, time, what, why"),
        "wall": ("table", "of a run in one dimension: at, the wall's place, m, and outward, 1 or -1"),
        "file": ("text", "the file that it was read from"),
    }
)
"""Known keys, with the kind of their value and their meaning. Any other key is free."""


SIMULATED = ("playback", "experiment", "replay")
"""Sources whose every number is an answer: force and IHIP are as the renderer gave them, and the clock is made."""


def is_bilateral(meta: Mapping[str, Any]) -> bool:
    """Whether the scene holds the tool from both sides."""
    scene = meta.get("scene")
    return isinstance(scene, Mapping) and bool(scene.get("bilateral"))


def check_metadata(meta: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of `meta`, its tables and lists too. Raises `InputError` for a known key of the wrong kind."""
    for key in METADATA.keys() & meta.keys():
        kind, meaning = METADATA[key]
        fits, wanted = KINDS[kind]
        if not fits(meta[key]):
            raise InputError(f"meta: {key} = {meta[key]!r} is not {wanted}", why=f"it is the {meaning}")
    return {str(key): _copied(value) for key, value in meta.items()}


def _number(value: Any) -> bool:
    real = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
    return real and math.isfinite(value)


def _date(value: Any) -> bool:
    try:
        datetime.fromisoformat(value)
    except (TypeError, ValueError):
        return False
    return True


def _copied(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _copied(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_copied(item) for item in value]
    return value


KINDS: Mapping[str, tuple[Callable[[Any], bool], str]] = {
    "text": (lambda value: isinstance(value, str), "a text"),
    "table": (lambda value: isinstance(value, Mapping), "a table"),
    "positive": (lambda value: _number(value) and value > 0.0, "a positive number"),
    "length": (lambda value: _number(value) and value >= 0.0, "a length in metres, not negative"),
    "date": (_date, "a date as 2025-01-31T14:05:00+01:00"),
}
