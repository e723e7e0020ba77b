"""`hapticeval search`: the smallest path that breaks a renderer, and whether it still does."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hapticeval.commands.arguments import Scheduler, Seed, model_named, option, renderers_option
from hapticeval.commands.terminal import Terminal, columns, lines, paragraphs, say, wrote_lines
from hapticeval.errors import InputError
from hapticeval.quantity import plural

if TYPE_CHECKING:
    from hapticeval.search.counterexample import StoredCounterexample
    from hapticeval.search.seeds import Hunt, HuntResult

PICTURE_SECONDS = 20.0
"""Seconds in which the pictures of a renderer's counterexamples begin: what is slow, or hangs, ends there."""

EXIT_CODES = """\b
Exit codes:
  0  nothing was found in that time; with --replay every case is fixed
  1  something was found, or still fails, nothing could be judged, or the search was interrupted
  2  wrong usage or input, or every model was refused
  3  a renderer broke: it raised, answered nonsense, died or hung (outranks 1 and 2)
"""


def search(
    renderers: Annotated[list[str] | None, renderers_option("with --replay that of each case")] = None,
    checks: Annotated[
        list[str] | None,
        option(
            "--check",
            metavar="ID",
            help="Only this check; may be repeated. Without it all that decide, but those on goals and on effects.",
        ),
    ] = None,
    models: Annotated[
        list[str] | None,
        option(
            "--model",
            metavar="MODEL",
            help="Only on this model, as in star:points=6, or a WKT or GeoJSON file; may be repeated.",
        ),
    ] = None,
    dimension: Annotated[
        int | None,
        option(
            "--dimension",
            metavar="N",
            help="On models in the plane (2), or on meshes and surfaces in space (3). "
            "Without it 3 for a renderer that declares space alone, else 2.",
            min=2,
            max=3,
        ),
    ] = None,
    moving: Annotated[
        bool, typer.Option("--moving", help="On bodies that slide and spin, of a renderer that supports 'moving'.")
    ] = False,
    seconds: Annotated[
        float,
        typer.Option(
            "--seconds", metavar="S", help="Time for each renderer, without its pictures: up to 20 s.", min=0.1
        ),
    ] = 60.0,
    examples: Annotated[
        int | None, option("--examples", metavar="N", help="End after so many examples, if the time lasts.", min=1)
    ] = None,
    replay: Annotated[
        Path | None,
        option("--replay", metavar="DIR", help="Search nothing: try the cases that are kept below a folder."),
    ] = None,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where counterexamples are kept.")
    ] = Path("counterexamples"),
    seed: Seed = 0,
    seeds: Annotated[
        int,
        typer.Option(
            "--seeds",
            metavar="N",
            help="Search with so many seeds, from --seed on, each for its own time, on all processors.",
            min=1,
            rich_help_panel="Long runs",
        ),
    ] = 1,
    scheduler: Scheduler = None,
) -> None:
    """Search for the smallest path that breaks a renderer.

    Models and hand paths are drawn, judged by the checks, and what fails is made smaller while it fails in the same
    way: fewer moves, shorter, on round coordinates. Each counterexample is kept as a suite of one case, which `run`
    takes, with its path as CSV and a picture. What is kept below DIR is tried first the next time.

    \b
    Examples:
      hapticeval search -r mine:Renderer
      hapticeval search -r mine:Renderer --check continuous-contact --model cassinian --seconds 10
      hapticeval search -r constraint -r minimum-distance --seed 7 -o found
      hapticeval search -r mine:InSpace --dimension 3
      hapticeval search -r mine:Renderer --seeds 16 --scheduler tcp://10.0.0.1:8786
      hapticeval search --replay found -r mine:Renderer
      hapticeval run found/constraint/continuous-contact.toml -r constraint
    """
    from hapticeval.files import plain
    from hapticeval.runner.folder import COUNTEREXAMPLES, holds_results, locked_folder
    from hapticeval.runner.interrupts import Interrupts
    from hapticeval.search.counterexample import read_all
    from hapticeval.search.seeds import Hunt

    if replay is not None:
        raise typer.Exit(_replay_kept(replay, renderers))
    names = _searched_renderers(renderers)
    check_ids = _searched_checks(checks)
    if models and dimension is not None:
        raise InputError("--dimension and --model", why="a model has a dimension", todo="give one of the two")
    model_tables = [plain(model_named(text).table, "model") for text in models or ()]
    # A report shows what lies here in its folder: searched, judged and reported there one at a time.
    results = directory.parent if directory.name == COUNTEREXAMPLES and holds_results(directory.parent) else None
    with (
        locked_folder(results),
        locked_folder(directory, for_results=False),
        Interrupts(to_the_end=True) as interrupts,
        Terminal() as terminal,
    ):
        # What earlier searches kept is tried before anything is drawn.
        known = read_all(directory)
        hunts = [
            Hunt(name, check_ids, model_tables, known, seconds, examples, dimension or _default_dimension(name), moving)
            for name in names
        ]

        def interrupted() -> bool:
            return interrupts.count > 0

        # All renderers and seeds side by side; else one after the other, with a bar.
        if seeds > 1 or scheduler is not None:
            all_seeds = range(seed, seed + seeds)
            code = _hunt_side_by_side(hunts, all_seeds, scheduler, directory, terminal, interrupted)
        else:
            code = _hunt_in_turn(hunts, seed, directory, terminal, interrupted)
    raise typer.Exit(code)


def _searched_renderers(renderers: list[str] | None) -> list[str]:
    """Return each renderer once. Raises `InputError` where none is named or a name is not known, before time goes."""
    from hapticeval.discovery import resolve

    if not renderers:
        raise InputError("no renderer is named", why="a search takes its time for each", todo="name one: -r constraint")
    for name in renderers:
        resolve(name)
    return list(dict.fromkeys(renderers))


def _searched_checks(checks: list[str] | None) -> tuple[str, ...]:
    """Return the checks that are named, else all that decide. Raises `InputError` for one that no drawn case asks."""
    from hapticeval.phenomena.registry import CHECKS, OF_EFFECTS, unknown_check
    from hapticeval.phenomena.verdict import Level
    from hapticeval.search.drawing import judgeable

    for check in checks or ():
        if check not in CHECKS:
            raise unknown_check(check)
        if CHECKS[check].needs_closed_form:
            raise InputError(f"--check {check}", why="it compares with a closed form, which only a case can name")
        if check in OF_EFFECTS:
            raise InputError(
                f"--check {check}",
                why="it asks for an effect, and no scene that is drawn calls for one",
                todo="judge it in a suite: hapticeval run effects",
            )
    # What is only shown is not a fault, and no counterexample unless it is asked for: a god-object may have a memory.
    return tuple(checks or (name for name in judgeable() if CHECKS[name].level is not Level.INFO))


def _hunt_side_by_side(
    hunts: Sequence[Hunt],
    seeds: range,
    scheduler: str | None,
    directory: Path,
    terminal: Terminal,
    interrupted: Callable[[], bool],
) -> int:
    """Hunt with every seed, on all processors or a scheduler's workers; return the highest exit code."""
    from hapticeval.search.seeds import run_hunts
    from hapticeval.workers import default_workers

    names = ", ".join(hunt.renderer for hunt in hunts)
    terminal.line(f"searching with {plural(len(seeds), 'seed')} for what breaks {names}")
    codes, begun = [], time.monotonic()
    for hunt, outcome, ended in run_hunts(
        hunts, seeds, workers=default_workers(), scheduler=scheduler, interrupted=interrupted,
        progress=terminal.still, report=terminal.line,
    ):  # fmt: skip
        terminal.clear()
        # Some seeds were interrupted, or lost with their worker.
        if ended < len(seeds):
            terminal.line(f"{hunt.renderer}: {ended} of {plural(len(seeds), 'seed')} ended")
            codes.append(1)
        codes.append(_write_findings(hunt, outcome, directory, time.monotonic() - begun))
    return max(codes)


def _hunt_in_turn(
    hunts: Sequence[Hunt], seed: int, directory: Path, terminal: Terminal, interrupted: Callable[[], bool]
) -> int:
    """Hunt for one renderer after the other, with a bar; return the highest exit code."""
    from hapticeval.search.seeds import run_hunt

    codes = []
    for hunt in hunts:
        # Ctrl-C has ended the search: the renderers that are left are not begun.
        if interrupted():
            codes.append(1)
            break
        begun = time.monotonic()
        started = f"searching for what breaks {hunt.renderer}: up to {hunt.seconds:g} s"
        terminal.line(f"{started}, Ctrl-C ends it and keeps what is found")

        def progress(done: float, what: str, total: float = hunt.seconds) -> None:
            terminal.searching(done, total, what)

        outcome = run_hunt(hunt, seed, interrupted=interrupted, progress=progress, report=terminal.line)
        terminal.clear()
        # An interrupted search has failed, even where it found nothing.
        codes.append(max(_write_findings(hunt, outcome, directory, time.monotonic() - begun), int(interrupted())))
    return max(codes)


def _default_dimension(renderer: str) -> int:
    """Return 3 for a renderer whose factory declares that it is for models in space alone, else 2."""
    from hapticeval.discovery import resolve
    from hapticeval.renderer import choices_of
    from hapticeval.scene import PLANE, SPACE

    declared = choices_of(resolve(renderer)).supports or frozenset()
    # A renderer that declares nothing, or both, is searched in the plane.
    return 3 if SPACE in declared and PLANE not in declared else 2


def _write_findings(hunt: Hunt, outcome: HuntResult, directory: Path, took: float) -> int:
    """Write what was found of one renderer, print it, and return the exit code."""
    from hapticeval.search.counterexample import line, notes, write
    from hapticeval.search.hunt import deadline
    from hapticeval.search.trial import RENDERER

    written, without_picture = [], []
    suites = [write(counterexample, directory)[0] for counterexample in outcome.counterexamples]
    # One budget for all pictures of a renderer.
    is_over = deadline(PICTURE_SECONDS, lambda: False)
    for counterexample, suite in zip(outcome.counterexamples, suites, strict=True):
        pictures = draw_counterexample(counterexample, suite, is_over)
        written += [suite, *(pictures or ())]
        # None: no time was left; an empty list: the renderer breaks, and nothing can be drawn.
        without_picture += [] if pictures is not None else [counterexample.fault.check]
    say(
        paragraphs(
            lines(
                "\n  ".join([f"{hunt.renderer}: {line(counterexample)}", *notes(counterexample)])
                for counterexample in outcome.counterexamples
            ),
            describe_search(hunt, outcome, took),
            f"no picture, for its time was over, of: {', '.join(without_picture)}" if without_picture else "",
            wrote_lines(written),
        )
    )
    if any(counterexample.fault.check == RENDERER for counterexample in outcome.counterexamples):
        return 3
    if outcome.refused is not None:
        return 2
    return int(bool(outcome.counterexamples) or not outcome.judged)


def describe_search(hunt: Hunt, outcome: HuntResult, took: float) -> str:
    """Return what was searched, and what was not found."""
    if outcome.refused is not None:
        return f"{hunt.renderer} refuses every model that was tried: {outcome.refused}"
    failing = {counterexample.fault.check for counterexample in outcome.counterexamples}
    unfailed = [name for name in hunt.checks if name not in failing]
    # Checks that were decided, with in how many examples.
    passed = [f"{name} ({outcome.judged[name]})" for name in unfailed if outcome.judged[name]]
    undecided = [name for name in unfailed if not outcome.judged[name]]
    # The time of each renderer, or the user.
    ended = "" if outcome.finished else "; the time was over" if took >= hunt.seconds else "; interrupted"
    effort = [f"{plural(outcome.tried, 'example')} drawn, {outcome.trials} tried in {took:.1f} s{ended}"]
    if outcome.silence:
        effort.append(f"at the end {outcome.silence}")
    if not outcome.judged and not outcome.counterexamples:
        todo = "give more --seconds, or see whether the model is as large as you mean"
        return lines([*effort, f"nothing was judged: no example had an answer when the search ended; {todo}"])
    cut_short = [
        counterexample.fault.check for counterexample in outcome.counterexamples if not counterexample.complete
    ]
    named = [
        ("not shrunk to the end; search again, or give more --seconds", cut_short),
        ("no failure, in so many examples, of", passed),
        ("no example decides", undecided),
    ]
    return lines([*effort, *(f"{words}: {', '.join(names)}" for words, names in named if names)])


def draw_counterexample(
    counterexample: StoredCounterexample, suite: Path, over: Callable[[], bool]
) -> list[Path] | None:
    """Draw what the renderer does in a counterexample beside its suite; nothing where it breaks.

    None where the time is `over` before the renderer has answered.
    """
    from hapticeval.reports.canvas import save_figure
    from hapticeval.reports.run_figure import SCREEN_WIDTH, DrawnRun, Mark, run_figure
    from hapticeval.search.counterexample import line
    from hapticeval.search.trial import RENDERER, Bench, Stopped, record_case

    if counterexample.fault.check == RENDERER:
        return []
    try:
        with Bench(counterexample.renderer, counterexample.seed, over) as bench:
            recording = bench.call_in_case(counterexample.case, record_case, counterexample.case)
    except Stopped:
        return None
    if recording is None:
        return []
    # The time that the verdict names, ringed.
    marks = [] if counterexample.fault.time is None else [Mark(counterexample.fault.time)]
    model, title = counterexample.case.build_scene().model, f"{counterexample.renderer}: {line(counterexample)}"
    run = DrawnRun(counterexample.renderer, recording, marks)
    return save_figure(run_figure([run], model, title=title, width=SCREEN_WIDTH), suite.parent, suite.stem)[:1]


def _replay_kept(folder: Path, renderers: list[str] | None) -> int:
    """Try the cases below a folder, print which are fixed, and return the exit code."""
    from hapticeval.discovery import resolve, resolve_installed
    from hapticeval.runner.interrupts import Interrupts
    from hapticeval.search.counterexample import read_all
    from hapticeval.search.trial import RENDERER, Bench, Stopped

    all_kept = read_all(folder)
    if not all_kept:
        raise InputError(
            f"no counterexamples are kept in '{folder}'", todo="name the folder that a search wrote to with -o"
        )
    for name in renderers or ():
        resolve(name)
    rows: list[tuple[str, str]] = []
    codes = [0]
    with Interrupts(to_the_end=True) as interrupts, Terminal() as terminal:
        for done, counterexample in enumerate(all_kept):
            terminal.still(
                done, len(all_kept), f"trying what breaks {counterexample.renderer}: {counterexample.fault.check}"
            )
            if not renderers:
                resolve_installed(counterexample.renderer, source=str(folder))
            for name in dict.fromkeys(renderers or [counterexample.renderer]):
                with Bench(name, counterexample.seed, lambda: interrupts.count > 0) as bench:
                    try:
                        answer = bench(counterexample.case)
                    # Interrupted: the case has no row, and the code below is 1.
                    except Stopped:
                        break
                check = counterexample.fault.check
                # The same check fails, or the renderer itself breaks.
                again = next((fault for fault in answer.faults if fault.check in (check, RENDERER)), None)
                # Without an outcome the check had nothing to object to.
                outcome = answer.outcomes.get(check, "pass")
                if again is not None:
                    state = f"STILL FAILS: {again.message}"
                elif answer.refused is not None:
                    state = f"NOT TRIED: the renderer refuses: {answer.refused}"
                elif outcome in ("pass", "not-applicable"):
                    state = "FIXED"
                else:
                    state = f"NOT DECIDED: {outcome}"
                rows.append(
                    (
                        f"{name} {counterexample.renderer if name != counterexample.renderer else ''} {check}".replace(
                            "  ", " "
                        ),
                        state,
                    )
                )
                broke = again is not None and again.check == RENDERER
                codes.append(3 if broke else int(state != "FIXED"))
        if interrupts.count:
            codes.append(1)
    say(columns(rows))
    return max(codes)
