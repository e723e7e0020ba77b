"""What a bench found: error against time with the Pareto front, memory and time to build, and changes since another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hapticeval.reports.canvas import MM, Look, colour_of, figure, page_svg
from hapticeval.study.bench.document import BenchResults, Change, Kind, SettingEntry

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MICROSECONDS = 1e6
"""Microseconds in a second."""

ROW_HEIGHT = 0.24
"""Height (in) of a row of a figure with a row per setting."""

TARGET_ERROR = 0.1
"""Error (mm) that a line is drawn at."""

TIME_LIMITS = ((1000.0, "1 ms tick"), (10.0, "10 µs"))
"""Times (us) that lines are drawn at, where the plot reaches so far."""

EXACT_ERROR = 1e-5
"""Error (mm) at which exact settings, and those closer to it than that, are drawn."""

KIND_TITLES: Mapping[Kind, str] = {"step": "one step at a time, from Python", "batch": "a whole trajectory at once"}
"""What is timed, in words."""


PlottedSettings = list[tuple[SettingEntry, tuple[float, float]]]
"""Settings, each with its time (us) and its error (mm)."""


def bench_plots(bench: BenchResults, looks: Mapping[str, Look]) -> list[tuple[str, str]]:
    """Return the plots of a bench as SVG elements for a page, each with its title; none where nothing is measured.

    `looks` are those of the renderers on all pages.
    """
    plots = []
    for kind, title in KIND_TITLES.items():
        placed = {model: plotted_settings(settings, kind) for model, settings in bench.by_model().items()}
        drawable = [(model, plotted) for model, plotted in placed.items() if plotted]
        for number, (model, plotted) in enumerate(drawable):
            plots.append((f"{model}, {title}", _precision_svg(plotted, kind, looks, f"b{kind}{number}")))
    if any(setting.build_seconds for setting in bench.settings):
        plots.append(("memory, and time to build", _costs_svg(bench.settings, looks)))
    if any(change.low is not None for change in bench.comparison):
        plots.append(("against the earlier bench", _changes_svg(bench.comparison)))
    return plots


def _costs_svg(settings: Sequence[SettingEntry], looks: Mapping[str, Look]) -> str:
    """Draw a row per setting with a mark for its memory and one for its time to build: of all models the dearest."""
    settings_by_label: dict[str, list[SettingEntry]] = {}
    for setting in settings:
        if not setting.problem and setting.memory_bytes is not None and setting.build_seconds:
            settings_by_label.setdefault(setting.label, []).append(setting)
    rows = range(len(settings_by_label))
    height = 0.9 + ROW_HEIGHT * len(settings_by_label)
    with figure(10.0, height, page=True) as fig:
        panels = (
            ("memory of all arrays (MB)", lambda setting: max(setting.memory_bytes or 0, 1) / 1e6),
            ("least time to build (s)", lambda setting: min(setting.build_seconds)),
        )
        for k, (words, cost) in enumerate(panels):
            axes = fig.add_axes((0.40 + 0.30 * k, 0.55 / height, 0.28, 1.0 - 0.75 / height))
            for row, entries in zip(rows, settings_by_label.values(), strict=True):
                look = looks[entries[0].renderer]
                # Of several models the dearest counts, in memory as in time.
                axes.plot(
                    max(map(cost, entries)), row, linestyle="none", marker=look.marker, markersize=6,
                    color=colour_of(look.role),
                )  # fmt: skip
            axes.set(xscale="log", xlabel=words, ylim=(len(settings_by_label) - 0.5, -0.5))
            axes.set_yticks(rows, list(settings_by_label) if k == 0 else [])
            axes.grid(True, which="major")
        return page_svg(fig, prefix="bcost", title="Memory and time to build of every setting")


def _changes_svg(comparison: Sequence[Change]) -> str:
    """Draw a row per setting and kind of time: its ratio to the earlier time with the interval of 95 per cent."""
    timed = [
        (change, change.ratio, change.low)
        for change in comparison
        if change.low is not None and change.ratio is not None
    ]
    height = 0.9 + ROW_HEIGHT * len(timed)
    roles = {"better": ("one", "v"), "worse": ("mark", "^"), "not significant": ("quiet", "o")}
    with figure(10.0, height, page=True) as fig:
        axes = fig.add_axes((0.5, 0.55 / height, 0.48, 1.0 - 0.75 / height))
        for row, (change, ratio, low) in enumerate(timed):
            role, marker = roles[change.verdict]
            # The ratio's interval as a line, the ratio as a mark on it.
            axes.plot((low or ratio, change.high or ratio), (row, row), color=colour_of(role), linewidth=1.2)
            axes.plot(ratio, row, linestyle="none", marker=marker, markersize=6, color=colour_of(role))
        axes.axvline(1.0, color=colour_of("ink"), linewidth=1.0)
        axes.set(xscale="log", xlabel="time now / time then; triangles are significant", ylim=(len(timed) - 0.5, -0.5))
        axes.set_yticks(range(len(timed)), [f"{change.label}, {change.model}, {change.what}" for change, *_ in timed])
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_formatter(lambda value, _: f"{value:g}")
        return page_svg(fig, prefix="bchange", title="Times against those of the earlier bench")


def plotted_settings(settings: Sequence[SettingEntry], kind: Kind) -> PlottedSettings:
    """Return the settings that have a time of that kind and an error, each with its point: us across, mm up."""
    return [
        # An exact setting has no place on a logarithmic axis: it is drawn at EXACT_ERROR.
        (setting, (MICROSECONDS * times.median, max(MM * setting.claims["ihip"]["max"], EXACT_ERROR)))
        for setting in settings
        if setting.claims and (times := setting.times(kind))
    ]


def _precision_svg(plotted: PlottedSettings, kind: Kind, looks: Mapping[str, Look], prefix: str) -> str:
    """Draw error against time of the settings on one model."""
    names = {setting.renderer for setting, _ in plotted}
    # Inches of the legend: a row of two names, and one more for the front.
    below = 0.22 * (len(names) // 2 + 1)
    with figure(7.0, 4.6 + below, page=True) as fig:
        low = (0.62 + below) / (4.6 + below)
        axes = fig.add_axes((0.12, low, 0.86, 0.94 - low))
        _draw_panel(axes, plotted, kind, looks)
        axes.set_ylabel("largest IHIP error (mm)")
        fig.legend(*axes.get_legend_handles_labels(), loc="lower center", ncols=2, handlelength=1.2, columnspacing=1.6)
        title = f"Work-precision plot, {KIND_TITLES[kind]}: IHIP error against time a step"
        return page_svg(fig, prefix=prefix, title=title)


def _draw_panel(axes: Axes, plotted: PlottedSettings, kind: Kind, looks: Mapping[str, Look]) -> None:
    """Draw the settings of one model: a curve for each renderer, the Pareto front, and lines of what is asked for."""
    axes.set(xscale="log", yscale="log", xlabel="time a step, median (µs)")
    axes.grid(True, which="major")
    labelled = [(setting, at) for setting, at in plotted if kind in setting.front]
    label = "Pareto front"
    # A front a reference: errors that count from different ones cannot be compared.
    for reference in dict.fromkeys(setting.reference for setting, _ in labelled):
        # steps from each setting on the front to the next: what is reachable lies above and to the right
        front = sorted(at for setting, at in labelled if setting.reference == reference)
        axes.step(
            *zip(*front, strict=True), where="post", color=colour_of("ink"), linewidth=1.4, zorder=1.8, label=label
        )
        label = "_"  # the legend shows one line
    for name in dict.fromkeys(setting.renderer for setting, _ in plotted):
        colour, marker = colour_of(looks[name].role), looks[name].marker
        of_renderer = [(setting, at) for setting, at in plotted if setting.renderer == name]
        # The first and the last setting of a sweep are named, and what is on the front.
        labelled += [of_renderer[0], of_renderer[-1]]
        axes.plot(*zip(*(at for _, at in of_renderer), strict=True), color=colour, linewidth=0.7, alpha=0.6)
        label, foreign = name, _is_foreign(name)
        # Filled where the error is proven, hollow where it is an upper bound only.
        for proven, fill in ((True, colour), (False, "none")):
            points = [point for setting, point in of_renderer if bool(setting.proven) is proven]
            if points:
                axes.plot(
                    *zip(*points, strict=True), linestyle="none", marker=marker, markersize=10 if foreign else 6,
                    color=colour, markerfacecolor=fill, markeredgecolor=colour_of("ink") if foreign else colour,
                    label=label,
                )  # fmt: skip
                label = "_"  # of a name the legend shows one mark
    _set_axis_limits(axes, plotted)
    _label_settings(axes, labelled)
    axes.axhline(TARGET_ERROR, color=colour_of("mark"), linewidth=1.0, zorder=1.5)
    axes.annotate("0.1 mm", (1.0, TARGET_ERROR), xycoords=("axes fraction", "data"), ha="right", va="bottom")
    low, high = axes.get_xlim()
    for limit, text in TIME_LIMITS:
        if low < limit < high:
            axes.axvline(limit, color=colour_of("quiet"), linewidth=0.9, linestyle=(0, (4, 2)), zorder=1.5)
            where: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
            axes.annotate(text, (limit, 1.0), xytext=(3, -2), va="top", **where)
        elif limit >= high:
            words = f"{text} lies {limit / high:.2g} times further right →"
            axes.annotate(words, (1.0, 1.01), xycoords="axes fraction", ha="right", va="bottom")


def _is_foreign(name: str) -> bool:
    """Return whether a renderer is none of those that come with hapticeval: it stands out."""
    return ":" in name


def _set_axis_limits(axes: Axes, plotted: PlottedSettings) -> None:
    """Set both axes round the points, and shade where exact settings are drawn."""
    times, errors = zip(*(at for _, at in plotted), strict=True)
    # us: the 10 us line is always in view.
    low, high = min(*times, 8.0), max(*times, 12.0)
    axes.set_xlim(low / 1.35, high * 1.6)
    # Ticks at 1, 2 and 5 where fewer than two decades are shown, else at the powers of ten.
    ticks = [m * 10.0**k for k in range(-3, 6) for m in ((1, 2, 5) if high / low < 100.0 else (1,))]
    axes.set_xticks([at for at in ticks if low / 1.35 <= at <= high * 1.6])
    axes.set_xticks([], minor=True)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_ylim(min(errors) / 2.0, max(*errors, 0.2) * 3.0)
    if min(errors) <= EXACT_ERROR:
        axes.axhspan(EXACT_ERROR / 2.0, EXACT_ERROR * 2.0, color=colour_of("grid"), alpha=0.6, zorder=0.1)
        axes.annotate(
            "exact, or below 10 nm", (0.01, EXACT_ERROR * 2.0), xycoords=("axes fraction", "data"), xytext=(0, 2),
            textcoords="offset points",
        )  # fmt: skip


def _label_settings(axes: Axes, labelled: PlottedSettings) -> None:
    """Write the settings beside their marks, where there is room for them."""
    occupied: list[tuple[float, float]] = []
    for setting, place in labelled:
        text = setting.label if _is_foreign(setting.renderer) else setting.label.removeprefix(setting.renderer).strip()
        x, y = axes.transData.transform(place)
        # In pixels: a character is about 8 wide, a line 19 high; what would cover an earlier label is left out.
        if text and not any(abs(x - a) < 8.0 * len(text) and abs(y - b) < 19.0 for a, b in occupied):
            occupied.append((x, y))
            axes.annotate(text, place, xytext=(5, 3), textcoords="offset points", zorder=6)
