"""What the page shows of results: verdicts with their bars, runs with their figures, cases with their words."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hapticeval.quantity import quantity
from hapticeval.reports.marks import Mark, marks_of
from hapticeval.reports.replay_section import Section as ReplaySection
from hapticeval.reports.replay_section import replay_section
from hapticeval.reports.scene_words import ended_words, figures_cited, robot_words, scene_words
from hapticeval.reports.table import Cell, cell_of
from hapticeval.runner.results import ResultsDocument, RunEntry, VerdictEntry

RunKey = tuple[str, str, str]
"""Suite, case, renderer."""


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
class Shown:
    """A verdict as the page shows it; `bar` is metric / (metric + bound), so that the bound is always at one half."""

    cell: Cell
    document: VerdictEntry
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

    document: RunEntry
    anchor: str
    column: int
    drawing: Drawing
    ended: str
    verdicts: Sequence[Shown]

    @property
    def judged(self) -> Sequence[Shown]:
        """The verdicts but those that lack a channel."""
        return [shown for shown in self.verdicts if "lacks" not in shown.document.evidence]

    @property
    def lacking(self) -> Mapping[str, Sequence[Shown]]:
        """By channel, the verdicts that could not be reached for want of it: they are told in one line."""
        found: dict[str, list[Shown]] = {}
        for shown in self.verdicts:
            if "lacks" in shown.document.evidence:
                found.setdefault(shown.document.evidence["lacks"], []).append(shown)
        return found

    @property
    def unexpected(self) -> bool:
        """Whether anything here calls for attention."""
        return bool(self.document.error) or any(not shown.cell.as_expected for shown in self.verdicts)

    @property
    def failing(self) -> bool:
        """Whether a check fails here, or could not be made."""
        return any(shown.cell.outcome in ("fail", "error") for shown in self.verdicts)


@dataclass(frozen=True)
class ShownCase:
    """One case with all its renderers; the first run's document says what the case is, `comparison` draws them all.

    `figures` names those of the thesis that its citation does.
    """

    anchor: str
    document: RunEntry
    model: str
    scene: str
    robot: str
    figures: str
    comparison: Drawing | None
    runs: Sequence[ShownRun]
    replay: ReplaySection | None

    @property
    def folded(self) -> bool:
        """Whether its runs are told one by one only on demand: nothing is judged, and one figure shows them all."""
        return not self.document.judged and self.comparison is not None and bool(self.comparison.svg)

    @property
    def charted(self) -> bool:
        """Whether a run here has the figure of the sphere's two charts."""
        return any(run.drawing.charts for run in self.runs)

    @property
    def unexpected(self) -> bool:
        """Whether anything here calls for attention."""
        return any(run.unexpected for run in self.runs)


def shown_cases(
    results: ResultsDocument, names: Sequence[str], drawings: Mapping[RunKey, Drawing], anchors: Mapping[int, str]
) -> list[ShownCase]:
    """Every case of the results in the order in which they ran."""
    verdicts: dict[RunKey, list[VerdictEntry]] = {}
    for verdict in results.verdicts:
        verdicts.setdefault((verdict.suite, verdict.case, verdict.renderer), []).append(verdict)
    grouped: dict[tuple[str, str], list[ShownRun]] = {}
    for index, run in enumerate(results.runs):
        key = (run.suite, run.case, run.renderer)
        given = verdicts.get(key, [])
        marks = marks_of(given)
        grouped.setdefault(key[:2], []).append(
            ShownRun(
                run,
                f"r{index}",
                names.index(run.renderer),
                drawings.get(key, Drawing(problem="no recording was kept")),
                ended_words(run),
                [_shown(verdict, anchors[id(verdict)], marks.get(verdict.check)) for verdict in given],
            )
        )
    return [
        ShownCase(
            f"c{index}",
            runs[0].document,
            _model(runs[0].document),
            scene_words(runs[0].document),
            robot_words(runs[0].document),
            figures_cited(runs[0].document),
            drawings.get((*key, "")),
            runs,
            replay_section([run.document for run in runs]),
        )
        for index, (key, runs) in enumerate(grouped.items())
    ]


def _shown(verdict: VerdictEntry, anchor: str, mark: Mark | None) -> Shown:
    metric, bound, margin = verdict.metric, verdict.bound, verdict.margin
    unit, value = ("", None) if metric is None else (metric.unit, metric.value)
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
        evidence=[(name, _brief(each)) for name, each in verdict.evidence.items()],
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


def _model(run: RunEntry) -> str:
    """The model in a few words; an imported outline has thousands of numbers."""
    words = ", ".join(f"{name} {_brief(each)}" for name, each in run.model_parameters.items())
    kind = str(run.model["kind"])
    return f"{kind} ({words})" if 0 < len(words) < 120 else kind
