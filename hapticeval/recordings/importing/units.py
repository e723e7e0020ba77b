"""Units of foreign columns: what a name like `N cm` or `deg/s` is in SI, and whether it fits a channel."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from hapticeval.errors import InputError, UnknownNameError

UNIT_TABLE: tuple[tuple[tuple[int, ...], Mapping[str, float]], ...] = (
    # Powers of m, kg, s, rad, counts and volts. An angle is a dimension here, so that degrees never pass for metres.
    ((0, 0, 0, 0, 0, 0), {"1": 1.0}),
    (
        (1, 0, 0, 0, 0, 0),
        {"m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9, "in": 0.0254},
    ),
    ((0, 0, 1, 0, 0, 0), {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0}),
    ((0, 0, -1, 0, 0, 0), {"Hz": 1.0}),
    (
        (0, 0, 0, 1, 0, 0),
        {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "°": math.pi / 180.0, "rev": 2.0 * math.pi},
    ),
    ((0, 0, -1, 1, 0, 0), {"rpm": 2.0 * math.pi / 60.0}),
    ((1, 1, -2, 0, 0, 0), {"N": 1.0, "mN": 1e-3, "kN": 1e3, "gf": 9.80665e-3, "kgf": 9.80665, "lbf": 4.4482216152605}),
    ((2, 1, -2, 0, 0, 0), {"Nm": 1.0, "mNm": 1e-3, "Ncm": 1e-2, "Nmm": 1e-3}),
    ((0, 1, 0, 0, 0, 0), {"kg": 1.0, "g": 1e-3}),
    ((0, 0, 0, 0, 1, 0), {"count": 1.0, "counts": 1.0, "tick": 1.0, "ticks": 1.0}),
    ((0, 0, 0, 0, 0, 1), {"V": 1.0, "mV": 1e-3}),
)

UNIT_WORD = re.compile(r"([^\d\s^][^\s^]*|1)(?:\^(-?\d+))?")
LEADING_NUMBER = re.compile(r"([+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)\s+(?=\S)")


@dataclass(frozen=True)
class Unit:
    """A unit: `factor` times the value is SI, of powers `dimension`."""

    text: str
    factor: float
    dimension: tuple[int, ...]

    def times(self, other: Unit, power: int = 1) -> Unit:
        """Return the product with a power of another unit. Raises `InputError` where no number holds its factor."""
        try:
            factor = self.factor * other.factor**power
        except (OverflowError, ZeroDivisionError):
            factor = math.inf
        if not 0.0 < abs(factor) < math.inf:
            raise InputError(f"'{self.text} {other.text}^{power}' has a factor that no number holds")
        # (m kg/s^2)^p: exponents add up with the power of the other unit.
        powers = tuple(a + power * b for a, b in zip(self.dimension, other.dimension, strict=True))
        return Unit(f"{self.text} {other.text}^{power}", factor, powers)

    def to(self, si_unit: str) -> float:
        """Return the factor to `si_unit`. Raises `InputError` where the dimensions differ."""
        # Equal powers of every base unit: then the two differ by a factor alone.
        target = parse_unit(si_unit)
        if self.dimension != target.dimension:
            raise InputError(
                f"'{self.text}' is not a multiple of {si_unit}",
                why="the dimensions differ, an angle being one of its own",
                todo='give the factor between them with its unit, as in scale = "0.075 m/rad" or divide = "0.075 m"',
            )
        return self.factor / target.factor


UNITS = {name: Unit(name, factor, powers) for powers, factors in UNIT_TABLE for name, factor in factors.items()}
"""Every unit by its name; products (`N m`), quotients (`mm/s`) and powers (`s^2`) are made of these.

pint was tried: degrees are pure numbers to it, so that they would pass for radians and ratios.
"""


def parse_unit(text: str) -> Unit:
    """Return the unit of `mm`, `N m`, `deg/s`, `0.1 deg`, `m/s^2`; a leading number scales it.

    Raises `InputError` for an empty text or `?`, `UnknownNameError` for a word that is not a unit.
    """
    text = text.strip()
    if text in ("", "?"):
        raise InputError(
            f"the unit '{text}' is not known" if text else "a unit is missing",
            why="a unit is never guessed: a thousandfold error would look like data",
            todo='write the unit that the author of the file states, as in unit = "mm"; of a pure number, unit = "1"',
        )
    # "0.1 deg": a number with a blank behind it scales the unit.
    leading = LEADING_NUMBER.match(text)
    combined = Unit(text, float(leading[1]) if leading else 1.0, (0,) * 6)
    remainder = text[leading.end() :] if leading else text
    for place, part in enumerate(remainder.replace("·", " ").replace("*", " ").replace("²", "^2").split("/")):
        for word in part.replace("(", " ").replace(")", " ").split():
            match = UNIT_WORD.fullmatch(word)
            if match is None or match[1] not in UNITS:
                raise UnknownNameError("unit", word, UNITS)
            # What follows the first slash is below it; "^2" is the word's own power.
            combined = combined.times(UNITS[match[1]], int(match[2] or 1) * (-1 if place else 1))
    if not math.isfinite(combined.factor) or combined.factor <= 0.0:
        raise InputError(f"the unit '{text}' has the factor {combined.factor}", why="it must be positive and finite")
    return Unit(text, combined.factor, combined.dimension)


def parse_quantity(value: float | str) -> Unit:
    """Return a number with its unit, `0.075 m` or `2.4e-5 rad/count`, or a number alone, as a unit.

    Raises `InputError` for anything else, and for a number that is zero or not finite.
    """
    number, _, unit = (value if isinstance(value, str) else repr(value)).strip().partition(" ")
    try:
        factor = float(number)
    except ValueError:
        factor = math.nan
    if not math.isfinite(factor) or factor == 0.0:
        raise InputError(
            f"'{value}' is not a quantity",
            why="it is a number, finite and not zero, and a unit",
            todo='write it as "0.075 m"',
        )
    parsed = parse_unit(unit or "1")
    return Unit(f"{value}", factor * parsed.factor, parsed.dimension)
