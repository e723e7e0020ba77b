"""What a bench found: error against time with the Pareto front, memory and time to build."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hapticeval.reports.canvas import MM, Look
from hapticeval.reports.chart import Axis, Chart, Curve, Note, Rule, charts_data, look_style
from hapticeval.study.bench.document import BenchResults, SettingEntry

MICROSECONDS = 1e6
"""Microseconds in a second."""

ROW_HEIGHT = 19
"""Pixels of a row of a chart with a row per setting."""

TARGET_ERROR = 0.1
"""Error (mm) that a line is drawn at."""

TIME_LIMITS = ((1000.0, "1 ms tick"), (10.0, "10 µs"))
"""Times (us) that lines are drawn at, where the plot reaches so far."""

EXACT_ERROR = 1e-5
"""Error (mm) at which exact settings, and those closer to it than that, are drawn."""

PlottedSettings = list[tuple[SettingEntry, tuple[float, float]]]
"""Settings, each with its time (us) and its error (mm)."""


def bench_plots(bench: BenchResults, looks: Mapping[str, Look]) -> list[tuple[str, str]]:
    """Return the plots of a bench for a page, each with its title; none where nothing is measured.

    `looks` are those of the renderers on all pages.
    """
    plots = []
    for model, settings in bench.by_model().items():
        if plotted := plotted_settings(settings):
            plots.append((model, charts_data([front_chart(plotted, looks, model)])))
    costs = [setting for setting in bench.settings if not setting.problem and setting.memory_bytes is not None]
    if any(setting.build_seconds for setting in costs):
        plots += [(chart.title, charts_data([chart])) for chart in _cost_charts(costs, looks)]
    return plots


def _cost_charts(settings: Sequence[SettingEntry], looks: Mapping[str, Look]) -> list[Chart]:
    """Return a row per setting with a mark for its memory, and one for its time to build: of all models the dearest."""
    settings_by_label: dict[str, list[SettingEntry]] = {}
    for setting in settings:
        if setting.build_seconds:
            settings_by_label.setdefault(setting.label, []).append(setting)
    panels = {
        "memory of all arrays (MB)": lambda setting: max(setting.memory_bytes or 0, 1) / 1e6,
        "least time to build (s)": lambda setting: min(setting.build_seconds),
    }
    return [
        Chart(
            title=f"{words} of every setting",
            x=Axis(label=words, log=True),
            y=Axis(label="", names=list(settings_by_label)),
            curves=[
                Curve(x=[max(map(cost, entries))], y=[row], line=False, **look_style(looks[entries[0].renderer]))
                for row, entries in enumerate(settings_by_label.values())
            ],
            height=50 + ROW_HEIGHT * len(settings_by_label),
        )
        for words, cost in panels.items()
    ]


def plotted_settings(settings: Sequence[SettingEntry]) -> PlottedSettings:
    """Return the settings that have a time and an error, each with its point: us across, mm up."""
    return [
        # An exact setting has no place on a logarithmic axis: it is drawn at EXACT_ERROR.
        (setting, (MICROSECONDS * setting.step.median, max(MM * setting.claims["ihip"]["max"], EXACT_ERROR)))
        for setting in settings
        if setting.claims and setting.step
    ]


def pareto_front(plotted: PlottedSettings) -> PlottedSettings:
    """Return each setting that is more accurate than all quicker ones, by time."""
    front: PlottedSettings = []
    for setting, (time, error) in sorted(plotted, key=lambda entry: entry[1]):
        if not front or error < front[-1][1][1]:
            front.append((setting, (time, error)))
    return front


def front_chart(plotted: PlottedSettings, looks: Mapping[str, Look], title: str) -> Chart:
    """Return IHIP error against time of the settings of one model: a curve for each renderer, and the Pareto front."""
    curves, named = [], []
    label = "Pareto front"
    # A front a reference: errors that count from different ones cannot be compared.
    for reference in dict.fromkeys(setting.reference for setting, _ in plotted):
        front = pareto_front([entry for entry in plotted if entry[0].reference == reference])
        named += front
        curves.append(_curve(front, role="ink", width=1.8, steps=True, label=label))
        # The legend shows one of them.
        label = ""
    for name in dict.fromkeys(setting.renderer for setting, _ in plotted):
        of_renderer = [entry for entry in plotted if entry[0].renderer == name]
        # The first and the last setting of a sweep are named, and what is on the front.
        named += [of_renderer[0], of_renderer[-1]]
        curves.append(_curve(of_renderer, role=looks[name].role, width=1.0, faint=True))
        # Filled where the error is proven, hollow where it is an upper bound only.
        for proven in (True, False):
            points = [entry for entry in of_renderer if bool(entry[0].proven) is proven]
            if points:
                style: dict[str, Any] = {
                    "role": looks[name].role,
                    "marker": looks[name].marker,
                    "size": 9.0 if _is_foreign(name) else 6.0,
                }
                is_first = not any(curve.label == name for curve in curves)
                curves.append(_curve(points, **style, hollow=not proven, line=False, label=name if is_first else ""))
    times, errors = zip(*(place for _, place in plotted), strict=True)
    # us: the 10 us line is always in view.
    view = min(*times, 8.0) / 1.35, max(*times, 12.0) * 1.6
    rules = [Rule(y=TARGET_ERROR, role="mark", text=f"{TARGET_ERROR} mm")]
    rules += [
        Rule(x=limit, role="quiet", dash=(4, 2), text=text) for limit, text in TIME_LIMITS if view[0] < limit < view[1]
    ]
    if min(errors) <= EXACT_ERROR:
        rules.append(Rule(y=EXACT_ERROR, role="grid", width=5.0, text="exact, or below 10 nm"))
    return Chart(
        title=f"IHIP error against time a step: {title}",
        x=Axis(label="time a step, median (µs)", log=True, range=view),
        y=Axis(label="largest IHIP error (mm)", log=True, range=(min(errors) / 2.0, max(*errors, 0.2) * 3.0)),
        curves=curves,
        rules=rules,
        notes=[Note(*place, text) for setting, place in named if (text := _setting_words(setting))],
        height=420,
    )


def _curve(plotted: PlottedSettings, **style: Any) -> Curve:
    return Curve(x=[time for _, (time, _) in plotted], y=[error for _, (_, error) in plotted], **style)


def _is_foreign(name: str) -> bool:
    """Return whether a renderer is none of those that come with hapticeval: it stands out."""
    return ":" in name


def _setting_words(setting: SettingEntry) -> str:
    """Return what stands beside a setting: its knob, of a foreign renderer also its name."""
    return setting.label if _is_foreign(setting.renderer) else setting.label.removeprefix(setting.renderer).strip()
