"""The first screen of a report: the verdict of the run, renderers by phenomena, the worst failures, every case."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hapticeval.phenomena.pages import read_page
from hapticeval.phenomena.verdict import Outcome
from hapticeval.reports.bench_figure import TITLES, bench_plots
from hapticeval.reports.canvas import page_element
from hapticeval.reports.check_pages import link_to
from hapticeval.reports.effects_figure import EffectPlot, cost_svg
from hapticeval.reports.grid import (
    Grid,
    State,
    cases,
    counted,
    hard_cases,
    headline,
    phenomena,
    sound,
    state,
    worst,
)
from hapticeval.reports.places import anchor, case_file
from hapticeval.reports.svg import classed, sheet
from hapticeval.reports.table import by_commit, provenance, ran, summaries
from hapticeval.reports.templates import environment
from hapticeval.runner.results import ResultsDocument, RunEntry, RunKey, SuiteEntry, VerdictEntry
from hapticeval.study.bench.document import BenchResults
from hapticeval.study.effects.document import EffectsDocument

if TYPE_CHECKING:
    from hapticeval.phenomena.check import Check

MOST = 6
"""Failures that are shown with their figure."""


@dataclass(frozen=True)
class Drawing:
    """What stands where a figure belongs: an SVG element, or the reason why there is none."""

    svg: str = ""
    problem: str = ""


@dataclass(frozen=True)
class ShownSuite:
    """A suite with the grid of its cases by renderers."""

    name: str
    title: str
    citation: str
    grid: Grid
    counted: Sequence[tuple[State, int]]

    @property
    def grave(self) -> bool:
        """Return whether anything here is not as expected."""
        return any(each.grave for each, _ in self.counted)


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
    """Return the page; `drawings` are the figures of the runs that `worst` names.

    It has a section on `bench` where there is one, on `effects` and their `costs`, on the `counterexamples` of a
    search, and on a recording that was `replayed` into replay/. Without `single` it needs the style beside it, and
    links to the pages of the cases; with it, to places in itself. Everything that comes from results is escaped; the
    figures' SVG is put in as it is.
    """
    from hapticeval.closed_forms import CLOSED_FORMS

    given = worst(results, MOST)
    first = {verdict.key: verdict for verdict in reversed(given)}  # of several failures of a run, one has the figure
    shown = [
        (verdict, (drawings or {}).get(verdict.key, Drawing()) if first[verdict.key] is verdict else Drawing())
        for verdict in given
    ]
    plots = [] if bench is None else bench_plots(bench)
    pictures = [_picture(each, f"x{number}") for number, each in enumerate(counterexamples)]
    costs_svg = "" if costs is None else cost_svg(costs)
    drawn = [*(each.svg for _, each in shown), *(svg for _, svg in plots), *(each.svg for each in effects)]
    elements, styles = classed([*drawn, *pictures, costs_svg])
    taken = iter(elements)
    known = judged_checks(results)
    recorded = {run.renderer for run in results.runs if run.is_recorded}
    names, hard = hard_cases(results)
    replays = [run for run in results.runs if run.replay]
    beside = not replays and replayed is not None
    if replayed is not None and beside:
        replays = [run for run in replayed.runs if run.replay]

    def page(suite: str, case: str) -> str:
        return f"#{anchor(suite, case)}" if single else case_file(suite, case)

    def to(entry: VerdictEntry | RunEntry) -> str:
        if isinstance(entry, RunEntry):
            return page(entry.suite, entry.case)
        if single:
            return f"#{anchor(*entry.key, entry.check)}"
        return f"{case_file(entry.suite, entry.case)}#{anchor(entry.renderer, entry.check)}"

    return environment().get_template("index.html.j2").render(
        single=single,
        styles=sheet(styles),
        results=results,
        headline=headline(results),
        sound=sound(results),
        provenance=provenance(results),
        ran=ran(results),
        counted=counted(results),
        judged_renderers=[name for name in results.renderers if name not in recorded],
        recorded=bool(recorded),
        case_count=len({(run.suite, run.case) for run in results.runs}),
        replays=replays,
        replay_page=("replay" if single else "../replay") + "/report/index.html" if beside else None,
        replayed=[run for run in replays if run.replay is not None and run.replay.difference is not None],
        replay=replays[0].replay if replays else None,
        commits=by_commit(results),
        broken=sum(run.error is not None for run in results.runs),
        breakdowns=results.breakdowns,
        ended=sum(run.ended is not None for run in results.runs),
        grid=phenomena(results),
        worst_words=_worst_words({state(each) for each in given}),
        failures=[(verdict, Drawing(next(taken), each.problem)) for verdict, each in shown],
        more=_more(results, given),
        hard_names=names,
        hard=hard,
        summaries=summaries(results),
        closed_forms=_closed_forms(results, {name for name, check in known.items() if check.needs_closed_form}),
        forms=CLOSED_FORMS,
        suites=_suites(results),
        grave_states=[each for each in State if each.grave],
        failing_states=[State.KNOWN, State.WARNING, *(each for each in State if each.grave)],
        titles={(run.suite, run.case): run.title for run in results.runs},
        aside={(run.suite, run.case) for run in results.runs if not run.judged},
        page=page,
        to=to,
        checks=[(check, read_page(check)) for check in known.values()],
        about=None if single else link_to,
        command={name: getattr(results.command, name) for name in results.command.__struct_fields__},
        bench=bench,
        bench_plots=[(title, next(taken)) for title, _ in plots],
        bench_titles=TITLES,
        effects=[replace(each, svg=next(taken)) for each in effects],
        counterexamples=[(each, next(taken)) for each in counterexamples],
        costs=costs,
        cost_svg=next(taken),
    )  # fmt: skip


def _worst_words(states: set[State]) -> str:
    """Return the title of what is shown of the verdicts: all of them known failures, or warnings at worst, or more."""
    if any(each.grave for each in states):
        return "Not as expected"
    return "Warnings" if State.WARNING in states else "Known failures"


def _more(results: ResultsDocument, shown: Sequence[VerdictEntry]) -> int:
    """How many verdicts are not as expected, or warn, beside those `shown` and those that broken runs took away."""
    given = [each for each in results.verdicts if not results.lost(each)]
    return max(0, sum(state(each).grave or state(each) is State.WARNING for each in given) - len(shown))


def _picture(found: Counterexample, prefix: str) -> str:
    """Return the picture of a counterexample as an element; empty where there is none."""
    if found.picture is None:
        return ""
    return page_element(found.picture.read_text(encoding="utf-8"), prefix=prefix, title=found.line)


def _suites(results: ResultsDocument) -> list[ShownSuite]:
    """Every suite in the order in which they ran."""
    given = {suite.name: suite for suite in results.suites}
    shown = []
    for name in dict.fromkeys(run.suite for run in results.runs):
        suite = given.get(name, SuiteEntry(name=name, title="", citation="", rows=[]))
        counts = Counter(state(each) for each in results.verdicts if each.suite == name)
        grid = cases(results, name)
        shown.append(
            ShownSuite(
                name,
                suite.title or name,
                suite.citation,
                grid,
                [(each, counts[each]) for each in State if counts[each]],
            )
        )
    return shown


def _closed_forms(results: ResultsDocument, checks: set[str]) -> list[tuple[RunEntry, list[VerdictEntry], str]]:
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
        cited = re.search(r"Table (\d+\.\d+)", runs[key].citation or "")
        tables.append((runs[key], verdicts, cited[1] if cited else ""))
    return sorted(tables, key=lambda table: (not table[2], table[2]))
