"""Figures for papers, at their real size and in fonts that journals take: their frame, a bench's, and a grid's."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.quantity import parse_paper_length
from hapticeval.reports.bench_figure import base_of, plotted_settings, small_multiples
from hapticeval.reports.canvas import FONT_SIZES, MM, Look, colour_of, in_style, looks_of
from hapticeval.reports.chart import draw_chart
from hapticeval.reports.grid import Grid, Tile
from hapticeval.runner.results import unknown_renderer
from hapticeval.runner.standing import Standing
from hapticeval.study.bench.document import BenchResults

if TYPE_CHECKING:
    from matplotlib.axes import Axes


INCH = 0.0254
"""Metres in an inch, in which matplotlib measures paper."""

SMALLEST_SIDE, LARGEST_SIDE = 0.03, 1.2
"""Metres of a side of a figure: axes and labels need the least, a poster the most."""

COLUMN_WIDTH, FONT_SIZE = "88mm", 8.0
"""Width, of a column of most journals, and points of all text of a figure, where none are asked for."""


class PaperFigure(Figure):
    """A figure that is saved at its real size and in TrueType fonts (Type 42), whatever matplotlib's settings are."""

    def savefig(self, fname: Any, **options: Any) -> None:
        """Save it as matplotlib does; an image has 300 dots an inch if nothing else is said."""
        with in_style({"pdf.fonttype": 42, "ps.fonttype": 42, "savefig.bbox": None}):
            super().savefig(fname, **{"dpi": 300, **options})


@contextmanager
def paper_page(
    width: str | None, height: str | None, font_size: float | None, *, natural: Callable[[float], float]
) -> Iterator[PaperFigure]:
    """Make a figure to be drawn inside the block; lengths are texts such as "88mm", or None for what is usual.

    `natural` gives the height (m) of a width (m), where none is asked for. Text is `font_size` points high. Raises
    `InputError` for a size that no figure can have, and as `parse_paper_length` does.
    """
    across = parse_paper_length(COLUMN_WIDTH if width is None else width, option="width")
    up = natural(across) if height is None else parse_paper_length(height, option="height")
    points = FONT_SIZE if font_size is None else font_size
    for name, size in (("width", across), ("height", up)):
        if not SMALLEST_SIDE <= size <= LARGEST_SIDE:
            limits = f"{MM * SMALLEST_SIDE:g} to {MM * LARGEST_SIDE:g} mm"
            raise InputError(f"a figure of {MM * size:.4g} mm {name}", why=f"a side is {limits} long")
    if not 3.0 <= points <= 40.0:
        raise InputError(f"a font of {points:g} points", why="it is 3 to 40 points high")
    with in_style(dict.fromkeys(FONT_SIZES, points)):
        margins = ConstrainedLayoutEngine(w_pad=0.02, h_pad=0.02)
        yield PaperFigure(figsize=(across / INCH, up / INCH), facecolor="white", layout=margins)


def add_legend(fig: Figure, handles: list[Any], *, below: bool = False, grows: bool = False) -> None:
    """Put the key of all that is drawn above or below the axes, in as many columns as fit.

    The figure `grows` by its height, so that the axes keep theirs.
    """
    place: Any = "outside lower left" if below else "outside upper left"
    for columns in range(len(handles), 0, -1):
        legend = fig.legend(
            handles=handles, loc=place, ncols=columns, borderaxespad=0.2, handlelength=2.2, columnspacing=1.2,
            handletextpad=0.5, borderpad=0.1, labelspacing=0.3,
        )  # fmt: skip
        box = legend.get_window_extent()
        if columns == 1 or box.width < 0.98 * fig.bbox.width:
            break
        legend.remove()
    if grows:
        fig.set_figheight(fig.get_figheight() + float(box.height / fig.dpi))


def labels_of(names: Sequence[str], labels: Mapping[str, str] | None) -> dict[str, str]:
    """Return what each renderer that is drawn is called: as `labels` has it for its name, else by its name.

    Raises `UnknownNameError` for a label of a renderer that is not drawn.
    """
    labels = labels or {}
    for name in labels:
        if name not in names:
            raise UnknownNameError("renderer of the figure", name, names)
    return {name: labels.get(name, name) for name in names}


SHADES = {
    **dict.fromkeys((Standing.ERROR, Standing.FAIL, Standing.DIFFERS, Standing.UNDECIDED), 0.66),
    **dict.fromkeys((Standing.WARNING, Standing.OUTDATED, Standing.KNOWN, Standing.INHERENT), 0.86),
}
"""Grey behind a cell, 1 is white: darker is worse, and it prints without colour. What passes has none."""


PANELS_ACROSS = 2
"""Panels of a bench beside each other, at most."""

ROW = 0.005
"""Height of a row of the grid, m."""


def paper_accuracy(
    bench: BenchResults,
    renderers: Sequence[str] = (),
    *,
    judged: Sequence[str] = (),
    labels: Mapping[str, str] | None = None,
    width: str | None = None,
    height: str | None = None,
    font_size: float | None = None,
) -> PaperFigure:
    """Draw IHIP error (mm) against the time of a step (us), a panel a renderer and model, on axes that all share.

    A filled mark's error is proven, a hollow one's is an upper bound. `renderers`: those to draw, all if none are
    named. Looks are those of a report in which the `judged` renderers come first. Raises `InputError` for a bench
    without a measured setting, `UnknownNameError` for a renderer that it has not, and as `paper_page` does.
    """
    names = list(dict.fromkeys(setting.renderer for setting in bench.settings if not setting.problem))
    for name in renderers:
        if name not in {*names, *map(base_of, names)}:
            raise UnknownNameError("renderer of the bench", name, names)
    chosen = [name for name in names if not renderers or name in renderers or base_of(name) in renderers]
    all_looks = looks_of([*judged, *(setting.renderer for setting in bench.settings)])
    looks = {name: all_looks[name] for name in chosen}
    texts = labels_of(chosen, labels)
    charts = [
        (model, chart)
        for model, settings in bench.by_model().items()
        if plotted_settings(drawn := [setting for setting in settings if setting.renderer in chosen])
        for chart in small_multiples(drawn, looks)
    ]
    if not charts:
        raise InputError("the bench has nothing to draw", why="no setting has a time and an error")
    columns = min(len(charts), PANELS_ACROSS)
    rows = -(-len(charts) // columns)
    with paper_page(width, height, font_size, natural=lambda across: 0.8 * across * rows / columns) as fig:
        panels = list(fig.subplots(rows, columns, squeeze=False).flat)
        for axes in panels[len(charts) :]:
            axes.set_axis_off()
        for axes, (model, chart) in zip(panels, charts, strict=False):
            draw_chart(axes, chart, legend=False)
            axes.set_title(f"{chart.title}, {model}", loc="left")
            # The axes are alike: their words stand at the edges alone.
            spec = axes.get_subplotspec()
            axes.set_ylabel(axes.get_ylabel() if spec.is_first_col() else "")
            axes.set_xlabel(axes.get_xlabel() if spec.is_last_row() else "")
            axes.minorticks_off()
        proven = all(setting.proven for setting in bench.settings if setting.renderer in chosen and setting.claims)
        add_legend(fig, _looks_handles(looks, texts, proven=proven), grows=height is None)
        return fig


def _looks_handles(looks: Mapping[str, Look], texts: Mapping[str, str], *, proven: bool) -> list[Any]:
    """Return the key of every mark that is drawn: a renderer by its name among `texts`."""
    handles = [
        Line2D([], [], color=colour_of(look.role), marker=look.marker, markersize=4.5, linewidth=0.7, label=texts[name])
        for name, look in looks.items()
    ]
    if not proven:
        quiet: dict[str, Any] = {"color": colour_of("quiet"), "marker": "o", "markersize": 4.5, "linestyle": "none"}
        handles.append(Line2D([], [], markerfacecolor="white", label="hollow: an upper bound", **quiet))
    return handles


def paper_grid(
    grid: Grid,
    renderers: Sequence[str] = (),
    *,
    labels: Mapping[str, str] | None = None,
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
    names = labels_of(list(rows), labels)

    # The headings stand upright: the longest takes about 0.45 of a column's width.
    with paper_page(
        width, height, font_size, natural=lambda across: min(0.45 * across + ROW * len(rows), LARGEST_SIDE)
    ) as fig:
        axes = fig.subplots()
        # Renderers down, phenomena across, a cell of 1 by 1 each.
        axes.set(xlim=(0, len(grid.columns)), ylim=(len(rows), 0))
        for row, tiles in enumerate(rows.values()):
            for column, tile in enumerate(tiles):
                if tile is not None:
                    _draw_cell(axes, column, row, tile)
        axes.set_yticks([row + 0.5 for row in range(len(rows))], list(names.values()))
        axes.set_xticks([column + 0.5 for column in range(len(grid.columns))], grid.columns, rotation=90)
        axes.xaxis.tick_top()
        axes.tick_params(length=0)
        states = {tile.standing for tiles in rows.values() for tile in tiles if tile is not None}
        signs = [
            Line2D([], [], linestyle="none", marker=f"${state.symbol}$", markersize=5, color=colour_of("ink"),
                   label=state.words)
            for state in Standing if state in states
        ]  # fmt: skip
        add_legend(fig, signs, below=True, grows=height is None)
        return fig


def _draw_cell(axes: Axes, column: int, row: int, tile: Tile) -> None:
    """Draw the sign of the gravest verdict, on its shade."""
    shade = SHADES.get(tile.standing, 1.0)
    axes.fill_between([column, column + 1], row, row + 1, color=(shade, shade, shade), linewidth=0.4, edgecolor="white")
    axes.text(column + 0.5, row + 0.5, tile.standing.symbol, ha="center", va="center_baseline")
