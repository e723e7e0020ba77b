"""Lengths and times as a user writes them: `0.1mm`, `10us`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from hapticeval.errors import InputError

LENGTHS: Mapping[str, float] = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}
TIMES: Mapping[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
NUMBER = re.compile(r"\s*([0-9.eE+-]+)\s*(.*?)\s*")


def length(text: str, *, option: str) -> float:
    """Metres of `0.1mm`, `50 um` or `1e-4m`. Raises `InputError`, naming the option, for anything else."""
    return _parsed(text, LENGTHS, option, "0.1mm")


def duration(text: str, *, option: str) -> float:
    """Seconds of `10us`, `1 ms` or `500ns`. Raises `InputError`, naming the option, for anything else."""
    return _parsed(text, TIMES, option, "10us")


def _parsed(text: str, units: Mapping[str, float], option: str, example: str) -> float:
    found = NUMBER.fullmatch(text)
    try:
        number = float(found[1]) if found else math.nan
    except ValueError:
        number = math.nan
    unit = found[2] if found else ""
    if unit not in units or not math.isfinite(number) or number <= 0.0:
        why = f"'{unit}' is no such unit" if math.isfinite(number) and unit else "it is not a number and a unit"
        if math.isfinite(number) and number <= 0.0:
            why = "it must be positive"
        elif math.isfinite(number) and not unit:
            why = "it has no unit"
        raise InputError(
            f"{option} {text}",
            why=why,
            todo=f"write a number and one of {', '.join(units)}: {option} {example}",
        )
    return number * units[unit]
