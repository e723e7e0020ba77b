"""One case: what is touched, how the hand is led or pushes, and the checks that judge it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path as FilePath
from typing import Any

from hapticeval.closed_forms.form import CLOSED_FORMS
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.model import Model
from hapticeval.phenomena.verdict import Outcome
from hapticeval.renderer import stated
from hapticeval.scene import Scene
from hapticeval.stimulus.experiments import build_experiment, build_scene, check_workspace
from hapticeval.stimulus.paths import build_path
from hapticeval.stimulus.stimulus import Experiment, Stimulus

Published = Mapping[str, Mapping[str, Outcome]]


@dataclass(frozen=True, kw_only=True)
class Case:
    """One scene with one stimulus and the checks that read its recording.

    `depth_of` says whose surface a trajectory's depth counts from: the `model`'s, or that of the renderer's own
    `representation`, which may lie deeper than the trajectory. An unjudged case is shown and never counts.
    `published` maps renderer and check to the outcome in print, and `closed_form` the renderer to the name of its
    closed form.
    """

    name: str
    title: str
    shows: str
    citation: str
    model: Mapping[str, Any]
    depth_of: str
    scene: Mapping[str, Any]
    trajectory: Mapping[str, Any] | None
    experiment: Mapping[str, Any] | None
    checks: tuple[str, ...]
    judged: bool
    published: Published
    closed_form: Mapping[str, str]
    folder: FilePath = field(repr=False)

    @property
    def stimulus_kind(self) -> str:
        """ "trajectory" (playback) or "experiment" (closed loop)."""
        return "experiment" if self.trajectory is None else "trajectory"

    def build_scene(self) -> Scene:
        """The scene, its model built once a process."""
        return build_scene(_model(json.dumps(self.model, sort_keys=True)), self.scene)

    def build_stimulus(self, scene: Scene, renderer: object) -> Stimulus:
        """The path or the experiment; the renderer's own surface counts where `depth_of` says so.

        Raises `InputError` when the stimulus has another dimension than the model.
        """
        stimulus = self._stimulus(scene, renderer)
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
        """Raise `InputError`, naming the case, for a stimulus that no renderer could be given.

        Nor may the robot be unable to reach it (Assumption 7.1), or a closed form be about something else.
        """
        try:
            scene = self.build_scene()
            stimulus = self.build_stimulus(scene, None)
            if isinstance(stimulus, Experiment):
                check_workspace(scene, stimulus)
            for name in self.closed_form.values():
                CLOSED_FORMS[name].check(scene)
        except InputError as error:
            raise InputError(f"case '{self.name}': {error.what}", why=error.why, todo=error.todo) from error

    def _stimulus(self, scene: Scene, renderer: object) -> Stimulus:
        if self.trajectory is None:
            return build_experiment(self.experiment or {}, self.folder)
        surface = scene.model.boundary
        if self.depth_of == "representation":
            surface = stated(renderer, "surface") or surface
        return build_path(self.trajectory, surface, self.folder)


@lru_cache(maxsize=64)
def _model(document: str) -> Model:
    return make_model(**json.loads(document))
