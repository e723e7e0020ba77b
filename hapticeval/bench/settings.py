"""What is benched: every renderer at every combination of the values of its knobs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import cast

from hapticeval.bench.reference import swept
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

    @property
    def label(self) -> str:
        """For instance `constraint@polygon vertices 80`."""
        return " ".join([self.renderer, *(f"{knob} {value:g}" for knob, value in self.values.items())])


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

    `chosen` replaces the values of knobs by name, on the renderers that have them. Raises `UnknownNameError` for a
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
        sweep = {knob: asked.get(knob) or swept(each, quick=quick) for knob, each in knobs[name].items()}
        for values in product(*sweep.values()):
            setting = dict(zip(sweep, values, strict=True))
            found.append(Setting(name, setting, cast("RendererFactory", turned(factory, setting, name=name))))
    return found


def chosen_values(options: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """The values of `--knob vertices=40,80,160`, by knob. Raises `InputError` for anything else."""
    chosen: dict[str, tuple[float, ...]] = {}
    for option in options:
        knob, equals, text = option.partition("=")
        try:
            values = tuple(float(each) for each in text.split(","))
        except ValueError:
            values = ()
        if not knob or not equals or not values or not all(0.0 < value < float("inf") for value in values):
            raise InputError(
                f"--knob {option}",
                why="it is a knob's name, '=' and positive numbers with commas between",
                todo="for instance --knob vertices=40,80,160",
            )
        chosen[knob.strip()] = values
    return chosen
