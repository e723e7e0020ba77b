"""One figure of several renderers on one case, at its real size and in fonts that journals take.

Above the plane: the model, the HIP's path and the IHIP's path of each renderer. Below it the force's size against time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.reports.canvas import MM, Look, colour_of, draw_over_time, looks_of
from hapticeval.reports.paper import PaperFigure, add_legend, paper_page
from hapticeval.reports.plane import aspect_of, box_round, draw_body, name_axes, samples_along_path
from hapticeval.reports.run_figure import include_zero
from hapticeval.runner.results import VerdictEntry
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TALLEST = 0.12
"""Metres of height that the axes of a figure have at most where no height is asked for."""

DETAIL = 20_000.0
"""Width of the view over what is left out of the model's outline: not to be seen in print."""

DASHES = (0, (3.0, 1.5))
"""Line style of the HIP's path: the offset, and the lengths of line and gap in line widths."""

RING = 9.0
"""Points across the ring where a verdict points."""

MARKS_OF_CURVE = 9
"""About so many markers stand on a curve, those of different renderers at different places."""


@dataclass(frozen=True)
class PaperRun:
    """What a renderer did on the case, and, if a check's verdict is to be shown, that."""

    renderer: str
    recording: Recording
    verdict: VerdictEntry | None = None

    @property
    def label(self) -> str:
        """The name in the legend, with the outcome where there is a verdict."""
        return self.renderer if self.verdict is None else f"{self.renderer} ({self.verdict.outcome})"

    @property
    def tick(self) -> int | None:
        """The sample that the verdict's evidence names by time or HIP; None where it names none."""
        evidence: Mapping[str, Any] = {} if self.verdict is None else self.verdict.evidence
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
    width: str | None = None,
    height: str | None = None,
    font_size: float | None = None,
) -> PaperFigure:
    """Draw the runs of one case over each other; see `paper_page` for sizes.

    `looks` are those that the renderers have on the pages of a report; if not given, those of a report of these runs.
    Runs in space are drawn in their `clearest_coordinates`. A ring and a line in time stand where the verdict of a run
    points. Raises as `paper_page` does.
    """
    with paper_page(width, height, font_size, natural=_natural_height) as fig:
        plane, force = fig.subplots(2, 1, height_ratios=(2.6, 1.0))
        looks = looks or looks_of(run.renderer for run in runs)
        _draw_forces(force, runs, looks)
        coordinates = clearest_coordinates([run.recording for run in runs])
        low, high = _draw_paths(plane, runs, coordinates, looks)
        legend_height = add_legend(fig, _legend_handles(runs, looks))
        if height is None:
            fig.set_figheight(fig.get_figheight() + legend_height)
        fig.align_ylabels()
        # How wide the numbers at the axes are depends on what is in view, and that on the room which they leave.
        for _ in range(2):
            fig.draw_without_rendering()
            view = box_round(0.5 * (low + high), 1.15 * (high - low), aspect_of(plane))
            plane.set(xlim=view[::2], ylim=view[1::2])
        fig.set_layout_engine("none")
        if model is not None:
            draw_body(plane, model, view, coordinates, detail=DETAIL)
        return fig


def _natural_height(width: float) -> float:
    return min(width, max(TALLEST, 0.6 * width))


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
            axes.plot(*hip.T, color=colour, linewidth=0.9, linestyle=DASHES, zorder=2.5)
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


def _legend_handles(runs: Sequence[PaperRun], looks: Mapping[str, Look]) -> list[Any]:
    """Return the names of all that is drawn."""
    from matplotlib.lines import Line2D

    words = "HIP" if _have_one_path(runs) else "HIP of each renderer"
    handles = [Line2D([], [], color=colour_of("quiet"), linewidth=0.9, linestyle=DASHES, label=words)]
    for number, run in enumerate(runs):
        look = looks[run.renderer]
        style = _curve_style(look, number, len(runs))
        handles.append(Line2D([], [], color=colour_of(look.role), label=f"IHIP, {run.label}", **style))
    marked = [run.verdict for run in runs if run.verdict is not None and run.tick is not None]
    if marked:
        fails = all(verdict.outcome is Outcome.FAIL for verdict in marked)
        words = f"where {marked[0].check} fails" if fails else f"worst place of {marked[0].check}"
        handles.append(Line2D([], [], label=words, **_ring("ink")))
    return handles
