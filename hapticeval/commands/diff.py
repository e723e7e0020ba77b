"""`hapticeval diff`: what a change of the code has changed in verdicts, margins and times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from hapticeval.commands.arguments import argument
from hapticeval.commands.summary import paint
from hapticeval.commands.terminal import lines, paragraphs, plural, say
from hapticeval.quantity import quantity
from hapticeval.runner.diff import Diff, MarginMove, VerdictChange, compare_results
from hapticeval.runner.results import FILE, read_results

if TYPE_CHECKING:
    from hapticeval.study.bench.document import Change

EXIT_CODES = """\b
Exit codes:
  0  no verdict is worse
  1  a verdict stops the gate that did not, or the new run is incomplete; with --strict also where a verdict changed
     or is gone, or a time is significantly longer
  2  wrong usage or input
"""

SHOWN = 10
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
    """Compare two runs: verdicts that changed, margins that moved, times that moved significantly.

    A verdict is worse where it stops the gate now and did not before. Margins are in bounds. Times are those of
    `hapticeval bench`, where both folders hold one: a single run of a case shows nothing significant.

    \b
    Examples:
      hapticeval diff main results
      hapticeval diff main results --format markdown >> "$GITHUB_STEP_SUMMARY"
    """
    found = compare_results(*(read_results(each.parent if each.name == FILE else each) for each in (old, new)))
    times = _times(old, new)
    written = {
        Format.TEXT: _text,
        Format.GITHUB: _github,
        Format.MARKDOWN: _markdown,
        Format.JSON: _json,
    }[format_]
    say(written(found, times, verbose))
    slower = any(each.verdict == "worse" for each in times)
    raise typer.Exit(int(found.stops(strict=strict) or (strict and slower)))


def _times(old: Path, new: Path) -> Sequence[Change]:
    """Return the changes of two benches that differ significantly; none where a folder holds no bench."""
    from hapticeval.study.bench.compare import compare_benches
    from hapticeval.study.bench.document import FILE as BENCH
    from hapticeval.study.bench.document import read_bench, read_samples

    if not all((folder / BENCH).is_file() for folder in (old, new)):
        return []
    (before, earlier), (now, samples) = ((read_bench(folder), read_samples(folder)) for folder in (old, new))
    return [each for each in compare_benches(now, samples, before, earlier) if each.verdict != "not significant"]


def _counts(found: Diff, times: Sequence[Change]) -> str:
    standings = [each.standing for each in found.verdicts]
    counted = [f"{standings.count(name)} {name}" for name in dict.fromkeys(standings)]
    moved = f"{plural(len(found.margins), 'margin')} moved"
    timed = f", {plural(len(times), 'time')} moved significantly" if times else ""
    ended = f"; the new run is incomplete: {found.incomplete}" if found.incomplete else ""
    both = f"{plural(found.compared, 'verdict')} in both runs"
    return f"{both}: {', '.join(counted) or 'none changed'}; {moved}{timed}{ended}"


def _change(each: VerdictChange) -> str:
    return f"{each.standing}: {_outcomes(each)}"


def _outcomes(each: VerdictChange) -> str:
    if each.before is None or each.now is None:
        return str(each.now or each.before)
    return f"{each.before}, now {each.now}"


def _move(each: MarginMove) -> str:
    way = "nearer to failing" if each.by < 0.0 else "further from failing"
    values = f"{quantity(each.before, each.unit)}, now {quantity(each.now, each.unit)}"
    return f"{each.metric} {values}: {abs(each.by):.3g} bounds {way}"


def _time(each: Change) -> str:
    ratio = "" if each.ratio is None else f" {each.ratio:.3g} times what it was"
    return f"{each.label} on {each.model}: {each.what}{ratio}, {each.verdict}"


def _text(found: Diff, times: Sequence[Change], verbose: bool) -> str:
    colours = {"worse": "red", "gone": "yellow", "changed": "yellow", "better": "green"}
    margins = found.margins if verbose else found.margins[:SHOWN]
    more = len(found.margins) - len(margins)
    return paragraphs(
        lines(
            f"{paint(each.standing, colours.get(each.standing))}: {each.renderer} on {each.place}: {_outcomes(each)}\n"
            f"  {each.message}"
            for each in found.verdicts
        ),
        lines(f"margin: {each.renderer} on {each.place}: {_move(each)}" for each in margins),
        f"and {plural(more, 'margin')} more: -v shows them" if more else "",
        lines(f"time: {_time(each)}" for each in times),
        _counts(found, times),
    )


def _github(found: Diff, times: Sequence[Change], verbose: bool) -> str:
    """Workflow commands: GitHub shows each beside the job."""
    kinds = {"worse": "error", "gone": "warning", "changed": "warning"}
    told = [
        _annotation(kinds.get(c.standing, "notice"), f"{c.renderer} on {c.place}", f"{_change(c)}: {c.message}")
        for c in found.verdicts
    ]
    if verbose:
        told += [_annotation("notice", f"{each.renderer} on {each.place}", _move(each)) for each in found.margins]
    told += [_annotation("warning" if each.verdict == "worse" else "notice", "time", _time(each)) for each in times]
    return lines([*told, _annotation("error" if found.incomplete else "notice", "hapticeval", _counts(found, times))])


def _annotation(kind: str, title: str, message: str) -> str:
    def escaped(text: str) -> str:
        return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")

    return f"::{kind} title={escaped(title).replace(':', '%3A').replace(',', '%2C')}::{escaped(message)}"


def _markdown(found: Diff, times: Sequence[Change], verbose: bool) -> str:
    from hapticeval.reports.table import aligned_table

    def tables() -> Iterator[str]:
        yield f"**hapticeval**: {_counts(found, times)}"
        if found.verdicts:
            rows = [[c.standing, c.renderer, c.place, _outcomes(c), c.message] for c in found.verdicts]
            yield aligned_table(["", "renderer", "verdict", "outcome", "what was seen"], rows)
        margins = found.margins if verbose else found.margins[:SHOWN]
        if margins:
            yield aligned_table(
                ["renderer", "margin that moved", "by"], [[m.renderer, m.place, _move(m)] for m in margins]
            )
        if times:
            yield lines(f"- {_time(each)}" for each in times)

    return "\n\n".join(tables())


def _json(found: Diff, times: Sequence[Change], verbose: bool) -> str:  # noqa: ARG001 - as the others
    document = {**msgspec.structs.asdict(found), "times": times}
    return msgspec.json.format(msgspec.json.encode(document), indent=1).decode()
