"""What a bench found: error against time, a chart a renderer on axes that all share, for a page and for a paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hapticeval.reports.canvas import MM, Look
from hapticeval.reports.chart import Axis, Chart, Curve, Note, Rule
from hapticeval.study.bench.document import SettingEntry

MICROSECONDS = 1e6
"""Microseconds in a second."""

MULTIPLE_HEIGHT = 210
"""Pixels of the chart of one renderer among those of others."""

TARGET_ERROR = 0.1
"""Error (mm) that a line is drawn at."""

EXACT_ERROR = 1e-5
"""Error (mm) at which exact settings, and those closer to it than that, are drawn."""

TICK_RULE = Rule(x=1000.0, role="quiet", dash=(4, 2), text="tick of 1 ms")
"""Time (us) in which a loop of 1 kHz wants its answer, on a chart with times across."""

PlottedSettings = list[tuple[SettingEntry, tuple[float, float]]]
"""Settings, each with its time (us) and its error (mm)."""


def base_of(renderer: str) -> str:
    """Return a renderer's name without its representation."""
    return renderer.partition("@")[0]


def cheapest_by_renderer(
    settings: Sequence[SettingEntry], group: Callable[[str], str] = base_of
) -> dict[str, SettingEntry]:
    """Return of each renderer on one model the quickest setting within `TARGET_ERROR`, or else the most accurate.

    Those that come within it are first, the quickest first. `group` says which names are one renderer.
    """
    ranked: dict[str, list[tuple[bool, float, float, SettingEntry]]] = {}
    for setting, (time, _) in plotted_settings(settings):
        assert setting.claims is not None
        error = MM * setting.claims["ihip"]["max"]
        too_coarse = error > TARGET_ERROR
        ranked.setdefault(group(setting.renderer), []).append(
            (too_coarse, error if too_coarse else time, error, setting)
        )
    best = {name: min(entries, key=lambda entry: entry[:3]) for name, entries in ranked.items()}
    return {name: entry[3] for name, entry in sorted(best.items(), key=lambda pair: pair[1][:3])}


def small_multiples(settings: Sequence[SettingEntry], looks: Mapping[str, Look]) -> list[Chart]:
    """Return a chart for each renderer on one model: error against time on axes that all share.

    A line is a representation, with its name at its end and the knob's values at its ends.
    """
    plotted = plotted_settings(settings)
    times, errors = zip(*(place for _, place in plotted), strict=True)
    # us and mm: the tick, and what is exact, are in view.
    across = Axis(label="time a step (µs)", log=True, range=(min(*times, 2.0) / 1.5, 2000.0))
    up = Axis(label="largest IHIP error (mm)", log=True, range=(EXACT_ERROR / 2.0, max(*errors, 1.0) * 3.0))
    charts = []
    for name in dict.fromkeys(base_of(setting.renderer) for setting, _ in plotted):
        curves, notes = [], []
        for variant in dict.fromkeys(setting.renderer for setting, _ in plotted if base_of(setting.renderer) == name):
            line = [entry for entry in plotted if entry[0].renderer == variant]
            proven = all(setting.proven for setting, _ in line)
            curves.append(
                _curve(line, role=looks[variant].role, width=1.2, marker=looks[variant].marker, hollow=not proven)
            )
            words = variant.partition("@")[2]
            # The finest and the coarsest setting, which may be one.
            for setting, place in line[:-2:-1] + line[: len(line) > 1]:
                notes.append(Note(*place, f"{words} {setting.label.removeprefix(variant).strip()}".strip()))
        rules = [TICK_RULE, Rule(y=TARGET_ERROR, role="mark")]
        charts.append(
            Chart(title=name, x=across, y=up, curves=curves, rules=rules, notes=notes, height=MULTIPLE_HEIGHT)
        )
    return charts


def plotted_settings(settings: Sequence[SettingEntry]) -> PlottedSettings:
    """Return the settings that have a time and an error, each with its point: us across, mm up."""
    return [
        # An exact setting has no place on a logarithmic axis: it is drawn at EXACT_ERROR.
        (setting, (MICROSECONDS * setting.step.median, max(MM * setting.claims["ihip"]["max"], EXACT_ERROR)))
        for setting in settings
        if setting.claims and setting.step
    ]


def _curve(plotted: PlottedSettings, **style: Any) -> Curve:
    return Curve(x=[time for _, (time, _) in plotted], y=[error for _, (_, error) in plotted], **style)
