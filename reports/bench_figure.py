"""Work-precision plots: the error of every setting against the time that a step takes, and the Pareto front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hapticeval.reports.canvas import MM, drawn, figure, page_svg
from hapticeval.study.bench.document import BenchResults, Kind, SettingEntry

if TYPE_CHECKING:
    from matplotlib.axes import Axes

US = 1e6
ROLES = ("hip", "ihip", "one", "two", "mark", "three")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">")
GOOD_ENOUGH = 0.1
"""Error (mm) that a line is drawn at."""

LIMITS = ((1000.0, "1 ms tick"), (10.0, "10 µs"))
"""Times (us) that lines are drawn at, where the plot reaches so far."""

EXACT = 1e-5
"""Error (mm) at which exact settings, and those closer to it than that, are drawn."""

TITLES: Mapping[Kind, str] = {"step": "one step at a time, from Python", "batch": "a whole trajectory at once"}


def bench_plots(bench: BenchResults) -> list[tuple[str, str]]:
    """Return the plots of a bench, each with its title; none where nothing has been measured."""
    if not any(each.claims and each.step for each in bench.settings):
        return []
    return [(title, bench_svg(bench, kind, prefix=f"b{kind}")) for kind, title in TITLES.items()]


def bench_svg(bench: BenchResults, kind: Kind, *, prefix: str) -> str:
    """Draw one panel per model, as an SVG element for a page; `kind` is `step` or `batch`."""
    models = list(dict.fromkeys(each.model for each in bench.settings))
    names = list(dict.fromkeys(each.renderer for each in bench.settings if each.claims and each.times(kind)))
    rows = (len(names) + 3) // 4
    title = f"Work-precision plot, {TITLES[kind]}: IHIP error against time a step"
    with figure(10.0, 4.6 + 0.2 * rows, page=True) as made:
        low = (0.62 + 0.2 * rows) / (4.6 + 0.2 * rows)
        width = 0.93 / max(len(models), 1)
        panels = [made.add_axes((0.065 + k * width, low, width - 0.055, 0.93 - low)) for k in range(len(models))]
        for axes, model in zip(panels, models, strict=True):
            _draw_panel(axes, [each for each in bench.settings if each.model == model], kind, names)
            axes.set_title(model)
        if panels:
            panels[0].set_ylabel("IHIP error, 99 % (mm)")
            handles: dict[str, Any] = {}
            for axes in panels:
                drawings, labels = axes.get_legend_handles_labels()
                handles = {**dict(zip(labels, drawings, strict=True)), **handles}
            made.legend(
                handles.values(), handles.keys(), loc="lower center", ncols=4, frameon=False, fontsize=8,
                handlelength=1.2, columnspacing=1.6,
            )  # fmt: skip
        return page_svg(made, prefix=prefix, title=title)


def _draw_panel(axes: Axes, entries: Sequence[SettingEntry], kind: Kind, names: Sequence[str]) -> None:
    shown = [each for each in entries if each.claims and each.times(kind)]
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("time a step, median (µs)")
    axes.grid(True, which="major", linewidth=0.5)
    axes.set_axisbelow(True)
    for name in dict.fromkeys(each.renderer for each in shown):
        colour, marker = _look(name, names)
        held = [each for each in shown if each.renderer == name]
        places = [_place(each, kind) for each in held]
        axes.plot(*zip(*places, strict=True), color=colour, linewidth=0.7, alpha=0.6)
        for proven in (True, False):
            label = name if proven or not any(each.proven for each in held) else None
            some = [at for each, at in zip(held, places, strict=True) if bool(each.proven) is proven]
            if some:
                axes.plot(
                    *zip(*some, strict=True), linestyle="none", marker=marker, markersize=6, color=colour,
                    markerfacecolor=colour if proven else "none", label=label,
                )  # fmt: skip
    _draw_front(axes, [_place(each, kind) for each in shown if kind in each.front])
    _limit(axes, shown, kind)
    _draw_labels(axes, shown, kind)
    axes.axhline(GOOD_ENOUGH, color=drawn("mark"), linewidth=1.0, zorder=1.5)
    axes.annotate("0.1 mm", (1.0, GOOD_ENOUGH), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7)
    for at, text in LIMITS:
        low, high = axes.get_xlim()
        if low < at < high:
            axes.axvline(at, color=drawn("quiet"), linewidth=0.9, linestyle=(0, (4, 2)), zorder=1.5)
            axes.annotate(
                text, (at, 1.0), xycoords=("data", "axes fraction"), xytext=(3, -2), textcoords="offset points",
                va="top", fontsize=7,
            )  # fmt: skip
        elif at >= high:
            axes.annotate(
                f"{text} lies {at / high:.2g} times further right →", (1.0, 1.01), xycoords="axes fraction",
                ha="right", va="bottom", fontsize=7,
            )  # fmt: skip


def _look(name: str, names: Sequence[str]) -> tuple[str, str]:
    """Colour and marker of a renderer: one colour for all its representations, one marker for each representation."""
    bases = list(dict.fromkeys(each.partition("@")[0] for each in names))
    kinds = list(dict.fromkeys(each.partition("@")[2] for each in names))
    base, _, kind = name.partition("@")
    return drawn(ROLES[bases.index(base) % len(ROLES)]), MARKERS[kinds.index(kind) % len(MARKERS)]


def _place(entry: SettingEntry, kind: Kind) -> tuple[float, float]:
    """Time (us) and error (mm) of a setting."""
    times, claims = entry.times(kind), entry.claims
    assert times is not None, "only settings with times are drawn"
    assert claims is not None, "only settings with errors are drawn"
    return US * times.median, max(MM * claims["ihip"]["p99"], EXACT)


def _draw_front(axes: Axes, places: Sequence[tuple[float, float]]) -> None:
    """Steps from each setting on the front to the next: what is reachable lies above and to the right."""
    if not places:
        return
    times, errors = zip(*sorted(places), strict=True)
    axes.step(times, errors, where="post", color=drawn("ink"), linewidth=1.4, zorder=1.8, label="Pareto front")


def _limit(axes: Axes, shown: Sequence[SettingEntry], kind: Kind) -> None:
    places = [_place(each, kind) for each in shown]
    times, errors = [at for at, _ in places], [error for _, error in places]
    low, high = min([*times, 8.0]), max([*times, 12.0])
    axes.set_xlim(low / 1.35, high * 1.6)
    ticks = [m * 10.0**k for k in range(-3, 6) for m in ((1, 2, 5) if high / low < 100.0 else (1,))]
    axes.set_xticks([at for at in ticks if low / 1.35 <= at <= high * 1.6])
    axes.set_xticks([], minor=True)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_ylim(min(errors) / 2.0, max([*errors, 0.2]) * 3.0)
    if min(errors) <= EXACT:
        axes.axhspan(EXACT / 2.0, EXACT * 2.0, color=drawn("grid"), alpha=0.6, zorder=0.1)
        axes.annotate(
            "exact, or below 10 nm", (0.01, EXACT * 2.0), xycoords=("axes fraction", "data"), xytext=(0, 2),
            textcoords="offset points", fontsize=7,
        )  # fmt: skip


def _draw_labels(axes: Axes, shown: Sequence[SettingEntry], kind: Kind) -> None:
    """The settings on the front, and the coarsest and finest of each line, where there is room for them."""
    ends = []
    for name in dict.fromkeys(each.renderer for each in shown):
        held = [each for each in shown if each.renderer == name]
        ends += [held[0], held[-1]]
    wanted = [each for each in shown if kind in each.front] + ends
    taken: list[tuple[float, float]] = []
    for each in wanted:
        text = each.label.removeprefix(each.renderer).strip()
        place = _place(each, kind)
        x, y = axes.transData.transform(place)
        if not text or any(abs(x - a) < 42.0 and abs(y - b) < 9.0 for a, b in taken):
            continue
        taken.append((x, y))
        axes.annotate(text, place, xytext=(5, 3), textcoords="offset points", fontsize=6.5, zorder=6)
