"""One figure a recording, in the manner of thesis Figures 6.2 to 6.16: where the points went, and what was felt.

Left the plane with the model, HIPs, IHIPs and the projections between them; right the response force against
time, and below it how far the points moved in a tick (playback) or how deep the HIP was (experiment).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import GAP_STEPS
from hapticeval.reports.canvas import MM, figure, page_svg
from hapticeval.reports.marks import Mark, labels
from hapticeval.reports.plane import draw_plane
from hapticeval.reports.svg import drawn
from hapticeval.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BUCKETS = 140


def figure_svg(
    recording: Recording, model: Model | None, *, marks: Sequence[Mark] = (), prefix: str = "f", title: str = ""
) -> str:
    """The figure as an SVG element for a page; the same input gives the same text.

    Of a recording in 3D the two coordinates in which it moves most are drawn, and all three force components.
    """
    with figure(8.0, 3.5, page=True) as made:
        _draw(made, recording, model, marks)
        return page_svg(made, prefix=prefix, title=title)


def run_figure(recording: Recording, model: Model | None, *, marks: Sequence[Mark] = (), title: str = "") -> Figure:
    """Return the same as a figure of matplotlib, under a title."""
    with figure(8.0, 3.7) as made:
        _draw(made, recording, model, marks)
        made.suptitle(title, y=0.99, fontsize="medium")
        return made


def _draw(made: Figure, recording: Recording, model: Model | None, marks: Sequence[Mark]) -> None:
    plane = made.add_axes((0.08, 0.12, 0.405, 0.79))
    force = made.add_axes((0.59, 0.45, 0.39, 0.46))
    below = made.add_axes((0.59, 0.12, 0.39, 0.225))
    ticks = {mark.number: int(np.argmin(np.abs(recording.time - mark.time))) for mark in marks}
    failed = {mark.number for mark in marks if mark.failed}
    draw_plane(plane, recording, model, ticks=ticks, failed=failed)
    _draw_force(force, recording)
    _draw_below(below, recording)
    force.tick_params(labelbottom=False)
    below.set_xlabel("time (s)")
    force.yaxis.set_label_coords(-0.125, 0.5)
    below.yaxis.set_label_coords(-0.125, 0.5)
    for axes in (force, below):
        _finish_time_axes(axes, recording, marks, numbered=axes is force)


def _draw_force(axes: Axes, recording: Recording) -> None:
    magnitude = np.linalg.norm(recording.force, axis=1)
    _trace(axes, recording.time, magnitude, "|F|", "ink", linewidth=1.6)
    for index, (role, dashes) in enumerate((("one", (None, None)), ("two", (4, 1.2)), ("three", (1.2, 1.2)))):
        if index < recording.force.shape[1]:
            _trace(axes, recording.time, recording.force[:, index], f"F{'₁₂₃'[index]}", role, dashes=dashes)
    axes.set_ylabel("response force (N)")
    _include_zero(axes, recording.force, magnitude[:, None])
    _legend(axes)


def _draw_below(axes: Axes, recording: Recording) -> None:
    if recording.meta.get("source") in ("playback", "replay") and len(recording) > 2:
        _draw_steps(axes, recording)
        return
    depth = MM * np.linalg.norm(recording.ihip - recording.hip, axis=1)
    _trace(axes, recording.time, depth, "", "ihip")
    axes.set_ylabel("|IHIP − HIP|\n(mm)")  # noqa: RUF001
    _include_zero(axes, depth[:, None])


def _draw_steps(axes: Axes, recording: Recording) -> None:
    """Steps of both points on one axis: an IHIP that jumps where the HIP does not is pop-through."""
    joined = ~_gaps(recording.time)
    time = recording.time[1:][joined]
    hip = MM * np.linalg.norm(np.diff(recording.hip, axis=0), axis=1)[joined]
    ihip = MM * np.linalg.norm(np.diff(recording.ihip, axis=0), axis=1)[joined]
    _trace(axes, time, ihip, "IHIP", "ihip")
    _trace(axes, time, hip, "HIP", "hip", dashes=(4, 1.2))
    axes.set_ylabel("step a tick\n(mm)")
    _include_zero(axes, hip[:, None], ihip[:, None])
    _legend(axes)


def _trace(
    axes: Axes,
    time: Array,
    values: Array,
    label: str,
    role: str,
    *,
    linewidth: float = 1.1,
    dashes: tuple[float | None, float | None] = (None, None),
) -> None:
    kept = extremes(values, BUCKETS)
    # No line leads over a gap: it would show what nobody measured.
    cuts = np.flatnonzero(np.diff(np.cumsum(np.append(False, _gaps(time)))[kept])) + 1
    shown = [np.insert(each[kept], cuts, np.nan) for each in (time, values)]
    (line,) = axes.plot(*shown, color=drawn(role), label=label, linewidth=linewidth)
    if dashes[0] is not None:
        line.set_dashes([each for each in dashes if each is not None])


def _gaps(time: Array) -> BoolArray:
    """Between which samples (n - 1,) the clock has a gap."""
    steps = np.diff(time)
    return np.asarray(steps > GAP_STEPS * np.median(steps)) if steps.size else np.zeros(0, dtype=bool)


def extremes(values: Array, buckets: int) -> IntArray:
    """Indices, in order, that keep the first, last, lowest and highest of each of `buckets` equal stretches.

    However long the recording, no peak of a single tick is lost from the picture.
    """
    count = values.size
    if count <= 4 * buckets:
        return np.arange(count)
    kept = {0, count - 1}
    edges = np.linspace(0, count, buckets + 1).astype(int)
    for first, end in pairwise(edges):
        stretch = values[first:end]
        kept |= {int(first), int(first + np.argmin(stretch)), int(first + np.argmax(stretch))}
    return np.array(sorted(kept))


def _include_zero(axes: Axes, *columns: Array) -> None:
    """Zero is always in sight, and rounding errors are never blown up to the height of the axis."""
    low = min(0.0, *(float(column.min()) for column in columns))
    high = max(0.0, *(float(column.max()) for column in columns))
    if high - low < 1e-6:
        high = 1.0
    pad = 0.07 * (high - low)
    axes.set_ylim(low - (pad if low < 0.0 else 0.4 * pad), high + pad)


def _legend(axes: Axes) -> None:
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=4, frameon=False, handlelength=2.0, columnspacing=1.2,
        borderaxespad=0.0, handletextpad=0.5,
    )  # fmt: skip


def _finish_time_axes(axes: Axes, recording: Recording, marks: Sequence[Mark], *, numbered: bool) -> None:
    start, end = float(recording.time[0]), float(recording.time[-1])
    axes.set_xlim(start, end if end > start else start + recording.dt)
    axes.grid(True, linewidth=0.5)
    axes.set_axisbelow(True)
    for mark in marks:
        axes.axvline(
            mark.time, color=drawn("mark"), linewidth=1.3 if mark.failed else 0.9, zorder=1.5,
            linestyle="-" if mark.failed else (0, (1.5, 1.5)),
        )  # fmt: skip
    if numbered:
        near = 0.03 * (end - start)
        for time, text in labels([mark.number for mark in marks], [np.array([mark.time]) for mark in marks], near):
            axes.annotate(
                text, (float(time[0]), 0.0), xycoords=("data", "axes fraction"), xytext=(0, -1.5),
                textcoords="offset points", ha="center", va="top", fontsize=7.5, color=drawn("ink"),
                annotation_clip=False,
            )  # fmt: skip
