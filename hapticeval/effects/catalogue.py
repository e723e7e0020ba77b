"""All effects by kind, and how suites, results and recordings write them.

An effect is imported when something first calls for it: a process whose scenes call for none imports none. So what has
to be known of every effect stands here, and the rest in its class. A check or a renderer names a kind by the constants
below.

To add one: a file with its class, whose `kind` is the key, and an entry in `EFFECTS` at the place at which it takes its
turn among those of its stage. One that acts outside of contact (`Alters.FREE_SPACE`) comes last wherever it stands:
friction and its like take any force that they are given as contact.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from hapticeval.effects.effect import Alters, Effect
from hapticeval.errors import InputError, UnknownNameError


class Entry(NamedTuple):
    """What is known of an effect without importing it.

    - `place`: its class, as "module:Class" with the module from this package on.
    - `meaning`: completes "the scene asks for KIND: ..." of an effect that renderers may declare to support; empty
      where no renderer has to do with it.
    - `short`: its short forms, a key of the scene's table, with a dot for one of a table in it, to the field, or to ""
      for all fields.
    """

    place: str
    meaning: str = ""
    short: Mapping[str, str] = {}

    @property
    def of(self) -> type[Effect]:
        """The class, which is imported now at the latest."""
        module, _, name = self.place.partition(":")
        effect_type: type[Effect] = getattr(import_module(module, __package__), name)
        return effect_type


VISCOSITY, FORCE_SENSOR = "viscosity", "force-sensor"
FRICTION, VISCOUS_FRICTION, LUGRE = "friction", "viscous-friction", "lugre"
SHADING, STOCHASTIC_TEXTURE = "shading", "stochastic-texture"
HEIGHT_MAP, BUMP_MAP = "height-map", "bump-map"
CONTACT_IMPULSE, CONTACT_TRANSIENT, RECORDED_IMPULSE = "contact-impulse", "contact-transient", "recorded-impulse"
SATURATION, JOINT_FRICTION = "saturation", "joint-friction"
"""Kinds that other rooms ask for by name."""

EFFECTS: dict[str, Entry] = {
    SHADING: Entry(".shading:Shading", "the force follows normals interpolated between vertices (4.15)"),
    HEIGHT_MAP: Entry(".reliefs:HeightMap", "the surface has a relief, felt as the potential K (d + h)^2 / 2 (4.3.2)"),
    BUMP_MAP: Entry(".reliefs:BumpMap", "the normal is turned by a relief (4.16)"),
    FRICTION: Entry(
        ".friction:Friction", "the surface holds a tool that sticks, and brakes one that slides (4.18), (4.20)"
    ),
    VISCOUS_FRICTION: Entry(
        ".viscous_friction:ViscousFriction", "the surface brakes a hand in contact in proportion to its speed along it"
    ),
    LUGRE: Entry(".lugre:LuGre", "the surface holds and brakes the tool by bristles that bend (LuGre)"),
    STOCHASTIC_TEXTURE: Entry(
        ".stochastic_texture:StochasticTexture", "the surface shakes the tool that slides along it (4.3.2)"
    ),
    VISCOSITY: Entry(
        ".viscous_friction:Viscosity",
        "the surface brakes the tool that slides along it (7.18)",
        {"viscosity": "coefficient"},
    ),
    CONTACT_IMPULSE: Entry(".transients:ContactImpulse", "a contact begins with a pulse that stops the device (4.21)"),
    CONTACT_TRANSIENT: Entry(".transients:ContactTransient", "a contact begins with a decaying vibration (4.3.4)"),
    RECORDED_IMPULSE: Entry(".transients:RecordedImpulse", "a contact begins with a pulse that was measured (4.3.4)"),
    "encoder": Entry(
        ".sensors:Encoder", short={"imperfections.encoder_step": "step", "imperfections.encoder_counts": "counts"}
    ),
    "velocity-filter": Entry(".sensors:VelocityFilter", short={"imperfections.velocity_cutoff": "cutoff"}),
    FORCE_SENSOR: Entry(
        ".sensors:ForceSensor",
        "the hand's force is measured, and the tool moves along the surface as under that force (8.6)",
        {"imperfections.force_sensor": ""},
    ),
    SATURATION: Entry(".actuators:Saturation", short={"imperfections.torque_limit": "limit"}),
    "delay": Entry(".actuators:Delay", short={"imperfections.delay": "time"}),
    JOINT_FRICTION: Entry(".actuators:JointFriction", short={"imperfections.friction": "torque"}),
}
"""Kind -> entry, in the order in which effects take part in a tick; see `in_order`."""

LISTED, EACH = "effects", "effect"
"""The entries of a scene's table that list effects, each a table of `kind` and its numbers: as `effects = [...]`, or
one after the other as `[[case.scene.effect]]`."""


def read_effects(table: Mapping[str, Any], folder: Path = Path()) -> tuple[dict[str, Any], tuple[Effect, ...]]:
    """Read the effects of a scene's table, listed or in short form; return the table's other entries, and the effects.

    Files that an effect names count from `folder`. `viscosity = 0.3` is short for `effects = [{ kind = "viscosity",
    coefficient = 0.3 }]`, see `Entry.short`. Raises `UnknownNameError` for an unknown kind, number or short form, and
    `InputError` for numbers that an effect lacks or cannot have.
    """
    listed = [dict(document) for entry in (LISTED, EACH) for document in table.get(entry, ())]
    # a short form is a key of the table itself, or "group.key" of a table in it
    groups = {key.partition(".")[0] for entry in EFFECTS.values() for key in entry.short if "." in key}
    short = {key: value for key, value in table.items() if key not in groups}
    short |= {f"{group}.{key}": value for group in groups for key, value in table.get(group, {}).items()}
    field_of = {key: (kind, field) for kind, entry in EFFECTS.items() for key, field in entry.short.items()}
    documents_by_kind: dict[str, dict[str, Any]] = {}
    for key, value in short.items():
        if key in field_of:
            # several short forms may be numbers of one effect; an empty field stands for all of them
            kind, field = field_of[key]
            documents_by_kind.setdefault(kind, {"kind": kind}).update({field: value} if field else value)
        elif "." in key:
            group = key.partition(".")[0]
            names = [short_form.rpartition(".")[2] for short_form in field_of if short_form.startswith(f"{group}.")]
            raise UnknownNameError(f"entry of {group}", key.removeprefix(f"{group}."), names)
    other_entries = {
        key: value
        for key, value in short.items()
        if key not in field_of and "." not in key and key not in (LISTED, EACH)
    }
    return other_entries, tuple(make_effect(document, folder) for document in [*listed, *documents_by_kind.values()])


def short_forms() -> dict[str, bool]:
    """Return the entries of a scene's table that are short forms of effects, and whether each is a number."""
    return {key.partition(".")[0]: "." not in key for entry in EFFECTS.values() for key in entry.short}


def make_effect(document: Mapping[str, Any], folder: Path = Path()) -> Effect:
    """Make an effect of a table of `kind` and its numbers. Raises `InputError` as `read_effects` does."""
    kind = document.get("kind")
    if kind not in EFFECTS:
        raise UnknownNameError("effect", str(kind), EFFECTS)
    effect_type = EFFECTS[kind].of
    numbers = effect_type.read({name: value for name, value in document.items() if name != "kind"}, folder)
    names = [field.name for field in fields(effect_type)]
    for name in numbers:
        if name not in names:
            raise UnknownNameError(f"number of effect '{kind}'", name, names)
    try:
        return effect_type(**numbers)
    except TypeError as error:
        raise InputError(f"effect '{kind}' lacks a number", why=str(error), todo=f"give {', '.join(names)}") from error


def in_order(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return effects in the catalogue's order, without those that are off. Raises `InputError` for two of a kind.

    Those with a force in free space come last: the others would take it for contact.
    """
    effect_of: dict[str, Effect] = {}
    for effect in effects:
        if effect.kind in effect_of:
            raise InputError(f"the scene lists two effects '{effect.kind}'", todo="leave one out")
        effect_of[effect.kind] = effect
    order = list(EFFECTS)

    def turn(effect: Effect) -> tuple[bool, int]:
        place = order.index(effect.kind) if effect.kind in order else len(order)
        return Alters.FREE_SPACE in effect.alters, place

    return tuple(sorted((effect for effect in effect_of.values() if not effect.off), key=turn))
