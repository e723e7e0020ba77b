"""The pages of a report beside those of its cases: the first, what it links to, and what the checks ask.

`ReportView` is all that their templates read.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hapticeval.files import write_text
from hapticeval.phenomena.inherent import limits_of
from hapticeval.phenomena.pages import CheckPage, read_page
from hapticeval.phenomena.verdict import Outcome
from hapticeval.reports.bench_figure import cheapest_by_renderer, plotted_settings, small_multiples
from hapticeval.reports.canvas import Look, looks_of, svg_element
from hapticeval.reports.cards import Card, accuracy_card, cases_by_effect, effects_card, hard_card
from hapticeval.reports.case_page import asset
from hapticeval.reports.chart import charts_data
from hapticeval.reports.effects_figure import EffectPlot
from hapticeval.reports.grid import Grid, HardCase, Tile, case_grid, digit_families, hard_cases, worst_verdicts
from hapticeval.reports.table import Summary, summaries
from hapticeval.reports.templates import CHECK_PAGES, INDEX, PAGES_FOLDER, anchor, case_file, environment, explain_terms
from hapticeval.runner.diff import Edition, History
from hapticeval.runner.results import Breakdown, Replay, ResultsDocument, RunEntry, SuiteEntry, VerdictEntry
from hapticeval.runner.standing import Standing, count_standings
from hapticeval.study.bench.document import BenchResults, SettingEntry

if TYPE_CHECKING:
    from hapticeval.closed_forms import ClosedForm
    from hapticeval.phenomena.check import Check


MOST_FAILURES = 6
"""Failures that are shown with their figure."""

MOST_BREAKDOWNS = 6
"""Causes that stopped runs that the first page tells of."""


@dataclass(frozen=True)
class Drawing:
    """What stands where a figure belongs: the data that the page's script draws, or the reason why there is none."""

    data: str = ""
    problem: str = ""


class WorstVerdict(NamedTuple):
    """A verdict that the first page shows, with its figure."""

    verdict: VerdictEntry
    drawing: Drawing


class BenchModel(NamedTuple):
    """A model of a bench: of each renderer and representation a setting, which are marked, and the charts' data."""

    model: str
    settings: Mapping[str, SettingEntry]
    cheapest: set[str]
    charts: str


class SuiteSection(NamedTuple):
    """A suite with the grid of its cases by renderers, and how many of its verdicts have each standing."""

    entry: SuiteEntry
    grid: Grid
    counts: Sequence[tuple[Standing, int]]
    grave: bool


class ClosedFormTable(NamedTuple):
    """The verdicts of a case that compare a run with its closed form; `cited` is the number of the table in print."""

    run: RunEntry
    verdicts: Sequence[VerdictEntry]
    cited: str


class Replays(NamedTuple):
    """Replays of one recording; `page` is where their own report lies."""

    runs: Sequence[RunEntry]
    page: str | None

    @property
    def compared(self) -> Sequence[RunEntry]:
        """The runs for which a distance from the recorded one is told."""
        return [run for run in self.runs if run.replay is not None and run.replay.difference is not None]


class Counterexample(NamedTuple):
    """What a search has found: the `renderer` that it breaks, how in a line, its suite file, and its picture if any."""

    renderer: str
    line: str
    suite: Path
    picture: Path | None

    def svg(self, prefix: str) -> str:
        """Return the picture as an element whose ids begin with `prefix`; empty where there is none."""
        if self.picture is None:
            return ""
        return svg_element(self.picture.read_text(encoding="utf-8"), prefix=prefix, title=self.line)


@dataclass(frozen=True)
class Single:
    """What the page holds when it stands alone: styles, scripts, and what the pages of the cases show."""

    styles: Sequence[str]
    scripts: Sequence[str]
    bodies: Sequence[str]


@dataclass(frozen=True)
class ReportView:
    """What the templates show of results, and of what lies beside them; of what is not there they have no page.

    - `drawings`: the figures of the verdicts that `worst_verdicts` names, by suite, case, renderer and check
    - `effects`: panels of effects
    - `counterexamples`: of a search
    - `replayed`: a recording that was replayed into replay/
    - `has_thesis`: what the thesis shows lies in thesis/
    - `single`: with it all is on one page, which links to itself
    """

    results: ResultsDocument
    drawings: Mapping[tuple[str, str, str, str], Drawing] = field(default_factory=dict)
    bench: BenchResults | None = None
    effects: Sequence[EffectPlot] = ()
    counterexamples: Sequence[Counterexample] = ()
    replayed: ResultsDocument | None = None
    has_thesis: bool = False
    single: Single | None = None

    # What the run amounts to.

    @cached_property
    def counts(self) -> Sequence[tuple[Standing, int]]:
        """How many verdicts have each standing."""
        return count_standings(verdict.standing for verdict in self.results.verdicts)

    @property
    def unexpected_count(self) -> int:
        """How many verdicts are not as expected; those that one cause took away count as one."""
        return len(self.results.stopping_by_itself) + len(self.results.breakdowns)

    @property
    def unexpected_standings(self) -> Sequence[Standing]:
        """The standings of what is not as expected in this run."""
        strict = self.results.command.strict
        return [standing for standing in Standing if standing.unexpected or (strict and standing.stops_strict)]

    @property
    def failing_standings(self) -> Sequence[Standing]:
        """The standings of what does not pass, expected or not."""
        return [standing for standing in Standing if standing.stops_strict or standing.excused]

    @cached_property
    def recorded_renderers(self) -> set[str]:
        """The names under which recorded runs are judged, which are not renderers."""
        return {run.renderer for run in self.results.runs if run.is_recorded}

    @property
    def judged_renderers(self) -> Sequence[str]:
        """The renderers that were judged."""
        return [name for name in self.results.renderers if name not in self.recorded_renderers]

    @cached_property
    def looks(self) -> Mapping[str, Look]:
        """How each renderer looks on all pages; those of the bench alone come after the others."""
        benched = [] if self.bench is None else [setting.renderer for setting in self.bench.settings]
        judged = [verdict.renderer for verdict in self.results.verdicts]
        return looks_of([*self.results.renderers, *judged, *benched])

    @cached_property
    def titles(self) -> Mapping[tuple[str, str], str]:
        """The title of each case by suite and name."""
        return {(run.suite, run.case): run.title for run in self.results.runs}

    @cached_property
    def cases_aside(self) -> set[tuple[str, str]]:
        """The cases that are shown and not judged."""
        return {(run.suite, run.case) for run in self.results.runs if not run.judged}

    @property
    def command(self) -> str:
        """The command that gives these results, as it would be typed."""
        command = self.results.command
        words = ["hapticeval run", *command.suites, *(f"-r {name}" for name in command.renderers)]
        words += [f"-k {expression}" for expression in command.select]
        return " ".join(
            [*words, *["--strict"] * command.strict, *([f"--shard {command.shard}"] if command.shard else [])]
        )

    # The first page.

    @property
    def breakdowns(self) -> Sequence[Breakdown]:
        """What stopped runs, by cause."""
        return self.results.breakdowns[:MOST_BREAKDOWNS]

    @cached_property
    def worst(self) -> Sequence[WorstVerdict]:
        """What is shown with a figure: failures, warnings, or else what is known to fail."""
        return [
            WorstVerdict(verdict, self.drawings.get((*verdict.key, verdict.check), Drawing()))
            for verdict in worst_verdicts(self.results, MOST_FAILURES)
        ]

    @property
    def worst_words(self) -> str:
        """The title of what is shown as the worst."""
        return worst_words({worst.verdict.standing for worst in self.worst})

    @property
    def unlisted_count(self) -> int:
        """How many verdicts are not as expected, or warn, beside the worst and those that broken runs took away."""
        candidates = [verdict for verdict in self.results.verdicts if not self.results.lost(verdict)]
        return max(0, sum(verdict.standing.stops_strict for verdict in candidates) - len(self.worst))

    @cached_property
    def suites(self) -> Sequence[SuiteSection]:
        """Every suite in the order in which they ran."""
        entry_by_name = {suite.name: suite for suite in self.results.suites}
        sections = []
        for name in dict.fromkeys(run.suite for run in self.results.runs):
            entry = entry_by_name.get(name, SuiteEntry(name=name, title=name, citation="", rows=[]))
            counts = Counter(verdict.standing for verdict in self.results.verdicts if verdict.suite == name)
            ordered = [(standing, counts[standing]) for standing in Standing if counts[standing]]
            is_grave = any(verdict.suite == name for verdict in self.results.stopping)
            sections.append(SuiteSection(entry, case_grid(self.results, name), ordered, is_grave))
        return sections

    # What it links to.

    @cached_property
    def pages(self) -> Sequence[SubPage]:
        """The pages that have something to show."""
        return [page for page in SUB_PAGES if page.is_needed(self)]

    @cached_property
    def summaries(self) -> Sequence[Summary]:
        """The tables that the suites define."""
        return summaries(self.results)

    @cached_property
    def first_summary(self) -> Summary | None:
        """The table that the first page begins with: the one in print, or else the first."""
        return max(self.summaries, key=lambda summary: bool(summary.number), default=None)

    def answer_link(self, summary: Summary, row: str, renderer: str) -> str | None:
        """Return the link to the worst of the verdicts that an answer of a table is made of; None without one."""
        cells = {} if summary.suite is None else summary.suite.cells
        verdicts = [
            verdict
            for verdict in self.results.verdicts
            if verdict.renderer == renderer
            and summary.suite is not None
            and verdict.suite == summary.suite.name
            and f"{verdict.case}/{verdict.check}" in cells.get(row, ())
        ]
        return self.entry_link(Tile(verdicts).worst) if verdicts else None

    @cached_property
    def cards(self) -> Sequence[Card]:
        """What the first page tells of accuracy in time, hard cases and effects."""
        cards = (
            accuracy_card(self.bench) if self.bench is not None else None,
            hard_card(digit_families(self.results)),
            effects_card(self.cases_by_effect, self.bench),
        )
        names = {page.name for page in self.pages}
        return [card for card in cards if card is not None and card.page in names]

    @cached_property
    def cases_by_effect(self) -> Mapping[str, Sequence[tuple[str, str]]]:
        """The cases that call for each kind of effect, and for none."""
        return cases_by_effect(self.results)

    @cached_property
    def hard_cases(self) -> tuple[Sequence[str], Sequence[HardCase]]:
        """The renderers, and the digits that they keep in each hard case."""
        return hard_cases(self.results)

    @cached_property
    def checks(self) -> Mapping[str, Check]:
        """The checks that gave verdicts by id, in the results' order; without those not installed."""
        from hapticeval.phenomena.registry import CHECKS

        judged = dict.fromkeys(verdict.check for verdict in self.results.verdicts)
        return {name: CHECKS[name] for name in judged if name in CHECKS}

    @cached_property
    def check_pages(self) -> Sequence[tuple[Check, CheckPage]]:
        """Each of the checks with what is told of it."""
        return [(check, read_page(check)) for check in self.checks.values()]

    @cached_property
    def replays(self) -> Replays:
        """The replays among the results, or else those that lie in the folder replay/."""
        runs = [run for run in self.results.runs if run.replay]
        if runs or self.replayed is None:
            return Replays(runs, None)
        page = self.beside("replay/report/index.html")
        return Replays([run for run in self.replayed.runs if run.replay], page)

    @property
    def replay(self) -> Replay | None:
        """What was replayed."""
        return self.replays.runs[0].replay if self.replays.runs else None

    @cached_property
    def bench_models(self) -> Sequence[BenchModel]:
        """What the bench measured on each model, in the looks that renderers have on all pages."""
        if self.bench is None:
            return []
        return [
            BenchModel(
                model,
                cheapest_by_renderer(settings, group=str),
                {setting.label for setting in cheapest_by_renderer(settings).values()},
                charts_data(small_multiples(settings, self.looks)),
            )
            for model, settings in self.bench.by_model().items()
            if plotted_settings(settings)
        ]

    @cached_property
    def closed_forms(self) -> Sequence[ClosedFormTable]:
        """One table per case with verdicts of checks that need a closed form; those that cite a table come first."""
        checks = {name for name, check in self.checks.items() if check.needs_closed_form}
        runs = {(run.suite, run.case): run for run in self.results.runs}
        grouped: dict[tuple[str, str], list[VerdictEntry]] = {}
        for verdict in self.results.verdicts:
            if verdict.check in checks and verdict.outcome is not Outcome.NOT_APPLICABLE:
                grouped.setdefault((verdict.suite, verdict.case), []).append(verdict)
        tables = []
        for key, verdicts in grouped.items():
            # For instance "Table 6.3": the number in print.
            cited = re.search(r"Table (\d+\.\d+)", runs[key].citation or "")
            tables.append(ClosedFormTable(runs[key], verdicts, cited[1] if cited else ""))
        # False sorts first: tables with a number before those without.
        return sorted(tables, key=lambda table: (not table.cited, table.cited))

    @property
    def laws(self) -> Mapping[str, ClosedForm]:
        """What loops do in continuous time, by the number of the equation."""
        from hapticeval.closed_forms import CLOSED_FORMS

        return CLOSED_FORMS

    # Where things are.

    def beside(self, path: str) -> str:
        """Return the link to what lies in the result folder, beside the report."""
        return path if self.single else f"../{path}"

    def page_link(self, name: str) -> str:
        """Return the link to one of `SUB_PAGES`."""
        return f"#{name}" if self.single else f"{name}.html"

    def check_link(self, check: str) -> str | None:
        """Return the link to what is told of a check; None where its page is not at hand."""
        return None if self.single or check not in self.checks else f"{CHECK_PAGES}#{check}"

    def case_link(self, suite: str, case: str) -> str:
        """Return the link to a case."""
        return f"#{anchor(suite, case)}" if self.single else case_file(suite, case)

    def run_place(self, suite: str, case: str, renderer: str) -> str:
        """Return the link to a verdict of a run, but for the check's id at its end."""
        # On the one page an anchor names suite and case too.
        if self.single:
            return f"#{anchor(suite, case, renderer, '')}"
        return f"{case_file(suite, case)}#{anchor(renderer, '')}"

    def entry_link(self, entry: VerdictEntry | RunEntry) -> str:
        """Return the link to a verdict, or to the case of a run."""
        if isinstance(entry, RunEntry):
            return self.case_link(entry.suite, entry.case)
        return self.run_place(*entry.key) + anchor(entry.check)


class SubPage(NamedTuple):
    """A page one click from the first: its name, also of its template and file, and whether it has anything to show."""

    name: str
    title: str
    is_needed: Callable[[ReportView], bool]


SUB_PAGES: Sequence[SubPage] = (
    SubPage("costs", "What accuracy costs in time", lambda view: view.bench is not None),
    SubPage("effects", "Effects", lambda view: bool(view.effects)),
    SubPage("replay", "Replay", lambda view: view.replay is not None),
    SubPage("counterexamples", "Counterexamples", lambda view: bool(view.counterexamples)),
    SubPage("hard-cases", "Hard cases", lambda view: bool(view.hard_cases[1])),
    SubPage("closed-forms", "Closed forms", lambda view: bool(view.closed_forms)),
    SubPage("reading", "How to read this", lambda _: True),
)


def render_pages(view: ReportView) -> dict[str, str]:
    """Return the pages of a report but those of cases, by file; of a single page that one.

    Everything that comes from results is escaped; the figures' SVG is put in as it is.
    """
    jinja = environment()
    pages = {INDEX: jinja.get_template("index.html.j2").render(view=view)}
    if not view.single:
        template = jinja.get_template("page.html.j2")
        pages |= {f"{page.name}.html": template.render(view=view, page=page) for page in view.pages}
        checks = [(check, html_of(page.text)) for check, page in view.check_pages]
        pages[CHECK_PAGES] = jinja.get_template("check_pages.html.j2").render(pages=checks, limits_of=limits_of)
    return {name: explain_terms(text) for name, text in pages.items()}


def worst_words(standings: set[Standing]) -> str:
    """Return the title of what is shown of the verdicts: all of them known failures, or warnings at worst, or more."""
    if any(standing.unexpected for standing in standings):
        return "Not as expected"
    return "Warnings" if any(standing.stops_strict for standing in standings) else "Known failures"


TITLE = re.compile(r"\A#[^\n]*\n")
"""The title of a check's page, which the report sets itself."""

HEADING = re.compile(r"^## ", re.MULTILINE)
"""Headings of a check's page, which stand below the check's own here."""

CHECK_LINK = re.compile(r"\]\(([\w-]+)\.md\)")
OTHER_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\.md[^)]*\)")
"""Links to the page of a check, which is a place on this one, and to other pages of the documentation."""


COMMENT = re.compile(r" *<!--.*?-->")
"""What an item of a check's page says to `CheckPage.item_of` alone."""


def html_of(page: str) -> str:
    """Return a check's page in Markdown as HTML without its title and its comments; other HTML in it is escaped."""
    from markdown_it import MarkdownIt

    # Title off, links to checks into anchors of this page, other links to their text, headings one level down.
    body = HEADING.sub("### ", OTHER_LINK.sub(r"\1", CHECK_LINK.sub(r"](#\1)", COMMENT.sub("", TITLE.sub("", page)))))
    return str(MarkdownIt("commonmark", {"html": False}).render(body))


def write_history(path: Path, histories: Sequence[History]) -> Path:
    """Write the page, which needs no other file, and return its path. Raises `HapticevalError` where that fails."""
    editions = {id(edition): edition for history in histories for edition in history.editions}.values()
    standings = {
        stand.gravest.standing for history in histories for check in history.checks for stand in check.stands if stand
    }
    text = environment().get_template("history.html.j2").render(
        histories=histories,
        style=asset("report.css").decode(),
        links={edition.folder: link for edition in editions if (link := _report_of(edition, path))},
        standings=[standing for standing in Standing if standing in standings],
    )  # fmt: skip
    write_text(path, text)
    return path


def _report_of(edition: Edition, page: Path) -> str:
    """Return the link from the page to the report of a run; "" where it has none."""
    report = edition.folder / PAGES_FOLDER / INDEX
    return Path(os.path.relpath(report, page.parent)).as_posix() if report.exists() else ""
