"""All effects by kind, and how suites, results and recordings write them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any

from hapticeval.effects.bump_map import BumpMap
from hapticeval.effects.delay import Delay
from hapticeval.effects.effect import Effect
from hapticeval.effects.encoder import Encoder
from hapticeval.effects.force_sensor import ForceSensor
from hapticeval.effects.height_map import HeightMap
from hapticeval.effects.joint_friction import JointFriction
from hapticeval.effects.saturation import Saturation
from hapticeval.effects.stochastic_texture import StochasticTexture
from hapticeval.effects.velocity_filter import VelocityFilter
from hapticeval.effects.viscosity import Viscosity
from hapticeval.errors import InputError, UnknownNameError

EFFECTS: dict[str, type[Effect]] = {
    each.kind: each
    for each in (
        Viscosity,
        Encoder,
        VelocityFilter,
        ForceSensor,
        Saturation,
        Delay,
        JointFriction,
        HeightMap,
        BumpMap,
        StochasticTexture,
    )
}
"""Kind -> class, in the order in which effects take part in a tick. A new effect is named here."""

LISTED = "effects"
"""The entry of a scene's table that lists effects, each a table of `kind` and its numbers."""


def read_effects(table: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[Effect, ...]]:
    """Return what else a scene's table holds, and its effects: those listed under `effects`, and their short forms.

    `viscosity = 0.3` is short for `effects = [{ kind = "viscosity", coefficient = 0.3 }]`, see `Effect.keys`. Raises
    `UnknownNameError` for an unknown kind, number or short form, and `InputError` for numbers that an effect lacks or
    cannot have.
    """
    listed = [dict(each) for each in table.get(LISTED, ())]
    groups = {key.partition(".")[0] for kind in EFFECTS.values() for key in kind.keys if "." in key}
    short = {key: value for key, value in table.items() if key not in groups}
    short |= {f"{group}.{key}": value for group in groups for key, value in table.get(group, {}).items()}
    known = {key: (kind, field) for kind, made in EFFECTS.items() for key, field in made.keys.items()}
    gathered: dict[str, dict[str, Any]] = {}
    for key, value in short.items():
        if key in known:
            kind, field = known[key]
            gathered.setdefault(kind, {"kind": kind}).update({field: value} if field else value)
        elif "." in key:
            group = key.partition(".")[0]
            names = [each.rpartition(".")[2] for each in known if each.startswith(f"{group}.")]
            raise UnknownNameError(f"entry of {group}", key.removeprefix(f"{group}."), names)
    rest = {key: value for key, value in short.items() if key not in known and "." not in key and key != LISTED}
    return rest, tuple(make_effect(each) for each in [*listed, *gathered.values()])


def short_forms() -> dict[str, bool]:
    """Return the entries of a scene's table that are short forms of effects, and whether each is a number."""
    return {key.partition(".")[0]: "." not in key for kind in EFFECTS.values() for key in kind.keys}


def make_effect(document: Mapping[str, Any]) -> Effect:
    """Make an effect of a table of `kind` and its numbers. Raises `InputError` as `read_effects` does."""
    kind = document.get("kind")
    if kind not in EFFECTS:
        raise UnknownNameError("effect", str(kind), EFFECTS)
    numbers = {name: value for name, value in document.items() if name != "kind"}
    names = [each.name for each in fields(EFFECTS[kind])]
    for name in numbers:
        if name not in names:
            raise UnknownNameError(f"number of effect '{kind}'", name, names)
    try:
        return EFFECTS[kind](**numbers)
    except TypeError as error:
        raise InputError(f"effect '{kind}' lacks a number", why=str(error), todo=f"give {', '.join(names)}") from error


def in_order(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return effects in the catalogue's order, without those that are off. Raises `InputError` for two of a kind."""
    found: dict[str, Effect] = {}
    for each in effects:
        if each.kind in found:
            raise InputError(f"the scene lists two effects '{each.kind}'", todo="leave one out")
        found[each.kind] = each
    order = list(EFFECTS)
    kept = (each for each in found.values() if not each.off)
    return tuple(sorted(kept, key=lambda each: order.index(each.kind) if each.kind in order else len(order)))
