"""The report as one page that needs nothing else: no network, no script, readable in print."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from hapticeval.costs import Costs
from hapticeval.reports.bench_section import COLUMNS, bench_section
from hapticeval.reports.marks import Mark, marks_of
from hapticeval.reports.quantity import quantity
from hapticeval.reports.replay_section import COLUMNS as REPLAY_COLUMNS
from hapticeval.reports.replay_section import Section as ReplaySection
from hapticeval.reports.replay_section import replay_section
from hapticeval.reports.table import SYMBOLS, Cell, cell_of, matrix, ran, renderers, summary
from hapticeval.results import Results

RunKey = tuple[str, str, str]
"""Suite, case, renderer."""


@dataclass(frozen=True)
class Drawing:
    """What stands where a run's figure belongs: an SVG element, or the reason why there is none."""

    svg: str = ""
    problem: str = ""


@dataclass(frozen=True)
class Shown:
    """A verdict as the page shows it; `bar` is metric / (metric + bound), so that the bound is always at one half."""

    cell: Cell
    document: Mapping[str, Any]
    anchor: str
    metric: str
    bound: str
    margin: str
    bar: float | None
    mark: Mark | None
    evidence: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class ShownRun:
    """One renderer in one case."""

    document: Mapping[str, Any]
    anchor: str
    column: int
    drawing: Drawing
    verdicts: Sequence[Shown]

    @property
    def unexpected(self) -> bool:
        """Whether anything here calls for attention."""
        return bool(self.document["error"]) or any(not shown.cell.as_expected for shown in self.verdicts)


@dataclass(frozen=True)
class ShownCase:
    """One case with all its renderers; the first run's document says what the case is, `comparison` draws them all."""

    anchor: str
    document: Mapping[str, Any]
    model: str
    scene: str
    comparison: Drawing | None
    runs: Sequence[ShownRun]
    replay: ReplaySection | None


def render_html(results: Results, drawings: Mapping[RunKey, Drawing], *, costs: Costs | None = None) -> str:
    """The page, with a section on `costs` where there is a bench.

    Everything that comes from results is escaped; the drawings' SVG is put in as it is.
    """
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    names = renderers(results)
    anchors = {id(verdict): f"v{index}" for index, verdict in enumerate(results.verdicts)}
    files = resources.files("hapticeval.reports")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["svg"] = Markup
    template = environment.from_string(files.joinpath("report.html.j2").read_text(encoding="utf-8"))
    outcomes = Counter(verdict["outcome"] for verdict in results.verdicts)
    unexpected = sum(not verdict["as_expected"] for verdict in results.verdicts)
    return template.render(
        css=Markup(files.joinpath("report.css").read_text(encoding="utf-8")),
        results=results,
        ran=ran(results),
        renderers=names,
        outcomes=[(name, outcomes[name]) for name in SYMBOLS if outcomes[name]],
        unexpected=unexpected,
        broken=sum(bool(run["error"]) for run in results.runs),
        symbols=SYMBOLS,
        summary=summary(results),
        matrix=matrix(results),
        anchors=lambda cell: anchors[id(cell.verdict)],
        cases=_cases(results, names, drawings, anchors),
        checks=_checks(results),
        bench=None if costs is None else bench_section(costs),
        bench_columns=COLUMNS,
        replay_columns=REPLAY_COLUMNS,
        versions={name: each for name, each in results.environment.get("versions", {}).items() if each},
    )


def _cases(
    results: Results, names: Sequence[str], drawings: Mapping[RunKey, Drawing], anchors: Mapping[int, str]
) -> list[ShownCase]:
    verdicts: dict[RunKey, list[Mapping[str, Any]]] = {}
    for verdict in results.verdicts:
        verdicts.setdefault((verdict["suite"], verdict["case"], verdict["renderer"]), []).append(verdict)
    grouped: dict[tuple[str, str], list[ShownRun]] = {}
    for index, run in enumerate(results.runs):
        key = (run["suite"], run["case"], run["renderer"])
        given = verdicts.get(key, [])
        marks = marks_of(given)
        grouped.setdefault(key[:2], []).append(
            ShownRun(
                run,
                f"r{index}",
                names.index(run["renderer"]),
                drawings.get(key, Drawing(problem="no recording was kept")),
                [_shown(verdict, anchors[id(verdict)], marks.get(verdict["check"])) for verdict in given],
            )
        )
    return [
        ShownCase(
            f"c{index}",
            runs[0].document,
            _model(runs[0].document),
            _scene(runs[0].document),
            drawings.get((*key, "")),
            runs,
            replay_section([run.document for run in runs]),
        )
        for index, (key, runs) in enumerate(grouped.items())
    ]


def _shown(verdict: Mapping[str, Any], anchor: str, mark: Mark | None) -> Shown:
    metric, bound, margin = verdict["metric"] or {}, verdict["bound"], verdict["margin"]
    unit, value = metric.get("unit", ""), metric.get("value")
    comparable = value is not None and bound is not None and value >= 0.0 and bound >= 0.0 and value + bound > 0.0
    return Shown(
        cell=cell_of(verdict),
        document=verdict,
        anchor=anchor,
        metric=quantity(value, unit) if metric else "",
        bound="" if bound is None else quantity(bound, unit),
        margin="" if margin is None else quantity(margin, unit),
        bar=value / (value + bound) if comparable else None,
        mark=mark,
        evidence=[(name, _brief(each)) for name, each in verdict["evidence"].items()],
    )


def _brief(value: Any) -> str:
    """Evidence as JSON text, numbers to six digits."""
    if isinstance(value, str):
        return value
    return json.dumps(_rounded(value), ensure_ascii=False)


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, list):
        return [_rounded(each) for each in value]
    if isinstance(value, dict):
        return {name: _rounded(each) for name, each in value.items()}
    return value


def _model(run: Mapping[str, Any]) -> str:
    """The model in a few words; an imported outline has thousands of numbers."""
    rest = {name: each for name, each in run["model"].items() if name != "kind"}
    rest = rest.get("parameters", rest)
    words = ", ".join(f"{name} {_brief(each)}" for name, each in rest.items())
    return f"{run['model']['kind']}{f' ({words})' if words else ''}" if len(words) < 120 else run["model"]["kind"]


def _scene(run: Mapping[str, Any]) -> str:
    scene = run["scene"]
    units = {"stiffness": "N/m", "damping": "N s/m", "mass": "kg", "restitution": ""}
    words = [f"{name} {quantity(scene[name], unit)}" for name, unit in units.items() if scene[name]]
    if scene["sampling_time"]:
        words.append(f"{1.0 / scene['sampling_time']:.4g} Hz")
    return ", ".join([*words, "bilateral" if scene["bilateral"] else "unilateral"])


def _checks(results: Results) -> list[Any]:
    """What the checks of these results say of themselves, as far as this version still knows them."""
    from hapticeval.phenomena.registry import CHECKS

    used = dict.fromkeys(verdict["check"] for verdict in results.verdicts)
    return [CHECKS[name] for name in used if name in CHECKS]
