"""One figure per case, in the manner of thesis Figures 6.19, 6.22, 7.3 and 7.6: all its renderers side by side."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings.recording import Recording
from hapticeval.reports.canvas import MM, drawn, figure, page_svg
from hapticeval.reports.plane import Box, box_round, draw_body, name_axes, shape_of, shown_axes
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROLES = ("hip", "ihip", "one", "two", "mark", "ink", "three")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (5, 1.5, 1.2, 1.5)))
"""Curves of one colour, or that lie on each other, are told apart by these."""

LEAST = 1e-12
"""m: distances below are rounding errors of the simulation, and lie on the floor of the logarithmic panel."""

OUT_OF_SIGHT = 3.0
"""A run that goes this many times as far as the median run leaves the picture, which would show nothing else."""

SLIVER = 3.0
"""Paths this much longer than wide are drawn with a scale of its own for each axis."""

WHOLE = 2.0
"""A solid up to this many times as large as the paths is shown whole."""

Styles = Mapping[str, Mapping[str, Any]]
"""By renderer, how matplotlib draws its curves."""


def comparison_svg(runs: Mapping[str, Recording], model: Model, *, prefix: str, title: str) -> str:
    """Return the figure as an SVG element: where the tools went, how far off the surface, and how fast along it.

    The distance is drawn twice, the second time by its size in powers of ten: what set stabilisation leaves is a
    thousandth of what others do. `runs` maps renderers to their recordings of one case. Of runs in space the first
    panel shows the shadow.
    """
    looks = zip(cycle(ROLES), cycle(DASHES), strict=False)
    styles = {name: {"color": drawn(role), "linestyle": dash} for name, (role, dash) in zip(runs, looks, strict=False)}
    extent = {name: float(np.max(np.abs(recording.hip))) for name, recording in runs.items()}
    in_sight = [name for name, each in extent.items() if each <= OUT_OF_SIGHT * np.median(list(extent.values()))]
    with figure(8.0, 4.7, page=True) as made:
        _draw_paths(made.add_axes((0.08, 0.10, 0.405, 0.79)), runs, styles, model, in_sight)
        off, size, along = panels = [made.add_axes((0.59, low, 0.39, 0.23)) for low in (0.66, 0.38, 0.10)]
        motions = {name: surface_motion(each, model) for name, each in runs.items()}
        forwards = -1.0 if next(iter(motions.values()))[1][0] < 0.0 else 1.0
        for name, (distance, speed) in motions.items():
            sizes = np.maximum(np.abs(distance), LEAST)
            for axes, values in zip(panels, (MM * distance, sizes, forwards * speed), strict=True):
                axes.plot(runs[name].time, values, label=name, **styles[name])
        off.set_ylabel("off the surface\n(mm)")
        size.set_ylabel("the same, size\n(m)")
        along.set(ylabel="speed along it\n(m/s)", xlabel="time (s)")
        seen = MM * np.concatenate([[0.0], *(motions[name][0] for name in in_sight)])
        pad = 0.08 * max(np.ptp(seen), 1e-6)
        off.set_ylim(seen.min() - pad, seen.max() + pad)
        _powers(size, [distance for distance, _ in motions.values()])
        for axes in panels:
            axes.tick_params(labelbottom=axes is along)
            axes.yaxis.set_label_coords(-0.115, 0.5)
            axes.grid(True)
            axes.set_xlim(0.0, max(float(each.time[-1]) for each in runs.values()))
        handles, names = off.get_legend_handles_labels()
        made.legend(handles, names, loc="upper center", ncols=min(4, len(names)), handlelength=2.6)
        return page_svg(made, prefix=prefix, title=title)


def surface_motion(recording: Recording, model: Model) -> tuple[Array, Array]:
    """Return the HIP's signed distance (n,), m, and the speed of its foot along the surface (n,), m/s.

    In the plane the speed has the sign of the tangent; P_T ẏ = (I + n W) ṗ.
    """
    frame = model.boundary.closest_point(recording.hip)
    velocity = recording.velocity
    across = np.sum(velocity * frame.normal, axis=1)[:, None] * frame.normal
    count = recording.hip.shape[1]
    stretch = np.eye(count) + frame.distance[:, None, None] * frame.shape
    foot = np.linalg.solve(stretch, (velocity - across)[..., None])[..., 0]
    if count == 2:
        tangent = np.column_stack([-frame.normal[:, 1], frame.normal[:, 0]])
        return frame.distance, np.sum(foot * tangent, axis=1)
    return frame.distance, np.linalg.norm(foot, axis=1)


def _draw_paths(axes: Axes, runs: Mapping[str, Recording], styles: Styles, model: Model, in_sight: list[str]) -> None:
    shown = shown_axes(np.vstack([each.hip for each in runs.values()]))
    paths = {name: MM * recording.hip[:, list(shown)] for name, recording in runs.items()}
    seen = np.vstack([paths[name] for name in in_sight])
    if model.dimension == 3:
        ends = MM * np.reshape(model.boundary.bounds, (2, 3))[:, list(shown)]
        if np.all(np.ptp(ends, axis=0) < WHOLE * np.ptp(seen, axis=0).max()):
            seen = np.vstack([seen, ends])
    view = _view(seen, shape_of(axes))
    draw_body(axes, model, view, shown)
    for name, path in paths.items():
        axes.plot(*path.T, zorder=3, **styles[name])
    axes.set(xlim=view[::2], ylim=view[1::2], aspect="auto")
    name_axes(axes, shown, model.dimension)


def _view(points: Array, aspect: float) -> Box:
    """What the points cover and a margin, in the shape of the axes unless that would leave a sliver."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = 1.12 * np.maximum(high - low, 1e-3)
    if max(size) > SLIVER * min(size):
        aspect = float(size[0] / size[1])
    return box_round(0.5 * (low + high), size, aspect)


def _powers(axes: Axes, distances: list[Array]) -> None:
    """Whole powers of ten, down to what the run that keeps closest keeps within for half of its time."""
    worst = max(float(np.max(np.abs(each))) for each in distances)
    close = min(float(np.median(np.abs(each))) for each in distances)
    low, high = np.floor(np.log10(max(close, LEAST))), np.ceil(np.log10(max(worst, 10.0 * LEAST)))
    powers = np.arange(low, high + 1.0, max(1.0, np.ceil((high - low) / 4.0)))
    superscripts = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    axes.set(yscale="log", ylim=(10.0**low, 10.0 ** (high + 0.3)))
    axes.set_yticks(10.0**powers, ["10" + str(int(power)).translate(superscripts) for power in powers])
    axes.set_yticks([], minor=True)
