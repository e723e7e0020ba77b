"""Scenes as suite files write them, on a model, and whether the scene's robot can do what a case asks of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any, get_type_hints

from msgspec import Struct, defstruct, structs

from hapticeval.devices.catalogue import make_device
from hapticeval.devices.device import Device
from hapticeval.devices.point_mass import PointMass
from hapticeval.documents import convert
from hapticeval.effects.catalogue import LISTED, read_effects
from hapticeval.errors import DomainError, InputError
from hapticeval.geometry.model import Model
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Experiment

BUILT_ENTRIES = ("model", LISTED)
"""Entries of a scene that are built apart from its table's plain entries."""


@cache
def _scene_table() -> type[Struct]:
    """Make the type that checks a `scene` table without effects: the numbers and choices of `Scene`, and a device."""
    hints = get_type_hints(Scene) | {"device": str | dict[str, Any] | None}
    # Taken from `Scene` itself, so that a new number of scenes is an entry of suite files at once.
    entries = [
        (field.name, hints[field.name], field.default) for field in fields(Scene) if field.name not in BUILT_ENTRIES
    ]
    return defstruct("SceneTable", entries, forbid_unknown_fields=True, frozen=True)


def build_scene(model: Model, table: Mapping[str, Any], folder: Path = Path()) -> Scene:
    """Return the scene of a suite's `scene` table.

    - `device`: a name of `devices.catalogue`, or a table of `kind` and its parameters. A point mass has the tool's mass
      and the model's dimension where it gives none.
    - `effects`: a list, or short forms, see `read_effects`; paths of their files are relative to `folder`.

    Raises `InputError` for an entry that a scene does not have, for a device of another dimension than the model, and
    as `Scene` does.
    """
    plain_entries, effects = read_effects(table, folder)
    values = structs.asdict(convert(plain_entries, _scene_table(), "scene"))
    if values["device"] is not None:
        values["device"] = _device(values["device"], values["mass"], model)
    return Scene(model=model, effects=effects, **values)


def _device(device_table: str | Mapping[str, Any], mass: float, model: Model) -> Device:
    """Return the device of a scene with a tool of `mass` (kg). Raises `InputError` for another dimension."""
    device_table = {"kind": device_table} if isinstance(device_table, str) else dict(device_table)
    if device_table.get("kind") == PointMass.name:
        # What the table gives goes before what the tool has.
        device_table = {"mass": mass, "dimension": model.dimension, **device_table}
    device = make_device(**device_table)
    if device.dimension != model.dimension:
        raise InputError(
            f"device '{device.name}' moves in {device.dimension}D, and model '{model.name}' is in {model.dimension}D",
            why="hand and model must live in the same space",
            todo=f"use point-mass, or parallelogram-{model.dimension}dof",
        )
    return device


def check_workspace(scene: Scene, experiment: Experiment) -> None:
    """Raise `InputError`, naming the point, where the robot cannot reach all of the model, or the start."""
    from hapticeval.devices.workspace import require_in_workspace

    device = scene.robot
    if isinstance(device, PointMass):
        return
    try:
        # Assumption 7.1: all of the model lies within the functional workspace, and so does the start.
        require_in_workspace(device, scene.model)
        start = device.joints(experiment.position)
    except DomainError as error:
        raise InputError(error.what, why=error.why, todo=error.todo) from error
    # true for NaN as well
    if not device.margin(start) > 0.0:
        raise InputError(
            f"the experiment starts at ({', '.join(f'{x:g}' for x in experiment.position)}) m",
            why=f"that is outside of the functional workspace of {device.name}",
            todo="start nearer to its home, the origin",
        )
