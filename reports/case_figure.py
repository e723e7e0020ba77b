"""The figures of a case with all its renderers laid over each other, as they stand on a page without script.

One shows the model with the hand's path and where each renderer put the tool; the other force and steps against time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.reports.canvas import (
    LINE_DASHES,
    MM,
    Look,
    colour_of,
    figure,
    page_svg,
)
from hapticeval.reports.case_data import EYE_AXES, Track
from hapticeval.reports.plane import (
    Box,
    aspect_of,
    box_round,
    draw_geometry,
    filled_part,
    labels,
    name_axes,
    solid_mesh,
    solid_shadow,
)
from hapticeval.types import Array, BoolArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes


RUNAWAY_RATIO = 3.0
"""A run that goes this many times as far as the median run leaves the picture, which would show nothing else."""

SMALLEST_DISTANCE = 1e-12
"""Distances (m) below this are rounding errors, and lie on the floor of a logarithmic panel."""

FIGURE_WIDTH, PLANE_HEIGHT = 4.4, 4.1
"""Inches of both figures, and of that of the model."""

PLANE_AREA, SPACE_AREA = (0.17, 0.12, 0.82, 0.87), (0.01, 0.01, 0.98, 0.98)
"""Left, bottom, width and height as shares of the figure: the plane needs room for numbers, space does not."""

PLOT_HEIGHT, LOW_PLOT_HEIGHT = 2.1, 1.55
"""Inches of a panel; the lower where there are more than two."""

TIME_ROOM, TIME_AXIS = 0.5, 0.42
"""Inches that panels leave free, and those of them that the numbers and the label of the time take."""

PLOT_LEFT, PLOT_WIDTH, PLOT_MARGIN, PLOT_GAP = 0.175, 0.78, 0.02, 0.05
"""Shares of the figure: where panels begin, and how wide they are; what is free below one, and of its height in all."""

LABEL_LEFT = -0.15
"""Where labels of vertical axes stand, as a share of the axes' width: flush in all panels."""

PATH_MARKERS = 12
"""A path bears about so many markers."""


@dataclass(frozen=True)
class Place:
    """A place that a verdict names: its `number` in the figures, the renderer, and the time, s."""

    number: int
    renderer: str
    time: float


class Term(NamedTuple):
    """One line of a panel: a `channel` of the track, of it one `column`, or of vectors the length; and its label.

    `is_size`: lengths of vectors, and numbers without their sign.
    """

    channel: str
    label: str
    column: int | None = None
    is_size: bool = False

    @property
    def script_name(self) -> str:
        """The name that `assets/case.js` reads: "force.1" of a column, "|force|" of a size."""
        if self.is_size:
            return f"|{self.channel}|"
        return self.channel if self.column is None else f"{self.channel}.{self.column}"


@dataclass(frozen=True)
class Panel:
    """One plot against time: the label of its axis, and what is drawn of each run; see `panel_values`.

    Of `terms` the first is drawn of every run, the others where one run is shown alone.
    """

    label: str
    terms: tuple[Term, ...]
    powers: tuple[float, float] | None = None
    """Of a logarithmic axis, both ends."""


def case_panels(tracks: Sequence[Track]) -> list[Panel]:
    """Return the panels of a case: force, and steps or depth; of a hand that is held on a surface its distance."""
    panels = []
    # A run in one dimension, which lies on the second axis: its place says what the plane cannot.
    if all(track.hip.shape[1] == 2 and not track.hip[:, 0].any() for track in tracks):
        panels.append(Panel("place (mm)", (Term("hip", "HIP", column=1), Term("ihip", "IHIP", column=1))))
    widest = max((track.hip.shape[1] for track in tracks), default=2)
    if any(track.force is not None for track in tracks):
        parts = tuple(Term("force", f"F{'₁₂₃'[k]}", column=k) for k in range(widest))
        panels.append(Panel("force (N)", (Term("force", "|F|", is_size=True), *parts)))
    if any(track.off is not None for track in tracks):
        panels.append(Panel("off the surface (mm)", (Term("off", "off"),)))
        panels.append(Panel("the same, size (mm)", (Term("off", "off", is_size=True),), powers=_power_range(tracks)))
        panels.append(Panel("speed along it (m/s)", (Term("along", "along"),)))
    # Without an IHIP there is neither depth nor its step: the hand alone is drawn.
    elif any(track.apart is None for track in tracks) and len(tracks) == 1:
        panels.append(Panel("HIP step a tick (mm)", (Term("hip_step", "HIP"),)))
    # On a given path a tool that jumps farther than the hand moves is pop-through.
    elif all(track.led for track in tracks):
        panels.append(Panel("step a tick (mm)", (Term("step", "IHIP"), Term("hip_step", "HIP"))))
    else:
        panels.append(Panel("depth (mm)", (Term("apart", "depth", is_size=True),)))
    return panels


def _power_range(tracks: Sequence[Track]) -> tuple[float, float]:
    """Return the ends of a logarithmic panel, whole powers of ten in mm.

    The lower is at the median of the run that keeps closest to the surface, the upper above the farthest.
    """
    sizes = [np.abs(track.off) for track in tracks if track.off is not None]
    # m: the best run's median is the floor, so that it is not all below the panel.
    closest = max(min(float(np.median(size)) for size in sizes), SMALLEST_DISTANCE)
    worst = max(*(float(size.max()) for size in sizes), 10.0 * SMALLEST_DISTANCE)
    return float(MM * 10.0 ** np.floor(np.log10(closest))), float(MM * 10.0 ** (np.ceil(np.log10(worst)) + 0.3))


def panel_values(track: Track, term: Term) -> Array | None:
    """Return what a panel draws of a run, (n,), in N, mm or m/s; None where it was not recorded."""
    values: Array | None = getattr(track, term.channel)
    if values is None:
        return None
    # Forces are shown in N and speeds in m/s, lengths in mm.
    scale = 1.0 if term.channel in ("force", "along") else MM
    if term.column is not None:
        # One that a run in the plane does not have is not drawn.
        return scale * values[:, term.column] if term.column < values.shape[1] else None
    if term.is_size:
        return scale * (np.linalg.norm(values, axis=1) if values.ndim == 2 else np.abs(values))
    return scale * values


def plane_svg(
    tracks: Sequence[Track],
    model: Model | None,
    looks: Mapping[str, Look],
    places: Sequence[Place],
    *,
    crosses: Mapping[str, Sequence[float]],
    prefix: str,
    title: str,
) -> str:
    """Return the model with the paths of all runs as an SVG element; `places` are ringed and numbered.

    `crosses` are points, m, by renderer: where it refuses the model. A run in space is seen along the last row of
    `EYE_AXES`; what the model hides of it is drawn faintly.
    """
    space = tracks[0].hip.shape[1] == 3
    # (N, 2), mm/m: in space the projection along the direction to the eye.
    projection = MM * (EYE_AXES[:2].T if space else np.eye(2))
    with figure(FIGURE_WIDTH, PLANE_HEIGHT, page=True) as fig:
        axes = fig.add_axes(SPACE_AREA if space else PLANE_AREA)
        view = view_of(tracks, model, projection, aspect_of(axes))
        if model is not None:
            draw_geometry(axes, solid_shadow(model, EYE_AXES) if space else filled_part(model, view), view)
        # Runs on one hand path share its line; a path of one run alone has that run's colour.
        hands: dict[bytes, list[Track]] = {}
        for track in tracks:
            hands.setdefault(track.hip.tobytes(), []).append(track)
        for group in hands.values():
            # A tool that is held on a surface is where the hand is: its path is drawn below.
            if group[0].off is not None:
                continue
            colour = looks[group[0].name].role if len(hands) > 1 and len(group) == 1 else "quiet"
            path = _with_gaps(group[0].hip @ projection, group[0].starts)
            axes.plot(*path.T, color=colour_of(colour), linewidth=0.8, zorder=2)
        for track in tracks:
            path = track.ihip if track.off is None else track.hip
            _draw_path(
                axes, track, path @ projection, looks[track.name], _hidden_behind_model(track, model) if space else None
            )
        ringed_points = []
        for place in places:
            track = next(track for track in tracks if track.name == place.renderer)
            path = track.ihip if track.off is None else track.hip
            # The sample nearest to the verdict's time, in the figure's coordinates, mm.
            ringed_points.append(path[int(np.argmin(np.abs(track.time - place.time)))] @ projection)
            axes.plot(
                *ringed_points[-1], marker="o", markersize=9.0, markerfacecolor="none", markeredgewidth=1.3,
                color=colour_of(looks[track.name].role), zorder=5,
            )  # fmt: skip
        for name, position in crosses.items():
            axes.plot(
                *(np.array(position) @ projection),
                marker="x",
                markersize=8.0,
                color=colour_of(looks[name].role),
                zorder=5,
            )
        for point, text in labels([place.number for place in places], ringed_points, 0.05 * (view[2] - view[0])):
            axes.annotate(text, tuple(point), xytext=(5.5, 3.5), textcoords="offset points", zorder=6)
        axes.set(xlim=view[::2], ylim=view[1::2], aspect="auto")
        if space:
            _draw_directions(axes, view)
        else:
            name_axes(axes, (0, 1), 2)
            axes.yaxis.set_label_coords(LABEL_LEFT, 0.5)
        return page_svg(fig, prefix=prefix, title=title)


def _draw_path(axes: Axes, track: Track, path: Array, look: Look, hidden: BoolArray | None) -> None:
    """Draw the tool's path where it is in contact, faint where it is `hidden`; without an IHIP there is none.

    A tool that is held on a surface is where the hand is.
    """
    if track.apart is None:
        return
    if track.off is None:
        # Free motion, where the tool is at the hand, is not drawn.
        path = np.where(np.any(track.apart != 0.0, axis=1)[:, None], path, np.nan)
    line_style: dict[str, Any] = {"color": colour_of(look.role), "dashes": look.dash or (None, None), "zorder": 3}
    visible = path if hidden is None else np.where(hidden[:, None], np.nan, path)
    if hidden is not None:
        # One sample more on both sides, so that the faint line meets the strong one.
        behind = hidden | np.append(False, hidden[:-1]) | np.append(hidden[1:], False)
        axes.plot(
            *_with_gaps(np.where(behind[:, None], path, np.nan), track.starts).T,
            **{**line_style, "linewidth": 0.7, "alpha": 0.5},
        )
    marker_times = np.linspace(track.time[0], track.time[-1], PATH_MARKERS, endpoint=False)
    axes.plot(
        *_with_gaps(visible, track.starts).T, **line_style, linewidth=1.3, marker=look.marker, markersize=3.5,
        markeredgewidth=0.0, markevery=np.unique(np.searchsorted(track.time, marker_times)).tolist(),
    )  # fmt: skip


def _hidden_behind_model(track: Track, model: Model | None) -> BoolArray | None:
    """Return where the surface under the tool faces away from the eye, (n,); None without a model."""
    if model is None:
        return None
    # Of a convex solid this is exact; of others it misses what a part in front hides.
    return np.asarray(model.boundary.closest_point(track.ihip).normal @ EYE_AXES[2] < 0.0)


def _draw_directions(axes: Axes, view: Box) -> None:
    """Draw three arrows for the coordinates in a corner, and a scale bar with its length."""
    size = 0.07 * (view[2] - view[0])
    origin = np.array([view[2] - 1.8 * size, view[1] + 1.6 * size])
    for k, name in enumerate("₁₂₃"):
        tip = origin + size * EYE_AXES[:2, k]
        axes.plot(*np.stack([origin, tip]).T, color=colour_of("quiet"), linewidth=0.8)
        axes.annotate(f"y{name}", tuple(origin + 1.35 * size * EYE_AXES[:2, k]), ha="center", va="center")
    # mm: the bar is the largest of 1, 2, 5 times a power of ten below a third of the width.
    longest = 0.3 * (view[2] - view[0])
    power = 10.0 ** np.floor(np.log10(longest))
    length = max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= longest)
    start = np.array([view[0] + 0.4 * size, view[1] + 0.5 * size])
    axes.plot([start[0], start[0] + length], [start[1]] * 2, color=colour_of("quiet"), linewidth=1.4)
    axes.annotate(f"{length:g} mm", tuple(start), xytext=(0, 3), textcoords="offset points")
    axes.set_axis_off()


def _with_gaps(values: Array, starts: Sequence[int] | Any) -> Array:
    """Return values with a row of NaN before each start, so that no line crosses a gap."""
    return np.insert(values, starts, np.nan, axis=0)


def view_of(tracks: Sequence[Track], model: Model | None, projection: Array, aspect: float) -> Box:
    """Return what the figure shows, mm: the paths that do not run away, and the whole solid if it is not far larger.

    `projection` (N, 2) maps points, m, onto the figure, and `aspect` is the figure's height over its width.
    """
    # m, from the origin.
    extent = [float(np.max(np.abs(track.hip))) for track in tracks]
    in_sight = [
        track for track, reach in zip(tracks, extent, strict=True) if reach <= RUNAWAY_RATIO * float(np.median(extent))
    ]
    points = np.vstack([np.vstack([track.hip, track.ihip]) for track in in_sight]) @ projection
    if model is not None and (model.dimension == 3 or model.boundary.closed):
        solid = (solid_mesh(model).vertices if model.dimension == 3 else model.boundary.points(200)) @ projection
        # The whole solid is in view where the paths still fill two fifths of it.
        if np.all(np.ptp(solid, axis=0) < 2.5 * np.ptp(points, axis=0).max()):
            points = np.vstack([points, solid])
    low, high = points.min(axis=0), points.max(axis=0)
    return box_round(0.5 * (low + high), 1.14 * (high - low), aspect)


def panels_svg(
    tracks: Sequence[Track],
    panels: Sequence[Panel],
    looks: Mapping[str, Look],
    places: Sequence[Place],
    *,
    prefix: str,
    title: str,
) -> str:
    """Return the panels, one above the other, as an SVG element."""
    height = TIME_ROOM + (LOW_PLOT_HEIGHT if len(panels) > 2 else PLOT_HEIGHT) * len(panels)
    with figure(FIGURE_WIDTH, height, page=True) as fig:
        # Heights as shares of the figure, above the room for the time axis.
        share = 1.0 / len(panels)
        below = TIME_AXIS / height
        free = 1.0 - below
        start = min(float(track.time[0]) for track in tracks)
        end = max(float(track.time[-1]) for track in tracks)
        for k, panel in enumerate(panels):
            bottom = below + free * (1.0 - (k + 1) * share) + PLOT_MARGIN
            axes = fig.add_axes((PLOT_LEFT, bottom, PLOT_WIDTH, free * share - PLOT_GAP))
            _draw_panel(axes, tracks, panel, looks, alone=len(tracks) == 1)
            axes.set_xlim(start, end if end > start else start + 1e-3)
            axes.set_ylabel(panel.label)
            axes.yaxis.set_label_coords(LABEL_LEFT, 0.5)
            axes.grid(True)
            last = k == len(panels) - 1
            axes.tick_params(labelbottom=last, bottom=False, left=False, which="both")
            if panel.powers is None:
                axes.locator_params(axis="y", nbins=5)
            axes.locator_params(axis="x", nbins=6)
            if last:
                axes.set_xlabel("time (s)")
            for name in dict.fromkeys(place.renderer for place in places):
                # All lines of a renderer as one, from bottom to top and broken by NaN.
                at = [time for place in places if place.renderer == name for time in (place.time, place.time, np.nan)]
                axes.plot(
                    at, [0.0, 1.0, np.nan] * (len(at) // 3), transform=axes.get_xaxis_transform(), zorder=1,
                    color=colour_of(looks[name].role), linewidth=0.9, linestyle=(0, (1.5, 1.5)),
                )  # fmt: skip
            times = [np.array([place.time]) for place in places]
            if k == 0:
                for time, text in labels([place.number for place in places], times, 0.03 * (end - start)):
                    axes.annotate(text, (float(time[0]), 1.0), xycoords=("data", "axes fraction"), xytext=(0, 1),
                                  textcoords="offset points", ha="center")  # fmt: skip
        return page_svg(fig, prefix=prefix, title=title)


def _draw_panel(axes: Axes, tracks: Sequence[Track], panel: Panel, looks: Mapping[str, Look], *, alone: bool) -> None:
    """Draw one panel over time: its first term of every run, all terms of a run that is alone."""
    # Zero is always in view.
    highs, lows = [0.0], [0.0]
    for track in tracks:
        look = looks[track.name]
        for k, term in enumerate(panel.terms if alone else panel.terms[:1]):
            values = panel_values(track, term)
            if values is None:
                continue
            if panel.powers:
                # What lies below a logarithmic panel runs along its floor.
                values = np.maximum(values, panel.powers[0])
            colour, dash = (look.role, look.dash) if k == 0 else (("one", "two", "three")[k - 1], LINE_DASHES[k])
            axes.plot(
                *(_with_gaps(numbers, track.starts) for numbers in (track.time, values)), color=colour_of(colour),
                dashes=dash or (None, None), linewidth=1.1,
            )  # fmt: skip
            highs.append(float(values.max()))
            lows.append(float(values.min()))
    if panel.powers:
        axes.set_yscale("log")
        axes.set_ylim(*panel.powers)
        return
    low, high = min(lows), max(highs)
    # Nothing but rounding errors: show an axis from 0 to 1.
    if high - low < 1e-9:
        high = 1.0
    pad = 0.07 * (high - low)
    axes.set_ylim(low - (pad if low < 0.0 else 0.3 * pad), high + pad)
