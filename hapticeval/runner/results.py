"""The results document: what ran, what was found, and whether that is all of it; the one input of every report."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from importlib import metadata, resources
from pathlib import Path
from typing import Any

from hapticeval.errors import HapticevalError, InputError
from hapticeval.files import file_stem, plain, replacing, without_non_finite
from hapticeval.phenomena.verdict import Verdict, warns

__all__ = [
    "FILE",
    "Results",
    "environment",
    "file_stem",
    "read_results",
    "to_json",
    "validate",
    "verdict_document",
    "write_results",
]

FILE = "results.json"
FORMAT_VERSION = 1
Document = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Results:
    """Everything that a report needs, as JSON values; `results.schema.json` says what each entry holds.

    `planned` and `ran` count verdicts; an incomplete run says the `reason`. `runs` has an entry a (suite, case,
    renderer), `verdicts` one a check of it. `table` maps row titles to renderers to "Yes" or "No", and
    `published_table` is the same as printed, where the suites carry it. `suites` says of each suite that ran its
    `name`, `title` and `citation`, and the titles of its `rows`.
    """

    planned: int
    ran: int
    complete: bool
    reason: str | None
    environment: Document
    seed: int
    command: Document
    runs: Sequence[Document]
    verdicts: Sequence[Document]
    table: Mapping[str, Mapping[str, str]]
    timing: Document
    published_table: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    suites: Sequence[Document] = field(default_factory=list)
    format_version: int = FORMAT_VERSION


def is_recorded(run: Document) -> bool:
    """Whether an entry of `runs` is the recorded run of a replay, which is no renderer's."""
    replay = run.get("replay")
    return replay is not None and replay["difference"] is None


def all_refused(results: Results) -> bool:
    """Whether every renderer refused every case: then nothing was judged. A recorded run is no renderer."""
    runs = [run for run in results.runs if not is_recorded(run)]
    return bool(runs) and all(run.get("refusal") for run in runs)


def is_warning(verdict: Document) -> bool:
    """Whether a verdict document is a warning: see `hapticeval.phenomena.verdict.warns`."""
    return warns(verdict["level"], verdict["outcome"], verdict["published"])


def stops(results: Results, verdict: Document) -> bool:
    """Whether a verdict stops a gate: it is not as expected, or a warning of a run that is strict."""
    return not verdict["as_expected"] or (bool(results.command.get("strict")) and is_warning(verdict))


def verdict_document(verdict: Verdict) -> dict[str, Any]:
    """A verdict as JSON values.

    A number that JSON cannot hold becomes null, and `evidence["not_finite"]` then says what it was, so that an
    infinite metric is never lost without a trace.
    """
    finding = verdict.finding
    metric = finding.metric
    measured, lost = without_non_finite(
        plain(
            {
                "metric": None if metric is None else {"name": metric.name, "value": metric.value, "unit": metric.unit},
                "bound": finding.bound,
                "evidence": finding.evidence,
            },
            "verdict",
        ),
        "verdict",
    )
    margin = finding.margin
    if lost:
        measured["evidence"]["not_finite"] = [what.removeprefix("verdict.") for what in lost]
        margin = without_non_finite(plain(margin))[0]
    return {
        "renderer": verdict.renderer,
        "suite": verdict.suite,
        "case": verdict.case,
        "check": verdict.check,
        "level": verdict.level.value,
        "outcome": verdict.outcome.value,
        "metric": measured["metric"],
        "bound": measured["bound"],
        "margin": plain(margin),
        "evidence": measured["evidence"],
        "message": finding.message,
        "published": None if verdict.published is None else verdict.published.value,
        "as_expected": verdict.as_expected,
    }


def to_json(results: Results) -> str:
    """The document as JSON text that any reader takes: no NaN, no infinity; null stands for them."""
    return json.dumps(_document(results), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _document(results: Results) -> dict[str, Any]:
    names = [each.name for each in fields(Results)]
    ordered = ["format_version", *(name for name in names if name != "format_version")]
    document, _ = without_non_finite(plain({name: getattr(results, name) for name in ordered}, "results"))
    return dict(document)


def write_results(directory: Path, results: Results) -> Path:
    """Write `directory`/results.json, whole or not at all, and return its path.

    Raises `InputError` for results that do not fit the schema, and `HapticevalError` where the file cannot be
    written.
    """
    validate(_document(results))
    path = Path(directory) / FILE
    try:
        with replacing(path) as temporary:
            temporary.write_text(to_json(results), encoding="utf-8")
    except OSError as error:
        raise HapticevalError(f"cannot write {path}", why=error.strerror or str(error)) from error
    return path


def read_results(directory: Path) -> Results:
    """Read `directory`/results.json.

    Raises `InputError`, naming file and place, for a folder or file that is not there, JSON that is broken, a
    format version other than ours, and a document that does not fit the schema.
    """
    directory = Path(directory)
    path = directory / FILE
    if not directory.is_dir():
        raise InputError(
            f"no result folder '{directory}'",
            why="it is a file" if directory.exists() else "there is no such folder",
            todo="name the folder that `hapticeval run -o` wrote",
        )
    try:
        document = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_constant)
    except FileNotFoundError as error:
        raise InputError(
            f"'{directory}' holds no {FILE}",
            why="a run writes it",
            todo="name the folder that `hapticeval run -o` wrote",
        ) from error
    except OSError as error:
        raise InputError(f"cannot read {path}", why=error.strerror or str(error)) from error
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path} is not JSON: line {error.lineno}, column {error.colno}",
            why=error.msg,
            todo="run again: the file was cut or edited",
        ) from error
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path} is not JSON text", why=str(error), todo="run again: the file was damaged or edited"
        ) from error
    validate(document, place=str(path))
    return Results(**document)


def _no_constant(name: str) -> Any:
    raise ValueError(f"it holds {name}, which is no JSON number")


def validate(document: Any, *, place: str = "results") -> None:
    """Raise `InputError`, naming the entry, for a document that is not results of this format."""
    from jsonschema.exceptions import best_match

    version = document.get("format_version") if isinstance(document, Mapping) else None
    if isinstance(version, int) and version != FORMAT_VERSION:
        newer = version > FORMAT_VERSION
        raise InputError(
            f"{place} has results format {version}; this hapticeval reads format {FORMAT_VERSION}",
            why="a newer hapticeval wrote it" if newer else "no such format was released",
            todo="update hapticeval" if newer else "run again",
        )
    worst = best_match(_validator().iter_errors(document))
    if worst is not None:
        where = worst.json_path.removeprefix("$").removeprefix(".") or "the document"
        raise InputError(
            f"{place} does not fit the results format at {where}",
            why=worst.message if len(worst.message) < 300 else worst.message[:300] + " ...",
            todo="run again, or mend that entry",
        )
    if document["ran"] > document["planned"] or (document["complete"] and document["ran"] != document["planned"]):
        raise InputError(
            f"{place} says that {document['ran']} of {document['planned']} planned verdicts ran, "
            f"and that it is {'complete' if document['complete'] else 'incomplete'}",
            why="a complete run has as many verdicts as were planned, and no run has more",
        )


@cache
def _validator() -> Any:
    """Compiled once: a run writes its results every second."""
    from jsonschema import Draft202012Validator

    schema = resources.files("hapticeval.runner").joinpath("results.schema.json").read_text(encoding="utf-8")
    return Draft202012Validator(json.loads(schema))


def environment() -> dict[str, Any]:
    """What the numbers may depend on: versions and the kind of machine, no names of hosts, users or folders."""
    versions: dict[str, str | None] = {}
    for name in ("hapticeval", "numpy", "scipy", "numba", "shapely", "h5py"):
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = None
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpu_count": os.cpu_count(),
        "versions": versions,
    }
