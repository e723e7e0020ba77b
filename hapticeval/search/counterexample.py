"""Counterexamples as files: a suite of one case with its path, which anyone can run, and what a later search needs.

A case lies below the folder of a search as RENDERER/CHECK.toml, with CHECK.csv beside it where the hand is led along a
path, CHECK.ply where the model is a mesh that was drawn, and CHECK.json, which holds the same case as moves, what it
breaks, and how it was found.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import msgspec
from msgspec import Struct

from hapticeval.documents import convert, parse_json
from hapticeval.errors import InputError
from hapticeval.files import file_stem, replacing
from hapticeval.quantity import length, quantity
from hapticeval.search.hunt import JUMPS, Found
from hapticeval.search.trial import RENDERER, Fault
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.stimulus.moves import Moves
from hapticeval.suite.case import Case

VERSIONED = ("hapticeval", "hypothesis", "numpy", "scipy", "numba")
"""Packages on whose versions it may depend what a search finds."""


class Kept(Struct, frozen=True, kw_only=True):
    """What CHECK.json holds: the case as it was found, its fault, and what found it.

    `jump`: two HIPs of a path, m, and how far the IHIP jumps between them, m.
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

    @property
    def case(self) -> Case:
        """The case, to be tried and shrunk."""
        return Case(
            name=_name(self.fault),
            title=f"Breaks {self.renderer}",
            model=self.model,
            checks=self.checks,
            scene=self.scene,
            trajectory=self.trajectory,
            experiment=self.experiment,
        )


def kept(found: Found, renderer: str, seed: int) -> Kept:
    """Return what is kept of a counterexample."""
    case = found.case
    pair = found.pair
    return Kept(
        renderer=renderer,
        fault=found.fault,
        model=dict(case.model),
        checks=case.checks,
        scene=dict(case.scene),
        trajectory=case.trajectory if isinstance(case.trajectory, Moves) else None,
        experiment=case.experiment,
        examples=found.examples,
        seed=seed,
        complete=found.complete,
        jump=None if pair is None else (tuple(pair[0].tolist()), tuple(pair[1].tolist()), pair[2]),
        versions={name: version(name) for name in VERSIONED},
    )


def line(made: Kept) -> str:
    """Return a counterexample in one line: what breaks, on how small a case, after how many examples."""
    fault = made.fault
    what = f"{fault.check}: {fault.message};"
    if fault.check == JUMPS and fault.value is not None and fault.kind in ("mini", "major"):
        what = f"{'mini ' * (fault.kind == 'mini')}pop-through of {length(fault.value)}"
    elif fault.check == RENDERER:
        what = f"{fault.message};"
    many = f"after {made.examples} example{'s' * (made.examples != 1)}"
    if made.trajectory is None:
        assert made.experiment is not None
        return f"{what} in an experiment of {quantity(made.experiment.duration, 's')}, {many}"
    return f"{what} on a path of {length(made.trajectory.length)}, {many}"


def notes(made: Kept) -> list[str]:
    """Return what there is to know besides: the bisection of a jump, and a shrink that was cut short."""
    said = []
    if made.jump is not None:
        low, high, jump = made.jump
        said.append(f"the IHIP jumps {length(jump)} between HIPs {length(math.dist(low, high))} apart")
    elif made.fault.check == JUMPS and made.complete:
        said.append("between HIPs a nanometre apart no such jump is left, or none can be looked for: a steep place")
    if not made.complete:
        said.append("the time was over before it was as small as it gets")
    return said


def write(made: Kept, folder: FilePath) -> list[FilePath]:
    """Write a counterexample below `folder`, and return the paths of its files; an earlier one of that check goes."""
    place, name = _place(folder, made.renderer), _name(made.fault)
    files = {f"{name}.toml": _suite(made, name), f"{name}.json": _json(made)}
    if made.trajectory is not None:
        path = made.trajectory.path()
        axes = ",".join("xyz"[: path.dimension])
        rows = [
            ",".join(map(repr, [t, *point])) for t, point in zip(path.time.tolist(), path.points.tolist(), strict=True)
        ]
        files[f"{name}.csv"] = "\n".join([f"t,{axes}", *rows, ""])
    if _drawn_mesh(made.model):
        files[f"{name}.ply"] = _ply(made.model["vertices"], made.model["triangles"])
    for file, text in files.items():
        with replacing(place / file) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [place / file for file in files]


def _place(folder: FilePath, renderer: str) -> FilePath:
    """Return the folder of a renderer: its name as far as a file may have it, with a digest where another has that."""
    whole = folder / file_stem(renderer)
    short = folder / whole.name.partition("~")[0]
    if whole.is_dir() or short == folder or any(each.renderer != renderer for each in map(_read, _files(short))):
        return whole
    return short


def read_all(folder: FilePath) -> list[Kept]:
    """Return the counterexamples below `folder`, in the order of their names.

    Raises `InputError`, naming the file, for one that is none of ours.
    """
    return [_read(file) for file in _files(folder)]


class Listed(NamedTuple):
    """A counterexample on disk, for who shows it: what is kept of it, its `suite` file, and its `picture` if any.

    `kept.case` is the case with its checks, `kept.fault` what it breaks, `line` that in a sentence, and `notes` what
    there is to know besides.
    """

    kept: Kept
    suite: FilePath
    picture: FilePath | None

    @property
    def line(self) -> str:
        """See `line`."""
        return line(self.kept)

    @property
    def notes(self) -> list[str]:
        """See `notes`."""
        return notes(self.kept)


def listed(folder: FilePath, *, suffix: str = ".svg") -> list[Listed]:
    """Return the counterexamples below `folder` by renderer and check, with pictures of a `suffix`: .svg or .png.

    None where there is no such folder. Raises `InputError`, naming the file, for one that is none of ours.
    """
    found = []
    for file in _files(folder):
        picture = file.with_suffix(suffix)
        found.append(Listed(_read(file), file.with_suffix(".toml"), picture if picture.is_file() else None))
    return sorted(found, key=lambda each: (each.kept.renderer, each.kept.fault.check))


def _files(folder: FilePath) -> list[FilePath]:
    return [file for file in sorted(folder.rglob("*.json")) if file.with_suffix(".toml").is_file()]


def _read(file: FilePath) -> Kept:
    try:
        document = parse_json(file.read_bytes(), file.name)
    except (OSError, InputError) as error:
        raise InputError(f"cannot read the counterexample {file}", why=str(error), todo="remove it") from error
    made: Kept = convert(document, Kept, str(file), todo="remove it, or have it written anew")
    return made


def _name(fault: Fault) -> str:
    return file_stem(fault.check)


def _json(made: Kept) -> str:
    return msgspec.json.format(msgspec.json.encode(made), indent=1).decode() + "\n"


def _suite(made: Kept, name: str) -> str:
    """Return a suite of one case: what `hapticeval run FILE -r RENDERER` takes."""
    shows = line(made)
    entries: dict[str, Any] = {
        "name": name,
        "title": f"What breaks {made.renderer}",
        "shows": shows,
        "model": {"kind": "mesh", "file": f"{name}.ply", "unit": "m"} if _drawn_mesh(made.model) else made.model,
        "scene": made.scene,
        "checks": list(made.checks),
    }
    if made.trajectory is not None:
        entries["trajectory"] = {"kind": "file", "path": f"{name}.csv"}
    else:
        entries["experiment"] = msgspec.to_builtins(made.experiment)
    text = [
        f"# Found by hapticeval search, seed {made.seed}. Run it: hapticeval run {name}.toml -r RENDERER",
        f"title = {_toml(f'What breaks {made.renderer}')}",
        "",
        "[[case]]",
        *(f"{key} = {_toml(value)}" for key, value in entries.items() if value not in ({}, None)),
        "",
    ]
    return "\n".join(text)


def _drawn_mesh(model: Mapping[str, Any]) -> bool:
    """Whether a model is a mesh whose triangles stand in its table, in metres."""
    return model["kind"] == "mesh" and "vertices" in model and model.get("unit", "m") == "m"


def _ply(vertices: Sequence[Sequence[float]], triangles: Sequence[Sequence[int]]) -> str:
    """Return a mesh as a PLY file, with all digits."""
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


def _toml(value: Any) -> str:
    """Return a value of JSON in TOML's words, on one line; entries that are None are left out."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_toml(each)}" for key, each in value.items() if each is not None) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
