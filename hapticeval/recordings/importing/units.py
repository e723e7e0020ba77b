"""Units of foreign columns: what a name like `N cm` or `deg/s` is in SI, and whether it fits a channel."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from hapticeval.errors import InputError, UnknownNameError

Dimension = tuple[int, int, int, int, int, int]
"""Powers of m, kg, s, rad, counts and volts. An angle is a dimension here, so that degrees never pass for metres."""

M, KG, S, RAD, COUNT, V = (tuple(int(i == k) for i in range(6)) for k in range(6))
NONE = (0,) * 6
NEWTON = (1, 1, -2, 0, 0, 0)

UNITS: Mapping[str, tuple[float, tuple[int, ...]]] = {
    "1": (1.0, NONE),
    "m": (1.0, M),
    "dm": (0.1, M),
    "cm": (1e-2, M),
    "mm": (1e-3, M),
    "um": (1e-6, M),
    "µm": (1e-6, M),
    "nm": (1e-9, M),
    "in": (0.0254, M),
    "s": (1.0, S),
    "ms": (1e-3, S),
    "us": (1e-6, S),
    "µs": (1e-6, S),
    "ns": (1e-9, S),
    "min": (60.0, S),
    "Hz": (1.0, tuple(-power for power in S)),
    "rad": (1.0, RAD),
    "mrad": (1e-3, RAD),
    "deg": (math.pi / 180.0, RAD),
    "°": (math.pi / 180.0, RAD),
    "rev": (2.0 * math.pi, RAD),
    "rpm": (2.0 * math.pi / 60.0, (0, 0, -1, 1, 0, 0)),
    "N": (1.0, NEWTON),
    "mN": (1e-3, NEWTON),
    "kN": (1e3, NEWTON),
    "gf": (9.80665e-3, NEWTON),
    "kgf": (9.80665, NEWTON),
    "lbf": (4.4482216152605, NEWTON),
    "Nm": (1.0, (2, 1, -2, 0, 0, 0)),
    "mNm": (1e-3, (2, 1, -2, 0, 0, 0)),
    "Ncm": (1e-2, (2, 1, -2, 0, 0, 0)),
    "Nmm": (1e-3, (2, 1, -2, 0, 0, 0)),
    "kg": (1.0, KG),
    "g": (1e-3, KG),
    "count": (1.0, COUNT),
    "counts": (1.0, COUNT),
    "tick": (1.0, COUNT),
    "ticks": (1.0, COUNT),
    "V": (1.0, V),
    "mV": (1e-3, V),
}
"""Factor to SI and powers of each unit; products (`N m`), quotients (`mm/s`) and powers (`s^2`) are made of these."""

WORD = re.compile(r"([^\d\s^][^\s^]*|1)(?:\^(-?\d+))?")


@dataclass(frozen=True)
class Unit:
    """A unit: `factor` times the value is SI, of powers `dimension`."""

    text: str
    factor: float
    dimension: tuple[int, ...]

    def __mul__(self, other: Unit) -> Unit:
        powers = tuple(a + b for a, b in zip(self.dimension, other.dimension, strict=True))
        return Unit(f"{self.text} {other.text}", self.factor * other.factor, powers)

    def __truediv__(self, other: Unit) -> Unit:
        powers = tuple(a - b for a, b in zip(self.dimension, other.dimension, strict=True))
        return Unit(f"{self.text} / ({other.text})", self.factor / other.factor, powers)


def parse_unit(text: str) -> Unit:
    """The unit of `mm`, `N m`, `deg/s`, `0.1 deg`, `m/s^2`; a leading number scales it.

    Raises `InputError` for an empty text or `?`, `UnknownNameError` for a word that is no unit.
    """
    text = text.strip()
    if text in ("", "?"):
        raise InputError(
            f"the unit '{text}' is not known" if text else "a unit is missing",
            why="a unit is never guessed: a thousandfold error would look like data",
            todo='write the unit that the author of the file states, as in unit = "mm"; of a pure number, unit = "1"',
        )
    leading = re.match(r"([+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)\s+(?=\S)", text)
    factor = float(leading[1]) if leading else 1.0
    rest = text[leading.end() :] if leading else text
    powers = [0] * 6
    for place, part in enumerate(rest.replace("·", " ").replace("*", " ").replace("²", "^2").split("/")):
        for word in part.replace("(", " ").replace(")", " ").split():
            found = WORD.fullmatch(word)
            if found is None or found[1] not in UNITS:
                raise UnknownNameError("unit", word, UNITS)
            power = int(found[2] or 1) * (-1 if place else 1)
            one, dimension = UNITS[found[1]]
            factor *= one**power
            powers = [total + power * each for total, each in zip(powers, dimension, strict=True)]
    if not math.isfinite(factor) or factor <= 0.0:
        raise InputError(f"the unit '{text}' has the factor {factor}", why="it must be positive and finite")
    return Unit(text, factor, tuple(powers))


def parse_quantity(value: float | str) -> Unit:
    """A number with its unit, `0.075 m` or `2.4e-5 rad/count`, or a number alone. Raises `InputError` for others."""
    if isinstance(value, int | float):
        if not math.isfinite(value) or value == 0.0:
            raise InputError(f"a factor of {value!r}", why="it must be finite and not zero")
        return Unit(f"{value:g}", float(value), NONE)
    number, _, unit = value.strip().partition(" ")
    try:
        factor = float(number)
    except ValueError:
        factor = math.nan
    if not math.isfinite(factor) or factor == 0.0:
        raise InputError(f"'{value}' is no quantity", why="it is a number and a unit", todo='write it as "0.075 m"')
    found = parse_unit(unit) if unit.strip() else Unit("1", 1.0, NONE)
    return Unit(value.strip(), factor * found.factor, found.dimension)


def fits(unit: Unit, wanted: str) -> bool:
    """Whether a unit has the dimension of a channel's."""
    return unit.dimension == parse_unit(wanted).dimension
