"""Figures for papers, at their real size and in fonts that journals take: of one case, of a bench, and of a grid.

One of several renderers on a case shows the model, the HIP's path and the IHIP's path of each renderer in the plane.
Below it is the force's size against time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.model import Model
from hapticeval.phenomena.verdict import Outcome
from hapticeval.quantity import parse_paper_length
from hapticeval.recordings.recording import Recording
from hapticeval.reports.bench_figure import EXACT_ERROR, PlottedSettings, plotted_settings
from hapticeval.reports.canvas import FONT_SIZES, MM, Look, colour_of, draw_over_time, in_style, looks_of
from hapticeval.reports.grid import Grid, Tile
from hapticeval.reports.plane import aspect_of, box_round, draw_geometry, model_shadow, name_axes, samples_along_path
from hapticeval.reports.run_figure import include_zero
from hapticeval.runner.results import VerdictEntry, unknown_renderer
from hapticeval.runner.standing import Standing
from hapticeval.study.bench.document import BenchResults
from hapticeval.types import Array

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


TALLEST = 0.12
"""Metres of height that the axes of a figure have at most where no height is asked for."""

PRINT_DETAIL = 20_000.0
"""Width of the view over what is left out of the model's outline: not to be seen in print."""

HIP_DASHES = (0, (3.0, 1.5))
"""Line style of the HIP's path: the offset, and the lengths of line and gap in line widths."""

RING = 9.0
"""Points across the ring where a verdict points."""

MARKS_OF_CURVE = 9
"""About so many markers stand on a curve, those of different renderers at different places."""


def labels_of(names: Sequence[str], labels: Mapping[str, str] | None) -> dict[str, str]:
    """Return what each renderer that is drawn is called: as `labels` has it for its name, else by its name.

    Raises `UnknownNameError` for a label of a renderer that is not drawn.
    """
    labels = labels or {}
    for name in labels:
        if name not in names:
            raise UnknownNameError("renderer of the figure", name, names)
    return {name: labels.get(name, name) for name in names}


@dataclass(frozen=True)
class PaperRun:
    """What a renderer did on the case, and, if a check's verdict is to be shown, that."""

    renderer: str
    recording: Recording
    verdict: VerdictEntry | None = None

    @property
    def tick(self) -> int | None:
        """The sample that the verdict's evidence names by time or HIP; None where it names none, or passes."""
        if self.verdict is None or self.verdict.outcome is Outcome.PASS:
            return None
        evidence: Mapping[str, Any] = self.verdict.evidence
        time, hip = evidence.get("time"), evidence.get("hip")
        if isinstance(time, int | float):
            return int(np.argmin(np.abs(self.recording.time - time)))
        if isinstance(hip, Sequence) and len(hip) == self.recording.dimension:
            return int(np.argmin(np.linalg.norm(self.recording.hip - np.array(hip), axis=1)))
        return None


def paper_figure(
    runs: Sequence[PaperRun],
    model: Model | None,
    *,
    looks: Mapping[str, Look] | None = None,
    labels: Mapping[str, str] | None = None,
    width: str | None = None,
    height: str | None = None,
    font_size: float | None = None,
) -> PaperFigure:
    """Draw the runs of one case over each other; see `paper_page` for sizes and `labels_of` for `labels`.

    `looks` are those that the renderers have on the pages of a report; if not given, those of a report of these runs.
    Runs in space are drawn in their `clearest_coordinates`. A ring and a line in time stand where the verdict of a run
    that does not pass points. Raises as `paper_page` does.
    """
    names = labels_of([run.renderer for run in runs], labels)
    with paper_page(width, height, font_size, natural=lambda across: min(across, max(TALLEST, 0.6 * across))) as fig:
        plane, force = fig.subplots(2, 1, height_ratios=(2.6, 1.0))
        looks = looks or looks_of(run.renderer for run in runs)
        _draw_forces(force, runs, looks)
        coordinates = clearest_coordinates([run.recording for run in runs])
        low, high = _draw_paths(plane, runs, coordinates, looks)
        add_legend(fig, _legend_handles(runs, looks, names), grows=height is None)
        fig.align_ylabels()
        # How wide the numbers at the axes are depends on what is in view, and that on the room which they leave.
        for _ in range(2):
            fig.draw_without_rendering()
            view = box_round(0.5 * (low + high), 1.15 * (high - low), aspect_of(plane))
            plane.set(xlim=view[::2], ylim=view[1::2])
        fig.set_layout_engine("none")
        if model is not None:
            draw_geometry(plane, model_shadow(model, coordinates, view, detail=PRINT_DETAIL), view)
        return fig


def _curve_style(look: Look, number: int, count: int) -> dict[str, Any]:
    """Return how the curves of a renderer look: earlier ones are wider, so that all are seen where they coincide."""
    return {
        "dashes": look.dash or (None, None),
        "marker": look.marker,
        "markersize": 3.6,
        "markeredgewidth": 0.4,
        "markeredgecolor": "white",
        "linewidth": 1.0 + 0.9 * (count - 1 - number) / max(count - 1, 1),
        "zorder": 3.0 + 0.1 * number,
    }


def clearest_coordinates(recordings: Sequence[Recording]) -> tuple[int, int]:
    """Return the two coordinates in whose plane HIPs and IHIPs spread over the largest area, so never edge-on.

    They spread there at least 1/sqrt(3) as far across the path as in the principal plane: the area of a parallelogram
    in space, squared, is the sum of those of its three shadows, squared.
    """
    points = np.vstack([part for recording in recordings for part in (recording.hip, recording.ihip)])
    centred = points - points.mean(axis=0)
    # By area, in m^2 times the number of points: the product of the two singular values.
    spreads = {
        pair: float(np.prod(np.linalg.svd(centred[:, list(pair)], compute_uv=False)))
        for pair in combinations(range(points.shape[1]), 2)
    }
    return max(spreads, key=lambda pair: spreads[pair])


def _draw_paths(
    axes: Axes, runs: Sequence[PaperRun], coordinates: tuple[int, int], looks: Mapping[str, Look]
) -> tuple[Array, Array]:
    """Draw the paths of HIP and IHIPs, a ring round the IHIP that a verdict points at, and the line to its HIP.

    Return the least and the greatest coordinates of all, (2,) each, mm.
    """
    name_axes(axes, coordinates, runs[0].recording.dimension)
    same = _have_one_path(runs)
    points = []
    for number, run in enumerate(runs):
        hip, ihip = (MM * part[:, list(coordinates)] for part in (run.recording.hip, run.recording.ihip))
        points += [hip, ihip]
        if not same or run is max(runs, key=lambda run: len(run.recording)):
            colour = colour_of("quiet" if same else looks[run.renderer].role)
            axes.plot(*hip.T, color=colour, linewidth=0.9, linestyle=HIP_DASHES, zorder=2.5)
        # NaN where nothing touches: the IHIP is the HIP there.
        touching = np.where(run.recording.contact[:, np.newaxis], ihip, np.nan)
        even = samples_along_path(run.recording, MARKS_OF_CURVE * len(runs))[number :: len(runs)]
        look = looks[run.renderer]
        style = _curve_style(look, number, len(runs))
        axes.plot(*touching.T, color=colour_of(look.role), markevery=even.tolist(), **style)
        if run.tick is not None:
            axes.plot(*np.stack([hip[run.tick], ihip[run.tick]]).T, color=colour_of("ink"), linewidth=0.6, zorder=4.5)
            # Rings at one place lie within each other.
            axes.plot(*ihip[run.tick], **_ring(look.role, size=RING + 2.0 * (len(runs) - 1 - number)))
    return np.nanmin(np.vstack(points), axis=0), np.nanmax(np.vstack(points), axis=0)


def _have_one_path(runs: Sequence[PaperRun]) -> bool:
    """Return whether all were led along the same HIPs, some not to the end; in a closed loop each has its own."""
    longest = max((run.recording.hip for run in runs), key=len)
    return all(np.array_equal(run.recording.hip, longest[: len(run.recording)]) for run in runs)


def _ring(role: str, *, size: float = RING) -> dict[str, Any]:
    """Return the style of the ring where a verdict points: the renderer's colour."""
    look: dict[str, Any] = {"marker": "o", "markersize": size, "markerfacecolor": "none", "linestyle": "none"}
    return {**look, "markeredgewidth": 1.3, "color": colour_of(role), "zorder": 5}


def _draw_forces(axes: Axes, runs: Sequence[PaperRun], looks: Mapping[str, Look]) -> None:
    """Draw the size of each force (N) against time (s), with a line at the time that a verdict points at."""
    sizes: list[Array] = []
    for number, run in enumerate(runs):
        sizes.append(np.linalg.norm(run.recording.force, axis=1))
        every = max(len(run.recording) // MARKS_OF_CURVE, 1)
        # Markers of different renderers stand side by side.
        markevery = (every * number // len(runs), every)
        look = looks[run.renderer]
        style = _curve_style(look, number, len(runs))
        draw_over_time(axes, run.recording, sizes[-1], look.role, markevery=markevery, **style)
        if run.tick is not None:
            # The dashes of one fall into the gaps of the others, should all lie at one time.
            axes.axvline(
                float(run.recording.time[run.tick]), color=colour_of(look.role), linewidth=0.9, zorder=1.5,
                linestyle=(3.0 * number, (3.0, max(3.0 * (len(runs) - 1), 2.0))),
            )  # fmt: skip
    start = min(float(run.recording.time[0]) for run in runs)
    end = max(float(run.recording.time[-1]) for run in runs)
    # A recording of one sample still needs an axis of some width.
    axes.set(xlabel="time (s)", ylabel="force (N)", xlim=(start, end if end > start else start + 1e-3))
    axes.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    include_zero(axes, *sizes)


def _legend_handles(runs: Sequence[PaperRun], looks: Mapping[str, Look], names: Mapping[str, str]) -> list[Any]:
    """Return the key of all that is drawn: a renderer by its name among `names`, with the outcome of its verdict."""
    words = "HIP" if _have_one_path(runs) else "HIP of each renderer"
    handles = [Line2D([], [], color=colour_of("quiet"), linewidth=0.9, linestyle=HIP_DASHES, label=words)]
    for number, run in enumerate(runs):
        look = looks[run.renderer]
        style = _curve_style(look, number, len(runs))
        outcome = "" if run.verdict is None else f" ({run.verdict.outcome})"
        label = f"IHIP, {names[run.renderer]}{outcome}"
        handles.append(Line2D([], [], color=colour_of(look.role), label=label, **style))
    marked = [run.verdict for run in runs if run.verdict is not None and run.tick is not None]
    if marked:
        fails = all(verdict.outcome is Outcome.FAIL for verdict in marked)
        words = f"where {marked[0].check} {'fails' if fails else 'does not pass'}"
        handles.append(Line2D([], [], label=words, **_ring("ink")))
    return handles


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
    labels: Mapping[str, str] | None = None,
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
    texts = labels_of(chosen, labels)
    with paper_page(width, height, font_size, natural=lambda across: 0.75 * across * len(plots)) as fig:
        all_axes = fig.subplots(len(plots), 1, squeeze=False)[:, 0]
        for axes, (model, plotted) in zip(all_axes, plots.items(), strict=True):
            _draw_front(axes, plotted, looks)
            axes.set_title(model, loc="left")
            axes.set_ylabel("largest IHIP error (mm)")
        all_axes[-1].set_xlabel("time of a step, median (µs)")
        add_legend(fig, _front_handles(plots.values(), looks, texts), grows=height is None)
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


def _front_handles(plots: Iterable[PlottedSettings], looks: Mapping[str, Look], texts: Mapping[str, str]) -> list[Any]:
    """Return the key of every mark that is drawn: a renderer by its name among `texts`."""
    handles = [
        Line2D([], [], color=colour_of(look.role), marker=look.marker, markersize=4.5, linewidth=0.7, label=texts[name])
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
