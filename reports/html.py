"""The report as one page that needs nothing else: no network, no script, readable in print."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from typing import Any

from hapticeval.reports.bench_section import COLUMNS, bench_section
from hapticeval.reports.closed_form_section import closed_form_tables
from hapticeval.reports.groups import shown_suites, shown_summary
from hapticeval.reports.replay_section import COLUMNS as REPLAY_COLUMNS
from hapticeval.reports.shown import Drawing, RunKey, shown_cases
from hapticeval.reports.svg import classed
from hapticeval.reports.table import SYMBOLS, ran, renderers
from hapticeval.runner.results import ResultsDocument
from hapticeval.study.bench.document import BenchResults


def render_html(
    results: ResultsDocument, drawings: Mapping[RunKey, Drawing], *, bench: BenchResults | None = None
) -> str:
    """The page, with a section on `bench` where there is one.

    Everything that comes from results is escaped; the drawings' SVG is put in as it is.
    """
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup
    from msgspec import structs

    names = renderers(results)
    anchors = {id(verdict): f"v{index}" for index, verdict in enumerate(results.verdicts)}
    files = resources.files("hapticeval.reports")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["svg"] = Markup
    environment.filters["breakable"] = _breakable
    template = environment.from_string(files.joinpath("report.html.j2").read_text(encoding="utf-8"))
    drawings, styles = _classed(drawings)
    cases = shown_cases(results, names, drawings, anchors)
    recorded = {run.renderer for run in results.runs if run.is_recorded}
    outcomes = Counter(verdict.outcome for verdict in results.verdicts)
    unexpected = sum(not verdict.as_expected for verdict in results.verdicts)
    return template.render(
        css=Markup(files.joinpath("report.css").read_text(encoding="utf-8")),
        styles=Markup(styles),
        results=results,
        command=structs.asdict(results.command),
        ran=ran(results),
        renderers=names,
        outcomes=[(name, outcomes[name]) for name in SYMBOLS if outcomes[name]],
        unexpected=unexpected,
        warnings=sum(each.warns for each in results.verdicts),
        strict=results.command.strict,
        undecided=outcomes["inconclusive"],
        refused=results.all_refused,
        judged_renderers=[name for name in names if name not in recorded],
        recorded=bool(recorded),
        broken=sum(bool(run.error) for run in results.runs),
        symbols=SYMBOLS,
        summary=shown_summary(results),
        suites=shown_suites(results, cases),
        closed_forms=closed_form_tables(results.runs, results.verdicts, names, anchors),
        anchors=lambda cell: anchors[id(cell.verdict)],
        cases=cases,
        ended=sum(bool(run.ended) for run in results.runs),
        checks=_checks(results),
        bench=None if bench is None else bench_section(bench),
        bench_columns=COLUMNS,
        replay_columns=REPLAY_COLUMNS,
        versions={name: each for name, each in results.environment.versions.items() if each},
    )


def _breakable(name: str) -> str:
    """A name with leave to break where its parts meet."""
    return name.replace("+", "+\u200b").replace("@", "\u200b@")


def _classed(drawings: Mapping[RunKey, Drawing]) -> tuple[dict[RunKey, Drawing], str]:
    """The drawings with their styles in one style sheet, without which half of the page would be styles."""
    keys = sorted(drawings)
    elements, rules = classed([text for key in keys for text in (drawings[key].svg, drawings[key].charts)])
    pairs = zip(elements[::2], elements[1::2], strict=True)
    return {
        key: replace(drawings[key], svg=svg, charts=charts) for key, (svg, charts) in zip(keys, pairs, strict=True)
    }, rules


def _checks(results: ResultsDocument) -> list[Any]:
    """What the checks of these results say of themselves, as far as this version still knows them."""
    from hapticeval.phenomena.registry import CHECKS

    used = dict.fromkeys(verdict.check for verdict in results.verdicts)
    return [CHECKS[name] for name in used if name in CHECKS]
