"""The command line: a shell around suites, runner and reports, each imported when it is used."""

from __future__ import annotations

import gc
import io
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import Annotated

import typer

from hapticeval import __version__
from hapticeval.commands import authors, bench, cache, diff, draw, judging, paper, record, recordings, reproduce, search
from hapticeval.commands.arguments import SectionedCommand, SectionedGroup
from hapticeval.commands.terminal import annotation, on_github, say
from hapticeval.errors import HapticevalError, printable

ABOUT = """Judge haptic renderers by six phenomena of rigid contact.

\b
Examples:
  hapticeval run                          the built-in renderers
  hapticeval run -r mymodule:factory      a renderer of your own
  hapticeval run -k corner -r constraint  only cases with corner in their name
  hapticeval run dynamics                 in closed loop with a robot
  hapticeval list cases                   what there is to run
  hapticeval explain continuous-contact   what a check measures, and its bound
  hapticeval doctor -r mymodule:factory   what is missing of the contract
  hapticeval new python mymodule          a renderer to start from
  hapticeval search -r mymodule:factory   the smallest path that breaks it
  hapticeval bench --quick                what accuracy costs in time
  hapticeval reproduce figure-6.22        a figure of the thesis, beside the print
  hapticeval record -o run.h5             record a robot; here a simulated one
  hapticeval replay run.h5 -r constraint  its hand path, another renderer
"""

EXIT_CODES = f"The --help of each command has examples and exit codes. Those of run:\n\n{judging.EXIT_CODES}"


app = typer.Typer(
    name="hapticeval",
    help=ABOUT,
    epilog=EXIT_CODES,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    cls=SectionedGroup,
)


INTERRUPTED_CODE = 130
"""What typer leaves with, without a word, where Ctrl-C has met nobody who does something about it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; what a user got wrong is shown without a traceback.

    Without `arguments` it takes those of the process, which ends after it. Ctrl-C where no command does something about
    it, as before one has begun, is shown in a word, and the code is 1.
    """
    exit_code = _exit_code_of(_typer_command(), arguments, "hapticeval")
    if arguments is None:
        gc.freeze()  # the process ends: it need not look for garbage once more
    return exit_code


def run_program(function: Callable[..., None], epilog: str, arguments: Sequence[str] | None = None) -> int:
    """Run a function as a command of its own, as the programs of `examples/studies` are; return its exit code.

    Its options are read off it as those of `hapticeval` are, and its errors are shown as they are by `main`.
    """
    program = typer.Typer(
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    )
    program.command(cls=SectionedCommand, epilog=epilog)(function)
    # Run by `python -m`, a module is called __main__, and its spec knows its name.
    name = getattr(sys.modules[function.__module__].__spec__, "name", function.__module__)
    return _exit_code_of(typer.main.get_command(program), arguments, f"python -m {name}")


def _exit_code_of(command: Callable[..., object], arguments: Sequence[str] | None, name: str) -> int:
    """Run a command that typer built on `arguments`, those of the process if None, and return its exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A terminal that lacks a character shows a question mark; no run ends for that.
            stream.reconfigure(errors="replace")
    # Commands may change what Ctrl-C does; a caller in Python gets its own handler back.
    interrupted = signal.getsignal(signal.SIGINT)
    try:
        command(args=None if arguments is None else list(arguments), prog_name=name)
    except HapticevalError as error:
        # Texts of files and foreign code may hold control characters: written out.
        print(printable(f"error: {error}"), file=sys.stderr)
        if on_github():
            say(annotation("error", name, printable(str(error))))
        return error.exit_code
    except KeyboardInterrupt:
        return _interrupted_code()
    except SystemExit as stop:
        if stop.code == INTERRUPTED_CODE:
            return _interrupted_code()
        # SystemExit without a code is a success; with a text, which Python would print, a failure.
        return stop.code if isinstance(stop.code, int) else 0 if stop.code is None else 1
    finally:
        if arguments is not None and signal.getsignal(signal.SIGINT) is not interrupted:
            signal.signal(signal.SIGINT, interrupted)  # the command has kept Ctrl-C from disturbing its end
    return 0


@lru_cache(maxsize=1)
def _typer_command() -> Callable[..., object]:
    """Return the command that typer builds of `app`, once a process: building takes as long as a small command."""
    return typer.main.get_command(app)


def _interrupted_code() -> int:
    """Say that the command was interrupted, ignore further Ctrl-C, and return its exit code."""
    # A second Ctrl-C while Python ends would print a traceback.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    print("interrupted", file=sys.stderr)
    return 1


def _print_version(is_requested: bool) -> None:
    if is_requested:
        say(f"hapticeval {__version__}")
        raise typer.Exit


@app.callback()
def _common_options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Nothing is shared but `--version`."""


study = typer.Typer(
    help="Studies of renderers and robots: pictures and tables beside the verdicts.",
    short_help="Pictures and tables of renderers and robots.",
    no_args_is_help=True,
    cls=SectionedGroup,
)

COMMANDS: Mapping[str, Sequence[tuple[Callable[..., None], str, str]]] = MappingProxyType(
    {
        "Judge": (
            (judging.run, judging.EXIT_CODES, "Run suites on renderers, judge, and report."),
            (judging.list_, judging.LIST_CODES, "List renderers, suites, cases, checks, effects, formats."),
            (judging.explain, judging.LIST_CODES, "Explain what a check asks, measures and allows, and why."),
            (judging.report, judging.REPORT_CODES, "Write the reports of an earlier run anew, from its results."),
            (paper.figure, paper.FIGURE_CODES, "Draw renderers on a case in one figure for a paper."),
            (paper.table, paper.TABLE_CODES, "Write a LaTeX table for a paper."),
            (diff.diff, diff.EXIT_CODES, "Compare two runs: verdicts, margins and times."),
            (diff.history, diff.HISTORY_CODES, "Show checks over commits, and the first red one."),
            (search.search, search.EXIT_CODES, "Find the smallest path that breaks a renderer."),
            (bench.bench, bench.EXIT_CODES, "Measure what accuracy costs in time."),
        ),
        "Write a renderer": (
            (authors.new, authors.NEW_CODES, "Write a renderer to start from."),
            (authors.doctor, authors.DOCTOR_CODES, "Walk a renderer through the contract."),
            (authors.header, authors.HEADER_CODES, "Print the C header for libraries."),
        ),
        "Record and replay": (
            (record.record, record.EXIT_CODES, "Run a renderer on a robot and record it."),
            (recordings.inspect, recordings.INSPECT_CODES, "Examine a recording: clock, channels, units, physics."),
            (judging.replay, judging.REPLAY_CODES, "Lead renderers along a recorded hand path."),
            (recordings.view, recordings.VIEW_CODES, "Show a recording in a page, with a slider over time."),
            (recordings.compare, recordings.COMPARE_CODES, "Put two recordings side by side."),
            (recordings.convert, recordings.CONVERT_CODES, "Convert foreign files, journals and recordings."),
        ),
        "Beside these": (
            (reproduce.reproduce, reproduce.REPRODUCE_CODES, "Compute figures and tables of the thesis."),
            (judging.merge, judging.MERGE_CODES, "Make one run of several, as of its shards."),
            (diff.badge, diff.BADGE_CODES, "Draw a badge of what a run found."),
            (cache.cache, cache.EXIT_CODES, "Show or remove the compiled kernels."),
        ),
    }
)
"""The commands as the first page of help groups them: each with its exit codes and its line there."""

STUDIES: Sequence[tuple[Callable[..., None], str, str]] = (
    (draw.field, draw.DRAW_CODES, "Draw where a projection leads, and where it jumps."),
    (draw.limits, draw.LIMITS_CODES, "Find the largest stiffness that stays stable."),
)


def _name_of(function: Callable[..., None]) -> str:
    return function.__name__.rstrip("_")


for _group, _commands_of_group in COMMANDS.items():
    for _function, _epilog, _short in _commands_of_group:
        app.command(
            _name_of(_function), cls=SectionedCommand, epilog=_epilog, short_help=_short, rich_help_panel=_group
        )(_function)
for _function, _epilog, _short in STUDIES:
    study.command(_name_of(_function), cls=SectionedCommand, epilog=_epilog, short_help=_short)(_function)
app.add_typer(study, name="study", rich_help_panel="Beside these")
