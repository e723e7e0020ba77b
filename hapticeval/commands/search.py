"""`hapticeval search`: the smallest path that breaks a renderer, and whether it still does."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hapticeval.commands.arguments import Renderers, Seed, model_named, option
from hapticeval.commands.terminal import Terminal, columns, lines, paragraphs, say, wrote
from hapticeval.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from hapticeval.geometry.model import Model
    from hapticeval.runner.interrupts import Interrupts
    from hapticeval.search.counterexample import Kept
    from hapticeval.search.hunt import Search
    from hapticeval.search.trial import Bench

EXIT_CODES = """\b
Exit codes:
  0  nothing was found in that time; with --replay every case is fixed
  1  something was found, or still fails, nothing could be judged, or the search was interrupted
  2  wrong usage or input, or every model was refused
  3  a renderer broke: it raised, answered nonsense, died or hung (outranks 1 and 2)
"""


def search(
    renderers: Renderers = None,
    checks: Annotated[
        list[str] | None,
        option("--check", metavar="ID", help="Only this check; may be repeated. Without it, all but those on goals."),
    ] = None,
    models: Annotated[
        list[str] | None,
        option(
            "--model",
            metavar="MODEL",
            help="Only on this model, as in star:points=6, or a WKT or GeoJSON file; may be repeated.",
        ),
    ] = None,
    seconds: Annotated[
        float, typer.Option("--seconds", metavar="S", help="Time for each renderer, without the pictures.", min=0.1)
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
      hapticeval search --replay found -r mine:Renderer
      hapticeval run found/constraint/continuous-contact.toml -r constraint
    """
    raise typer.Exit(
        _replay(replay, renderers)
        if replay is not None
        else _search(renderers, checks, models, seconds, examples, directory, seed)
    )


def _search(
    renderers: list[str] | None,
    checks: list[str] | None,
    models: list[str] | None,
    seconds: float,
    examples: int | None,
    directory: Path,
    seed: int,
) -> int:
    from hapticeval.discovery import resolve
    from hapticeval.phenomena.registry import CHECKS
    from hapticeval.runner.interrupts import Interrupts
    from hapticeval.search.counterexample import read_all
    from hapticeval.search.drawing import judgeable

    if not renderers:
        raise InputError("no renderer is named", why="a search takes its time for each", todo="name one: -r constraint")
    for name in renderers:
        resolve(name)
    for check in checks or ():
        if check not in CHECKS:
            raise UnknownNameError("check", check, CHECKS)
        if CHECKS[check].needs_closed_form:
            raise InputError(f"--check {check}", why="it compares with a closed form, which only a case can name")
    asked = tuple(checks or judgeable())
    on = [model_named(text) for text in models or ()]
    known = read_all(directory) if directory.is_dir() else []
    codes = []
    with Interrupts(to_the_end=True) as interrupts, Terminal() as terminal:
        for name in dict.fromkeys(renderers):
            if interrupts.count:
                codes.append(1)
                break
            codes.append(_searched(name, asked, on, seconds, examples, directory, seed, known, terminal, interrupts))
    return max(codes)


def _searched(
    renderer: str,
    checks: Sequence[str],
    models: Sequence[Model],
    seconds: float,
    examples: int | None,
    directory: Path,
    seed: int,
    known: Sequence[Kept],
    terminal: Terminal,
    interrupts: Interrupts,
) -> int:
    """Search for what one renderer breaks, write and tell it, and return the exit code."""
    from hapticeval.search.counterexample import kept, line, notes, write
    from hapticeval.search.hunt import Search, deadline
    from hapticeval.search.trial import RENDERER, Bench

    terminal.line(f"searching for what breaks {renderer}: up to {seconds:g} s, Ctrl-C ends it and keeps what is found")
    begun = time.monotonic()
    stop = deadline(seconds, lambda: interrupts.count > 0)

    def over() -> bool:
        terminal.searching(time.monotonic() - begun, seconds, f"{made.tried} examples, {len(made.found)} found")
        return stop()

    with Bench(renderer, seed, over) as bench:
        made = Search(
            bench, checks, seed, models, known=[(each.case, each.examples) for each in known], most=examples,
            told=terminal.line,
        )  # fmt: skip
        made.run()
    found = [kept(each, renderer, seed) for each in made.found.values()]
    written = []
    for each in found:
        files = write(each, directory)
        written += [files[0], *_picture(each, files[0], seed)]
    took = time.monotonic() - begun
    say(
        paragraphs(
            lines("\n  ".join([f"{renderer}: {line(each)}", *notes(each)]) for each in found),
            _told(renderer, made, bench, took),
            wrote(written),
        )
    )
    if RENDERER in made.found:
        return 3
    if made.refused is not None:
        return 2
    return int(bool(found) or not made.judged or interrupts.count > 0)


def _told(renderer: str, made: Search, bench: Bench, took: float) -> str:
    """Return what was searched, and what was not found."""
    if made.refused is not None:
        return f"{renderer} refuses every model that was tried: {made.refused}"
    missing = [name for name in made.checks if name not in made.found]
    passed = [f"{name} ({made.judged[name]})" for name in missing if made.judged[name]]
    silent = [name for name in missing if not made.judged[name]]
    ended = "" if made.finished else "; stopped before the end"
    tried = f"{made.tried} example{'s' * (made.tried != 1)} drawn, {bench.tried} tried in {took:.1f} s{ended}"
    if not made.judged and not made.found:
        return lines([tried, "nothing was judged: no example had an answer when the time was over"])
    said = [("no failure, in so many examples, of", passed), ("no example decides", silent)]
    return lines([tried, *(f"{words}: {', '.join(names)}" for words, names in said if names)])


def _picture(made: Kept, suite: Path, seed: int) -> list[Path]:
    """Draw what the renderer does in a counterexample beside its suite; nothing where it breaks."""
    from hapticeval.reports.canvas import save_figure
    from hapticeval.reports.run_figure import Mark, run_figure
    from hapticeval.search.counterexample import line
    from hapticeval.search.trial import RENDERER, Bench

    if made.fault.check == RENDERER:
        return []
    with Bench(made.renderer, seed, lambda: False) as bench:
        recording = bench.recorded(made.case)
    if recording is None:
        return []
    marks = [] if made.fault.time is None else [Mark(1, made.fault.time, True)]
    figure = run_figure(recording, made.case.build_scene().model, marks=marks, title=f"{made.renderer}: {line(made)}")
    return save_figure(figure, suite.parent, suite.stem)[:1]


def _replay(folder: Path, renderers: list[str] | None) -> int:
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
    with Interrupts(to_the_end=True) as interrupts:
        for made in all_kept:
            if not renderers:
                resolve_installed(made.renderer, source=str(folder))
            for name in dict.fromkeys(renderers or [made.renderer]):
                with Bench(name, made.seed, lambda: interrupts.count > 0) as bench:
                    try:
                        answer = bench(made.case)
                    except Stopped:
                        break
                check = made.fault.check
                again = next((fault for fault in answer.faults if fault.check in (check, RENDERER)), None)
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
                    (f"{name} {made.renderer if name != made.renderer else ''} {check}".replace("  ", " "), state)
                )
                broke = again is not None and again.check == RENDERER
                codes.append(3 if broke else int(state != "FIXED"))
        if interrupts.count:
            codes.append(1)
    say(columns(rows))
    return max(codes)
