"""`hapticeval bench`: what accuracy costs in time, and the words and tables in which the terminal says it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from hapticeval import quantity
from hapticeval.commands.arguments import Folder, Seed, option, parse_knobs, renderers_option
from hapticeval.commands.terminal import Terminal, lines, paragraphs, say, wrote_lines
from hapticeval.errors import InputError, in_mm
from hapticeval.study.bench.document import BenchResults, Change, SettingEntry
from hapticeval.study.bench.judge import describe_unproven

EXIT_CODES = """\b
Exit codes:
  0  measured; with --compare nothing is worse, with --within every renderer that -r names
     has a setting that meets it (and --budget), on every model that it takes; without -r
     one of the built-in ones has
  1  something is significantly worse, no setting meets --within, or the bench was
     interrupted
  2  wrong usage or input, or a setting whose input was not usable
  3  a renderer broke (outranks 1 and 2)
"""


def bench(
    renderers: Annotated[list[str] | None, renderers_option("the built-in ones, on every representation")] = None,
    knobs: Annotated[
        list[str] | None,
        option(
            "--knob",
            metavar="NAME=VALUE,...",
            help="Values to sweep a knob over, such as vertices=40,80,160; may be repeated.",
        ),
    ] = None,
    models: Annotated[
        list[str] | None,
        option(
            "--model",
            metavar="MODEL",
            help="cassinian or star, in the plane; sphere or torus, which renderers get as triangle meshes. May be "
            "repeated; without it the cassinian, and without --quick the star too.",
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="One model, one knob a renderer, few values: half a minute.")
    ] = False,
    within: Annotated[
        str | None,
        option(
            metavar="LENGTH",
            help="Name the cheapest setting whose largest IHIP error is at most this, such as 0.1mm, of "
            "those that share a reference.",
        ),
    ] = None,
    budget: Annotated[
        str | None, option(metavar="TIME", help="Only settings whose step takes at most this, such as 10us.")
    ] = None,
    compare: Annotated[
        Path | None, option(metavar="DIR", help="The folder of an earlier bench: show what is better or worse now.")
    ] = None,
    directory: Folder = Path("results"),
    seed: Seed = 0,
) -> None:
    """Measure what accuracy costs in time: sweep the knobs of renderers.

    Without -r, those that come with hapticeval are measured, on every
    representation. A folder that holds a bench of other renderers, on this
    machine and with these versions, keeps their settings: so a renderer of
    your own stands among ours. The error of a renderer without knobs counts
    from that of ours which it is nearest to.

    \b
    Examples:
      hapticeval bench --quick -o results
      hapticeval bench --quick -r mymodule:factory -o results
      hapticeval bench --quick --model sphere -o results
      hapticeval bench -r constraint@polygon --knob vertices=40,80,160
      hapticeval bench --within 0.1mm --budget 10us
      hapticeval bench --quick -o new --compare old
    """
    from msgspec.structs import replace

    from hapticeval.commands.bench import describe
    from hapticeval.quantity import parse_duration, parse_length
    from hapticeval.runner.folder import prepared_folder
    from hapticeval.runner.results import FILE as RESULTS
    from hapticeval.study.bench.compare import compare_benches
    from hapticeval.study.bench.document import join_benches, read_bench, read_samples, write_bench
    from hapticeval.study.bench.judge import describe_missed, judge_bench
    from hapticeval.study.bench.sweep import Sweep, settings_by_model

    error_limit = None if within is None else parse_length(within, option="--within")
    time_limit = None if budget is None else parse_duration(budget, option="--budget")
    # Read first: DIR may be the folder that the new bench is written to.
    earlier_bench = None if compare is None else (read_bench(compare), read_samples(compare))
    settings = settings_by_model(models, renderers, quick=quick, chosen=parse_knobs(knobs or []))
    names = list(dict.fromkeys(setting.renderer for of_model in settings.values() for setting in of_model))
    command = {"renderers": names, "models": list(settings), "knobs": knobs or [], "within": within, "budget": budget}
    sweep = Sweep(settings, quick=quick, seed=seed, command=command)
    with prepared_folder(directory, keep_reports=True):
        with Terminal() as terminal:
            sweep.run(terminal.working)
        samples = sweep.samples()
        results = sweep.results()
        if earlier_bench is not None:
            # Before the join: settings that are kept were not measured now.
            results = replace(results, comparison=compare_benches(results, samples, *earlier_bench))
        with suppress(InputError):  # one that is not there, or of another version, has nothing to keep
            results, samples = join_benches(results, samples, read_bench(directory), read_samples(directory))
        results = judge_bench(results, within=error_limit, budget=time_limit)
        written = write_bench(directory, results, samples)
    has_results = (directory / RESULTS).exists()
    hint = f"hapticeval report {directory} puts it into the report of the run that lies there" if has_results else ""
    # Who names no renderer asks which one will do, and not that all of them do.
    missed = (
        []
        if error_limit is None
        else list(describe_missed(results, within=error_limit, budget=time_limit, together=not renderers))
    )
    say(paragraphs(describe(results), lines(missed), wrote_lines(written), hint))
    worse = any(change.verdict == "worse" for change in results.comparison)
    raise typer.Exit(
        # A renderer that broke has a higher code than what was found to be worse.
        max([int(bool(missed) or worse or not results.complete), *(failure.exit_code for failure in sweep.failures)])
    )


length, duration = partial(quantity.format_length, micro="u"), partial(quantity.format_duration, micro="u")
"""On a terminal, units are spelt as options take them."""

COLUMNS: Mapping[str, Callable[[SettingEntry], str | None]] = {
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
        columns = {title: [cell(setting) for setting in measured] for title, cell in COLUMNS.items()}
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
