"""What accuracy costs in time, as a section of the page: plots, one table per model, and which setting will do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hapticeval.quantity import duration, length, size
from hapticeval.reports.bench_figure import TITLES, bench_svg
from hapticeval.study.bench.document import BenchResults

COLUMNS = (
    "renderer and setting",
    "IHIP error, 99 %",
    "largest",
    "normal, 99 %",
    "force, 99 %",
    "a step, median",
    "99.9 %",
    "of the 1 ms tick",
    "in batch",
    "memory",
    "build",
)


@dataclass(frozen=True)
class Row:
    """One setting; `mark` if it lies on the Pareto front, `unproven` if the reference does not certify its error."""

    cells: Sequence[str]
    mark: bool
    unproven: bool


@dataclass(frozen=True)
class Section:
    """Everything that the page shows of a bench."""

    plots: Sequence[tuple[str, str]]
    answers: Sequence[tuple[str, str, str, str, str]]
    tables: Mapping[str, Sequence[Row]]
    left_out: Sequence[tuple[str, str]]
    references: Sequence[str]
    orders: Sequence[str]
    comparison: Sequence[str]
    machine: str
    incomplete: str


def bench_section(bench: BenchResults) -> Section:
    """The section of a bench document."""
    measured = any(each["claims"] and each["step"] for each in bench.settings)
    return Section(
        plots=[(TITLES[kind], bench_svg(bench, kind, prefix=f"b{kind}")) for kind in TITLES] if measured else [],
        answers=list(_answers(bench)),
        tables={
            model: [_row(each) for each in bench.settings if each["model"] == model and not each["problem"]]
            for model in dict.fromkeys(each["model"] for each in bench.settings)
        },
        left_out=[
            (f"{each['label']} on the {each['model']}", each["problem"]) for each in bench.settings if each["problem"]
        ],
        references=list(_references(bench)),
        orders=list(_orders(bench)),
        comparison=[_compared(each) for each in bench.comparison if each["verdict"] != "not significant"],
        machine=_machine(bench),
        incomplete="" if bench.complete else str(bench.reason),
    )


def _answers(bench: BenchResults) -> Iterator[tuple[str, str, str, str, str]]:
    by_key = {each["key"]: each for each in bench.settings}
    for each in bench.answers:
        asked = length(each["within_m"]) + (f" within {duration(each['budget_s'])}" if each["budget_s"] else "")
        if each["key"] is None:
            yield each["model"], TITLES[each["what"]], asked, "no setting", ""
            continue
        entry = by_key[each["key"]]
        error, took = entry["claims"]["ihip"]["p99"], entry[each["what"]]["median"]
        yield each["model"], TITLES[each["what"]], asked, each["label"], f"{_error(error)} in {duration(took)}"


def _row(entry: Mapping[str, Any]) -> Row:
    claims, step, batch = entry["claims"], entry["step"], entry["batch"]
    errors = (
        ["–"] * 4  # noqa: RUF001
        if claims is None
        else [
            _error(claims["ihip"]["p99"]),
            _error(claims["ihip"]["max"]),
            f"{claims['normal']['p99']:.2g}°",
            f"{claims['force']['p99']:.2g} N",
        ]
    )
    times = (
        ["–"] * 3  # noqa: RUF001
        if step is None
        else [duration(step["median"]), duration(step["p999"]), f"{100 * step['tick_share']:.2g} %"]
    )
    rest = [
        "–" if batch is None else duration(batch["median"]),  # noqa: RUF001
        size(entry["memory_bytes"]),
        duration(min(entry["build_seconds"])),
    ]
    return Row([entry["label"], *errors, *times, *rest], "step" in entry["front"], entry["proven"] is False)


def _references(bench: BenchResults) -> Iterator[str]:
    """What errors count from, renderers with the same words together."""
    words: dict[str, list[str]] = {}
    for each in bench.references:
        if each["what"] is None:
            text = "no reference: neither an exact form nor a knob to refine it by"
        elif each["disagreement"] is None:
            text = each["what"]
        else:
            text = f"{each['what']}; the last refinement moved the IHIP by {each['disagreement']['ihip']['p99']:.1e} m"
        words.setdefault(text, []).append(f"{each['renderer']} on the {each['model']}")
    for text, names in words.items():
        yield f"{text}: {', '.join(names)}"


def _orders(bench: BenchResults) -> Iterator[str]:
    for each in bench.orders:
        found = ", ".join(f"{name} {value:.2f}" for name, value in each["orders"].items() if value is not None)
        yield f"{each['renderer']} on the {each['model']}, by {each['knob']}: {found}"


def _compared(each: Mapping[str, Any]) -> str:
    by = "" if each["ratio"] is None else f", {each['ratio']:.3g} times what it was"
    return f"{each['verdict']}: {each['label']} on the {each['model']}, {each['what']}{by}"


def _machine(bench: BenchResults) -> str:
    machine, environment = bench.machine, bench.environment
    parts = [
        str(machine.get("processor", "")),
        f"{machine.get('cores', '?')} cores",
        f"Python {environment.get('python', '?')}",
        *(f"{name} {each}" for name, each in environment.get("versions", {}).items() if each),
        f"reading the clock takes {machine.get('clock_ns', 0.0):.0f} ns, which is in every step",
        f"load average {machine['load_average']:.2g} when it began" if machine.get("load_average") is not None else "",
        f"{bench.rounds} rounds",
        f"seed {bench.seed}",
    ]
    return ", ".join(part for part in parts if part)


def _error(metres: float) -> str:
    return "exact" if metres == 0.0 else length(metres)
