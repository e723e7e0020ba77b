"""Numbers with units, as a user writes them (`0.1mm`, `10us`) and as they are shown (`0.12 mm`, `2.4 µs`)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from hapticeval.errors import InputError

LENGTHS: Mapping[str, float] = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}
PAPER_LENGTHS: Mapping[str, float] = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "pt": 0.0254 / 72.0}
TIMES: Mapping[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
QUANTITY = re.compile(r"\s*([0-9.eE+-]+)\s*(.*?)\s*")


def parse_length(text: str, *, option: str) -> float:
    """Return the metres of `0.1mm`, `50 um` or `1e-4m`. Raises `InputError`, naming the option, for anything else."""
    return _parse_quantity(text, LENGTHS, option, "0.1mm")


def parse_paper_length(text: str, *, option: str) -> float:
    """Return the metres of `88mm`, `3.5in` or `12cm` on paper. Raises `InputError`, naming the option, otherwise."""
    return _parse_quantity(text, PAPER_LENGTHS, option, "88mm")


def parse_duration(text: str, *, option: str) -> float:
    """Return the seconds of `10us`, `1 ms` or `500ns`. Raises `InputError`, naming the option, for anything else."""
    return _parse_quantity(text, TIMES, option, "10us")


def _parse_quantity(text: str, units: Mapping[str, float], option: str, example: str) -> float:
    # A text that is not of that form, or `1e` and the like, gives NaN, which the checks below refuse.
    match = QUANTITY.fullmatch(text)
    try:
        number = float(match[1]) if match else math.nan
    except ValueError:
        number = math.nan
    unit = match[2] if match else ""
    if math.isfinite(number) and number > 0.0 and unit in units:
        return number * units[unit]
    if not math.isfinite(number):
        why = "it is not a number and a unit"
    elif number <= 0.0:
        why = "it must be positive"
    else:
        why = f"'{unit}' is not a known unit" if unit else "it has no unit"
    todo = f"write a number and one of {', '.join(units)}: {option} {example}"
    raise InputError(f"{option} {text}", why=why, todo=todo)


def format_number(value: float, digits: int = 4) -> str:
    """Format a number, as in `0.83`, `1450`, `120,000`; with a power of ten from 1e6 on and below 1e-4 only."""
    text = f"{value + 0.0:.{digits}g}"  # a sum: -0.0 is 0
    # The format "g" turns to powers of ten at once beyond the digits: 120,000 at four digits is 1.2e+05.
    mantissa, e, power = text.partition("e")
    if not e:
        return text
    if 0 < int(power) < 6:
        count = int(float(text))
        return f"{count:,}" if abs(count) >= 10_000 else f"{count}"
    return f"{mantissa}e{int(power)}"


def format_quantity(value: float | None, unit: str) -> str:
    """Format a value in SI units, lengths in mm, shares without one, as in `0.83 mm`; "not finite" for null."""
    if value is None:
        return "not finite"
    if unit == "m":
        value, unit = 1e3 * value, "mm"
    return f"{format_number(value)} {'' if unit == '1' else unit}".rstrip()


def format_length(metres: float, *, micro: str = "µ") -> str:
    """Format a length in the unit that suits its size, as in `0.12 mm`, `3.1 µm`, `0`."""
    if metres == 0.0:
        return "0"
    unit, scale = next(
        # The first unit in which the number does not round to less than 0.1.
        ((u, s) for u, s in (("mm", 1e3), (f"{micro}m", 1e6), ("nm", 1e9)) if metres * s >= 0.0995),
        ("pm", 1e12),
    )
    value = metres * scale
    return f"{format_number(value, 2) if value < 99.5 else format_number(round(value, 0))} {unit}"


def format_duration(seconds: float, *, micro: str = "µ") -> str:
    """Format a time in the unit that suits its size, as in `2.4 µs`."""
    unit, scale = next(
        # The first unit in which the number is about 1 or more: 0.995 s is 0.995 s, 0.994 s is 994 ms.
        ((u, s) for u, s in (("s", 1.0), ("ms", 1e3), (f"{micro}s", 1e6)) if seconds * s >= 0.995),
        ("ns", 1e9),
    )
    return f"{format_number(seconds * scale, 3)} {unit}"


def format_size(count: int) -> str:
    """Format a number of bytes, as in `1.2 MB`."""
    unit, scale = next(((u, s) for u, s in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)) if count >= s), ("B", 1.0))
    return f"{format_number(count / scale, 3)} {unit}"


def plural(count: int, noun: str) -> str:
    """Return a count with its noun, as in `1 row`, `12,000 rows`."""
    return f"{count:,} {noun}" if count == 1 else f"{count:,} {noun}s"


def name_first(names: Sequence[str], limit: int | None, separator: str = ", ") -> str:
    """Return the first `limit` of some names, all if it is None, and how many others there are."""
    others = len(names[limit:]) if limit is not None else 0
    return separator.join(names[:limit]) + (f", and {plural(others, 'other')}" if others else "")


def align_columns(rows: Sequence[Sequence[str]], *, left: int | None = None) -> list[str]:
    """Return rows of cells as lines with aligned columns: the first `left` (None: all) to the left, the rest right."""
    # A column is as wide as its longest cell.
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = ["<" if left is None or place < left else ">" for place in range(len(widths))]
    return [
        "  ".join(f"{cell:{side}{width}}" for cell, side, width in zip(row, sides, widths, strict=True)).rstrip()
        for row in rows
    ]
