"""The figure of the sphere's two charts along a run, in the manner of thesis Figures 7.6 to 7.8.

From the top, with a chart shaded where it is not the active one, and broken lines at the switches:

- distance from the surface and its rate (7.6)
- the coordinates of each chart (7.7)
- the torque of one joint by either chart (7.8)
"""

from __future__ import annotations

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.quantity import plural
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.reports.canvas import DASHED, MM, colour_of, draw_over_time, figure, legend_above, page_svg

FIGURE_JOINT = 1
"""The joint of Figure 7.8: the second."""

TORQUE_ROUNDING = 1e-9
"""Torques this share of the largest apart are the same: rounding makes less."""

CHART_CHANNELS = ("chart", "eta1", "eta2", "torque1", "torque2")
"""What set stabilisation by an atlas records: the active chart, and coordinates and torques by either chart."""


def has_charts(recording: Recording) -> bool:
    """Return whether the renderer recorded charts, and a robot followed them."""
    return all(name in recording.channels for name in CHART_CHANNELS)


def charts_words(recording: Recording) -> str:
    """Describe how often the charts take turns, and how far apart their torques are."""
    time, chart = recording.time, recording.channels["chart"]
    # The largest torque difference of any joint at each sample (ticks,), N m.
    differences = np.max(np.abs(recording.channels["torque1"] - recording.channels["torque2"]), axis=1)
    largest = float(np.max(np.abs(recording.channels["joint_torque"])))
    # Negated <=, so that a torque that is not finite counts as disagreeing.
    disagreeing = np.flatnonzero(~(differences <= TORQUE_ROUNDING * largest))
    agreeing = np.delete(differences, disagreeing)
    words = [f"The charts take turns {plural(int(np.count_nonzero(np.diff(chart))), 'time')}."]
    if agreeing.size:
        words.append(f"Their torques agree to {float(agreeing.max()):.1g} N m, of {largest:.3g} N m at the most.")
    if not disagreeing.size:
        return " ".join([*words, "The chart that is not at work does not spike near its pole; in print it does."])
    angle = np.where(chart == 1.0, recording.channels["eta2"][:, 2], recording.channels["eta1"][:, 2])[disagreeing]
    # A chart is singular where its polar angle is 0 or pi: how far the idle one is from the nearer, at the most.
    pole = float(np.degrees(np.max(np.minimum(angle, np.pi - angle))))
    first, last = time[disagreeing[[0, -1]]]
    when = f"at t = {first:.4g} s" if disagreeing.size == 1 else f"between t = {first:.4g} and {last:.4g} s"
    words.append(
        f"Not so in {disagreeing.size} of {time.size} samples, {when}, with the chart that is not at work "
        f"within {pole:.2g}° of its own pole: there they are up to "
        f"{float(np.max(differences[disagreeing])):.3g} N m apart."
    )
    return " ".join(words)


def atlas_svg(recording: Recording, model: Model, *, prefix: str, title: str) -> str:
    """Return the figure as an SVG element for a page, from the signals that set stabilisation by an atlas records."""
    time, chart = recording.time, recording.channels["chart"]
    frame = model.boundary.closest_point(recording.hip)
    # xi_2, the derivative of the distance: the velocity's part along the outward normal.
    rate = np.sum(recording.velocity * frame.normal, axis=1)
    with figure(7.0, 8.0, page=True) as fig:
        distance, first, second, torques = fig.subplots(4, 1, sharex=True)
        fig.subplots_adjust(left=0.12, right=0.89, top=0.97, bottom=0.07, hspace=0.34)
        draw_over_time(distance, recording, MM * frame.distance, "hip", label="ξ₁, distance")
        distance.set_ylabel("distance (mm)")
        rate_axes = distance.twinx()
        draw_over_time(rate_axes, recording, MM * rate, "ihip", label="ξ₂, its rate", linestyle=DASHED)
        rate_axes.set_ylabel("rate (mm/s)")
        for number, axes in enumerate((first, second), start=1):
            eta = np.degrees(recording.channels[f"eta{number}"])
            draw_over_time(axes, recording, eta[:, 0], "one", label="t̂₁, around the axis")
            draw_over_time(axes, recording, eta[:, 2], "two", label="t̂₂, from the axis", linestyle=DASHED)
            axes.set(ylabel=f"chart {number} (°)", yticks=[-180, -90, 0, 90, 180])
            # Shade the stretches in which the other chart is at work.
            for begin, end in runs_of(chart != number):
                axes.axvspan(time[begin], time[min(end, time.size - 1)], color=colour_of("model"), zorder=0)
        for number, role, style in ((1, "hip", "-"), (2, "ihip", DASHED)):
            torque = recording.channels[f"torque{number}"][:, FIGURE_JOINT]
            draw_over_time(torques, recording, torque, role, label=f"by chart {number}", linestyle=style)
        torques.set(ylabel=f"torque {FIGURE_JOINT + 1} (N m)", xlabel="time (s)", xlim=(time[0], time[-1]))
        # What the motors really gave and a margin: a chart that spikes beside its own singularity is cut off.
        motor_torque = recording.channels["joint_torque"][:, FIGURE_JOINT]
        pad = 0.25 * max(np.ptp(motor_torque), 1e-3)
        torques.set_ylim(motor_torque.min() - pad, motor_torque.max() + pad)
        legend_above(distance, rate_axes)
        for axes in (first, second, torques):
            legend_above(axes)
        for axes in (distance, first, second, torques):
            for switch in time[1:][np.diff(chart) != 0.0]:
                axes.axvline(switch, color=colour_of("quiet"), linewidth=0.8, linestyle=(0, (3, 2)), zorder=1)
        return page_svg(fig, prefix=prefix, title=title)
