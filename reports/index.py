"""The first screen of a report: the verdict of the run, renderers by phenomena, the worst failures, every case."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hapticeval.phenomena.pages import read_page
from hapticeval.phenomena.verdict import Outcome
from hapticeval.reports.bench_figure import TITLES, bench_plots
from hapticeval.reports.canvas import svg_element
from hapticeval.reports.check_pages import link_to
from hapticeval.reports.effects_figure import EffectPlot, cost_svg
from hapticeval.reports.grid import (
    Grid,
    case_grid,
    hard_cases,
    headline,
    is_sound,
    phenomenon_grid,
    worst_verdicts,
)
from hapticeval.reports.places import anchor, case_file
from hapticeval.reports.table import provenance, ran_words, renderers_by_commit, summaries
from hapticeval.reports.templates import environment
from hapticeval.runner.results import ResultsDocument, RunEntry, RunKey, SuiteEntry, VerdictEntry
from hapticeval.runner.standing import Standing, count_standings
from hapticeval.study.bench.document import BenchResults
from hapticeval.study.effects.document import EffectsDocument

if TYPE_CHECKING:
    from hapticeval.phenomena.check import Check

MOST_FAILURES = 6
"""Failures that are shown with their figure."""


@dataclass(frozen=True)
class Drawing:
    """What stands where a figure belongs: an SVG element, or the reason why there is none."""

    svg: str = ""
    problem: str = ""


@dataclass(frozen=True)
class SuiteSection:
    """A suite with the grid of its cases by renderers."""

    name: str
    title: str
    citation: str
    grid: Grid
    counted: Sequence[tuple[Standing, int]]

    @property
    def grave(self) -> bool:
        """Return whether anything here is not as expected."""
        return any(standing.unexpected for standing, _ in self.counted)


@dataclass(frozen=True)
class Single:
    """What the page holds when it stands alone: styles, scripts, and what the pages of the cases show."""

    styles: Sequence[str]
    scripts: Sequence[str]
    bodies: Sequence[str]


class Counterexample(NamedTuple):
    """What a search has found: the `renderer` that it breaks, how in a line, its suite file, and its picture if any."""

    renderer: str
    line: str
    suite: Path
    picture: Path | None


def judged_checks(results: ResultsDocument) -> dict[str, Check]:
    """Return the checks that gave verdicts by id, in the results' order; without those not installed."""
    from hapticeval.phenomena.registry import CHECKS

    return {name: CHECKS[name] for name in dict.fromkeys(v.check for v in results.verdicts) if name in CHECKS}


def render_index(
    results: ResultsDocument,
    drawings: Mapping[RunKey, Drawing] | None = None,
    *,
    bench: BenchResults | None = None,
    effects: Sequence[EffectPlot] = (),
    costs: EffectsDocument | None = None,
    counterexamples: Sequence[Counterexample] = (),
    replayed: ResultsDocument | None = None,
    single: Single | None = None,
) -> str:
    """Return the page; `drawings` are the figures of the runs that `worst_verdicts` names.

    What is given has a section: `bench`, `effects` and their `costs`, `counterexamples` of a search, and a recording
    that was `replayed` into replay/.

    Without `single` the page needs the style beside it, and links to the pages of the cases; with it, to itself.
    Everything that comes from results is escaped; the figures' SVG is put in as it is.
    """
    from hapticeval.closed_forms import CLOSED_FORMS

    # What the first page shows with a figure: failures, warnings, or else what is known to fail.
    worst = worst_verdicts(results, MOST_FAILURES)
    # Reversed, so that the first of several failures of a run wins: it has the figure.
    first = {verdict.key: verdict for verdict in reversed(worst)}
    failures = [
        (verdict, (drawings or {}).get(verdict.key, Drawing()) if first[verdict.key] is verdict else Drawing())
        for verdict in worst
    ]
    plots = [] if bench is None else bench_plots(bench)
    pictures = [
        _counterexample_svg(counterexample, f"x{number}") for number, counterexample in enumerate(counterexamples)
    ]
    costs_svg = "" if costs is None else cost_svg(costs)
    # Checks of a package that is not installed here have no page to link to.
    known = judged_checks(results)
    recorded = {run.renderer for run in results.runs if run.is_recorded}
    names, hard = hard_cases(results)
    replays = [run for run in results.runs if run.replay]
    # Shown from the folder replay/, where the results themselves are no replay.
    replayed_beside = not replays and replayed is not None
    if replayed is not None and replayed_beside:
        replays = [run for run in replayed.runs if run.replay]

    def case_link(suite: str, case: str) -> str:
        return f"#{anchor(suite, case)}" if single else case_file(suite, case)

    def entry_link(entry: VerdictEntry | RunEntry) -> str:
        if isinstance(entry, RunEntry):
            return case_link(entry.suite, entry.case)
        # On the one page an anchor names suite and case too.
        if single:
            return f"#{anchor(*entry.key, entry.check)}"
        return f"{case_file(entry.suite, entry.case)}#{anchor(entry.renderer, entry.check)}"

    return environment().get_template("index.html.j2").render(
        single=single,
        results=results,
        headline=headline(results),
        sound=is_sound(results),
        provenance=provenance(results),
        ran=ran_words(results),
        counted=count_standings(verdict.standing for verdict in results.verdicts),
        judged_renderers=[name for name in results.renderers if name not in recorded],
        recorded=bool(recorded),
        case_count=len({(run.suite, run.case) for run in results.runs}),
        replays=replays,
        replay_page=("replay" if single else "../replay") + "/report/index.html" if replayed_beside else None,
        replayed=[run for run in replays if run.replay is not None and run.replay.difference is not None],
        replay=replays[0].replay if replays else None,
        commits=renderers_by_commit(results),
        broken=sum(run.error is not None for run in results.runs),
        breakdowns=results.breakdowns,
        ended=sum(run.ended is not None for run in results.runs),
        grid=phenomenon_grid(results),
        worst_words=_worst_words({verdict.standing for verdict in worst}),
        failures=failures,
        more=_unlisted_count(results, worst),
        hard_names=names,
        hard=hard,
        summaries=summaries(results),
        closed_forms=_closed_form_tables(results, {name for name, check in known.items() if check.needs_closed_form}),
        forms=CLOSED_FORMS,
        suites=_suite_sections(results),
        grave_states=[standing for standing in Standing if standing.unexpected],
        failing_states=[standing for standing in Standing if standing.stops_strict or standing.excused],
        titles={(run.suite, run.case): run.title for run in results.runs},
        aside={(run.suite, run.case) for run in results.runs if not run.judged},
        case_link=case_link,
        entry_link=entry_link,
        checks=[(check, read_page(check)) for check in known.values()],
        about=None if single else link_to,
        command={name: getattr(results.command, name) for name in results.command.__struct_fields__},
        bench=bench,
        bench_plots=plots,
        bench_titles=TITLES,
        effects=effects,
        counterexamples=list(zip(counterexamples, pictures, strict=True)),
        costs=costs,
        cost_svg=costs_svg,
    )  # fmt: skip


def _worst_words(standings: set[Standing]) -> str:
    """Return the title of what is shown of the verdicts: all of them known failures, or warnings at worst, or more."""
    if any(standing.unexpected for standing in standings):
        return "Not as expected"
    return "Warnings" if any(standing.stops_strict for standing in standings) else "Known failures"


def _unlisted_count(results: ResultsDocument, listed: Sequence[VerdictEntry]) -> int:
    """How many verdicts are not as expected, or warn, beside those `listed` and those that broken runs took away."""
    candidates = [verdict for verdict in results.verdicts if not results.lost(verdict)]
    return max(0, sum(verdict.standing.stops_strict for verdict in candidates) - len(listed))


def _counterexample_svg(counterexample: Counterexample, prefix: str) -> str:
    """Return the picture of a counterexample as an element; empty where there is none."""
    if counterexample.picture is None:
        return ""
    return svg_element(counterexample.picture.read_text(encoding="utf-8"), prefix=prefix, title=counterexample.line)


def _suite_sections(results: ResultsDocument) -> list[SuiteSection]:
    """Every suite in the order in which they ran."""
    suite_by_name = {suite.name: suite for suite in results.suites}
    sections = []
    for name in dict.fromkeys(run.suite for run in results.runs):
        suite = suite_by_name.get(name, SuiteEntry(name=name, title="", citation="", rows=[]))
        # States of the suite's verdicts, written beside its title.
        counts = Counter(verdict.standing for verdict in results.verdicts if verdict.suite == name)
        grid = case_grid(results, name)
        sections.append(
            SuiteSection(
                name,
                suite.title or name,
                suite.citation,
                grid,
                [(standing, counts[standing]) for standing in Standing if counts[standing]],
            )
        )
    return sections


def _closed_form_tables(results: ResultsDocument, checks: set[str]) -> list[tuple[RunEntry, list[VerdictEntry], str]]:
    """One table per case with verdicts of these checks: a run, the verdicts, and the number of the table in print.

    Those that cite a table come first, by its number.
    """
    runs = {(run.suite, run.case): run for run in results.runs}
    grouped: dict[tuple[str, str], list[VerdictEntry]] = {}
    for verdict in results.verdicts:
        if verdict.check in checks and verdict.outcome is not Outcome.NOT_APPLICABLE:
            grouped.setdefault((verdict.suite, verdict.case), []).append(verdict)
    tables = []
    for key, verdicts in grouped.items():
        # For instance "Table 7.1": the number in print.
        cited = re.search(r"Table (\d+\.\d+)", runs[key].citation or "")
        tables.append((runs[key], verdicts, cited[1] if cited else ""))
    # False sorts first: tables with a number before those without.
    return sorted(tables, key=lambda table: (not table[2], table[2]))
