"""Knobs: what of a renderer can be set finer or coarser, so that `hapticeval bench` can sweep it.

A factory may have

- `knobs`: a mapping from names to `Knob`s;
- `with_knobs(**values)`: the factory with some of them set.

Both are looked up by name, on any factory, ours or a third party's: there is nothing to inherit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

from hapticeval.errors import InputError, UnknownNameError


@dataclass(frozen=True, kw_only=True)
class Knob:
    """One setting of a renderer: `values` to sweep, from the coarsest to the finest, in `unit` ("" for a count).

    `quick` are the values of a quick sweep, all `values` where it is empty. A renderer that has no exact form is
    measured against itself at the last of `finest`, and the one before shows how far that has converged; without
    `finest` these are the last two that are swept. Raises `InputError` for a knob without values.
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


def knobs_of(factory: object) -> Mapping[str, Knob]:
    """Return the knobs that a factory declares; none where it declares none.

    Raises `InputError` where it declares knobs and has no `with_knobs` to set them.
    """
    knobs = getattr(factory, "knobs", None) or {}
    if knobs and not callable(getattr(factory, "with_knobs", None)):
        raise InputError(
            f"the factory {factory!r} declares the knobs {', '.join(knobs)} and cannot set them",
            why="it has no with_knobs(**values)",
            todo="add with_knobs(**values), which returns the factory with those values",
        )
    return cast("Mapping[str, Knob]", knobs)


def configured(factory: Callable[..., object], settings: Settings, *, name: str) -> Callable[..., object]:
    """Return the factory with its knobs at `settings`; `name` is what the user called the renderer.

    Raises `UnknownNameError`, with the closest, for a knob that it does not have.
    """
    if not settings:
        return factory
    refuse_unknown(settings, knobs_of(factory), name=name)
    with_knobs = cast("Callable[..., Callable[..., object]]", getattr(factory, "with_knobs"))  # noqa: B009
    return with_knobs(**settings)


def refuse_unknown(given: Mapping[str, object], known: Mapping[str, Knob], *, name: str) -> None:
    """Raise `UnknownNameError` for the first of `given` that is no knob of the renderer `name`."""
    for knob in given:
        if knob not in known:
            raise UnknownNameError(f"knob of {name}", knob, known)
