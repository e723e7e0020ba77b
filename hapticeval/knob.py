"""Knobs: what of a renderer can be set finer or coarser, so that `hapticeval bench` can sweep it.

A factory declares them as `knobs`, a mapping from names to `Knob`s, and sets them by `with_knobs(**values)`, which
returns the factory with some of them set: see `renderer.Choices`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hapticeval.errors import InputError, UnknownNameError


@dataclass(frozen=True, kw_only=True)
class Knob:
    """One setting of a renderer, such as a cell's size: `values`, the coarsest first, in `unit` ("" for a count).

    `quick` are the values of a quick sweep, all `values` where it is empty.

    A renderer that has no exact form is measured against itself at the last of `finest`, and the one before shows how
    far that has converged; without `finest` these are the last two that are swept.

    Raises `InputError` for a knob without values.
    """

    values: tuple[float, ...]
    unit: str
    meaning: str
    quick: tuple[float, ...] = ()
    finest: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.values:
            raise InputError("a knob without values", why="a sweep needs at least one", todo="give it values")


Settings = Mapping[str, float]
"""Values by knob."""


def refuse_unknown(settings: Mapping[str, object], known: Mapping[str, Knob], *, name: str) -> None:
    """Raise `UnknownNameError` for the first of `settings` that is no knob of the renderer `name`."""
    for knob in settings:
        if knob not in known:
            # Of several the first is named: the user mends one word at a time.
            raise UnknownNameError(f"knob of {name}", knob, known)
