"""A bench in words for the terminal: every setting, orders, answers, what is not proven, and the comparison."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

from hapticeval import quantity
from hapticeval.errors import in_mm
from hapticeval.study.bench.document import BenchResults, Change, SettingEntry
from hapticeval.study.bench.judge import describe_unproven

length, duration = partial(quantity.format_length, micro="u"), partial(quantity.format_duration, micro="u")
"""On a terminal, units are spelt as options take them."""

SETTING_COLUMNS: Mapping[str, Callable[[SettingEntry], str | None]] = {
    # A star for the front of single steps; that of batches is in the document.
    "": lambda setting: "*" if "step" in setting.front else "",
    "setting": lambda setting: setting.label,
    "IHIP worst": lambda setting: (
        "~" * (setting.proven is False) + length(setting.claims["ihip"]["max"]) if setting.claims else None
    ),
    # The hand there: a renderer may be off at one edge or jump alone.
    "at": lambda setting: in_mm(round(x, 4) for x in setting.worst_at) if setting.worst_at else None,
    "normal 99%": lambda setting: f"{setting.claims['normal']['p99']:.2g} deg" if setting.claims else None,
    "force 99%": lambda setting: f"{setting.claims['force']['p99']:.2g} N" if setting.claims else None,
    "step median": lambda setting: duration(setting.step.median) if setting.step else None,
    "99.9%": lambda setting: duration(setting.step.p999) if setting.step else None,
    "of tick": lambda setting: (
        f"{quantity.format_number(100 * setting.step.tick_share, 2)} %" if setting.step else None
    ),
    "batch": lambda setting: duration(setting.batch.median) if setting.batch else None,
    "memory": lambda setting: None if setting.memory_bytes is None else quantity.format_size(setting.memory_bytes),
    # The shortest of several builds: the others waited for the machine.
    "mesh": lambda setting: duration(min(setting.mesh_seconds)) if setting.mesh_seconds else None,
    "build": lambda setting: duration(min(setting.build_seconds)) if setting.build_seconds else None,
}
"""The columns of a table of settings; what is not known is None, and a column of that alone is left out."""

ORDERS = {"ihip": "IHIP", "normal": "normal", "force": "force"}


def describe(results: BenchResults) -> str:
    """Describe a bench for the terminal: tables, orders, the answers, and the comparison."""
    parts = [
        *_tables(results),
        "\n".join(_orders(results)),
        "\n".join(describe_unproven(results)),
        "\n".join(_in_compiled_loops(results)),
        "\n".join(_left_out(results)),
        "\n".join(_answers(results)),
        "\n".join(_comparison(results.comparison)),
        f"{len(results.settings)} settings in {results.timing['wall_seconds']:.3g} s, {results.rounds} rounds of timing"
        + _count_earlier(results)
        + ("" if results.complete else f"; incomplete: {results.reason}"),
    ]
    return "\n\n".join(part for part in parts if part)


def _tables(results: BenchResults) -> Iterator[str]:
    for model, settings in results.by_model().items():
        measured = [setting for setting in settings if not setting.problem]
        columns = {title: [cell(setting) for setting in measured] for title, cell in SETTING_COLUMNS.items()}
        # A column that no setting fills, such as meshes in the plane, is left out.
        filled = {title: cells for title, cells in columns.items() if any(cell is not None for cell in cells)}
        if not filled:
            continue
        rows = [["-" if cell is None else cell for cell in row] for row in zip(*filled.values(), strict=True)]
        head = f"{model} (* on the Pareto front of its reference, one step at a time; ~ not proven)"
        yield "\n".join([head, *quantity.align_columns([list(filled), *rows], left=2)])


def _in_compiled_loops(results: BenchResults) -> Iterator[str]:
    """Say of shared libraries that their steps are timed as closed loops call them, without Python."""
    for label in dict.fromkeys(entry.label for entry in results.settings if entry.renderer.startswith("lib:")):
        yield f"steps of {label} are timed in a compiled loop, as closed loops call them: no Python is in them"


def _left_out(results: BenchResults) -> Iterator[str]:
    for number, sentence in enumerate(results.left_out()):
        if number == 0:
            yield "Not measured:"
        yield f"   {sentence}"


def _count_earlier(results: BenchResults) -> str:
    earlier = sum(setting.kept for setting in results.settings)
    return f"; {earlier} of them kept from an earlier bench" if earlier else ""


def _orders(results: BenchResults) -> Iterator[str]:
    for entry in results.orders:
        orders = ", ".join(f"{ORDERS[name]} {value:.2f}" for name, value in entry.orders.items() if value is not None)
        yield f"order of convergence, {entry.renderer} on the {entry.model} by {entry.knob}: {orders}"


def _answers(results: BenchResults) -> Iterator[str]:
    kinds = {"step": "one step at a time", "batch": "in batch"}
    by_key = {setting.key: setting for setting in results.settings}
    references = Counter(answer.model for answer in results.answers if answer.what == "step")
    for answer in results.answers:
        budget = f" within {duration(answer.budget_s)}" if answer.budget_s else ""
        words = "no setting"
        if answer.key is not None:
            entry = by_key[answer.key]
            claims, took = entry.claims, entry.times(answer.what)
            # Errors are those that the reference proves; times those of single steps or of batches.
            if claims is not None and took is not None:
                error, median, p99 = length(claims["ihip"]["max"]), duration(took.median), duration(took.p99)
                words = f"{answer.label} ({error} in {median}, 99 % of steps in {p99})"
        reference = f", off from {answer.reference}" if references[answer.model] > 1 else ""
        yield f"{answer.model}{reference}, {length(answer.within_m)}{budget}, {kinds[answer.what]}: {words}"
    for model, count in references.items():
        if count > 1:
            yield (
                f"On the {model} errors count from {count} references, and settings are compared only where they share "
                "one: no renderer is the winner over the others."
            )


def _comparison(changes: Sequence[Change]) -> Iterator[str]:
    for change in changes:
        if change.verdict != "not significant":
            # No ratio where the old error was zero, no interval for errors, which are not random.
            by = "" if change.ratio is None else f": {change.ratio:.3g} times"
            if change.p is not None:
                high = "" if change.high is None else f"{change.high:.3g}"
                by += f" [{change.low:.3g}, {high}], p = {change.p:.2g}"
            yield f"{change.verdict}: {change.label} on the {change.model}, {change.what}{by}"
    if changes:
        quiet = sum(change.verdict == "not significant" for change in changes)
        yield f"compared: {quiet} of {len(changes)} not significant"
