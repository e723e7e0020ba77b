"""The sphere's two charts along a run, in the manner of thesis Figures 7.6 to 7.8.

From the top: distance from the surface and its rate (7.6), the coordinates of each chart (7.7), and the torque of one
joint by either chart (7.8). Where a chart is not the active one it is shaded; broken lines are the switches.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings.recording import Recording
from hapticeval.reports.canvas import MM, figure, page_svg
from hapticeval.reports.figures import BUCKETS, extremes
from hapticeval.reports.svg import drawn
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

JOINT = 1
"""The joint of Figure 7.8: the second."""

AGREE = 1e-9
"""Torques this share of the largest apart are the same: rounding makes less."""

NEEDS = ("chart", "eta1", "eta2", "torque1", "torque2")


def has_charts(recording: Recording) -> bool:
    """Return whether the renderer recorded charts, and a robot followed them."""
    return all(name in recording.channels for name in NEEDS)


def charts_words(recording: Recording) -> str:
    """Describe how often the charts take turns, and how far apart their torques are."""
    time, chart = recording.time, recording.channels["chart"]
    apart = np.max(np.abs(recording.channels["torque1"] - recording.channels["torque2"]), axis=1)
    largest = float(np.max(np.abs(recording.channels["joint_torque"])))
    far = np.flatnonzero(~(apart <= AGREE * largest))
    near = np.delete(apart, far)
    turns = int(np.count_nonzero(np.diff(chart)))
    words = [f"The charts take turns {turns} time{'' if turns == 1 else 's'}."]
    if near.size:
        words.append(f"Their torques agree to {float(near.max()):.1g} N m, of {largest:.3g} N m at the most.")
    if far.size:
        angle = np.where(chart == 1.0, recording.channels["eta2"][:, 2], recording.channels["eta1"][:, 2])[far]
        pole = float(np.degrees(np.max(np.minimum(angle, np.pi - angle))))
        when = (
            f"at t = {time[far[0]]:.4g} s"
            if far.size == 1
            else f"between t = {time[far[0]]:.4g} and {time[far[-1]]:.4g} s"
        )
        words.append(
            f"Not so in {far.size} of {time.size} samples, {when}, with the chart that is not at work "
            f"within {pole:.2g}° of its own pole: there they are up to {float(np.max(apart[far])):.3g} N m apart."
        )
    else:
        words.append("The chart that is not at work does not spike near its pole; in print it does.")
    return " ".join(words)


def atlas_svg(recording: Recording, model: Model, *, prefix: str, title: str) -> str:
    """The figure as an SVG element for a page, from the signals that set stabilisation by an atlas records."""
    time, chart = recording.time, recording.channels["chart"]
    frame = model.boundary.frame(recording.hip)
    rate = np.sum(recording.velocity * frame.normal, axis=1)
    with figure(8.0, 7.2, page=True) as made:
        panels = made.subplots(4, 1, sharex=True)
        made.subplots_adjust(left=0.10, right=0.90, top=0.97, bottom=0.07, hspace=0.30)
        _trace(panels[0], time, MM * frame.distance, "ξ₁, distance", "hip")
        panels[0].set_ylabel("distance (mm)")
        beside = panels[0].twinx()
        _trace(beside, time, MM * rate, "ξ₂, its rate", "ihip", dashes=(0, (4, 1.2)))
        beside.set_ylabel("rate (mm/s)")
        _legend(panels[0], beside)
        for number in (1, 2):
            axes, eta = panels[number], recording.channels[f"eta{number}"]
            _trace(axes, time, np.degrees(eta[:, 0]), "t̂₁, around the axis", "one")
            _trace(axes, time, np.degrees(eta[:, 2]), "t̂₂, from the axis", "two", dashes=(0, (4, 1.2)))
            for begin, end in _stretches(time, chart != number):
                axes.axvspan(begin, end, color=drawn("model"), zorder=0)
            axes.set_ylabel(f"chart {number} (°)")
            axes.set_yticks([-180, -90, 0, 90, 180])
            _legend(axes)
        for number, role, dashes in ((1, "hip", "-"), (2, "ihip", (0, (4, 1.2)))):
            torque = recording.channels[f"torque{number}"][:, JOINT]
            _trace(panels[3], time, torque, f"by chart {number}", role, dashes=dashes)
        panels[3].set_ylabel(f"torque {JOINT + 1} (N m)")
        panels[3].set_ylim(*_sight(recording.channels["joint_torque"][:, JOINT]))
        _legend(panels[3])
        for axes in panels:
            for switch in time[1:][np.diff(chart) != 0.0]:
                axes.axvline(switch, color=drawn("quiet"), linewidth=0.8, linestyle=(0, (3, 2)), zorder=1)
        panels[3].set_xlabel("time (s)")
        panels[3].set_xlim(float(time[0]), float(time[-1]))
        return page_svg(made, prefix=prefix, title=title)


def _trace(axes: Axes, time: Array, values: Array, label: str, role: str, *, dashes: Any = "-") -> None:
    kept = extremes(values, BUCKETS)
    axes.plot(time[kept], values[kept], color=drawn(role), label=label, linestyle=dashes)


def _legend(*axes: Axes) -> None:
    handles, labels = [], []
    for each in axes:
        found = each.get_legend_handles_labels()
        handles += found[0]
        labels += found[1]
    axes[0].legend(
        handles, labels, loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=4, frameon=False, borderaxespad=0.0
    )


def _sight(torque: Array) -> tuple[float, float]:
    """What the motors really gave and a margin: a chart that spikes beside its own singularity is cut off."""
    low, high = float(torque.min()), float(torque.max())
    pad = 0.25 * max(high - low, 1e-3)
    return low - pad, high + pad


def _stretches(time: Array, where: Array) -> Iterator[tuple[float, float]]:
    """Begin and end of every stretch in which `where` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], where.astype(np.float64), [0.0]])))
    for begin, end in edges.reshape(-1, 2):
        yield float(time[begin]), float(time[min(end, time.size - 1)])
