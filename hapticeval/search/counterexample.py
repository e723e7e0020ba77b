"""Counterexamples as files: a suite of one case with its path, which anyone can run, and what a later search needs.

Below the folder of a search they are in RENDERER/:

- CHECK.toml: the suite;
- CHECK.csv: the path, where the hand is led along one;
- CHECK.ply: the model, where it is a mesh that was drawn;
- CHECK.json: the same case as moves of the hand, what it breaks, and how it was found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import msgspec
from msgspec import Struct

from hapticeval.documents import convert, parse_json, toml_text
from hapticeval.errors import InputError
from hapticeval.files import file_stem, write_text
from hapticeval.quantity import format_length, format_quantity, plural
from hapticeval.search.hunt import JUMP_CHECK, FailingCase
from hapticeval.search.trial import RENDERER, Fault
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.stimulus.moves import Moves
from hapticeval.suite.case import Case

VERSIONED_PACKAGES = ("hapticeval", "hypothesis", "numpy", "scipy", "numba")
"""Packages whose versions may change what a search finds."""


class _DrawnMesh(Struct):
    """The table of a mesh that was drawn: vertices, m, and the numbers of three of them a triangle."""

    vertices: list[tuple[float, float, float]]
    triangles: list[tuple[int, int, int]]


class StoredCounterexample(Struct, frozen=True, kw_only=True):
    """What CHECK.json holds: the case as it was found, its fault, and what found it.

    `jump`: two neighbouring HIPs, m, and how far the IHIP jumps between them, m.
    """

    renderer: str
    fault: Fault
    model: dict[str, Any]
    checks: tuple[str, ...]
    scene: dict[str, Any] = {}
    trajectory: Moves | None = None
    experiment: ExperimentTable | None = None
    examples: int
    seed: int
    complete: bool
    jump: tuple[tuple[float, ...], tuple[float, ...], float] | None = None
    versions: dict[str, str] = {}

    def __post_init__(self) -> None:
        # What is read beside the case's own tables: a file may have been edited.
        if (self.trajectory is None) == (self.experiment is None):
            raise ValueError("it needs a trajectory or an experiment, and has both or none")
        if _is_drawn_mesh(self.case.model):
            msgspec.convert(self.model, _DrawnMesh)
        if self.jump is not None and not len(self.jump[0]) == len(self.jump[1]) > 0:
            raise ValueError("the two HIPs of its jump need as many numbers each")

    @property
    def case(self) -> Case:
        """The case, to be tried again and shrunk."""
        return Case(
            name=file_stem(self.fault.check),
            title=f"Breaks {self.renderer}",
            model=self.model,
            checks=self.checks,
            scene=self.scene,
            trajectory=self.trajectory,
            experiment=self.experiment,
        )


def stored_counterexample(failing_case: FailingCase, renderer: str, seed: int) -> StoredCounterexample:
    """Return a counterexample as its file holds it."""
    case = failing_case.case
    pair = failing_case.pair
    return StoredCounterexample(
        renderer=renderer,
        fault=failing_case.fault,
        model=dict(case.model),
        checks=case.checks,
        scene=dict(case.scene),
        trajectory=case.trajectory if isinstance(case.trajectory, Moves) else None,
        experiment=case.experiment,
        examples=failing_case.examples,
        seed=seed,
        complete=failing_case.complete,
        jump=None if pair is None else (tuple(pair[0].tolist()), tuple(pair[1].tolist()), pair[2]),
        versions={name: version(name) for name in VERSIONED_PACKAGES},
    )


def line(counterexample: StoredCounterexample) -> str:
    """Return a counterexample in one line: what breaks, on how small a case, after how many examples."""
    fault = counterexample.fault
    what = f"{fault.check}: {fault.message};"
    # The size of a jump says more than the check's message.
    if fault.check == JUMP_CHECK and fault.value is not None and fault.kind in ("mini", "major"):
        what = f"{'mini ' if fault.kind == 'mini' else ''}pop-through of {format_length(fault.value)}"
    elif fault.check == RENDERER:
        what = f"{fault.message};"
    after_examples = f"after {plural(counterexample.examples, 'example')}"
    if counterexample.trajectory is None:
        assert counterexample.experiment is not None
        return (
            f"{what} in an experiment of {format_quantity(counterexample.experiment.duration, 's')}, {after_examples}"
        )
    return f"{what} on a path of {format_length(counterexample.trajectory.length)}, {after_examples}"


def notes(counterexample: StoredCounterexample) -> list[str]:
    """Return further sentences: on the bisection of a jump, and on a shrink that was cut short."""
    sentences = []
    if counterexample.jump is not None:
        low, high, jump = counterexample.jump
        sentences.append(
            f"the IHIP jumps {format_length(jump)} between HIPs {format_length(math.dist(low, high))} apart"
        )
    elif counterexample.fault.check == JUMP_CHECK and counterexample.complete:
        sentences.append(
            "between HIPs a nanometre apart no such jump is left, or none can be looked for: a steep place"
        )
    if not counterexample.complete:
        sentences.append("the time was over before it was as small as it gets")
    return sentences


def write(counterexample: StoredCounterexample, folder: FilePath) -> list[FilePath]:
    """Write a counterexample below `folder`, over an earlier one of that check; return the paths of its files."""
    place, name = _renderer_folder(folder, counterexample.renderer), file_stem(counterexample.fault.check)
    files = {f"{name}.toml": _suite_text(counterexample, name), f"{name}.json": _json_text(counterexample)}
    if counterexample.trajectory is not None:
        path = counterexample.trajectory.path()
        axes = ",".join("xyz"[: path.dimension])
        # The repr of a float reads back as the same bits.
        rows = [
            ",".join(map(repr, [t, *point])) for t, point in zip(path.time.tolist(), path.points.tolist(), strict=True)
        ]
        files[f"{name}.csv"] = "\n".join([f"t,{axes}", *rows, ""])
    # Triangles of a drawn mesh go into a file of their own; the catalogue makes any other model again.
    if _is_drawn_mesh(counterexample.model):
        files[f"{name}.ply"] = _ply(counterexample.model["vertices"], counterexample.model["triangles"])
    for file, text in files.items():
        write_text(place / file, text)
    return [place / file for file in files]


def _renderer_folder(folder: FilePath, renderer: str) -> FilePath:
    """Return the folder of a renderer: its name as a file may have it, with a digest where another shares that."""
    full_name = folder / file_stem(renderer)
    short_name = folder / full_name.name.partition("~")[0]
    # The full name, with a digest, where it is in use already, or another renderer has the short one.
    if (
        full_name.is_dir()
        or short_name == folder
        or any(other.renderer != renderer for other in map(_read_counterexample, _counterexample_files(short_name)))
    ):
        return full_name
    return short_name


def read_all(folder: FilePath) -> list[StoredCounterexample]:
    """Return the counterexamples below `folder`, in the order of their names.

    Raises `InputError`, naming the file, for one that is none of ours.
    """
    return [_read_counterexample(file) for file in _counterexample_files(folder)]


class CounterexampleFiles(NamedTuple):
    """A counterexample on disk, to be shown: what is stored of it, its `suite` file, and its `picture` if any.

    `counterexample.case` is the case with its checks, and `counterexample.fault` what it breaks. `line` says that in a
    sentence, and `notes` what there is to know besides.
    """

    counterexample: StoredCounterexample
    suite: FilePath
    picture: FilePath | None

    @property
    def line(self) -> str:
        """See `line`."""
        return line(self.counterexample)

    @property
    def notes(self) -> list[str]:
        """See `notes`."""
        return notes(self.counterexample)


def list_counterexamples(folder: FilePath) -> list[CounterexampleFiles]:
    """Return the counterexamples below `folder` by renderer and check, with the pictures that are there.

    None where there is no such folder. Raises `InputError`, naming the file, for one that is none of ours.
    """
    counterexamples = []
    for file in _counterexample_files(folder):
        picture = file.with_suffix(".svg")
        counterexamples.append(
            CounterexampleFiles(
                _read_counterexample(file), file.with_suffix(".toml"), picture if picture.is_file() else None
            )
        )
    return sorted(counterexamples, key=lambda files: (files.counterexample.renderer, files.counterexample.fault.check))


def _counterexample_files(folder: FilePath) -> list[FilePath]:
    return [file for file in sorted(folder.rglob("*.json")) if file.with_suffix(".toml").is_file()]


def _read_counterexample(file: FilePath) -> StoredCounterexample:
    try:
        document = parse_json(file.read_bytes(), file.name)
    except (OSError, InputError) as error:
        raise InputError(f"cannot read the counterexample {file}", why=str(error), todo="remove it") from error
    counterexample: StoredCounterexample = convert(
        document, StoredCounterexample, str(file), todo="remove it, or have it written anew"
    )
    return counterexample


def _json_text(counterexample: StoredCounterexample) -> str:
    return msgspec.json.format(msgspec.json.encode(counterexample), indent=1).decode() + "\n"


def _suite_text(counterexample: StoredCounterexample, name: str) -> str:
    """Return a suite of one case: what `hapticeval run FILE -r RENDERER` takes."""
    shows = line(counterexample)
    entries: dict[str, Any] = {
        "name": name,
        "title": f"What breaks {counterexample.renderer}",
        "shows": shows,
        "model": {"kind": "mesh", "file": f"{name}.ply", "unit": "m"}
        if _is_drawn_mesh(counterexample.model)
        else counterexample.model,
        "scene": counterexample.scene,
        "checks": list(counterexample.checks),
    }
    if counterexample.trajectory is not None:
        entries["trajectory"] = {"kind": "file", "path": f"{name}.csv"}
    else:
        entries["experiment"] = msgspec.to_builtins(counterexample.experiment)
    text = [
        f"# Found by hapticeval search, seed {counterexample.seed}. Run it: hapticeval run {name}.toml -r RENDERER",
        f"title = {toml_text(f'What breaks {counterexample.renderer}')}",
        "",
        "[[case]]",
        # what is empty or None is the default
        *(f"{key} = {toml_text(value)}" for key, value in entries.items() if value not in ({}, None)),
        "",
    ]
    return "\n".join(text)


def _is_drawn_mesh(model: Mapping[str, Any]) -> bool:
    """Whether a model is a mesh whose triangles stand in its table, in metres."""
    return model["kind"] == "mesh" and "vertices" in model and model.get("unit", "m") == "m"


def _ply(vertices: Sequence[Sequence[float]], triangles: Sequence[Sequence[int]]) -> str:
    """Return a mesh as the text of a PLY file, with all digits."""
    return "\n".join(
        [
            *("ply", "format ascii 1.0", f"element vertex {len(vertices)}"),
            *(f"property double {axis}" for axis in "xyz"),
            *(f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"),
            *(" ".join(map(repr, vertex)) for vertex in vertices),
            *(" ".join(map(str, (len(corners), *corners))) for corners in triangles),
            "",
        ]
    )
