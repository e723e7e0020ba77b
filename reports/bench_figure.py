"""What a bench found: error against time with the Pareto front, memory and time to build, and changes since another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hapticeval.reports.canvas import CURVES, MM, drawn, figure, page_svg
from hapticeval.study.bench.document import BenchResults, Change, Kind, SettingEntry

if TYPE_CHECKING:
    from matplotlib.axes import Axes

US = 1e6
ROW = 0.2
"""Height (in) of a row of a figure with a row per setting."""

ABREAST = 2
"""Models whose panels stand beside each other."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">")
GOOD_ENOUGH = 0.1
"""Error (mm) that a line is drawn at."""

LIMITS = ((1000.0, "1 ms tick"), (10.0, "10 µs"))
"""Times (us) that lines are drawn at, where the plot reaches so far."""

EXACT = 1e-5
"""Error (mm) at which exact settings, and those closer to it than that, are drawn."""

TITLES: Mapping[Kind, str] = {"step": "one step at a time, from Python", "batch": "a whole trajectory at once"}


Placed = list[tuple[SettingEntry, tuple[float, float]]]
"""Settings, each with its time (us) and its error (mm)."""


def bench_plots(bench: BenchResults) -> list[tuple[str, str]]:
    """Return the plots of a bench as SVG elements for a page, each with its title; none where nothing is measured."""
    plots = []
    names = list(dict.fromkeys(each.renderer for each in bench.settings if not each.problem))
    for kind, title in TITLES.items():
        placed = {model: _placed(settings, kind) for model, settings in bench.by_model().items()}
        shown = [(model, each) for model, each in placed.items() if each]
        for first in range(0, len(shown), ABREAST):
            plots.append((title, _svg(dict(shown[first : first + ABREAST]), kind, names, first)))
    if any(each.build_seconds for each in bench.settings):
        plots.append(("memory, and time to build", _costs(bench.settings, names)))
    if any(each.low is not None for each in bench.comparison):
        plots.append(("against the earlier bench", _changes(bench.comparison)))
    return plots


def _costs(settings: Sequence[SettingEntry], names: Sequence[str]) -> str:
    """A row per setting with a mark for its memory and one for its time to build: of all models the dearest."""
    held: dict[str, list[SettingEntry]] = {}
    for each in settings:
        if not each.problem and each.memory_bytes is not None and each.build_seconds:
            held.setdefault(each.label, []).append(each)
    rows = range(len(held))
    height = 0.9 + ROW * len(held)
    with figure(10.0, height, page=True) as made:
        panels = (
            ("memory of all arrays (MB)", lambda each: max(each.memory_bytes or 0, 1) / 1e6),
            ("least time to build (s)", lambda each: min(each.build_seconds)),
        )
        for k, (words, cost) in enumerate(panels):
            axes = made.add_axes((0.28 + 0.36 * k, 0.55 / height, 0.34, 1.0 - 0.75 / height))
            for row, entries in zip(rows, held.values(), strict=True):
                colour, marker = _look(entries[0].renderer, names)
                axes.plot(max(map(cost, entries)), row, linestyle="none", marker=marker, markersize=6, color=colour)
            axes.set(xscale="log", xlabel=words, ylim=(len(held) - 0.5, -0.5))
            axes.set_yticks(rows, list(held) if k == 0 else [])
            axes.grid(True, which="major")
        return page_svg(made, prefix="bcost", title="Memory and time to build of every setting")


def _changes(comparison: Sequence[Change]) -> str:
    """A row per setting and kind of time: its ratio to the earlier time with the interval of 95 per cent."""
    timed = [(each, each.ratio, each.low) for each in comparison if each.low is not None and each.ratio is not None]
    height = 0.9 + ROW * len(timed)
    roles = {"better": ("one", "v"), "worse": ("mark", "^"), "not significant": ("quiet", "o")}
    with figure(10.0, height, page=True) as made:
        axes = made.add_axes((0.38, 0.55 / height, 0.6, 1.0 - 0.75 / height))
        for row, (each, ratio, low) in enumerate(timed):
            role, marker = roles[each.verdict]
            axes.plot((low or ratio, each.high or ratio), (row, row), color=drawn(role), linewidth=1.2)
            axes.plot(ratio, row, linestyle="none", marker=marker, markersize=6, color=drawn(role))
        axes.axvline(1.0, color=drawn("ink"), linewidth=1.0)
        axes.set(xscale="log", xlabel="time now / time then; triangles are significant", ylim=(len(timed) - 0.5, -0.5))
        axes.set_yticks(range(len(timed)), [f"{each.label}, {each.model}, {each.what}" for each, *_ in timed])
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_formatter(lambda value, _: f"{value:g}")
        axes.tick_params(axis="x", which="minor", labelsize=7)
        return page_svg(made, prefix="bchange", title="Times against those of the earlier bench")


def _placed(settings: Sequence[SettingEntry], kind: Kind) -> Placed:
    """Those that have both a time of that kind and a proven error."""
    return [
        (each, (US * times.median, max(MM * each.claims["ihip"]["p99"], EXACT)))
        for each in settings
        if each.claims and (times := each.times(kind))
    ]


def _svg(models: Mapping[str, Placed], kind: Kind, names: Sequence[str], first: int) -> str:
    """One panel per model, of which number `first` is the first."""
    below = 0.2 * ((len(names) + 3) // 4)
    with figure(10.0, 4.6 + below, page=True) as made:
        low = (0.62 + below) / (4.6 + below)
        width = 0.93 / len(models)
        handles: dict[str, Any] = {}
        for k, (model, placed) in enumerate(models.items()):
            axes = made.add_axes((0.065 + k * width, low, width - 0.055, 0.93 - low))
            _draw_panel(axes, placed, kind, names)
            axes.set_title(model, loc="left")
            if k == 0:
                axes.set_ylabel("IHIP error, 99 % (mm)")
            drawings, labels = axes.get_legend_handles_labels()
            handles |= {label: each for label, each in zip(labels, drawings, strict=True) if label not in handles}
        made.legend(
            handles.values(), handles.keys(), loc="lower center", ncols=4, fontsize=8, handlelength=1.2,
            columnspacing=1.6,
        )  # fmt: skip
        title = f"Work-precision plot, {TITLES[kind]}: IHIP error against time a step"
        return page_svg(made, prefix=f"b{kind}{first or ''}", title=title)


def _draw_panel(axes: Axes, placed: Placed, kind: Kind, names: Sequence[str]) -> None:
    axes.set(xscale="log", yscale="log", xlabel="time a step, median (µs)")
    axes.grid(True, which="major")
    wanted = [(each, at) for each, at in placed if kind in each.front]
    if wanted:  # steps from each setting on the front to the next: what is reachable lies above and to the right
        front = sorted(at for _, at in wanted)
        label = "Pareto front"
        axes.step(*zip(*front, strict=True), where="post", color=drawn("ink"), linewidth=1.4, zorder=1.8, label=label)
    for name in dict.fromkeys(each.renderer for each, _ in placed):
        colour, marker = _look(name, names)
        held = [(each, at) for each, at in placed if each.renderer == name]
        wanted += [held[0], held[-1]]
        axes.plot(*zip(*(at for _, at in held), strict=True), color=colour, linewidth=0.7, alpha=0.6)
        label, foreign = name, _foreign(name)
        for proven, fill in ((True, colour), (False, "none")):
            some = [at for each, at in held if bool(each.proven) is proven]
            if some:
                axes.plot(
                    *zip(*some, strict=True), linestyle="none", marker=marker, markersize=10 if foreign else 6,
                    color=colour, markerfacecolor=fill, markeredgecolor=drawn("ink") if foreign else colour,
                    label=label,
                )  # fmt: skip
                label = "_"  # of a name the legend shows one mark
    _limit(axes, placed)
    _name(axes, wanted)
    axes.axhline(GOOD_ENOUGH, color=drawn("mark"), linewidth=1.0, zorder=1.5)
    small: dict[str, Any] = {"fontsize": 7}
    axes.annotate("0.1 mm", (1.0, GOOD_ENOUGH), xycoords=("axes fraction", "data"), ha="right", va="bottom", **small)
    low, high = axes.get_xlim()
    for at, text in LIMITS:
        if low < at < high:
            axes.axvline(at, color=drawn("quiet"), linewidth=0.9, linestyle=(0, (4, 2)), zorder=1.5)
            where: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
            axes.annotate(text, (at, 1.0), xytext=(3, -2), va="top", **where, **small)
        elif at >= high:
            words = f"{text} lies {at / high:.2g} times further right →"
            axes.annotate(words, (1.0, 1.01), xycoords="axes fraction", ha="right", va="bottom", **small)


def _look(name: str, names: Sequence[str]) -> tuple[str, str]:
    """Colour and marker of a renderer: one colour for all its representations, one marker for each representation."""
    bases = list(dict.fromkeys(each.partition("@")[0] for each in names))
    kinds = list(dict.fromkeys(each.partition("@")[2] for each in names))
    base, _, kind = name.partition("@")
    return drawn(CURVES[bases.index(base) % len(CURVES)]), MARKERS[kinds.index(kind) % len(MARKERS)]


def _foreign(name: str) -> bool:
    """Return whether a renderer is none of those that come with hapticeval: it stands out."""
    return ":" in name


def _limit(axes: Axes, placed: Placed) -> None:
    times, errors = zip(*(at for _, at in placed), strict=True)
    low, high = min(*times, 8.0), max(*times, 12.0)
    axes.set_xlim(low / 1.35, high * 1.6)
    ticks = [m * 10.0**k for k in range(-3, 6) for m in ((1, 2, 5) if high / low < 100.0 else (1,))]
    axes.set_xticks([at for at in ticks if low / 1.35 <= at <= high * 1.6])
    axes.set_xticks([], minor=True)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_ylim(min(errors) / 2.0, max(*errors, 0.2) * 3.0)
    if min(errors) <= EXACT:
        axes.axhspan(EXACT / 2.0, EXACT * 2.0, color=drawn("grid"), alpha=0.6, zorder=0.1)
        axes.annotate(
            "exact, or below 10 nm", (0.01, EXACT * 2.0), xycoords=("axes fraction", "data"), xytext=(0, 2),
            textcoords="offset points", fontsize=7,
        )  # fmt: skip


def _name(axes: Axes, wanted: Placed) -> None:
    """Write the settings beside their marks, where there is room for them."""
    taken: list[tuple[float, float]] = []
    for each, place in wanted:
        text = each.label if _foreign(each.renderer) else each.label.removeprefix(each.renderer).strip()
        x, y = axes.transData.transform(place)
        if text and not any(abs(x - a) < 4.0 * len(text) and abs(y - b) < 9.0 for a, b in taken):
            taken.append((x, y))
            axes.annotate(text, place, xytext=(5, 3), textcoords="offset points", fontsize=6.5, zorder=6)
