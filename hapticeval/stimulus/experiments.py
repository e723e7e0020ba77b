"""Experiments and their robots, as suite files write them: who pushes, what is pushed, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from hapticeval.devices.catalogue import make_device
from hapticeval.devices.device import Device
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.catalogue import read_effects
from hapticeval.errors import DomainError, InputError
from hapticeval.geometry.model import Model
from hapticeval.scene import Scene
from hapticeval.stimulus.paths import below, read_path, read_rows
from hapticeval.stimulus.stimulus import Experiment, Hand, Path
from hapticeval.types import Array


def build_scene(model: Model, spec: Mapping[str, Any]) -> Scene:
    """The scene of a suite's `scene` table.

    Numbers go to `Scene` as they are. `device` is a name of `devices.catalogue` or a table of `kind` and its
    parameters; a point mass has the tool's mass and the model's dimension where it gives none. Effects are written as
    `effects.catalogue.read_effects` reads them. Raises `InputError` for a device of another dimension than the model,
    and as those do.
    """
    values, effects = read_effects(spec)
    if "inner_loop" in values:
        values["inner_loop"] = InnerLoop(values["inner_loop"])
    if "device" in values:
        values["device"] = _device(values["device"], values.get("mass", Scene.mass), model)
    return Scene(model=model, effects=effects, **values)


def _device(spec: str | Mapping[str, Any], mass: float, model: Model) -> Device:
    given = {"kind": spec} if isinstance(spec, str) else dict(spec)
    if given["kind"] == PointMass.name:
        given = {"mass": mass, "dimension": model.dimension, **given}
    device = make_device(**given)
    if device.dimension != model.dimension:
        raise InputError(
            f"device '{device.name}' moves in {device.dimension}D, and model '{model.name}' is in {model.dimension}D",
            why="hand and model must live in the same space",
            todo=f"use point-mass, or parallelogram-{model.dimension}dof",
        )
    return device


def build_experiment(spec: Mapping[str, Any], folder: FilePath) -> Experiment:
    """The experiment of a suite's `experiment` table.

    The operator's force comes from rows `force` (s, N, N[, N]) or from a CSV file `force_file` with the header
    `t,fx,fy[,fz]`, and a `hand` draws the tool along its `path`: `points` with a `duration`, run through at even
    times, or a `file`: CSV with the header `t,x,y[,z]`, or a recording (.h5), whose HIP it is. Files count from the
    suite's `folder`. Raises `InputError`, naming the file and the row, for what cannot be read, and as `Experiment`
    and `Hand` do.
    """
    position = np.array(spec["position"], dtype=np.float64)
    rows = _force(spec, folder, position.size)
    return Experiment(
        duration=spec["duration"],
        position=position,
        velocity=np.array(spec.get("velocity", np.zeros(position.size)), dtype=np.float64),
        force_time=rows[:, 0],
        force=rows[:, 1:],
        hand=_hand(spec["hand"], folder) if "hand" in spec else None,
    )


def _force(spec: Mapping[str, Any], folder: FilePath, dimension: int) -> Array:
    if "force_file" in spec:
        if "force" in spec:
            raise InputError("both force and force_file are given", why="they say the same", todo="leave one out")
        return read_rows(
            below(folder, str(spec["force_file"])),
            "force",
            "a time in seconds and newtons",
            ("t", "fx", "fy", "fz"),
        )
    try:
        return np.array(spec.get("force", [[0.0] * (dimension + 1)]), dtype=np.float64)
    except ValueError as error:
        raise InputError("the rows of force differ in length", why="each is a time and a force") from error


def _hand(spec: Mapping[str, Any], folder: FilePath) -> Hand:
    path = spec["path"]
    if "file" in path:
        desired = read_path(below(folder, str(path["file"])))
    else:
        try:
            points = np.array(path["points"], dtype=np.float64)
        except ValueError as error:
            raise InputError("the points of the hand's path differ in dimension") from error
        desired = Path(np.linspace(0.0, path["duration"], len(points)), points)
    return Hand(path=desired, stiffness=spec["stiffness"], damping=spec.get("damping", 0.0))


def check_workspace(scene: Scene, experiment: Experiment) -> None:
    """See that model and start lie where the scene's robot can be (Assumption 7.1).

    Raises `InputError`, with the first point that does not.
    """
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
