"""A bench in words for the terminal: every setting, orders, answers, what is not proven, and the comparison."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from hapticeval import quantity
from hapticeval.study.bench.document import BenchResults
from hapticeval.study.bench.judge import unproven

length, duration = partial(quantity.length, micro="u"), partial(quantity.duration, micro="u")
"""On a terminal, units are spelt as options take them."""

HEAD = (
    "",
    "setting",
    "IHIP 99%",
    "normal 99%",
    "force 99%",
    "step median",
    "99.9%",
    "of tick",
    "batch",
    "memory",
    "build",
)
ORDERS = {"ihip": "IHIP", "normal": "normal", "force": "force"}


def describe(results: BenchResults) -> str:
    """Describe a bench for the terminal: tables, orders, the answers, and the comparison."""
    parts = [
        *_tables(results),
        "\n".join(_orders(results)),
        "\n".join(unproven(results)),
        "\n".join(_answers(results)),
        "\n".join(_comparison(results.comparison)),
        f"{len(results.settings)} settings in {results.timing['wall_seconds']:.3g} s, {results.rounds} rounds of timing"
        + ("" if results.complete else f"; incomplete: {results.reason}"),
    ]
    return "\n\n".join(part for part in parts if part)


def _tables(results: BenchResults) -> Iterator[str]:
    for model in dict.fromkeys(each["model"] for each in results.settings):
        held = [each for each in results.settings if each["model"] == model]
        rows = [HEAD, *(_row(each) for each in held if not each["problem"])]
        widths = [max(len(row[k]) for row in rows) for k in range(len(HEAD))]
        lines = [
            "  ".join(
                text.ljust(width) if k < 2 else text.rjust(width)
                for k, (text, width) in enumerate(zip(row, widths, strict=True))
            )
            for row in rows
        ]
        lines += [f"   {each['label']}: {each['problem']}" for each in held if each["problem"]]
        yield f"{model} (* on the Pareto front, one step at a time; ~ not proven)\n" + "\n".join(
            line.rstrip() for line in lines
        )


def _row(entry: Mapping[str, Any]) -> tuple[str, ...]:
    claims, step, batch = entry["claims"], entry["step"], entry["batch"]
    mark = "" if entry["proven"] is not False else "~"
    return (
        "*" if "step" in entry["front"] else "",
        entry["label"],
        "-" if claims is None else mark + length(claims["ihip"]["p99"]),
        "-" if claims is None else f"{claims['normal']['p99']:.2g} deg",
        "-" if claims is None else f"{claims['force']['p99']:.2g} N",
        "-" if step is None else duration(step["median"]),
        "-" if step is None else duration(step["p999"]),
        "-" if step is None else f"{100 * step['tick_share']:.2g} %",
        "-" if batch is None else duration(batch["median"]),
        "-" if entry["memory_bytes"] is None else quantity.size(entry["memory_bytes"]),
        duration(min(entry["build_seconds"])) if entry["build_seconds"] else "-",
    )


def _orders(results: BenchResults) -> Iterator[str]:
    for each in results.orders:
        found = ", ".join(f"{ORDERS[name]} {value:.2f}" for name, value in each["orders"].items() if value is not None)
        yield f"order of convergence, {each['renderer']} on the {each['model']} by {each['knob']}: {found}"


def _answers(results: BenchResults) -> Iterator[str]:
    kinds = {"step": "one step at a time", "batch": "in batch"}
    by_key = {each["key"]: each for each in results.settings}
    for each in results.answers:
        asked = f"{each['model']}, {length(each['within_m'])}"
        asked += f" within {duration(each['budget_s'])}" if each["budget_s"] else ""
        if each["key"] is None:
            yield f"{asked}, {kinds[each['what']]}: no setting"
            continue
        entry = by_key[each["key"]]
        took, error = entry[each["what"]], entry["claims"]["ihip"]["p99"]
        yield (
            f"{asked}, {kinds[each['what']]}: {each['label']} "
            f"({length(error)} in {duration(took['median'])}, 99 % of steps in {duration(took['p99'])})"
        )


def _comparison(found: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    for each in found:
        if each["verdict"] != "not significant":
            by = "" if each["ratio"] is None else f": {each['ratio']:.3g} times"
            if each["p"] is not None:
                high = "" if each["high"] is None else f"{each['high']:.3g}"
                by += f" [{each['low']:.3g}, {high}], p = {each['p']:.2g}"
            yield f"{each['verdict']}: {each['label']} on the {each['model']}, {each['what']}{by}"
    if found:
        quiet = sum(each["verdict"] == "not significant" for each in found)
        yield f"compared: {quiet} of {len(found)} not significant"
