"""Figures for a paper of more than one run: the front of a bench, and the grid of renderers by phenomena."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.reports.bench_figure import EXACT_ERROR, PlottedSettings, plotted_settings
from hapticeval.reports.canvas import Look, colour_of, looks_of
from hapticeval.reports.grid import Grid, Tile
from hapticeval.reports.paper import LARGEST, PaperFigure, add_legend, paper_page
from hapticeval.runner.results import unknown_renderer
from hapticeval.runner.standing import Standing
from hapticeval.study.bench.document import BenchResults

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHADES = {
    **dict.fromkeys((Standing.ERROR, Standing.FAIL, Standing.DIFFERS, Standing.UNDECIDED), 0.66),
    **dict.fromkeys((Standing.WARNING, Standing.OUTDATED, Standing.KNOWN, Standing.INHERENT), 0.86),
}
"""Grey behind a cell, 1 is white: darker is worse, and it prints without colour. What passes has none."""


ROW = 0.005
"""Height of a row of the grid, m."""


def _base_of(name: str) -> str:
    """Return the renderer's name without its representation: a bench has it on every one."""
    return name.partition("@")[0]


def paper_fronts(
    bench: BenchResults,
    renderers: Sequence[str] = (),
    *,
    judged: Sequence[str] = (),
    width: str | None = None,
    height: str | None = None,
    font_size: float | None = None,
) -> PaperFigure:
    """Draw IHIP error (mm) against the time of a step (us) for each model, with the Pareto front.

    A filled mark's error is proven, a hollow one's is an upper bound. `renderers`: those to draw, all if none are
    named. Looks are those of a report in which the `judged` renderers come first. Raises `InputError` for a bench
    without a measured setting, `UnknownNameError` for a renderer that it has not, and as `paper_page` does.
    """
    names = list(dict.fromkeys(setting.renderer for setting in bench.settings if not setting.problem))
    for name in renderers:
        if name not in {*names, *map(_base_of, names)}:
            raise UnknownNameError("renderer of the bench", name, names)
    chosen = [name for name in names if not renderers or name in renderers or _base_of(name) in renderers]
    plots = {
        model: plotted
        for model, settings in bench.by_model().items()
        if (plotted := plotted_settings([setting for setting in settings if setting.renderer in chosen], "step"))
    }
    if not plots:
        raise InputError("the bench has nothing to draw", why="no setting has a time and an error")
    all_looks = looks_of([*judged, *(setting.renderer for setting in bench.settings)])
    looks = {name: all_looks[name] for name in chosen}
    with paper_page(width, height, font_size, natural=lambda across: 0.75 * across * len(plots)) as fig:
        all_axes = fig.subplots(len(plots), 1, squeeze=False)[:, 0]
        for axes, (model, plotted) in zip(all_axes, plots.items(), strict=True):
            _draw_front(axes, plotted, looks)
            axes.set_title(model, loc="left")
            axes.set_ylabel("largest IHIP error (mm)")
        all_axes[-1].set_xlabel("time of a step, median (µs)")
        legend_height = add_legend(fig, _front_handles(plots.values(), looks))
        if height is None:
            fig.set_figheight(fig.get_figheight() + legend_height)
        return fig


def _draw_front(axes: Axes, plotted: PlottedSettings, looks: Mapping[str, Look]) -> None:
    """Draw the settings of one model, a curve a renderer, and the steps of the front of each reference among them."""
    axes.set(xscale="log", yscale="log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.minorticks_off()
    axes.grid(True, which="major")
    if min(error for _, (_, error) in plotted) <= EXACT_ERROR:
        axes.annotate("exact, or below 10 nm", (0.02, EXACT_ERROR), xycoords=("axes fraction", "data"), xytext=(0, 3),
                      textcoords="offset points")  # fmt: skip
    # The fronts of what is drawn: errors that count from different references cannot be compared.
    for reference in dict.fromkeys(setting.reference for setting, _ in plotted):
        front: list[tuple[float, float]] = []
        for time, error in sorted(place for setting, place in plotted if setting.reference == reference):
            # each setting that is more accurate than all quicker ones
            if not front or error < front[-1][1]:
                front.append((time, error))
        axes.step(*zip(*front, strict=True), where="post", color=colour_of("ink"), linewidth=1.2, zorder=1.8)
    for name in dict.fromkeys(setting.renderer for setting, _ in plotted):
        look = looks[name]
        colour = colour_of(look.role)
        of_renderer = [(setting, place) for setting, place in plotted if setting.renderer == name]
        axes.plot(*zip(*(place for _, place in of_renderer), strict=True), color=colour, linewidth=0.7, alpha=0.6)
        for setting, place in of_renderer:
            fill = colour if setting.proven else "white"
            axes.plot(*place, marker=look.marker, markersize=4.5, color=colour, markerfacecolor=fill, linestyle="none")


def _front_handles(plots: Iterable[PlottedSettings], looks: Mapping[str, Look]) -> list[Any]:
    """Return the key of every mark that is drawn."""
    handles = [
        Line2D([], [], color=colour_of(look.role), marker=look.marker, markersize=4.5, linewidth=0.7, label=name)
        for name, look in looks.items()
    ]
    handles.append(Line2D([], [], color=colour_of("ink"), linewidth=1.2, label="Pareto front"))
    if any(not setting.proven for plotted in plots for setting, _ in plotted):
        quiet: dict[str, Any] = {"color": colour_of("quiet"), "marker": "o", "markersize": 4.5, "linestyle": "none"}
        handles.append(Line2D([], [], markerfacecolor="white", label="hollow: an upper bound", **quiet))
    return handles


def paper_grid(
    grid: Grid,
    renderers: Sequence[str] = (),
    *,
    width: str | None = None,
    height: str | None = None,
    font_size: float | None = None,
) -> PaperFigure:
    """Draw a grid of renderers by phenomena: a cell has the sign and the shade of its gravest verdict.

    `renderers`: the rows, all if none are named. Raises `UnknownNameError` for one that the grid has not, `InputError`
    for an empty one, and as `paper_page` does.
    """
    rows = {name: tiles for name, tiles in grid.rows if not renderers or name in renderers}
    for name in renderers:
        if name not in rows:
            raise unknown_renderer(name, [row for row, _ in grid.rows])
    if not rows or not grid.columns:
        raise InputError("there is no grid to draw", why="no verdict was given")

    # The headings stand upright: the longest takes about 0.45 of a column's width.
    def natural_height(across: float) -> float:
        return min(0.45 * across + ROW * len(rows), LARGEST)

    with paper_page(width, height, font_size, natural=natural_height) as fig:
        axes = fig.subplots()
        # Renderers down, phenomena across, a cell of 1 by 1 each.
        axes.set(xlim=(0, len(grid.columns)), ylim=(len(rows), 0))
        for row, tiles in enumerate(rows.values()):
            for column, tile in enumerate(tiles):
                if tile is not None:
                    _draw_cell(axes, column, row, tile)
        axes.set_yticks([row + 0.5 for row in range(len(rows))], list(rows))
        axes.set_xticks([column + 0.5 for column in range(len(grid.columns))], grid.columns, rotation=90)
        axes.xaxis.tick_top()
        axes.tick_params(length=0)
        states = {tile.standing for tiles in rows.values() for tile in tiles if tile is not None}
        signs = [
            Line2D([], [], linestyle="none", marker=f"${state.symbol}$", markersize=5, color=colour_of("ink"),
                   label=state.words)
            for state in Standing if state in states
        ]  # fmt: skip
        legend_height = add_legend(fig, signs, below=True)
        if height is None:
            fig.set_figheight(fig.get_figheight() + legend_height)
        return fig


def _draw_cell(axes: Axes, column: int, row: int, tile: Tile) -> None:
    """Draw the sign of the gravest verdict, on its shade."""
    shade = SHADES.get(tile.standing, 1.0)
    axes.fill_between([column, column + 1], row, row + 1, color=(shade, shade, shade), linewidth=0.4, edgecolor="white")
    axes.text(column + 0.5, row + 0.5, tile.standing.symbol, ha="center", va="center_baseline")
