"""A bench in words for the terminal: every setting, orders, answers, what is not proven, and the comparison."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hapticeval.bench.judge import unproven
from hapticeval.costs import Costs

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


def summary(costs: Costs) -> str:
    """The closing words of a bench."""
    parts = [
        *_tables(costs),
        "\n".join(_orders(costs)),
        "\n".join(unproven(costs)),
        "\n".join(_answers(costs)),
        "\n".join(_comparison(costs.comparison)),
        f"{len(costs.settings)} settings in {costs.timing['wall_seconds']:.3g} s, {costs.rounds} rounds of timing"
        + ("" if costs.complete else f"; incomplete: {costs.reason}"),
    ]
    return "\n\n".join(part for part in parts if part)


def _tables(costs: Costs) -> Iterator[str]:
    for model in dict.fromkeys(each["model"] for each in costs.settings):
        held = [each for each in costs.settings if each["model"] == model]
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
        size(entry["memory_bytes"]),
        duration(min(entry["build_seconds"])) if entry["build_seconds"] else "-",
    )


def _orders(costs: Costs) -> Iterator[str]:
    for each in costs.orders:
        found = ", ".join(f"{ORDERS[name]} {value:.2f}" for name, value in each["orders"].items() if value is not None)
        yield f"order of convergence, {each['renderer']} on the {each['model']} by {each['knob']}: {found}"


def _answers(costs: Costs) -> Iterator[str]:
    kinds = {"step": "one step at a time", "batch": "in batch"}
    by_key = {each["key"]: each for each in costs.settings}
    for each in costs.answers:
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


def length(metres: float) -> str:
    """For instance `0.12 mm`, `3.1 um`, `0` for exact."""
    if metres == 0.0:
        return "0"
    unit, scale = next(
        ((u, s) for u, s in (("mm", 1e3), ("um", 1e6), ("nm", 1e9)) if metres * s >= 0.0995), ("pm", 1e12)
    )
    return f"{metres * scale:.2g} {unit}"


def duration(seconds: float) -> str:
    """For instance `2.4 us`."""
    unit, scale = next(((u, s) for u, s in (("s", 1.0), ("ms", 1e3), ("us", 1e6)) if seconds * s >= 0.995), ("ns", 1e9))
    return f"{seconds * scale:.3g} {unit}"


def size(count: int | None) -> str:
    """For instance `1.2 MB`."""
    if count is None:
        return "-"
    unit, scale = next(((u, s) for u, s in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)) if count >= s), ("B", 1.0))
    return f"{count / scale:.3g} {unit}"
