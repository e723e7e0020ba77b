"""The bench document: what was measured at each setting. All that reports read.

The types below are its only definition: reading checks a file against them, and writing gives what reading takes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec.structs import replace

from hapticeval.files import read_json, write_json

BENCH_FILE = "bench.json"
FORMAT_VERSION = 3

QUIET_RATIO = 1.5
"""The 99 per cent quantile of an empty call, in medians, up to which a machine is quiet. *Chosen*."""

TICK = 1e-3
"""Seconds in which a haptic renderer must have answered."""

Errors = dict[str, dict[str, float]]
"""By metric (`ihip` m, `normal` degrees, `force` N) and statistic (`rms`, `p99`, `max`)."""


class _DocumentPart(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of the document's objects."""


class Times(_DocumentPart, frozen=True):
    """Seconds per step: the median and the 99 per cent quantile of all rounds, and the median of each round."""

    median: float
    p99: float
    rounds: list[float]


class SettingEntry(_DocumentPart, frozen=True):
    """A renderer with values of its knobs on a model.

    - `errors` count from the reference, and `claims` are those that it can prove; None without a reference;
    - `step` is the time of a step, None where not measured;
    - `worst_at` is the HIP, m, of the largest IHIP error;
    - `reference` names what they count from: settings can be compared where they share it;
    - `front` says whether the setting lies on the Pareto front of those that share its reference;
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
    memory_bytes: int | None
    build_seconds: list[float]
    key: str
    front: bool
    problem: str | None
    kept: bool = False
    # msgspec copies a list that is a default: instances do not share it.
    mesh_seconds: list[float] = []
    reference: str | None = None
    worst_at: list[float] | None = None


class ReferenceEntry(_DocumentPart, frozen=True):
    """What the errors of a renderer on a model count from, and how far that may be off; None if exact.

    `extrapolated`: by Richardson; else how far its last refinement moved it.
    """

    renderer: str
    model: str
    what: str | None
    disagreement: Errors | None
    extrapolated: bool = False


class Uncalled(_DocumentPart, frozen=True):
    """What effects cost a scene that calls for none: of a renderer as runs get it, beside what its factory made.

    `same_law`: its law is the one that the factory made, and no copy; `ratio` of the medians of a step.
    """

    renderer: str
    same_law: bool
    ratio: float


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
    within_m: float
    budget_s: float | None
    key: str | None
    label: str | None
    reference: str | None = None


class Change(_DocumentPart, frozen=True):
    """A setting against an earlier bench: the ratio of its step's times, or of its IHIP errors."""

    model: str
    label: str
    what: Literal["step", "IHIP error"]
    ratio: float | None
    verdict: Literal["better", "worse", "the same"]


class BenchResults(_DocumentPart, frozen=True):
    """A bench: what was measured, on which machine, by which command, and what follows from it.

    `empty` are the times of a call that does nothing: what the clock and the machine put into every step. `uncalled`
    is what effects cost where none is called for.
    """

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
    empty: Times | None = None
    uncalled: Uncalled | None = None
    comparison: list[Change] = []
    format_version: int = FORMAT_VERSION

    @property
    def is_quiet(self) -> bool:
        """Whether the machine was quiet enough for the tails of times: an empty call's own tail is short."""
        return self.empty is not None and self.empty.p99 <= QUIET_RATIO * self.empty.median

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


def join_benches(results: BenchResults, before: BenchResults) -> BenchResults:
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
        return results
    # New measurements of a renderer on a model replace all old ones of that pair.
    measured = {(setting.renderer, setting.model) for setting in results.settings}
    # Keys of their own, which no key "s..." of this bench can equal.
    kept_settings = [
        replace(setting, key=f"k{number:03d}", kept=True)
        for number, setting in enumerate(
            setting for setting in before.settings if (setting.renderer, setting.model) not in measured
        )
    ]
    references = [reference for reference in before.references if (reference.renderer, reference.model) not in measured]
    return replace(results, settings=[*kept_settings, *results.settings], references=[*references, *results.references])


def write_bench(directory: Path, results: BenchResults) -> Path:
    """Write bench.json into a folder, whole or not at all; return its path.

    Raises `HapticevalError` where it cannot be written.
    """
    return write_json(directory / BENCH_FILE, results)


def read_bench(directory: Path) -> BenchResults:
    """Read `directory`/bench.json. Raises `InputError` as `read_json` does."""
    return read_json(directory / BENCH_FILE, BenchResults, version=FORMAT_VERSION, command="bench")
