"""Suites: files of cases, each a scene, a stimulus and the checks that judge it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache
from importlib import resources
from pathlib import Path as FilePath
from types import MappingProxyType
from typing import Any

from hapticeval.closed_forms.form import CLOSED_FORMS
from hapticeval.documents import read_document
from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.experiments import build_experiment, build_scene, check_workspace
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.model import Model
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.scene import Scene
from hapticeval.stimulus import Experiment, Stimulus
from hapticeval.trajectories import build_path

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
            surface = getattr(renderer, "surface", None) or surface
        return build_path(self.trajectory, surface, self.folder)


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of the summary table: Yes where `check` passes in all `cases` (globs), with what is in print."""

    title: str
    check: str
    cases: tuple[str, ...]
    published: Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class Suite:
    """A file of cases and the rows of the table that they fill; `renderers` are run where none are named."""

    name: str
    title: str
    citation: str
    cases: tuple[Case, ...]
    rows: tuple[Row, ...]
    renderers: tuple[str, ...] = ()


@lru_cache(maxsize=64)
def _model(document: str) -> Model:
    return make_model(**json.loads(document))


def find_suites() -> Mapping[str, FilePath]:
    """The suites that are installed, by name."""
    folder = FilePath(str(resources.files("hapticeval.suites")))
    return MappingProxyType({file.stem: file for file in sorted(folder.glob("*.toml"))})


def suites_named(name_or_path: str) -> tuple[str, ...]:
    """The suite of that name or path, or the group of suites whose names begin with it and a hyphen.

    Raises `UnknownNameError` for a name of neither.
    """
    known = find_suites()
    if name_or_path in known or FilePath(name_or_path).suffix == ".toml":
        return (name_or_path,)
    group = tuple(name for name in known if name.startswith(f"{name_or_path}-"))
    if not group:
        raise UnknownNameError("suite", name_or_path, [*known, *suite_groups()])
    return group


def suite_groups() -> Mapping[str, tuple[str, ...]]:
    """The groups of installed suites: what stands before the hyphen, and the names that begin so."""
    groups: dict[str, list[str]] = {}
    for name in find_suites():
        first, hyphen, _ = name.partition("-")
        if hyphen:
            groups.setdefault(first, []).append(name)
    return {first: tuple(names) for first, names in groups.items() if len(names) > 1}


def load_suite(name_or_path: str) -> Suite:
    """A suite by its name or by the path of a TOML file.

    Raises `UnknownNameError` for neither, and `InputError`, naming file and case, for a file that is not TOML, does
    not fit the schema, or names unknown checks or models.
    """
    known = find_suites()
    file = known.get(name_or_path)
    if file is None:
        file = FilePath(name_or_path)
        if file.suffix != ".toml":
            raise UnknownNameError("suite", name_or_path, known)
        if not file.is_file():
            raise InputError(f"no suite file {file}", todo=f"check the path, or use one of: {', '.join(known)}")
    document = read_document(file, "suite.schema.json")
    variants = document.get("variant", {})
    cases = tuple(case for spec in document["case"] for case in _cases(spec, variants, file))
    _refuse_repeats([case.name for case in cases], file.name)
    rows = tuple(_row(spec, file.name) for spec in document.get("row", []))
    for row in rows:
        for pattern in row.cases:
            if not any(fnmatchcase(case.name, pattern) and row.check in case.checks for case in cases):
                raise InputError(
                    f"{file.name}: row '{row.title}' asks for '{row.check}' in '{pattern}'",
                    why="no case of that name has that check",
                    todo=f"the cases are: {', '.join(case.name for case in cases)}",
                )
    return Suite(
        name=file.stem,
        title=document["title"],
        citation=document.get("citation", ""),
        cases=cases,
        rows=rows,
        renderers=tuple(document.get("renderers", ())),
    )


def _refuse_repeats(names: list[str], file: str) -> None:
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InputError(f"{file} has two cases named '{name}'", todo="give each case a name of its own")


def _row(spec: Mapping[str, Any], file: str) -> Row:
    _check_known(spec["check"], f"{file}: row '{spec['title']}'")
    return Row(
        title=spec["title"],
        check=spec["check"],
        cases=tuple(spec["cases"]),
        published=spec.get("published", {}),
    )


def _check_known(name: str, place: str) -> None:
    if name not in CHECKS:
        error = UnknownNameError("check", name, CHECKS)
        raise InputError(f"{place}: {error.what}", todo=error.todo)


def _cases(spec: Mapping[str, Any], variants: Mapping[str, Any], file: FilePath) -> Iterator[Case]:
    """The case and its variants, or one for each entry of its sweep."""
    place = f"{file.name}: case '{spec['name']}'"
    for label in spec.get("variants", ()):
        if label not in variants:
            error = UnknownNameError("variant", label, variants)
            raise InputError(f"{place}: {error.what}", todo=error.todo)
    for renderer, form in spec.get("closed_form", {}).items():
        if form not in CLOSED_FORMS:
            error = UnknownNameError("closed form", form, CLOSED_FORMS)
            raise InputError(f"{place}: {error.what} for '{renderer}'", todo=error.todo)
    for check in spec["checks"]:
        _check_known(check, place)
    trajectory = spec.get("trajectory")
    if "sweep" not in spec:
        if trajectory is not None and trajectory["kind"] in ("scaled", "arc") and "depth" not in trajectory:
            raise InputError(
                f"{place}: a '{trajectory['kind']}' trajectory needs a depth", todo="give depth, or a sweep"
            )
        yield _case(spec, spec["name"], trajectory, spec.get("published", {}), file)
        for label in spec.get("variants", ()):
            varied = _varied(spec, variants[label])
            yield _case(varied, f"{spec['name']}-{label}", trajectory, {}, file)
        return
    if trajectory is None:
        raise InputError(f"{place}: a sweep is over the depth of a trajectory", todo="write a case an experiment")
    for entry in spec["sweep"]:
        swept = {**trajectory, "depth": entry["depth"]}
        published = {
            renderer: {**spec.get("published", {}).get(renderer, {}), **entry.get("published", {}).get(renderer, {})}
            for renderer in [*spec.get("published", {}), *entry.get("published", {})]
        }
        titled = {**spec, "title": f"{spec['title']}: {1e3 * entry['depth']:.3g} mm"}
        yield _case(titled, f"{spec['name']}-{entry['label']}", swept, published, file)


def _varied(spec: Mapping[str, Any], variant: Mapping[str, Any]) -> Mapping[str, Any]:
    """The case in another scene. What is in print, closed forms too, is about the case as it stands, not about this."""
    scene = {**spec.get("scene", {}), **variant["scene"]}
    checks = [check for check in spec["checks"] if check != "closed-form"]
    varied = {**spec, "scene": scene, "checks": checks, "title": f"{spec['title']}, {variant['title']}"}
    varied.pop("closed_form", None)
    for name in ("shows", "citation", "judged"):
        if name in variant:
            varied[name] = variant[name]
    return varied


def _case(
    spec: Mapping[str, Any],
    name: str,
    trajectory: Mapping[str, Any] | None,
    published: Mapping[str, Mapping[str, str]],
    file: FilePath,
) -> Case:
    for renderer, outcomes in published.items():
        for check in outcomes:
            if check not in spec["checks"]:
                raise InputError(
                    f"{file.name}: case '{name}': an outcome of '{check}' is published for '{renderer}'",
                    why="the case does not have that check",
                    todo=f"its checks are: {', '.join(spec['checks'])}",
                )
    case = Case(
        name=name,
        title=spec["title"],
        shows=" ".join(spec.get("shows", "").split()),
        citation=spec.get("citation", ""),
        model=spec["model"],
        depth_of=spec.get("depth_of", "model"),
        scene=spec.get("scene", {}),
        trajectory=trajectory,
        experiment=spec.get("experiment"),
        checks=tuple(spec["checks"]),
        judged=spec.get("judged", True),
        published={
            renderer: {check: Outcome(outcome) for check, outcome in outcomes.items()}
            for renderer, outcomes in published.items()
        },
        closed_form=spec.get("closed_form", {}),
        folder=file.parent,
    )
    try:
        case.build_scene()
    except HapticevalError as error:
        raise InputError(f"{file.name}: case '{name}': {error.what}", why=error.why, todo=error.todo) from error
    return case
