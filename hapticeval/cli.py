"""The command line: a shell around suites, runner and reports, each imported when it is used."""

from __future__ import annotations

import io
import json
import os
import sys
from collections.abc import Generator, Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hapticeval import __version__
from hapticeval.errors import HapticevalError, InputError

if TYPE_CHECKING:
    from hapticeval.events import Event
    from hapticeval.results import Results
    from hapticeval.terminal import Terminal

DEFAULT_SUITE = "thesis"
DEFAULT_DIRECTORY = Path("results")
REPORTS = ("table.md", "junit.xml", "report.html")

ABOUT = """Judge haptic renderers by six phenomena of rigid contact.

\b
Examples:
  hapticeval run                               the built-in renderers on the thesis's cases
  hapticeval run -r mymodule:factory           a renderer of your own, from the current directory
  hapticeval run -k '*corner*' -r constraint   only the cases whose name has corner in it
  hapticeval list cases                        what there is to run
  hapticeval explain continuous-contact        what a check measures, its bound, and why
  hapticeval bench --quick                     what accuracy costs in time
"""

EXIT_CODES = """\b
Exit codes:
  0  every verdict is as required, or as published where the suite publishes one
  1  a check failed, could not decide or differs, or fewer verdicts than planned were reached
  2  wrong usage or input
  3  a renderer broke: the message names case, tick and HIP (outranks 1 and 2)
  4  nothing was selected
"""

BENCH_EXIT_CODES = """\b
Exit codes:
  0  measured; with --compare nothing is worse, with --within a setting meets it
  1  something is significantly worse, no setting meets --within, or the bench was interrupted
  2  wrong usage or input, or a setting whose input was not usable
  3  a renderer broke (outranks 1 and 2)
"""

app = typer.Typer(
    name="hapticeval",
    help=ABOUT,
    epilog=EXIT_CODES,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


class Listing(StrEnum):
    """What `hapticeval list` can list."""

    RENDERERS = "renderers"
    SUITES = "suites"
    CASES = "cases"
    CHECKS = "checks"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; what a user got wrong is told without a traceback."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        app(args=None if arguments is None else list(arguments), prog_name="hapticeval")
    except HapticevalError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 0 if stop.code is None else 1
    return 0


def _version(wanted: bool) -> None:
    if wanted:
        _say(f"hapticeval {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Nothing is shared but `--version`."""


@app.command(epilog=EXIT_CODES)
def run(
    suites: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SUITE",
            help=f"Suite names or TOML files; {DEFAULT_SUITE} if none.",
            show_default=False,
        ),
    ] = None,
    renderers: Annotated[
        list[str] | None,
        typer.Option(
            "-r",
            "--renderer",
            metavar="NAME",
            help="BASE[+SCHEME][@REPRESENTATION], BASE an entry point or package.module:factory; may be "
            "repeated. Without it, the renderers that come with hapticeval.",
            show_default=False,
        ),
    ] = None,
    select: Annotated[
        list[str] | None,
        typer.Option(
            "-k",
            metavar="GLOB",
            help="Only the cases, or case/check pairs, that match; may be repeated.",
            show_default=False,
        ),
    ] = None,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where results and reports go.")
    ] = DEFAULT_DIRECTORY,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of everything random.", min=0, max=2**32 - 1)] = 0,
) -> None:
    """Run suites on renderers, judge, and write results and reports.

    \b
    Examples:
      hapticeval run
      hapticeval run thesis -r constraint -r minimum-distance@level-set
      hapticeval run -r mymodule:factory -k 'cassinian-*/continuous-contact'
      hapticeval run mysuite.toml -o out
    """
    from hapticeval.discovery import own_renderers
    from hapticeval.results import FILE
    from hapticeval.runner import execute, plan
    from hapticeval.terminal import Terminal, exit_code, summary

    names = renderers or list(own_renderers())
    planned = plan(suites or [DEFAULT_SUITE], names, select=select or (), seed=seed)
    _prepare(directory)
    with Terminal() as terminal:
        results = _watch(execute(planned, directory, workers=_cores()), terminal)
        written = _report(directory, terminal)
    _say(summary(results, [directory / FILE, *written]))
    raise typer.Exit(exit_code(results, terminal.errors))


@app.command("list")
def list_(what: Annotated[Listing, typer.Argument(help="What to list.", show_default=False)]) -> None:
    """List the renderers, suites, cases or checks that there are."""
    from hapticeval import listing

    rows = {
        Listing.RENDERERS: listing.renderers,
        Listing.SUITES: listing.suites,
        Listing.CASES: listing.cases,
        Listing.CHECKS: listing.checks,
    }[what]()
    _say(listing.columns(rows))


@app.command()
def explain(
    check: Annotated[str, typer.Argument(help="A check's id, as in `hapticeval list checks`.")],
) -> None:
    """Tell what a check asks, measures and allows, and why."""
    from hapticeval import listing

    _say(listing.columns(listing.explained(check)))


@app.command()
def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of an earlier run.")],
) -> None:
    """Write the reports of an earlier run anew, from its results."""
    from hapticeval.terminal import Terminal

    with Terminal() as terminal:
        written = _report(directory, terminal)
    _say("\n".join(f"wrote {path}" for path in written))


@app.command(epilog=BENCH_EXIT_CODES)
def bench(
    renderers: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="RENDERER",
            help="As in `run -r`. Without one, those that come with hapticeval, on every representation.",
            show_default=False,
        ),
    ] = None,
    knobs: Annotated[
        list[str] | None,
        typer.Option(
            "--knob",
            metavar="NAME=VALUE,...",
            help="Values to sweep a knob over, such as vertices=40,80,160; may be repeated.",
            show_default=False,
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few values and few samples: some minutes.")] = False,
    within: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help="Name the cheapest setting whose IHIP error is at most this, such as 0.1mm.",
            show_default=False,
        ),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option(
            metavar="TIME", help="Only settings whose step takes at most this, such as 10us.", show_default=False
        ),
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="The folder of an earlier bench: tell what is better or worse now.", show_default=False
        ),
    ] = None,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where the measurements go.")
    ] = DEFAULT_DIRECTORY,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of everything random.", min=0)] = 0,
) -> None:
    """Measure what accuracy costs in time: sweep the knobs of renderers.

    \b
    Examples:
      hapticeval bench --quick
      hapticeval bench constraint@polygon --knob vertices=40,80,160
      hapticeval bench --within 0.1mm --budget 10us
      hapticeval bench --quick -o new --compare old
    """
    from dataclasses import replace

    from hapticeval.bench import compare as comparison
    from hapticeval.bench import quantity, tell
    from hapticeval.bench.judge import judged
    from hapticeval.bench.settings import chosen_values, own_variants, settings_of
    from hapticeval.bench.sweep import Sweep
    from hapticeval.costs import read_costs, read_samples, write_costs
    from hapticeval.terminal import Terminal

    wanted = None if within is None else quantity.length(within, option="--within")
    limit = None if budget is None else quantity.duration(budget, option="--budget")
    before = None if compare is None else (read_costs(compare), read_samples(compare))
    names = renderers or own_variants()
    settings = settings_of(names, quick=quick, chosen=chosen_values(knobs or []))
    _prepare(directory)
    command = {"renderers": names, "knobs": knobs or [], "within": within, "budget": budget}
    sweep = Sweep(settings, quick=quick, seed=seed, command=command)
    with Terminal() as terminal:
        sweep.run(terminal.working)
    samples = sweep.samples()
    costs = judged(sweep.costs(), within=wanted, budget=limit)
    if before is not None:
        costs = replace(costs, comparison=comparison.compare(costs, samples, *before))
    written = write_costs(directory, costs, samples)
    _say("\n".join([tell.summary(costs), "", *(f"wrote {path}" for path in written)]))
    missed = within is not None and any(each["what"] == "step" and each["key"] is None for each in costs.answers)
    worse = any(each["verdict"] == "worse" for each in costs.comparison)
    raise typer.Exit(max([int(missed or worse or not costs.complete), *(each.exit_code for each in sweep.failures)]))


@app.command()
def field(
    renderer: Annotated[str, typer.Argument(metavar="RENDERER", help="As in `run -r`.", show_default=False)],
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="A model of the catalogue, as in star or star:points=6,tip_angle=40, or a WKT or GeoJSON file.",
            show_default=False,
        ),
    ],
    within: Annotated[
        str, typer.Option(metavar="LENGTH", help="How far from a discontinuity the inside is measured.")
    ] = "1mm",
    origin: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="X,Y",
            help="Of a renderer with memory: the surface point nearest to this one, m, is where its tool was.",
            show_default=False,
        ),
    ] = None,
    arc: Annotated[
        float | None,
        typer.Option("--s", metavar="ARC", help="The same by arc length along the model, m.", show_default=False),
    ] = None,
    knobs: Annotated[
        list[str] | None,
        typer.Option("--knob", metavar="NAME=VALUE", help="Set a knob; may be repeated.", show_default=False),
    ] = None,
    cells: Annotated[int, typer.Option(metavar="N", help="Lattice steps along the longer side.", min=20)] = 300,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where picture and numbers go.")
    ] = Path(),
) -> None:
    """Draw where a projection sends the inside of a model, and where it jumps.

    \b
    Examples:
      hapticeval field minimum-distance star
      hapticeval field constraint@curve cassinian --from 0.1,0
      hapticeval field minimum-distance@polygon cassinian --knob vertices=80 -o pictures
      hapticeval field mapping outline.wkt --within 2mm
    """
    from hapticeval.bench.quantity import length
    from hapticeval.picturing import pictured
    from hapticeval.reports.fields_figure import caption, write_field

    distance = length(within, option="--within")
    found, document = pictured(renderer, model, within=distance, origin=origin, arc=arc, knobs=knobs or [], cells=cells)
    written = write_field(directory, found, document)
    _say("\n".join([document["title"], caption(document), "", *(f"wrote {path}" for path in written)]))


def _watch(stream: Iterator[Event], terminal: Terminal) -> Results:
    """Give every event to the terminal, and return the results that the last one brings.

    Ctrl-C may come while an event is shown; the stream must learn of it to end the run in good order.
    """
    from hapticeval.events import RunFinished

    results = None
    for event in stream:
        try:
            terminal(event)
        except KeyboardInterrupt:
            if not isinstance(stream, Generator):
                raise
            event = stream.throw(KeyboardInterrupt)
        if isinstance(event, RunFinished):
            results = event.results
    assert results is not None
    return results


def _prepare(directory: Path) -> None:
    """See that results may be written: into a folder that is new, empty, or holds an earlier run or bench of ours."""
    from hapticeval import costs
    from hapticeval.results import FILE

    if directory.exists() and not directory.is_dir():
        raise InputError(f"'{directory}' is a file", why="results go into a folder", todo="name another with -o")
    if (
        directory.is_dir()
        and any(directory.iterdir())
        and not any(map(_ours, (directory / FILE, directory / costs.FILE)))
    ):
        raise InputError(
            f"'{directory}' is not empty and holds no {FILE} of an earlier run",
            why="files that hapticeval did not write are never overwritten",
            todo="name a new or an empty folder with -o",
        )
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for report in REPORTS:  # an earlier run's must not stand beside this one's results
            (directory / report).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot write into the folder '{directory}'", why=str(error), todo="name another with -o"
        ) from error


def _ours(file: Path) -> bool:
    """Whether a file is a document of a run or a bench, of whatever version."""
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    kinds = ({"format_version", "planned", "verdicts"}, {"format_version", "settings", "references"})
    return isinstance(document, dict) and any(kind <= document.keys() for kind in kinds)


def _report(directory: Path, terminal: Terminal) -> list[Path]:
    from hapticeval.reports import write_reports

    return write_reports(directory, progress=terminal.drawn, workers=_cores())


def _cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _say(text: str) -> None:
    """Print on stdout. A reader that has gone away (`| head`) changes no exit code."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
