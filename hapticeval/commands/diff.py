"""`hapticeval diff`, `history` and `badge`: what a change of the code has changed, since when, and where it stands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from hapticeval.commands.arguments import argument, option
from hapticeval.commands.summary import paint
from hapticeval.commands.terminal import annotation, lines, paragraphs, say, wrote_lines
from hapticeval.errors import UnknownNameError
from hapticeval.quantity import format_number, format_quantity, plural
from hapticeval.runner.diff import Diff, MarginMove, VerdictChange, compare_results
from hapticeval.runner.results import RESULTS_FILE, read_results
from hapticeval.table import Table

if TYPE_CHECKING:
    from hapticeval.runner.diff import History
    from hapticeval.study.bench.document import Change


EXIT_CODES = """\b
Exit codes:
  0  no verdict is worse
  1  a verdict stops the gate that did not, or the new run is incomplete; with --strict also where a verdict changed
     or is gone, or a time is longer
  2  wrong usage or input
"""

MARGINS_SHOWN = 10
"""Margins that are shown without -v: those that moved most."""


class Format(StrEnum):
    """How a comparison is written: for people, as annotations of GitHub, as a comment there, or for programs."""

    TEXT = "text"
    GITHUB = "github"
    MARKDOWN = "markdown"
    JSON = "json"


def diff(
    old: Annotated[Path, argument(metavar="OLD", help="The folder of an earlier run.")],
    new: Annotated[Path, argument(metavar="NEW", help="The folder of a later one.")],
    format_: Annotated[
        Format, typer.Option("--format", help="text; github: annotations of a job; markdown: a comment; json.")
    ] = Format.TEXT,
    strict: Annotated[
        bool, typer.Option("--strict", help="Let every change of a verdict count, and slower times.")
    ] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="Show all margins that moved.")] = False,
) -> None:
    """Compare two runs: verdicts that changed, margins that moved, times that moved.

    A verdict is worse where it stops the gate now and did not before. Margins are in bounds. Times are those of
    `hapticeval bench`, where both folders hold one: a single run of a case says nothing.

    \b
    Examples:
      hapticeval diff main results
      hapticeval diff main results --format markdown >> "$GITHUB_STEP_SUMMARY"
    """
    comparison = compare_results(
        *(read_results(folder.parent if folder.name == RESULTS_FILE else folder) for folder in (old, new))
    )
    times = _changed_times(old, new)
    written = {
        Format.TEXT: _as_text,
        Format.GITHUB: _as_github,
        Format.MARKDOWN: _as_markdown,
        Format.JSON: _as_json,
    }[format_]
    say(written(comparison, times, verbose))
    # Slower times count for the exit code with --strict only.
    slower = any(change.verdict == "worse" for change in times)
    raise typer.Exit(int(comparison.stops(strict=strict) or (strict and slower)))


def _changed_times(old: Path, new: Path) -> Sequence[Change]:
    """Return what two benches differ in; nothing where a folder holds no bench."""
    from hapticeval.study.bench.document import BENCH_FILE, read_bench
    from hapticeval.study.bench.judge import compare_benches

    if not all((folder / BENCH_FILE).is_file() for folder in (old, new)):
        return []
    changes = compare_benches(read_bench(new), read_bench(old))
    return [change for change in changes if change.verdict != "the same"]


def _counts_words(comparison: Diff, times: Sequence[Change]) -> str:
    """Return the closing line: verdicts in both runs, changes by their standing, margins and times that moved."""
    standings = [verdict.standing for verdict in comparison.verdicts]
    counted = [f"{standings.count(name)} {name}" for name in dict.fromkeys(standings)]
    moved = f"{plural(len(comparison.margins), 'margin')} moved"
    timed = f", {plural(len(times), 'time')} moved" if times else ""
    ended = f"; the new run is incomplete: {comparison.incomplete}" if comparison.incomplete else ""
    both = f"{plural(comparison.compared, 'verdict')} in both runs"
    return f"{both}: {', '.join(counted) or 'none changed'}; {moved}{timed}{ended}{_apart_words(comparison)}"


def _apart_words(comparison: Diff) -> str:
    """Return why two runs share no verdict, and what helps; "" where they share one, or there is none."""
    if comparison.compared or not comparison.verdicts:
        return ""
    before = {verdict.renderer for verdict in comparison.verdicts if verdict.now is None}
    now = {verdict.renderer for verdict in comparison.verdicts if verdict.before is None}
    if before & now:
        return "; the runs have no check of one case in common: give both the same suites and -k"
    return "; the runs have no renderer in common: give the old and the new version one name"


def _outcome_words(change: VerdictChange) -> str:
    """Return an outcome and what it is now, or the one outcome where only one run has the verdict."""
    # Only one of the runs has the verdict.
    if change.before is None or change.now is None:
        return str(change.now or change.before)
    return f"{change.before}, now {change.now}"


def _move_words(move: MarginMove) -> str:
    """Return a metric before and now with its unit, and by how many bounds its margin moved."""
    # `by` is the margin's change in bounds; a margin grows away from failing.
    direction = "nearer to failing" if move.by < 0.0 else "further from failing"
    values = f"{format_quantity(move.before, move.unit)}, now {format_quantity(move.now, move.unit)}"
    return f"{move.metric} {values}: {format_number(abs(move.by), 3)} bounds {direction}"


def _time_words(change: Change) -> str:
    ratio = "" if change.ratio is None else f" {change.ratio:.3g} times what it was"
    return f"{change.label} on {change.model}: {change.what}{ratio}, {change.verdict}"


def _as_text(comparison: Diff, times: Sequence[Change], verbose: bool) -> str:
    """Return the comparison for people: verdicts, margins and times a line each, then the counts."""
    colours = {"worse": "red", "gone": "yellow", "changed": "yellow", "better": "green"}
    margins = comparison.margins if verbose else comparison.margins[:MARGINS_SHOWN]
    more = len(comparison.margins) - len(margins)
    return paragraphs(
        lines(f"suite: {suite}" for suite in comparison.suites),
        lines(
            f"{paint(change.standing, colours.get(change.standing))}: {change.renderer} on {change.place}: "
            f"{_outcome_words(change)}\n  {change.message}"
            for change in comparison.verdicts
        ),
        lines(f"margin: {move.renderer} on {move.place}: {_move_words(move)}" for move in margins),
        f"and {plural(more, 'margin')} more: -v shows them" if more else "",
        lines(f"time: {_time_words(change)}" for change in times),
        _counts_words(comparison, times),
    )


def _as_github(comparison: Diff, times: Sequence[Change], verbose: bool) -> str:
    """Workflow commands: GitHub shows each beside the job."""
    # What is better is a notice.
    kinds = {"worse": "error", "gone": "warning", "changed": "warning"}
    annotations = [annotation("warning", "suite", suite) for suite in comparison.suites]
    annotations += [
        annotation(
            kinds.get(c.standing, "notice"),
            f"{c.renderer} on {c.place}",
            f"{c.standing}: {_outcome_words(c)}: {c.message}",
        )
        for c in comparison.verdicts
    ]
    if verbose:
        annotations += [
            annotation("notice", f"{move.renderer} on {move.place}", _move_words(move)) for move in comparison.margins
        ]
    annotations += [
        annotation("warning" if change.verdict == "worse" else "notice", "time", _time_words(change))
        for change in times
    ]
    return lines(
        [
            *annotations,
            annotation("error" if comparison.incomplete else "notice", "hapticeval", _counts_words(comparison, times)),
        ]
    )


def _as_markdown(comparison: Diff, times: Sequence[Change], verbose: bool) -> str:
    """Return the comparison as a comment for GitHub, with tables of verdicts and margins."""

    def tables() -> Iterator[str]:
        yield f"**hapticeval**: {_counts_words(comparison, times)}"
        if comparison.suites:
            yield lines(f"- {suite}" for suite in comparison.suites)
        if comparison.verdicts:
            rows = [[c.standing, c.renderer, c.place, _outcome_words(c), c.message] for c in comparison.verdicts]
            yield Table("verdicts", ["", "renderer", "verdict", "outcome", "what was seen"], rows).markdown
        margins = comparison.margins if verbose else comparison.margins[:MARGINS_SHOWN]
        if margins:
            moves = [[move.renderer, move.place, _move_words(move)] for move in margins]
            yield Table("margins", ["renderer", "margin that moved", "by"], moves).markdown
        if times:
            yield lines(f"- {_time_words(change)}" for change in times)

    return "\n\n".join(tables())


def _as_json(comparison: Diff, times: Sequence[Change], verbose: bool) -> str:  # noqa: ARG001 - as the others
    document = {**msgspec.structs.asdict(comparison), "times": times}
    return msgspec.json.format(msgspec.json.encode(document), indent=1).decode()


HISTORY_CODES = """\b
Exit codes:
  0  written, whatever it says
  2  wrong usage or input
"""


def history(
    folders: Annotated[list[Path], argument(metavar="DIR...", help="Folders of runs.")],
    renderers: Annotated[
        list[str] | None,
        option("-r", "--renderer", metavar="NAME", help="Show this renderer; may be repeated. Without it: all."),
    ] = None,
    as_given: Annotated[
        bool, typer.Option("--as-given", help="Take the runs in this order, and not by the time when they ran.")
    ] = False,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The page to write, or a folder for it.")
    ] = Path("history.html"),
) -> None:
    """Show a renderer over several runs: a page of checks over commits, with the first red commit of each.

    A check is red in a run where one of its verdicts stops that run's gate. A run whose renderer lies in a git
    repository is called by its commit, any other by its folder. Columns link to the reports that are there.

    \b
    Examples:
      hapticeval history results-*
      hapticeval history --as-given good middle bad -r mine:Nearest -o bisect.html
    """
    from hapticeval.reports.pages import write_history
    from hapticeval.runner.diff import histories_of
    from hapticeval.runner.results import read_results

    runs = [(folder, read_results(folder)) for folder in dict.fromkeys(folders)]
    if not as_given:
        # ISO dates in UTC: their order as text is that in time.
        runs.sort(key=lambda run: run[1].date)
    known = {name for _, results in runs for name in results.renderers}
    for name in renderers or ():
        if name not in known:
            raise UnknownNameError("renderer of these runs", name, known)
    histories = histories_of(runs, renderers or ())
    # As -o of other commands, a folder will do.
    written = write_history(output if output.suffix else output / "history.html", histories)
    say(paragraphs(*(lines(_words_of(renderer_history)) for renderer_history in histories), wrote_lines([written])))


def _words_of(renderer_history: History) -> Iterator[str]:
    """Yield what is told of a renderer: over what, what is red, and since when."""
    red = [check for check in renderer_history.checks if check.is_red]
    state = (
        f"{plural(len(red), 'check')} red, the first from {renderer_history.first_red.words}"
        if renderer_history.first_red
        else "all green"
    )
    yield f"{renderer_history.renderer}: {plural(len(renderer_history.editions), 'run')}; now {state}"
    for check in renderer_history.checks:
        if check.words:
            yield f"  {check.check}: {check.words}"
            if check.is_red and check.first_red is not None:
                yield f"    {check.first_red.gravest.place}: {check.first_red.gravest.message}"


BADGE_CODES = """\b
Exit codes:
  0  the badge is written, whatever it shows
  2  wrong usage, no results in the folder, or no badge can be written there
"""


def badge(
    directory: Annotated[Path, argument(metavar="DIR", help="The folder of a run.")] = Path("results"),
    output: Annotated[
        Path | None, option("-o", "--output", metavar="DIR", help="Where badge.svg and badge.json go: DIR of the run.")
    ] = None,
) -> None:
    """Draw a badge of a run: badge.svg, and badge.json for an endpoint of shields.io.

    \b
    Example:
      hapticeval badge results -o badges
    """
    from hapticeval.reports.badge import write_badge
    from hapticeval.runner.results import read_results

    # Beside the results unless a folder is named.
    say(wrote_lines(write_badge(output or directory, read_results(directory))))
