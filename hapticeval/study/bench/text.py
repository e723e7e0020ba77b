"""A bench in words for the terminal: every setting, orders, answers, what is not proven, and the comparison."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

from hapticeval import quantity
from hapticeval.study.bench.document import BenchResults, Change, SettingEntry
from hapticeval.study.bench.judge import unproven

length, duration = partial(quantity.length, micro="u"), partial(quantity.duration, micro="u")
"""On a terminal, units are spelt as options take them."""

COLUMNS: Mapping[str, Callable[[SettingEntry], str | None]] = {
    "": lambda each: "*" if "step" in each.front else "",
    "setting": lambda each: each.label,
    "IHIP 99%": lambda each: "~" * (each.proven is False) + length(each.claims["ihip"]["p99"]) if each.claims else None,
    "normal 99%": lambda each: f"{each.claims['normal']['p99']:.2g} deg" if each.claims else None,
    "force 99%": lambda each: f"{each.claims['force']['p99']:.2g} N" if each.claims else None,
    "step median": lambda each: duration(each.step.median) if each.step else None,
    "99.9%": lambda each: duration(each.step.p999) if each.step else None,
    "of tick": lambda each: f"{quantity.number(100 * each.step.tick_share, 2)} %" if each.step else None,
    "batch": lambda each: duration(each.batch.median) if each.batch else None,
    "memory": lambda each: None if each.memory_bytes is None else quantity.size(each.memory_bytes),
    "mesh": lambda each: duration(min(each.mesh_seconds)) if each.mesh_seconds else None,
    "build": lambda each: duration(min(each.build_seconds)) if each.build_seconds else None,
}
"""The columns of a table of settings; what is not known is None, and a column of that alone is left out."""

ORDERS = {"ihip": "IHIP", "normal": "normal", "force": "force"}


def describe(results: BenchResults) -> str:
    """Describe a bench for the terminal: tables, orders, the answers, and the comparison."""
    parts = [
        *_tables(results),
        "\n".join(_orders(results)),
        "\n".join(unproven(results)),
        "\n".join(_through_python(results)),
        "\n".join(_left_out(results)),
        "\n".join(_answers(results)),
        "\n".join(_comparison(results.comparison)),
        f"{len(results.settings)} settings in {results.timing['wall_seconds']:.3g} s, {results.rounds} rounds of timing"
        + _kept(results)
        + ("" if results.complete else f"; incomplete: {results.reason}"),
    ]
    return "\n\n".join(part for part in parts if part)


def _tables(results: BenchResults) -> Iterator[str]:
    for model, settings in results.by_model().items():
        measured = [each for each in settings if not each.problem]
        columns = {title: [cell(each) for each in measured] for title, cell in COLUMNS.items()}
        filled = {title: cells for title, cells in columns.items() if any(each is not None for each in cells)}
        if not filled:
            continue
        rows = [["-" if each is None else each for each in row] for row in zip(*filled.values(), strict=True)]
        head = f"{model} (* on the Pareto front, one step at a time; ~ not proven)"
        yield "\n".join([head, *quantity.aligned([list(filled), *rows], left=2)])


def _through_python(results: BenchResults) -> Iterator[str]:
    """Say of libraries that a single step is timed with Python's part in it, which compiled loops do not have."""
    for entry in results.settings:
        if entry.renderer.startswith("lib:") and entry.step is not None and entry.batch is not None:
            yield (
                f"a step of {entry.label} on the {entry.model} takes {duration(entry.step.median)} called from Python, "
                f"and {duration(entry.batch.median)} called as closed loops do, which is the library's own time"
            )


def _left_out(results: BenchResults) -> Iterator[str]:
    for number, sentence in enumerate(results.left_out()):
        if number == 0:
            yield "Not measured:"
        yield f"   {sentence}"


def _kept(results: BenchResults) -> str:
    kept = sum(each.kept for each in results.settings)
    return f"; {kept} of them kept from an earlier bench" if kept else ""


def _orders(results: BenchResults) -> Iterator[str]:
    for each in results.orders:
        found = ", ".join(f"{ORDERS[name]} {value:.2f}" for name, value in each.orders.items() if value is not None)
        yield f"order of convergence, {each.renderer} on the {each.model} by {each.knob}: {found}"


def _answers(results: BenchResults) -> Iterator[str]:
    kinds = {"step": "one step at a time", "batch": "in batch"}
    by_key = {each.key: each for each in results.settings}
    for each in results.answers:
        budget = f" within {duration(each.budget_s)}" if each.budget_s else ""
        found = "no setting"
        if each.key is not None:
            entry = by_key[each.key]
            claims, took = entry.claims, entry.times(each.what)
            if claims is not None and took is not None:
                error, median, most = length(claims["ihip"]["p99"]), duration(took.median), duration(took.p99)
                found = f"{each.label} ({error} in {median}, 99 % of steps in {most})"
        yield f"{each.model}, {length(each.within_m)}{budget}, {kinds[each.what]}: {found}"


def _comparison(found: Sequence[Change]) -> Iterator[str]:
    for each in found:
        if each.verdict != "not significant":
            by = "" if each.ratio is None else f": {each.ratio:.3g} times"
            if each.p is not None:
                high = "" if each.high is None else f"{each.high:.3g}"
                by += f" [{each.low:.3g}, {high}], p = {each.p:.2g}"
            yield f"{each.verdict}: {each.label} on the {each.model}, {each.what}{by}"
    if found:
        quiet = sum(each.verdict == "not significant" for each in found)
        yield f"compared: {quiet} of {len(found)} not significant"
