"""The closing words of a run on stdout: a grid of suites and renderers, the table, and what is unexpected."""

from __future__ import annotations

import os
import shutil
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import typer

from hapticeval.commands.terminal import annotation, lines, paragraphs, wrote_lines
from hapticeval.phenomena.inherent import would_follow
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.quantity import align_columns, format_duration, name_first, plural
from hapticeval.runner.known import describe_outdated
from hapticeval.runner.results import Breakdown, Problem, ResultsDocument, RunEntry, Timing, VerdictEntry
from hapticeval.runner.standing import Standing, counts_in_words
from hapticeval.table import Cell, Table

VERDICTS_SHOWN = 10
"""Unexpected verdicts that are shown without -v: the worst; more scroll off a screen, and the report has them all."""

CASES_NAMED = 3
"""Cases that are named of those in which a renderer broke in one way, without -v."""

REFUSALS_SHOWN = 3
"""Reasons for which renderers refuse some of their runs that are shown without -v."""

LEGEND = {
    "!": "!n are not as expected",
    "~": "~n fail and are known",
    "*": "*n fail by what the renderer declares to be (inherent)",
    "?": "?n warn",
}
"""What the marks behind a cell's numbers mean."""


duration = partial(format_duration, micro="u")
"""On a terminal, units are spelt as options take them."""


def summary(results: ResultsDocument, written: Iterable[Path], *, verbose: bool = False, width: int = 0) -> str:
    """Return grid, table, what is not as it must be, worst first, counts, time and files; if `verbose` all else, too.

    Where a `width` is given, tables that are wider are shown as lists.
    """
    stops = [verdict for verdict in _stopping_verdicts(results) if not results.lost(verdict)]
    # Warnings and entries of an outdated list are always shown; what is known or inherent needs -v.
    unstopping = [verdict for verdict in results.verdicts if not results.stops(verdict)]
    worst = stops if verbose else stops[:VERDICTS_SHOWN]
    more = len(stops) - len(worst)
    return paragraphs(
        _pass_grid(results, width),
        *_summary_tables(results, width),
        lines(results.table_notes),
        lines(_breakdown_words(breakdown, verbose=verbose) for breakdown in results.breakdowns),
        lines(
            _problem_lines(f"refuses: {run.renderer} on {run.suite}/{run.case}", run.refusal)
            for run in _all_refused_runs(results)
            if run.refusal
        ),
        lines(map(_verdict_words, worst)),
        f"and {plural(more, 'verdict')} more that {'is' if more == 1 else 'are'} not as expected: "
        "-v shows them, and so does a report"
        if more
        else "",
        lines(_verdict_words(verdict) for verdict in unstopping if verdict.standing is Standing.OUTDATED),
        lines(_verdict_words(verdict) for verdict in unstopping if verdict.standing is Standing.WARNING),
        lines(_verdict_words(verdict) for verdict in unstopping if verdict.standing.excused) if verbose else "",
        lines(_not_applicable_reasons(results)) if verbose else "",
        lines(_refused_words(results, verbose=verbose)),
        _totals_words(results, verbose=verbose),
        lines(_too_slow_words(results)),
        wrote_lines(written),
    )


def _stopping_verdicts(results: ResultsDocument) -> list[VerdictEntry]:
    """Return what stops the gate, the worst first: errors, then what a hand feels most."""
    return sorted(results.stopping, key=lambda verdict: verdict.severity, reverse=True)


def github_annotations(results: ResultsDocument) -> str:
    """Return workflow commands by which GitHub shows beside a job what stops its gate, the worst first."""
    # Where all is refused nothing was judged, and the exit code is that of a wrong input.
    refused = results.refusals if results.all_refused else {}
    refusals = (
        annotation("error", f"{name} refuses {name_first(cases, 1)}", what) for (name, what), cases in refused.items()
    )
    failures = (
        annotation(
            "error",
            f"{verdict.renderer} on {verdict.place}",
            "; ".join(part for part in (f"{verdict.outcome}: {verdict.message}", verdict.measured) if part),
        )
        for verdict in _stopping_verdicts(results)[:VERDICTS_SHOWN]
    )
    return lines([*refusals, *failures])


def paint(text: str, colour: str | None) -> str:
    """Return the text in a colour, where stdout is a terminal that shows colours."""
    # NO_COLOR and TERM=dumb as other programs take them.
    plain = not sys.stdout.isatty() or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return text if plain or colour is None else typer.style(text, fg=colour)


def terminal_width() -> int:
    """Return how many columns stdout has; 0, for any number, where it is not a terminal."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else 0


def _pass_grid(results: ResultsDocument, width: int) -> str:
    """A row a suite and a column a renderer: how many of the judged verdicts pass, and how many are a surprise."""
    cells: dict[str, dict[str, list[VerdictEntry]]] = {}
    for verdict in results.verdicts:
        cells.setdefault(verdict.suite, {}).setdefault(verdict.renderer, []).append(verdict)
    renderers = list(dict.fromkeys(verdict.renderer for verdict in results.verdicts))
    rows = [
        [
            results.suite_label(suite),
            *(_grid_cell(row[name], results) if name in row else "" for name in renderers),
        ]
        for suite, row in cells.items()
    ]
    if not rows:
        return ""
    table = Table("passed", ["", *renderers], rows)
    marks = [text for mark, text in LEGEND.items() if any(mark in text for row in table.texts for text in row[1:])]
    return _aligned_cells(table, width) + "\n" + "; ".join(["passed/judged", *marks])


def _grid_cell(verdicts: Sequence[VerdictEntry], results: ResultsDocument) -> Cell | str:
    """A cell of the grid; verdicts of level info are shown in the report and never judged."""
    judged = [verdict for verdict in verdicts if verdict.standing.judged]
    if not judged:
        return "-"
    wrong = sum(results.stops(verdict) for verdict in verdicts)
    standings = Counter(verdict.standing for verdict in judged if not results.stops(verdict))
    counts = {
        "!": wrong,
        "~": standings[Standing.KNOWN],
        "*": standings[Standing.INHERENT],
        "?": standings[Standing.WARNING],
    }
    text = f"{standings[Standing.PASS]}/{len(judged)}"
    noted = "".join(f" {mark}{count}" for mark, count in counts.items() if count)
    return Cell(text + noted, "bad" if wrong else "noted" if noted else "good")


def _summary_tables(results: ResultsDocument, width: int) -> Iterator[str]:
    """A table a suite that has rows which some renderer has decided; a cell says where it differs from print."""
    from hapticeval.reports.table import summaries, summary_table

    groups = summaries(results)
    for group in groups:
        decided = [row for row in group.rows if any(answer for answer, _ in row.cells)]
        # What is only in print stands in the report.
        table = summary_table(replace(group, printed=(), rows=tuple(replace(row, printed=()) for row in decided)))
        heading = f"{group.suite.title}\n" if group.suite is not None and len(groups) > 1 else ""
        yield heading + _aligned_cells(table, width)


TONE_COLOURS = {"good": "green", "noted": "yellow", "bad": "red"}
"""The colour of a cell by how good it is."""


def _aligned_cells(table: Table, width: int) -> str:
    """Return a table in aligned columns with colours; where these are too wide, a list for each row."""
    texts = [list(table.header), *table.texts]
    colours = [[None if isinstance(cell, str) else TONE_COLOURS.get(cell.tone) for cell in row] for row in table.rows]
    aligned_lines = align_columns(texts)
    if width and max(map(len, aligned_lines)) > width:
        lists = []
        for (title, *row), (_, *row_colours) in zip(table.texts, colours, strict=True):
            decided = [entry for entry in zip(table.header[1:], row, row_colours, strict=True) if entry[1]]
            named = align_columns([[f"  {name}", text] for name, text, _ in decided])
            lists += [title, *(paint(line, colour) for line, (*_, colour) in zip(named, decided, strict=True))]
        return lines(lists)
    # Widths by text: colour codes take no room on the terminal, but count as characters.
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    painted = (
        [paint(text, colour) + " " * (place - len(text)) for text, colour, place in zip(*row, widths, strict=True)]
        for row in zip(table.texts, colours, strict=True)
    )
    return lines([aligned_lines[0], *("  ".join(row).rstrip() for row in painted)])


def _breakdown_words(broken: Breakdown, *, verbose: bool) -> str:
    """Return why a renderer broke, what to do, and in which cases first."""
    cases = broken.cases
    text = _problem_lines(f"broke: {broken.words}", broken.error)
    if not broken.error.todo:
        text += f"\n  what to do: see what `hapticeval doctor -r {broken.runs[0].renderer}` finds of the contract"
    limit = None if verbose else CASES_NAMED
    return lines([text, f"  first on {name_first(cases, limit, ', then ')}"] if cases else [text])


def _problem_lines(head: str, problem: Problem) -> str:
    """Return a headline in red, and below it what happened, why, and what to do."""
    problem_lines = [paint(head, "red"), f"  {problem.what}"]
    problem_lines += [
        f"  {label}: {text}" for label, text in (("why", problem.why), ("what to do", problem.todo)) if text
    ]
    return lines(problem_lines)


def _all_refused_runs(results: ResultsDocument) -> Iterator[RunEntry]:
    """The first run of each renderer that has refused all that it was given: it has not been judged at all."""
    # Whoever ran anywhere is not left out altogether.
    judged = {run.renderer for run in results.runs if not run.refusal}
    yielded: set[str] = set()
    for run in results.runs:
        if run.renderer not in judged | yielded:
            yielded.add(run.renderer)
            yield run


def _verdict_words(verdict: VerdictEntry) -> str:
    """A verdict of which there is something to say, with its measure and its bound."""
    outcome, published = verdict.outcome, verdict.published
    place = f"{verdict.renderer} on {verdict.place}"
    if verdict.standing is Standing.OUTDATED:
        head, todo = describe_outdated(verdict)
        return lines([paint(head, "yellow"), f"  {todo}"])
    head, colour = {
        Standing.DIFFERS: (f"differs: {place}: {outcome}, published {published}", "red"),
        Standing.KNOWN: (f"known: {outcome}: {place}", "yellow"),
        Standing.INHERENT: (f"inherent: {outcome}: {place}", "yellow"),
        Standing.WARNING: (f"warning: {outcome}: {place}", "yellow"),
    }.get(verdict.standing, (f"{outcome}: {place}", "red"))
    notes = {
        "known because": verdict.known,
        "inherent because": verdict.inherent,
        "fail here too": ", ".join(verdict.alike) if verdict.standing.unexpected else "",
        "may be inherent": _inherent_hint(verdict),
        "see": _page_words(verdict),
    }
    note_lines = [f"{label}: {text}" for label, text in notes.items() if text]
    return lines(
        [paint(head, colour), *(f"  {text}" for text in (verdict.measured, verdict.message, *note_lines) if text)]
    )


def _page_words(verdict: VerdictEntry) -> str:
    """Return the item of its check's page that a failure is about, and the command that shows the page's."""
    if verdict.outcome is not Outcome.FAIL or not verdict.standing.unexpected:
        return ""
    from hapticeval.phenomena.registry import item_words  # which loads what the checks need

    item = item_words(verdict.check, verdict.evidence)
    return f"{item}: hapticeval explain {verdict.check}" if item else ""


def _inherent_hint(verdict: VerdictEntry) -> str:
    """Return what a renderer has to declare for this failure to be inherent; "" where that would not make it so."""
    if verdict.outcome is not Outcome.FAIL or not verdict.standing.unexpected:
        return ""
    measured = verdict.metric
    metric = (
        None if measured is None or measured.value is None else Metric(measured.name, measured.value, measured.unit)
    )
    finding = Finding(verdict.outcome, verdict.message, metric, verdict.bound, verdict.evidence)
    declared = " or ".join(would_follow(verdict.check, finding))
    return f"in a renderer that declares {declared}, see hapticeval explain {verdict.check}" if declared else ""


def _refused_words(results: ResultsDocument, *, verbose: bool) -> Iterator[str]:
    """Yield a line for each reason for which a renderer that was judged elsewhere has refused runs."""
    judged = {run.renderer for run in results.runs if not run.refusal}
    refusals = [(renderer, what, cases) for (renderer, what), cases in results.refusals.items() if renderer in judged]
    listed, limit = (None, None) if verbose else (REFUSALS_SHOWN, CASES_NAMED)
    for renderer, what, cases in refusals[:listed]:
        yield f"refused: {renderer} on {name_first(cases, limit)}: {what}"
    if more := refusals[len(refusals) if listed is None else listed :]:
        yield f"refused: {plural(len(more), 'reason')} more, -v shows them"


def _not_applicable_reasons(results: ResultsDocument) -> Iterator[str]:
    """Yield why checks were not applicable, once for each reason, less the refusals, which are shown as such."""
    refused = {run.key for run in results.runs if run.refusal}
    reasons = Counter(
        (verdict.check, verdict.message)
        for verdict in results.verdicts
        if verdict.outcome is Outcome.NOT_APPLICABLE and verdict.key not in refused
    )
    for (check, why), count in reasons.items():
        yield f"not applicable: {check}{f' ({count} times)' if count > 1 else ''}: {why}"


def _totals_words(results: ResultsDocument, *, verbose: bool) -> str:
    """Return how many verdicts ran, with which outcomes, and how long that took."""
    standings = [verdict.standing for verdict in results.verdicts]
    hidden = (
        ""
        if verbose or not any(standing.excused for standing in standings)
        else " (-v shows what is known or inherent)"
    )
    ran = f"{results.ran:,} of {plural(results.planned, 'planned verdict')} ran"
    if not results.complete:
        ran += f" (incomplete: {results.reason})"
    unexpected = f"{len(results.stopping) or 'none'} not as expected{results.strict_words}"
    counts = f"{ran}: {counts_in_words(standings)}; {unexpected}{hidden}"
    return f"{counts}\n{_time_words(results.timing)}"


def _too_slow_words(results: ResultsDocument) -> Iterator[str]:
    """Yield a line for each renderer whose steps take longer than the sampling time, in the case where it is worst."""
    slow_runs: dict[str, list[tuple[float, RunEntry]]] = {}
    for run in results.runs:
        if run.step_seconds is not None and run.step_seconds > run.scene.sampling_time:
            slow_runs.setdefault(run.renderer, []).append((run.step_seconds / run.scene.sampling_time, run))
    for renderer, slow in slow_runs.items():
        times, worst = max(slow, key=lambda pair: pair[0])
        others = f", and too slow in {plural(len(slow) - 1, 'other case')}" if len(slow) > 1 else ""
        yield (
            f"too slow: half of the steps of {renderer} take {duration(worst.step_seconds or 0.0)} or more, "
            f"{times:.3g} times the sampling time of {duration(worst.scene.sampling_time)}, "
            f"on {worst.suite}/{worst.case}{others}; timed beside the other work of this run"
        )


def _time_words(timing: Timing) -> str:
    """How long it took, beside the time that was simulated where that says anything."""
    if timing.times_real_time < 0.05:
        return f"took {timing.wall_seconds:.1f} s"
    return (
        f"simulated {timing.simulated_seconds:.1f} s in {timing.wall_seconds:.1f} s: "
        f"{timing.times_real_time:.1f} times real time"
    )
