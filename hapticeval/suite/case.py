"""One case: what is touched, how the hand is led or pushes, and the checks that judge it."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

from hapticeval.closed_forms import CLOSED_FORMS
from hapticeval.errors import InputError, at
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.model import Model
from hapticeval.renderer import abilities_of
from hapticeval.scene import Scene
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.stimulus.stimulus import Experiment, Stimulus
from hapticeval.stimulus.trajectories import AnyTrajectory
from hapticeval.suite.generated import Generated
from hapticeval.suite.scene import build_scene, check_workspace

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
        # A table is no key of a cache; its text is.
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
                own = abilities_of(renderer).surface
            stimulus = self.trajectory.path(own or scene.model.boundary, self.folder)
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
            else:
                _, hips = stimulus.sampled(scene.sampling_time)
                for effect in scene.effects:
                    effect.check_path(scene, hips)
            # A closed form holds for certain models and gains only.
            for name in self.closed_form.values():
                CLOSED_FORMS[name].check(scene)


@lru_cache(maxsize=64)
def _model(document: str) -> Model:
    return make_model(**json.loads(document))
