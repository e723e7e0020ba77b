"""`hapticeval bench`: what accuracy costs in time."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from hapticeval.commands.arguments import Folder, Seed, option, parse_knobs, renderers_option
from hapticeval.commands.terminal import Terminal, lines, paragraphs, say, wrote_lines
from hapticeval.errors import InputError

EXIT_CODES = """\b
Exit codes:
  0  measured; with --compare nothing is worse, with --within every renderer that -r names
     has a setting that meets it (and --budget), on every model that it takes; without -r
     one of the built-in ones has
  1  something is worse, no setting meets --within, or the bench was
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
        bool, typer.Option("--quick", help="One model, one knob a renderer, few values: the quickest look.")
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

    from hapticeval.quantity import parse_duration, parse_length
    from hapticeval.runner.folder import locked_folder
    from hapticeval.runner.results import RESULTS_FILE
    from hapticeval.study.bench.document import join_benches, read_bench, write_bench
    from hapticeval.study.bench.judge import compare_benches, describe, describe_missed, judge_bench
    from hapticeval.study.bench.sweep import Sweep, settings_by_model

    error_limit = None if within is None else parse_length(within, option="--within")
    time_limit = None if budget is None else parse_duration(budget, option="--budget")
    # Read first: DIR may be the folder that the new bench is written to.
    earlier_bench = None if compare is None else read_bench(compare)
    settings = settings_by_model(models, renderers, quick=quick, chosen=parse_knobs(knobs or []))
    names = list(dict.fromkeys(setting.renderer for of_model in settings.values() for setting in of_model))
    command = {"renderers": names, "models": list(settings), "knobs": knobs or [], "within": within, "budget": budget}
    sweep = Sweep(settings, quick=quick, seed=seed, command=command)
    with locked_folder(directory):
        with Terminal() as terminal:
            sweep.run(terminal.working)
        results = sweep.results()
        if earlier_bench is not None:
            # Before the join: settings that are kept were not measured now.
            results = replace(results, comparison=compare_benches(results, earlier_bench))
        with suppress(InputError):  # one that is not there, or of another version, has nothing to keep
            results = join_benches(results, read_bench(directory))
        results = judge_bench(results, within=error_limit, budget=time_limit)
        written = write_bench(directory, results)
    has_results = (directory / RESULTS_FILE).exists()
    hint = f"hapticeval report {directory} puts it into the report of the run that lies there" if has_results else ""
    # Who names no renderer asks which one will do, and not that all of them do.
    missed = (
        []
        if error_limit is None
        else list(describe_missed(results, within=error_limit, budget=time_limit, together=not renderers))
    )
    say(paragraphs(describe(results), lines(missed), wrote_lines([written]), hint))
    worse = any(change.verdict == "worse" for change in results.comparison)
    raise typer.Exit(
        # A renderer that broke has a higher code than what was found to be worse.
        max([int(bool(missed) or worse or not results.complete), *(failure.exit_code for failure in sweep.failures)])
    )
