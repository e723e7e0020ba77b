"""The report as one page that needs nothing else: no network, no script, readable in print."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from typing import Any

from hapticeval.phenomena.verdict import Outcome
from hapticeval.quantity import duration, length, quantity, size
from hapticeval.reports.bench_figure import TITLES, bench_plots
from hapticeval.reports.canvas import classed
from hapticeval.reports.effects_figure import EffectPlot, cost_svg
from hapticeval.reports.run_figure import marks_of
from hapticeval.reports.scene_words import ended_words, figures_cited, robot_words, scene_words
from hapticeval.reports.table import SYMBOLS, MatrixRow, SummaryRow, by_suite, matrix, ran
from hapticeval.runner.results import ResultsDocument, RunEntry, RunKey, SuiteEntry, VerdictEntry
from hapticeval.study.bench.document import BenchResults
from hapticeval.study.effects.document import EffectsDocument

BRIEF = 120
"""Characters of a model's parameters above which only its kind is named: an imported outline has thousands."""


@dataclass(frozen=True)
class Drawing:
    """What stands where a run's figure belongs: an SVG element, or the reason why there is none.

    `charts` is a second figure, that of the sphere's two charts, and `found` says what is seen in it.
    """

    svg: str = ""
    problem: str = ""
    charts: str = ""
    found: str = ""


@dataclass(frozen=True)
class Case:
    """One case with all its renderers; the `first` run says what the case is, `comparison` draws them all."""

    anchor: str
    runs: Sequence[RunEntry]
    comparison: Drawing | None
    unexpected: bool
    """Whether anything here calls for attention."""
    charted: bool
    """Whether a run here has the figure of the sphere's two charts."""

    @property
    def first(self) -> RunEntry:
        """The run that says what the case is."""
        return self.runs[0]

    @property
    def folded(self) -> bool:
        """Return whether the runs are shown only on demand: nothing is judged, and one figure shows them all."""
        return not self.first.judged and self.comparison is not None and bool(self.comparison.svg)


@dataclass(frozen=True)
class ShownSuite:
    """One suite; `columns` are the numbers and names of its renderers, `judged` and `shown` its rows of the matrix.

    `contents` pairs each case with its variants: the cases that are the same with a change, and the change.
    """

    anchor: str
    name: str
    title: str
    citation: str
    columns: Sequence[tuple[int, str]]
    cases: Sequence[Case]
    contents: Sequence[tuple[Case, Sequence[tuple[str, Case]]]]
    judged: Sequence[MatrixRow]
    shown: Sequence[MatrixRow]


def render_html(
    results: ResultsDocument,
    drawings: Mapping[RunKey, Drawing],
    *,
    bench: BenchResults | None = None,
    effects: Sequence[EffectPlot] = (),
    costs: EffectsDocument | None = None,
) -> str:
    """Return the page, with a section on `bench` where there is one, and on `effects` and their `costs`.

    Everything that comes from results is escaped; the drawings' SVG is put in as it is.
    """
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    from hapticeval.closed_forms import CLOSED_FORMS as FORMS
    from hapticeval.phenomena.registry import CHECKS

    files = resources.files("hapticeval.reports")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {
        "breakable": lambda name: name.replace("+", "+\u200b").replace("@", "\u200b@"),
        "brief": _brief,
        "bytes": size,
        "svg": Markup,
        "duration": duration,
        "in_unit": length,
        "millimetres": _millimetres,
        "place": lambda metres: f"({', '.join(map(_millimetres, metres))})",
        "quantity": quantity,
        "short": _short,
    }
    drawings, styles = _classed(drawings)
    cases = _cases(results, drawings)
    anchors = {id(verdict): f"v{index}" for index, verdict in enumerate(results.verdicts)}
    numbers = {run.key: index for index, run in enumerate(results.runs)}
    outcomes = Counter(verdict.outcome for verdict in results.verdicts)
    recorded = {run.renderer for run in results.runs if run.is_recorded}
    used = dict.fromkeys(verdict.check for verdict in results.verdicts)
    known = {name: CHECKS[name] for name in used if name in CHECKS}
    template = environment.from_string(files.joinpath("report.html.j2").read_text(encoding="utf-8"))
    return template.render(
        css=Markup(files.joinpath("report.css").read_text(encoding="utf-8")),
        styles=Markup(styles),
        results=results,
        command={name: getattr(results.command, name) for name in results.command.__struct_fields__},
        ran=ran(results),
        renderers=results.renderers,
        judged_renderers=[name for name in results.renderers if name not in recorded],
        recorded=bool(recorded),
        outcomes=[(name, outcomes[name]) for name in Outcome if outcomes[name]],
        unexpected=sum(not verdict.as_expected for verdict in results.verdicts),
        warnings=sum(verdict.warns for verdict in results.verdicts),
        broken=sum(run.error is not None for run in results.runs),
        ended=sum(run.ended is not None for run in results.runs),
        symbols=SYMBOLS,
        summary=_summary(results),
        suites=_suites(results, cases),
        cases=cases,
        closed_forms=_closed_forms(results, {name for name, check in known.items() if check.needs_closed_form}),
        forms=FORMS,
        anchor=lambda verdict: anchors[id(verdict)],
        number=lambda run: numbers[run.key],
        column=results.renderers.index,
        verdicts=lambda run: results.verdicts_of.get(run.key, []),
        marks=marks_of,
        drawing=lambda run: drawings.get(run.key, Drawing(problem="no recording was kept")),
        is_unexpected=lambda run: _unexpected(results, run),
        model_words=_model_words,
        scene_words=scene_words,
        robot_words=robot_words,
        ended_words=ended_words,
        figures_cited=figures_cited,
        checks=list(known.values()),
        bench=bench,
        bench_plots=[] if bench is None else bench_plots(bench),
        titles=TITLES,
        effects=effects,
        costs=costs,
        cost_svg="" if costs is None else cost_svg(costs),
    )


def _classed(drawings: Mapping[RunKey, Drawing]) -> tuple[dict[RunKey, Drawing], str]:
    """The drawings with their styles in one style sheet, without which half of the page would be styles."""
    keys = sorted(drawings)
    elements, rules = classed([text for key in keys for text in (drawings[key].svg, drawings[key].charts)])
    pairs = zip(elements[::2], elements[1::2], strict=True)
    return {
        key: replace(drawings[key], svg=svg, charts=charts) for key, (svg, charts) in zip(keys, pairs, strict=True)
    }, rules


def _unexpected(results: ResultsDocument, run: RunEntry) -> bool:
    return run.error is not None or not all(each.as_expected for each in results.verdicts_of.get(run.key, []))


def _cases(results: ResultsDocument, drawings: Mapping[RunKey, Drawing]) -> list[Case]:
    """Every case in the order in which they ran."""
    grouped: dict[tuple[str, str], list[RunEntry]] = {}
    for run in results.runs:
        grouped.setdefault((run.suite, run.case), []).append(run)
    return [
        Case(
            f"c{index}",
            runs,
            drawings.get((*key, "")),
            any(_unexpected(results, run) for run in runs),
            any(run.key in drawings and drawings[run.key].charts for run in runs),
        )
        for index, (key, runs) in enumerate(grouped.items())
    ]


def _suites(results: ResultsDocument, cases: Sequence[Case]) -> list[ShownSuite]:
    """Every suite in the order in which they ran, with only the renderers that ran there."""
    given = {suite.name: suite for suite in results.suites}
    rows = matrix(results)
    shown = []
    for index, name in enumerate(dict.fromkeys(each.suite for each in results.entries())):
        own = [case for case in cases if case.first.suite == name]
        ran_here = {each.renderer for each in results.entries() if each.suite == name}
        aside = {case.first.case for case in own if not case.first.judged}
        suite = given.get(name, SuiteEntry(name=name, title="", citation="", rows=[]))
        shown.append(
            ShownSuite(
                f"s{index}",
                name,
                suite.title or name,
                suite.citation,
                [(column, each) for column, each in enumerate(results.renderers) if each in ran_here],
                own,
                _contents(own),
                [row for row in rows if row.suite == name and row.case not in aside],
                [row for row in rows if row.suite == name and row.case in aside],
            )
        )
    return shown


def _contents(cases: Sequence[Case]) -> list[tuple[Case, list[tuple[str, Case]]]]:
    """A variant's title is that of its case, a comma and what is changed."""
    entries: list[tuple[Case, list[tuple[str, Case]]]] = []
    for case in cases:
        start = f"{entries[-1][0].first.title}, " if entries else None
        if start is not None and case.first.title.startswith(start):
            entries[-1][1].append((case.first.title.removeprefix(start), case))
        else:
            entries.append((case, []))
    return entries


def _summary(
    results: ResultsDocument,
) -> list[tuple[SuiteEntry | None, list[SummaryRow], list[tuple[int, str]]]]:
    """The summary in the groups of `by_suite`, each with the renderers that have an answer in it."""
    return [
        (suite, rows, [(k, name) for k, name in enumerate(results.renderers) if any(row.cells[k][0] for row in rows)])
        for suite, rows in by_suite(results)
    ]


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


def _brief(value: Any) -> str:
    """Evidence as JSON text, numbers to six digits."""
    if isinstance(value, str):
        return value
    rounded = json.loads(json.dumps(value), parse_float=lambda text: float(f"{float(text):.6g}"))
    return json.dumps(rounded, ensure_ascii=False)


def _model_words(run: RunEntry) -> str:
    """The model in a few words."""
    words = ", ".join(f"{name} {_brief(each)}" for name, each in run.model_parameters.items())
    kind = str(run.model["kind"])
    return f"{kind} ({words})" if 0 < len(words) < BRIEF else kind


def _millimetres(metres: float | None) -> str:
    """To a nanometre; what rounds to zero has no sign."""
    if metres is None:
        return "not finite"
    text = f"{1e3 * metres:.6f}"
    return text.removeprefix("-") if not float(text) else text.replace("-", "−")  # noqa: RUF001


def _short(metres: float | None) -> str:
    """A length for which millimetres may be far too much."""
    if metres is None or not 0.0 < metres < 1e-4:
        return quantity(metres, "m")
    unit, scale = next(
        ((unit, scale) for unit, scale in (("µm", 1e6), ("nm", 1e9)) if metres * scale >= 1.0), ("pm", 1e12)
    )
    return quantity(metres * scale, unit)
