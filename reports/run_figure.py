"""The figure of runs in a file: the model, the paths of hand and tools on it, and the force against time.

Several runs of a case lie over each other. A run that is alone also has the force's components, the lines from hand to
tool, and how far these move in a tick (playback) or how deep the hand is (experiment).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D

from hapticeval.geometry.model import Model
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import continuing_steps
from hapticeval.reports.canvas import LINE_DASHES, MM, Look, colour_of, looks_of
from hapticeval.reports.paper import INCH, PaperFigure, add_legend, labels_of, paper_page
from hapticeval.reports.plane import (
    Box,
    aspect_of,
    box_round,
    draw_geometry,
    filled_part,
    labels,
    model_shadow,
    name_axes,
)
from hapticeval.runner.results import VerdictEntry
from hapticeval.types import Array, IntArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from shapely import Geometry

TALLEST = 0.12
"""Metres of height that the axes of a figure have at most where no height is asked for."""

WIDE = 0.15
"""Metres of width from which on the plots of a run that is alone stand beside the model, not below."""

SCREEN_WIDTH = "180mm"
"""Width of a figure that is drawn to be looked at."""

PRINT_DETAIL = 20_000.0
"""Width of the view over what is left out of the model's outline: not to be seen in print."""

HIP_DASHES = (0, (3.0, 1.5))
"""Line style of the HIP's path: the offset, and the lengths of line and gap in line widths."""

RING = 9.0
"""Points across the ring where a verdict points."""

MARKS_OF_CURVE = 9
"""About so many markers stand on a curve, those of different renderers at different places."""

RAYS = 60
"""About so many lines from hand to tool are drawn."""

OVERVIEW_BELOW = 0.35
"""Share of the model in view below which a small picture of the whole is added."""

LENS_BELOW = 0.025
"""Depth as a share of the view below which hand and tool cannot be told apart without a lens."""

INSET_SIDE = 0.31
"""Side of a small picture, as a share of the axes."""


@dataclass(frozen=True)
class Mark:
    """A place to which a verdict points, by its time (s): with a `number` where there are several; 0 for none."""

    time: float
    number: int = 0


def marks_of(verdicts: Sequence[VerdictEntry], recording: Recording) -> list[Mark]:
    """Return the marks of one run's verdicts that do not pass, and whose evidence names a time or a HIP."""
    times = [time for verdict in verdicts if (time := _time_of(verdict, recording)) is not None]
    return [Mark(time, number if len(times) > 1 else 0) for number, time in enumerate(times, start=1)]


def _time_of(verdict: VerdictEntry, recording: Recording) -> float | None:
    """Return the time (s) that a verdict's evidence names itself or by a HIP; None where it names none, or passes."""
    if verdict.outcome is Outcome.PASS:
        return None
    hip = verdict.evidence.get("hip")
    if verdict.time is None and isinstance(hip, Sequence) and len(hip) == recording.dimension:
        # The sample whose HIP is nearest.
        return float(recording.time[int(np.argmin(np.linalg.norm(recording.hip - np.array(hip), axis=1)))])
    return verdict.time


@dataclass(frozen=True)
class DrawnRun:
    """What a renderer did on the case, the places to mark, and the outcome that the legend has beside its name."""

    renderer: str
    recording: Recording
    marks: Sequence[Mark] = ()
    outcome: str = ""

    def tick(self, mark: Mark) -> int:
        """Return the sample nearest to the mark's time."""
        return int(np.argmin(np.abs(self.recording.time - mark.time)))


def run_figure(
    runs: Sequence[DrawnRun],
    model: Model | None,
    *,
    looks: Mapping[str, Look] | None = None,
    labels: Mapping[str, str] | None = None,
    title: str = "",
    mark_words: str = "",
    width: str | None = None,
    height: str | None = None,
    font_size: float | None = None,
) -> PaperFigure:
    """Draw the runs of one case over each other; see `paper_page` for sizes and `labels_of` for `labels`.

    `looks` are those that the renderers have on the pages of a report; if not given, those of a report of these runs.
    Runs in space are drawn in their `clearest_coordinates`. A ring and a line in time stand at each mark, which the
    legend explains by `mark_words`. Raises as `paper_page` and `labels_of` do.
    """
    names = labels_of([run.renderer for run in runs], labels)
    looks = looks or looks_of(run.renderer for run in runs)
    with paper_page(width, height, font_size, natural=lambda across: _natural_height(across, len(runs))) as fig:
        plane, *plots = _add_axes(fig, len(runs))
        _draw_forces(plots[0], runs, looks)
        if len(runs) == 1:
            _draw_motion(plots[1], runs[0].recording, looks[runs[0].renderer])
        _set_times(plots, runs, looks)
        coordinates = clearest_coordinates([run.recording for run in runs])
        low, high = _draw_paths(plane, runs, coordinates, looks)
        if title:
            # Letters are about half as wide as high.
            line_length = int(72.0 * fig.get_figwidth() / (0.55 * float(plane.xaxis.label.get_fontsize())))
            fig.suptitle(fill(title, line_length), fontsize="medium")
        add_legend(fig, _legend_handles(runs, looks, names, mark_words), grows=height is None)
        fig.align_ylabels()
        # How wide the numbers at the axes are depends on what is in view, and that on the room which they leave.
        for _ in range(2):
            fig.draw_without_rendering()
            view = box_round(0.5 * (low + high), 1.15 * (high - low), aspect_of(plane))
            plane.set(xlim=view[::2], ylim=view[1::2])
        fig.set_layout_engine("none")
        body = None if model is None else model_shadow(model, coordinates, view, detail=PRINT_DETAIL)
        if body is not None:
            draw_geometry(plane, body, view)
        _number_marks(plane, runs, coordinates, view)
        _add_insets(plane, runs, coordinates, looks, model, body, view)
        return fig


def _natural_height(across: float, count: int) -> float:
    """Return the height (m) of a figure of `count` runs that is `across` (m) wide, where none is asked for."""
    if count == 1:
        return 0.5 * across if across >= WIDE else min(1.3 * across, max(1.2 * TALLEST, 0.6 * across))
    return min(across, max(TALLEST, 0.6 * across))


def _add_axes(fig: PaperFigure, count: int) -> list[Axes]:
    """Add the axes of the plane, of the force, and of a run that is alone of its motion."""
    if count > 1:
        return list(fig.subplots(2, 1, height_ratios=(2.6, 1.0)))
    if fig.get_figwidth() * INCH >= WIDE:
        mosaic = fig.subplot_mosaic([["plane", "force"], ["plane", "motion"]])
        return [mosaic[name] for name in ("plane", "force", "motion")]
    return list(fig.subplots(3, 1, height_ratios=(2.6, 1.0, 0.8)))


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


def _gap_rows(recording: Recording) -> IntArray:
    """Return the rows that begin after a gap: no line may lead there, it would show what nobody measured."""
    return (np.flatnonzero(~continuing_steps(recording)) + 1 if len(recording) > 1 else np.zeros(0)).astype(np.int64)


def _curve_style(look: Look, number: int, count: int) -> dict[str, Any]:
    """Return how the curves of a renderer look: earlier ones are wider, so that all are seen where they coincide."""
    return {
        "color": colour_of(look.role),
        "dashes": look.dash or (None, None),
        "marker": look.marker,
        "markersize": 3.6,
        "markeredgewidth": 0.4,
        "markeredgecolor": "white",
        "linewidth": 1.0 + 0.9 * (count - 1 - number) / max(count - 1, 1),
        "zorder": 3.0 + 0.1 * number,
    }


# The plane.


def _draw_paths(
    axes: Axes, runs: Sequence[DrawnRun], coordinates: tuple[int, int], looks: Mapping[str, Look]
) -> tuple[Array, Array]:
    """Draw the paths of HIP and IHIPs, and a ring with the line from HIP to IHIP at each mark.

    Return the least and the greatest coordinates of all, (2,) each, mm.
    """
    name_axes(axes, coordinates, runs[0].recording.dimension)
    same = _have_one_path(runs)
    points = []
    for number, run in enumerate(runs):
        hip, ihip = (MM * part[:, list(coordinates)] for part in (run.recording.hip, run.recording.ihip))
        points += [hip, ihip]
        gaps, look = _gap_rows(run.recording), looks[run.renderer]
        if not same or run is max(runs, key=lambda run: len(run.recording)):
            colour = colour_of("quiet" if same else look.role)
            path = np.insert(hip, gaps, np.nan, axis=0)
            axes.plot(*path.T, color=colour, linewidth=0.9, linestyle=HIP_DASHES, zorder=2.5)
        if len(runs) == 1:
            _draw_rays(axes, run.recording, hip, ihip, _rows_along_path(run.recording, RAYS))
        # NaN where nothing touches: the IHIP is the HIP there.
        touching = np.insert(np.where(run.recording.contact[:, np.newaxis], ihip, np.nan), gaps, np.nan, axis=0)
        rows = _rows_along_path(run.recording, MARKS_OF_CURVE * len(runs))[number :: len(runs)]
        markers = (rows + np.searchsorted(gaps, rows, side="right")).tolist()
        axes.plot(*touching.T, markevery=markers, **_curve_style(look, number, len(runs)))
        for tick in map(run.tick, run.marks):
            axes.plot(*np.stack([hip[tick], ihip[tick]]).T, color=colour_of("ink"), linewidth=0.6, zorder=4.5)
            # Rings at one place lie within each other.
            axes.plot(*ihip[tick], **_ring(look.role, size=RING + 2.0 * (len(runs) - 1 - number)))
    return np.nanmin(np.vstack(points), axis=0), np.nanmax(np.vstack(points), axis=0)


def _have_one_path(runs: Sequence[DrawnRun]) -> bool:
    """Return whether all were led along the same HIPs, some not to the end; in a closed loop each has its own."""
    longest = max((run.recording.hip for run in runs), key=len)
    return all(np.array_equal(run.recording.hip, longest[: len(run.recording)]) for run in runs)


def _draw_rays(axes: Axes, recording: Recording, hip: Array, ihip: Array, rows: IntArray) -> None:
    """Draw the lines from hand to tool, (n, 2) in mm, at the rows that are in contact."""
    rows = rows[recording.contact[rows]]
    # NaN between the lines.
    rays = np.stack([hip[rows], ihip[rows], np.full_like(hip[rows], np.nan)], axis=1).reshape(-1, 2)
    axes.plot(*rays.T, color=colour_of("ray"), linewidth=0.6, zorder=2)


def _rows_along_path(recording: Recording, count: int) -> IntArray:
    """Return about `count` rows, evenly spaced by how far HIP and IHIP travel together."""
    points = np.hstack([recording.hip, recording.ihip])
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    even = np.searchsorted(travelled, np.linspace(0.0, travelled[-1], count))
    return np.unique(np.clip(np.append(even, [0, len(recording) - 1]), 0, len(recording) - 1)).astype(np.int64)


def _ring(role: str, *, size: float = RING) -> dict[str, Any]:
    """Return the style of the ring where a verdict points: the renderer's colour."""
    look: dict[str, Any] = {"marker": "o", "markersize": size, "markerfacecolor": "none", "linestyle": "none"}
    return {**look, "markeredgewidth": 1.3, "color": colour_of(role), "zorder": 5}


def _number_marks(axes: Axes, runs: Sequence[DrawnRun], coordinates: tuple[int, int], view: Box) -> None:
    """Write the numbers of marks beside their rings."""
    numbered = [(mark.number, run.tick(mark), run.recording) for run in runs for mark in run.marks if mark.number]
    places = [MM * recording.ihip[tick, list(coordinates)] for _, tick, recording in numbered]
    for place, text in labels([number for number, *_ in numbered], places, 0.05 * (view[2] - view[0])):
        axes.annotate(text, tuple(place), xytext=(5.5, 3.5), textcoords="offset points", zorder=6)


# Small pictures in the corners.


def _add_insets(
    axes: Axes,
    runs: Sequence[DrawnRun],
    coordinates: tuple[int, int],
    looks: Mapping[str, Look],
    model: Model | None,
    body: Geometry | None,
    view: Box,
) -> None:
    """Add the whole model where little of it is in view, and a lens where hand and tool cannot be told apart."""
    corners = _emptiest_corners(runs, coordinates, view)
    is_outline = model is not None and model.dimension == 2 and model.boundary.closed
    if model is not None and is_outline and view[2] - view[0] < OVERVIEW_BELOW * MM * model.size:
        _draw_overview(axes, corners.pop(0), model, view)
    deepest = max(runs, key=lambda run: float(_depths(run.recording).max()))
    depths = _depths(deepest.recording)
    # A mark deep enough to be seen, else the deepest sample.
    ticks = [tick for tick in map(deepest.tick, deepest.marks) if depths[tick] > 0.3 * depths.max()]
    tick = ticks[0] if ticks else int(np.argmax(depths))
    if 0.0 < depths.max() < LENS_BELOW * (view[2] - view[0]):
        _draw_lens(axes, corners.pop(0), deepest, looks[deepest.renderer], coordinates, body, tick)


def _depths(recording: Recording) -> Array:
    """Return the distances between HIP and IHIP (n,), mm."""
    return np.asarray(MM * np.linalg.norm(recording.ihip - recording.hip, axis=1))


Corner = tuple[float, float]
"""The lower left corner of an inset, as shares of the axes."""


def _emptiest_corners(runs: Sequence[DrawnRun], coordinates: tuple[int, int], view: Box) -> list[Corner]:
    """Return places for insets, as shares of the axes, those that hide the fewest points first."""
    columns = list(coordinates)
    points = MM * np.vstack([part[:, columns] for run in runs for part in (run.recording.hip, run.recording.ihip)])
    # From mm to shares of the axes, in which insets are placed.
    share = (points - view[:2]) / (np.array(view[2:]) - view[:2])
    high = 0.985 - INSET_SIDE
    places = [(high, high), (0.015, high), (high, 0.015), (0.015, 0.015)]
    return sorted(
        places, key=lambda place: int(np.sum(np.all((share > place) & (share < np.add(place, INSET_SIDE)), axis=1)))
    )


def _add_inset(axes: Axes, corner: Corner) -> Axes:
    """Add a small picture at a corner of the axes."""
    inset = axes.inset_axes((*corner, INSET_SIDE, INSET_SIDE))
    inset.set(facecolor=colour_of("paper"), xticks=[], yticks=[])
    inset.spines[["top", "right"]].set_visible(True)
    return inset


def _draw_overview(axes: Axes, corner: Corner, model: Model, view: Box) -> None:
    """Draw the whole model, with a rectangle round what the large picture shows of it."""
    from matplotlib.patches import Rectangle

    inset = _add_inset(axes, corner)
    bounds = MM * np.array(model.boundary.bounds)
    model_box = box_round(0.5 * (bounds[:2] + bounds[2:]), 1.15 * (bounds[2:] - bounds[:2]), aspect_of(axes))
    draw_geometry(inset, filled_part(model, model_box), model_box, linewidth=0.8)
    width, height = view[2] - view[0], view[3] - view[1]
    inset.add_patch(Rectangle(view[:2], width, height, fill=False, edgecolor=colour_of("ihip"), zorder=3))


def _draw_lens(
    axes: Axes,
    corner: Corner,
    run: DrawnRun,
    look: Look,
    coordinates: tuple[int, int],
    body: Geometry | None,
    tick: int,
) -> None:
    """Draw the neighbourhood of one sample, enlarged until its depth can be seen."""
    inset = _add_inset(axes, corner)
    hip, ihip = (MM * part[:, list(coordinates)] for part in (run.recording.hip, run.recording.ihip))
    box = box_round(0.5 * (hip[tick] + ihip[tick]), np.full(2, 3.2 * _depths(run.recording).max()), aspect_of(axes))
    draw_geometry(inset, body, box)
    # Up to 7 samples in the lens, evenly spaced.
    inside = np.flatnonzero(np.all((hip > box[:2]) & (hip < box[2:]), axis=1))
    rows = inside[np.linspace(0, inside.size - 1, min(7, inside.size)).astype(int)].astype(np.int64)
    _draw_rays(inset, run.recording, hip, ihip, rows)
    dots: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4.0}
    inset.plot(*hip[rows].T, **dots, markerfacecolor="none", color=colour_of("quiet"), zorder=3)
    inset.plot(*ihip[rows[run.recording.contact[rows]]].T, **dots, color=colour_of(look.role), zorder=4)
    # How many times larger than in the picture, by widths in mm.
    times = np.ptp(axes.get_xlim()) * INSET_SIDE / (box[2] - box[0])
    paper = {"facecolor": colour_of("paper"), "edgecolor": "none", "pad": 1.0}
    text = f"× {float(f'{times:.2g}'):g}"  # noqa: RUF001
    inset.text(0.05, 0.95, text, va="top", transform=inset.transAxes, zorder=6, bbox=paper)
    axes.indicate_inset(
        (box[0], box[1], box[2] - box[0], box[3] - box[1]), inset, edgecolor=colour_of("quiet"), alpha=1.0
    )


# Against time.


def _draw_over_time(axes: Axes, recording: Recording, values: Array, **style: Any) -> None:
    """Draw a channel (n,) in the unit of the axis against time in s, without a line over a gap."""
    gaps = _gap_rows(recording)
    time, values = (np.insert(column, gaps, np.nan) for column in (recording.time, values))
    axes.plot(time, values, **style)


def _draw_forces(axes: Axes, runs: Sequence[DrawnRun], looks: Mapping[str, Look]) -> None:
    """Draw the size of each force (N) against time (s), of a run that is alone also its components."""
    columns: list[Array] = []
    for number, run in enumerate(runs):
        columns.append(np.linalg.norm(run.recording.force, axis=1))
        every = max(len(run.recording) // MARKS_OF_CURVE, 1)
        # Markers of different renderers stand side by side.
        markevery = (every * number // len(runs), every)
        style = {**_curve_style(looks[run.renderer], number, len(runs)), "label": "|F|"}
        _draw_over_time(axes, run.recording, columns[-1], markevery=markevery, **style)
    if len(runs) == 1:
        for k, column in enumerate(runs[0].recording.force.T):
            style = {"color": colour_of(("one", "two", "three")[k]), "dashes": LINE_DASHES[k + 1], "linewidth": 0.9}
            _draw_over_time(axes, runs[0].recording, column, label=f"F{'₁₂₃'[k]}", **style)
            columns.append(column)
        _add_key(axes)
    axes.set(ylabel="force (N)")
    _include_zero(axes, *columns)


def _draw_motion(axes: Axes, recording: Recording, look: Look) -> None:
    """Draw the steps of both points, where an IHIP that jumps and a HIP that does not are pop-through; or the depth."""
    tool, hand = {"color": colour_of(look.role)}, {"color": colour_of("quiet"), "linestyle": HIP_DASHES}
    # On a given path the hand's steps do not depend on the renderer.
    if recording.meta.get("source") in ("playback", "replay") and len(recording) > 2:
        ihip, hip = (_step_lengths(recording, points) for points in (recording.ihip, recording.hip))
        _draw_over_time(axes, recording, ihip, label="IHIP", **tool)
        _draw_over_time(axes, recording, hip, label="HIP", **hand)
        axes.set(ylabel="step a tick (mm)")
        _include_zero(axes, ihip, hip)
        _add_key(axes)
        return
    _draw_over_time(axes, recording, _depths(recording), **tool)
    axes.set(ylabel="depth (mm)")
    _include_zero(axes, _depths(recording))


def _step_lengths(recording: Recording, points: Array) -> Array:
    """Return how far (mm) the points (n, N) move in the tick before each sample; NaN where there is none before it."""
    steps = MM * np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.append(np.nan, np.where(continuing_steps(recording), steps, np.nan))


def _set_times(plots: Sequence[Axes], runs: Sequence[DrawnRun], looks: Mapping[str, Look]) -> None:
    """Give all plots one axis of time, and lines at the times of marks."""
    start = min(float(run.recording.time[0]) for run in runs)
    end = max(float(run.recording.time[-1]) for run in runs)
    for axes in plots:
        for number, run in enumerate(runs):
            # The dashes of one fall into the gaps of the others, should all lie at one time.
            dashes = (3.0 * number, (3.0, max(3.0 * (len(runs) - 1), 2.0)))
            for mark in run.marks:
                at = float(run.recording.time[run.tick(mark)])
                axes.axvline(at, color=colour_of(looks[run.renderer].role), linewidth=0.9, linestyle=dashes, zorder=1.5)
        # A recording of one sample still needs an axis of some width.
        axes.set(xlim=(start, end if end > start else start + 1e-3))
        axes.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        axes.tick_params(labelbottom=axes is plots[-1])
    plots[-1].set(xlabel="time (s)")


def _add_key(axes: Axes) -> None:
    """Put one row of labels above the right end of the axes."""
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=4, borderaxespad=0.0, handlelength=2.0, columnspacing=1.2,
        handletextpad=0.5,
    )  # fmt: skip


def _include_zero(axes: Axes, *columns: Array) -> None:
    """Keep zero in sight, and never blow up rounding errors to the height of the axis."""
    # The last zero serves the case of no columns.
    low = min(0.0, *(float(np.nanmin(column)) for column in columns), 0.0)
    high = max(0.0, *(float(np.nanmax(column)) for column in columns), 0.0)
    if high - low < 1e-6:
        high = 1.0
    pad = 0.07 * (high - low)
    axes.set_ylim(low - (pad if low < 0.0 else 0.4 * pad), high + pad)


def _legend_handles(
    runs: Sequence[DrawnRun], looks: Mapping[str, Look], names: Mapping[str, str], mark_words: str
) -> list[Any]:
    """Return the key of all that is drawn: a renderer by its name among `names`, with the outcome of its verdict."""
    words = "HIP" if _have_one_path(runs) else "HIP of each renderer"
    handles = [Line2D([], [], color=colour_of("quiet"), linewidth=0.9, linestyle=HIP_DASHES, label=words)]
    for number, run in enumerate(runs):
        label = f"IHIP, {names[run.renderer]}" + (f" ({run.outcome})" if run.outcome else "")
        handles.append(Line2D([], [], label=label, **_curve_style(looks[run.renderer], number, len(runs))))
    if mark_words and any(run.marks for run in runs):
        handles.append(Line2D([], [], label=mark_words, **_ring("ink")))
    return handles
