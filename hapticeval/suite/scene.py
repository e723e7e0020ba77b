"""Scenes as suite files write them, on a model, and whether the scene's robot can do what a case asks of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from typing import Any, get_type_hints

from msgspec import Struct, defstruct, structs

from hapticeval.devices.catalogue import make_device
from hapticeval.devices.device import Device
from hapticeval.devices.imperfections import ForceSensor, Imperfections
from hapticeval.devices.point_mass import PointMass
from hapticeval.documents import convert
from hapticeval.errors import DomainError, InputError, UnknownNameError
from hapticeval.geometry.model import Model
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Experiment


@cache
def _table() -> type[Struct]:
    """Make the type of a `scene` table: the numbers and choices of `Scene`, and what is built of words."""
    hints = get_type_hints(Scene) | {"device": str | dict[str, Any] | None, "imperfections": dict[str, Any]}
    entries = [(each.name, hints[each.name], each.default) for each in fields(Scene) if each.name != "model"]
    return defstruct(
        "SceneTable",
        [(name, kind, {} if name == "imperfections" else d) for name, kind, d in entries],
        forbid_unknown_fields=True,
        frozen=True,
    )


def build_scene(model: Model, table: Mapping[str, Any]) -> Scene:
    """Return the scene of a suite's `scene` table.

    `device` is a name of `devices.catalogue` or a table of `kind` and its parameters; a point mass has the tool's mass
    and the model's dimension where it gives none. `imperfections` are
    those of `Imperfections`, with `encoder_counts` (counts a turn) instead of `encoder_step` where that is wanted, and
    a table `force_sensor`. Raises `InputError` for an entry that a scene does not have, for a device of another
    dimension than the model, and as `Scene` does.
    """
    values = structs.asdict(convert(dict(table), _table(), "scene"))
    if values["device"] is not None:
        values["device"] = _device(values["device"], values["mass"], model)
    turning = values["device"] is not None and not isinstance(values["device"], PointMass)
    values["imperfections"] = _imperfections(values["imperfections"], turning)
    return Scene(model=model, **values)


def _device(given: str | Mapping[str, Any], mass: float, model: Model) -> Device:
    given = {"kind": given} if isinstance(given, str) else dict(given)
    if given.get("kind") == PointMass.name:
        given = {"mass": mass, "dimension": model.dimension, **given}
    device = make_device(**given)
    if device.dimension != model.dimension:
        raise InputError(
            f"device '{device.name}' moves in {device.dimension}D, and model '{model.name}' is in {model.dimension}D",
            why="hand and model must live in the same space",
            todo=f"use point-mass, or parallelogram-{model.dimension}dof",
        )
    return device


def _imperfections(spec: Mapping[str, Any], turning: bool) -> Imperfections:
    values = dict(spec)
    known = [*(each.name for each in fields(Imperfections)), "encoder_counts"]
    for name in values:
        if name not in known:
            raise UnknownNameError("entry of imperfections", name, known)
    counts = values.pop("encoder_counts", None)
    if counts is not None:
        if "encoder_step" in values:
            raise InputError("both encoder_counts and encoder_step are given", todo="leave one out")
        if not turning:
            raise InputError(
                f"encoder_counts = {counts!r} for a point mass",
                why="counts are of a turn, and its joints are its position in metres",
                todo="give encoder_step (m), or a device with joints that turn",
            )
        values["encoder_step"] = 2.0 * math.pi / counts
    if "force_sensor" in values:
        values["force_sensor"] = ForceSensor(**values["force_sensor"])
    return Imperfections(**values)


def check_workspace(scene: Scene, experiment: Experiment) -> None:
    """Raise `InputError`, with the first point, where model or start are out of the robot's reach (Assumption 7.1)."""
    from hapticeval.devices.workspace import require

    device = scene.robot
    if isinstance(device, PointMass):
        return
    try:
        require(device, scene.model)
        start = device.joints(experiment.position)
    except DomainError as error:
        raise InputError(error.what, why=error.why, todo=error.todo) from error
    if not device.margin(start) > 0.0:
        raise InputError(
            f"the experiment starts at ({', '.join(f'{x:g}' for x in experiment.position)}) m",
            why=f"that is outside of the functional workspace of {device.name}",
            todo="start nearer to its home, the origin",
        )
