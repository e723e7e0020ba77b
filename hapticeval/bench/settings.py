"""What is benched: every renderer at every value of its knobs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import cast

from hapticeval.bench.quantity import length
from hapticeval.discovery import own_renderers, resolve
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.knob import Settings, knobs_of, turned
from hapticeval.renderer import RendererFactory


@dataclass(frozen=True, eq=False)
class Setting:
    """A renderer with its knobs at given values."""

    renderer: str
    values: Settings
    factory: RendererFactory
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """For instance `constraint@polygon vertices 80`, `minimum-distance@lut cell 0.5mm`."""
        return " ".join([self.renderer, *(told(knob, value, self.units[knob]) for knob, value in self.values.items())])


def told(knob: str, value: float, unit: str) -> str:
    """A knob's value in words; lengths in millimetres."""
    return f"{knob} {1e3 * value:g}mm" if unit == "m" else f"{knob} {value:g}{unit}"


def own_variants() -> list[str]:
    """The renderers that come with hapticeval, each on every representation that it offers."""
    names = []
    for name in own_renderers():
        offered = getattr(resolve(name), "representations", None)
        names += [f"{name}@{each}" for each in offered] if offered else [name]
    return names


def settings_of(
    renderers: Sequence[str], *, quick: bool, chosen: Mapping[str, Sequence[float]] | None = None
) -> list[Setting]:
    """Every setting of the renderers, in the order given, coarse before fine.

    Each knob is swept alone, the others as the renderer itself has them. `chosen` says which knobs to sweep instead,
    and over which values, on the renderers that have them: then in every combination. Raises `UnknownNameError` for a
    knob that none of them has, and as `resolve` does.
    """
    factories = {name: resolve(name) for name in dict.fromkeys(renderers)}
    knobs = {name: knobs_of(factory) for name, factory in factories.items()}
    asked = dict(chosen or {})
    known = {knob for each in knobs.values() for knob in each}
    for knob in asked:
        if knob not in known:
            raise UnknownNameError(f"knob of {', '.join(factories)}", knob, known)
    found = []
    for name, factory in factories.items():
        wanted = {knob: values for knob, values in asked.items() if knob in knobs[name]}
        if wanted:
            every = [dict(zip(wanted, values, strict=True)) for values in product(*wanted.values())]
        else:
            every = [
                {knob: value}
                for knob, each in knobs[name].items()
                for value in (each.quick if quick and each.quick else each.values)
            ]
        units = {knob: each.unit for knob, each in knobs[name].items()}
        for setting in every or [{}]:
            found.append(Setting(name, setting, cast("RendererFactory", turned(factory, setting, name=name)), units))
    return found


def chosen_values(options: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """The values of `--knob vertices=40,80,160` or `--knob cell=1mm,0.5mm`, by knob.

    Raises `InputError` for anything else.
    """
    chosen: dict[str, tuple[float, ...]] = {}
    for option in options:
        knob, equals, text = option.partition("=")
        try:
            values = tuple(_number(each) for each in text.split(","))
        except (ValueError, InputError):
            values = ()
        if not knob or not equals or not values or not all(0.0 < value < float("inf") for value in values):
            raise InputError(
                f"--knob {option}",
                why="it is a knob's name, '=' and positive numbers with commas between",
                todo="for instance --knob vertices=40,80,160",
            )
        chosen[knob.strip()] = values
    return chosen


def _number(text: str) -> float:
    """A plain number, or a length with its unit in metres."""
    try:
        return float(text)
    except ValueError:
        return length(text, option="--knob")
