"""One figure per run, in the manner of thesis Figures 6.2 to 6.16: where the points went, and what was felt.

Left the plane with the model, HIPs, IHIPs and the projections between them; right the response force against
time, and below it how far the points moved in a tick (playback) or how deep the HIP was (experiment).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import continuing_steps
from hapticeval.reports.canvas import (
    DASHED,
    DOTTED,
    MM,
    Look,
    colour_of,
    draw_over_time,
    figure,
    legend_above,
    page_svg,
)
from hapticeval.reports.plane import draw_plane, labels
from hapticeval.runner.results import VerdictEntry
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Frame: TypeAlias = "tuple[Axes, Axes, Axes]"
"""The plane, the force, and what is below it."""

Area: TypeAlias = tuple[float, float, float, float]
"""Left, bottom, width and height of axes, as shares of the figure."""

AREAS_SIDE_BY_SIDE: tuple[Area, Area, Area] = (
    (0.08, 0.12, 0.405, 0.79),
    (0.59, 0.45, 0.39, 0.46),
    (0.59, 0.12, 0.39, 0.225),
)
AREAS_STACKED: tuple[Area, Area, Area] = (
    (0.175, 0.555, 0.775, 0.405),
    (0.175, 0.28, 0.775, 0.155),
    (0.175, 0.085, 0.775, 0.135),
)
"""Where plane, force and what is below it lie: side by side on paper, one above the other on a page."""

LABEL_DISTANCE = 0.44
"""Inches from an axis to its label: numbers of five characters lie between."""

FIGURE_HEIGHT, LINE_HEIGHT = 3.7, 0.16
"""Inches of a figure under a title of one line, and of each further one."""

TITLE_CHARACTERS = 100
"""Characters of a line of the title."""


@dataclass(frozen=True)
class Mark:
    """A time (s) that a verdict's evidence names; `number` is shown in the figure, and beside the verdict."""

    number: int
    time: float
    failed: bool


def marks_of(verdicts: Sequence[VerdictEntry]) -> dict[str, Mark]:
    """Return the marks of one run's verdicts, by check; verdicts whose evidence names no time have none."""
    timed = [(verdict, verdict.time) for verdict in verdicts if verdict.time is not None]
    return {
        verdict.check: Mark(number, time, verdict.outcome is Outcome.FAIL)
        for number, (verdict, time) in enumerate(timed, start=1)
    }


def figure_svg(
    recording: Recording,
    model: Model | None,
    *,
    marks: Sequence[Mark] = (),
    prefix: str = "f",
    title: str = "",
    look: Look | None = None,
) -> str:
    """Return the figure as an SVG element for a page; the same input gives the same text.

    With the `look` of its renderer the IHIP has that renderer's colour, and the HIP that of what stands beside.

    Of a recording in 3D the two coordinates in which it moves most are drawn, and all three force components.
    """
    with figure(4.4, 6.6, page=True) as fig:
        _draw(_add_frame(fig, AREAS_STACKED), recording, model, marks)
        svg = page_svg(fig, prefix=prefix, title=title)
    if look is None:
        return svg
    # The HIP first: the renderer's colour may be that of its role.
    return svg.replace("var(--fig-hip)", "var(--fig-quiet)").replace("var(--fig-ihip)", f"var(--fig-{look.role})")


def run_figure(recording: Recording, model: Model | None, *, marks: Sequence[Mark] = (), title: str = "") -> Figure:
    """Return the same as a figure of matplotlib, under a title, which takes as many lines as it needs."""
    lines = wrap(title, TITLE_CHARACTERS)
    height = FIGURE_HEIGHT + LINE_HEIGHT * max(len(lines) - 1, 0)
    with figure(8.0, height) as fig:
        left, bottom, width, high = np.array(AREAS_SIDE_BY_SIDE).T
        # The axes keep their size on paper; only the title takes more.
        share = FIGURE_HEIGHT / height
        places = np.column_stack([left, share * bottom, width, share * high]).tolist()
        _draw(_add_frame(fig, places), recording, model, marks)
        fig.suptitle("\n".join(lines), y=1.0 - 0.01 * share, fontsize="medium")
        return fig


def _add_frame(fig: Figure, places: Sequence[Area]) -> Frame:
    """Add the axes of the plane, of the force and of what is below it."""
    plane, force, below = map(fig.add_axes, places)
    # One time axis for both.
    below.sharex(force)
    force.tick_params(labelbottom=False)
    below.set_xlabel("time (s)")
    for axes in (force, below):
        # A fixed distance from the axis, so that labels of both plots are flush.
        axes.yaxis.set_label_coords(-LABEL_DISTANCE / (axes.get_position().width * fig.get_figwidth()), 0.5)
        axes.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        axes.grid(True)
    return plane, force, below


def _draw(frame: Frame, recording: Recording, model: Model | None, marks: Sequence[Mark]) -> None:
    """Draw a run into the axes, with a vertical line and a ring at each mark, numbered where there are several."""
    plane, force, below = frame
    # The sample nearest to each mark's time.
    ticks = {mark.number: int(np.argmin(np.abs(recording.time - mark.time))) for mark in marks}
    draw_plane(plane, recording, model, ticks=ticks, failed={mark.number for mark in marks if mark.failed})
    _draw_force(force, recording)
    _draw_below(below, recording)
    start, end = float(recording.time[0]), float(recording.time[-1])
    # A recording of one sample still needs an axis of some width.
    below.set_xlim(start, end if end > start else start + recording.dt)
    for axes in (force, below):
        for mark in marks:
            axes.axvline(
                mark.time, color=colour_of("mark"), linewidth=1.3 if mark.failed else 0.9, zorder=1.5,
                linestyle="-" if mark.failed else (0, (1.5, 1.5)),
            )  # fmt: skip
    # A number tells marks apart: one mark alone needs none.
    numbered = marks if len(marks) > 1 else ()
    times = [np.array([mark.time]) for mark in numbered]
    for time, text in labels([mark.number for mark in numbered], times, 0.03 * (end - start)):
        force.annotate(
            text, (float(time[0]), 0.0), xycoords=("data", "axes fraction"), xytext=(0, -1.5),
            textcoords="offset points", ha="center", va="top", annotation_clip=False,
        )  # fmt: skip


def _draw_force(axes: Axes, recording: Recording) -> None:
    """Draw the force's size and its components, N."""
    magnitude = np.linalg.norm(recording.force, axis=1)
    draw_over_time(axes, recording, magnitude, "ink", label="|F|", linewidth=1.6)
    for column, role, style, name in zip(
        recording.force.T, ("one", "two", "three"), ("-", DASHED, DOTTED), "₁₂₃", strict=False
    ):
        draw_over_time(axes, recording, column, role, label=f"F{name}", linestyle=style)
    axes.set_ylabel("force (N)")
    include_zero(axes, recording.force, magnitude)
    _legend(axes)


def _draw_below(axes: Axes, recording: Recording) -> None:
    """Steps of both points on one axis, where an IHIP that jumps and a HIP that does not are pop-through; or depth."""
    # On a given path the hand's steps do not depend on the renderer.
    if recording.meta.get("source") in ("playback", "replay") and len(recording) > 2:
        ihip, hip = (_step_lengths(recording, points) for points in (recording.ihip, recording.hip))
        draw_over_time(axes, recording, ihip, "ihip", label="IHIP, step a tick")
        draw_over_time(axes, recording, hip, "hip", label="HIP", linestyle=DASHED)
        axes.set_ylabel("step (mm)")
        include_zero(axes, ihip, hip)
        _legend(axes)
        return
    depth = MM * np.linalg.norm(recording.ihip - recording.hip, axis=1)
    draw_over_time(axes, recording, depth, "ihip", label="|IHIP − HIP|")  # noqa: RUF001
    axes.set_ylabel("depth (mm)")
    include_zero(axes, depth)
    _legend(axes)


def _step_lengths(recording: Recording, points: Array) -> Array:
    """How far (mm) the points (n, N) move in the tick before each sample; NaN where there is none before it."""
    steps = MM * np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.append(np.nan, np.where(continuing_steps(recording), steps, np.nan))


def _legend(axes: Axes) -> None:
    legend_above(axes, handlelength=2.0, columnspacing=1.2, handletextpad=0.5)


def include_zero(axes: Axes, *columns: Array) -> None:
    """Zero is always in sight, and rounding errors are never blown up to the height of the axis."""
    # The last zero serves the case of no columns.
    low = min(0.0, *(float(np.nanmin(column)) for column in columns), 0.0)
    high = max(0.0, *(float(np.nanmax(column)) for column in columns), 0.0)
    if high - low < 1e-6:
        high = 1.0
    pad = 0.07 * (high - low)
    axes.set_ylim(low - (pad if low < 0.0 else 0.4 * pad), high + pad)
