"""The bench document: what was measured at each setting, and beside it the raw samples. All that reports read.

The types below are its only definition: reading checks a file against them, and writing gives what reading takes.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from msgspec.structs import replace

from hapticeval.errors import InputError
from hapticeval.files import read_json, replacing, write_json, writing
from hapticeval.types import IntArray

BENCH_FILE = "bench.json"
SAMPLES_FILE = "bench_samples.npz"
FORMAT_VERSION = 2

Kind = Literal["step", "batch"]
"""A time is of single steps, or of a whole trajectory at once."""

Errors = dict[str, dict[str, float]]
"""By metric (`ihip` m, `normal` degrees, `force` N) and statistic (`rms`, `p99`, `max`)."""

Samples = Mapping[str, IntArray]
"""`<key>/step` (rounds, n), ns, and `<key>/batch` (rounds, n), ps per step, by an entry's key."""


class _DocumentPart(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of the document's objects."""


class Times(_DocumentPart, frozen=True):
    """Seconds per step by statistic; `tick_share` is the 99.9 per cent quantile as a share of the tick of 1 ms."""

    median: float
    p99: float
    p999: float
    max: float
    tick_share: float


class SettingEntry(_DocumentPart, frozen=True):
    """A renderer with values of its knobs on a model.

    - `errors` count from the reference, and `claims` are those that it can prove; None without a reference;
    - `step` and `batch` are None where not measured;
    - `worst_at` is the HIP, m, of the largest IHIP error;
    - `reference` names what they count from: settings can be compared where they share it;
    - `front` has the kinds of time on whose Pareto front the setting lies, among those that share its reference;
    - `problem` is why an entry has nothing else;
    - `kept` entries are of an earlier bench, see `join_benches`;
    - `build_seconds` are of each build of the renderer;
    - `mesh_seconds` are of the mesh that it was given for each: triangulated, checked, and its tree.
    """

    renderer: str
    model: str
    settings: dict[str, float]
    label: str
    errors: Errors | None
    claims: Errors | None
    proven: bool | None
    step: Times | None
    batch: Times | None
    memory_bytes: int | None
    build_seconds: list[float]
    key: str
    front: list[Kind]
    problem: str | None
    kept: bool = False
    # msgspec copies a list that is a default: instances do not share it.
    mesh_seconds: list[float] = []
    reference: str | None = None
    worst_at: list[float] | None = None

    def times(self, kind: Kind) -> Times | None:
        """Return the times of a kind."""
        return self.step if kind == "step" else self.batch


class ReferenceEntry(_DocumentPart, frozen=True):
    """What the errors of a renderer on a model count from, and how far its last refinement moved it; None if exact."""

    renderer: str
    model: str
    what: str | None
    disagreement: Errors | None


class OrderEntry(_DocumentPart, frozen=True):
    """The observed order of convergence of each error by a knob over its `values`, the `others` as they are."""

    renderer: str
    model: str
    knob: str
    others: dict[str, float]
    values: list[float]
    orders: dict[str, float | None]


class Answer(_DocumentPart, frozen=True):
    """The cheapest setting within an error (m) and a time (s); `key` and `label` are None where there is none.

    It is the cheapest of those whose errors count from the `reference`; None where no setting has one.
    """

    model: str
    what: Kind
    within_m: float
    budget_s: float | None
    key: str | None
    label: str | None
    reference: str | None = None


class Change(_DocumentPart, frozen=True):
    """A setting against an earlier bench: its ratio of times or errors, with the interval and p of the times."""

    model: str
    label: str
    what: str
    ratio: float | None
    low: float | None
    high: float | None
    p: float | None
    verdict: Literal["better", "worse", "not significant"]


class BenchResults(_DocumentPart, frozen=True):
    """A bench: what was measured, on which machine, by which command, and what follows from it."""

    complete: bool
    reason: str | None
    quick: bool
    seed: int
    rounds: int
    environment: dict[str, Any]
    machine: dict[str, Any]
    command: dict[str, Any]
    references: list[ReferenceEntry]
    settings: list[SettingEntry]
    orders: list[OrderEntry]
    answers: list[Answer]
    timing: dict[str, float]
    comparison: list[Change] = []
    format_version: int = FORMAT_VERSION

    def by_model(self) -> dict[str, list[SettingEntry]]:
        """Return the settings on each model."""
        by_model: dict[str, list[SettingEntry]] = {}
        for setting in self.settings:
            by_model.setdefault(setting.model, []).append(setting)
        return by_model

    def left_out(self) -> list[str]:
        """Return a sentence for each renderer and model of which a setting was not measured, with the reason."""
        labels_by_problem: dict[tuple[str, str, str], list[str]] = {}
        for setting in self.settings:
            if setting.problem is not None:
                labels_by_problem.setdefault((setting.renderer, setting.model, setting.problem), []).append(
                    setting.label
                )
        return [
            f"{labels[0] if len(labels) == 1 else f'{name} ({len(labels)} settings)'} on the {model}: {problem}"
            for (name, model, problem), labels in labels_by_problem.items()
        ]


def join_benches(
    results: BenchResults, samples: Samples, before: BenchResults, earlier: Samples
) -> tuple[BenchResults, Samples]:
    """Add the settings of an earlier bench of other renderers or models, so that new ones stand among them.

    Nothing is added where versions, processor, cores, seed or effort differ: their times could not be compared.
    """
    if any(
        one != other
        for one, other in (
            (results.environment, before.environment),
            (results.seed, before.seed),
            (results.quick, before.quick),
            *((results.machine.get(name), before.machine.get(name)) for name in ("processor", "cores")),
        )
    ):
        return results, samples
    # New measurements of a renderer on a model replace all old ones of that pair.
    measured = {(setting.renderer, setting.model) for setting in results.settings}
    keys = {
        # Keys of their own, which no key "s..." of this bench can equal.
        setting.key: f"k{number:03d}"
        for number, setting in enumerate(
            setting for setting in before.settings if (setting.renderer, setting.model) not in measured
        )
    }
    settings = [
        replace(setting, key=keys[setting.key], kept=True) for setting in before.settings if setting.key in keys
    ]
    references = [reference for reference in before.references if (reference.renderer, reference.model) not in measured]
    # Samples are named "key/kind": the key is the part before the slash.
    old = {
        f"{keys[key]}/{kind}": rows
        for (key, _, kind), rows in ((name.partition("/"), rows) for name, rows in earlier.items())
        if key in keys
    }
    joined = replace(results, settings=[*settings, *results.settings], references=[*references, *results.references])
    return joined, {**old, **samples}


def write_bench(directory: Path, results: BenchResults, samples: Samples) -> list[Path]:
    """Write bench.json and its samples into a folder, each whole or not at all; return the paths written.

    Raises `HapticevalError` where a file cannot be written.
    """
    samples_file = directory / SAMPLES_FILE
    with writing(f"into {directory}"), replacing(samples_file) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **{name: np.asarray(rows) for name, rows in samples.items()})  # type: ignore[arg-type]
    return [write_json(directory / BENCH_FILE, results), samples_file]


def read_bench(directory: Path) -> BenchResults:
    """Read `directory`/bench.json. Raises `InputError` as `read_json` does."""
    return read_json(directory / BENCH_FILE, BenchResults, version=FORMAT_VERSION, command="bench")


def read_samples(directory: Path) -> dict[str, IntArray]:
    """Read the raw samples beside a bench.json. Raises `InputError` for a file that is not there or is damaged."""
    path = directory / SAMPLES_FILE
    try:
        # No pickles: a file that is read never runs code.
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return {name: np.asarray(archive[name], dtype=np.int64) for name in archive.files}
    except FileNotFoundError as error:
        raise InputError(f"'{directory}' holds no {SAMPLES_FILE}", todo="run `hapticeval bench` again") from error
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(
            f"{path} is damaged", why=str(error), todo="run `hapticeval bench` again, or restore the file"
        ) from error
