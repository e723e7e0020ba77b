"""The command line: a shell around suites, runner and reports, each imported when it is used."""

from __future__ import annotations

import io
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from hapticeval import __version__
from hapticeval.commands import (
    bench,
    compare,
    convert,
    device,
    field,
    flow,
    inspect,
    integrators,
    limits,
    record,
    replay,
)
from hapticeval.commands.output import DEFAULT_DIRECTORY, prepare, say
from hapticeval.commands.running import report_on as _report
from hapticeval.commands.running import watch as _watch
from hapticeval.errors import HapticevalError

DEFAULT_SUITE = "thesis"

ABOUT = """Judge haptic renderers by six phenomena of rigid contact.

\b
Examples:
  hapticeval run                               the built-in renderers on the thesis's cases
  hapticeval run -r mymodule:factory           a renderer of your own, from the current directory
  hapticeval run -k '*corner*' -r constraint   only the cases whose name has corner in it
  hapticeval list cases                        what there is to run
  hapticeval explain continuous-contact        what a check measures, its bound, and why
  hapticeval run dynamics                      in closed loop with a robot, against chapters 6.3 and 7
  hapticeval record -o run.h5                  record a robot; here the simulated one, in real time
  hapticeval replay run.h5 -r constraint       a recorded hand path through another renderer
  hapticeval bench --quick                     what accuracy costs in time
"""

EXIT_CODES = """\b
Exit codes:
  0  every verdict is as required, or as published where the suite publishes one
  1  a check failed, could not decide or differs, or fewer verdicts than planned were reached, as after Ctrl-C;
     with --strict also where a check of level should failed or could not decide
  2  wrong usage or input, or every case was refused by every renderer
  3  a renderer broke: the message names case, tick and HIP (outranks 1 and 2)
  4  nothing was selected
"""

TOLD = """\b
Exit codes:
  0  told
  2  wrong usage, or no such name
"""

REPORTED = """\b
Exit codes:
  0  the reports are written, whatever they say
  1  interrupted: no reports are written
  2  wrong usage, no results in the folder, or no reports can be written there
"""

DRAWN = """\b
Exit codes:
  0  told and drawn
  2  wrong usage or input: the message says what, why, and what to do
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


INTERRUPTED = 130
"""What typer leaves with, without a word, where Ctrl-C has met nobody who does something about it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; what a user got wrong is told without a traceback.

    Without `arguments` it takes those of the process, which ends after it. Ctrl-C where no command does something about
    it, as before one has begun, is told in a word, and is 1.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    interrupted = signal.getsignal(signal.SIGINT)
    try:
        app(args=None if arguments is None else list(arguments), prog_name="hapticeval")
    except HapticevalError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return _interrupted()
    except SystemExit as stop:
        if stop.code == INTERRUPTED:
            return _interrupted()
        return stop.code if isinstance(stop.code, int) else 0 if stop.code is None else 1
    finally:
        if arguments is not None and signal.getsignal(signal.SIGINT) is not interrupted:
            signal.signal(signal.SIGINT, interrupted)  # the command has kept Ctrl-C from disturbing its end
    return 0


def _interrupted() -> int:
    """The exit code of a command that was interrupted; nothing disturbs the end of it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    print("interrupted", file=sys.stderr)
    return 1


def _version(wanted: bool) -> None:
    if wanted:
        say(f"hapticeval {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Nothing is shared but `--version`."""


@app.command(epilog=EXIT_CODES, short_help="Run suites on renderers, judge, and report.")
def run(
    suites: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SUITE",
            help=f"Suites, groups of suites or TOML files; {DEFAULT_SUITE} if none.",
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
            "repeated. Without it, those that the suite names, or that come with hapticeval.",
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
    strict: Annotated[bool, typer.Option("--strict", help="Let warnings count: checks of level should.")] = False,
) -> None:
    """Run suites on renderers, judge, and write results and reports.

    \b
    Examples:
      hapticeval run
      hapticeval run thesis -r constraint -r minimum-distance@level-set
      hapticeval run dynamics
      hapticeval run -r mymodule:factory -k 'cassinian-*/continuous-contact'
      hapticeval run mysuite.toml -o out
    """
    from hapticeval.commands.terminal import Terminal, exit_code, summary
    from hapticeval.runner.execution import execute
    from hapticeval.runner.interrupts import Interrupts
    from hapticeval.runner.planning import plan
    from hapticeval.runner.results import FILE
    from hapticeval.workers import cores

    planned = plan(suites or [DEFAULT_SUITE], renderers or (), select=select or (), seed=seed, strict=strict)
    prepare(directory)
    with Interrupts(to_the_end=True) as interrupts, Terminal() as terminal:
        results = _watch(execute(planned, directory, workers=cores(), interrupts=interrupts), terminal)
        written = _report(directory, terminal, interrupts)
        say(summary(results, [directory / FILE, *written]))
    raise typer.Exit(max(exit_code(results, terminal.errors), int(terminal.stopped)))


@app.command("list", epilog=TOLD)
def list_(
    what: Annotated[
        str, typer.Argument(help="renderers, suites, cases, checks, devices or models.", show_default=False)
    ],
) -> None:
    """List the renderers, suites, cases, checks, devices or models.

    \b
    Examples:
      hapticeval list renderers
      hapticeval list cases
    """
    from hapticeval.commands import listing

    say(listing.columns(listing.listed(what)))


@app.command(epilog=TOLD)
def explain(
    check: Annotated[str, typer.Argument(help="A check's id, as in `hapticeval list checks`.")],
) -> None:
    """Tell what a check asks, measures and allows, and why.

    \b
    Example:
      hapticeval explain continuous-contact
    """
    from hapticeval.commands import listing

    say(listing.columns(listing.explained(check)))


@app.command(epilog=REPORTED)
def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of an earlier run.")],
) -> None:
    """Write the reports of an earlier run anew, from its results.

    \b
    Example:
      hapticeval report results
    """
    from hapticeval.commands.terminal import Terminal
    from hapticeval.runner.interrupts import Interrupts

    with Interrupts(to_the_end=True) as interrupts, Terminal() as terminal:
        written = _report(directory, terminal, interrupts)
    if written:
        say("\n".join(f"wrote {path}" for path in written))
    raise typer.Exit(int(terminal.stopped))


for _command, _epilog, _short in (
    (record.record, record.EXIT_CODES, "Run a renderer on a robot and record it."),
    (inspect.inspect, inspect.EXIT_CODES, "Examine a recording: clock, channels, units, physics."),
    (convert.convert, convert.EXIT_CODES, "Convert foreign files, journals and recordings."),
    (replay.replay, replay.EXIT_CODES, "Lead renderers along a recorded hand path."),
    (compare.compare, compare.EXIT_CODES, "Compare the force of runs that no clock can align."),
    (bench.bench, bench.EXIT_CODES, "Measure what accuracy costs in time."),
    (field.field, DRAWN, "Draw where a projection leads, and where it jumps."),
    (flow.flow, DRAWN, "Draw how a model's outline shrinks to a point."),
    (device.device, DRAWN, "Tell what the hand feels of a device, and its reach."),
    (limits.limits, limits.EXIT_CODES, "Find the largest stiffness that stays stable."),
    (integrators.integrators, DRAWN, "Draw how exactly a robot's motion is integrated."),
):
    app.command(epilog=_epilog, short_help=_short)(_command)
