"""One case: what is touched, how the hand is led or pushes, and the checks that judge it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from functools import cache, lru_cache
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal, get_type_hints

from msgspec import Meta, Struct, defstruct, structs

from hapticeval.closed_forms import CLOSED_FORMS
from hapticeval.devices.catalogue import make_device
from hapticeval.devices.device import Device
from hapticeval.devices.point_mass import PointMass
from hapticeval.documents import convert
from hapticeval.effects.catalogue import LISTED, read_effects
from hapticeval.errors import DomainError, InputError, at
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.model import Model
from hapticeval.renderer import wrapped
from hapticeval.scene import Scene
from hapticeval.stimulus.experiments import AnyTrajectory, ExperimentTable
from hapticeval.stimulus.motions import AnyMotion, path_in_body
from hapticeval.stimulus.moves import Move, Moves, shortest_duration
from hapticeval.stimulus.paths import Trajectory
from hapticeval.stimulus.stimulus import Experiment, Path, Stimulus


class Generated(Trajectory, frozen=True, kw_only=True, tag="generated"):
    """A trajectory of random hand paths, one after the other: see `hapticeval.strategies.hand_paths`.

    - `seed`: the same one gives the same path with the same version of hypothesis.
    - `examples`: how many paths; from one to the next the hand goes straight, through the model if need be.
    - `parts`: what paths are made of, all kinds if none are given; `most`: how many parts a path has at most.
    """

    seed: Annotated[int, Meta(ge=0)]
    strategy: Literal["hand", "hand-with-tremor"] = "hand"
    examples: Annotated[int, Meta(ge=1, le=10_000)] = 20
    parts: tuple[str, ...] = ()
    most: int = 3

    def path(self, surface: Boundary, folder: FilePath) -> Path:  # noqa: ARG002 - as every trajectory
        """Return the path, drawn once for a surface; see `Trajectory.path` and `hand_paths`."""
        known: Any = surface
        return _drawn_path(self, known)


@lru_cache(maxsize=8)
def _drawn_path(table: Generated, surface: Boundary) -> Path:
    from hapticeval import strategies

    # Strategies draw on models, and read nothing of one but its boundary.
    model = Model(surface.name, {}, surface)
    drawn = strategies.hand_paths(
        model, parts=table.parts or strategies.PARTS, most_parts=table.most, tremor=table.strategy == "hand-with-tremor"
    )
    paths = strategies.examples(drawn, table.examples, seed=table.seed)
    moves = list(paths[0].moves)
    for before, after in pairwise(paths):
        # A straight move joins two paths; it is left out where the next starts where this one ended.
        length = math.dist(before.moves[-1].to, after.start)
        moves += [Move(to=after.start, seconds=shortest_duration(length)), *after.moves] if length else after.moves
    tremor = next((path.tremor for path in paths if path.tremor is not None), None)
    return Moves(start=paths[0].start, moves=tuple(moves), tremor=tremor).path()


BUILT_ENTRIES = ("model", LISTED)
"""Entries of a scene that are built apart from its table's plain entries."""


@cache
def _scene_table() -> type[Struct]:
    """Make the type that checks a `scene` table without effects: the numbers and choices of `Scene`, and a device."""
    hints = get_type_hints(Scene) | {"device": str | dict[str, Any] | None, "believed": dict[str, float] | None}
    # Taken from `Scene` itself, so that a new number of scenes is an entry of suite files at once.
    entries = [
        (field.name, hints[field.name], field.default) for field in fields(Scene) if field.name not in BUILT_ENTRIES
    ]
    return defstruct("SceneTable", entries, forbid_unknown_fields=True, frozen=True)


def build_scene(model: Model, table: Mapping[str, Any], folder: FilePath = FilePath()) -> Scene:
    """Return the scene of a suite's `scene` table.

    - `device`: a name of `devices.catalogue`, or a table of `kind` and its parameters. A point mass has the tool's mass
      and the model's dimension where it gives none.
    - `believed`: parameters of the device that its inner loop takes for others, `{ b1 = 0.37 }`.
    - `effects`: a list, or short forms, see `read_effects`; paths of their files are relative to `folder`.

    Raises `InputError` for an entry that a scene does not have, for a device of another dimension than the model, and
    as `Scene` does.
    """
    plain_entries, effects = read_effects(table, folder)
    values = structs.asdict(convert(plain_entries, _scene_table(), "scene"))
    if values["believed"] is not None and values["device"] is None:
        raise InputError("believed says what a device is taken for, and there is no device", todo="give the device")
    if values["device"] is not None:
        if values["believed"] is not None:
            values["believed"] = _believed(values["believed"], values["device"], values["mass"], model)
        values["device"] = _device(values["device"], values["mass"], model)
    return Scene(model=model, effects=effects, **values)


BELIEVABLE = ("b1", "b2", "b3", "d1", "d2", "d3")
"""Parameters of a robot that its inner loop may take for others: what an identification gives, and no length."""


def _believed(parameters: Mapping[str, float], device: str | Mapping[str, Any], mass: float, model: Model) -> Device:
    """Return the `device` with other `parameters`. Raises `InputError` for one that cannot be taken for another."""
    unknown = [name for name in parameters if name not in BELIEVABLE]
    if unknown:
        raise InputError(
            f"believed: {unknown[0]} = {parameters[unknown[0]]!r}",
            why="an inner loop takes inertias and dampings of a robot for others; its encoders know the lengths",
            todo=f"use: {', '.join(BELIEVABLE)}",
        )
    table = {"kind": device} if isinstance(device, str) else dict(device)
    return _device({**table, **parameters}, mass, model)


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
    from hapticeval.devices.device import require_in_workspace

    device = scene.robot
    if isinstance(device, PointMass):
        return
    try:
        # Assumption 7.1: all of the model lies within the functional workspace, and so does the start.
        require_in_workspace(device, scene.model)
        device.joints(experiment.position)
    except DomainError as error:
        raise InputError(error.what, why=error.why, todo=error.todo) from error


Published = dict[str, dict[str, Literal["pass", "fail"]]]
"""Renderer, then check, then the outcome in print."""


class CaseEntries(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a case and the `[[case]]` table of a suite file have in common.

    - `depth_of`: whether a trajectory's depth counts from the model's surface or from that of the renderer's own
      `representation`, which may lie deeper than the trajectory.
    - `judged`: a case that is not is shown, and never counts.
    - `published`: outcomes in print.
    - `closed_form`: for a renderer the name of the formula that it follows here.
    """

    name: Annotated[str, Meta(pattern=r"^[a-z0-9][a-z0-9.-]*$")]
    title: str
    model: dict[str, Any]
    checks: Annotated[tuple[str, ...], Meta(min_length=1)]
    shows: str = ""
    citation: str = ""
    depth_of: Literal["model", "representation"] = "model"
    scene: dict[str, Any] = {}
    trajectory: AnyTrajectory | Generated | None = None
    experiment: ExperimentTable | None = None
    judged: bool = True
    published: Published = {}
    closed_form: dict[str, str] = {}

    def __post_init__(self) -> None:
        if not isinstance(self.model.get("kind"), str):
            raise ValueError("the model has no kind")


class Case(CaseEntries, frozen=True, kw_only=True):
    """One scene with one stimulus and the checks that read its recording; paths of files are relative to `folder`."""

    folder: FilePath = FilePath()

    @property
    def stimulus_kind(self) -> Literal["trajectory", "experiment"]:
        """ "trajectory" (playback) or "experiment" (closed loop)."""
        return "trajectory" if self.experiment is None else "experiment"

    def build_scene(self) -> Scene:
        """Return the scene, its model built once in each process."""
        # A table is not a key of a cache; its text is.
        return build_scene(_model(json.dumps(self.model, sort_keys=True)), self.scene, self.folder)

    def build_stimulus(self, scene: Scene, renderer: object) -> Stimulus:
        """Return the path or the experiment; depths count from the renderer's own surface where `depth_of` says so.

        Raises `InputError` where the stimulus has another dimension than the model.
        """
        if self.experiment is not None:
            stimulus: Stimulus = self.experiment.experiment(self.folder)
        else:
            assert self.trajectory is not None
            # Unless the case says otherwise depth counts from the model, whatever surface the renderer has of it.
            own = None
            if renderer is not None and self.depth_of == "representation":
                own = wrapped(renderer).surface
            stimulus = self.trajectory.path(own or scene.model.boundary, self.folder)
            if scene.motion is not None and stimulus.dimension == scene.model.dimension:
                stimulus = _path_in_body(stimulus, scene.motion, scene)
        dimension = scene.model.dimension
        if stimulus.dimension != dimension:
            raise InputError(
                f"the HIP is led in {stimulus.dimension}D on a {dimension}D model",
                why="HIP and model must live in the same space",
                todo="project the trajectory onto the model's plane: drop a column"
                if dimension == 2
                else "give three columns, or a model in the plane",
            )
        return stimulus

    def check_stimulus(self) -> None:
        """Raise `InputError`, naming the case, for a stimulus that does not fit the scene.

        That is one of another dimension, out of the robot's reach (Assumption 7.1), or along which an effect makes no
        sense; and a closed form that does not hold in the scene.
        """
        with at(f"case '{self.name}'"):
            scene = self.build_scene()
            # No renderer is at hand yet: the depth counts from the model, whatever `depth_of` says.
            stimulus = self.build_stimulus(scene, None)
            if isinstance(stimulus, Experiment):
                check_workspace(scene, stimulus)
                _check_even(scene)
            else:
                _, hips = stimulus.sampled(scene.sampling_time)
                for effect in scene.effects:
                    effect.check_path(scene, hips)
            # A closed form holds for certain models and gains only.
            for name in self.closed_form.values():
                CLOSED_FORMS[name].check(scene)


PATH_POINTS_A_TICK = 4
"""Points of a path that is taken from the world into the body's frame: refined runs see its true shape."""


def _path_in_body(path: Path, motion: AnyMotion, scene: Scene) -> Path:
    """Return the path of a hand, in whichever frame it is given, in the frame of the scene's body.

    Raises `InputError` where a path of the world, or one on a body that jumps, begins inside: a hand that is led in
    first needs ticks, and the body moves on in them.
    """
    if motion.frame == "world":
        path = path_in_body(path, motion, scene.sampling_time / PATH_POINTS_A_TICK)
    depth = -float(scene.model.boundary.signed_distance(path.points[:1])[0])
    if depth > 0.0 and not scene.bilateral and (motion.frame == "world" or motion.jumps):
        raise InputError(
            f"a path begins {1e3 * depth:.3g} mm inside a body that moves, in the frame of the {motion.frame}",
            why="a hand is led in first, and the body would move on meanwhile",
            todo="let it begin in free space",
        )
    return path


def _check_even(scene: Scene) -> None:
    """Raise `InputError` for an experiment with a body in whose frame a device would not do as it does at rest."""
    motion = scene.motion
    if motion is not None and not (motion.even and motion.frame == "body" and isinstance(scene.robot, PointMass)):
        raise InputError(
            f"an experiment with a {scene.robot.name} and a motion of kind '{motion.kind}' in the frame of the "
            f"{motion.frame}",
            why="a loop runs in the frame of the body: it does the same there only of a point mass, on a body that "
            "slides evenly",
            todo="give a trajectory, or kind = 'slide'",
        )


@lru_cache(maxsize=128)  # all our suites have 77
def _model(document: str) -> Model:
    return make_model(**json.loads(document))
