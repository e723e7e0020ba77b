"""The bench document: what was measured at each setting, and beside it the raw samples. All that reports read."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import HapticevalError, InputError
from hapticeval.files import plain, replacing, without_non_finite
from hapticeval.types import IntArray

FILE = "bench.json"
SAMPLES = "bench_samples.npz"
FORMAT_VERSION = 1
Document = Mapping[str, Any]

ENTRY = {
    "renderer",
    "model",
    "settings",
    "label",
    "errors",
    "claims",
    "proven",
    "step",
    "batch",
    "memory_bytes",
    "build_seconds",
    "key",
    "front",
    "problem",
}
"""What every entry of `settings` has."""


@dataclass(frozen=True, kw_only=True)
class BenchResults:
    """A bench as JSON values.

    `settings` has one entry per model, renderer and values of its knobs: `errors` by metric (`ihip` m, `normal`
    degrees, `force` N) and statistic (`rms`, `p99`, `max`) against the reference; `claims`, those that the reference
    can prove, null without one; `step` and `batch`, seconds per step by statistic (`median`, `p99`, `p999`, `max`) and
    `tick_share`, null where not measured; `front`, the kinds of time on whose Pareto front it lies; `problem`, why an
    entry has nothing else. `references` names what errors count from, `orders` has the observed orders of convergence,
    `answers` the cheapest settings, and `comparison` the verdicts against another bench.
    """

    complete: bool
    reason: str | None
    quick: bool
    seed: int
    rounds: int
    environment: Document
    machine: Document
    command: Document
    references: Sequence[Document]
    settings: Sequence[Document]
    orders: Sequence[Document]
    answers: Sequence[Document]
    timing: Document
    comparison: Sequence[Document] = field(default_factory=list)
    format_version: int = FORMAT_VERSION


Samples = Mapping[str, IntArray]
"""`<key>/step` (rounds, n), ns, and `<key>/batch` (rounds, n), ps per step, by an entry's key."""


def write_bench(directory: Path, results: BenchResults, samples: Samples) -> list[Path]:
    """Write bench.json and its samples into a folder, each whole or not at all; return the paths written.

    Raises `HapticevalError` where a file cannot be written.
    """
    document, _ = without_non_finite(
        plain({each.name: getattr(results, each.name) for each in fields(results)}, "bench")
    )
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    paths = [Path(directory) / SAMPLES, Path(directory) / FILE]
    try:
        with replacing(paths[0]) as temporary, temporary.open("wb") as stream:
            np.savez_compressed(stream, **{name: np.asarray(each) for name, each in samples.items()})  # type: ignore[arg-type]
        with replacing(paths[1]) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise HapticevalError(f"cannot write into {directory}", why=error.strerror or str(error)) from error
    return paths[::-1]


def read_bench(directory: Path) -> BenchResults:
    """Read `directory`/bench.json.

    Raises `InputError`, naming the file, for one that is not there, is cut short or edited, or is of another version.
    """
    path = Path(directory) / FILE
    again = "run `hapticeval bench` again"
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(
            f"'{directory}' holds no {FILE}",
            why="a bench writes it",
            todo="name the folder that `hapticeval bench -o` wrote",
        ) from error
    except OSError as error:
        raise InputError(f"cannot read {path}", why=error.strerror or str(error)) from error
    except ValueError as error:
        raise InputError(f"{path} is not JSON text", why=str(error), todo=again) from error
    if not isinstance(document, dict):
        raise InputError(f"{path} is no bench", why="it is not a JSON object", todo=again)
    version = document.get("format_version")
    if version != FORMAT_VERSION:
        raise InputError(
            f"{path} has bench format {version!r}; this hapticeval reads format {FORMAT_VERSION}",
            todo="update hapticeval" if isinstance(version, int) and version > FORMAT_VERSION else again,
        )
    names = {each.name for each in fields(BenchResults)}
    if document.keys() != names:
        odd = ", ".join(sorted(document.keys() ^ names))
        raise InputError(f"{path} does not fit the bench format", why=f"not as it must be: {odd}", todo=again)
    for index, entry in enumerate(document["settings"]):
        if not isinstance(entry, dict) or not entry.keys() >= ENTRY:
            raise InputError(f"{path} does not fit the bench format at settings[{index}]", todo=again)
    return BenchResults(**document)


def read_samples(directory: Path) -> dict[str, IntArray]:
    """Read the raw samples beside a bench.json. Raises `InputError` for a file that is not there or is damaged."""
    path = Path(directory) / SAMPLES
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return {name: np.asarray(archive[name], dtype=np.int64) for name in archive.files}
    except FileNotFoundError as error:
        raise InputError(f"'{directory}' holds no {SAMPLES}", todo="run `hapticeval bench` again") from error
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(
            f"{path} is damaged", why=str(error), todo="run `hapticeval bench` again, or restore the file"
        ) from error
