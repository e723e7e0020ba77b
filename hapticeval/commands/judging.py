"""The commands that judge, and show what was found: run, replay, report, list, explain."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hapticeval.commands.arguments import (
    FormatName,
    MappingFile,
    MemoryLimit,
    SceneEntries,
    Scheduler,
    Seed,
    SuiteCase,
    Timeout,
    TouchedModel,
    Verbose,
    argument,
    load_within,
    model_named,
    option,
    renderers_option,
)
from hapticeval.commands.summary import github_annotations, summary, terminal_width
from hapticeval.commands.terminal import Terminal, on_github, paragraphs, say, wrote_lines
from hapticeval.errors import HapticevalError, InputError
from hapticeval.files import file_stem
from hapticeval.recordings.memory import DEFAULT_LIMIT
from hapticeval.suite import DEFAULT_SUITE

if TYPE_CHECKING:
    from hapticeval.api import Results
    from hapticeval.replay.subject import ReplayCase
    from hapticeval.runner.interrupts import Interrupts

TIMEOUT = 600.0
"""Seconds in which the built-in renderers end any case of the suites several times over, with kernels to compile."""

COLLECTED_AFTER = 50_000
"""New objects after which Python looks for garbage while it judges; by default, 700, that took a tenth of a run.

What is imported and compiled stays, and what is recorded is freed without it. Chosen.
"""

loop_option = partial(option, rich_help_panel="While you work on a renderer")
gate_option = partial(option, rich_help_panel="Gate")
long_run_option = partial(option, rich_help_panel="Long runs")

EXIT_CODES = """\b
Exit codes:
  0  every verdict is as required, inherent in what the renderer declares,
     or known with --known
  1  a check failed, could not decide or differs, or fewer verdicts than
     planned were reached, as after Ctrl-C; with --strict also where a check
     of level should failed or could not decide, or a known failure is none
     any more
  2  wrong usage or input, or every case was refused by every renderer
  3  a renderer broke: the message names case, tick and HIP (outranks 1 and 2)
  4  nothing was selected
"""

REPLAY_CODES = """\b
Exit codes:
  0  every verdict is as required; with --as-recorded, the log follows from its renderer
  1  a check failed, could not decide or differs; with --as-recorded, the log does not follow
  2  wrong usage or input, or every renderer refused the case
  3  a renderer broke
"""

LIST_CODES = """\b
Exit codes:
  0  listed
  2  wrong usage, or no such name
"""

MERGE_CODES = """\b
Exit codes:
  0  every verdict is as required, inherent in what its renderer declares, or known
  1  a check failed, could not decide or differs, or one of the runs is incomplete
  2  wrong usage, or what is in the folders is not one run: versions, seeds,
     overlaps, missing shards
  3  a renderer broke
"""

REPORT_CODES = """\b
Exit codes:
  0  the reports are written, whatever they say
  1  interrupted: pages are without the figures that were not drawn yet
  2  wrong usage, no results in the folder, or no reports can be written there
"""


def run(
    suites: Annotated[
        list[str] | None,
        argument(metavar="SUITE", help=f"Suites, groups of suites or TOML files; {DEFAULT_SUITE} if none."),
    ] = None,
    renderers: Annotated[list[str] | None, renderers_option("those that the suite names, or the built-in ones")] = None,
    select: Annotated[
        list[str] | None,
        option(
            "-k",
            metavar="EXPR",
            help="Run only what this selects: names of cases and checks or globs on them, CASE/CHECK, with and, or, "
            "not, parentheses; may be repeated.",
        ),
    ] = None,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where results and reports go.")
    ] = Path("results"),
    seed: Seed = 0,
    verbose: Verbose = False,
    quick: Annotated[
        bool,
        loop_option(
            "--quick", help="Run few cases, which have every check between them, and write no reports: some seconds."
        ),
    ] = False,
    no_report: Annotated[bool, loop_option("--no-report", help="Write results.json and recordings alone.")] = False,
    exit_first: Annotated[bool, loop_option("-x", help="Stop at the first verdict that is not as required.")] = False,
    failed_first: Annotated[
        bool, loop_option("--failed-first", help="Begin with what failed in DIR the last time.")
    ] = False,
    watch: Annotated[
        bool, loop_option("--watch", help="Run again whenever a file of renderer or suite changes.")
    ] = False,
    strict: Annotated[
        bool, gate_option("--strict", help="Let warnings count, and known failures that are none any more.")
    ] = False,
    known: Annotated[
        Path | None,
        gate_option("--known", metavar="TOML", help="Let the failures on this list pass, each with its reason."),
    ] = None,
    write_known: Annotated[
        Path | None,
        gate_option(
            "--write-known", metavar="TOML", help="Make or renew that list from what fails now; its reasons stay."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "-j",
            metavar="N",
            min=0,
            show_default=False,
            help="Share the work among N processes: one a processor if not given, this one alone with 0.",
        ),
    ] = None,
    timeout: Timeout = TIMEOUT,
    resume: Annotated[
        bool, long_run_option("--resume", help="Keep what an earlier run into DIR has finished, and run the rest.")
    ] = False,
    shard: Annotated[
        str | None,
        long_run_option("--shard", metavar="K/N", help="Run part K of N only: `hapticeval merge` makes them one."),
    ] = None,
    scheduler: Scheduler = None,
) -> None:
    """Run suites on renderers, judge, and write results and reports.

    \b
    Examples:
      hapticeval run                                the built-in renderers
      hapticeval run -r mymodule:factory            one of your own
      hapticeval run thesis -r constraint -r minimum-distance@level-set
      hapticeval run dynamics                       another suite: in closed loop
      hapticeval run mysuite.toml -o out            a suite of your own, and where to

    \b
    While you work on it:
      hapticeval run -r mymodule:factory --quick --watch
      hapticeval run -r mymodule:factory -k 'star-* and not memoryless'
      hapticeval run -r mymodule:factory -k 'cassinian-*/continuous-contact'

    \b
    As a gate, with a list of known failures that is written once:
      hapticeval run -r mymodule:factory --write-known known.toml
      hapticeval run -r mymodule:factory --known known.toml --strict

    \b
    On several machines:
      hapticeval run dynamics --shard 3/16 -o shard-3
      hapticeval run dynamics --scheduler tcp://10.0.0.1:8786 --resume
    """
    from hapticeval import api

    # An earlier list is read before it is renewed: its reasons stay.
    if known is None and write_known is not None and write_known.exists():
        known = write_known

    def judged(terminal: Terminal) -> Results:
        results = api.run(
            renderers or (),
            suites=suites or DEFAULT_SUITE,
            select=select or (),
            output=directory,
            seed=seed,
            strict=strict,
            known=known,
            quick=quick,
            exit_first=exit_first,
            failed_first=failed_first,
            workers=workers,
            timeout=timeout,
            watch=terminal,
            resume=resume,
            shard=shard,
            scheduler=scheduler,
        )
        if write_known is None:
            return results
        try:
            return results.write_known(write_known)
        except HapticevalError as error:
            error.todo = "; ".join(filter(None, (error.todo, f"with --resume -o {directory} nothing is judged again")))
            raise

    # Once, or again after each change with --watch.
    def once() -> int:
        return judge_and_summarise(
            judged, verbose=verbose, report=not (quick or no_report), known_file=write_known, resumable=True
        )

    if not watch:
        raise typer.Exit(once())
    from hapticeval.commands.watching import files_behind, run_again

    # Beside the renderers' sources: files of the user that change what is judged.
    suite_files = [Path(suite) for suite in suites or () if suite.endswith(".toml")] + (
        [] if known is None else [known]
    )
    raise typer.Exit(run_again(once, lambda: [*files_behind(renderers or ()), *suite_files]))


def merge(
    folders: Annotated[list[Path], argument(metavar="DIR...", help="Folders of runs, or of all shards of a run.")],
    directory: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Where the one run goes.")],
) -> None:
    """Make one run of several: of all shards of a run, or of runs on other suites, cases or renderers.

    Verdicts come in the order in which one run would have come to them. What is not one run is refused: other
    versions or seeds, the same case and renderer twice, a suite that was changed, shards that are missing.

    \b
    Examples:
      hapticeval merge shard-* -o results
      hapticeval merge on-monday on-tuesday -o both
    """
    from hapticeval import api

    raise typer.Exit(judge_and_summarise(lambda _: api.merge(folders, directory)))


def judge_and_summarise(
    judge: Callable[[Terminal], Results],
    opening_text: Callable[[Results], str] | None = None,
    *,
    verbose: bool = False,
    report: bool = True,
    known_file: Path | None = None,
    resumable: bool = False,
) -> int:
    """Have renderers judged, print the summary, below the `opening_text` of the results, and return the exit code.

    After an interrupt it says how to go on, if the command is `resumable`.

    Reports are written if wanted. `known_file` is named among them: the list that `judge` writes of what fails. What a
    failure amounts to is then settled by that list, so the summary alone counts.
    """
    from hapticeval.runner.interrupts import Interrupts

    with (
        _seldom_collected(),
        Interrupts(to_the_end=True) as interrupts,
        Terminal(verbose=verbose, counts=known_file is None) as terminal,
    ):
        # Progress goes to stderr while it runs; stdout has the summary alone, at the end.
        results = judge(terminal)
        write_error = None
        try:
            # None where the run was given up.
            reports = _write_reports(results, terminal, interrupts) if report else [results.file]
        except HapticevalError as error:
            # As on a full disk: what was judged is told all the same.
            error.todo = error.todo or f"the verdicts are kept: hapticeval report {results.folder} writes the reports"
            reports, write_error = None, error
        opening = "" if opening_text is None else opening_text(results)
        written = [*(reports or [results.file]), *([known_file] if known_file else [])]
        say(paragraphs(opening, summary(results.document, written, verbose=verbose, width=terminal_width())))
        if terminal.interrupted and resumable:
            say("to go on: the same command with --resume")
        if on_github():
            say(github_annotations(results.document))
        if write_error is not None:
            raise write_error
    return max(results.exit_code, int(interrupts.count > 0))


@contextmanager
def _seldom_collected() -> Iterator[None]:
    """While it lasts, Python seldom looks for garbage, here and in the processes that are copied of this one."""
    thresholds = gc.get_threshold()
    gc.set_threshold(COLLECTED_AFTER, *thresholds[1:])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)


def _write_reports(results: Results, terminal: Terminal, interrupts: Interrupts, **options: Any) -> list[Path] | None:
    """Write the reports of results, with the `options` of `Results.report`, and return all paths.

    Where the user has stopped the run at once it says how to have them later, and returns None. Where the user stops
    the drawing, the pages are without the figures that are left, and it says so; an earlier report stays as it is. A
    first interrupt that has ended the run early does not stop the drawing as well.
    """
    # An interrupt that has ended the run early was not meant for the reports.
    interrupts_of_run = int(terminal.interrupted)

    def stopped() -> bool:
        return interrupts.count > interrupts_of_run

    # A second interrupt ends the run at once, and no report is drawn.
    if not stopped():
        try:
            written = results.report(progress=terminal.drawn, stopped=stopped, **options)
        except KeyboardInterrupt:
            pass
        else:
            if stopped():
                terminal.line(f"interrupted: figures are left out; hapticeval report {results.folder} draws them")
            return written
    terminal.line(f"no reports are written: hapticeval report {results.folder} makes them of what is kept")
    return None


def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of an earlier run.")],
    single_file: Annotated[
        bool, typer.Option("--single-file", help="Write report.html, which holds all pages, in place of report/.")
    ] = False,
) -> None:
    """Write the reports of an earlier run anew, from its results.

    \b
    Examples:
      hapticeval report results
      hapticeval report results --single-file
    """
    from hapticeval.api import Results
    from hapticeval.runner.interrupts import Interrupts

    results = Results.read(directory)
    with Interrupts(to_the_end=True) as interrupts, Terminal() as terminal:
        written = _write_reports(results, terminal, interrupts, single_file=single_file)
    if written is not None:
        say(wrote_lines(written[1:]))
    raise typer.Exit(int(interrupts.count > 0))


def replay(
    file: Annotated[Path, argument(metavar="FILE", help="A recording.")],
    renderers: Annotated[list[str] | None, renderers_option("the built-in ones")] = None,
    as_recorded: Annotated[
        bool, typer.Option("--as-recorded", help="Compute the recorded renderer again, and compare with the log.")
    ] = False,
    model: TouchedModel = None,
    suite_case: SuiteCase = None,
    scene: SceneEntries = None,
    mapping: MappingFile = None,
    format_: FormatName = None,
    memory_limit: MemoryLimit = DEFAULT_LIMIT,
    directory: Annotated[
        Path | None, option("-o", "--output", metavar="DIR", help="Where results and reports go: replay-FILE.")
    ] = None,
    seed: Seed = 0,
    verbose: Verbose = False,
) -> None:
    """Lead renderers along a recorded hand path, and judge them beside the recorded run.

    The path is played sample by sample at its recorded times. It is open loop: under another force the hand would
    have moved otherwise.

    \b
    Examples:
      hapticeval replay run7.h5 -r constraint -r minimum-distance
      hapticeval replay signal.svc --mapping handwriting.toml --model circle --scene stiffness=1000
      hapticeval replay run7.h5 --as-recorded
    """
    from hapticeval.discovery import own_renderers
    from hapticeval.replay.as_recorded import unstated_renderer
    from hapticeval.replay.subject import make_replay_case

    directory = directory or Path(f"replay-{file_stem(file.stem)}")
    # New results remove the recordings of earlier ones.
    if file.resolve().is_relative_to((directory / "recordings").resolve()) and not as_recorded:
        raise InputError(
            f"{file} is a recording of the results in '{directory}', which a replay into that folder would remove",
            why="new results take the place of earlier ones",
            todo="name another folder with -o",
        )
    recording = load_within(memory_limit, file, mapping, format_)
    table = None if model is None else model_named(model).table
    replay_case = make_replay_case(
        file, recording, model=table, suite_case=suite_case, scene=scene or (),
        unsaid=unstated_renderer(recording, renderers or ()) if as_recorded else None,
    )  # fmt: skip
    # Named where the recording is suspicious.
    hint = f"see `hapticeval inspect {file}{'' if mapping is None else f' --mapping {mapping}'}`"
    if as_recorded:
        raise typer.Exit(_recompute_recorded(replay_case, renderers, hint))
    raise typer.Exit(
        _replay_path(replay_case, renderers or list(own_renderers()), directory, seed, hint, verbose=verbose)
    )


def _replay_path(
    replay_case: ReplayCase, renderers: list[str], directory: Path, seed: int, hint: str, *, verbose: bool
) -> int:
    """Judge renderers along the recorded path, print the summary, and return the exit code."""
    from hapticeval.api import carry_out
    from hapticeval.replay.job import describe_differences, prepare_replay, replay_plan
    from hapticeval.runner.planning import RunOptions

    # One run for each renderer, beside the recorded one.
    planned = replay_plan(replay_case, renderers, RunOptions(output=directory, seed=seed))
    # Once for all renderers: the path and its examination.
    work = prepare_replay(replay_case)

    def judged(terminal: Terminal) -> Results:
        _warn_of_suspicious(work.path.suspicious, hint, terminal)
        return carry_out(planned, watch=terminal, work=work)

    return judge_and_summarise(
        judged, opening_text=lambda results: describe_differences(results.document), verbose=verbose
    )


def _warn_of_suspicious(suspicious: Sequence[str], hint: str, terminal: Terminal) -> None:
    """Say what an examination of the recording found: verdicts on it may say little."""
    for finding in suspicious:
        terminal.line(f"suspicious: {finding}")
    if suspicious:
        terminal.line(hint)


def _recompute_recorded(replay_case: ReplayCase, renderers: list[str] | None, hint: str) -> int:
    """Compare the log with its own renderer, computed again, and return the exit code."""
    from hapticeval.replay.as_recorded import as_recorded

    comparison = as_recorded(replay_case, renderers or ())
    with Terminal() as terminal:
        _warn_of_suspicious(comparison.suspicious, hint, terminal)
    say(comparison.describe())
    return int(not comparison.follows)


def list_(
    what: Annotated[
        str, argument(metavar="WHAT", help="renderers, suites, cases, checks, devices, models, effects or formats.")
    ],
    suites: Annotated[list[str] | None, argument(metavar="SUITE", help="The cases of these suites only.")] = None,
) -> None:
    """List the renderers, suites, cases, checks, devices, models, effects or file formats.

    \b
    Examples:
      hapticeval list renderers
      hapticeval list cases thesis
    """
    from hapticeval.commands import listing

    say(listing.listing_text(what, suites or ()))


def explain(
    check: Annotated[
        list[str],
        argument(
            metavar="CHECK",
            help="A check's id, as in `hapticeval list checks`, a word of the field for it, or a number of the thesis.",
        ),
    ],
) -> None:
    """Explain what a check asks, measures and allows, and why; or what shows a part of the thesis.

    \b
    Examples:
      hapticeval explain continuous-contact
      hapticeval explain pop-through
      hapticeval explain 6.22 (also table-6.3, "(4.12)")
    """
    from hapticeval.commands import listing

    say(listing.explanation(" ".join(check)))
