"""The bench itself: build every setting of every renderer, measure its accuracy, then time all of them in turns."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import count, islice, product
from typing import Any

import numpy as np

from hapticeval.discovery import own_renderers, resolve
from hapticeval.errors import HapticevalError, InputError, RefusalError, RendererError, UnknownNameError, describe_error
from hapticeval.geometry.representations import triangulate_surface
from hapticeval.phenomena.sampling import force_floor
from hapticeval.renderer import Renderer, RendererFactory, Settings, choices_of, configured, wrapped
from hapticeval.runner.results import environment
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer, with_effects
from hapticeval.study.bench.accuracy import (
    LEAST_ERROR_SHARE,
    PLANE_PATHS,
    SPACE_MODELS,
    Answers,
    Reference,
    Workload,
    answers_to,
    equal_by_value,
    errors_against,
    fresh_scene,
    nearest_of_ours,
    on_the_exact_curve,
    reference_of,
    with_mesh,
    workload,
    worst_place,
)
from hapticeval.study.bench.document import BenchResults, Errors, ReferenceEntry, SettingEntry, Times, Uncalled
from hapticeval.study.bench.measure import (
    DoesNothing,
    Track,
    array_bytes,
    machine,
    sample_track,
    step_times,
    time_builds,
    without_garbage_collection,
)
from hapticeval.types import IntArray

Progress = Callable[[int, int, str], None]
"""Called with how many of how many pieces of work are done, and which comes next."""


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is measured: models and meshes, points of each, rounds of timing, steps per round, and builds."""

    models: tuple[str, ...]
    finer: tuple[int, ...]
    points: int
    rounds: int
    steps: int
    builds: int


QUICK = Effort(models=("cassinian",), finer=(1, 4, 16, 32), points=400, rounds=4, steps=250, builds=1)
FULL = Effort(models=tuple(PLANE_PATHS), finer=(1, 2, 4, 8, 16, 32, 128), points=1000, rounds=20, steps=1000, builds=5)


@dataclass(frozen=True, eq=False)
class Setting:
    """A renderer with its knobs at given values: `factory` builds it, `base` with the knobs as it has them.

    In space it is given a mesh `finer` than the coarsest; 0 in the plane.
    """

    renderer: str
    values: Settings
    base: RendererFactory
    factory: RendererFactory
    units: Mapping[str, str] = field(default_factory=dict)
    finer: int = 0

    def prepare(self, scene: Scene) -> Scene:
        """Return the scene as the renderer gets it: in space with a mesh for a model."""
        return with_mesh(scene, self.finer) if self.finer else scene

    @property
    def label(self) -> str:
        """The setting in words, for instance `constraint@polygon vertices 80`, `minimum-distance@lut cell 0.5mm`."""
        return " ".join(
            [self.renderer, *(_knob_text(knob, value, self.units[knob]) for knob, value in self.values.items())]
        )


def _knob_text(knob: str, value: float, unit: str) -> str:
    return f"{knob} {1e3 * value:g}mm" if unit == "m" else f"{knob} {value:.12g}{unit}"


def own_variants() -> list[str]:
    """Name the renderers that come with hapticeval, each on every representation that it offers."""
    names = []
    for name in own_renderers():
        offered = choices_of(resolve(name)).representations
        names += [f"{name}@{representation}" for representation in offered] if offered else [name]
    return names


def own_on_meshes() -> list[str]:
    """Name the renderers that come with hapticeval and take meshes: each as it is, and as a table where it has one."""
    # Refusals alone are asked for: the coarsest mesh costs least.
    coarsest = with_mesh(fresh_scene(SPACE_MODELS[0], 0), 1)
    names = []
    for name in own_renderers():
        with suppress(RefusalError):
            # A renderer that answers a stimulus whole has no step to be timed.
            if make_renderer(resolve(name), coarsest).steps:
                tabled = "lut" in (choices_of(resolve(name)).representations or ())
                names += [name, f"{name}@lut"] if tabled else [name]
    return names


def settings_of(
    renderers: Sequence[str],
    *,
    quick: bool,
    chosen: Mapping[str, Sequence[float]] | None = None,
) -> list[Setting]:
    """List every setting of the renderers, in the order given, coarse before fine.

    Each knob is swept alone, the others as the renderer itself has them; only the first knob where `quick`. `chosen`
    names the knobs to sweep instead, with their values, on the renderers that have them: then in every combination.

    Raises `UnknownNameError` for a knob that none of them has, and as `resolve` does.
    """
    factories = {name: resolve(name) for name in dict.fromkeys(renderers)}
    knobs = {name: choices_of(factory).knobs for name, factory in factories.items()}
    chosen_values = dict(chosen or {})
    known = {knob for definitions in knobs.values() for knob in definitions}
    for knob in chosen_values:
        if knob not in known:
            # A knob that one of the renderers has is enough: it is swept on those.
            raise UnknownNameError(f"knob of {', '.join(factories)}", knob, known)
    settings = []
    for name, factory in factories.items():
        swept = {knob: values for knob, values in chosen_values.items() if knob in knobs[name]}
        if swept:
            # Chosen knobs: in all combinations. Otherwise one knob at a time.
            every = [dict(zip(swept, values, strict=True)) for values in product(*swept.values())]
        else:
            every = [
                {knob: value}
                for knob, definition in islice(knobs[name].items(), 1 if quick else None)
                for value in (definition.quick if quick and definition.quick else definition.values)
            ]
        units = {knob: definition.unit for knob, definition in knobs[name].items()}
        for setting in every or [{}]:
            settings.append(Setting(name, setting, factory, configured(factory, setting, name=name), units))
    return settings


def settings_on_meshes(
    model: str, renderers: Sequence[str], *, quick: bool, chosen: Mapping[str, Sequence[float]] | None = None
) -> list[Setting]:
    """List the renderers, each on meshes of a model in space from coarse to fine.

    Tables are of the finest mesh alone, for whatever the mesh they take the same time, with their cells as `chosen`, or
    at their coarsest: space costs by the cube. Raises as `settings_of` does.
    """
    surface = fresh_scene(model, 0).model.surface
    meshes = [(finer, len(triangulate_surface(surface, finer)[1])) for finer in (QUICK if quick else FULL).finer]
    settings = []
    for name in dict.fromkeys(renderers):
        factory = resolve(name)
        cells = {
            knob: definition.values[:1]
            for knob, definition in choices_of(factory).knobs.items()
            if definition.unit == "m"
        }
        swept = {**cells, **(chosen or {})}
        without_knobs = [Setting(name, {}, factory, factory)]
        for setting in settings_of([name], quick=quick, chosen=swept) if swept else without_knobs:
            # The number of triangles is shown as if it were a knob: space is measured by meshes.
            units = {"triangles": "", **setting.units}
            # A knob in metres is a table's cell: such a renderer reads its table, whatever the mesh.
            for finer, triangles in meshes[-1:] if cells else meshes:
                values = {"triangles": float(triangles), **setting.values}
                settings.append(replace(setting, values=values, units=units, finer=finer))
    return settings


def settings_by_model(
    models: Sequence[str] | None,
    renderers: Sequence[str] | None,
    *,
    quick: bool,
    chosen: Mapping[str, Sequence[float]] | None = None,
) -> dict[str, list[Setting]]:
    """List what is measured on each model: the settings of the renderers, or of ours; without names the usual models.

    Raises `UnknownNameError` for a model that is none of `PLANE_PATHS` and `SPACE_MODELS`, and as `settings_of` does.
    """
    settings = {}
    for model in dict.fromkeys(models or (QUICK if quick else FULL).models):
        if model in PLANE_PATHS:
            settings[model] = settings_of(renderers or own_variants(), quick=quick, chosen=chosen)
        elif model in SPACE_MODELS:
            settings[model] = settings_on_meshes(model, renderers or own_on_meshes(), quick=quick, chosen=chosen)
        else:
            raise UnknownNameError("model of a bench", model, (*PLANE_PATHS, *SPACE_MODELS))
    return settings


@dataclass
class _Entry:
    """One setting on one model, and what has been measured of it so far."""

    setting: Setting
    work: Workload
    key: str
    renderer: Renderer | None = None
    reference: Reference | None = None
    errors: Errors | None = None
    worst_at: list[float] | None = None
    memory: int | None = None
    builds: list[float] = field(default_factory=list)
    meshes: list[float] = field(default_factory=list)
    problem: str | None = "not reached"
    failure: HapticevalError | None = None
    steps: list[IntArray] = field(default_factory=list)

    def document_entry(self) -> SettingEntry:
        """Return the entry of the document; errors that are rounding count as none."""
        rounded, reference, scene = self.errors, self.reference, self.work.scene
        if rounded is not None:
            # What is rounding goes with the size of the number: metres, degrees and newtons have floors of their own.
            floors = {"ihip": scene.model.size, "normal": 180.0, "force": scene.model.size * scene.stiffness}
            rounded = {
                metric: {
                    statistic: value if value > LEAST_ERROR_SHARE * floors[metric] else 0.0
                    for statistic, value in every.items()
                }
                for metric, every in rounded.items()
            }
        return SettingEntry(
            renderer=self.setting.renderer,
            model=self.work.name,
            settings=dict(self.setting.values),
            label=self.setting.label,
            errors=rounded,
            claims=None if rounded is None or reference is None else reference.claims(rounded),
            proven=None if rounded is None or reference is None else reference.proves(rounded),
            step=_time_statistics(self.steps),
            memory_bytes=self.memory,
            build_seconds=self.builds,
            mesh_seconds=self.meshes,
            reference=None if reference is None else reference.source,
            # Where nothing is off no place is the worst.
            worst_at=self.worst_at if rounded is not None and rounded["ihip"]["max"] > 0.0 else None,
            key=self.key,
            front=False,
            problem=self.problem,
        )


class Sweep:
    """A bench of some settings on each model. `run` may be stopped by Ctrl-C: what was measured is kept."""

    def __init__(
        self, settings: Mapping[str, Sequence[Setting]], *, quick: bool, seed: int, command: Mapping[str, Any]
    ) -> None:
        self.quick = quick
        self.seed = seed
        self.command = command
        self.effort = QUICK if quick else FULL
        self.works = [workload(kind, points=self.effort.points, seed=seed) for kind in settings]
        pairs = [(work, setting) for work in self.works for setting in settings[work.name]]
        self.factories = {setting.renderer: setting.base for _, setting in pairs}
        self.entries = [_Entry(setting, work, f"s{k:03d}") for k, (work, setting) in enumerate(pairs)]
        self.references: dict[tuple[str, str], Reference | None] = {}
        self.rounds = 0
        self.empty: list[IntArray] = []
        self.uncalled: list[tuple[IntArray, IntArray]] = []
        self.same_law = True
        self._fresh = count(1)
        self._compiled: set[str] = set()
        self.reason: str | None = None
        self.wall = 0.0
        self.machine = machine()

    def run(self, progress: Progress) -> None:
        """Measure all settings, one after the other: accuracy first, then rounds of timing."""
        begun = time.perf_counter()
        total = len(self.entries) + self.effort.rounds
        try:
            for done, entry in enumerate(self.entries):
                progress(done, total, f"{entry.setting.label} on the {entry.work.name}: accuracy")
                self._prepare(entry)
            # Another order in every round: a slow stretch of the machine does not always meet the same setting.
            order = np.random.default_rng(self.seed)
            for done in range(self.effort.rounds):
                progress(len(self.entries) + done, total, f"timing, round {done + 1} of {self.effort.rounds}")
                with without_garbage_collection():
                    self._round(done, order)
            progress(total, total, "")
        except KeyboardInterrupt:
            self.reason = "interrupted by the user"
        self.wall = time.perf_counter() - begun

    @property
    def failures(self) -> list[HapticevalError]:
        """The errors that stopped single settings; a refusal is none, unless nothing else came out."""
        failures = [entry.failure for entry in self.entries if entry.failure is not None]
        broken = [failure for failure in failures if not isinstance(failure, RefusalError)]
        # Where every setting was refused the refusals are the outcome.
        return failures if len(failures) == len(self.entries) else broken

    def _prepare(self, entry: _Entry) -> None:
        try:
            self._measure(entry)
            entry.problem = None
        except HapticevalError as error:
            entry.failure = error
            entry.problem = " ".join(part for part in (f"{error.what}.", error.why) if part)
        except Exception as error:
            entry.failure = RendererError(f"measuring it raised {describe_error(error)}", tick=0, hip=())
            entry.problem = entry.failure.what

    def _measure(self, entry: _Entry) -> None:
        setting, work = entry.setting, entry.work
        if setting.renderer not in self._compiled:  # what is compiled on first use is compiled now
            make_renderer(setting.factory, with_mesh(work.scene, 1) if setting.finer else work.scene)
            self._compiled.add(setting.renderer)
        # A new model for every build: a renderer may keep what it has prepared for a model.
        scenes = (fresh_scene(work.name, next(self._fresh)) for _ in range(self.effort.builds))
        built, entry.builds, took = time_builds(setting.factory, setting.prepare, scenes, self.effort.builds)
        if not isinstance(built, Renderer):
            raise _NotBenched(
                f"'{setting.renderer}' has no reset and step to be timed",
                why="it answers a whole stimulus at once",
            )
        entry.renderer, entry.meshes = built, took if setting.finer else []
        measured = answers_to(built, work)
        entry.reference = self._reference(setting, work, measured)
        if entry.reference is not None:
            entry.errors = errors_against(measured, entry.reference.answers, floor=force_floor(work.scene))
            entry.worst_at = worst_place(measured, entry.reference.answers, work).tolist()
        entry.memory = array_bytes(entry.renderer)

    def _reference(self, setting: Setting, work: Workload, measured: Answers) -> Reference | None:
        """Return the reference of a setting's renderer; those that are equal on the exact curve share one."""
        key = (setting.renderer, work.name)
        if key not in self.references:
            base = on_the_exact_curve(self.factories[setting.renderer])
            shared = [
                reference
                for (name, model), reference in self.references.items()
                if model == work.name and equal_by_value(base, on_the_exact_curve(self.factories[name]))
            ]
            if shared:
                self.references[key] = shared[0]
            else:
                reference = None
                # Without a reference of its own, the nearest of ours.
                with suppress(RefusalError):  # of what takes meshes alone
                    reference = reference_of(setting.renderer, setting.factory, work, quick=self.quick)
                self.references[key] = reference or nearest_of_ours(measured, work, quick=self.quick)
        return self.references[key]

    def _round(self, number: int, order: np.random.Generator) -> None:
        """Time every setting once, in a random order. A round that is cut short is dropped as a whole."""
        live = [entry for entry in self.entries if entry.renderer is not None]
        took: dict[str, IntArray] = {}
        tracks = {work.name: sample_track(work.slide, work.dt) for work in self.works}
        # A round fills `took` and adds it at its end: one that Ctrl-C cuts short leaves nothing.
        for k in order.permutation(len(live)):
            entry = live[k]
            along = tracks[entry.work.name]
            assert entry.renderer is not None
            # Each round goes on along the path where the last one ended.
            first = number * self.effort.steps % len(along.rows)
            took[entry.key] = step_times(entry.renderer, along, self.effort.steps, first=first)
        stepping = next((entry for entry in live if not entry.setting.finer), None)
        if stepping is not None:
            self._time_uncalled(stepping, tracks[stepping.work.name], number)
        if live:
            self.empty.append(step_times(DoesNothing(), tracks[live[0].work.name], self.effort.steps, first=0))
        self.rounds += 1
        for entry in live:
            entry.steps.append(took[entry.key])

    def _time_uncalled(self, entry: _Entry, along: Track, number: int) -> None:
        """Time a renderer as runs get it in a scene without effects, and, beside it, as its factory makes it."""
        bare = wrapped(entry.setting.factory(entry.work.scene))
        called = with_effects(bare, entry.work.scene)
        self.same_law = self.same_law and called.law is bare.law and called.renderer is bare.renderer
        # In turns, so that a slow stretch of the machine does not always meet the same.
        pair = [called.renderer, bare.renderer]
        times = [step_times(one, along, self.effort.steps, first=0) for one in (pair if number % 2 else pair[::-1])]
        called_times, bare_times = times if number % 2 else times[::-1]
        self.uncalled.append((called_times, bare_times))

    def _uncalled_cost(self) -> Uncalled | None:
        """Return what effects cost where none is called for; None where nothing was timed."""
        if not self.uncalled:
            return None
        called, bare = (float(np.median(np.concatenate(samples))) for samples in zip(*self.uncalled, strict=True))
        name = next(entry.setting.renderer for entry in self.entries if entry.renderer and not entry.setting.finer)
        return Uncalled(renderer=name, same_law=self.same_law, ratio=called / bare)

    def results(self) -> BenchResults:
        """Return what was measured as a document; `judge.judge_bench` adds fronts, orders and answers."""
        return BenchResults(
            complete=self.reason is None,
            reason=self.reason,
            quick=self.quick,
            seed=self.seed,
            rounds=self.rounds,
            environment=environment(),
            machine=self.machine,
            command=dict(self.command),
            references=[
                ReferenceEntry(
                    renderer=name,
                    model=model,
                    what=None if reference is None else reference.what,
                    disagreement=None if reference is None else reference.disagreement,
                    extrapolated=reference is not None and reference.extrapolated,
                )
                for (name, model), reference in self.references.items()
            ],
            settings=[entry.document_entry() for entry in self.entries],
            orders=[],
            answers=[],
            timing={"wall_seconds": self.wall},
            empty=_time_statistics(self.empty),
            uncalled=self._uncalled_cost(),
        )


class _NotBenched(InputError):
    """A renderer that cannot be stepped: left out, and no fault."""

    exit_code = 0


def _time_statistics(rounds: Sequence[IntArray]) -> Times | None:
    """Return statistics of a step's time from the samples of each round, (n,), ns; None without rounds."""
    if not rounds:
        return None
    seconds = [1e-9 * samples for samples in rounds]
    together = np.concatenate(seconds)
    return Times(
        median=float(np.median(together)),
        p99=float(np.quantile(together, 0.99)),
        rounds=[float(np.median(samples)) for samples in seconds],
    )
