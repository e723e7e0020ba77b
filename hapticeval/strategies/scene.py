"""Scenes: gains, a mass, a model, and the effects that they call for."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import strategies as st

from hapticeval.effects.catalogue import EFFECTS, make_effect
from hapticeval.effects.effect import Effect
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.model import Model
from hapticeval.scene import Scene
from hapticeval.strategies.plane import plane_models


def scenes(
    models: st.SearchStrategy[Model] | None = None,
    *,
    bilateral: bool | None = None,
    called: st.SearchStrategy[tuple[Effect, ...]] | None = None,
) -> st.SearchStrategy[Scene]:
    """Draw scenes on `models` (those of `plane_models` if none are given), with the effects that are `called` for.

    Stiffness is 50 to 4000 N/m, damping (N s/m) from none to critical, and the tool's mass 50 g to 1 kg. Where
    `bilateral` is None, some surfaces hold the tool from both sides and some do not.
    """
    for what, strategy in (("models", models), ("called", called)):
        if strategy is not None and not isinstance(strategy, st.SearchStrategy):
            raise InputError(
                f"{what} = {strategy!r}", why="it is no strategy", todo="use hypothesis.strategies.just(...)"
            )
    return _scenes(plane_models() if models is None else models, bilateral, st.just(()) if called is None else called)


@st.composite
def _scenes(
    draw: st.DrawFn,
    models: st.SearchStrategy[Model],
    bilateral: bool | None,
    called: st.SearchStrategy[tuple[Effect, ...]],
) -> Scene:
    stiffness = draw(st.sampled_from([1000.0, 50.0, 200.0, 4000.0]))
    mass = draw(st.sampled_from([0.1, 0.05, 0.3, 1.0]))
    ratio = draw(st.sampled_from([0.0, 0.3, 1.0]))
    return Scene(
        model=draw(models),
        stiffness=stiffness,
        # b = 2 zeta sqrt(k m), N s/m, with the damping ratio zeta from 0 to 1, the critical one
        damping=round(2.0 * ratio * math.sqrt(stiffness * mass), 3),
        mass=mass,
        bilateral=draw(st.booleans()) if bilateral is None else bilateral,
        effects=draw(called),
    )


def effects(kind: str, **numbers: st.SearchStrategy[Any]) -> st.SearchStrategy[Effect]:
    """Draw an effect of the catalogue: its `kind`, and a strategy for each of its numbers that it is to have.

    `st.tuples(effects("viscosity", coefficient=st.sampled_from([0.1, 1.0])))` is what `scenes(called=...)` takes.
    Raises `UnknownNameError` for an unknown kind; what the numbers may be is checked when they are drawn.
    """
    if kind not in EFFECTS:
        raise UnknownNameError("effect", kind, EFFECTS)
    return st.fixed_dictionaries({"kind": st.just(kind), **numbers}).map(make_effect)
