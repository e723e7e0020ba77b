"""The figures of a case with all its renderers laid over each other, as they stand on a page without script.

One shows the model with the hand's path and where each renderer put the tool; the other force and steps against time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.reports.canvas import MM, drawn, figure, page_svg
from hapticeval.reports.case_data import Track
from hapticeval.reports.plane import Box, box_round, draw_body, labels, name_axes, shape_of, shown_axes
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROLES = ("ihip", "hip", "one", "two", "ink", "three", "mark")
DASHES = ((), (6, 2), (2, 2), (6, 2, 2, 2))
"""Lengths of lines and gaps, in points."""
MARKERS = "osD^vPX"

OUT_OF_SIGHT = 3.0
"""A run that goes this many times as far as the median run leaves the picture, which would show nothing else."""

LEAST = 1e-12
"""m: distances below are rounding errors, and lie on the floor of a logarithmic panel."""

EVERY = 12
"""A path bears about so many markers."""


@dataclass(frozen=True)
class Look:
    """How a renderer is drawn: the role of its colour, its dashes and its marker, no two alike for 84 renderers."""

    role: str
    dash: tuple[int, ...]
    marker: str


def look(index: int) -> Look:
    """Return the look of the renderer at a place in the order of the columns."""
    return Look(
        ROLES[index % len(ROLES)], DASHES[(index + index // len(ROLES)) % len(DASHES)], MARKERS[index % len(MARKERS)]
    )


@dataclass(frozen=True)
class Place:
    """A place that a verdict names: its `number` in the figures, the renderer, and the time, s."""

    number: int
    renderer: str
    time: float


@dataclass(frozen=True)
class Panel:
    """One plot against time: the label of its axis, and what is drawn of each run; see `term`.

    Of `terms` the first is drawn of every run, the others where one run is shown alone.
    """

    label: str
    terms: tuple[tuple[str, str], ...]
    powers: bool = False
    """Whether the axis is logarithmic."""


def panels(found: Sequence[Track], *, held: bool) -> list[Panel]:
    """Return the panels of a case: force, and steps or depth; of a tool that is `held` on the surface its distance."""
    made = []
    widest = max((each.hip.shape[1] for each in found), default=2)
    if any(each.force is not None for each in found):
        parts = tuple((f"force.{k}", f"F{'₁₂₃'[k]}") for k in range(widest))
        made.append(Panel("force (N)", (("|force|", "|F|"), *parts)))
    if held:
        made.append(Panel("off the surface (mm)", (("off", "off"),)))
        made.append(Panel("the same, size (mm)", (("|off|", "off"),), powers=True))
    elif any(each.apart is None for each in found) and len(found) == 1:
        made.append(Panel("HIP step a tick (mm)", (("hip_step", "HIP"),)))
    elif all(each.led for each in found):
        made.append(Panel("step a tick (mm)", (("step", "IHIP"), ("hip_step", "HIP"))))
    else:
        made.append(Panel("depth |IHIP − HIP| (mm)", (("|apart|", "depth"),)))  # noqa: RUF001
    return made


def term(each: Track, name: str) -> Array | None:
    """Return what a panel draws of a run, (n,), in N or mm; None where it was not recorded."""
    channel, _, column = name.strip("|").partition(".")
    values: Array | None = getattr(each, channel)
    if values is None:
        return None
    scale = 1.0 if channel == "force" else MM
    if column:
        return scale * values[:, int(column)] if int(column) < values.shape[1] else None
    if name.startswith("|"):
        size = np.linalg.norm(values, axis=1) if values.ndim == 2 else np.abs(values)
        return scale * size
    return scale * values


def plane_svg(
    found: Sequence[Track],
    model: Model | None,
    looks: Mapping[str, Look],
    places: Sequence[Place],
    *,
    prefix: str,
    title: str,
) -> str:
    """Return the model with the paths of all runs as an SVG element; `places` are ringed and numbered."""
    shown = shown_axes(np.vstack([each.hip for each in found]))
    with figure(5.0, 4.6, page=True) as made:
        axes = made.add_axes((0.115, 0.1, 0.875, 0.89))
        view = view_of(found, model, shown, shape_of(axes))
        if model is not None:
            draw_body(axes, model, view, shown)
        columns = list(shown)
        paths = {each.hip.tobytes(): each for each in found}
        for each in paths.values():
            alone = len(paths) > 1
            colour = drawn(looks[each.name].role if alone else "quiet")
            axes.plot(*_broken(MM * each.hip[:, columns], each.starts).T, color=colour, linewidth=0.8, zorder=2)
        for each in found:
            if each.apart is not None:
                _draw_path(axes, each, MM * each.ihip[:, columns], looks[each.name])
        where = []
        for place in places:
            each = next(track for track in found if track.name == place.renderer)
            where.append(MM * each.ihip[int(np.argmin(np.abs(each.time - place.time))), columns])
            axes.plot(*where[-1], marker="o", markersize=9.0, markerfacecolor="none", markeredgewidth=1.3,
                      color=drawn(looks[each.name].role), zorder=5)  # fmt: skip
        for point, text in labels([place.number for place in places], where, 0.05 * (view[2] - view[0])):
            axes.annotate(text, tuple(point), xytext=(5.5, 3.5), textcoords="offset points", fontsize=8, zorder=6)
        axes.set(xlim=view[::2], ylim=view[1::2], aspect="auto")
        name_axes(axes, shown, found[0].hip.shape[1])
        return page_svg(made, prefix=prefix, title=title)


def _draw_path(axes: Axes, each: Track, ihip: Array, style: Look) -> None:
    moving = np.any(np.abs(each.apart) > 0.0, axis=1) if each.apart is not None else np.ones(len(ihip), dtype=bool)
    path = _broken(np.where(moving[:, None], ihip, np.nan), each.starts)
    axes.plot(
        *path.T, color=drawn(style.role), dashes=style.dash or (None, None), linewidth=1.3, zorder=3,
        marker=style.marker, markersize=3.5, markeredgewidth=0.0, markevery=max(1, len(path) // EVERY), label=each.name,
    )  # fmt: skip


def _broken(values: Array, starts: Sequence[int] | Any) -> Array:
    """Values with a row of NaN before each start, so that no line crosses a gap."""
    return np.insert(values, starts, np.nan, axis=0)


def view_of(found: Sequence[Track], model: Model | None, shown: tuple[int, int], aspect: float) -> Box:
    """Return what the figure shows, mm: the paths that do not run away, and the whole solid if it is not far larger."""
    extent = [float(np.max(np.abs(each.hip))) for each in found]
    near = [each for each, far in zip(found, extent, strict=True) if far <= OUT_OF_SIGHT * float(np.median(extent))]
    points = MM * np.vstack([np.vstack([each.hip, each.ihip]) for each in near])[:, list(shown)]
    if model is not None and (model.dimension == 3 or model.boundary.closed):
        ends = MM * np.reshape(model.boundary.bounds, (2, -1))[:, list(shown)]
        if np.all(np.ptp(ends, axis=0) < 2.5 * np.ptp(points, axis=0).max()):
            points = np.vstack([points, ends])
    low, high = points.min(axis=0), points.max(axis=0)
    return box_round(0.5 * (low + high), 1.14 * (high - low), aspect)


def panels_svg(
    found: Sequence[Track],
    shown: Sequence[Panel],
    looks: Mapping[str, Look],
    places: Sequence[Place],
    *,
    prefix: str,
    title: str,
) -> str:
    """Return the panels, one above the other, as an SVG element."""
    height = 1.55 if len(shown) > 2 else 2.1
    with figure(5.0, 0.5 + height * len(shown), page=True) as made:
        share = 1.0 / len(shown)
        below = 0.42 / (0.5 + height * len(shown))
        free = 1.0 - below
        start = min(float(each.time[0]) for each in found)
        end = max(float(each.time[-1]) for each in found)
        for k, panel in enumerate(shown):
            axes = made.add_axes((0.135, below + free * (1.0 - (k + 1) * share) + 0.02, 0.855, free * share - 0.05))
            _draw_panel(axes, found, panel, looks, alone=len(found) == 1)
            axes.set_xlim(start, end if end > start else start + 1e-3)
            axes.set_ylabel(panel.label)
            axes.yaxis.set_label_coords(-0.115, 0.5)
            axes.grid(True)
            last = k == len(shown) - 1
            axes.tick_params(labelbottom=last)
            if last:
                axes.set_xlabel("time (s)")
            for place in places:
                axes.axvline(
                    place.time,
                    color=drawn(looks[place.renderer].role),
                    linewidth=0.9,
                    linestyle=(0, (1.5, 1.5)),
                    zorder=1,
                )
            times = [np.array([place.time]) for place in places]
            if k == 0:
                for time, text in labels([place.number for place in places], times, 0.03 * (end - start)):
                    axes.annotate(text, (float(time[0]), 1.0), xycoords=("data", "axes fraction"), xytext=(0, 1),
                                  textcoords="offset points", ha="center", fontsize=7.5)  # fmt: skip
        return page_svg(made, prefix=prefix, title=title)


def _draw_panel(axes: Axes, found: Sequence[Track], panel: Panel, looks: Mapping[str, Look], *, alone: bool) -> None:
    highs, lows = [0.0], [0.0]
    for each in found:
        style = looks[each.name]
        for k, (name, _) in enumerate(panel.terms if alone else panel.terms[:1]):
            values = term(each, name)
            if values is None:
                continue
            if panel.powers:
                values = np.maximum(values, MM * LEAST)
            time = each.time
            colour, dash = (style.role, style.dash) if k == 0 else (("one", "two", "three")[k - 1], DASHES[k])
            axes.plot(
                np.insert(time, each.starts, np.nan), _broken(values, each.starts), color=drawn(colour),
                dashes=dash or (None, None), linewidth=1.1,
            )  # fmt: skip
            highs.append(float(values.max()))
            lows.append(float(values.min()))
    if panel.powers:
        axes.set_yscale("log")
        return
    low, high = min(lows), max(highs)
    if high - low < 1e-9:
        high = 1.0
    pad = 0.07 * (high - low)
    axes.set_ylim(low - (pad if low < 0.0 else 0.3 * pad), high + pad)
